"""Ray-triangle tests: a float32 filter by matrix products, and an exact test of single pairs.

An edge function is the product of the Plücker coordinates of ray and edge, six numbers each, so a matrix
product with the rows of `edge_rows` tests all rays against all edges in float32. This filter classifies
pairs as misses, certain hits and, within a bound of its rounding error, uncertain ones. `hits_watertight`
tests the uncertain pairs by exact signs. So no ray passes between two adjacent triangles, and the result
does not depend on how BLAS rounds.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..arrays.soa import soa
from ..arrays.vec import Bools, Doubles, Floats, Ints, cross, f4, spans

ROUNDOFF = 2.0**-24  # half an ulp of float32
AT_ONCE = 1 << 14  # triangles per batch: their float64 data fit the cache
LEAST_EXTENT = 1e-30  # added to the extent of points, so that no row is infinite
# Column i: the axes that become x, y and z for rays whose largest component is along axis i.
AXES = np.array([[1, 2, 0], [2, 0, 1], [0, 1, 2]])


@soa
class TriangleTable:
    """Float64 data of the exact tests, one column per triangle (m)."""

    corners: Floats  # (m, 3, 3) vertices: triangle, corner, xyz
    plane: Doubles  # (4, m) normal n = (b - a) × (c - a), and n·a
    # None where no barycentric weights are needed:
    second: Doubles | None  # (4, m) weight of the second vertex at p is second[:3]·p + second[3]
    third: Doubles | None  # (4, m) the same for the third vertex
    # (m,) largest distance of a corner from the plane, but for rounding in float64; None: 0
    deviation: Doubles | None = None


def triangle_table(triangles: Floats, weights: bool) -> TriangleTable:
    """Precompute planes, and with `weights` barycentric gradients, of triangles (m, 3, 3)."""
    m = len(triangles)
    plane = np.empty((4, m))
    second, third = (np.empty((4, m)) if weights else None for _ in range(2))
    for span in spans(m, AT_ONCE):
        a, b, c = vertices(triangles[span])
        normal = cross(b - a, c - a)
        _write_plane(plane[:, span], normal, a)
        if second is None or third is None:
            continue
        with np.errstate(all="ignore"):
            size2 = (normal * normal).sum(0)
            gradients = cross(c - a, normal) / size2, cross(normal, b - a) / size2
        for rows, gradient in zip((second, third), gradients, strict=True):
            _write_plane(rows[:, span], gradient, a)
            rows[3, span] *= -1
    return TriangleTable(triangles, plane, second, third)


def _write_plane(rows: Doubles, normal: Floats | Doubles, point: Doubles) -> None:
    """Write normals (3, k), and their products with points (3, k), to rows (4, k)."""
    rows[:3] = normal
    rows[3] = (normal * point).sum(0)


def vertices(triangles: Floats) -> Doubles:
    """Return the vertices of triangles (k, 3, 3) as (corner, axis, k) float64."""
    return np.ascontiguousarray(triangles.transpose(1, 2, 0), np.float64)


def has_area(triangles: Floats) -> Bools:
    """Return a mask of the triangles (m, 3, 3) that are not degenerate; a degenerate one is never hit."""
    mask = np.empty(len(triangles), np.bool_)
    for span in spans(mask.size, AT_ONCE):
        a, b, c = vertices(triangles[span])
        normal = cross(b - a, c - a)
        with np.errstate(all="ignore"):
            size2 = (normal * normal).sum(0)
        mask[span] = (size2 > 0) & np.isfinite(size2)
    return mask


def edge_rows(corners: Floats, center: Floats, radius: float) -> Floats:
    """Return the Plücker rows of the edges of convex polygons, corners (e, m, 3) -> (e, m, 6) float32.

    With a ray as (d, (o - center) × d), |d| = 1, the product w of a row and a ray is the volume
    spanned by ray and edge; the ray passes inside if all w have the same sign (Shoemake, "Plücker
    coordinate tutorial", 1998). `radius` bounds the distance of all corners from `center` (3,).

    Rows are scaled so that the same thresholds hold for every polygon. If a ray hits, the products
    w0 w1, w1 w2 ... of adjacent edges are above -1; if they are above 1, the ray hits. Proof: each w
    has an error of at most e, and hits have 0 <= |w| <= 2A (twice the area), so their products are
    above -e (2A + e). A product above e (2A + 3e) is certain: a w of the wrong sign is less than e.
    """
    corner: Doubles = corners.astype(np.float64) - center
    following = np.roll(corner, -1, 0)
    direction = following - corner
    moment = np.cross(corner, following)
    _, scale = _edge_error(corner, radius)
    rows = np.concatenate([moment, direction], 2) * scale[:, None]
    return rows.astype(f4)


class PolygonPlanes(NamedTuple):
    """Planes of flat polygons (m), to find on which side points are, with error bounds."""

    plane: Doubles  # (4, m) unit normal and offset: their product with (p, 1) is 0 on the plane
    deviation: Doubles  # (m,) largest distance of a corner from the plane

    def rows(self, near: Floats, far: Floats) -> tuple[Floats, Floats]:
        """Return rows (m, 4) for the start points and rows (m, 4) for the end points of rays.

        Points (4, n) are p - center and 1. The largest absolute coordinates of the start points are `near`
        (3,), and those of the end points `far` (3,). The product of a row and a point is above 1 or below -1
        where the point is certainly on that side of the plane. For end points, the float32 distance t of
        the plane is then certainly less than the ray's length.
        """
        near, far = near.astype(np.float64) + LEAST_EXTENT, far.astype(np.float64) + LEAST_EXTENT
        normal, offset = np.abs(self.plane[:3].T), np.abs(self.plane[3])
        # Errors in half ulps: 1 for the point, 1 for the plane, 4 for the sum of four terms. An end point is
        # the sum of a start point and a product of at most near + far, so its error is 2 near + 2 far in
        # place of 1; the error of a float32 t adds as much again.
        at_start = ROUNDOFF * (normal @ (6 * near) + 6 * offset) + self.deviation
        at_end = ROUNDOFF * (normal @ (4 * near + 8 * far) + 6 * offset) + self.deviation
        return (self.plane / at_start).T.astype(f4), (self.plane / at_end).T.astype(f4)


def polygon_planes(
    table: TriangleTable, prim: Ints, corners: Floats, center: Floats, deviation: Doubles
) -> PolygonPlanes:
    """Return the planes about `center` (3,) of flat polygons with corners (e, m, 3).

    They are the planes of their first triangles `prim` (m,) in the table, from which t is computed. These are
    up to `deviation` (m,) away from the planes of the corners.
    """
    plane = table.plane.take(prim, 1)
    plane[3] = (plane[:3] * center[:, None]).sum(0) - plane[3]
    plane /= np.sqrt((plane[:3] * plane[:3]).sum(0))
    return PolygonPlanes(plane, deviation + _deviation_from_plane(corners.astype(np.float64) - center))


def side_rows(corners: Floats, center: Floats, radius: float, deviation: Doubles) -> Floats:
    """Return rows (m, 4) that find on which side of flat polygons, corners (e, m, 3), a point lies.

    The product with (p - center, 1) has the sign of the edge functions of a ray from p if the ray reaches
    the polygon's plane at t > 0. Rows are scaled so that the product of this and w1 (see `edge_rows`) is
    above -1 for every such hit, with p within five radii of the center. The plane that a ray reaches may be
    `deviation` (m,) away from that of the corners.
    """
    corner: Doubles = corners.astype(np.float64) - center
    normal = np.cross(corner[1] - corner[0], corner[2] - corner[0])
    offset = (normal * corner[0]).sum(1)
    rows = np.concatenate([-normal, offset[:, None]], 1)
    size = np.linalg.norm(normal, axis=1)
    edge_error, edge_scale = _edge_error(corner, radius)
    area2 = _twice_area(corner)
    # 60 rounding errors: those of a sum of four terms, and those of p if it is a point along a ray.
    error = ROUNDOFF * 60 * radius * size + (_deviation_from_plane(corner) + deviation) * size
    slack = error * (area2 + edge_error) + edge_error * (6 * radius * size + error)
    with np.errstate(all="ignore"):
        return (rows / (slack * edge_scale)[:, None]).astype(f4)


def _edge_error(corner: Doubles, radius: float) -> tuple[Doubles, Doubles]:
    """Return bounds (m,) of the float32 error of edge functions, and the scale (m,) of their rows."""
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
    """Return twice the area of triangles or quadrilaterals (e, m, 3)."""
    across = corner[-1] - corner[1] if len(corner) == 4 else corner[2] - corner[1]
    return np.linalg.norm(np.cross(corner[2] - corner[0], across), axis=1)


def _deviation_from_plane(corner: Doubles) -> Doubles | float:
    """Return a bound of the distance between a corner and the plane of the others; 0 for triangles."""
    if len(corner) == 3:
        return 0.0
    a, b, c, d = corner
    halves = np.cross(b - a, c - a), np.cross(c - a, d - a)
    volume = np.abs((halves[0] * (d - a)).sum(1))
    with np.errstate(all="ignore"):
        return volume / np.minimum(*(np.linalg.norm(half, axis=1) for half in halves))


def least_adjacent_product(edges: Floats, out: Floats) -> Floats:
    """Return the least of w0 w1, w1 w2 ... of edge functions (b, e, m, k).

    It is positive where all signs are equal. Overwrites all edges but the second.
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


def least_opposite_product(edges: Floats, out: Floats) -> Floats:
    """Return the lesser of w0 w2 and w1 w3 of edge functions (b, 4, m, k) of parallelograms.

    Both pairs of opposite edges have the same sum, d·n, so that all signs are equal where both products are
    positive: see `least_adjacent_product`. Overwrites the last two edges.
    """
    pairs = np.multiply(edges[:, :2], edges[:, 2:], out=edges[:, 2:])
    return np.minimum(pairs[:, 0], pairs[:, 1], out=out)


def vertices_from(table: TriangleTable, prim: Ints, origin: Doubles) -> Doubles:
    """Return the vertices of triangles `prim` (k,) relative to points (3, k): (corner, axis, k)."""
    return vertices(table.corners.take(prim, 0)) - origin


def hits_watertight(vertices: Doubles, direction: Doubles) -> Bools:
    """Return a mask (k,) of the rays whose lines pass through triangles (3, 3, k), relative to their origins.

    Woop, Benthin, Wald, "Watertight ray/triangle intersection", JCGT 2(1), 2013: shear space so that
    the ray is the z axis, and test the origin against the projected edges. The projected vertices are
    rounded to float32, so that float64 products of them are exact, and so is the sign of a difference of
    two: adjacent triangles have no gap between them.
    """
    axes = AXES.take(np.abs(direction).argmax(0), 1)
    place = axes * direction.shape[1] + np.arange(direction.shape[1])
    permuted = vertices.reshape(3, -1).take(place, 1)
    along = direction.reshape(-1).take(place)
    projected = (permuted[:, :2] - along[:2] / along[2] * permuted[:, 2:]).astype(f4).astype(np.float64)
    before, after = projected.take([2, 0, 1], 0), projected.take([1, 2, 0], 0)
    edges = before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]
    low, high = np.minimum.reduce(edges, 0), np.maximum.reduce(edges, 0)
    return ((low >= 0) & (high > 0)) | ((high <= 0) & (low < 0))


def plane_distance(
    plane: Doubles, chosen: Ints, origin: Floats | Doubles, direction: Floats | Doubles
) -> Doubles:
    """Return the distance t (k,) of planes `chosen` (k,) of `plane` (4, m) along rays (3, k), float64."""
    nx, ny, nz, offset = (row.take(chosen) for row in plane)
    top = offset - (nx * origin[0] + ny * origin[1] + nz * origin[2])
    return top / (nx * direction[0] + ny * direction[1] + nz * direction[2])


def clamp_to_triangle(
    t: Doubles, vertices: Doubles, direction: Doubles, deviation: Doubles | None
) -> Doubles:
    """Clip t (k,) to the extent of triangles (3, 3, k), relative to the rays' origins, along the rays.

    For a ray in the triangle's plane t is 0/0. The margin is wide enough not to change t for rays that
    cross the plane, which is up to `deviation` (k,) away from the corners (None: 0), at a measurable angle.
    """
    square = (direction * direction).sum(0)
    depths = (vertices * direction).sum(1) / square
    low, high = depths.min(0), depths.max(0)
    margin = 1e-6 * (high - low) + 1e-9 * np.maximum(np.abs(low), np.abs(high))
    if deviation is not None:
        margin += np.where(deviation > 0, high - low + 16 * deviation / np.sqrt(square), 0)
    return np.clip(t, low - margin, high + margin)


def barycentrics(
    table: TriangleTable, prim: Ints, origin: Doubles, direction: Doubles
) -> tuple[Floats, Floats]:
    """Return the weights (k,) of the second and third vertex where rays cross triangles `prim` (k,)."""
    t = plane_distance(table.plane, prim, origin, direction)
    x = origin[0] + t * direction[0]
    y = origin[1] + t * direction[1]
    z = origin[2] + t * direction[2]
    weights = []
    for gradient in (table.second, table.third):
        assert gradient is not None
        gx, gy, gz, constant = (row.take(prim) for row in gradient)
        weight = (gx * x + gy * y + gz * z + constant).astype(f4)
        weights.append(np.minimum(np.maximum(weight, f4(0), out=weight), f4(1), out=weight))
    b1, b2 = weights
    return b1, np.minimum(b2, 1 - b1, out=b2)
