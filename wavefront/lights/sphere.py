"""Emitting spheres, sampled by the cone that they fill."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import field, replace
from typing import ClassVar, Self

import numpy as np

from ..arrays.elementary import sin_cos_turns
from ..arrays.frame import Frame
from ..arrays.soa import soa
from ..arrays.state import SurfaceInteraction
from ..arrays.vec import (
    INV_FOUR_PI,
    INV_PI,
    TWO_PI,
    Bools,
    Doubles,
    Floats,
    Ints,
    dot,
    f4,
    positive,
    put,
    take,
)
from ..sampling.warp import uniform_cone, uniform_sphere
from .base import Emitters, LightRecord, LightSample, Receiver

UNEVEN = f4(0.05)  # (sine of a sphere · tan θ)²: how much cos θ varies over spheres that are worth it
RISEN = f4(1.0001)  # squared cosine, in squared sines of a sphere, of the lowest that is all above a horizon


@soa
class SphereLights(LightRecord):
    """k spheres that emit on both sides."""

    center: Floats  # (3, k) scene units
    radius: Floats  # (k,) scene units
    radiance: Floats  # (3, k) W·sr⁻¹·m⁻²
    # the n surfaces for which they are sampled; None where unknown
    receiver: Receiver | None = field(default=None, kw_only=True)

    takes_receiver: ClassVar[bool] = True

    def sample_li(self, point: Floats, u: Floats) -> LightSample:
        """Draw a direction uniformly in the cone of the sphere, or of all directions from inside.

        Where all of a sphere is above a surface, its projection on the plane is sampled uniformly: a point of
        the disk that the cone cuts from the unit sphere is moved along the normal, back to that sphere.

        Source: Shirley, Wang and Zimmerman 1996, "Monte Carlo Techniques for Direct Lighting", §3.2;
        C. Ureña and I. Georgiev 2018, "Stratified Sampling of Projected Spherical Caps", §3.
        """
        axis, distance = self._towards(point)
        height, outside = self._cone(distance)
        in_cone = Frame.from_normal(axis).to_world(uniform_cone(u, np.where(outside, height, f4(1))))
        wi = np.where(outside, in_cone, uniform_sphere(u)).astype(f4)
        pdf = np.where(outside, f4(1) / (TWO_PI * height), INV_FOUR_PI)
        for lanes, normal, cos in self._risen(axis, height, outside):
            depth = height.take(lanes)
            sin2 = depth * (f4(2) - depth)
            turn, r2 = u.take(lanes, 1)
            sin, cosine = sin_cos_turns(turn)
            r = np.sqrt(r2 * sin2)
            on_disk = Frame.from_normal(take(axis, lanes)).to_world(
                np.stack([r * cosine, r * sin, f4(1) - depth])
            )
            within = sin2 * (f4(1) - r2)  # 1 − |on_disk|²
            low = dot(normal, on_disk)
            high = np.sqrt(low * low + within)
            put(wi, lanes, on_disk + normal * (within / (low + high)))
            pdf[lanes] = high * INV_PI / (sin2 * cos)
        along = distance * dot(axis, wi)
        beside = axis * distance - wi * along  # from the ray to the center; d² − along² would cancel
        half_chord = np.sqrt(np.maximum(self.radius**2 - dot(beside, beside), f4(0)))
        reach = np.where(outside, along - half_chord, along + half_chord)
        radiance = np.broadcast_to(self.radiance, wi.shape)
        return LightSample(wi, radiance, pdf, reach, half_chord / self.radius)

    def pdf_li(self, point: Floats, wi: Floats) -> Floats:
        """Return the density of `sample_li` inside the cone of the sphere."""
        axis, distance = self._towards(point)
        height, outside = self._cone(distance)
        away = wi - axis
        meets = f4(0.5) * dot(away, away) <= height * f4(1 + 2**-20)  # 1 − cosθ without cancellation
        pdf = np.where(outside, f4(1) / (TWO_PI * height), INV_FOUR_PI)
        for lanes, normal, cos in self._risen(axis, height, outside):
            depth = height.take(lanes)
            pdf[lanes] = positive(dot(normal, take(wi, lanes))) * INV_PI / (depth * (f4(2) - depth) * cos)
        return np.where(meets | ~outside, pdf, f4(0))

    def lighting(self, receiver: Receiver) -> Self:
        """Return the lights as they are sampled for surfaces."""
        return replace(self, receiver=receiver)

    def _risen(self, axis: Floats, height: Floats, outside: Bools) -> Iterator[tuple[Ints, Floats, Floats]]:
        """Yield lanes of surfaces low below spheres, which are all above them; normals, cosines to axes."""
        if self.receiver is None:
            return
        cos, sin2 = dot(self.receiver.normal, axis), height * (f4(2) - height)
        cos2 = cos * cos
        uneven = sin2 - sin2 * cos2 > UNEVEN * cos2
        risen = (cos > 0) & (cos2 > RISEN * sin2) & uneven & outside & self.receiver.opaque
        lanes = np.flatnonzero(risen)
        if lanes.size:
            yield lanes, np.broadcast_to(self.receiver.normal, axis.shape).take(lanes, 1), cos.take(lanes)

    def le(self, wi: Floats, surface: SurfaceInteraction | None = None) -> Floats:
        """Return the radiance, (3, n)."""
        return np.broadcast_to(self.radiance, wi.shape)

    def power(self, scene_radius: float) -> Doubles:
        """4πr²·π·L of the outside."""
        return 4 * np.pi**2 * self.radius.astype(np.float64) ** 2 * self.radiance.mean(0, dtype=np.float64)

    def irradiance(self, center: Doubles, radius: float, scene_radius: float) -> Doubles:
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
