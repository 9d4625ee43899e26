"""Rays against triangles, one (ray, triangle) pair per element: who is hit, where, and how far.

Two tests share this file. `edge_rows` serves the fast one: the sign of an edge function is the sign
of the product of the ray's and the edge's Plücker coordinates, six numbers each, so a matrix product
tests all rays against all edges in float32. It only sorts pairs into *misses*, *hits*, and a thin
*unsure* band that is wider than its rounding error. `hits_watertight` decides the unsure ones by signs
that are exact, so that no ray slips between two triangles and the result never depends on how BLAS
happened to round.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..record import record
from ..vec import Bools, Floats, Ints, cross, f4

Doubles = NDArray[np.float64]

ROUNDOFF = 2.0**-24  # half an ulp of float32
TINY = 1e-30  # least extent of points, so that no row is infinite
# Column i: the axes that become x, y and z for rays that run mostly along axis i.
AXES = np.array([[1, 2, 0], [2, 0, 1], [0, 1, 2]])


@record
class TriangleTable:
    """What the element-by-element decision reads, float64, one column per triangle (m)."""

    corners: Doubles  # (9, m) x, y, z of the first, second and third vertex
    plane: Doubles  # (4, m) normal n = (b - a) × (c - a), and n·a
    second: Doubles  # (4, m) weight of the second vertex at p is second[:3]·p + second[3]
    third: Doubles  # (4, m) the same for the third vertex


def triangle_table(triangles: Floats) -> TriangleTable:
    """Precompute planes and barycentric gradients of triangles (m, 3, 3)."""
    corners = np.ascontiguousarray(triangles.reshape(-1, 9).T, np.float64)
    a, b, c = corners[:3], corners[3:6], corners[6:]
    normal = cross(b - a, c - a)
    with np.errstate(all="ignore"):
        size2 = (normal * normal).sum(0)
        second = cross(c - a, normal) / size2
        third = cross(normal, b - a) / size2
    return TriangleTable(
        corners,
        np.concatenate([normal, (normal * a).sum(0)[None]]),
        np.concatenate([second, -(second * a).sum(0)[None]]),
        np.concatenate([third, -(third * a).sum(0)[None]]),
    )


def has_area(triangles: Floats) -> Bools:
    """Tell which triangles (m, 3, 3) are not degenerate; a degenerate one is never hit."""
    a, b, c = np.ascontiguousarray(triangles.transpose(1, 2, 0), np.float64)
    normal = cross(b - a, c - a)
    with np.errstate(all="ignore"):
        size2 = (normal * normal).sum(0)
    return (size2 > 0) & np.isfinite(size2)


def edge_rows(corners: Floats, center: Floats, radius: float) -> Floats:
    """Return the Plücker rows of the edges of convex polygons, corners (e, m, 3) -> (e, m, 6) float32.

    With a ray as (d, (o - center) × d), |d| = 1, the product w of a row and a ray is the volume
    spanned by ray and edge: the ray passes inside if all have one sign (Shoemake, "Plücker
    coordinate tutorial", 1998). `radius` bounds the distance of all corners from `center` (3,).

    Rows are scaled so that one threshold serves every polygon: a ray that truly hits has
    products w0 w1, w1 w2 ... of neighbors > -1, and if they are above 1, it truly hits. For an error
    of at most e in each w, and as hits have 0 <= |w| <= 2A (twice the area), the products are above
    -e (2A + e). Sure hits are above e (2A + 3e), as a wrong sign means a w of less than e.
    """
    corner: Doubles = corners.astype(np.float64) - center
    following = np.roll(corner, -1, 0)
    direction = following - corner
    moment = np.cross(corner, following)
    _, scale = _edge_error(corner, radius)
    rows = np.concatenate([moment, direction], 2) * scale[:, None]
    return rows.astype(f4)


class Sides(NamedTuple):
    """Planes of flat polygons (m), to tell on which side points are, with a bound for rounding."""

    plane: Doubles  # (4, m) unit normal, and the offset: on the plane, their product with (p, 1) is 0
    deviation: Doubles  # (m,) by how much the corners may be off the plane

    def rows(self, start: Floats, end: Floats) -> tuple[Floats, Floats]:
        """Return rows (m, 4) each for points where rays start and end, (4, n): o - center and 1.

        Their products with them are beyond 1 or -1 where it is sure on which side the point is. For
        the end, a float32 distance t to the plane is then less than the ray's length as well.
        """
        near, far = np.abs(start[:3]).max(1), np.abs(end[:3]).max(1)
        near, far = near.astype(np.float64) + TINY, far.astype(np.float64) + TINY
        normal, offset = np.abs(self.plane[:3].T), np.abs(self.plane[3])
        # In half ulps: rounding of the point 1, of the plane 1, of the sum of four terms 4. An end is the
        # sum of a start and a product of at most near + far, so 2 near + 2 far in place of 1; and a float32 t
        # is off by as much as another such product.
        at_start = ROUNDOFF * (normal @ (6 * near) + 6 * offset) + self.deviation
        at_end = ROUNDOFF * (normal @ (4 * near + 8 * far) + 6 * offset) + self.deviation
        return (self.plane / at_start).T.astype(f4), (self.plane / at_end).T.astype(f4)


def sides(table: TriangleTable, prim: Ints, corners: Floats, center: Floats) -> Sides:
    """Return the planes of flat polygons, corners (e, m, 3), that begin with triangles `prim` (m,).

    They are those that t is computed with, about `center` (3,).
    """
    plane = table.plane.take(prim, 1)
    plane[3] = (plane[:3] * center[:, None]).sum(0) - plane[3]
    plane /= np.sqrt((plane[:3] * plane[:3]).sum(0))
    return Sides(plane, np.zeros(prim.size) + _deviation_from_plane(corners.astype(np.float64) - center))


def side_rows(corners: Floats, center: Floats, radius: float) -> Floats:
    """Return rows (m, 4) that tell on which side of flat polygons, corners (e, m, 3), a point lies.

    The product with (p - center, 1) has the sign of the edge functions of a ray if the polygon's plane
    lies ahead of p. It is scaled so that its product with w1 (see `edge_rows`) is above -1 for
    every true hit that does, with p within five radii of the center.
    """
    corner: Doubles = corners.astype(np.float64) - center
    normal = np.cross(corner[1] - corner[0], corner[2] - corner[0])
    offset = (normal * corner[0]).sum(1)
    rows = np.concatenate([-normal, offset[:, None]], 1)
    size = np.linalg.norm(normal, axis=1)
    edge_error, edge_scale = _edge_error(corner, radius)
    area2 = _twice_area(corner)
    # 60 roundings: of a sum of four terms, and of p where it is a point along a ray.
    error = ROUNDOFF * 60 * radius * size + _deviation_from_plane(corner) * size
    slack = error * (area2 + edge_error) + edge_error * (6 * radius * size + error)
    with np.errstate(all="ignore"):
        return (rows / (slack * edge_scale)[:, None]).astype(f4)


def _edge_error(corner: Doubles, radius: float) -> tuple[Doubles, Doubles]:
    """Bound the float32 error of edge functions of corners (e, m, 3), and the scale of their rows."""
    following = np.roll(corner, -1, 0)
    moment = np.cross(corner, following)
    span = np.linalg.norm(following - corner, axis=2)
    # By Wilkinson's bounds on six-term sums, with (o - center) rounded at a distance up to 2 radius.
    error = ROUNDOFF * (12 * np.linalg.norm(moment, axis=2) + 40 * radius * span).max(0)
    error += _deviation_from_plane(corner) * span.sum(0)
    area2 = _twice_area(corner)
    with np.errstate(all="ignore"):
        return error, 1 / np.sqrt(error * (area2 + 3 * error))


def _twice_area(corner: Doubles) -> Doubles:
    """Twice the area of triangles or quadrilaterals (e, m, 3)."""
    across = corner[-1] - corner[1] if len(corner) == 4 else corner[2] - corner[1]
    return np.linalg.norm(np.cross(corner[2] - corner[0], across), axis=1)


def _deviation_from_plane(corner: Doubles) -> Doubles | float:
    """How far a corner of a quadrilateral may be from the plane of the others; 0 for triangles."""
    if len(corner) == 3:
        return 0.0
    a, b, c, d = corner
    halves = np.cross(b - a, c - a), np.cross(c - a, d - a)
    volume = np.abs((halves[0] * (d - a)).sum(1))
    with np.errstate(all="ignore"):
        return volume / np.minimum(*(np.linalg.norm(half, axis=1) for half in halves))


def one_sign(edges: Floats, out: Floats) -> Floats:
    """Edge functions (b, e, m, k) -> the least of w0 w1, w1 w2 ..., above 0 where all have one sign.

    Overwrites all edges but the second.
    """
    count = edges.shape[1]
    products = []
    for edge in (*range(count - 1, 1, -1), 0):
        neighbor = 1 if edge == 0 else edge - 1
        products.append(np.multiply(edges[:, edge], edges[:, neighbor], out=edges[:, edge]))
    np.minimum(products[0], products[1], out=out)
    for product in products[2:]:
        np.minimum(out, product, out=out)
    return out


def pairs_of_one_sign(edges: Floats, out: Floats) -> Floats:
    """Edge functions (b, 4, m, k) of parallelograms -> the lesser of w0 w2 and w1 w3; see `one_sign`.

    Opposite edges have one sum, d·n, so they cannot both have the other sign, that of an outside.
    Overwrites the last two edges.
    """
    pairs = np.multiply(edges[:, :2], edges[:, 2:], out=edges[:, 2:])
    return np.minimum(pairs[:, 0], pairs[:, 1], out=out)


def vertices_from(table: TriangleTable, prim: Ints, origin: Doubles) -> Doubles:
    """Return the vertices of triangles `prim` (k,) as seen from points (3, k): corner, axis, k."""
    return table.corners.take(prim, 1).reshape(3, 3, -1) - origin


def hits_watertight(vertices: Doubles, direction: Doubles) -> Bools:
    """Decide for triangles, seen from where rays start (3, 3, k), whether the rays' lines pass inside.

    Woop, Benthin, Wald, "Watertight ray/triangle intersection", JCGT 2(1), 2013: shear space so that
    the ray runs along z, and test the origin against the projected edges. The projected vertices are
    rounded to float32, so that in float64 their products are exact and so is the sign of a difference
    of two: the triangles of a mesh stay a mesh, without gaps.
    """
    axes = AXES.take(np.abs(direction).argmax(0), 1)
    place = axes * direction.shape[1] + np.arange(direction.shape[1])
    turned = vertices.reshape(3, -1).take(place, 1)
    along = direction.reshape(-1).take(place)
    projected = (turned[:, :2] - along[:2] / along[2] * turned[:, 2:]).astype(f4).astype(np.float64)
    before, after = projected.take([2, 0, 1], 0), projected.take([1, 2, 0], 0)
    edges = before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]
    low, high = np.minimum.reduce(edges, 0), np.maximum.reduce(edges, 0)
    return ((low >= 0) & (high > 0)) | ((high <= 0) & (low < 0))


def plane_distance(
    plane: Doubles, chosen: Ints, origin: Floats | Doubles, direction: Floats | Doubles
) -> Doubles:
    """Distance t to planes `chosen` (k,) of all (4, m), see TriangleTable, along rays (3, k), float64."""
    nx, ny, nz, offset = (row.take(chosen) for row in plane)
    top = offset - (nx * origin[0] + ny * origin[1] + nz * origin[2])
    return top / (nx * direction[0] + ny * direction[1] + nz * direction[2])


def clamp_to_triangle(t: Doubles, vertices: Doubles, direction: Doubles) -> Doubles:
    """Keep t (k,) within the stretch of the ray beside its triangle, as seen from its start (3, 3, k).

    A ray that runs in a triangle's plane has a plane distance of 0/0. The margin leaves every ray that
    crosses the plane at a measurable angle alone.
    """
    depths = (vertices * direction).sum(1) / (direction * direction).sum(0)
    low, high = depths.min(0), depths.max(0)
    margin = 1e-6 * (high - low) + 1e-9 * np.maximum(np.abs(low), np.abs(high))
    return np.clip(t, low - margin, high + margin)


def barycentrics(
    table: TriangleTable, prim: Ints, origin: Doubles, direction: Doubles
) -> tuple[Floats, Floats]:
    """Weights (k,) of the second and third vertex where rays (3, k) cross triangles `prim` (k,)."""
    t = plane_distance(table.plane, prim, origin, direction)
    x = origin[0] + t * direction[0]
    y = origin[1] + t * direction[1]
    z = origin[2] + t * direction[2]
    weights = []
    for gradient in (table.second, table.third):
        gx, gy, gz, constant = (row.take(prim) for row in gradient)
        weight = (gx * x + gy * y + gz * z + constant).astype(f4)
        weights.append(np.minimum(np.maximum(weight, f4(0), out=weight), f4(1), out=weight))
    b1, b2 = weights
    return b1, np.minimum(b2, 1 - b1, out=b2)
