"""Photometric units: what is given in lux, candela and cd/m² is read back; exposure by ISO 12232."""

import numpy as np
import pytest
from scenes import EYE, floor, probe
from significance import measure

import wavefront as wf

COLORS = [1.0, (0.2, 0.9, 0.1), "moccasin", "#00f"]


@pytest.mark.parametrize("color", COLORS)
@pytest.mark.parametrize("efficacy", [683, 179])
def test_back_and_forth(color, efficacy: float) -> None:
    found = wf.from_photometric(850, color, efficacy=efficacy)
    assert found.shape == (3,)
    assert wf.to_photometric(found, efficacy=efficacy) == pytest.approx(850)
    assert efficacy * (found @ [0.2126, 0.7152, 0.0722]) == pytest.approx(850)
    again = wf.from_photometric(850, found, efficacy=efficacy)
    assert again == pytest.approx(found)


def test_arrays() -> None:
    rows = np.arange(24, dtype=np.float32).reshape(2, 4, 3)
    found = wf.to_photometric(rows)
    assert found.dtype == np.float32
    assert found == pytest.approx(683 * (rows @ np.float32([0.2126, 0.7152, 0.0722])), rel=1e-6)
    assert wf.to_photometric([1, 0, 0]) == pytest.approx(683 * 0.2126)


def test_lux_on_a_floor() -> None:
    """A sun of E lux, seen on a white floor of reflectance 0.5: L = E·0.5/π cd/m²."""
    sun = wf.DirectionalLight((0, -1, 0), wf.from_photometric(10_000))
    scene = wf.Scene([floor(wf.Diffuse(0.5))], [sun], probe((0, 0, 0), EYE))
    seen = measure(scene, 4, integrator="direct_mis", max_bounces=1).value
    assert 683 * seen == pytest.approx(10_000 * 0.5 / np.pi, rel=1e-4)


def test_candela_over_a_floor() -> None:
    lamp = wf.PointLight((0, 2, 0), wf.from_photometric(300))
    scene = wf.Scene([floor(wf.Diffuse(0.5))], [lamp], probe((0, 0, 0), EYE))
    seen = measure(scene, 4, integrator="direct_mis", max_bounces=1).value
    assert 683 * seen == pytest.approx(300 / 4 * 0.5 / np.pi, rel=1e-4)


@pytest.mark.parametrize("ev100", [-3, 0, 7, 15.0])
@pytest.mark.parametrize("efficacy", [683, 179])
def test_exposure_saturates_at_its_luminance(ev100: float, efficacy: float) -> None:
    """78/(100·0.65)·2^EV cd/m² become 1."""
    white = wf.from_photometric(78 / 65 * 2**ev100, efficacy=efficacy)
    assert white * 2 ** wf.exposure(ev100, efficacy=efficacy) == pytest.approx(np.ones(3))


def test_settings_of_a_camera() -> None:
    assert wf.exposure(f_number=1, shutter=1) == pytest.approx(wf.exposure(0))
    assert wf.exposure(f_number=16, shutter=1 / 100) == pytest.approx(wf.exposure(np.log2(256 * 100)))
    assert wf.exposure(f_number=8, shutter=1 / 60, iso=400) == pytest.approx(
        wf.exposure(f_number=8, shutter=1 / 60) + 2
    )


BAD = {
    "negative": (lambda: wf.from_photometric(-1), "photometric value is -1; it must be at least 0"),
    "black": (lambda: wf.from_photometric(1, 0), "photometric color is black"),
    "efficacy": (lambda: wf.from_photometric(1, efficacy=0), "efficacy is 0; it must be above 0"),
    "channels": (lambda: wf.to_photometric([1, 2]), r"must have shape \(..., 3\), got \(2,\)"),
    "none": (wf.exposure, "exposure needs ev100, or f_number and shutter"),
    "both": (lambda: wf.exposure(3, shutter=1), "and not both"),
    "half": (lambda: wf.exposure(shutter=1), "exposure f_number must be a number, got None"),
    "shutter": (lambda: wf.exposure(f_number=2, shutter=0), "exposure shutter is 0; it must be above 0"),
    "word": (lambda: wf.exposure("bright"), "exposure ev100 must be a number"),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_arguments_are_named(name: str) -> None:
    call, message = BAD[name]
    with pytest.raises(wf.SceneError, match=message):
        call()
