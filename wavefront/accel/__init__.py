"""Ray queries: which surface a ray meets first, and whether anything blocks it."""

from .base import Accelerator, Geometry, Intersections
from .cache import AcceleratorCache
from .instances import InstanceAccelerator, Placements
from .kinds import KINDS, kind_of
from .primitives import CurvedPrimitives
from .registry import make_accelerator, most_copies

__all__ = [
    "KINDS",
    "Accelerator",
    "AcceleratorCache",
    "CurvedPrimitives",
    "Geometry",
    "InstanceAccelerator",
    "Intersections",
    "Placements",
    "kind_of",
    "make_accelerator",
    "most_copies",
]
