"""Parameters that vary over surfaces: their interface, images, vertex colors, normal and bump maps."""

from .base import BaseTexture
from .image import Texture
from .normal_map import BaseNormalMap, BumpMap, NormalMap
from .vertex_colors import VertexColors

__all__ = ["BaseNormalMap", "BaseTexture", "BumpMap", "NormalMap", "Texture", "VertexColors"]
