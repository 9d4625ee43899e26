"""Rotations as quaternions (x, y, z, w), and the parts of matrices.

Sources: K. Shoemake, "Animating Rotation with Quaternion Curves", SIGGRAPH 1985 (slerp); N. Higham,
"Computing the Polar Decomposition", SIAM J. Sci. Stat. Comput. 7(4), 1986; S. Shepperd, "Quaternion from
Rotation Matrix", J. Guidance and Control 1(3), 1978.
"""

from __future__ import annotations

from functools import reduce

import numpy as np

from ..arrays.elementary import arctan2, sin
from ..arrays.vec import Doubles, Ints

MOST_STEPS = 64  # of Newton's method, which needs ten
SETTLED = 4 * float(np.finfo(np.float64).eps)
PARALLEL = 1e-9  # sine of an angle below which slerp is linear


def rotation_of(quaternions: Doubles) -> Doubles:
    """Return the matrices (n, 3, 3) of quaternions (n, 4) of any length; 0 means no rotation."""
    rows = quaternions.T
    with np.errstate(over="ignore", divide="ignore"):
        size = _dot(rows, rows)
        factor = np.where(size > 0, np.sqrt(2 / size), 0)
    x, y, z, w = rows * factor
    out = np.empty((3, 3, len(quaternions)))
    xx, yy, zz, xy, xz, yz, xw, yw, zw = x * x, y * y, z * z, x * y, x * z, y * z, x * w, y * w, z * w
    out[0] = 1 - yy - zz, xy - zw, xz + yw
    out[1] = xy + zw, 1 - xx - zz, yz - xw
    out[2] = xz - yw, yz + xw, 1 - xx - yy
    return out.transpose(2, 0, 1)


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


class Arcs:
    """The shorter turns from some unit quaternions to others.

    Parameters
    ----------
    a, b
        (n, 4).
    """

    def __init__(self, a: Doubles, b: Doubles) -> None:
        self._first, self._second = a.T.copy(), b.T.copy()  # contiguous over the quaternions
        self._second *= np.where(_dot(self._first, self._second) < 0, -1.0, 1.0)
        self._angle = 2 * arctan2(_norm(self._first - self._second), _norm(self._first + self._second))
        self._sine = sin(self._angle)

    def at(self, part: Doubles, arc: Ints | None = None) -> Doubles:
        """Return the quaternions (4, n) after parts (n,) in [0, 1] of arcs: all of them, or by index."""
        p, q, angle, sine = self._first, self._second, self._angle, self._sine
        if arc is not None:
            p, q, angle, sine = p.take(arc, 1), q.take(arc, 1), angle.take(arc), sine.take(arc)
        apart, left = sine > PARALLEL, 1 - part
        safe = np.where(apart, sine, 1)
        between = np.where(apart, sin(left * angle) / safe, left) * p
        between += np.where(apart, sin(part * angle) / safe, part) * q
        between /= _norm(between)
        return between


def slerp(a: Doubles, b: Doubles, part: Doubles) -> Doubles:
    """Return the quaternions (n, 4) between unit ones, the shorter way, at parts (n, 1) in [0, 1]."""
    return Arcs(a, b).at(part[:, 0]).T


def _dot(a: Doubles, b: Doubles) -> Doubles:
    """Return the scalar products (n,) of quaternions (4, n), each added up in order."""
    x, y, z, w = a * b
    out: Doubles = x + y + z + w
    return out


def _norm(rows: Doubles) -> Doubles:
    """Return the lengths (n,) of quaternions (4, n)."""
    return np.sqrt(_dot(rows, rows))


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
