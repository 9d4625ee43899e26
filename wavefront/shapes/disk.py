"""Flat disks."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ..arrays.elementary import sin_cos_turns
from ..core.errors import SceneError, finite_array, number
from ..core.suggestions import suggests_keywords
from ..materials import MaterialLike
from ..textures.parameter import Color
from .mesh import Mesh

MOST_RADIUS = 1e37  # so that float32 can hold the corners


@suggests_keywords
def Disk(
    center: ArrayLike,
    normal: ArrayLike,
    radius: float,
    *,
    segments: int = 64,
    material: MaterialLike | None = None,
    emission: Color | None = None,
    two_sided: bool = False,
    name: str = "disk",
) -> Mesh:
    """Return a disk as a mesh: a regular polygon of the same area.

    Parameters
    ----------
    center
        (3,) scene units.
    normal
        (3,) normal of the front, of any length.
    radius
        Of the disk, scene units, above 0.
    segments
        Corners of the polygon, from 3 to 65536. From 16 on, its distance from the circle is at most
        0.34·(π/segments)²·radius: 0.08 % of the radius for 64.
    material, emission, two_sided, name
        As for `Mesh`. Texture coordinates span the square around the disk.

    Raises
    ------
    SceneError
        If an argument is malformed or out of range.

    Examples
    --------
    >>> table = wf.Disk((0, 0, 0), (0, 1, 0), 2, material=wf.Diffuse(0.4))
    >>> len(table.faces)
    64
    """
    middle = finite_array(f"{name}: center", center, (3,))
    axis = finite_array(f"{name}: normal", normal, (3,))
    if not np.linalg.norm(axis) > 0:
        raise SceneError(f"{name}: normal is {axis.tolist()}; it must not be zero")
    size = number(
        f"{name}: radius", radius, lambda x: 0 < x <= MOST_RADIUS, f"above 0 and at most {MOST_RADIUS:g}"
    )
    n = int(
        number(
            f"{name}: segments",
            segments,
            lambda x: x == int(x) and 3 <= x <= 65_536,
            "a whole number from 3 to 65536",
        )
    )
    axis = axis / np.linalg.norm(axis)
    u = np.cross(np.eye(3)[np.abs(axis).argmin()], axis)
    u /= np.linalg.norm(u)
    sin, cos = sin_cos_turns(np.arange(n) / n)
    ring = np.stack([cos, sin], 1)
    reach = size * np.sqrt(2 * np.pi / n / sin[1])  # of the corners, for equal area
    k = np.arange(n)
    return Mesh(
        middle + reach * np.vstack([ring @ np.stack([u, np.cross(axis, u)]), np.zeros(3)]),
        np.stack([np.full(n, n), k, (k + 1) % n], 1),
        uvs=np.vstack([0.5 + 0.5 * ring, [0.5, 0.5]]),
        material=material,
        emission=emission,
        two_sided=two_sided,
        name=name,
    )
