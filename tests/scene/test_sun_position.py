"""The direction to the sun: axes, and the algorithm where pvlib is installed."""

import sys
from datetime import datetime
from types import ModuleType

import numpy as np
import pytest

import wavefront as wf


class Column(list):
    def to_numpy(self) -> np.ndarray:
        return np.array(self, float)


@pytest.fixture
def library(monkeypatch) -> list:
    """In place of pvlib: the sun is 30° high, at 60° from north to east; returns what it is asked."""
    asked = []

    def get_solarposition(times, *place):
        asked.append((list(times), place))
        n = len(times)
        return {"apparent_elevation": Column([30.0] * n), "azimuth": Column([60.0] * n)}

    pandas, pvlib, solar = (ModuleType(name) for name in ("pandas", "pvlib", "pvlib.solarposition"))
    pandas.DatetimeIndex = list
    solar.get_solarposition = get_solarposition
    for module in (pandas, pvlib, solar):
        monkeypatch.setitem(sys.modules, module.__name__, module)
    return asked


@pytest.mark.parametrize(
    ("axes", "up", "north"),
    [
        ({}, (0, 1, 0), (0, 0, -1)),
        ({"up": "z"}, (0, 0, 1), (0, 1, 0)),
        ({"up": "z", "north": (1, 0, 0)}, (0, 0, 1), (1, 0, 0)),
        ({"north": (3, 5, 3)}, (0, 1, 0), (np.sqrt(0.5), 0, np.sqrt(0.5))),
    ],
)
def test_axes(library, axes: dict, up: tuple, north: tuple) -> None:
    sun = wf.sun_position("2026-06-21 12:00", 48, 11, altitude=500, **axes)
    up, north = np.array(up, float), np.array(north, float)
    east = np.cross(north, up)
    due = 0.5 * up + np.sqrt(0.75) * (0.5 * north + np.sqrt(0.75) * east)
    np.testing.assert_allclose(sun, due, atol=1e-12)
    assert library == [(["2026-06-21 12:00"], (48, 11, 500))]


def test_east_is_where_maps_have_it(library) -> None:
    """Right of north, seen from above: +x by default, whether y or z is up."""
    for up in "yz":
        assert wf.sun_position("2026-06-21", 48, 11, up=up)[0] == pytest.approx(0.75)


def test_several_times(library) -> None:
    assert wf.sun_position(["2026-06-21", "2026-06-22"], 48, 11).shape == (2, 3)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ({"latitude": 91}, "latitude is 91; it must be from -90 to 90"),
        ({"longitude": 200}, "longitude is 200"),
        ({"north": (0, 2, 0)}, "it must not be vertical"),
        ({"up": "w"}, "up is 'w'"),
    ],
)
def test_wrong_input(library, arguments: dict, said: str) -> None:
    with pytest.raises(wf.SceneError, match=said):
        wf.sun_position("2026-06-21", **{"latitude": 48, "longitude": 11, **arguments})


def test_without_the_library(missing) -> None:
    missing("pvlib")
    with pytest.raises(ImportError, match="pip install pvlib"):
        wf.sun_position("2026-06-21", 48, 11)


def test_the_algorithm() -> None:
    """The example of Reda and Andreas (2004), table A5.1: zenith 50.11162°, azimuth 194.34024°."""
    pytest.importorskip("pvlib")
    sun = wf.sun_position("2003-10-17 12:30:30-07:00", 39.742476, -105.1786, altitude=1830.14, up="z")
    z, a = np.radians([50.11162, 194.34024])
    due = np.sin(z) * np.sin(a), np.sin(z) * np.cos(a), np.cos(z)
    np.testing.assert_allclose(sun, due, atol=2e-5)
    with pytest.raises(wf.SceneError, match="time is 'noon'"):
        wf.sun_position("noon", 48, 11)


@pytest.mark.parametrize(
    "time",
    [
        "2026-06-21 12:00",
        datetime(2026, 6, 21, 12),
        np.datetime64("2026-06-21T12:00"),
        ["2026-06-21 12:00"] * 2,
    ],
)
def test_a_time_without_a_zone_is_taken_for_utc_with_a_warning(time) -> None:
    pytest.importorskip("pvlib")
    with pytest.warns(UserWarning, match="the time 2026-06-21 12:00:00 has no zone and is taken for UTC"):
        sun = wf.sun_position(time, 48.1, 11.6)
    known = wf.sun_position("2026-06-21 14:00+02:00", 48.1, 11.6)
    assert np.abs(sun - known).max() < 1e-12


@pytest.mark.parametrize("time", [float("nan"), [None, "2026-06-21"], "nat", object(), []])
def test_a_time_that_is_missing(time: object) -> None:
    pytest.importorskip("pvlib")
    with pytest.raises(wf.SceneError, match=r"^time is "):
        wf.sun_position(time, 48, 11)
