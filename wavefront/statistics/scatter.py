"""The scatter of batches of samples where pixels share paths: it gives the error of a mean over pixels.

The errors of the pixels of a tile depend on each other, those of tiles do not (sampling/tiles.py). So the sum
over the pixels of one tile is formed for each batch of samples, and the scatter of these sums over batches is
the squared error of the tile's part. The squared errors of tiles add up, and so do their degrees of freedom.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arrays.soa import soa
from ..arrays.vec import Doubles, Floats, Ints
from ..core.errors import SceneError
from ..film.film import Film, chunks
from ..sampling.tiles import place_in_tiles

UNIT = 127  # deviations are whole multiples of this part of the standard error
NAMES = {"deviations": (np.int8, 4), "tile": (np.int32, 2)}  # types and dimensions
PREFIX = "scatter."  # before the names of arrays in files


@soa
class Scatter:
    """How the batches of pixels that share paths scatter.

    The squares of a pixel's deviations add up to its squared error, or less: the rest is its own.
    """

    deviations: NDArray[np.int8]  # (H, W, batches, 3) times the pixel's standard error / UNIT; see above
    tile: NDArray[np.int32]  # (H, W) pixels of different tiles are independent

    def rescaled(self, factor: Floats) -> Scatter:
        """Return the same scatter where standard errors are 1 / factor (H, W, 3) times as large."""
        scaled = np.empty_like(self.deviations)
        for row, other, by in zip(scaled, self.deviations, factor, strict=True):
            row[:] = _whole(other * by[:, None])
        return Scatter(scaled, self.tile)


def _whole(values: Any) -> NDArray[np.int8]:
    return np.asarray(np.clip(np.rint(values), -UNIT, UNIT).astype(np.int8))


def film_scatter(
    film: Film, standard_error: Floats, whole: tuple[int, int], corner: tuple[int, int]
) -> tuple[Scatter, ...]:
    """Return the scatter of a film whose pixels share paths; nothing where pixels lack a second sample.

    Parameters
    ----------
    standard_error
        (H, W, 3) of its picture.
    whole, corner
        (width, height) of the whole picture, and the column and row in it of the film's first pixel.
    """
    width, height = film.size
    if film.count.min() < 2:
        return ()
    batches = film.deviations(slice(0, 1)).shape[0]
    deviations = np.empty((width * height, batches, 3), np.int8)
    errors = standard_error.reshape(-1, 3)
    for span in chunks(width * height):
        scale = np.maximum(errors[span], np.finfo(np.float32).tiny)
        raw = film.deviations(span).transpose(2, 0, 1)
        deviations[span] = _whole(raw * (UNIT / scale.astype(np.float64))[:, None])
    pixel = np.add.outer(
        (np.arange(height, dtype=np.int64) + corner[1]) * whole[0], np.arange(width) + corner[0]
    )
    tile, _ = place_in_tiles(pixel.ravel().astype(np.uint32), whole[0])
    shape = height, width
    return (Scatter(deviations.reshape(*shape, batches, 3), tile.astype(np.int32).reshape(shape)),)


def sums_by_label(
    standard_error: Floats, freedom: Doubles, scatter: Sequence[Scatter], label: Ints, labels: int
) -> tuple[Doubles, Doubles]:
    """Estimate the variance of sums over the pixels of each label, and how well it is known.

    Parameters
    ----------
    standard_error
        (H, W, 3)
    freedom
        (H, W) degrees of freedom of each pixel's error.
    scatter
        Of the picture, for each part of it that shares paths.
    label
        (H, W) from 0 to `labels` - 1, or -1 for pixels that do not count.

    Returns
    -------
    variance
        (labels, 3)
    spread
        (labels, 3) sum of the squares of independent parts of the variance over their degrees of freedom, so
        that variance² / spread are those of the whole (F. E. Satterthwaite, An Approximate Distribution of
        Estimates of Variance Components, 1946).
    """
    pixels = np.flatnonzero(label.ravel() >= 0)
    where = label.ravel().take(pixels)
    error = standard_error.reshape(-1, 3)[pixels].astype(np.float64)
    variance, spread, unshared = np.zeros((labels, 3)), np.zeros((labels, 3)), np.ones_like(error)
    for group in scatter:
        deviations = group.deviations.reshape(-1, *group.deviations.shape[2:])[pixels] / np.float64(UNIT)
        unshared -= np.square(deviations).sum(1)
        deviations *= error[:, None]
        shared, tile = _by_tile(deviations, group.tile.ravel()[pixels], where)
        _add_to(variance, tile, shared[0])
        _add_to(spread, tile, shared[1])
    alone = np.square(error) * np.where(unshared > ROUNDING, unshared, 0)
    _add_to(variance, where, alone)
    _add_to(spread, where, np.square(alone) / freedom.ravel()[pixels, None])
    return variance, spread


ROUNDING = 0.05  # part of a squared error that the rounding of deviations may leave over


def _by_tile(pixels: Doubles, tile: NDArray[np.int32], label: Ints) -> tuple[tuple[Doubles, Doubles], Ints]:
    """Return variance and spread (m, 3) of the sums over pixels of one tile and label, and labels (m,).

    All pixels of a tile have equally many samples.

    Parameters
    ----------
    pixels
        (k, batches, 3) deviations of pixels.
    """
    order = np.lexsort((tile, label))
    key = np.stack([label, tile.astype(np.intp)])[:, order]
    first = np.flatnonzero(np.append(True, (key[:, 1:] != key[:, :-1]).any(0)))
    if not order.size:
        return (np.zeros((0, 3)), np.zeros((0, 3))), np.zeros(0, np.intp)
    sums = np.add.reduceat(pixels[order], first, axis=0)
    variance = np.square(sums).sum(1)
    freedom = np.maximum((sums != 0).any(2).sum(1) - 1, 1)[:, None]
    return (variance, np.square(variance) / freedom), key[0, first]


def _add_to(sums: Doubles, label: Ints, values: Doubles) -> None:
    """Add values (m, 3) to sums (labels, 3) by their labels (m,)."""
    for channel in range(values.shape[1]):
        sums[:, channel] += np.bincount(label, values[:, channel], sums.shape[0])


def scatter_of_difference(
    parts: Sequence[tuple[Sequence[Scatter], Floats]], standard_error: Floats
) -> tuple[Scatter, ...]:
    """Return the scatter of the difference, or sum, of independent pictures.

    Parameters
    ----------
    parts
        Scatter and standard error (H, W, 3) of each picture.
    standard_error
        (H, W, 3) of the result.
    """
    tiny = np.finfo(np.float32).tiny
    return tuple(
        group.rescaled(error / np.maximum(standard_error, tiny))
        for scatter, error in parts
        for group in scatter
    )


def scatter_arrays(scatter: Sequence[Scatter]) -> dict[str, NDArray[Any]]:
    """Return all arrays by the names that they have in files."""
    return {
        f"{PREFIX}{number}.{name}": getattr(group, name)
        for number, group in enumerate(scatter)
        for name in NAMES
    }


def restored_scatter(
    file: str, shape: tuple[int, ...], arrays: Mapping[str, NDArray[Any]]
) -> tuple[Scatter, ...]:
    """Return the scatter of a picture (H, W, 3) of which `scatter_arrays` returned these, from a file.

    Raises
    ------
    SceneError
        If one is missing, or is of another shape or type.
    """
    restored: list[Scatter] = []
    for _ in range(len(arrays) // len(NAMES)):
        values = {name: arrays.get(f"{PREFIX}{len(restored)}.{name}") for name in NAMES}
        for name, (kind, dimensions) in NAMES.items():
            data = values[name]
            right = data is not None and data.dtype == kind and data.ndim == dimensions
            if data is None or not right or data.shape[:2] != shape[:2] or data.shape[3:] not in ((), (3,)):
                raise SceneError(f"{file}: the scatter of its samples is damaged: {name!r}")
        restored.append(Scatter(**values))  # type: ignore[arg-type]
    return tuple(restored)
