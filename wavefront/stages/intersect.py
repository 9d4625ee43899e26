"""Where rays meet surfaces."""

from __future__ import annotations

from ..scene import CompiledScene
from ..state import Hits, Paths, Surface
from ..vec import Bools, Floats, dot
from .surface import leave


def intersect(scene: CompiledScene, paths: Paths) -> Hits:
    """Find what each path's ray meets first."""
    found = scene.accelerator.closest(paths.origin, paths.direction, paths.leaving)
    return Hits(found.t, found.prim, found.b1, found.b2)


def visible(scene: CompiledScene, surface: Surface, wi: Floats, distance: Floats) -> Bools:
    """Tell whether nothing stands between each point and `distance` (n,) along wi (3, n)."""
    origin = leave(surface, wi, dot(surface.ng, wi))
    return ~scene.accelerator.occluded(origin, wi, distance, surface.prim)
