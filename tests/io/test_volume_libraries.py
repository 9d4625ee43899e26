"""Grids in files that libraries read: what one of their writers wrote is where it was."""

import itertools

import numpy as np
import pytest
from inside import openvdb

import wavefront as wf

GRID = np.random.default_rng(1).random((4, 3, 2)).astype(np.float32)  # z, y, x
COLORS = np.random.default_rng(2).random((4, 3, 2, 3)).astype(np.float32)
SHEARED = np.array([(0.1, 0.05, 0), (0, 0.2, 0), (0, 0, 0.3)])  # a column for each axis


def center(transform: np.ndarray, grid: np.ndarray, x: int, y: int, z: int) -> np.ndarray:
    """Where the center of a voxel is."""
    part = (np.array((x, y, z)) + 0.5) / grid.shape[2::-1]
    return transform[:3, :3] @ part + transform[:3, 3]


@pytest.fixture
def vdb():
    try:
        return openvdb()
    except wf.SceneError:
        pytest.skip("no Python module of OpenVDB")


@pytest.mark.parametrize("encoding", ["raw", "gzip", "bzip2", "ascii"])
@pytest.mark.parametrize("grid", [GRID, COLORS], ids=["numbers", "colors"])
def test_nrrd(tmp_path, grid: np.ndarray, encoding: str) -> None:
    nrrd = pytest.importorskip("nrrd")
    directions = SHEARED.T if grid.ndim == 3 else np.vstack([np.full(3, np.nan), SHEARED.T])
    header = {"encoding": encoding, "space dimension": 3, "space origin": (1, 2, 3)}
    nrrd.write(str(tmp_path / "a.nrrd"), grid, {**header, "space directions": directions}, index_order="C")
    values, transform = wf.load_grid(tmp_path / "a.nrrd")
    assert values.dtype == np.float32
    np.testing.assert_allclose(values, grid, 1e-7)
    for place in ((0, 0, 0), (1, 2, 3)):
        np.testing.assert_allclose(center(transform, grid, *place), (1, 2, 3) + SHEARED @ place)
    wf.GridMedium(values, transform, absorption=1)


def test_nrrd_with_spacings_or_nothing(tmp_path) -> None:
    nrrd = pytest.importorskip("nrrd")
    nrrd.write(str(tmp_path / "a.nrrd"), GRID, {"spacings": (1.0, 2.0, 3.0)}, index_order="C")
    assert wf.load_grid(tmp_path / "a.nrrd")[1].tolist() == np.diag((2.0, 6, 12, 1)).tolist()
    nrrd.write(str(tmp_path / "b.nrrd"), GRID.astype(">i2"), index_order="C")
    np.testing.assert_allclose(wf.load_grid(tmp_path / "b.nrrd")[1], np.eye(4))


def test_nrrd_that_is_not_read(tmp_path) -> None:
    nrrd = pytest.importorskip("nrrd")
    nrrd.write(str(tmp_path / "a.nrrd"), GRID, index_order="C")
    whole = (tmp_path / "a.nrrd").read_bytes()
    nrrd.write(str(tmp_path / "a.nrrd"), GRID, {"encoding": "raw"}, index_order="C")
    raw = (tmp_path / "a.nrrd").read_bytes()
    for data, message in (
        (b"NRRD", "a.nrrd"),
        (b"", "a.nrrd: "),
        (raw.replace(b"dimension: 3", b"dimension: x"), "a.nrrd: is not read by pynrrd"),
        (whole[:-8], "a.nrrd: has packed data that end early"),
        (raw[:-8], "a.nrrd: is not read by pynrrd"),
        (whole.replace(b"sizes: 2 3 4", b"sizes: 2 3 -4"), "sizes"),
        (whole.replace(b"sizes: 2 3 4", b"sizes: 2 3 99999999999"), "memory"),
        (whole.replace(b"encoding:", b"data file: /etc/hostname\nencoding:"), "field 'data file'"),
    ):
        (tmp_path / "a.nrrd").write_bytes(data)
        with pytest.raises(wf.SceneError, match=message):
            wf.load_grid(tmp_path / "a.nrrd")
    nrrd.write(str(tmp_path / "a.nrrd"), GRID[0], index_order="C")
    with pytest.raises(wf.SceneError, match="must be x, y and z"):
        wf.load_grid(tmp_path / "a.nrrd")


def vti(path, mode: str = "Appended", compressor: str = "ZLib", cells: bool = False) -> None:
    """Write a grid of numbers and one of colors as VTK does."""
    models, files = (pytest.importorskip(f"vtkmodules.{each}") for each in ("vtkCommonDataModel", "vtkIOXML"))
    support = pytest.importorskip("vtkmodules.util.numpy_support")
    image, more = models.vtkImageData(), int(cells)
    image.SetExtent(5, 6 + more, -1, 1 + more, 0, 3 + more)
    image.SetOrigin(1, 2, 3)
    image.SetSpacing(0.1, 0.2, 0.3)
    image.SetDirectionMatrix((0, -1, 0, 1, 0, 0, 0, 0, 1))
    data = image.GetCellData() if cells else image.GetPointData()
    for name, grid in (("density", GRID), ("color", COLORS.astype(float))):
        held = support.numpy_to_vtk(grid.reshape(24, -1), deep=True)
        held.SetName(name)
        data.AddArray(held)
    writer = files.vtkXMLImageDataWriter()
    writer.SetFileName(str(path))
    writer.SetInputData(image)
    getattr(writer, f"SetDataModeTo{mode}")()
    getattr(writer, f"SetCompressorTypeTo{compressor}")()
    writer.Write()


@pytest.mark.parametrize("cells", [False, True], ids=["points", "cells"])
def test_vti(tmp_path, cells: bool) -> None:
    for mode, compressor in itertools.product(("Ascii", "Binary", "Appended"), ("None", "ZLib", "LZMA")):
        vti(tmp_path / "a.vti", mode, compressor, cells)
        values, transform = wf.load_grid(tmp_path / "a.vti", "density")
        np.testing.assert_array_equal(values, GRID)
        np.testing.assert_array_equal(wf.load_grid(tmp_path / "a.vti", "color")[0], COLORS)
        half = 0.5 * cells
        for x, y, z in ((0, 0, 0), (1, 2, 3)):
            there = (1 - 0.2 * (y - 1 + half), 2 + 0.1 * (x + 5 + half), 3 + 0.3 * (z + half))
            np.testing.assert_allclose(center(transform, GRID, x, y, z), there)
    with pytest.raises(wf.SceneError, match="the arrays are color, density"):
        wf.load_grid(tmp_path / "a.vti")


def test_vti_that_is_not_read(tmp_path, capfd) -> None:
    vti(tmp_path / "a.vti")
    whole = (tmp_path / "a.vti").read_bytes()
    for data, message in (
        (b"junk", "a.vti: is no ImageData"),
        (whole[:-200], "a.vti: is damaged"),
        (whole.replace(b"5 6 -1 1 0 3", b"5 6 -1 1 0 999999999"), "memory"),
    ):
        (tmp_path / "a.vti").write_bytes(data)
        with pytest.raises(wf.SceneError, match=message):
            wf.load_grid(tmp_path / "a.vti", "color")
    assert capfd.readouterr() == ("", "")


def test_vdb(tmp_path, vdb) -> None:
    """Leaves and tiles, on both sides of zero; grids that lie alike come in one box."""
    density, heat, other = vdb.FloatGrid(), vdb.FloatGrid(), vdb.Vec3SGrid()
    density.name, heat.name, other.name = "density", "temperature", "color"
    matrix = np.eye(4)
    matrix[:3, :3], matrix[3, :3] = SHEARED.T, (1, 2, 3)
    density.copyFromArray(np.ascontiguousarray(GRID.T), ijk=(-1, -12, 7))
    density.transform = vdb.createLinearTransform(matrix.tolist())
    heat.fill((0, -16, 0), (15, 15, 15), 700.0)  # of whole leaves, which become tiles
    heat.transform = density.transform
    other.copyFromArray(np.ascontiguousarray(COLORS.transpose(2, 1, 0, 3)))
    vdb.write(str(tmp_path / "a.vdb"), grids=[density, heat, other])

    values, transform = wf.load_grid(tmp_path / "a.vdb", "density")
    assert values.shape == (18, 34, 19)  # x from -2 to 16, y from -17 to 16, z from -1 to 16
    np.testing.assert_array_equal(values[8:12, 5:8, 1:3], GRID)
    assert np.count_nonzero(values) == GRID.size
    for voxel in ((-1, -12, 7), (0, -10, 10)):
        place = center(transform, values, *(np.array(voxel) - (-2, -17, -1)))
        np.testing.assert_allclose(place, (1, 2, 3) + SHEARED @ voxel, atol=1e-12)
    hot, same = wf.load_grid(tmp_path / "a.vdb", "temperature")
    np.testing.assert_array_equal(same, transform)
    assert (hot[1:-1, 1:-1, 2:-1] == 700).all()
    assert np.count_nonzero(hot) == 16 * 32 * 16
    colors = wf.load_grid(tmp_path / "a.vdb", "color")[0]
    np.testing.assert_array_equal(colors[1:-1, 1:-1, 1:-1], COLORS)
    wf.GridMedium(values, transform, absorption=1, temperature=hot)


def test_vdb_that_is_not_read(tmp_path, vdb) -> None:
    def written(grid, name="density"):
        grid.name = name
        vdb.write(str(tmp_path / "a.vdb"), grids=[grid])
        return tmp_path / "a.vdb"

    with pytest.raises(wf.SceneError, match="no active voxels"):
        wf.load_grid(written(vdb.FloatGrid()))
    wide = vdb.FloatGrid()
    for corner in (0, 1 << 14):
        wide.fill((corner,) * 3, (corner,) * 3, 1.0)
    with pytest.raises(wf.SceneError, match="memory"):
        wf.load_grid(written(wide))
    full = vdb.FloatGrid(2.0)
    full.copyFromArray(GRID)
    with pytest.warns(UserWarning, match=r"'density' has the background 2\.0"):
        assert (wf.load_grid(written(full))[0][0] == 2).all()
    with pytest.raises(wf.SceneError, match="the arrays are density"):
        wf.load_grid(tmp_path / "a.vdb", "smoke")
    (tmp_path / "a.vdb").write_bytes(b"junk" * 40)
    with pytest.raises(wf.SceneError, match=r"a\.vdb: is not read by OpenVDB"):
        wf.load_grid(tmp_path / "a.vdb")


def test_libraries_that_are_missing_are_named(tmp_path, missing) -> None:
    missing("nrrd", "vtkmodules", "openvdb", "pyopenvdb", "bpy")
    for kind, message in (("nrrd", "install pynrrd"), ("vti", "install vtk"), ("vdb", "install bpy")):
        (tmp_path / f"a.{kind}").write_bytes(b"x")
        with pytest.raises(wf.SceneError, match=rf"a\.{kind}: files of .* need .*{message}"):
            wf.load_grid(tmp_path / f"a.{kind}")
