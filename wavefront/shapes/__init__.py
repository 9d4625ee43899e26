"""Shapes: meshes, instances and curved primitives."""

from .base import CurvedShape, Shape
from .disk import Disk
from .instance import Instance
from .mesh import Mesh, Rectangle
from .sphere import Sphere

__all__ = ["CurvedShape", "Disk", "Instance", "Mesh", "Rectangle", "Shape", "Sphere"]
