"""Values at points of a plane drawn with matplotlib, which is optional."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..arrays.vec import luminance
from ..core.errors import SceneError
from ..image.plot import import_pyplot

if TYPE_CHECKING:
    from .measurement import Measurement

UNITS = {
    "irradiance": "W·m⁻²",
    "fluence": "W·m⁻²",
    "radiance": "W·sr⁻¹·m⁻²",
    "arriving flux": "W",
    "leaving flux": "W",
}


def draw(found: Measurement, levels: int, axes: Any, label: str | None) -> Any:
    """Draw a measurement over the two axes along which its points are spread most, and return the axes."""
    pyplot = import_pyplot()
    across, up = np.sort(np.argsort(-np.ptp(found.points, axis=0), kind="stable")[:2])
    x, y = found.points[:, across], found.points[:, up]
    if np.linalg.matrix_rank(np.stack([x - x[0], y - y[0]]), tol=1e-6 * np.ptp(x)) < 2:
        raise SceneError("plot: the points are on one line; they must cover a plane")
    value = luminance(found.value.T)
    axes = pyplot.subplots()[1] if axes is None else axes
    filled = axes.tricontourf(x, y, value, 64, cmap="viridis")
    if np.ptp(value) > 0:
        axes.clabel(axes.tricontour(x, y, value, levels, colors="white", linewidths=0.7), fontsize="small")
    axes.figure.colorbar(filled, ax=axes, label=label or f"{found.kind}, {UNITS[found.kind]}")
    axes.set_aspect("equal")
    axes.set_xlabel("xyz"[across])
    axes.set_ylabel("xyz"[up])
    return axes
