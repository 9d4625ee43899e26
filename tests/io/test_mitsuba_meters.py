"""Sensors of Mitsuba that measure light, and its sky, which is light to be measured."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from inside import Y_INTEGRAL, Sensors, cie_function, main

import wavefront as wf

BLACK = {"type": "diffuse", "reflectance": 0.0}
METER = {"type": "irradiancemeter"}
SKY = {"type": "constant", "radiance": {"type": "rgb", "value": [1, 2, 3]}}
RADIANCE = """<scene version="3.0.0">
  <integrator type="path"><integer name="max_depth" value="2"/></integrator>
  <sensor type="radiancemeter">
    <point name="origin" x="0" y="0" z="4"/><vector name="direction" x="0" y="0" z="-2"/>
    <sampler type="independent"><integer name="sample_count" value="4"/></sampler>
  </sensor>
  <shape type="rectangle"><emitter type="area"><rgb name="radiance" value="1 2 3"/></emitter></shape>
</scene>"""


def scene(strict: bool = True, **parts: Any) -> wf.Scene:
    return wf.from_mitsuba({"type": "scene", **parts}, strict=strict)


def measured(spp: int = 16, **parts: Any) -> wf.Measurement:
    return wf.Measurement(wf.render(scene(**parts), spp, progress=False, workers=1))


@pytest.mark.parametrize(
    ("place", "seen"),
    [
        ({"origin": [0, 0, 4], "direction": [0, 0, -2]}, (1, 2, 3)),
        ({"to_world": np.diag([1.0, -1, -1, 1])}, (0, 0, 0)),
        ({"to_world": [[1, 0, 0, 0.5], [0, -1, 0, 0], [0, 0, -3, 4], [0, 0, 0, 1]]}, (1, 2, 3)),
        ({"to_world": np.eye(4) + 2 * np.eye(4)[2][:, None] * np.eye(4)[3]}, (0, 0, 0)),  # beyond it
    ],
)
def test_a_radiance_meter_sees_what_is_ahead(place: dict[str, Any], seen: tuple[float, ...]) -> None:
    lamp = {"type": "rectangle", "emitter": {"type": "area", "radiance": SKY["radiance"]}, "bsdf": BLACK}
    found = measured(view={"type": "radiancemeter", **place}, lamp=lamp)
    assert found.kind == "radiance"
    np.testing.assert_allclose(found.value, [seen], rtol=1e-5)


def test_the_settings_of_a_meter() -> None:
    sampler, ball = {"type": "independent", "sample_count": 9}, {"type": "sphere"}
    made = scene(
        view={"type": "radiancemeter", "sampler": sampler},
        path={"type": "path", "max_depth": 3},
        ball=ball,
    )
    assert made.settings == {
        "filter": "box",
        "lighting": None,
        "spp": 9,
        "max_bounces": 2,
        "roulette": 5,
    }
    assert wf.Measurement(wf.render(made, progress=False)).value.max() == 0  # no light is added
    with pytest.warns(UserWarning, match="hide_emitters for a sensor that measures light"):
        scene(False, view={"type": "radiancemeter"}, i={"type": "path", "hide_emitters": True}, s=ball)
    with pytest.raises(wf.SceneError, match=r"view \(radiancemeter\): direction"):
        scene(view={"type": "radiancemeter", "origin": [0, 0, 0]})


SHAPES = {
    "rectangle": {"type": "rectangle", "to_world": np.diag([3.0, 1, 1, 1])},
    "sphere": {"type": "sphere", "radius": 2},
    "cylinder": {"type": "cylinder", "radius": 0.5},
    "cube": {"type": "cube"},
}


@pytest.mark.parametrize("kind", SHAPES)
def test_an_irradiance_meter_measures_power_over_area(kind: str) -> None:
    found = measured(shape={**SHAPES[kind], "meter": METER, "bsdf": BLACK}, sky=SKY)
    assert found.kind == "irradiance"
    np.testing.assert_allclose(found.value, [np.pi * np.array([1, 2, 3])], rtol=1e-5)


def test_an_irradiance_meter_agrees_with_the_flux() -> None:
    lamp = {
        "type": "sphere",
        "center": [0, 1, 2],
        "radius": 0.3,
        "emitter": {"type": "area", "radiance": 5.0},
    }
    made = scene(plate={"type": "rectangle", "meter": METER}, lamp=lamp)
    shown = wf.Measurement(wf.render(made, 64, progress=False, workers=1))
    flux = wf.measure_flux(made, "plate", spp=64, progress=False, workers=1)
    assert flux.kind == "arriving flux"
    np.testing.assert_allclose(shown.value, flux.value / 4, rtol=1e-6)  # of the same paths
    np.testing.assert_allclose(shown.standard_error, flux.standard_error / 4, rtol=1e-6)
    flipped = measured(plate={"type": "rectangle", "meter": METER, "flip_normals": True}, lamp=lamp)
    assert flipped.value.max() == 0


def test_meters_that_count_for_nothing_are_named() -> None:
    view = {"type": "perspective"}
    with pytest.warns(UserWarning, match="the further sensor 'irradiancemeter'"):
        made = scene(False, view=view, plate={"type": "rectangle", "meter": METER})
    assert not isinstance(made.camera, Sensors)
    group = {"type": "shapegroup", "ball": {"type": "sphere", "meter": METER}}
    with pytest.warns(UserWarning, match="left out, as it is in a group"):
        scene(False, group=group, copy={"type": "instance", "g": {"type": "ref", "id": "group"}})
    with pytest.warns(UserWarning, match="left out, as it is at no mesh or sphere"):
        made = scene(False, view=METER, ball={"type": "sphere"})
    assert made.camera is None


def test_the_command_line_measures_what_a_file_has(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("meter.xml").write_text(RADIANCE)
    assert main(["render", "meter.xml", "--quiet"]) != 0
    assert "wavefront measure meter.xml -o out.csv" in capsys.readouterr().err
    assert main(["measure", "meter.xml", "--quiet", "--workers", "1"]) == 0
    assert capsys.readouterr().out.startswith("out.csv: radiance at 1 point, ")
    table = np.genfromtxt("out.csv", delimiter=",", names=True)
    assert [float(table[name]) for name in ("z", "nz", "r", "g", "b", "samples")] == [4, -1, 1, 2, 3, 4]
    Path("none.xml").write_text('<scene version="3.0.0"><shape type="sphere"/></scene>')
    assert main(["measure", "none.xml", "--quiet"]) != 0
    assert "none.xml: has no sensor that measures light" in capsys.readouterr().err
    assert main(["info", "meter.xml"]) == 0


@pytest.fixture
def model(calls_of: Any) -> list[Any]:
    """An even sky of radiance 4 and a sun of irradiance 1000; returns what is asked."""
    asked: list[Any] = []

    def even(turbidity: float, albedo: Any, cos_sun: float) -> Any:
        asked.append((turbidity, albedo.ravel().astype(float).round(4).tolist(), round(cos_sun, 4)))
        return cie_function(5), np.full((3, 1), 4, np.float32), np.full(3, 1000.0)

    calls_of("wavefront.lights.sky.hosek_wilkie_sky", even)
    return asked


def lights(**parameters: Any) -> list[Any]:
    return scene(sun={"type": "sunsky", **parameters}, ball={"type": "sphere"}).lights


def test_the_parameters_of_sky_and_sun(model: list[Any]) -> None:
    albedo = {"type": "rgb", "value": [0.1, 0.2, 0.3]}
    above, disk = lights(
        turbidity=5.0,
        albedo=albedo,
        sun_direction=[0, 0.6, 0.8],
        sky_scale=2.0,
        sun_scale=0.5,
        sun_aperture=4.0,
    )
    assert model == [(5.0, [0.1, 0.2, 0.3], 0.8)] * 2
    assert above.up.tolist() == [0, 0, 1]
    np.testing.assert_allclose(
        above.radiance([(0, 0, 1), (1, 0, -1)]) * Y_INTEGRAL, [[8] * 3, [0] * 3], rtol=1e-5
    )
    assert not above.direct_normal.any()
    mean_cosine = (1 + np.cos(np.radians(2))) / 2
    np.testing.assert_allclose(disk.irradiance, 500 / Y_INTEGRAL * mean_cosine, rtol=1e-6)
    np.testing.assert_allclose(disk.direction, [0, -0.6, -0.8], atol=1e-7)
    assert disk.angle == 4
    turn = np.array([[1.0, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]])
    (above,) = lights(to_world=turn, sun_direction=[0, 0.5, 0.5], sun_scale=0.0)
    assert above.up.tolist() == [0, 1, 0]
    (disk,) = lights(sun_direction=[0, 0.6, 0.8], sky_scale=0.0)
    assert disk.angle == pytest.approx(0.5358)
    with pytest.raises(wf.SceneError, match="complex_sun"):
        lights(sun_direction=[0, 0, 1], complex_sun=True)


def test_the_sun_at_a_time(model: list[Any], calls_of: Any) -> None:
    """North is -x and east is -y before to_world; a time is that of its zone."""
    asked: list[Any] = []

    def position(time: Any, latitude: float, longitude: float, up: str) -> Any:
        asked.append((time.isoformat(), latitude, longitude, up))
        return np.array([0.48, -0.6, 0.64])  # east, north, up

    calls_of("wavefront.io.mitsuba.emitters.sun_position", position)
    above, _ = lights(
        year=2024, month=4, day=3, hour=9.5, minute=20.0, second=30.0, timezone=2.0, latitude=48.0
    )
    assert asked == [("2024-04-03T07:50:30+00:00", 48.0, 139.6917, "z")]
    np.testing.assert_allclose(above.sun, [0.6, -0.48, 0.64], atol=1e-12)
    turn = np.array([[1.0, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]])
    above, _ = lights(to_world=turn)
    np.testing.assert_allclose(above.sun, [0.6, 0.64, 0.48], atol=1e-12)
    assert asked[1][0] == "2010-07-10T06:00:00+00:00"


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({"sun_direction": [0, 0, 1], "hour": 3.0}, "has sun_direction and hour; give one of them"),
        ({"sun_direction": [0, 0, -1]}, "above the horizon"),
        ({"month": 13}, "month is 13"),
        ({"month": 2, "day": 30}, r"sun \(sunsky\): the time of its sun: day is out of range"),
        ({"albedo": {"type": "checkerboard"}, "sun_direction": [0, 0, 1]}, "albedo, a texture"),
    ],
)
def test_a_malformed_sky_is_refused(model: list[Any], parameters: dict[str, Any], message: str) -> None:
    with pytest.raises(wf.SceneError, match=message):
        lights(**parameters)


def test_without_the_data_an_error_says_what_to_install(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "mitsuba").mkdir()  # a package without them
    (tmp_path / "mitsuba" / "__init__.py").touch()
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(wf.SceneError, match=r"sun \(sunsky\): Sky.hosek_wilkie needs .*pip install mitsuba"):
        lights(sun_direction=[0, 0, 1])
