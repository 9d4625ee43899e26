"""Algebra of (3, n) float32 vectors.

Every sum is written out by component, so that the bits of one column never depend on how many
columns stand beside it.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.floating[Any]]  # float32; the stubs lose the width in arithmetic
Doubles = NDArray[np.float64]
Ints = NDArray[np.intp]
Bools = NDArray[np.bool_]

Lanes: TypeAlias = Ints | slice  # some columns, by index or from one to another; all of them: ALL

f4 = np.float32
ZERO, INF = f4(0), f4(np.inf)
TWO_PI, INV_PI, INV_TWO_PI, INV_FOUR_PI = f4(2 * np.pi), f4(1 / np.pi), f4(0.5 / np.pi), f4(0.25 / np.pi)
BELOW_ONE = f4(1 - 2.0**-24)  # the largest number below 1
FLOAT32_MAX = float(np.finfo(f4).max)
TINY = f4(1e-30)  # in place of a divisor that is 0 or less: products of it with usual numbers are finite
ALL = slice(None)


Array = TypeVar("Array", bound=NDArray[Any])


def take(a: Array, lanes: Lanes) -> Array:
    """Columns `lanes` of (..., n), all in [0, n); views, not copies, for a slice and of broadcasts."""
    if isinstance(lanes, slice):
        return a[..., lanes]  # type: ignore[return-value]
    if a.strides[-1]:
        # "wrap" is a sixth faster than the check of each index that is the default
        return a.take(lanes, -1, mode="wrap")  # type: ignore[return-value]
    if lanes.size <= a.shape[-1]:
        return a[..., : lanes.size]  # type: ignore[return-value]
    return np.broadcast_to(a[..., :1], (*a.shape[:-1], lanes.size))  # type: ignore[return-value]


def put(a: Floats, lanes: Lanes, values: Floats) -> None:
    """Write values (c, k) over columns `lanes` of (c, n); by index three times as fast as at once."""
    for row, new in zip(a, values, strict=True):
        row[lanes] = new


def broadcast(value: Any, n: int) -> NDArray[Any]:
    """One value for n lanes, (n,), read-only: free to keep, and free to gather."""
    one = np.asarray(value)
    out = np.ndarray(n, one.dtype, one, strides=(0,))  # a third of the time of np.broadcast_to
    out.flags.writeable = False
    return out


def dot(a: Floats, b: Floats) -> Floats:
    """Dot product of (3, n) columns -> (n,)."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: Floats, b: Floats) -> Floats:
    """Cross product of (3, n) columns -> (3, n)."""
    out = np.empty(np.broadcast_shapes(a.shape, b.shape), np.result_type(a, b))
    np.subtract(a[1] * b[2], a[2] * b[1], out=out[0])
    np.subtract(a[2] * b[0], a[0] * b[2], out=out[1])
    np.subtract(a[0] * b[1], a[1] * b[0], out=out[2])
    return out


def length(a: Floats) -> Floats:
    """Euclidean length of (3, n) columns -> (n,)."""
    return np.sqrt(dot(a, a))


def normalize(a: Floats) -> Floats:
    """Scale (3, n) columns to unit length; a zero column stays zero."""
    size = length(a)
    size += size == 0
    return a / size


def highest(a: Floats) -> Floats:
    """Largest component of (3, n) columns -> (n,); NaN where one is. Faster than `a.max(0)`."""
    return np.maximum(np.maximum(a[0], a[1]), a[2])


def interpolate(a: Floats, b: Floats, c: Floats, b1: Floats, b2: Floats) -> Floats:
    """Interpolate values at the corners of triangles, (..., n), with barycentric weights b1, b2 (n,)."""
    return a * (f4(1) - b1 - b2) + b * b1 + c * b2


def luminance(rgb: Floats | Sequence[Floats]) -> Floats:
    """Relative luminance of linear Rec. 709 RGB, (3, n) -> (n,) (ITU-R BT.709)."""
    return f4(0.2126) * rgb[0] + f4(0.7152) * rgb[1] + f4(0.0722) * rgb[2]


def positive(x: Floats) -> Floats:
    """max(x, 0) of numbers (n,); NaN stays. Twice as fast as `np.maximum` with a scalar."""
    return x.clip(ZERO, INF)


def signs(x: Floats) -> Floats:
    """1 with the sign of each number (n,), -1 for -0. Twice as fast as `np.copysign`."""
    bits = x.view(np.uint32) & np.uint32(0x80000000)
    bits |= np.uint32(0x3F800000)
    return bits.view(f4)


def column(value: object) -> Floats:
    """Three numbers as a (3, 1) float32 column."""
    return np.asarray(value, f4).reshape(3, 1)
