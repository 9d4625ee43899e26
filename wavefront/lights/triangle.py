"""Emitting triangles: every mesh with an emission becomes a set of these."""

from __future__ import annotations

from typing import ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from ..arrays.soa import soa
from ..arrays.vec import Floats, cross, dot, f4
from ..sampling.warp import uniform_triangle
from .base import LightSample
from .planar import LEAST_SQUARE, PlanarLights, TwoSided, area_pdf


@soa
class TriangleLights(PlanarLights):
    """k triangles that emit from their front side, sampled uniformly by area."""

    parallelograms: ClassVar[float] = 0.5
    middle: ClassVar[int] = 3

    @classmethod
    def from_triangles(cls, triangles: NDArray[np.float64], radiance: Floats) -> Self:
        """Build from vertices (k, 3, 3), relative to the scene's center, and radiance (3, k) or (3, 1)."""
        a, b, c = triangles.transpose(1, 2, 0)
        return cls.from_edges(a, b - a, c - a, radiance)

    def sample_li(self, point: Floats, u: Floats) -> LightSample:
        """Pick a point uniformly by area; its density in solid angle is d²/(A·cosθ)."""
        return self._sample_at(point, self.weights(u))

    def _sample_at(self, point: Floats, b: Floats) -> LightSample:
        """Sample the points with barycentric weights b1, b2 (2, n)."""
        wi = self.edge_u * b[0]
        wi += self.edge_v * b[1]
        wi += self.corner
        wi -= point
        d2 = dot(wi, wi)
        distance = np.sqrt(d2 + LEAST_SQUARE)
        wi /= distance
        cos_light = self._facing(-dot(self.normal, wi))
        pdf = area_pdf(d2, cos_light, self.area)
        radiance = np.broadcast_to(self.radiance, wi.shape)
        return LightSample(wi, radiance, pdf, distance, cos_light)

    @staticmethod
    def weights(u: Floats) -> Floats:
        """Barycentric weights b1, b2 (2, n) of the points that `sample_li` picks with u (2, n)."""
        return uniform_triangle(u)

    def pdf_li(self, point: Floats, wi: Floats) -> Floats:
        """Return d²/(A·cosθ) where the ray meets a side that shines.

        The hit test is Möller and Trumbore 1997, "Fast, Minimum Storage Ray/Triangle Intersection".
        """
        p = cross(wi, self.edge_v)
        det = dot(self.edge_u, p)
        cos_light = self._facing(-dot(self.normal, wi))
        lit = (cos_light > 0) & (det != 0)
        inverse = f4(1) / np.where(lit, det, f4(1))
        away = point - self.corner
        b1 = dot(away, p) * inverse
        q = cross(away, self.edge_u)
        b2 = dot(wi, q) * inverse
        t = dot(self.edge_v, q) * inverse
        meets = lit & (t > 0) & (b1 >= 0) & (b2 >= 0) & (b1 + b2 <= 1)
        t = np.where(meets, t, f4(0))  # elsewhere its square may be beyond float32
        return t * t / (np.where(meets, cos_light, f4(1)) * self.area)


@soa
class TwoSidedTriangleLights(TwoSided, TriangleLights):
    """k triangles that emit from both sides."""
