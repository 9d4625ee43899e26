"""Opacity of surfaces (alpha), such as leaves cut out of a rectangle."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..arrays.state import SurfaceInteraction
from ..arrays.vec import Bools, Doubles, Floats, f4
from ..core.errors import SceneError
from ..textures.base import BaseTexture
from ..textures.image import Texture
from ..textures.parameter import Scalar, scalar


class Opacity:
    """The fraction of the light that meets a surface; the rest goes straight on, as if nothing were there.

    Parameters
    ----------
    alpha
        The fraction, (1,) or `BaseTexture`; values outside [0, 1] count as 0 or 1.
    cutoff
        Where alpha is at least this, the surface is opaque; elsewhere it is absent. None blends.
    """

    def __init__(self, alpha: Any, cutoff: float | None) -> None:
        self.alpha, self.cutoff = alpha, cutoff

    @property
    def constant(self) -> float | None:
        """The opacity where it is the same everywhere, None where it varies."""
        return None if isinstance(self.alpha, BaseTexture) else float(self._resolved(self.alpha)[0])

    def at(self, surface: SurfaceInteraction) -> Floats:
        """Return the opacity at hit points, (n,), in [0, 1]."""
        if isinstance(self.alpha, BaseTexture):
            return self._resolved(self.alpha.at(surface))
        return np.repeat(self._resolved(self.alpha), len(surface))

    def is_one_over(self, uvs: Doubles) -> Bools:
        """Return whether the opacity is 1 all over triangles, given by texture coordinates (m, 3, 2).

        Where that is not known it is False.
        """
        if not isinstance(self.alpha, Texture) or self.alpha.uv_set:
            return np.zeros(len(uvs), np.bool_)
        return self.alpha.is_one_within(uvs.min(1).T, uvs.max(1).T)

    def _resolved(self, alpha: Floats) -> Floats:
        if self.cutoff is None:
            return np.clip(alpha, f4(0), f4(1))
        return (alpha >= f4(self.cutoff)).astype(f4)


def alpha_value(name: str, alpha: Scalar) -> Any:
    """Return alpha as (1,) float32 in [0, 1], or a `BaseTexture` that gives numbers.

    Raises
    ------
    SceneError
        If it is outside [0, 1], or a texture of colors.
    """
    if isinstance(alpha, BaseTexture) and alpha.scalar is False:  # its luminance would be no one's opacity
        raise SceneError(f"{name} is {alpha!r}, which gives colors; choose one channel by channel=")
    return scalar(name, alpha)
