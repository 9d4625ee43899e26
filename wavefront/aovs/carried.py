"""Points that are carried to another time by surfaces that move or deform."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np

from ..arrays.vec import Bools, Doubles, Ints, distinct, dot
from ..shapes import Instance, Mesh, Shape

Forms = Callable[[float], Any]  # from a time to the arrays of a shape that deforms, by name


def carried(
    shapes: Sequence[Shape], shape: Ints, face: Ints, point: Doubles, start: Doubles, end: Doubles
) -> Doubles:
    """Return where points of surfaces are at other times, (n, 3).

    Parameters
    ----------
    shapes
        Those of the scene, with their motions.
    shape, face
        (n,) the numbers of the shapes, and those of the triangles or primitives in each.
    point
        (n, 3) where they are at times `start` (n,), s.
    end
        (n,) the other times, s.
    """
    out = point.copy()
    for number in distinct(shape):
        element = shapes[number]
        if element.moves:
            lanes = np.flatnonzero(shape == number)
            out[lanes] = _moved(element, face[lanes], point[lanes], start[lanes], end[lanes])
    return out


def _moved(shape: Any, face: Ints, point: Doubles, start: Doubles, end: Doubles) -> Doubles:
    """Return where points (n, 3) of one shape are."""
    form = shape.mesh if isinstance(shape, Instance) else shape
    before, after = (_matrices(shape, times) for times in (start, end))
    local = _applied(np.asarray(np.linalg.inv(before), np.float64), point)
    if form.deformation is not None:
        local = _reformed(form, face, local, start, end)
    return _applied(after, local)


def _matrices(shape: Any, times: Doubles) -> Doubles:
    """Return the matrices (n, 4, 4) that place a shape at times (n,)."""
    if shape.motion is not None:
        return np.asarray(shape.motion.at_times(times), np.float64)
    stays = shape.transform if isinstance(shape, Instance) else np.eye(4)
    return np.broadcast_to(stays, (len(times), 4, 4))


def _applied(matrices: Doubles, points: Doubles) -> Doubles:
    """Return points (n, 3), each transformed by its matrix (n, 4, 4)."""
    x, y, z = points.T[..., None]
    m = matrices[:, :3]
    return np.asarray(m[..., 0] * x + m[..., 1] * y + m[..., 2] * z + m[..., 3])


def _reformed(form: Any, face: Ints, local: Doubles, start: Doubles, end: Doubles) -> Doubles:
    """Return where points (n, 3) on a shape that deforms are, in its own coordinates."""
    rest = form if form._rest is None else form._rest
    place = partial(_on_mesh, rest) if isinstance(rest, Mesh) else _on_primitives
    out, forms = local.copy(), form.deformation.at
    for first, second in {*zip(start.tolist(), end.tolist(), strict=True)}:
        lanes = np.flatnonzero((start == first) & (end == second))
        out[lanes] = place(forms(first), forms(second), face[lanes], local[lanes])
    return out


def _on_mesh(mesh: Mesh, before: Any, after: Any, face: Ints, point: Doubles) -> Doubles:
    """Return where points (n, 3) of faces (n,) are once the corners have gone elsewhere."""
    then = before["vertices"]
    face, b1, b2 = weights_on(mesh.faces, then, face, point)
    a, b, c = after["vertices"].take(mesh.faces.take(face, 0), 0).transpose(1, 2, 0)
    return np.asarray((a + (b - a) * b1 + (c - a) * b2).T)


def _on_primitives(before: Any, after: Any, number: Ints, point: Doubles) -> Doubles:
    """Return where points (n, 3) of spheres are, or of cylinders and the like, which turn the shorter way."""
    if "centers" in before:
        return np.asarray(point + (after["centers"] - before["centers"]).take(number, 0), np.float64)
    (a, b), (c, d) = ([form[name].take(number, 0) for name in ("starts", "ends")] for form in (before, after))
    old, new = b - a, d - c
    length = _dots(old, old)[:, None]
    share = _dots(point - a, old)[:, None] / np.where(length > 0, length, 1)
    return np.asarray(c + share * new, np.float64) + _turned(point - a - share * old, _unit(old), _unit(new))


def _turned(v: Doubles, one: Doubles, other: Doubles) -> Doubles:
    """Return vectors (n, 3), turned as unit vectors (n, 3) turn to others the shorter way."""
    axis: Doubles = np.cross(one, other)
    cos = _dots(one, other)[:, None]
    along = _dots(axis, v)[:, None] / np.maximum(1 + cos, 1e-12)
    return np.asarray(v * cos + np.cross(axis, v) + axis * along, np.float64)


def _unit(v: Doubles) -> Doubles:
    length = np.sqrt(_dots(v, v))[:, None]
    return np.asarray(v / np.where(length > 0, length, 1))


def _dots(a: Doubles, b: Doubles) -> Doubles:
    return np.asarray(dot(np.ascontiguousarray(a.T), np.ascontiguousarray(b.T)), np.float64)


def weights_on(
    faces: Ints,
    vertices: Doubles,
    face: Ints,
    point: Doubles,
    placed: Callable[[Doubles], Doubles] | None = None,
) -> tuple[Ints, Doubles, Doubles]:
    """Return the triangles that points (n, 3) are on, and the barycentric weights (n,) of their b and c.

    Of a flat quadrilateral whose halves look alike, the first half may have been reported for the second.

    Parameters
    ----------
    faces, vertices
        (f, 3) and (v, 3) of the mesh.
    face
        (n,) the triangles that were reported.
    placed
        From vertices (3, n) to where they are in the scene; None where the points are in their coordinates.
    """
    following = np.minimum(face + 1, len(faces) - 1)
    weights = []
    for number in (face, following):
        a, b, c = vertices.take(faces.take(number, 0), 0).transpose(1, 2, 0)
        if placed is not None:
            a, b, c = placed(a), placed(b), placed(c)
        weights.append(barycentric(a, b, c, point.T))
    beyond, further = (np.maximum(np.maximum(-b1, -b2), b1 + b2 - 1) for b1, b2 in weights)
    second = _are_quads(faces, vertices, face, following) & (further < beyond)
    (b1, b2), (c1, c2) = weights
    return np.where(second, following, face), np.where(second, c1, b1), np.where(second, c2, b2)


def _are_quads(faces: Ints, vertices: Doubles, face: Ints, following: Ints) -> Bools:
    """Return whether faces (n,) are fans with those that follow: see `shapes/fans.py`."""
    (a, _, c), (p, q, _) = (vertices.take(faces.take(number, 0).T, 0) for number in (face, following))
    return ((a == p) & (c == q)).all(1)


def barycentric(a: Doubles, b: Doubles, c: Doubles, point: Doubles) -> tuple[Doubles, Doubles]:
    """Return the barycentric weights (n,) of b and c at points (3, n) of triangles; 0 without an area."""
    u, v, w = b - a, c - a, point - a
    uu, uv, vv, wu, wv = dot(u, u), dot(u, v), dot(v, v), dot(w, u), dot(w, v)
    area = uu * vv - uv * uv
    area = np.where(area > 0, area, np.inf)
    return (vv * wu - uv * wv) / area, (uu * wv - uv * wu) / area
