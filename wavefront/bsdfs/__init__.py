"""Materials. Adding one is a file here and a line below; the parametrised tests find it there."""

from .base import Bsdf, BsdfSample, Spatial
from .diffuse import Diffuse

ALL = (Diffuse,)

__all__ = ["ALL", "Bsdf", "BsdfSample", "Diffuse", "Spatial"]
