"""Tone curves: functions from linear radiance of any size to linear display values in [0, 1].

Each takes and returns an array (..., 3) of float64. Values below 0 count as 0, infinite ones as the largest.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..arrays.vec import Doubles

LUMINANCE = np.array([[0.2126, 0.7152, 0.0722]])  # of linear RGB, ITU-R BT.709
LARGEST = 1e30  # radiance; larger values are the same on the display

ACES_IN = np.array([[0.59719, 0.35458, 0.04823], [0.07600, 0.90834, 0.01566], [0.02840, 0.13383, 0.83777]])
ACES_OUT = np.array(
    [[1.60475, -0.53108, -0.07367], [-0.10208, 1.10813, -0.00605], [-0.00327, -0.07276, 1.07602]]
)

AGX_IN = np.array(
    [
        [0.842479062253094, 0.0784335999999992, 0.0792237451477643],
        [0.0423282422610123, 0.878468636469772, 0.0791661274605434],
        [0.0423756549057051, 0.0784336, 0.879142973793104],
    ]
)
AGX_OUT = np.linalg.inv(AGX_IN)
AGX_STOPS = (-12.47393, 4.026069)  # log₂ of the radiances that become black and white
AGX_CURVE = (15.5, -40.14, 31.96, -6.868, 0.4298, 0.1191, -0.00232)  # from the 6th power down
AGX_GAMMA = 2.2  # of the display that the curve is made for
PUNCHY_POWER, PUNCHY_SATURATION = 1.35, 1.4


def transformed(matrix: Doubles, rgb: Doubles) -> Doubles:
    """Return `matrix` (k, 3) times each color (..., 3); the sums are written out, see `arrays/vec.py`."""
    return np.stack([a * rgb[..., 0] + b * rgb[..., 1] + c * rgb[..., 2] for a, b, c in matrix], axis=-1)


def clipped(rgb: Doubles) -> Doubles:
    """Return the values, clipped to [0, 1]."""
    return np.clip(rgb, 0, 1)


def reinhard(rgb: Doubles) -> Doubles:
    """Return the color divided by 1 + its luminance.

    Source: E. Reinhard et al., Photographic Tone Reproduction for Digital Images, 2002, equation 3, for
    the luminance of each pixel. Saturated colors may exceed 1; they are clipped.
    """
    values = _limited(rgb)
    return clipped(values / (1 + transformed(LUMINANCE, values)))


def aces(rgb: Doubles) -> Doubles:
    """Return S. Hill's fit of the ACES reference rendering and sRGB output transforms.

    Source: BakingLab by M. Pettineo and S. Hill, ACES.hlsl (github.com/TheRealMJP/BakingLab): a matrix, the
    quotient of two polynomials per channel, another matrix.
    """
    v = transformed(ACES_IN, _limited(rgb))
    curve = (v * (v + 0.0245786) - 0.000090537) / (v * (0.983729 * v + 0.4329510) + 0.238081)
    return clipped(transformed(ACES_OUT, curve))


def agx(rgb: Doubles) -> Doubles:
    """Return T. Sobotka's AgX in the approximation of B. Wrensch, without a look.

    Source: B. Wrensch, Minimal AgX Implementation, iolite-engine.com, 2023 (the polynomial of degree 6), for
    T. Sobotka, AgX (github.com/sobotka/AgX). Its values are for a display of gamma 2.2; they are returned
    linear.
    """
    return np.asarray(clipped(transformed(AGX_OUT, _agx_codes(rgb))) ** AGX_GAMMA)


def agx_punchy(rgb: Doubles) -> Doubles:
    """Return AgX with its look "punchy", of more contrast and more saturated colors.

    Source: as for `agx`; the look is a power of the codes, and a mix of colors with their luminance.
    """
    codes = np.maximum(_agx_codes(rgb), 0) ** PUNCHY_POWER
    gray = transformed(LUMINANCE, codes)
    codes = gray + PUNCHY_SATURATION * (codes - gray)
    return np.asarray(clipped(transformed(AGX_OUT, codes)) ** AGX_GAMMA)


def _agx_codes(rgb: Doubles) -> Doubles:
    low, high = AGX_STOPS
    stops = np.log2(np.maximum(transformed(AGX_IN, _limited(rgb)), 2.0 ** (low - 1)))
    return np.asarray(np.polyval(AGX_CURVE, np.clip((stops - low) / (high - low), 0, 1)))


def _limited(rgb: Doubles) -> Doubles:
    return np.clip(np.nan_to_num(rgb, nan=0.0, posinf=LARGEST), 0, LARGEST)


AUTO = "auto"  # the tone curve that the metadata of a picture name
CHOSEN_TONE = "agx_punchy"  # of pictures whose light was chosen automatically
CHOSEN_STOPS = 1.5  # by which their light is brightened before this curve, which leaves room above white

TONES: dict[str, Callable[[Doubles], Doubles] | None] = {  # by name; None leaves the values as they are
    "none": None,
    "reinhard": reinhard,
    "aces": aces,
    "agx": agx,
    "agx_punchy": agx_punchy,
}
TONE_NAMES = (AUTO, *TONES)
