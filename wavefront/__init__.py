"""wavefront: a physically based path tracer in whole-array NumPy."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from .core.html import register_preview
from .core.suggestions import did_you_mean
from .version import VERSION

if TYPE_CHECKING:
    from . import integrators, testing
    from .accel import Accelerator, Geometry, Intersections
    from .animation import save_animation
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
    from .camera import Camera, Fisheye, Projection
    from .camera.moves import interpolate_cameras, orbit
    from .colors import blackbody, exposure, from_photometric, srgb, to_photometric
    from .compile.program import Feature
    from .core.errors import Interrupted, RenderError, SaveError, SceneError
    from .datasets import write_dataset
    from .drive import Session, program
    from .drive.frames import render_frames
    from .drive.render import render
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
    from .image.comparison import Comparison, compare
    from .io.foreign import from_open3d
    from .io.load import from_mitsuba, from_trimesh, load, load_mesh
    from .io.materialx import load_materialx
    from .io.pyvista.objects import from_pyvista
    from .io.sources import LoadLimits
    from .io.volumes import load_grid
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
    from .materials import Material, OpenPBR
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
    from .media import GridMedium, HenyeyGreenstein, Isotropic, Medium, PhaseFunction, PhaseMix, Rayleigh
    from .motion import Keyframes, Motion
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
    from .viewer import Viewer, view
    from .views import render_many, turntable
    from .watching.bounces import bounces
    from .watching.explain import explain
    from .watching.path import LightFound, PathVertices, Vertex
    from .watching.step import Step
    from .watching.trace import Trace, trace

__version__ = VERSION


def _draw_ball(material: Any) -> bytes | None:
    return import_module(".material_ball", __name__).ball_png(material)


register_preview(_draw_ball)

_MODULES = {
    "elementary": ".arrays.elementary",
    "integrators": ".integrators",
    "testing": ".testing",
    "vec": ".arrays.vec",
    "warp": ".sampling.warp",
}

_HOMES = {  # of the public names: a module is imported when one of its names is asked for
    ".accel": "Accelerator Geometry Intersections",
    ".animation": "save_animation",
    ".arrays.frame": "Frame",
    ".arrays.state": "Hits Paths SurfaceInteraction",
    ".bsdfs": (
        "Bsdf BsdfSample Conductor Dielectric Diffuse DiffuseTransmission Disney Measured "
        "Mirror Mix NullSurface OrenNayar Plastic Principled ShadowCatcher Sides "
        "ThinDielectric ThinDisney"
    ),
    ".camera": "Camera Fisheye Projection",
    ".camera.moves": "interpolate_cameras orbit",
    ".colors": "blackbody exposure from_photometric srgb to_photometric",
    ".compile.program": "Feature",
    ".core.errors": "Interrupted RenderError SaveError SceneError",
    ".datasets": "write_dataset",
    ".drive": "Session program",
    ".drive.frames": "render_frames",
    ".drive.render": "render",
    ".extensions": (
        "register_accelerator register_executor register_filter register_format "
        "register_integrator register_light_sampler register_sampler"
    ),
    ".image": "Image",
    ".image.comparison": "Comparison compare",
    ".io.foreign": "from_open3d",
    ".io.load": "from_mitsuba from_trimesh load load_mesh",
    ".io.materialx": "load_materialx",
    ".io.pyvista.objects": "from_pyvista",
    ".io.sources": "LoadLimits",
    ".io.volumes": "load_grid",
    ".lights": (
        "DeltaLight DirectionalLight Emitters Environment IESLight InfiniteLight Light "
        "LightRecord LightSample PointLight PointLights Projector Receiver Sky SpotLight "
        "with_flux"
    ),
    ".lights.choice": "LightSampler",
    ".materials": "Material OpenPBR",
    ".measuring": (
        "DaylightCoefficients Measurement Weather Year daylight_coefficients grid_points "
        "load_points load_weather measure measure_flux"
    ),
    ".media": "GridMedium HenyeyGreenstein Isotropic Medium PhaseFunction PhaseMix Rayleigh",
    ".motion": "Keyframes Motion",
    ".sampling.filters": "BoxFilter GaussianFilter TentFilter",
    ".sampling.sampler": "Sampler",
    ".scene": "Scene",
    ".scene.lighting": "studio",
    ".scene.loss": "Loss",
    ".scene.sun_position": "sun_position",
    ".shapes": (
        "Box Capsules Cylinders Disk Edges GridBox Group HeightField Instance Mesh Plane "
        "Points Rectangle Shape SignedDistanceGrid Sphere Spheres"
    ),
    ".statistics": "RegionMean",
    ".textures.base": "BaseTexture",
    ".textures.image": "Texture",
    ".textures.normal_map": "BumpMap NormalMap",
    ".textures.vertex_colors": "VertexColors",
    ".viewer": "Viewer view",
    ".views": "render_many turntable",
    ".watching.bounces": "bounces",
    ".watching.explain": "explain",
    ".watching.path": "LightFound PathVertices Vertex",
    ".watching.step": "Step",
    ".watching.trace": "Trace trace",
}
_HOME_OF = {name: module for module, names in _HOMES.items() for name in names.split()}

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
    "Fisheye",
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
    "Keyframes",
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
    "Motion",
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
    "Projection",
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
    "render_frames",
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
    if name in _MODULES:
        attribute = import_module(_MODULES[name], __name__)
    elif name in _HOME_OF:
        attribute = getattr(import_module(_HOME_OF[name], __name__), name)
    else:
        hint = did_you_mean(name, __all__, (__name__,)) if not name.startswith("_") else ""
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}{hint}")
    import_module(".io.to_scene", __name__)  # registers what is taken of other libraries
    globals()[name] = attribute  # from now on without this function
    return attribute


def __dir__() -> list[str]:
    return __all__
