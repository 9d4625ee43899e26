"""OpenPBR, the material that Blender, Houdini and Maya agree on."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ..arrays.elementary import log
from ..arrays.state import SurfaceInteraction
from ..arrays.vec import Floats, f4
from ..bsdfs import Bsdf, Dielectric
from ..bsdfs.dielectric import dispersed
from ..bsdfs.openpbr import OpenPBRBsdf
from ..colors import rgb
from ..core.errors import SceneError, called, in_brief, number, warn_caller
from ..core.suggestions import suggests_keywords
from ..media import HenyeyGreenstein, Medium
from ..textures.base import BaseTexture
from ..textures.normal_map import BaseNormalMap
from ..textures.parameter import Color, Scalar, color, scalar
from .material import Material

BESIDE_GLASS = (
    "base_metalness",
    "coat_weight",
    "fuzz_weight",
    "thin_film_weight",
    "geometry_thin_walled",
    "specular_roughness_anisotropy",
)
LEAST_COLOR = f4(1e-4)  # of the light that passes `transmission_depth`


class OpenPBR(Material):
    """The material of OpenPBR 1.1, with the names, units and defaults of its specification.

    The `bsdf` scatters light, and the emission, alpha, normal map and interior follow from the other
    parameters. docs/openpbr.md lists what is approximated.

    Parameters
    ----------
    base_weight, base_color, base_diffuse_roughness, base_metalness
        The diffuse base or the metal: its color times its weight, the roughness of the diffuse base (the EON
        model), and from 0 (dielectric) to 1 (metal). All in [0, 1].
    specular_weight, specular_color, specular_roughness, specular_roughness_anisotropy, specular_ior
        The reflection of the base: the weight, at least 0, scales the reflectance along the normal by way of
        the index; the color tints it, for metals at about 82°.
    transmission_weight, transmission_color, transmission_depth
        Part of the dielectric that is clear. The color tints light where it crosses the surface, or where the
        depth is more than 0, on a path of this length inside.
    transmission_scatter, transmission_scatter_anisotropy
        Scattering inside, 1/`transmission_depth`, and its mean cosine in (−1, 1).
    transmission_dispersion_scale, transmission_dispersion_abbe_number
        The Abbe number, at least 0, is divided by the scale in [0, 1], and gives each channel an index; there
        is no dispersion where one of them is 0. It makes the `bsdf` a `Dielectric`, beside which there can be
        nothing else.
    subsurface_weight, subsurface_color
        Part of the base that scatters light below the surface, as if it were diffuse.
    coat_weight, coat_color, coat_roughness, coat_ior, coat_darkening
        A clear coat, what it lets pass along the normal in and out, and how much light that it throws back
        to the base darkens it.
    fuzz_weight, fuzz_color, fuzz_roughness
        Fibers above all.
    emission_luminance, emission_color
        Their product is the radiance.
    thin_film_weight, thin_film_thickness, thin_film_ior
        A film on the base, in micrometers.
    geometry_opacity
        In [0, 1].
    geometry_thin_walled
        The surface is a sheet.
    geometry_normal
        A `NormalMap` or `BumpMap`.
    priority, name
        As for `Material`.

    Raises
    ------
    SceneError
        If a parameter is out of its range, not finite, or a texture where there can be none.

    Examples
    --------
    >>> paint = wf.OpenPBR(base_color=(0.6, 0.05, 0.05), specular_roughness=0.4, coat_weight=1)
    >>> honey = wf.OpenPBR(transmission_weight=1, transmission_color=(1, 0.6, 0.1), transmission_depth=0.5)
    """

    @suggests_keywords
    def __init__(
        self,
        *,
        base_weight: Scalar = 1.0,
        base_color: Color = 0.8,
        base_diffuse_roughness: Scalar = 0.0,
        base_metalness: Scalar = 0.0,
        specular_weight: Scalar = 1.0,
        specular_color: Color = 1.0,
        specular_roughness: Scalar = 0.3,
        specular_ior: Scalar = 1.5,
        specular_roughness_anisotropy: Scalar = 0.0,
        transmission_weight: Scalar = 0.0,
        transmission_color: Color = 1.0,
        transmission_depth: float = 0.0,
        transmission_scatter: ArrayLike = 0.0,
        transmission_scatter_anisotropy: float = 0.0,
        transmission_dispersion_scale: float = 0.0,
        transmission_dispersion_abbe_number: float = 20.0,
        subsurface_weight: Scalar = 0.0,
        subsurface_color: Color = 0.8,
        coat_weight: Scalar = 0.0,
        coat_color: Color = 1.0,
        coat_roughness: Scalar = 0.0,
        coat_ior: Scalar = 1.6,
        coat_darkening: Scalar = 1.0,
        fuzz_weight: Scalar = 0.0,
        fuzz_color: Color = 1.0,
        fuzz_roughness: Scalar = 0.5,
        thin_film_weight: Scalar = 0.0,
        thin_film_thickness: Scalar = 0.5,
        thin_film_ior: Scalar = 1.4,
        emission_luminance: float = 0.0,
        emission_color: Color = 1.0,
        geometry_opacity: Scalar = 1.0,
        geometry_thin_walled: bool = False,
        geometry_normal: BaseNormalMap | None = None,
        priority: int | None = None,
        name: str | None = None,
    ) -> None:
        arguments = locals()
        depth = _amount("transmission_depth", transmission_depth)
        interior = None
        if depth > 0 and not geometry_thin_walled:
            arguments["transmission_color"] = 1.0
            interior = _interior(
                transmission_color, depth, transmission_scatter, transmission_scatter_anisotropy
            )
        below = scalar("OpenPBR subsurface_weight", subsurface_weight)
        if isinstance(below, BaseTexture) or below > 0:
            warn_caller("OpenPBR: subsurface scattering is approximated by a diffuse surface of its color")
        layers = OpenPBRBsdf(**{key: arguments[key] for key in OpenPBRBsdf.defaults if key in arguments})
        opacity = scalar("OpenPBR geometry_opacity", geometry_opacity)
        if not isinstance(geometry_normal, BaseNormalMap | None):
            wanted = "a NormalMap or a BumpMap"
            raise SceneError(f"OpenPBR geometry_normal must be {wanted}, got {in_brief(geometry_normal)}")
        rgb("OpenPBR transmission_scatter", transmission_scatter, np.inf)
        number("OpenPBR transmission_scatter_anisotropy", transmission_scatter_anisotropy)
        super().__init__(
            _dispersive(layers, transmission_dispersion_scale, transmission_dispersion_abbe_number),
            alpha=opacity if isinstance(opacity, BaseTexture) or opacity != 1 else None,
            normal_map=geometry_normal,
            emission=_emission(_amount("emission_luminance", emission_luminance), emission_color),
            interior=interior,
            priority=priority,
            name=name,
        )


def _amount(name: str, value: float) -> float:
    return number(f"OpenPBR {name}", value, lambda x: 0 <= x < np.inf, "at least 0 and finite")


def _dispersive(layers: OpenPBRBsdf, scale: float, abbe: float) -> Bsdf:
    """Return dispersive glass if the layers are clear glass alone, else the layers as they are."""
    scale = number("OpenPBR transmission_dispersion_scale", scale, lambda x: 0 <= x <= 1, "in [0, 1]")
    abbe = _amount("transmission_dispersion_abbe_number", abbe)
    if scale == 0 or abbe == 0 or not layers.transmissive:
        return layers
    index, clear = layers.index_inside, layers.transmission_weight
    others = (getattr(layers, key) for key in BESIDE_GLASS)
    mixed = any(isinstance(parameter, BaseTexture) or np.any(parameter) for parameter in others)
    if mixed or isinstance(index, BaseTexture) or isinstance(clear, BaseTexture) or clear != 1:
        warn_caller("OpenPBR: transmission_dispersion_scale is left out where there is more than clear glass")
        return layers
    ior = float(index[0])
    return Dielectric(
        dispersed(ior, abbe / scale) if ior >= 1 else 1 / dispersed(1 / ior, abbe / scale),
        layers.specular_roughness,
        reflectance=layers.specular_color,
        transmittance=layers.transmission_color,
    )


def _emission(luminance: float, tint: Color) -> Color | None:
    shade = color("OpenPBR emission_color", tint, np.inf)
    if luminance == 0:
        return None
    if isinstance(shade, BaseTexture):
        return Scaled(shade, luminance)
    with called("OpenPBR emission_luminance times emission_color", "radiance"), np.errstate(over="ignore"):
        return rgb("radiance", shade.astype(np.float64) * luminance)


def _interior(passed: Color, depth: float, scatter: ArrayLike, anisotropy: float) -> Medium:
    """Return the medium that lets a color pass a depth (specification, section on translucency)."""
    if isinstance(passed, BaseTexture):
        raise SceneError("OpenPBR transmission_color is a texture; with a transmission_depth it is a color")
    tint = np.maximum(color("OpenPBR transmission_color", passed), LEAST_COLOR)
    scattering = rgb("OpenPBR transmission_scatter", scatter, np.inf) / f4(depth)
    absorption = -log(tint) / f4(depth) - scattering
    absorption -= min(float(absorption.min()), 0)  # as much as makes all channels absorb
    phase = HenyeyGreenstein(anisotropy) if anisotropy else None
    return Medium(absorption[:, 0], scattering[:, 0], phase=phase)


class Scaled(BaseTexture):
    """A texture of colors times a number."""

    scalar = False

    def __init__(self, colors: BaseTexture, factor: float) -> None:
        self.colors, self.factor = colors, f4(factor)
        self.reads = colors.reads

    def limits(self) -> tuple[float, ...]:
        """Return the limits of the products."""
        return tuple(limit * float(self.factor) for limit in self.colors.limits())

    def at(self, surface: SurfaceInteraction) -> Floats:
        """Return the products, (3, n)."""
        return np.broadcast_to(self.colors.at(surface) * self.factor, (3, len(surface)))
