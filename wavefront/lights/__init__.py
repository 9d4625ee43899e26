"""Lights, and how one of them is chosen."""

from .base import Light, LightSample, UserLight
from .directional import DirectionalLight, DirectionalLights, SunLight
from .environment import ConstantEnvironment, Environment
from .image import ImageEnvironment
from .infinite import EnvironmentSum, InfiniteLight
from .point import PointLight, PointLights
from .rectangle import RectangleLights, TwoSidedRectangleLights, first_of_pairs
from .sphere import SphereLights
from .spot import SpotLight, SpotLights
from .table import LightTable
from .triangle import TriangleLights, TwoSidedTriangleLights

__all__ = [
    "ConstantEnvironment",
    "DirectionalLight",
    "DirectionalLights",
    "Environment",
    "EnvironmentSum",
    "ImageEnvironment",
    "InfiniteLight",
    "Light",
    "LightSample",
    "LightTable",
    "PointLight",
    "PointLights",
    "RectangleLights",
    "SphereLights",
    "SpotLight",
    "SpotLights",
    "SunLight",
    "TriangleLights",
    "TwoSidedRectangleLights",
    "TwoSidedTriangleLights",
    "UserLight",
    "first_of_pairs",
]
