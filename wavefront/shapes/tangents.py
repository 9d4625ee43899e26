"""Tangents of meshes: derivatives by texture coordinates, and the tangent frames of normal maps."""

from __future__ import annotations

import numpy as np

from ..arrays.vec import Doubles
from .mesh import Mesh
from .smoothing import corner_angles

MAX_LENGTH = 2.0**60  # of derivatives: float32 can square them


def mesh_dpduv(mesh: Mesh, uvs: Doubles | None) -> Doubles:
    """Return dP/du and dP/dv at the corners of the faces, (m, 3, 6), scene units.

    They are constant on the facets of a flat mesh. On a smooth mesh they are averaged at each vertex over
    the faces that share it and have the same orientation of texture coordinates, weighted by their angles,
    as in M. Mikkelsen 2008, "Simulation of Wrinkled Surfaces Revisited", section 3.4
    (MikkTSpace). Zero where the texture coordinates of a face span no area, or so small an area
    that the derivatives are longer than `MAX_LENGTH`.
    """
    flat = np.zeros((len(mesh.faces), 6))
    if uvs is None:
        return np.repeat(flat[:, None], 3, 1)
    corner, uv = mesh.vertices[mesh.faces], uvs[mesh.faces]
    edge1, edge2 = corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]
    (du1, dv1), (du2, dv2) = (uv[:, 1] - uv[:, 0]).T, (uv[:, 2] - uv[:, 0]).T
    area = du1 * dv2 - du2 * dv1
    directions = np.hstack([edge1 * a[:, None] + edge2 * b[:, None] for a, b in ((dv2, -dv1), (-du2, du1))])
    area = np.where(np.abs(directions).max(1) <= MAX_LENGTH * np.abs(area), area, 0)
    regular = np.flatnonzero(area)
    flat[regular] = directions[regular] / area[regular, None]
    if mesh.normals is None:
        return np.repeat(flat[:, None], 3, 1)
    return _smooth(mesh, flat, area, corner_angles(corner))


def mesh_tangent_frame(mesh: Mesh, uvs: Doubles | None) -> Doubles:
    """Return the tangent frames of normal maps at the corners of the faces, (m, 3, 6).

    These are the mesh's own tangents and bitangents (glTF 2.0, section 3.7.2.1: normal × tangent · w), or
    else dP/du and dP/dv. Their lengths have no meaning.
    """
    if mesh.tangents is None or mesh.normals is None:
        return mesh_dpduv(mesh, uvs)
    tangents = mesh.tangents[:, :3]
    bitangents = np.cross(mesh.normals, tangents) * np.where(mesh.tangents[:, 3:] < 0, -1.0, 1.0)
    return np.hstack([tangents, bitangents])[mesh.faces]


def _smooth(mesh: Mesh, flat: Doubles, area: Doubles, angles: Doubles) -> Doubles:
    """Average the derivatives (m, 6) of faces at each vertex, directions and lengths separately."""
    groups = (2 * mesh.faces + (area > 0)[:, None]).ravel()
    weights = (angles * (area != 0)[:, None]).ravel()
    total = np.bincount(groups, weights)
    out = np.empty((groups.size, 6))
    for columns in (slice(0, 3), slice(3, 6)):
        vectors = np.repeat(flat[:, columns], 3, 0)
        size = np.linalg.norm(vectors, axis=1)
        mean_size = np.bincount(groups, weights * size) / np.where(total > 0, total, 1)
        units = vectors / np.where(size > 0, size, 1)[:, None]
        direction = np.stack([np.bincount(groups, weights * unit) for unit in units.T], 1)
        length = np.linalg.norm(direction, axis=1)
        scale = mean_size / np.where(length > 0, length, 1)
        out[:, columns] = (direction * scale[:, None])[groups]
    out[np.repeat(area == 0, 3)] = 0
    return out.reshape(-1, 3, 6)
