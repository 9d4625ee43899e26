"""Disney's principled material for thin sheets, as Mitsuba has it."""

from __future__ import annotations

from functools import partial

import numpy as np

from ..arrays.vec import INV_PI, Floats, broadcast, dot, f4
from ..core.parameter import Parameter, parametrized
from ..sampling.warp import cosine_hemisphere
from ..textures.parameter import Scalar, scalar
from .base import BsdfSample, weigh
from .disney import DisneyBase
from .fresnel import fresnel_dielectric
from .microfacet import Facets, reflect


@parametrized
class ThinDisney(DisneyBase):
    """Disney's principled material for sheets such as leaves and paper, with Mitsuba's formulas.

    Light goes through without refraction, as a rough mirror image or as a matte one. The sheet looks the same
    from both sides. As in Mitsuba a facet transmits no light to directions that see its front, so that this
    part is not reciprocal.

    Source: B. Burley 2015, "Extending the Disney BRDF to a BSDF with Integrated Subsurface Scattering", as
    implemented in `principledthin` of Mitsuba 3.

    Parameters
    ----------
    base_color
        Albedo of the base, and tint of transmitted light, in [0, 1].
    roughness, anisotropic
        In [0, 1]; the facets are `anisotropic` along the direction of growing u.
    ior, transmission
        Refractive index, and the part of the sheet that reflects and transmits by facets, in [0, 1].
    diffuse_transmission
        Part of the rest that crosses the sheet, in [0, 2]: 0 is none of it, 2 all.
    specular_tint, sheen, sheen_tint
        In [0, 1]; tints are towards the hue of the base.
    flatness
        In [0, 1], from diffuse to approximate subsurface scattering.

    Raises
    ------
    SceneError
        If a parameter is out of its range or not finite.

    Examples
    --------
    >>> leaf = wf.ThinDisney((0.2, 0.5, 0.1), 0.4, transmission=0.3, diffuse_transmission=1)
    """

    transmissive = True

    diffuse_transmission: Parameter[Scalar] = Parameter(
        partial(scalar, holds=lambda x: 0 <= x <= 2, limit="in [0, 2]"), default=0.0, kw_only=True
    )

    def evaluate(self, wo: Floats, wi: Floats) -> tuple[Floats, Floats]:
        """Return `f` and `pdf` of the lobes on the side of wi."""
        upper = wi.copy()
        upper[2] = np.abs(wi[2])
        gloss, above, below = self._shares()
        value, density, cos = self.facets().mirror_lobe(wo, upper)
        reflected, cos_refracted = fresnel_dielectric(cos, self.ior)
        glossy, _ = self._glossy(cos, reflected, cos_refracted)
        f = glossy * (self.transmission * value) + self._matte(wo, upper, cos) * above
        f = f + self._sheen(cos, above)
        value, through, _ = self.facets_through().mirror_lobe(wo, upper)
        seen = dot(wi, wo + upper) < 0  # both directions see the facet, from opposite sides
        clear = np.where(seen, self.transmission * (f4(1) - reflected) * value, f4(0))
        crossing = self.base_color * (clear + INV_PI * below)
        matte, is_above = INV_PI * upper[2], wi[2] > 0
        pdf = gloss * np.where(is_above, density, np.where(seen, through, f4(0)))
        pdf = pdf + np.where(is_above, above, below) * matte
        return np.where(is_above, f, crossing), pdf

    def sample_f(self, wo: Floats, u: Floats) -> BsdfSample:
        """Select a lobe by u[2], sample it, and weight by the density of all lobes on its side."""
        gloss, above, _ = self._shares()
        clear, faceted = u[2] < gloss, u[2] < f4(2) * gloss
        m = np.where(
            clear, self.facets_through().visible_normals(wo, u), self.facets().visible_normals(wo, u)
        )
        wi = np.where(faceted, reflect(wo, m), cosine_hemisphere(u))
        valid = wi[2] > 0
        crosses = clear | (u[2] >= f4(2) * gloss + above)
        wi[2] *= np.where(crosses, f4(-1), f4(1))
        valid &= ~clear | (dot(wi, m) < 0)
        f, pdf = self.evaluate(wo, wi)
        pdf = np.where(valid, pdf, f4(0))
        return BsdfSample(wi, weigh(f, wi, pdf), pdf, broadcast(np.False_, len(pdf)))

    def _shares(self) -> tuple[Floats, Floats, Floats]:
        """Chances of each of the two faceted lobes, and of matte reflection and transmission."""
        matte, crossing = f4(1) - self.transmission, f4(0.5) * self.diffuse_transmission
        return f4(0.5) * self.transmission, matte * (f4(1) - crossing), matte * crossing

    def facets_through(self) -> Facets:
        """Return the facets of transmission, rougher the higher the index (Burley 2015, figure 15)."""
        return self._facets_of((f4(0.65) * self.ior - f4(0.35)) * self.roughness)
