"""Ray queries: which surface a ray meets first, and whether anything blocks it."""

from .base import Accelerator, Geometry, Intersections
from .choose import make_accelerator

__all__ = ["Accelerator", "Geometry", "Intersections", "make_accelerator"]
