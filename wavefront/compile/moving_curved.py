"""Curved shapes that move while a shutter is open: instances of one shape each.

In the scene's tables they are where they are in the middle of that time, and rays meet them there: by the
matrix of their own time, and less the way of each primitive where these move by themselves.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..accel import CurvedPrimitives, Placements
from ..arrays.vec import f4
from .instances import InstanceTable


def with_curved(
    placements: Placements | None,
    table: InstanceTable | None,
    kinds: Sequence[CurvedPrimitives],
    triangles: int,
    meshes: int,
    rows: int,
) -> tuple[Placements, InstanceTable]:
    """Return the data of instances with columns for curved shapes that move.

    Parameters
    ----------
    placements, table
        Of instances of meshes; None where there are none.
    kinds
        The primitives of each shape, whose rows are the last ones of the scene's tables.
    triangles
        The number of those that are not instanced.
    meshes
        The number of meshes of instances.
    rows
        The number of rows of the scene's tables.
    """
    counts = np.array([len(kind) for kind in kinds], np.intp)
    before, k = np.cumsum(counts) - counts, counts.size
    first_row = rows - int(counts.sum())
    # one past all other primitive ids: instances of meshes may have more of these than rows
    first = rows if table is None or placements is None else rows + int(table.shift.max(initial=0))
    ids, shift = first + before, np.full(k, first - first_row)
    low = np.stack([kind.bounds[0].min(1) for kind in kinds], 1)
    high = np.stack([kind.bounds[1].max(1) for kind in kinds], 1)
    curved = Placements(meshes + np.arange(k), ids, np.repeat(np.eye(3, 4).reshape(12, 1), k, 1), low, high)
    turn = np.repeat(np.eye(3).reshape(9, 1), k, 1).astype(f4)
    radius = (np.linalg.norm(high - low, axis=0) / 2).astype(f4)
    material = None if table is None or table.material is None else np.full(k, -1)
    columns = InstanceTable(ids, shift, turn, turn, radius, material)
    if placements is None or table is None:
        return curved, InstanceTable.concatenate([_single(triangles), columns])
    pairs = [[getattr(group, name) for group in (placements, curved)] for name in PLACEMENT]
    joined = Placements(*(np.concatenate(pair, -1) for pair in pairs))
    return joined, InstanceTable.concatenate([table, columns])


PLACEMENT = ("mesh", "first", "to_local", "low", "high")


def _single(triangles: int) -> InstanceTable:
    """Return the columns of shapes that are not instanced, where no mesh is."""
    same = np.repeat(np.eye(3).reshape(9, 1), 2, 1).astype(f4)
    return InstanceTable(np.array([0, triangles]), np.zeros(2, np.intp), same, same, np.zeros(2, f4), None)
