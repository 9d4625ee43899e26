"""wavefront: a physically based path tracer in whole-array NumPy."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from .accel import Accelerator, Geometry, Intersections
from .arrays import elementary, vec
from .arrays.frame import Frame
from .arrays.state import Hits, Paths, SurfaceInteraction
from .bsdfs import (
    Bsdf,
    BsdfSample,
    Conductor,
    Dielectric,
    Diffuse,
    DiffuseTransmission,
    Disney,
    Measured,
    Mirror,
    Mix,
    NullSurface,
    OrenNayar,
    Plastic,
    Principled,
    ShadowCatcher,
    Sides,
    ThinDielectric,
    ThinDisney,
)
from .camera import Camera
from .colors import blackbody, exposure, from_photometric, srgb, to_photometric
from .compile.program import Feature
from .core.errors import Interrupted, RenderError, SaveError, SceneError
from .core.html import register_preview
from .core.suggestions import did_you_mean
from .drive import Session, program
from .extensions import (
    register_accelerator,
    register_executor,
    register_filter,
    register_format,
    register_integrator,
    register_light_sampler,
    register_sampler,
)
from .image import Image
from .lights import (
    DeltaLight,
    DirectionalLight,
    Emitters,
    Environment,
    IESLight,
    InfiniteLight,
    Light,
    LightRecord,
    LightSample,
    PointLight,
    PointLights,
    Projector,
    Receiver,
    Sky,
    SpotLight,
    with_flux,
)
from .lights.choice import LightSampler
from .material_ball import ball_png
from .materials import Material, OpenPBR
from .media import GridMedium, HenyeyGreenstein, Isotropic, Medium, PhaseFunction, PhaseMix, Rayleigh
from .render import render
from .sampling import warp
from .sampling.filters import BoxFilter, GaussianFilter, TentFilter
from .sampling.sampler import Sampler
from .scene import Scene
from .scene.lighting import studio
from .scene.loss import Loss
from .scene.sun_position import sun_position
from .shapes import (
    Box,
    Capsules,
    Cylinders,
    Disk,
    Edges,
    GridBox,
    Group,
    HeightField,
    Instance,
    Mesh,
    Plane,
    Points,
    Rectangle,
    Shape,
    SignedDistanceGrid,
    Sphere,
    Spheres,
)
from .statistics import RegionMean
from .textures.base import BaseTexture
from .textures.image import Texture
from .textures.normal_map import BumpMap, NormalMap
from .textures.vertex_colors import VertexColors
from .version import VERSION

if TYPE_CHECKING:
    from .animation import save_animation
    from .camera.moves import interpolate_cameras, orbit
    from .datasets import write_dataset
    from .image.comparison import Comparison, compare
    from .io.foreign import from_open3d
    from .io.load import from_mitsuba, from_trimesh, load, load_mesh
    from .io.materialx import load_materialx
    from .io.pyvista.objects import from_pyvista
    from .io.sources import LoadLimits
    from .io.volumes import load_grid
    from .measuring import (
        DaylightCoefficients,
        Measurement,
        Weather,
        Year,
        daylight_coefficients,
        grid_points,
        load_points,
        load_weather,
        measure,
        measure_flux,
    )
    from .viewer import Viewer, view
    from .views import render_many, turntable
    from .watching.bounces import bounces
    from .watching.explain import explain
    from .watching.path import LightFound, PathVertices, Vertex
    from .watching.step import Step
    from .watching.trace import Trace, trace

__version__ = VERSION
register_preview(ball_png)

_LATER = {  # what many programs do without is imported when they ask for it
    ".animation": ("save_animation",),
    ".camera.moves": ("interpolate_cameras", "orbit"),
    ".datasets": ("write_dataset",),
    ".image.comparison": ("Comparison", "compare"),
    ".io.foreign": ("from_open3d",),
    ".io.load": ("from_mitsuba", "from_trimesh", "load", "load_mesh"),
    ".io.materialx": ("load_materialx",),
    ".io.pyvista.objects": ("from_pyvista",),
    ".io.sources": ("LoadLimits",),
    ".io.volumes": ("load_grid",),
    ".measuring": (
        "DaylightCoefficients",
        "Measured",
        "Measurement",
        "Weather",
        "Year",
        "daylight_coefficients",
        "grid_points",
        "load_points",
        "load_weather",
        "measure",
        "measure_flux",
    ),
    ".testing": ("testing",),
    ".viewer": ("Viewer", "view"),
    ".watching.bounces": ("bounces",),
    ".watching.explain": ("explain",),
    ".watching.path": ("PathVertices", "Vertex", "LightFound"),
    ".watching.step": ("Step",),
    ".watching.trace": ("Trace", "trace"),
    ".views": ("render_many", "turntable"),
}

__all__ = [
    "Accelerator",
    "BaseTexture",
    "Box",
    "BoxFilter",
    "Bsdf",
    "BsdfSample",
    "BumpMap",
    "Camera",
    "Capsules",
    "Comparison",
    "Conductor",
    "Cylinders",
    "DaylightCoefficients",
    "DeltaLight",
    "Dielectric",
    "Diffuse",
    "DiffuseTransmission",
    "DirectionalLight",
    "Disk",
    "Disney",
    "Edges",
    "Emitters",
    "Environment",
    "Feature",
    "Frame",
    "GaussianFilter",
    "Geometry",
    "GridBox",
    "GridMedium",
    "Group",
    "HeightField",
    "HenyeyGreenstein",
    "Hits",
    "IESLight",
    "Image",
    "InfiniteLight",
    "Instance",
    "Interrupted",
    "Intersections",
    "Isotropic",
    "Light",
    "LightFound",
    "LightRecord",
    "LightSample",
    "LightSampler",
    "LoadLimits",
    "Loss",
    "Material",
    "Measured",
    "Measurement",
    "Medium",
    "Mesh",
    "Mirror",
    "Mix",
    "NormalMap",
    "NullSurface",
    "OpenPBR",
    "OrenNayar",
    "PathVertices",
    "Paths",
    "PhaseFunction",
    "PhaseMix",
    "Plane",
    "Plastic",
    "PointLight",
    "PointLights",
    "Points",
    "Principled",
    "Projector",
    "Rayleigh",
    "Receiver",
    "Rectangle",
    "RegionMean",
    "RenderError",
    "Sampler",
    "SaveError",
    "Scene",
    "SceneError",
    "Session",
    "ShadowCatcher",
    "Shape",
    "Sides",
    "SignedDistanceGrid",
    "Sky",
    "Sphere",
    "Spheres",
    "SpotLight",
    "Step",
    "SurfaceInteraction",
    "TentFilter",
    "Texture",
    "ThinDielectric",
    "ThinDisney",
    "Trace",
    "Vertex",
    "VertexColors",
    "Viewer",
    "Weather",
    "Year",
    "blackbody",
    "bounces",
    "compare",
    "daylight_coefficients",
    "elementary",
    "explain",
    "exposure",
    "from_mitsuba",
    "from_open3d",
    "from_photometric",
    "from_pyvista",
    "from_trimesh",
    "grid_points",
    "integrators",
    "interpolate_cameras",
    "load",
    "load_grid",
    "load_materialx",
    "load_mesh",
    "load_points",
    "load_weather",
    "measure",
    "measure_flux",
    "orbit",
    "program",
    "register_accelerator",
    "register_executor",
    "register_filter",
    "register_format",
    "register_integrator",
    "register_light_sampler",
    "register_sampler",
    "render",
    "render_many",
    "save_animation",
    "srgb",
    "studio",
    "sun_position",
    "testing",
    "to_photometric",
    "trace",
    "turntable",
    "vec",
    "view",
    "warp",
    "with_flux",
    "write_dataset",
]


def __getattr__(name: str) -> Any:
    for module, names in _LATER.items():
        if name in names:
            found = import_module(module, __name__)
            return found if name == "testing" else getattr(found, name)
    hint = did_you_mean(name, __all__, (__name__,)) if not name.startswith("_") else ""
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}{hint}")


def __dir__() -> list[str]:
    return __all__
