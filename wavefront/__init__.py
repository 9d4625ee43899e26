"""wavefront: a physically based path tracer in whole-array NumPy."""

from . import testing
from .bsdfs import (
    Bsdf,
    BsdfSample,
    Conductor,
    Dielectric,
    Diffuse,
    Mirror,
    Mix,
    OrenNayar,
    Principled,
    ThinDielectric,
)
from .camera import Camera
from .errors import SceneError
from .film import Image
from .io.load import from_trimesh, load, load_mesh
from .lights import DirectionalLight, Environment, PointLight, SpotLight
from .metrics import Comparison, compare
from .relief import BumpMap, NormalMap
from .render import render
from .scene import Scene
from .shapes import Disk, Instance, Mesh, Rectangle, Sphere
from .textures import Texture
from .vertex_colors import VertexColors

__all__ = [
    "Bsdf",
    "BsdfSample",
    "BumpMap",
    "Camera",
    "Comparison",
    "Conductor",
    "Dielectric",
    "Diffuse",
    "DirectionalLight",
    "Disk",
    "Environment",
    "Image",
    "Instance",
    "Mesh",
    "Mirror",
    "Mix",
    "NormalMap",
    "OrenNayar",
    "PointLight",
    "Principled",
    "Rectangle",
    "Scene",
    "SceneError",
    "Sphere",
    "SpotLight",
    "Texture",
    "ThinDielectric",
    "VertexColors",
    "compare",
    "from_trimesh",
    "load",
    "load_mesh",
    "render",
    "testing",
]
