"""The common base of emitting triangles and rectangles."""

from __future__ import annotations

from dataclasses import field, replace
from typing import ClassVar, Self

import numpy as np

from ..arrays.soa import soa
from ..arrays.state import SurfaceInteraction
from ..arrays.vec import TINY, Doubles, Floats, dot, f4, positive
from .base import Emitters, LightRecord, Receiver

LEAST_SQUARE = f4(1e-35)  # added to squared distances before their root, so that nothing is divided by 0
MOST_SLOPE = f4(0.9)  # small densities make rare, bright samples
LEVEL = f4(1.001)  # 1, and a little more, so that nothing is divided by 0
EDGE_ON = f4(1e-14)  # taken off cosines that are divided by; smaller ones count as those of a dark side


@soa
class PlanarLights(LightRecord):
    """k flat lights that emit from their front side, given by a corner and two edges."""

    corner: Floats  # (3, k) scene units
    edge_u: Floats  # (3, k) from the corner; edge_u × edge_v is the front
    edge_v: Floats  # (3, k) from the corner
    normal: Floats  # (3, k) unit normal of the front side
    area: Floats  # (k,) squared scene units
    radiance: Floats  # (3, k) W·sr⁻¹·m⁻²; the mean, where the emission varies
    # the n surfaces for which they are sampled; None where unknown
    receiver: Receiver | None = field(default=None, kw_only=True)
    few: bool = field(default=True, kw_only=True)  # so few that sampling for surfaces is worth its time

    takes_receiver: ClassVar[bool] = True
    sides: ClassVar[int] = 1  # number of emitting sides
    parallelograms: ClassVar[float]  # area, in parallelograms of the edges
    middle: ClassVar[int]  # the middle is corner + (edge_u + edge_v)/middle

    @classmethod
    def from_edges(
        cls,
        corner: Doubles,
        edge_u: Doubles,
        edge_v: Doubles,
        radiance: Floats,
    ) -> Self:
        """Build from corners, relative to the scene's center, edges, and radiance, (3, k) each or (3, 1)."""
        normal = np.cross(edge_u, edge_v, axis=0)
        size = np.linalg.norm(normal, axis=0)
        p, u, v, n = (np.ascontiguousarray(rows, f4) for rows in (corner, edge_u, edge_v, normal / size))
        radiances = np.broadcast_to(radiance, p.shape).astype(f4)
        return cls(p, u, v, n, (cls.parallelograms * size).astype(f4), radiances)

    def le(self, wi: Floats, surface: SurfaceInteraction | None = None) -> Floats:
        """Return the radiance of rays that meet an emitting side, (3, n), else 0."""
        return self.radiance * (self._facing(-dot(self.normal, wi)) > 0)

    def power(self, scene_radius: float) -> Doubles:
        """π·A·L for each side."""
        return self.sides * np.pi * self.area * self.radiance.mean(0, dtype=np.float64)

    def irradiance(self, center: Doubles, radius: float, scene_radius: float) -> Doubles:
        """L·A·cosθ/d² at most, with the area at the middle; (c, k)."""
        middle = self._middle()
        size = np.sqrt(self.area)
        away = center[:, :, None] - middle[:, None, :]
        height = (away * self.normal[:, None, :]).sum(0)
        height = np.maximum((height if self.sides == 1 else np.abs(height)) + radius + size, 0)
        distance = np.sqrt(np.maximum((away**2).sum(0), np.maximum(size, radius) ** 2))
        strength = self.area * self.radiance.mean(0, dtype=np.float64)
        return strength * np.minimum(height / distance, 1) / distance**2

    def emitters(self) -> Emitters:
        """Return the middles; lights with one side shine to the front."""
        facing = self.normal.astype(np.float64) * (self.sides == 1)
        return Emitters(self._middle().astype(np.float64), facing, self.area.astype(np.float64))

    def lighting(self, receiver: Receiver) -> Self:
        """Return the lights as they are sampled for surfaces, by the irradiance from their sides."""
        return replace(self, receiver=receiver) if self.few else self

    def _across(self) -> tuple[Floats, Floats]:
        """Return the ways (3, k) across, between the middles of opposite sides of the square of u."""
        return self.edge_u, self.edge_v

    def _slopes(self, away: Floats, near: bool = False) -> Floats | None:
        """Return slopes (2, n) for `warp.linear`, given the way (3, n) to the middle of the square of u.

        They are None where no surface is known. At the middles of opposite sides, densities have the ratio of
        the irradiance from there, per area or `near` per solid angle: of cosθ/d³ or of cosθ. If heights above
        the surface are c ± k and squared distances q ± g, these have the ratios (1 + a)/(1 − a), a = k/c, and
        (1 + b)/(1 − b), b = g/q. Products of such ratios add a and b as hyperbolic tangents add.

        Source: M. Pharr, W. Jakob and G. Humphreys, Physically Based Rendering, 4th edition, 2023, section
        6.5.3, for a warp by the irradiance.
        """
        if self.receiver is None:
            return None
        normal = self.receiver.normal
        if not self.receiver.opaque.all():
            normal = normal * self.receiver.opaque  # light from everywhere counts
        across = self._across()
        height, square = np.maximum(f4(2) * dot(normal, away), TINY), dot(away, away)
        a, b = _dots(across, normal), _dots(across, away)
        a = a / np.maximum(np.abs(a), height)
        for row, side in zip(b, across, strict=True):
            row /= square + f4(0.25) * dot(side, side)
        falls = b * b
        if near:
            np.sqrt(np.maximum(f4(1) - falls, f4(0)), out=falls)
        falls += f4(1)
        b /= falls
        if not near:
            b += b
        np.multiply(a, b, out=falls)
        a -= b
        a /= LEVEL - falls
        return a.clip(-MOST_SLOPE, MOST_SLOPE)

    def _middle(self) -> Floats:
        return self.corner + (self.edge_u + self.edge_v) / self.middle

    def _facing(self, rise: Floats) -> Floats:
        """Return heights, or cosines, above an emitting side (n,), given those above the front."""
        return rise


class TwoSided:
    """Makes planar lights emit from both sides."""

    __slots__ = ()
    sides: ClassVar[int] = 2

    def _facing(self, rise: Floats) -> Floats:
        return np.abs(rise)


def _dots(sides: tuple[Floats, Floats], v: Floats) -> Floats:
    """Return the dot products (2, n) of two vectors (3, k) with vectors v (3, n)."""
    out = np.empty((2, v.shape[1]), f4)
    for row, side in zip(out, sides, strict=True):
        np.multiply(side[0], v[0], out=row)
        row += side[1] * v[1]
        row += side[2] * v[2]
    return out


def area_pdf(d2: Floats, cos_light: Floats, area: Floats) -> Floats:
    """Return the solid-angle density d²/(A·cosθ) of points drawn uniformly from an area; 0 on a dark side.

    Parameters
    ----------
    d2
        (n,) squared distances of the points.
    cos_light
        (n,) cosines at the points, above 0 on a side that shines.
    area
        (n,) or (1,).
    """
    return positive(d2 / ((cos_light - EDGE_ON) * area))
