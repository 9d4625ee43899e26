"""Ray queries through Embree (package embreex); spheres stay with NumPy."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..errors import SceneError
from ..vec import Bools, Floats, Ints, cross, dot, f4, length
from . import triangle
from .base import Geometry, Intersections
from .numpy_accel import NumpyAccelerator


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
                'accel="embree" needs embreex, which is not installed: pip install embreex'
            ) from error
        triangles = np.ascontiguousarray(geometry.triangles, f4)
        with np.errstate(all="ignore"):
            ids = np.flatnonzero(triangle.has_area(triangles))
        self._ids = np.append(ids, -1)  # by Embree's number, at the end that of a miss
        self._scene: Any = None
        if ids.size:
            self._scene = EmbreeScene(robust=True)
            TriangleMesh(self._scene, triangles if ids.size == len(triangles) else triangles.take(ids, 0))
            rays = np.zeros((1, 3), f4)
            self._scene.run(rays, rays + f4(1))  # build now, not in the first of many threads
        self._planes = Planes(triangles)
        self._spheres: NumpyAccelerator | None = None
        if geometry.radii.size:
            none = np.zeros((0, 3, 3), f4)
            self._first_sphere = len(triangles)
            self._spheres = NumpyAccelerator(Geometry(none, geometry.centers, geometry.radii))

    def closest(self, origin: Floats, direction: Floats, exclude_prim: Ints) -> Intersections:
        """Find the nearest hit with t > 0 of rays (3, n)."""
        hits = self._closest_triangle(origin, direction, exclude_prim)
        if self._spheres is not None:
            on_sphere = self._spheres.closest(origin, direction, self._sphere_left(exclude_prim))
            nearer = np.flatnonzero(on_sphere.t < hits.t)
            hits.t[nearer] = on_sphere.t.take(nearer)
            hits.prim[nearer] = on_sphere.prim.take(nearer) + self._first_sphere
            hits.b1[nearer] = hits.b2[nearer] = 0
        return hits

    def occluded(self, origin: Floats, direction: Floats, distance: Floats, exclude_prim: Ints) -> Bools:
        """Tell whether anything is hit with 0 < t < `distance` (n,)."""
        blocked = self._occluded_by_triangle(origin, direction, distance, exclude_prim)
        if self._spheres is not None:
            blocked |= self._spheres.occluded(origin, direction, distance, self._sphere_left(exclude_prim))
        return blocked

    def _sphere_left(self, exclude_prim: Ints) -> Ints:
        return np.where(exclude_prim >= self._first_sphere, exclude_prim - self._first_sphere, -1)

    def _closest_triangle(self, origin: Floats, direction: Floats, exclude_prim: Ints) -> Intersections:
        """Nearest triangles of rays (3, n); lanes that met the triangle they leave look again."""
        n = origin.shape[1]
        if self._scene is None or not n:
            zero = np.zeros((2, n), f4)
            return Intersections(np.full(n, np.inf, f4), np.full(n, -1), zero[0], zero[1])
        hits = self._run(origin, direction)
        again = np.flatnonzero(((hits.prim == exclude_prim) | ~(hits.t > 0)) & (hits.prim >= 0))
        if again.size:
            self._look_beyond(origin, direction, exclude_prim, again, hits)
        return hits

    def _run(self, origin: Floats, direction: Floats) -> Intersections:
        """Ask Embree for what rays (3, n) meet first."""
        far = np.full(origin.shape[1], np.inf, f4)
        # it reads columns where they are
        found = self._scene.run(origin.T, direction.T, dists=far, query="INTERSECT", output=1)
        prim, b1, b2 = self._ids.take(found["primID"]), found["u"], found["v"]
        missed = np.flatnonzero(prim < 0)
        b1[missed] = b2[missed] = 0
        return Intersections(found["tfar"], prim, b1, b2)

    def _look_beyond(
        self, origin: Floats, direction: Floats, exclude_prim: Ints, again: Ints, hits: Intersections
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
            found = self._run((start + t * along).astype(f4), along)
            beyond = (t + found.t).astype(f4)
            hits.t[again], hits.prim[again] = beyond, found.prim
            hits.b1[again], hits.b2[again] = found.b1, found.b2
            again = again.compress(
                (found.prim >= 0) & ((found.prim == exclude_prim.take(again)) | ~(beyond > 0))
            )
            step *= 2

    def _occluded_by_triangle(
        self, origin: Floats, direction: Floats, distance: Floats, exclude_prim: Ints
    ) -> Bools:
        if self._scene is None or not distance.size:
            return np.zeros(distance.size, bool)
        # Embree counts a hit at exactly the distance; we do not.
        limit = np.nextafter(distance, f4(0))
        answer = self._scene.run(origin.T, direction.T, dists=limit, query="OCCLUDED")
        blocked = (answer >= 0) & (distance > 0)
        # A blocked lane may have met only the triangle that it leaves.
        lanes = np.flatnonzero(blocked & (exclude_prim >= 0) & (exclude_prim < len(self._planes)))
        rays = origin.take(lanes, 1), direction.take(lanes, 1), exclude_prim.take(lanes)
        doubtful = np.flatnonzero(~self._planes.behind(*rays))
        if doubtful.size:
            lanes = lanes.take(doubtful)
            rays = origin.take(lanes, 1), direction.take(lanes, 1), exclude_prim.take(lanes)
            blocked[lanes] = self._closest_triangle(*rays).t < distance.take(lanes)
        return blocked


class Planes:
    """The planes of triangles (m, 3, 3), to tell which rays surely do not meet the triangle that they leave.

    Embree takes t from v·N and d·N in float32, where v goes from the origin to a corner and N is the
    cross product of two edges, differences of such v. With E the extent of the triangle along each axis,
    all of these are within E. In half ulps, edges are off by 3, products of two by 7 and a component of N by
    16 of E·E; each term of v·N and d·N besides by 5. The bounds here are twice that.
    """

    def __init__(self, triangles: Floats) -> None:
        corners = np.ascontiguousarray(triangles.transpose(1, 2, 0), np.float64)
        a, b, c = corners
        x, y, z = extent = np.ptp(corners, axis=0)
        with np.errstate(all="ignore"):
            normal = cross(b - a, c - a)
            size = length(normal)
            normal /= size
            error = 2 * triangle.ROUNDOFF * (5 * np.abs(normal) + 16 * np.stack([y * z, z * x, x * y]) / size)
        self._rows = np.stack([*normal, dot(normal, a), dot(error, extent), error.sum(0)])

    def __len__(self) -> int:
        """Return the number of triangles."""
        return self._rows.shape[1]

    def behind(self, origin: Floats, direction: Floats, exclude_prim: Ints) -> Bools:
        """Tell of which rays (3, n) the triangle that they leave (n,) is surely behind."""
        nx, ny, nz, offset, unsure, grazing = self._rows.take(exclude_prim, 1)
        height = nx * origin[0] + ny * origin[1] + nz * origin[2] - offset
        rise = nx * direction[0] + ny * direction[1] + nz * direction[2]
        grazing *= np.abs(direction).max(0)
        return (height * rise > 0) & (np.abs(height) > unsure) & (np.abs(rise) > grazing)
