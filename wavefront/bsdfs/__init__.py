"""Materials. Adding one is a file here and a line below; the parametrised tests find it there."""

from .base import Bsdf, BsdfSample, Spatial
from .conductor import Conductor
from .dielectric import Dielectric
from .diffuse import Diffuse
from .mirror import Mirror

ALL = (Diffuse, Mirror, Dielectric, Conductor)

__all__ = ["ALL", "Bsdf", "BsdfSample", "Conductor", "Dielectric", "Diffuse", "Mirror", "Spatial"]
