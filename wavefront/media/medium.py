"""Homogeneous media."""

from __future__ import annotations

from copy import copy
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from ..arrays.vec import f4
from ..colors import rgb
from ..core.errors import SceneError
from ..core.parameter import Parameter, Parametrized
from ..core.suggestions import suggests_keywords
from ..textures.base import BaseTexture


def _coefficient(name: str, value: Any) -> Any:
    """Return a coefficient per channel, (3, 1) float32, at least 0."""
    if isinstance(value, BaseTexture):
        raise SceneError(f"{name} must be a color, not a texture: it belongs to a volume, not to a surface")
    if isinstance(value, str):
        raise SceneError(f"{name} must be numeric, not the name of a color, got {value!r}")
    return rgb(name, value)


class Medium(Parametrized):
    """A homogeneous medium, such as the inside of colored glass.

    Parameters
    ----------
    absorption
        Absorption coefficient per channel, per scene unit of path length, at least 0: a number or three.
        Over a length t the radiance falls by exp(−absorption · t) (Beer and Lambert).

    Raises
    ------
    SceneError
        If a parameter is out of its range, not finite, or a texture.

    Examples
    --------
    >>> tea = wf.Medium(absorption=(0.5, 1.5, 4.0))
    >>> cup = wf.Sphere((0, 0, 0), 1, material=wf.Material(wf.Dielectric(1.33), interior=tea))
    """

    absorption = Parameter(_coefficient)

    @suggests_keywords
    def __init__(self, absorption: ArrayLike = 0.0) -> None:
        self.absorption = absorption
        self.derive()

    def scaled(self, factor: float) -> Self:
        """Return this medium where lengths were multiplied by `factor`: itself if nothing changes."""
        if factor == 1 or not self.absorption.any():
            return self
        other = copy(self)
        # no float32 is so large that it would make a path of length 0 a NaN
        per_unit = self.absorption.astype(np.float64) / factor
        other.absorption = np.minimum(per_unit, np.finfo(f4).max).astype(f4)
        return other
