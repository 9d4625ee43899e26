"""What a file says of a surface, in the words of `Principled`, and the material that comes nearest."""

from __future__ import annotations

import inspect
from copy import copy
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..bsdfs import Bsdf, Dielectric, Diffuse, Principled, ThinDielectric
from ..textures import Texture
from ..vertex_colors import VertexColors
from .repair import Raw

PARAMETERS = frozenset(inspect.signature(Principled).parameters)
BASES: dict[type[Bsdf], str] = {Diffuse: "reflectance", Principled: "base_color"}
GLASS = frozenset(("base_color", "transmission", "ior", "roughness", "absorption", "thin"))


@dataclass
class Look:
    """What a surface looks like."""

    material: Bsdf
    emission: NDArray[np.float64] | Texture | None = None  # radiance, (3,) or varying
    two_sided: bool = False  # the emission leaves both sides
    lost: list[str] = field(default_factory=list)  # what the file asks for in vain
    alpha: Any = None  # number or texture where opacity counts: glTF's alpha modes MASK and BLEND
    cutoff: float | None = None  # as of `Bsdf.with_alpha`
    # the same with its base colour multiplied by vertex colours, once made; by whether its opacity is, too
    tinted: dict[bool, Look] = field(default_factory=dict)


COLOURED = Look(Diffuse(VertexColors()))  # of a mesh that has vertex colours and no material


def dress(raw: Raw, look: Look | None) -> bool:
    """Give a mesh its material and emission, and the material the mesh's vertex colours.

    Returns False if the material has no base colour that they could multiply.
    """
    honoured = True
    if raw.colors is not None:
        look, honoured = (
            (COLOURED, True) if look is None else _tinted(look, look.alpha is not None and is_faint(raw))
        )
    if look is not None:
        raw.material, raw.emission, raw.two_sided = look.material, look.emission, look.two_sided
    return honoured


def is_faint(raw: Raw) -> bool:
    """Tell whether vertex colours are anywhere less than opaque."""
    return raw.colors is not None and bool((raw.colors[:, 3:] < 1).any())


def _tinted(look: Look, faint: bool) -> tuple[Look, bool]:
    name = next((name for kind, name in BASES.items() if isinstance(look.material, kind)), None)
    if name is None:
        return look, False
    if faint not in look.tinted:
        material = copy(look.material)
        base = getattr(material, name)
        setattr(material, name, VertexColors(base.ravel() if isinstance(base, np.ndarray) else base))
        if faint:
            material = material.with_alpha(VertexColors(look.alpha, channel=3), look.cutoff)
        look.tinted[faint] = Look(material, look.emission, look.two_sided)
    return look.tinted[faint], True


def realise(wanted: dict[str, Any]) -> tuple[Bsdf, list[str]]:
    """Return a material, and the names of what is wanted in vain.

    Parameters
    ----------
    wanted
        Parameters of `Principled`, and others that it may get, by name, as far as they are not
        neutral; `alpha` may be. `base_color` is always there. Values are numbers, colours or textures.
    """
    wanted = dict(wanted)
    alpha, cutoff = wanted.pop("alpha", 1.0), wanted.pop("alpha_cutoff", None)
    material, lost = _solid(wanted)
    return material.with_alpha(alpha, cutoff), lost


def _solid(wanted: dict[str, Any]) -> tuple[Bsdf, list[str]]:
    """Return a material that is all there, and the names of what is wanted in vain."""
    lost = [name for name in wanted if name not in PARAMETERS]
    known = {name: value for name, value in wanted.items() if name in PARAMETERS}
    if known.keys() == {"base_color"}:
        return Diffuse(known["base_color"]), lost
    # what is all glass is better off with the materials that know nothing else: they can be smooth
    transmission = known.get("transmission", 0.0)
    if known.keys() <= GLASS and not isinstance(transmission, Texture) and transmission == 1:
        return _glass(known), lost
    return Principled(**known), lost


def _glass(known: dict[str, Any]) -> Bsdf:
    ior, roughness, tint = known.get("ior", 1.5), known.get("roughness", 0.5), known["base_color"]
    if known.get("thin"):
        return ThinDielectric(ior, roughness, transmittance=tint)
    return Dielectric(ior, roughness, transmittance=tint, absorption=known.get("absorption", 0.0))
