"""Cubes, spheres, cylinders, cones, capsules and planes of USD as meshes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from ...core.errors import number, one_of
from ...shapes import Box, Mesh, Rectangle
from ..repair import RawMesh
from ..surfaces import arc, cap, revolved, slope
from .values import value_of

AXES = {"Z": [0, 1, 2], "X": [2, 0, 1], "Y": [1, 2, 0]}  # which coordinate of a shape along z becomes x, y, z


def gprim(prim: Any, time: Any) -> RawMesh:
    """Return the mesh of a prim of one of the types in `GPRIMS`."""

    def length(name: str, default: float) -> float:
        return number(name, float(value_of(prim, time, name, default)), lambda x: x > 0, "above 0")

    axis = str(value_of(prim, time, "axis", "Z"))
    return along(one_of("axis", axis, tuple(AXES)), GPRIMS[str(prim.GetTypeName())](length, axis))


def along(axis: str, raw: RawMesh) -> RawMesh:
    """Return a mesh about z that is turned about another axis."""
    order = AXES[axis]
    normals = None if raw.normals is None else raw.normals[:, order]
    return replace(raw, vertices=raw.vertices[:, order], normals=normals)


Length = Callable[[str, float], float]  # of a parameter and its default


def _flat(mesh: Mesh) -> RawMesh:
    return RawMesh("", mesh.vertices, mesh.faces, uvs=mesh.uvs)


def _cube(length: Length, axis: str) -> RawMesh:
    return _flat(Box((0, 0, 0), length("size", 2.0)))


def _plane(length: Length, axis: str) -> RawMesh:
    width, long = length("width", 2.0), length("length", 2.0)
    x, y = (width, long) if axis == "Z" else (long, width)
    return _flat(Rectangle((-x / 2, -y / 2, 0), (x, 0, 0), (0, y, 0)))


def _sphere(length: Length, axis: str) -> RawMesh:
    return revolved("sphere", [arc(length("radius", 1.0))])


def _cylinder(length: Length, axis: str) -> RawMesh:
    radius, half = length("radius", 1.0), length("height", 2.0) / 2
    side = slope((radius, radius), (-half, half))
    return revolved("cylinder", [cap(0.0, radius, -half), side, cap(radius, 0.0, half)])


def _cone(length: Length, axis: str) -> RawMesh:
    radius, half = length("radius", 1.0), length("height", 2.0) / 2
    return revolved("cone", [cap(0.0, radius, -half), slope((radius, 0.0), (-half, half))])


def _capsule(length: Length, axis: str) -> RawMesh:
    return revolved("capsule", [arc(length("radius", 0.5), length("height", 1.0) / 2)])


GPRIMS = {"Cube": _cube, "Plane": _plane, "Sphere": _sphere, "Cylinder": _cylinder}
GPRIMS |= {"Cone": _cone, "Capsule": _capsule}
