"""Where the sun stands at a time and a place."""

from __future__ import annotations

from datetime import UTC
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..arrays.elementary import sin_cos_turns
from ..arrays.vec import Doubles
from ..camera import upward
from ..core.errors import SceneError, finite_array, in_brief, number, warn_caller
from ..core.suggestions import suggests_keywords
from .scene import turned_up


@suggests_keywords
def sun_position(
    time: Any,
    latitude: float,
    longitude: float,
    *,
    altitude: float = 0.0,
    up: ArrayLike = "y",
    north: ArrayLike | None = None,
) -> Doubles:
    """Return the direction to the sun, by the solar position algorithm of pvlib (`pip install pvlib`).

    Parameters
    ----------
    time
        A time with its zone, such as "2026-06-21 12:00+02:00", a `datetime`, or several (n,), as pandas reads
        them. One without a zone is taken for UTC, with a warning: most clocks show another time.
    latitude
        Degrees, north positive.
    longitude
        Degrees, east positive.
    altitude
        Above sea level, m.
    up
        Direction to the zenith: (3,), or the name of an axis, such as "z".
    north
        (3,) direction to the north, of which the level part counts. By default it is -z where y is up, and y
        where z is up, so that east is x.

    Returns
    -------
    (3,) unit vector, or (n, 3) of several times, with the refraction of the air. It is below the horizon by
    night.

    Raises
    ------
    SceneError
        If an argument is malformed or out of its range, or north is vertical.
    ImportError
        If pvlib is not installed.

    Notes
    -----
    Source: I. Reda and A. Andreas, Solar Position Algorithm for Solar Radiation Applications, Solar Energy
    76(5), 2004.

    Examples
    --------
    >>> wf.sun_position("2026-06-21 14:00+02:00", latitude=48.1, longitude=11.6).round(2)
    array([-0.18,  0.9 ,  0.4 ])
    """
    place = (
        number("latitude", latitude, lambda x: abs(x) <= 90, "from -90 to 90"),
        number("longitude", longitude, lambda x: abs(x) <= 180, "from -180 to 180"),
        number("altitude", altitude),
    )
    zenith, toward_north, east = horizon_axes(up, north)
    try:
        import pandas
        from pvlib.solarposition import get_solarposition
    except ImportError as error:
        raise ImportError("sun_position needs pvlib: pip install pvlib") from error
    try:
        times = pandas.DatetimeIndex(np.atleast_1d(np.asarray(time, dtype=object)))
    except (TypeError, ValueError, OverflowError) as error:
        raise SceneError(f"time is {in_brief(time)}; it must be a time, or several: {error}") from error
    if not len(times) or getattr(times, "hasnans", False):
        raise SceneError(f"time is {in_brief(time)}; it must be a time, or several, none of which is missing")
    if getattr(times, "tz", UTC) is None:
        warn_caller(
            f"sun_position: the time {times[0]} has no zone and is taken for UTC; write {times[0]}+00:00 if "
            "it is, or the zone of the place, such as +02:00"
        )
    position = get_solarposition(times, *place)
    (high, level), (across, along) = (
        sin_cos_turns(position[name].to_numpy() / 360) for name in ("apparent_elevation", "azimuth")
    )
    sun = np.outer(high, zenith) + np.outer(level * along, toward_north) + np.outer(level * across, east)
    return sun[0] if np.ndim(time) == 0 else sun


def horizon_axes(up: ArrayLike, north: ArrayLike | None) -> tuple[Doubles, Doubles, Doubles]:
    """Return the unit vectors (3,) to the zenith, the north and the east.

    Raises
    ------
    SceneError
        If one is malformed, or north is vertical.
    """
    turn = turned_up(upward("up", up))
    zenith = turn[:, 1]
    level = -turn[:, 2] if north is None else finite_array("north", north, (3,))
    level = level - (level * zenith).sum() * zenith
    length = np.sqrt((level * level).sum())
    if not length > 1e-9 * max(1.0, np.abs(level).max()):
        raise SceneError(f"north is {north!r}; it must not be vertical")
    level = level / length
    return zenith, level, np.cross(level, zenith)
