"""Instances: meshes that are in a scene several times, and in its arrays once."""

from __future__ import annotations

from typing import Self

import numpy as np

from ..accel import Intersections
from ..arrays.state import Hits, Rays
from ..arrays.vec import ALL, Floats, Ints, Lanes, f4, length, normalize, put, take
from ..compile.instances import InstanceTable, times
from ..compile.program import Facts, Feature
from ..compile.scene import CompiledScene
from ..stages.interaction import POINT_ERROR, Surfaces


class InstancedSurfaces(Surfaces):
    """Surfaces some of which are in the arrays in coordinates of their own."""

    __slots__ = ()

    def __init__(self, scene: CompiledScene, rays: Rays, hits: Hits) -> None:
        super().__init__(scene, rays, hits)
        self.column = hits.instance

    @classmethod
    def hits_of(cls, scene: CompiledScene, intersections: Intersections) -> Hits:
        """Return hits with the columns of their instances."""
        hits = super().hits_of(scene, intersections)
        assert scene.instances is not None
        hits.prim, hits.instance = scene.instances.locate(intersections.prim)
        return hits

    @classmethod
    def material_rows(cls, scene: CompiledScene, hits: Hits, lanes: Lanes) -> Ints:
        """Return the rows (k,) of materials, of which instances may have their own."""
        rows = super().material_rows(scene, hits, lanes)
        assert scene.instances is not None
        if scene.instances.material is None or hits.instance is None:
            return rows
        replaced = scene.instances.material.take(take(hits.instance, lanes))
        return np.where(replaced >= 0, replaced, rows)

    def prims(self) -> Ints:
        """Return primitive ids, which differ between instances."""
        prim = super().prims()
        return prim if self.column is None else prim + self._table.shift.take(self.column)

    @property
    def _table(self) -> InstanceTable:
        assert self.scene.instances is not None
        return self.scene.instances

    def placed_lanes(self) -> Lanes:
        """Return the lanes (k,) that may have transforms."""
        return ALL

    def normal_matrices(self, lanes: Lanes) -> Floats:
        """Return the matrices (9, k) of normals to the scene, of some lanes."""
        assert self.column is not None
        return self._table.normal.take(take(self.column, lanes), 1)

    def normals_there(self, normals: Floats, lanes: Lanes) -> Floats:
        """Return normals (3, k) of some lanes in the scene; not of unit length."""
        return times(self.normal_matrices(lanes), normals)

    def vector_matrices(self) -> Floats:
        """Return the matrices (9, n) of vectors to the scene."""
        assert self.column is not None
        return self._table.linear.take(self.column, 1)

    def normals(self, point: Floats, error: Floats) -> tuple[Floats, Floats]:
        """Transform unit normals of meshes to the scene, and enlarge the errors (n,) of hit points.

        The ray of an instance was rounded once more, in the mesh's coordinates: its direction, and its
        origin, whose distance there is at most t and the mesh's radius together. Division by the length of
        the transformed normal converts a length along the normal from these coordinates to the scene.
        """
        ng, error = super().normals(point, error)
        if self.column is None:
            return ng, error
        lanes = self.placed_lanes()
        there = self.normals_there(take(ng, lanes), lanes)
        size = length(there)
        size = np.where(size > 0, size, f4(1))
        more = (
            POINT_ERROR
            * (self._table.radius.take(take(self.column, lanes)) + take(self.hits.t, lanes))
            / size
        )
        if isinstance(lanes, slice):
            return there / size, error + more
        put(ng, lanes, there / size)
        error[lanes] += more
        return ng, error

    def corner_normals(self, corners: list[Floats]) -> list[Floats]:
        """Transform normals of vertices, and normalize each as in a mesh of its own.

        A skewed transform changes their lengths.
        """
        if self.column is None:
            return corners
        corners, matrices = super().corner_normals(corners), self.normal_matrices(ALL)
        return [normalize(times(matrices, corner)) for corner in corners]

    def vectors(self, values: Floats) -> Floats:
        """Transform vectors along surfaces (3·k, n), k for each, to the scene."""
        if self.column is None:
            return values
        matrices = self.vector_matrices()
        return np.concatenate([times(matrices, values[i : i + 3]) for i in range(0, len(values), 3)])


class Instances(Feature):
    """Places meshes in the scene that are stored once."""

    surfaces = InstancedSurfaces

    @classmethod
    def of(cls, facts: Facts) -> Self | None:
        """Return the feature of a scene with instances that share their arrays."""
        return None if facts.compiled.instances is None else cls()
