"""Light samples of rectangles, triangles and spheres by what arrives: densities, means and noise."""

from functools import cache

import numpy as np
import pytest
import scenes
from inside import (
    LightRecord,
    Receiver,
    RectangleLights,
    SphereLights,
    TexturedTriangleLights,
    TriangleLights,
    TwoSidedRectangleLights,
    f4,
)
from significance import assert_same_images, repeat

import wavefront as wf

WHITE = np.ones((3, 1), f4)
SETTINGS: dict = {"max_bounces": 3, "accel": "numpy"}
NORMALS = [(0, 1, 0), (1, 0, 0), (-0.6, 0.48, 0.64), (0.6, -0.64, 0.48)]


def rectangle(kind: type[RectangleLights] = RectangleLights) -> RectangleLights:
    """Two by two, one above the origin, shining downward."""
    panel = wf.Rectangle((-1, 1, -1), (2, 0, 0), (0, 0, 2))
    return kind.from_pairs(panel.vertices[panel.faces][:1], WHITE)


def triangle() -> TriangleLights:
    return TriangleLights.from_triangles(np.array([[[1, 2, 0], [0, 2, 0], [0.3, 2.5, 1]]]), WHITE)


def sphere() -> SphereLights:
    return SphereLights(f4([[0], [2], [0.5]]), f4([0.9]), WHITE)


LIGHTS = {
    "rectangle": rectangle,
    "two sides": lambda: rectangle(TwoSidedRectangleLights),
    "triangle": triangle,
    "sphere": sphere,
}


def receiver(normal: tuple[float, ...], n: int = 1, opaque: bool = True) -> Receiver:
    unit = f4(normal).reshape(3, 1) / f4(np.sqrt(np.square(normal).sum()))
    return Receiver(np.repeat(unit, n, 1), np.full(n, opaque))


def samples(
    light: LightRecord, point: tuple[float, ...], n: int = 20_000
) -> tuple[wf.LightSample, np.ndarray]:
    at = np.repeat(f4(point).reshape(3, 1), n, 1)
    return light.sample_li(at, np.random.default_rng(3).random((2, n), f4)), at


@pytest.mark.parametrize("name", LIGHTS)
def test_densities_are_those_of_the_samples(name: str) -> None:
    """From any point and for any normal."""
    rng, n = np.random.default_rng(7), 20_000
    normal = rng.normal(size=(3, n))
    lit = Receiver(f4(normal / np.linalg.norm(normal, axis=0)), rng.random(n) < 0.8)
    at = f4(rng.uniform(-3, 3, (3, n)))
    light = LIGHTS[name]().lighting(lit)
    sample = light.sample_li(at, rng.random((2, n), f4))
    some = np.flatnonzero(sample.pdf)
    ratio = light.pdf_li(at, sample.wi)[some] / sample.pdf[some]
    assert (np.abs(ratio - 1) < 2e-3).mean() > 0.999


@pytest.mark.parametrize("normal", NORMALS)
@pytest.mark.parametrize("name", LIGHTS)
def test_each_density_is_one_over_the_light(name: str, normal: tuple[float, ...]) -> None:
    """By quadrature over points that are uniform on the area, or in solid angle, to 0.2 %."""
    n = 150
    u = ((np.indices((n, n)).reshape(2, -1) + 0.5) / n).astype(f4)
    for point in [(0.2, 0, 0.1), (0.7, 0.9, -0.3), (3, -2, 1), (-1, -2, 4)]:
        light = LIGHTS[name]()
        at = np.repeat(f4(point).reshape(3, 1), n * n, 1)
        plain = light.sample_li(at, u)
        if not plain.pdf.all():
            continue
        density = light.lighting(receiver(normal, n * n)).pdf_li(at, plain.wi)
        assert (density / plain.pdf).mean(dtype=float) == pytest.approx(1, abs=2e-3)


@pytest.mark.parametrize(
    ("point", "normal", "less"),
    [
        ((0.2, 0, 0.1), (1, 0, 0), 2),
        ((0.2, 0, 0.1), (0.3, 1, 0.2), 1.5),
        ((1, -2, 1.5), (0, 1, 0), 15),
        ((3, -1, 0), (-1, 0, 0), 15),
        ((3, 0.5, 0), (0, 1, 0), 3),
    ],
    ids=["near wall", "near floor", "floor", "wall", "ledge"],
)
def test_what_arrives_is_less_noisy(point: tuple[float, ...], normal: tuple[float, ...], less: float) -> None:
    """Than by solid angle, or area, and has the same mean."""
    variances, means = [], []
    n = 20_000
    lit = receiver(normal, n)
    for light in (rectangle(), rectangle().lighting(lit)):
        sample, _ = samples(light, point, n)
        cos = (lit.normal * sample.wi).sum(0).clip(0)
        value = np.where(sample.pdf > 0, cos / sample.pdf, 0).astype(float)
        variances.append(value.var())
        means.append(value.mean())
    assert abs(means[0] - means[1]) < 4 * np.sqrt(sum(variances) / n)
    assert variances[1] < variances[0] / less


def test_a_sphere_above_the_horizon_has_no_noise() -> None:
    """Close to the horizon; where it is partly below, or high up, it is sampled plainly."""
    n = 20_000
    for normal, exact in (((0.7, 0.51, 0.5), True), ((0.8, 0.1, 0.5), False), ((-0.2, 2, 0.4), False)):
        lit = receiver(normal, n)
        sample, at = samples(sphere().lighting(lit), (0.2, 0, 0.1), n)
        assert (sample.pdf == samples(sphere(), (0.2, 0, 0.1), n)[0].pdf).all() != exact
        value = (lit.normal * sample.wi).sum(0).clip(0) / sample.pdf
        assert (value.std() < 1e-4 * value.mean()) == exact
        ahead = sample.wi.astype(float) * sample.distance + at - sphere().center
        assert np.linalg.norm(ahead, axis=0) == pytest.approx(0.9, abs=1e-5)


def test_light_from_behind_counts_for_what_transmits() -> None:
    """Its normal has no effect."""
    point, n = (0.2, -1, 0.1), 100
    up, down = (
        samples(rectangle().lighting(receiver(normal, n, opaque=False)), point, n)[0].wi
        for normal in ((0, 1, 0), (0.6, -0.8, 0))
    )
    assert (up == down).all()


def test_many_triangles_are_sampled_plainly() -> None:
    """Small ones differ in nothing but their choice."""
    rng = np.random.default_rng(0)
    corners = rng.random((200, 3, 3))
    light = TriangleLights.from_triangles(corners, WHITE)
    assert light.lighting(receiver((0, 1, 0), 200)) is light
    numbers = np.zeros(200, np.intp)
    textured = TexturedTriangleLights.textured(corners, WHITE, numbers, numbers, (WHITE,))
    assert textured.lighting(receiver((0, 1, 0), 200)) is textured


def room() -> wf.Scene:
    """Surfaces of several kinds, lit by a panel close to a wall, a textured one, a triangle and a sphere."""
    wall = wf.Rectangle((-4, -0.5, -1.5), (8, 0, 0), (0, 4, 0), material=wf.Diffuse(0.5))
    panel = wf.Rectangle((-2, 1.2, -1.4), (2, 0, 0), (0, 0, 1.2), emission=3)
    lone = wf.Mesh([(1, 2, 1), (2.5, 1.5, 0), (2, 2.5, -1)], [(0, 2, 1)], emission=4, two_sided=True)
    patch = wf.Rectangle((-0.5, 2.5, 1), (1.5, 0, 0), (0, 0, 1.5))
    colors = np.array([[1, 0.2, 0.1], [0.3, 1, 0.2], [0, 0, 1], [1, 1, 1]])
    textured = wf.Mesh(patch.vertices, patch.faces, colors=colors, emission=wf.VertexColors())
    camera = wf.Camera.look_at((0, 1.2, 6), (0, 0.4, 0), fov=30, size=(32, 16))
    lamp = wf.Sphere((2.6, 0.3, 0.6), 0.5, emission=2)
    return wf.Scene([*scenes.four_materials(), wall, panel, lone, textured, lamp], camera=camera)


@pytest.mark.slow
@pytest.mark.parametrize(
    "options",
    [{}, {"branches": 3}, {"guide": True}, {"reuse": True}],
    ids=["plain", "branches", "guided", "shared"],
)
@pytest.mark.first(1)
def test_pictures_keep_their_means(options: dict) -> None:
    """Those of BSDF samples alone, for which light samples do not count."""
    found = repeat(room(), 4, 12, **SETTINGS, **options)
    assert_same_images(found, by_bsdf_samples(), max_error=0.05)


@cache
def by_bsdf_samples() -> list[np.ndarray]:
    """Return pictures of the scene that no light sample has touched."""
    return repeat(room(), 48, 12, 100, integrator="naive", **SETTINGS)
