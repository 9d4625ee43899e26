"""Lux: each light by its own efficacy, with its error and interval."""

import pickle
from pathlib import Path

import numpy as np
import pytest
from gltf_builder import Builder
from inside import f4

import wavefront as wf

QUIET = {"progress": False, "workers": 1}
SUN = np.array([0.5, 0.6, 0.3])
HEIGHT = SUN[1] / np.linalg.norm(SUN)
BLACK = wf.Disk((0, -0.5, 0), (0, 1, 0), 50, material=wf.Diffuse(0))
AT, UP = [(0, 0, 0), (1, 0, 0)], (0, 1, 0)


def lit_by(*lights, spp: int = 64, points=AT, shapes=(BLACK,), **settings) -> wf.Measurement:
    return wf.measure(wf.Scene(shapes, lights), points, UP, spp=spp, **{**QUIET, **settings})


def lamp(folder: Path, height: float = 2.0, **options) -> wf.IESLight:
    """1000 cd straight down."""
    file = folder / "lamp.ies"
    file.write_text(
        "IESNA:LM-63-2002\nTILT=NONE\n1 -1 1 4 1 1 2 0 0 0\n1 1 20\n0 30 60 90  0  1000 900 400 0"
    )
    return wf.IESLight(file, (0, height, 0), **options)


class Lantern(wf.Light):
    """A user's light, of a file of its own: a point of 1 W/sr."""

    def record(self, center):
        return wf.PointLight((0, 2, 0), 1).record(center)


class Broadband(Lantern):
    efficacy = 95


def test_a_clear_sky_in_watts_has_some_70_000_lux() -> None:
    """The irradiances that a weather station measures, times 110 lm/W and not 683."""
    found = lit_by(wf.Sky.perez(723, 120, SUN), spp=256)
    due = 110 * (723 * HEIGHT + 120)
    assert due == pytest.approx(70_000, rel=0.01)
    assert (np.abs(found.lux - due) < 4 * found.lux_error).all()
    assert (found.lux_error < 0.02 * due).all()
    assert found.lux_of("broadband")[0] == pytest.approx(found.lux)
    assert not found.lux_of("visible")[0].any()


@pytest.mark.parametrize("reuse", [False, True])
@pytest.mark.parametrize("efficacy", [683, 179, 1])
def test_a_sky_and_a_luminaire_add_each_by_its_own_efficacy(tmp_path, efficacy: float, reuse: bool) -> None:
    sky = wf.Sky.cie(5, horizontal=3)
    points = [(0, 0, 0)] * 16 if reuse else [(0, 0, 0)]
    lights = sky, lamp(tmp_path, efficacy=efficacy, color="moccasin")
    found = lit_by(*lights, spp=256, points=points, reuse=reuse)
    for (value, error), due in (
        ((found.lux, found.lux_error), 110 * 3 + 1000 / 4),
        (found.lux_of("broadband"), 110 * 3),
        (found.lux_of("visible"), 1000 / 4),
    ):
        assert (np.abs(value - due) <= 4.5 * error + 1e-4 * due).all()  # points are lifted a little
        assert (error < 0.1 * due).all()
    low, high = found.lux_interval(0.9999)
    assert (low < 580).all()
    assert (high > 580).all()


def sky_in_lux() -> wf.Sky:
    sky = wf.Sky.cie(16, horizontal=100)
    sky.horizontal = wf.from_photometric(9000)
    return sky


POINT = {"position": (0, 2, 0), "intensity": 1}
LAMPS = {
    "candela": (lambda: wf.PointLight((0, 2, 0), wf.from_photometric(400, "orange")), 100),
    "watts": (lambda: wf.PointLight(**POINT), 683 / 4),
    "own": (Lantern, 683 / 4),
    "own, broadband": (Broadband, 95 / 4),
    "lumens": (lambda: wf.with_flux(wf.PointLight(**POINT), 1600 * np.pi), 100),
    "lumens by another efficacy": (
        lambda: wf.with_flux(wf.PointLight(**POINT), 1600 * np.pi, efficacy=179),
        100,
    ),
    "sun in lux": (lambda: wf.DirectionalLight((0, -1, 0), wf.from_photometric(80_000)), 80_000),
    "environment": (lambda: wf.Environment(wf.from_photometric(1000)), 1000 * np.pi),
    "sky in watts": (lambda: wf.Sky.cie(5, horizontal=100), 11_000),
    "sky by another efficacy": (lambda: wf.Sky.cie(5, horizontal=100, efficacy=125), 12_500),
    "sky in lux": (lambda: wf.Sky.cie(5, horizontal=wf.from_photometric(9000)), 9000),
    "sky in lux, later": (sky_in_lux, 9000),
    "sky in lux, as Radiance": (
        lambda: wf.Sky.cie(5, horizontal=wf.from_photometric(9000, efficacy=179)),
        9000,
    ),
    "weather in lux": (lambda: wf.Sky.perez(500, 90, SUN, illuminance=(0, 9000)), 9000),
}


@pytest.mark.parametrize("name", LAMPS)
def test_each_kind_of_light(name: str) -> None:
    make, due = LAMPS[name]
    found = lit_by(make(), spp=1024, points=AT[:1])
    assert (np.abs(found.lux - due) <= 4 * found.lux_error + 1e-4 * due).all()
    assert (found.lux_error <= 0.01 * due).all()


def ball(**options) -> wf.Sphere:
    return wf.Sphere((0, 3, 0), 0.5, **options)


@pytest.mark.parametrize(
    ("shape", "due"),
    [
        (ball(emission=1, material=wf.Diffuse(0)), 683 / 36),
        (ball(material=wf.Material(wf.Diffuse(0), emission=1, efficacy=100)), 100 / 36),
        (wf.with_flux(ball(emission=1, material=wf.Diffuse(0)), 360, efficacy=179), 360 / 36 / np.pi**2),
    ],
)
def test_shapes_that_shine(shape: wf.Sphere, due: float) -> None:
    """A ball of radiance L at a distance d: πL r²/d²."""
    found = lit_by(points=AT[:1], shapes=[shape, BLACK], spp=256)
    assert found.lux[0] == pytest.approx(np.pi * due, rel=1e-3)


def test_media_that_shine_are_visible_light() -> None:
    """Beside a lamp of another efficacy: a ball of emission ε per length and volume V brings ε V/d²."""
    fire = wf.Sphere((0, 3, 0), 1, material=wf.Material(wf.NullSurface(), interior=wf.Medium(emission=0.05)))
    due = 683 * 0.05 * 4 / 3 * np.pi / 9
    found = lit_by(Broadband(), shapes=[fire, BLACK], points=AT[:1], spp=1024)
    value, error = found.lux_of("visible")
    assert abs(value[0] - due) < 4 * error[0] < 0.4 * due
    assert found.lux_of("broadband")[0] == pytest.approx(95 / 4, rel=0.2)


def test_errors_are_those_of_the_sum() -> None:
    """A blue lamp in watts that are broadband and a red one, one of which each sample finds.

    The points are all at one place, so their scatter is the error.
    """
    red, blue = wf.PointLight((0, 2, 0), (2, 0, 0)), Broadband()
    found = lit_by(red, blue, spp=32, points=[(0, 0, 0)] * 1500, reuse=False, sampler="independent")
    due = (683 * 2 * 0.2126 + 95) / 4
    assert found.lux.mean() == pytest.approx(due, abs=4 * found.lux.std() / np.sqrt(1500))
    assert np.sqrt(np.mean(found.lux_error**2)) == pytest.approx(found.lux.std(), rel=0.08)
    low, high = found.lux_interval(0.9)
    held = ((low <= due) & (due <= high)).mean()
    assert abs(held - 0.9) < 0.04


def test_gray_light_has_the_errors_of_its_watts() -> None:
    found = lit_by(wf.Environment(np.random.default_rng(0).random((4, 8, 1)) * np.ones(3)), spp=32)
    assert found.lux == pytest.approx(683 * found.value[:, 0], rel=1e-5)
    assert found.lux_error == pytest.approx(683 * found.standard_error[:, 0], rel=1e-3)
    for limit, of_watts in zip(found.lux_interval(0.9), found.interval(0.9), strict=True):
        assert limit == pytest.approx(683 * of_watts[:, 0], rel=1e-3)


def test_color_counts_by_its_luminance() -> None:
    found = lit_by(wf.DirectionalLight((0, -1, 0), (1, 2, 3)))
    assert found.lux == pytest.approx(683 * (0.2126 + 2 * 0.7152 + 3 * 0.0722), rel=1e-5)
    assert wf.to_photometric(found) == pytest.approx(wf.to_photometric(found.value), rel=1e-5)
    with pytest.raises(wf.SceneError, match="efficacy is 179; a measurement has the"):
        wf.to_photometric(found, efficacy=179)
    with pytest.raises(wf.SceneError, match="kind is 'red'"):
        found.lux_of("red")


def test_luminance_and_lumens() -> None:
    """Of radiance cd/m², of flux lumens."""
    sky = wf.Sky.cie(5, horizontal=np.pi)
    seen = wf.measure(wf.Scene([BLACK], [sky]), AT, UP, kind="radiance", spp=4, **QUIET)
    assert seen.lux == pytest.approx(110, rel=1e-4)
    assert "luminance" in seen.columns()
    assert str(seen).endswith("110 to 110 cd·m⁻²")
    panel = wf.Rectangle((0, 0, 0), (0, 0, 2), (3, 0, 0))
    arriving = wf.measure_flux(wf.Scene([BLACK], [sky]), panel, spp=64, **QUIET)
    assert abs(arriving.lux - 110 * np.pi * 6) < 4 * arriving.lux_error < 80
    assert arriving.columns()["lumens"] == pytest.approx(arriving.lux)


def mixed(**settings) -> wf.Measurement:
    floor = wf.Rectangle((-2, -0.5, 2), (4, 0, 0), (0, 0, -4), material=wf.Diffuse((0.8, 0.5, 0.2)))
    lights = wf.Sky.perez(1, 0.5, SUN), wf.Environment(0.1), wf.PointLight((0, 2, 0), (1, 2, 3))
    points = np.random.default_rng(1).uniform(-1, 1, (40, 3)) * (1, 0, 1)
    return lit_by(*lights, shapes=[floor], points=points, **{"spp": 32, **settings})


@pytest.mark.parametrize("reuse", [False, True])
def test_the_same_bits_however_the_work_is_divided(reuse: bool) -> None:
    one, other = mixed(reuse=reuse), mixed(reuse=reuse, wave_size=256, workers=2, executor="threads")
    for name, column in one.columns().items():
        assert column.tobytes() == other.columns()[name].tobytes(), name


def test_shared_paths_bring_as_many_lux() -> None:
    alone, shared = mixed(spp=256, reuse=False), mixed(spp=256, reuse=True)
    away = (alone.lux - shared.lux) / np.hypot(alone.lux_error, shared.lux_error)
    assert np.abs(away).max() < 5
    assert np.abs(away.mean()) < 1
    for kind in ("broadband", "visible"):
        assert alone.lux_of(kind)[0].mean() == pytest.approx(shared.lux_of(kind)[0].mean(), rel=0.05)


def test_parts_files_and_tables(tmp_path) -> None:
    """The parts of a measurement have all of its lux; csv files have columns of it."""
    whole = mixed(aovs=("direct", "light_groups"))
    parts = [
        mixed(spp=None, samples=each, aovs=("direct", "light_groups")) for each in (range(16), range(16, 32))
    ]
    merged = parts[0].merge(parts[1])
    assert merged.lux.tobytes() == whole.lux.tobytes()
    assert merged.lux_error == pytest.approx(whole.lux_error, rel=1e-5)
    whole.save(tmp_path / "a.npz")
    again = wf.Measurement.load(tmp_path / "a.npz")
    assert again.lux.tobytes() == whole.lux.tobytes()
    assert again.lux_interval()[1].tobytes() == whole.lux_interval()[1].tobytes()
    whole.save(tmp_path / "a.csv")
    head, *rows = (tmp_path / "a.csv").read_text().splitlines()
    at = head.split(",").index("lux")
    assert [f4(row.split(",")[at]) for row in rows] == whole.lux.tolist()
    assert head.split(",")[at + 1] == "lux_error"
    del again.image.layers["lux"]
    old = wf.Measurement(again.image)
    assert "lux" not in old.columns()
    assert "lux" not in str(old)
    with pytest.raises(wf.SceneError, match="lux is not known"):
        _ = old.lux


def test_it_is_drawn_in_lux() -> None:
    pytest.importorskip("matplotlib")
    found = mixed(spp=4)
    axes = found.plot(unit="lux")
    assert axes.figure.axes[1].get_ylabel() == "irradiance, lux"
    low, high = axes.figure.axes[1].get_ylim()
    assert low <= found.lux.min()
    assert found.lux.max() <= high < 2 * found.lux.max()
    with pytest.raises(wf.SceneError, match="unit is 'cd'"):
        found.plot(unit="cd")


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: wf.Sky.cie(5, horizontal=9, efficacy=0), "Sky efficacy is 0; it must be above 0 lm/W"),
        (
            lambda: wf.Sky.cie(12, SUN, horizontal=wf.from_photometric(9), direct_normal=7),
            "110.0 and 683.0 lm/W; give all of its light in watts, or all by from_photometric",
        ),
        (lambda: wf.Sky.cie(5, horizontal=wf.from_photometric(9), efficacy=110), "110.0 and 683.0 lm/W"),
        (lambda: wf.Material(wf.Diffuse(0), efficacy=-1), "Material efficacy is -1"),
        (lambda: wf.Weather([0], [1], [(0, 1, 0)], efficacy=0), "Weather efficacy is 0"),
    ],
)
def test_wrong_efficacies(make, said: str) -> None:
    with pytest.raises(wf.SceneError, match=said):
        make()


def test_a_light_of_the_users_must_have_an_efficacy_above_0() -> None:
    light = Lantern()
    light.efficacy = 0
    with pytest.raises(wf.SceneError, match="Lantern efficacy is 0; it must be above 0 lm/W"):
        lit_by(light)


def test_photometric_colors_keep_their_efficacy() -> None:
    color = wf.from_photometric(100, efficacy=179)
    for same in (color, pickle.loads(pickle.dumps(color)), 2 * color[:2], color.copy()):
        assert same.efficacy == 179
    sky = wf.Sky.cie(5, horizontal=color)
    assert pickle.loads(pickle.dumps(sky)).efficacy == sky.efficacy == 179
    sky.efficacy = 179
    assert "efficacy=179" in repr(sky)


def test_a_year_in_lux() -> None:
    """By the efficacy of the weather, or by one that is given: then all values are lux."""
    hours = wf.Weather([723, 0], [120, 90], [SUN, SUN], efficacy=105)
    found = wf.daylight_coefficients(wf.Scene([BLACK]), AT[:1], UP, spp=64, **QUIET)
    due = np.array([723 * HEIGHT + 120, 90])
    in_watts, in_lux = found.annual(hours), found.annual(hours, efficacy=105)
    assert in_watts.value[0] == pytest.approx(due, rel=0.05)
    assert in_watts.lux == pytest.approx(105 * in_watts.value)
    assert in_watts.lux == pytest.approx(in_lux.lux, rel=1e-6)
    assert in_lux.lux.tobytes() == in_lux.value.tobytes()
    assert in_watts.lux_error == pytest.approx(in_lux.standard_error, rel=1e-5)
    for year in (in_watts, in_lux):
        assert year.daylight_autonomy(20_000)[0].tolist() == [0.5]
        assert year.useful_daylight(5000, 20_000)[0].tolist() == [0.5]
    value, error = found.lux(wf.Sky.cie(5, horizontal=90))
    assert value == pytest.approx(110 * 90, rel=0.02)
    assert error[0] < 0.02 * value[0]


def test_lights_of_gltf_have_the_candela_of_their_file(tmp_path) -> None:
    """A point light of 90 cd at a height of 3, and a triangle of 5 cd/m² on the floor seen from above."""
    build = Builder().mesh(material=0)
    build.json["materials"] = [
        {
            "emissiveFactor": [1, 1, 1],
            "doubleSided": True,
            "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": 5}},
        }
    ]
    light = {"type": "point", "intensity": 90}
    build.json["extensionsUsed"] = ["KHR_lights_punctual", "KHR_materials_emissive_strength"]
    build.json["extensions"] = {"KHR_lights_punctual": {"lights": [light]}}
    build.json["nodes"] += [{"translation": [0, 3, 9], "extensions": {"KHR_lights_punctual": {"light": 0}}}]
    build.json["scenes"] = [{"nodes": [0, 1]}]
    build.glb(tmp_path / "a.glb")
    below = wf.measure(tmp_path / "a.glb", [(0, 0, 9)], UP, spp=1024, max_bounces=0, **QUIET)
    assert abs(below.lux - 10) < 4 * below.lux_error + 0.01 < 0.4
    emitted = {"kind": "radiance", "spp": 4, "max_bounces": 0, **QUIET}
    alone = wf.load(tmp_path / "a.glb")
    under_sky = wf.Scene(alone.shapes, [wf.Sky.cie(5, horizontal=1)])
    for scene in (alone, under_sky):
        seen = wf.measure(scene, [(0.2, 0.2, 1)], (0, 0, -1), **emitted)
        assert seen.lux == pytest.approx(5)
