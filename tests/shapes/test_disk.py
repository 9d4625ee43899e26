"""Disks: polygons of exactly the disk's area."""

import numpy as np
import pytest
import strategies
from hypothesis import given
from hypothesis import strategies as st
from scenes import ALBEDO, BLACK, EYE, disk_irradiance, floor, polygon_irradiance, probe
from significance import assert_mean, measure

import wavefront as wf


def areas(mesh: wf.Mesh) -> np.ndarray:
    """Vector areas of the faces, (m, 3)."""
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    return np.cross(b - a, c - a) / 2


@given(strategies.rotations(), st.floats(1e-3, 1e3), st.integers(3, 200))
def test_area_normal_and_center(turn: np.ndarray, radius: float, segments: int) -> None:
    center = turn[0] * 10
    mesh = wf.Disk(center, 7 * turn[1], radius, segments=segments)
    vectors = areas(mesh)
    assert len(vectors) == segments
    assert vectors.sum(0) == pytest.approx(np.pi * radius**2 * turn[1], rel=1e-9, abs=1e-9 * radius**2)
    assert np.linalg.norm(vectors, axis=1).sum() == pytest.approx(np.pi * radius**2, rel=1e-9)
    assert mesh.vertices[:-1].mean(0) == pytest.approx(center, abs=1e-9 * (10 + radius))


@pytest.mark.parametrize("segments", [16, 64, 1000])
def test_rim_is_near_the_circle(segments: int) -> None:
    """Corners outside, edges inside, both by at most 0.34·(π/segments)² of the radius."""
    mesh = wf.Disk((0, 0, 0), (0, 0, 1), 1.0, segments=segments)
    corner = np.linalg.norm(mesh.vertices[0])
    edge = corner * np.cos(np.pi / segments)
    assert 1 < corner < 1 + 0.34 * (np.pi / segments) ** 2
    assert 1 - 0.34 * (np.pi / segments) ** 2 < edge < 1
    if segments == 64:
        assert max(corner - 1, 1 - edge) < 1e-3


@pytest.mark.parametrize(("offset", "expected"), [(0, 0.628319), (1, 0.460076), (3, 0.080608)])
def test_polygon_gives_the_irradiance_of_the_disk(offset: float, expected: float) -> None:
    """Case 3 of the reference values, without noise: Lambert's formula of the polygon."""
    mesh = wf.Disk((0, 2, 0), (0, -1, 0), 1.0)
    assert disk_irradiance(1, 2, offset) == pytest.approx(expected, abs=1e-6)
    exact = polygon_irradiance(mesh.vertices[:-1] - (offset, 0, 0))
    assert exact == pytest.approx(disk_irradiance(1, 2, offset), rel=1e-5)


@pytest.mark.parametrize("integrator", ["naive", "direct_simple", "direct_mis", "full"])
@pytest.mark.parametrize("offset", [1, 0, 3])
@pytest.mark.first(4)
def test_disk_light(integrator: str, offset: float) -> None:
    """Case 3 of the reference values, rendered."""
    light = wf.Disk((0, 2, 0), (0, -1, 0), 1.0, material=BLACK, emission=1.0)
    scene = wf.Scene([floor(), light], camera=probe((offset, 0, 0), np.add((offset, 0, 0), EYE)))
    spp = {"naive": 4096 if offset < 3 else 8192}.get(integrator, 1024)
    mean = measure(scene, spp, integrator=integrator, max_bounces=1)
    assert_mean(mean, disk_irradiance(1, 2, offset) * ALBEDO / np.pi, 0.01)


def test_uvs_span_the_square() -> None:
    """The middle of the picture is the middle of the disk, and its rim touches the sides."""
    mesh = wf.Disk((0, 0, 0), (0, 0, 1), 2.0, segments=4)
    assert mesh.uvs[-1].tolist() == [0.5, 0.5]
    assert mesh.uvs[:-1] == pytest.approx(np.array([[1, 0.5], [0.5, 1], [0, 0.5], [0.5, 0]]))
    across = mesh.vertices[mesh.faces[0, 1]], mesh.vertices[mesh.faces[0, 2]]
    assert np.cross(*across)[2] > 0


BAD = {
    "center": ({"center": (0, np.nan, 0)}, r"disk: center\[1\] is nan; it must be finite"),
    "normal zero": ({"normal": (0, 0, 0)}, r"disk: normal is \[0.0, 0.0, 0.0\]; it must not be zero"),
    "radius": ({"radius": 0}, "disk: radius is 0; it must be above 0"),
    "segments two": ({"segments": 2}, "disk: segments is 2; it must be a whole number from 3 to 65536"),
    "segments fraction": ({"segments": 8.5}, "disk: segments is 8.5; it must be a whole number"),
    "emission": ({"emission": -1}, "disk: emission is -1; it must be at least 0"),
    "material": ({"material": 3}, "disk: material must be a material"),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_arguments_are_named(name: str) -> None:
    change, message = BAD[name]
    with pytest.raises(wf.SceneError, match=message):
        wf.Disk(**{"center": (0, 0, 0), "normal": (0, 1, 0), "radius": 1.0, **change})
