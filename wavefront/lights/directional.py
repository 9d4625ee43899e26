"""Light from one direction, infinitely far away: delta, or a small disk of the sky such as the sun."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ..arrays.elementary import sin_cos
from ..arrays.frame import Frame
from ..arrays.soa import soa
from ..arrays.state import SurfaceInteraction
from ..arrays.vec import TWO_PI, Bools, Doubles, Floats, column, dot, f4
from ..colors import rgb
from ..core.errors import SceneError, finite_array, number
from ..core.parameter import Parameter, Parametrized, parametrized
from ..film.aov_names import DEFAULT_GROUP, group_name
from ..sampling.warp import uniform_cone
from .base import DeltaLight, Emitters, FarLight, LightSample
from .infinite import InfiniteLight, at_infinity, facing_irradiance, through_scene, turned

MIN_ANGLE = 0.01  # degrees; float32 directions cannot tell a smaller disk's edge to a percent


@soa
class DirectionalLights(DeltaLight):
    """k lights whose rays are parallel."""

    towards: Floats  # (3, k) unit direction to the light
    facing: Floats  # (3, k) W·m⁻² on a surface that faces the light

    def sample_li(self, point: Floats, u: Floats) -> LightSample:
        """Return the direction; the radiance is the irradiance of a surface that faces it."""
        wi = np.broadcast_to(self.towards, point.shape)
        return at_infinity(wi, np.broadcast_to(self.facing, point.shape), np.ones(point.shape[1], f4))

    def power(self, scene_radius: float) -> Doubles:
        """E through the disk of the scene, πR²."""
        return through_scene(self.facing.mean(0, dtype=np.float64), scene_radius)

    def irradiance(self, center: Doubles, radius: float, scene_radius: float) -> Doubles:
        """E, everywhere; (c, k)."""
        return facing_irradiance(self, center)

    def emitters(self) -> Emitters:
        """Return the directions."""
        away = -self.towards.astype(np.float64)
        return Emitters(np.zeros_like(away), away, np.full(len(self), np.inf))


@soa
class SunLight(InfiniteLight):
    """A disk of constant radiance at infinity, sampled uniformly in solid angle."""

    axes: Floats  # (3, 3) columns of a frame whose third points to the middle of the disk
    height: Floats  # (1,) 1 − cos of the angular radius
    radiance: Floats  # (3, 1) W·sr⁻¹·m⁻²

    def sample_li(self, point: Floats, u: Floats) -> LightSample:
        """Draw a direction uniformly in the cone."""
        wi = turned(self.axes, uniform_cone(u, self.height))
        pdf = np.broadcast_to(f4(1) / (TWO_PI * self.height), wi.shape[1:])
        return at_infinity(wi, np.broadcast_to(self.radiance, wi.shape), pdf)

    def pdf_li(self, point: Floats, wi: Floats) -> Floats:
        """Return 1/(solid angle of the disk) within it."""
        return np.where(self._meets(wi), f4(1) / (TWO_PI * self.height), f4(0))

    def le(self, wi: Floats, surface: SurfaceInteraction | None = None) -> Floats:
        """Return the radiance within the disk, (3, n)."""
        return self.radiance * self._meets(wi)

    def power(self, scene_radius: float) -> Doubles:
        """π·sin²·L through the disk of the scene, πR²."""
        height = self.height.astype(np.float64)
        irradiance = np.pi * height * (2 - height) * self.radiance.mean(0, dtype=np.float64)
        return through_scene(irradiance, scene_radius)

    def irradiance(self, center: Doubles, radius: float, scene_radius: float) -> Doubles:
        """E, everywhere; (c, k)."""
        return facing_irradiance(self, center)

    def _meets(self, wi: Floats) -> Bools:
        away = wi - column(self.axes[:, 2])
        return f4(0.5) * dot(away, away) <= self.height  # 1 − cosθ without cancellation


def unit(name: str, value: ArrayLike) -> Doubles:
    """Return a (3,) direction scaled to unit length.

    Raises
    ------
    SceneError
        If it is malformed or zero.
    """
    vector = finite_array(name, value, (3,))
    largest = np.abs(vector).max()
    if not largest > 0:
        raise SceneError(f"{name} is {vector.tolist()}; it must not be zero")
    vector = vector / largest
    return np.asarray(vector / np.linalg.norm(vector))


def _angle(name: str, value: float) -> float:
    allowed = f"0, or from {MIN_ANGLE} to 180 degrees"
    return number(name, value, lambda x: x == 0 or MIN_ANGLE <= x <= 180, allowed)


@parametrized
class DirectionalLight(Parametrized, FarLight):
    """A directional light, infinitely far away, such as the sun.

    Parameters
    ----------
    direction
        (3,) the direction in which the light travels, of any length.
    irradiance
        W·m⁻² on a surface that faces the light, one number or three. A surface at the angle θ gets
        irradiance·cosθ.
    angle
        Angular diameter in degrees; that of the sun is 0.53. With 0 the rays are parallel, shadows are sharp,
        and the light itself is never seen, not even in a mirror. Otherwise the light is a disk in the sky of
        radiance irradiance/(π·sin²(angle/2)), which is seen where rays leave the scene.
    group
        Name of the light group, for `aovs="light_groups"`.

    Raises
    ------
    SceneError
        If an argument is malformed, the direction is zero, or the angle is neither 0 nor from
        0.01 to 180.

    Examples
    --------
    >>> sun = wf.DirectionalLight((-1, -2, -1), irradiance=3, angle=0.53)
    """

    _directions = ("direction",)
    direction: Parameter[ArrayLike] = Parameter(unit)
    irradiance: Parameter[ArrayLike] = Parameter(rgb)
    angle: Parameter[float] = Parameter(_angle, default=0.0, kw_only=True)
    group: Parameter[str] = Parameter(group_name, default=DEFAULT_GROUP, kw_only=True)

    def record(self, center: Doubles) -> DirectionalLights | SunLight:
        """Return the light as a record of one column."""
        towards = (-self.direction).astype(f4).reshape(3, 1)
        if self.angle == 0:
            return DirectionalLights(towards, self.irradiance)
        radius = np.radians(self.angle) / 2
        frame = Frame.from_normal(towards)
        axes = np.concatenate([frame.x, frame.y, frame.z], axis=1)
        height = np.array([2 * sin_cos(np.float64(radius / 2))[0] ** 2], f4)
        return SunLight(
            axes, height, (self.irradiance / (np.pi * sin_cos(np.float64(radius))[0] ** 2)).astype(f4)
        )
