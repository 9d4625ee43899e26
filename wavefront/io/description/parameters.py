"""Tables of the parameters of materials: the name of each in a format, and its name here."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any, NamedTuple

import numpy as np

from ...textures.base import BaseTexture


class Parameter(NamedTuple):
    """A parameter of a material: a number or a color, which may be multiplied by an image."""

    ours: str  # its name in `Principled`, or `Material`
    theirs: str  # that of the number or color
    default: Any = 0.0  # where it is not given; a number, or several of a color
    image: str = ""  # the name of the image, if there may be one
    channel: Any = None  # of the image, as of `Texture`; None: its colors
    neutral: Any = None  # the value that changes nothing
    low: float = 0.0
    high: float = 1.0
    times: float = 1.0  # by which theirs is multiplied
    beside: str = ""  # another parameter, by our name, without which this one has no effect

    @property
    def is_color(self) -> bool:
        """Whether it is a color, not a number."""
        return bool(np.ndim(self.default))


# of glTF, and of what trimesh makes of glTF and COLLADA
METALLIC_ROUGHNESS = (
    Parameter("metallic", "metallicFactor", 1.0, "metallicRoughnessTexture", 2, neutral=0.0),
    Parameter("roughness", "roughnessFactor", 1.0, "metallicRoughnessTexture", 1),
)


def fill(
    wanted: dict[str, Any],
    rows: Iterable[Parameter],
    factor: Callable[[Parameter], Any],
    image: Callable[[Parameter, Any], BaseTexture | None],
) -> None:
    """Set the parameters of a table that a file has, unless they have no effect.

    Parameters
    ----------
    wanted
        The parameters of a material by our names, to which they are added.
    rows
        The table.
    factor
        Returns the number or color of a row; None where the file has none.
    image
        Returns the image of a row, multiplied by a factor; None where the file has none.
    """
    for row in rows:
        if row.beside and row.beside not in wanted:
            continue
        value = factor(row)
        texture = image(row, row.default if value is None else value)
        if texture is not None:
            wanted[row.ours] = texture
        elif value is not None and (row.neutral is None or np.not_equal(value, row.neutral).any()):
            wanted[row.ours] = value
