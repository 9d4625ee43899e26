"""White balance: the linear transform that makes the color of a light neutral."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ..arrays.vec import Doubles
from ..colors import rgb
from ..colors.primaries import BRADFORD
from ..core.errors import SceneError, as_array, number

WhiteBalance = float | ArrayLike  # kelvin, or the linear RGB of something that is gray

KELVIN = (1667.0, 25000.0)  # where the approximation of the Planckian locus holds
NEUTRAL = 6504.0  # kelvin that change nothing: the correlated color temperature of D65, the white of sRGB
XYZ_OF_RGB = np.array(  # linear sRGB to CIE XYZ, IEC 61966-2-1
    [
        [0.4124564, 0.3575761, 0.1804375],
        [0.2126729, 0.7151522, 0.0721750],
        [0.0193339, 0.1191920, 0.9503041],
    ]
)


def white_balance_matrix(white: WhiteBalance) -> Doubles:
    """Return the transform (3, 3) of linear RGB that makes a light look white.

    Colors are scaled in the space of the Bradford transform (K. M. Lam, Metamerism and Color Constancy, 1985,
    with the matrix of B. Lindbloom, Chromatic Adaptation). The luminance of the light is kept.

    Parameters
    ----------
    white
        Color temperature of the light, 1667 to 25000 K; 6504 changes nothing. Or the linear RGB that a gray
        thing has in the picture.

    Raises
    ------
    SceneError
        If it is neither.
    """
    if as_array("white_balance", white).ndim == 0:
        low, high = KELVIN
        limit = f"{low:g} to {high:g} kelvin, or a linear RGB"
        kelvin = number("white_balance", white, lambda x: low <= x <= high, limit)
        source, target = _planckian(kelvin), _planckian(NEUTRAL)
    else:
        gray = rgb("white_balance", white, dtype=np.float64)[:, 0]
        if not gray.min() > 0:
            raise SceneError(f"white_balance is {white!r}; each component must be above 0")
        source = XYZ_OF_RGB @ gray
        target = XYZ_OF_RGB @ np.full(3, source[1])
    gains = (BRADFORD @ target) / (BRADFORD @ source)
    scaling = np.linalg.inv(BRADFORD) @ (gains[:, None] * BRADFORD)
    return np.asarray(np.linalg.inv(XYZ_OF_RGB) @ scaling @ XYZ_OF_RGB)


def _planckian(kelvin: float) -> Doubles:
    """Return the CIE XYZ (3,) of black body radiation, with Y = 1.

    Source: B. Kang et al., Design of Advanced Color Temperature Control System for HDTV Applications, Journal
    of the Korean Physical Society 41, 2002: cubic splines of the Planckian locus.
    """
    t = 1e3 / kelvin
    if kelvin <= 4000:
        x = ((-0.2661239 * t - 0.2343589) * t + 0.8776956) * t + 0.179910
    else:
        x = ((-3.0258469 * t + 2.1070379) * t + 0.2226347) * t + 0.240390
    if kelvin <= 2222:
        y = ((-1.1063814 * x - 1.34811020) * x + 2.18555832) * x - 0.20219683
    elif kelvin <= 4000:
        y = ((-0.9549476 * x - 1.37418593) * x + 2.09137015) * x - 0.16748867
    else:
        y = ((3.0817580 * x - 5.87338670) * x + 3.75112997) * x - 0.37001483
    return np.array([x / y, 1.0, (1 - x - y) / y])
