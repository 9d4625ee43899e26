"""Chi-square tests of samples against their density."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from ..arrays.vec import Doubles, Floats, Ints
from .charts import Chart
from .quadrature import COLUMNS, ROWS, Cells, DensityIntegrator
from .report import Report

GUIDES = 1 << 17  # samples that guide the quadrature, of all cells
FEW = 500  # samples of a cell


def gamma_q(a: float, x: float) -> float:
    """Return the regularized upper incomplete gamma function Q(a, x).

    Source: NIST DLMF 8.11.4 (series, for x < a + 1) and 8.9.2 (continued fraction, by Lentz's rule).
    """
    if x <= 0:
        return 1.0
    scale = math.exp(a * math.log(x) - x - math.lgamma(a))
    if x < a + 1:
        term = total = 1 / a
        n = a
        while term > total * 1e-16:
            n += 1
            term *= x / n
            total += term
        return 1 - scale * total
    b = x + 1 - a
    c, d = 1e300, 1 / b
    fraction = d
    for i in range(1, 10_000):
        step = -i * (i - a)
        b += 2
        d = 1 / (step * d + b)
        c = b + step / c
        fraction *= c * d
        if abs(c * d - 1) < 1e-15:
            break
    return scale * fraction


def chi_square(observed: Ints, expected: Doubles) -> tuple[float, int, float]:
    """Return χ², degrees of freedom and p-value; cells with less than 5 expected samples are pooled.

    The cells must cover every outcome, so that both sums are the number of samples. If the pool expects
    less than 5 samples, its count is compared with the Poisson distribution instead, with a tolerance of
    10⁻⁵ of all samples, because rounding moves some just beyond the edge of a density.
    """
    rare = expected < 5
    pool, pooled = float(expected[rare].sum()), int(observed[rare].sum())
    stray = 1.0
    observed, expected = observed[~rare], expected[~rare]
    if pool >= 5:
        observed, expected = np.append(observed, pooled), np.append(expected, pool)
    elif pooled:
        allowed = pool + 1e-5 * (float(expected.sum()) + pool)
        stray = 1 - gamma_q(pooled, max(allowed, 1e-300))  # P(X ≥ pooled)
    statistic = float(((observed - expected) ** 2 / expected).sum())
    freedom = len(expected) - 1
    p = gamma_q(freedom / 2, statistic / 2) if freedom > 0 else 1.0
    return statistic, max(freedom, 0), p if stray == 1 else min(1.0, 2 * min(p, stray))


def _chi_square_p(observed: Ints, integrals: Doubles) -> float:
    """Return the p-value of χ² over cells, row sums and column sums; sums reveal a slope that cells hide.

    It is that of the samples which have a point. How many these are is the integral of the density, whose
    error by quadrature may be many times the square root of the few that have none.
    """
    expected = integrals * (observed.sum() / max(float(integrals.sum()), 1e-300))
    counts, means = observed.reshape(ROWS, COLUMNS), expected.reshape(ROWS, COLUMNS)
    views = [(counts.ravel(), means.ravel()), (counts.sum(1), means.sum(1)), (counts.sum(0), means.sum(0))]
    return min(1.0, 3 * min(chi_square(o, e)[2] for o, e in views))


def binomial_p(count: int, trials: int, probability: float) -> float:
    """Return the two-sided exact binomial p-value: twice the smaller tail, at most 1."""
    if not 0 < probability < 1:
        return float(count == (trials if probability >= 1 else 0))
    k = np.arange(1, trials + 1)
    log_choose = np.concatenate([[0.0], np.cumsum(np.log((trials + 1 - k) / k))])
    k = np.arange(trials + 1)
    pmf = np.exp(log_choose + k * math.log(probability) + (trials - k) * math.log1p(-probability))
    return min(1.0, 2 * min(float(pmf[: count + 1].sum()), float(pmf[count:].sum())))


def check_density(
    report: Report,
    where: str,
    chart: Chart,
    pilot: Floats,
    points: Floats,
    total: int,
    density: Callable[[Floats], Floats],
    alpha: float,
    singular: float = 0.0,
) -> None:
    """Check sampled points (d, m ≤ total) against a density by χ², and the density's integral.

    `total − m` of the samples have no point or belong to a delta lobe; the probability of delta lobes is
    `singular`.
    """
    cells = Cells.around(chart.to_square(pilot), chart.seams)
    on_square = chart.to_square(points)
    cell = cells.find(on_square)
    observed = np.bincount(cell, minlength=ROWS * COLUMNS)
    # all samples of a cell that has few: a part of it that all points of the quadrature miss counts there
    guide = np.flatnonzero((np.arange(cell.size) < GUIDES) | (observed <= FEW)[cell])
    height = density(points.take(guide, 1)).astype(np.float64)
    integrator = DensityIntegrator(density, chart, on_square.take(guide, 1), height)
    expected, unresolved = integrator.cells(cells)
    integral = float(expected.sum())
    fraction = points.shape[1] / total
    noise = math.sqrt(fraction * (1 - fraction) / total)
    report.near("integral of pdf", where, integral, fraction, 1e-4 + 4.5 * noise + unresolved)
    if singular > 0:
        report.at_most("sum of probabilities", where, singular + integral, 1 + 1e-4 + unresolved)
    report.significant("chi-square", where, _chi_square_p(observed, expected), alpha)
