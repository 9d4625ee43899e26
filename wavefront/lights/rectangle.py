"""Emitting rectangles: pairs of triangles that make one are sampled as a whole."""

from __future__ import annotations

from collections.abc import Iterator
from typing import ClassVar, Self

import numpy as np

from ..arrays.soa import soa
from ..arrays.vec import Doubles, Floats, Ints, dot, f4, put, take
from ..sampling.spherical import SphericalRectangle
from ..sampling.warp import linear_pdf, linear_with_density
from ..shapes.fans import are_fans, disjoint_pairs
from .base import LightSample
from .planar import LEAST_SQUARE, PlanarLights, TwoSided, area_pdf

NEAR = f4(1)  # squared distance, in areas, within which solid angle is sampled
ROOT_NEAR = np.sqrt(NEAR)
HIGH = f4(0.25)  # height, in widths, from which float32 is enough for solid angles
HALF = f4(0.5)
ON = f4(1e-5)  # height, in widths, of points on the rectangle itself
SQUARE = 1e-6  # how far, relative to its sides, a pair of triangles may be from a rectangle


@soa
class RectangleLights(PlanarLights):
    """k rectangles, with perpendicular edges, that emit from their front side."""

    parallelograms: ClassVar[float] = 1
    middle: ClassVar[int] = 2

    @classmethod
    def from_pairs(cls, triangles: Doubles, radiance: Floats) -> Self:
        """Build from the first triangle of each pair, (k, 3, 3), and radiance (3, k) or (3, 1).

        The corners of a pair are p, p + u, p + u + v and p, p + u + v, p + v.
        """
        a, b, c = triangles.transpose(1, 2, 0)
        return cls.from_edges(a, b - a, c - b, radiance)

    def sample_li(self, point: Floats, u: Floats) -> LightSample:
        """Draw a point by area, or from nearby a direction in solid angle.

        The density is uniform, or for surfaces one that is linear along both edges.
        """
        wi = self._middle() - point
        slope = self._slopes(wi)
        p, over_area = (u, None) if slope is None else linear_with_density(u, slope)
        wi += self.edge_u * (p[0] - HALF)
        wi += self.edge_v * (p[1] - HALF)
        height = self._facing(self._rise(point))
        pdfs = []
        for lanes, seen, warp in self._near(point, height):
            numbers, density = u.take(lanes, 1), seen.pdf()
            if warp is not None:
                numbers, over_square = linear_with_density(numbers, warp)
                density *= over_square
            pdfs.append((lanes, density))
            put(wi, lanes, seen.sample(numbers))
        d2 = dot(wi, wi)
        distance = np.sqrt(d2 + LEAST_SQUARE)
        wi /= distance
        cos_light = height / distance
        pdf = area_pdf(d2, cos_light, self.area)
        if over_area is not None:
            pdf *= over_area
        for lanes, density in pdfs:
            pdf[lanes] = density
        return LightSample(wi, np.broadcast_to(self.radiance, wi.shape), pdf, distance, cos_light)

    def pdf_li(self, point: Floats, wi: Floats) -> Floats:
        """Return the density of `sample_li` where the ray meets a side that shines."""
        rise, fall = self._rise(point), -dot(self.normal, wi)
        cos_light = self._facing(fall)
        t = rise / np.where(cos_light > 0, fall, f4(1))
        away = self._middle() - point
        on_plane = wi * t - away
        p = np.stack([dot(on_plane, edge) / dot(edge, edge) for edge in (self.edge_u, self.edge_v)]) + HALF
        meets = (cos_light > 0) & (t > 0) & ((p >= 0) & (p <= 1)).all(0)
        pdf = area_pdf(t * t, cos_light, self.area)
        slope = self._slopes(away)
        if slope is not None:
            pdf *= linear_pdf(p.clip(f4(0), f4(1)), slope)
        for lanes, seen, warp in self._near(point, np.where(meets, self._facing(rise), f4(0)), np.inf):
            pdf[lanes] = seen.pdf()
            if warp is not None:
                pdf[lanes] *= linear_pdf(seen.inverse(wi.take(lanes, 1)), warp)
        return np.where(meets, pdf, f4(0))

    def _rise(self, point: Floats) -> Floats:
        """Height (n,) of points over the front."""
        return dot(self.normal, point) - dot(self.normal, self.corner)

    def _near(
        self, point: Floats, height: Floats, high: float | np.floating = HIGH
    ) -> Iterator[tuple[Ints, SphericalRectangle, Floats | None]]:
        """Yield lanes of points that get light and are close to the middle, for the rectangle's size.

        With them come the rectangles as seen from there, and the slopes of densities. From afar both
        densities are alike, and sampling the area costs less. Points on the rectangle itself are none of
        these. Above the height `high`, in widths, float32 is used, which takes less time for many points.
        """
        width = np.sqrt(self.area)
        low = np.flatnonzero((height > ON * width) & (height < ROOT_NEAR * width))
        if not low.size:
            return
        lights = self._at(low)
        away = lights._middle() - point.take(low, 1)
        near = low.compress(dot(away, away) < NEAR * lights.area)
        above = height.take(near) > f4(high) * (width if width.size == 1 else width.take(near))
        for lanes, dtype in ((near.compress(above), np.float32), (near.compress(~above), np.float64)):
            if lanes.size:
                yield lanes, *self._seen(take(point, lanes), lanes, dtype)

    def _at(self, lanes: Ints) -> Self:
        """Return the rectangles of some lanes."""
        return self if len(self) == 1 else self.take(lanes)

    def _seen(
        self, point: Floats, lanes: Ints, dtype: type[np.floating]
    ) -> tuple[SphericalRectangle, Floats | None]:
        """Return rectangles as seen from the points (3, k) of some lanes, and the slopes of densities."""
        lights = self._at(lanes)
        if self.receiver is not None:
            lights = lights.lighting(self.receiver if len(self.receiver) == 1 else self.receiver.take(lanes))
        seen = SphericalRectangle.of(lights.corner - point, lights.edge_u, lights.edge_v, dtype)
        return seen, lights._slopes(lights._middle() - point, near=True)


@soa
class TwoSidedRectangleLights(TwoSided, RectangleLights):
    """k rectangles that emit from both sides."""


def first_of_pairs(triangles: Doubles, mesh_of: Ints) -> Ints:
    """Find consecutive triangles (m, 3, 3) that make a rectangle: indices (k,) of the first of each.

    `mesh_of` (m,) numbers their meshes; both must be of the same.
    """
    a, b, c = (triangles[:-1, i] for i in range(3))
    d = triangles[1:, 2]
    u, v = b - a, c - b
    size_u, size_v = np.linalg.norm(u, axis=1), np.linalg.norm(v, axis=1)
    closes = np.linalg.norm(d - a - v, axis=1) <= SQUARE * (size_u + size_v)
    square = np.abs((u * v).sum(1)) <= SQUARE * size_u * size_v
    same_mesh = mesh_of[:-1] == mesh_of[1:]
    rectangles = same_mesh & are_fans(triangles) & closes & square & (size_u > 0) & (size_v > 0)
    return disjoint_pairs(np.flatnonzero(rectangles))
