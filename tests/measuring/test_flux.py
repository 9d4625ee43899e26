"""measure_flux(): view factors of public catalogues, conservation of power, faces and sides."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import scenes
from significance import Mean

import wavefront as wf

QUIET: dict[str, Any] = {"progress": False, "workers": 1}
BLACK = wf.Diffuse(0)


def opposed(x: float, y: float) -> float:
    """View factor of equal, parallel, opposed rectangles; sides over distance.

    Source: J. R. Howell, A Catalog of Radiation Heat Transfer Configuration Factors, C-11.
    """
    a, b = 1 + x * x, 1 + y * y
    terms = np.log(np.sqrt(a * b / (a + b - 1)))
    terms += x * np.sqrt(b) * np.arctan(x / np.sqrt(b)) + y * np.sqrt(a) * np.arctan(y / np.sqrt(a))
    return float(2 / (np.pi * x * y) * (terms - x * np.arctan(x) - y * np.arctan(y)))


def at_right_angles(h: float, w: float) -> float:
    """View factor of rectangles with a common edge; h and w are the other sides over it (ibid., C-14)."""
    h2, w2 = h * h, w * w
    root = np.sqrt(h2 + w2)
    angles = w * np.arctan(1 / w) + h * np.arctan(1 / h) - root * np.arctan(1 / root)
    logs = np.log((1 + w2) * (1 + h2) / (1 + h2 + w2))
    logs += w2 * np.log(w2 * (1 + h2 + w2) / ((1 + w2) * (h2 + w2)))
    logs += h2 * np.log(h2 * (1 + h2 + w2) / ((1 + h2) * (h2 + w2)))
    return float((angles + logs / 4) / (np.pi * w))


def lamp(*rectangle: Any) -> wf.Mesh:
    return wf.Rectangle(*rectangle, material=BLACK, emission=1)


def plates() -> tuple[Any, Any, float]:
    """What shines, what receives, and the part of the power that arrives."""
    return (
        lamp((0, 0, 0), (2, 0, 0), (0, 1, 0)),
        wf.Rectangle((0, 0, 0.8), (0, 1, 0), (2, 0, 0)),
        opposed(2.5, 1.25),
    )


def corner() -> tuple[Any, Any, float]:
    return (
        lamp((0, 0, 0), (2, 0, 0), (0, 1, 0)),
        wf.Rectangle((0, 0, 0), (0, 0, 3), (2, 0, 0)),
        at_right_angles(1.5, 0.5),
    )


def ball_and_disk() -> tuple[Any, Any, float]:
    """Source: ibid., sphere to coaxial disk: (1 − 1/√(1 + R²))/2, R the radius over the distance."""
    ball = wf.Sphere((0, -1.2, 0), 0.5, material=BLACK, emission=1)
    return ball, scenes.disk(0.9, 0.0, 1024), (1 - 1 / np.sqrt(1 + (0.9 / 1.2) ** 2)) / 2


def area(shape: Any) -> float:
    if isinstance(shape, wf.Sphere):
        return float(4 * np.pi * shape.radius**2)
    a, b, c = shape.vertices[shape.faces].transpose(1, 0, 2)
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)


def test_formulas_are_those_of_the_catalogue() -> None:
    """Values of textbooks: unit cubes have 0.19982 and 0.20004."""
    assert opposed(1, 1) == pytest.approx(0.19982, abs=5e-6)
    assert at_right_angles(1, 1) == pytest.approx(0.20004, abs=5e-6)


@pytest.mark.parametrize("make", [plates, corner, ball_and_disk])
@pytest.mark.parametrize(
    ("spp", "error"),
    [(512, 5e-4), pytest.param(1 << 15, 5e-5, marks=pytest.mark.slow)],
    ids=["quick", "long"],
)
def test_view_factors(make: Any, spp: int, error: float) -> None:
    shining, receiving, factor = make()
    receiving.material, receiving.emission = BLACK, None
    found = wf.measure_flux([shining, receiving], [receiving] * 64, spp=spp, **QUIET)
    mean = Mean.of(found.value.mean(1, dtype=np.float64) / (np.pi * area(shining)))
    assert mean.error < error
    assert abs(mean.value - factor) < max(4 * mean.error, 2e-6)
    assert spp < 1 << 15 or abs(mean.value - factor) < 1e-4


def cell(albedo: float) -> tuple[wf.Scene, list[Any], float]:
    """A closed room with a lamp, two boxes and a ball; its shapes, and the power that it emits."""
    room = scenes.cornell_box().shapes
    front = wf.Rectangle((-1, -1, 1), (0, 2, 0), (2, 0, 0))
    ball = wf.Sphere((0.3, 0, 0.3), 0.3)
    room = [*room, front, ball]
    for each in room:
        each.material = wf.Material(wf.Diffuse(albedo), emission=each.emission)
    power = np.pi * 0.46 * 0.38 * np.array((18.387, 13.9873, 6.75357))
    return wf.Scene(room), room, power.mean()


@pytest.mark.parametrize("spp", [64, pytest.param(8192, marks=pytest.mark.slow)])
def test_a_closed_room_absorbs_what_it_emits(spp: int) -> None:
    """And what leaves all surfaces arrives at some."""
    albedo = 0.6
    scene, shapes, power = cell(albedo)
    sums = {}
    for kind in ("arriving", "leaving"):
        found = wf.measure_flux(scene, shapes, kind=kind, spp=spp, max_bounces=64, **QUIET)
        error = np.sqrt((found.standard_error.astype(float) ** 2).sum(0)).mean()
        sums[kind] = found.value.sum(0, dtype=float).mean(), error
    arriving, leaving = sums["arriving"], sums["leaving"]
    assert arriving[1] < 0.2 * arriving[0] / np.sqrt(spp)
    assert abs((1 - albedo) * arriving[0] - power) < 4 * (1 - albedo) * arriving[1]
    assert abs(arriving[0] - leaving[0]) < 4 * np.hypot(arriving[1], leaving[1])


def test_what_leaves_a_lamp_is_its_power() -> None:
    ball, panel = wf.Sphere((0, 0, 0), 0.4, material=BLACK, emission=2), lamp((2, 0, 0), (1, 0, 0), (0, 1, 0))
    found = wf.measure_flux([ball, panel], [ball, panel], kind="leaving", spp=64, **QUIET)
    np.testing.assert_allclose(found.value[:, 0], [2 * np.pi * 4 * np.pi * 0.16, np.pi], rtol=1e-5)
    assert not wf.measure_flux([ball, panel], panel, kind="leaving", side="back", spp=64, **QUIET).value.any()
    around = wf.Sphere((0.2, 0.3, 0), 3, material=BLACK)
    arriving = wf.measure_flux([ball, around], around, side="back", spp=1024, **QUIET)
    assert abs(arriving.value[0, 0] - found.value[0, 0]) < 4 * arriving.standard_error[0, 0]
    assert arriving.standard_error[0, 0] < 0.01 * found.value[0, 0]


def test_faces_add_up_to_their_mesh() -> None:
    """A mesh of faces of all sizes, one of none, at the same points as each of its faces."""
    rng = np.random.default_rng(0)
    vertices = np.concatenate([rng.uniform(-1, 1, (30, 2)) * (1, 0.1), np.zeros((30, 1))], 1)
    faces = np.concatenate([rng.permutation(30).reshape(10, 3) for _ in range(3)])
    faces[4] = faces[4][[0, 0, 1]]
    with pytest.warns(UserWarning, match="zero area"):
        mesh = wf.Mesh(vertices, faces, material=BLACK)
    sky = wf.Scene(mesh, wf.Environment((1, 2, 3)))
    each, whole = (wf.measure_flux(sky, mesh, faces=many, spp=16, **QUIET) for many in (True, False))
    assert each.value.shape == (30, 3)
    assert not each.value[4].any()
    np.testing.assert_allclose(each.value.sum(0), whole.value[0], rtol=1e-5)


def test_points_are_spread_evenly() -> None:
    """A light beside a plate brings to each part what it brings to the whole."""
    panel = scenes.panel((0.2, -0.3), (1.0, 0.9), 0.7)
    floor, parts = scenes.floor(BLACK, 1), []
    for k in range(4):
        x, z = k % 2 - 1.0, k // 2 - 1.0
        parts.append(wf.Rectangle((x, 0, z), (0, 0, 1), (1, 0, 0)))
    four = wf.Mesh(
        np.concatenate([each.vertices for each in parts]),
        np.concatenate([each.faces + 4 * k for k, each in enumerate(parts)]),
    )
    apart, whole, joined = (
        wf.measure_flux([panel, floor], each, spp=4096, **QUIET) for each in (parts, floor, four)
    )
    for found in (whole, joined):
        errors = [found.standard_error[:, 0], apart.standard_error[:, 0]]
        error = np.sqrt(sum((each**2).sum() for each in errors))
        assert error < 0.003 * found.value[0, 0]
        assert abs(found.value[0, 0] - apart.value[:, 0].sum()) < 4 * error


def test_instances_and_names_are_shapes() -> None:
    mesh = wf.Rectangle((0, 0, 0), (1, 0, 0), (0, 1, 0), material=BLACK, name="plate")
    scene = wf.Scene(
        [wf.Instance(mesh, np.diag([2.0, 3, 1, 1])), mesh.translated((9, 0, 0))], wf.Environment(1)
    )
    found = wf.measure_flux(scene, "plate", spp=4, **QUIET)
    np.testing.assert_allclose(found.value[:, 0], np.pi * np.array([6, 1]), rtol=1e-5)
    scaled = wf.Scene([shape.scaled(2.0**40) for shape in scene.shapes], scene.lights)
    found = wf.measure_flux(scaled, "plate", spp=4, **QUIET)
    np.testing.assert_allclose(found.value[:, 0], np.pi * np.array([6, 1]) * 4.0**40, rtol=1e-5)


def test_flux_is_saved_and_merged(tmp_path: Any) -> None:
    scene, shapes, _ = cell(0.3)
    parts = [wf.measure_flux(scene, shapes, samples=each, **QUIET) for each in (range(8), range(8, 16))]
    parts[0].save(tmp_path / "a.npz")
    whole = wf.measure_flux(scene, shapes, spp=16, **QUIET)
    merged = wf.Measurement.load(tmp_path / "a.npz").merge(parts[1])
    assert merged.value.tobytes() == whole.value.tobytes()
    assert merged.kind == "arriving flux"


@pytest.mark.parametrize(
    ("shapes", "settings", "message"),
    [
        ([], {}, "shapes is empty"),
        ("wall", {}, "shapes: name is 'wall'"),
        ([3], {}, "shapes has 3; power is measured at meshes and spheres"),
        (wf.Cylinders([(0, 0, 0)], [(0, 0, 1)], 1), {}, "power is measured at meshes and spheres"),
        ("ball", {"faces": True}, "faces is True; that is for one shape, which is a mesh"),
        ("ball", {"kind": "absorbed"}, "kind is 'absorbed'"),
        ("ball", {"side": "top"}, "side is 'top'"),
    ],
)
def test_wrong_arguments_are_named(shapes: Any, settings: dict[str, Any], message: str) -> None:
    with pytest.raises(wf.SceneError, match=message):
        wf.measure_flux(wf.Scene([wf.Sphere((0, 0, 0), 1, name="ball")]), shapes, **settings)
