"""The features that a view has beside those of its scene."""

from __future__ import annotations

from dataclasses import replace

from ..camera import Camera
from ..compile.scene import CompiledScene
from ..guiding import GuideTable
from ..motion.shutter import Shutter
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


def seen_with(scene: CompiledScene, table: GuideTable | None = None, branches: int = 1) -> CompiledScene:
    """Return a scene for the paths of a view, with the table that guides them, and their branches.

    Paths from lights meet the scene as it is.
    """
    guides = () if table is None else (Guide(table),)
    splits = () if branches == 1 else (Branches(branches),)
    return replace(scene, program=scene.program.plus(*guides, *splits))
