"""The features that a view has beside those of its scene."""

from __future__ import annotations

from dataclasses import replace

from ..camera import Camera
from ..compile.program import Program
from ..compile.scene import CompiledScene
from ..guiding import GuideTable
from ..motion.shutter import Shutter
from ..sampling.tiles import Tiles
from .branches import Branches
from .guide import Guide
from .motion import Exposure, motions_of_camera


def seen_by(scene: CompiledScene, camera: Camera, shutter: Shutter | None) -> CompiledScene:
    """Return a scene as the first rays of a camera meet it, whose shutter is open for a time."""
    scene = scene.seen_by(camera)
    if shutter is None or not (scene.motion is not None or camera.moves):
        return scene
    motions = None
    if camera.moves:
        span = shutter.read_over(camera.rolling_shutter)
        motions = motions_of_camera(camera, span, scene.center, scene.scale)
    return replace(scene, program=scene.program.plus(Exposure(shutter, motions)))


def seen_with(
    scene: CompiledScene, table: GuideTable | None = None, branches: int = 1, tiles: Tiles | None = None
) -> CompiledScene:
    """Return a scene for the paths of a view, with the table that guides them, and their branches.

    Paths of a tile share light, so that all of them have one time. Paths from lights meet the
    scene as it is.
    """
    guides = () if table is None else (Guide(table),)
    splits = () if branches == 1 else (Branches(branches),)
    program = scene.program if tiles is None or scene.motion is None else _at_once(scene.program, tiles)
    return replace(scene, program=program.plus(*guides, *splits))


def _at_once(program: Program, tiles: Tiles) -> Program:
    """Return a program in which the paths of a tile have one time."""
    return Program(
        [
            replace(feature, tiles=tiles) if isinstance(feature, Exposure) else feature
            for feature in program.features
        ]
    )
