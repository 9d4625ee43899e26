"""The emission of media on grids as lights: points of a fire, chosen by how much is emitted there."""

from __future__ import annotations

from typing import Any, Self

import numpy as np

from ..arrays.soa import soa
from ..arrays.state import SurfaceInteraction
from ..arrays.vec import Doubles, Floats, dot, f4
from ..media.grid import GridMedia
from ..sampling.discrete import Inversion
from .base import Emitters, LightRecord, LightSample

PARTS = f4(1024)  # of the edge of a cell; the position within one of them is the number for another edge


class GlowingCells:
    """One medium of a record, and the cells of its box that glow.

    Parameters
    ----------
    media, column
        Which medium. Its table `aim` has the density of points in each cell.
    """

    def __init__(self, media: GridMedia, column: int) -> None:
        self.media, self.column = media, column
        width, height, depth = media.aim.size[:, column]
        first = media.aim.first[column]
        density = media.aim.values[0, first : first + width * height * depth].astype(np.float64)
        table = (density / density.sum()).reshape(-1, width)
        self._rows = Inversion(table.sum(1)[None])
        self._columns = Inversion(table)
        self._size = np.array([[width], [height], [depth]], f4)
        matrix = media.to_unit[:, column].astype(np.float64)
        self.to_world = np.linalg.inv(matrix[:9].reshape(3, 3))
        self._offset = -self.to_world @ matrix[9:]
        middle = np.indices((depth, height, width)).reshape(3, -1)[::-1] + 0.5
        self.middle = self._placed((middle @ table.ravel() / self._size[:, 0])[:, None].astype(f4))
        volume = abs(np.linalg.det(self.to_world))
        self.extent = float((volume / table.size / (table**2).sum()) ** (1 / 3))
        glow = [
            values.values[:, start : start + int(values.size[:, column].prod())].mean(1, dtype=np.float64)
            for values in (media.density, media.glow)
            for start in [values.first[column]]
        ]
        shine = media.shine[:, column]
        self.power = 4 * np.pi * volume * float((shine * glow[0] + glow[1]).mean())

    def points(self, u: Floats) -> tuple[Floats, Floats]:
        """Return points (3, n), chosen with u (2, n), in the unit cube and in the scene."""
        row, y = self._rows.find(u[0])
        flat, x = self._columns.find(u[1], row)
        z = x * PARTS
        width, height, _ = self._size[:, 0].astype(np.intp)
        cell = np.stack([flat - row * width, row % height, row // height])
        unit = (cell.astype(f4) + np.stack([x, y, z - np.floor(z)])) / self._size
        return unit, self._placed(unit)

    def _placed(self, unit: Floats) -> Floats:
        rows, shift = self.to_world.astype(f4), self._offset.astype(f4)
        return np.stack([dot(rows[axis][:, None], unit) + shift[axis] for axis in range(3)])


@soa
class GlowLights(LightRecord):
    """A medium on a grid that glows.

    A sample is a point in it. The emission there per unit of length, ε, is divided by a rate c, as is the
    density q·t² of points at a distance t along directions. Their quotient stays, and it alone counts; and
    the weights of multiple importance sampling compare q·t²/c with the density of directions. Those of a
    point are the same for a path that goes through it, so they add up to 1 whatever c is. A path meets all of
    the emission along a ray at once, so c is a few points over the extent of the medium.
    """

    middle: Floats  # (3, 1) of the emission
    cells: Any  # GlowingCells

    @classmethod
    def of(cls, media: GridMedia, column: int) -> Self:
        """Return the light of one of the media of a record."""
        cells = GlowingCells(media, column)
        return cls(cells.middle, cells)

    def sample_li(self, point: Floats, u: Floats) -> LightSample:
        """Choose a point within the medium."""
        unit, at = self.cells.points(u)
        away = at - point
        d2 = dot(away, away)
        safe = np.where(d2 > 0, d2, f4(1))
        distance, column = np.sqrt(safe), np.full(u.shape[1], self.cells.column)
        media = self.cells.media
        radiance = media.emission(column, unit, media.density.at(column, unit)) / media.points_on_ray[column]
        pdf = np.where(d2 > 0, safe * media.aim.cell_at(column, unit), f4(0))
        return LightSample(away / distance, radiance, pdf, distance, np.ones_like(distance))

    def pdf_li(self, point: Floats, wi: Floats) -> Floats:
        """Return 0: no ray meets the light as a surface. `GridMedia.sample` weighs emission along paths."""
        return np.zeros(wi.shape[1], f4)

    def le(self, wi: Floats, surface: SurfaceInteraction | None = None) -> Floats:
        """Return 0, likewise."""
        return np.zeros_like(wi)

    def power(self, scene_radius: float) -> Doubles:
        """4π·∫ε over the volume."""
        return np.array([self.cells.power])

    def irradiance(self, center: Doubles, radius: float, scene_radius: float) -> Doubles:
        """As of a point in the middle, but not above that at the distance of its extent; (c, k)."""
        away = self.middle[:, 0].astype(np.float64)[:, None] - center
        least = max(radius, self.cells.extent / 2)
        return (self.cells.power / (4 * np.pi * np.maximum((away**2).sum(0), least**2)))[:, None]

    def emitters(self) -> Emitters:
        """Return the middle."""
        middle = self.middle.astype(np.float64)
        return Emitters(middle, np.zeros_like(middle), np.array([self.cells.extent**2]))
