"""Interleaved tiles: pixels, some distance apart, whose paths share what they find.

The picture is divided into blocks of (SIDE · STRIDE)² pixels, and each block into STRIDE² tiles of SIDE²
pixels, which lie STRIDE pixels apart. So pixels next to each other are of different tiles, and their noise
stays independent. Tiles depend on the place in the whole picture alone, and are the same for every sample:
a pixel that needs more samples needs them together with the others of its tile, in one job.

Source: A. Keller and W. Heidrich, "Interleaved Sampling", Eurographics Workshop on Rendering 2001.
"""

from __future__ import annotations

import numpy as np

from .record import record
from .state import Words
from .vec import Ints

SIDE = 4  # pixels of a tile, in each direction
STRIDE = 7  # pixels between two of them
MEMBERS = SIDE * SIDE


def place_in_tiles(pixel: Words, width: int) -> tuple[Ints, Ints]:
    """Return the number of the tile of each pixel (n,), and which of its members it is, (n,).

    Parameters
    ----------
    pixel
        (n,) row-major indices in a picture so many pixels wide.
    """
    block = SIDE * STRIDE
    number = pixel.astype(np.intp)
    y = number // width
    x = number - y * width
    block_x, block_y = x // block, y // block
    tile_x, tile_y = x % STRIDE, y % STRIDE
    across = -(-width // block)
    tile = ((block_y * across + block_x) * STRIDE + tile_y) * STRIDE + tile_x
    member = (y % block // STRIDE) * SIDE + x % block // STRIDE
    return tile, member


def others_in_tile(pixel: Words, one: int, width: int) -> Ints:
    """Return which of pixels (n,) share the tile of pixel[one], without that one; arguments as above."""
    tile, _ = place_in_tiles(pixel, width)
    same = np.flatnonzero(tile == tile[one])
    return same[same != one]


@record
class WaveTiles:
    """The tiles of the paths of a wave: those of one tile and one sample belong together.

    Pixels that a tile lacks, because they lie outside of the picture or need no samples, are not in it.
    """

    tile: Ints  # (n,) number of the tile of each path, from 0 on
    member: Ints  # (n,) which member of the tile it is
    count: int  # number of tiles

    @classmethod
    def of(cls, pixel: Words, sample: Words, width: int) -> WaveTiles:
        """Return the tiles of paths, given pixels (n,) and samples (n,)."""
        tile, member = place_in_tiles(pixel, width)
        key = (sample.astype(np.intp) << 32) | tile
        order = np.argsort(key, kind="stable")
        ordered = key.take(order)
        number = np.empty(key.size, np.intp)
        number[order] = np.cumsum(np.diff(ordered, prepend=ordered[:1]) != 0)
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


def whole_tiles(pixel: Words, width: int) -> tuple[Ints, Ints]:
    """Return an order (n,) of pixels (n,) in which the members of each tile follow each other, and its cuts.

    Cuts (k,) are the places in this order at which a tile ends, rising. Tiles come in the order of
    their last pixels, so that as many whole rows as possible lie side by side.
    """
    tile, _ = place_in_tiles(pixel, width)
    by_tile = np.argsort(tile, kind="stable")
    ends = np.append(np.flatnonzero(np.diff(tile.take(by_tile))) + 1, pixel.size)
    sizes = np.diff(ends, prepend=0)
    last = pixel.take(by_tile.take(ends - 1))  # pixels rise, also within a tile
    in_turn = np.argsort(last, kind="stable")
    turn = np.empty(ends.size, np.intp)
    turn[in_turn] = np.arange(ends.size)
    order = by_tile.take(np.argsort(np.repeat(turn, sizes), kind="stable"))
    return order, np.cumsum(sizes.take(in_turn))
