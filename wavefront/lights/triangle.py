"""Emitting triangles: every mesh with an emission becomes a set of these."""

from __future__ import annotations

from typing import ClassVar, Self

import numpy as np

from ..arrays.soa import soa
from ..arrays.vec import Doubles, Floats, cross, dot, f4
from ..sampling.warp import linear_pdf, linear_with_density, uniform_triangle, uniform_triangle_inverse
from .base import LightSample
from .planar import LEAST_SQUARE, PlanarLights, TwoSided, area_pdf

MIDDLE = f4(0.375)  # part of both edges: between the middles of opposite sides of the square of u
FEW = 128  # triangles at most that are sampled for surfaces; of more, each is small


@soa
class TriangleLights(PlanarLights):
    """k triangles that emit from their front side, sampled by area."""

    parallelograms: ClassVar[float] = 0.5
    middle: ClassVar[int] = 3

    @classmethod
    def from_triangles(cls, triangles: Doubles, radiance: Floats) -> Self:
        """Build from vertices (k, 3, 3), relative to the scene's center, and radiance (3, k) or (3, 1)."""
        a, b, c = triangles.transpose(1, 2, 0)
        lights = cls.from_edges(a, b - a, c - a, radiance)
        lights.few = len(triangles) <= FEW
        return lights

    def sample_li(self, point: Floats, u: Floats) -> LightSample:
        """Pick a point uniformly by area, density d²/(A·cosθ), or for a surface by its irradiance."""
        return self._sample_at(point, u)[0]

    def _sample_at(self, point: Floats, u: Floats) -> tuple[LightSample, Floats]:
        """Return samples, and the barycentric weights b1, b2 (2, n) of their points."""
        wi = self.corner - point
        slope = self._slopes(wi + MIDDLE * (self.edge_u + self.edge_v))
        p, over_square = (u, None) if slope is None else linear_with_density(u, slope)
        b = uniform_triangle(p)
        wi += self.edge_u * b[0]
        wi += self.edge_v * b[1]
        d2 = dot(wi, wi)
        distance = np.sqrt(d2 + LEAST_SQUARE)
        wi /= distance
        cos_light = self._facing(-dot(self.normal, wi))
        pdf = area_pdf(d2, cos_light, self.area)
        if over_square is not None:
            pdf *= over_square
        radiance = np.broadcast_to(self.radiance, wi.shape)
        return LightSample(wi, radiance, pdf, distance, cos_light), b

    def pdf_li(self, point: Floats, wi: Floats) -> Floats:
        """Return the density of `sample_li` where the ray meets a side that shines.

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
        pdf = t * t / (np.where(meets, cos_light, f4(1)) * self.area)
        slope = self._slopes(MIDDLE * (self.edge_u + self.edge_v) - away)
        if slope is None:
            return pdf
        b = np.where(meets, np.stack([b1, b2]), f4(0))
        return pdf * linear_pdf(uniform_triangle_inverse(b), slope)

    def _across(self) -> tuple[Floats, Floats]:
        """Return the ways across; `uniform_triangle` moves the middles of the far sides."""
        u, v = self.edge_u, self.edge_v
        return f4(0.75) * u - f4(0.25) * v, f4(0.75) * v - f4(0.25) * u


@soa
class TwoSidedTriangleLights(TwoSided, TriangleLights):
    """k triangles that emit from both sides."""
