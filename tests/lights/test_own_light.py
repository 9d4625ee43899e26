"""Lights of a user's own: the examples of docs/lights.md, and one at infinity."""

import re
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from inside import LightTable, LightTreeSampler, chi_square
from significance import assert_same_images, repeat

import wavefront as wf

PAGE = (Path(__file__).parents[2] / "docs" / "lights.md").read_text("utf-8")
everywhere = pytest.mark.parametrize("integrator", ["naive", "direct_simple", "direct_mis", "full"])
by_light_samples = pytest.mark.parametrize("integrator", ["direct_simple", "direct_mis", "full"])
column = wf.vec.column


@cache
def example(name):
    """Return the class of that name from the document."""
    blocks = re.findall(r"^```python\n(.*?)^```$", PAGE, re.MULTILINE | re.DOTALL)
    (block,) = (block for block in blocks if f"class {name}(" in block)
    space = {"__name__": "own"}
    exec(compile(re.split(r"\n\n\n(?![@c])", block)[0], name, "exec"), space)
    return space[name]


def line(start=(-1, 2, 0), edge=(2, 0, 0), intensity=(3, 2, 1), kind=None):
    return (kind or example("LineLight"))(column(start), column(edge), column(intensity))


def floor(**settings):
    return wf.Rectangle((-4, 0, 4), (8, 0, 0), (0, 0, -8), material=wf.Diffuse(0.5), **settings)


def probe(at=(0, 0, 0), size=(16, 16)):
    """A camera that sees a small piece of the floor."""
    return wf.Camera.look_at(np.add(at, (0.01, 1, 0)), at, fov=0.1, size=size)


def picture(scene, spp, **settings):
    return wf.render(scene, spp, **{"workers": 1, "progress": False, "max_bounces": 1, **settings})


def measure(shapes, lights, spp=64, at=(0, 0, 0), **settings):
    """Return the radiance (3,) of a point of the floor, and its standard error."""
    image = picture(wf.Scene(shapes, lights, probe(at)), spp, **settings)
    error = np.sqrt((image.standard_error**2).sum((0, 1))) / image.rgb[..., 0].size
    return image.rgb.mean((0, 1)), error


def assert_close(found, wanted):
    """Compare means with their errors, which must be below 2 %, within four of these."""
    (a, da), (b, db) = found, wanted
    error = np.hypot(da, db)
    assert (error < 0.02 * b).all()
    assert (np.abs(a - b) <= 4 * error + 1e-5 * b).all()


# --- Without a surface -----------------------------------------------------------------------------


def test_a_line_keeps_the_contract():
    wf.testing.check_light(line(), samples=20_000)


@by_light_samples
def test_a_line_lights_a_floor(integrator):
    """At height h over its middle, of half length a: E = 2·a/(h·√(h² + a²)) times intensity per length."""
    irradiance = 2 / (2 * np.sqrt(5)) * np.array([3, 2, 1]) / 2
    exact = 0.5 / np.pi * irradiance, np.zeros(3)
    assert_close(measure([floor()], [line()], integrator=integrator), exact)
    moved = [floor(), wf.Sphere((20, 1, 0), 0.5)]  # the center of the scene is elsewhere
    assert_close(measure(moved, [line()], integrator=integrator), exact)


@by_light_samples
@pytest.mark.parametrize("accel", ["numpy", "embree"])
def test_a_line_without_length_is_a_point_light(integrator, accel):
    if accel == "embree":
        pytest.importorskip("embreex")
    lamp = wf.Rectangle((-1, 3, -1), (2, 0, 0), (0, 0, 2), emission=(1, 2, 3))
    shapes = [floor(), lamp, wf.Sphere((0.5, 0.5, 0), 0.5)]
    camera = wf.Camera.look_at((0, 3, 6), (0, 0.5, 0), size=(24, 18))
    point, own = wf.PointLight((1, 2, 1), (3, 2, 1)), line((1, 2, 1), (0, 0, 0))
    settings = {"integrator": integrator, "accel": accel, "max_bounces": 3, "light_sampler": "power"}
    one, other = (picture(wf.Scene(shapes, [light], camera), 4, **settings) for light in (point, own))
    np.testing.assert_allclose(one.rgb, other.rgb, rtol=1e-5)


def test_lines_are_joined_and_sampled_beside_others():
    lights = [
        line(),
        line((1, 1, 1), (0, 1, 0)),
        wf.PointLight((-1, 1, 1), 2),
        line((-2, 3, 0), (0, 0, 1), (9, 9, 9)),
    ]
    each = [measure([floor()], [light]) for light in lights]
    total = sum(mean for mean, _ in each), np.sqrt(sum(error**2 for _, error in each))
    assert_close(measure([floor()], lights, 256), total)


def test_the_naive_integrator_says_that_it_cannot_find_it():
    with pytest.warns(UserWarning, match=r"cannot find lights without size \(LineLight\)"):
        picture(wf.Scene([floor()], [line()], probe(size=(4, 4))), 1, integrator="naive")


@by_light_samples
def test_a_class_of_its_own_for_the_scene(integrator):
    """As the package's own lights are made: one class for the scene, and one that is sampled."""

    class Tube(wf.Light):
        def record(self, center):
            return line((-1, 2, 0) - center)

    assert Tube().delta
    found = measure([floor()], [Tube()], integrator=integrator)
    assert_close(found, measure([floor()], [line()], integrator=integrator))


def lines_under_a_ceiling(kind, k=600):
    """Short lines, whose powers differ, all in one plane over the floor."""
    rng = np.random.default_rng(3)
    return [
        line((x, 0.3, z), (0.05, 0, 0), np.full(3, strength * 0.01), kind)
        for x, z, strength in np.stack([*rng.uniform(-4, 4, (2, k)), rng.random(k)], 1)
    ]


class Nowhere(example("LineLight")):
    """The same lines, but they do not say where they are."""

    emitters = wf.LightRecord.emitters


def test_the_tree_draws_lines_by_its_probabilities(tree_of_lights):
    """Those sum to 1, near lines are preferred, and counts of draws agree with them."""
    lights = lines_under_a_ceiling(example("LineLight"))
    kind = type(lights[0]).concatenate(lights)
    choice, k, n = LightTable([kind], (4, 1, 4)).choice, len(kind), 1 << 16
    assert isinstance(choice, LightTreeSampler)
    at = np.array([[1.0], [0], [-2]], np.float32)
    pmf = choice.pmf(np.arange(k), np.repeat(at, k, 1)).astype(float)
    assert pmf.sum() == pytest.approx(1, abs=1e-5)
    away = np.linalg.norm(kind.start - at, axis=0)
    assert pmf[away < 1].sum() > 5 * (away < 1).mean()
    u = (np.random.default_rng(4).integers(0, 1 << 24, n) / (1 << 24)).astype(np.float32)
    light, chance = choice.sample(np.repeat(at, n, 1), u)
    assert (chance == pmf[light]).all()
    _, _, p = chi_square(np.bincount(light, minlength=k), pmf * n)
    assert p > 1e-3


def test_lights_that_say_where_they_are_have_less_noise(tree_of_lights):
    variances, means = [], []
    for kind in (example("LineLight"), Nowhere):
        scene = wf.Scene([floor()], [*lines_under_a_ceiling(kind), wf.Environment(0.01)], probe((1, 0, -2)))
        image = picture(scene, 32, sampler="independent", reuse=False, branches=1)
        variances.append((image.standard_error**2).mean())
        means.append(measure(scene.shapes, scene.lights, 32, (1, 0, -2), sampler="independent"))
    assert variances[0] < 0.1 * variances[1]
    (placed, small), (nowhere, large) = means
    assert (np.abs(placed - nowhere) <= 4 * np.hypot(small, large)).all()


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"middle": np.zeros((3, 2))}, r"middle must have shape \(3, 1\), got \(3, 2\)"),
        ({"middle": np.full((3, 1), np.nan)}, r"middle\[0\]\[0\] is nan; it must be finite"),
        ({"facing": column((0, 2, 0))}, r"facing\[:, 0\] has the length 2; it must be at most 1"),
        ({"extent2": np.array([-1.0])}, r"extent2\[0\] is -1; it must be at least 0"),
        (None, r"must return wf\.Emitters or None, got 3"),
    ],
)
def test_mistakes_of_places_are_named(tree_of_lights, changes, message):
    class Wrong(example("LineLight")):
        def emitters(self):
            return 3 if changes is None else replace(super().emitters().take(np.array([0])), **changes)

    with pytest.raises(wf.SceneError, match=f"Wrong: emitters.*{message}"):
        wf.testing.check_light(line(kind=Wrong), samples=20_000)
    refused([floor()], [line(kind=Wrong), line()], f"Wrong: emitters.*{message}")


# --- With a surface --------------------------------------------------------------------------------

CORNER, EDGE_U, EDGE_V = (-1, 2, -1), (2, 0, 0), (0, 0, 2)


def gradient(kind=None, **settings):
    """A panel, and the light that makes it shine."""
    panel = wf.Rectangle(CORNER, EDGE_U, EDGE_V, material=wf.Diffuse(0), **settings)
    fields = (column(v) for v in (CORNER, EDGE_U, EDGE_V, (1, 0.5, 0.25)))
    return panel, (kind or example("GradientLight"))(*fields, panel)


def twin():
    """The same with the means of the package: colors of vertices."""
    panel, _ = gradient()
    along = (panel.vertices[:, :1] - CORNER[0]) / EDGE_U[0]
    colors = along * np.array([[1, 0.5, 0.25]])
    return wf.Mesh(
        panel.vertices, panel.faces, colors=colors, emission=wf.VertexColors(), material=wf.Diffuse(0)
    )


def test_a_panel_keeps_the_contract():
    _, light = gradient()
    wf.testing.check_light(light, points=[[1, 1, 1]], samples=20_000)


def test_the_check_finds_a_radiance_that_is_not_that_of_the_point():
    class Even(example("GradientLight")):
        def le(self, wi, surface):
            return np.broadcast_to(self.radiance, wi.shape)

    with pytest.raises(AssertionError, match="radiance ≠ le"):
        wf.testing.check_light(gradient(Even)[1], points=[[0, 0, 0]], samples=20_000)


@everywhere
@pytest.mark.first(1)
def test_a_panel_shines_as_one_with_vertex_colors(integrator):
    """On a floor, straight and by a mirror, with other lights beside it."""
    panel, light = gradient()
    spp = 2048 if integrator == "naive" else 256
    for extra in ([], [wf.Rectangle((-3, 0, -3), (6, 0, 0), (0, 4, 0), emission=(0.2, 0.3, 0.5))]):
        own = measure([floor(), panel, *extra], [light], spp, integrator=integrator, at=(0.8, 0, 0.3))
        assert_close(
            own, measure([floor(), twin(), *extra], [], spp, integrator=integrator, at=(0.8, 0, 0.3))
        )


@everywhere
def test_a_panel_is_seen_as_one_with_vertex_colors(integrator):
    mirror = wf.Rectangle((-3, 0, 3), (6, 0, 0), (0, 0, -6), material=wf.Mirror(0.8))
    panel, light = gradient()
    for eye in ((0.5, 0.2, 0.1), (0.5, 3, 3)):
        camera = wf.Camera.look_at(eye, (0, 1, 0), fov=70, size=(24, 18))
        own, other = (
            picture(scene, 2, integrator=integrator, lighting=None)
            for scene in (wf.Scene([mirror, panel], [light], camera), wf.Scene([mirror, twin()], [], camera))
        )
        assert own.rgb.max() > 0.3
        np.testing.assert_allclose(own.rgb, other.rgb, atol=2e-5)


def test_attributes_that_the_light_reads_are_there():

    class ByCoordinates(example("GradientLight")):
        reads = ("uv",)

        def le(self, wi, surface):
            return self.radiance * np.where(self.cosine(wi) > 0, surface.uv[0], np.float32(0))

    panel, light = gradient(ByCoordinates)
    scene = wf.Scene([floor(), panel], [light], wf.Camera.look_at((0.5, 0.2, 0.1), (0, 2, 0), size=(8, 6)))
    found = picture(scene, 1).rgb
    scene.lights = [gradient()[1]]
    scene.lights[0].shape = panel
    np.testing.assert_allclose(found, picture(scene, 1).rgb, atol=2e-5)


def test_a_sphere_of_ones_own():
    """A ball that shines evenly, sampled uniformly over all directions; as one with an emission."""

    @dataclass(eq=False)
    class Ball(wf.LightRecord):
        center: np.ndarray
        radiance: np.ndarray
        shape: wf.Sphere

        def record(self, center):
            return replace(self, center=self.center - column(center))

        def sample_li(self, point, u):
            wi = wf.warp.uniform_sphere(u)
            pdf = self.pdf_li(point, wi)
            return wf.LightSample(wi, self.le(wi), pdf, self.reach(point, wi), np.ones_like(pdf))

        def reach(self, point, wi):
            to = self.center - point
            along = wf.vec.dot(to, wi)
            inside = self.shape.radius**2 - (wf.vec.dot(to, to) - along**2)
            return np.where(inside > 0, along - np.sqrt(np.maximum(inside, 0)), 0).astype(np.float32)

        def pdf_li(self, point, wi):
            return np.where(self.reach(point, wi) > 0, np.float32(0.25 / np.pi), np.float32(0))

        def le(self, wi, surface=None):
            return np.broadcast_to(self.radiance, wi.shape)

        def power(self, scene_radius):
            return 4 * np.pi**2 * self.shape.radius**2 * self.radiance.mean(0)

    black = wf.Sphere((0, 2, 0), 1, material=wf.Diffuse(0))
    light = Ball(column((0, 2, 0)), column((3, 2, 1)), black)
    shining = wf.Sphere((0, 2, 0), 1, material=wf.Diffuse(0), emission=(3, 2, 1))
    for integrator in ("naive", "direct_mis"):  # met by rays, and drawn
        own = measure([floor(), black], [light], 1024, integrator=integrator)
        assert_close(own, measure([floor(), shining], [], 1024, integrator=integrator))


# --- At infinity -----------------------------------------------------------------------------------


class Dome(wf.InfiniteLight):
    """A sky whose radiance is the cosine with the vertical."""

    def sample_li(self, point, u):
        wi = wf.warp.uniform_sphere(u)
        far = np.full(wi.shape[1], np.inf, np.float32)
        return wf.LightSample(wi, self.le(wi), self.pdf_li(point, wi), far, np.ones_like(far))

    def pdf_li(self, point, wi):
        return np.full(wi.shape[1], 0.25 / np.pi, np.float32)

    def le(self, wi, surface=None):
        return np.broadcast_to(wi[1].clip(0), wi.shape)

    def power(self, scene_radius):
        return np.array([np.pi * scene_radius**2 * np.pi])


def test_a_dome_keeps_the_contract():
    wf.testing.check_light(Dome(), samples=20_000)


@everywhere
def test_a_dome_lights_a_floor(integrator):
    """Irradiance ∫cos² dω = 2π/3, and twice as much beside an environment of 2/3."""
    for lights, irradiance in (([Dome()], 2 * np.pi / 3), ([Dome(), wf.Environment(2 / 3)], 4 * np.pi / 3)):
        found = measure([floor()], lights, 512, integrator=integrator)
        assert_close(found, (np.full(3, 0.5 / np.pi * irradiance), np.zeros(3)))


@pytest.mark.parametrize("integrator", ["full", "direct_simple"])
@pytest.mark.first(1)
def test_a_sky_that_is_sampled_for_its_receivers_is_even(integrator):
    """As an environment of the same radiance is, on slopes of all kinds, by means of many pictures."""
    materials = wf.Diffuse(0.6), wf.Conductor.named("gold", 0.5)
    balls = [wf.Sphere((1.2 * k - 0.6, 0.5, 0), 0.5, material=each) for k, each in enumerate(materials)]
    camera = wf.Camera.look_at((0, 1.5, 4), (0, 0.4, 0), fov=30, size=(32, 16))
    skies = example("EvenSky")(column((0, 1, 0))), wf.Environment(1)
    own, even = (
        repeat(
            wf.Scene([floor(), *balls], [sky], camera), 32, 12, 100 * k, max_bounces=2, integrator=integrator
        )
        for k, sky in enumerate(skies)
    )
    assert_same_images(own, even, max_error=0.002)


# --- Mistakes --------------------------------------------------------------------------------------


def refused(shapes, lights, message):
    with pytest.raises(wf.SceneError, match=message):
        picture(wf.Scene(shapes, lights, probe(size=(4, 4))), 1)


def test_what_is_no_light_is_refused():
    with pytest.raises(wf.SceneError, match=r"lights\[0\] is 3; it must be one of .* or a wf\.Light"):
        wf.Scene([floor()], [3])


def test_mistakes_of_a_light_are_named():
    class Nowhere(example("LineLight")):
        record = wf.LightRecord.record

    class Nothing(wf.Light):
        def record(self, center):
            return None

    class Flat(example("LineLight")):
        def sample_li(self, point, u):
            sample = super().sample_li(point, u)
            return replace(sample, pdf=sample.pdf[None])

    class Reads(example("LineLight")):
        reads = ("speed",)

    refused([floor()], [line(kind=Nowhere)], r"Nowhere has no record\(center\)")
    refused([floor()], [Nothing()], r"Nothing: record must return a wf\.LightRecord, got None")
    refused(
        [floor()], [line(kind=Flat)], r"Flat: sample_li's pdf has the shape \(1, \d+\); it must have \(n,\)"
    )
    refused([floor()], [line(kind=Reads)], r"Reads reads 'speed'; it must be one of uv")
    small = wf.Rectangle((-4e-12, 0, 4e-12), (8e-12, 0, 0), (0, 0, -8e-12))
    refused([small], [line()], r"LineLight has no scaled\(factor\)")


def test_mistakes_of_a_shape_are_named():
    panel, light = gradient()
    refused([floor()], [light], "GradientLight: its shape 'rectangle' is not in the scene")
    refused([floor(), panel], [light, light], "GradientLight: its shape is a light already")
    panel.emission = 1.0
    refused([floor(), panel], [light], "GradientLight: its shape is a light already")
    panel.emission, panel.material = None, wf.Material(wf.Diffuse(0.5), alpha=0.5)
    refused([floor(), panel], [light], "must be opaque; its material has an alpha")
    placed = wf.Instance(gradient()[0], np.eye(4))
    refused([floor(), placed], [replace(light, shape=placed)], "must be a wf.Mesh or a wf.Sphere")
    many = replace(light, radiance=np.ones((3, 3), np.float32), corner=np.ones((3, 3), np.float32))
    panel.material = None
    refused([floor(), panel], [many], "record has 3 columns; it must have 1, or 2, one for each face")
