"""Scenes of extreme size look like the same scenes at an ordinary one."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from inside import MAX_RADIUS, MIN_RADIUS, length_factor, scaled_shapes

import wavefront as wf

SIDE = 12
BUMPS = np.random.default_rng(1).random((8, 8))


def room(s: float, instances: float | None = None, projection: str = "lens") -> wf.Scene:
    """A box with everything in it that has a length, and all lengths times s.

    `instances` is the factor of lengths in the frame of the mesh that is placed; by default s too.
    """

    def wall(corner: Any, u: Any, v: Any, **more: Any) -> wf.Mesh:
        return wf.Rectangle(*(np.array(x, float) * s for x in (corner, u, v)), **more)

    white = wf.Diffuse(0.7)
    bumpy = wf.Material(wf.Diffuse(0.6), normal_map=wf.BumpMap(BUMPS, 0.05 * s))
    glass = wf.Material(wf.Dielectric(1.5), interior=wf.Medium((2 / s, 1 / s, 0.2 / s)))
    leaf = wf.Material(wf.Principled(0.8, transmission=0.5), interior=wf.Medium(0.5 / s))
    shapes: list[Any] = [
        wall((-1, -1, -1), (0, 0, 2), (2, 0, 0), material=bumpy),
        wall((-1, 1, -1), (2, 0, 0), (0, 0, 2), material=white),
        wall((-1, -1, -1), (2, 0, 0), (0, 2, 0), material=white),
        wall((-1, -1, -1), (0, 2, 0), (0, 0, 2), material=wf.Diffuse((0.7, 0.1, 0.1))),
        wall((-0.3, 0.98, -0.3), (0.6, 0, 0), (0, 0, 0.6), emission=6),
        wf.Sphere(np.array((-0.4, -0.6, 0)) * s, 0.4 * s, material=glass),
        wf.Sphere(np.array((0.5, 0.5, 0)) * s, 0.1 * s, emission=3),
        wf.Mesh(np.array([[0, -0.9, 0.5], [0.8, -0.9, 0.6], [0.4, -0.2, 0.5]]) * s, [[0, 1, 2]], emission=2),
    ]
    own = s if instances is None else instances
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]]) * own * 0.5
    tetrahedron = wf.Mesh(corners, [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]], material=leaf)
    for k in range(3):
        transform = np.eye(4)
        transform[:3, :3] *= (0.5 + 0.2 * k) * (s / own)
        transform[:3, 3] = np.array((0.2 + 0.2 * k, -1 + 0.2 * k, -0.5 + 0.3 * k)) * s
        shapes.append(wf.Instance(tetrahedron, transform))
    lights = [
        wf.PointLight(np.array((0, 0.5, 0.5)) * s, (s * s, s * s, 0)),
        wf.SpotLight(np.array((0.5, 0.8, 0.5)) * s, 3 * s * s, target=np.array((0, -1, 0)) * s),
        wf.DirectionalLight((0, -1, -1), 0.5),
        wf.Environment(0.2),
    ]
    eye, size = np.array((0.2, 0.1, 3.4)) * s, (SIDE, SIDE)
    if projection == "lens":
        camera = wf.Camera.look_at(eye, (0, 0, 0), size=size, aperture=0.1 * s, focus=3 * s)
    else:
        camera = wf.Camera.orthographic(eye, (0, 0, 0), height=2.2 * s, size=size)
    return wf.Scene(shapes, lights, camera)


def picture(scene: wf.Scene, accel: str) -> np.ndarray:
    return wf.render(scene, 4, accel=accel, max_bounces=4, workers=1, progress=False).rgb


@pytest.fixture(params=["numpy", "embree"])
def accel(request: pytest.FixtureRequest, shared_instances: None) -> str:
    if request.param == "embree":
        pytest.importorskip("embreex")
    return str(request.param)


@pytest.mark.parametrize("projection", ["lens", "orthographic"])
@pytest.mark.first(2)
def test_a_power_of_two_in_size_changes_no_bit(accel: str, projection: str) -> None:
    unit = picture(room(1.0, projection=projection), accel)
    assert unit.mean() > 0.1
    for exponent in (-120, -22, 24, 95):
        scaled = picture(room(2.0**exponent, projection=projection), accel)
        assert np.array_equal(scaled, unit), f"2^{exponent}"


def test_any_other_size_changes_rounding_only(accel: str) -> None:
    unit = picture(room(1.0), accel)
    for exponent in (-30, -20, -14, 13, 19, 30):
        scaled = picture(room(10.0**exponent), accel)
        off = np.abs(scaled - unit) / (unit + 0.01)
        # a rounding may send a path elsewhere: of 576 samples, few
        assert np.median(off) < 1e-5, f"1e{exponent}"
        assert (off > 1e-3).any(2).sum() <= 3, f"1e{exponent}"
        assert scaled.mean() == pytest.approx(unit.mean(), rel=0.02), f"1e{exponent}"


def test_meshes_of_instances_may_have_any_size_of_their_own(accel: str) -> None:
    unit = picture(room(1.0), accel)
    for exponent in (-100, -50, 50, 100):
        assert np.array_equal(picture(room(1.0, instances=2.0**exponent), accel), unit), f"2^{exponent}"


def test_ordinary_scenes_stay_as_they_are() -> None:
    scene = room(1.0)
    shapes = scaled_shapes(scene.shapes, 1.0)
    assert all(one is other for one, other in zip(shapes, scene.shapes, strict=True))
    for size in (MIN_RADIUS, 1e-3, 1.0, 1e5, MAX_RADIUS, 0.0):
        assert length_factor(size) == 1
    for size in (1e-38, 1e-30, MIN_RADIUS**1.01, MAX_RADIUS**1.01, 1e30, 5e38):
        assert 1 <= size * length_factor(size) < 2
        assert np.frexp(length_factor(size))[0] == 0.5  # a power of two


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            lambda scene: setattr(scene, "camera", wf.Camera.look_at((0, 0, 1e20), (0, 0, 0))),
            r"Camera origin is \[0.0, 0.0, 1e\+20\], 1e\+20 from the center of .* at most 1.15e\+18",
        ),
        (
            lambda scene: scene.lights.append(wf.PointLight((0, -1e19, 0), 1)),
            r"PointLight position is .*, 1e\+19 from the center of the scene; .* at most 1.15e\+18",
        ),
        (
            lambda scene: scene.lights.append(wf.SpotLight((0, 9e18, 0), 1, target=(0, 0, 0))),
            r"SpotLight position is .*, 9e\+18 from the center",
        ),
    ],
)
def test_what_is_too_far_away_is_refused(change: Any, message: str) -> None:
    scene = room(1.0)
    change(scene)
    with pytest.raises(wf.SceneError, match=message):
        picture(scene, "numpy")


def test_a_light_too_strong_for_the_size_of_the_scene_is_refused() -> None:
    with pytest.raises(
        wf.SceneError, match=r"PointLight intensity is 1; in a scene of this size .* at most 0.000244"
    ):
        wf.PointLight((0, 0, 0), 1).scaled(2.0**70)
    ball = wf.Sphere((0, 0, 0), 1e-25)
    with pytest.raises(wf.SceneError, match="PointLight intensity is 1; in a scene of this size"):
        picture(wf.Scene(ball, [wf.PointLight((0, 1e-24, 0), 1)]), "numpy")
    with pytest.raises(wf.SceneError, match=r"Environment radiance is 1e\+39; it must be at most 3.4e\+38"):
        wf.Environment(1e39)
