"""Files of grids that libraries read: NRRD, VTK's images and OpenVDB."""

from __future__ import annotations

import bz2
import math
import sys
import zlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from importlib.util import find_spec
from io import BytesIO
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from ..arrays.vec import Doubles, Floats, f4
from ..codecs.budget import Budget
from ..core.errors import SceneError, warn_caller
from ..core.suggestions import did_you_mean

Found = TypeVar("Found")
NUMBERS_OF_VDB = ("bool", "int32", "int64", "half", "float", "double", "vec3s", "vec3d", "vec3i")
ELSEWHERE = ("data file", "datafile", "byte skip", "byteskip", "line skip", "lineskip")  # fields of NRRD


def chosen(arrays: Mapping[str, Found], name: str | None) -> Found:
    """Return the array of a name, or the only one."""
    if name is None and len(arrays) == 1:
        return next(iter(arrays.values()))
    if name is None or name not in arrays:
        listed = ", ".join(sorted(arrays)) or "none"
        raise SceneError(f"name is {name!r}; the arrays are {listed}{did_you_mean(name, list(arrays))}")
    return arrays[name]


def placed(edges: ArrayLike, corner: ArrayLike) -> Doubles:
    """Return the matrix (4, 4) from the unit cube to the box at a corner, with edges (3, 3) in columns."""
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = edges, corner
    return matrix


def read_nrrd(path: str, data: bytes, budget: Budget, name: str | None = None) -> tuple[Floats, Doubles]:
    """Return the grid of a file that holds its header and its data (definition of NRRD, version 5)."""
    try:
        import nrrd
    except ImportError as error:
        raise SceneError("files of NRRD need pynrrd: pip install pynrrd") from error
    file = BytesIO(data)
    try:
        header = nrrd.read_header(file)
        if away := [field for field in ELSEWHERE if field in header]:
            raise SceneError(f"has the field {away[0]!r}; data are read right behind the header alone")
        sizes = [int(size) for size in header["sizes"]]
        if min(sizes) < 1:
            raise SceneError(f"has the sizes {sizes}")
        needed = math.prod(sizes) * 8
        budget.charge("the grid", 2 * needed)
        unpack: Any = {"gz": zlib.decompressobj(31), "bz": bz2.BZ2Decompressor()}.get(header["encoding"][:2])
        if unpack is not None:
            file, header["encoding"] = BytesIO(unpack.decompress(file.read(), needed)), "raw"
            if not unpack.eof:
                raise SceneError("has packed data that end early, or hold more than the header claims")
        values = nrrd.read_data(header, file, index_order="C")
    except SceneError:
        raise
    except MemoryError:
        raise
    except Exception as error:  # of any type: a header without an end raises StopIteration
        raise SceneError(f"is not read by pynrrd: {str(error) or type(error).__name__}") from error
    colors = len(sizes) - 3
    if colors == 1 and "space directions" in header:
        colors = 1 if np.isnan(header["space directions"][0]).all() else -1
    if colors not in (0, 1):
        raise SceneError(f"has the sizes {sizes}; they must be x, y and z, or c, x, y and z")
    size = sizes[colors:]
    if "space directions" in header:
        steps = np.asarray(header["space directions"], np.float64)[colors:].T
        corner = header["space origin"] - steps.sum(1) / 2 if "space origin" in header else np.zeros(3)
        return np.ascontiguousarray(values, f4), placed(steps * size, corner)
    along = header.get("spacings")
    step = 1 / np.array(size) if along is None else np.nan_to_num(np.asarray(along[colors:], float), nan=1.0)
    low = np.nan_to_num(np.asarray(header.get("axis mins", np.zeros(len(sizes)))[colors:], float))
    return np.ascontiguousarray(values, f4), placed(np.diag(step * size), low)


def read_vti(path: str, data: bytes, budget: Budget, name: str | None = None) -> tuple[Floats, Doubles]:
    """Return an array of VTK's ImageData: values of points or cells, each the center of a voxel."""
    try:
        from vtkmodules.util.numpy_support import vtk_to_numpy
        from vtkmodules.vtkCommonCore import vtkObject
        from vtkmodules.vtkCommonDataModel import vtkDataObject as keys
        from vtkmodules.vtkCommonExecutionModel import vtkStreamingDemandDrivenPipeline as pipeline
        from vtkmodules.vtkIOXML import vtkXMLImageDataReader
    except ImportError as error:
        raise SceneError("files of VTK need vtk: pip install vtk") from error

    reader: Any = vtkXMLImageDataReader()  # its stubs know no bytes
    reader.SetReadFromInputString(True)
    reader.SetInputString(data)
    shown = vtkObject.GetGlobalWarningDisplay()
    vtkObject.GlobalWarningDisplayOff()  # errors are ours, in place of lines on standard error
    try:
        reader.UpdateInformation()
        about = reader.GetOutputInformation(0)
        extent = about.Get(pipeline.WHOLE_EXTENT())
        if extent is None:
            raise SceneError("is no ImageData of VTK in XML")
        kinds = (
            ("points", 1, about.Get(keys.POINT_DATA_VECTOR()), reader.GetPointDataArraySelection()),
            ("cells", 0, about.Get(keys.CELL_DATA_VECTOR()), reader.GetCellDataArraySelection()),
        )
        arrays = {}
        for kind, more, vector, selection in kinds:
            selection.DisableAllArrays()
            for i in range(vector.GetNumberOfInformationObjects() if vector else 0):
                field = vector.GetInformationObject(i)
                entry = field.Get(keys.FIELD_NAME()), field.Get(keys.FIELD_NUMBER_OF_COMPONENTS())
                arrays[entry[0] if entry[0] not in arrays else f"{entry[0]} of {kind}"] = (
                    more,
                    selection,
                    *entry,
                )
        more, selection, called, channels = chosen(arrays, name)
        size = [high - low + more for low, high in zip(extent[::2], extent[1::2], strict=True)]
        if min(size) < 1 or channels < 1:
            raise SceneError(f"has {size} {'points' if more else 'cells'} of {channels} components")
        budget.charge("the grid", 2 * 8 * math.prod(size) * channels)
        selection.EnableArray(called)
        reader.Update()
    finally:
        vtkObject.SetGlobalWarningDisplay(shown)
    image = reader.GetOutput()
    array = (image.GetPointData() if more else image.GetCellData()).GetArray(called)
    if reader.GetErrorCode() or array is None or array.GetNumberOfTuples() != math.prod(size):
        raise SceneError(f"is damaged: vtk does not read the array {called!r}")
    values = vtk_to_numpy(array).reshape(*size[::-1], channels)
    steps = np.array(about.Get(keys.DIRECTION()) or np.eye(3)).reshape(3, 3) * about.Get(keys.SPACING())
    corner = np.array(about.Get(keys.ORIGIN())) + steps @ (np.array(extent[::2]) - more / 2)
    return np.ascontiguousarray(values[..., 0] if channels == 1 else values, f4), placed(steps * size, corner)


def read_vdb(path: str, data: bytes, budget: Budget, name: str | None = None) -> tuple[Floats, Doubles]:
    """Return a grid of OpenVDB, in a box around the active voxels of all grids with its transform.

    The box has a margin of one voxel, so that interpolation fades to the background there.
    """
    vdb = openvdb()
    try:
        grids, _ = vdb.readAll(path)
    except Exception as error:  # of the library, of any type
        raise SceneError(f"is not read by OpenVDB: {error}") from error
    named: dict[str, Any] = {}
    for grid in grids:
        named[grid.name if grid.name not in named else f"{grid.name}[{len(named)}]"] = grid
    grid = chosen(named, name)
    kind = grid.valueTypeName
    if kind not in NUMBERS_OF_VDB or not grid.transform.isLinear:
        raise SceneError(
            f"grid {grid.name!r} has values of type {kind} and the transform {grid.transform.typeName}; "
            f"the types are {', '.join(NUMBERS_OF_VDB)}, and transforms are linear"
        )
    steps, origin = _map(grid)
    boxes = [
        other.evalActiveVoxelBoundingBox()
        for other in grids
        if other.activeVoxelCount()
        and other.transform.isLinear
        and np.array_equal(_map(other)[0], steps)
        # the same voxels at the same places
        and np.array_equal(_map(other)[1], origin)
    ]
    if not boxes:
        raise SceneError(f"grid {grid.name!r} has no active voxels")
    low, high = (extreme([box[i] for box in boxes], 0) for i, extreme in ((0, np.min), (1, np.max)))
    low, size = low - 1, [int(length) for length in high - low + 3]
    channels = (3,) if kind.startswith("vec3") else ()
    budget.charge("the grid", 2 * 8 * math.prod((*size, *channels)))
    values = np.zeros((*size, *channels), f4)
    grid.copyToArray(values, ijk=tuple(int(index) for index in low))
    if np.any(grid.background):
        warn_caller(
            f"{path}: grid {grid.name!r} has the background {grid.background} in all space; it is kept up to "
            f"one voxel around the active ones"
        )
    order = (2, 1, 0, 3)[: values.ndim]
    return np.ascontiguousarray(values.transpose(order)), placed(steps * size, origin + steps @ (low - 0.5))


def _map(grid: Any) -> tuple[Doubles, Doubles]:
    """Return the matrix (3, 3) and the offset (3,) from the voxels of a grid of OpenVDB to the world."""
    origin = np.array(grid.transform.indexToWorld((0, 0, 0)))
    ends = [grid.transform.indexToWorld(end) for end in ((1, 0, 0), (0, 1, 0), (0, 0, 1))]
    return np.array(ends).T - origin[:, None], origin


def openvdb() -> Any:
    """Return the Python module of OpenVDB: installed as such, by Debian, or within Blender's bpy."""
    for module in ("openvdb", "pyopenvdb"):
        if find_spec(module) is not None:
            return __import__(module)
    bpy = find_spec("bpy")
    if bpy is not None and bpy.origin is not None:
        with _also_from(sorted(Path(bpy.origin).parent.glob("*/python/**/site-packages"))):
            if find_spec("openvdb") is not None:
                return __import__("openvdb")
    raise SceneError(
        "files of OpenVDB need its Python module: openvdb of conda-forge, python3-openvdb of Debian, or "
        "pip install bpy"
    )


@contextmanager
def _also_from(folders: list[Path]) -> Iterator[None]:
    """Search modules in some folders after all others."""
    before = list(sys.path)
    sys.path += map(str, folders)
    try:
        yield
    finally:
        sys.path[:] = before
