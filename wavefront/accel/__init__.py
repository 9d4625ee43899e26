"""Ray queries: which surface a ray meets first, and whether anything blocks it."""

from .base import Accelerator, Geometry, Intersections
from .choose import make_accelerator, most_copies
from .instances import InstanceAccelerator, Placements
from .keep import KeptAccelerators

__all__ = [
    "Accelerator",
    "Geometry",
    "InstanceAccelerator",
    "Intersections",
    "KeptAccelerators",
    "Placements",
    "make_accelerator",
    "most_copies",
]
