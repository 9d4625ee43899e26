"""Lights that move while a shutter is open: the emitting surfaces and the other lights of a scene."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..arrays.vec import Floats, Ints
from ..core.errors import SceneError, warn_caller
from ..lights import InfiniteLight, Light, LightRecord
from ..lights.moving import DeformingLights, MovingLights
from ..motion.steps import Motions
from .motion import DeformingRows, MotionTable


def moving_light(light: Light, record: LightRecord, motions: Motions | None, number: int) -> LightRecord:
    """Return a light, given by its record in the middle of the time, as it moves.

    Those that fill a part of the sky stay as they are then, and a warning says so.

    Raises
    ------
    SceneError
        If it is one of a surface.
    """
    if light.shape is not None:
        raise SceneError(f"{type(light).__name__} moves while the shutter is open; move its shape instead")
    if isinstance(record, InfiniteLight) or motions is None:
        warn_caller(f"{type(light).__name__} turns while the shutter is open; it is shown as in the middle")
        return record
    return MovingLights(record, np.full(len(record), number), motions, type(record))


def moving_parts(
    record: LightRecord, rows: Ints | None, motion: MotionTable
) -> Iterator[tuple[LightRecord, Ints | None]]:
    """Yield emitting surfaces by kind: still ones, rigid ones that move, and meshes that deform.

    Parameters
    ----------
    record, rows
        k lights, and the rows (..., k) of their primitives in the scene's tables.
    """
    assert rows is not None
    first = np.atleast_2d(rows)[0]
    column = motion.column_of_row.take(first)
    still = np.flatnonzero(column == 0)
    if still.size == column.size:
        yield record, rows
        return
    if still.size:
        yield record.take(still), rows[..., still]
    rigid = motion.is_rigid(first)
    groups: list[tuple[DeformingRows | None, Ints]] = [(None, np.flatnonzero((column > 0) & rigid))]
    groups += motion.deformation_of(first)
    for deforming, lanes in groups:
        if lanes.size:
            lights, row = record.take(lanes), first.take(lanes)
            if deforming is not None:
                lights = _deforming(lights, row, deforming)
            assert motion.motions is not None
            number = motion.mover.take(column.take(lanes))
            yield MovingLights(lights, number, motion.motions, type(lights)), rows[..., lanes]


def _deforming(record: LightRecord, row: Ints, mesh: DeformingRows) -> DeformingLights:
    """Return emitting triangles of a mesh that deforms, by their rows (k,) in the scene's tables."""
    corners: Floats = np.concatenate(
        [corners.take(row - mesh.first, 0).reshape(-1, 9).T for corners in mesh.corners]
    )
    times = tuple(mesh.times.tolist())
    return DeformingLights(record, np.ascontiguousarray(corners), times, type(record))
