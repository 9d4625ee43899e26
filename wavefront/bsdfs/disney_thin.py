"""Disney's principled material for thin sheets, as Mitsuba has it."""

from __future__ import annotations

from functools import partial

from ..core.parameter import Parameter, parametrized
from ..textures.parameter import Scalar, scalar
from .disney import DisneyModel
from .layers.disney import DisneySheet
from .layers.layers import Layers


@parametrized
class ThinDisney(DisneyModel):
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

    def layers(self) -> Layers:
        """Return the sheet, on which nothing lies."""
        return Layers(DisneySheet(diffuse_transmission=self.diffuse_transmission, **self.shared()))
