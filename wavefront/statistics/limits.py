"""Confidence limits of means of few samples, of light that is never negative and now and then very bright.

Where most samples are alike and a few much brighter, as where a lamp is half hidden, few samples may have met
too few of the bright ones. Mean and scatter are then both too small, and an interval of Student's ends below
the true value. Corrections by the skewness of samples do not help: samples that are missing do not tell. What
helps is a variance that takes single samples, batches of them and one unseen sample together, and limits
of a distribution that is skewed as such sums are.
"""

from __future__ import annotations

import numpy as np

from ..arrays.vec import Doubles
from .student_t import t_quantile

SINGLE = 4.0  # degrees of freedom that the scatter of single samples counts for, beside that of batches
FADING = 64.0  # that weight times samples, at most: the more samples, the better batches know
UNSEEN = 0.25  # relative deviation of the sample that was not seen
EVENTS = 2.0  # that may have been missed
LARGE = 1e8  # shape of a gamma distribution from where on it is a normal one
TINY = 1e-300
TABLE = 1024  # quantiles that are computed; of more numbers some of these


def moderated_variance(
    samples: Doubles, mean: Doubles, alone: Doubles, scatter: Doubles, freedom: Doubles
) -> tuple[Doubles, Doubles]:
    """Return the variance of means, and its degrees of freedom.

    It is that of G. K. Smyth, Linear Models and Empirical Bayes Methods for Assessing Differential
    Expression, 2004, between single samples and batches, and that of a sample which was not seen. Degrees of
    freedom are by F. E. Satterthwaite, An Approximate Distribution of Estimates of Variance Components, 1946.

    Parameters
    ----------
    samples
        That each mean is of, at least 2.
    mean, alone
        The means, and their variances as of independent samples.
    scatter, freedom
        Their variances by the scatter of batches, and the degrees of freedom of those.
    """
    weight, seen = np.minimum(SINGLE, FADING / samples), samples / (samples + 1)
    components = (
        (weight / (weight + freedom) * seen * alone, samples - 1),
        (freedom / (weight + freedom) * seen * scatter, freedom),
        (np.square(UNSEEN * mean) / (samples * (samples + 1)), samples - 1),
    )
    variance = np.asarray(sum(component for component, _ in components))
    spread = np.asarray(sum(np.square(component) / degrees for component, degrees in components))
    return variance, np.where(spread > 0, np.square(variance) / np.where(spread > 0, spread, 1), samples - 1)


def event_of(mean: Doubles, variance: Doubles) -> Doubles:
    """Return the contribution of one event to means that are sums of like, rare events; 0 without any.

    Of such a sum the variance is as many times the mean. The events at points near each other are as bright
    as each other, but a point may have met none yet.
    """
    return np.where(mean > 0, variance / np.where(mean > 0, mean, 1), 0)


def light_limits(
    mean: Doubles, variance: Doubles, freedom: Doubles, event: Doubles, confidence: float
) -> tuple[Doubles, Doubles]:
    """Return lower and upper limits of means of light, which are 0 or more.

    They are quantiles of gamma distributions. The upper one is that of a mean with some events more than were
    met, as in M. P. Fay and E. J. Feuer, Confidence Intervals for Directly Standardized Rates, 1997, where it
    is one. Where the error is small they are those of Student's t distribution. All arrays have one shape.

    Parameters
    ----------
    event
        The contribution of one event.
    """
    t = _deviates(confidence, freedom)
    more, lit = EVENTS * event, np.where(mean > 0, mean, 1)
    low = _gamma_quantile(lit, variance, -t)
    high = _gamma_quantile(lit + more, variance + np.square(more), t)
    return np.where(mean > 0, low, mean), np.where(mean > 0, high, mean)


def _deviates(confidence: float, freedom: Doubles) -> Doubles:
    """Return t of Student's distribution; of many values by interpolation over 1/ν, to some parts in 10⁶."""
    if freedom.size <= TABLE:
        return t_quantile(confidence, freedom.ravel()).reshape(freedom.shape)
    inverse = 1 / freedom
    at = np.linspace(inverse.min(), inverse.max(), TABLE)
    return np.interp(inverse, at, t_quantile(confidence, 1 / at))


def _gamma_quantile(mean: Doubles, variance: Doubles, t: Doubles) -> Doubles:
    """Return the quantile of a gamma distribution at a deviate t of the normal one.

    By E. B. Wilson and M. M. Hilferty, The Distribution of Chi-Square, 1931.
    """
    shape = np.maximum(np.square(mean) / np.maximum(variance, TINY), 1e-3)
    cubed = np.maximum(1 - 1 / (9 * shape) + t / (3 * np.sqrt(shape)), 0) ** 3
    return np.where(shape > LARGE, mean + t * np.sqrt(variance), mean * cubed)


def rule_of_three(confidence: float, samples: Doubles) -> Doubles:
    """Return the highest chance per sample of an event that no sample met, at a confidence: 3/n for 95 %."""
    return -np.log1p(-confidence) / samples
