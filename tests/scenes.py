"""Scenes whose light is known exactly.

A probe camera looks at one point with 8 × 8 pixels, all of them the same: 64 batches in a render.
The exact values are closed forms; where one came from a public test suite that is said.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import pytest
from inside import ConstantEnvironment, Floats, f4
from numpy.typing import ArrayLike, NDArray
from significance import SIDE

import wavefront as wf

BLACK = wf.Diffuse(0.0)
ALBEDO = 0.5
ALL = ("naive", "direct_simple", "direct_mis", "full")
SAMPLING_LIGHTS = ("direct_simple", "direct_mis", "full")  # the naive one cannot find a point
DIRECT = ("direct_simple", "direct_mis")
INDIRECT = ("naive", "full")
# lights that are met by rays, and lights that are sampled: the others do the same in another order
MET_AND_SAMPLED = [
    each if each in ("naive", "direct_mis") else pytest.param(each, marks=pytest.mark.slow) for each in ALL
]


@dataclass(frozen=True)
class Case:
    """A scene, what its probe must measure, and who must measure it."""

    name: str
    build: Callable[[], wf.Scene]
    expected: float
    integrators: tuple[str, ...] = ALL
    spp: int = 4096  # of each of the 64 batches
    naive_spp: int = 8192
    max_error: float = 0.002  # bound on the relative standard error
    options: dict[str, object] = field(default_factory=dict)
    later: tuple[str, ...] = ()  # integrators by which it is measured in a slow test only

    def __str__(self) -> str:
        return self.name


def each(cases: list[Case]) -> dict[str, object]:
    """Arguments of `pytest.mark.parametrize`: every case with every integrator that reaches it."""
    pairs = [
        pytest.param(
            case,
            integrator,
            marks=pytest.mark.slow if integrator in case.later else (),
            id=f"{case}-{integrator}",
        )
        for case in cases
        for integrator in case.integrators
    ]
    return {"argnames": ("case", "integrator"), "argvalues": pairs}


# --- Parts ---------------------------------------------------------------------------------------


def probe(point: ArrayLike, origin: ArrayLike, up: ArrayLike = (0.3, 0.5, 0.81)) -> wf.Camera:
    """A camera all of whose pixels see one point."""
    return wf.Camera.look_at(origin, point, up, fov=1e-6, size=(SIDE, SIDE))


def floor(material: wf.Bsdf | None = None, half: float = 10.0, y: float = 0.0) -> wf.Mesh:
    """A square that faces up."""
    material = material or wf.Diffuse(ALBEDO)
    return wf.Rectangle(
        (-half, y, -half), (0, 0, 2 * half), (2 * half, 0, 0), material=material, name="floor"
    )


def panel(
    low: tuple[float, float], high: tuple[float, float], y: float, emission: ArrayLike | None = 1.0
) -> wf.Mesh:
    """A black rectangle, low to high in (x, z), that faces down and shines."""
    u, v = (high[0] - low[0], 0, 0), (0, 0, high[1] - low[1])
    return wf.Rectangle((low[0], y, low[1]), u, v, material=BLACK, emission=emission, name="panel")


def disk(radius: float, y: float, n: int = 256) -> wf.Mesh:
    """A disk of n triangles that faces down and shines; its area is exact."""
    radius *= np.sqrt(2 * np.pi / n / np.sin(2 * np.pi / n))
    turn = np.arange(n) * 2 * np.pi / n
    rim = np.stack([radius * np.cos(turn), np.full(n, y), radius * np.sin(turn)], 1)
    k = np.arange(n)
    faces = np.stack([np.full(n, n), k, (k + 1) % n], 1)
    return wf.Mesh(np.vstack([rim, [0, y, 0]]), faces, material=BLACK, emission=1.0, name="disk")


def box(
    low: ArrayLike,
    high: ArrayLike,
    material: wf.Bsdf,
    emission: ArrayLike | None = None,
    inward: bool = False,
    name: str = "box",
) -> wf.Mesh:
    """A closed box of twelve triangles that face out, or in."""
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], float)
    quads = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    faces = np.array([[q[0], q[i], q[i + 1]] for q in quads for i in (1, 2)])
    low, high = np.asarray(low, float), np.asarray(high, float)
    vertices = low + corners * (high - low)
    faces = faces[:, ::-1] if inward else faces
    return wf.Mesh(vertices, faces, material=material, emission=emission, name=name)


class CosineEnvironment(wf.Environment):
    """An environment of radiance max(cosθ, 0) around y, written as a user would write one."""

    def record(self, center: NDArray[np.float64]) -> ConstantEnvironment:
        """Return the light as a record of one column."""
        return _CosineRecord(self.radiance)


class _CosineRecord(ConstantEnvironment):
    __slots__ = ()

    def sample_li(self, point: Floats, u: Floats):
        """Draw a direction uniformly on the sphere."""
        sample = ConstantEnvironment.sample_li(self, point, u)
        sample.radiance = self.le(sample.wi)
        return sample

    def le(self, wi: Floats) -> Floats:
        """Radiance (3, n) of directions (3, n)."""
        return self.radiance * np.maximum(wi[1], f4(0))


# --- Exact values --------------------------------------------------------------------------------


def polygon_irradiance(corners: ArrayLike) -> float:
    """Irradiance at the origin on a surface that faces +y from a polygon of radiance 1 above it.

    Source: J. H. Lambert, Photometria, 1760: half the sum of angle × cosine over the edges.
    """
    v = np.asarray(corners, float)
    v = v / np.linalg.norm(v, axis=1, keepdims=True)
    w = np.roll(v, -1, 0)
    edge = np.cross(v, w)
    angle = np.arctan2(np.linalg.norm(edge, axis=1), (v * w).sum(1))
    return abs(float((angle * edge[:, 1] / np.linalg.norm(edge, axis=1)).sum() / 2))


def disk_irradiance(radius: float, height: float, offset: float) -> float:
    """Irradiance on a floor from a disk of radiance 1 that faces it."""
    a2, h2, x2 = radius**2, height**2, offset**2
    return np.pi / 2 * (1 - (h2 + x2 - a2) / np.sqrt((h2 + x2 + a2) ** 2 - 4 * a2 * x2))


def fresnel(degrees: float, ior: float = 1.5) -> float:
    """Unpolarized reflectance of a dielectric boundary, by Snell and Fresnel as in any textbook."""
    theta = np.radians(degrees)
    sin_t = np.sin(theta) / ior
    if sin_t >= 1:
        return 1.0
    c, ct = np.cos(theta), np.sqrt(1 - sin_t**2)
    s = (c - ior * ct) / (c + ior * ct)
    p = (ior * c - ct) / (ior * c + ct)
    return float((s * s + p * p) / 2)


# --- Direct light (cases 1 to 8) -----------------------------------------------------------------

HERE = (0.0, 0.0, 0.0)
EYE = np.array([0.31, 0.17, 0.23])  # from the point looked at to the camera, clear of the lights


def _lit_floor(*lights: object, at: ArrayLike = HERE) -> wf.Scene:
    shapes = [light for light in lights if isinstance(light, wf.Mesh | wf.Sphere)]
    others = [light for light in lights if not isinstance(light, wf.Mesh | wf.Sphere)]
    return wf.Scene([floor(), *shapes], others, probe(at, np.asarray(at) + EYE))


def _half_matte(light: wf.Mesh, at: ArrayLike) -> wf.Scene:
    """A light above a floor of which half is a mirror; the light is not seen in it."""
    ground = floor(wf.Mix(wf.Diffuse(ALBEDO), wf.Mirror(1.0), 0.5))
    return wf.Scene([ground, light], camera=probe(at, np.asarray(at) + EYE))


def _black_sphere(center: ArrayLike) -> wf.Sphere:
    return wf.Sphere(center, 0.5, material=BLACK, emission=1.0)


NORI_TRIANGLES = (
    (
        0.0898394,
        [(-0.443432, 0.596366, 0.495985), (-0.320397, 0.0677699, -0.229359), (0.0341197, 0.11415, -0.343049)],
    ),
    (
        0.0534198,
        [(0.100871, 0.289075, -0.422609), (-0.308386, 0.629587, 0.423966), (-0.373132, 0.237287, 0.351592)],
    ),
)


def nori_triangle(corners: ArrayLike) -> wf.Scene:
    """A triangle light above a floor, as in the tests `pa5` of Nori (W. Jakob, EPFL)."""
    corners = np.asarray(corners, float)
    normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
    faces = [[0, 1, 2]] if normal @ corners[0] < 0 else [[0, 2, 1]]  # towards the origin
    light = wf.Mesh(corners, faces, material=BLACK, emission=1.0, name="light")
    return wf.Scene([floor(), light], camera=probe(HERE, (0, 0.01, 0), up=(0, 0, 1)))


def _half_hidden(light: object, y: float) -> wf.Scene:
    """Hide all of a light that is at x < 0 from the origin."""
    blocker = wf.Rectangle((-9, y, -9), (9, 0, 0), (0, 0, 18), material=BLACK, name="blocker")
    return _lit_floor(light, blocker)


TILT = np.radians(60)
DIRECT_CASES = [
    Case(
        "point light, straight below",
        lambda: _lit_floor(wf.PointLight((0, 2, 0), 10)),
        2.5 * ALBEDO / np.pi,
        SAMPLING_LIGHTS,
        spp=16,
    ),
    Case(
        "point light, offset 1.5",
        lambda: _lit_floor(wf.PointLight((0, 2, 0), 10), at=(1.5, 0, 0)),
        1.28 * ALBEDO / np.pi,
        SAMPLING_LIGHTS,
        spp=16,
    ),
    Case(
        "two point lights",
        lambda: _lit_floor(wf.PointLight((0, 2, 0), 10), wf.PointLight((1.5, 2, 0), 2)),
        (2.5 + 0.2 * 1.28) * ALBEDO / np.pi,
        SAMPLING_LIGHTS,
    ),
    Case("sphere light", lambda: _lit_floor(_black_sphere((0, 2, 0))), 0.196350 * ALBEDO / np.pi),
    Case(
        "sphere light at 60 degrees",
        lambda: _lit_floor(_black_sphere((-2 * np.sin(TILT), 2 * np.cos(TILT), 0))),
        0.098175 * ALBEDO / np.pi,
        naive_spp=16384,
        later=("naive", "direct_simple"),
    ),
    *(
        Case(
            f"disk light, offset {x}",
            lambda x=x: _lit_floor(disk(1, 2), at=(x, 0, 0)),
            expected * ALBEDO / np.pi,
            naive_spp=16384,
            later=tuple(each for each in ALL if each not in now),
        )
        for x, expected, now in (
            (0, 0.628319, ("direct_mis", "full")),
            (1, 0.460076, ("direct_mis",)),
            (3, 0.080608, ("direct_simple",)),
        )
    ),
    *(
        Case(
            f"rectangle light, {where}",
            lambda x=x, z=z: _lit_floor(panel((-1, -1), (1, 1), 1), at=(x, 0, z)),
            expected * ALBEDO / np.pi,
            spp=16384,
            later=tuple(each for each in ALL if each not in now),
        )
        for where, x, z, expected, now in (
            ("center", 0, 0, 1.740840, ("naive", "direct_mis", "full")),
            ("offset 0.5", 0.5, 0, 1.564202, ("direct_simple",)),
            ("below a corner", 1, 1, 0.652688, ("direct_mis",)),
        )
    ),
    Case(
        # all light comes from one quarter, so lobe and direction must not share a number
        "half-matte floor, below a corner",
        lambda: _half_matte(panel((-1, -1), (1, 1), 1), at=(-1, 0, -1)),
        0.652688 * ALBEDO / np.pi / 2,
        max_error=0.004,
    ),
    Case("environment", lambda: _lit_floor(wf.Environment(1.0)), ALBEDO),
    Case("cosine environment", lambda: _lit_floor(CosineEnvironment(1.0)), 2.094395 * ALBEDO / np.pi),
    Case(
        "half-hidden rectangle",
        lambda: _half_hidden(panel((-1, -1), (1, 1), 1), 0.5),
        0.870420 * ALBEDO / np.pi,
        spp=16384,
        later=("naive", "direct_mis", "full"),
    ),
    Case("half-hidden sphere", lambda: _half_hidden(_black_sphere((0, 2, 0)), 1), 0.098175 * ALBEDO / np.pi),
    Case(
        "half-hidden disk",
        lambda: _half_hidden(disk(1, 2), 1),
        0.628319 / 2 * ALBEDO / np.pi,
        naive_spp=16384,
        later=("naive", "direct_simple", "full"),
    ),
]
TRIANGLE_CASES = [
    Case(
        f"Nori triangle {number}",
        lambda corners=corners: nori_triangle(corners),
        expected,
        spp=16384,
        naive_spp=32768,
        max_error=0.001,
        later=("naive", *ALL[number % 2 :: 2]),
    )
    for number, (expected, corners) in enumerate(NORI_TRIANGLES, 1)
]


# --- Indirect light (cases 9 and 10) -------------------------------------------------------------


def furnace(albedo: float) -> wf.Scene:
    """A closed box with walls of radiance 1, seen from inside."""
    walls = box((-0.5,) * 3, (0.5,) * 3, wf.Diffuse(albedo), emission=1.0, inward=True)
    return wf.Scene([walls], camera=probe((0.5, 0.11, 0.07), (-0.2, 0.1, -0.3)))


def inside_sphere(light: object, emission: float | None = None) -> wf.Scene:
    """A unit sphere seen from inside."""
    shell = wf.Sphere((0, 0, 0), 1.0, material=wf.Diffuse(0.5), emission=emission)
    return wf.Scene([shell], [light] if light else [], probe((0.6, 0.8, 0), (-0.3, 0.2, 0.1)))


def _geometric(ratio: float, bounces: int) -> float:
    return (1 - ratio ** (bounces + 1)) / (1 - ratio)


INDIRECT_CASES = [
    *(
        Case(
            f"furnace of {albedo}, {bounces} bounces",
            lambda albedo=albedo: furnace(albedo),
            _geometric(albedo, bounces),
            ALL if bounces == 1 else INDIRECT,
            spp=8192 if bounces == 64 else 2048,
            naive_spp=8192 if bounces == 64 else 2048,
            max_error=0.001,
            options={"max_bounces": bounces},
            later=ALL if (albedo, bounces) in ((0.8, 1), (0.5, 64)) else (),
        )
        for albedo in (0.5, 0.8)
        for bounces in (1, 8, 64)
    ),
    Case(
        "point light in a sphere",
        lambda: inside_sphere(wf.PointLight((0, 0, 0), np.pi)),
        1.0,
        ("full",),
        spp=2048,
        max_error=0.001,
        options={"max_bounces": 64},
    ),
    Case(
        "point light in a sphere, direct",
        lambda: inside_sphere(wf.PointLight((0, 0, 0), np.pi)),
        0.5,
        SAMPLING_LIGHTS,
        spp=64,
        options={"max_bounces": 1},
    ),
    Case(
        "shining sphere from inside",
        lambda: inside_sphere(None, 0.5),
        1.0,
        INDIRECT,
        spp=2048,
        naive_spp=2048,
        max_error=0.001,
        options={"max_bounces": 64},
    ),
    Case(
        "shining sphere from inside, direct",
        lambda: inside_sphere(None, 0.5),
        0.75,
        options={"max_bounces": 1},
    ),
]


# --- Specular surfaces (cases 11 to 13, 15 and 16) -----------------------------------------------


def glass_surface(degrees: float, from_inside: bool) -> wf.Scene:
    """A glass plane between a bright half-space above and a black one below.

    From above the camera sees the reflectance. From below it sees what gets through, more
    radiant by η² = 2.25.
    """
    theta = np.radians(degrees)
    up = -1 if from_inside else 1
    eye = np.array([np.sin(theta), up * np.cos(theta), 0])
    glass = floor(wf.Dielectric(1.5), half=100)
    dark = floor(BLACK, half=1e4, y=-10)
    return wf.Scene([glass, dark], [wf.Environment(1.0)], probe(HERE, eye))


def metal_surface(degrees: float) -> wf.Scene:
    """A conductor with (η, k) = (2, 4) in an environment of 1."""
    theta = np.radians(degrees)
    eye = np.array([np.sin(theta), np.cos(theta), 0])
    return wf.Scene([floor(wf.Conductor(2, 4))], [wf.Environment(1.0)], probe(HERE, eye))


def slab(degrees: float) -> wf.Scene:
    """A glass plate over a shining floor, seen from above in the dark."""
    theta = np.radians(degrees)
    eye = np.array([np.sin(theta), np.cos(theta), 0])
    plate = box((-500, -1, -500), (500, 0, 500), wf.Dielectric(1.5))
    light = wf.Rectangle((-900, -2, -900), (0, 0, 1800), (1800, 0, 0), material=BLACK, emission=1.0)
    return wf.Scene([plate, light], camera=probe(HERE, eye))


def corridor(reflectance: float, bounces: int) -> wf.Scene:
    """Two facing mirrors between which a ray at 45° is reflected so many times, then an environment."""
    length = bounces + 1.0
    mirror = wf.Mirror(reflectance)
    low = wf.Rectangle((-1, 0, -1), (0, 0, 2), (length, 0, 0), material=mirror)
    high = wf.Rectangle((-1, 1, -1), (0, 0, 2), (length, 0, 0), material=mirror)
    return wf.Scene([low, high], [wf.Environment(1.0)], probe((0.5, 0, 0), (0, 0.5, 0)))


def glass_ball() -> wf.Scene:
    """A lossless glass sphere in an environment of 1."""
    camera = wf.Camera.look_at((0, 1, 4), (0, 0, 0), fov=32, size=(SIDE, SIDE))
    return wf.Scene([wf.Sphere((0, 0, 0), 1, material=wf.Dielectric(1.5))], [wf.Environment(1.0)], camera)


def glass_box() -> wf.Scene:
    """A lossless glass box in an environment of 1."""
    camera = wf.Camera.look_at((2, 3, 4), (0, 0, 0), fov=28, size=(SIDE, SIDE))
    cube = box((-1, -0.8, -0.6), (1, 0.8, 0.6), wf.Dielectric(1.5), name="glass")
    return wf.Scene([cube], [wf.Environment(1.0)], camera)


def through_glass(degrees: float, refracted: float) -> wf.Scene:
    """A glass plane over a narrow light in the dark, where Snell's law sends the ray."""
    theta, x = np.radians(degrees), -np.tan(np.radians(refracted))
    light = wf.Rectangle((x - 0.002, -1, -5), (0, 0, 10), (0.004, 0, 0), material=BLACK, emission=1.0)
    camera = probe(HERE, (np.sin(theta), np.cos(theta), 0))
    return wf.Scene([floor(wf.Dielectric(1.5)), light], camera=camera)


ETA2 = 1.5**2
SPECULAR_CASES = [
    *(
        Case(
            f"Fresnel at {degrees}",
            lambda degrees=degrees: glass_surface(degrees, False),
            expected,
            ALL if degrees == 45 else ("full",),
            naive_spp=1024,
            later=() if degrees == 45 else ALL,
        )
        for degrees, expected in (
            (0, 0.04),
            (30, 0.041523),
            (45, 0.050240),
            (56.309932, 0.073965),  # Brewster's angle: only one polarization is reflected
            (60, 0.089187),
            (75, 0.253061),
            (80, 0.387704),
            (85, 0.612800),
            (89, 0.904185),
        )
    ),
    *(
        Case(
            f"Fresnel at {degrees} from inside",
            lambda degrees=degrees: glass_surface(degrees, True),
            ETA2 * (1 - expected),
            ALL if degrees == 30 else ("full",),
            naive_spp=1024,
            later=() if degrees == 10 else ALL,
        )
        for degrees, expected in ((10, 0.040083), (30, 0.055190), (40, 0.245291))
    ),
    Case(
        "Snell at 45",
        lambda: through_glass(45, 28.125506),
        (1 - 0.050240) / ETA2,
        naive_spp=1024,
        later=("naive", "direct_simple", "direct_mis"),
    ),
    *(
        Case(
            f"conductor at {degrees}",
            lambda degrees=degrees: metal_surface(degrees),
            expected,
            ALL if degrees == 45 else ("full",),
            spp=1024,
            naive_spp=1024,
            later=() if degrees == 60 else ALL,
        )
        for degrees, expected in ((0, 0.68), (45, 0.672879), (60, 0.656533), (80, 0.658843))
    ),
    *(
        Case(
            f"slab at {degrees}",
            lambda degrees=degrees: slab(degrees),
            expected,
            naive_spp=1024,
            options={"max_bounces": 128},
            later=ALL,
        )
        for degrees, expected in ((0, 0.923077), (45, 0.904327))
    ),
    Case(
        "ten mirrors",
        lambda: corridor(0.9, 10),
        0.9**10,
        spp=8192,
        options={"max_bounces": 10},
        later=ALL,
    ),
]


# --- Scenes to compare estimators on -------------------------------------------------------------


def cornell_box(size: tuple[int, int] = (16, 16)) -> wf.Scene:
    """The classic room with two boxes and a light below the ceiling; its front is open."""
    white, green, red = (
        wf.Diffuse(c) for c in ((0.885, 0.699, 0.666), (0.105, 0.378, 0.076), (0.57, 0.043, 0.044))
    )
    walls = [
        wf.Rectangle((-1, -1, -1), (0, 0, 2), (2, 0, 0), material=white, name="floor"),
        wf.Rectangle((-1, 1, -1), (2, 0, 0), (0, 0, 2), material=white, name="ceiling"),
        wf.Rectangle((-1, -1, -1), (2, 0, 0), (0, 2, 0), material=white, name="back"),
        wf.Rectangle((-1, -1, -1), (0, 2, 0), (0, 0, 2), material=red, name="left"),
        wf.Rectangle((1, -1, -1), (0, 0, 2), (0, 2, 0), material=green, name="right"),
    ]
    light = wf.Rectangle(
        (-0.23, 0.99, -0.19),
        (0.46, 0, 0),
        (0, 0, 0.38),
        material=BLACK,
        emission=(18.387, 13.9873, 6.75357),
        name="light",
    )
    boxes = [
        _turned_box((0.335, -0.7, 0.38), (0.3, 0.3, 0.3), -17, white),
        _turned_box((-0.33, -0.4, -0.28), (0.3, 0.61, 0.3), 18.25, white),
    ]
    camera = wf.Camera.look_at((0, 0, 3.9), (0, 0, 0), fov=39.3077, size=size)
    return wf.Scene([*walls, light, *boxes], camera=camera)


def _turned_box(center: ArrayLike, half: ArrayLike, degrees: float, material: wf.Bsdf) -> wf.Mesh:
    cube = box(-np.asarray(half, float), half, material)
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    turn = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
    return wf.Mesh(
        cube.vertices @ turn.T + np.asarray(center, float), cube.faces, material=material, name="box"
    )


def room(size: tuple[int, int] = (16, 16)) -> wf.Scene:
    """The Cornell room with a mirror and a glass sphere instead of boxes, and a large soft light."""
    shapes = cornell_box(size).shapes[:5]
    shapes.append(panel((-0.6, -0.6), (0.6, 0.6), 0.98, emission=(3.0, 2.5, 2.0)))
    shapes.append(wf.Sphere((-0.45, -0.6, -0.3), 0.4, material=wf.Mirror(0.9)))
    shapes.append(wf.Sphere((0.45, -0.6, 0.3), 0.4, material=wf.Dielectric(1.5)))
    return wf.Scene(shapes, camera=cornell_box(size).camera)


def everything(size: tuple[int, int] = (9, 7)) -> wf.Scene:
    """Every kind of shape, material and light, and a mesh with shading normals."""
    scene = room(size)
    bumpy = wf.Mesh(
        [[-0.9, -0.9, 0.2], [-0.2, -0.9, 0.6], [-0.5, -0.2, 0.3]],
        [[0, 1, 2]],
        normals=[[-0.2, 0.1, 1], [0.3, 0.2, 1], [0, 0.4, 1]],
        material=wf.Conductor((0.2, 0.9, 1.1), (3.9, 2.5, 2.2)),
    )
    glow = wf.Sphere((0.0, 0.1, -0.5), 0.15, material=wf.Diffuse(0.3), emission=(0.5, 1.0, 2.0))
    lights = [
        wf.PointLight((0.6, 0.7, 0.6), 0.7),
        wf.PointLight((-0.6, 0.2, 0.9), (0.1, 0.3, 0.2)),
        wf.Environment((0.2, 0.3, 0.5)),
    ]
    return wf.Scene([*scene.shapes, bumpy, glow], lights, scene.camera)


def four_materials() -> list[wf.Shape]:
    """Balls of a matte, a coated, a metallic and a transmitting material on a matte floor."""
    materials = (
        wf.Diffuse(0.7),
        wf.Material.named("plastic"),
        wf.Conductor.named("gold", 0.4),
        wf.Dielectric(1.5, roughness=0.4),
    )
    balls = [wf.Sphere((1.2 * k - 1.8, 0, 0), 0.5, material=each) for k, each in enumerate(materials)]
    return [*balls, wf.Rectangle((-4, -0.5, 4), (8, 0, 0), (0, 0, -8), material=wf.Diffuse(0.5))]
