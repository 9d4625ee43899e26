"""Files of grids for media: arrays of NumPy, and Mitsuba's volumes."""

from __future__ import annotations

import math
import struct
import zipfile
from io import BytesIO

import numpy as np
from numpy.typing import NDArray

from ..arrays.vec import Doubles, Floats, f4
from ..codecs.budget import Budget
from ..codecs.npz import MAX_HEADER, checked_shape, read_arrays
from ..core.errors import SceneError, one_of
from ..core.files import extension_of, path_name, read_bytes
from ..core.suggestions import did_you_mean
from .sources import LoadLimits, PathLike, checked_limits

EXTENSIONS = (".npy", ".npz", ".vol")
VOL_HEADER = struct.Struct("<3sBiiiii6f")
VOL_FLOAT32 = 1
UNIT = np.array([(0.0, 0, 0), (1, 1, 1)])


def load_grid(
    path: PathLike, name: str | None = None, *, limits: LoadLimits | None = None
) -> tuple[Floats, Doubles]:
    """Return a grid of numbers in a file, for `GridMedium`, and the corners of its box.

    Parameters
    ----------
    path
        A file .npy or .npz of NumPy, with axes z, y, x and perhaps colors; or .vol of Mitsuba.
    name
        Which array of an npz file; not needed where it has one alone.
    limits
        Of the size of the file, and of the memory that it may take.

    Returns
    -------
    values
        (z, y, x) float32, or (z, y, x, c) with c > 1 channels.
    box
        (2, 3) lower and upper corner, scene units; those of the unit cube where the file has none.

    Raises
    ------
    SceneError
        If the file is missing, of another kind, damaged or too large, or has no such array.

    Examples
    --------
    >>> np.save("smoke.npy", np.ones((8, 4, 4), np.float32))
    >>> density, box = wf.load_grid("smoke.npy")
    >>> smoke = wf.GridMedium(density, 2 * box, albedo=0.5)
    """
    limits = checked_limits(limits)
    text = path_name(path)
    one_of(f"{text}: the extension", extension_of(path, EXTENSIONS), EXTENSIONS)
    data = read_bytes(path, limits.file_bytes)
    budget = Budget(limits.pixels, limits.memory_bytes)
    budget.add_file(len(data))
    return parsed_grid(text, data, budget, name)


def parsed_grid(path: str, data: bytes, budget: Budget, name: str | None = None) -> tuple[Floats, Doubles]:
    """Return the grid of a file that has been read; see `load_grid`."""
    try:
        if path.lower().endswith(".vol"):
            return _vol(data, budget)
        if path.lower().endswith(".npz"):
            return _as_grid(_chosen(read_arrays(data, budget), name)), UNIT
        budget.charge("the array", 2 * math.prod(checked_shape("array", data[:MAX_HEADER], len(data))) * 4)
        return _as_grid(np.lib.format.read_array(BytesIO(data), allow_pickle=False)), UNIT
    except (SceneError, ValueError, OSError, zipfile.BadZipFile) as error:
        raise SceneError(f"{path}: {error}") from error


def _chosen(arrays: dict[str, NDArray[np.generic]], name: str | None) -> NDArray[np.generic]:
    """Return the array of a name, or the only one."""
    if name is None and len(arrays) == 1:
        return next(iter(arrays.values()))
    if name is None or name not in arrays:
        listed = ", ".join(sorted(arrays)) or "none"
        raise SceneError(f"name is {name!r}; the arrays are {listed}{did_you_mean(name, list(arrays))}")
    return arrays[name]


def _as_grid(values: NDArray[np.generic]) -> Floats:
    if values.dtype.kind not in "fiub" or values.ndim not in (3, 4) or not values.size:
        raise SceneError(
            f"is {values.dtype} of shape {values.shape}; it must be numbers (z, y, x) or (z, y, x, c)"
        )
    return np.ascontiguousarray(values, f4)


def _vol(data: bytes, budget: Budget) -> tuple[Floats, Doubles]:
    """Return the grid of a volume of Mitsuba, version 3 (documentation of its plugin gridvolume)."""
    if len(data) < VOL_HEADER.size or data[:3] != b"VOL":
        raise SceneError("is no volume of Mitsuba: it does not begin with VOL and a header")
    _, version, kind, width, height, depth, channels, *box = VOL_HEADER.unpack_from(data)
    if version != 3 or kind != VOL_FLOAT32:
        raise SceneError(f"has version {version} and values of type {kind}; 3 and 1, float32, are read")
    size, there = (width, height, depth, channels), len(data) - VOL_HEADER.size
    if min(size) < 1 or math.prod(size) * 4 != there:
        raise SceneError(
            f"claims {width} × {height} × {depth} voxels of {channels} channels; {there} bytes follow"
        )
    budget.charge("the grid", there)
    values = np.frombuffer(data, "<f4", offset=VOL_HEADER.size).reshape(depth, height, width, channels)
    grid = values[..., 0] if channels == 1 else values
    return np.ascontiguousarray(grid, f4), np.array(box, np.float64).reshape(2, 3)
