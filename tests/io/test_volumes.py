"""Grids in files."""

import struct

import numpy as np
import pytest

import wavefront as wf

GRID = np.random.default_rng(1).random((4, 3, 2)).astype(np.float32)


def vol(grid: np.ndarray, box=(0, 1, 2, 3, 4, 5), version: int = 3, kind: int = 1, width: int | None = None):
    """A volume as Mitsuba writes it."""
    depth, height, columns = grid.shape[:3]
    channels = grid.shape[3] if grid.ndim == 4 else 1
    header = struct.pack("<3sB5i6f", b"VOL", version, kind, width or columns, height, depth, channels, *box)
    return header + grid.astype("<f4").tobytes()


def test_arrays_of_numpy(tmp_path) -> None:
    np.save(tmp_path / "a.npy", GRID.astype(float))
    np.savez_compressed(tmp_path / "b.npz", density=GRID, temperature=2 * GRID)
    np.savez(tmp_path / "c.npz", GRID)
    for path, name in (("a.npy", None), ("b.npz", "density"), ("c.npz", None)):
        values, transform = wf.load_grid(tmp_path / path, name)
        assert values.dtype == np.float32
        np.testing.assert_array_equal(values, GRID)
        np.testing.assert_array_equal(transform, np.eye(4))
    np.testing.assert_array_equal(wf.load_grid(str(tmp_path / "b.npz"), "temperature")[0], 2 * GRID)


@pytest.mark.parametrize("channels", [1, 3])
def test_volumes_of_mitsuba(tmp_path, channels: int) -> None:
    grid = np.stack([GRID] * channels, -1) * np.arange(1, channels + 1, dtype=np.float32)
    (tmp_path / "a.vol").write_bytes(vol(grid))
    values, transform = wf.load_grid(tmp_path / "a.vol")
    np.testing.assert_array_equal(values, grid[..., 0] if channels == 1 else grid)
    medium = wf.GridMedium(GRID, transform, absorption=1)
    assert medium.bounds.tolist() == [[0, 1, 2], [3, 4, 5]]


@pytest.mark.parametrize(
    ("name", "data", "message"),
    [
        ("a.vol", b"VOL", "is no volume of Mitsuba"),
        ("a.vol", b"X" * 80, "is no volume of Mitsuba"),
        ("a.vol", vol(GRID, version=2), "has version 2 and values of type 1; 3 and 1"),
        ("a.vol", vol(GRID, kind=3), "values of type 3"),
        ("a.vol", vol(GRID)[:-4], "claims 2 × 3 × 4 voxels of 1 channels; 92 bytes follow"),
        ("a.vol", vol(GRID, width=2**31 - 1), "claims 2147483647 × 3"),
        ("a.vol", vol(GRID, width=-1), "claims -1 × 3"),
        ("a.npy", b"\x93NUMPY", "a.npy"),
        ("a.npz", b"PK", "a.npz"),
        ("a.dat", b"", "a.dat: the extension"),
    ],
)
def test_damaged_files_are_named(tmp_path, name: str, data: bytes, message: str) -> None:
    (tmp_path / name).write_bytes(data)
    with pytest.raises(wf.SceneError, match=message):
        wf.load_grid(tmp_path / name)


def test_what_arrays_must_be(tmp_path) -> None:
    np.save(tmp_path / "flat.npy", GRID[0])
    np.save(tmp_path / "text.npy", np.full((1, 1, 1), "x"))
    np.save(tmp_path / "objects.npy", np.array([[[None]]]), allow_pickle=True)
    np.savez(tmp_path / "two.npz", density=GRID, flame=GRID)
    header = (tmp_path / "flat.npy").read_bytes().replace(b"(3, 2)", b"(9**9)")
    (tmp_path / "claims.npy").write_bytes(header)
    for name in ("flat.npy", "text.npy", "objects.npy", "claims.npy"):
        with pytest.raises(wf.SceneError, match=name):
            wf.load_grid(tmp_path / name)
    with pytest.raises(wf.SceneError, match="the arrays are density, flame"):
        wf.load_grid(tmp_path / "two.npz")
    with pytest.raises(wf.SceneError, match="did you mean"):
        wf.load_grid(tmp_path / "two.npz", "densty")


def test_limits(tmp_path) -> None:
    np.save(tmp_path / "a.npy", GRID)
    np.savez_compressed(tmp_path / "a.npz", np.zeros((256, 256, 256), np.uint8))
    with pytest.raises(wf.SceneError, match="10"):
        wf.load_grid(tmp_path / "a.npy", limits=wf.LoadLimits(file_bytes=10))
    with pytest.raises(wf.SceneError, match="memory_bytes"):
        wf.load_grid(tmp_path / "a.npz", limits=wf.LoadLimits(memory_bytes=1))
    with pytest.raises(wf.SceneError, match=r"limits is 3; it must be a wf\.LoadLimits"):
        wf.load_grid(tmp_path / "a.npy", limits=3)
