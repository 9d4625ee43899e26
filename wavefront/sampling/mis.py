"""The weight of multiple importance sampling."""

from __future__ import annotations

import numpy as np

from ..arrays.vec import Floats, f4


def power_heuristic(pdf: Floats, other: Floats) -> Floats:
    """Return MIS weights (n,) of samples of density `pdf` (n,), given the other technique's density `other`.

    The weight is pdf² / (pdf² + other²), and 0 where `pdf` is 0. It is computed from the square of the
    ratio of the densities, against overflow.

    Source: E. Veach and L. Guibas, Optimally Combining Sampling Techniques, SIGGRAPH 1995,
    section 4, β = 2.
    """
    with np.errstate(divide="ignore", invalid="ignore", over="ignore", under="ignore"):
        ratio = other / pdf  # inf gives the weight 0
        ratio *= ratio
        weight = f4(1) / (f4(1) + ratio)
    # NaN remains for 0/0, no sample, and inf/inf, two delta-like densities.
    equal = np.isnan(weight)
    if equal.any():
        weight[equal] = np.where(pdf[equal] > 0, f4(0.5), f4(0))
    return weight
