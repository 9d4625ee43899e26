"""Image environments: convention, exact irradiances, noise, and what is refused."""

import numpy as np
import pytest
import strategies
from hypothesis import given
from inside import (
    ConstantEnvironment,
    Display,
    EnvironmentSum,
    NumpyAccelerator,
    compile_scene,
    f4,
    srgb_to_linear,
    write_image,
)
from near import assert_near
from scenes import ALBEDO, BLACK, EYE, HERE, MET_AND_SAMPLED, floor, panel, probe
from significance import SIDE, Mean, assert_mean, assert_same_images, measure, render, repeat

import wavefront as wf
from wavefront import testing

ORIGIN = np.zeros(3)
SAMPLING = ("direct_simple", "direct_mis", "full")
U = np.random.default_rng(6).random((2, 500), f4)


def turn(around_y: float, around_x: float = 0.0) -> np.ndarray:
    """A rotation about x, then about y, radians."""
    c, s, d, t = np.cos(around_y), np.sin(around_y), np.cos(around_x), np.sin(around_x)
    return np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]]) @ [[1, 0, 0], [0, d, -t], [0, t, d]]


def noise(height: int = 8, width: int = 16) -> np.ndarray:
    """A rough picture."""
    return np.random.default_rng(5).random((height, width, 3)) ** 3


def le(environment: wf.Environment, *directions) -> np.ndarray:
    """Radiance (n, 3) seen in directions."""
    w = np.array(directions, f4).T
    return environment.record(ORIGIN).le(w / np.linalg.norm(w, axis=0)).T


def lit_floor(*lights) -> wf.Scene:
    """A floor, seen at one point."""
    return wf.Scene([floor()], lights, probe(HERE, EYE))


def cosine_map(height: int = 128) -> np.ndarray:
    """Radiance max(cosθ, 0) about +y, at the centers of the pixels."""
    cos = np.cos(np.pi * (np.arange(height) + 0.5) / height)
    return np.broadcast_to(np.maximum(cos, 0)[:, None, None], (height, 2 * height, 3))


def irradiance(rows: np.ndarray, poles: bool = False) -> float:
    """Irradiance on a floor from a map that is the same all around, rows interpolated."""
    theta = (np.arange(20_000) + 0.5) / 20_000 * np.pi / 2
    at = np.linspace(0, 1, len(rows)) if poles else (np.arange(len(rows)) + 0.5) / len(rows)
    radiance = np.interp(theta, np.pi * at, rows)
    return float(2 * np.pi * (radiance * np.cos(theta) * np.sin(theta)).mean() * np.pi / 2)


def sun_map(height: int = 64) -> np.ndarray:
    """A dim sky with a small sun, half of the light."""
    sky = np.full((height, 2 * height, 3), 0.3)
    sky[12, 40] = 900.0
    return sky


# --- Convention ------------------------------------------------------------------------------------


def test_layout() -> None:
    picture = np.zeros((4, 8, 3))
    picture[1:3, 3:5, 0] = 1  # the middle
    picture[1:3, 1:3, 1] = 1  # a quarter of the way from the left
    picture[0, :, 2] = 1  # the top row
    for filter in ("nearest", "bilinear"):
        environment = wf.Environment(picture, filter=filter)
        seen = le(environment, (0, 0, 1), (1, 0, 0), (0, 1, 0), (0, 0, -1), (-1, 0, 0), (0, -1, 0))
        expected = [[1, 0, 0], [0, 1, 0], [0, 0, 1], [0, 0, 0], [0, 0, 0], [0, 0, 0]]
        assert seen == pytest.approx(np.array(expected, float), abs=1e-6)


def around(theta: np.ndarray) -> np.ndarray:
    """Directions (3, 16 n) at angles (n,) from the upper pole, through the middles of 16 columns."""
    longitude = (0.5 - (np.arange(16) + 0.5) / 16) * 2 * np.pi
    level, up = np.sin(theta)[:, None], np.cos(theta)[:, None]
    wi = [level * np.sin(longitude), up + 0 * longitude, level * np.cos(longitude)]
    return np.reshape(wi, (3, -1)).astype(f4)


@pytest.mark.parametrize("filter", ["nearest", "bilinear"])
@pytest.mark.parametrize("rows", ["centers", "poles"])
def test_every_pixel_is_seen_in_its_direction(filter: str, rows: str) -> None:
    picture = noise()
    theta = (np.arange(8) + 0.5) / 8 * np.pi if rows == "centers" else np.arange(8) / 7 * np.pi
    theta = np.clip(theta, 1e-6, np.pi - 1e-6)  # at a pole itself all columns meet
    seen = wf.Environment(picture, filter=filter, rows=rows).record(ORIGIN).le(around(theta))
    assert seen.T.reshape(8, 16, 3) == pytest.approx(picture, abs=2e-5)


def test_rows_from_pole_to_pole() -> None:
    """What lies between the rows, the mean over all directions, and a backdrop."""
    picture = noise()
    sky = wf.Environment(picture, rows="poles", backdrop=picture)
    theta = np.linspace(1e-6, np.pi - 1e-6, 40)
    at = np.arange(8) / 7 * np.pi
    due = [[np.interp(theta, at, picture[:, x, k]) for x in range(16)] for k in range(3)]
    for each in (sky, sky.backdrop):
        assert each is not None
        seen = each.record(ORIGIN).le(around(theta)).reshape(3, 40, 16)
        assert seen == pytest.approx(np.transpose(due, (0, 2, 1)), abs=2e-5)
    theta = (np.arange(7000) + 0.5) / 7000 * np.pi  # the mean over columns is that of the pixels
    rows = np.stack([np.interp(theta, at, picture[:, :, k].mean(1)) for k in range(3)])
    assert sky.radiance.ravel() == pytest.approx((rows * np.sin(theta)).mean(1) * np.pi / 2, rel=0.01)


def test_scale_multiplies_the_radiance() -> None:
    scale = (2, 0.5, 0)
    picture, even = wf.Environment(noise(), scale=scale), wf.Environment((1, 2, 3), scale=scale)
    directions = [(1, 2, 3), (-1, 0.3, 0.1)]
    assert le(picture, *directions) == pytest.approx(le(wf.Environment(noise()), *directions) * scale)
    assert even.radiance.ravel() == pytest.approx([2, 1, 0])
    even.radiance = even.radiance
    assert even.radiance.ravel() == pytest.approx([2, 1, 0])
    with pytest.raises(wf.SceneError, match="Environment scale"):
        wf.Environment(1, scale=-1)


def test_bilinear_wraps_around() -> None:
    picture = np.zeros((2, 4, 3))
    picture[:, 0], picture[:, 3] = 1, 3
    assert le(wf.Environment(picture), (0, 0, -1)) == pytest.approx(2)


@given(strategies.rotations(), strategies.unit_vectors())
def test_transform_turns_the_environment(rotation: np.ndarray, w: np.ndarray) -> None:
    picture = cosine_map(8) + np.arange(3)
    plain = wf.Environment(picture).record(ORIGIN)
    turned = wf.Environment(picture, transform=rotation).record(ORIGIN)
    after = (rotation @ w).astype(f4)
    assert turned.le(after) == pytest.approx(plain.le(w), abs=2e-5)


def test_a_rendered_panorama_is_the_environment() -> None:
    """A camera that looks along +z gives back the map, pixel for pixel."""
    picture = noise()
    camera = wf.Camera.panorama((0, 0, 0), size=(16, 8))
    scene = wf.Scene([wf.Sphere((0, -50, 0), 1e-3)], [wf.Environment(picture, filter="nearest")], camera)
    image = render(scene, 4, max_bounces=0)
    assert image.rgb == pytest.approx(picture.astype(f4), rel=1e-6)


# --- Exact irradiances -----------------------------------------------------------------------------


@pytest.mark.parametrize("integrator", MET_AND_SAMPLED)
@pytest.mark.parametrize("transform", [None, turn(2.0)])
def test_cosine_map(integrator: str, transform) -> None:
    """Case 5 of the reference values: E = 2π/3, to the resolution of the map."""
    environment = wf.Environment(cosine_map(), transform=transform)
    mean = measure(lit_floor(environment), 1024, integrator=integrator, max_bounces=1)
    expected = irradiance(cosine_map()[:, 0, 0])
    assert expected == pytest.approx(2.094395, rel=1e-4)
    assert_mean(mean, expected * ALBEDO / np.pi, 0.002)


@pytest.mark.parametrize("integrator", SAMPLING)
def test_light_of_rows_at_the_poles(integrator: str) -> None:
    """Few rows, most of whose light comes from the cap at the pole."""
    rows = np.array([4.0, 1, 0.5, 0.2])
    environment = wf.Environment(np.broadcast_to(rows[:, None, None], (4, 6, 3)), rows="poles")
    mean = measure(lit_floor(environment), 1024, integrator=integrator, max_bounces=1)
    assert_mean(mean, irradiance(rows, poles=True) * ALBEDO / np.pi, 0.002)


@pytest.mark.parametrize("integrator", SAMPLING)
@pytest.mark.parametrize("column", [0, 3])
def test_one_texel(integrator: str, column: int) -> None:
    """One texel of the top row of an 8 × 4 map: E = 0.196350."""
    picture = np.zeros((4, 8, 3))
    picture[0, column] = 1
    scene = lit_floor(wf.Environment(picture, filter="nearest"))
    mean = measure(scene, 64, integrator=integrator, max_bounces=1)
    assert_mean(mean, 0.196350 * ALBEDO / np.pi, 0.002)


def test_one_bright_pixel_makes_no_fireflies() -> None:
    """No pixel of a picture with 16 samples is far from the mean, though the texel is 1e5 bright.

    With "bilinear" it shines less towards its edges, and pixels scatter by 0.18 of the mean.
    """
    picture = np.full((64, 128, 3), 1e-3)
    picture[10, 50] = 1e5
    for filter, most in (("nearest", 1.05), ("bilinear", 2.5)):
        rgb = render(lit_floor(wf.Environment(picture, filter=filter)), 16, integrator="full").rgb
        assert rgb.max() < most * rgb.mean()


def test_a_constant_picture_is_a_constant() -> None:
    picture = np.broadcast_to([0.25, 0.5, 2.0], (3, 5, 3))
    same, plain = wf.Environment(picture), wf.Environment((0.25, 0.5, 2.0))
    w = np.random.default_rng(0).normal(size=(3, 500)).astype(f4)
    w /= np.linalg.norm(w, axis=0)
    assert same.record(ORIGIN).le(w).tolist() == plain.record(ORIGIN).le(w).tolist()
    assert isinstance(plain.record(ORIGIN), ConstantEnvironment)
    assert same.radiance == pytest.approx(plain.radiance)
    assert same.record(ORIGIN).power(2.0) == pytest.approx(plain.record(ORIGIN).power(2.0))
    assert same.record(ORIGIN).pdf_li(w, w) == pytest.approx(1 / (4 * np.pi), rel=1e-6)
    ours, theirs = (repeat(lit_floor(e), 16, integrator="direct_mis") for e in (same, plain))
    assert_same_images(ours, theirs, 0.01)


def test_estimators_agree_among_shapes() -> None:
    """Sky, sun and a glossy world of shadows: BSDF sampling, light sampling and both."""
    shapes = [
        floor(half=2.0),
        wf.Sphere((0, 0.5, 0), 0.5, material=wf.Mirror(0.8)),
        wf.Sphere((1, 0.4, 0.5), 0.4, material=wf.Diffuse((0.7, 0.3, 0.2))),
    ]
    camera = wf.Camera.look_at((0, 2, 5), (0, 0.4, 0), fov=35, size=(SIDE, SIDE))
    scene = wf.Scene(shapes, [wf.Environment(noise(), transform=turn(0.4, 0.7))], camera)
    full, naive = (repeat(scene, n, integrator=i, max_bounces=4) for n, i in ((32, "full"), (128, "naive")))
    assert_same_images(full, naive, 0.005)


def test_sampling_a_small_sun_beats_chance() -> None:
    """At least ten times less variance than BSDF sampling alone, at equal samples."""
    scene = lit_floor(wf.Environment(sun_map()))
    runs = {
        name: repeat(scene, 64, runs=8, integrator=name, max_bounces=1).var(0).mean()
        for name in ("naive", "direct_mis")
    }
    assert runs["naive"] > 10 * runs["direct_mis"]
    assert runs["naive"] > 100 * runs["direct_mis"]  # and so it is


# --- Sampling --------------------------------------------------------------------------------------


@pytest.mark.parametrize("rows", ["centers", "poles"])
@pytest.mark.parametrize(("filter", "transform"), [("nearest", None), ("bilinear", turn(1.0, 0.5))])
def test_sampling_keeps_the_contract(filter: str, transform, rows: str) -> None:
    """Pdf integrates to one, samples follow it, and carry the radiance that is seen."""
    picture = noise(3, 4)
    picture[1, 2] = 0  # with "nearest" it is never drawn
    environment = wf.Environment(picture, filter=filter, transform=transform, rows=rows)
    testing.check_light(environment, points=[HERE], samples=50_000)


def test_the_density_of_a_texel_at_a_pole_is_its_mean() -> None:
    """Two rows of 1 and 3 share the sphere: 1.5 and 2.5 in the mean over angles."""
    sky = wf.Environment(np.array([[[1.0] * 3], [[3.0] * 3]]), rows="poles").record(ORIGIN)
    w = np.array([[0.6, 0.6], [0.8, -0.8], [0, 0]], f4)
    assert sky.pdf_li(w, w) == pytest.approx([1.5 / 4 / (2 * np.pi), 2.5 / 4 / (2 * np.pi)], rel=1e-6)


SUNS = [wf.DirectionalLight((1, -1, 0.2), 1.0, angle=30), wf.DirectionalLight((0.9, -1, 0.3), 0.5, angle=20)]


@pytest.mark.parametrize("rows", ["centers", "poles"])
@pytest.mark.parametrize("filter", ["nearest", "bilinear"])
def test_densities_are_those_of_one_pass_over_the_image(filter: str, rows: str, monkeypatch) -> None:
    """Light is summed by some rows at a time; here by all, by three of 16 texels, and by one."""
    records = []
    for texels in (1000, 50, 1):
        monkeypatch.setattr("wavefront.lights.image.CHUNK", texels)
        records.append(wf.Environment(noise(), filter=filter, rows=rows).record(ORIGIN))
    for record in records[1:]:
        assert (record.texels.weights() == records[0].texels.weights()).all()
        assert record.mean == pytest.approx(records[0].mean)


@pytest.mark.parametrize("suns", [[], SUNS])
def test_pdf_integrates_to_one(suns: list) -> None:
    """Summed over a fine grid of the sphere, for a map with a small sun, and a sky with two more."""
    environment = wf.Environment(sun_map(), transform=turn(0.3, 0.2))
    record = EnvironmentSum.of([light.record(ORIGIN) for light in (environment, *suns)])
    n = 1400
    cos = (np.arange(n) + 0.5) / n * 2 - 1
    phi = (np.arange(2 * n) + 0.5) / n * np.pi
    total = 0.0
    for c in cos:
        s = np.sqrt(1 - c * c)
        w = np.stack([s * np.cos(phi), s * np.sin(phi), np.full_like(phi, c)]).astype(f4)
        total += float(record.pdf_li(w, w).sum(dtype=float))
    assert total * 4 * np.pi / (2 * n * n) == pytest.approx(1, abs=5e-3)


@pytest.mark.parametrize("filter", ["nearest", "bilinear"])
def test_what_shines_can_be_drawn(filter: str) -> None:
    """The pdf is above 0 wherever the radiance is, next to lone pixels and at the poles, too."""
    picture = np.zeros((16, 32, 3))
    picture[0, 3], picture[15, 31], picture[7, 0], picture[8, 17] = 1, 1, 1, 1
    record = wf.Environment(picture, filter=filter).record(ORIGIN)
    w = np.random.default_rng(1).normal(size=(3, 200_000)).astype(f4)
    w /= np.linalg.norm(w, axis=0)
    radiance, pdf = record.le(w)[0], record.pdf_li(w, w)
    assert (radiance > 0).any()
    assert not ((radiance > 1e-5) & (pdf == 0)).any()
    assert (radiance / np.maximum(pdf, 1e-30)).max() < 30 * (radiance.sum() / len(pdf) * 4 * np.pi)


# --- Several lights at infinity --------------------------------------------------------------------


def test_environment_and_suns_make_one_sky() -> None:
    sky = wf.Environment(cosine_map(64))
    suns = [wf.DirectionalLight((0.2, -1, 0), 1.0, angle=20), wf.DirectionalLight((0, -1, 1), 2.0, angle=40)]
    expected = [
        irradiance(cosine_map(64)[:, 0, 0]),
        np.cos(np.arctan(0.2)),
        np.sqrt(2),
    ]  # these suns are not cut off
    for integrator, spp in (("naive", 2048), ("direct_mis", 256), ("direct_simple", 512)):
        mean = measure(lit_floor(sky, *suns), spp, integrator=integrator, max_bounces=1)
        assert_mean(mean, sum(expected) * ALBEDO / np.pi, 0.002)


def test_a_sky_keeps_the_contract() -> None:
    lights = [wf.Environment(noise(2, 4)), SUNS[0]]
    testing.check_light(
        EnvironmentSum.of([light.record(ORIGIN) for light in lights]), points=[HERE], samples=50_000
    )


def test_a_dark_part_of_a_sky() -> None:
    dark = wf.DirectionalLight((0, -1, 0), 0.0, angle=5)
    assert_mean(measure(lit_floor(wf.Environment(1.0), dark), 64, max_bounces=1), ALBEDO, 0.01)
    assert measure(lit_floor(dark, dark), 4, max_bounces=1).value == 0


# --- Files and errors ------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["sky.exr", "sky.hdr", "sky.npy", "sky.png"])
def test_files(tmp_path, name: str) -> None:
    picture = noise(4, 8).astype(f4)
    write_image(tmp_path / name, picture, Display(gamma="srgb"))
    tolerance = {"sky.hdr": 0.01, "sky.png": 0.01}.get(name, 1e-6)
    seen = wf.Environment(tmp_path / name).radiance
    assert seen == pytest.approx(wf.Environment(picture).radiance, rel=tolerance)


@pytest.mark.parametrize("kind", [np.uint8, np.uint16])
def test_integers_are_srgb(kind) -> None:
    """128 of 255 is 0.2159 of linear light."""
    codes = np.full((2, 4, 3), np.iinfo(kind).max // 2 + 1, kind)
    expected = srgb_to_linear(codes[:1, 0].T / f4(np.iinfo(kind).max))
    assert wf.Environment(codes).radiance == pytest.approx(expected, rel=1e-6)


def test_gray_and_alpha() -> None:
    """One channel is gray; alpha is not used, with a warning where it would matter."""
    gray = np.arange(8.0).reshape(2, 4)
    rgb = np.repeat(gray[:, :, None], 3, 2)
    expected = wf.Environment(rgb).radiance.tolist()
    assert wf.Environment(gray).radiance.tolist() == expected
    assert wf.Environment(gray[:, :, None]).radiance.tolist() == expected
    assert wf.Environment(np.dstack([rgb, np.ones((2, 4))])).radiance.tolist() == expected
    with pytest.warns(UserWarning, match="Environment radiance: 8 pixels are transparent; alpha is not used"):
        assert wf.Environment(np.dstack([rgb, np.full((2, 4), 0.5)])).radiance.tolist() == expected


def test_the_array_is_copied() -> None:
    picture = np.ones((2, 4, 3), f4)
    environment = wf.Environment(picture)
    picture[:] = 7
    assert le(environment, (0, 0, 1)).tolist() == [[1, 1, 1]]


def test_negative_pixels_warn() -> None:
    """Resampled maps have some; they are counted and count as 0."""
    picture = np.ones((2, 4, 3))
    picture[1, 2, 0], picture[1, 3] = -0.5, -1
    with pytest.warns(
        UserWarning, match=r"2 negative pixels count as 0, first: row 1, column 2, \[-0.5, 1.0, 1.0\]"
    ):
        environment = wf.Environment(picture, filter="nearest")
    assert environment.record(ORIGIN).image.mean().tolist() == pytest.approx([0.75, 0.875, 0.875])


PICTURE = np.ones((2, 4, 3))
BAD = {
    "NaN": (
        {"radiance": np.where(np.arange(4)[:, None] == 2, np.nan, PICTURE)},
        r"Environment radiance: 2 pixels .*, first: row 0, column 2, \[nan, nan, nan\]",
    ),
    "infinite": ({"radiance": PICTURE * np.inf}, "8 pixels are not finite"),
    "too large": ({"radiance": PICTURE * 1e39}, r"8 pixels are not finite in float32, .* \[inf, inf, inf\]"),
    "five channels": ({"radiance": np.ones((2, 4, 5))}, r"is float64 of shape \(2, 4, 5\); it must be"),
    "four axes": ({"radiance": np.ones((1, 2, 4, 3))}, r"shape \(1, 2, 4, 3\); it must be \(H, W, 3\)"),
    "text": ({"radiance": np.full((2, 4, 3), "x")}, "it must be"),
    "black": (
        {"radiance": PICTURE * 0},
        r"Environment radiance is black in every pixel; Environment\(0\) is",
    ),
    "no file": ({"radiance": "missing.exr"}, "missing.exr"),
    "no image": ({"radiance": "sky.obj"}, "extension is '.obj'; it must be one of"),
    "filter": (
        {"radiance": PICTURE, "filter": "cubic"},
        "filter is 'cubic'; it must be one of bilinear, nearest",
    ),
    "rows": ({"radiance": PICTURE, "rows": "edges"}, "rows is 'edges'; it must be one of centers, poles"),
    "one row": (
        {"radiance": PICTURE[:1], "rows": "poles"},
        'Environment image has 1 row; with rows="poles" it must have at least 2',
    ),
    "negative": ({"radiance": -1.0}, "Environment radiance is -1; it must be at least 0"),
    "transform scales": (
        {"radiance": PICTURE, "transform": 2 * np.eye(3)},
        "Environment transform must be a rotation, without scale or shear: an element .* is 3,",
    ),
    "transform mirrors": (
        {"radiance": PICTURE, "transform": np.diag([-1, 1, 1])},
        "Environment transform must be a rotation; it mirrors",
    ),
    "transform 4 × 4": ({"radiance": 1.0, "transform": np.eye(4)}, r"must have shape \(3, 3\)"),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_arguments_are_named(name: str) -> None:
    arguments, message = BAD[name]
    with pytest.raises(wf.SceneError, match=message):
        wf.Environment(**arguments)


def test_a_bright_environment_over_a_black_floor() -> None:
    camera = wf.Camera.look_at((0, 1, 0), (0, 2, 1), fov=20, size=(SIDE, SIDE))
    scene = wf.Scene([floor(BLACK)], [wf.Environment(np.full((2, 4, 3), 3.0))], camera)
    assert (render(scene, 1).rgb == 3).all()


# --- Beside BSDF samples ---------------------------------------------------------------------------


def directions(n: int) -> np.ndarray:
    """Unit directions (3, n) all around."""
    w = np.random.default_rng(3).normal(size=(3, n)).astype(f4)
    return w / np.linalg.norm(w, axis=0)


@pytest.mark.parametrize("transform", [None, turn(0.4, 0.3)])
def test_beside_bsdf_samples_what_is_brighter_than_the_mean_is_drawn(transform) -> None:
    """The density is what exceeds a uniform one, in proportion, also at the samples; so is the power."""
    record = wf.Environment(sun_map(), transform=transform).record(ORIGIN)
    left = record.compensated()
    w = directions(20_000)
    excess = np.maximum(record.pdf_li(w, w) - 1 / (4 * np.pi), 0)
    assert_near(left.pdf_li(w, w), excess / left.share, rel=1e-4, abs=1e-6)
    assert left.le(w).tolist() == record.le(w).tolist()
    assert_near(left.power(2.0), left.share * record.power(2.0))
    u = np.random.default_rng(4).random((2, 5000)).astype(f4)
    sample = left.sample_li(w[:, :5000], u)
    assert (sample.pdf > 0).all()
    assert_near(sample.pdf, left.pdf_li(sample.wi, sample.wi), rel=1e-3)
    complete = record.pdf_li(sample.wi, sample.wi)
    assert_near(sample.pdf, (complete - 1 / (4 * np.pi)) / left.share, rel=1e-3)


@pytest.mark.parametrize("radiance", [1.0, np.ones((4, 8, 3)), np.full((16, 32, 3), 0.3)])
def test_light_from_all_around_takes_no_light_samples_beside_bsdf_samples(radiance) -> None:
    """No shadow ray is traced, but by what has nothing else; what paths meet counts in full."""
    scene = wf.Scene([floor()], [wf.Environment(radiance)], wf.Camera.look_at(EYE, HERE, size=(8, 8)))
    for integrator, shadow_rays in (("full", 0), ("direct_mis", 0), ("direct_simple", 1)):
        image = wf.render(scene, 64, integrator=integrator, max_bounces=1, progress=False)
        rays = image.metadata["rays"] / image.metadata["samples"]
        # direct_simple draws half of its directions from below the floor, where no ray is needed
        assert rays == pytest.approx(2 - 0.5 * shadow_rays, abs=0.1), integrator
        expected = ALBEDO * radiance_of(radiance)
        assert image.rgb.mean() == pytest.approx(expected, rel=0.02)
        if not shadow_rays:
            assert image.rgb == pytest.approx(np.full((8, 8, 3), expected), rel=1e-5)


def gradient(contrast: float) -> np.ndarray:
    """Radiance that rises by `contrast` either way of its mean, to the poles: contrast²/3 of variance."""
    up = np.cos(np.pi * (np.arange(32) + 0.5) / 32)
    return np.broadcast_to(1 + contrast * up[:, None, None], (32, 64, 3))


@pytest.mark.parametrize(
    ("image", "drawn"),
    [
        (1 + 0.1 * noise(32, 64), False),
        (gradient(0.5), False),
        (gradient(0.6), True),
        (np.where(np.arange(128) == 40, 6, 1)[:, None] * np.ones((64, 128, 3)), True),
    ],
    ids=["noise", "weak gradient", "gradient", "a bright line of 4 % of the light"],
)
def test_an_image_that_varies_little_takes_no_light_samples_beside_bsdf_samples(image, drawn) -> None:
    """A tenth of its squared mean is what counts as little, wherever it is and however it is turned."""
    record = wf.Environment(image * 7, transform=turn(0.3, 0.8)).record(ORIGIN)
    assert (record.compensated().power(1.0) > 0).tolist() == [drawn]


def radiance_of(radiance) -> float:
    """The one value of a radiance."""
    return float(np.ravel(radiance)[0])


def test_a_sun_before_an_even_sky_gets_all_light_samples() -> None:
    """Of a sky's two parts only what stands out is drawn; its density elsewhere is 0."""
    sky = EnvironmentSum.of([light.record(ORIGIN) for light in (wf.Environment(0.5), SUNS[0])]).compensated()
    w = directions(20_000)
    within = SUNS[0].record(ORIGIN).le(w)[0] > 0
    assert 0 < within.sum() < len(within)
    assert ((sky.pdf_li(w, w) > 0) == within).all()
    assert sky.power(2.0) == pytest.approx(SUNS[0].record(ORIGIN).power(2.0))
    sample = sky.sample_li(w, np.random.default_rng(4).random((2, 20_000)).astype(f4))
    assert (sample.radiance > 0.5).all()


@pytest.mark.parametrize("material", [wf.Conductor.named("gold", roughness=0.7), wf.Diffuse(ALBEDO)])
@pytest.mark.first(1)
def test_an_even_sky_leaves_all_light_samples_to_a_panel(material) -> None:
    """The estimators with BSDF samples draw the panel alone; light samples alone bring the same light."""
    scene = wf.Scene([floor(material), panel((-1, -1), (1, 1), 1)], wf.Environment(0.5), probe(HERE, EYE))
    for mis, drawn in ((False, [True, True]), (True, [True, False])):
        lights = compile_scene(scene, NumpyAccelerator, mis=mis).lights
        number = lights.sample_li(np.zeros((3, 500), f4), np.linspace(0, 1, 500, False, dtype=f4), U)[1]
        assert lights.chosen_from.tolist() == drawn
        assert np.isin([0, 1], number).tolist() == drawn
    found = [measure(scene, 2048, integrator=each, max_bounces=1) for each in SAMPLING]
    for mean in found[1:]:
        error = float(np.hypot(mean.error, found[0].error))
        assert_mean(Mean(mean.value, error, mean.batches), found[0].value, 0.004)


@pytest.mark.slow
def test_compensation_keeps_the_mean() -> None:
    """Of a picture with a sun, with a panel beside it, on a rough metal: as by BSDF samples alone."""
    metal = wf.Conductor.named("gold", roughness=0.7)
    lights = [wf.Environment(np.minimum(sun_map(), 30)), *SUNS]
    scene = wf.Scene([floor(metal)], lights, wf.Camera.look_at(EYE, HERE, size=(8, 8)))
    naive = repeat(scene, 2048, integrator="naive", max_bounces=1, first_seed=100)
    for integrator in ("full", "direct_mis"):
        assert_same_images(repeat(scene, 512, integrator=integrator, max_bounces=1), naive, 0.01)
