"""Operations on (3, n) float32 vectors.

Every sum is written out by component, so that the bits of a column do not depend on the number of columns.

Examples
--------
>>> a, b = np.float32([[1], [2], [3]]), np.float32([[0], [1], [0]])
>>> wf.vec.dot(a, b)
array([2.], dtype=float32)
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.floating[Any]]  # float32; NumPy's stubs do not keep the width in arithmetic
Doubles = NDArray[np.float64]
Bytes = NDArray[np.uint8]
Ints = NDArray[np.intp]
Bools = NDArray[np.bool_]

Lanes: TypeAlias = Ints | slice  # some columns, by indices or by a slice; ALL is every column

f4 = np.float32
ZERO, INF = f4(0), f4(np.inf)
TWO_PI, INV_PI, INV_TWO_PI, INV_FOUR_PI = f4(2 * np.pi), f4(1 / np.pi), f4(0.5 / np.pi), f4(0.25 / np.pi)
BELOW_ONE = f4(1 - 2.0**-24)  # the largest number below 1
FLOAT32_MAX = float(np.finfo(f4).max)
TINY = f4(1e-30)  # in place of a divisor that is 0 or less: products of it with usual numbers are finite
ALL = slice(None)


Array = TypeVar("Array", bound=NDArray[Any])


def take(a: Array, lanes: Lanes) -> Array:
    """Return columns `lanes` of (..., n), all in [0, n); a view for a slice or a `broadcast` array."""
    if isinstance(lanes, slice):
        return a[..., lanes]  # type: ignore[return-value]
    if a.strides[-1]:
        # "wrap" is a sixth faster than the default, which checks each index.
        return a.take(lanes, -1, mode="wrap")  # type: ignore[return-value]
    if lanes.size <= a.shape[-1]:
        return a[..., : lanes.size]  # type: ignore[return-value]
    return np.broadcast_to(a[..., :1], (*a.shape[:-1], lanes.size))  # type: ignore[return-value]


def put(a: Floats, lanes: Lanes, values: Floats) -> None:
    """Write values (c, k) to columns `lanes` of (c, n); row by row, which is three times as fast."""
    for row, new in zip(a, values, strict=True):
        row[lanes] = new


def add_to_slots(rows: Floats, slot: Ints, values: Floats) -> None:
    """Add values (3, k) to the slots (k,), in which numbers may repeat, of rows (3, n)."""
    for row, channel in zip(rows, values, strict=True):  # a row at a time: much faster
        np.add.at(row, slot, channel)


def broadcast(value: Any, n: int) -> NDArray[Any]:
    """Return a read-only array (n,) of one value, which needs no memory and no time to gather."""
    one = np.asarray(value)
    out = np.ndarray(n, one.dtype, one, strides=(0,))  # takes a third of the time of np.broadcast_to
    out.flags.writeable = False
    return out


def dot(a: Floats, b: Floats) -> Floats:
    """Return dot products (n,) of vectors (3, n)."""
    out = a[0] * b[0]
    out += a[1] * b[1]  # in place, which takes three quarters of the time
    out += a[2] * b[2]
    return out


def cross(a: Floats, b: Floats) -> Floats:
    """Return cross products (3, n) of vectors (3, n)."""
    out = np.empty(np.broadcast_shapes(a.shape, b.shape), np.result_type(a, b))
    np.subtract(a[1] * b[2], a[2] * b[1], out=out[0])
    np.subtract(a[2] * b[0], a[0] * b[2], out=out[1])
    np.subtract(a[0] * b[1], a[1] * b[0], out=out[2])
    return out


def length(a: Floats) -> Floats:
    """Return the Euclidean lengths (n,) of vectors (3, n)."""
    return np.sqrt(dot(a, a))


def normalize(a: Floats) -> Floats:
    """Return vectors (3, n) scaled to unit length; zero vectors stay zero."""
    size = length(a)
    size += size == 0
    return a / size


def highest(a: Floats) -> Floats:
    """Return the largest components (n,) of vectors (3, n), NaN if one is; faster than `a.max(0)`."""
    return np.maximum(np.maximum(a[0], a[1]), a[2])


def interpolate(a: Floats, b: Floats, c: Floats, b1: Floats, b2: Floats) -> Floats:
    """Return values at the corners of triangles (..., n), interpolated by weights b1, b2 (n,)."""
    return a * (f4(1) - b1 - b2) + b * b1 + c * b2


def luminance(rgb: Floats | Sequence[Floats]) -> Floats:
    """Return the relative luminance (n,) of linear Rec. 709 RGB (3, n) (ITU-R BT.709)."""
    return f4(0.2126) * rgb[0] + f4(0.7152) * rgb[1] + f4(0.0722) * rgb[2]


def positive(x: Floats) -> Floats:
    """Return max(x, 0) of numbers (n,), NaN for NaN; twice as fast as `np.maximum` with a scalar."""
    return x.clip(ZERO, INF)


def signs(x: Floats) -> Floats:
    """Return 1 with the sign of each number (n,), -1 for -0; twice as fast as `np.copysign`."""
    bits = x.view(np.uint32) & np.uint32(0x80000000)
    bits |= np.uint32(0x3F800000)
    return bits.view(f4)


def spans(total: int, size: int) -> Iterator[slice]:
    """Yield slices of at most `size` that cover `total` columns, so that temporary arrays stay small."""
    for start in range(0, total, size):
        yield slice(start, min(start + size, total))


def column(value: object) -> Floats:
    """Return three numbers as a (3, 1) float32 column."""
    return np.asarray(value, f4).reshape(3, 1)


def distinct(values: Ints) -> list[int]:
    """Return the distinct values in rising order, like np.unique, which would import numpy.ma."""
    ordered = np.sort(values)
    return ordered[np.diff(ordered, prepend=-1) > 0].tolist()
