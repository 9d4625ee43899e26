"""Ray queries by Embree (package embreex); curved primitives are traced by NumPy."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..arrays.vec import ALL, Bools, Doubles, Floats, Ints, Lanes, cross, dot, f4, length, take
from ..core.errors import SceneError
from . import triangle
from .balls import bounding_balls
from .base import Geometry, Intersections
from .coplanar import Overlaps, find_overlaps
from .duplicates import that_can_be_hit
from .numpy_accel import NumpyAccelerator


def installed() -> bool:
    """Return whether embreex can be imported."""
    try:
        import embreex.rtcore_scene  # noqa: F401
    except ImportError:
        return False
    return True


LEAST_REACH = 2.0**-20  # scale of a step, for rays from the origin that hit there


class EmbreeAccelerator:
    """Triangles by Embree, curved primitives by NumPy; see base.Accelerator.

    Of triangles with the same corners Embree knows the first alone. Where others that overlap in a plane are
    hit, Embree finds any of them, and NumPy then the first.
    """

    name = "embree"

    def __init__(self, geometry: Geometry) -> None:
        try:
            from embreex.mesh_construction import TriangleMesh
            from embreex.rtcore_scene import EmbreeScene
        except ImportError as error:
            raise SceneError(
                'accel="embree" needs embreex, which is not installed: pip install embreex'
            ) from error
        self._geometry = geometry
        triangles = np.ascontiguousarray(geometry.triangles, f4)
        with np.errstate(all="ignore"):
            # Embree returns any of several triangles at the same distance
            ids = that_can_be_hit(triangles)
        self._ids = np.append(ids, -1)  # (k + 1,) ids by Embree's primitive; the last one is for misses
        self._scene: Any = None
        self._overlapping: OverlappingFaces | None = None
        if ids.size:
            self._scene = EmbreeScene(robust=True)
            TriangleMesh(self._scene, triangles if ids.size == len(triangles) else triangles.take(ids, 0))
            rays = np.zeros((1, 3), f4)
            self._scene.run(rays, rays + f4(1))  # build now, not in the first of many threads
            self._planes = TrianglePlanes(triangles)
            overlaps = find_overlaps(triangles, ids, self._planes.plane)
            self._overlapping = None if overlaps is None else OverlappingFaces(geometry, overlaps)
        self._curved: NumpyAccelerator | None = None
        if any(map(len, geometry.curved)):
            self._first_curved = len(triangles)
            self._curved = NumpyAccelerator(Geometry(np.zeros((0, 3, 3), f4), geometry.curved))
            self._balls = bounding_balls(geometry.curved)

    def __reduce__(self) -> tuple[type[EmbreeAccelerator], tuple[Geometry]]:
        """Pickle the geometry: Embree's own memory cannot be pickled."""
        return EmbreeAccelerator, (self._geometry,)

    def closest(self, origin: Floats, direction: Floats, exclude_prim: Ints) -> Intersections:
        """Return the nearest hits with t > 0 of rays (3, n)."""
        hits = self._closest_triangle(origin, direction, exclude_prim)
        if self._overlapping is not None:
            self._overlapping.find_first(origin, direction, exclude_prim, hits)
        if self._curved is not None:
            rays, lanes = self._near_curved(origin, direction, exclude_prim)
            on_curved = self._curved.closest(*rays)
            closer = np.flatnonzero(on_curved.t < take(hits.t, lanes))
            nearer = closer if isinstance(lanes, slice) else lanes.take(closer)
            hits.t[nearer] = on_curved.t.take(closer)
            hits.prim[nearer] = on_curved.prim.take(closer) + self._first_curved
            hits.b1[nearer] = hits.b2[nearer] = 0
        return hits

    def occluded(self, origin: Floats, direction: Floats, distance: Floats, exclude_prim: Ints) -> Bools:
        """Return a mask (n,): which rays hit anything at 0 < t < `distance` (n,)."""
        blocked = self._occluded_by_triangle(origin, direction, distance, exclude_prim)
        if self._curved is not None:
            (start, along, left), lanes = self._near_curved(origin, direction, exclude_prim)
            blocked[lanes] |= self._curved.occluded(start, along, take(distance, lanes), left)
        return blocked

    def _near_curved(
        self, origin: Floats, direction: Floats, exclude_prim: Ints
    ) -> tuple[tuple[Floats, Floats, Ints], Lanes]:
        """Return the rays, of n, that may hit curved primitives, and their lanes."""
        left = np.where(exclude_prim >= self._first_curved, exclude_prim - self._first_curved, -1)
        lanes = ALL if self._balls is None else self._balls.near(origin, direction, left)
        return (take(origin, lanes), take(direction, lanes), take(left, lanes)), lanes

    def _closest_triangle(self, origin: Floats, direction: Floats, exclude_prim: Ints) -> Intersections:
        """Return the nearest hits of triangles; rays that hit their excluded triangle are traced again."""
        n = origin.shape[1]
        if self._scene is None or not n:
            zero = np.zeros((2, n), f4)
            return Intersections(np.full(n, np.inf, f4), np.full(n, -1), zero[0], zero[1])
        hits = self._run(origin, direction)
        repeat = np.flatnonzero(((hits.prim == exclude_prim) | ~(hits.t > 0)) & (hits.prim >= 0))
        if repeat.size:
            self._trace_beyond(origin, direction, exclude_prim, repeat, hits)
        return hits

    def _run(self, origin: Floats, direction: Floats) -> Intersections:
        """Return Embree's nearest hits of rays (3, n)."""
        far = np.full(origin.shape[1], np.inf, f4)
        # Embree reads the transposed views without a copy.
        hits = self._scene.run(origin.T, direction.T, dists=far, query="INTERSECT", output=1)
        prim, b1, b2 = self._ids.take(hits["primID"]), hits["u"], hits["v"]
        missed = np.flatnonzero(prim < 0)
        b1[missed] = b2[missed] = 0
        return Intersections(hits["tfar"], prim, b1, b2)

    def _trace_beyond(
        self, origin: Floats, direction: Floats, exclude_prim: Ints, repeat: Ints, hits: Intersections
    ) -> None:
        """Trace lanes `repeat` again from just beyond their invalid hits, until all hits are valid.

        embreex cannot exclude a primitive. The step is a few roundings of the origin at first, and doubles
        each time.
        """
        step = 4 * triangle.ROUNDOFF
        while repeat.size:
            start, along = origin.take(repeat, 1).astype(np.float64), direction.take(repeat, 1)
            size = np.abs(start).max(0) / np.abs(along).max(0)
            t = hits.t.take(repeat).astype(np.float64)
            reach = size + t
            reach[reach == 0] = LEAST_REACH
            t += step * reach
            next_hits = self._run((start + t * along).astype(f4), along)
            beyond = (t + next_hits.t).astype(f4)
            hits.t[repeat], hits.prim[repeat] = beyond, next_hits.prim
            hits.b1[repeat], hits.b2[repeat] = next_hits.b1, next_hits.b2
            repeat = repeat.compress(
                (next_hits.prim >= 0) & ((next_hits.prim == exclude_prim.take(repeat)) | ~(beyond > 0))
            )
            step *= 2

    def _occluded_by_triangle(
        self, origin: Floats, direction: Floats, distance: Floats, exclude_prim: Ints
    ) -> Bools:
        if self._scene is None or not distance.size:
            return np.zeros(distance.size, bool)
        # Embree includes a hit at exactly the distance; `occluded` does not.
        limit = np.nextafter(distance, f4(0))
        answer = self._scene.run(origin.T, direction.T, dists=limit, query="OCCLUDED")
        blocked = (answer >= 0) & (distance > 0)
        # A lane may be blocked only by its excluded triangle.
        lanes = np.flatnonzero(blocked & (exclude_prim >= 0) & (exclude_prim < len(self._planes)))
        rays = origin.take(lanes, 1), direction.take(lanes, 1), exclude_prim.take(lanes)
        uncertain = np.flatnonzero(~self._planes.certainly_missed(*rays))
        if uncertain.size:
            lanes = lanes.take(uncertain)
            rays = origin.take(lanes, 1), direction.take(lanes, 1), exclude_prim.take(lanes)
            blocked[lanes] = self._closest_triangle(*rays).t < distance.take(lanes)
        return blocked


class OverlappingFaces:
    """Faces of a scene that overlap in a plane: of those at the same distance the first is to be hit."""

    def __init__(self, geometry: Geometry, overlaps: Overlaps) -> None:
        self._face, self._group = overlaps.face, overlaps.group
        self._number = np.full(geometry.count + 1, -1)  # place of each primitive in `face`; -1 is a miss, too
        self._number[overlaps.face] = np.arange(overlaps.face.size)
        self._open = np.zeros(geometry.count + 1, np.bool_)
        self._open[overlaps.face] = overlaps.open
        faces = geometry.triangles.take(overlaps.face, 0)
        self._accelerator = NumpyAccelerator(Geometry(faces, weights=geometry.weights))

    def find_first(self, origin: Floats, direction: Floats, exclude_prim: Ints, hits: Intersections) -> None:
        """Replace hits of rays (3, n) by those of earlier faces that overlap the faces hit."""
        lanes = np.flatnonzero(self._open.take(hits.prim))
        if not lanes.size:
            return
        excluded = self._number.take(exclude_prim.take(lanes))
        first_hits = self._accelerator.closest(origin.take(lanes, 1), direction.take(lanes, 1), excluded)
        group = self._group.take(self._number.take(hits.prim.take(lanes)))
        # NumPy may miss all of them at an edge, and find something behind
        same = np.flatnonzero((first_hits.prim >= 0) & (self._group.take(first_hits.prim) == group))
        lanes = lanes.take(same)
        hits.t[lanes], hits.prim[lanes] = first_hits.t.take(same), self._face.take(first_hits.prim.take(same))
        hits.b1[lanes], hits.b2[lanes] = first_hits.b1.take(same), first_hits.b2.take(same)


class TrianglePlanes:
    """The planes of triangles (m, 3, 3), to find rays that certainly miss their excluded triangle.

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

    @property
    def plane(self) -> Doubles:
        """The unit normals and offsets, (4, m)."""
        return self._rows[:4]

    def certainly_missed(self, origin: Floats, direction: Floats, exclude_prim: Ints) -> Bools:
        """Return a mask of the rays (3, n) whose excluded triangle (n,) is certainly behind them."""
        nx, ny, nz, offset, height_error, rise_error = self._rows.take(exclude_prim, 1)
        height = nx * origin[0] + ny * origin[1] + nz * origin[2] - offset
        rise = nx * direction[0] + ny * direction[1] + nz * direction[2]
        rise_error *= np.abs(direction).max(0)
        return (height * rise > 0) & (np.abs(height) > height_error) & (np.abs(rise) > rise_error)
