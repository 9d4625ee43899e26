"""Optical flow: where the pictures of other times show the point of each pixel, and whether they do."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arrays.soa import soa
from ..arrays.state import Rays
from ..arrays.vec import Bools, Doubles, Ints, dot, f4
from ..camera import Camera, Panorama
from ..compile.scene import CompiledScene
from ..shapes import Shape
from ..stages.passing import covering_hits
from .carried import carried

FLOWS = {"flow": 1, "flow_back": 0}  # AOVs, and which of the two times each leads to
HIDDEN = {"flow_occluded": "flow", "flow_back_occluded": "flow_back"}
ROUNDS = 6  # iterations for the row that is read at the time when it shows a point
NEARER = 1e-3  # by which part of its distance something must be nearer than a point to hide it

# the scene as the camera meets it at a time, for rays with times if the sensor is read row by row
SceneAt = Callable[[float], CompiledScene]


@soa
class Flow:
    """How the surfaces that a picture shows go on to the pictures before and after."""

    shapes: Sequence[Shape]  # with their motions, in the order of the ids
    camera: Camera  # with its motion
    start: float  # time of the picture, s; of a rolling shutter that of the first row
    times: tuple[float, float]  # of the pictures before and after
    scene_at: SceneAt

    def layers(
        self, names: Sequence[str], pixel: Ints, shape: Ints, face: Ints, point: Doubles
    ) -> Iterator[tuple[str, NDArray[Any]]]:
        """Yield the AOVs of surfaces that pixels show.

        Parameters
        ----------
        names
            Those asked for.
        pixel
            (n,) row-major in the whole picture.
        shape, face, point
            (n,) and (n, 3) of the surfaces that they show.
        """
        width = self.camera.resolution[0]
        film: Doubles = np.stack([pixel % width, pixel // width], 1) + np.float64(0.5)
        for name, which in FLOWS.items():
            hidden = next(layer for layer, of in HIDDEN.items() if of == name)
            if name not in names and hidden not in names:
                continue
            places, film_then, times = self._film_at(self.times[which], film, shape, face, point)
            if name in names:
                yield name, self._shortest(film_then - film)
            if hidden in names:
                yield hidden, self._hidden(self.times[which], times, places, film_then)

    def _delay(self, row: Doubles) -> Doubles:
        """Return the times (n,) from the reading of the first row to that of others, s."""
        if not self.camera.rolling_shutter:
            return np.zeros(len(row))
        width, height = self.camera.resolution
        rows = np.clip(np.nan_to_num(np.floor(row)), 0, height - 1).astype(np.int64)
        return self.camera.row_delay((rows * width).astype(np.uint32))

    def _film_at(
        self, time: float, film: Doubles, shape: Ints, face: Ints, point: Doubles
    ) -> tuple[Doubles, Doubles, Doubles]:
        """Return where points are in the picture of a time, (n, 3) and in pixels (n, 2), and when (n,)."""
        begin = self.start + self._delay(film[:, 1])
        film_then = film
        for _ in range(ROUNDS if self.camera.rolling_shutter else 1):
            end = time + self._delay(film_then[:, 1])
            places = carried(self.shapes, shape, face, point, begin, end)
            film_then = self.camera.project_at(places, end)[0]
        return places, film_then, end

    def _shortest(self, flow: Doubles) -> Doubles:
        """Return flow (n, 2) the shorter way around a panorama."""
        if isinstance(self.camera.projection, Panorama):
            width = self.camera.resolution[0]
            flow[:, 0] -= width * np.rint(flow[:, 0] / width)
        return flow

    def _hidden(self, time: float, times: Doubles, places: Doubles, film_then: Doubles) -> NDArray[np.int32]:
        """Return 1 for points (n, 3) that the picture of a time does not show: hidden, or beside it; else 0.

        Parameters
        ----------
        time, times
            Of the picture, and of the rows (n,) that would show them.
        there
            (n, 2) in pixels of the whole picture.
        """
        x0, y0, x1, y1 = self.camera.window
        inside = (film_then >= (x0, y0)).all(1) & (film_then < (x1, y1)).all(1)
        lanes = np.flatnonzero(inside)
        hidden: NDArray[np.int32] = np.where(inside, 0, 1).astype(np.int32)
        if lanes.size:
            hidden[lanes] = self._covered(time, times[lanes], places[lanes], film_then[lanes])
        return hidden

    def _covered(self, time: float, times: Doubles, places: Doubles, film_then: Doubles) -> Bools:
        """Return whether something is nearer to the camera than points (n, 3), on their way to it."""
        scene = self.scene_at(time)
        rays = self._rays(scene, times, film_then)
        moved, hits = covering_hits(scene, rays)
        origin, direction = (vectors.astype(np.float64) for vectors in (rays.origin, rays.direction))
        met = dot(
            moved.origin.astype(np.float64) + moved.direction.astype(np.float64) * hits.t - origin, direction
        )
        far = dot((places * scene.scale - scene.center).T - origin, direction)
        return np.asarray((hits.prim != -1) & (met < far * (1 - NEARER)))

    def _rays(self, scene: CompiledScene, times: Doubles, film_then: Doubles) -> Rays:
        """Return the rays of film points (n, 2) of the camera as it is at times (n,)."""
        n, origin, direction = len(times), [], []
        order = np.argsort(times, kind="stable")
        for lanes in np.split(order, np.flatnonzero(np.diff(times[order])) + 1):
            view = scene.view(self.camera.at(float(times[lanes[0]])))
            x, y = film_then[lanes].T.astype(f4)
            start, along = view.rays(x, y, scene.center)
            origin.append(start)
            direction.append(along)
        back = np.argsort(order, kind="stable")
        starts, ways = (np.concatenate(pieces, 1)[:, back] for pieces in (origin, direction))
        rays = Rays(starts, ways, np.full(n, -1, np.intp))
        if scene.motion is not None:
            rays.time = times
        return rays
