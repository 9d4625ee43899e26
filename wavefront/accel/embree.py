"""Ray queries through Embree (the extra `wavefront[embree]`); spheres stay with NumPy."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..errors import SceneError
from ..vec import Bools, Floats, Ints, f4
from . import triangle
from .base import Geometry, Intersections
from .stream import NumpyAccelerator


def installed() -> bool:
    """Tell whether embreex can be imported."""
    try:
        import embreex.rtcore_scene  # noqa: F401
    except ImportError:
        return False
    return True


class EmbreeAccelerator:
    """Triangles through Embree, spheres through NumPy; see base.Accelerator."""

    name = "embree"

    def __init__(self, geometry: Geometry) -> None:
        try:
            from embreex.mesh_construction import TriangleMesh
            from embreex.rtcore_scene import EmbreeScene
        except ImportError as error:
            raise SceneError(
                'accel="embree" needs embreex, which is not installed: pip install wavefront[embree]'
            ) from error
        triangles = np.ascontiguousarray(geometry.triangles, f4)
        with np.errstate(all="ignore"):
            self._ids = np.flatnonzero(triangle.has_area(triangles))
        self._scene: Any = None
        if self._ids.size:
            self._scene = EmbreeScene(robust=True)
            TriangleMesh(self._scene, triangles.take(self._ids, 0))
            rays = np.zeros((1, 3), f4)
            self._scene.run(rays, rays + f4(1))  # build now, not in the first of many threads
        self._table = triangle.triangle_table(triangles)
        self._spheres: NumpyAccelerator | None = None
        if geometry.radii.size:
            none = np.zeros((0, 3, 3), f4)
            self._first_sphere = len(triangles)
            self._spheres = NumpyAccelerator(Geometry(none, geometry.centers, geometry.radii))

    def closest(self, origin: Floats, direction: Floats, leaving: Ints) -> Intersections:
        """Find the nearest hit with t > 0 of rays (3, n)."""
        hits = self._closest_triangle(origin, direction, leaving)
        if self._spheres is not None:
            on_sphere = self._spheres.closest(origin, direction, self._sphere_left(leaving))
            nearer = np.flatnonzero(on_sphere.t < hits.t)
            hits.t[nearer] = on_sphere.t.take(nearer)
            hits.prim[nearer] = on_sphere.prim.take(nearer) + self._first_sphere
            hits.b1[nearer] = hits.b2[nearer] = 0
        return hits

    def occluded(self, origin: Floats, direction: Floats, distance: Floats, leaving: Ints) -> Bools:
        """Tell whether anything is hit with 0 < t < `distance` (n,)."""
        blocked = self._occluded_by_triangle(origin, direction, distance, leaving)
        if self._spheres is not None:
            blocked |= self._spheres.occluded(origin, direction, distance, self._sphere_left(leaving))
        return blocked

    def _sphere_left(self, leaving: Ints) -> Ints:
        return np.where(leaving >= self._first_sphere, leaving - self._first_sphere, -1)

    def _closest_triangle(self, origin: Floats, direction: Floats, leaving: Ints) -> Intersections:
        """Nearest triangles of rays (3, n); lanes that met the triangle they leave look again."""
        n = origin.shape[1]
        if self._scene is None or not n:
            zero = np.zeros((2, n), f4)
            return Intersections(np.full(n, np.inf, f4), np.full(n, -1), zero[0], zero[1])
        found = self._scene.run(_rows(origin), _rows(direction), query="INTERSECT", output=1)
        missed = found["primID"] < 0
        prim = np.where(missed, -1, self._ids.take(found["primID"], mode="clip"))
        t = np.where(missed, f4(np.inf), found["tfar"])
        hits = Intersections(t, prim, np.where(missed, 0, found["u"]), np.where(missed, 0, found["v"]))
        again = np.flatnonzero(~missed & ((prim == leaving) | ~(t > 0)))
        if again.size:
            self._look_beyond(origin, direction, leaving, again, hits)
        return hits

    def _look_beyond(
        self, origin: Floats, direction: Floats, leaving: Ints, again: Ints, hits: Intersections
    ) -> None:
        """Trace lanes `again` from just beyond the hit that does not count, until none is left.

        Embree cannot leave out a primitive. The step doubles each time, from a few roundings of the
        origin on.
        """
        step = 4 * triangle.ROUNDOFF
        while again.size:
            start, along = origin.take(again, 1).astype(np.float64), direction.take(again, 1)
            size = np.abs(start).max(0) / np.abs(along).max(0)
            t = hits.t.take(again).astype(np.float64)
            t += step * (size + t)
            rays = _rows((start + t * along).astype(f4)), _rows(along)
            found = self._scene.run(*rays, query="INTERSECT", output=1)
            missed = found["primID"] < 0
            prim = np.where(missed, -1, self._ids.take(found["primID"], mode="clip"))
            beyond = np.where(missed, np.inf, t + found["tfar"]).astype(f4)
            hits.t[again], hits.prim[again] = beyond, prim
            hits.b1[again], hits.b2[again] = np.where(missed, 0, found["u"]), np.where(missed, 0, found["v"])
            again = again.compress(~missed & ((prim == leaving.take(again)) | ~(beyond > 0)))
            step *= 2

    def _occluded_by_triangle(
        self, origin: Floats, direction: Floats, distance: Floats, leaving: Ints
    ) -> Bools:
        if self._scene is None or not distance.size:
            return np.zeros(distance.size, bool)
        # Embree counts a hit at exactly the distance; we do not.
        limit = np.nextafter(distance, f4(0))
        answer = self._scene.run(_rows(origin), _rows(direction), dists=limit, query="OCCLUDED")
        blocked = (answer >= 0) & (distance > 0)
        # A blocked lane may have met only the triangle that it leaves.
        doubtful = np.flatnonzero(blocked & (leaving >= 0))
        if doubtful.size:
            rays = origin.take(doubtful, 1), direction.take(doubtful, 1), leaving.take(doubtful)
            blocked[doubtful] = self._closest_triangle(*rays).t < distance.take(doubtful)
        return blocked


def _rows(vectors: Floats) -> Floats:
    """(3, n) columns as the contiguous (n, 3) rows that Embree reads."""
    return np.ascontiguousarray(vectors.T, f4)
