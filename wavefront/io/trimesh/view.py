"""The camera and the lights of trimesh scenes, if they were set."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...camera import Camera
from ...camera.projection import Perspective
from ...core.errors import SceneError, warn_caller
from ...lights import DirectionalLight, PointLight, SpotLight
from ...scene import Scene
from ...shapes.transform import Matrix
from ..description.punctual import punctual_light
from ..description.views import camera_at
from ..losses import Losses

SOURCE = "trimesh object"
KINDS = {"PointLight": "point", "DirectionalLight": "directional", "SpotLight": "spot"}
MADE_UP = (60, 60, 60, 255)  # color of trimesh's own lights


def add_camera(scene: Scene, geometry: Any) -> None:
    """Give a scene the camera that was set in its trimesh scene.

    The resolution of the camera is the size of the picture. A camera without a transform is placed to see
    the whole scene.

    Raises
    ------
    SceneError
        If a value is out of range.
    """
    if not getattr(geometry, "has_camera", False):
        return
    if geometry.source is not None and geometry.source.file_type in ("glb", "gltf"):
        # trimesh ignores the parent nodes of the camera, so its position is wrong
        warn_caller(f"{SOURCE}: not honored: the camera of its glTF file; wf.load reads it")
        return
    camera = geometry.camera
    width, height = (int(side) for side in camera.resolution)
    fov = float(camera.fov[1])
    matrix = _transform(geometry, camera.name)
    try:
        if matrix is None:
            warn_caller(f"{SOURCE}: its camera has no transform; it is placed to see all of the scene")
            placed = scene.framing_camera(fov=fov, size=(width, height))
        else:
            placed = camera_at(matrix, fov, (width, height))
        lens = Perspective(fov, pixel_aspect=_pixel_aspect(camera))
        scene.camera = Camera(placed.origin, placed.rotation, lens, (width, height))
    except SceneError as error:
        raise SceneError(f"{SOURCE}: its camera: {error}") from error


def _pixel_aspect(camera: Any) -> float:
    """Return the width of a pixel over its height.

    It follows from the focal lengths. But if the sides of the picture have the ratio of the angles, which is
    trimesh's default and an approximation, pixels are square, as in its viewer.
    """
    (width, height), (across, up) = camera.resolution, camera.fov
    if abs(width - height * across / up) < 1:
        return 1.0
    return float(camera.focal[1] / camera.focal[0])


def lights(geometry: Any, losses: Losses) -> list[DirectionalLight | PointLight | SpotLight]:
    """Return the lights that were set in a trimesh scene.

    They have the meaning of KHR_lights_punctual and shine along -z of their nodes. Lights that trimesh added
    for its viewer do not count.

    Raises
    ------
    SceneError
        If a light is malformed.
    """
    # reading `lights` would add default lights
    scene_lights = getattr(geometry, "_lights", None) or []
    if scene_lights and all(_is_made_up(light) for light in scene_lights):
        warn_caller(f"{SOURCE}: not honored: the lights that trimesh made for its viewer")
        return []
    return [_light(geometry, light, losses) for light in scene_lights]


def _light(geometry: Any, light: Any, losses: Losses) -> DirectionalLight | PointLight | SpotLight:
    label = f"{SOURCE}: light {getattr(light, 'name', light)!r}"
    kind = KINDS.get(type(light).__name__)
    if kind is None:
        raise SceneError(f"{label} is a {type(light).__name__}; it must be one of {', '.join(KINDS)}")
    if light.radius is not None:
        warn_caller(f"{label}: not honored: radius")
    matrix = _transform(geometry, light.name)
    if matrix is None:
        warn_caller(f"{label} has no transform; it stands at the origin and looks along -z")
        matrix = np.eye(4)
    json: dict[str, Any] = {"type": kind, "intensity": light.intensity}
    json["color"] = [int(code) / 255 for code in light.color[:3]]
    if kind == "spot":
        outer = min(light.outerConeAngle, np.pi / 2)
        json["spot"] = {"innerConeAngle": min(light.innerConeAngle, outer), "outerConeAngle": outer}
    try:
        converted = punctual_light(json, matrix, losses, label)
    except SceneError as error:
        raise SceneError(f"{label}: {error}") from error
    assert converted is not None
    return converted


def _is_made_up(light: Any) -> bool:
    """Return whether a light is one that trimesh adds to scenes without lights."""
    return (
        type(light).__name__ == "PointLight"
        and str(light.name).startswith("light_")
        and tuple(light.color) == MADE_UP
        and light.intensity == 1
    )


def _transform(geometry: Any, name: str) -> Matrix | None:
    """Return the (4, 4) matrix of a node to the scene, None if the scene's graph has no such node."""
    if name not in geometry.graph:
        return None
    try:
        matrix, _ = geometry.graph[name]
    except (ValueError, KeyError) as error:
        raise SceneError(f"{SOURCE}: node {name!r} is not connected to the scene: {error}") from error
    return np.asarray(matrix, np.float64)
