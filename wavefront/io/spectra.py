"""Spectra as linear RGB, and the indices of refraction of named materials."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..arrays.elementary import exp
from ..arrays.vec import Doubles, f4
from ..core.errors import SceneError, as_array, finite_array, in_brief, number
from ..core.files import decode_text
from .text_lines import numbers

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

# η and k as linear RGB, weighted by the matching functions as Mitsuba does where it renders RGB; the
# measurements are those of the Luxpop database, and of Palik where the name says so
METALS = {
    "Ag": ((0.15528, 0.11673, 0.13839), (4.8284, 3.1222, 2.1469)),
    "Al": ((1.6575, 0.8804, 0.52124), (9.2238, 6.2695, 4.837)),
    "AlAs": ((3.6053, 3.2329, 2.2163), (0.00067944, 0, 0.0075127)),
    "Au": ((0.14304, 0.37531, 1.442), (3.983, 2.3856, 1.6034)),
    "Be": ((4.185, 3.185, 2.7841), (3.8355, 3.0101, 2.869)),
    "Cr": ((4.3697, 2.9165, 1.6549), (5.2065, 4.2313, 3.7547)),
    "CsI": ((2.1449, 1.7023, 1.6624), (0, 0, 0)),
    "Cu": ((0.20101, 0.92375, 1.1022), (3.9133, 2.453, 2.1421)),
    "Cu2O": ((3.5518, 2.9499, 2.7519), (0.11421, 0.1939, 0.60613)),
    "CuO": ((3.2475, 2.4478, 2.2102), (0.52109, 0.57003, 0.72218)),
    "Hg": ((2.3989, 1.44, 0.90957), (6.3276, 4.3719, 3.4218)),
    "HgTe": ((4.779, 3.2312, 2.6599), (1.6316, 1.5808, 1.7293)),
    "Ir": ((3.0863, 2.0822, 1.6179), (5.5922, 4.0671, 3.2673)),
    "K": ((0.064043, 0.04641, 0.038185), (2.1042, 1.3489, 0.91313)),
    "Li": ((0.26579, 0.19562, 0.22095), (3.5402, 2.3111, 1.6686)),
    "MgO": ((2.0896, 1.6507, 1.5949), (0, 0, 0)),
    "Mo": ((4.484, 3.5251, 2.7763), (4.1114, 3.4208, 3.1506)),
    "Na_palik": ((0.060269, 0.056141, 0.061988), (3.1793, 2.1125, 1.579)),
    "Nb": ((3.4201, 2.7901, 2.3956), (3.4414, 2.7377, 2.5797)),
    "Ni_palik": ((2.3673, 1.6634, 1.4671), (4.4988, 3.0502, 2.3454)),
    "Rh": ((2.5858, 1.8602, 1.5543), (6.7823, 4.703, 3.9761)),
    "Se": ((4.0583, 2.8429, 2.8209), (0.75405, 0.63844, 0.52181)),
    "SiC": ((3.1723, 2.526, 2.4794), (0, 0, 0)),
    "SnTe": ((4.5242, 1.9816, 1.2816), (0, 0, 0)),
    "Ta": ((2.0627, 2.3929, 2.6279), (2.4084, 1.7415, 1.947)),
    "Te": ((7.3902, 4.4821, 2.6371), (3.256, 3.5271, 3.2921)),
    "ThF4": ((1.8307, 1.4422, 1.3876), (0, 0, 0)),
    "TiC": ((3.7005, 2.8374, 2.5823), (3.2656, 2.3516, 2.1728)),
    "TiN": ((1.6484, 1.1505, 1.3798), (3.3683, 1.9435, 1.1021)),
    "TiO2": ((3.4566, 2.8017, 2.9052), (0.00010526, 0, 0.00065289)),
    "VC": ((3.6576, 2.7527, 2.5327), (3.0683, 2.1987, 1.9632)),
    "VN": ((2.8656, 2.1192, 1.9401), (3.0322, 2.0561, 1.6163)),
    "V_palik": ((4.2776, 3.5129, 2.7611), (3.4913, 2.8895, 3.1115)),
    "W": ((4.3708, 3.3002, 2.9984), (3.5006, 2.6049, 2.2732)),
    "a-C": ((2.944, 2.2271, 1.9682), (0.88746, 0.7993, 0.81529)),
    "d-C": ((2.7087, 2.3188, 2.2289), (0, 0, 0)),
}
# indices of refraction at 589 nm, by material (Hecht, Optics, and others)
_INDICES = """
vacuum 1.0, helium 1.000036, hydrogen 1.000132, air 1.000277, carbon dioxide 1.00045, water 1.333,
acetone 1.36, ethanol 1.361, carbon tetrachloride 1.461, glycerol 1.4729, benzene 1.501,
silicone oil 1.52045, bromine 1.661, water ice 1.31, fused quartz 1.458, pyrex 1.47, acrylic glass 1.49,
polypropylene 1.49, bk7 1.5046, sodium chloride 1.544, amber 1.55, pet 1.575, diamond 2.419
"""
INDICES = {
    name.strip(): float(index)
    for name, _, index in (each.strip().rpartition(" ") for each in _INDICES.split(","))
}


def spectrum_rgb(pairs: Sequence[tuple[float, float]], *, emission: bool, bounded: bool) -> Doubles:
    """Return the color (3,) of a spectrum, given as wavelengths in nm and values.

    Emission is weighted by the matching functions, other spectra by these and D65, so that 1 is white. Colors
    outside the gamut are clipped; `bounded` ones also at 1.

    Raises
    ------
    SceneError
        If there are fewer than two values, or the wavelengths do not rise.
    """
    given = finite_array("spectrum", pairs, (None, 2))
    at, values = given.T
    if len(at) < 2 or not (np.diff(at) > 0).all():
        raise SceneError("spectrum needs at least two values, whose wavelengths rise")
    wave = np.linspace(FIRST, FIRST + STEP * (len(X) - 1), 2001)
    light = np.where((wave >= at[0]) & (wave <= at[-1]), np.interp(wave, at, values), 0)
    table = np.arange(len(X)) * STEP + FIRST
    if not emission:
        light = light * np.interp(wave, table, D65) / D65_SCALE
    step = (wave[1] - wave[0]) / Y_INTEGRAL
    xyz = np.array([(np.interp(wave, table, each) * light).sum() * step for each in (X, Y, Z)])
    return np.clip(TO_RGB @ xyz, 0, 1 if bounded else None)


def uniform_emission(value: float) -> Doubles:
    """Return the color (3,) of light of the same power at all wavelengths, which is not white in RGB."""
    return np.asarray(value * TO_RGB.sum(1))


def blackbody(temperature: float) -> Doubles:
    """Return the radiance (3,) of a black body of a temperature in kelvin, W·sr⁻¹·m⁻²·nm⁻¹."""
    kelvin = number("temperature", temperature, lambda x: 100 <= x <= 1e6, "from 100 to 1e6 kelvin")
    meters = (np.arange(len(X)) * STEP + FIRST) * 1e-9
    fall = exp((-PLANCK[1] / (meters * kelvin)).astype(f4)).astype(float)
    power = PLANCK[0] / (meters * meters) ** 2 / meters * fall / (1 - fall) * 1e-9
    pairs = np.stack([meters * 1e9, power], 1)
    return spectrum_rgb(pairs, emission=True, bounded=False)  # type: ignore[arg-type]


def pairs_of(name: str, value: Any) -> float | list[tuple[float, float]]:
    """Return a number, or wavelengths with values, of a text such as "400:0.1, 700:0.8" or of a list."""
    if not isinstance(value, str):
        given = as_array(name, value)
        return number(name, value) if given.ndim == 0 else list(finite_array(name, value, (None, 2)))
    parts = value.replace(",", " ").split()
    if len(parts) == 1 and ":" not in value:
        return numbers("spectrum", name, value, (1,))[0]
    pairs = [part.split(":") for part in parts]
    if any(len(pair) != 2 for pair in pairs):
        raise SceneError(f"{name} is {in_brief(value)}; it must be a number, or wavelength:value pairs")
    return [(numbers("", name, at, (1,))[0], numbers("", name, found, (1,))[0]) for at, found in pairs]


def read_spectrum(path: Path, data: bytes) -> list[tuple[float, float]]:
    """Return the wavelengths and values of a file (.spd): a pair in each line, # begins a comment."""
    pairs = []
    for line, text in enumerate(decode_text(data).splitlines(), 1):
        text = text.partition("#")[0]
        if text.strip():
            wave, value = numbers(f"{path} line {line}", "spectrum", text, (2,))
            pairs.append((wave, value))
    return pairs
