"""Directions of an environment drawn by its light times the cosine at the surface that it lights."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from ..arrays.elementary import sin_cos_turns
from ..arrays.vec import Doubles, Floats, Ints, f4, take
from ..sampling.discrete import Inversion, within_cell
from .base import Receiver

NORMALS = 16  # squared: the normals of the table, on an octahedron
NO_NORMAL = NORMALS * NORMALS  # number of points without a normal
CELLS = 16, 32  # rows and columns at most, of parts of the image that a normal weighs as wholes
MARGIN = 0.08  # added to cosines: a cell, and the normals of a bin, reach beyond their middles
EDGE = f4(2.0**-12)  # of a texel: how far from its edge samples stay, more than their rounding
PLAIN = 0.02  # share of directions that are drawn by light alone


class CosineProduct:
    """A distribution over the texels of an image for each of many normals, and one for no normal.

    A cell of the image is chosen by its light times the cosine at its middle, and a texel within it by light.

    Sources: D. Cline, P. Egbert, J. Talbot and D. Cardon, Two Stage Importance Sampling for Direct Lighting,
    EGSR 2006; Z. Cigolle et al., A Survey of Efficient Representations for Independent Unit Vectors, JCGT
    2014 (octahedral normals).

    Parameters
    ----------
    light
        (H, W) in proportion to the light of each texel; an equirectangular image, top row first. It is kept.
    rotation
        (3, 3) to world from the image; None where they are the same.
    directions
        (3, H, W) of the texels; None for those of an equirectangular image.
    cells
        Rows and columns of cells, at most.
    """

    def __init__(
        self,
        light: Floats,
        rotation: Floats | None,
        directions: Doubles | None = None,
        cells: tuple[int, int] = CELLS,
    ) -> None:
        self.shape = height, width = light.shape
        rows, columns = min(cells[0], height), min(cells[1], width)
        self._row_edges = np.arange(rows + 1) * height // rows
        self._column_edges = np.arange(columns + 1) * width // columns
        self._cell_row = np.repeat(np.arange(rows), np.diff(self._row_edges))
        self._cell_column = np.repeat(np.arange(columns), np.diff(self._column_edges))
        self._cells = rows, columns
        mass, middle = self._cell_light(light) if directions is None else self._light_along(light, directions)
        if rotation is not None:
            middle = np.stack([sum(row[k] * middle[k] for k in range(3)) for row in rotation.astype(float)])
        self._choose_cells(mass, middle)
        self._choose_texels(light)

    def _cell_light(self, light: Floats) -> tuple[Doubles, Doubles]:
        """Return the light of cells (rows, columns), and their mean directions (3, rows, columns)."""
        height, width = self.shape
        sin_theta, cos_theta = sin_cos_turns((np.arange(height) + 0.5) / (2 * height))
        sin_phi, cos_phi = sin_cos_turns(0.5 - (np.arange(width) + 0.5) / width)
        mass, middle = np.zeros(self._cells), np.zeros((3, *self._cells))
        for row, (start, stop) in enumerate(zip(self._row_edges, self._row_edges[1:], strict=False)):
            band = light[start:stop]
            for out, factor, level in (
                (mass, None, None),
                (middle[0], sin_phi, sin_theta),
                (middle[1], None, cos_theta),
                (middle[2], cos_phi, sin_theta),
            ):
                sums = band if level is None else band * level[start:stop, None]
                sums = sums.sum(0, dtype=np.float64)
                if factor is not None:
                    sums *= factor
                out[row] = np.add.reduceat(sums, self._column_edges[:-1])
        return mass, np.divide(middle, mass, out=np.zeros_like(middle), where=mass > 0)

    def _light_along(self, light: Floats, directions: Doubles) -> tuple[Doubles, Doubles]:
        """Return the same, of texels in given directions (3, H, W)."""
        parts = np.concatenate([light[None], light * directions])
        rows = np.add.reduceat(parts, self._row_edges[:-1], axis=1, dtype=np.float64)
        mass, *middle = np.add.reduceat(rows, self._column_edges[:-1], axis=2)
        return mass, np.divide(middle, mass, out=np.zeros_like(middle), where=mass > 0)

    def _choose_cells(self, mass: Doubles, middle: Doubles) -> None:
        x, y, z = octahedral_normals()[:, :, None, None]
        cos = x * middle[0] + y * middle[1] + z * middle[2]  # (normals, rows, columns)
        cos += MARGIN
        weight = np.maximum(cos, 0, out=cos)
        weight *= mass
        total = weight.sum((1, 2), keepdims=True)
        weight *= np.divide(1 - PLAIN, total, out=np.zeros_like(total), where=total > 0)
        weight += (1 - weight.sum((1, 2), keepdims=True)) * (mass / mass.sum())
        weight = np.concatenate([weight, (mass / mass.sum())[None]])
        self._rows = Inversion(weight.sum(2))
        self._columns = Inversion(weight.reshape(-1, self._cells[1]), 1)
        height, width = self.shape
        weight *= np.divide(height * width, mass, out=np.zeros_like(mass), where=mass > 0)
        self._density = weight.astype(f4).ravel()  # of a texel over its light

    def _choose_texels(self, light: Floats) -> None:
        (rows, columns), height = self._cells, len(light)
        of_row = np.add.reduceat(light, self._column_edges[:-1], axis=1, dtype=np.float64)  # (H, columns)
        within = np.zeros((rows, columns, np.diff(self._row_edges).max()))
        for row, (start, stop) in enumerate(zip(self._row_edges, self._row_edges[1:], strict=False)):
            within[row, :, : stop - start] = of_row[start:stop].T
        self._texel_rows = Inversion(within.reshape(rows * columns, -1), 2)
        within = np.zeros((height, columns, np.diff(self._column_edges).max()), f4)
        for column, (start, stop) in enumerate(zip(self._column_edges, self._column_edges[1:], strict=False)):
            within[:, column, : stop - start] = light[:, start:stop]
        self._texel_columns = Inversion(within.reshape(height * columns, -1), 2)
        self._light = light.astype(f4, copy=False).ravel()

    def sample(self, u: Floats, normal: Ints) -> tuple[Floats, Floats, Floats]:
        """Return points x, y (n,) in [0, 1) of the image, and their density (n,) over the unit square.

        Parameters
        ----------
        u
            (2, n): u[0] selects x, u[1] selects y.
        normal
            (n,) numbers of normals.
        """
        column, row, x, v, pdf = self._sample(u, normal)
        return within_cell(column, x, self.shape[1]), within_cell(row, v, self.shape[0]), pdf

    def _sample(self, u: Floats, normal: Ints) -> tuple[Ints, Ints, Floats, Floats, Floats]:
        """Return columns and rows (n,) of texels, places within them, and the density over the square."""
        (rows, columns), width = self._cells, self.shape[1]
        flat, v = self._rows.find(u[1], normal)
        row = flat - normal * rows
        cell, x = self._columns.find(u[0], flat)
        density = take(self._density, cell)
        column = cell - flat * columns
        of = row * columns + column
        flat, v = self._texel_rows.find(v, of)
        texel_row = flat - of * self._texel_rows.items + take(self._row_edges, row)
        of = texel_row * columns + column
        flat, x = self._texel_columns.find(x, of)
        texel_column = flat - of * self._texel_columns.items + take(self._column_edges, column)
        pdf = density * take(self._light, texel_row * width + texel_column)
        return texel_column, texel_row, x, v, pdf

    def pdf(self, x: Floats, y: Floats, normal: Ints) -> Floats:
        """Return the density over the unit square, (n,), at x, y (n,) in [0, 1], for normals (n,)."""
        (rows, columns), (height, width) = self._cells, self.shape
        column = np.clip((x * f4(width)).astype(np.intp), 0, width - 1)
        row = np.clip((y * f4(height)).astype(np.intp), 0, height - 1)
        cell = (normal * rows + take(self._cell_row, row)) * columns + take(self._cell_column, column)
        return take(self._density, cell) * take(self._light, row * width + column)


class TexelProduct(CosineProduct):
    """A product from which whole texels are drawn. All cells have equally many rows and columns of them."""

    def _choose_texels(self, light: Floats) -> None:
        (rows, columns), (height, width) = self._cells, self.shape
        number = np.arange(height * width, dtype=np.int32).reshape(rows, height // rows, columns, -1)
        self._texel_at = number.transpose(0, 2, 1, 3).ravel()  # cell by cell
        self._light = light.astype(f4, copy=False).ravel()
        within = self._light.take(self._texel_at).reshape(-1, width // columns)
        of_row = np.add.reduceat(within, [0], axis=1, dtype=np.float64)
        self._texel_rows = Inversion(of_row.reshape(rows * columns, -1), 2)
        self._texel_columns = Inversion(within, 2)

    def sample_texels(self, u: Floats, normal: Ints) -> tuple[Ints, Floats, Floats, Floats]:
        """Return texels (n,), points x, y (n,) in [0, 1) of the image, and the density over the square.

        Points keep a small distance from edges of texels.

        Parameters
        ----------
        u
            (2, n): u[0] selects x, u[1] selects y.
        normal
            (n,) numbers of normals.
        """
        height, width = self.shape
        row, y = self._rows.find(u[1], normal)
        cell, x = self._columns.find(u[0], row)
        density = take(self._density, cell)
        cell -= normal * (self._cells[0] * self._cells[1])
        row, y = self._texel_rows.find(y, cell)
        at, x = self._texel_columns.find(x, row)
        texel = take(self._texel_at, at).astype(np.intp)
        density *= take(self._light, texel)
        row = texel // width
        for place, first, size in ((x, texel - row * width, width), (y, row, height)):
            np.clip(place, EDGE, f4(1) - EDGE, out=place)
            place += first
            place *= f4(1 / size)
        return texel, x, y, density

    @cached_property
    def _cell_of(self) -> Ints:
        """The cells of texels, (H·W,); made where they are used, so not compared."""
        of = self._cell_row[:, None] * self._cells[1] + self._cell_column
        return of.ravel().astype(np.int32)  # half the memory

    def pdf_of_texels(self, texel: Ints, normal: Ints) -> Floats:
        """Return the density over the unit square, (n,), in texels (n,), for normals (n,)."""
        cell = normal * (self._cells[0] * self._cells[1])
        cell += take(self._cell_of, texel)
        return take(self._density, cell) * take(self._light, texel)


def octahedral_normals() -> Doubles:
    """Return unit vectors (3, NORMALS²) at the middles of bins on an octahedron."""
    middle = (np.arange(NORMALS) + 0.5) / NORMALS * 2 - 1
    x, y = (grid.ravel() for grid in np.meshgrid(middle, middle, indexing="ij"))
    z = 1 - np.abs(x) - np.abs(y)
    fold = np.maximum(-z, 0)
    normal = np.stack([x - np.where(x >= 0, fold, -fold), y - np.where(y >= 0, fold, -fold), z])
    return normal / np.sqrt((normal * normal).sum(0))


def octahedral_bins(normal: Floats) -> Ints:
    """Return the bins (n,) of unit vectors (3, n), as `octahedral_normals` numbers them."""
    size = np.abs(normal)
    length = size[0] + size[1] + size[2]
    with np.errstate(divide="ignore", invalid="ignore"):
        x, y = normal[0] / length, normal[1] / length
        below = normal[2] < 0
        x, y = (
            np.where(below, np.copysign(f4(1) - np.abs(y), x), x),
            np.where(below, np.copysign(f4(1) - np.abs(x), y), y),
        )
    half = f4(NORMALS / 2)
    low, high = f4(0), f4(NORMALS - 1)  # `fmax` takes NaN for the least
    i = np.fmin(np.fmax((x + f4(1)) * half, low), high).astype(np.intp)
    j = np.fmin(np.fmax((y + f4(1)) * half, low), high).astype(np.intp)
    i *= NORMALS
    i += j
    return i


def bins_of(receiver: Receiver) -> Ints:
    """Return the numbers (n,) of the normals that directions are drawn for; `NO_NORMAL` of clear surfaces."""
    if receiver.bins is not None:
        return receiver.bins
    return np.where(receiver.opaque, octahedral_bins(receiver.normal), NO_NORMAL)
