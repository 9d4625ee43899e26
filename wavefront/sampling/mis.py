"""The weight that combines two ways of sampling one integral."""

from __future__ import annotations

import numpy as np

from ..vec import Floats, f4


def power_heuristic(pdf: Floats, other: Floats) -> Floats:
    """Weight of a sample drawn with density `pdf` (n,) that could have been drawn with `other` (n,).

    pdf² / (pdf² + other²), and 0 where `pdf` is 0. The ratio of the smaller density to the
    larger is what gets squared, so nothing overflows and nothing is divided by zero.

    Source: E. Veach and L. Guibas, Optimally Combining Sampling Techniques, SIGGRAPH 1995,
    section 4, β = 2.
    """
    with np.errstate(divide="ignore", invalid="ignore", over="ignore", under="ignore"):
        ratio = other / pdf  # inf is right: the weight becomes 0
        ratio *= ratio
        weight = f4(1) / (f4(1) + ratio)
    # 0/0 and inf/inf are the cases that are left: no sample, and two delta-like densities.
    equal = np.isnan(weight)
    if equal.any():
        weight[equal] = np.where(pdf[equal] > 0, f4(0.5), f4(0))
    return weight
