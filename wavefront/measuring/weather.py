"""The sun and the sky in each hour of a year: weather files."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from datetime import UTC, datetime, timedelta, timezone

import numpy as np
from numpy.typing import ArrayLike

from ..arrays.vec import Doubles, f4
from ..colors import DAYLIGHT
from ..core.errors import SceneError, exact, finite_array, number
from ..core.files import decode_text, read_bytes
from ..core.suggestions import suggests_keywords
from ..lights import SkyPatches
from ..lights.sky import SOLAR_CONSTANT, relative_radiance
from ..lights.sky_functions import perez_function
from ..scene.sun_position import horizon_axes, sun_position

HEADER = 8  # lines of an EPW file
YEAR, MINUTE, DIRECT, DIFFUSE = 0, 4, 14, 15  # columns
RANGES = (("year", 0, 1700, 2200), ("month", 1, 1, 12), ("day", 2, 1, 31), ("hour", 3, 0, 24))  # by columns
MISSING = 9999  # stands for a value that was not measured


class Weather:
    """The irradiances and the direction to the sun of many hours.

    Parameters
    ----------
    direct_normal
        (h,) irradiance by the sun of a surface that faces it, W·m⁻².
    diffuse_horizontal
        (h,) irradiance of a horizontal plane by the sky, W·m⁻².
    sun
        (h, 3) directions to the sun, of any length.
    efficacy
        lm/W of both, for lux: about 110, of all watts of sun and sky.

    Raises
    ------
    SceneError
        If an array is malformed, an irradiance is negative, or the efficacy is not above 0.

    Examples
    --------
    >>> day = wf.Weather([0, 300, 600], [50, 100, 120], sun=[(1, 0.2, 1), (0.5, 0.5, 1), (0, 1, 1)])
    >>> len(day)
    3
    """

    def __init__(
        self,
        direct_normal: ArrayLike,
        diffuse_horizontal: ArrayLike,
        sun: ArrayLike,
        *,
        efficacy: float = DAYLIGHT,
    ) -> None:
        self.efficacy = number("Weather efficacy", efficacy, lambda x: x > 0, "above 0 lm/W")
        self.direct_normal = finite_array("direct_normal", direct_normal, (None,))
        shape = self.direct_normal.shape
        self.diffuse_horizontal = finite_array("diffuse_horizontal", diffuse_horizontal, (None,))
        if self.diffuse_horizontal.shape != shape:
            hours = f"{len(self.direct_normal)} and {len(self.diffuse_horizontal)}"
            raise SceneError(
                f"direct_normal and diffuse_horizontal have {hours} hours; they must have as many"
            )
        towards = finite_array("sun", sun, (*shape, 3))
        for name, values in (
            ("direct_normal", self.direct_normal),
            ("diffuse_horizontal", self.diffuse_horizontal),
        ):
            if (values < 0).any():
                at = int(values.argmin())
                raise SceneError(f"{name}[{at}] is {exact(values[at])}; it must be at least 0")
        length = np.sqrt((towards * towards).sum(1, keepdims=True))
        if not length.all():
            raise SceneError(f"sun[{int(length.argmin())}] is zero; it must have a direction")
        self.sun = towards / length

    def __len__(self) -> int:
        """Return the number of hours."""
        return len(self.direct_normal)

    def height(self, patches: SkyPatches) -> Doubles:
        """Return the sine of the sun's height, (h,)."""
        return product(self.sun, patches.axes[:, 2:])[:, 0]

    def on_patches(self, patches: SkyPatches, ground: float, along: int) -> tuple[Doubles, Doubles]:
        """Return the radiance of patches by sky and ground, and by the sun alone, (p, h) each.

        The sun's is that of the patch that it stands in, with all of its irradiance. While it is below the
        horizon the sky is even.
        """
        directions = patches.directions(along)
        wi = directions.reshape(3, -1).astype(f4)
        up = product(patches.axes[:, 2:].T, directions.reshape(3, -1))[0].astype(f4)
        weights, projected = patches.weights(along), patches.projected
        height, stands_in = self.height(patches), patches.number(np.ascontiguousarray(self.sun.T, f4))
        sky, sun = np.zeros((len(patches), len(self))), np.zeros((len(patches), len(self)))
        for hour in np.flatnonzero(self.diffuse_horizontal > 0):
            direct, diffuse = float(self.direct_normal[hour]), float(self.diffuse_horizontal[hour])
            if height[hour] <= 0:
                sky[1:, hour] = diffuse / np.pi
                continue
            function = perez_function(direct, diffuse, min(float(height[hour]), 1.0), SOLAR_CONSTANT)
            relative = relative_radiance(function, wi, up, self.sun[hour].astype(f4))
            mean = (relative.astype(float).reshape(weights.shape) * weights).sum(1)
            sky[1:, hour] = diffuse / (mean * projected).sum() * mean
        level = np.where(height > 0, self.direct_normal * height, 0)
        sky[0] = ground / np.pi * (self.diffuse_horizontal + level)
        by_day = np.flatnonzero(level > 0)
        patch = stands_in[by_day]
        sun[patch, by_day] = self.direct_normal[by_day] / patches.solid_angles[patch]
        return sky, sun


def product(a: Doubles, b: Doubles) -> Doubles:
    """Return the matrix product of a (n, p) and b (p, m), with the same bits everywhere."""
    out = np.zeros((len(a), b.shape[1]))
    for column, row in zip(a.T, b, strict=True):
        out += column[:, None] * row
    return out


@suggests_keywords
def load_weather(
    path: str | os.PathLike[str], *, up: ArrayLike = "y", north: ArrayLike | None = None
) -> Weather:
    """Read a weather file of EnergyPlus (EPW): the sun and the sky of each hour of a year.

    The sun is that of the middle of the hour, by `sun_position`, which needs pvlib.

    Parameters
    ----------
    path
        The file.
    up, north
        As for `sun_position`.

    Raises
    ------
    SceneError
        If it cannot be read, or a line is malformed or lacks an irradiance. The message names it.
    ImportError
        If pvlib is not installed.

    Notes
    -----
    Source: EnergyPlus, Auxiliary Programs, "EnergyPlus Weather File (EPW) Data Dictionary".

    Examples
    --------
    >>> year = wf.load_weather("munich.epw")  # doctest: +SKIP
    """
    name = os.fspath(path)
    lines = decode_text(read_bytes(path)).splitlines()
    head = lines[0].split(",") if lines else []
    if len(lines) <= HEADER or head[0] != "LOCATION":
        raise SceneError(
            f"{name}: is no weather file: the first of more than {HEADER} lines must be LOCATION"
        )
    latitude, longitude, zone, altitude = _numbers(name, 1, head, range(6, 10))
    if not abs(zone) < 24:
        raise SceneError(f"{name}: line 1 has the time zone {zone:g}; it must be within 24 hours of UTC")
    times, rows = [], []
    for at, line in enumerate(lines[HEADER:], HEADER + 1):
        words = line.split(",")
        values = _numbers(name, at, words, (*range(YEAR, MINUTE), DIRECT, DIFFUSE))
        if not all(0 <= value < MISSING for value in values[-2:]):
            raise SceneError(
                f"{name}: line {at} has the irradiances {values[-2:]}; they must be from 0 to {MISSING}"
            )
        for what, column, low, high in RANGES:
            if not low <= values[column] <= high:
                limit = f"it must be from {low} to {high}"
                raise SceneError(f"{name}: line {at} has the {what} {values[column]:g}; {limit}")
        year, month, day, hour = (int(value) for value in values[:4])
        try:
            midnight = datetime(year, month, day, tzinfo=timezone(timedelta(hours=zone)))
        except (ValueError, OverflowError) as error:
            raise SceneError(f"{name}: line {at} has no such day: {error}") from error
        times.append(midnight + timedelta(hours=hour - 0.5))
        rows.append(values[-2:])
    utc = [time.astimezone(UTC) for time in times]
    horizon_axes(up, north)  # these are no fault of the file
    try:
        sun = sun_position(utc, latitude, longitude, altitude=altitude, up=up, north=north)
    except SceneError as error:
        raise SceneError(f"{name}: {error}") from error
    direct, diffuse = np.array(rows).T
    return Weather(direct, diffuse, sun)


def _numbers(name: str, at: int, words: list[str], columns: Sequence[int]) -> list[float]:
    """Return the numbers of some columns of a line."""
    try:
        values = [float(words[column]) for column in columns]
    except (IndexError, ValueError) as error:
        raise SceneError(f"{name}: line {at} is malformed: {error}") from error
    for column, value in zip(columns, values, strict=True):
        if not math.isfinite(value):
            raise SceneError(f"{name}: line {at} is malformed: column {column + 1} is {value}")
    return values
