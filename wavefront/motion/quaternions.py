"""Rotations as quaternions (x, y, z, w), and the parts of matrices.

Sources: K. Shoemake, "Animating Rotation with Quaternion Curves", SIGGRAPH 1985 (slerp); N. Higham,
"Computing the Polar Decomposition", SIAM J. Sci. Stat. Comput. 7(4), 1986; S. Shepperd, "Quaternion from
Rotation Matrix", J. Guidance and Control 1(3), 1978.
"""

from __future__ import annotations

from functools import reduce

import numpy as np

from ..arrays.elementary import arctan2, sin_cos
from ..arrays.vec import Doubles

MOST_STEPS = 64  # of Newton's method, which needs ten
SETTLED = 4 * float(np.finfo(np.float64).eps)
PARALLEL = 1e-9  # sine of an angle below which slerp is linear


def rotation_of(quaternions: Doubles) -> Doubles:
    """Return the matrices (n, 3, 3) of quaternions (n, 4) of any length; 0 means no rotation."""
    with np.errstate(over="ignore", divide="ignore"):
        size = (quaternions[:, None] @ quaternions[:, :, None])[:, 0, 0]
        factor = np.where(size > 0, np.sqrt(2 / size), 0)
    x, y, z, w = (quaternions * factor[:, None]).T
    out = np.empty((len(quaternions), 3, 3))
    out[:, 0] = np.stack([1 - y * y - z * z, x * y - z * w, x * z + y * w], 1)
    out[:, 1] = np.stack([x * y + z * w, 1 - x * x - z * z, y * z - x * w], 1)
    out[:, 2] = np.stack([x * z - y * w, y * z + x * w, 1 - x * x - y * y], 1)
    return out


def quaternions_of(rotations: Doubles) -> Doubles:
    """Return the unit quaternions (n, 4) of rotations (n, 3, 3), by the largest of their components."""
    r = rotations
    trace = r[:, 0, 0] + r[:, 1, 1] + r[:, 2, 2]
    squares = np.stack([*(1 + 2 * r[:, i, i] - trace for i in range(3)), 1 + trace], 1)  # times four
    x, y, z = (r[:, (i + 2) % 3, (i + 1) % 3] - r[:, (i + 1) % 3, (i + 2) % 3] for i in range(3))
    xy, yz, zx = (r[:, i, (i + 1) % 3] + r[:, (i + 1) % 3, i] for i in range(3))
    rows = np.stack(
        [
            np.stack([squares[:, 0], xy, zx, x], 1),
            np.stack([xy, squares[:, 1], yz, y], 1),
            np.stack([zx, yz, squares[:, 2], z], 1),
            np.stack([x, y, z, squares[:, 3]], 1),
        ],
        1,
    )
    best = rows[np.arange(len(r)), squares.argmax(1)]
    return best / _length(best)


def slerp(a: Doubles, b: Doubles, part: Doubles) -> Doubles:
    """Return the quaternions (n, 4) between unit ones, the shorter way, at parts (n, 1) in [0, 1]."""
    p, q, t = a.T.copy(), b.T.copy(), part[:, 0]  # contiguous over the quaternions
    x, y, z, w = p * q
    q *= np.where(x + y + z + w < 0, -1.0, 1.0)
    angle = 2 * arctan2(_norm(p - q), _norm(p + q))
    sine = sin_cos(angle)[0]
    apart = sine > PARALLEL
    safe = np.where(apart, sine, 1)
    first = np.where(apart, sin_cos((1 - t) * angle)[0] / safe, 1 - t)
    second = np.where(apart, sin_cos(t * angle)[0] / safe, t)
    between = first * p + second * q
    return np.ascontiguousarray((between / _norm(between)).T)


def _norm(rows: Doubles) -> Doubles:
    """Return the lengths (n,) of quaternions (4, n)."""
    x, y, z, w = rows
    out: Doubles = np.sqrt(x * x + y * y + z * z + w * w)
    return out


def normalized(quaternions: Doubles) -> Doubles:
    """Return quaternions (n, 4) at unit length; zero becomes no rotation."""
    size = _length(quaternions)
    return np.where(size > 0, quaternions / np.where(size > 0, size, 1), [0.0, 0.0, 0.0, 1.0])


def polar(matrices: Doubles) -> tuple[Doubles, Doubles]:
    """Return rotations and stretches (n, 3, 3), whose products are matrices that can be inverted.

    A stretch is symmetric. That of a matrix that mirrors has negative factors along all three axes, so that
    between two of them there is another one that mirrors.
    """
    size = np.abs(matrices).max((1, 2), keepdims=True)
    q = matrices / np.where(determinants(matrices / size)[:, None, None] < 0, -size, size)
    rough = np.ones(len(q), np.bool_)
    for _ in range(MOST_STEPS):
        inverse = cofactors(q[rough]) / determinants(q[rough])[:, None, None]
        scale = np.sqrt(np.sqrt(_squares(inverse) / _squares(q[rough])))
        better = (scale * q[rough] + inverse / scale) / 2
        moved = np.abs(better - q[rough]).max((1, 2))
        q[rough] = better
        rough[rough] = moved > SETTLED
        if not rough.any():
            break
    stretch = times(q.transpose(0, 2, 1), matrices)
    return q, (stretch + stretch.transpose(0, 2, 1)) / 2


def cofactors(matrices: Doubles) -> Doubles:
    """Return the matrices of cofactors (n, 3, 3): the inverse transposes times the determinants."""
    a, b, c = matrices.transpose(1, 0, 2)
    return np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)], 1)


def determinants(matrices: Doubles) -> Doubles:
    """Return the determinants (n,) of matrices (n, 3, 3)."""
    x, y, z = (matrices[:, 0] * np.cross(matrices[:, 1], matrices[:, 2])).T
    return np.asarray(x + y + z)


def times(a: Doubles, b: Doubles) -> Doubles:
    """Return the products of matrices (n, k, k), term by term: the bits of one depend on no other one."""
    out: Doubles = a[:, :, :1] * b[:, :1]
    for i in range(1, a.shape[2]):
        out = out + a[:, :, i : i + 1] * b[:, i : i + 1]
    return out


def _squares(matrices: Doubles) -> Doubles:
    """Return the sums (n, 1, 1) of the squares of the elements of matrices (n, 3, 3)."""
    squares = np.square(matrices).reshape(-1, 9).T
    return np.asarray(reduce(np.add, squares))[:, None, None]  # in order, for the same bits on any machine


def _length(rows: Doubles) -> Doubles:
    """Return the lengths (n, 1) of rows (n, 4)."""
    return _norm(rows.T)[:, None]
