"""Glass whose channels differ: by an index for each (dispersion), or by a film with interference.

A refracted path follows the channel that was drawn, by the throughput of the channels so far, so that a path
that follows one keeps to it. A reflected path keeps all channels. Rough glass draws a channel, and weighs by
the densities of all.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..arrays.vec import Floats, Ints, broadcast, column, dot, f4
from .base import BsdfSample, weigh
from .fresnel import fresnel_dielectric
from .microfacet import reflect, refract
from .thin_film import film_reflectance

if TYPE_CHECKING:
    from .dielectric import Dielectric


def evaluate_channels(glass: Dielectric, wo: Floats, wi: Floats) -> tuple[Floats, Floats]:
    """Return `f` and `pdf` of rough glass."""
    facets = glass.facets()
    value, density, cos = facets.mirror_lobe(wo, wi)
    reflected, _, eta = fresnel_channels(glass, cos)
    chance = _shares(glass, wo)
    f = glass.reflectance * (value * reflected)
    pdf = density * _total(chance * reflected)
    for k in range(3):
        through, through_density, through_cos, _ = facets.refraction_lobe(wo, wi, eta[k])
        passed = f4(1) - fresnel_channels(glass, through_cos)[0][k]
        f[k] += glass.transmittance[k] * (through * passed)
        pdf = pdf + through_density * passed * chance[k]
    return f, pdf


def sample_channels(glass: Dielectric, wo: Floats, u: Floats) -> BsdfSample:
    """Reflect with the probability of the mean Fresnel reflectance (by u[2]), else refract in a channel."""
    n = wo.shape[1]
    smooth = glass.specular
    m = np.repeat(column((0, 0, 1)), n, 1) if smooth else glass.facets().visible_normals(wo, u)
    cos = wo[2] if smooth else np.maximum(dot(wo, m), f4(0))
    reflected, cos_refracted, eta = fresnel_channels(glass, cos)
    chance = _shares(glass, wo)
    refracted = chance * (f4(1) - reflected)
    mean = _total(chance * reflected)
    reflects = u[2] < mean
    left = u[2] - mean
    k = (left >= refracted[0]).astype(np.intp) + (left >= refracted[0] + refracted[1])
    index = _of(eta, k)
    wi = np.where(reflects, reflect(wo, m), refract(wo, m, cos, _of(cos_refracted, k), index))
    relative = np.where(reflects, f4(1), index)
    if not smooth:
        f, pdf = evaluate_channels(glass, wo, wi)
        pdf = np.where((wi[2] > 0) == reflects, pdf, f4(0))
        return BsdfSample(wi, weigh(f, wi, pdf), pdf, broadcast(np.False_, n), relative)
    followed = np.arange(3)[:, None] == k if glass.dispersive else np.ones((3, n), np.bool_)
    passed = _of(refracted, k) if glass.dispersive else _total(refracted)
    pdf = np.where(reflects, mean, passed)
    inverse = f4(1) / (np.where(pdf > 0, pdf, f4(1)) * relative * relative)
    crosses = glass.transmittance * ((f4(1) - reflected) * followed)
    both = np.where(reflects, glass.reflectance * reflected, crosses)
    weight = both * np.where(pdf > 0, inverse, f4(0))
    return BsdfSample(wi, weight, pdf, np.ones(n, np.bool_), relative)


def fresnel_channels(glass: Dielectric, cos: Floats) -> tuple[Floats, Floats, Floats]:
    """Return reflectance, refracted cosine and relative index of each channel, (3, n) each."""
    eta = np.broadcast_to(glass.eta, (3, cos.size))
    reflected, cos_refracted = fresnel_dielectric(cos, eta)
    if glass.has_film:
        film = film_reflectance(cos, glass.film_thickness, glass.film_ior, glass.before, eta * glass.before)
        reflected = np.where(reflected < 1, film, f4(1))
    return reflected, cos_refracted, eta


def mean_of_channels(reflected: Floats) -> Floats:
    """Return the mean of a reflectance over the channels, if it has any, (n,)."""
    return reflected if reflected.ndim == 1 else _total(reflected) * f4(1 / 3)


def _shares(glass: Dielectric, wo: Floats) -> Floats:
    """Return the probabilities of the channels, (3, n)."""
    return np.broadcast_to(glass.shares, wo.shape)


def _total(values: Floats) -> Floats:
    return values[0] + values[1] + values[2]


def _of(values: Floats, k: Ints) -> Floats:
    """Return the rows k (n,) of values (3, n), (n,)."""
    return np.take_along_axis(values, k[None], 0)[0]
