"""Student's t distribution of whole arrays."""

from __future__ import annotations

import math

import numpy as np

from ..arrays.vec import Doubles

CHUNK = 1 << 17  # values that are computed together: few enough for the cache
ITERATIONS = 400  # at most, of the continued fraction
STEPS = 60  # of Newton's method, at most
LONGEST = 2.0  # step of the logarithm
LEAST_SLOPE = 1e-300


def t_tail(t: Doubles, freedom: Doubles) -> Doubles:
    """Return the chance P(|T| ≥ t) of Student's distribution, (n,) for t ≥ 0.

    It is I_x(ν/2, 1/2) with x = ν/(ν + t²): M. Abramowitz and I. A. Stegun, Handbook of Mathematical
    Functions, 26.7.1 and 26.5.27.
    """
    tail = np.empty_like(t)
    for start in range(0, t.size, CHUNK):
        span = slice(start, start + CHUNK)
        squared, nu = np.square(t[span]), freedom[span]
        total = nu + squared
        tail[span] = _incomplete_beta(nu / total, squared / total, nu / 2, np.full_like(nu, 0.5))
    return tail


def t_quantile(confidence: float, freedom: Doubles) -> Doubles:
    """Return t (n,) for which P(|T| < t) of Student's distribution is `confidence`.

    By Newton's method for ln P(|T| ≥ t), a concave function of ln t.
    """
    due, at = math.log1p(-confidence), np.zeros_like(freedom)
    scale = log_gamma((freedom + 1) / 2) - log_gamma(freedom / 2) - np.log(freedom * math.pi) / 2
    for _ in range(STEPS):
        t = np.exp(at)
        tail = t_tail(t, freedom)
        density = np.exp(scale - (freedom + 1) / 2 * np.log1p(np.square(t) / freedom))
        step = (np.log(tail) - due) * tail / np.maximum(2 * t * density, LEAST_SLOPE)
        at += np.clip(step, -LONGEST, LONGEST)
        if (np.abs(step) < 1e-12).all():
            break
    return np.exp(at)


def _incomplete_beta(x: Doubles, rest: Doubles, a: Doubles, b: Doubles) -> Doubles:
    """Return the regularized incomplete beta function I_x(a, b); `rest` is 1 − x without cancellation.

    By the continued fraction of W. H. Press et al., Numerical Recipes, 6.4, which converges quickly for x
    below (a + 1)/(a + b + 2); elsewhere I_x(a, b) = 1 − I_{1−x}(b, a).
    """
    swap = x > (a + 1) / (a + b + 2)
    x, rest = np.where(swap, rest, x), np.where(swap, x, rest)
    a, b = np.where(swap, b, a), np.where(swap, a, b)
    with np.errstate(divide="ignore", under="ignore"):
        power = a * np.log(x) + b * np.log(rest)
        front = np.exp(power + log_gamma(a + b) - log_gamma(a) - log_gamma(b)) / a
    value = np.minimum(front * _beta_fraction(x, a, b), 1.0)
    return np.where(swap, 1 - value, value)


def _beta_fraction(x: Doubles, a: Doubles, b: Doubles) -> Doubles:
    """Evaluate the continued fraction by the method of Lentz."""
    c, d = np.ones_like(x), 1 / _nonzero(1 - (a + b) * x / (a + 1))
    value = d.copy()
    for m in range(1, ITERATIONS):
        for term in (
            m * (b - m) * x / ((a + 2 * m - 1) * (a + 2 * m)),
            -(a + m) * (a + b + m) * x / ((a + 2 * m) * (a + 2 * m + 1)),
        ):
            d, c = 1 / _nonzero(1 + term * d), _nonzero(1 + term / c)
            value *= d * c
        if (np.abs(d * c - 1) < 1e-12).all():
            break
    return value


def _nonzero(values: Doubles) -> Doubles:
    return np.where(np.abs(values) < 1e-30, 1e-30, values)


def log_gamma(x: Doubles) -> Doubles:
    """Return ln Γ(x) for x > 0, by Stirling's series for x + 8 (Abramowitz and Stegun, 6.1.41)."""
    shift = np.ones_like(x)
    for k in range(8):
        shift = shift * (x + k)
    y = x + 8
    series = 1 / (12 * y) - 1 / (360 * y**3) + 1 / (1260 * y**5) - 1 / (1680 * y**7)
    return (y - 0.5) * np.log(y) - y + 0.5 * math.log(2 * math.pi) + series - np.log(shift)
