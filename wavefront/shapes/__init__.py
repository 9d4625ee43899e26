"""Shapes: what a scene is made of."""

from .mesh import Mesh, Rectangle
from .sphere import Sphere

__all__ = ["Mesh", "Rectangle", "Sphere"]
