"""An environment of radiance 1 whose patches are groups of lights: the share of each part of the sky."""

from __future__ import annotations

from typing import Self

import numpy as np

from ..arrays.elementary import arctan2, sin_cos_turns
from ..arrays.soa import soa
from ..arrays.vec import INV_TWO_PI, Doubles, Floats, Ints, column, dot, f4
from .environment import ConstantEnvironment

PER_ROW = 30, 30, 24, 24, 18, 12, 6  # patches of Tregenza's rows, from the horizon; one more is at the zenith


@soa
class SkyPatches:
    """Tregenza's division of the sky into 145 patches, and Reinhart's finer ones of n × n for each.

    Patch 0 is all below the horizon. The others are numbered from the horizon up, in each row clockwise from
    the north, seen from above, on which the first is centered. Radiance numbers them so, too.

    Sources: P. R. Tregenza, Subdivision of the Sky Hemisphere for Luminance Measurements, Lighting Research &
    Technology 19(1), 1987; C. Reinhart, Tageslichtsimulation, 2001 (the subdivision).
    """

    axes: Doubles  # (3, 3) columns: to the north, to the east, to the zenith
    sines: Doubles  # (rows + 1,) of the heights at which rows begin, from the horizon; last the zenith
    per_row: Ints  # (rows,) patches
    first: Ints  # (rows,) number of the first patch

    @classmethod
    def of(cls, subdivision: int, axes: Doubles) -> Self:
        """Return the patches for Reinhart's n; 1 are Tregenza's."""
        per_row = np.array([*np.repeat(PER_ROW, subdivision) * subdivision, 1])
        step = 1 / (2 * (2 * len(per_row) - 1))  # turns; the cap reaches half as far
        sines = np.append(sin_cos_turns(np.arange(len(per_row)) * step)[0], 1.0)
        return cls(axes, sines, per_row, 1 + np.concatenate([[0], per_row.cumsum()[:-1]]))

    def __len__(self) -> int:
        """Return the number of patches, with the ground."""
        return int(self.first[-1]) + 1

    @property
    def solid_angles(self) -> Doubles:
        """(patches,) sr."""
        rows = 2 * np.pi * np.diff(self.sines) / self.per_row
        return np.concatenate([[2 * np.pi], np.repeat(rows, self.per_row)])

    @property
    def projected(self) -> Doubles:
        """Solid angles of the sky's patches, projected on a horizontal plane, (patches − 1,) sr; in all π."""
        return np.repeat(np.pi * np.diff(self.sines * self.sines) / self.per_row, self.per_row)

    def number(self, wi: Floats) -> Ints:
        """Return the patches (n,) in directions wi (3, n)."""
        north, east, up = (dot(wi, column(axis)) for axis in self.axes.T)
        row = np.clip(self.sines.astype(f4).searchsorted(up, side="right") - 1, 0, len(self.per_row) - 1)
        count = self.per_row.take(row)
        turns = arctan2(east, north) * INV_TWO_PI
        place = np.floor(turns * count.astype(f4) + f4(0.5)).astype(np.intp) % count
        return np.where(up < 0, 0, self.first.take(row) + place)

    def directions(self, along: int) -> Doubles:
        """Return along² evenly spread directions for each patch of the sky, (3, patches − 1, along²)."""
        cell = (np.arange(along) + 0.5) / along
        u, v = (grid.ravel() for grid in np.meshgrid(cell, cell))
        row = np.repeat(np.arange(len(self.per_row)), self.per_row)[:, None]
        count = self.per_row[row]
        place = np.arange(1, len(self))[:, None] - self.first[row]
        up = self.sines[row] + v * np.diff(self.sines)[row]
        east, north = sin_cos_turns((place + u - 0.5) / count)
        level = np.sqrt((1 - up) * (1 + up))
        local = (north * level, east * level, up)
        return sum(axis[:, None, None] * part for axis, part in zip(self.axes.T, local, strict=True))

    def weights(self, along: int) -> Doubles:
        """Return a horizontal plane's weights (patches − 1, along²) for means over `directions(along)`."""
        cosine = (self.axes[:, 2, None, None] * self.directions(along)).sum(0)
        return np.asarray(cosine / cosine.sum(1, keepdims=True))


@soa
class PatchedEnvironment(ConstantEnvironment):
    """Radiance 1 from everywhere; the part of each patch is a group of lights."""

    patches: SkyPatches | None = None

    @property
    def names(self) -> tuple[str, ...]:
        """The groups, by the number of the patch."""
        assert self.patches is not None
        return tuple(f"patch {number}" for number in range(len(self.patches)))
