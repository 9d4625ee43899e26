"""Shapes: meshes, instances and curved primitives."""

from .arrays import PrimitiveArray
from .base import CurvedShape, Shape
from .disk import Disk
from .instance import Instance
from .mesh import Mesh, Rectangle
from .points import Edges, Points
from .segments import Capsules, Cylinders
from .sphere import Sphere
from .spheres import Spheres

__all__ = [
    "Capsules",
    "CurvedShape",
    "Cylinders",
    "Disk",
    "Edges",
    "Instance",
    "Mesh",
    "Points",
    "PrimitiveArray",
    "Rectangle",
    "Shape",
    "Sphere",
    "Spheres",
]
