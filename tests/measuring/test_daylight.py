"""Daylight coefficients, weather, and the figures of a year."""

from datetime import UTC, datetime

import numpy as np
import pytest
from inside import measuring_product as product

import wavefront as wf

QUIET = {"progress": False, "workers": 1}
FAR = wf.Scene([wf.Sphere((0, -50, 0), 1)])  # as good as nothing
SUNS = np.array([(1, 0.4, 0.3), (0.2, 1, 0.5), (-1, 0.6, 0.5), (0.3, -0.2, 1)], float)
HOURS = wf.Weather([500, 800, 0, 300], [100, 120, 90, 4], SUNS)
HEIGHT = SUNS[:, 1] / np.linalg.norm(SUNS, axis=1)


def coefficients(scene=FAR, points=((0, 0, 0),), normals=(0, 1, 0), **settings):
    return wf.daylight_coefficients(scene, points, normals, **{"spp": 512, **QUIET, **settings})


def within(value, due, error, sigmas: float = 5.0) -> None:
    """Within some standard errors, which come from 8 batches."""
    assert (np.abs(np.asarray(value) - due) <= sigmas * np.asarray(error) + 2e-4 * np.abs(due)).all()


def test_a_free_level_point_gets_what_the_weather_station_measures() -> None:
    """Sky and sun; by night, and while the sun is low, the sky alone."""
    year = coefficients().annual(HOURS)
    day = HEIGHT > 0
    due = HOURS.diffuse_horizontal + np.where(day, HOURS.direct_normal * HEIGHT, 0)
    within(year.value[0], due, year.standard_error[0])
    assert (year.standard_error[0] < 0.02 * due).all()


def test_a_wall_sees_half_of_the_sky_and_the_ground() -> None:
    """Under an even sky L, a ground of albedo ρ: (1 + ρ)·πL/2."""
    found = coefficients(normals=(1, 0, 0))
    even = found.sky_radiance(wf.Sky.cie(5, horizontal=np.pi, ground=0.4))
    assert even == pytest.approx([0.4] + [1] * 145, rel=1e-4)
    value, error = found.irradiance(even)
    within(value, 1.4 * np.pi / 2, error)
    night = wf.Weather([0], [100], [(1, -0.1, 0)])
    year = found.annual(night, ground=0.4, efficacy=2)
    within(year.value[0], 2 * 100 * 1.4 / 2, year.standard_error[0])
    both, _ = found.irradiance(np.stack([even, 2 * even], 1))
    assert both == pytest.approx(value[0] * np.array([[1, 2]]))


@pytest.mark.parametrize("sky", [wf.Sky.cie(1, horizontal=100), wf.Sky.cie(16, horizontal=100)])
@pytest.mark.first(1)
def test_as_a_measurement_under_the_same_sky(sky: wf.Sky) -> None:
    """A court of walls; the patches of smooth skies are even within half a percent."""
    sides = [
        ((-2, 0, -2), (4, 0, 0)),
        ((2, 0, -2), (0, 0, 4)),
        ((2, 0, 2), (-4, 0, 0)),
        ((-2, 0, 2), (0, 0, -4)),
    ]
    walls = [wf.Rectangle(a, b, (0, 2, 0), material=wf.Diffuse(0.5)) for a, b in sides]
    floor = wf.Rectangle((-2, 0, -2), (0, 0, 4), (4, 0, 0), material=wf.Diffuse((0.2, 0.5, 0.3)))
    scene = wf.Scene([*walls, floor])
    points = [(0, 0, 0), (1.5, 0, 1.2)]
    found = coefficients(scene, points, spp=2048)
    value, error = found.irradiance(found.sky_radiance(sky))
    measured = wf.measure(wf.Scene(scene.shapes, [sky]), points, (0, 1, 0), spp=2048, **QUIET)
    due = measured.value @ np.array([0.2126, 0.7152, 0.0722])
    together = np.hypot(error, measured.standard_error[:, 1])
    assert (np.abs(value - due) <= 4 * together + 0.006 * due).all()
    assert (together < 0.02 * due).all()


def test_the_sun_is_where_it_is_and_casts_shadows() -> None:
    """Not spread over its patch: a disk hides it from one point and not from another close to it."""
    sun = np.array([0.3, 1, 0.2]) / np.linalg.norm([0.3, 1, 0.2])
    black = wf.Disk(sun * 5, sun, 0.5, material=wf.Diffuse(0))
    points, hour = [(0, 0, 0), (0.7, 0, 0)], wf.Weather([900], [1e-6], [sun])
    found = coefficients(wf.Scene([black]), points, spp=64)
    beam = found.sunlight(hour)[:, 0]
    assert beam[0] == 0
    assert beam[1] == pytest.approx(900 * sun[1], rel=1e-6)
    assert found.annual(hour).value[:, 0] == pytest.approx(beam, abs=0.02)


def test_light_of_the_sun_that_a_surface_reflects() -> None:
    """Below a large white ground in the sun, a point that looks down gets ρ·E, by the sun's patch."""
    ground = wf.Disk((0, -1, 0), (0, 1, 0), 300, material=wf.Diffuse(0.5))
    sun = np.array([0.6, 0.8, 0.0])
    found = coefficients(wf.Scene([ground]), [(0, 0, 0)], (0, -1, 0), spp=2048)
    year = found.annual(wf.Weather([1000], [1e-6], [sun]))
    at = found.patches.number(np.float32(sun.reshape(3, 1)))[0]
    cosine = found.patches.projected[at - 1] / found.patches.solid_angles[at]  # the mean over the patch
    within(year.value[0], 0.5 * 1000 * cosine, year.standard_error[0])
    assert year.standard_error[0, 0] < 50
    assert abs(cosine - 0.8) < 0.1


@pytest.mark.slow
def test_up_and_north_turn_patches_and_points_alike() -> None:
    tree = ((0.5, 0.8, -1.0), 0.6)
    one = coefficients(wf.Scene([wf.Sphere(*tree)]), spp=2048)
    x, y, z = tree[0]
    other = coefficients(wf.Scene([wf.Sphere((x, -z, y), tree[1])]), normals=(0, 0, 1), up="z", spp=2048)
    sky = one.sky_radiance(wf.Sky.cie(13, (0.5, 1, -1), horizontal=100))
    same = other.sky_radiance(wf.Sky.cie(13, (0.5, 1, 1), up="z", horizontal=100))
    assert sky == pytest.approx(same, rel=1e-4)
    (a, ea), (b, eb) = one.irradiance(sky), other.irradiance(same)
    within(a, b, np.hypot(ea, eb))
    turned = coefficients(wf.Scene([wf.Sphere((-z, y, x), tree[1])]), north=(1, 0, 0), spp=2048)
    c, ec = turned.irradiance(sky)
    within(a, c, np.hypot(ea, ec))


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ({"noise": 0.1}, "noise is 0.1; daylight_coefficients chooses it itself"),
        ({"aovs": "direct"}, "aovs is 'direct'"),
        ({"spp": 7}, "spp is 7; it must be a whole number from 8"),
        ({"subdivision": 0}, "subdivision is 0"),
        ({"scene": wf.Scene([wf.Sphere((0, 0, 0), 1, emission=1)])}, "a shape of the scene emits"),
        ({"up": "w"}, "up is 'w'"),
    ],
)
def test_wrong_input(settings: dict, said: str) -> None:
    with pytest.raises(wf.SceneError, match=said):
        coefficients(**settings)


def test_radiance_must_have_a_value_for_each_patch() -> None:
    with pytest.raises(wf.SceneError, match="it must have a value for each patch"):
        coefficients(spp=8).irradiance(np.ones(145))


@pytest.mark.slow
def test_errors_of_a_year_cover_the_truth() -> None:
    """95 % intervals by Student's t with 7 degrees of freedom, over points and seeds."""
    canopy = wf.Scene([wf.Disk((0, 1, 0), (0, -1, 0), 1, material=wf.Diffuse(0.7))])
    points = [(x, 0, 0) for x in (0.0, 0.4, 0.8, 1.2)]
    true = coefficients(canopy, points, spp=1 << 17, seed=1000).annual(HOURS).total()[0]
    inside = []
    for seed in range(40):
        value, error = coefficients(canopy, points, spp=256, seed=seed).annual(HOURS).total()
        inside += (np.abs(value - true) < 2.365 * error).tolist()
    assert 0.9 < np.mean(inside) <= 1


# --- Figures of a year ---------------------------------------------------------------------------------


def made_up(batches: np.ndarray) -> wf.Year:
    hours = batches.shape[2]
    return wf.Year(np.float32(batches), wf.Weather([0] * hours, [0] * hours, [(0, 1, 0)] * hours))


def test_sums_have_the_error_of_their_batches() -> None:
    """Of a sum, the jackknife is the standard error of the mean: hours of one batch err together."""
    rng = np.random.default_rng(0)
    batches = 500 + 20 * rng.normal(size=(8, 3, 1)) + rng.normal(size=(8, 3, 50))
    year = made_up(batches)
    value, error = year.total()
    sums = np.float32(batches).astype(float).sum(2)
    assert value == pytest.approx(sums.mean(0), rel=1e-6)
    assert error == pytest.approx(sums.std(0, ddof=1) / np.sqrt(8), rel=1e-5)
    some, _ = year.total(np.arange(50) < 10)
    assert some == pytest.approx(np.float32(batches).astype(float)[:, :, :10].sum(2).mean(0), rel=1e-6)
    assert year.value.shape == year.standard_error.shape == (3, 50)


def test_parts_of_the_hours() -> None:
    hours = np.array([50, 99, 100, 299, 300, 3000, 3001, 9000.0])
    year = made_up(np.tile(hours, (8, 1, 1)))
    for found, due in (
        (year.daylight_autonomy(300), 4 / 8),
        (year.daylight_autonomy(300, [3, 4]), 1 / 2),
        (year.useful_daylight(), 4 / 8),
        (year.useful_daylight(300, 3000), 2 / 8),
    ):
        assert found[0].tolist() == [due]
        assert found[1].tolist() == [0]
    with pytest.raises(wf.SceneError, match="high is 1; it must be at least low, 2"):
        year.useful_daylight(2, 1)
    with pytest.raises(wf.SceneError, match="hours is empty"):
        year.total(hours > 9000)
    with pytest.raises(wf.SceneError, match="hours must be a mask of 8 hours, or indices"):
        year.total([True, False])


# --- Weather -------------------------------------------------------------------------------------------


def epw(*rows: str, head: str = "LOCATION,Munich,,DEU,IWEC,108660,48.13,11.7,1.0,529.0") -> str:
    return "\n".join([head, *["X"] * 7, *rows])


def row(hour: int, direct: float, diffuse: float, day: str = "1999,6,21") -> str:
    return f"{day},{hour},60,flags,{','.join(['1'] * 8)},{direct},{diffuse},0"


@pytest.fixture
def asked(calls_of) -> list:
    """In place of pvlib; returns what it is asked."""
    calls = []

    def sun_position(time, *place, **axes):
        calls.append((time, place, axes))
        return np.tile((0.0, 1.0, 0.0), (len(time), 1))

    calls_of("wavefront.measuring.weather.sun_position", sun_position)
    return calls


def test_reading_a_weather_file(asked, tmp_path) -> None:
    (tmp_path / "m.epw").write_text(epw(row(1, 0, 5), row(24, 700.5, 90)))
    year = wf.load_weather(tmp_path / "m.epw", up="z", north=(1, 0, 0))
    assert len(year) == 2
    assert year.direct_normal.tolist() == [0, 700.5]
    assert year.diffuse_horizontal.tolist() == [5, 90]
    ((times, place, axes),) = asked
    assert place == (48.13, 11.7)
    assert axes == {"altitude": 529.0, "up": "z", "north": (1, 0, 0)}
    utc = UTC  # hour 1 is from 0 to 1 o'clock, an hour before UTC
    assert times == [datetime(1999, 6, 20, 23, 30, tzinfo=utc), datetime(1999, 6, 21, 22, 30, tzinfo=utc)]


def test_a_place_that_is_nowhere(tmp_path) -> None:
    pytest.importorskip("pvlib")
    (tmp_path / "bad.epw").write_text(epw(row(1, 0, 0), head="LOCATION,x,,,,,99,11,1,0"))
    with pytest.raises(wf.SceneError, match=r"bad\.epw: latitude is 99"):
        wf.load_weather(tmp_path / "bad.epw")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "is no weather file"),
        (epw(), "is no weather file"),
        (epw(row(1, 0, 0), head="PLACE"), "is no weather file"),
        (epw(row(1, 0, 0), head="LOCATION,x"), "line 1 is malformed"),
        (epw(row(1, 0, 0), "1999,6"), "line 10 is malformed"),
        (epw(row(1, 0, 0), row(2, -1, 0)), "line 10 has the irradiances"),
        (epw(row(1, 0, 9999)), "line 9 has the irradiances"),
        (epw(row(1, 0, 0, "1999,2,30")), "line 9 has no such day"),
        (epw(row(1, 0, 0).replace("1999", "noon")), "line 9 is malformed"),
        *[
            (epw(row(1, 0, 0).replace(f",{old},", f",{odd},", 1)), "line 9 (is malformed|has the)")
            for old in ("1", "6", "21")  # the hour, the month, the day
            for odd in ("nan", "inf", "1e20", "-1e20", "25000")
        ],
        *[
            (epw(row(1, 0, 0).replace("1999", odd)), "line 9 (is malformed|has the year)")
            for odd in ("nan", "inf", "1e20", "0", "9999")
        ],
        *[
            (epw(row(1, 0, 0), head=f"LOCATION,x,,,,,48,{odd}"), "line 1 ")
            for odd in ("11,nan,0", "inf,1,0", "11,1e20,0", "11,1,nan")
        ],
        (epw(row(25, 0, 0)), "line 9 has the hour 25; it must be from 0 to 24"),
    ],
)
def test_files_that_are_no_weather(asked, tmp_path, text: str, said: str) -> None:
    (tmp_path / "bad.epw").write_text(text)
    with pytest.raises(wf.SceneError, match=said) as caught:
        wf.load_weather(tmp_path / "bad.epw")
    assert "bad.epw" in str(caught.value)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (([-1], [0], [(0, 1, 0)]), r"direct_normal\[0\] is -1; it must be at least 0"),
        (([0], [-2], [(0, 1, 0)]), r"diffuse_horizontal\[0\] is -2"),
        (([0], [0, 1], [(0, 1, 0)]), "diffuse_horizontal"),
        (([0], [0], [(0, 0, 0)]), r"sun\[0\] is zero"),
    ],
)
def test_malformed_weather(arguments: tuple, said: str) -> None:
    with pytest.raises(wf.SceneError, match=said):
        wf.Weather(*arguments)


def test_patches_under_weather_have_its_irradiance() -> None:
    patches = coefficients(spp=8).patches
    sky, sun = HOURS.on_patches(patches, 0.2, 4)
    level = (sky[1:] * patches.projected[:, None]).sum(0)
    assert level == pytest.approx(HOURS.diffuse_horizontal, rel=1e-3)
    due = np.where(HEIGHT > 0, HOURS.direct_normal, 0)
    assert (sun * patches.solid_angles[:, None]).sum(0) == pytest.approx(due)
    assert ((sun > 0).sum(0) <= 1).all()
    whole = HOURS.diffuse_horizontal + due * np.maximum(HEIGHT, 0)
    assert sky[0] == pytest.approx(0.2 / np.pi * whole)


def test_products_of_matrices() -> None:
    rng = np.random.default_rng(0)
    a, b = rng.random((4, 7)), rng.random((7, 5))
    np.testing.assert_allclose(product(a, b), a @ b, rtol=1e-12)


@pytest.mark.parametrize("held", [False, True], ids=["alone", "with a stone in it"])
def test_water_above_dims_the_sun_of_each_hour(held: bool) -> None:
    """By exp(−σ·length) on the slanted way, whether or not paths store what they are inside of."""
    sigma, up = np.array([0.3, 1.0, 2.0]), np.array([0.3, 1, 0.2]) / np.linalg.norm([0.3, 1, 0.2])
    water = wf.Material(wf.NullSurface(), interior=wf.Medium(sigma))
    shapes = [wf.Box((0, 1.5, 0), (40, 1, 40), material=water)]
    if held:
        shapes.append(wf.Sphere((15, 1.5, 15), 0.2, material=wf.Diffuse(0)))
    hour = wf.Weather([900], [1e-6], [up])
    beam = coefficients(wf.Scene(shapes), spp=64).sunlight(hour)[0, 0]
    through = np.array([0.2126, 0.7152, 0.0722]) @ np.exp(-sigma / up[1])
    assert beam == pytest.approx(900 * up[1] * through, rel=1e-3)
