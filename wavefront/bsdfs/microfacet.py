"""The GGX microfacet model: distribution of normals, shadowing, and sampling of visible normals.

Isotropic, with roughness parameter α. All formulas use the stretched length
σ(w) = √(z² + α²(x² + y²)) of a direction, in which the Smith terms of GGX read
Λ(w) = (σ/|z| − 1)/2, G1(w) = 2|z|/(|z| + σ) and, height-correlated,
G2(wo, wi)/(|zo||zi|) = 2/(|zo|σi + |zi|σo): nothing is divided by a cosine.

Sources: B. Walter et al. 2007, "Microfacet Models for Refraction through Rough Surfaces"; E. Heitz
2014, "Understanding the Masking-Shadowing Function in Microfacet-Based BRDFs", JCGT 3(2), eq. 99.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ..arrays.elementary import sin_cos_turns
from ..arrays.vec import INV_PI, TINY, Bools, Floats, dot, f4, normalize
from ..textures.base import BaseTexture

# Below this α a lobe is narrower than 0.1°, and half vectors of float32 directions no longer
# resolve it: constants below count as smooth, and textures are raised to it.
SMOOTH = f4(1e-3)


def is_smooth(roughness: Any) -> bool:
    """Return whether a roughness gives a delta lobe: a constant with α = roughness² < `SMOOTH`."""
    return not isinstance(roughness, BaseTexture) and bool(roughness[0] ** 2 < SMOOTH)


def alpha_of(roughness: Floats) -> Floats:
    """Map perceptual roughness (n,) to α = roughness², at least `SMOOTH`."""
    return np.maximum(roughness * roughness, SMOOTH)


def stretched(w: Floats, alpha: Floats) -> Floats:
    """Return σ = √(z² + α²(x² + y²)) of directions (3, n), (n,)."""
    return np.sqrt(w[2] * w[2] + alpha * alpha * (w[0] * w[0] + w[1] * w[1]))


def normal_density(h: Floats, h2: Floats, alpha: Floats) -> Floats:
    """D(h/|h|) of half vectors h (3, n) of squared length h2 (n,), 1/sr (Walter et al., eq. 33)."""
    z2 = h[2] * h[2]
    a2 = alpha * alpha
    spread = np.maximum(a2 * z2 + (h[0] * h[0] + h[1] * h[1]), TINY)
    return a2 * INV_PI * (h2 / spread) ** 2


def visible_normals(wo: Floats, alpha: Floats, u: Floats) -> Floats:
    """Draw microfacet normals (3, n) as they are seen along wo, from u (2, n).

    Their density is D(m)·G1(wo)·(wo·m)/zo. Source: J. Dupuy and A. Benyoub 2023, "Sampling Visible
    GGX Normals with Spherical Caps", Computer Graphics Forum 42(8), listing 3.
    """
    squeezed = wo.copy()
    squeezed[:2] *= alpha
    squeezed = normalize(squeezed)
    sin, cos = sin_cos_turns(u[0])
    z = (f4(1) - u[1]) * (f4(1) + squeezed[2]) - squeezed[2]
    radius = np.sqrt(np.maximum((f4(1) - z) * (f4(1) + z), f4(0)))
    squeezed[0] += radius * cos
    squeezed[1] += radius * sin
    squeezed[2] += z
    squeezed[:2] *= alpha
    squeezed[2] = np.maximum(squeezed[2], TINY)
    return normalize(squeezed)


def mirror_lobe(wo: Floats, wi: Floats, alpha: Floats) -> tuple[Floats, Floats, Floats]:
    """Reflection by the microfacets without Fresnel, where wi (3, n) is above the surface.

    Returns
    -------
    value
        (n,) D·G2/(4·zo·zi), 1/sr; 0 below the surface.
    pdf
        (n,) density of `visible_normals` carried to wi, D·G1(wo)/(4·zo); 0 below the surface.
    cos
        (n,) cosine between wo and the microfacet.
    """
    h = wo + wi
    h2 = dot(h, h)
    above = wi[2] > 0
    density = np.where(above, normal_density(h, h2, alpha), f4(0))
    so, si = stretched(wo, alpha), stretched(wi, alpha)
    value = density * (f4(0.5) / np.maximum(wo[2] * si + np.maximum(wi[2], f4(0)) * so, TINY))
    pdf = density * (f4(0.5) / (wo[2] + so))
    return value, pdf, np.minimum(f4(0.5) * np.sqrt(h2), f4(1))


def refraction_lobe(
    wo: Floats, wi: Floats, alpha: Floats, eta: Floats
) -> tuple[Floats, Floats, Floats, Bools]:
    """Refraction by the microfacets without Fresnel, where wi (3, n) is below the surface.

    With s = wo + η·wi, whose direction is that of the microfacet's normal m, the squared
    denominator of Walter et al., eq. 21, is just |s|².

    Returns
    -------
    value
        (n,) D·G2·|wo·m||wi·m|/(zo·|zi|·|s|²), 1/sr, for radiance: 1/η² is included.
    pdf
        (n,) density of `visible_normals` carried to wi, 1/sr.
    cos
        (n,) cosine between wo and the microfacet.
    valid
        (n,) wi is below the surface, and both directions see the facet from opposite sides.
    """
    s = wo + eta * wi
    s2 = np.maximum(dot(s, s), TINY)
    sign = np.copysign(f4(1), s[2])
    scale = sign / np.sqrt(s2)
    cos_o, cos_i = dot(wo, s) * scale, dot(wi, s) * scale
    valid = (wi[2] < 0) & (cos_o > 0) & (cos_i < 0)
    shared = np.where(valid, normal_density(s, s2, alpha) * np.abs(cos_o * cos_i) / s2, f4(0))
    so, si = stretched(wo, alpha), stretched(wi, alpha)
    value = shared * (f4(2) / np.maximum(wo[2] * si + np.abs(wi[2]) * so, TINY))
    pdf = shared * (f4(2) * eta * eta / (wo[2] + so))
    return value, pdf, np.minimum(np.abs(cos_o), f4(1)), valid


def reflect(wo: Floats, m: Floats) -> Floats:
    """Mirror wo (3, n) at unit normals m (3, n)."""
    return m * (f4(2) * dot(wo, m)) - wo


def refract(wo: Floats, m: Floats, cos: Floats, cos_refracted: Floats, eta: Floats) -> Floats:
    """Refract wo (3, n) at unit normals m (3, n) into the other side, of relative index eta (n,)."""
    inverse = f4(1) / eta
    return m * (cos * inverse - cos_refracted) - wo * inverse
