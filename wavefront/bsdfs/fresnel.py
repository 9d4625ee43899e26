"""How much light an optically smooth boundary reflects."""

from __future__ import annotations

import numpy as np

from ..arrays.vec import TINY, Floats, f4


def fresnel_dielectric(cos: Floats, eta: Floats) -> tuple[Floats, Floats]:
    """Unpolarized reflectance between two dielectrics, and the cosine of the refracted ray.

    Parameters
    ----------
    cos
        (n,) cosine of the angle of incidence, in [0, 1].
    eta
        (n,) or (1,) refractive index beyond / before the boundary.

    Returns
    -------
    reflectance
        (n,) mean over both polarizations; exactly 1 where all light is reflected internally.
    cos_refracted
        (n,) cosine beyond the boundary, at least 0; 0 where all light is reflected internally.

    Notes
    -----
    Source: E. Hecht, *Optics*, 4th ed., eqs. 4.34 and 4.40, with g = η·cosθt as in Walter et al. 2007,
    "Microfacet Models for Refraction through Rough Surfaces", eq. 22. Written with
    g² = cos² + (η² − 1), which is exact at η = 1 and needs no branch for total internal reflection.
    """
    perpendicular, parallel, g = _amplitudes(cos, eta)
    reflectance = f4(0.5) * (perpendicular * perpendicular + parallel * parallel)
    return np.where(g > 0, reflectance, f4(1)), np.minimum(g / eta, f4(1))


def _amplitudes(cos: Floats, eta: Floats) -> tuple[Floats, Floats, Floats]:
    """Return the amplitudes of both polarizations, and g of `fresnel_dielectric`, (n,) each."""
    eta_scale = eta * eta
    g = np.sqrt(np.maximum(cos * cos + (eta - f4(1)) * (eta + f4(1)), f4(0)))
    perpendicular = (cos - g) / np.maximum(cos + g, TINY)
    parallel = (eta_scale * cos - g) / np.maximum(eta_scale * cos + g, TINY)
    return perpendicular, parallel, g


def fresnel_sheet(cos: Floats, eta: Floats) -> Floats:
    """Unpolarized reflectance (n,) of a clear sheet with two parallel faces, without interference.

    Parameters
    ----------
    cos, eta
        As for `fresnel_dielectric`, of the first face.

    Notes
    -----
    Light that a face polarizes stays polarized at the next one. So each polarization has its own sum of all
    reflections, 2R/(1 + R) with R of one face (Hecht, *Optics*, §9.6), and the reflectance is their mean.
    """
    perpendicular, parallel, g = _amplitudes(cos, eta)
    s, p = perpendicular * perpendicular, parallel * parallel
    return np.where(g > 0, s / (f4(1) + s) + p / (f4(1) + p), f4(1))


def fresnel_conductor(cos: Floats, eta: Floats, k: Floats) -> Floats:
    """Unpolarized reflectance of a conductor in air or vacuum, per channel, (3, n).

    Parameters
    ----------
    cos
        (n,) cosine of the angle of incidence, in [0, 1].
    eta, k
        (3, n) or (3, 1) real and imaginary part of the refractive index, η + ik.

    Notes
    -----
    Source: Hecht, *Optics*, §4.8, in the real-valued form of S. Lagarde 2013, "Memo on Fresnel
    equations". The root a² is taken through the larger of its two conjugate factors, so that no
    digits cancel when k is much larger than η.
    """
    cos2 = cos * cos
    sin2 = np.maximum(f4(1) - cos2, f4(0))
    etak2 = (eta * k) ** 2
    t0 = (eta - k) * (eta + k) - sin2
    a2b2 = np.sqrt(t0 * t0 + f4(4) * etak2)
    larger = np.maximum(f4(0.5) * (a2b2 + np.abs(t0)), TINY)
    a = np.sqrt(np.where(t0 > 0, larger, etak2 / larger))
    t1 = a2b2 + cos2
    t2 = f4(2) * cos * a
    perpendicular = (t1 - t2) / (t1 + t2)
    t3 = cos2 * a2b2 + sin2 * sin2
    t4 = t2 * sin2
    parallel = perpendicular * (t3 - t4) / np.maximum(t3 + t4, TINY)
    return f4(0.5) * (perpendicular + parallel)
