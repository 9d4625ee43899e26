"""Projectors: points that show a picture."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..arrays.elementary import sin_cos
from ..arrays.vec import Doubles, f4
from ..core.errors import SceneError, number
from ..core.parameter import Parameter, optional, parametrized
from ..film.aov_names import DEFAULT_GROUP, group_name
from .base import position
from .directional import unit
from .point import intensity_of
from .spot import AimedLight, PicturedLights, picture_of, sides_of, target_of


def _picture(name: str, value: Any) -> Any:
    if value is None:
        raise SceneError(f"{name} is None; it must be a Texture, a file or an array")
    return picture_of(name, value)


def _fov(name: str, value: float) -> float:
    return number(name, value, lambda x: 0 < x <= 170, "above 0 and at most 170 degrees")


@parametrized
class Projector(AimedLight):
    """A projector: a point that throws a picture, as a `Camera` of the same view would see it.

    Parameters
    ----------
    position
        (3,) scene units.
    picture
        A `Texture` of colors, or a file or an array of one. Its size gives the ratio of its sides.
    intensity
        W/sr of white on the axis, one number or three. A screen that faces the projector at distance d has
        the irradiance I·color/d² everywhere.
    target, direction
        (3,) the point in the middle of the picture, or the direction to it: give one of them.
    fov
        Angle between the lower and the upper edge, degrees, above 0 and at most 170.
    up
        The direction (3,) of the upper edge.
    group
        Name of the light group, for `aovs="light_groups"`.

    Raises
    ------
    SceneError
        If an argument is malformed or out of range.

    Examples
    --------
    >>> slide = np.random.default_rng(0).random((9, 16, 3))
    >>> beam = wf.Projector((0, 2, 4), slide, 30, target=(0, 1, 0), fov=30)
    """

    hint = "direct the Projector, or widen its fov"
    _directions = "direction", "up"
    position: Parameter[ArrayLike] = Parameter(position)
    picture: Parameter[Any] = Parameter(_picture)
    intensity: Parameter[ArrayLike] = Parameter(intensity_of, default=1.0)
    target: Parameter[ArrayLike | None] = Parameter(target_of, default=None, kw_only=True)
    direction: Parameter[ArrayLike | None] = Parameter(optional(unit), default=None, kw_only=True)
    fov: Parameter[float] = Parameter(_fov, default=45.0, kw_only=True)
    up: Parameter[ArrayLike] = Parameter(unit, default=(0, 1, 0), kw_only=True)
    group: Parameter[str] = Parameter(group_name, default=DEFAULT_GROUP, kw_only=True)

    @property
    def _handed(self) -> bool:
        return True

    def record(self, center: Doubles) -> PicturedLights:
        """Return the light as a record of one column, relative to `center` (3,)."""
        sin, cos = sin_cos(np.float64(np.radians(self.fov) / 2))
        high = sin / cos
        wide = high * self.picture.size[0] / self.picture.size[1]
        right, up = sides_of(self.direction, self.up)
        beyond = 1 - 0.999 / np.sqrt(1 + wide * wide + high * high)  # a cone around the picture
        return PicturedLights(
            (self.position - center).astype(f4).reshape(3, 1),
            self.direction.astype(f4).reshape(3, 1),
            np.array([beyond], f4),
            np.full(1, 1e6, f4),
            self.intensity.astype(f4),
            np.zeros(1, f4),
            np.zeros(1, f4),
            right * f4(1 / wide),
            up * f4(1 / high),
            self.picture,
            screen=True,
        )
