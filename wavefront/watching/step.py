"""One stage of the loop, as it is seen from outside."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property
from typing import Any, TypeVar

import numpy as np

from ..arrays.state import Hits, Paths, SurfaceInteraction
from ..arrays.vec import Floats, f4
from ..compile.scene import CompiledScene

Record = TypeVar("Record", Paths, Hits, SurfaceInteraction)
PLACES = ("origin", "prev_vertex", "point")  # fields that are places
LENGTHS = ("t", "error", "dpduv", "dpduv1")  # fields that are lengths


class Step:
    """The data after a stage of the loop, from `trace`.

    Its arrays are read-only. Places are in the coordinates of the user's scene.

    Parameters
    ----------
    stage
        "generate", "intersect", the name of a feature that acted, "compact", "shade", "direct",
        "bounce-sample" or "end".
    bounce
        Number of the surface that the paths have come to, 0 for the first.
    scene
        The compiled scene.
    light
        (3, n) radiance so far, a column for each pixel that is traced.
    paths
        The paths that are under way.
    hits
        The hits of their rays; None where they have not been traced.
    surface
        The surfaces that they have come to; None where these are not known.

    Examples
    --------
    >>> steps = wf.trace([wf.Sphere((0, 0, 0), 1), wf.Environment(1)], size=(4, 4))
    >>> step = next(steps)
    >>> step.stage, step.bounce, len(step.paths)
    ('generate', 0, 16)
    """

    def __init__(
        self,
        stage: str,
        bounce: int,
        scene: CompiledScene,
        light: Floats,
        paths: Paths,
        hits: Hits | None = None,
        surface: SurfaceInteraction | None = None,
    ) -> None:
        self.stage, self.bounce, self._scene = stage, bounce, scene
        self.light = light.copy()  # the loop adds to it
        self.light.flags.writeable = False
        self._paths, self._hits, self._surface = paths, hits, surface

    @cached_property
    def paths(self) -> Paths:
        """The paths that are under way."""
        return in_world(self._scene, self._paths)

    @cached_property
    def hits(self) -> Hits | None:
        """The hits of their rays; None where they have not been traced."""
        return None if self._hits is None else in_world(self._scene, self._hits)

    @cached_property
    def surface(self) -> SurfaceInteraction | None:
        """The surfaces that they have come to; None where these are not known."""
        return None if self._surface is None else in_world(self._scene, self._surface)

    def __repr__(self) -> str:
        """Return the stage, and how many paths are under way."""
        return f"<Step {self.stage!r}, bounce {self.bounce}: {len(self._paths)} paths>"

    def _repr_html_(self) -> str:
        records = (soa for soa in (self.paths, self.hits, self.surface) if soa is not None)
        return f"<p>{self.stage}, bounce {self.bounce}</p>" + "".join(soa._repr_html_() for soa in records)


def in_world(scene: CompiledScene, record: Record) -> Record:
    """Return a record in the user's coordinates, read-only; arrays that are the same there are not copied."""
    changed: dict[str, Any] = {}
    for name, value in record._values():
        if not isinstance(value, np.ndarray):
            continue
        if name in PLACES:
            value = world_points(scene, value)
        elif name in LENGTHS and scene.scale != 1:
            value = value / f4(scene.scale)
        view = value.view()
        view.flags.writeable = False
        changed[name] = view
    return replace(record, **changed)


def world_points(scene: CompiledScene, points: Floats) -> Floats:
    """Return points (3, n) of the compiled scene in the user's coordinates."""
    if scene.scale == 1 and not scene.center.any():
        return points
    world: Floats = ((points + scene.center[:, None]) / scene.scale).astype(f4)
    return world
