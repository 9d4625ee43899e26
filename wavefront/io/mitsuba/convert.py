"""Scenes of Mitsuba as scenes of this package."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from ...camera import Sensors, SurfaceSensors
from ...lights import Environment, Sky
from ...scene import Scene
from ..description.contents import Contents
from ..description.conversion import only_one, shown
from ..description.entity import Entity
from ..repair import RawMesh
from ..sources import SceneFiles
from . import bsdfs, emitters, shapes, textures  # noqa: F401  they fill the table
from .media import medium_around
from .nodes import Graph, Job, plugin
from .views import DEFAULT_FILM, check_clipping, meter_on, sees_media


def convert(
    name: str,
    scene: Any,
    files: SceneFiles,
    find: Callable[[str], Path],
    read_mesh: Callable[[Path], list[RawMesh]],
    version: str = "",
) -> Contents:
    """Return what a dictionary holds.

    Parameters
    ----------
    name
        What it is called in messages.
    scene
        The dictionary, as for `mi.load_dict`.
    files
        The files that it may read.
    find
        Returns the path of a file that the scene names.
    read_mesh
        Returns the meshes of an obj or ply file.
    version
        What is said of the version of its file where something is unknown.

    Raises
    ------
    SceneError
        If the scene is malformed.
    """
    job = Job(name, files, find, read_mesh)
    job.instead["film"] = DEFAULT_FILM, "the default in its place"
    made: Contents = job.convert(Graph(name, job, version).build(scene))
    return made


DEFINED = "bsdf texture sampler film rfilter medium phase volume"  # for others to refer to


@plugin("scene", "scene", "", f"shape emitter sensor integrator {DEFINED}", "allow_thread_reordering")
def _scene(entity: Entity) -> Contents:
    job = entity.job
    parts = [part for part in entity.held("shape") if part.type != "shapegroup"]
    carried = [(sensor, part) for part in parts for sensor in part.held("sensor")]
    sensors = [(sensor, entity) for sensor in entity.held("sensor")] + carried
    seen = [(*each, view) for each in sensors if (view := job.convert(each[0])) is not None]
    for sensor, *_ in seen[1:]:
        entity.lose(f"the further sensor {sensor.type!r}")
    camera, settings = seen[0][2] if seen else (None, {})
    job.eye = None if camera is None else camera.origin
    integrators = entity.held("integrator")
    job.sees_media = not integrators or sees_media(integrators[0])
    followed = job.convert(integrators[0]) if integrators else {}
    measures, hides = bool(seen) and (camera is None or isinstance(camera, Sensors)), "background" in followed
    job.hides_lamps = hides and not measures
    if hides and measures:
        entity.lose("hide_emitters for a sensor that measures light")
    found = [shape for part in parts for shape in job.convert(part)]
    lamps = [part for part in entity.held("emitter") if part.type != "area"]
    made = [light for part in lamps if (light := job.convert(part)) is not None]
    lights = [light for each in made for light in (each if isinstance(each, list) else [each])]
    lights = only_one(lights, job.files.losses)
    found = shown(found, lights, job.files.losses)
    settings = settings | followed
    if measures or (not hides and any(isinstance(light, Environment | Sky) for light in lights)):
        settings.pop("background", None)  # alpha is 1
    if seen and camera is None:
        camera = _meter(*seen[0][:2])
    elif seen and not measures:
        check_clipping(seen[0][0], camera, found)
    if isinstance(camera, Sensors):
        camera = camera.above(Scene(found).bounds)
    medium = medium_around(entity, seen[0][0] if seen else None)
    return Contents(lights=lights, camera=camera, shapes=found, settings=settings, medium=medium)


def _meter(sensor: Entity, place: Entity) -> SurfaceSensors | None:
    """Return what measures the irradiance on the shape that holds a sensor."""
    meter = meter_on(place.job.convert(place)) if place.kind == "shape" else None
    if meter is None:
        sensor.lose("left out, as it is at no mesh or sphere")
    return meter
