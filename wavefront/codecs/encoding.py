"""Conversion between linear values and display values."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arrays.vec import Floats
from ..colors import linear_to_srgb, srgb_to_linear
from ..core.errors import SceneError, number
from . import png_jpeg as coded
from .png_jpeg import Gamma

MAX_STOPS = 100


def codes_to_linear(codes: NDArray[Any], gamma: Gamma = "srgb") -> Floats:
    """Return the linear values of uint8 or uint16 codes (H, W, C); alpha is not decoded."""
    most = np.iinfo(codes.dtype).max
    table = np.arange(most + 1, dtype=np.float32) / np.float32(most)
    decoded = srgb_to_linear(table) if isinstance(gamma, str) else (table.astype(np.float64) ** gamma)
    values, colors = np.empty(codes.shape, np.float32), 3 if codes.shape[2] > 2 else 1
    values[..., :colors] = decoded.astype(np.float32)[codes[..., :colors]]
    values[..., colors:] = table[codes[..., colors:]]
    return values


def exposed(rgb: Floats, exposure: float) -> Floats:
    """Return values multiplied by 2 to the power `exposure`, any shape."""
    return rgb * np.float32(2.0 ** check_exposure(exposure))


def check_exposure(exposure: float) -> float:
    """Return `exposure` as a float.

    Raises
    ------
    SceneError
        If it is not a number from -100 to 100.
    """
    limit = f"from {-MAX_STOPS} to {MAX_STOPS}"
    return number("exposure", exposure, lambda x: abs(x) <= MAX_STOPS, limit)


def check_gamma(gamma: Gamma) -> Gamma:
    """Return `gamma` as a float or "srgb".

    Raises
    ------
    SceneError
        If it is neither a number from 0.01 to 100 nor "srgb".
    """
    if isinstance(gamma, str) and gamma == "srgb":
        return gamma
    low, high = coded.GAMMAS
    if isinstance(gamma, str):
        raise SceneError(f"gamma is {gamma!r}; it must be a number from {low:g} to {high:g}, or 'srgb'")
    return number("gamma", gamma, lambda x: low <= x <= high, f"from {low:g} to {high:g}")


def to_codes(values: ArrayLike, gamma: Gamma = 2.2, bits: int = 8) -> NDArray[Any]:
    """Return linear values as codes for display of 8 or 16 bits, any shape; NaN becomes 0.

    Raises
    ------
    SceneError
        If gamma is neither a number from 0.01 to 100 nor "srgb".
    """
    curve = check_gamma(gamma)
    unit = np.clip(np.nan_to_num(np.asarray(values, np.float32), nan=0.0, posinf=1.0, neginf=0.0), 0, 1)
    encoded = linear_to_srgb(unit) if isinstance(curve, str) else unit.astype(np.float64) ** (1 / curve)
    kind = np.uint8 if bits == 8 else np.uint16
    return np.round(encoded * np.iinfo(kind).max).astype(kind)
