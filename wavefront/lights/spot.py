"""Spot lights: points that emit into a cone."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arrays.elementary import arccos, arcsin, sin_cos, sin_cos_turns
from ..arrays.soa import soa
from ..arrays.vec import Floats, dot, f4
from ..core.errors import SceneError, finite_array, number
from ..core.parameter import Parameter
from ..core.suggestions import suggests_keywords
from ..film.aov_names import DEFAULT_GROUP
from .base import DeltaLight, Emitters, LightSample
from .directional import unit
from .point import LightAtPoint


@soa
class SpotLights(DeltaLight):
    """k points that each emit into a cone."""

    position: Floats  # (3, k) scene units
    axis: Floats  # (3, k) unit direction of the emission
    outer: Floats  # (k,) 1 − cos of the angle at which the light ends
    slope: Floats  # (k,) 1/(cos of the angle at which it begins to fall − cos of where it ends)
    intensity: Floats  # (3, k) W/sr on the axis

    def sample_li(self, point: Floats, u: Floats) -> LightSample:
        """Return the direction to the light; radiance is I·falloff/d²."""
        away = self.position - point
        d2 = dot(away, away)
        apart = d2 > 0
        safe = np.where(apart, d2, f4(1))
        distance = np.sqrt(safe)
        wi = away / distance
        strength = self._falloff(wi)
        pdf = np.where(apart & (strength > 0), f4(1), f4(0))
        return LightSample(wi, self.intensity * (strength / safe), pdf, distance, np.ones_like(distance))

    def power(self, scene_radius: float) -> NDArray[np.float64]:
        """2πI·(h_inner + (h_outer − h_inner)/3), the integral of the falloff; h = 1 − cos."""
        outer = self.outer.astype(np.float64)
        solid_angle = 2 * np.pi * (outer - 2 / 3 / self.slope)
        return solid_angle * self.intensity.mean(0, dtype=np.float64)

    def irradiance(
        self, center: NDArray[np.float64], radius: float, scene_radius: float
    ) -> NDArray[np.float64]:
        """I·falloff/d² at most, with the falloff at the part of the ball nearest to the axis; (c, k)."""
        away = center[:, :, None] - self.position[:, None, :]
        distance = np.sqrt((away**2).sum(0))
        far = np.maximum(distance, 1e-30)
        angle = arccos(np.clip((away * self.axis[:, None, :]).sum(0) / far, -1, 1))
        nearest = angle - arcsin(np.minimum(radius / far, 1))
        nearest = np.where(distance > radius, np.maximum(nearest, 0), 0)
        ramp = np.clip((self.outer - (1 - sin_cos_turns(nearest / (2 * np.pi))[1])) * self.slope, 0, 1)
        return self.intensity.mean(0, dtype=np.float64) * ramp**2 / np.maximum(distance, radius) ** 2

    def emitters(self) -> Emitters:
        """Return the positions; the lights shine along their axes."""
        middle = self.position.astype(np.float64)
        return Emitters(middle, self.axis.astype(np.float64), np.zeros(len(self)))

    def _falloff(self, wi: Floats) -> Floats:
        """Part (n,) of the intensity that leaves against wi (3, n).

        Source: glTF 2.0, KHR_lights_punctual, "Inner and Outer Cone Angles": the square of a ramp
        in the cosine. Here 1 − cos takes the cosine's place, so that narrow cones keep their digits.
        """
        off = wi + self.axis
        ramp = np.clip((self.outer - f4(0.5) * dot(off, off)) * self.slope, f4(0), f4(1))
        return ramp * ramp


def _angle(name: str, value: float) -> float:
    return number(name, value, lambda x: 0 < x <= 180, "above 0 and at most 180 degrees")


def _blend(name: str, value: float) -> float:
    return number(name, value, lambda x: 0 <= x <= 1, "in [0, 1]")


class SpotLight(LightAtPoint):
    """A spot light: a point that emits into a cone.

    Parameters
    ----------
    position
        (3,) scene units.
    intensity
        W/sr on the axis, one number or three; at distance d it gives irradiance I·cosθ/d².
    target, direction
        (3,) a point on the axis, or the direction of the axis: give one of them.
    angle
        Full angle of the cone, degrees; beyond it there is no light.
    blend
        Part of the cone's angle, from the edge inwards, in which the light falls off: 0 is a hard
        edge, with 1 it falls off from the axis on.
    group
        Name of the light group, for `aovs="light_groups"`.

    Notes
    -----
    `angle` and `blend` are Blender's "Spot Size" and "Blend". The cone of glTF has
    angle = 2·outerConeAngle (in degrees) and blend = 1 − innerConeAngle/outerConeAngle.

    Raises
    ------
    SceneError
        If an argument is malformed or out of range.

    Examples
    --------
    >>> spot = wf.SpotLight((0, 4, 2), 100, target=(0, 0, 0), angle=30)
    """

    hint = "direct the SpotLight, or widen its cone"
    direction = Parameter(unit)
    angle = Parameter(_angle)
    blend = Parameter(_blend)

    @suggests_keywords
    def __init__(
        self,
        position: ArrayLike,
        intensity: ArrayLike,
        *,
        target: ArrayLike | None = None,
        direction: ArrayLike | None = None,
        angle: float = 45.0,
        blend: float = 0.15,
        group: str = DEFAULT_GROUP,
    ) -> None:
        self.position = position
        self.intensity = intensity
        if (target is None) == (direction is None):
            raise SceneError("SpotLight needs a target or a direction, and not both")
        if target is not None:
            aim = finite_array("SpotLight target", target, (3,)) - self.position
            if not aim.any():
                raise SceneError(f"SpotLight position and target are both {self.position.tolist()}")
            self.direction = aim
        else:
            self.direction = direction
        self.angle = angle
        self.blend = blend
        self.group = group

    def record(self, center: NDArray[np.float64]) -> SpotLights:
        """Return the light as a record of one column, relative to `center` (3,)."""
        half = np.radians(self.angle) / 2
        outer = 2 * sin_cos(np.float64(half / 2))[0] ** 2
        inner = 2 * sin_cos(np.float64(half * (1 - self.blend) / 2))[0] ** 2
        width = max(outer - inner, 1e-6 * outer)  # a hard edge is a very steep ramp
        return SpotLights(
            (self.position - center).astype(f4).reshape(3, 1),
            self.direction.astype(f4).reshape(3, 1),
            np.array([outer], f4),
            np.array([1 / width], f4),
            self.intensity.astype(f4),
        )
