"""Spectra as linear RGB."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arrays.elementary import exp
from ..arrays.vec import Doubles, f4
from ..core.errors import SceneError, exact, finite_array, number

FIRST, STEP = 380, 5  # nm, of the tables
# color matching functions of CIE 1931, 2 degrees, and the power of D65 relative to 560 nm (CIE 15:2018)
_TABLE = """
    .001368 .002236 .004243 .00765 .01431 .02319 .04351 .07763 .1344 .2148 .2839 .3285 .3483 .3481
    .3362 .3187 .2908 .2511 .1954 .1421 .09564 .05795 .03201 .0147 .0049 .0024 .0093 .0291 .06327
    .1096 .1655 .2257 .2904 .3597 .4334 .5121 .5945 .6784 .7621 .8425 .9163 .9786 1.026 1.057 1.062
    1.046 1.003 .9384 .8544 .7514 .6424 .5419 .4479 .3608 .2835 .2187 .1649 .1212 .0874 .0636 .04677
    .0329 .0227 .01584 .01136 .008111 .00579 .004109 .002899 .002049 .00144 .0009999 .0006901
    .000476 .0003323 .0002348 .0001662 .0001174 .000083 .000059 .000042
    .000039 .000064 .00012 .000217 .000396 .00064 .00121 .00218 .004 .0073 .0116 .01684 .023 .0298
    .038 .048 .06 .0739 .09098 .1126 .139 .1693 .208 .2586 .323 .4073 .503 .6082 .71 .7932 .862
    .9149 .954 .9803 .995 1 .995 .9786 .952 .9154 .87 .8163 .757 .6949 .631 .5668 .503 .4412 .381
    .321 .265 .217 .175 .1382 .107 .0816 .061 .04458 .032 .0232 .017 .01192 .00821 .005723 .004102
    .002929 .002091 .001484 .001047 .00074 .00052 .0003611 .0002492 .0001719 .00012 .000085 .00006
    .000042 .00003 .000021 .000015
    .00645 .01055 .02005 .03621 .06785 .1102 .2074 .3713 .6456 1.039 1.386 1.623 1.747 1.783 1.772
    1.744 1.669 1.528 1.288 1.042 .813 .6162 .4652 .3533 .272 .2123 .1582 .1117 .07825 .05725 .04216
    .02984 .0203 .0134 .00875 .00575 .0039 .00275 .0021 .0018 .00165 .0014 .0011 .001 .0008 .0006
    .00034 .00024 .00019 .0001 .00005 .00003 .00002 .00001 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0
    0 0 0 0 0 0
    49.98 52.31 54.65 68.7 82.75 87.12 91.49 92.46 93.43 90.06 86.68 95.77 104.9 110.9 117 117.4
    117.8 116.3 114.9 115.4 115.9 112.4 108.8 109.1 109.4 108.6 107.8 106.3 104.8 106.2 107.7 106
    104.4 104.2 104 102 100 98.17 96.33 96.06 95.79 92.24 88.69 89.35 90.01 89.8 89.6 88.65 87.7
    85.49 83.29 83.49 83.7 81.86 80.03 80.12 80.21 81.25 82.28 80.28 78.28 74 69.72 70.67 71.61
    72.98 74.35 67.98 61.6 65.74 69.89 72.49 75.09 69.34 63.59 55.01 46.42 56.61 66.81 65.09 63.38
"""
X, Y, Z, D65 = np.array(_TABLE.split(), np.float64).reshape(4, -1)
Y_INTEGRAL, D65_SCALE = 106.7502594, 98.99741752  # of the tables from 360 to 830 nm
TO_RGB = np.array(
    [[3.240479, -1.537150, -0.498535], [-0.969256, 1.875991, 0.041556], [0.055648, -0.204043, 1.057311]]
)  # XYZ to linear Rec. 709
PLANCK = (1.19104295e-16, 1.4387773e-2)  # 2hc² in W·m²/sr and hc/k in m·K


def spectrum_rgb(pairs: Sequence[tuple[float, float]], *, emission: bool, bounded: bool) -> Doubles:
    """Return the color (3,) of a spectrum, given as wavelengths in nm and values.

    Emission is weighted by the matching functions, other spectra by these and D65, so that 1 is white. Colors
    outside the gamut are clipped; `bounded` ones also at 1.

    Raises
    ------
    SceneError
        If there are fewer than two values, or the wavelengths do not rise.
    """
    rows = finite_array("spectrum", pairs, (None, 2))
    at, values = rows.T
    if len(at) < 2 or not (np.diff(at) > 0).all():
        raise SceneError("spectrum needs at least two values, whose wavelengths rise")
    wave = np.linspace(FIRST, FIRST + STEP * (len(X) - 1), 2001)
    light = np.where((wave >= at[0]) & (wave <= at[-1]), np.interp(wave, at, values), 0)
    table = np.arange(len(X)) * STEP + FIRST
    if not emission:
        light = light * np.interp(wave, table, D65) / D65_SCALE
    step = (wave[1] - wave[0]) / Y_INTEGRAL
    xyz = np.array([(np.interp(wave, table, matching) * light).sum() * step for matching in (X, Y, Z)])
    return np.clip(TO_RGB @ xyz, 0, 1 if bounded else None)


def reflectance_weights(wavelengths: Doubles) -> Doubles:
    """Return the weights (3, k) by which values at rising wavelengths (k,), in nm, make a color under D65.

    Values are linear in between. They are 0 beyond the wavelengths, which counts as black.
    """
    table = np.arange(len(X)) * STEP + float(FIRST)
    place = np.clip(np.searchsorted(wavelengths, table) - 1, 0, max(len(wavelengths) - 2, 0))
    start, end = wavelengths[place], wavelengths[np.minimum(place + 1, len(wavelengths) - 1)]
    fraction = (table - start) / np.where(end > start, end - start, 1)
    weight = np.stack([row[0] * X + row[1] * Y + row[2] * Z for row in TO_RGB]) * D65
    weight /= weight.sum(1, keepdims=True)
    weight = np.where((table >= wavelengths[0]) & (table <= wavelengths[-1]), weight, 0)
    out = np.zeros((3, len(wavelengths)))
    for channel in range(3):
        np.add.at(out[channel], place, weight[channel] * (1 - fraction))
        np.add.at(out[channel], np.minimum(place + 1, len(wavelengths) - 1), weight[channel] * fraction)
    return out


def uniform_emission(value: float) -> Doubles:
    """Return the color (3,) of light of the same power at all wavelengths, which is not white in RGB."""
    return np.asarray(value * TO_RGB.sum(1))


def blackbody(temperature: float) -> Doubles:
    """Return the radiance (3,) of a black body of a temperature in kelvin, W·sr⁻¹·m⁻²·nm⁻¹."""
    pairs = blackbody_spectrum(temperature)
    return spectrum_rgb(pairs, emission=True, bounded=False)  # type: ignore[arg-type]


def blackbody_spectrum(temperature: float) -> Doubles:
    """Return wavelengths in nm and the radiance there, W·sr⁻¹·m⁻²·nm⁻¹, of a black body, (k, 2)."""
    kelvin = number("temperature", temperature, lambda x: 100 <= x <= 1e6, "from 100 to 1e6 kelvin")
    meters = (np.arange(len(X)) * STEP + FIRST) * 1e-9
    fall = exp((-PLANCK[1] / (meters * kelvin)).astype(f4)).astype(float)
    power = PLANCK[0] / (meters * meters) ** 2 / meters * fall / (1 - fall) * 1e-9
    return np.stack([meters * 1e9, power], 1)


COLDEST, HOTTEST, TABULATED = 300.0, 1e5, 512  # kelvin, and how many between


def blackbody_colors(temperature: NDArray[Any]) -> Doubles:
    """Return the radiance (..., 3) of black bodies of temperatures (...) in kelvin, W·sr⁻¹·m⁻².

    It counts watts by channel, as lights do, so that its luminance is that of the spectrum. Below 300 K
    nothing is seen.

    Raises
    ------
    SceneError
        If one is above 1e5 K.
    """
    most = float(temperature.max(initial=0))
    if most > HOTTEST:
        raise SceneError(f"temperature is {exact(most)} kelvin; it must be at most {HOTTEST:g}")
    if most <= COLDEST:
        return np.zeros((*temperature.shape, 3))
    kelvin = np.linspace(COLDEST, most, TABULATED)
    colors = np.array([blackbody(temperature) for temperature in kelvin]) * Y_INTEGRAL
    return np.stack([np.interp(temperature, kelvin, row, left=0) for row in colors.T], -1)
