"""Emitting triangles: every mesh with an emission becomes a set of these."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from ..record import record
from ..sampling.warp import uniform_triangle
from ..vec import Floats, cross, dot, f4
from .base import LEAST_SQUARE, Light, LightSample, area_pdf, facing_area


@record
class TriangleLights(Light):
    """k triangles that emit from their front side, sampled uniformly by area."""

    corner: Floats  # (3, k) first vertex, scene units
    edge1: Floats  # (3, k) to the second vertex
    edge2: Floats  # (3, k) to the third vertex
    normal: Floats  # (3, k) unit normal of the front side
    area: Floats  # (k,) squared scene units
    radiance: Floats  # (3, k) W·sr⁻¹·m⁻²; of one that does not shine evenly, its mean

    sides: ClassVar[int] = 1  # that shine

    @classmethod
    def from_triangles(cls, triangles: NDArray[np.float64], radiance: Floats) -> TriangleLights:
        """Build from vertices (k, 3, 3), relative to the scene's center, and radiance (3, k) or (3, 1)."""
        edge1 = (triangles[:, 1] - triangles[:, 0]).T
        edge2 = (triangles[:, 2] - triangles[:, 0]).T
        normal = np.cross(edge1, edge2, axis=0)
        twice = np.linalg.norm(normal, axis=0)
        corner, u, v, n = (
            np.ascontiguousarray(rows, f4) for rows in (triangles[:, 0].T, edge1, edge2, normal / twice)
        )
        each = np.broadcast_to(radiance, (3, len(triangles))).astype(f4)
        return cls(corner, u, v, n, (twice / 2).astype(f4), each)

    def sample_li(self, point: Floats, u: Floats) -> LightSample:
        """Pick a point uniformly by area; its density in solid angle is d²/(A·cosθ)."""
        b = self.weights(u)
        wi = self.edge1 * b[0]
        wi += self.edge2 * b[1]
        wi += self.corner
        wi -= point
        d2 = dot(wi, wi)
        distance = np.sqrt(d2 + LEAST_SQUARE)
        wi /= distance
        cos_light = self._cosine(wi)
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
        p = cross(wi, self.edge2)
        det = dot(self.edge1, p)
        cos_light = self._cosine(wi)
        lit = (cos_light > 0) & (det != 0)
        inverse = f4(1) / np.where(lit, det, f4(1))
        away = point - self.corner
        b1 = dot(away, p) * inverse
        q = cross(away, self.edge1)
        b2 = dot(wi, q) * inverse
        t = dot(self.edge2, q) * inverse
        meets = lit & (t > 0) & (b1 >= 0) & (b2 >= 0) & (b1 + b2 <= 1)
        t = np.where(meets, t, f4(0))  # elsewhere its square may be beyond float32
        return t * t / (np.where(meets, cos_light, f4(1)) * self.area)

    def le(self, wi: Floats) -> Floats:
        """Return the radiance on rays that come upon a side that shines, (3, n)."""
        return self.radiance * (self._cosine(wi) > 0)

    def power(self, scene_radius: float) -> NDArray[np.float64]:
        """π·A·L for each side."""
        return self.sides * np.pi * self.area * self.radiance.mean(0, dtype=np.float64)

    def irradiance(
        self, center: NDArray[np.float64], radius: float, scene_radius: float
    ) -> NDArray[np.float64]:
        """L·A·cosθ/d² of a small area at the middle; (c, k)."""
        middle = self.corner + (self.edge1 + self.edge2) / 3
        strength = self.area * self.radiance.mean(0, dtype=np.float64)
        return facing_area(center, radius, middle, self.normal, np.sqrt(self.area), strength, self.sides)

    def _cosine(self, wi: Floats) -> Floats:
        """Cosine (n,) of rays along wi against the normal, above 0 on sides that shine."""
        return -dot(self.normal, wi)


@record
class TwoSidedTriangleLights(TriangleLights):
    """k triangles that emit from both sides."""

    sides: ClassVar[int] = 2

    def _cosine(self, wi: Floats) -> Floats:
        return np.abs(dot(self.normal, wi))
