"""Media that only absorb, wherever light begins, ends or turns: against closed forms and with a table."""

from __future__ import annotations

import itertools
from collections.abc import Callable

import numpy as np
import pytest
from inside import absorption, compile_scene, make_accelerator
from inside import scene as compiling
from scenes import BLACK, probe
from significance import assert_mean, assert_same_images, channels, render, repeat

import wavefront as wf

ALL = ("naive", "direct_simple", "direct_mis", "full")
MIRRORED = np.diag([-1.0, 1, 1, 1])
SKY = wf.Environment(1)


def water(absorption=1.0, bsdf=None, **more) -> wf.Material:
    return wf.Material(bsdf or wf.NullSurface(), interior=wf.Medium(absorption), **more)


def cube(absorption=1.0, at=(0, 0, 0), size=2.0, bsdf=None, **more) -> wf.Mesh:
    return wf.Box(at, size, material=water(absorption, bsdf, **more))


def ball(absorption=1.0, at=(0, 0, 0), radius=0.5, bsdf=None, **more) -> wf.Sphere:
    return wf.Sphere(at, radius, material=water(absorption, bsdf, **more))


def lamp(at=(0, 0, 0), radius=0.5) -> wf.Sphere:
    return wf.Sphere(at, radius, material=BLACK, emission=1)


def scene_of(parts: list, camera: wf.Camera | None = None) -> wf.Scene:
    """A scene of shapes and lights."""
    lights = [each for each in parts if isinstance(each, wf.Light)]
    return wf.Scene([each for each in parts if isinstance(each, wf.Shape)], lights, camera)


def mirror(z: float) -> wf.Mesh:
    return wf.Rectangle((-0.9, -0.9, z), (1.8, 0, 0), (0, 1.8, 0), material=wf.Mirror())


# what is seen from (0, 0, 3) along −z, and how much of it is left: shapes, and the optical depth
SEEN: dict[str, tuple[Callable[[], list], float]] = {
    "a lamp inside": (lambda: [cube(), lamp()], 0.5),
    "a lamp that sticks out by half": (lambda: [cube(), lamp((0, 0, -1))], 1.5),
    "a lamp that shares the far side": (
        lambda: [wf.Rectangle((-1, -1, -1), (2, 0, 0), (0, 2, 0), material=BLACK, emission=1), cube()],
        2.0,
    ),
    "a ball inside": (lambda: [cube(), ball(2.0), SKY], 3.0),
    "a ball of glass inside": (lambda: [cube(), ball(2.0, bsdf=wf.Dielectric(1.0)), SKY], 3.0),
    "a ball that sticks out by half": (lambda: [cube(1.0), ball(1.0, (0, 0, 1)), SKY], 2.5),
    "a mirror inside": (lambda: [cube(), mirror(0), SKY], 2.0),
    "two balls within each other": (lambda: [ball(1, radius=1), ball(0.25, radius=0.5), SKY], 1.25),
    "a bubble": (lambda: [cube(), wf.Sphere((0, 0, 0), 0.5, material=wf.Dielectric(1.0)), SKY], 1.0),
    "boxes that touch": (
        lambda: [cube(1, (0, 0, -0.5), (2, 2, 1)), cube(2, (0, 0, 0.5), (2, 2, 1)), SKY],
        3.0,
    ),
    "boxes that touch by a part of a side": (
        lambda: [cube(2, (0.1, 0.2, 0.5), (1, 1, 1)), cube(1, (0, 0, -0.5), (2, 2, 1)), SKY],
        3.0,
    ),
    "a box on a floor that shines": (
        lambda: [wf.Rectangle((-4, -4, -1), (8, 0, 0), (0, 8, 0), material=BLACK, emission=1), cube()],
        2.0,
    ),
    "a sheet of water over a floor": (
        lambda: [
            wf.Rectangle((-4, -4, 1), (8, 0, 0), (0, 8, 0), material=water(1)),
            wf.Rectangle((-4, -4, -1), (8, 0, 0), (0, 8, 0), material=BLACK, emission=1),
        ],
        2.0,
    ),
}


def as_given(shapes: list) -> list:
    return shapes


def mirrored(shapes: list) -> list:
    return [each.transformed(MIRRORED) if isinstance(each, wf.Shape) else each for each in shapes]


def instanced(shapes: list) -> list:
    """Each mesh as one of three instances, of which the first is mirrored twice."""
    out = []
    for each in shapes:
        if not isinstance(each, wf.Mesh):
            out.append(each)
            continue
        base = each.transformed(MIRRORED)
        out += [wf.Instance(base, MIRRORED @ _moved((x, 0, 0))) for x in (0, 50, 90)]
    return out


def _moved(offset) -> np.ndarray:
    matrix = np.eye(4)
    matrix[:3, 3] = offset
    return matrix


@pytest.mark.parametrize("form", [as_given, mirrored, instanced], ids=lambda f: f.__name__)
@pytest.mark.parametrize("name", SEEN)
def test_what_is_seen_through_absorbers(name: str, form) -> None:
    """exp(−depth), by every integrator and both accelerators: nothing here is random."""
    build, depth = SEEN[name]
    scene = scene_of(form(build()), probe((0, 0, 0), (0.0, 0.0, 3.0)))
    every = zip(ALL, ("numpy", "embree", "numpy", "embree"), strict=True)
    for integrator, accel in list(every)[:: 1 if form is as_given else 3]:
        seen = render(scene, 1, integrator=integrator, accel=_available(accel), lighting=None).rgb
        assert seen == pytest.approx(np.exp(-depth), rel=3e-4), integrator


def _available(accel: str) -> str:
    from wavefront.accel.embree import installed

    return accel if installed() else "numpy"


def measured(shapes, point, direction, kind="irradiance", **options) -> float:
    found = wf.measure(
        scene_of(shapes), [point], [direction], kind=kind, progress=False, **{"spp": 64, **options}
    )
    return float(found.value[0, 0])


@pytest.mark.parametrize("integrator", ["direct_simple", "direct_mis", "full"])
@pytest.mark.parametrize(
    ("sensor", "depth"), [((0, 0, 3), 1.0), ((0, 0, 0.5), 0.5), ((0, 0, 1), 1.0)], ids=str
)
def test_a_point_light_inside(sensor, depth: float, integrator: str) -> None:
    """Of a sensor outside, inside, and on the side of the cube."""
    shapes, distance = [cube(), wf.PointLight((0, 0, 0), 1)], sensor[2]
    due = np.exp(-depth) / distance**2
    assert measured(shapes, sensor, (0, 0, -1), integrator=integrator) == pytest.approx(due, rel=1e-4)


def test_a_light_and_a_sensor_inside() -> None:
    shapes = [cube(), wf.PointLight((0, 0, -0.5), 1)]
    assert measured(shapes, (0, 0, 0.5), (0, 0, -1)) == pytest.approx(np.exp(-1), rel=1e-4)


def test_a_ball_that_shines_is_met_from_inside() -> None:
    shining = wf.Sphere((0, 0, 0), 2, material=water(0.5, BLACK), emission=1)
    for point, depth in (((0, 0, 0), 1.0), ((0, 0, 1), 0.5)):
        seen = measured([shining], point, (0, 0, 1), "radiance")
        assert seen == pytest.approx(np.exp(-depth), rel=1e-4)


def test_the_floor_of_a_pool() -> None:
    """Fresnel's reflectance at 1.33, and radiance that falls by 1.33²."""
    floor = wf.Rectangle((-0.9, -0.9, -0.5), (1.8, 0, 0), (0, 1.8, 0), material=BLACK, emission=1)
    scene = wf.Scene([cube(bsdf=wf.Dielectric(1.33)), floor], camera=probe((0, 0, 0), (0.0, 0.0, 3.0)))
    due = (1 - (0.33 / 2.33) ** 2) / 1.33**2 * np.exp(-1.5)
    for mean in channels(scene, 1024, lighting=None, max_bounces=8):
        assert_mean(mean, due, 0.003, sigmas=4)


def test_a_bubble_in_colored_glass() -> None:
    """A slab of glass 3 thick with a flat bubble 1 thick: all ways between its four faces, added up."""
    sigma = np.array([0.3, 1.0, 2.0])
    slab = wf.Box((0, 0, 0), (80, 80, 3), material=water(sigma, wf.Dielectric(1.5)))
    bubble = wf.Box((0, 0, 0), (40, 40, 1), material=wf.Dielectric(1 / 1.5))
    scene = wf.Scene([slab, bubble], SKY, probe((0, 0, 0), (0.0, 0.0, 9.0)))
    r, glass = (0.5 / 2.5) ** 2, np.exp(-sigma)
    due = np.zeros(3)
    for channel, through in enumerate(glass):
        layers = [(r, through), (r, 1.0), (r, through), (r, 1.0)]
        reflected, passed = 0.0, 1.0
        for reflectance, inside in reversed(layers):  # reflectance and transmittance of a pile of faces
            below_r, below_t = reflected * inside**2, passed * inside
            again = 1 / (1 - reflectance * below_r)
            passed = (1 - reflectance) * below_t * again
            reflected = reflectance + (1 - reflectance) ** 2 * below_r * again
        due[channel] = reflected + passed  # both lead to the sky
    for mean, each in zip(channels(scene, 4096, max_bounces=60), due, strict=True):
        assert_mean(mean, each, 0.003, sigmas=4)


def test_flux_of_a_lamp_in_the_same_box() -> None:
    """A rectangle below a point light, by quadrature."""
    shapes = [wf.Box((0, 0, 0), 4, material=water(0.7)), wf.PointLight((0, 0, 1), 2)]
    target = wf.Rectangle((-1, -1, 0), (2, 0, 0), (0, 2, 0))
    x = (np.arange(400) + 0.5) / 200 - 1
    d2 = x[:, None] ** 2 + x**2 + 1
    due = (2 / d2**1.5 * np.exp(-0.7 * np.sqrt(d2))).mean() * 4
    found = wf.measure_flux(scene_of([*shapes, target]), target, spp=4096, progress=False)
    assert np.ravel(found.value)[0] == pytest.approx(due, rel=0.003)


def test_a_wall_in_a_room_of_haze() -> None:
    """Both legs are charged: from the lamp to the wall, and from the wall to the camera."""
    room = wf.Box((0, 0, 0), 4, material=water(0.3, wf.Diffuse(0)))
    wall = wf.Rectangle((-1, -1, -1), (2, 0, 0), (0, 2, 0), material=wf.Diffuse(0.5))
    light = wf.PointLight((0, 0, 1.5), 3)
    scene = wf.Scene([room, wall], light, probe((0, 0, -1), (0.0, 0.0, 1.0)))
    due = 0.5 / np.pi * 3 / 2.5**2 * np.exp(-0.3 * 4.5)
    for integrator in ("direct_simple", "direct_mis", "full"):
        assert render(scene, 1, integrator=integrator).rgb == pytest.approx(due, rel=1e-3)


# --- When the table is needed ----------------------------------------------------------------------------


def joined(*meshes: wf.Mesh) -> wf.Mesh:
    """One mesh of several."""
    faces = np.concatenate([m.faces + len(m.vertices) * number for number, m in enumerate(meshes)])
    vertices = np.concatenate([m.vertices for m in meshes])
    return wf.Mesh(vertices, faces, material=meshes[0].material)


def opened(mesh: wf.Mesh) -> wf.Mesh:
    return wf.Mesh(mesh.vertices, mesh.faces[1:], material=mesh.material)


def floor(z: float) -> wf.Mesh:
    return wf.Rectangle((-4, -4, z), (8, 0, 0), (0, 8, 0))


def bottle() -> wf.Mesh:
    """A bottle of glass, with an outer and an inner wall that meet at its mouth."""
    profile = np.array([(0, 0), (0.5, 0), (0.5, 1), (0.2, 1.4), (0.15, 1.4), (0.4, 1), (0.4, 0.1), (0, 0.1)])
    turn = np.linspace(0, 2 * np.pi, 24, endpoint=False)
    ring = np.stack([np.cos(turn), np.zeros(24), np.sin(turn)], 1)
    vertices = (profile[:, None, :1] * ring + profile[:, None, 1:] * np.array([0, 1.0, 0])).reshape(-1, 3)
    row, column = np.divmod(np.arange(7 * 24), 24)
    a, b = row * 24 + column, row * 24 + (column + 1) % 24
    faces = np.concatenate([np.stack([a, a + 24, b], 1), np.stack([b, a + 24, b + 24], 1)])
    corners = vertices[faces]
    solid = (
        np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) > 1e-9
    )
    return wf.Mesh(vertices, faces[solid], material=water(2, wf.Dielectric(1.5)))


def prism() -> wf.Mesh:
    corners = [(0, 0, 0), (1, 0, 0), (0.5, 0.9, 0), (0, 0, 2), (1, 0, 2), (0.5, 0.9, 2)]
    faces = [(0, 2, 1), (3, 4, 5), (0, 1, 4), (0, 4, 3), (1, 2, 5), (1, 5, 4), (2, 0, 3), (2, 3, 5)]
    return wf.Mesh(corners, faces, material=water(2, wf.Dielectric(1.5)))


GLASS = wf.Dielectric(1.5)
HALF = 1 - 1e-4
CHOICES: dict[str, tuple[bool, list]] = {
    "a ball": (True, [ball(bsdf=GLASS), SKY]),
    "a bottle": (True, [bottle(), SKY]),
    "a bottle with something in it": (False, [bottle(), ball(at=(0, 0.6, 0), radius=0.1), SKY]),
    "a prism": (True, [prism(), SKY]),
    "a ball on a floor": (True, [ball(), floor(-0.5), SKY]),
    "a ball sunk into the floor": (False, [ball(), floor(-0.4999), SKY]),
    "a cube above a floor": (True, [cube(), floor(-1.001), SKY]),
    "a cube on a floor": (False, [cube(), floor(-1), SKY]),
    "a cube in a room": (True, [cube(), wf.Box((0, 0, 0), 6), SKY]),
    "a cube in a room that it touches": (False, [cube(), wf.Box((0, 0, 2), 6), SKY]),
    "two balls apart": (True, [ball(), ball(2, (1.001, 0, 0)), SKY]),
    "two balls that overlap": (False, [ball(), ball(2, (0.999, 0, 0)), SKY]),
    "a light inside": (False, [cube(), wf.PointLight((0, 0, HALF), 1)]),
    "a light outside": (True, [cube(), wf.PointLight((0, 0, 1 + 1e-4), 1)]),
    "a light of no known place": (True, [cube(), wf.DirectionalLight((0, 0, -1), 1)]),
    "it shines": (False, [wf.Sphere((0, 0, 0), 1, material=water(1, BLACK), emission=1)]),
    "open": (False, [opened(cube()), SKY]),
    "inside out": (False, [wf.Mesh(cube().vertices, cube().faces[:, ::-1], material=water()), SKY]),
    "two parts apart": (True, [joined(cube(), cube(at=(2.1, 0, 0))), SKY]),
    "two parts that touch": (False, [joined(cube(), cube(at=(2, 0, 0))), SKY]),
    "a capsule": (False, [wf.Capsules([(0, 0, 0)], [(0, 0, 1)], 0.2, material=water()), SKY]),
    "a cylinder": (True, [wf.Cylinders([(0, 0, 0)], [(0, 0, 1)], 0.2, material=water()), SKY]),
    "a cylinder on a floor": (
        False,
        [wf.Cylinders([(0, 0, 0)], [(0, 0, 1)], 0.2, material=water()), floor(0), SKY],
    ),
    "clear": (True, [cube(0.0), lamp()]),
    "an instance": (True, [*instanced([cube()]), SKY]),
    "an instance with another inside": (
        False,
        [*instanced([cube()]), wf.Instance(floor(0.5), np.eye(4)), SKY],
    ),
    "balls beside": (True, [cube(), wf.Spheres([(3, 0, 0), (3, 2, 0)], 0.1), SKY]),
    "balls on both sides": (False, [cube(), wf.Spheres([(3, 0, 0), (-3, 2, 0)], 0.1), SKY]),
}


@pytest.mark.parametrize("name", CHOICES)
def test_the_table_is_left_out_where_absorbers_are_alone(name: str) -> None:
    alone, parts = CHOICES[name]
    assert (compile_scene(scene_of(parts), lambda g: make_accelerator(g, "numpy")).media is None) is alone


def test_very_many_absorbers_get_a_table_without_a_search(monkeypatch) -> None:
    monkeypatch.setattr(absorption, "MOST_PARTS", 20)
    shapes = [ball(at=(3 * k, 0, 0)) for k in range(21)]
    assert compile_scene(wf.Scene(shapes, SKY), lambda g: make_accelerator(g, "numpy")).media is not None


@pytest.mark.parametrize("at", [(0, 0, 0.2), (0, 0, 5)], ids=["camera inside", "camera outside"])
@pytest.mark.parametrize("bsdf", [wf.NullSurface(), GLASS], ids=["border", "glass"])
def test_cameras_inside_need_no_table(at, bsdf, monkeypatch) -> None:
    """The picture is the same with one; so are sensors, and pictures with caustics."""
    around = [wf.Rectangle((-9, -9, -3), (18, 0, 0), (0, 18, 0)), wf.PointLight((2, 1, 4), 9), SKY]
    camera = wf.Camera.look_at(at, (0, 0.1, -3), fov=60, size=(24, 24))
    scene = scene_of([ball((0.3, 1, 2), radius=1, bsdf=bsdf), *around], camera)

    def pictures() -> list[np.ndarray]:
        some = [render(scene, 4, max_bounces=2, **more).rgb for more in ({}, {"caustics": True})]
        return [
            *some,
            wf.measure(scene, [at, (0, 0, 2)], [(0, 0, 1), (0, 0, -1)], spp=64, progress=False).value,
        ]

    alone = pictures()
    monkeypatch.setattr(compiling, "absorbs_alone", lambda *given: False)
    for one, other in zip(alone, pictures(), strict=True):
        assert one == pytest.approx(other, rel=1e-3, abs=1e-6)


# --- With paths that are shared, guided or traced from lights ---------------------------------------------


def room(*parts: wf.Shape, medium=None, light: wf.Light | None = None) -> wf.Scene:
    """A room with a lamp at its ceiling, and what is in it."""
    walls = wf.Box((0, 0, 0), 4, material=wf.Diffuse((0.7, 0.5, 0.4)))
    panel = wf.Rectangle((-1, 1.9, -1), (2, 0, 0), (0, 0, 2), emission=5)
    camera = wf.Camera.look_at((0, 0, 1.9), (0, -0.5, 0), fov=80, size=(16, 16))
    lights = [] if light is None else [light]
    shapes = [walls, *parts, *([panel] if light is None else [])]
    return wf.Scene(shapes, lights, camera, medium=medium)


HAZE = wf.Medium((0.05, 0.2, 0.4))


def drink() -> list[wf.Shape]:
    """A ball of water with ice in it, by priorities, and a matte fruit that sticks out."""
    water_ball = ball((0.3, 0.6, 1.2), (-0.6, -1, 0), 0.8, wf.Dielectric(1.33), priority=1)
    ice = ball(0.1, (-0.4, -0.7, 0.2), 0.3, wf.Dielectric(1.31), priority=2)
    return [water_ball, ice, wf.Sphere((-0.8, -0.4, 0), 0.4, material=wf.Diffuse((0.8, 0.2, 0.1)))]


GLOSSY = wf.Sphere((0.9, -1.2, 0.2), 0.7, material=wf.Principled((0.9, 0.6, 0.2), 1, 0.4))
SHARED = {
    "haze": lambda: room(GLOSSY, medium=HAZE),
    "drink": lambda: room(*drink()),
    "drink in haze": lambda: room(*drink(), GLOSSY, medium=HAZE),
    "leaf": lambda: room(
        cube(1.5, (0.8, -1.4, 0), 1, wf.Dielectric(1.2)),
        wf.Sphere((0.8, -1.4, 0), 0.3, material=wf.Diffuse(0.7)),
        wf.Rectangle(
            (-1.5, -1, -0.5), (1, 0, 0), (0, 1, 0.3), material=wf.DiffuseTransmission(0.3, (0.2, 0.5, 0.1))
        ),
    ),
}


@pytest.mark.first(1)
@pytest.mark.parametrize("name", SHARED)
def test_shared_paths_through_absorbers(name: str) -> None:
    scene = SHARED[name]()
    assert compile_scene(scene, lambda g: make_accelerator(g, "numpy")).media is not None
    own = repeat(scene, 8, runs=8, reuse=False, max_bounces=4)
    shared = repeat(scene, 8, runs=8, first_seed=100, reuse=True, max_bounces=4)
    assert_same_images(own, shared, 0.02)


@pytest.mark.slow
@pytest.mark.parametrize("name", SHARED)
def test_guided_and_naive_paths_through_absorbers(name: str) -> None:
    scene = SHARED[name]()
    options = {"runs": 8, "max_bounces": 4}
    own = repeat(scene, 64, reuse=False, **options)
    assert_same_images(own, repeat(scene, 64, first_seed=100, guide=True, **options), 0.01)
    assert_same_images(own, repeat(scene, 256, first_seed=200, integrator="naive", **options), 0.02)


@pytest.mark.slow
@pytest.mark.parametrize("inside", [True, False], ids=["lamp in the drink", "lamp above"])
@pytest.mark.parametrize("accel", ["numpy", "embree"])
def test_caustics_of_a_drink(inside: bool, accel: str) -> None:
    """Paths from lights bring the same light as those from the camera, which meet the lamp by chance."""
    bulb = wf.Sphere((-0.6, -1, 0.45) if inside else (-0.2, 1.2, 0.4), 0.15, material=BLACK, emission=30)
    scene = room(*drink(), bulb, medium=HAZE)
    options = {"runs": 8, "reuse": False, "max_bounces": 5, "accel": _available(accel)}
    own = repeat(scene, 512, **options)
    from_lights = repeat(scene, 128, first_seed=100, caustics=True, **options)
    assert_same_images(own, from_lights, 0.02)


@pytest.mark.slow
@pytest.mark.first(1)
@pytest.mark.parametrize("medium", [wf.Medium((0.1, 0.2, 0.3)), None], ids=["haze", "clear air"])
def test_a_caustic_by_a_point_light_is_dimmed(medium) -> None:
    """Below water without a step of index it is the light that comes through a border that is not there."""

    def scene(bsdf) -> wf.Scene:
        pool = wf.Box((0, 0, 0), (3, 3, 1), material=water(0.5, bsdf, priority=1))
        fish = wf.Sphere((0.4, 0.2, 0), 0.3, material=wf.Diffuse(0.5))
        ground = wf.Rectangle((-1.4, -1.4, -1.5), (2.8, 0, 0), (0, 2.8, 0), material=wf.Diffuse(0.5))
        camera = wf.Camera.look_at((0, 0, -0.8), (0, 0, -1.5), up=(0, 1, 0), fov=90, size=(8, 8))
        return wf.Scene([pool, ground, fish], wf.PointLight((0, 0, 2), 10), camera, medium=medium)

    straight = repeat(scene(wf.NullSurface()), 16, runs=8, integrator="direct_mis")
    from_lights = repeat(scene(wf.Dielectric(1.0)), 512, runs=8, caustics=True, max_bounces=3)
    assert_same_images(straight, from_lights, 0.02)


@pytest.mark.parametrize("caustics", [False, True])
@pytest.mark.parametrize("accel", ["numpy", "embree"])
def test_backgrounds_and_catchers_behind_mirrored_instances(accel: str, caustics: bool) -> None:
    """A white background arrives by exp(−σ); a shadow covers 1 − exp(−σ), both through water 1 thick."""
    options = {"accel": _available(accel), "caustics": caustics}
    sigma = np.array([0.3, 1.0, 2.0])
    slab = wf.Box((0, 0, 0), (2, 2, 1), material=water(sigma))
    glass = wf.Sphere((0, 3, 0), 0.3, material=wf.Dielectric(1.5))
    parts = [*instanced([slab]), glass, wf.PointLight((0, 4, 4), 1)]
    image = render(scene_of(parts, probe((0, 0, 0), (0.0, 0.0, 5.0))), 1, background=(1, 1, 1), **options)
    np.testing.assert_allclose(image.rgb[0, 0], np.exp(-sigma), rtol=1e-4)
    assert image.alpha == pytest.approx(1 - np.exp(-sigma).mean(), rel=1e-4)
    smoke = wf.Box((0, 0, 0), (2, 2, 1), material=water(0.99))
    catcher = wf.Rectangle((-3, -3, -2), (6, 0, 0), (0, 6, 0), material=wf.ShadowCatcher())
    camera = wf.Camera.look_at((0.3, 0, -1), (0.3, 0, -2), up=(0, 1, 0), fov=1, size=(4, 4))
    parts = [*instanced([smoke]), catcher, glass, wf.DirectionalLight((0, 0, -1), 1)]
    shadow = render(scene_of(parts, camera), 64, background="transparent", **options)
    assert shadow.alpha.mean() == pytest.approx(1 - np.exp(-0.99), rel=0.01)


# --- Forty random scenes ---------------------------------------------------------------------------------


class Solid:
    """A ball or a box of water, for rays in double precision."""

    def __init__(self, kind: str, at, size: float, absorption: float, level: int) -> None:
        self.kind, self.at, self.size = kind, np.asarray(at, float), size
        self.absorption, self.level = absorption, level

    def shape(self) -> wf.Shape:
        if self.kind == "ball":
            return wf.Sphere(self.at, self.size, material=water(self.absorption))
        box = wf.Box(self.at, 2 * self.size, material=water(self.absorption))
        if self.kind == "box":
            return box
        return wf.Instance(wf.Box(self.at * [-1, 1, 1], 2 * self.size, material=box.material), MIRRORED)

    def crossings(self, origin, direction) -> list[float]:
        o = origin - self.at
        if self.kind == "ball":
            b, c = o @ direction, o @ o - self.size**2
            root = b * b - c
            return [] if root <= 0 else [-b - np.sqrt(root), -b + np.sqrt(root)]
        with np.errstate(divide="ignore"):
            ends = np.sort([(-self.size - o) / direction, (self.size - o) / direction], 0)
        low, high = ends[0].max(), ends[1].min()
        return [low, high] if low < high else []

    def holds(self, point) -> bool:
        away = np.abs(point - self.at)
        return bool((away @ away < self.size**2) if self.kind == "ball" else (away < self.size).all())


def optical_depth(solids: list[Solid], origin, direction, length: float) -> float:
    """∫ σ along a ray, where the innermost solid counts."""
    cuts = [t for solid in solids for t in solid.crossings(origin, direction) if 0 < t < length]
    ends = np.unique([0, *cuts, *([length] if np.isfinite(length) else [])])
    total = 0.0
    for a, b in itertools.pairwise(ends):
        inside = [each for each in solids if each.holds(origin + direction * (a + b) / 2)]
        if inside:
            total += max(inside, key=lambda each: each.level).absorption * (b - a)
    return total


def random_solids(rng: np.random.Generator, crowded: bool) -> list[Solid]:
    """Balls and boxes, one within the other; where crowded also boxes that touch or overlap."""
    out = []
    for x in (-2.5, 2.5)[: 1 + rng.integers(2)]:
        at, size, level = np.array([x, *rng.uniform(-0.5, 0.5, 2)]), rng.uniform(1, 1.6), 0
        for _ in range(rng.integers(1, 4) if crowded else 1):
            kind = str(rng.choice(["ball", "box", "instance"]))
            out.append(Solid(kind, at, size, rng.uniform(0.1, 1.5), level))
            at, size, level = at + rng.uniform(-0.1, 0.1, 3), size * rng.uniform(0.35, 0.5), level + 1
    if crowded:
        absorption = rng.uniform(0.1, 1)
        low = np.array([-0.4, 3.0, 0.0])
        out.append(Solid("box", low, 0.5, absorption, 9))
        out.append(Solid("box", low + np.array((1.0, 0, 0)), 0.5, rng.uniform(0.1, 1), 9))  # touches
        out.append(Solid("box", low - np.array((0.7, 0.2, 0.1)), 0.5, absorption, 9))  # overlaps
    return out


@pytest.mark.first(4)
# the first four have each integrator, both accelerators, and many solids or few
@pytest.mark.parametrize("seed", sorted(range(40), key=lambda seed: seed not in (0, 7, 9, 14)))
def test_random_absorbers(seed: int, monkeypatch) -> None:
    """Against the optical depth of what sensors see, and pictures with a table in every case."""
    rng = np.random.default_rng(seed)
    crowded = bool(seed % 2)
    solids = random_solids(rng, crowded)
    accel = _available(("numpy", "embree")[seed // 2 % 2])
    lamps = [(rng.uniform(-3, 3, 3) if crowded else (0, -4, 0), 0.3) for _ in range(2)]
    shapes = [*(each.shape() for each in solids), *(lamp(*each) for each in lamps)]
    _compare_with_rays(rng, solids, lamps, shapes, accel)
    shapes += [
        wf.Rectangle((-5, -5, -3), (10, 0, 0), (0, 10, 0), material=wf.Diffuse((0.7, 0.5, 0.3))),
        wf.Rectangle((-1, -5.5, -2), (2, 0, 0), (0, 0, 4), material=wf.Mirror()),
    ]
    integrator = ALL[seed // 4 % 4]
    lights: list[wf.Light] = [wf.Environment(0.3)]
    if integrator != "naive":
        lights.append(wf.PointLight(rng.uniform(-2, 2, 3) if crowded else (0, -5, 1), 8))
    at = rng.uniform(-1, 1, 3) if crowded else (0, -6, 4)
    scene = wf.Scene(shapes, lights, wf.Camera.look_at(at, (0, 0, -1), fov=80, size=(16, 16)))
    options = {"integrator": integrator, "accel": accel, "max_bounces": 2}
    chosen = _picture(scene, **options)
    monkeypatch.setattr(compiling, "absorbs_alone", lambda *given: False)
    np.testing.assert_allclose(chosen, _picture(scene, **options), rtol=2e-4, atol=1e-6)


def _picture(scene: wf.Scene, **options) -> np.ndarray:
    return render(scene, 2, reuse=False, **options).rgb


def _compare_with_rays(rng, solids, lamps, shapes, accel) -> None:
    """Compare what 24 sensors see of the lamps and of a sky, and what a point light brings to them."""
    points, directions = rng.uniform(-3, 3, (24, 3)), rng.normal(size=(24, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    clear = [not any(np.linalg.norm(p - at) < r for at, r in lamps) for p in points]
    points, directions = points[clear], directions[clear]
    options = {"spp": 1, "progress": False, "lighting": None, "accel": accel, "max_bounces": 0}
    scene = wf.Scene(shapes, wf.Environment(1))
    found = wf.measure(scene, points, directions, kind="radiance", **options).value[:, 0]
    balls = [Solid("ball", at, r, 0, 0) for at, r in lamps]
    due = []
    for point, direction in zip(points, directions, strict=True):
        ends = [t for each in balls for t in each.crossings(point, direction) if t > 0]
        due.append(np.exp(-optical_depth(solids, point, direction, min(ends, default=np.inf))))
    np.testing.assert_allclose(found, due, rtol=1e-3)
    light = rng.uniform(-2, 2, 3)
    scene = wf.Scene([each.shape() for each in solids], wf.PointLight(light, 1))
    to_light = light - points
    distance = np.linalg.norm(to_light, axis=1, keepdims=True)
    options |= {"max_bounces": 1}
    found = wf.measure(scene, points, to_light / distance, **options).value[:, 0]
    due = [
        np.exp(-optical_depth(solids, point, way / d, d[0])) / d[0] ** 2
        for point, way, d in zip(points, to_light, distance, strict=True)
    ]
    np.testing.assert_allclose(found, due, rtol=1e-3)
