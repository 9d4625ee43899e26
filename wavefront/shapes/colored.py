"""The base class of shapes that have colors, and show them unless they are given a material."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..arrays.vec import Doubles, f4
from ..bsdfs import Diffuse
from ..colors import named_rows, srgb_to_linear, warn_of_colormap
from ..colors.maps import color_map, numeric
from ..core.errors import SceneError, exact, finite_array
from ..core.plural import plural
from ..materials import Material
from ..textures.vertex_colors import VertexColors
from .base import Checked, Shape


def linear_colors(name: str, values: ArrayLike | None) -> Doubles | None:
    """Return (n, 4) linear colors in [0, 1]; colors without an opacity are opaque."""
    if values is None:
        return None
    names = named_rows(name, values)
    if names is not None:
        values = names
    array = finite_array(name, values, (None, None))
    codes = getattr(values, "dtype", None)
    if codes in (np.uint8, np.uint16):
        most = np.iinfo(codes).max
        array[:, :3] = srgb_to_linear(array[:, :3].astype(f4) / f4(most))
        array[:, 3:] /= most
    if array.shape[1] not in (3, 4):
        raise SceneError(f"{name} has {plural(array.shape[1], 'number')} per vertex; it must have 3 or 4")
    bad = np.argwhere((array < 0) | (array > 1))
    if len(bad):
        i, j = bad[0]
        raise SceneError(f"{name}[{i}][{j}] is {exact(array[i, j])}; it must be in [0, 1], or uint8")
    if codes is not None:
        warn_of_colormap(name, np.asarray(values))
    return array if array.shape[1] == 4 else np.column_stack([array, np.ones(len(array))])


def mapped_colors(name: str, values: Any, cmap: Any, clim: Any) -> Any:
    """Return the colors of a colormap for numbers (n,), or `values` themselves where none is given.

    Raises
    ------
    SceneError
        If they are not one number each.
    """
    if cmap is None and clim is None:
        return values
    if values is None:
        raise SceneError(f"{name}: cmap and clim are for colors=..., one number each")
    numbers = numeric(f"{name}: colors", values)
    return color_map(f"{name}: colors", numbers, cmap, clim).colors(numbers)


class ColoredShape(Shape):
    """Base class of meshes, with colors of vertices, and of arrays of primitives, with one color for each.

    Attributes
    ----------
    colors
        (n, 4) linear RGB and opacity; None if all are white.
    """

    colors = Checked(linear_colors)
    _default: tuple[bool, Material] | None = None  # whether it shows colors; the material

    @property
    def default_material(self) -> Material:
        """A `Diffuse` that shows the colors, or is gray where there are none."""
        shown = self.colors is not None
        if self._default is None or self._default[0] != shown:
            self._default = shown, Material(Diffuse(VertexColors() if shown else 0.5))
        return self._default[1]
