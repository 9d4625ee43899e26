"""PLY: meshes and points, with normals, texture coordinates, one texture, and colors of vertices or faces.

Damaged rows are left out: faces of fewer than three corners or of vertices that do not exist, and the rows
that a file lacks which ends early. The rows are read here, as trimesh refuses a binary file that ends early
or whose polygons have several sizes, or a text with a damaged vertex, and leaves out strips.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...arrays.vec import Doubles, Ints
from ...bsdfs import Diffuse
from ...materials import Material
from ...textures.image import Texture
from ..clouds import cloud
from ..description.appearance import MaterialSpec, assign_material, from_srgb, is_faint
from ..description.contents import Contents
from ..losses import Losses
from ..repair import RawMesh, Table, with_split_corners
from ..rows import NAME, NONE, Faces, Rows, bad_rows, faces_of_rows, note_damage, note_rows
from ..sources import GRAY, SceneFiles
from .header import RGB, read_header, unread
from .rows import read_rows

UVS = (("texture_u", "texture_v"), ("u", "v"), ("s", "t"))  # names of texture coordinates of vertices


class Parsed(NamedTuple):
    """The content of a file, with all that it stores."""

    contents: Contents
    rows: dict[str, Rows]
    row: Ints  # (m,) that of each triangle in `rows["face"]`


def parse(files: SceneFiles, data: bytes, materials: bool) -> Parsed:
    """Return the content of a PLY file.

    Raises
    ------
    SceneError
        If its header is damaged. The message names the file and the line.
    """
    header = read_header(files.name, data)
    rows = read_rows(header, data)
    note_damage(files.losses, rows)
    for ignored in unread(header.elements) if materials else ():
        files.losses.note(ignored)
    vertex = rows.get("vertex")
    points = None if vertex is None else vertex.table("xyz")
    if vertex is None or points is None:
        return Parsed(Contents.once([]), rows, NONE.row)
    if not any(element.count for element in header.elements if element.name in ("face", "tristrips")):
        spheres = cloud(files.losses, points, _codes(vertex))
        shapes = [] if spheres is None else [spheres]
        return Parsed(Contents(shapes=shapes), rows, NONE.row)
    points[bad_rows(vertex)] = np.nan
    faces = _faces(files, rows, points)
    raw = RawMesh(NAME, points, faces.triangles, normals=vertex.table(("nx", "ny", "nz")))
    raw.uvs = next((uvs for names in UVS if (uvs := vertex.table(names)) is not None), None)
    raw = _with_uvs_of_corners(files, raw, rows, faces)
    spec = _textured(files, header.textures) if materials and raw.uvs is not None else None
    raw = _colored(files, raw, rows, faces, spec is not None)
    assign_material(raw, spec)
    return Parsed(Contents.once([raw] if len(raw.faces) else []), rows, faces.row)


def _faces(files: SceneFiles, rows: dict[str, Rows], points: Doubles) -> Faces:
    """Return the triangles of faces and strips."""
    parts = []
    for name, cut in (("face", faces_of_rows), ("tristrips", _of_strips)):
        if name in rows and (named := _indices(rows[name])) is not None:
            parts.append(cut(files.losses, rows[name], named, points))
    return Faces(*map(np.concatenate, zip(NONE, *parts, strict=True)))


def _has_strips(rows: dict[str, Rows]) -> bool:
    return "tristrips" in rows and rows["tristrips"].count > 0


def _indices(rows: Rows) -> str | None:
    """Return the name of the list with the indices of vertices; None if there is none."""
    usual = [name for name in ("vertex_index", "vertex_indices") if name in rows.lists]
    return next(iter(usual or rows.lists), None)


def _of_strips(losses: Losses, rows: Rows, named: str, points: Doubles) -> Faces:
    """Return the triangles of strips. -1 begins a new one. Degenerate ones are left out."""
    counts, values = rows.lists[named]
    with np.errstate(all="ignore"):
        vertices = values.astype(np.intp)
    strips = [NONE]
    for number, strip in enumerate(np.split(np.arange(len(values)), np.cumsum(counts)[:-1])):
        for run in np.split(strip, np.flatnonzero(vertices[strip] == -1)):
            run = run[vertices[run] != -1]
            if len(run) >= 3:
                corner = np.stack([run[:-2], run[1:-1], run[2:]], axis=1)
                corner[1::2] = corner[1::2, [1, 0, 2]]
                strips.append(Faces(vertices[corner], np.full(len(corner), number), corner))
    triangles, row, corner = map(np.concatenate, zip(*strips, strict=True))
    inside = ((triangles >= 0) & (triangles < len(points))).all(1)
    lost = np.zeros(rows.count, np.bool_)
    lost[row[~inside]] = True
    note_rows(losses, rows, lost, f"with a vertex beyond the {len(points)}")
    keep = inside & (triangles != np.roll(triangles, 1, axis=1)).all(1)
    return Faces(triangles[keep], row[keep], corner[keep])


def _with_uvs_of_corners(files: SceneFiles, raw: RawMesh, rows: dict[str, Rows], faces: Faces) -> RawMesh:
    """Return a mesh with the texture coordinates that faces have for their corners, if they do."""
    face = rows.get("face")
    if face is None or "texcoord" not in face.lists or not len(faces.row) or _has_strips(rows):
        return raw
    counts, values = face.lists["texcoord"]
    corners, _ = face.lists[_indices(face) or ""]
    wrong = (counts != 2 * corners) & ~bad_rows(face)
    done = "0 in place of texture coordinates"
    note_rows(files.losses, face, wrong, "with texture coordinates that do not fit the corners", done)
    split = with_split_corners(raw)
    begin = np.cumsum(counts) - counts, np.cumsum(corners) - corners
    at = begin[0][faces.row][:, None] + 2 * (faces.corner - begin[1][faces.row][:, None])
    at = np.where(wrong[faces.row][:, None], len(values), at).ravel()
    padded = np.append(values.astype(np.float64), [0.0, 0.0])
    split.uvs = np.stack([padded[at], padded[at + 1]], 1)
    return split


def _colors(rows: Rows | None) -> Table | None:
    """Return linear colors (n, 4) of rows, None if they have none."""
    rgb = None if rows is None else rows.units(RGB)
    if rows is None or rgb is None:
        return None
    alpha = rows.units(["alpha"])
    codes = np.ones((len(rgb), 1)) if alpha is None else np.rint(alpha * 255) / 255
    return np.hstack([from_srgb(rgb), codes])


def _codes(vertex: Rows) -> Table | None:
    """Return the colors of points as codes (n, 3) of sRGB."""
    rgb = vertex.units(RGB)
    return None if rgb is None else np.rint(np.clip(np.nan_to_num(rgb), 0, 1) * 255).astype(np.uint8)


def _colored(files: SceneFiles, raw: RawMesh, rows: dict[str, Rows], faces: Faces, textured: bool) -> RawMesh:
    """Return a mesh with the colors that count: those of the vertices, unless these are white, or of faces.

    White ones are defaults of some program. Beside a texture none count.
    """
    of_vertices, of_faces = _colors(rows["vertex"]), _colors(rows.get("face"))
    if _has_strips(rows):
        of_faces = None
    if textured:
        for colors, what in ((of_vertices, "vertex"), (of_faces, "face")):
            if colors is not None:
                files.losses.note(f"{what} colors")
        return raw
    if of_faces is not None and (of_vertices is None or (of_vertices == 1).all()):
        raw = with_split_corners(raw)
        raw.colors = np.repeat(of_faces[faces.row], 3, 0)
    elif of_vertices is not None:
        if of_faces is not None:
            files.losses.note("face colors")
        is_split = len(raw.vertices) != len(of_vertices)
        raw.colors = of_vertices[faces.triangles.ravel()] if is_split else of_vertices
    if is_faint(raw):  # where it has no effect
        files.losses.note("opacity of vertex colors")
    return raw


def _textured(files: SceneFiles, textures: list[str]) -> MaterialSpec | None:
    """Return the material of a texture; None if there is none."""
    if not textures:
        return None
    reference = textures[-1]
    if len(textures) > 1:
        files.losses.note("several textures", done=f"{reference!r} is taken for all faces")
    image = files.picture(reference, instead=GRAY)
    if image is None or image is GRAY:  # as without a material
        return None
    return MaterialSpec(Material(Diffuse(Texture(image)), alpha=1.0))
