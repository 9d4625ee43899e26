"""Checks of a warp."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..arrays.vec import Floats, f4
from .bsdf import chunk_sizes
from .charts import CHARTS
from .chi2 import check_density
from .report import PILOT, Report


def check_warp(
    sample: Callable[[Floats], Floats],
    pdf: Callable[[Floats], Floats],
    inverse: Callable[[Floats], Floats] | None = None,
    *,
    domain: str = "sphere",
    samples: int = 1_000_000,
    significance: float = 1e-3,
    seed: int = 0,
    tolerance: float = 1e-4,
) -> Report:
    """Check that a warp's sample, pdf and inverse are consistent.

    Parameters
    ----------
    sample
        Maps u (2, n) to points of the domain.
    pdf
        Density at points of the domain with respect to solid angle or area.
    inverse
        Maps points back to u (2, n).
    domain
        "sphere" (unit vectors (3, n)), "disk", "triangle" (b1, b2) or "square" ((2, n) each).
    samples, significance, seed
        As for `check_bsdf`.
    tolerance
        Largest distance that a point may have after inverse and sample.

    Raises
    ------
    AssertionError
        With each failed check, and the measured and expected values.
    """
    report = Report(f"check_warp({getattr(sample, '__name__', 'sample')})")
    rng = np.random.default_rng(seed)
    points = np.concatenate([sample(rng.random((2, size), f4)) for size in chunk_sizes(samples)], axis=1)
    report.holds("finite", domain, ~np.isfinite(points), "finite numbers")
    density = pdf(points[:, : 1 << 16])
    edge = float(np.mean(~(density > 0)))  # rounding may move a few points beyond the border
    report.at_most("pdf 0 at samples", domain, edge, 1e-3)
    chart = CHARTS[domain]
    if domain == "sphere":
        size = np.sqrt((points.astype(np.float64) ** 2).sum(0))
        report.at_most("unit length", domain, float(np.abs(size - 1).max()), 1e-5)
    if inverse is not None:
        again = sample(inverse(points[:, : 1 << 16]))
        error = np.abs(again - points[:, : 1 << 16]).max(0)
        report.at_most("round trip", domain, float(error.max()), tolerance)
    pilot = sample(rng.random((2, PILOT), f4))
    check_density(report, domain, chart, pilot, points, samples, pdf, significance)
    return report.raise_if_failed()
