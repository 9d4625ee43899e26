"""Clear sheets too thin to bend light: window panes, bubbles, leaves of plastic."""

from __future__ import annotations

import numpy as np

from ..arrays.vec import Floats, dot, f4
from .base import BsdfSample, weigh
from .energy import gain
from .fresnel import fresnel_sheet
from .microfacet import reflect
from .mirror import mirrored
from .refractive import RefractiveBsdf


class ThinDielectric(RefractiveBsdf):
    """A thin sheet of clear material, such as a window pane: it reflects and transmits without refraction.

    All reflections between its two faces are summed, for each polarization by itself: with R of one face it
    reflects 2R/(1 + R) (Hecht, *Optics*, §9.6, without interference). It looks the same from both sides. A
    rough sheet scatters transmitted light as widely as reflected light, as in glTF's
    KHR_materials_transmission.

    Parameters
    ----------
    ior
        Refractive index of the material relative to the medium around it, from 1e-6 to 1e6.
    roughness
        In [0, 1]; α = roughness². Below α = 0.001 it is perfectly smooth.
    reflectance, transmittance
        Tints of the reflected and of the transmitted light per channel, in [0, 1].
    roughness_v, rotation, distribution, shadowing, multiscatter
        As for `Conductor`.

    Raises
    ------
    SceneError
        If a parameter is out of its range or not finite.

    Examples
    --------
    >>> pane = wf.Rectangle((-1, 0, 0), (2, 0, 0), (0, 2, 0), material=wf.ThinDielectric(1.5))
    """

    thin = True

    def albedo(self, wo: Floats) -> Floats:
        """Return the tints of both sides, weighted by the reflectance of a smooth sheet."""
        return self.transmittance + (self.reflectance - self.transmittance) * self._reflected(wo[2])

    def evaluate(self, wo: Floats, wi: Floats) -> tuple[Floats, Floats]:
        """Return `f` and `pdf`: below the sheet the lobe above it, mirrored; 0 for a smooth sheet."""
        if self.specular:
            return np.zeros_like(wi), np.zeros_like(wi[2])
        upper = wi.copy()
        upper[2] = np.abs(wi[2])
        value, density, cos = self.facets().mirror_lobe(wo, upper)
        if self.multiscatter:
            value = value * gain(self, wo, upper)
        reflected = self._reflected(cos)
        above = wi[2] > 0
        share = np.where(above, reflected, f4(1) - reflected)
        return np.where(above, self.reflectance, self.transmittance) * (value * share), density * share

    def sample_f(self, wo: Floats, u: Floats) -> BsdfSample:
        """Reflect with the probability of the sheet's reflectance (by u[2]), else go through."""
        if self.specular:
            wi, cos = mirrored(wo), wo[2]
        else:
            m = self.facets().visible_normals(wo, u)
            wi, cos = reflect(wo, m), np.maximum(dot(wo, m), f4(0))
        reflected = self._reflected(cos)
        reflects = u[2] < reflected
        valid = wi[2] > 0
        wi[2] *= np.where(reflects, f4(1), f4(-1))
        if self.specular:
            weight = np.where(reflects, self.reflectance, self.transmittance)
            pdf = np.where(reflects, reflected, f4(1) - reflected)
            return BsdfSample(wi, weight, pdf, np.ones(len(pdf), np.bool_))
        f, pdf = self.evaluate(wo, wi)
        pdf = np.where(valid, pdf, f4(0))
        return BsdfSample(wi, weigh(f, wi, pdf), pdf, np.zeros(len(pdf), np.bool_))

    def _reflected(self, cos: Floats) -> Floats:
        """Part of the light that the sheet reflects, (n,)."""
        return fresnel_sheet(cos, self.ior)
