"""Shapes of Mitsuba."""

from __future__ import annotations

import os
from copy import deepcopy
from dataclasses import replace
from typing import Any

import numpy as np

from ...arrays.elementary import sin_cos_turns
from ...arrays.vec import Doubles, Ints
from ...bsdfs import Diffuse, Sides
from ...core.errors import SceneError, as_array
from ...materials import Material
from ...shapes import Cylinders, Group, Shape, SignedDistanceGrid, Sphere
from ...shapes.smoothing import corner_angles, facet_normals, same_rows
from ...shapes.transform import EVEN, Matrix, is_even
from ...textures.base import BaseTexture
from ...textures.image import Texture
from ..description.computed import computed
from ..description.conversion import textures_in
from ..description.entity import ABOVE_0, Entity
from ..description.placing import facing, moved_raw
from ..description.views import frame
from ..joining import COLUMNS, stacked
from ..repair import RawMesh, build, with_corner_uvs
from ..surfaces import as_meshes, ball
from ..volumes import parsed_grid
from .attributes import with_attribute
from .bsdfs import FacingSides, is_one_sided, solid
from .media import interior_of
from .nodes import TABLE, Job, plugin, unsupported
from .serialized import read_serialized
from .textures import upside_down
from .transforms import to_world

SIDES = 128  # of round shapes that are meshes
ROUND = 1e-4  # relative difference of the scales along two axes that is taken for rounding
POLES = np.array([[0.0, 0, -1], [-1, 0, 0], [0, 1, 0]])  # from the axes of a `Sphere` to those of Mitsuba
LEAST_OPACITY = 1 / 32  # of a surface that emits, which has all of its light all the same
CORNERS = ((0, 0), (1, 0), (0, 1))  # texture coordinates of faces that have none
SURFACE, PARTS = "to_world flip_normals", "bsdf emitter medium sensor"


@plugin("rectangle", "shape", SURFACE, PARTS)
def _rectangle(entity: Entity) -> list[Shape]:
    corners = np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    return _mesh(entity, RawMesh("rectangle", corners, faces, uvs=(corners[:, :2] + 1) / 2))


@plugin("cube", "shape", SURFACE, PARTS)
def _cube(entity: Entity) -> list[Shape]:
    sides = ((1, 5, 4, 0), (3, 2, 6, 7), (1, 3, 7, 5), (5, 7, 6, 4), (4, 6, 2, 0), (3, 1, 0, 2))
    number = np.array(sides).reshape(-1)  # of a corner: a bit for each axis
    corners = np.stack([number & 1, number >> 1 & 1, number >> 2], 1) * 2.0 - 1
    faces = np.array([[0, 1, 2], [0, 2, 3]]) + 4 * np.arange(6)[:, None, None]
    uvs = np.tile([[0.0, 1], [1, 1], [1, 0], [0, 0]], (6, 1))
    raw, (low, high) = RawMesh("cube", corners, faces.reshape(-1, 3), uvs=uvs), _box(to_world(entity))
    outside = entity.job.eye is None or bool(((entity.job.eye < low) | (entity.job.eye > high)).any())
    return _mesh(entity, raw, closed=outside)


@plugin("disk", "shape", SURFACE, PARTS, note="a mesh of 128 triangles")
def _disk(entity: Entity) -> list[Shape]:
    ring, turns = _ring(np.sqrt(2 * np.pi / SIDES / sin_cos_turns(np.array([1 / SIDES]))[0][0]))
    count = np.arange(SIDES)
    flat = np.hstack([ring, np.zeros((SIDES + 1, 1))])
    vertices = np.concatenate([flat, np.zeros((SIDES, 3))])
    uvs = np.concatenate(
        [np.stack([np.ones(SIDES + 1), turns], 1), np.stack([np.zeros(SIDES), turns[:-1] + 0.5 / SIDES], 1)]
    )
    faces = np.stack([SIDES + 1 + count, count, count + 1], 1)
    return _mesh(entity, RawMesh("disk", vertices, faces, uvs=uvs))


@plugin(
    "cylinder",
    "shape",
    f"{SURFACE} p0 p1 radius",
    PARTS,
    note="a mesh where it shines, is textured or elliptic",
)
def _cylinder(entity: Entity) -> list[Shape]:
    start, end = entity.vector("p0", (0, 0, 0)), entity.vector("p1", (0, 0, 1))
    radius = entity.number("radius", 1.0, ABOVE_0)
    if not (end - start).any():
        raise SceneError(f"p0 and p1 are both {start.tolist()}")
    axes, matrix = frame(end - start), to_world(entity)
    material, emission = _appearance(entity)
    around = np.linalg.norm(matrix[:3, :3] @ axes[:, :2], axis=0)
    needs_faces = emission is not None or entity.children("sensor") or entity.flag("flip_normals")
    even = abs(around[1] - around[0]) <= ROUND * around[0]
    if even and not needs_faces and not textures_in(material, Texture) and not _has_grain(material):
        ends = np.stack([start, end]) @ matrix[:3, :3].T + matrix[:3, 3]
        size, name = radius * around[0], entity.name or "cylinders"
        return [Cylinders(ends[:1], ends[1:], size, caps=False, material=material, name=name)]
    ring, turns = _ring(1.0)
    across = ring @ axes[:, :2].T
    vertices = np.concatenate([start + radius * across, end + radius * across])
    uvs = np.concatenate([np.stack([turns, np.full(SIDES + 1, v)], 1) for v in (0.0, 1.0)])
    k = np.arange(SIDES)
    low, high = (k, k + 1), (k + SIDES + 1, k + SIDES + 2)
    faces = np.stack([low[0], low[1], high[1], low[0], high[1], high[0]], 1).reshape(-1, 3)
    return _mesh(entity, RawMesh("cylinder", vertices, faces, np.tile(across, (2, 1)), uvs))


@plugin(
    "sphere", "shape", f"{SURFACE} center radius", PARTS, note="one radius; a mesh where its front is inside"
)
def _sphere(entity: Entity) -> list[Shape]:
    center, radius, matrix = _placed_ball(entity)
    mirrored = bool(np.linalg.det(matrix[:3, :3]) < 0)
    inward = entity.flag("flip_normals") != mirrored  # a reflection turns the normals, but of no other shape
    closed = entity.job.eye is None or bool(np.linalg.norm(entity.job.eye - center) > radius)
    material, emission = _appearance(entity, closed and not inward)
    turn = None
    if {"uv", "tangent_frame"} & _reads((material, emission)):
        material, emission = _for_spheres(material, emission, entity.job)
        left, _, right = np.linalg.svd(matrix[:3, :3])
        turn = left @ right @ POLES
    improper, name = turn is not None and mirrored, entity.name or "sphere"
    sphere = Sphere(
        center,
        radius,
        material=material,
        emission=emission,
        transform=None if improper else turn,
        name=name,
    )
    if not (inward or improper or (emission is not None and material.opacity is not None)):
        return [sphere]
    raw = facing(ball(sphere, turn), reverse=inward)
    return _built(entity, replace(raw, name=name, material=material, emission=emission))


def _placed_ball(entity: Entity) -> tuple[Doubles, float, Matrix]:
    """Return the center and the radius of a sphere in the scene, and its transform."""
    center = entity.vector("center", (0, 0, 0))
    radius = entity.number("radius", 1.0, ABOVE_0)
    matrix = to_world(entity)
    scale = np.linalg.svd(matrix[:3, :3], compute_uv=False)
    if scale[0] - scale[2] > ROUND * scale[0]:
        entity.lose("to_world, which scales unevenly")
    center = matrix[:3, :3] @ center + matrix[:3, 3]
    return center, radius * float(np.linalg.norm(matrix[:3, 0])), matrix


@plugin("obj ply", "shape", f"{SURFACE} filename face_normals flip_tex_coords", PARTS)
def _file(entity: Entity) -> list[Shape]:
    path = entity.job.find(entity.text("filename"))
    raw = entity.job.once(path, lambda: _merged(str(path), entity.job.read_mesh(path)))
    raw = with_attribute(entity.job.name, replace(raw), entity)
    if entity.flag("flip_tex_coords", entity.type == "obj") and raw.uvs is not None:
        raw = replace(raw, uvs=raw.uvs * (1, -1) + (0, 1))
    return _mesh(entity, replace(raw, name=path.stem), of_file=True)


@plugin("serialized", "shape", f"{SURFACE} filename shape_index face_normals", PARTS, note="versions 3 and 4")
def _serialized(entity: Entity) -> list[Shape]:
    path = entity.job.find(entity.text("filename"))
    key = (path, entity.whole("shape_index", 0))
    data = entity.job.once(path, lambda: entity.job.files.read(path))
    raw = entity.job.once(key, lambda: read_serialized(str(path), data, key[1], entity.job.files))
    return _mesh(entity, raw, of_file=True)


@plugin("sdfgrid", "shape", "to_world filename grid normals", PARTS)
def _distance_grid(entity: Entity) -> list[Shape]:
    if "filename" in entity.values:
        path = entity.job.find(entity.text("filename"))
        values, _ = parsed_grid(os.fspath(path), entity.job.files.read(path), entity.job.files.budget)
    else:
        values = as_array("grid", entity.get("grid"))
        if values.ndim != 4 or values.shape[3] != 1:
            raise SceneError(f"grid has shape {values.shape}; it must have shape (z, y, x, 1)")
        values = values[..., 0]
    material, emission = _appearance(entity)
    if emission is not None:
        raise SceneError("has an area light; it cannot emit light")
    smooth = entity.choice("normals", "smooth", ("analytic", "smooth")) == "smooth"
    name = entity.name or "sdfgrid"
    return [SignedDistanceGrid(values, to_world(entity), smooth=smooth, material=material, name=name)]


@plugin("shapegroup merge", "shape", holds="shape")
def _group(entity: Entity) -> list[Shape]:
    """Return its shapes, which are placed by instances."""
    for sensor in (sensor for child in entity.children("shape") for sensor in child.children("sensor")):
        sensor.lose("left out, as it is in a group")
    return [shape for child in entity.children("shape") for shape in entity.job.convert(child)]


@plugin("instance", "shape", "to_world", holds="shape")
def _instance(entity: Entity) -> list[Shape]:
    group, matrix = entity.only("shape"), to_world(entity)
    if group.type != "shapegroup":
        raise SceneError(f"holds a {group.type}; it must be a shapegroup")
    job = entity.job
    shapes = job.convert(group)
    if not is_even(matrix[None], EVEN):
        shapes = job.once((group, "meshes"), lambda: as_meshes(shapes, job.name, job.files.losses))
    job.count_instances(len(shapes))
    return list(Group(shapes).placed(matrix, name=entity.name or None))


unsupported("shape", "blender bsplinecurve linearcurve ellipsoids ellipsoidsmesh")


def _mesh(entity: Entity, raw: RawMesh, of_file: bool = False, closed: bool = False) -> list[Shape]:
    """Return a mesh where to_world places it; that of a file has normals, unless face_normals is set."""
    with np.errstate(over="ignore", invalid="ignore"):
        raw = _of_file(entity, raw) if of_file else moved_raw(raw, to_world(entity))
    if entity.flag("flip_normals"):
        normals = None if raw.normals is None else -raw.normals
        raw = replace(raw, faces=raw.faces[:, ::-1], normals=normals)
    entity.job.count(raw.faces)
    material, emission = _appearance(entity, closed, of_file and raw.normals is not None)
    if raw.uvs is None and {"uv", "tangent_frame"} & _reads((material, emission)):
        raw = with_corner_uvs(raw, CORNERS)
    name = entity.name or raw.name
    return _built(entity, replace(raw, name=name, material=material, emission=emission))


def _built(entity: Entity, raw: RawMesh) -> list[Shape]:
    """Return the mesh of a shape; nothing where it has no faces."""
    mesh = build(entity.job.name, raw, entity.lost)
    return [] if mesh is None else [mesh]


def _of_file(entity: Entity, raw: RawMesh) -> RawMesh:
    """Return a mesh of a file where to_world places it.

    Its front is where its normals point, and else where its faces do: then a reflection turns it.
    """
    if entity.flag("face_normals"):
        raw = replace(raw, normals=None)
    moved = replace(moved_raw(raw, to_world(entity)), tangents=None)
    if moved.normals is not None:
        return facing(moved, reverse=False)
    moved.faces = raw.faces
    if not entity.flag("face_normals"):
        moved.normals = angle_normals(moved.vertices, moved.faces)
    return moved


def angle_normals(vertices: Doubles, faces: Ints) -> Doubles:
    """Return normals (n, 3): sums of those of the faces at each vertex, weighted by their angles there.

    Vertices of one place, as on seams of texture coordinates, have normals of their own, as in Mitsuba.
    Source: G. Thürmer and C. Wüthrich 1998, "Computing Vertex Normals from Polygonal Facets".
    """
    exists = ((faces >= 0) & (faces < len(vertices))).all(1)
    corners = faces[exists].ravel()
    flat, angles = facet_normals(vertices, faces[exists]), corner_angles(vertices[faces[exists]]).ravel()
    sums = [np.bincount(corners, np.repeat(row, 3) * angles, len(vertices)) for row in flat]
    return np.nan_to_num(np.stack(sums, 1))  # of vertices that are not finite; their faces are left out


def _reads(appearance: Any) -> set[str]:
    """Return the fields of surfaces that the textures of a material or an emission read."""
    textures: list[BaseTexture] = textures_in(appearance)
    return {name for texture in textures for name in texture.reads}


def _has_grain(material: Material) -> bool:
    """Return whether a material scatters along its tangents otherwise than across them."""
    return "tangent_frame" in _reads(material)


def _appearance(entity: Entity, closed: bool = False, bent: bool = False) -> tuple[Material, Any]:
    """Return the material and the emission of a shape; `bent` where it has normals other than its own."""
    bsdfs, emitters = entity.children("bsdf"), entity.children("emitter")
    for extra in (*bsdfs[1:], *emitters[1:]):
        entity.lose(f"a second {extra.kind}")
    emission = _emission(entity, emitters[0]) if emitters else None
    if not bsdfs:
        material = entity.job.made.setdefault(not emitters, Material(Diffuse(0 if emitters else 0.5)))
        one_sided = not emitters
    else:
        material, one_sided = entity.job.convert(bsdfs[0]), is_one_sided(bsdfs[0])
    interior = interior_of(entity, hollow=material.alpha is not None)
    if emission is not None and material.alpha is not None:
        alpha, emission = _shining(material.alpha, emission)
        material = solid(material, entity.job)
        material = entity.job.changed(material, alpha=alpha)
    if interior is not None:
        material = entity.job.changed(material, interior=interior)
    if one_sided and not (closed and material.alpha is None):
        kind = FacingSides if bent else Sides
        bsdf = entity.job.once((id(material.bsdf), kind), lambda: kind(material.bsdf))
        material = entity.job.changed(material, bsdf=bsdf)
    if emitters and entity.job.hides_lamps:
        material = entity.job.changed(material, visible_to_camera=False)
    return material, emission


def _emission(entity: Entity, emitter: Entity) -> Any:
    """Return the radiance of a shape; None without an area light."""
    if emitter.type != "area" and TABLE.find("emitter", emitter.type).convert is not None:
        entity.lose(f"the emitter {emitter.type!r}, which is no area light")
        return None
    return entity.job.convert(emitter)


def _shining(alpha: Any, emission: Any) -> tuple[Any, Any]:
    """Return the opacity and the radiance of a surface whose light is seen in full, whatever its opacity."""
    opacity = alpha if isinstance(alpha, BaseTexture) else float(np.ravel(alpha)[0])
    alpha = computed(_at_least, opacity, LEAST_OPACITY)
    return alpha, computed(_quotient, emission, alpha, rising=False)


def _at_least(alpha: Any, least: Any) -> Any:
    return np.maximum(alpha, least)


def _quotient(a: Any, b: Any) -> Any:
    return a / b


def _merged(name: str, raws: list[RawMesh]) -> RawMesh:
    """Return all meshes of a file as one."""
    if not raws:
        raise SceneError(f"{name}: has no faces")
    if len(raws) == 1:
        return raws[0]
    raw = stacked("", raws)
    if raw.normals is not None:
        return raw
    # a vertex of the file is one of the mesh, whatever the materials of its faces
    number = same_rows(raw.vertices if raw.uvs is None else np.hstack([raw.vertices, raw.uvs]))
    first = np.unique(number, return_index=True)[1]
    columns = {column: None if (rows := getattr(raw, column)) is None else rows[first] for column in COLUMNS}
    return replace(raw, faces=number[raw.faces], **columns)  # type: ignore[arg-type]


def _ring(radius: float) -> tuple[Doubles, Doubles]:
    """Return points on a circle (n, 2), the last of which is the first, and their turns (n,)."""
    turns = np.arange(SIDES + 1) / SIDES
    sin, cos = sin_cos_turns(turns)
    ring = radius * np.stack([cos, sin], 1)
    ring[-1] = ring[0]
    return ring, turns


def _box(matrix: Matrix) -> tuple[Doubles, Doubles]:
    """Return the lower and the upper corner of a cube from -1 to 1 that a matrix placed."""
    reach = np.abs(matrix[:3, :3]).sum(1)
    return matrix[:3, 3] - reach, matrix[:3, 3] + reach


def _for_spheres(material: Material, emission: Any, job: Job) -> tuple[Material, Any]:
    """Return both with their textures upside down: v of a `Sphere` is 1 where Mitsuba's is 0."""
    appearance = (material, emission)
    key = (*map(id, appearance), "sphere")
    if key not in job.made:
        memo = {id(texture): upside_down(texture) for texture in textures_in(appearance, Texture)}
        job.made[key] = (deepcopy(appearance, {**memo, **{id(memo): list(memo.values())}}), appearance)
    converted: tuple[Material, Any] = job.made[key][0]
    return converted
