"""Files of grids for media: arrays of NumPy, Mitsuba's volumes, and files that libraries read."""

from __future__ import annotations

import math
import struct
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ..arrays.vec import Doubles, Floats, f4
from ..codecs.budget import Budget, in_memory
from ..codecs.npz import read_array, read_arrays
from ..core.errors import SceneError, one_of
from ..core.files import extension_of, path_name, read_bytes
from ..core.suggestions import suggests_keywords
from .sources import LoadLimits, PathLike, checked_limits
from .volume_libraries import chosen, placed, read_nrrd, read_vdb, read_vti

VOL_HEADER = struct.Struct("<3sBiiiii6f")
VOL_FLOAT32 = 1


@suggests_keywords
def load_grid(
    path: PathLike, name: str | None = None, *, limits: LoadLimits | None = None
) -> tuple[Floats, Doubles]:
    """Return a grid of numbers in a file, for `GridMedium`, and where it is.

    Parameters
    ----------
    path
        A file .npy or .npz of NumPy, with axes z, y, x and perhaps colors; .vol of Mitsuba; .nrrd, through
        pynrrd; .vti, ImageData of VTK, through vtk; or .vdb, through the Python module of OpenVDB.
    name
        Which array or grid of the file; not needed where it has one alone.
    limits
        Of the size of the file, and of the memory that it may take.

    Returns
    -------
    values
        (z, y, x) float32, or (z, y, x, c) with c > 1 channels.
    transform
        (4, 4) from the unit cube to the box of the grid, scene units; the unit cube itself where the file
        has none. Values lie at the centers of its voxels.

    Raises
    ------
    SceneError
        If the file is missing, of another kind, damaged or too large, or has no such array, or if the library
        that reads it is not installed.

    Examples
    --------
    >>> np.save("smoke.npy", np.ones((8, 4, 4), np.float32))
    >>> density, transform = wf.load_grid("smoke.npy")
    >>> smoke = wf.GridMedium(density, transform, albedo=0.5)
    """
    limits = checked_limits(limits)
    _reader(path)
    data = read_bytes(path, limits.file_bytes)
    budget = Budget(limits.pixels, limits.memory_bytes)
    budget.add_file(len(data))
    with in_memory(path):
        return parsed_grid(path_name(path), data, budget, name)


def parsed_grid(path: str, data: bytes, budget: Budget, name: str | None = None) -> tuple[Floats, Doubles]:
    """Return the grid of a file that has been read; see `load_grid`."""
    try:
        return _reader(path)(path, data, budget, name)
    except MemoryError:
        raise
    except Exception as error:  # libraries raise errors of any type on damaged data
        raise SceneError(f"{path}: {str(error) or type(error).__name__}") from error


def _reader(path: PathLike) -> Callable[[str, bytes, Budget, str | None], tuple[Floats, Doubles]]:
    """Return the function that reads files of a path's extension."""
    extension = extension_of(path, tuple(READERS))
    one_of(f"{path_name(path)}: the extension", extension, tuple(READERS))
    return READERS[extension]


def _npy(path: str, data: bytes, budget: Budget, name: str | None) -> tuple[Floats, Doubles]:
    """Return the array of a file."""
    return _as_grid(read_array(data, budget)), np.eye(4)


def _npz(path: str, data: bytes, budget: Budget, name: str | None) -> tuple[Floats, Doubles]:
    """Return an array of an archive."""
    return _as_grid(chosen(read_arrays(data, budget), name)), np.eye(4)


def _as_grid(values: NDArray[np.generic]) -> Floats:
    if values.dtype.kind not in "fiub" or values.ndim not in (3, 4) or not values.size:
        raise SceneError(
            f"is {values.dtype} of shape {values.shape}; it must be numbers (z, y, x) or (z, y, x, c)"
        )
    return np.ascontiguousarray(values, f4)


def _vol(path: str, data: bytes, budget: Budget, name: str | None) -> tuple[Floats, Doubles]:
    """Return the grid of a volume of Mitsuba, version 3 (documentation of its plugin gridvolume)."""
    if len(data) < VOL_HEADER.size or data[:3] != b"VOL":
        raise SceneError("is no volume of Mitsuba: it does not begin with VOL and a header")
    _, version, kind, width, height, depth, channels, *box = VOL_HEADER.unpack_from(data)
    if version != 3 or kind != VOL_FLOAT32:
        raise SceneError(f"has version {version} and values of type {kind}; 3 and 1, float32, are read")
    size, bytes_left = (width, height, depth, channels), len(data) - VOL_HEADER.size
    if min(size) < 1 or math.prod(size) * 4 != bytes_left:
        raise SceneError(
            f"claims {width} × {height} × {depth} voxels of {channels} channels; {bytes_left} bytes follow"
        )
    budget.charge("the grid", bytes_left)
    values = np.frombuffer(data, "<f4", offset=VOL_HEADER.size).reshape(depth, height, width, channels)
    grid = values[..., 0] if channels == 1 else values
    low, high = np.array(box, np.float64).reshape(2, 3)
    return np.ascontiguousarray(grid, f4), placed(np.diag(high - low), low)


READERS = {
    ".npy": _npy,
    ".npz": _npz,
    ".vol": _vol,
    ".nrrd": read_nrrd,
    ".vti": read_vti,
    ".vdb": read_vdb,
}
