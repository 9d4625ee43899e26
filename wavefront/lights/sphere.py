"""Emitting spheres, sampled by the cone that they fill."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..arrays.frame import Frame
from ..arrays.soa import soa
from ..arrays.state import SurfaceInteraction
from ..arrays.vec import INV_FOUR_PI, TWO_PI, Bools, Floats, dot, f4
from ..sampling.warp import uniform_cone, uniform_sphere
from .base import Emitters, LightRecord, LightSample


@soa
class SphereLights(LightRecord):
    """k spheres that emit on both sides."""

    center: Floats  # (3, k) scene units
    radius: Floats  # (k,) scene units
    radiance: Floats  # (3, k) W·sr⁻¹·m⁻²

    def sample_li(self, point: Floats, u: Floats) -> LightSample:
        """Draw a direction uniformly in the cone of the sphere, or of all directions from inside.

        Source: Shirley, Wang and Zimmerman 1996, "Monte Carlo Techniques for Direct Lighting", §3.2.
        """
        axis, distance = self._towards(point)
        height, outside = self._cone(distance)
        in_cone = Frame.from_normal(axis).to_world(uniform_cone(u, np.where(outside, height, f4(1))))
        wi = np.where(outside, in_cone, uniform_sphere(u)).astype(f4)
        along = distance * dot(axis, wi)
        beside = axis * distance - wi * along  # from the ray to the center; d² − along² would cancel
        half_chord = np.sqrt(np.maximum(self.radius**2 - dot(beside, beside), f4(0)))
        reach = np.where(outside, along - half_chord, along + half_chord)
        pdf = np.where(outside, f4(1) / (TWO_PI * height), INV_FOUR_PI)
        radiance = np.broadcast_to(self.radiance, wi.shape)
        return LightSample(wi, radiance, pdf, reach, half_chord / self.radius)

    def pdf_li(self, point: Floats, wi: Floats) -> Floats:
        """Return 1/(solid angle of the sphere) inside its cone."""
        axis, distance = self._towards(point)
        height, outside = self._cone(distance)
        away = wi - axis
        meets = f4(0.5) * dot(away, away) <= height * f4(1 + 2**-20)  # 1 − cosθ without cancellation
        cone = np.where(meets, f4(1) / (TWO_PI * height), f4(0))
        return np.where(outside, cone, INV_FOUR_PI)

    def le(self, wi: Floats, surface: SurfaceInteraction | None = None) -> Floats:
        """Return the radiance, (3, n)."""
        return np.broadcast_to(self.radiance, wi.shape)

    def power(self, scene_radius: float) -> NDArray[np.float64]:
        """4πr²·π·L of the outside."""
        return 4 * np.pi**2 * self.radius.astype(np.float64) ** 2 * self.radiance.mean(0, dtype=np.float64)

    def irradiance(
        self, center: NDArray[np.float64], radius: float, scene_radius: float
    ) -> NDArray[np.float64]:
        """π·L·(r/d)², with d at least r and the radius of the ball; (c, k)."""
        away = self.center[:, None, :] - center[:, :, None]
        size = self.radius.astype(np.float64)
        strength = np.pi * size**2 * self.radiance.mean(0, dtype=np.float64)
        return strength / np.maximum((away**2).sum(0), np.maximum(size, radius) ** 2)

    def emitters(self) -> Emitters:
        """Return the centers; spheres shine everywhere."""
        middle = self.center.astype(np.float64)
        return Emitters(middle, np.zeros_like(middle), self.radius.astype(np.float64) ** 2)

    def _towards(self, point: Floats) -> tuple[Floats, Floats]:
        """Return the unit axis (3, n) and the distance (n,) to the center."""
        axis = self.center - point
        distance = np.sqrt(dot(axis, axis))
        axis = axis / np.where(distance > 0, distance, f4(1))
        axis[2] += np.where(distance > 0, f4(0), f4(1))  # any axis will do at the center
        return axis, distance

    def _cone(self, distance: Floats) -> tuple[Floats, Bools]:
        """Return 1 − cosθmax (n,), kept above 0, and whether the point is outside the sphere."""
        outside = distance > self.radius
        sin2 = (self.radius / np.where(outside, distance, self.radius)) ** 2
        cos = np.sqrt(np.maximum(f4(1) - sin2, f4(0)))
        return np.maximum(sin2 / (f4(1) + cos), f4(1e-30)), outside
