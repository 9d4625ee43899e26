"""AOVs of a picture drawn with matplotlib, which is optional."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arrays.vec import Doubles, Floats
from ..codecs.encoding import to_codes
from ..film.aov_names import components

STEPS = 1.2207440846 ** -np.arange(1.0, 4)  # fill a cube evenly: M. Roberts, Quasirandom Sequences, 2018
DARKEST = 0.15
MOST_NAMES = 20  # in a legend: those of the largest areas
FILL = 0.85  # gray where an AOV has no value


def draw(name: str, values: NDArray[Any], names: Mapping[int, str] | None, axes: Any, cmap: Any) -> Any:
    """Draw an AOV, and return the axes.

    Parameters
    ----------
    name
        Of the AOV; the title.
    values
        (H, W) or (H, W, c). Codes of uint8 are drawn as they are.
    names
        Of ids, if the AOV holds ids.
    axes
        Axes of matplotlib, or None for new ones.
    cmap
        Colormap of numbers.
    """
    pyplot = import_pyplot()
    axes = pyplot.subplots()[1] if axes is None else axes
    axes.set_title(name)
    axes.set_axis_off()
    if names is not None:
        _draw_ids(axes, values, names)
    elif values.ndim == 2:
        picture = axes.imshow(values, cmap=cmap, interpolation="nearest")
        axes.figure.colorbar(picture, ax=axes)
    else:
        axes.imshow(aov_colors(name, values), interpolation="nearest")
    return axes


def draw_scale(
    name: str, unit: str, values: NDArray[Any], limits: tuple[float, float], log: bool, axes: Any, cmap: Any
) -> Any:
    """Draw numbers (H, W) between limits in false color, with a scale in a unit, and return the axes."""
    pyplot = import_pyplot()
    from matplotlib.colors import LogNorm, Normalize

    axes = pyplot.subplots()[1] if axes is None else axes
    axes.set_title(name)
    axes.set_axis_off()
    scale = (LogNorm if log else Normalize)(*limits, clip=True)
    picture = axes.imshow(np.fmax(values, limits[0]), cmap=cmap, norm=scale, interpolation="nearest")
    axes.figure.colorbar(picture, ax=axes, label=unit)
    return axes


def import_pyplot() -> Any:
    """Return matplotlib's pyplot.

    Raises
    ------
    ImportError
        If it is not installed. The message says how to install it.
    """
    try:
        from matplotlib import pyplot
    except ImportError as error:
        raise ImportError("plotting needs matplotlib: pip install matplotlib") from error
    return pyplot


def aov_colors(name: str, values: NDArray[Any]) -> NDArray[Any]:
    """Return the components (H, W, c) of an AOV as colors (H, W, 3), uint8 or in [0, 1]."""
    if values.dtype == np.uint8:
        return values
    kind = "".join(components(name, values.shape[2]))
    if kind == "RGB":
        return to_codes(values)
    if kind == "XYZ" and "normal" in name:
        return _filled((values + 1) / 2)
    if kind == "XYZ":
        return _filled(_stretched(values))
    padded = np.zeros((*values.shape[:2], 3), np.float32)  # uv as red and green, by their fraction
    padded[..., : min(3, values.shape[2])] = values[..., :3] % 1
    return _filled(np.where(np.isnan(values[..., :1]), np.nan, padded))


def _stretched(values: Floats) -> Floats:
    """Return values scaled so that each component fills [0, 1]."""
    known = values[~np.isnan(values).any(axis=-1)]
    if not len(known):
        return values
    low, high = known.min(0), known.max(0)
    return (values - low) / np.where(high > low, high - low, 1)


def _filled(colors: Floats) -> Floats:
    return np.clip(np.where(np.isnan(colors), FILL, colors), 0, 1)


def _draw_ids(axes: Any, ids: NDArray[Any], names: Mapping[int, str]) -> None:
    """Draw each id in a color of its own, with a legend of the largest ones."""
    from matplotlib.patches import Patch

    axes.imshow(id_colors(ids), interpolation="nearest")
    numbers, areas = np.unique(ids[ids >= 0], return_counts=True)
    largest = np.sort(numbers[np.argsort(-areas, kind="stable")[:MOST_NAMES]])
    patches = [
        Patch(color=color, label=names.get(int(number), str(number)))
        for number, color in zip(largest, id_colors(largest), strict=True)
    ]
    if patches:
        axes.legend(handles=patches, loc="upper left", bbox_to_anchor=(1, 1), fontsize="small")


def id_colors(ids: NDArray[Any]) -> Doubles:
    """Return distinct colors (..., 3) in [0, 1] of ids, any shape; those below 0 are gray."""
    numbers = np.asarray(ids)[..., None]
    return np.where(numbers < 0, FILL, DARKEST + (1 - DARKEST) * (numbers * STEPS % 1))
