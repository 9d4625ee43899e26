"""The geometric AOVs of a picture: the first hit of the ray through the center of each pixel and the lens.

Nothing in them is random or filtered. A surface with alpha is met where its opacity is at least 0.5.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arrays.state import Hits, Rays, Words
from ..arrays.vec import Doubles, Ints, distinct, dot, f4, length
from ..camera import Camera
from ..compile.materials import material_parts
from ..compile.scene import CompiledScene
from ..film.aov_names import MASKS, aov_of
from ..materials import Material
from ..shapes import Instance, Mesh, Shape
from ..shapes.instance import kinds_of
from ..stages.generate import center_rays
from ..stages.interaction import interaction
from ..stages.passing import covering_hits
from .carried import carried, weights_on
from .flow import Flow

RAYS_AT_ONCE = 1 << 16
IDS = {"shape_id": "shape", "instance_id": "instance", "material_id": "material"}
NORMALS = ("normal", "normal_geometric")


class ShapeTable:
    """The numbers and names of shapes, instances and materials, as the AOVs have them.

    Parameters
    ----------
    shapes
        Those of the rendered scene.
    """

    def __init__(self, shapes: Sequence[Shape]) -> None:
        self.shapes = shapes
        self._materials: list[Material] = []
        numbers: dict[object, int] = {}  # by identity, and by the parts and the name
        kinds, kind = kinds_of(shapes)
        of_kind = [self._number(shape.material, numbers) for shape in kinds]
        self.material_of = np.array(of_kind, np.int32)[kind]
        placed = np.array([isinstance(shape, Instance) for shape in kinds])[kind]
        self.instance_of = np.where(placed, np.cumsum(placed) - 1, -1).astype(np.int32)

    def _number(self, material: Material, numbers: dict[object, int]) -> int:
        if id(material) not in numbers:
            number = numbers.setdefault((material.name, material_parts(material)), len(self._materials))
            numbers[id(material)] = number
            if number == len(self._materials):
                self._materials.append(material)
        return numbers[id(material)]

    def ids(self, name: str, shape: Ints) -> NDArray[np.int32]:
        """Return the ids of an AOV for the numbers of shapes (n,)."""
        if name == "shape_id":
            return shape.astype(np.int32)
        return (self.instance_of if name == "instance_id" else self.material_of).take(shape)

    def names(self, kind: str) -> dict[int, str]:
        """Return the name of each id of a kind: "shape", "instance" or "material"."""
        if kind == "shape":
            return {at: shape.name for at, shape in enumerate(self.shapes)}
        if kind == "instance":
            return {
                int(number): shape.name
                for number, shape in zip(self.instance_of, self.shapes, strict=True)
                if number >= 0
            }
        named = [material.name or type(material.bsdf).__name__ for material in self._materials]
        return dict(enumerate(named))


def geometric_aovs(
    scene: CompiledScene,
    camera: Camera,
    shapes: ShapeTable,
    names: Sequence[str],
    flow: Flow | None = None,
) -> dict[str, NDArray[Any]]:
    """Return geometric AOVs of a picture by name, (height, width) or (height, width, channels).

    Parameters
    ----------
    scene
        The compiled scene.
    camera
        In the scene's own unit of length.
    shapes
        Those of the scene.
    names
        The AOVs that are asked for.
    flow
        How surfaces go on to other times, if AOVs of flow are asked for.
    """
    width, height = camera.size
    layers = {name: _empty(name, width * height) for name in names}
    view = scene.view(camera)
    corners = _Corners(shapes.shapes) if "uv" in names else None
    for span, pixel in pixel_spans(width * height):
        center = center_rays(scene, view, pixel)
        moved, hits = covering_hits(scene, center)
        met = hits.found
        if not met.size:
            continue
        hits = hits.take(met)
        rays = center.take(met), moved.take(met)
        for name, values in _aovs_of_hits(scene, camera, shapes, corners, names, *rays, hits):
            layers[name][span][met] = values
        if flow is not None:
            shape, face = scene.shape_numbers.of(hits), scene.shape_numbers.face(hits)
            seen = view.address(pixel[met]).astype(np.int64)
            for name, values in flow.layers(names, seen, shape, face, _points(scene, *rays, hits)[0]):
                layers[name][span][met] = values
    return {
        name: values.reshape((height, width) if values.ndim == 1 else (height, width, -1))
        for name, values in layers.items()
    }


def _empty(name: str, pixels: int) -> NDArray[Any]:
    """Return an AOV without any hit."""
    if name in (*IDS, *MASKS):
        return np.full(pixels, -1, np.int32)
    channels = aov_of(name).channels
    return np.full(pixels if channels == 1 else (pixels, channels), np.nan, f4)


def pixel_spans(pixels: int) -> Iterator[tuple[slice, Words]]:
    """Yield spans of pixels, and the numbers of these."""
    for start in range(0, pixels, RAYS_AT_ONCE):
        end = min(start + RAYS_AT_ONCE, pixels)
        yield slice(start, end), np.arange(start, end, dtype=np.uint32)


def _aovs_of_hits(
    scene: CompiledScene,
    camera: Camera,
    shapes: ShapeTable,
    corners: _Corners | None,
    names: Sequence[str],
    center: Rays,
    moved: Rays,
    hits: Hits,
) -> Iterator[tuple[str, NDArray[Any]]]:
    """Yield the AOVs of rays that hit something: (n,) or (n, channels)."""
    shape = scene.shape_numbers.of(hits)
    for name in IDS:
        if name in names:
            yield name, shapes.ids(name, shape)
    point, distance = _points(scene, center, moved, hits)
    if "position" in names:
        yield "position", point
    if "distance" in names:
        yield "distance", distance
    if "depth" in names:
        time = center.time
        yield "depth", camera.project(point)[1] if time is None else camera.project_at(point, time)[1]
    if corners is not None:
        yield "uv", _uv(scene, corners, shape, point, moved, hits)
    if any(name in names for name in NORMALS):
        surface = interaction(scene, moved, hits)
        for tilt in scene.program.tilt:
            tilt(scene, moved, surface)
        if "normal" in names:
            yield "normal", surface.ns.T
        if "normal_geometric" in names:
            yield "normal_geometric", surface.ng.T


def _uv(
    scene: CompiledScene, corners: _Corners, shape: Ints, point: Doubles, rays: Rays, hits: Hits
) -> Doubles:
    """Return texture coordinates (n, 2) of points (n, 3), NaN where there are none.

    Of rays with times, points are carried to where shapes are at their start, and curved ones in the tables.
    """
    face, shapes, first = scene.shape_numbers.face(hits), corners.shapes, point
    if rays.time is not None:
        start = min((element.time_span[0] for element in shapes if element.moves), default=0.0)
        first = carried(shapes, shape, face, point, rays.time, np.full(len(point), start))
    uv = corners.uv(shape, face, first)
    curved = np.flatnonzero(hits.prim >= scene.triangles)
    if curved.size:
        met = rays.take(curved)
        on = met.origin + met.direction * hits.t.take(curved)
        if met.time is not None and scene.motion is not None:
            then = np.full(curved.size, scene.motion.shutter.middle)
            places = carried(shapes, shape[curved], face[curved], point[curved], met.time, then)
            on = (places * scene.scale - scene.center).T.astype(f4)
        uv[curved] = scene.curved.uv(hits.prim.take(curved) - scene.triangles, on).T
    return uv


def _points(scene: CompiledScene, center: Rays, moved: Rays, hits: Hits) -> tuple[Doubles, Doubles]:
    """Return the points that rays meet, (n, 3), and their distances (n,), in the scene's own unit.

    `moved` are the rays behind passed surfaces, a little beside the line. The points are on it.
    """
    direction = center.direction.astype(np.float64)
    direction /= length(direction)
    origin = center.origin.astype(np.float64)
    met = moved.origin.astype(np.float64) + moved.direction.astype(np.float64) * hits.t
    distance = dot(met - origin, direction)
    points = (scene.center[:, None] + origin + direction * distance) / scene.scale
    return np.ascontiguousarray(points.T), np.asarray(distance / scene.scale, np.float64)


class _Corners:
    """The triangles of the user's shapes, for values at points on them."""

    def __init__(self, shapes: Sequence[Shape]) -> None:
        self.shapes = shapes
        meshes = [shape.mesh if isinstance(shape, Instance) else shape for shape in shapes]
        numbers: dict[int, int] = {}
        self._of_shape = np.array([numbers.setdefault(id(mesh), len(numbers)) for mesh in meshes], np.intp)
        self._meshes: Mapping[int, Shape] = {numbers[id(mesh)]: mesh for mesh in meshes}

    def uv(self, shape: Ints, face: Ints, point: Doubles) -> Doubles:
        """Return texture coordinates (n, 2) at points (n, 3) on faces of meshes, NaN where there are none."""
        out = np.full((len(shape), 2), np.nan)
        number = self._of_shape.take(shape)
        for mesh in distinct(number):
            lanes = np.flatnonzero(number == mesh)
            out[lanes] = self._uv(self._meshes[mesh], shape.take(lanes), face.take(lanes), point[lanes])
        return out

    def _uv(self, mesh: Shape, shape: Ints, face: Ints, point: Doubles) -> Doubles:
        if not isinstance(mesh, Mesh) or mesh.uvs is None:
            return np.full((len(point), 2), np.nan)
        face, b1, b2 = weights_on(mesh.faces, mesh.vertices, face, point, partial(self._placed, shape))
        at_a, at_b, at_c = mesh.uvs.take(mesh.faces.take(face, 0), 0).transpose(1, 2, 0)
        return (at_a + (at_b - at_a) * b1 + (at_c - at_a) * b2).T

    def _placed(self, number: Ints, vertex: Doubles) -> Doubles:
        """Return vertices (3, n) of the meshes of shapes (n,) in the scene."""
        if not isinstance(self.shapes[number[0]], Instance):
            return vertex
        used = distinct(number)
        lane = np.searchsorted(used, number)
        placed = [self.shapes[shape_number] for shape_number in used]
        m = np.stack([shape.transform for shape in placed if isinstance(shape, Instance)])
        m = m.take(lane, 0).transpose(1, 2, 0)
        x, y, z = vertex
        return np.stack([row[0] * x + row[1] * y + row[2] * z + row[3] for row in m[:3]])
