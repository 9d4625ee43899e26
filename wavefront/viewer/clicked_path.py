"""The path of a pixel that is clicked: drawn into the scene, and as a table."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from ..arrays.vec import Doubles
from ..core.errors import SceneError
from .viewpoint import Viewpoint

if TYPE_CHECKING:
    from ..watching.path import PathVertices

    PathOf = Callable[[Viewpoint, tuple[int, int]], PathVertices]

PATH, LIGHT = "/path", "/light samples"  # the drawn parts
COLORS = {PATH: (230, 90, 12), LIGHT: (255, 230, 50)}
THICKNESS = 3.0  # pixels
LIGHT_LENGTH, FREE_LENGTH = 0.15, 1.0  # of directions that lead to lights, and out of the scene; radii
TABLE = "overflow-x:auto;padding:0 0.6em 0.6em;font-size:0.7em"
HINT = "click: the path of a pixel, as wf.trace has it"


class ClickedPath:
    """Shows a path where the box of the page is ticked.

    Parameters
    ----------
    server
        That of viser.
    viewpoint
        Returns the view of the page.
    path_of
        Traces the path of a pixel (x, y) of a view.
    say
        Called with errors.
    """

    def __init__(
        self, server: Any, viewpoint: Callable[[], Viewpoint], path_of: PathOf, say: Callable[[str], object]
    ) -> None:
        self._server, self._viewpoint, self._path_of, self._say = server, viewpoint, path_of, say
        self.box = server.gui.add_checkbox("paths", False, hint=HINT)
        self.table = server.gui.add_html("")
        self.box.on_update(self._ticked)
        server.scene.on_click()(self._clicked)

    def _ticked(self, event: Any) -> None:
        """Remove the path when the box is unchecked."""
        if not self.box.value:
            self._clear()

    def _clear(self) -> None:
        self.table.content = ""
        for name in COLORS:
            self._server.scene.remove_by_name(name)

    def _clicked(self, event: Any) -> None:
        if not self.box.value:
            return
        view = self._viewpoint()
        x, y = (
            min(max(int(fraction * side), 0), side - 1)
            for fraction, side in zip(event.screen_pos, view.size, strict=True)
        )
        try:
            path = self._path_of(view, (x, y))
        except SceneError as error:
            self._say(str(error))
            return
        self.show(path, view)

    def show(self, path: PathVertices, view: Viewpoint) -> None:
        """Draw a path, from its first surface on, and its light samples."""
        self._clear()
        self.table.content = f'<div style="{TABLE}">{path._repr_html_()}</div>'
        for name, segments in zip(COLORS, segments_of(path, view.surroundings.radius), strict=True):
            if segments:
                points = np.array([[view.surroundings.to_page(end) for end in pair] for pair in segments])
                self._server.scene.add_line_segments(
                    name, points, COLORS[name], thickness=THICKNESS, thickness_units="screen"
                )
        self._server.flush()


Segment = tuple[Doubles, Doubles]


def segments_of(path: PathVertices, radius: float) -> tuple[list[Segment], list[Segment]]:
    """Return the segments between the vertices of a path, and pieces of those that lead to lights.

    Where the path leaves a scene of a radius, a segment shows its direction.
    """
    points = [vertex.point for vertex in path if vertex.point is not None]
    between = list(pairwise(points))
    if points and path[-1].point is None:
        between.append((points[-1], points[-1] - FREE_LENGTH * radius * path[-1].wo))
    toward = [
        (vertex.point, vertex.point + LIGHT_LENGTH * radius * vertex.sampled.wi)
        for vertex in path
        if vertex.point is not None and vertex.sampled is not None and vertex.sampled.wi is not None
    ]
    return between, toward
