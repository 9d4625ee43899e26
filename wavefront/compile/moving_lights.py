"""Lights that move while a shutter is open: the emitting surfaces and the other lights of a scene."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from ..arrays.vec import Floats, Ints
from ..core.errors import SceneError
from ..lights import ConstantEnvironment, ImageEnvironment, InfiniteLight, Light, LightRecord
from ..lights.moving import DeformingLights, MovingLights
from ..lights.turning import TurningLight
from .motion import DeformingRows, MotionTable


def moving_light(light: Light, record: LightRecord, number: int, motion: MotionTable | None) -> LightRecord:
    """Return a light of a scene, given by its record in the middle of the time, as it moves.

    Raises
    ------
    SceneError
        If it is one of a surface.
    """
    if motion is None or number not in motion.motion_of_light:
        return record
    if light.shape is not None:
        raise SceneError(f"{type(light).__name__} moves while the shutter is open; move its shape instead")
    row, motions = motion.motion_of_light[number], motion.lights
    assert motions is not None
    if not isinstance(record, InfiniteLight):
        return MovingLights(record, np.full(len(record), row), motions, type(record))
    if isinstance(record, ConstantEnvironment):  # the same however it is turned
        return record
    if isinstance(record, ImageEnvironment) and record.in_texels:
        record = replace(record, in_texels=False, made=None)  # rays that escape see the image, not means
    return TurningLight(record, row, motions)


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
