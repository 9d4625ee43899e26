"""The diffuse color of glTF's specular-glossiness model, where it depends on two textures.

Source: Khronos Group, KHR_materials_pbrSpecularGlossiness, "Specular - Glossiness".
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ...arrays.state import SurfaceInteraction
from ...arrays.vec import Floats, f4
from ...textures.base import BaseTexture
from ...textures.image import Texture
from ...textures.parameter import Color, color


class BesideSpecular(BaseTexture):
    """diffuse · (1 − max(specular)), where the specular color is a texture.

    Parameters
    ----------
    diffuse
        A color in [0, 1], or a texture.
    specular
        A texture of colors in [0, 1]. Its image, wrapping and texture coordinates may differ from those of
        the diffuse texture: both are looked up at each hit point.
    """

    def __init__(self, diffuse: Color, specular: Texture) -> None:
        self.diffuse: Any = color("diffuse", diffuse)
        self.specular = specular
        reads = self.diffuse.reads if isinstance(self.diffuse, BaseTexture) else ()
        self.reads = tuple(dict.fromkeys((*reads, *specular.reads)))

    def __repr__(self) -> str:
        """Return the call that makes it."""
        return f"BesideSpecular({self.diffuse!r}, {self.specular!r})"

    def at(self, surface: SurfaceInteraction) -> Floats:
        """Return the color at hit points, (3, n)."""
        red, green, blue = self.specular.at(surface)
        left = f4(1) - np.maximum(np.maximum(red, green), blue)
        return left * (self.diffuse.at(surface) if isinstance(self.diffuse, BaseTexture) else self.diffuse)
