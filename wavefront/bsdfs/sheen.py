"""The shine of cloth at grazing angles, from fibers that stand on the surface.

Source: A. Conty Estevez and C. Kulla 2017, "Production Friendly Microfacet Sheen BRDF", as glTF's
KHR_materials_sheen uses it.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from ..arrays.elementary import exp, log
from ..arrays.vec import TWO_PI, Floats, dot, f4
from ..sampling.warp import uniform_hemisphere
from .albedo import lookup, tabulate

LEAST_ROUGHNESS = f4(0.07)  # below it the distribution is a spike at the horizon
# Rows a, b, c, d, e of the paper's table 1: for roughness 0, and 1.
FIT = np.array(
    [[25.3245, 3.32435, 0.16801, -1.27393, -4.85967], [21.5473, 3.82987, 0.19823, -1.97760, -4.32054]], f4
)


def sheen_lobe(wo: Floats, wi: Floats, roughness: Floats) -> Floats:
    """D·G/(4·cosθo·cosθi) of the fibers above the surface, (n,), without color (eqs. 2 and 3)."""
    alpha = np.maximum(roughness, LEAST_ROUGHNESS)
    h = wo + wi
    sin2 = np.clip((h[0] * h[0] + h[1] * h[1]) / np.maximum(dot(h, h), f4(1e-20)), f4(0), f4(1))
    density = fiber_density(sin2, alpha)
    zo, zi = np.maximum(wo[2], f4(1e-4)), np.maximum(wi[2], f4(1e-4))
    shadowing = f4(1) + _lambda(zo, alpha) + _lambda(zi, alpha)
    return np.where(wi[2] > 0, density / (shadowing * f4(4) * zo * zi), f4(0))


def fiber_density(sin2: Floats, alpha: Floats) -> Floats:
    """D of half vectors whose angle with the normal has the squared sine sin2, (n,), 1/sr (eq. 2)."""
    return (f4(2) + f4(1) / alpha) * _power(sin2, f4(0.5) / alpha) / TWO_PI


def sheen_albedo(cos: Floats, roughness: Floats) -> Floats:
    """Part of the light from cos (n,) that the fibers reflect, (n,), by bilinear lookup."""
    return lookup(_albedo_table(), roughness, cos)


def _power(x: Floats, exponent: Floats) -> Floats:
    """x^exponent; np.power rounds differently beside other lanes."""
    return exp(log(np.maximum(x, f4(1e-20))) * exponent)


def _lambda(z: Floats, alpha: Floats) -> Floats:
    """Shadowing of a direction of cosine z (n,): the paper's fit, section 3."""
    smooth = (f4(1) - alpha) ** 2
    a, b, c, d, e = (FIT[1, k] + (FIT[0, k] - FIT[1, k]) * smooth for k in range(5))

    def fit(x: Floats) -> Floats:
        return a / (f4(1) + b * _power(x, c)) + d * x + e

    steep = z < f4(0.5)
    value = fit(np.where(steep, z, f4(1) - z))
    return exp(np.where(steep, value, f4(2) * fit(np.full_like(z, 0.5)) - value))


@cache
def _albedo_table() -> Floats:
    """Directional albedo of `sheen_lobe`."""

    def row(wo: Floats, roughness: Floats, u: Floats) -> tuple[Floats]:
        wi = uniform_hemisphere(u)
        return (sheen_lobe(wo, wi, roughness) * wi[2] * TWO_PI,)

    return np.minimum(tabulate(row)[0], f4(1))
