"""Data that are interpolated over triangles or computed on curved shapes: normals, and attributes."""

from __future__ import annotations

from typing import Self

import numpy as np

from ..accel import Intersections
from ..arrays.state import Hits
from ..arrays.vec import Floats, dot, normalize
from ..compile.program import Facts, Feature
from ..compile.scene import CompiledScene
from ..stages.interaction import Surfaces, at_corners, face_viewer, interpolated


class InterpolatedSurfaces(Surfaces):
    """Surfaces of triangles that need the barycentric weights of hits."""

    __slots__ = ()

    @classmethod
    def hits_of(cls, scene: CompiledScene, intersections: Intersections) -> Hits:
        """Return hits with their barycentric weights."""
        hits = super().hits_of(scene, intersections)
        hits.b1, hits.b2 = intersections.b1, intersections.b2
        return hits


class Interpolation(Feature):
    """Keeps where on triangles hits are."""

    surfaces = InterpolatedSurfaces

    @classmethod
    def of(cls, facts: Facts) -> Self | None:
        """Return the feature of a scene where anything is interpolated over triangles."""
        return cls() if facts.compiled.interpolates else None


class SmoothSurfaces(Surfaces):
    """Surfaces whose shading normals may differ from those of the surface."""

    __slots__ = ()

    def shading_normals(self, ng: Floats, front: Floats, side: Floats, point: Floats) -> Floats:
        """Return those that are interpolated on triangles, or computed on curved primitives."""
        scene, hits = self.scene, self.hits
        ns = self._interpolated(ng)
        curved = np.flatnonzero(hits.prim >= scene.triangles)
        if scene.curved.shading_normals and curved.size:
            ns[:, curved] = self.curved_normals(curved, point, ng)
        return face_viewer(-self.rays.direction, ns * side)

    def _interpolated(self, ng: Floats) -> Floats:
        """Return the interpolated vertex normals, (3, n), and `ng` where there are none."""
        scene, hits = self.scene, self.hits
        if scene.corner_normals is None:
            return ng.copy()
        ns = normalize(
            interpolated(self.corner_normals(at_corners(scene.corner_normals, hits, scene.triangles)), hits)
        )
        flat = (hits.prim >= scene.triangles) | ~(dot(ns, ng) > 0)
        np.copyto(ns, ng, where=flat)
        return ns


class SmoothNormals(Feature):
    """Shades surfaces as if their normals were those of their vertices."""

    surfaces = SmoothSurfaces

    @classmethod
    def of(cls, facts: Facts) -> Self | None:
        """Return the feature of a scene with normals at vertices, or with curves that have some."""
        return cls() if facts.compiled.shading_normals else None
