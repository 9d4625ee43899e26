"""Sampled AOVs: what they hold, that they sum to the picture, and that their bits stay."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from inside import AOVS, accumulate, albedo_of, emitted, intersect, intersect_and_compact
from inside import BSDFS_ALL as ALL
from scipy import stats
from significance import ALPHA, render

import wavefront as wf

SAMPLED = tuple(name for name, layer in AOVS.items() if layer.sampled)
EVERYTHING = (*SAMPLED, "light_groups", "coverage")
INTEGRATORS = ("naive", "direct_simple", "direct_mis", "full")


def room(size: int = 24, point: bool = True) -> wf.Scene:
    """Light of four groups on diffuse, mirror, glass, glossy and half transparent things, and instances."""
    leaf = wf.Rectangle((-0.3, 0, 0), (0.6, 0, 0), (0, 0.6, 0), material=wf.Diffuse((0.2, 0.7, 0.1)))
    veil = wf.Material(wf.Diffuse(0.6), alpha=0.5)
    lamp = wf.Material(wf.Diffuse(0.0), emission=(6, 5, 4), group="lamp")
    return wf.Scene(
        [
            wf.Rectangle((-3, 0, -3), (0, 0, 6), (6, 0, 0), material=wf.Diffuse((0.7, 0.6, 0.5))),
            wf.Sphere((-1, 0.5, 0), 0.5, material=wf.Mirror((0.9, 0.8, 0.7))),
            wf.Sphere((0, 0.5, 0.5), 0.5, material=wf.Dielectric(1.5)),
            wf.Sphere((1, 0.5, 0), 0.5, material=wf.Mix(wf.Mirror(0.9), wf.Diffuse(0.5), 0.5)),
            wf.Sphere(
                (0, 0.3, -1), 0.3, material=wf.Principled((0.8, 0.3, 0.2), metallic=0.5, roughness=0.3)
            ),
            wf.Rectangle((-1.5, 0, 1), (3, 0, 0), (0, 0.6, 0), material=veil),
            wf.Rectangle((-0.5, 2, -0.5), (1, 0, 0), (0, 0, 1), material=lamp),
            *(
                wf.Instance(leaf, [[1, 0, 0, x], [0, 1, 0, 0], [0, 0, 1, -0.8], [0, 0, 0, 1]])
                for x in (-0.9, 0.9)
            ),
        ],
        [
            wf.Environment((0.2, 0.3, 0.5), group="sky"),
            wf.DirectionalLight((1, -2, -1), 3, angle=40, group="sun"),
            *([wf.PointLight((2, 2, 2), 4)] if point else []),
        ],
        wf.Camera.look_at((0, 1.2, 4), (0, 0.5, 0), fov=45, size=(size, size)),
    )


def ulps(found: np.ndarray, *terms: np.ndarray) -> float:
    """Largest difference of the sum of terms from `found`, in units of a float32 ulp of each term."""
    total = sum(term.astype(np.float64) for term in terms)
    room_for_each = sum(np.spacing(np.maximum(np.abs(term), np.abs(found))) for term in terms)
    return float((np.abs(total - found) / room_for_each).max())


# --- The picture stays, and is the sum ------------------------------------------------------------


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_parts_sum_to_the_picture(integrator: str) -> None:
    """Direct and indirect light, and the groups of lights, within an ulp for each term."""
    options = {"branches": 3} if integrator == "full" else {}
    scene = room(point=integrator != "naive")  # which cannot find a point
    image = render(scene, 16, integrator=integrator, aovs=EVERYTHING, **options)
    plain = render(scene, 16, integrator=integrator, **options)
    np.testing.assert_array_equal(image.rgb, plain.rgb)
    np.testing.assert_array_equal(image.standard_error, plain.standard_error)
    assert ulps(image.rgb, image.direct, image.indirect) <= 1
    groups = image.light_groups
    names = ("lamp", "sky", "sun") if integrator == "naive" else ("lamp", "sky", "sun", "default")
    assert set(groups) == set(names)
    assert all(layer.max() > 0 for layer in groups.values())
    assert ulps(image.rgb, *groups.values()) <= 1
    if integrator.startswith("direct"):
        assert not image.indirect.any()


def test_layers_that_are_not_asked_for_are_not_made() -> None:
    plain = render(room(8), 2)
    assert plain.layers == plain.light_groups == plain.coverage == {}
    image = render(room(8), 2, aovs="indirect")
    assert list(image.layers) == list(image.errors) == ["indirect"]
    with pytest.raises(AttributeError, match="no attribute 'dept'; did you mean 'depth'"):
        _ = image.dept
    with pytest.raises(AttributeError, match="render it with aovs="):
        _ = image.direct


def same_mean(a: wf.Image, b: wf.Image, name: str, other: str) -> float:
    """p-value, Šidák-corrected, of two AOVs of independent pictures having one mean in blocks of pixels."""

    def summary(image: wf.Image, layer: str) -> tuple[np.ndarray, np.ndarray]:
        mean = image.rgb if layer == "rgb" else image.layers[layer]
        error = image.standard_error if layer == "rgb" else image.errors[layer]
        side = mean.shape[0] // 4
        cells = [np.square(error, dtype=np.float64) / side**4, mean.astype(np.float64) / side**2]
        variance, value = (cell.reshape(4, side, 4, side, 3).sum((1, 3)) for cell in cells)
        return value, variance

    (mean_a, var_a), (mean_b, var_b) = summary(a, name), summary(b, other)
    z = np.abs(mean_a - mean_b) / np.sqrt(var_a + var_b + 1e-12)
    return float(1 - (1 - 2 * stats.norm.sf(z.max())) ** z.size)


@pytest.mark.parametrize("integrator", ["full", "naive"])
@pytest.mark.first(1)
def test_direct_light_is_that_of_direct_mis(integrator: str) -> None:
    """By a significance test of blocks, in a scene with mirrors, glass and mixtures of both."""
    scene = room(16, point=integrator != "naive")
    image = render(scene, 512 if integrator == "naive" else 256, integrator=integrator, aovs="direct", seed=1)
    expected = render(scene, 256, integrator="direct_mis", seed=2)
    assert same_mean(image, expected, "direct", "rgb") > ALPHA
    brighter = wf.Image(expected.rgb * np.float32(1.05), standard_error=expected.standard_error)
    assert same_mean(image, brighter, "direct", "rgb") < ALPHA  # it would be seen


@pytest.mark.slow
def test_branches_change_no_layer() -> None:
    one = render(room(16), 256, aovs=EVERYTHING, seed=1)
    three = render(room(16), 128, aovs=EVERYTHING, seed=2, branches=3)
    for name in ("direct", "indirect", "denoising_albedo", "denoising_normal", "light_groups.sky"):
        assert same_mean(one, three, name, name) > ALPHA, name


# --- What the AOVs hold ----------------------------------------------------------------------------


def test_albedo_of_a_textured_plane_is_the_texture() -> None:
    """Texel by texel, where a pixel sees only one; its error is 0 there."""
    texels = np.random.default_rng(1).random((8, 8, 3), np.float32)
    texture = wf.Texture(texels, filter="nearest", srgb=False)
    plane = wf.Rectangle((-1, -1, 0), (2, 0, 0), (0, 2, 0), material=wf.Diffuse(texture), emission=0.5)
    camera = wf.Camera.look_at((0, 0, 5), (0, 0, 0), fov=2 * np.degrees(np.arctan(1 / 5)), size=(24, 24))
    for bounces in (0, 4):  # also where no path goes on from the plane
        image = render(
            wf.Scene([plane], [wf.Environment(1)], camera), 4, aovs=("albedo",), max_bounces=bounces
        )
        np.testing.assert_allclose(image.albedo[1::3, 1::3], texels, rtol=0, atol=2**-24)
        assert not image.errors["albedo"][1::3, 1::3].any()


def test_albedo_of_mirrors_is_their_tint_and_of_lights_and_misses_0() -> None:
    """The guides look through the mirror, at the wall behind the camera."""
    wall = wf.Rectangle((-40, -40, 9), (0, 80, 0), (80, 0, 0), material=wf.Diffuse((0.1, 0.5, 0.9)))
    mirror = wf.Rectangle((-4, -9, -2), (4, 0, 0), (0, 18, 0), material=wf.Mirror((0.9, 0.8, 0.7)))
    lamp = wf.Rectangle((0, -9, -2), (1, 0, 0), (0, 18, 0), material=wf.Diffuse(0.0), emission=3)
    camera = wf.Camera.look_at((0, 0, 0), (0, 0, -2), fov=90, size=(16, 16))
    image = render(wf.Scene([wall, mirror, lamp], [], camera), 4, aovs=SAMPLED)
    at_mirror, at_lamp, beside = (
        (slice(None), slice(1, 7)),
        (slice(None), slice(9, 11)),
        (slice(None), slice(13, 16)),
    )
    np.testing.assert_allclose(
        image.albedo[at_mirror], np.broadcast_to((0.9, 0.8, 0.7), (16, 6, 3)), atol=1e-6
    )
    assert not image.albedo[at_lamp].any()
    assert not image.albedo[beside].any()
    assert image.alpha[at_mirror].min() == image.alpha[at_lamp].min() == 1
    assert not image.alpha[beside].any()
    seen = image.denoising_albedo[at_mirror]
    np.testing.assert_allclose(seen, np.broadcast_to((0.1, 0.5, 0.9), seen.shape), atol=1e-6)
    np.testing.assert_allclose(
        image.denoising_normal[at_mirror], np.broadcast_to((0, 0, -1), seen.shape), atol=1e-6
    )
    np.testing.assert_allclose(
        image.denoising_normal[at_lamp],
        np.broadcast_to((0, 0, 1), image.denoising_normal[at_lamp].shape),
        atol=1e-6,
    )
    assert not image.denoising_normal[beside].any()


def test_guides_go_through_glass() -> None:
    shell = wf.Sphere((0, 0, 0), 20, material=wf.Diffuse((0.3, 0.6, 0.2)))
    ball = wf.Sphere((0, 0, 0), 1, material=wf.Dielectric(1.5))
    camera = wf.Camera.look_at((0, 0, 4), (0, 0, 0), fov=20, size=(8, 8))
    image = render(wf.Scene([shell, ball], [wf.PointLight((5, 5, 5), 1)], camera), 4, aovs=SAMPLED)
    assert image.albedo[4, 4].min() > 0.99
    np.testing.assert_allclose(image.denoising_albedo[4, 4], (0.3, 0.6, 0.2), atol=1e-6)


@pytest.mark.parametrize("opacity", [1.0, 0.3])
def test_alpha_of_a_disk_is_its_area(opacity: float) -> None:
    material = wf.Material(wf.Diffuse(0.5), alpha=opacity)
    disk = wf.Disk((0, 0, 0), (0, 0, 1), 0.7, material=material)
    camera = wf.Camera.look_at((0, 0, 5), (0, 0, 0), fov=2 * np.degrees(np.arctan(1 / 5)), size=(16, 16))
    image = render(wf.Scene([disk], [wf.Environment(1)], camera), 256, aovs="alpha", sampler="independent")
    area, error = float(image.alpha.mean()), float(np.sqrt(np.square(image.errors["alpha"]).sum()) / 256)
    exact = opacity * np.pi * 0.7**2 / 4
    assert error < 0.005
    assert abs(area - exact) < 4 * error
    assert 0 < np.count_nonzero((image.alpha > 0) & (image.alpha < 0.9 * opacity)) < 60


def test_alpha_is_filtered_like_the_picture() -> None:
    """Before a black sky, a white disk in even light is as bright as it covers, sample by sample."""
    disk = wf.Disk((0, 0, 0), (0, 0, 1), 0.7, material=wf.Diffuse(0.0), emission=1)
    camera = wf.Camera.look_at((0, 0, 5), (0, 0, 0), fov=23, size=(16, 16))
    for name in ("box", "tent", "gaussian"):
        image = render(wf.Scene([disk], [], camera), 16, aovs="alpha", filter=name)
        np.testing.assert_array_equal(image.alpha, image.rgb[..., 0])


def test_coverage_tells_shapes_apart_by_their_names() -> None:
    """The parts of a pixel that shapes cover sum to alpha, and one behind another counts for nothing."""
    leaf = wf.Rectangle((0, 0, 0), (0.5, 0, 0), (0, 0.5, 0), name="leaf")
    shapes = [
        wf.Rectangle(
            (-1, -1, 0), (1, 0, 0), (0, 2, 0), material=wf.Material(wf.Diffuse(0.5), alpha=0.4), name="left"
        ),
        wf.Rectangle((0, -1, 0), (0.5, 0, 0), (0, 2, 0), name="right"),
        wf.Rectangle((0, -1, -1), (0.5, 0, 0), (0, 2, 0), name="hidden"),
        *(
            wf.Instance(leaf, [[1, 0, 0, 0.5], [0, 1, 0, y], [0, 0, 1, 0], [0, 0, 0, 1]], name="leaf")
            for y in (-1, 0.5)
        ),
    ]
    camera = wf.Camera.look_at((0, 0, 5), (0, 0, 0), fov=2 * np.degrees(np.arctan(1 / 5)), size=(16, 16))
    image = render(wf.Scene(shapes, [wf.Environment(1)], camera), 64, aovs=("alpha", "coverage"))
    parts = image.coverage
    assert list(parts) == ["left", "right", "hidden", "leaf"]
    np.testing.assert_allclose(sum(parts.values()), image.alpha, atol=1e-6)
    assert parts["left"].mean() == pytest.approx(0.4 / 2, abs=0.01)
    assert parts["right"].mean() == pytest.approx(0.25, abs=0.001)
    assert parts["leaf"].mean() == pytest.approx(2 * 0.25 / 4, abs=0.001)
    assert not parts["hidden"].any()


@pytest.mark.slow
def test_errors_are_those_of_the_samples() -> None:
    """The standard error of an AOV predicts the scatter between seeds."""
    runs = [render(room(6), 16, aovs=SAMPLED, seed=seed, sampler="independent") for seed in range(24)]
    for name in SAMPLED:
        layers = np.stack([run.layers[name] for run in runs]).astype(np.float64)
        told = np.sqrt(np.mean([np.square(run.errors[name], dtype=np.float64).mean() for run in runs]))
        seen = np.sqrt(layers.var(0, ddof=1).mean())
        assert told == pytest.approx(seen, rel=0.15), name


@pytest.mark.parametrize("kind", ALL, ids=lambda kind: kind.__name__)
def test_albedo_is_about_the_scattered_part(kind: type[wf.Bsdf]) -> None:
    """Of directions from steep to oblique, by the mean weight of samples."""
    bsdf = {
        "OrenNayar": lambda: wf.OrenNayar(0.5, 0.3, energy_preserving=True),
        "Conductor": lambda: wf.Conductor.named("gold"),
        "Mix": lambda: wf.Mix(wf.Diffuse(0.8), wf.Mirror(0.3)),
        "Disney": lambda: wf.Disney(0.3),
        "Sides": lambda: wf.Sides(wf.Diffuse(0.5)),
    }.get(kind.__name__, kind)()
    cos = np.array([1.0, 0.8, 0.5], np.float32).repeat(4096)
    wo = np.stack([np.sqrt(1 - cos**2), 0 * cos, cos])
    sample = bsdf.sample_f(wo, np.random.default_rng(3).random((bsdf.dimensions, cos.size), np.float32))
    weight = sample.weight if sample.eta is None else sample.weight * sample.eta**2
    seen = weight.reshape(3, 3, 4096).mean(2)
    np.testing.assert_allclose(albedo_of(bsdf, wo)[:, ::4096], seen, atol=0.03)
    np.testing.assert_allclose(wf.Bsdf.albedo(bsdf, wo)[:, ::4096], seen, atol=0.06)


# --- The bits --------------------------------------------------------------------------------------


def assert_same_bits(a: wf.Image, b: wf.Image) -> None:
    """Compare the picture, the AOVs and their errors."""
    assert list(a.layers) == list(b.layers)
    assert list(a.errors) == list(b.errors)
    np.testing.assert_array_equal(a.rgb, b.rgb)
    for name in a.layers:
        np.testing.assert_array_equal(a.layers[name], b.layers[name], err_msg=name)
        if name in a.errors:
            np.testing.assert_array_equal(a.errors[name], b.errors[name], err_msg=name)


@pytest.mark.parametrize("branches", [1, 2])
@pytest.mark.first(1)
def test_bits_depend_on_neither_workers_nor_waves(branches: int) -> None:
    options = {"aovs": EVERYTHING, "branches": branches, "progress": False, "accel": "numpy"}
    one = wf.render(room(12), 5, workers=1, **options)
    for workers, wave, executor in (
        (3, 211, "processes"),
        (8, 300, ThreadPoolExecutor),
    ):
        assert_same_bits(
            one, wf.render(room(12), 5, workers=workers, wave_size=wave, executor=executor, **options)
        )


@pytest.mark.slow
def test_bits_stay_in_adaptive_renders_and_sessions() -> None:
    """Where pixels differ in their samples; the last picture of a session is that of `render`."""
    options = {"noise": 0.05, "aovs": EVERYTHING, "progress": False, "accel": "numpy"}
    one = wf.render(room(12), 600, workers=1, **options)
    assert len(np.unique(one.counts)) > 1
    assert one.counts.max() > 127  # wider numbers
    with wf.Session(room(12), 600, workers=2, wave_size=900, **options) as session:
        *_, last = session
    assert_same_bits(one, last)


def test_many_samples_do_not_overflow() -> None:
    """Albedo and normals of 1 keep their mean beyond 127 samples."""
    plane = wf.Rectangle((-9, -9, 0), (18, 0, 0), (0, 18, 0), material=wf.Diffuse(1.0))
    camera = wf.Camera.look_at((0, 0, 5), (0, 0, 0), fov=30, size=(4, 4))
    image = render(wf.Scene([plane], [wf.Environment(1)], camera), 300, aovs=SAMPLED, wave_size=1000)
    assert (image.albedo == 1).all()
    assert (image.denoising_normal == (0, 0, 1)).all()
    assert not image.errors["albedo"].any()


# --- A user's own ----------------------------------------------------------------------------------


def only_emission(scene, paths, sampler, max_bounces):
    """Show what shines, as in the documents."""
    L = np.zeros((3, len(paths)), np.float32)
    intersect_and_compact(scene, paths, sampler, 0, L, mis=False)
    return L


def without_stages(scene, paths, sampler, max_bounces):
    """Return a gray picture."""
    return np.full((3, len(paths)), 0.5, np.float32)


def doubled(scene, paths, sampler, max_bounces):
    """Return another array than the one that light was added to."""
    return 2 * only_emission(scene, paths, sampler, max_bounces)


def into_two(scene, paths, sampler, max_bounces):
    """Add light to two arrays."""
    L = only_emission(scene, paths, sampler, max_bounces)
    accumulate(np.zeros_like(L), paths, emitted(scene, paths, intersect(scene, paths)))
    return L


def test_own_integrators_give_layers() -> None:
    image = render(room(), 4, integrator=only_emission, aovs=EVERYTHING)
    full = render(room(), 4, aovs=EVERYTHING)
    for name in ("alpha", "albedo"):
        np.testing.assert_array_equal(image.layers[name], full.layers[name])
    np.testing.assert_array_equal(image.direct, image.rgb)
    assert image.layers["light_groups.sky"].any()


@pytest.mark.parametrize(
    ("integrator", "layer", "message"),
    [
        (without_stages, "alpha", "without_stages cannot give the AOV 'alpha': .*intersect_and_compact"),
        (without_stages, "denoising_normal", "'denoising_normal'.*intersect_and_compact"),
        (without_stages, "direct", "without_stages cannot give the AOV 'direct': .*accumulate"),
        (doubled, "indirect", "doubled cannot give the AOV 'indirect': .* the array that it returns"),
        (doubled, "light_groups", "'light_groups'"),
        (into_two, "direct", "into_two cannot give the AOV 'direct'"),
    ],
)
def test_what_an_integrator_cannot_give_is_an_error(integrator, layer: str, message: str) -> None:
    with pytest.raises(wf.SceneError, match=message):
        render(room(8), 1, integrator=integrator, aovs=layer)


class Plain(wf.Bsdf):
    """A BSDF as in the documents: f alone."""

    result: object = None

    def f(self, wo, wi):
        """Return 0.6/π."""
        return np.float32(0.6 / np.pi) * np.broadcast_to(wi[2] > 0, wi.shape)


class Odd(Plain):
    """A BSDF with an albedo of its own."""

    def __init__(self, value) -> None:
        self.value = value

    def albedo(self, wo):
        """Return what was given."""
        return self.value(wo)


def plane_of(bsdf: wf.Bsdf) -> wf.Scene:
    """A wall that fills the picture."""
    wall = wf.Rectangle((-9, -9, 0), (18, 0, 0), (0, 18, 0), material=bsdf)
    return wf.Scene([wall], [wf.Environment(1)], wf.Camera.look_at((0, 0, 5), (0, 0, 0), fov=30, size=(4, 4)))


def test_own_bsdfs_have_an_albedo() -> None:
    """By the mean weight of samples, or their own; of a wrong shape it is an error."""
    image = render(plane_of(Plain()), 2, aovs="albedo")
    np.testing.assert_allclose(image.albedo, 0.6, rtol=1e-5)
    image = render(plane_of(Odd(lambda wo: np.full((3, 1), 1.5, np.float32))), 2, aovs="albedo")
    assert (image.albedo == 1).all()
    with pytest.raises(wf.SceneError, match=r"Odd: albedo has the shape \(3,\); it must have \(3, n\)"):
        render(plane_of(Odd(lambda wo: np.ones(3, np.float32))), 2, aovs="albedo")


class Faulty(Plain):
    """A BSDF whose samples at 1 of 4096 random numbers are NaN."""

    def sample_f(self, wo, u):
        """Return the samples of the base class with some NaN."""
        sample = super().sample_f(wo, u)
        sample.weight[:, u[0] < 1 / 4096] = np.nan
        return sample


def test_samples_that_are_not_finite_count_in_no_layer() -> None:
    scene = plane_of(Faulty())
    scene.camera = scene.camera.resized((32, 32))
    with pytest.raises(wf.RenderError) as caught:
        render(scene, 16, aovs=EVERYTHING)
    image = caught.value.image
    bad = image.metadata["bad_samples"]
    assert bad > 0
    assert image.counts.sum() == 32 * 32 * 16 - bad
    assert (image.alpha == 1).all()
    assert image.denoising_normal[..., 2] == pytest.approx(1)
    assert np.isfinite(image.direct).all()
    assert ulps(image.rgb, image.direct, image.indirect) <= 1
    assert np.abs(image.indirect).max() < 1e-6  # nothing but direct light: they count as 0 there


def test_two_lights_of_the_sky_have_their_own_groups() -> None:
    """A floor below a sky that is the same all around, and below a wide sun."""
    lights = [
        wf.Environment((1, 0.5, 0.2), group="sky"),
        wf.DirectionalLight((0, -1, 0), 3, angle=30, group="sun"),
    ]
    floor = wf.Rectangle((-9, 0, -9), (0, 0, 18), (18, 0, 0), material=wf.Diffuse(0.5))
    camera = wf.Camera.look_at((0, 5, 0.1), (0, 0, 0), fov=20, size=(24, 24))
    image = render(wf.Scene([floor], lights, camera), 64, aovs="light_groups")
    found = {name: layer.mean((0, 1)) for name, layer in image.light_groups.items()}
    assert found["sky"] == pytest.approx([0.5, 0.25, 0.1], rel=0.01)
    assert found["sun"] == pytest.approx([0.5 / np.pi * 3] * 3, rel=0.01)


def test_paths_may_end_at_the_first_primitive() -> None:
    """A light without any reflection, triangle number 0, is seen in a mirror."""
    wall = wf.Mesh([[-90, -90, 5], [0, 90, 5], [90, -90, 5]], [[0, 1, 2]], material=wf.Diffuse(0), emission=1)
    mirror = wf.Rectangle((-9, -9, 0), (18, 0, 0), (0, 18, 0), material=wf.Mirror(1.0))
    scene = wf.Scene([wall, mirror])
    scene.camera = wf.Camera.look_at((0, 0, 3), (0, 0, 0), fov=20, size=(6, 6))
    image = render(scene, 2, aovs="denoising_normal", max_bounces=4)
    assert np.allclose(np.abs(image.denoising_normal), (0, 0, 1), atol=1e-6)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: wf.PointLight((0, 0, 0), 1, group=""), "PointLight group is ''; it must be a name"),
        (lambda: wf.Environment(1, group=3), "Environment group is 3"),
        (lambda: wf.DirectionalLight((0, -1, 0), 1, group=None), "DirectionalLight group is None"),
        (lambda: wf.Material(wf.Diffuse(0.5), group=b"a"), "Material group is b'a'"),
    ],
)
def test_groups_are_names(make, message: str) -> None:
    with pytest.raises(wf.SceneError, match=message):
        make()


def test_groups_of_the_sky_are_told_apart() -> None:
    """An environment and a sun are one light for the samples, and two AOVs."""
    lights = [
        wf.Environment((1, 0, 0), group="red"),
        wf.DirectionalLight((1, 2, 3), (0, 2, 1), angle=90, group="other"),
    ]
    scene = wf.Scene([wf.Sphere((0, 0, 0), 1, material=wf.Diffuse(0.5))], lights)
    image = render(scene, 4, size=(16, 16), aovs="light_groups")
    red, other = image.layers["light_groups.red"], image.layers["light_groups.other"]
    assert not red[..., 1:].any()
    assert not other[..., 0].any()
    np.testing.assert_allclose(red + other, image.rgb, rtol=1e-6)
