"""Light samples of environments by light times cosine: densities, means and noise."""

import tracemalloc
from collections.abc import Callable
from functools import cache

import numpy as np
import pytest
import scenes
from inside import (
    NO_NORMAL,
    CosineProduct,
    EnvironmentSum,
    LightRecord,
    NumpyAccelerator,
    Receiver,
    TexelProduct,
    compile_scene,
    f4,
    octahedral_bins,
    octahedral_normals,
)
from near import assert_near
from significance import assert_same_images, repeat

import wavefront as wf
from wavefront import testing

SETTINGS: dict = {"max_bounces": 3, "accel": "numpy"}
NORMALS = [(0, 1, 0), (0, -1, 0), (1, 0, 0), (-0.6, 0.48, 0.64), (0.1, -0.2, -0.97)]


def sky(height: int = 24, width: int = 40) -> np.ndarray:
    """A dim sky of noise with a small sun."""
    image = 0.2 + np.random.default_rng(5).random((height, width, 3)) ** 3
    image[5, 11] = 20
    return image


def lighting(image: np.ndarray, normal: tuple[float, ...], opaque: bool = True, **options) -> LightRecord:
    """Return an environment as it is sampled for surfaces of one normal."""
    size = np.sqrt(np.square(normal).sum())
    receiver = Receiver(f4(normal).reshape(3, 1) / f4(size), np.array([opaque]))
    return wf.Environment(image, **options).record(np.zeros(3)).compensated().lighting(receiver)


def test_tables_are_made_once_for_an_environment() -> None:
    """And anew when it has got another image."""
    sky = wf.Environment(np.random.default_rng(1).random((8, 16, 3)))
    tables = sky.record(np.zeros(3)).compensated()
    assert sky.record(np.ones(3)).compensated() is tables
    sky.radiance = np.random.default_rng(2).random((8, 16, 3))
    assert sky.record(np.zeros(3)).compensated() is not tables


def memory(make: Callable[[], object]) -> tuple[int, int]:
    """The bytes that something made keeps, and their peak while it is made."""
    tracemalloc.start()
    kept = make()
    size, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    del kept
    return size, peak


def sampled(**options) -> Callable[[], wf.Environment]:
    """Return what makes an environment and draws light samples for a surface and for none."""

    def make() -> wf.Environment:
        environment = wf.Environment(**options)
        record = environment.record(np.zeros(3)).compensated()
        lit = record.lighting(Receiver(f4([[0], [1], [0]]), np.array([True])))
        for each in (record, lit):
            each.pdf_li(np.zeros((3, 1), f4), each.sample_li(np.zeros((3, 1), f4), f4([[0.3], [0.6]])).wi)
        return environment

    return make


def test_bytes_for_each_pixel() -> None:
    """12 of the image, 4 of densities by light alone, 10 by light times cosine; 12 and 4 of a backdrop."""
    images = [np.random.default_rng(1).random((height, 2 * height, 3), f4) ** 4 for height in (256, 512)]
    more = images[1].size / 3 - images[0].size / 3
    sampled(radiance=images[0])()
    (kept, _), (most, peak) = (memory(sampled(radiance=image)) for image in images)
    assert (most - kept) / more == pytest.approx(26.1, abs=0.2)
    assert kept - 26.1 * images[0].size / 3 < 1.5e6
    assert peak < 45 * images[1].size / 3
    shown, _ = memory(sampled(radiance=images[0], backdrop=images[1]))
    assert (shown - kept) / (images[1].size / 3) == pytest.approx(16, abs=0.2)


def test_without_an_image_no_table_is_made(calls_of) -> None:
    made = calls_of("wavefront.lights.image.CosineProduct"), calls_of("wavefront.lights.image.Distribution2D")
    lights = wf.PointLight((0, 3, 0), 5), wf.DirectionalLight((0, -1, 0), 1, angle=3), wf.Environment(0.5)
    panel = wf.Rectangle((-1, 2, -1), (2, 0, 0), (0, 0, 2), emission=3)
    for image, tables in ((None, 0), (sky(), 1)):
        scene = wf.Scene([*scenes.four_materials(), panel], lights)
        if image is not None:
            scene.lights = [*lights[:2], wf.Environment(image)]
        compile_scene(scene, NumpyAccelerator, mis=True)
        assert [len(calls) for calls in made] == [tables, tables]


@pytest.mark.parametrize("shape", [(24, 40), (5, 9), (1, 2), (70, 133)])
def test_densities_are_one_over_the_image(shape: tuple[int, int]) -> None:
    light = np.random.default_rng(1).random(shape) ** 4
    light[0, 0] = 0
    product = CosineProduct(light, None)
    y, x = ((np.indices(shape).reshape(2, -1) + 0.5) / np.array(shape)[:, None]).astype(f4)
    for normal in [0, 17, 130, NO_NORMAL - 1, NO_NORMAL]:
        density = product.pdf(x, y, np.full(x.size, normal))
        assert_near(density.mean(dtype=float), 1, rel=1e-5)
        assert (density > 0).tolist() == (light.ravel() > 0).tolist()
    assert_near(density, (light / light.mean()).ravel(), rel=1e-4)


def test_texels_are_those_of_the_points() -> None:
    rng, shape, n = np.random.default_rng(2), (24, 40), 20_000
    light, directions = rng.random(shape, f4) ** 4, rng.normal(size=(3, *shape))
    directions /= np.linalg.norm(directions, axis=0)
    u, normal = rng.random((2, n), f4), rng.integers(0, NO_NORMAL + 1, n)
    points, texels = (kind(light, None, directions, (6, 5)) for kind in (CosineProduct, TexelProduct))
    x, y, pdf = points.sample(u, normal)
    texel, x_of_texel, y_of_texel, same_pdf = texels.sample_texels(u, normal)
    assert np.array_equal(texel, (y * shape[0]).astype(int) * shape[1] + (x * shape[1]).astype(int))
    assert np.allclose([x_of_texel, y_of_texel], [x, y], atol=1e-5)
    assert np.array_equal(same_pdf, pdf)
    assert np.array_equal(texels.pdf_of_texels(texel, normal), pdf)


@pytest.mark.parametrize("opaque", [True, False])
@pytest.mark.parametrize("normal", NORMALS)
@pytest.mark.first(1)
def test_the_contract_holds_for_each_normal(normal: tuple[float, ...], opaque: bool) -> None:
    turn = np.linalg.qr([[3.0, 1, 2], [-1, 4, 1], [1, -2, 5]])[0]
    turn *= np.sign(np.linalg.det(turn))
    testing.check_light(lighting(sky(), normal, opaque, transform=turn), points=[[0, 0, 0]], samples=30_000)


@pytest.mark.slow
def test_a_sum_of_lights_at_infinity_is_sampled_for_normals() -> None:
    """With a sun beside the sky; directions below the surface are as rare as in the sky alone."""
    normals = np.repeat(f4(NORMALS[:2]).T, 50_000, axis=1)
    yes = np.ones(normals.shape[1], np.bool_)
    parts = [
        light.record(np.zeros(3))
        for light in (
            wf.Environment(np.ones((16, 32, 3)) + sky(16, 32)),
            wf.DirectionalLight((-0.2, -1, -0.1), 3, angle=8),
        )
    ]
    both = EnvironmentSum.of(parts).compensated()
    lit = both.lighting(Receiver(normals, yes))
    u = np.random.default_rng(0).random((2, yes.size), f4)
    sample = lit.sample_li(np.zeros_like(normals), u)
    of_sun = parts[1].pdf_li(normals, sample.wi) > 0
    up = (sample.wi * normals).sum(0)[~of_sun] > 0
    assert up.mean() > 0.9
    half = np.arange(yes.size) < 50_000
    for of, normal in ((half, NORMALS[0]), (~half, NORMALS[1])):
        one = Receiver(f4(normal).reshape(3, 1), yes[:1])
        testing.check_light(both.lighting(one), points=[[0, 0, 0]], samples=10_000)
        alone = both.lighting(one).pdf_li(np.zeros((3, 1), f4), sample.wi[:, of])
        assert (sample.pdf[of] == alone).all()


@pytest.mark.parametrize("normal", NORMALS)
def test_most_light_samples_are_above_the_surface(normal: tuple[float, ...]) -> None:
    u = np.random.default_rng(0).random((2, 20_000), f4)
    samples = lighting(np.ones((16, 32, 3)) + sky(16, 32), normal).sample_li(np.zeros((3, u.shape[1]), f4), u)
    unit = np.array(normal) / np.linalg.norm(normal)
    assert (unit @ samples.wi > 0).mean() > 0.9


def test_normals_are_found_in_their_bins() -> None:
    middle = octahedral_normals().astype(f4)
    assert octahedral_bins(middle).tolist() == list(range(NO_NORMAL))
    any_ = np.random.default_rng(0).normal(size=(3, 5000))
    any_ /= np.linalg.norm(any_, axis=0)
    near = octahedral_normals()[:, octahedral_bins(any_.astype(f4))]
    assert (any_ * near).sum(0).min() > 0.96
    poles = f4([[0, 0, 0, 1], [0, 0, -1, 0], [1, -1, 0, 0]])
    assert (octahedral_bins(poles) < NO_NORMAL).all()


def surfaces() -> wf.Scene:
    """Matte, glossy, rough and transmitting surfaces, a panel, and two environments in one."""
    camera = wf.Camera.look_at((0, 1.2, 6), (0, 0, 0), fov=30, size=(32, 16))
    return wf.Scene(scenes.four_materials(), [wf.Environment(sky())], camera)


@pytest.mark.parametrize(
    "options",
    [{}, {"reuse": True}, {"background": "transparent"}, {"branches": 3}, {"guide": True}],
    ids=["plain", "shared", "background", "branches", "guided"],
)
@pytest.mark.first(1)
def test_pictures_keep_their_means(options: dict) -> None:
    """Those of BSDF samples alone, for which light samples do not count."""
    found = repeat(surfaces(), 12, 12, **SETTINGS, **options)
    assert_same_images(found, by_bsdf_samples(options.get("background")), max_error=0.05)


@cache
def by_bsdf_samples(background: str | None) -> list[np.ndarray]:
    """Return pictures of the scene that no light sample has touched."""
    return repeat(surfaces(), 64, 12, 100, integrator="naive", background=background, **SETTINGS)
