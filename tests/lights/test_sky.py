"""Skies: the formulas of the standards, their irradiance, and how they are sampled."""

import struct
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
from inside import hosek_wilkie, sky_functions
from scenes import ALBEDO, EYE, HERE, floor, probe
from significance import assert_mean, measure
from sky_values import dome, standard

import wavefront as wf
from wavefront import testing

ORIGIN = np.zeros(3)
TYPES = range(1, 17)
HEIGHTS = 5, 20, 40, 65, 88  # degrees, of the sun


def toward(height: float, azimuth: float = 37.0) -> np.ndarray:
    """Unit vector, y up."""
    h, a = np.radians(height), np.radians(azimuth)
    return np.array([np.cos(h) * np.sin(a), np.sin(h), np.cos(h) * np.cos(a)])


def test_what_is_assigned_later_changes_the_light() -> None:
    sky, after = (wf.Sky.cie(12, toward(height), horizontal=120, ground=0.4) for height in (30, 60))
    after.sun = sky.sun
    assert after.radiance(np.eye(3)).tolist() == sky.radiance(np.eye(3)).tolist() != []
    after.horizontal = 240
    np.testing.assert_allclose(after.radiance([(0, 1, 0)]), 2 * sky.radiance([(0, 1, 0)]), rtol=1e-6)
    with pytest.raises(wf.SceneError, match="horizontal is 0"):
        after.horizontal = 0
    assert (after.horizontal == 240).all()


@pytest.mark.parametrize("type", TYPES)
def test_horizontal_irradiance_and_luminance_of_the_standard_skies(type: int) -> None:
    """By another quadrature, of the closed formula: irradiance within 0.1 %, luminance with it."""
    around, weight = dome()
    for height in HEIGHTS:
        sun = toward(height)
        relative = standard(type, sun, around)
        seen = wf.Sky.cie(type, sun, horizontal=(2, 3, 4)).radiance(around.reshape(-1, 3))
        irradiance = (seen * weight.reshape(-1, 1)).sum(0)
        assert irradiance == pytest.approx([2, 3, 4], rel=5e-4)
        due = 3 * relative.ravel() / (relative * weight).sum()
        np.testing.assert_allclose(seen[:, 1], due, rtol=7e-4)


def test_the_overcast_skies_are_three_times_as_bright_at_the_zenith() -> None:
    """The standard's type 1 nearly so: 1 + 4·exp(-0.7) = 2.986; the traditional one exactly."""
    up, low = (0, 1, 0), (1, 1e-4, 0)
    for type, ratio in ((1, 1 + 4 * np.exp(-0.7)), (3, 1 + 1.1 * np.exp(-0.8)), (5, 1.0), (16, 3.0)):
        zenith, horizon = wf.Sky.cie(type).radiance([up, low])[:, 0]
        assert zenith / horizon == pytest.approx(ratio, rel=3e-4)
    thirds = wf.Sky.cie(16, horizontal=7 / 9 * np.pi).radiance([toward(h) for h in (0, 30, 60, 90)])[:, 0]
    assert thirds == pytest.approx([1 / 3, 2 / 3, (1 + np.sqrt(3)) / 3, 1], rel=1e-4)


# epsilon, delta as given by gendaylit 2.6 of Radiance 6.1 -ang HEIGHT 0 -W DIRECT DIFFUSE -O 1, whose
# extraterrestrial irradiance is 1367·1.03502: a, b, c, d, e
GENDAYLIT = {
    (0, 100, 30): (0.832968, -0.605102, 0.501177, -0.415291, -0.028838),
    (5, 150, 40): (0.877076, -0.574503, 0.606563, -0.470006, -0.024503),
    (50, 200, 50): (-1.324783, -0.834497, 8.371089, -2.275681, 0.205685),
    (150, 250, 35): (-1.061782, -0.931302, 10.858362, -3.106739, 0.102672),
    (300, 200, 45): (-1.014863, -0.514322, 14.077688, -3.278168, 0.029915),
    (500, 150, 30): (-0.987219, -0.447196, 13.051906, -3.277422, 0.040928),
    (700, 110, 55): (-0.969117, -0.210507, 15.953013, -3.932904, 0.667849),
    (850, 80, 60): (-0.99482, -0.213633, 22.353588, -6.127064, 1.303873),
    (900, 60, 75): (-1.01962, -0.260569, 25.879216, -6.532293, 1.419689),
    (393.5, 100, 30): (-0.986484, -0.404916, 13.209624, -3.29797, 0.043194),  # between two bins
    (396.5, 100, 30): (-1.050738, -0.314913, 13.0603, -3.432704, 0.324402),
    (30, 40, 10): (-1.710627, -0.681033, 8.477638, -2.615322, 0.192769),
}


@pytest.mark.parametrize(("direct", "diffuse", "height"), GENDAYLIT)
def test_perez_beside_radiance(direct: float, diffuse: float, height: float) -> None:
    function = sky_functions.perez_function(direct, diffuse, np.sin(np.radians(height)), 1367 * 1.03502)
    a, b, constant, c, d, e = function.coefficients[:6, 0, 0]
    due = GENDAYLIT[direct, diffuse, height]
    np.testing.assert_allclose((a, b, c, d, e), due, rtol=2e-5, atol=2e-6)
    assert constant == 1


@pytest.mark.parametrize(("direct", "diffuse", "height"), [(0, 100, 30), (300, 200, 45), (850, 80, 60)])
def test_perez_has_the_irradiances_that_were_measured(direct: float, diffuse: float, height: float) -> None:
    around, weight = dome(256, 512)
    sun = toward(height)
    sky = wf.Sky.perez(direct, diffuse, sun)
    level = (sky.radiance(around.reshape(-1, 3)) * weight.reshape(-1, 1)).sum(0)
    assert level == pytest.approx([diffuse] * 3, rel=1e-3)
    assert sky.direct_normal == pytest.approx([direct] * 3)
    lit = wf.Sky.perez(direct, diffuse, sun, illuminance=(9000, 11000), disk=False)
    assert lit.diffuse_horizontal == pytest.approx([11000 / 683] * 3)
    assert not lit.direct_normal.any()
    ratio = lit.radiance(around[::32, 0]) / sky.radiance(around[::32, 0])
    assert ratio == pytest.approx(11000 / 683 / diffuse, rel=1e-5)


@pytest.mark.parametrize("direct", [0, 1, 20, 1000])
@pytest.mark.parametrize("diffuse", [0.5, 500])
@pytest.mark.parametrize("height", [0.5, 20, 89.9])
def test_perez_is_finite_and_positive_for_whatever_weather(direct, diffuse, height) -> None:
    around, _ = dome(16, 16)
    seen = wf.Sky.perez(direct, diffuse, toward(height)).radiance(around.reshape(-1, 3))
    assert np.isfinite(seen).all()
    assert (seen >= 0).all()


SKIES = {
    "overcast": lambda **more: wf.Sky.cie(1, horizontal=3, **more),
    "even": lambda **more: wf.Sky.cie(5, horizontal=3, **more),
    "clear": lambda **more: wf.Sky.cie(15, toward(25), horizontal=(1, 2, 3), **more),
    "perez": lambda **more: wf.Sky.perez(0, 3, toward(50), **more),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", ["clear", pytest.param("perez", marks=pytest.mark.slow)])
@pytest.mark.parametrize("mis", [pytest.param(False, marks=pytest.mark.slow), True])
def test_contract(name: str, mis: bool) -> None:
    """χ² of the directions against their density, ∫ pdf = 1, radiance of samples and of rays."""
    record = SKIES[name]().record(ORIGIN)
    testing.check_light(record.compensated() if mis else record, samples=2_000, points=[[2, 1, 3]])


@pytest.mark.parametrize("integrator", ["naive", "direct_simple", "direct_mis", "full"])
@pytest.mark.parametrize("name", SKIES)
def test_a_level_floor_gets_the_horizontal_irradiance(integrator: str, name: str) -> None:
    sky = SKIES[name]()
    mean = measure(wf.Scene([floor()], [sky], probe(HERE, EYE)), 64, integrator=integrator, max_bounces=1)
    assert_mean(mean, sky.diffuse_horizontal.mean() * ALBEDO / np.pi, 0.01)


def test_sun_and_sky_together_and_the_ground() -> None:
    """The disk adds its cosine; below the horizon there is ground that both light."""
    sun = toward(40)
    sky = wf.Sky.cie(12, sun, horizontal=1, direct_normal=5, ground=(0.1, 0.2, 0.3))
    level = 1 + 5 * np.sin(np.radians(40))
    mean = measure(wf.Scene([floor()], [sky], probe(HERE, EYE)), 64, max_bounces=1)
    assert_mean(mean, level * ALBEDO / np.pi, 0.01)
    below = sky.radiance([(0, -1, 0), (1, -0.01, 2)])
    np.testing.assert_allclose(below, np.array([[0.1, 0.2, 0.3]] * 2) * level / np.pi, rtol=1e-4)
    record = sky.record(ORIGIN)
    disk, beside = (record.le(np.array(toward(h), np.float32).reshape(3, 1))[0, 0] for h in (40.2, 40.3))
    assert disk - beside == pytest.approx(5 / (np.pi * np.sin(np.radians(0.533 / 2)) ** 2), rel=1e-3)


def test_up_turns_the_sky() -> None:
    """The same sky for z up."""
    x, y, z = sun = toward(30)
    other = wf.Sky.cie(13, (x, -z, y), up="z", horizontal=2)
    directions = np.random.default_rng(0).normal(size=(100, 3))
    turned = directions[:, [0, 2, 1]] * (1, -1, 1)
    same = wf.Sky.cie(13, sun, horizontal=2).radiance(directions)
    np.testing.assert_allclose(other.radiance(turned), same, rtol=1e-4)


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: wf.Sky.cie(0), "Sky type is 0; it must be from 1 to 15, or 16"),
        (lambda: wf.Sky.cie(True), "Sky type is True"),
        (lambda: wf.Sky.cie(12), "Sky sun is None; such a sky needs one that is above the horizon"),
        (lambda: wf.Sky.cie(12, (0, -1, 0)), "above the horizon"),
        (lambda: wf.Sky.cie(1, horizontal=0), "Sky horizontal is 0; it and the model's must be above 0"),
        (lambda: wf.Sky.cie(1, horizontal=-1), "Sky horizontal is -1"),
        (lambda: wf.Sky.cie(1, ground=1.5), "Sky ground is 1.5"),
        (lambda: wf.Sky.perez(-1, 100, (0, 1, 0)), "Sky direct_normal is -1; it must be at least 0"),
        (lambda: wf.Sky.perez(1, 0, (0, 1, 0)), "Sky diffuse_horizontal is 0; it must be above 0"),
        (lambda: wf.Sky.perez(1, 1, (1, 0, 0)), "above the horizon"),
        (lambda: wf.Sky.hosek_wilkie(11, 0, (0, 1, 0)), "Sky turbidity is 11; it must be from 1 to 10"),
        (lambda: wf.Sky.cie(1).radiance([(0, 0, 0)]), "directions must not be zero"),
    ],
)
def test_wrong_input(make, said: str) -> None:
    with pytest.raises(wf.SceneError, match=said):
        make()


# --- Hošek and Wilkie ----------------------------------------------------------------------------------


def write_tensors(path: Path, arrays: dict[str, np.ndarray]) -> None:
    """A file of arrays as mitsuba has it."""
    head, body = b"tensor_file\0\1\0" + struct.pack("<I", len(arrays)), b""
    size = len(head) + sum(2 + len(name) + 11 + 8 * array.ndim for name, array in arrays.items())
    for name, array in arrays.items():
        head += struct.pack("<H", len(name)) + name.encode()
        head += struct.pack("<HBQ", array.ndim, 11, size + len(body)) + struct.pack(
            f"<{array.ndim}Q", *array.shape
        )
        body += np.ascontiguousarray(array, "<f8").tobytes()
    path.write_bytes(head + body)


@pytest.fixture
def data(tmp_path: Path, monkeypatch) -> dict[str, np.ndarray]:
    """Made-up data of the model."""
    rng = np.random.default_rng(3)
    low = np.array([-1.1, -0.4, 0.2, 3.0, -4.0, 0.3, 0.05, 0.4, 0.6])  # the last one is H, of χ
    arrays = {
        "sky_params_rgb": low * rng.uniform(0.9, 1.1, (10, 2, 6, 3, 9)),
        "sky_rad_rgb": rng.uniform(1, 2, (10, 2, 6, 3)),
        "sun_rad_rgb": rng.uniform(1, 2, (10, 45, 3, 4, 6)),
    }
    file = tmp_path / "mitsuba" / hosek_wilkie.FILE  # as if the package stood there
    file.parent.mkdir(parents=True)
    (tmp_path / "mitsuba" / "__init__.py").touch()
    monkeypatch.syspath_prepend(tmp_path)
    write_tensors(file, arrays)
    return arrays


def test_hosek_wilkie_with_made_up_data(data) -> None:
    """Equation 8 of the paper, between tables of turbidity and albedo, and a Bézier curve of the height."""
    sun, turbidity, albedo = toward(35), 3.25, (0.1, 0.5, 1.0)
    sky = wf.Sky.hosek_wilkie(turbidity, albedo, sun)
    x = np.cbrt(35 / 90)
    curve = np.array([1, 5, 10, 10, 5, 1]) * (1 - x) ** np.arange(5, -1, -1) * x ** np.arange(6)
    directions = np.array([(0, 1, 0), (0.3, 0.5, -0.2), sun, (1, 0.02, 0)])
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    cos_z, cos_g = directions[:, 1], np.clip(directions @ sun, -1, 1)
    gamma = np.arccos(cos_g)
    for k in range(3):
        mixed = []
        for name in ("sky_params_rgb", "sky_rad_rgb"):
            of_channel = 0.75 * data[name][2, :, :, k] + 0.25 * data[name][3, :, :, k]
            mixed.append(np.tensordot(curve, (1 - albedo[k]) * of_channel[0] + albedo[k] * of_channel[1], 1))
        (a, b, c, d, e, f, g, i, h), scale = mixed
        chi = (1 + cos_g**2) / (1 + h * h - 2 * h * cos_g) ** 1.5
        seen = c + d * np.exp(e * gamma) + f * cos_g**2 + g * chi + i * np.sqrt(cos_z)
        due = scale * (1 + a * np.exp(b / (cos_z + 0.01))) * seen
        np.testing.assert_allclose(sky.radiance(directions)[:, k], due, rtol=2e-4)
    segment = int(x * 45)
    height = np.radians(35) - np.pi / 2 * (segment / 45) ** 3
    u = (np.arange(4000) + 0.5) / 4000  # of the disk's area; the cosine to its normal is √(1 − u)
    rows = 0.75 * data["sun_rad_rgb"][2, segment] + 0.25 * data["sun_rad_rgb"][3, segment]
    powers = np.array([np.mean(np.sqrt(1 - u) ** j) for j in range(6)])
    radiance = (rows * height ** np.arange(4)[:, None] * powers).sum((1, 2))
    solid = np.pi * np.sin(np.radians(0.5358 / 2)) ** 2
    assert sky.direct_normal == pytest.approx(467.069280386 * solid * radiance, rel=1e-4)
    bright = wf.Sky.hosek_wilkie(turbidity, albedo, sun, scale=2, disk=False)
    np.testing.assert_allclose(bright.diffuse_horizontal, 2 * sky.diffuse_horizontal, rtol=1e-6)
    assert not bright.direct_normal.any()


@pytest.mark.parametrize("turbidity", [1, 9.5, 10])
def test_hosek_wilkie_at_the_ends_of_its_tables(data, turbidity: float) -> None:
    for height in (0.01, 90):
        for albedo in (0, 1):
            sky = wf.Sky.hosek_wilkie(turbidity, albedo, toward(height))
            assert np.isfinite(sky.diffuse_horizontal).all()
            assert (sky.direct_normal > 0).all()


def test_files_that_hold_no_sky(data, tmp_path: Path) -> None:
    for raw in (b"", b"tensor_file\0\1\0\5\0\0\0", b"something else, and long enough to be read"):
        (tmp_path / "mitsuba" / hosek_wilkie.FILE).write_bytes(raw)
        hosek_wilkie.tensors.cache_clear()
        with pytest.raises(wf.SceneError, match=r"sunsky_datasets\.bin does not hold the data of the sky"):
            wf.Sky.hosek_wilkie(3, 0, (0, 1, 0))


def test_without_the_data_of_mitsuba(data, tmp_path: Path) -> None:
    (tmp_path / "mitsuba" / hosek_wilkie.FILE).unlink()
    with pytest.raises(wf.SceneError, match="pip install mitsuba"):
        wf.Sky.hosek_wilkie(3, 0, (0, 1, 0))


# Turbidity, albedo, height of the sun: pixels of Mitsuba 3.9.1's `sunsky` without a sun, at SEEN
SEEN = [(0, 0, 1), (0.6, 0.6, 0.52915), (-0.7, 0.7, 0.1414)]
MITSUBA = {
    (3, 0.2, 40): [
        [0.0201615, 0.0360011, 0.0730464],
        [0.180902, 0.2091773, 0.2426436],
        [0.0867314, 0.1351738, 0.1969157],
    ],
    (1, 0.0, 10): [
        [0.0068997, 0.0149274, 0.0271244],
        [0.0293353, 0.0485671, 0.0688017],
        [0.0562466, 0.0780773, 0.0807892],
    ],
    (6.5, 0.5, 70): [
        [0.1842474, 0.2019769, 0.2394806],
        [0.145543, 0.1846004, 0.2525534],
        [0.1621726, 0.2091025, 0.2817636],
    ],
}


@pytest.mark.parametrize(("turbidity", "albedo", "height"), MITSUBA)
def test_hosek_wilkie_beside_mitsuba(turbidity: float, albedo: float, height: float) -> None:
    """Mitsuba divides by the integral of ȳ."""
    if find_spec("mitsuba") is None:
        pytest.skip("the data come with mitsuba")
    h = np.radians(height)
    sun = 0.6 * np.cos(h), 0.8 * np.cos(h), np.sin(h)
    seen = wf.Sky.hosek_wilkie(turbidity, albedo, sun, up="z").radiance(SEEN) / 106.7502594
    np.testing.assert_allclose(seen, MITSUBA[turbidity, albedo, height], rtol=2e-5)
