"""Point lights."""

from __future__ import annotations

from copy import copy
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from ..arrays.soa import soa
from ..arrays.vec import FLOAT32_MAX, Bools, Doubles, Floats, dot, f4
from ..colors import rgb
from ..core.errors import SceneError, as_array, exact, finite_array
from ..core.parameter import Parameter, Parametrized, parametrized
from ..film.aov_names import DEFAULT_GROUP, group_name
from .base import DeltaLight, Emitters, Light, LightSample, position


@soa
class PointLightRecord(DeltaLight):
    """k points that emit equally in all directions."""

    position: Floats  # (3, k) scene units
    intensity: Floats  # (3, k) W/sr

    def sample_li(self, point: Floats, u: Floats) -> LightSample:
        """Return the direction to the light; radiance is I/d²."""
        wi, distance, d2, apart = toward(self.position, point)
        pdf = np.where(apart, f4(1), f4(0))
        return LightSample(wi, self.intensity / d2, pdf, distance, np.ones_like(distance))

    def power(self, scene_radius: float) -> Doubles:
        """4πI."""
        return 4 * np.pi * self.intensity.mean(0, dtype=np.float64)

    def irradiance(self, center: Doubles, radius: float, scene_radius: float) -> Doubles:
        """I/d², with d at least the radius of the ball; (c, k)."""
        away = self.position[:, None, :] - center[:, :, None]
        return self.intensity.mean(0, dtype=np.float64) / np.maximum((away**2).sum(0), radius**2)

    def emitters(self) -> Emitters:
        """Return the positions; the lights shine everywhere."""
        middle = self.position.astype(np.float64)
        return Emitters(middle, np.zeros_like(middle), np.zeros(len(self)))


def toward(position: Floats, point: Floats) -> tuple[Floats, Floats, Floats, Bools]:
    """Return the directions (3, n) from points to positions, the distances d, d², and whether d is above 0.

    Where it is not, d² and d are 1.
    """
    away = position - point
    d2 = dot(away, away)
    apart = d2 > 0
    safe = np.where(apart, d2, f4(1))
    distance = np.sqrt(safe)
    return away / distance, distance, safe, apart


def intensity_of(name: str, value: ArrayLike) -> Doubles:
    """Return an intensity as a (3, 1) float64 column: in a very large scene it may be beyond float32.

    Raises
    ------
    SceneError
        If it is not one or three finite numbers, at least 0.
    """
    return rgb(name, value, dtype=np.float64)


class LightAtPoint(Parametrized, Light):
    """Base of lights at one position, with an intensity, which its subclasses declare."""

    delta = True
    _points = ("position",)
    position: Any
    intensity: Any

    @property
    def bounds(self) -> Doubles:
        """The position, twice, (2, 3)."""
        return np.stack([self.position, self.position])

    def scaled(self, factor: float) -> Self:
        """Return the light for a scene whose lengths were multiplied by `factor`: the same irradiance there.

        Raises
        ------
        SceneError
            If its intensity is then beyond float32.
        """
        light = copy(self)
        light.position = self.position * factor
        light.intensity = scaled_intensity(f"{type(self).__name__} intensity", self.intensity, factor)
        return light


@parametrized
class PointLight(LightAtPoint):
    """A point light, which emits equally in all directions.

    Parameters
    ----------
    position
        (3,) scene units.
    intensity
        W/sr, one number or three; at distance d it gives irradiance I·cosθ/d².
    group
        Name of the light group, for `aovs="light_groups"`.

    Raises
    ------
    SceneError
        If an argument is malformed.

    Examples
    --------
    >>> lamp = wf.PointLight((0, 3, 0), intensity=(40, 35, 30))
    """

    position: Parameter[ArrayLike] = Parameter(position)
    intensity: Parameter[ArrayLike] = Parameter(intensity_of)
    group: Parameter[str] = Parameter(group_name, default=DEFAULT_GROUP, kw_only=True)

    def record(self, center: Doubles) -> PointLightRecord:
        """Return the light as a record of one column, relative to `center` (3,)."""
        return PointLightRecord((self.position - center).astype(f4).reshape(3, 1), self.intensity.astype(f4))


def checked_positions(name: str, value: ArrayLike) -> Doubles:
    """Return where lights stand, (n, 3) scene units.

    Raises
    ------
    SceneError
        If the array has another shape, no row, or an element that is not finite.
    """
    array = finite_array(name, value, (None, 3))
    if not len(array):
        raise SceneError(f"{name} must have one row at least, got {array.shape}")
    return array


def intensities_of(name: str, value: ArrayLike) -> Doubles:
    """Return intensities as float64: in a very large scene they may be beyond float32.

    Raises
    ------
    SceneError
        If an element is negative or not finite.
    """
    if isinstance(value, str):
        return intensity_of(name, value)[:, 0]
    array = finite_array(name, value, (None,) * as_array(name, value).ndim)
    bad = np.argwhere(array < 0)
    if len(bad):
        where = "".join(f"[{i}]" for i in bad[0])
        raise SceneError(f"{name}{where} is {exact(array[tuple(bad[0])])}; it must be at least 0")
    return array


@parametrized
class PointLights(Parametrized, Light):
    """Many point lights as one object, given by arrays.

    A million of them are set up in two seconds. Each counts as a light of its own where one is chosen.

    Parameters
    ----------
    positions
        (n, 3) scene units.
    intensities
        W/sr: one number, a color (3,), a number for each point (n, 1), or a color for each (n, 3).
    group
        Name of the light group, for `aovs="light_groups"`.

    Raises
    ------
    SceneError
        If an argument is malformed.

    Examples
    --------
    >>> stars = np.random.default_rng(0).normal(size=(1000, 3)) * (5, 1, 5) + (0, 4, 0)
    >>> floor = wf.Rectangle((-3, 0, -3), (0, 0, 6), (6, 0, 0))
    >>> wf.render(wf.Scene([floor], wf.PointLights(stars, 0.02)), spp=1, size=(8, 8)).shape
    (8, 8, 3)
    """

    delta = True
    _points = ("positions",)
    positions: Parameter[ArrayLike] = Parameter(checked_positions)
    intensities: Parameter[ArrayLike] = Parameter(intensities_of)
    group: Parameter[str] = Parameter(group_name, default=DEFAULT_GROUP, kw_only=True)

    def derive(self) -> None:
        """Check that there is an intensity for each position."""
        shape, n = self.intensities.shape, len(self.positions)
        if shape not in ((), (3,), (n, 1), (n, 3)):
            raise SceneError(
                f"PointLights intensities must have shape (), (3,), ({n}, 1) or ({n}, 3) for {n} positions, "
                f"got {shape}"
            )

    @property
    def bounds(self) -> Doubles:
        """Lower and upper corner (2, 3) of the positions."""
        return np.stack([self.positions.min(0), self.positions.max(0)])

    def scaled(self, factor: float) -> PointLights:
        """Return the lights for a scene whose lengths were multiplied by `factor`: the same irradiance there.

        Raises
        ------
        SceneError
            If an intensity is then beyond float32.
        """
        lights = copy(self)
        lights.positions = self.positions * factor
        lights.intensities = scaled_intensity("PointLights intensities", self.intensities, factor)
        return lights

    def record(self, center: Doubles) -> PointLightRecord:
        """Return the lights as a record of n columns, relative to `center` (3,)."""
        intensities = np.broadcast_to(self.intensities, self.positions.shape)
        return PointLightRecord(
            np.ascontiguousarray((self.positions - center).T, f4), np.ascontiguousarray(intensities.T, f4)
        )


def scaled_intensity(name: str, intensity: Doubles, factor: float) -> Doubles:
    """Return intensities in a scene whose lengths were multiplied by `factor`.

    Raises
    ------
    SceneError
        If it is then beyond float32.
    """
    scaled = intensity * factor * factor
    if scaled.max() > FLOAT32_MAX:
        raise SceneError(
            f"{name} is {intensity.max():.3g}; in a scene of this size it must be at most "
            f"{FLOAT32_MAX / factor / factor:.3g}"
        )
    return scaled
