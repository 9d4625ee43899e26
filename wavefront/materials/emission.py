"""What a material sends of its own."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..textures.parameter import Color, color


class Emission:
    """The radiance that leaves a surface, beside what it scatters; it makes a light of a shape.

    Parameters
    ----------
    radiance
        W·sr⁻¹·m⁻², (3, 1) float32, or a `BaseTexture` that gives colors.
    """

    def __init__(self, radiance: Any) -> None:
        self.radiance = radiance


def emission(name: str, radiance: Color | Emission | None) -> Emission | None:
    """Return the emission that a user asks for by `name`, None where it is black.

    Raises
    ------
    SceneError
        If a number is below 0 or not finite.
    """
    if radiance is None or isinstance(radiance, Emission):
        return radiance
    value = color(name, radiance, np.inf)
    return None if isinstance(value, np.ndarray) and not value.any() else Emission(value)
