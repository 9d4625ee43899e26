"""Elementary functions with the same bits on every machine.

NumPy computes sin, exp, arctan2 and others by code that differs between AVX-512, AVX2 and SSE, or calls the
C library; the results differ in the last bit. The functions here consist of operations that IEEE 754 rounds
in one way only: sums, products, quotients, square roots and comparisons. All code that affects a picture
uses them, in float32 or float64.

Examples
--------
>>> wf.elementary.exp(np.float32([0, 1]))
array([1.       , 2.7182817], dtype=float32)
"""

from __future__ import annotations

import math
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from .vec import Floats

# float32 or float64, of any shape; results are of the same type
Reals = TypeVar("Reals", bound=NDArray[np.floating[Any]] | np.floating[Any])

F4, F8 = np.dtype(np.float32), np.dtype(np.float64)


def sin_cos_turns(turns: Reals) -> tuple[Reals, Reals]:
    """Return sine and cosine of 2π·turns, with an error of at most two ulps of 1.

    With v the difference to the nearest integer, they are the cosine and the sine of ``¼ − |v|`` turns, an
    angle in [−¼, ¼], so that no range reduction by cases is needed.
    """
    t: Any = turns
    v = t - np.rint(t)
    a = v.dtype.type(0.25) - np.abs(v)
    z = a * a
    sine, cosine = _horner(z, _COS_TURNS[z.dtype]), _horner(z, _SIN_TURNS[z.dtype])
    cosine *= a
    return np.copysign(sine, v), cosine


def sin_cos(x: Reals) -> tuple[Reals, Reals]:
    """Return sine and cosine of angles x in [−π/2, π/2], radians; the sine is accurate for small x, too."""
    angle: Any = x
    z = angle * angle
    return angle * _horner(z, _SIN[z.dtype]), _horner(z, _COS[z.dtype])


def sin(x: Reals) -> Reals:
    """Return the sine of angles x in [−π/2, π/2], radians, as `sin_cos` does."""
    angle: Any = x
    return angle * _horner(angle * angle, _SIN[angle.dtype])


def arctan2(y: Reals, x: Reals) -> Reals:
    """Return the angle of the point (x, y), radians in [−π, π]; 0 or ±π for (±0, 0).

    The tangent of half the angle to the nearest axis, t/(1 + √(1 + t²)), is at most √2 − 1. In this range a
    polynomial of five terms is accurate enough for float32, and one of eleven for float64.
    """
    wide: Any = np.abs(x)
    high: Any = np.abs(y)
    kind = wide.dtype.type
    one = kind(1)
    larger = np.maximum(wide, high)
    larger += larger == 0
    t = np.minimum(wide, high) / larger
    t /= one + np.sqrt(one + t * t)
    angle = t * _horner(t * t, _TWICE_ARCTAN[t.dtype])
    steep = (high > wide).astype(kind)  # 1 if the nearest axis is y; arithmetic is faster than np.where
    angle *= one - kind(2) * steep
    angle += steep * kind(math.pi / 2)
    behind = np.signbit(x).astype(kind)
    angle *= one - kind(2) * behind
    angle += behind * kind(math.pi)
    return np.copysign(angle, y)


def arccos(x: Reals) -> Reals:
    """Return the angle in [0, π], radians, whose cosine is x in [−1, 1]."""
    return arctan2(_sine_of_cosine(x), x)


def arcsin(x: Reals) -> Reals:
    """Return the angle in [−π/2, π/2], radians, whose sine is x in [−1, 1]."""
    return arctan2(x, _sine_of_cosine(x))


def _sine_of_cosine(x: Any) -> Any:
    """Return √(1 − x²), the sine of an angle whose cosine is x."""
    one = x.dtype.type(1)
    return np.sqrt((one - x) * (one + x))


def exp(x: Floats) -> Floats:
    """Return e to the power x, float32; 0 for x below −87, and exp(88) for x above 88.

    x = n·ln 2 + r with ``|r| ≤ ln 2/2``; 2ⁿ is made from its bits.
    """
    inside = x.clip(_LEAST_EXPONENT, _GREATEST_EXPONENT)
    n = np.rint(inside * _INVERSE_LN_2)
    r = inside - n * _LN_2_HIGH
    r -= n * _LN_2_LOW
    power = (n + _TO_EXPONENT).view(np.int32) << 23
    return np.where(x < _LEAST_EXPONENT, np.float32(0), _horner(r, _EXP) * power.view(np.float32))


def log(x: Floats) -> Floats:
    """Return the natural logarithm of normal float32 numbers x above 0.

    x = m·2ⁿ with m in [√½, √2), and log m = 2·artanh((m − 1)/(m + 1)).
    """
    bits = x.view(np.int32)
    n = (bits - _ROOT_HALF_BITS) >> 23
    m = (bits - (n << 23)).view(np.float32)
    s = (m - np.float32(1)) / (m + np.float32(1))
    power = n.astype(np.float32)
    return power * _LN_2_HIGH + (s * _horner(s * s, _TWICE_ARTANH) + power * _LN_2_LOW)


def _horner(x: Any, coefficients: tuple[Any, ...]) -> Any:
    """Return a polynomial of x; coefficients have its type, those of the highest power first."""
    total = x * coefficients[0]
    for coefficient in coefficients[1:-1]:
        total += coefficient
        total *= x
    total += coefficients[-1]
    return total


def _series(first: int, count: int, unit: float, kind: np.dtype[Any]) -> tuple[Any, ...]:
    """Return the Taylor coefficients (−1)ᵏ·unitⁿ/n! of sine or cosine, n = first + 2k, highest first."""
    powers = [first + 2 * k for k in range(count)]
    return tuple(kind.type((-1) ** k * unit**n / math.factorial(n)) for k, n in enumerate(powers))[::-1]


# The numbers of terms for a remainder below half an ulp of 1 at π/2.
_TERMS: dict[np.dtype[Any], int] = {F4: 7, F8: 12}
_COS = {kind: _series(0, count, 1.0, kind) for kind, count in _TERMS.items()}
_SIN = {kind: _series(1, count, 1.0, kind) for kind, count in _TERMS.items()}
_COS_TURNS = {kind: _series(0, count, 2 * math.pi, kind) for kind, count in _TERMS.items()}
_SIN_TURNS = {kind: _series(1, count, 2 * math.pi, kind) for kind, count in _TERMS.items()}
# 2·arctan(√z)/√z for z in [0, (√2 − 1)²], interpolated at Chebyshev nodes; errors 4e-8 and 7e-17.
# fmt: off
_TWICE_ARCTAN = {
    F4: tuple(np.float32(c) for c in (
        0.15952583613589116, -0.27696980424538414, 0.3994816483101533, -0.6666557154384969,
        1.9999999625292222,
    )),
    F8: tuple(np.float64(c) for c in (
        0.04227074631538649, -0.08696104431432924, 0.11376698453618021, -0.13280467860858816,
        0.15379906992613715, -0.18181546149616828, 0.22222212360911892, -0.28571428361952933,
        0.3999999999771022, -0.6666666666665688, 2.0,
    )),
}
# fmt: on
_EXP = tuple(np.float32(1 / math.factorial(n)) for n in range(7, -1, -1))
_TWICE_ARTANH = tuple(np.float32(2 / n) for n in (9, 7, 5, 3, 1))
_INVERSE_LN_2 = np.float32(1 / math.log(2))
_LN_2_HIGH = np.float32(0.693359375)  # nine bits: its products with exponents are exact
_LN_2_LOW = np.float32(math.log(2) - 0.693359375)
_LEAST_EXPONENT, _GREATEST_EXPONENT = np.float32(-87), np.float32(88)
_TO_EXPONENT = np.float32(1.5 * 2**23 + 127)  # the sum has the integer in its lowest bits
_ROOT_HALF_BITS = np.int32(np.float32(math.sqrt(0.5)).view(np.int32))
