"""Shapes: meshes, instances and curved primitives."""

from .arrays import PrimitiveArray
from .base import CurvedShape, Shape
from .box import Box, GridBox, Plane
from .disk import Disk
from .distance_grid import SignedDistanceGrid
from .group import Group
from .height_field import HeightField
from .instance import Instance
from .mesh import Mesh, Rectangle
from .points import Edges, Points
from .segments import Capsules, Cylinders
from .sphere import Sphere
from .spheres import Spheres

__all__ = [
    "Box",
    "Capsules",
    "CurvedShape",
    "Cylinders",
    "Disk",
    "Edges",
    "GridBox",
    "Group",
    "HeightField",
    "Instance",
    "Mesh",
    "Plane",
    "Points",
    "PrimitiveArray",
    "Rectangle",
    "Shape",
    "SignedDistanceGrid",
    "Sphere",
    "Spheres",
]
