"""Rays through the cells of coarse grids, all by one step at a time."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..arrays.elementary import log
from ..arrays.soa import soa
from ..arrays.state import SoA
from ..arrays.vec import Bools, Floats, Ints, f4, highest, take
from ..sampling.steps import StepNumbers
from .base import MediumRays

SMALL = f4(1e-25)  # in place of components of directions that are less, for divisions


@soa
class March(SoA):
    """Rays within boxes, each in one cell of a grid (Amanatides and Woo).

    Source: J. Amanatides and A. Woo, "A Fast Voxel Traversal Algorithm for Ray Tracing", Eurographics 1987.
    """

    row: Ints  # (n,) which of the rays that were given
    number: Ints  # (n,) of the grid
    start: Floats  # (3, n) where rays enter, in the unit cube
    direction: Floats  # (3, n) likewise, per scene unit
    entry: Floats  # (n,) distance up to there, scene units
    t: Floats  # (n,) distance from there on
    end: Floats  # (n,) of the border, or of the end of the ray
    plane: Floats  # (3, n) of the next borders of cells along each axis
    spacing: Floats  # (3, n) between these
    stride: Ints  # (3, n) from cell to cell
    cell: Ints  # (n,)
    left: Floats  # (n,) optical depth up to the next event
    control: Floats  # (n,) optical depth that is known without events
    steps: StepNumbers

    @classmethod
    def of(cls, rays: MediumRays, cells: Ints, first: Ints, left: Floats) -> March:
        """Return those of n rays that meet the unit cube.

        Parameters
        ----------
        rays
            With origin and direction in the unit cube, the direction per scene unit.
        cells, first
            (3, k) along x, y and z, and (k,) the first cell of each grid.
        left
            (n,) optical depth up to the first event.
        """
        assert rays.steps is not None
        origin, direction = rays.origin, rays.direction
        turned = np.where(np.abs(direction) < SMALL, np.where(direction < 0, -SMALL, SMALL), direction)
        one, other = -origin / turned, (f4(1) - origin) / turned
        near = np.maximum(highest(np.minimum(one, other)), f4(0))
        far = np.minimum(-highest(-np.maximum(one, other)), rays.length)
        row = np.flatnonzero(near < far)
        number, turned, near = rays.number.take(row), take(turned, row), near.take(row)
        start = np.minimum(np.maximum(take(origin, row) + turned * near, f4(0)), f4(1))
        along = take(cells, number)
        in_cells, forth = start * along.astype(f4), turned > 0
        at = np.minimum(in_cells.astype(np.intp), along - 1)
        speed = turned * along.astype(f4)
        stride = np.stack([np.ones_like(row), along[0], along[0] * along[1]])
        offset = at[0] + stride[1] * at[1] + stride[2] * at[2]
        return cls(
            row=row,
            number=number,
            start=start,
            direction=turned,
            entry=near,
            t=np.zeros_like(near),
            end=far.take(row) - near,
            plane=((at + forth).astype(f4) - in_cells) / speed,
            spacing=f4(1) / np.abs(speed),
            stride=np.where(forth, stride, -stride),
            cell=first.take(number) + offset,
            left=left.take(row),
            control=np.zeros_like(near),
            steps=rays.steps.take(row),
        )

    def advance(self, rate: Floats, sure: Floats | None = None) -> tuple[Ints, Bools]:
        """Move each ray to the border of its cell, or to an event before, in place.

        Parameters
        ----------
        rate
            (n,) of events in the cells, per scene unit.
        sure
            (n,) extinction that is added up in `control`.

        Returns
        -------
        The lanes (k,) of rays that are at events, and whether rays (n,) are still inside.
        """
        border = -highest(-self.plane)
        stop = np.minimum(border, self.end)
        depth = rate * (stop - self.t)
        met = self.left < depth
        to = np.where(met, self.t + self.left / np.where(met, rate, f4(1)), stop)
        if sure is not None:
            self.control += sure * (to - self.t)
        self.t, self.left = to, self.left - np.where(met, self.left, depth)
        crossing: Any = ~met & (self.plane == border)
        # where two borders meet, both are crossed
        self.plane += np.where(crossing, self.spacing, f4(0))
        moved = self.stride * crossing
        self.cell += moved[0] + moved[1] + moved[2]
        return np.flatnonzero(met), met | (border < self.end)

    def points(self, lanes: Ints) -> Floats:
        """Return where some rays (k,) are in the unit cube, (3, k)."""
        return take(self.start, lanes) + take(self.direction, lanes) * self.t.take(lanes)

    def draw(self, lanes: Ints, step: int) -> Floats:
        """Choose the optical depths up to the next events of some lanes (k,); return another number."""
        steps = self.steps.take(lanes)
        self.left[lanes] = optical_depth(steps.draw(step))
        return steps.draw(step, 1)


def optical_depth(u: Floats) -> Floats:
    """Return distances (n,) between events of rate 1, for u (n,) in [0, 1)."""
    return -log(f4(1) - u)
