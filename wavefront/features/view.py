"""The features that a view has beside those of its scene."""

from __future__ import annotations

from dataclasses import replace

from ..compile.scene import CompiledScene
from ..guiding import GuideTable
from .branches import Branches
from .guide import Guide


def seen_with(scene: CompiledScene, table: GuideTable | None = None, branches: int = 1) -> CompiledScene:
    """Return a scene as paths of a view meet it, which a table guides, and which go on in several ways.

    Paths from lights meet the scene as it is.
    """
    guides = () if table is None else (Guide(table),)
    splits = () if branches == 1 else (Branches(branches),)
    return replace(scene, program=scene.program.plus(*guides, *splits))
