"""Specular surfaces: those that light leaves by delta lobes alone, such as smooth glass and mirrors.

Paths from lights (integrators/light_tracing.py) begin at points on them, which are drawn uniformly by area.
"""

from __future__ import annotations

import numpy as np

from ..accel.quads import find_quads
from ..accel.sphere import SpherePrimitives
from ..arrays.soa import soa
from ..arrays.state import SoA
from ..arrays.vec import Bools, Doubles, Floats, Ints, f4, interpolate
from ..sampling.warp import uniform_sphere, uniform_triangle
from .curved import CurvedTable
from .materials import MaterialTable


@soa
class SpecularPoints(SoA):
    """Points on specular surfaces."""

    point: Floats  # (3, n) scene units
    prim: Ints  # (n,) primitive id
    b1: Floats  # (n,) barycentric weight of the second vertex, of a triangle
    b2: Floats  # (n,) and of the third


@soa
class SpecularSurfaces:
    """The specular surfaces of a scene: its triangles and spheres whose materials have only delta lobes."""

    of_prim: Bools  # (m + k + 1,) whether each primitive id is one; False at the end, for others and a miss
    # (m + k,) the lowest primitive id that a ray may report for a hit of each: that of the first triangle
    # of a flat quadrilateral, or its own
    found_as: Ints
    prim: Ints  # (c,) their primitive ids, triangles first
    corners: Floats  # (t, 3, 3) of the triangles
    centers: Floats  # (3, c - t) of the spheres
    radii: Floats  # (c - t,)
    cumulative: Doubles  # (c,) sums of areas, scene units²

    def includes(self, prim: Ints) -> Bools:
        """Return whether primitives are specular surfaces, (n,), given their ids (n,); -1 is no primitive."""
        return self.of_prim.take(np.minimum(prim, self.of_prim.size - 1))

    @property
    def area(self) -> float:
        """Their area, scene units²."""
        return float(self.cumulative[-1])

    def sample(self, u_choice: Floats, u: Floats) -> SpecularPoints:
        """Draw points uniformly by area, with u_choice (n,) and u (2, n) in [0, 1)."""
        which = self.cumulative.searchsorted(u_choice * self.cumulative[-1], side="right")
        which = np.minimum(which, self.prim.size - 1)
        flat = np.flatnonzero(which < len(self.corners))
        round_ = np.flatnonzero(which >= len(self.corners))
        point, weights = np.empty((3, which.size), f4), np.zeros((2, which.size), f4)
        weights[:, flat] = uniform_triangle(u[:, flat])
        a, b, c = self.corners.take(which.take(flat), 0).transpose(1, 2, 0)
        point[:, flat] = interpolate(a, b, c, *weights[:, flat])
        ball = which.take(round_) - len(self.corners)
        directions = uniform_sphere(u[:, round_])
        point[:, round_] = self.centers.take(ball, 1) + directions * self.radii.take(ball)
        return SpecularPoints(point, self.prim.take(which), *weights)


def find_specular_surfaces(
    triangles: Floats,
    curved: CurvedTable,
    still: int,
    material_of: Ints,
    light_of: Ints,
    materials: MaterialTable,
) -> SpecularSurfaces | None:
    """Return the specular surfaces of a scene; None if it has none.

    Cylinders, capsules and instances that share their arrays do not count, nor does what moves while a
    shutter is open, nor do spheres that shine: no light sample tells whether a point on such a sphere is
    lit from the other side of the same sphere.

    Parameters
    ----------
    triangles
        (m, 3, 3) those that no instance shares.
    curved
        The k curved primitives, whose ids follow those of the triangles.
    still
        How many of their kinds, the first ones, do not move.
    material_of, light_of
        (m + k,) material of each of these primitives, and its light, -1 for none.
    """
    delta = np.array([bsdf.specular for bsdf in materials.groups], np.bool_)[materials.group_of]
    of_prim = np.append(delta.take(material_of), False)
    of_prim[len(triangles) : -1] &= _spheres_among(curved, still) & (light_of[len(triangles) :] < 0)
    flat = np.flatnonzero(of_prim[: len(triangles)])
    corners = triangles.take(flat, 0)
    edge, other = (corners[:, k].astype(np.float64) - corners[:, 0] for k in (1, 2))
    area = np.linalg.norm(np.cross(edge, other), axis=1) / 2
    ball = np.flatnonzero(of_prim[len(triangles) :])
    centers, radii = np.zeros((3, 0), f4), np.zeros(0, f4)
    for kind, first in zip(curved.kinds[:still], curved.first, strict=False):
        if isinstance(kind, SpherePrimitives) and ball.size:
            centers, radii = kind.centers.take(ball - first, 1), kind.radii.take(ball - first)
    cumulative = np.cumsum(np.append(area, 4 * np.pi * radii.astype(np.float64) ** 2))
    if not cumulative.size or not cumulative[-1] > 0:
        return None
    found_as = np.arange(of_prim.size - 1)
    found_as[find_quads(triangles) + 1] -= 1
    prim = np.append(flat, ball + len(triangles))
    return SpecularSurfaces(of_prim, found_as, prim, corners, centers, radii, cumulative)


def _spheres_among(curved: CurvedTable, still: int) -> Bools:
    """Return whether each curved primitive is a sphere, and among the kinds that do not move, (k,)."""
    return np.concatenate(
        [np.zeros(0, np.bool_)]
        + [
            np.full(len(kind), isinstance(kind, SpherePrimitives) and number < still)
            for number, kind in enumerate(curved.kinds)
        ]
    )
