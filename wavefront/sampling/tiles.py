"""Tiles: pixels whose paths share light.

Those of a picture are interleaved. It is divided into blocks of SIDE² cells. Each cell has STRIDE² pixels,
one of each of the STRIDE² tiles of its block. A hash of block and cell shifts the tiles within the cell, so
the pixels of a tile lie at irregular distances, and the noise that they share does not repeat. Tiles depend
on the place in the whole picture alone, and are the same for every sample: a pixel that needs more samples
needs them together with the others of its tile, in one job. Partners that change from sample to sample would
lose the stratification of the light that a pixel gets from the others.

Sensors at points form tiles of those that lie near each other.

Source: A. Keller and W. Heidrich, "Interleaved Sampling", Eurographics Workshop on Rendering 2001.
"""

from __future__ import annotations

from typing import TypeAlias

import numpy as np

from ..arrays.soa import soa
from ..arrays.state import Words
from ..arrays.vec import Doubles, Ints

SIDE = 4  # cells of a block, in each direction; each has a pixel of every tile
STRIDE = 7  # pixels of a cell, in each direction
MEMBERS = SIDE * SIDE
PIXELS_PER_TRIED = 1536  # of a picture, for each tile of a tuning run: a sixth of a sample of each pixel
POINTS_PER_TRIED, LEAST_TRIED = 1024, 8  # likewise of sensors, which get many samples; and tiles for few
TILES_PER_BLOCK = 4  # of sensors, which get samples together: as many as the squares of a picture have pixels
MORTON_BITS = 20  # of each coordinate


def place_in_tiles(pixel: Words, width: int) -> tuple[Ints, Ints]:
    """Return the number of the tile of each pixel (n,), and which of its members it is, (n,).

    Parameters
    ----------
    pixel
        (n,) row-major indices in a picture of this width.
    """
    (y, x), side = _divided(pixel.astype(np.uint32), width), SIDE * STRIDE
    (block_x, x), (block_y, y) = _divided(x, side), _divided(y, side)
    (cell_x, x), (cell_y, y) = _divided(x, STRIDE), _divided(y, STRIDE)
    member = cell_y * np.uint32(SIDE) + cell_x
    shift_x, shift_y = cell_shifts(block_x, block_y, member)
    tile_x, tile_y = _divided(x + shift_x, STRIDE)[1], _divided(y + shift_y, STRIDE)[1]
    block = block_y * np.uint32(-(-width // side)) + block_x
    tile = (block * np.uint32(STRIDE) + tile_y) * np.uint32(STRIDE) + tile_x
    return tile.astype(np.intp), member.astype(np.intp)


def _divided(numbers: Words, divisor: int) -> tuple[Words, Words]:
    """Return quotients and remainders (n,); much faster than `np.divmod` and with longer integers."""
    whole = numbers // np.uint32(divisor)
    return whole, numbers - whole * np.uint32(divisor)


def cell_shifts(block_x: Words, block_y: Words, member: Words) -> tuple[Words, Words]:
    """Return the shifts of the tiles of cells, (n,) pixels in x and y: a hash of the cells.

    The hash is that of C. Wellons, Prospecting for Hash Functions, 2018, lowbias32.
    """
    h = block_x * np.uint32(0x9E3779B1) + block_y * np.uint32(0x85EBCA77) + member * np.uint32(0xC2B2AE3D)
    for shift, factor in ((16, 0x7FEB352D), (15, 0x846CA68B)):
        h ^= h >> np.uint32(shift)
        h *= np.uint32(factor)
    h ^= h >> np.uint32(16)
    rest, shift_x = _divided(h, STRIDE)
    return shift_x, _divided(rest, STRIDE)[1]


def pixels_of_tiles(place: Ints, across: int) -> tuple[Ints, Ints]:
    """Return columns and rows (k, MEMBERS) of the pixels of tiles (k,), numbered block by block from 0 on.

    `across` is the number of blocks in a row.
    """
    block, tile = np.divmod(place[:, None], STRIDE * STRIDE)
    (block_y, block_x), member = np.divmod(block, across), np.arange(MEMBERS)
    cells = (numbers.astype(np.uint32) for numbers in (block_x, block_y, member))
    shift_x, shift_y = (shift.astype(np.intp) for shift in cell_shifts(*cells))
    x = (block_x * SIDE + member % SIDE) * STRIDE + (tile % STRIDE - shift_x) % STRIDE
    y = (block_y * SIDE + member // SIDE) * STRIDE + (tile // STRIDE - shift_y) % STRIDE
    return x, y


@soa
class PictureTiles:
    """The interleaved tiles of a picture."""

    width: int  # pixels
    height: int

    def place(self, pixel: Words) -> tuple[Ints, Ints]:
        """Return tile and member of pixels (n,), as `place_in_tiles`."""
        return place_in_tiles(pixel, self.width)

    def block_of(self, pixel: Words) -> Ints:
        """Return the number of the block of each pixel (n,), which has whole tiles."""
        return self.place(pixel)[0] // STRIDE**2

    @property
    def count(self) -> int:
        """Number of tiles, with those that have no pixel."""
        return -(-self.width // (SIDE * STRIDE)) * -(-self.height // (SIDE * STRIDE)) * STRIDE**2

    @property
    def tried(self) -> int:
        """How many tiles a tuning run has, at most."""
        return self.width * self.height // PIXELS_PER_TRIED

    def pixels(self, number: Ints) -> list[Words]:
        """Return the pixels of each of some tiles (k,)."""
        columns, rows = pixels_of_tiles(number, -(-self.width // (SIDE * STRIDE)))
        return [
            (y * self.width + x)[(x < self.width) & (y < self.height)].astype(np.uint32)
            for x, y in zip(columns, rows, strict=True)
        ]


@soa
class PointTiles:
    """The tiles of sensors: each has sensors that follow each other in an order of all."""

    rank: Ints  # (n,) place of each pixel in this order

    def place(self, pixel: Words) -> tuple[Ints, Ints]:
        """Return tile and member of pixels (n,), as `place_in_tiles`."""
        return np.divmod(self.rank.take(pixel), MEMBERS)

    def block_of(self, pixel: Words) -> Ints:
        """Return the number of the block of each pixel (n,), which has whole tiles."""
        return self.place(pixel)[0] // TILES_PER_BLOCK

    @property
    def count(self) -> int:
        """How many there are."""
        return -(-self.rank.size // MEMBERS)

    @property
    def tried(self) -> int:
        """How many tiles a tuning run has, at most."""
        return max(LEAST_TRIED, self.rank.size // POINTS_PER_TRIED)

    def pixels(self, number: Ints) -> list[Words]:
        """Return the pixels of each of some tiles (k,)."""
        order = np.argsort(self.rank).astype(np.uint32)
        return [order[MEMBERS * tile : MEMBERS * (tile + 1)] for tile in number.tolist()]


Tiles: TypeAlias = PictureTiles | PointTiles


def nearby_ranks(points: Doubles, directions: Doubles) -> Ints:
    """Return the place (n,) of each point in an order in which near points of like directions lie together.

    First come those whose directions have the same largest component, then those that are near along a
    Morton curve (G. M. Morton, 1966).
    """
    axis = np.abs(directions).argmax(1)
    facing = 2 * axis + (directions[np.arange(len(axis)), axis] < 0)
    low = points.min(0)
    size = np.max(points.max(0) - low) or 1.0
    cells = ((points - low) / size * (2**MORTON_BITS - 1)).astype(np.int64)
    key = np.zeros(len(points), np.int64)
    for bit in range(MORTON_BITS):
        for k in range(3):
            key |= (cells[:, k] >> bit & 1) << (3 * bit + k)
    rank = np.empty(len(points), np.intp)
    rank[np.lexsort((key, facing))] = np.arange(len(points))
    return rank


def others_in_tile(pixel: Words, one: int, tiles: Tiles) -> Ints:
    """Return which of pixels (n,) share the tile of pixel[one], without that one."""
    tile, _ = tiles.place(pixel)
    same = np.flatnonzero(tile == tile[one])
    return same[same != one]


@soa
class WaveTiles:
    """The tiles of the paths of a wave: those of one tile and one sample belong together.

    Pixels that a tile lacks, because they lie outside of the picture, are not in it.
    """

    tile: Ints  # (n,) number of the tile of each path, from 0 on, sample by sample
    member: Ints  # (n,) which member of the tile it is
    count: int  # number of tiles

    @classmethod
    def of(cls, pixel: Words, sample: Words, tiles: Tiles) -> WaveTiles:
        """Return the tiles of paths, given pixels (n,) and samples (n,)."""
        tile, member = tiles.place(pixel)
        rank = np.cumsum(np.bincount(tile, minlength=1) > 0)  # from 1 on, among the tiles of the wave
        in_turn = (sample - sample.min(initial=2**32 - 1)).astype(np.intp)
        number = in_turn * rank[-1] + rank.take(tile) - 1
        return cls(number, member, int(number.max(initial=-1)) + 1)

    def grid(self, path: Ints, which: Ints | None = None) -> Ints:
        """Return which of some paths belongs to each member of each tile, (MEMBERS, tiles); -1 for none.

        Parameters
        ----------
        path
            (k,) paths of the wave. The result holds indices into this array.
        which
            Indices of those that count, at most one for each member of a tile; None for all.
        """
        numbers = np.arange(path.size) if which is None else which
        path = path.take(numbers)
        grid = np.full((MEMBERS, self.count), -1, np.intp)
        grid[self.member.take(path), self.tile.take(path)] = numbers
        return grid


def whole_tiles(pixel: Words, tiles: Tiles) -> tuple[Ints, Ints]:
    """Return an order (n,) of pixels (n,) in which the members of each tile follow each other, and its cuts.

    Cuts (k,) are the places in this order at which a tile ends, rising. Tiles come in the order of
    their last pixels, so that as many whole rows as possible lie side by side.
    """
    tile, _ = tiles.place(pixel)
    by_tile = np.argsort(tile, kind="stable")
    ends = np.append(np.flatnonzero(np.diff(tile.take(by_tile))) + 1, pixel.size)
    sizes = np.diff(ends, prepend=0)
    last = pixel.take(by_tile.take(ends - 1))  # pixels rise, also within a tile
    in_turn = np.argsort(last, kind="stable")
    turn = np.empty(ends.size, np.intp)
    turn[in_turn] = np.arange(ends.size)
    order = by_tile.take(np.argsort(np.repeat(turn, sizes), kind="stable"))
    return order, np.cumsum(sizes.take(in_turn))
