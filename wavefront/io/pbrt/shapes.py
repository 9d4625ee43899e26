"""Shapes of pbrt."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ...arrays.elementary import arccos, sin_cos_turns
from ...arrays.vec import Doubles
from ...core.errors import SceneError
from ...shapes import Group, Mesh, Shape, Sphere
from ...shapes.transform import EVEN, Matrix, is_even
from ...textures.base import BaseTexture
from ..description.computed import clipped, computed, product
from ..description.conversion import placed, textures_in
from ..description.entity import ABOVE_0, Entity, Limit
from ..description.placing import facing, in_range, moved_raw
from ..repair import RawMesh, build, existing, with_corner_uvs, with_split_corners
from ..surfaces import RINGS, SIDES, over_square
from ..trimesh_library import import_trimesh
from .entities import Job, converts, placement, unsupported
from .mappings import Mapped, Mapping
from .materials import material_of
from .textures import scalar

TURN = Limit(lambda x: 0 < x <= 360, "above 0 and at most 360 degrees")
ROUND = 1e-5  # relative difference of the scales along two axes that is taken for rounding
POINTS, PAIRS, NORMALS = ("point3", "point"), ("point2", "float"), ("normal3", "normal")


@converts("shape", "sphere")
def _sphere(entity: Entity) -> RawMesh:
    radius = _radius(entity)
    low, high = sorted(entity.number(f"z{end}", at * radius) for end, at in (("min", -1), ("max", 1)))
    # polar angles in half turns, from the lower end to the upper one
    begin, end = (float(arccos(np.clip(np.float64(z / radius), -1, 1))) / np.pi for z in (low, high))
    turns = _turns(entity)

    def point(u: Doubles, v: Doubles) -> tuple[Doubles, Doubles]:
        sin, cos = sin_cos_turns((begin + (end - begin) * v) / 2)
        around = sin_cos_turns(u * turns)
        normal = np.stack([around[1] * sin, around[0] * sin, cos], 1)
        return normal * radius, normal

    return over_square("sphere", SIDES, RINGS, point)


@converts("shape", "cylinder")
def _cylinder(entity: Entity) -> RawMesh:
    radius, turns = _radius(entity), _turns(entity)
    low, high = sorted((entity.number("zmin", -1.0), entity.number("zmax", 1.0)))

    def point(u: Doubles, v: Doubles) -> tuple[Doubles, Doubles]:
        sin, cos = sin_cos_turns(u * turns)
        normal = np.stack([cos, sin, np.zeros_like(u)], 1)
        return normal * radius + (low + (high - low) * v)[:, None] * (0, 0, 1), normal

    return over_square("cylinder", SIDES, 1, point)


@converts("shape", "disk")
def _disk(entity: Entity) -> RawMesh:
    radius, turns, height = _radius(entity), _turns(entity), entity.number("height", 0.0)
    inner = entity.number("innerradius", 0.0, Limit(lambda x: 0 <= x < radius, f"from 0 to below {radius:g}"))

    def point(u: Doubles, v: Doubles) -> tuple[Doubles, None]:
        sin, cos = sin_cos_turns(u * turns)
        size = radius + (inner - radius) * v
        return np.stack([cos * size, sin * size, np.full_like(u, height)], 1), None

    return over_square("disk", SIDES, 1, point)


@converts("shape", "trianglemesh", harmless="faceIndices")
def _triangle_mesh(entity: Entity) -> RawMesh:
    return _arrays(entity, 3)


@converts("shape", "bilinearmesh", harmless="faceIndices")
def _bilinear_mesh(entity: Entity) -> RawMesh:
    raw = _arrays(entity, 4)
    patches = raw.faces.reshape(-1, 4)
    a, b, c, d = (raw.vertices[patches[:, i]] for i in range(4))
    size = np.abs(np.stack([b - a, c - a, d - a])).max((0, 2))
    if (np.abs((np.cross(b - a, c - a) * (d - a)).sum(1)) > 1e-6 * size**3).any():
        entity.lose("the curvature of its patches; two triangles for each")
    if raw.uvs is None:
        raw = with_corner_uvs(raw, ((0, 0), (1, 0), (0, 1), (1, 1)))
        patches = raw.faces.reshape(-1, 4)
    return replace(raw, faces=patches[:, [0, 1, 3, 0, 3, 2]].reshape(-1, 3))


@converts("shape", "plymesh")
def _ply_mesh(entity: Entity) -> RawMesh:
    path = entity.job.find(entity.text("filename", ""))
    raws = entity.job.once(path, lambda: entity.job.read_mesh(path))
    if not raws:
        raise SceneError(f"{path}: has no faces")
    faces = raws[0].faces
    exists = entity.job.once(
        (path, "there"), lambda: existing(entity.lost, entity.label, faces, len(raws[0].vertices))
    )
    raw = raws[0] if exists.all() else replace(raws[0], faces=faces[exists])
    return replace(raw, name=path.name.partition(".")[0], colors=None)


@converts("shape", "loopsubdiv", harmless="scheme")
def _loop(entity: Entity) -> RawMesh:
    raw, levels = _arrays(entity, 3), entity.whole("levels", 3, 0, 16)
    entity.job.files.limits.check_triangles(entity.label, len(raw.faces) * 4**levels)
    used, faces = np.unique(raw.faces, return_inverse=True)  # trimesh refuses vertices without faces
    subdivided = import_trimesh().remesh.subdivide_loop
    try:
        vertices, faces = subdivided(raw.vertices[used], faces.reshape(-1, 3), levels)
    except (ValueError, IndexError, AssertionError) as error:
        raise SceneError(f"cannot be subdivided: {error}") from error
    return RawMesh("loopsubdiv", vertices, faces, smooth=True)


unsupported("shape", "curve")


def _radius(entity: Entity) -> float:
    return entity.number("radius", 1.0, ABOVE_0)


def _turns(entity: Entity) -> float:
    return entity.number("phimax", 360.0, TURN) / 360


def _arrays(entity: Entity, corners: int) -> RawMesh:
    """Return the arrays of a shape, as they are; its faces have a number of corners."""
    vertices = entity.get("P", None, *POINTS)
    if vertices is None:
        raise SceneError("has no P")
    indices = entity.get("indices", None, "integer")
    if indices is None:
        if len(vertices) != corners:
            raise SceneError(f"has {len(vertices)} points and no indices")
        indices = np.arange(corners)
    whole = len(indices) // corners * corners
    if whole < len(indices):
        entity.lose(f"has {len(indices)} indices; a face has {corners}; the last ones left out")
    faces = indices[:whole].astype(np.intp).reshape(-1, corners)
    exists = existing(entity.lost, entity.label, faces, len(vertices))
    raw = RawMesh(entity.type, vertices, faces[exists])
    coordinates = entity.get("uv", None, *PAIRS)
    if coordinates is None:
        coordinates = entity.get("st", None, *PAIRS)
    raw.normals = _rows(entity, "N", entity.get("N", None, *NORMALS), len(vertices))
    if coordinates is not None:
        coordinates = np.ravel(coordinates)
        coordinates = coordinates[: len(coordinates) // 2 * 2].reshape(-1, 2)
    raw.uvs = _rows(entity, "uv", coordinates, len(vertices))
    return raw


def _rows(entity: Entity, name: str, rows: Doubles | None, count: int) -> Doubles | None:
    """Return values of vertices; None, which is noted, if there is not one for each."""
    if rows is None or len(rows) == count:
        return rows
    entity.lose(f"{name} has {len(rows)} rows; P has {count}; left out")
    return None


def place(entity: Entity) -> list[Shape]:
    """Return a shape where it stands in the scene."""
    with entity.lost.part(entity.label), placed(entity.label):
        return _shapes(entity, placement(entity), entity.state.area)
    return []


def place_object(entities: Sequence[Entity], job: Job, matrices: Matrix) -> list[Shape]:
    """Return the shapes of an object at each of several places, (n, 4, 4)."""
    even = is_even(matrices, EVEN)
    shapes: list[Shape] = []
    for entity in entities:
        with job.files.losses.part(entity.label), placed(entity.label):
            job.count_instances(len(matrices))
            if entity.state.area is not None:
                entity.lose("the light of a shape in an object")
            placed_shapes = _shapes(entity, placement(entity), None, even)
            if any(_mappings(shape.material) for shape in placed_shapes):
                entity.lose("where its instances are; all have the texture coordinates of the object")
            shapes += placed_shapes
    label = entities[0].label if entities else job.name
    with job.files.losses.part(label), placed(label):
        return list(Group(shapes).placed(job.world @ matrices @ np.linalg.inv(job.world)))
    return []


def _shapes(entity: Entity, matrix: Matrix, light: Entity | None, even: bool = True) -> list[Shape]:
    """Return a shape, placed by a matrix, which may be an area light; `even` if it is not stretched later."""
    exact = _exact_sphere(entity, matrix, light) if even else None
    shape = exact or _mesh(entity, matrix, light)
    return [] if shape is None else [shape]


def _exact_sphere(entity: Entity, matrix: Matrix, light: Entity | None) -> Sphere | None:
    """Return a sphere that needs no mesh: a whole one, without textures, that is not stretched."""
    if entity.type != "sphere" or entity.values.keys() - {"radius", "alpha"} or entity.state.reverse:
        return None
    if not is_even(matrix[None], ROUND):
        return None
    alpha = _opacity(entity, light)
    radius = _radius(entity) * float(np.linalg.svd(matrix[:3, :3], compute_uv=False)[0])
    material = material_of(entity, alpha)
    emission, _ = _emission(light, 4 * np.pi * radius * radius)
    if textures_in((material, emission)):
        return None
    return Sphere(matrix[:3, 3], radius, material=material, emission=emission)


def _mesh(entity: Entity, matrix: Matrix, light: Entity | None) -> Mesh | None:
    """Return the mesh of a shape, placed by a matrix, which may be an area light."""
    raw = entity.job.convert(entity)
    if not raw:
        return None
    if not in_range(matrix[None])[0]:
        raise SceneError("is placed by a matrix whose elements are too large")
    with np.errstate(over="ignore", invalid="ignore"):
        raw = moved_raw(facing(raw, entity.state.reverse), matrix)
        area = _area(raw) if light else 0.0
    entity.job.count(raw.faces)
    raw.material = material_of(entity, _opacity(entity, light))
    raw.emission, raw.two_sided = _emission(light, area)
    return build(entity.place, _with_coordinates(entity, raw), entity.lost)


def _with_coordinates(entity: Entity, raw: RawMesh) -> RawMesh:
    """Return a mesh with the texture coordinates that its textures need and that it has not."""
    parts = raw.material, raw.emission
    mappings = _mappings(parts)
    if raw.uvs is None and textures_in(parts):
        raw = with_corner_uvs(raw, ((0, 0), (1, 0), (1, 1)))  # as in pbrt
    if mappings:
        first, *more = mappings.values()
        if more:
            entity.lose("a second mapping by the place; the first one in its place")
        raw = replace(with_split_corners(raw), uvs1=first.at_corners(raw.vertices, raw.faces))
    return raw


def _opacity(entity: Entity, light: Entity | None) -> Any:
    """Return the opacity of a shape; None where none is given."""
    if "alpha" not in entity.values:
        return None
    alpha = clipped(scalar(entity, "alpha", 1.0))
    if light is None or isinstance(alpha, BaseTexture) or alpha > 0:
        return alpha
    entity.lose("alpha 0 of an area light, which pbrt does not show; it is seen")
    return None


def _emission(light: Entity | None, area: float) -> tuple[Any, bool]:
    """Return the radiance of an area light, and whether it leaves both sides; None if there is no light."""
    emission = None if light is None else light.job.convert(light)
    if light is None or emission is None:
        return None, False
    radiance, luminance, two_sided = emission
    power = light.number("power", -1.0)
    if power > 0 and luminance > 0 and area > 0:
        radiance = computed(product, radiance, power / (luminance * area * np.pi * (2 if two_sided else 1)))
    return radiance, two_sided


def _area(raw: RawMesh) -> float:
    """Return the area of a mesh."""
    a, b, c = (raw.vertices[raw.faces[:, i]] for i in range(3))
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum()) / 2


def _mappings(appearance: Any) -> dict[Any, Mapping]:
    """Return the mappings by the place of the textures of a material or an emission."""
    mappings = (texture.mapping for texture in textures_in(appearance, Mapped))
    return {mapping.key: mapping for mapping in mappings if mapping.coordinates is not None}
