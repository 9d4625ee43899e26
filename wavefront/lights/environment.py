"""Light that arrives from all around."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import rgb
from ..sampling.warp import uniform_sphere
from ..vec import Floats, f4
from .base import Light, LightSample

UNIFORM_SPHERE_PDF = f4(1 / (4 * np.pi))


@dataclass(slots=True)
class ConstantEnvironment(Light):
    """The same radiance from every direction."""

    radiance: Floats  # (3, 1) W·sr⁻¹·m⁻²

    def sample_li(self, point: Floats, u: Floats) -> LightSample:
        """Draw a direction uniformly on the sphere."""
        wi = uniform_sphere(u)
        n = wi.shape[1]
        radiance = np.broadcast_to(self.radiance, wi.shape)
        pdf, distance = np.full(n, UNIFORM_SPHERE_PDF, f4), np.full(n, np.inf, f4)
        return LightSample(wi, radiance, pdf, distance, np.ones(n, f4))

    def pdf_li(self, point: Floats, wi: Floats) -> Floats:
        """Return 1/4π."""
        return np.full(wi.shape[1], UNIFORM_SPHERE_PDF, f4)

    def le(self, wi: Floats) -> Floats:
        """Return the radiance, (3, n)."""
        return np.broadcast_to(self.radiance, wi.shape)

    def power(self, scene_radius: float) -> NDArray[np.float64]:
        """4π·L through the disk of the scene, πR²."""
        return 4 * np.pi**2 * scene_radius**2 * self.radiance.mean(0, dtype=np.float64)


class Environment:
    """Light that arrives from infinitely far away, wherever a ray leaves the scene.

    Parameters
    ----------
    radiance
        W·sr⁻¹·m⁻², one number or three.

    Raises
    ------
    SceneError
        If the radiance is malformed.
    """

    def __init__(self, radiance: ArrayLike = 1.0) -> None:
        self.radiance = rgb("Environment radiance", radiance)

    def record(self, centre: NDArray[np.float64]) -> ConstantEnvironment:
        """Return the light as a record of one column."""
        return ConstantEnvironment(self.radiance)
