"""Lights: their contract, how one is chosen, shadow rays, and which side shines."""

import numpy as np
import pytest
import scenes
from inside import ConstantEnvironment, LightTable, PointLightRecord, SphereLights, TriangleLights, f4
from near import assert_near
from significance import assert_mean, measure, render

import wavefront as wf

RNG = np.random.default_rng(1)


def column(*values: float) -> np.ndarray:
    """A (3, 1) column."""
    return np.array(values, f4).reshape(3, 1)


def triangles() -> TriangleLights:
    """Two triangles that face the origin: a near one and a far, thin one."""
    corners = np.array([[[1, 2, 0], [0, 2, 0], [0, 2, 1]], [[-9, -5, 4], [-9, 5, 4.5], [-9, 5, 4]]], float)
    return TriangleLights.from_triangles(corners, column(1, 2, 3))


def spheres() -> SphereLights:
    """A near sphere and a far, small one."""
    return SphereLights(
        np.array([[0, 3], [3, 1], [1, -2]], f4), np.array([0.8, 0.3], f4), np.ones((3, 2), f4)
    )


# --- Choice ---------------------------------------------------------------------------------------


def table(choice: str = "spatial") -> LightTable:
    """All kinds of light together."""
    kinds = [
        triangles(),
        spheres(),
        PointLightRecord(column(1, 2, 3), column(4, 5, 6)),
        ConstantEnvironment(column(1, 2, 3)),
    ]
    return LightTable(kinds, 2.0 / np.sqrt(3), choice)


def test_choice_is_proportional_to_power() -> None:
    """π·A·L of a triangle, 4π²r²L of a sphere, 4πI of a point, 4π²R²L of an environment."""
    lights = table("power")
    area = triangles().area.astype(float)
    power = np.concatenate(
        [np.pi * area * 2, 4 * np.pi**2 * np.array([0.8, 0.3]) ** 2, [4 * np.pi * 5, 4 * np.pi**2 * 8]]
    )
    assert len(lights) == 6
    assert lights.choice.pmf(np.arange(6), np.zeros((3, 6), f4)) == pytest.approx(
        power / power.sum(), rel=1e-5
    )


@pytest.mark.parametrize("choice", ["spatial", "power", "uniform"])
def test_samples_of_a_table_are_those_of_the_chosen_light(choice: str) -> None:
    """Every light is chosen as often as its probability says, which is part of the pdf."""
    lights, n = table(choice), 1 << 16
    point, u_choice, u = np.zeros((3, n), f4), (np.arange(n, dtype=f4) + f4(0.5)) / n, RNG.random((2, n), f4)
    sample, light = lights.sample_li(point, u_choice, u)
    chosen, chance = lights.choice.sample(point, u_choice)
    expected = lights.choice.pmf(np.arange(6), np.zeros((3, 6), f4))
    assert_near(np.bincount(chosen, minlength=6) / n, expected, abs=2 / n)
    assert (light == chosen).all()
    assert (lights.delta_of[light] == (chosen == 4)).all()
    some = np.flatnonzero((chosen != 4) & (sample.pdf > 0))
    again = lights.pdf_li(chosen[some], point[:, some], sample.wi[:, some])
    assert np.median(np.abs(again / sample.pdf[some] - 1)) < 1e-5
    assert np.mean(np.abs(again / sample.pdf[some] - 1) > 1e-3) < 1e-3  # on the very edges
    assert_near(sample.pdf[chosen == 4], chance[chosen == 4])
    radiance = lights.le(chosen[some], sample.wi[:, some])
    assert_near(radiance, sample.radiance[:, some])


@pytest.mark.parametrize("integrator", scenes.SAMPLING_LIGHTS)
def test_many_lights_add_up(integrator: str) -> None:
    """Two rectangles, a sphere, a point and an environment above a floor: the sum of what each gives."""
    lit = scenes.floor()
    shapes = [
        lit,
        scenes.panel((1, -1), (3, 1), 1),
        scenes.panel((-3, -1), (-1, 1), 1, emission=2.0),
        wf.Sphere((0, 2, 0), 0.5, material=scenes.BLACK, emission=4.0),
    ]
    camera = scenes.probe((0, 0, 0), scenes.EYE)
    scene = wf.Scene(shapes, [wf.PointLight((0.2, 1, 1.5), 3)], camera)
    sides = scenes.polygon_irradiance([(1, 1, -1), (3, 1, -1), (3, 1, 1), (1, 1, 1)])
    point = 3 / (0.2**2 + 1 + 1.5**2) ** 1.5
    expected = (3 * sides + 4 * 0.196350 + point) * scenes.ALBEDO / np.pi
    assert_mean(measure(scene, 4096, integrator=integrator, max_bounces=1), expected, 0.002)


# --- Sides and shadows ----------------------------------------------------------------------------


ONE_SIDED = {
    "rectangle": scenes.panel((-1, -1), (1, 1), 1),
    "triangle": wf.Mesh(
        [[-2, 1, -2], [4, 1, -2], [-2, 1, 4]], [[0, 1, 2]], material=scenes.BLACK, emission=1.0
    ),
}


@pytest.mark.parametrize("panel", ONE_SIDED.values(), ids=ONE_SIDED)
@pytest.mark.parametrize("integrator", scenes.ALL)
def test_a_mesh_shines_from_its_front_only(integrator: str, panel: wf.Mesh) -> None:
    below = wf.Camera.look_at((0, 0.1, 0), (0, 1, 0), (1, 0, 0), fov=1e-3, size=(2, 2))
    above = wf.Camera.look_at((0, 3, 0), (0, 1, 0), (1, 0, 0), fov=1e-3, size=(2, 2))
    roof = wf.Rectangle((-5, 2, -5), (10, 0, 0), (0, 0, 10))  # faces down, onto the back of the panel
    lit = wf.Camera.look_at((2, 1.5, 0), (0, 2, 0), fov=1e-3, size=(2, 2))
    assert (render(wf.Scene([panel], camera=below), 1, integrator=integrator).rgb == 1).all()
    assert (render(wf.Scene([panel], camera=above), 1, integrator=integrator).rgb == 0).all()
    assert (
        render(wf.Scene([panel, roof], camera=lit), 64, integrator=integrator, max_bounces=1).rgb == 0
    ).all()


SCALES = (1e-6, 1.0, 1e6)


@pytest.mark.parametrize("scale", SCALES)
@pytest.mark.parametrize("integrator", ["naive", "full"])
def test_light_from_very_near(scale: float, integrator: str) -> None:
    """A floor a thousandth of the light's width below it receives all of its radiance."""
    y = 1e-3
    expected = (
        scenes.polygon_irradiance([(-1, y, -1), (1, y, -1), (1, y, 1), (-1, y, 1)]) * scenes.ALBEDO / np.pi
    )
    shapes = [
        wf.Rectangle((-scale, 0, -scale), (0, 0, 2 * scale), (2 * scale, 0, 0)),
        scenes.panel((-scale, -scale), (scale, scale), y * scale),
    ]
    scene = wf.Scene(shapes, camera=scenes.probe((0, 0, 0), np.array([0.02, 0.0006, 0.01]) * scale))
    assert_mean(measure(scene, 1024, integrator=integrator, max_bounces=1), expected, 0.002)


@pytest.mark.parametrize("scale", SCALES)
@pytest.mark.parametrize(("integrator", "distance"), [("naive", 1.0), ("direct_mis", 1e-3)])
def test_light_that_stands_on_the_floor(scale: float, distance: float, integrator: str) -> None:
    """Shadow rays that graze the floor and end on the light's lowest edge are not blocked by either."""
    wall = np.array([(-1, 0, -distance), (1, 0, -distance), (1, 1, -distance), (-1, 1, -distance)])
    expected = scenes.polygon_irradiance(wall) * scenes.ALBEDO / np.pi
    light = wf.Mesh(wall * scale, [[0, 1, 2], [0, 2, 3]], material=scenes.BLACK, emission=1.0)
    eye = np.array([0.3, 0.5, 0.4]) * min(distance, 0.3) * scale
    scene = wf.Scene([scenes.floor(half=3 * scale), light], camera=scenes.probe((0, 0, 0), eye))
    spp = 4096 if integrator == "naive" else 2048
    mean = measure(scene, spp, integrator=integrator, max_bounces=1)
    assert_mean(mean, expected, 0.003, rounding=5e-4)  # the scene is 6000 times larger than the distance


@pytest.mark.parametrize("scale", SCALES)
@pytest.mark.parametrize("degrees", [0, 60, 85, 89, 89.9])
def test_point_light_at_grazing_angles(scale: float, degrees: float) -> None:
    """I·cosθ/d², to the last degree: a flat floor never shades itself."""
    theta = np.radians(degrees)
    light = np.array([np.sin(theta), np.cos(theta), 0]) * 2 * scale
    shapes = [scenes.floor(half=5 * scale), scenes.floor(half=5 * scale, y=-scale)]
    eye = np.array([0.1, 0.5, 0.3]) * scale
    scene = wf.Scene(shapes, [wf.PointLight(light, scale**2)], scenes.probe((0, 0, 0), eye))
    expected = np.cos(theta) / 4 * scenes.ALBEDO / np.pi
    image = render(scene, 4, integrator="direct_simple")
    assert image.rgb == pytest.approx(expected, rel=2e-4 if degrees < 89.5 else 2e-3)


@pytest.mark.parametrize("scale", SCALES)
@pytest.mark.parametrize("ratio", [2, 1500])
@pytest.mark.parametrize("integrator", ["direct_simple", "full"])
def test_sphere_lights_near_and_far(ratio: float, scale: float, integrator: str) -> None:
    """π(R/d)²cosθ, also for a sphere as small as the sun: shadow rays never end within it."""
    towards = np.array([-1.0, 0.8, -0.3])
    distance = np.linalg.norm(towards)
    light = wf.Sphere(towards * scale, distance / ratio * scale, material=scenes.BLACK, emission=ratio**2)
    scene = wf.Scene(
        [scenes.floor(half=3 * scale), light], camera=scenes.probe((0, 0, 0), scenes.EYE * scale)
    )
    expected = np.pi * 0.8 / distance * scenes.ALBEDO / np.pi
    assert_mean(measure(scene, 256, integrator=integrator, max_bounces=1), expected, 0.002, rounding=1e-4)


def ball(n: int = 24) -> wf.Mesh:
    """A convex closed mesh of 2n² triangles round the origin, with flat facets."""
    v, u = np.meshgrid(np.linspace(0, np.pi, n + 1), np.arange(2 * n) * np.pi / n, indexing="ij")
    points = np.stack([np.sin(v) * np.cos(u), np.cos(v), np.sin(v) * np.sin(u)], -1).reshape(-1, 3)
    i, j = np.meshgrid(np.arange(n), np.arange(2 * n), indexing="ij")
    a, b = i * 2 * n + j, i * 2 * n + (j + 1) % (2 * n)
    faces = np.concatenate(
        [np.stack([a, b, a + 2 * n], -1)[1:], np.stack([b, b + 2 * n, a + 2 * n], -1)[:-1]]
    )
    return wf.Mesh(points, faces.reshape(-1, 3))


@pytest.mark.parametrize("scale", SCALES)
@pytest.mark.parametrize("kind", ["mesh", "sphere"])
def test_convex_things_never_shade_themselves(kind: str, scale: float) -> None:
    """In an environment of 1 each sample of a surface of 0.5 is 0.5, without exception."""
    mesh = ball()
    shape = wf.Mesh(mesh.vertices * scale, mesh.faces) if kind == "mesh" else wf.Sphere((0, 0, 0), scale)
    eye = np.array([1.0, 0.7, 2.0]) * scale
    camera = wf.Camera.look_at(eye, (0, 0, 0), fov=20, size=(24, 24))
    scene = wf.Scene([shape], [wf.Environment()], camera)
    assert render(scene, 64, integrator="naive").rgb == pytest.approx(0.5, rel=1e-5)
    assert render(scene, 64, integrator="direct_mis").rgb.mean() == pytest.approx(0.5, rel=2e-3)


@pytest.mark.parametrize("scale", SCALES)
def test_a_closed_mesh_lets_no_light_in(scale: float) -> None:
    """A camera in a closed ball in a bright environment sees nothing, also at vertices and edges."""
    mesh = ball()
    camera = wf.Camera.look_at((0, 0, 0), (0, 1, 0), (0, 0, 1), fov=120, size=(32, 32))
    lights = [wf.Environment(), wf.PointLight((0, 2 * scale, 0), scale**2)]
    scene = wf.Scene([wf.Mesh(mesh.vertices * scale, mesh.faces)], lights, camera)
    with pytest.warns(UserWarning, match="the camera is inside 'mesh', where no light gets in"):
        assert (render(scene, 4, max_bounces=3).rgb == 0).all()


def test_shadow_rays_end_before_the_light() -> None:
    """The light itself, whatever stands on it from behind, and what is beyond it shade nothing."""
    panel = scenes.panel((-1, -1), (1, 1), 1)
    lid = wf.Rectangle((-1, 1, -1), (2, 0, 0), (0, 0, 2), material=scenes.BLACK)  # the same place
    expected = 1.740840 * scenes.ALBEDO / np.pi
    scene = scenes._lit_floor(panel, wf.Rectangle((-5, 1.001, -5), (10, 0, 0), (0, 0, 10)))
    assert_mean(measure(scene, 8192, integrator="direct_simple"), expected, 0.002)
    coplanar = wf.Scene([panel, scenes.floor(), lid], camera=scene.camera)
    assert np.isfinite(render(coplanar, 4).rgb).all()
