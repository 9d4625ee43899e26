"""The two roughnesses of glTF's KHR_materials_anisotropy, where textures give them or their direction."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...arrays.elementary import arctan2
from ...arrays.state import SurfaceInteraction
from ...arrays.vec import Floats, f4
from ...textures.base import BaseTexture
from ...textures.parameter import scalar


class RoughnessAlong(BaseTexture):
    """Roughness along the tangent: α is mix(across, 1, strength²), and roughness its root."""

    scalar = True

    def __init__(self, across: Any, strength: Any) -> None:
        self.across, self.strength = scalar("roughness", across), scalar("anisotropyStrength", strength)
        reads = [name for each in (self.across, self.strength) for name in getattr(each, "reads", ())]
        self.reads = tuple(dict.fromkeys(reads))

    def at(self, surface: SurfaceInteraction) -> Floats:
        """Return the roughness at hit points, (n,)."""
        across, strength = (
            each.at(surface) if isinstance(each, BaseTexture) else each
            for each in (self.across, self.strength)
        )
        alpha = across * across
        return np.sqrt(alpha + (f4(1) - alpha) * strength * strength)


class Direction(BaseTexture):
    """Rotation in degrees: that of the vector in red and green of a texture, and a further one."""

    scalar = True

    def __init__(self, vectors: BaseTexture, degrees: float) -> None:
        self.vectors, self.degrees, self.reads = vectors, f4(degrees), vectors.reads

    def at(self, surface: SurfaceInteraction) -> Floats:
        """Return the rotation at hit points, (n,)."""
        red, green, _ = self.vectors.at(surface)
        return arctan2(f4(2) * green - f4(1), f4(2) * red - f4(1)) * f4(180 / np.pi) + self.degrees
