"""Materials of surfaces."""

from __future__ import annotations

from copy import copy
from functools import partial
from typing import Any, Self, TypeAlias

import numpy as np

from ..arrays.vec import f4
from ..bsdfs import Bsdf
from ..bsdfs.base import is_bsdf
from ..colors import EFFICACY
from ..core.errors import SceneError, flag, number
from ..core.html import preview_html
from ..core.parameter import Parameter, Parametrized, instance_of, optional, parametrized
from ..core.suggestions import suggests_keywords
from ..film.aov_names import DEFAULT_GROUP, group_name
from ..media import BaseMedium
from ..textures.normal_map import BaseNormalMap
from ..textures.parameter import Color, Scalar, color
from .alpha import Opacity, alpha_value
from .named import named_bsdf


def _emission(name: str, value: Any) -> Any:
    """Return a radiance as (3, 1) float32 or a texture of colors; None where it is black."""
    radiance = None if value is None else color(name, value, np.inf)
    return None if isinstance(radiance, np.ndarray) and not radiance.any() else radiance


def _priority(name: str, value: Any) -> int:
    return int(number(name, value, lambda x: x == int(x) and abs(x) < 2**31, "a whole number below 2**31"))


_efficacy = partial(number, holds=lambda x: x > 0, limit="above 0 lm/W")
_cutoff = partial(number, holds=lambda x: x >= 0, limit="at least 0")
_normal_map = instance_of(BaseNormalMap, "a NormalMap or a BumpMap")
_interior = instance_of(BaseMedium, "a Medium such as wf.Medium(absorption=1)")


@parametrized
class Material(Parametrized):
    """A BSDF, and everything else that a surface is made of.

    Wherever a material is taken, a `Bsdf` alone is taken too and stands for `Material(bsdf)`, and a name
    for `Material.named(name)`.

    Parameters
    ----------
    bsdf
        How the surface scatters light.
    alpha
        Opacity: the fraction of the light that meets the surface, in [0, 1]: a number, or a `Texture` of one
        channel. The rest passes as if there were no surface, and so do shadow rays. None: opaque.
    alpha_cutoff
        If given, the surface is opaque where alpha is at least this, and absent elsewhere.
    normal_map
        A `NormalMap` or `BumpMap`, which perturbs the shading normals.
    emission
        Radiance that shapes of this material emit, W·sr⁻¹·m⁻², at least 0: a number, three numbers, or
        a texture. A shape's own emission replaces it.
    group
        Name of the light group of the emission, for `aovs="light_groups"`.
    efficacy
        lm/W of the emission, for `Measurement.lux`: 683 for watts of visible light.
    interior
        The `Medium` behind the surface. A ray that meets the surface from its back side has crossed it.
    priority
        A whole number, for shapes that overlap, such as a liquid and the glass around it: where they do,
        there is only the one of the higher priority, and surfaces within it do not count. Indices of
        refraction are then relative to vacuum, and not to what is around the shape. None: 0, and an index
        relative to what is around.
    name
        The name of the material in `Image.names`; materials of files have that of the file.
    visible_to_camera
        False: the camera sees what is behind the surface, also in AOVs. Mirrors and glass show it, and it
        shines and casts shadows: light in the picture that does not cover anything.

    Attributes
    ----------
    opacity
        Alpha and its cutoff as an `Opacity`; None if the surface is opaque everywhere.

    Raises
    ------
    SceneError
        If a parameter is of the wrong type or out of its range.

    Examples
    --------
    >>> leaf = wf.Material(wf.Diffuse((0.1, 0.5, 0.1)), alpha=0.5, name="leaf")
    >>> green_glass = wf.Material(wf.Dielectric(1.5), interior=wf.Medium(absorption=(2, 0.2, 1)))
    """

    bsdf: Parameter[Bsdf] = Parameter(is_bsdf)
    alpha: Parameter[Scalar | None] = Parameter(optional(alpha_value), default=None, kw_only=True)
    alpha_cutoff: Parameter[float | None] = Parameter(optional(_cutoff), default=None, kw_only=True)
    normal_map: Parameter[BaseNormalMap | None] = Parameter(optional(_normal_map), default=None, kw_only=True)
    emission: Parameter[Color | None] = Parameter(_emission, default=None, kw_only=True)
    interior: Parameter[BaseMedium | None] = Parameter(optional(_interior), default=None, kw_only=True)
    priority: Parameter[int | None] = Parameter(optional(_priority), default=None, kw_only=True)
    group: Parameter[str] = Parameter(group_name, default=DEFAULT_GROUP, kw_only=True)
    efficacy: Parameter[float] = Parameter(_efficacy, default=EFFICACY, kw_only=True)
    name: Parameter[str | None] = Parameter(optional(instance_of(str, "text")), default=None, kw_only=True)
    visible_to_camera: Parameter[bool] = Parameter(flag, default=True, kw_only=True)

    @classmethod
    @suggests_keywords
    def named(cls, name: str, color: Color | None = None) -> Self:
        """Return a material by its name, such as "gold", "glass", "plastic" or "clay".

        Parameters
        ----------
        name
            In upper or lower case; docs/materials.md lists all. Metals and clear materials have measured
            constants. All others were chosen by eye. A color may stand before it, as in "red plastic"; a
            color alone, such as "red" or "#ff8800", is matte.
        color
            The color in place of the usual one, as for `Diffuse`. Metals and mirrors have their own. For
            clear materials it is the tint of the light that passes their surface.

        Raises
        ------
        SceneError
            If the name is unknown, or the material has a color of its own.

        Examples
        --------
        >>> ball = wf.Sphere((0, 0, 0), 1, material="gold")
        >>> blue = wf.Sphere((2, 0, 0), 1, material=wf.Material.named("plastic", color="royalblue"))
        """
        key, bsdf = named_bsdf("Material name", name, color)
        return cls(bsdf, name=key)

    def _repr_html_(self) -> str:
        """Show a ball in a notebook."""
        return preview_html(self)

    def derive(self) -> None:
        """Set the opacity."""
        alpha = np.zeros(1, f4) if self.bsdf.invisible else self.alpha
        opacity = None if alpha is None else Opacity(alpha, self.alpha_cutoff)
        self.opacity: Opacity | None = None if opacity is None or opacity.constant == 1 else opacity

    @property
    def encloses(self) -> bool:
        """Whether light behind the surface is inside of something else than in front of it."""
        return self.interior is not None or self.bsdf.encloses

    def scaled(self, factor: float) -> Self:
        """Return this material where lengths were multiplied by `factor`: itself if it has no lengths."""
        if factor == 1:
            return self
        normal_map = None if self.normal_map is None else self.normal_map.scaled(factor)
        interior = None if self.interior is None else self.interior.scaled(factor)
        if normal_map is self.normal_map and interior is self.interior:
            return self
        other = copy(self)
        other.normal_map, other.interior = normal_map, interior
        return other


MaterialLike: TypeAlias = Material | Bsdf | str


def as_material(name: str, value: Any) -> Material:
    """Return a material; a `Bsdf` becomes one that has nothing else, and a name that of the table.

    Raises
    ------
    SceneError
        If the value, called `name`, is none of these.
    """
    if isinstance(value, str):
        key, bsdf = named_bsdf(name, value, None)
        return Material(bsdf, name=key)
    if isinstance(value, Material):
        return value
    if isinstance(value, Bsdf):
        return Material(value)
    raise SceneError(f'{name} must be a material such as wf.Diffuse(0.5) or "gold", got {value!r}')
