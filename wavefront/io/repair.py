"""Checks and repairs of a file's arrays before they become a `Mesh`. Each repair is noted."""

from __future__ import annotations

from abc import abstractmethod
from contextlib import nullcontext
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arrays.vec import FLOAT32_MAX, Bools, Doubles, Ints, cross, spans
from ..core.errors import collect_warnings, printable
from ..core.plural import plural
from ..materials import Material
from ..motion import Deformation
from ..shapes import Mesh
from ..textures.parameter import Color
from .losses import Losses

MAX_UV = 2.0**24  # above, float32 has no fractions, which textures need
AT_ONCE = 1 << 14  # faces whose area is found together, so that they fit the cache
FLAT = 1e-14  # a face is degenerate if twice its area is below this multiple of its longest edge squared

Table = Doubles
Faces = Ints


def wide(values: NDArray[Any]) -> Table:
    """Return numbers as float64. A signaling NaN is treated like any NaN, later."""
    with np.errstate(invalid="ignore"):
        return values.astype(np.float64)


@dataclass
class RawMesh:
    """A mesh as in a file."""

    name: str
    vertices: Table  # (n, 3)
    faces: Faces  # (m, 3)
    normals: Table | None = None  # (n, 3); a row of zeros means none
    uvs: Table | None = None  # (n, 2)
    uvs1: Table | None = None  # (n, 2)
    tangents: Table | None = None  # (n, 4) as of `Mesh`; ignored without normals
    colors: Table | None = None  # (n, 3 or 4) linear
    lines: Faces | None = None  # (m,) line of the file for each face
    material: Material | None = None
    emission: Color | None = None
    two_sided: bool = False  # the emission leaves both sides
    smooth: bool | float | str = False  # as of `Mesh`, where there are no normals
    attributes: dict[str, Table] = field(default_factory=dict)  # (n or m, k) of scenes of Mitsuba, by name
    deformation: FormOverTime | None = None  # of a mesh that deforms: the arrays are those of its start


class FormOverTime(Deformation):
    """How a mesh of a file deforms."""

    @abstractmethod
    def keeping(self, faces: Bools) -> Deformation:
        """Return the deformation of a mesh that has only some of the faces, by a mask (m,)."""


def with_corner_uvs(raw: RawMesh, corners: Any) -> RawMesh:
    """Return the same mesh with the texture coordinates (k, 2) of the corners of each face."""
    split = with_split_corners(raw)
    split.uvs = np.tile(np.asarray(corners, np.float64), (len(raw.faces), 1))
    return split


def with_face_colors(raw: RawMesh, colors: Table) -> RawMesh:
    """Return the same mesh with colors (m, 4) of its faces: every corner becomes a separate vertex."""
    split = with_split_corners(raw)
    split.colors = np.repeat(colors, 3, 0)
    return split


def with_split_corners(raw: RawMesh) -> RawMesh:
    """Return the same mesh with a separate vertex for every corner.

    Where there is no such vertex it is NaN, and `build` leaves the face out.
    """
    corners = raw.faces.ravel()
    exists = (corners >= 0) & (corners < len(raw.vertices))
    if not exists.all():
        raw = replace(raw, vertices=np.vstack([raw.vertices, np.full(3, np.nan)]))
        corners = np.where(exists, corners, len(raw.vertices) - 1)

    def of_corners(values: Table | None) -> Table | None:
        return values[np.minimum(corners, len(values) - 1)] if values is not None and len(values) else None

    return replace(
        raw,
        vertices=raw.vertices[corners],
        faces=np.arange(corners.size).reshape(raw.faces.shape),
        normals=of_corners(raw.normals),
        uvs=of_corners(raw.uvs),
        uvs1=of_corners(raw.uvs1),
        colors=of_corners(raw.colors),
    )


def build(source: str, raw: RawMesh, losses: Losses) -> Mesh | None:
    """Return a valid mesh, or None if no face is left.

    Parameters
    ----------
    source
        File name, for messages.
    raw
        The mesh of the file.
    losses
        Where repairs are noted.

    """
    label = _label(source, raw)
    vertices = np.asarray(raw.vertices, np.float64).reshape(-1, 3)
    faces = np.asarray(raw.faces).reshape(-1, 3).astype(np.intp)
    exists = existing(losses, label, faces, len(vertices))
    if not exists.any():
        return None
    if not exists.all():
        faces = np.where(exists[:, None], faces, 0)
    sound = np.all(np.abs(vertices) <= FLOAT32_MAX, axis=1)  # false for NaN
    vertices = np.where(sound[:, None], vertices, 0.0)
    keep: Bools = exists & np.all(sound[faces], axis=1)
    _note_faces(losses, label, raw, exists & ~keep, "with a vertex that is not finite or beyond float32")
    flat = keep & ~_has_area(vertices, faces) & (raw.deformation is None)  # others may be flat at times
    _note_faces(losses, label, raw, flat, "of zero area")
    faces = faces[keep & ~flat]
    if not len(faces):
        return None
    # of a mesh that deforms other forms may be sound, and are taken as they are
    with nullcontext() if raw.deformation is None else collect_warnings():
        mesh = _mesh(losses, label, raw, vertices, faces)
    if raw.deformation is not None:
        mesh.deformation = raw.deformation.keeping(keep)
        if raw.normals is None and raw.smooth is not False:
            mesh.compute_normals(raw.smooth)
    return mesh


def _mesh(losses: Losses, label: str, raw: RawMesh, vertices: Table, faces: Faces) -> Mesh:
    """Return a mesh of sound vertices and faces, with its normals, colors and other values."""
    return Mesh(
        vertices,
        faces,
        normals=_normals(losses, label, raw.normals, vertices, faces),
        uvs=_uvs(losses, label, "uv", raw.uvs),
        uvs1=_uvs(losses, label, "second uv", raw.uvs1),
        tangents=None if raw.normals is None else _finite(losses, label, "tangent", raw.tangents, 0.0),
        colors=_colors(losses, label, raw.colors),
        material=raw.material,
        emission=raw.emission,
        two_sided=raw.two_sided,
        name=printable(raw.name) or "mesh",
        smooth=False if raw.normals is not None or raw.deformation is not None else raw.smooth,
    )


def _label(source: str, raw: RawMesh) -> str:
    return f"{source}: {raw.name!r}" if raw.name else source


def existing(losses: Losses, label: str, faces: Faces, count: int) -> Bools:
    """Return a mask of the faces all of whose vertices are among `count`; the others are noted."""
    if not faces.size or (faces.min() >= 0 and faces.max() < count):
        return np.ones(len(faces), np.bool_)
    beyond = (faces < 0) | (faces >= count)
    i, j = np.argwhere(beyond)[0]
    first = f"face {i} uses vertex {faces[i, j]}; it must be in [0, {count - 1}]"
    faces_beyond = plural(int(beyond.any(1).sum()), "face")
    losses.note(f"{faces_beyond} with a vertex that does not exist, first: {first}", label, done="left out")
    return np.asarray(~beyond.any(1))


def _note_faces(losses: Losses, label: str, raw: RawMesh, bad: Bools, what: str) -> None:
    numbers = np.flatnonzero(bad)
    if not len(numbers):
        return
    first = f"face {numbers[0]}" if raw.lines is None else f"line {raw.lines[numbers[0]]}"
    losses.note(f"{plural(len(numbers), 'face')} {what}, first: {first}", label, done="left out")


def _note_vertices(losses: Losses, label: str, bad: Any, what: str, state: str, done: str) -> None:
    subject = plural(int(bad.sum()), f"{what} is", f"{what}s are")
    losses.note(f"{subject} {state}, first: vertex {bad.argmax()}", label, done=done)


def _has_area(vertices: Table, faces: Faces) -> Bools:
    has_area = np.empty(len(faces), np.bool_)
    for block in spans(len(faces), AT_ONCE):
        a, b, c = np.ascontiguousarray(vertices.take(faces[block], 0).transpose(1, 2, 0))
        edges = np.stack([b - a, c - b, a - c])  # (3, 3, m)
        longest = np.abs(edges).max(axis=(0, 1))
        # first divided by the longest edge, so that squares neither overflow nor underflow
        unit = edges / np.where(longest > 0, longest, 1)
        has_area[block] = np.abs(cross(unit[0], unit[1])).max(axis=0) > FLAT
    return has_area


def _normals(
    losses: Losses, label: str, normals: Table | None, vertices: Table, faces: Faces
) -> Table | None:
    """Return unit normals; vertices without a normal get that of a face that uses them."""
    if normals is None:
        return None
    normals = np.array(normals, np.float64)
    broken = ~np.isfinite(normals).all(axis=1)
    if broken.any():
        _note_vertices(losses, label, broken, "normal", "not finite", "that of a face in its place")
        normals[broken] = 0
    largest = np.abs(normals).max(axis=1)
    absent = largest == 0
    if absent.any():
        corner = vertices[faces]
        scale = np.abs(corner).max()
        flat = np.cross((corner[:, 1] - corner[:, 0]) / scale, (corner[:, 2] - corner[:, 0]) / scale)
        of_faces = np.zeros_like(normals)
        of_faces[faces.ravel()] = np.repeat(flat, 3, axis=0)
        normals[absent] = of_faces[absent]
        largest = np.abs(normals).max(axis=1)
    normals /= np.where(largest > 0, largest, 1)[:, None]
    size = np.sqrt((normals**2).sum(axis=1))
    return normals / np.where(size > 0, size, 1)[:, None]


def _finite(losses: Losses, label: str, what: str, values: Table | None, otherwise: float) -> Table | None:
    """Return values per vertex; values that are not finite in float32 are replaced by `otherwise`."""
    if values is None:
        return None
    values = np.array(values, np.float64)
    broken = ~(np.abs(values) <= FLOAT32_MAX).all(axis=1)
    if broken.any():
        _note_vertices(losses, label, broken, what, "not finite", f"{otherwise:g} in its place")
        values[broken] = otherwise
    return values


def _uvs(losses: Losses, label: str, what: str, uvs: Table | None) -> Table | None:
    """Return texture coordinates; invalid ones are replaced by 0."""
    uvs = _finite(losses, label, what, uvs, 0.0)
    if uvs is None:
        return None
    large = (np.abs(uvs) > MAX_UV).any(axis=1)
    if large.any():
        _note_vertices(losses, label, large, what, f"beyond ±{MAX_UV:.0f}", "0 in its place")
        uvs[large] = 0
    return uvs


def _colors(losses: Losses, label: str, colors: Table | None) -> Table | None:
    colors = _finite(losses, label, "vertex color", colors, 1.0)
    if colors is None:
        return None
    beyond = ((colors < 0) | (colors > 1)).any(axis=1)
    if beyond.any():
        _note_vertices(losses, label, beyond, "vertex color", "outside [0, 1]", "clamped")
    return np.clip(colors, 0, 1)
