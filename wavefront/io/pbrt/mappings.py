"""The mappings of pbrt's textures: texture coordinates of a shape, or by the place in the scene."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...arrays.elementary import arctan2
from ...arrays.vec import Doubles, Ints
from ...core.errors import SceneError
from ...textures.image import Texture
from ..description.entity import Entity
from .entities import placement

TURN = 2 * np.pi


@dataclass(frozen=True, eq=False)
class Mapping:
    """How a texture gets its coordinates, which are those of the shape where `coordinates` is None."""

    transform: Doubles  # (3, 3) of the coordinates
    coordinates: Callable[[Doubles], Doubles] | None = None  # (n, 2) at points (n, 3) of the scene
    turns: int | None = None  # which coordinate turns about the axis, from 0 to 1
    key: tuple[Any, ...] = ()  # mappings of the same key are the same

    @property
    def uv_set(self) -> Any:
        """Where meshes have the coordinates: 0 for their `uvs`, 1 for their `uvs1`."""
        return 0 if self.coordinates is None else 1

    def at_corners(self, vertices: Doubles, faces: Ints) -> Doubles:
        """Return the coordinates of the corners of triangles, (3·m, 2): those of one triangle stay together.

        A corner on the axis, which has no direction, gets the mean of the other corners.
        """
        assert self.coordinates is not None
        coordinates = self.coordinates(vertices)[faces]  # (m, 3, 2)
        if self.turns is not None:
            turn = coordinates[..., self.turns]
            first = np.where(np.isnan(turn[:, :1]), turn[:, 1:2], turn[:, :1])
            turn = turn - np.rint(turn - first)
            undefined = np.isnan(turn)
            middle = np.where(undefined, 0, turn).sum(1) / np.maximum((~undefined).sum(1), 1)
            coordinates[..., self.turns] = np.where(undefined, middle[:, None], turn)
        return coordinates.reshape(-1, 2)


class Mapped:
    """A texture with a mapping."""

    mapping: Mapping


class MappedTexture(Texture, Mapped):
    """An image with a mapping."""


def mapping_of(entity: Entity) -> Mapping:
    """Return the mapping of a texture."""
    kind = entity.choice("mapping", "uv", ("uv", "spherical", "cylindrical", "planar"))
    if kind == "uv":
        scale_u, scale_v = (entity.number(name, 1.0) for name in ("uscale", "vscale"))
        rows = [scale_u, 0, _shift(entity, "u")], [0, scale_v, _shift(entity, "v")], [0, 0, 1]
        return Mapping(np.array(rows))
    matrix = placement(entity)
    if not np.linalg.cond(matrix[:3, :3]) < 1e12:
        raise SceneError(f"the transform of its mapping is singular: {matrix[:3, :3].tolist()}")
    inverse = np.asarray(np.linalg.inv(matrix), np.float64)
    key: tuple[Any, ...] = (kind, inverse.tobytes())
    if kind == "planar":
        axes = np.stack([entity.vector("v1", (1.0, 0, 0)), entity.vector("v2", (0, 1.0, 0))])
        shift = np.array([_shift(entity, axis) for axis in "uv"])
        key = (*key, axes.tobytes(), shift.tobytes())
        return Mapping(np.eye(3), lambda points: _local(inverse, points) @ axes.T + shift, key=key)
    make, turns = (_spherical, 1) if kind == "spherical" else (_cylindrical, 0)
    return Mapping(np.eye(3), lambda points: make(_local(inverse, points)), turns, key)


def _shift(entity: Entity, axis: str) -> float:
    return entity.number(f"{axis}delta", 0.0)


def _local(inverse: Doubles, points: Doubles) -> Doubles:
    return points @ inverse[:3, :3].T + inverse[:3, 3]


def _around(points: Doubles) -> Doubles:
    """Return the turn about z, NaN on the axis."""
    x, y, _ = points.T
    return np.where((x == 0) & (y == 0), np.nan, arctan2(y, x) / TURN)


def _spherical(points: Doubles) -> Doubles:
    """Return the angle from z over π, and the turn about it."""
    x, y, z = points.T
    return np.stack([arctan2(np.sqrt(x * x + y * y), z) / np.pi, _around(points) % 1], 1)


def _cylindrical(points: Doubles) -> Doubles:
    """Return the turn about z, from half a turn on, and z."""
    return np.stack([_around(points) + 0.5, points[:, 2]], 1)
