"""Media against closed forms."""

import numpy as np
import pytest
import significance
from inside import MediumRays, PhaseBsdf, SurfaceInteraction
from scenes import probe
from significance import assert_mean, assert_same_images, channels, measure, render, repeat

import wavefront as wf

ALL = ("naive", "direct_simple", "direct_mis", "full")
FAR = wf.Sphere((0, 0, -1e4), 1, material=wf.Diffuse(0.0))  # a scene has a shape
integrators = pytest.mark.parametrize("integrator", ALL)


def around(medium, bsdf=None, **more) -> wf.Material:
    """The material of a shape that holds a medium."""
    return wf.Material(bsdf or wf.NullSurface(), interior=medium, **more)


def ball(medium, radius=1.0, at=(0, 0, 0), bsdf=None, **more) -> wf.Sphere:
    return wf.Sphere(at, radius, material=around(medium, bsdf, **more))


def block(medium, low=(-1, -1, -1), high=(1, 1, 1), bsdf=None, **more) -> wf.Mesh:
    low, high = np.array(low, float), np.array(high, float)
    return wf.Box((low + high) / 2, high - low, material=around(medium, bsdf, **more))


# --- Beer and Lambert ------------------------------------------------------------------------------------

SIGMA = np.array([0.2, 1.0, 3.0])


@integrators
@pytest.mark.parametrize("scattering", [0.0, (0.1, 0.2, 0.05)])
def test_light_falls_along_a_ray_through_fog(integrator: str, scattering) -> None:
    """All that is seen of a panel is what is neither absorbed nor scattered: no bounce brings light back."""
    fog = wf.Medium(SIGMA - np.broadcast_to(scattering, 3), scattering)
    panel = wf.Rectangle((-1, -1, 0), (2, 0, 0), (0, 2, 0), emission=1, material=wf.Diffuse(0.0))
    scene = wf.Scene(panel, camera=probe((0, 0, 0), (0, 0, 1.5)), medium=fog)
    for mean, sigma in zip(channels(scene, 256, integrator=integrator, max_bounces=0), SIGMA, strict=True):
        assert_mean(mean, np.exp(-sigma * 1.5), 0.02)


def test_the_camera_may_be_inside() -> None:
    """Of two balls, one within the other, by the way from the camera to the border of each."""
    inner, outer = wf.Medium(0.5), wf.Medium(0.25, emission=1e-9)  # which makes a table necessary
    shapes = [ball(inner), ball(outer, 3.0)]
    for origin, inside, outside in (((0, 0, 0.5), 1.5, 2.0), ((0, 0, 2), 2.0, 3.0), ((0, 0, 4), 2.0, 4.0)):
        camera = wf.Camera.look_at(origin, (0, 0, -9), fov=1e-3, size=(8, 8))
        seen = render(wf.Scene(shapes, wf.Environment(1), camera), 1).rgb
        assert seen == pytest.approx(np.exp(-0.5 * inside - 0.25 * outside), rel=1e-5)


def test_lens_and_parallel_cameras_inside() -> None:
    """Their rays begin at different points, some of them outside."""
    shapes = [ball(wf.Medium(0.5, emission=1e-9))]
    camera = wf.Camera.orthographic((0, 0, 0), (0, 0, -9), height=4, size=(16, 16))
    seen = render(wf.Scene(shapes, wf.Environment(1), camera), 1).rgb[..., 0]
    assert (seen == 1).any()
    assert seen.min() == pytest.approx(np.exp(-0.5), rel=0.01)


def test_a_medium_that_glows_in_endless_fog() -> None:
    """Rays without an end are in fog that does not glow."""
    scene = wf.Scene(
        ball(wf.Medium(1, emission=3)), camera=probe((0, 0, 0), (0, 0, 5)), medium=wf.Medium(0.1)
    )
    due = 3 * -np.expm1(-2) * np.exp(-0.4)
    assert render(scene, 1, lighting=None).rgb == pytest.approx(due, rel=1e-5)
    away = probe((0, 0, 9), (0, 0, 5))
    assert not render(wf.Scene(scene.shapes, camera=away, medium=scene.medium), 1, lighting=None).rgb.any()


def test_instances_hold_media() -> None:
    cube = block(wf.Medium(0.5, emission=1e-9))
    placed = [
        wf.Instance(cube, np.diag([1.0, 1, 2, 1])),
        wf.Instance(cube, np.diag([1.0, 1, 1, 1]) + _moved(4)),
    ]
    camera = probe((0, 0, 0), (0, 0, 9))
    assert render(wf.Scene(placed, wf.Environment(1), camera), 1).rgb == pytest.approx(np.exp(-3), rel=1e-5)


def _moved(z: float) -> np.ndarray:
    matrix = np.zeros((4, 4))
    matrix[2, 3] = z
    return matrix


def test_lights_at_infinity_do_not_get_through_endless_fog() -> None:
    scene = wf.Scene(FAR, [wf.Environment(1)], probe((0, 0, 0), (0, 0, 5)), medium=wf.Medium(0.1))
    with pytest.warns(UserWarning, match="no light of an Environment or a DirectionalLight gets through"):
        render(scene, 1)


GRID = (np.indices((512, 512)).reshape(2, -1).astype(np.float32) + np.float32(0.5)) / np.float32(512)


@pytest.mark.parametrize("length", [0.3, 1.5, np.inf])
@pytest.mark.parametrize("throughput", [(1, 1, 1), (0.7, 0.2, 0.1), (0, 1, 1)])
def test_weights_of_distances(length: float, throughput) -> None:
    """Over all numbers their mean is σs(1 − exp(−σt·s))/σt where light is scattered, and exp(−σt·s) else.

    The same for the mean of cos t, which tells where. Channels without throughput count for nothing.
    """
    record = wf.Medium((0.1, 0.5, 2), (1, 0.7, 0.2)).record(np.zeros(3))
    n = GRID.shape[1]
    zero, weight = np.zeros((3, n), np.float32), np.repeat(np.float32(throughput)[:, None], n, 1)
    far = np.full(n, length, np.float32)
    flight = record.sample(MediumRays(np.zeros(n, int), zero, zero, far, None), weight, GRID)
    sigma_s, sigma = record.scattering.ravel(), record.extinction.ravel()
    met = np.isfinite(flight.t)
    t = (np.arange(200_000) + 0.5) * (min(length, 40) / 200_000)
    for k in np.flatnonzero(throughput):
        falling = sigma_s[k] * np.exp(-sigma[k] * t) * min(length, 40) / t.size
        for form, due in ((np.ones_like, falling.sum()), (np.cos, (falling * np.cos(t)).sum())):
            found = np.where(met, flight.weight[k] * form(np.where(met, flight.t, 0)), 0)
            assert found.mean(dtype=float) == pytest.approx(due, abs=3e-3)
        through = np.where(met, 0, flight.weight[k]).mean(dtype=float)
        assert through == pytest.approx(np.exp(-sigma[k] * length), abs=3e-3)
    carried = (weight * flight.weight).sum(0)
    assert carried.max() <= weight[:, 0].sum() * (1 + 1e-5)  # no sample is brighter than its path


# --- Emission --------------------------------------------------------------------------------------------


@integrators
@pytest.mark.parametrize("depth", [1e-4, 0.04, 2.0])
def test_emission_along_a_ray(integrator: str, depth: float) -> None:
    """ε(1 − exp(−σ·t))/σ."""
    scene = wf.Scene(ball(wf.Medium(depth / 2, emission=3)), camera=probe((0, 0, 0), (0, 0, 5)))
    seen = render(scene, 1, integrator=integrator, lighting=None).rgb
    assert seen == pytest.approx(3 * -np.expm1(-depth) / (depth / 2), rel=1e-5)


@pytest.mark.parametrize("bounces", [0, 1, 3, 60])
def test_the_albedo_series(bounces: int) -> None:
    """In endless glowing fog k scatterings leave Σ ωⁱ, i ≤ k, of the light without any."""
    albedo = np.array([0.3, 0.5, 0.8])
    fog = wf.Medium(albedo=albedo, mean_free_path=(0.5, 1, 2), emission=(2, 1, 0.5))
    scene = wf.Scene(FAR, camera=probe((0, 0, 0), (0, 0, 5)), medium=fog)
    due = (1 - albedo ** (bounces + 1)) / (1 - albedo)
    for mean, each in zip(channels(scene, 64, max_bounces=bounces, lighting=None), due, strict=True):
        assert_mean(mean, each, 0.02)


# --- White furnace ---------------------------------------------------------------------------------------

FURNACES = {
    "ball": lambda m: ball(m),
    "glass ball": lambda m: ball(m, bsdf=wf.Dielectric(1.5)),
    "box": lambda m: block(m),
    "glass box": lambda m: block(m, bsdf=wf.Dielectric(1.3)),
}
WHITE = {
    "isotropic": lambda: wf.Medium(scattering=(0.5, 1, 2)),
    "forward": lambda: wf.Medium(scattering=(2, 1, 1), phase=wf.HenyeyGreenstein(0.7)),
}


def furnace(shape: str, medium: str) -> wf.Scene:
    return wf.Scene(FURNACES[shape](WHITE[medium]()), wf.Environment(1), probe((0, 0, 0), (1, 2, 4)))


@pytest.mark.parametrize("shape", FURNACES)
@pytest.mark.parametrize("medium", WHITE)
def test_white_furnace(shape: str, medium: str) -> None:
    for mean in channels(furnace(shape, medium), 64, max_bounces=500):
        assert_mean(mean, 1.0, 0.015, rounding=2e-5)


@pytest.mark.slow
@pytest.mark.parametrize("shape", FURNACES)
@pytest.mark.parametrize("medium", WHITE)
def test_white_furnace_within_a_thousandth(shape: str, medium: str) -> None:
    for mean in channels(furnace(shape, medium), 8192, max_bounces=500):
        assert_mean(mean, 1.0, 0.001, sigmas=3.5, rounding=2e-5)


# --- Single and multiple scattering ----------------------------------------------------------------------


@pytest.mark.parametrize("phase", [wf.Isotropic(), wf.HenyeyGreenstein(0.6), wf.Rayleigh()], ids=repr)
@pytest.mark.parametrize("integrator", ["direct_simple", "direct_mis"])
def test_single_scattering_of_a_point_light(phase: wf.PhaseFunction, integrator: str) -> None:
    """∫ σs exp(−σt (t + d)) p(cosθ) I/d² dt along the ray, by the trapezoid rule."""
    absorbed, scattered = 0.1, 0.3
    fog = wf.Medium(absorbed, scattered, phase=phase)
    light = wf.PointLight((1, 0, 0), 5)
    scene = wf.Scene(FAR, light, probe((0, 0, 0), (0, 0, 4)), medium=fog)
    t = np.linspace(0, 60, 60_001)
    toward = np.stack([np.ones_like(t), np.zeros_like(t), t - 4])
    d = np.sqrt((toward**2).sum(0))
    cos = -toward[2] / d  # light comes along −toward, and leaves along +z
    values = scattered * np.exp(-(absorbed + scattered) * (t + d)) * phase.p(cos) * 5 / d**2
    assert_mean(measure(scene, 1024, integrator=integrator), np.trapezoid(values, t), 0.01)


def h_function(albedo: float) -> float:
    """Chandrasekhar's H at μ = 1 for isotropic scattering (Radiative Transfer, 1950, §40), by iteration."""
    x, w = np.polynomial.legendre.leggauss(64)
    mu, w = (x + 1) / 2, w / 2
    h = np.ones_like(mu)
    for _ in range(2000):
        h = 1 / (np.sqrt(1 - albedo) + albedo / 2 * (w * mu * h / (mu[:, None] + mu)).sum(1))
    return float(1 / (np.sqrt(1 - albedo) + albedo / 2 * (w * mu * h / (1 + mu)).sum()))


def half_space(albedo: float, light: wf.Light) -> wf.Scene:
    deep = block(wf.Medium(albedo=albedo, mean_free_path=1), (-1e4, -1e4, -1e4), (1e4, 1e4, 0))
    return wf.Scene(deep, light, probe((0, 0, 0), (0, 0, 5)))


@pytest.mark.parametrize("albedo", [0.9, 0.5])
@pytest.mark.first(1)
def test_half_space_in_uniform_light(albedo: float) -> None:
    """Seen along the normal it has the radiance 1 − H(1)√(1 − ω)."""
    due = 1 - h_function(albedo) * np.sqrt(1 - albedo)
    mean = measure(half_space(albedo, wf.Environment(1)), 256, max_bounces=300)
    assert_mean(mean, due, 0.02)


@pytest.mark.parametrize("albedo", [0.5, 0.9])
@pytest.mark.first(1)
def test_half_space_in_a_beam(albedo: float) -> None:
    """ω/(4π) · μ₀/(μ + μ₀) · H(μ)H(μ₀), with both cosines 1: by light samples through the border."""
    due = albedo / (8 * np.pi) * h_function(albedo) ** 2
    scene = half_space(albedo, wf.DirectionalLight((0, 0, -1), 1))
    assert_mean(measure(scene, 256, max_bounces=300), due, 0.02)


def room(medium) -> wf.Scene:
    """A foggy box with a panel, a glass ball with another medium, and a diffuse one."""
    walls = block(None, (-2, -2, -2), (2, 2, 2), bsdf=wf.Diffuse((0.7, 0.4, 0.3)))
    lamp = wf.Rectangle((-1, 1.9, -1), (2, 0, 0), (0, 0, 2), emission=4)
    glass = ball(wf.Medium((0.1, 0.5, 1), 2), 0.7, (-0.8, -1, 0), bsdf=wf.Dielectric(1.4))
    matte = wf.Sphere((0.9, -1, 0.3), 0.6, material=wf.Diffuse(0.6))
    camera = wf.Camera.look_at((0, 0, 1.9), (0, -0.3, 0), fov=70, size=(16, 16))
    return wf.Scene([walls, lamp, glass, matte], camera=camera, medium=medium)


FOG = wf.Medium((0.02, 0.05, 0.1), (0.2, 0.2, 0.3), phase=wf.HenyeyGreenstein(0.4))


@pytest.mark.slow
def test_estimators_agree() -> None:
    full = repeat(room(FOG), 64, integrator="full", max_bounces=6)
    naive = repeat(room(FOG), 256, first_seed=100, integrator="naive", max_bounces=6)
    assert_same_images(full, naive, 0.01)
    guided = repeat(room(FOG), 64, first_seed=200, guide=True, max_bounces=6)
    assert_same_images(full, guided, 0.01)


def test_direct_estimators_agree() -> None:
    one = repeat(room(FOG), 16, runs=8, integrator="direct_simple")
    two = repeat(room(FOG), 16, runs=8, first_seed=50, integrator="direct_mis")
    assert_same_images(one, two, 0.05)


@pytest.mark.parametrize("options", [{"workers": 2, "executor": "threads"}, {"wave_size": 300}], ids=str)
def test_same_bits_whatever_workers_and_waves(options) -> None:
    one, two = (render(room(FOG), 8, max_bounces=5, **more).rgb for more in ({}, options))
    np.testing.assert_array_equal(one, two)


def test_a_render_goes_on_from_a_checkpoint(tmp_path) -> None:
    """With the same bits; not in another medium."""
    whole = render(room(FOG), 8, max_bounces=3).rgb
    path = tmp_path / "render.wfck"
    render(room(FOG), 4, max_bounces=3, checkpoint=path)
    with pytest.raises(wf.SceneError, match=r"another scene|checkpoint"):
        render(room(wf.Medium(0.1, 0.2)), 8, max_bounces=3, checkpoint=path)
    np.testing.assert_array_equal(render(room(FOG), 8, max_bounces=3, checkpoint=path).rgb, whole)


@pytest.mark.slow
def test_same_bits_in_processes() -> None:
    one, two = (
        render(room(FOG), 4, max_bounces=3, **more).rgb
        for more in ({}, {"workers": 2, "executor": "processes"})
    )
    np.testing.assert_array_equal(one, two)


def test_phase_functions_are_shaded_as_they_are() -> None:
    """Value and density are p at the angle between the light's ways, and samples have the weight 1."""
    phase = wf.HenyeyGreenstein(0.7)
    bsdf, u = PhaseBsdf(phase), np.random.default_rng(0).random((2, 1000), np.float32)
    wo = np.repeat(np.float32([[0], [0], [1]]), 1000, 1)
    sample = bsdf.sample_f(wo, u)
    np.testing.assert_allclose(sample.wi[2], -phase.sample(u[0]), rtol=1e-6)
    assert (sample.weight == 1).all()
    for f in (*bsdf.f(wo, sample.wi), bsdf.pdf(wo, sample.wi), sample.pdf, *bsdf.evaluate(wo, sample.wi)[0]):
        np.testing.assert_allclose(f, phase.p(-sample.wi[2]), rtol=1e-6)


# --- Priorities ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("first", [0, 1])
def test_overlaps_go_to_the_higher_priority(first: int) -> None:
    """Two boxes share [0, 1]; the ray passes [-1, 2]."""
    priority = (1, 0) if first == 0 else (0, 1)
    one = block(wf.Medium(0.5), (-1, -1, -1), (1, 1, 1), priority=priority[0])
    two = block(wf.Medium(0.2), (-1, -1, 0), (1, 1, 2), priority=priority[1])
    depth = 0.5 * 2 + 0.2 * 1 if first == 0 else 0.5 * 1 + 0.2 * 2
    for origin in ((0, 0, 5), (0, 0, -5)):
        scene = wf.Scene([one, two], wf.Environment(1), probe((0, 0, 0), origin))
        assert render(scene, 1).rgb == pytest.approx(np.exp(-depth), rel=1e-5)


def openpbr(ior: float, priority: int | None = None) -> wf.Material:
    return wf.OpenPBR(transmission_weight=1, specular_ior=ior, specular_roughness=0, priority=priority)


CLEAR = {
    "dielectric": wf.Dielectric,
    "principled": lambda ior: wf.Principled(1, 0, 0, ior, 1),
    "disney": lambda ior: wf.Disney(1, 0, ior=ior, transmission=1),
    "openpbr": lambda ior: openpbr(ior).bsdf,
}


@pytest.mark.parametrize("clear", CLEAR.values(), ids=CLEAR)
def test_nested_dielectrics(clear) -> None:
    """A panel in water behind a glass pane that reaches into the water, by Fresnel's reflectances."""
    glass = block(None, (-9, -9, 0), (9, 9, 1), bsdf=clear(1.5), priority=2)
    water = block(None, (-9, -9, -9), (9, 9, 0.5), bsdf=clear(1.33), priority=1)
    panel = wf.Rectangle((-1, -1, -1), (2, 0, 0), (0, 2, 0), emission=1, material=wf.Diffuse(0.0))
    scene = wf.Scene([glass, water, panel], camera=probe((0, 0, 0), (0, 0, 5)))
    through = [1 - ((a - b) / (a + b)) ** 2 for a, b in ((1.5, 1.0), (1.5, 1.33))]
    mean = measure(scene, 256, max_bounces=2, integrator="naive", lighting=None)
    assert_mean(mean, through[0] * through[1] / 1.33**2, 0.005)


def test_a_coat_of_the_index_around_it_is_not_seen() -> None:
    up, zero = np.repeat(np.float32([[0], [0], [1]]), 8, 1), np.zeros(8, np.float32)
    lane, water = np.zeros(8, np.intp), np.full(8, 1.33, np.float32)
    surface = SurfaceInteraction(0 * up, zero, up, up, up, lane, lane, np.zeros(8, bool), index_around=water)
    wi = np.float32([[0.6, -0.3, 0.5, 0, 0.6, -0.3, 0.5, 0]] * 2 + [[0.4, 0.5, 0.7, 1, -0.4, -0.5, -0.7, -1]])
    wi, wo = wi / np.linalg.norm(wi, axis=0), np.float32([[0.6], [0], [0.8]]) * np.ones(8, np.float32)
    some = {"transmission_weight": 1, "specular_roughness": 0.5}
    coated = wf.OpenPBR(coat_weight=1, coat_ior=1.33, **some).bsdf.bind(surface).f(wo, wi)
    np.testing.assert_allclose(coated, wf.OpenPBR(**some).bsdf.bind(surface).f(wo, wi), 1e-4)
    assert wf.OpenPBR(priority=2).priority == 2


@pytest.mark.parametrize("executor", ["threads", "processes"])
def test_more_than_four_shapes_around_a_path(executor: str) -> None:
    """The warning comes once, and in the caller, whatever the number of jobs."""
    shells = [ball(wf.Medium(0.1, emission=1e-9), radius) for radius in (1.0, 1.5, 2.0, 2.5, 3.0)]
    scene = wf.Scene(shells, wf.Environment(1), probe((0, 0, 0), (0, 0, 5)))
    with pytest.warns(UserWarning, match="inside of more than 4 shapes") as caught:
        render(scene, 64, executor=executor, workers=2, wave_size=256)
    assert [each.filename for each in caught] == [significance.__file__]


# --- The rest --------------------------------------------------------------------------------------------


def test_layers_of_fog() -> None:
    """What is scattered covers; the depth is that of the first surface."""
    floor = wf.Rectangle((-9, 0, 9), (18, 0, 0), (0, 0, -18))
    camera = wf.Camera.look_at((0, 0, 5), (0, 0, 0), fov=90, size=(8, 8))
    scene = wf.Scene([floor], wf.PointLight((0, 1, 0), 5), camera, medium=wf.Medium(scattering=50))
    aovs = ["alpha", "depth", "albedo", "normal", "direct", "light_groups"]
    image = render(scene, 4, aovs=aovs, max_bounces=3)
    assert (image.alpha == 1).all()
    clear = render(wf.Scene([floor], wf.PointLight((0, 1, 0), 5), camera), 4, aovs=["depth"])
    np.testing.assert_array_equal(image.layers["depth"], clear.layers["depth"])
    assert image.layers["light_groups.default"] == pytest.approx(image.rgb, abs=1e-6)


def test_light_groups_of_emission() -> None:
    """It is in the default group, whatever the last light is in; the sum of all is the picture."""
    sky = [wf.DirectionalLight((0, -1, 0), 1, group="sun"), wf.Environment(0.5, group="sky")]
    glowing = ball(wf.Medium(1, 1, emission=2))
    scene = wf.Scene(glowing, sky, probe((0, 0, 0), (0, 0, 5)))
    layers = render(scene, 16, aovs=["light_groups"]).layers
    alone = render(wf.Scene(glowing, camera=scene.camera), 16, aovs=["light_groups"], lighting=None)
    assert layers["light_groups.default"] == pytest.approx(alone.rgb, rel=1e-5)
    image = render(scene, 16, aovs=["light_groups"])
    assert sum(image.layers[f"light_groups.{name}"] for name in ("default", "sun", "sky")) == pytest.approx(
        image.rgb, rel=1e-5
    )


def test_scenes_without_scattering_need_no_table() -> None:
    from wavefront.accel import make_accelerator
    from wavefront.features.compiling import compile_scene

    for interior in (None, wf.Medium(2.0), wf.Medium()):
        scene = wf.Scene(ball(interior, bsdf=wf.Dielectric()), wf.Environment(1))
        assert compile_scene(scene, lambda g: make_accelerator(g, "numpy")).media is None


@pytest.mark.parametrize(
    "tinted",
    [
        wf.Medium((0.2, 1, 3)),
        wf.Medium((0.1, 0.5, 1.5), scale=2),
        wf.Medium(albedo=0, mean_free_path=(5, 1, 1 / 3)),
    ],
)
def test_absorption_alone_is_as_before(tinted: wf.Medium) -> None:
    """With and without the table the light through a ball of glass is the same."""
    camera = wf.Camera.look_at((0, 0, 5), (0, 0, 0), fov=30, size=(16, 16))
    one, two = (
        render(
            wf.Scene(ball(tinted, bsdf=wf.Dielectric(1.5)), wf.Environment(1), camera, medium=around), 4
        ).rgb
        for around in (None, wf.Medium())
    )
    np.testing.assert_allclose(one, two, rtol=1e-5)


@pytest.mark.parametrize("setting", ["caustics", "reuse"])
def test_what_media_exclude_is_refused(setting: str) -> None:
    with pytest.raises(wf.SceneError, match=f"{setting}=True does not go with media that scatter"):
        render(room(FOG), 1, **{setting: True})


@pytest.mark.parametrize("scattering", [0, 1])
def test_media_scale_with_the_scene(scattering: int) -> None:
    """In scenes of extreme size, which are rendered in another unit."""
    small, large = (
        render(
            wf.Scene(
                ball(wf.Medium(0.5 / size, scattering / size), size),
                wf.Environment(1),
                wf.Camera.look_at((0, 0, 5 * size), (0, 0, 0), fov=25, size=(8, 8)),
            ),
            16,
        ).rgb
        for size in (1.0, 2.0**60)
    )
    np.testing.assert_allclose(small, large, rtol=1e-4)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: wf.Medium(scattering=-1), "Medium scattering is -1; it must be at least 0"),
        (lambda: wf.Medium(albedo=0.5), "albedo and mean_free_path belong together"),
        (lambda: wf.Medium(1, albedo=0.5, mean_free_path=1), "in place of absorption and scattering"),
        (lambda: wf.Medium(albedo=1.5, mean_free_path=1), "Medium albedo is 1.5; it must be in"),
        (
            lambda: wf.Medium(albedo=0.5, mean_free_path=0),
            "Medium mean_free_path is 0; it must be more than 0",
        ),
        (lambda: wf.Medium(phase=0.5), "Medium phase must be a phase function"),
        (lambda: wf.Medium(scale=-1), "Medium scale is -1"),
        (lambda: wf.Material(wf.Diffuse(), priority=0.5), "Material priority is 0.5"),
        (lambda: wf.Scene(FAR, medium=3), "medium must be a Medium"),
    ],
)
def test_mistakes_are_named(make, message: str) -> None:
    with pytest.raises(wf.SceneError, match=message):
        make()


def test_other_ways_to_say_it() -> None:
    one = wf.Medium(0.5, 1.5, scale=2)
    two = wf.Medium(albedo=0.75, mean_free_path=0.25)
    np.testing.assert_allclose(one.sigma_a, two.sigma_a)
    np.testing.assert_allclose(one.sigma_s, two.sigma_s)
