"""Lights at a point or far away, in the terms of glTF's KHR_lights_punctual."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...lights import DirectionalLight, PointLight, SpotLight
from ...shapes.transform import Matrix
from ..losses import Losses
from .numbers import floats


def punctual_light(
    light: dict[str, Any], matrix: Matrix, losses: Losses, place: str
) -> DirectionalLight | PointLight | SpotLight | None:
    """Return a light of KHR_lights_punctual by the matrix of its node to the scene; None for other types.

    Numbers that are out of range are clamped, and noted.

    Raises
    ------
    SceneError
        If a value is malformed.
    """
    color = losses.within("color", floats("color", light.get("color", [1, 1, 1]), 3), 0, np.inf, place)
    intensity = floats("intensity", [light.get("intensity", 1)], 1)[0]
    with np.errstate(over="ignore"):
        strength = color * losses.within("intensity", intensity, 0, np.inf, place)
    at, forward = matrix[:3, 3], -matrix[:3, 2]
    match light.get("type"):
        case "point":
            return PointLight(at, strength)
        case "directional":
            return DirectionalLight(forward, strength)
        case "spot":
            angle, blend = _cone(light.get("spot", {}), losses, place)
            return SpotLight(at, strength, direction=forward, angle=angle, blend=blend)
    return None


def _cone(spot: dict[str, Any], losses: Losses, place: str) -> tuple[float, float]:
    """Return the angle of a spot in degrees, and the part of it over which light falls off."""
    angles = [spot.get("innerConeAngle", 0), spot.get("outerConeAngle", np.pi / 4)]
    inner, outer = floats("cone", angles, 2)
    outer = float(losses.within("outerConeAngle", outer, np.pi / 2**20, np.pi / 2, place))
    inner = float(losses.within("innerConeAngle", inner, 0, outer, place))
    return float(np.degrees(2 * outer)), 1 - inner / outer
