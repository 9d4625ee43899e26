"""Convert the arguments of materials to constants of fixed shape, or to textures of the right kind.

A texture of numbers is used as a gray color, and a texture of colors as a number by its luminance.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from ..arrays.state import SurfaceInteraction
from ..arrays.vec import Floats, f4, luminance
from ..colors import rgb
from ..core.errors import SceneError, exact, number, one_of, shape_of
from .base import BaseTexture

# Largest index of refraction; the least is its inverse: fourth powers stay in the range of float32.
MAX_INDEX = 1e6

# Refractive indices at 20 °C in the yellow light of sodium (589.3 nm) or helium (587.6 nm); they differ by
# 0.0003 at most. BK7, F2, SF11: data sheets of Schott. Fused silica: I. Malitson 1965, J. Opt. Soc. Am. 55,
# 1205. Others: CRC Handbook of Chemistry and Physics; the ordinary ray of birefringent crystals. Acrylic,
# polycarbonate, oil and window glass vary by 0.01.
INDICES = {
    "acetone": 1.3588,
    "acrylic": 1.4914,
    "air": 1.00027,
    "bk7": 1.5168,
    "diamond": 2.4173,
    "ethanol": 1.3611,
    "f2": 1.62004,
    "fused silica": 1.45846,
    "glass": 1.52,
    "glycerol": 1.4746,
    "ice": 1.309,
    "oil": 1.47,
    "polycarbonate": 1.585,
    "quartz": 1.5442,
    "salt": 1.5443,
    "sapphire": 1.7681,
    "sf11": 1.78472,
    "water": 1.333,
}

Color: TypeAlias = ArrayLike | BaseTexture
Scalar: TypeAlias = float | BaseTexture


class Gray(BaseTexture):
    """Colors with three equal channels."""

    scalar = False

    def __init__(self, numbers: BaseTexture) -> None:
        self.numbers, self.reads = numbers, numbers.reads

    def __repr__(self) -> str:
        """Name the numbers."""
        return repr(self.numbers)

    def limits(self) -> tuple[float, ...]:
        """Return the limits of the numbers."""
        return self.numbers.limits()

    def at(self, surface: SurfaceInteraction) -> Floats:
        """Return the numbers as colors, (3, n)."""
        values = self.numbers.at(surface)
        return np.broadcast_to(values, (3, *values.shape))


class Luminance(BaseTexture):
    """Numbers from colors."""

    scalar = True

    def __init__(self, colors: BaseTexture) -> None:
        self.colors, self.reads = colors, colors.reads

    def __repr__(self) -> str:
        """Name the colors."""
        return repr(self.colors)

    def limits(self) -> tuple[float, ...]:
        """Return the limits of the colors."""
        return self.colors.limits()

    def at(self, surface: SurfaceInteraction) -> Floats:
        """Return the luminance of the colors, (n,)."""
        return luminance(self.colors.at(surface))


def check_limits(name: str, value: BaseTexture, holds: Callable[[float], bool], limit: str) -> None:
    """Check the least and the greatest value of a texture, where they are known.

    Raises
    ------
    SceneError
        With the texture, the value and the limit.
    """
    for extreme in value.limits():
        if not holds(extreme):
            hint = ""
            if 1 < extreme <= 255:
                hint = ". Values from 0 to 255 are passed as uint8, or divided by 255; scale= multiplies them"
            raise SceneError(f"{name}: {value!r} has the value {exact(extreme)}; it must be {limit}{hint}")


def color(name: str, value: Color, high: float = 1.0, *, above_zero: bool = False) -> Any:
    """Return a color as (3, 1) float32 within [0, `high`], or a `BaseTexture` that gives colors."""
    if isinstance(value, BaseTexture):
        check_limits(
            name, value, lambda x: 0 <= x <= high, "at least 0" if np.isinf(high) else f"in [0, {high:g}]"
        )
        return Gray(value) if value.scalar else value
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
    """Return a number as (1,) float32 for which `holds` is true, or a `BaseTexture` that gives numbers."""
    if isinstance(value, BaseTexture):
        check_limits(name, value, holds, limit)
        return Luminance(value) if value.scalar is False else value
    if isinstance(value, np.ndarray) and value.shape == (1,):  # as stored in a material
        value = value[0]
    return np.array([number(name, value, holds, limit)], f4)


def index_of(name: str, value: Any) -> Any:
    """Return the refractive index of a substance by its name; another value as it is."""
    return (
        INDICES[one_of(name, value.lower().replace("_", " "), INDICES)] if isinstance(value, str) else value
    )


def refractive_indices(name: str, value: Color) -> Any:
    """Return a refractive index as by `refractive_index`, or one for each channel as (3, 1) float32."""
    if isinstance(value, BaseTexture | str) or math.prod(shape_of(value)) != 3:
        return refractive_index(name, value)  # type: ignore[arg-type]
    return np.concatenate(
        [refractive_index(f"{name}[{i}]", index) for i, index in enumerate(np.ravel(value).tolist())]
    )[:, None]


def refractive_index(name: str, value: Scalar) -> Any:
    """Return a refractive index, also by the name of a substance, as (1,) float32, or a `BaseTexture`."""
    return scalar(
        name,
        index_of(name, value),
        lambda x: 1 / MAX_INDEX <= x <= MAX_INDEX,
        f"more than 0, from {1 / MAX_INDEX:g} to {MAX_INDEX:g}",
    )
