"""Shapes: what a scene is made of."""

from .disk import Disk
from .mesh import Mesh, Rectangle
from .sphere import Sphere

__all__ = ["Disk", "Mesh", "Rectangle", "Sphere"]
