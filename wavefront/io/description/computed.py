"""Values of parameters: numbers, colors, textures, and functions of these."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ...arrays.state import SurfaceInteraction
from ...arrays.vec import Floats, f4
from ...core.errors import exact
from ...textures.base import BaseTexture
from ..losses import Losses

FLIP = np.array([[1.0, 0, 0], [0, -1, 1], [0, 0, 1]])  # converts between v downwards and v upwards
Value = Any  # a number, a color (3,) or a texture


class Computed(BaseTexture):
    """A function of textures and constants, such as their product; one of colors may give a number."""

    def __init__(
        self,
        function: Callable[..., Any],
        *parts: Any,
        limits: tuple[float, ...] = (),
        scalar: bool = False,
    ) -> None:
        self.function, self._limits = function, limits
        self.parts = tuple(
            argument
            if isinstance(argument, BaseTexture)
            else np.asarray(argument, f4).reshape(-1, 1)  # (1, 1) or (3, 1)
            for argument in parts
        )
        textures = [argument for argument in parts if isinstance(argument, BaseTexture)]
        self.reads = tuple(dict.fromkeys(field for texture in textures for field in texture.reads))
        self.scalar = scalar or all(
            argument.scalar if isinstance(argument, BaseTexture) else np.ndim(argument) == 0
            for argument in parts
        )

    def __repr__(self) -> str:
        """Name the function."""
        return f"<{self.function.__name__} of textures>"

    def limits(self) -> tuple[float, ...]:
        """Return the limits, where they are known."""
        return self._limits

    def at(self, surface: SurfaceInteraction) -> Floats:
        """Return the values of the function, (n,) or (3, n)."""
        arguments = (
            argument.at(surface) if isinstance(argument, BaseTexture) else argument for argument in self.parts
        )
        values = self.function(*(np.atleast_2d(argument) for argument in arguments))
        values = np.broadcast_to(values, (len(values), values.shape[1])).astype(f4)
        return values[0] if self.scalar else np.broadcast_to(values, (3, values.shape[1]))


def product(a: Any, b: Any) -> Any:
    """Return a·b."""
    return a * b


def clipped_product(a: Any, b: Any) -> Any:
    """Return a·b in [0, 1]."""
    return np.clip(a * b, 0, 1)


def limits_of(value: Value) -> tuple[float, ...]:
    """Return the least and the greatest value; () where they are not known."""
    if isinstance(value, BaseTexture):
        return value.limits()
    return float(np.min(value)), float(np.max(value))


def computed(function: Callable[..., Any], *parts: Value, rising: bool = True) -> Value:
    """Return a function of numbers, colors and textures, that rises with all of them where `rising`."""
    if not any(isinstance(argument, BaseTexture) for argument in parts):
        return function(*parts)
    limits = [limits_of(argument) for argument in parts]
    known = rising and all(limits)
    ends = tuple(float(function(*end)) for end in zip(*limits, strict=True)) if known else ()
    return Computed(function, *parts, limits=ends)


def at_least(value: Value, least: float) -> Value:
    """Return a number or a color that is not below a value; a texture is as it is."""
    return value if isinstance(value, BaseTexture) else np.maximum(value, least)


def clipped(value: Value, factor: float = 1.0) -> Value:
    """Return a value times a factor, clamped to [0, 1]."""
    limits = limits_of(value)
    if factor == 1 and limits and limits[0] >= 0 and limits[1] <= 1:
        return value
    return computed(clipped_product, value, factor)


def texture_within(losses: Losses, name: str, value: BaseTexture, high: float, place: str) -> BaseTexture:
    """Return a texture clamped to [0, high], which is noted, where it is known to be outside."""
    limits = value.limits()
    if not limits or (limits[0] >= 0 and limits[1] <= high):
        return value
    span, end = f"{exact(limits[0])} to {exact(limits[1])}", "1" if high == 1 else "more"
    losses.note(f"{name}, a texture,", place, span, f"clamped to 0 to {end}")
    within: BaseTexture = clipped(value) if high == 1 else computed(np.maximum, value, 0.0)
    return within
