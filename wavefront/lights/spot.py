"""Spot lights: points that emit into a cone."""

from __future__ import annotations

from functools import partial
from typing import Any, ClassVar, Literal

import numpy as np
from numpy.typing import ArrayLike

from ..arrays.elementary import arccos, arcsin, sin_cos, sin_cos_turns
from ..arrays.soa import soa
from ..arrays.vec import Doubles, Floats, dot, f4, highest
from ..core.errors import SceneError, called, finite_array, number, one_of
from ..core.parameter import Parameter, optional, parametrized
from ..film.aov_names import DEFAULT_GROUP, group_name
from ..textures.image import Texture
from ..textures.parameter import check_limits
from .base import DeltaLight, Emitters, LightSample, position
from .directional import unit
from .point import LightAtPoint, intensity_of, toward


@soa
class SpotLights(DeltaLight):
    """k points that each emit into a cone."""

    position: Floats  # (3, k) scene units
    axis: Floats  # (3, k) unit direction of the emission
    outer: Floats  # (k,) 1 − cos of the angle at which the light ends
    slope: Floats  # (k,) 1/(cos of the inner angle − cos of the outer one)
    intensity: Floats  # (3, k) W/sr on the axis
    # (k,) 1/(radians between both angles) where the falloff is linear in the angle, else 0
    linear: Floats
    step: Floats  # (k,) 1 where the falloff is a smooth step in the cosine, else 0

    def sample_li(self, point: Floats, u: Floats) -> LightSample:
        """Return the direction to the light; radiance is I·falloff/d²."""
        wi, distance, d2, apart = toward(self.position, point)
        strength = self._falloff(wi)
        pdf = np.where(apart & (strength > 0), f4(1), f4(0))
        return LightSample(wi, self.intensity * (strength / d2), pdf, distance, np.ones_like(distance))

    def power(self, scene_radius: float) -> Doubles:
        """2πI·(h_inner + (h_outer − h_inner)/3), the integral of the falloff; h = 1 − cos.

        Of a smooth step with 1/2 for 1/3, of a linear one 2πI·(1 − (sin outer − sin inner)/(outer − inner)).
        """
        outer = self.outer.astype(np.float64)
        solid_angle = 2 * np.pi * (outer - (2 / 3 - self.step / 6) / self.slope)
        linear = self.linear.astype(np.float64)
        end = arccos(1 - outer)
        begin = end - 1 / np.where(linear > 0, linear, np.inf)
        rise = (sin_cos_turns(end / (2 * np.pi))[0] - sin_cos_turns(begin / (2 * np.pi))[0]) * linear
        solid_angle = np.where(linear > 0, 2 * np.pi * (1 - rise), solid_angle)
        return solid_angle * self.intensity.mean(0, dtype=np.float64)

    def irradiance(self, center: Doubles, radius: float, scene_radius: float) -> Doubles:
        """I·falloff/d² at most, with the falloff at the part of the ball nearest to the axis; (c, k)."""
        away = center[:, :, None] - self.position[:, None, :]
        distance = np.sqrt((away**2).sum(0))
        far = np.maximum(distance, 1e-30)
        angle = arccos(np.clip((away * self.axis[:, None, :]).sum(0) / far, -1, 1))
        nearest = angle - arcsin(np.minimum(radius / far, 1))
        nearest = np.where(distance > radius, np.maximum(nearest, 0), 0)
        ramp = np.clip((self.outer - (1 - sin_cos_turns(nearest / (2 * np.pi))[1])) * self.slope, 0, 1)
        linear = np.clip((arccos(1 - self.outer.astype(np.float64)) - nearest) * self.linear, 0, 1)
        falloff = np.where(self.linear > 0, linear, _eased(ramp, self.step))
        return self.intensity.mean(0, dtype=np.float64) * falloff / np.maximum(distance, radius) ** 2

    def emitters(self) -> Emitters:
        """Return the positions; the lights shine along their axes."""
        middle = self.position.astype(np.float64)
        return Emitters(middle, self.axis.astype(np.float64), np.zeros(len(self)))

    def _falloff(self, wi: Floats) -> Floats:
        """Part (n,) of the intensity that leaves against wi (3, n).

        Source: glTF 2.0, KHR_lights_punctual, "Inner and Outer Cone Angles": the square of a ramp
        in the cosine. Here 1 − cos takes the cosine's place, so that narrow cones keep their digits. Or a
        ramp in the angle, as in Mitsuba 3, or 3t² − 2t³ of a ramp t in the cosine, as in pbrt-v4.
        """
        off = wi + self.axis
        away = f4(0.5) * dot(off, off)
        ramp = np.clip((self.outer - away) * self.slope, f4(0), f4(1))
        if not self.linear.any():
            return _eased(ramp, self.step)
        end, angle = (
            f4(2) * arcsin(np.sqrt(np.minimum(versine * f4(0.5), f4(1)))) for versine in (self.outer, away)
        )
        linear = np.clip((end - angle) * self.linear, f4(0), f4(1))
        return np.where(self.linear > 0, linear, _eased(ramp, self.step))


def _eased(ramp: Any, step: Floats) -> Any:
    """Return the square of a ramp, or a smooth step where `step` is 1."""
    return ramp * ramp * (f4(1) + step * (f4(2) - f4(2) * ramp))


@soa
class PicturedLights(SpotLights):
    """k spots that show a picture in a square or rectangle around the axis."""

    right: Floats  # (3, k) across the axis, over the tangent of the angle to the right edge
    up: Floats  # (3, k) the same for the upper edge
    picture: Texture  # colors, times the intensity
    screen: bool  # the picture alone is the light: even on a screen that faces it

    def sample_li(self, point: Floats, u: Floats) -> LightSample:
        """Return the direction to the light; radiance is that of a spot times the picture."""
        sample = SpotLights.sample_li(self, point, u)
        ahead = -dot(self.axis, sample.wi)
        safe = np.where(ahead > 0, ahead, f4(1))
        x, y = (-dot(side, sample.wi) / safe for side in (self.right, self.up))
        seen = self.picture.lookup(np.stack([x, y]) * f4(0.5) + f4(0.5))
        if self.screen:
            seen = seen / (safe * safe * safe)
        lit = (ahead > 0) & (np.abs(x) <= f4(1)) & (np.abs(y) <= f4(1)) & (highest(seen) > 0)
        sample.radiance = sample.radiance * seen
        sample.pdf = np.where(lit, sample.pdf, f4(0))
        return sample

    def power(self, scene_radius: float) -> Doubles:
        """Return the mean of the picture times the power of a spot, or I times the area of a screen."""
        mean = float(self.picture.mean().mean())
        if not self.screen:
            return SpotLights.power(self, scene_radius) * mean
        area = 4 / np.sqrt((self.right**2).sum(0) * (self.up**2).sum(0))
        return self.intensity.mean(0, dtype=np.float64) * area * mean

    def irradiance(self, center: Doubles, radius: float, scene_radius: float) -> Doubles:
        """Return that of the spot with the brightest color of the picture, to the corner of a screen."""
        most = max(self.picture.limits())
        if self.screen:
            corner = 1 + 1 / (self.right**2).sum(0) + 1 / (self.up**2).sum(0)
            most = most * corner**1.5
        return SpotLights.irradiance(self, center, radius, scene_radius) * most


def picture_of(name: str, value: Any) -> Texture | None:
    """Return a picture as a texture of colors; None where there is none."""
    if value is None:
        return None
    with called(name, "Texture source"):
        picture = value if isinstance(value, Texture) else Texture(value)
    if picture.scalar:
        raise SceneError(f"{name} must be a Texture of colors, got {value!r}")
    check_limits(name, picture, lambda x: x >= 0, "at least 0")
    return picture


def aim(name: str, position: Any, target: ArrayLike | None, direction: ArrayLike | None) -> ArrayLike:
    """Return a direction, given as such or by a target.

    Raises
    ------
    SceneError
        If not exactly one is given, or the target is the position.
    """
    if direction is not None and target is None:
        return direction
    if target is None or direction is not None:
        raise SceneError(f"{name} needs a target or a direction, and not both")
    toward = finite_array(f"{name} target", target, (3,)) - position
    if not toward.any():
        raise SceneError(f"{name} position and target are both {position.tolist()}")
    return toward


class AimedLight(LightAtPoint):
    """Base of lights at one position that shine along a direction, which its subclasses declare."""

    _directions: ClassVar[tuple[str, ...]] = ("direction",)
    target: Any
    direction: Any

    def derive(self) -> None:
        """Let a target give the direction, which then stays as it is."""
        if self.target is not None or self.direction is None:
            name = type(self).__name__
            toward = aim(name, self.position, self.target, self.direction)
            vars(self).update(direction=unit(f"{name} direction", toward), target=None)


def sides_of(axis: Doubles, up: Doubles) -> tuple[Floats, Floats]:
    """Return unit vectors (3, 1) to the right and up, seen along an axis (3,); any where up is parallel."""
    right = np.cross(axis, up)
    if np.linalg.norm(right) < 1e-9:
        right = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    right /= np.linalg.norm(right)
    return right.astype(f4).reshape(3, 1), np.cross(right, axis).astype(f4).reshape(3, 1)


def _angle(name: str, value: float) -> float:
    return number(name, value, lambda x: 0 < x <= 180, "above 0 and at most 180 degrees")


target_of = optional(position)
_falloff = partial(one_of, choices=("smooth", "linear", "smoothstep"))


def _blend(name: str, value: float) -> float:
    return number(name, value, lambda x: 0 <= x <= 1, "in [0, 1]")


@parametrized
class SpotLight(AimedLight):
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
    falloff
        "smooth" is that of glTF, "linear" is linear in the angle, as in Mitsuba, and "smoothstep" is that of
        pbrt.
    picture, up
        A `Texture`, or a file or an array: its colors multiply the intensity, in a square around the cone.
        `up` is the direction (3,) of its upper edge.
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
    _directions = "direction", "up"

    position: Parameter[ArrayLike] = Parameter(position)
    intensity: Parameter[ArrayLike] = Parameter(intensity_of)
    target: Parameter[ArrayLike | None] = Parameter(target_of, default=None, kw_only=True)
    direction: Parameter[ArrayLike | None] = Parameter(optional(unit), default=None, kw_only=True)
    angle: Parameter[float] = Parameter(_angle, default=45.0, kw_only=True)
    blend: Parameter[float] = Parameter(_blend, default=0.15, kw_only=True)
    falloff: Parameter[Literal["smooth", "linear", "smoothstep"]] = Parameter(
        _falloff, default="smooth", kw_only=True
    )
    picture: Parameter[Any] = Parameter(picture_of, default=None, kw_only=True)
    up: Parameter[ArrayLike] = Parameter(unit, default=(0, 1, 0), kw_only=True)
    group: Parameter[str] = Parameter(group_name, default=DEFAULT_GROUP, kw_only=True)

    @property
    def _handed(self) -> bool:
        return self.picture is not None

    def record(self, center: Doubles) -> SpotLights:
        """Return the light as a record of one column, relative to `center` (3,)."""
        half = np.radians(self.angle) / 2
        outer = 2 * sin_cos(np.float64(half / 2))[0] ** 2
        inner = 2 * sin_cos(np.float64(half * (1 - self.blend) / 2))[0] ** 2
        width = max(outer - inner, 1e-6 * outer)  # a hard edge is a very steep ramp
        radians = max(half * self.blend, 1e-6 * half)
        spot = (
            (self.position - center).astype(f4).reshape(3, 1),
            self.direction.astype(f4).reshape(3, 1),
            np.array([outer], f4),
            np.array([1 / width], f4),
            self.intensity.astype(f4),
            np.array([1 / radians if self.falloff == "linear" else 0], f4),
            np.array([self.falloff == "smoothstep"], f4),
        )
        if self.picture is None:
            return SpotLights(*spot)
        wide = sin_cos(np.float64(min(half, 0.499 * np.pi)))  # half of the sky has no square around it
        right, up = (side * f4(wide[1] / wide[0]) for side in sides_of(self.direction, self.up))
        return PicturedLights(*spot, right, up, self.picture, screen=False)
