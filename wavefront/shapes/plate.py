"""A square of nine patches, for grounds that fade out: rays meet it by arithmetic (accel/plate.py)."""

from __future__ import annotations

import numpy as np

from ..arrays.vec import Doubles
from ..materials import Material
from .mesh import Mesh

# Where patches begin and end along each side, from -1 to 1: the middle one is small, so that it is opaque
# where the others fade.
EDGES = -1.0, -0.155, 0.155, 1.0
PATCHES = len(EDGES) - 1  # along each side
FACES = 2 * PATCHES * PATCHES


def plate(center: Doubles, normal: Doubles, half: float, *, material: Material, name: str) -> Mesh:
    """Return a square with sides of 2·`half` around `center` (3,), with texture coordinates from 0 to 1.

    Its front is on the side of the unit vector `normal` (3,). Rows of patches follow each other, each from
    its lower left corner: first the triangle to the right of the diagonal, then the other.
    """
    u = np.cross(np.eye(3)[np.abs(normal).argmin()], normal)
    u /= np.linalg.norm(u)
    down, across = (grid.ravel() for grid in np.meshgrid(EDGES, EDGES, indexing="ij"))
    places = np.stack([across, down], 1)
    first = np.arange(PATCHES)[:, None] * (PATCHES + 1) + np.arange(PATCHES)  # corner of each patch
    above = PATCHES + 1
    pair = np.array([(0, 1, above + 1), (0, above + 1, above)])
    return Mesh(
        center + half * (places @ np.stack([u, np.cross(normal, u)])),
        (first.reshape(-1, 1, 1) + pair).reshape(-1, 3),
        uvs=0.5 + 0.5 * places,
        material=material,
        name=name,
    )
