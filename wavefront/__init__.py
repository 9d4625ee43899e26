"""wavefront: a physically based path tracer in whole-array NumPy."""

from . import testing
from .bsdfs import Bsdf, BsdfSample, Conductor, Dielectric, Diffuse, Mirror
from .camera import Camera
from .errors import SceneError
from .film import Image
from .io.load import from_trimesh, load, load_mesh
from .lights import Environment, PointLight
from .metrics import Comparison, compare
from .render import render
from .scene import Scene
from .shapes import Mesh, Rectangle, Sphere

__all__ = [
    "Bsdf",
    "BsdfSample",
    "Camera",
    "Comparison",
    "Conductor",
    "Dielectric",
    "Diffuse",
    "Environment",
    "Image",
    "Mesh",
    "Mirror",
    "PointLight",
    "Rectangle",
    "Scene",
    "SceneError",
    "Sphere",
    "compare",
    "from_trimesh",
    "load",
    "load_mesh",
    "render",
    "testing",
]
