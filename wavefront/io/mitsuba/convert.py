"""Scenes of Mitsuba as scenes of this package."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from ...camera import Camera, Sensors, SurfaceSensors
from ...core.errors import number
from ...lights import Environment, Light, Sky
from ...scene import Scene
from ..description.contents import Contents
from ..description.conversion import only_one, shown
from ..description.entity import Entity
from ..repair import RawMesh
from ..sources import SceneFiles
from . import bsdfs, emitters, shapes, textures  # noqa: F401  they fill the table
from .media import medium_around
from .nodes import Graph, Job, plugin
from .transforms import moved
from .views import DEFAULT_FILM, check_clipping, meter_on, sees_media


def convert(
    name: str,
    scene: Any,
    files: SceneFiles,
    find: Callable[[str], Path],
    read_mesh: Callable[[Path], list[RawMesh]],
    version: str = "",
) -> Contents:
    """Return the contents of a scene in a dictionary.

    Parameters
    ----------
    name
        Its name, for messages.
    scene
        The dictionary, as for `mi.load_dict`.
    files
        The files that it may read.
    find
        Returns the path of a file that the scene names.
    read_mesh
        Returns the meshes of an obj or ply file.
    version
        Words on the version of its file, for messages about unknown names.

    Raises
    ------
    SceneError
        If the scene is malformed.
    """
    job = Job(name, files, find, read_mesh)
    job.instead["film"] = DEFAULT_FILM, "the default in its place"
    contents: Contents = job.convert(Graph(name, job, version).build(scene))
    return contents


DEFINED = "bsdf texture sampler film rfilter medium phase volume"  # for others to refer to


@plugin("scene", "scene", "", f"shape emitter sensor integrator {DEFINED}", "allow_thread_reordering")
def _scene(entity: Entity) -> Contents:
    job = entity.job
    entities = [child for child in entity.children("shape") if child.type != "shapegroup"]
    seen = _sensors(entity, entities)
    camera, settings = seen[0][2] if seen else (None, {})
    measures = bool(seen) and (camera is None or isinstance(camera, Sensors))
    followed = _followed(entity, camera, measures)
    bodies = [body for child in entities for body in moved(child, job.convert(child))]
    lights = only_one(_lights(entity), job.files.losses)
    bodies = shown(bodies, lights, job.files.losses)
    settings = settings | followed
    around = any(isinstance(light, Environment | Sky) for light in lights)
    if measures or (around and "background" not in followed):
        settings.pop("background", None)  # alpha is 1
    if seen and camera is None:
        camera = _meter(*seen[0][:2])
    elif seen and not measures:
        check_clipping(seen[0][0], camera, bodies)
    if isinstance(camera, Sensors):
        camera = camera.above(Scene(bodies).bounds)
    if seen and camera is not None and not measures:
        (camera,) = moved(seen[0][0], [camera])
        settings = settings | _shutter(seen[0][0], [*bodies, *lights, camera])
    medium = medium_around(entity, seen[0][0] if seen else None)
    return Contents(lights=lights, camera=camera, shapes=bodies, settings=settings, medium=medium)


def _shutter(sensor: Entity, elements: list[Any]) -> dict[str, Any]:
    """Return the setting of the shutter where something moves while it is open."""
    if not any(element.moves for element in elements):
        return {}
    names = "shutter_open", "shutter_close"
    open_, close = (number(name, sensor.values.get(name, 0.0)) for name in names)
    return {"shutter": (open_, close)} if open_ < close else {}


def _sensors(entity: Entity, entities: list[Entity]) -> list[tuple[Entity, Entity, Any]]:
    """Return the sensors of a scene and of its shapes: each with its holder, its camera and its settings.

    The first one counts.
    """
    sensors = [(sensor, holder) for holder in (entity, *entities) for sensor in holder.children("sensor")]
    seen = [(*pair, view) for pair in sensors if (view := entity.job.convert(pair[0])) is not None]
    for sensor, *_ in seen[1:]:
        entity.lose(f"the further sensor {sensor.type!r}")
    return seen


def _followed(entity: Entity, camera: Camera | None, measures: bool) -> dict[str, Any]:
    """Return the settings of the integrator; the job learns whether it and the camera see media."""
    job = entity.job
    job.eye = None if camera is None else camera.origin
    integrators = entity.children("integrator")
    job.sees_media = not integrators or sees_media(integrators[0])
    followed: dict[str, Any] = job.convert(integrators[0]) if integrators else {}
    job.hides_lamps = "background" in followed and not measures
    if "background" in followed and measures:
        entity.lose("hide_emitters for a sensor that measures light")
    return followed


def _lights(entity: Entity) -> list[Light]:
    lamps = [lamp for lamp in entity.children("emitter") if lamp.type != "area"]
    pairs = [(lamp, light) for lamp in lamps if (light := entity.job.convert(lamp)) is not None]
    lists = [(lamp, converted if isinstance(converted, list) else [converted]) for lamp, converted in pairs]
    return [light for lamp, lights in lists for light in moved(lamp, lights)]


def _meter(sensor: Entity, place: Entity) -> SurfaceSensors | None:
    """Return the sensors of the irradiance on the shape that holds a sensor."""
    meter = meter_on(place.job.convert(place)) if place.kind == "shape" else None
    if meter is None:
        sensor.lose("left out, as it is at no mesh or sphere")
    return meter
