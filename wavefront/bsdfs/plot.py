"""A BSDF as curves around a point, drawn with matplotlib, which is optional."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from ..arrays.elementary import sin_cos_turns
from ..arrays.vec import f4, luminance
from ..core.errors import SceneError, finite_array
from ..image.plot import import_pyplot
from ..textures.base import BaseTexture

if TYPE_CHECKING:
    from .base import Bsdf

DIRECTIONS = 1440  # around the point, in the plane of `wo` and the normal


def draw_lobes(bsdf: Bsdf, wo: ArrayLike, axes: Any = None) -> Any:
    """Draw f, f times the cosine, and the density of a BSDF, and return the axes; see `Bsdf.plot`."""
    pyplot = import_pyplot()
    textures = [name for name, value in vars(bsdf).items() if isinstance(value, BaseTexture)]
    if textures:
        raise SceneError(f"plot: {', '.join(textures)} of {type(bsdf).__name__} vary over the surface")
    toward = finite_array("plot: wo", wo, (3,))
    if not toward[2] > 0:
        raise SceneError(
            f"plot: wo is {toward.tolist()}; its third component, along the normal, must be above 0"
        )
    toward = toward / np.sqrt(toward @ toward)
    across = np.hypot(toward[0], toward[1])
    along = toward[:2] / across if across > 0 else np.array([1.0, 0.0])
    turns = (np.arange(DIRECTIONS) + 0.5) / DIRECTIONS
    sin, cos = sin_cos_turns(turns.astype(f4))
    wi = np.stack([sin * f4(along[0]), sin * f4(along[1]), cos])
    columns = np.broadcast_to(toward.astype(f4)[:, None], wi.shape)
    f, pdf = bsdf.evaluate(columns, wi)
    curves = {"f": luminance(f), "f·|cosθ|": luminance(f) * np.abs(cos), "pdf": pdf}
    axes = pyplot.subplots(subplot_kw={"projection": "polar"})[1] if axes is None else axes
    axes.set_theta_zero_location("N")
    axes.set_theta_direction(-1)
    for name, values in curves.items():
        axes.plot(2 * np.pi * turns, values, label=name)
    axes.axvline(float(np.arctan2(across, toward[2])), color="gray", linestyle="--", label="wo")
    axes.set_title(
        f"{type(bsdf).__name__}: delta lobes have no curve" if bsdf.specular else type(bsdf).__name__
    )
    axes.legend(loc="lower right")
    return axes
