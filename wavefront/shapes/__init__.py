"""Shapes: meshes, spheres and instances."""

from .base import Shape
from .disk import Disk
from .instance import Instance
from .mesh import Mesh, Rectangle
from .sphere import Sphere

__all__ = ["Disk", "Instance", "Mesh", "Rectangle", "Shape", "Sphere"]
