"""Reconstruction filters, by filter importance sampling.

A sample counts only for its own pixel and with weight 1; the distribution of its position is the filter.
So pixels share no samples, and no filter has negative lobes.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from ..arrays.vec import Floats, f4
from ..core.errors import flag, number
from ..core.registry import Registry
from . import warp

Filter: TypeAlias = Callable[[Floats], Floats]

MOST_PIXELS = 64  # of a radius
MOST_STDDEV = 16  # radii; a wider Gaussian is flat
CENTER = f4(0.5)


def box(u: Floats) -> Floats:
    """Distribute uniformly: u (2, n) in [0, 1)² is the position from the pixel's corner, in pixels."""
    return u


@dataclass(frozen=True)
class _RadiusFilter:
    """A filter that ends at a radius, in pixels."""

    radius: float

    def __post_init__(self) -> None:
        """Check the radius."""
        name, limit = f"{type(self).__name__} radius", f"above 0 and at most {MOST_PIXELS} pixels"
        number(name, self.radius, lambda x: 0 < x <= MOST_PIXELS, limit)
        flag(f"{type(self).__name__} windowed", getattr(self, "windowed", False))


@dataclass(frozen=True)
class BoxFilter(_RadiusFilter):
    """A reconstruction filter that weighs the square around a pixel's center evenly.

    Parameters
    ----------
    radius
        Half the edge of the square, pixels; 0.5 is the pixel, as `filter="box"`.

    Raises
    ------
    SceneError
        If the radius is not above 0 and at most 64.

    Examples
    --------
    >>> image = wf.render([wf.Sphere((0, 0, 0), 1)], spp=1, size=(8, 8), filter=wf.BoxFilter(0.25))
    """

    radius: float = 0.5

    def __call__(self, u: Floats) -> Floats:
        """Return positions (2, n) from the pixel's corner, pixels, for u (2, n) in [0, 1)²."""
        return CENTER + (f4(2) * u - f4(1)) * f4(self.radius)


@dataclass(frozen=True)
class TentFilter(_RadiusFilter):
    """A reconstruction filter that falls linearly from a pixel's center, in both directions.

    Parameters
    ----------
    radius
        Pixels from the center to where it ends; `filter="tent"` has 1.

    Raises
    ------
    SceneError
        If the radius is not above 0 and at most 64.

    Examples
    --------
    >>> image = wf.render([wf.Sphere((0, 0, 0), 1)], spp=1, size=(8, 8), filter=wf.TentFilter(2))
    """

    radius: float = 1.0

    def __call__(self, u: Floats) -> Floats:
        """Return positions (2, n) from the pixel's corner, pixels, for u (2, n) in [0, 1)²."""
        return np.stack([CENTER + warp.tent(row, self.radius) for row in u])


@dataclass(frozen=True)
class GaussianFilter(_RadiusFilter):
    """A reconstruction filter that is a Gaussian around a pixel's center, in both directions.

    Parameters
    ----------
    radius
        Pixels from the center to where it ends. `filter="gaussian"` has 1.5, and the `stddev` 0.5.
    stddev
        Standard deviation, pixels.
    windowed
        True: less its value at the radius, so that it falls to 0 there, as in Mitsuba and pbrt. False: it is
        cut off.

    Raises
    ------
    SceneError
        If the radius is not above 0 and at most 64, or the standard deviation not above 0 and at most 16
        times the radius.

    Examples
    --------
    >>> of_mitsuba = wf.GaussianFilter(radius=2, windowed=True)
    >>> of_pbrt = wf.GaussianFilter(windowed=True)
    >>> image = wf.render([wf.Sphere((0, 0, 0), 1)], spp=1, size=(8, 8), filter=of_mitsuba)
    """

    radius: float = 1.5
    stddev: float = 0.5
    windowed: bool = False

    def __post_init__(self) -> None:
        """Check the radius and the standard deviation."""
        super().__post_init__()
        most = MOST_STDDEV * self.radius
        limit = f"above 0 and at most {most:g}, {MOST_STDDEV} times the radius"
        number("GaussianFilter stddev", self.stddev, lambda x: 0 < x <= most, limit)

    def __call__(self, u: Floats) -> Floats:
        """Return positions (2, n) from the pixel's corner, pixels, for u (2, n) in [0, 1)²."""
        follow = warp.windowed_gaussian if self.windowed else warp.gaussian
        return np.stack([CENTER + follow(row, self.stddev, self.radius) for row in u])


FILTERS: Registry[Filter] = Registry(
    "filter", "a function of u (2, n)", {"box": box, "tent": TentFilter(), "gaussian": GaussianFilter()}
)
