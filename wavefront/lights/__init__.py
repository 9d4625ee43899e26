"""Lights, and how one of them is chosen."""

from .base import DeltaLight, Emitters, Light, LightRecord, LightSample, Receiver
from .directional import DirectionalLight, DirectionalLights, SunLight
from .environment import ConstantEnvironment, Environment
from .flux import with_flux
from .glow import GlowLights
from .ies import IESLight, IESLights
from .image import ImageEnvironment
from .infinite import EnvironmentSum, InfiniteLight
from .patches import PatchedEnvironment, SkyPatches
from .point import PointLight, PointLightRecord, PointLights
from .projector import Projector
from .rectangle import RectangleLights, TwoSidedRectangleLights, first_of_pairs
from .sky import Sky, SkyLight
from .sphere import SphereLights
from .spot import PicturedLights, SpotLight, SpotLights
from .table import LightTable
from .textured_emission import TexturedTriangleLights, TwoSidedTexturedTriangleLights
from .textured_sphere import TexturedSphereLights
from .triangle import TriangleLights, TwoSidedTriangleLights

__all__ = [
    "ConstantEnvironment",
    "DeltaLight",
    "DirectionalLight",
    "DirectionalLights",
    "Emitters",
    "Environment",
    "EnvironmentSum",
    "GlowLights",
    "IESLight",
    "IESLights",
    "ImageEnvironment",
    "InfiniteLight",
    "Light",
    "LightRecord",
    "LightSample",
    "LightTable",
    "PatchedEnvironment",
    "PicturedLights",
    "PointLight",
    "PointLightRecord",
    "PointLights",
    "Projector",
    "Receiver",
    "RectangleLights",
    "Sky",
    "SkyLight",
    "SkyPatches",
    "SphereLights",
    "SpotLight",
    "SpotLights",
    "SunLight",
    "TexturedSphereLights",
    "TexturedTriangleLights",
    "TriangleLights",
    "TwoSidedRectangleLights",
    "TwoSidedTexturedTriangleLights",
    "TwoSidedTriangleLights",
    "first_of_pairs",
    "with_flux",
]
