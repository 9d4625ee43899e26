"""Meshes of round surfaces: functions over a square, and surfaces of revolution."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from ..arrays.elementary import sin_cos_turns
from ..arrays.vec import Doubles
from ..shapes import Cylinders, Shape, Sphere
from .joining import stacked
from .losses import Losses
from .repair import RawMesh, build

SIDES, RINGS = 128, 64  # around, and from pole to pole
Strip = tuple[Doubles, Doubles]  # radius and height (2, k) of points, and their normals (2, k)


def over_square(
    name: str, columns: int, rows: int, point: Callable[[Doubles, Doubles], tuple[Doubles, Any]]
) -> RawMesh:
    """Return a surface over the unit square, whose front is on the side of ∂p/∂u × ∂p/∂v.

    `point` returns positions and normals (n, 3) for u and v (n,). Faces without an area are left out.
    """
    u, v = (
        grid.ravel() for grid in np.meshgrid(np.arange(columns + 1) / columns, np.arange(rows + 1) / rows)
    )
    vertices, normals = point(u, v)
    corner = (np.arange(rows)[:, None] * (columns + 1) + np.arange(columns)).ravel()
    above = corner + columns + 1
    faces = np.stack([corner, corner + 1, above + 1, corner, above + 1, above], 1).reshape(-1, 3)
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    has_area = np.linalg.norm(np.cross(b - a, c - a), axis=1) > 1e-12 * np.square(np.abs(vertices).max())
    return RawMesh(name, vertices, faces[has_area], normals, np.stack([u, v], 1))


def revolved(name: str, strips: Sequence[Strip]) -> RawMesh:
    """Return the surface of revolution about z of the strips of a profile.

    A strip that rises has its front outside.
    """
    return stacked(name, [_turned(name, *strip) for strip in strips])


def _turned(name: str, profile: Doubles, normals: Doubles) -> RawMesh:
    rows = profile.shape[1] - 1

    def point(u: Doubles, v: Doubles) -> tuple[Doubles, Doubles]:
        sin, cos = sin_cos_turns(u % 1)
        row = np.rint(v * rows).astype(np.intp)
        out, up = (np.stack([cos * r, sin * r, z], 1) for r, z in (profile[:, row], normals[:, row]))
        return out, up

    return over_square(name, SIDES, rows, point)


def cap(inner: float, outer: float, height: float) -> Strip:
    """Return a flat ring from one radius to another; its front is up where the second one is smaller."""
    up = 1.0 if outer < inner else -1.0
    return np.array([[inner, outer], [height, height]]), np.array([[0.0, 0.0], [up, up]])


def slope(radii: tuple[float, float], heights: tuple[float, float]) -> Strip:
    """Return the side of a cylinder or a cone, from its lower to its upper end."""
    normal = np.array([heights[1] - heights[0], radii[0] - radii[1]])
    return np.array([radii, heights]), np.repeat((normal / np.linalg.norm(normal))[:, None], 2, 1)


def arc(radius: float, half: float = 0.0) -> Strip:
    """Return a half circle from the lower pole to the upper one, whose halves are 2·`half` apart."""
    quarter = np.arange(RINGS // 2 + 1) / (4 * (RINGS // 2))
    turns = np.concatenate([quarter - 0.25, quarter])
    sin, cos = sin_cos_turns(turns)
    sides = np.where(np.arange(len(turns)) > RINGS // 2, half, -half)
    return np.stack([radius * cos, radius * sin + sides]), np.stack([cos, sin])


def as_meshes(shapes: Sequence[Shape], name: str, losses: Losses) -> list[Shape]:
    """Return shapes that may be stretched: meshes in place of spheres and cylinders."""
    out: list[Shape] = []
    for shape in shapes:
        raw = None
        if isinstance(shape, Sphere):
            raw = ball(shape)
        elif isinstance(shape, Cylinders):
            raw = stacked("", _pipes(shape))
        if raw is None:
            out.append(shape)
            continue
        raw.name, raw.material, raw.emission = shape.name, shape.material, shape.emission
        mesh = build(name, raw, losses)
        out += [] if mesh is None else [mesh]
    return out


def _pipes(shape: Cylinders) -> list[RawMesh]:
    radii = np.broadcast_to(shape.radii, shape.count).tolist()
    return [_pipe(*cylinder) for cylinder in zip(shape.starts, shape.ends, radii, strict=True)]


def ball(sphere: Sphere, turn: Doubles | None = None) -> RawMesh:
    """Return a sphere as a mesh, with its texture coordinates; turned by a matrix in place of its own."""
    if turn is None:
        turn = np.eye(3) if sphere.transform is None else sphere.transform

    def point(u: Doubles, v: Doubles) -> tuple[Doubles, Doubles]:
        (sin, cos), (up, level) = sin_cos_turns(u - 0.5), sin_cos_turns(v / 2 - 0.25)
        normal = np.stack([sin * level, up, cos * level], 1) @ turn.T
        return normal * sphere.radius + sphere.center, normal

    return over_square("sphere", SIDES, RINGS, point)


def _pipe(start: Doubles, end: Doubles, radius: float) -> RawMesh:
    """Return the side of a cylinder as a mesh."""
    along = end - start
    axis = along / np.linalg.norm(along)
    x = np.cross(axis, np.eye(3)[np.abs(axis).argmin()])
    x = x / np.linalg.norm(x)
    y = np.cross(axis, x)

    def point(u: Doubles, v: Doubles) -> tuple[Doubles, Doubles]:
        sin, cos = sin_cos_turns(u)
        normal = cos[:, None] * x + sin[:, None] * y
        return start + v[:, None] * along + radius * normal, normal

    return over_square("cylinder", SIDES, 1, point)
