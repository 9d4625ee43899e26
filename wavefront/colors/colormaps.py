"""Colors that were taken from a colormap of matplotlib, which are sRGB, for linear ones."""

from __future__ import annotations

import sys
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arrays.vec import f4
from ..core.errors import warn_caller

MOST_ROWS = 16  # that are looked up


def warn_of_colormap(name: str, colors: NDArray[Any]) -> None:
    """Warn where colors (n, 3) or (n, 4) of floats are those of a colormap of matplotlib.

    Detected are rows that are, bit for bit in float32, entries of one of the colormaps that matplotlib has
    registered, where a program has imported it. Rows of zeros and ones alone are the same in sRGB and do not
    count, and two others at least must differ.
    """
    if "matplotlib.colors" not in sys.modules or colors.dtype.kind != "f" or len(colors) < 2:
        return
    sample = colors[np.linspace(0, len(colors) - 1, MOST_ROWS).astype(np.intp), :3].astype(f4)
    rows = {row.tobytes() for row in sample if ((row != 0) & (row != 1)).any()}
    match = next((label for label, table in _tables().items() if rows <= table), None)
    if len(rows) > 1 and match is not None:
        warn_caller(
            f"{name} are those of matplotlib's colormap {match!r}, which are sRGB, but floats are taken as "
            "linear; give colors=wf.srgb(...)"
        )


@cache
def _tables() -> dict[str, frozenset[bytes]]:
    """Return the entries of each colormap that matplotlib has now, as float32."""
    maps = sys.modules["matplotlib"].colormaps
    return {
        label: frozenset(row.tobytes() for row in maps[label](np.arange(maps[label].N))[:, :3].astype(f4))
        for label in maps
    }
