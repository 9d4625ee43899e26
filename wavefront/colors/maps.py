"""Numbers as colors, by a colormap and limits."""

from __future__ import annotations

from dataclasses import dataclass
from difflib import get_close_matches
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arrays.vec import Doubles, Floats
from ..core.errors import SceneError, as_array, finite_array
from .color import srgb

DEFAULT_MAP = "viridis"
NO_NUMBER = (169, 169, 169, 255)  # sRGB of numbers that are not finite, as in PyVista
MOST_HINTS = 3
FAR = 1e6  # lengths of the table beyond its ends that count


@dataclass(frozen=True)
class ColorMap:
    """A table of colors, and the numbers of its ends."""

    table: NDArray[np.uint8]  # (k, 4) sRGB and opacity
    limits: tuple[float, float]
    no_number: tuple[int, ...] = NO_NUMBER
    log: bool = False  # whether the logarithms of the numbers are shown

    def places(self, values: Doubles) -> Doubles:
        """Return the places of numbers (...) in the table, 0 to 1 within it; NaN where one is not finite."""
        low, high = self.limits
        if self.log:
            with np.errstate(divide="ignore", invalid="ignore"):
                values, (low, high) = np.log10(values), np.log10(self.limits).tolist()
        place = np.clip((values - low) / ((high - low) or 1.0), -FAR, FAR)
        return np.where(np.isfinite(values), place, np.nan)

    def colors(self, values: Doubles) -> Floats:
        """Return the linear colors and opacities (n, 4) of numbers (n,)."""
        place, count = self.places(values), len(self.table)
        is_finite = np.isfinite(place)
        entry = np.clip((np.where(is_finite, place, 0) * count).astype(np.intp), 0, count - 1)
        codes = np.where(is_finite[:, None], self.table[entry], np.array(self.no_number, np.uint8))
        return srgb(codes.astype(np.uint8))

    def picture(self) -> NDArray[np.uint8]:
        """Return a picture (2, k, 4) of the table, above a row of the color of NaN."""
        return np.stack([self.table, np.broadcast_to(np.array(self.no_number, np.uint8), self.table.shape)])

    def coordinates(self, values: Doubles) -> Doubles:
        """Return the texture coordinates (n, 2) of numbers (n,), in the picture or beyond."""
        place = self.places(values)
        is_finite = np.isfinite(place)
        return np.stack([np.where(is_finite, place, 0.5), np.where(is_finite, 0.75, 0.25)], 1)


def color_map(name: str, values: ArrayLike, cmap: Any = None, limits: ArrayLike | None = None) -> ColorMap:
    """Return the colors of numbers.

    Parameters
    ----------
    name
        Of the numbers, for messages.
    values
        Numbers, whose least and greatest are the limits where none are given.
    cmap
        The name of a colormap of matplotlib, by default "viridis"; one of its colormaps; or a list of colors,
        as for `srgb`.
    limits
        The numbers at both ends.

    Raises
    ------
    SceneError
        If there is no such colormap, a limit is not finite, or no number is.
    ImportError
        If matplotlib is not installed.
    """
    if limits is not None:
        low, high = finite_array("clim", limits, (2,)).tolist()
        return ColorMap(_table(cmap), (low, high))
    numbers = numeric(name, values)
    finite = numbers[np.isfinite(numbers)]
    if not finite.size:
        raise SceneError(f"{name} has no finite number")
    return ColorMap(_table(cmap), (float(finite.min()), float(finite.max())))


def numeric(name: str, values: ArrayLike) -> Doubles:
    """Return numbers (n,) as float64; they may be NaN.

    Raises
    ------
    SceneError
        If they are something else.
    """
    array = as_array(name, values)
    if array.dtype.kind not in "fiub" or array.ndim != 1:
        raise SceneError(f"{name} must be one number each, got {array.dtype} of shape {array.shape}")
    return array.astype(np.float64)


def _table(cmap: Any) -> NDArray[np.uint8]:
    if isinstance(cmap, list | tuple | np.ndarray):
        colors = np.atleast_2d([_codes(color) for color in cmap])
        return np.concatenate([colors, np.full((len(colors), 4 - colors.shape[1]), 255)], 1).astype(np.uint8)
    cmap = DEFAULT_MAP if cmap is None else cmap
    if isinstance(cmap, str):
        cmap = _named(cmap)
    if not (callable(cmap) and hasattr(cmap, "N")):
        raise SceneError(f"cmap is {cmap!r}; it must be a colormap of matplotlib, its name, or colors")
    return np.rint(255 * np.asarray(cmap(np.arange(cmap.N)))).astype(np.uint8)


def _named(cmap: str) -> Any:
    try:
        from matplotlib import colormaps
    except ImportError as error:
        raise ImportError("colormaps need matplotlib: pip install matplotlib") from error
    if cmap not in colormaps:
        near = [repr(name) for name in get_close_matches(cmap, list(colormaps), MOST_HINTS)]
        hint = f"; the nearest names are {', '.join(near)}" if near else ""
        raise SceneError(f"cmap is {cmap!r}, which is no colormap of matplotlib{hint}")
    return colormaps[cmap]


def _codes(color: Any) -> Any:
    """Return the sRGB codes of a color: a name, or three floats in sRGB from 0 to 1."""
    if isinstance(color, str):
        from .transfer import linear_to_srgb

        return np.rint(255 * linear_to_srgb(srgb(color)))
    return np.rint(255 * finite_array("cmap", color, (None,)))
