"""The light at points over many hours, and the figures that planners need."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from ..arrays.vec import Bools, Doubles, Floats
from ..core.errors import SceneError, number
from ..core.suggestions import suggests_keywords
from .weather import Weather

USEFUL = 100.0, 3000.0  # lux


class Year:
    """The light at points in each hour, from `DaylightCoefficients.annual`.

    Errors are those of the coefficients; the model of the sky and the weather have errors of their own. They
    are estimated by the jackknife, which leaves out one part of the samples at a time, for all figures.

    Parameters
    ----------
    batches
        (b, n, h) irradiance, or illuminance, of n points in h hours, by b independent parts of the samples.
    weather
        The suns and irradiances of the hours.
    efficacy
        Lux for each unit of `batches`: 1 if they are illuminances.

    Examples
    --------
    >>> hours = wf.Weather([300, 600], [100, 120], sun=[(0.5, 0.5, 1), (0, 1, 1)])
    >>> found = wf.daylight_coefficients([wf.Sphere((0, 0, 9), 1)], [(0, 0, 0)], (0, 1, 0), spp=64)
    >>> year = found.annual(hours)
    >>> isinstance(year, wf.Year), year.value.shape
    (True, (1, 2))
    >>> np.allclose(year.lux, 110 * year.value)
    True
    >>> share, error = year.daylight_autonomy(60_000)
    >>> share.tolist()
    [0.5]
    """

    def __init__(self, batches: Floats, weather: Weather, efficacy: float = 1.0) -> None:
        self.batches, self.weather = batches, weather
        self.efficacy = number("Year efficacy", efficacy, lambda x: x > 0, "above 0")

    @property
    def value(self) -> Doubles:
        """(n, h) mean of the batches."""
        return np.asarray(self.batches.mean(0, dtype=float))

    @property
    def standard_error(self) -> Doubles:
        """(n, h) of `value`."""
        spread = self.batches.std(0, ddof=1, dtype=float)
        return np.asarray(spread / np.sqrt(len(self.batches)))

    @property
    def lux(self) -> Doubles:
        """(n, h) illuminance."""
        return np.asarray(self.value * self.efficacy)

    @property
    def lux_error(self) -> Doubles:
        """(n, h) standard error of `lux`."""
        return np.asarray(self.standard_error * self.efficacy)

    @suggests_keywords
    def total(self, hours: ArrayLike | None = None) -> tuple[Doubles, Doubles]:
        """Return the sum of `value` over the hours, such as W·h·m⁻², and its standard error, (n,) each.

        Parameters
        ----------
        hours
            Which hours count: a mask (h,) or indices; all of them by default.
        """
        return self._estimate(lambda light: light.sum(1), hours)

    @suggests_keywords
    def daylight_autonomy(self, least: float, hours: ArrayLike | None = None) -> tuple[Doubles, Doubles]:
        """Return the part of the hours with at least so much light, and its standard error, (n,) each.

        Parameters
        ----------
        least
            Lux, such as 300.
        hours
            Those in which the room is used, as for `total`.
        """
        limit = number("least", least)
        return self._estimate(lambda light: (light * self.efficacy >= limit).mean(1), hours)

    @suggests_keywords
    def useful_daylight(
        self, low: float = USEFUL[0], high: float = USEFUL[1], hours: ArrayLike | None = None
    ) -> tuple[Doubles, Doubles]:
        """Return the part of the hours with useful daylight illuminance, and its standard error, (n,) each.

        Source: A. Nabil and J. Mardaljevic, Useful Daylight Illuminances, Energy and Buildings 38(7), 2006.

        Parameters
        ----------
        low, high
            Limits, lux.
        hours
            As for `total`.
        """
        least, most = number("low", low), number("high", high, lambda x: x >= low, f"at least low, {low}")
        return self._estimate(lambda light: self._between(light, least, most).mean(1), hours)

    def _between(self, light: Doubles, least: float, most: float) -> Bools:
        lux = light * self.efficacy
        return np.asarray((lux >= least) & (lux <= most))

    def _estimate(
        self, figure: Callable[[Doubles], Doubles], hours: ArrayLike | None
    ) -> tuple[Doubles, Doubles]:
        """Return a figure (n,) of the light (n, h), and its standard error by the jackknife."""
        every = np.arange(len(self.weather))
        try:
            chosen = every if hours is None else every[np.asarray(hours)]
        except IndexError as error:
            raise SceneError(f"hours must be a mask of {every.size} hours, or indices: {error}") from error
        if not chosen.size:
            raise SceneError("hours is empty; there must be at least one hour")
        light = self.batches[:, :, chosen].astype(float)
        count, whole = len(light), light.sum(0)
        without = np.stack([figure((whole - batch) / (count - 1)) for batch in light])
        away = without - without.mean(0)
        return figure(whole / count), np.sqrt((count - 1) / count * (away * away).sum(0))
