"""Materials: a BSDF and everything else that a surface is made of."""

from .alpha import Opacity
from .material import Material, MaterialLike, as_material

__all__ = ["Material", "MaterialLike", "Opacity", "as_material"]
