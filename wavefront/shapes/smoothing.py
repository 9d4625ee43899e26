"""Normals of meshes that have none: averages over the faces around a vertex that meet at small angles."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arrays.elementary import arccos, sin_cos
from ..arrays.vec import Bools, Doubles, Floats, Ints, cross, dot, length, normalize
from ..core.errors import SceneError, in_brief, number, shape_of

AUTO = "auto"
CREASE = 60.0  # degrees between the normals of two faces above which their edge is sharp, for "auto"
# Corners at one vertex: where more meet, as in the apex of a cone of many sides, facets keep their normals,
# as the work grows with the square of their number.
MOST_CORNERS = 256
GRID = 2.0**20  # normals that are the same in units of 1/GRID count as one
SAME = 1e-12  # 1 less the cosine between a facet's normal and an average that counts as the same


def check_smooth(name: str, value: Any) -> bool | float | str:
    """Check that something is True, False, a crease angle in degrees, or "auto"."""
    if isinstance(value, bool | np.bool_):
        return bool(value)
    if isinstance(value, str) and value == AUTO:
        return AUTO
    if isinstance(value, str) or shape_of(value) or isinstance(value, list):
        raise SceneError(
            f"{name} is {in_brief(value)}; it must be True, False, 'auto', or a crease angle in degrees"
        )
    return number(name, value, lambda x: 0 <= x <= 180, "a crease angle from 0 to 180 degrees")


def crease_normals(vertices: Doubles, faces: Ints, degrees: float) -> Doubles | None:
    """Return unit normals at the corners of faces, (m, 3, 3); None if all are those of the facets.

    The normal of a corner is the average of the normals of the faces at its vertex that are within a crease
    angle of its own face, weighted by their angles there (Thürmer and Wüthrich 1998, "Computing vertex
    normals from polygonal facets", J. Graphics Tools 3(1)) and by their areas, so that a plane stays flat
    beside a narrow fillet. Vertices in one place count as one.

    Parameters
    ----------
    vertices
        (n, 3) positions.
    faces
        (m, 3) vertex indices.
    degrees
        The crease angle.
    """
    corner = vertices[faces]
    normals = _twice_areas(vertices, faces)
    flat = normalize(normals)
    places = same_rows(vertices)[faces].ravel()
    order = np.argsort(places, kind="stable")
    counts = np.bincount(places)
    ends = np.cumsum(counts)
    crowded = counts > MOST_CORNERS
    last = np.where(crowded, 0, ends - 1)[places[order]]
    facet = np.ascontiguousarray(flat[:, order // 3])
    area = length(normals)
    share = facet * (corner_angles(corner) * (area / (area.max() or 1))[:, None]).ravel()[order]
    total = share.copy()
    _, least = sin_cos(np.float64(np.radians(degrees / 2)))
    least = 2 * least * least - 1 - SAME
    here, step = np.arange(len(order)), 1
    while here.size:  # over the pairs of corners at a vertex, by their distance in the order
        here = here[here + step <= last[here]]
        other = here + step
        near = dot(facet[:, here], facet[:, other]) >= least
        here_near, other_near = here[near], other[near]
        total[:, here_near] += share[:, other_near]
        total[:, other_near] += share[:, here_near]
        step += 1
    total /= np.where(total.any(0), length(total), 1)
    keep: Bools = (dot(total, facet) >= 1 - SAME) | ~total.any(0)
    if keep.all():
        return None
    total[:, keep] = facet[:, keep]
    out = np.empty((len(order), 3))
    out[order] = total.T
    return out.reshape(-1, 3, 3)


def facet_normals(vertices: Doubles, faces: Ints) -> Floats:
    """Return the unit normals (3, m) of faces; zero for those without an area."""
    return normalize(_twice_areas(vertices, faces))


def _twice_areas(vertices: Doubles, faces: Ints) -> Floats:
    """Return normals (3, m) of faces, as long as twice their areas."""
    a, b, c = np.ascontiguousarray(vertices[faces].transpose(1, 2, 0))
    return cross(b - a, c - a)


def split_vertices(faces: Ints, normals: Doubles) -> tuple[Ints, Doubles, Ints]:
    """Return a mesh with one normal for each vertex: vertices on creases are split.

    Parameters
    ----------
    faces
        (m, 3) vertex indices.
    normals
        (m, 3, 3) at the corners of the faces.

    Returns
    -------
    faces, normals, origin
        The new faces (m, 3), normals (k, 3), and the vertex (k,) of which each new one is a copy.
    """
    corners, flat = faces.ravel(), normals.reshape(-1, 3)
    number = same_rows(np.column_stack([corners, np.rint(flat * GRID)]))
    first = np.empty(number.max() + 1, np.intp)
    first[number] = np.arange(number.size)
    return number.reshape(-1, 3), flat[first], corners[first]


def same_rows(rows: NDArray[np.floating[Any]]) -> Ints:
    """Return a number for each row (n, k), the same for rows that are equal."""
    order = np.lexsort(rows.T[::-1])
    ordered = rows[order]
    number = np.empty(len(rows), np.intp)
    number[order] = np.append(0, np.cumsum((ordered[1:] != ordered[:-1]).any(1)))[: len(rows)]
    return number


def corner_angles(corner: Doubles) -> Doubles:
    """Return the angles of triangles (m, 3, 3) at their corners, (m, 3)."""
    forward = np.roll(corner, -1, 1) - corner
    backward = np.roll(corner, 1, 1) - corner
    size = np.linalg.norm(forward, axis=2) * np.linalg.norm(backward, axis=2)
    cos = (forward * backward).sum(2) / np.where(size > 0, size, 1)
    angles: Doubles = arccos(np.clip(cos, -1, 1))
    return angles
