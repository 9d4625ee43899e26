"""Materials: a BSDF and everything else that a surface is made of."""

from .alpha import Opacity
from .material import Material, MaterialLike, as_material
from .named import NAMED_MATERIALS
from .openpbr import OpenPBR

__all__ = ["NAMED_MATERIALS", "Material", "MaterialLike", "Opacity", "OpenPBR", "as_material"]
