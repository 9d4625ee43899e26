"""Reflection by a thin film on a surface, such as oil or an oxide, with interference.

Source: L. Belcour and P. Barla 2017, "A Practical Extension to Microfacet Theory for the Modeling of Varying
Iridescence", ACM Transactions on Graphics 36(4): the sum of all reflections in the film as a Fourier series
in the phase, whose terms are known for Gaussians that fit the matching functions of CIE 1931. Here these are
the matching functions of linear Rec. 709 RGB, relative to light of equal energy.
"""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np

from ..arrays.elementary import exp, sin_cos_turns
from ..arrays.vec import TINY, Floats, f4
from ..textures.base import BaseTexture
from ..textures.parameter import scalar

TERMS = 6  # of the series
# Gaussians in the wave number, 1/m: the matching function they belong to, amplitude, center, and variance
# (supplement of Belcour and Barla)
GAUSSIANS = (
    (0, 5.4856e-13, 1.6810e6, 4.3278e9),
    (0, 9.7470e-14, 2.2399e6, 4.5282e9),
    (1, 4.4201e-13, 1.7953e6, 9.3046e9),
    (2, 5.2481e-13, 2.2084e6, 6.6121e9),
)
WHITE = 1.0685e-7  # integral of each matching function, in the same unit
XYZ_TO_RGB = np.array(
    [
        [3.2404542, -1.5371385, -0.4985314],
        [-0.969266, 1.8760108, 0.041556],
        [0.0556434, -0.2040259, 1.0572252],
    ]
)
SHARES = XYZ_TO_RGB / XYZ_TO_RGB.sum(1, keepdims=True)
NANOMETER = 1e-9

thickness = partial(scalar, holds=lambda x: 0 <= x <= 1e5, limit="in [0, 100000] nanometers")


def has_film(value: Any) -> bool:
    """Return whether a thickness is above 0 anywhere."""
    return isinstance(value, BaseTexture) or bool(value[0] > 0)


def film_reflectance(
    cos: Floats, thickness: Floats, film: Floats, before: Any, beyond: Any, k: Any = 0
) -> Floats:
    """Unpolarized reflectance of a surface below a film, per channel, (3, n).

    Parameters
    ----------
    cos
        (n,) cosine of the angle of incidence, in [0, 1].
    thickness
        (n,) of the film, nanometers.
    film, before, beyond
        (n,) or (3, n) refractive indices of the film, and before and below it.
    k
        (3, n) extinction below it.
    """
    sin2 = before * before * np.maximum(f4(1) - cos * cos, f4(0))
    enters = sin2 < film * film
    inside = np.sqrt(np.maximum(film * film - sin2, TINY))  # index times cosine
    path = f4(2 * NANOMETER) * thickness * inside
    series = [_interference(path * f4(m)) for m in range(1, TERMS + 1)]
    k = np.asarray(k, cos.dtype)
    square, b = beyond * beyond - k * k, f4(2) * beyond * k  # (η + ik)², and u + iv = (η + ik)·cosine beyond
    a = square - sin2
    size = np.sqrt(a * a + b * b)
    u, v = np.sqrt(np.maximum(f4(0.5) * (size + a), f4(0))), np.sqrt(np.maximum(f4(0.5) * (size - a), f4(0)))
    above, film2 = before * cos, film * film
    perpendicular = _summed(above, inside, (inside, f4(0)), (u, v), series)
    parallel = _summed(
        film2 * above, before * before * inside, (square * inside, b * inside), (film2 * u, film2 * v), series
    )
    return np.where(enters, np.clip(f4(0.5) * (perpendicular + parallel), f4(0), f4(1)), f4(1))


def _summed(
    x: Floats, y: Floats, p: tuple[Any, Any], q: tuple[Any, Any], series: list[tuple[Floats, Floats]]
) -> Floats:
    """Reflectance of one polarization by the amplitudes (x − y)/(x + y) above and (p − q)/(p + q) below."""
    first = (x - y) / np.maximum(x + y, TINY)
    over, under = (p[0] - q[0], p[1] - q[1]), (p[0] + q[0], p[1] + q[1])
    scale = f4(1) / np.maximum(under[0] * under[0] + under[1] * under[1], TINY)
    re = (over[0] * under[0] + over[1] * under[1]) * scale
    im = (over[1] * under[0] - over[0] * under[1]) * scale
    one, two = first * first, np.minimum(re * re + im * im, f4(1))
    re, im = -first * re, -first * im  # of one pass through the film and back, times e^(phase)
    both = one * two
    waves, power = f4(0), (re, im)
    for cosines, sines in series:
        waves = waves + power[0] * cosines - power[1] * sines
        power = power[0] * re - power[1] * im, power[0] * im + power[1] * re
    twice = f4(2) * (f4(1) - one) * (f4(1) - two) * waves
    return (one + two - f4(2) * both - twice) / np.maximum(f4(1) - both, f4(1e-6))


def _interference(path: Floats) -> tuple[Floats, Floats]:
    """Mean cosine and sine of the phase by paths (n,) or (3, n), meters, in each channel, (3, n)."""
    shape = (3, path.shape[-1])
    cosines, sines = np.zeros(shape, f4), np.zeros(shape, f4)
    for function, amplitude, center, variance in GAUSSIANS:
        sin, cos = sin_cos_turns(path * f4(center))
        turns = path * f4(2 * np.pi * variance**0.5)
        height = f4(amplitude * (2 * np.pi * variance) ** 0.5 / WHITE) * exp(-turns * turns)
        for channel in range(3):
            share = f4(SHARES[channel, function])
            row = channel if path.ndim == 2 else slice(None)
            cosines[channel] += share * (height * cos)[row]
            sines[channel] += share * (height * sin)[row]
    return cosines, sines
