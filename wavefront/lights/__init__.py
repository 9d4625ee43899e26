"""Lights, and how one of them is chosen."""

from .base import Light, LightSample
from .choose import LightTable
from .environment import ConstantEnvironment, Environment
from .point import PointLight, PointLights
from .rectangle import RectangleLights, first_of_pairs
from .sphere import SphereLights
from .triangle import TriangleLights

__all__ = [
    "ConstantEnvironment",
    "Environment",
    "Light",
    "LightSample",
    "LightTable",
    "PointLight",
    "PointLights",
    "RectangleLights",
    "SphereLights",
    "TriangleLights",
    "first_of_pairs",
]
