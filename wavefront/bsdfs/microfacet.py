"""Microfacet models: distributions of normals, shadowing, and sampling of visible normals.

All formulas use the stretched length σ(w) = √(z² + αu²·x² + αv²·y²) of a direction, in which the Smith
terms of GGX read Λ(w) = (σ/|z| − 1)/2, G1(w) = 2|z|/(|z| + σ) and, height-correlated,
G2(wo, wi)/(|zo||zi|) = 2/(|zo|σi + |zi|σo): nothing is divided by a cosine. Beckmann's Λ gives a σ, too.

Sources: B. Walter et al. 2007, "Microfacet Models for Refraction through Rough Surfaces"; E. Heitz
2014, "Understanding the Masking-Shadowing Function in Microfacet-Based BRDFs", JCGT 3(2), eq. 99.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ..arrays.elementary import exp, sin_cos_turns
from ..arrays.vec import INV_PI, TINY, Bools, Floats, Ints, dot, f4, normalize
from ..textures.base import BaseTexture

# Below this α a lobe is narrower than 0.1°, and half vectors of float32 directions no longer
# resolve it: constants below count as smooth, and textures are raised to it.
SMOOTH = f4(1e-3)
LEAST_COS2 = f4(1e-6)  # of normals whose density by Beckmann is not 0


def is_smooth(roughness: Any) -> bool:
    """Return whether a roughness gives a delta lobe: a constant with α = roughness² < `SMOOTH`."""
    return not isinstance(roughness, BaseTexture) and bool(roughness[0] ** 2 < SMOOTH)


def alpha_of(roughness: Floats) -> Floats:
    """Map perceptual roughness (n,) to α = roughness², at least `SMOOTH`."""
    return np.maximum(roughness * roughness, SMOOTH)


class Facets(NamedTuple):
    """The microfacets of a surface at n points, by GGX or Beckmann.

    Normals of both distributions are drawn as visible normals of GGX, whose density is at least 0.68 times
    Beckmann's of the same α.
    """

    alpha: Floats  # (n,) or (1,), along the tangent
    alpha_v: Floats | None = None  # (n,) or (1,), across it; None: as along it
    tangent: Floats | None = None  # (2, n) cosine and sine of the tangent's azimuth; None: the x axis
    beckmann: bool = False
    separable: bool = False  # shadowing is independent of masking

    def take(self, lanes: Ints) -> Facets:
        """Return the facets at some of the points (k,)."""
        varying: dict[str, Any] = {
            name: value.take(lanes, -1)
            for name, value in zip(self._fields, self, strict=True)
            if isinstance(value, np.ndarray) and value.shape[-1] > 1
        }
        return self._replace(**varying)

    def _turned(self, w: Floats) -> Floats:
        """Return directions (3, n) with x along the tangent."""
        if self.tangent is None:
            return w
        cos, sin = self.tangent
        return np.stack([cos * w[0] + sin * w[1], cos * w[1] - sin * w[0], w[2]])

    def _turned_back(self, w: Floats) -> Floats:
        """Return directions (3, n) with x along the tangent in the frame of the surface."""
        if self.tangent is None:
            return w
        cos, sin = self.tangent
        return np.stack([cos * w[0] - sin * w[1], sin * w[0] + cos * w[1], w[2]])

    def _scale(self) -> Floats:
        """Return α along and across the tangent, (1 or 2, n)."""
        return self.alpha if self.alpha_v is None else np.stack(np.broadcast_arrays(self.alpha, self.alpha_v))

    def stretched(self, w: Floats) -> Floats:
        """Return GGX's σ of directions (3, n), (n,)."""
        if self.alpha_v is None:
            return np.sqrt(w[2] * w[2] + self.alpha * self.alpha * (w[0] * w[0] + w[1] * w[1]))
        return np.sqrt(w[2] * w[2] + self._reach2(w))

    def _reach2(self, w: Floats) -> Floats:
        """Return αu²·x² + αv²·y² of directions (3, n), (n,)."""
        x, y, _ = self._turned(w)
        return (x * self.alpha) ** 2 + (y * (self.alpha if self.alpha_v is None else self.alpha_v)) ** 2

    def _spread(self, h: Floats) -> tuple[Floats, Floats]:
        """Return αu·αv, and x²·αv/αu + y²·αu/αv of vectors h (3, n), (n,) each."""
        if self.alpha_v is None:
            return self.alpha * self.alpha, h[0] * h[0] + h[1] * h[1]
        x, y, _ = self._turned(h)
        ratio = self.alpha_v / self.alpha
        return self.alpha * self.alpha_v, x * x * ratio + y * y / ratio

    def turn(self, w: Floats) -> Floats | None:
        """Return cos² of the azimuth of directions w (3, n) from the tangent, if it counts, (n,)."""
        if self.alpha_v is None:
            return None
        x, y, _ = self._turned(w)
        return x * x / np.maximum(x * x + y * y, TINY)

    def stretched_turn(self, w: Floats) -> Floats | None:
        """Return cos² of the azimuth of stretched directions w (3, n), if it counts, (n,)."""
        if self.alpha_v is None:
            return None
        x, y, _ = self._turned(w)
        along, across = (x * self.alpha) ** 2, (y * self.alpha_v) ** 2
        return along / np.maximum(along + across, TINY)

    def unstretched(self, w: Floats) -> Floats:
        """Return the directions (3, n) whose stretched directions are w, with x along the tangent."""
        wide = w.copy()
        wide[:2] /= self._scale()
        return normalize(self._turned_back(wide))

    def wide_pdf(self, w: Floats, stretched: Floats) -> Floats:
        """Density of directions w (3, n) of a σ, (n,): half cosine-weighted, half the same `unstretched`."""
        squared = stretched * stretched
        area = self.alpha * (self.alpha if self.alpha_v is None else self.alpha_v)
        return np.abs(w[2]) * f4(0.5) * INV_PI * (f4(1) + area / (squared * squared))

    def normal_density(self, h: Floats, h2: Floats) -> Floats:
        """GGX's D(h/|h|) of half vectors h (3, n) of squared length h2 (n,), 1/sr (Walter et al., eq. 33)."""
        z2 = h[2] * h[2]
        a2, around = self._spread(h)
        spread = np.maximum(a2 * z2 + around, TINY)
        return a2 * INV_PI * (h2 / spread) ** 2

    def _beckmann_density(self, h: Floats, h2: Floats) -> Floats:
        """Beckmann's D, as `normal_density` (Walter et al., eq. 25)."""
        a2, around = self._spread(h)
        h2 = np.maximum(h2, TINY)
        cos2 = np.maximum(h[2] * h[2] / h2, LEAST_COS2)
        return exp(-around / (h2 * a2 * cos2)) * INV_PI / (a2 * cos2 * cos2)

    def _beckmann_stretched(self, w: Floats) -> Floats:
        """|z|·(1 + 2Λ) for Beckmann, (n,), by the rational approximation of Walter et al., section 5.2."""
        z, reach = np.abs(w[2]), np.sqrt(self._reach2(w))
        a = np.minimum(z / np.maximum(reach, TINY), f4(1.6))
        rest = np.maximum(f4(1) - f4(1.259) * a + f4(0.396) * a * a, f4(0)) / (f4(3.535) + f4(2.181) * a)
        return z + f4(2) * reach * rest

    def visible_weight(self, wo: Floats, m: Floats) -> Floats:
        """Density of the normals m (3, n) as seen along wo, over that of `visible_normals`, (n,)."""
        if not self.beckmann:
            return np.ones_like(wo[2])
        m2 = dot(m, m)
        masking = (wo[2] + self.stretched(wo)) / (wo[2] + self._beckmann_stretched(wo))
        return masking * self._beckmann_density(m, m2) / self.normal_density(m, m2)

    def visible_normals(self, wo: Floats, u: Floats) -> Floats:
        """Draw microfacet normals (3, n) as they are seen along wo, from u (2, n).

        Their density is D(m)·G1(wo)·(wo·m)/zo, of GGX. Source: J. Dupuy and A. Benyoub 2023, "Sampling
        Visible GGX Normals with Spherical Caps", Computer Graphics Forum 42(8), listing 3.
        """
        scale = self._scale()
        squeezed = wo.copy() if self.tangent is None else self._turned(wo)
        squeezed[:2] *= scale
        squeezed = normalize(squeezed)
        sin, cos = sin_cos_turns(u[0])
        z = (f4(1) - u[1]) * (f4(1) + squeezed[2]) - squeezed[2]
        radius = np.sqrt(np.maximum((f4(1) - z) * (f4(1) + z), f4(0)))
        squeezed[0] += radius * cos
        squeezed[1] += radius * sin
        squeezed[2] += z
        squeezed[:2] *= scale
        squeezed[2] = np.maximum(squeezed[2], TINY)
        return normalize(self._turned_back(squeezed))

    def _smith(self, zo: Floats, zi: Floats, so: Floats, si: Floats) -> Floats:
        """G2/(4·zo·zi), (n,), of cosines and σ (n,) each."""
        if self.separable:
            return f4(1) / np.maximum((zo + so) * (zi + si), TINY)
        return f4(0.5) / np.maximum(zo * si + zi * so, TINY)

    def weight(self, wo: Floats, wi: Floats, m: Floats) -> Floats:
        """f·|cosθi|/pdf, without Fresnel, of wi (3, n) to which `visible_normals` m (3, n) lead, (n,)."""
        zi = np.abs(wi[2])
        stretched = self._beckmann_stretched if self.beckmann else self.stretched
        so, si = stretched(wo), stretched(wi)
        return f4(2) * zi * (wo[2] + so) * self._smith(wo[2], zi, so, si) * self.visible_weight(wo, m)

    def mirror_lobe(
        self, wo: Floats, wi: Floats, stretched: tuple[Floats, Floats] | None = None
    ) -> tuple[Floats, Floats, Floats]:
        """Reflection by the microfacets without Fresnel, where wi (3, n) is above the surface.

        `stretched` has σ of both directions, (n,) each, if it is known.

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
        density = np.where(above, self.normal_density(h, h2), f4(0))
        so, si = stretched or (self.stretched(wo), self.stretched(wi))
        pdf = density * (f4(0.5) / (wo[2] + so))
        if self.beckmann:
            density = np.where(above, self._beckmann_density(h, h2), f4(0))
            so, si = self._beckmann_stretched(wo), self._beckmann_stretched(wi)
        value = density * self._smith(wo[2], np.maximum(wi[2], f4(0)), so, si)
        return value, pdf, np.minimum(f4(0.5) * np.sqrt(h2), f4(1))

    def refraction_lobe(
        self, wo: Floats, wi: Floats, eta: Floats, stretched: tuple[Floats, Floats] | None = None
    ) -> tuple[Floats, Floats, Floats, Bools]:
        """Refraction by the microfacets without Fresnel, where wi (3, n) is below the surface.

        `stretched` is as for `mirror_lobe`.

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
        shared = np.where(valid, self.normal_density(s, s2) * np.abs(cos_o * cos_i) / s2, f4(0))
        so, si = stretched or (self.stretched(wo), self.stretched(wi))
        pdf = shared * (f4(2) * eta * eta / (wo[2] + so))
        if self.beckmann:
            shared = np.where(valid, self._beckmann_density(s, s2) * np.abs(cos_o * cos_i) / s2, f4(0))
            so, si = self._beckmann_stretched(wo), self._beckmann_stretched(wi)
        value = shared * (f4(4) * self._smith(wo[2], np.abs(wi[2]), so, si))
        return value, pdf, np.minimum(np.abs(cos_o), f4(1)), valid


def reflect(wo: Floats, m: Floats) -> Floats:
    """Mirror wo (3, n) at unit normals m (3, n)."""
    return m * (f4(2) * dot(wo, m)) - wo


def refract(wo: Floats, m: Floats, cos: Floats, cos_refracted: Floats, eta: Floats) -> Floats:
    """Refract wo (3, n) at unit normals m (3, n) into the other side, of relative index eta (n,)."""
    inverse = f4(1) / eta
    return m * (cos * inverse - cos_refracted) - wo * inverse
