"""The meshes of a COLLADA document that pycollada has read, each with its matrix to the scene."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from ...arrays.vec import Ints
from ...core.plural import plural
from ...scene.loss import NOT_HONORED
from ...shapes.transform import IDENTITY, Matrix
from ..description.appearance import MaterialSpec, assign_material, from_srgb
from ..description.contents import Contents
from ..description.placing import Places
from ..polygons import triangulate, with_holes
from ..repair import RawMesh, Table
from ..sources import SceneFiles
from ..trimesh_library import import_trimesh, typed_errors
from ..trimesh_materials import material_spec
from .images import Images

NONE = np.zeros((0, 3), np.intp)  # triangles


class DaeMeshes:
    """The meshes of a document: one for each primitive of each geometry that is placed."""

    def __init__(self, files: SceneFiles, document: Any, materials: bool) -> None:
        self._files, self._document, self._materials = files, document, materials
        self._images = Images(files)
        self._specs: dict[str, MaterialSpec | None] = {}
        self.count = 0  # primitives that are read

    def contents(self) -> Contents:
        """Return the meshes, and where they are placed."""
        import collada

        names = import_trimesh().util.unique_name
        raws: dict[str, RawMesh] = {}
        counts: dict[str, int] = {}
        matrices = []
        for node, matrix in _nodes(self._document.scene.nodes, IDENTITY):
            for primitive in node.geometry.primitives:
                if isinstance(primitive, collada.lineset.LineSet):
                    continue
                identity = str(node.geometry.id)
                with self._files.losses.part(f"geometry {identity!r}"), typed_errors(self._files.name, "dae"):
                    raw = self._raw(primitive, {binding.symbol: binding.target for binding in node.materials})
                    raw.name = names(identity, contains=raws, counts=counts)
                    raws[raw.name] = raw
                    matrices.append(matrix)
                    self.count += 1
        return Contents(
            list(raws.values()), Places(np.arange(len(raws)), np.array(matrices).reshape(-1, 4, 4))
        )

    def _raw(self, primitive: Any, materials: dict[str, Any]) -> RawMesh:
        """Return the mesh of a primitive, whose corners are vertices of their own."""
        sources = primitive.sources
        offset, _, _, _, source = sources["VERTEX"][0]
        points = np.asarray(source.data, np.float64)
        rows, counts = self._polygons(primitive, points, offset)
        corner, _ = triangulate(points, rows[:, offset], counts)
        used = rows[corner.ravel()]

        def of_corners(semantic: str) -> Table | None:
            inputs = sources.get(semantic)
            return np.asarray(inputs[0][4].data, np.float64)[used[:, inputs[0][0]]] if inputs else None

        raw = RawMesh("", points[used[:, offset]], np.arange(len(used)).reshape(-1, 3), of_corners("NORMAL"))
        uvs, colors = of_corners("TEXCOORD"), of_corners("COLOR")
        raw.uvs = None if uvs is None else uvs[:, :2]
        spec = self._spec(materials[primitive.material]) if primitive.material in materials else None
        if colors is not None and spec is None:
            raw.colors = np.column_stack([from_srgb(colors[:, :3]), np.ones(len(colors))])
        elif colors is not None:
            self._note("vertex colors")
        assign_material(raw, spec)
        return raw

    def _polygons(self, primitive: Any, points: Table, offset: int) -> tuple[Ints, Ints]:
        """Return the rows (c, k) of indices at the corners of all polygons, and the counts (n,) of these."""
        rows = np.asarray(primitive.index, np.intp)
        if rows.ndim == 3:  # triangles
            return self._sound(rows.reshape(-1, rows.shape[2]), np.full(len(rows), 3))
        counts = np.asarray(primitive.vcounts, np.intp)
        exists = (counts >= 0) & (np.cumsum(np.maximum(counts, 0)) <= len(rows))
        if not exists.all():
            counts = counts[: exists.argmin()]
            self._note(f"{plural(len(exists) - len(counts), 'polygon')} without indices", done="left out")
        polygons = _with_holes(primitive, rows.shape[1])
        cut = [self._cut(rings, points, offset, rows.shape[1]) for rings in polygons]
        rows = np.concatenate([rows[: counts.sum()], *cut])
        return self._sound(rows, np.append(counts, [3] * (sum(map(len, cut)) // 3)).astype(np.intp))

    def _cut(self, rings: list[Ints], points: Table, offset: int, width: int) -> Ints:
        """Return the rows at the corners of the triangles of a polygon with holes."""
        sound = bool(rings) and all(len(ring) > 2 and (ring >= 0).all() for ring in rings)
        corners = with_holes([points[ring[:, offset]] for ring in rings]) if sound else NONE
        if not len(corners):
            self._note("a polygon with damaged holes", done="left out")
            return np.zeros((0, width), np.intp)
        return np.concatenate(rings)[corners.ravel()]

    def _sound(self, rows: Ints, counts: Ints) -> tuple[Ints, Ints]:
        """Return the polygons that have three corners and no index below 0."""
        polygon = np.repeat(np.arange(len(counts)), counts)
        bad = counts < 3
        bad[polygon[(rows < 0).any(1)]] = True
        if not bad.any():
            return rows, counts
        what = f"{plural(int(bad.sum()), 'polygon')} with fewer than 3 corners or an index below 0"
        self._note(what, done="left out")
        return rows[~bad[polygon]], counts[~bad]

    def _note(self, what: str, done: str = NOT_HONORED) -> None:
        self._files.losses.note(what, done=done)

    def _spec(self, material: Any) -> MaterialSpec | None:
        """Return a material of the document, which is read once."""
        if not self._materials:
            return None
        if material.id not in self._specs:
            read = import_trimesh().exchange.dae._parse_material(material.effect, self._images)
            self._images.report()
            converted = self._specs[material.id] = material_spec(read, self._files.losses)
            for lost in converted.lost:
                self._note(lost)
            if read.baseColorFactor is not None and read.baseColorFactor[3] < 255:
                self._note("opacity of materials")
        return self._specs[material.id]


def _nodes(nodes: Any, matrix: Matrix) -> Iterator[tuple[Any, Matrix]]:
    """Yield the geometries below some nodes, with their matrices to the scene."""
    import collada

    for node in nodes:
        if isinstance(node, collada.scene.GeometryNode):
            yield node, matrix
        elif isinstance(node, collada.scene.Node):
            with np.errstate(all="ignore"):  # a matrix that is not finite is reported where it is used
                inner = matrix @ np.asarray(node.matrix, np.float64)
            yield from _nodes(node.children or (), inner)


def _with_holes(primitive: Any, width: int) -> list[list[Ints]]:
    """Return the rings of the polygons with holes, which pycollada leaves out: rows (c, k) of indices."""
    polygons = []
    for element in primitive.xmlnode:
        if str(element.tag).endswith("}ph"):
            texts = [ring.text or "" for ring in element]
            rings = [np.array(text.split(), np.intp) for text in texts]
            polygons.append([ring[: len(ring) // width * width].reshape(-1, width) for ring in rings])
    return polygons
