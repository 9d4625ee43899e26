"""How the radiance of skies depends on direction: the CIE's standard skies, and Perez's all-weather model."""

from __future__ import annotations

import math
from typing import Self

import numpy as np

from ..arrays.elementary import arccos, exp, log
from ..arrays.soa import soa
from ..arrays.vec import Floats, f4
from ..core.errors import SceneError, in_brief

OVERCAST = 16  # number of the traditional overcast sky
# a, b, c, d, e of types 1 to 15: ISO 15469:2004 (CIE S 011/E:2003), table 1
_GRADATIONS = ((4.0, -0.7), (1.1, -0.8), (0.0, -1.0), (-1.0, -0.55), (-1.0, -0.32), (-1.0, -0.15))
_INDICATRICES = (
    *((0.0, -1.0, 0.0), (2.0, -1.5, 0.15), (5.0, -2.5, 0.3)),
    *((10.0, -3.0, 0.45), (16.0, -3.0, 0.3), (24.0, -2.8, 0.15)),
)
_OF_TYPES = (
    *((0, 0), (0, 1), (1, 0), (1, 1), (2, 0), (2, 1), (2, 2), (2, 3)),
    *((3, 1), (3, 2), (3, 3), (4, 3), (4, 4), (5, 4), (5, 5)),
)
WITHOUT_SUN = (1, 3, 5, OVERCAST)  # the same all around, wherever the sun is

# Four coefficients for each of a, b, c, d, e, by bins of clearness
_CLEARNESS = (1.065, 1.23, 1.5, 1.95, 2.8, 4.5, 6.2)  # between the bins
_BRIGHTNESS = 0.01, 0.6  # least and most: beyond, the coefficients lead to no luminance or to any
_STEEPEST = -0.05  # b at most: above 0, the horizon shines without bound
# fmt: off
_PEREZ = np.array([
    1.3525, -0.2576, -0.2690, -1.4366, -0.7670, 0.0007, 1.2734, -0.1233, 2.8000, 0.6004,
    1.2375, 1.0000, 1.8734, 0.6297, 0.9738, 0.2809, 0.0356, -0.1246, -0.5718, 0.9938,
    -1.2219, -0.7730, 1.4148, 1.1016, -0.2054, 0.0367, -3.9128, 0.9156, 6.9750, 0.1774,
    6.4477, -0.1239, -1.5798, -0.5081, -1.7812, 0.1080, 0.2624, 0.0672, -0.2190, -0.4285,
    -1.1000, -0.2515, 0.8952, 0.0156, 0.2782, -0.1812, -4.5000, 1.1766, 24.7219, -13.0812,
    -37.7000, 34.8438, -5.0000, 1.5218, 3.9229, -2.6204, -0.0156, 0.1597, 0.4199, -0.5562,
    -0.5484, -0.6654, -0.2672, 0.7117, 0.7234, -0.6219, -5.6812, 2.6297, 33.3389, -18.3000,
    -62.2500, 52.0781, -3.5000, 0.0016, 1.1477, 0.1062, 0.4659, -0.3296, -0.0876, -0.0329,
    -0.6000, -0.3566, -2.5000, 2.3250, 0.2937, 0.0496, -5.6812, 1.8415, 21.0000, -4.7656,
    -21.5906, 7.2492, -3.5000, -0.1554, 1.4062, 0.3988, 0.0032, 0.0766, -0.0656, -0.1294,
    -1.0156, -0.3670, 1.0078, 1.4051, 0.2875, -0.5328, -3.8500, 3.3750, 14.0000, -0.9999,
    -7.1406, 7.5469, -3.4000, -0.1078, -1.0750, 1.5702, -0.0672, 0.4016, 0.3017, -0.4844,
    -1.0000, 0.0211, 0.5025, -0.5119, -0.3000, 0.1922, 0.7023, -1.6317, 19.0000, -5.0000,
    1.2438, -1.9094, -4.0000, 0.0250, 0.3844, 0.2656, 1.0468, -0.3788, -2.4517, 1.4656,
    -1.0500, 0.0289, 0.4260, 0.3590, -0.3250, 0.1156, 0.7781, 0.0025, 31.0625, -14.5000,
    -46.1148, 55.3750, -7.2312, 0.4050, 13.3500, 0.6234, 1.5000, -0.6426, 1.8564, 0.5636,
]).reshape(8, 5, 4)
# fmt: on


@soa
class SkyFunction:
    """Relative radiance of a sky, by the angles Z from the zenith and γ from the sun.

    (1 + A·exp(B/(cos Z + offset)) + slope·cos Z) · (C + D·exp(E·γ) + F·cos²γ + G·χ(H, γ) + I·√cos Z), with
    χ(H, γ) = (1 + cos²γ)/(1 + H² − 2H·cos γ)^1.5. With G = I = 0 that is the form of Perez and of the CIE.

    Source: L. Hošek and A. Wilkie, An Analytic Model for Full Spectral Sky-Dome Radiance, SIGGRAPH 2012,
    equation 8.
    """

    coefficients: Floats  # (9, k, 1): A to I, for one channel or three
    slope: float = 0.0
    offset: float = 1e-6  # keeps the gradation finite at the horizon

    @classmethod
    def of_perez(cls, a: float, b: float, c: float, d: float, e: float, constant: float = 1.0) -> Self:
        """Return (1 + a·exp(b/cos Z))·(constant + c·exp(d·γ) + e·cos²γ)."""
        return cls(np.array([a, b, constant, c, d, e, 0, 0, 0], f4).reshape(9, 1, 1))

    def at(self, cos_zenith: Floats, gamma: Floats, cos_gamma: Floats) -> Floats:
        """Return the relative radiance (k, n), at least 0, where cos Z (n,) is at least 0."""
        a, b, c, d, e, f, g, h, i = self.coefficients
        gradation = f4(1) + a * exp(b / (cos_zenith + f4(self.offset))) + f4(self.slope) * cos_zenith
        squared = cos_gamma * cos_gamma
        indicatrix = c + d * exp(e * gamma) + f * squared
        if g.any() or i.any():
            below = f4(1) + h * h - f4(2) * h * cos_gamma
            indicatrix += g * (f4(1) + squared) / (below * np.sqrt(below)) + i * np.sqrt(cos_zenith)
        return np.maximum(gradation * indicatrix, f4(0))


def cie_function(type: int) -> SkyFunction:
    """Return the relative luminance of a standard sky, 1 to 15, or of the traditional overcast sky, 16.

    Raises
    ------
    SceneError
        If there is no such type.
    """
    if isinstance(type, bool) or not isinstance(type, int | np.integer) or type not in range(1, OVERCAST + 1):
        raise SceneError(f"Sky type is {in_brief(type)}; it must be from 1 to 15, or {OVERCAST}")
    if type == OVERCAST:  # (1 + 2·cos Z)/3
        return SkyFunction(np.array([0, 0, 1, 0, 0, 0, 0, 0, 0], f4).reshape(9, 1, 1), slope=2.0)
    gradation, indicatrix = _OF_TYPES[type - 1]
    (a, b), (c, d, e) = _GRADATIONS[gradation], _INDICATRICES[indicatrix]
    return SkyFunction.of_perez(a, b, c, d, e, 1 - c * _exp(d * math.pi / 2))


def perez_function(
    direct_normal: float, diffuse_horizontal: float, cos_sun: float, extraterrestrial: float
) -> SkyFunction:
    """Return the relative luminance of the all-weather sky, from irradiances and the sun's height.

    Source: R. Perez, R. Seals and J. Michalsky, All-Weather Model for Sky Luminance Distribution, Solar
    Energy 50(3), 1993, with the erratum in 51(5); relative air mass by Kasten (1966), as there.
    """
    zenith = float(arccos(np.float64(cos_sun)))
    kappa = 1.041 * zenith * zenith * zenith
    ratio = (diffuse_horizontal + direct_normal) / diffuse_horizontal
    clearness = (ratio + kappa) / (1 + kappa)
    air_mass = 1 / (cos_sun + 0.15 * _power(93.885 - math.degrees(zenith), -1.253))
    brightness = min(max(diffuse_horizontal * air_mass / extraterrestrial, _BRIGHTNESS[0]), _BRIGHTNESS[1])
    if _CLEARNESS[0] < clearness < _CLEARNESS[4]:
        brightness = max(brightness, 0.2)
    x = _PEREZ[int(np.searchsorted(_CLEARNESS, clearness, side="right"))]
    a, b, c, d, e = (x[:, 0] + x[:, 1] * zenith + brightness * (x[:, 2] + x[:, 3] * zenith)).tolist()
    if clearness < _CLEARNESS[0]:
        c = _exp(_power(brightness * (x[2, 0] + x[2, 1] * zenith), x[2, 2])) - x[2, 3]
        d = -_exp(brightness * (x[3, 0] + x[3, 1] * zenith)) + x[3, 2] + brightness * x[3, 3]
    return SkyFunction.of_perez(a, min(b, _STEEPEST), c, d, e)


def _exp(x: float) -> float:
    return float(exp(np.array(x, f4)))


def _power(base: float, exponent: float) -> float:
    return _exp(exponent * float(log(np.array(base, f4))))
