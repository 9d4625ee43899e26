"""Checks of a phase function."""

from __future__ import annotations

import math

import numpy as np

from ..arrays.vec import f4
from ..media import PhaseFunction
from ..media.phase import deflected
from .bsdf import chunk_sizes
from .charts import CHARTS
from .chi2 import check_density
from .report import PILOT, Report


def check_phase(
    phase: PhaseFunction, *, samples: int = 1_000_000, significance: float = 1e-3, seed: int = 0
) -> Report:
    """Check that a phase function fulfills the contract of `wavefront.PhaseFunction`.

    Parameters
    ----------
    phase
        The phase function.
    samples, significance, seed
        As for `check_bsdf`.

    Returns
    -------
    Report
        The worst value of each check; `print` it.

    Raises
    ------
    AssertionError
        With each failed check, and the measured and expected values.

    Examples
    --------
    >>> report = wf.testing.check_phase(wf.HenyeyGreenstein(0.7), samples=20_000)
    """
    report, where = Report(f"check_phase({type(phase).__name__})"), "sphere"
    rng = np.random.default_rng(seed)
    cos = np.concatenate([phase.sample(rng.random(size, f4)) for size in chunk_sizes(samples)])
    report.holds("type", where, np.array(cos.dtype != f4 or cos.shape != (samples,)), "float32 (n,)")
    report.holds("cosine", where, ~(np.abs(cos) <= 1), "in [-1, 1]")
    density = phase.p(cos[: 1 << 16])
    report.holds("type", where, np.array(density.dtype != f4), "float32 (n,)")
    report.holds("density", where, ~(density > 0) | ~np.isfinite(density), "finite and above 0 at samples")
    mean, noise = float(cos.mean(dtype=np.float64)), float(cos.std(dtype=np.float64)) / math.sqrt(samples)
    report.near("mean cosine", where, mean, phase.mean_cosine, 1e-4 + 4.5 * noise)
    points = deflected(cos, rng.random(samples, f4))
    pilot = deflected(phase.sample(rng.random(PILOT, f4)), rng.random(PILOT, f4))
    check_density(
        report, where, CHARTS["sphere"], pilot, points, samples, lambda w: phase.p(w[2]), significance
    )
    return report.raise_if_failed()
