"""`wavefront measure`: the light at points."""

from __future__ import annotations

import argparse
import os
from typing import Any

from ..arrays.vec import Doubles
from ..camera import Sensors
from ..camera.sensors import KINDS
from ..core.errors import SaveError, SceneError
from ..measuring import Measurement, grid_points, load_points
from ..measuring.measure import measured
from ..measuring.measurement import file_kind
from ..scene import Scene
from .command import SCENE_FILE, add_command
from .messages import ERROR, print_done, print_error, print_note
from .options import add_settings, framing, read_scene, setting_values, size, vector
from .outputs import save_elsewhere, whole_or_part


def add_measure_command(commands: Any) -> None:
    """Add the command and its options to those of a parser."""
    command = add_command(
        commands,
        "measure",
        "measure the light that arrives at points of a scene file",
        [
            "wavefront measure room.glb --grid 0,0.8,0:0,0,3:4,0,0:8x6 --noise 0.01 -o desk.csv",
            "wavefront measure room.glb --points sensors.csv --normal 0,1,0 --aov direct --aov indirect",
            "wavefront measure meter.xml -o meter.csv",
        ],
    )
    command.add_argument("scenes", nargs=1, metavar="scene", help=SCENE_FILE)
    command.add_argument("-o", "--output", default="out.csv", help="csv or npz file to write")
    where = command.add_mutually_exclusive_group()
    where.add_argument(
        "--grid",
        type=_grid,
        metavar="CORNER:EDGE:EDGE:NxM",
        help="N by M points in the middle of the cells of a parallelogram, of which the corner and two edges "
        "are X,Y,Z; the normal is the cross product of the edges",
    )
    where.add_argument(
        "--points", metavar="FILE", help="table with x, y, z of a point on each line, and a direction or none"
    )
    command.add_argument("--normal", type=vector, metavar="X,Y,Z", help="of all points, in place of others")
    command.add_argument("--kind", choices=KINDS, default=KINDS[0], help="what is measured")
    add_settings(command)
    command.add_argument("--quiet", action="store_true", help="no progress bar")
    command.set_defaults(run=_measure)


def _grid(text: str) -> tuple[Doubles, Doubles]:
    """Return the points and normals of CORNER:EDGE:EDGE:NxM."""
    fields = text.split(":")
    if len(fields) != 4:
        raise SceneError(f"{text!r} is not CORNER:EDGE:EDGE:NxM, such as 0,0.8,0:0,0,3:4,0,0:8x6")
    corner, edge_u, edge_v = (vector(field) for field in fields[:3])
    return grid_points(corner, edge_u, edge_v, size(fields[3]))


def _measure(options: argparse.Namespace) -> int:
    """Measure and save; return the exit status."""
    file_kind(options.output)
    (path,), progress = options.scenes, False if options.quiet else None
    by_options = _given_sensors(options)
    scene = read_scene(path, options, progress)
    sensors = _sensors_of(path, scene) if by_options is None else by_options.above(scene.bounds)
    settings = {**framing(options), **setting_values(options), "progress": progress}
    command = {"arguments": options.arguments, "folder": options.folder}
    spp = settings.pop("spp", None)
    image, status = whole_or_part(lambda: measured(scene, sensors, spp, settings, command).image)
    return (image is not None and _save(Measurement(image), options.output)) or status


def _given_sensors(options: argparse.Namespace) -> Sensors | None:
    """Return the sensors that the options describe, None without."""
    if options.grid is not None:
        points, normals = options.grid
    elif options.points is not None:
        points, normals = load_points(os.path.join(options.folder, options.points))
    else:
        return None
    normals = None if options.kind == "fluence" else normals if options.normal is None else options.normal
    return Sensors(points, normals, options.kind)


def _sensors_of(path: str, scene: Scene) -> Sensors:
    """Return the sensors that a scene file has."""
    if not isinstance(scene.camera, Sensors):
        raise SceneError(f"{path}: has no sensor that measures light; give points by --grid or --points")
    return scene.camera


def _save(measurement: Measurement, output: str) -> int:
    """Save a measurement, if not where it was meant to go then elsewhere; return the exit status."""
    try:
        measurement.save(output)
    except (SaveError, MemoryError) as error:
        print_error(error)
        place = save_elsewhere(measurement.save, output)
        print_note(f"the measurement {f'was saved as {place}' if place else 'is lost'}")
        return ERROR
    seconds, spp = measurement.metadata["seconds"], measurement.metadata["spp"]
    print_done(f"{output}: {measurement}, {spp:.4g} spp in {seconds:.1f} s")
    return 0
