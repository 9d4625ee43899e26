"""Ray queries: which surface a ray meets first, and whether anything blocks it."""

from .base import Accelerator, Geometry, Intersections
from .cache import AcceleratorCache
from .instances import InstanceAccelerator, Placements
from .registry import make_accelerator, most_copies

__all__ = [
    "Accelerator",
    "AcceleratorCache",
    "Geometry",
    "InstanceAccelerator",
    "Intersections",
    "Placements",
    "make_accelerator",
    "most_copies",
]
