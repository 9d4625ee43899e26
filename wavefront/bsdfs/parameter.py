"""Turn what a user passes as a material parameter into constants of fixed shape, or keep a texture."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from ..errors import SceneError, number, rgb
from ..vec import f4
from .base import Spatial

Colour: TypeAlias = ArrayLike | Spatial
Scalar: TypeAlias = float | Spatial


def colour(name: str, value: Colour, high: float = 1.0, *, above_zero: bool = False) -> Any:
    """Return a colour as (3, 1) float32 within [0, `high`], or the `Spatial` unchanged."""
    if isinstance(value, Spatial):
        return value
    result = rgb(name, value, high)
    if above_zero and not (result > 0).all():
        raise SceneError(f"{name} is {value!r}; it must be more than 0")
    return result


def scalar(
    name: str,
    value: Scalar,
    holds: Callable[[float], bool] = lambda x: 0 <= x <= 1,
    limit: str = "in [0, 1]",
) -> Any:
    """Return a number as (1,) float32 for which `holds` is true, or the `Spatial` unchanged."""
    return value if isinstance(value, Spatial) else np.array([number(name, value, holds, limit)], f4)
