"""Point lights."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import finite_array, rgb
from ..record import record
from ..vec import Floats, dot, f4
from .base import Light, LightSample


@record
class PointLights(Light):
    """k points that shine equally in all directions."""

    delta: ClassVar[bool] = True
    position: Floats  # (3, k) scene units
    intensity: Floats  # (3, k) W/sr

    def sample_li(self, point: Floats, u: Floats) -> LightSample:
        """Return the direction to the light; radiance is I/d²."""
        away = self.position - point
        d2 = dot(away, away)
        lit = d2 > 0
        safe = np.where(lit, d2, f4(1))
        distance = np.sqrt(safe)
        pdf = np.where(lit, f4(1), f4(0))
        return LightSample(away / distance, self.intensity / safe, pdf, distance, np.ones_like(distance))

    def pdf_li(self, point: Floats, wi: Floats) -> Floats:
        """Return 0: no sampled direction can meet a point."""
        return np.zeros(wi.shape[1], f4)

    def le(self, wi: Floats) -> Floats:
        """Return 0: a point is never seen."""
        return np.zeros_like(wi)

    def power(self, scene_radius: float) -> NDArray[np.float64]:
        """4πI."""
        return 4 * np.pi * self.intensity.mean(0, dtype=np.float64)

    def irradiance(
        self, centre: NDArray[np.float64], radius: float, scene_radius: float
    ) -> NDArray[np.float64]:
        """I/d², with d at least the radius of the ball; (c, k)."""
        away = self.position[:, None, :] - centre[:, :, None]
        return self.intensity.mean(0, dtype=np.float64) / np.maximum((away**2).sum(0), radius**2)


class PointLight:
    """A point that shines equally in all directions.

    Parameters
    ----------
    position
        (3,) scene units.
    intensity
        W/sr, one number or three; at distance d it gives irradiance I·cosθ/d².

    Raises
    ------
    SceneError
        If an argument is malformed.
    """

    def __init__(self, position: ArrayLike, intensity: ArrayLike) -> None:
        self.position = finite_array("PointLight position", position, (3,))
        self.intensity = rgb("PointLight intensity", intensity)

    def record(self, centre: NDArray[np.float64]) -> PointLights:
        """Return the light as a record of one column, relative to `centre` (3,)."""
        return PointLights((self.position - centre).astype(f4).reshape(3, 1), self.intensity)
