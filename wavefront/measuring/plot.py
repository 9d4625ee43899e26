"""Values at points of a plane drawn with matplotlib, which is optional."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..arrays.vec import luminance
from ..core.errors import SceneError, one_of
from ..image.plot import import_pyplot
from .units import PHOTOMETRIC, UNITS

if TYPE_CHECKING:
    from .measurement import Measurement


def draw(measurement: Measurement, levels: int, axes: Any, label: str | None, unit: str, cmap: Any) -> Any:
    """Draw a measurement over the two axes along which its points are spread most, and return the axes."""
    pyplot = import_pyplot()
    across, up = np.sort(np.argsort(-np.ptp(measurement.points, axis=0), kind="stable")[:2])
    x, y = measurement.points[:, across], measurement.points[:, up]
    if np.linalg.matrix_rank(np.stack([x - x[0], y - y[0]]), tol=1e-6 * np.ptp(x)) < 2:
        raise SceneError("plot: the points are on one line; they must cover a plane")
    value = (
        measurement.lux if one_of("unit", unit, ("watts", "lux")) == "lux" else luminance(measurement.value.T)
    )
    axes = pyplot.subplots()[1] if axes is None else axes
    filled = axes.tricontourf(x, y, value, 64, cmap=cmap)
    if np.ptp(value) > 0:
        axes.clabel(axes.tricontour(x, y, value, levels, colors="white", linewidths=0.7), fontsize="small")
    axes.figure.colorbar(filled, ax=axes, label=label or f"{measurement.kind}, {_unit(measurement, unit)}")
    axes.set_aspect("equal")
    axes.set_xlabel("xyz"[across])
    axes.set_ylabel("xyz"[up])
    return axes


def _unit(measurement: Measurement, unit: str) -> str:
    return PHOTOMETRIC[measurement.kind][1] if unit == "lux" else UNITS[measurement.kind]
