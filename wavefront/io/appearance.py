"""What a file says of a surface, in the words of `Principled`, and the material that comes nearest."""

from __future__ import annotations

import inspect
from copy import copy
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..bsdfs import Bsdf, Dielectric, Diffuse, Principled, ThinDielectric
from ..textures.image import Texture
from ..textures.vertex_colors import VertexColors
from .repair import RawMesh

PARAMETERS = frozenset(inspect.signature(Principled).parameters)
BASES: dict[type[Bsdf], str] = {Diffuse: "reflectance", Principled: "base_color"}
GLASS = frozenset(("base_color", "transmission", "ior", "roughness", "absorption", "thin"))


@dataclass
class MaterialSpec:
    """What a surface looks like."""

    material: Bsdf
    emission: NDArray[np.float64] | Texture | None = None  # radiance, (3,) or varying
    two_sided: bool = False  # the emission leaves both sides
    lost: list[str] = field(default_factory=list)  # what the file asks for in vain
    alpha: Any = None  # number or texture where opacity counts: glTF's alpha modes MASK and BLEND
    cutoff: float | None = None  # as of `Bsdf.with_alpha`
    # the same with its base color multiplied by vertex colors, once made; by whether its opacity is, too
    tinted: dict[bool, MaterialSpec] = field(default_factory=dict)


COLORED = MaterialSpec(Diffuse(VertexColors()))  # of a mesh that has vertex colors and no material


def assign_material(raw: RawMesh, spec: MaterialSpec | None) -> bool:
    """Give a mesh its material and emission, and the material the mesh's vertex colors.

    Returns False if the material has no base color that they could multiply.
    """
    honored = True
    if raw.colors is not None:
        spec, honored = (
            (COLORED, True) if spec is None else _tinted(spec, spec.alpha is not None and is_faint(raw))
        )
    if spec is not None:
        raw.material, raw.emission, raw.two_sided = spec.material, spec.emission, spec.two_sided
    return honored


def is_faint(raw: RawMesh) -> bool:
    """Tell whether vertex colors are anywhere less than opaque."""
    return raw.colors is not None and bool((raw.colors[:, 3:] < 1).any())


def _tinted(spec: MaterialSpec, faint: bool) -> tuple[MaterialSpec, bool]:
    name = next((name for kind, name in BASES.items() if isinstance(spec.material, kind)), None)
    if name is None:
        return spec, False
    if faint not in spec.tinted:
        material = copy(spec.material)
        base = getattr(material, name)
        setattr(material, name, VertexColors(base.ravel() if isinstance(base, np.ndarray) else base))
        if faint:
            material = material.with_alpha(VertexColors(spec.alpha, channel=3), spec.cutoff)
        spec.tinted[faint] = MaterialSpec(material, spec.emission, spec.two_sided)
    return spec.tinted[faint], True


def build_material(wanted: dict[str, Any]) -> tuple[Bsdf, list[str]]:
    """Return a material, and the names of what is wanted in vain.

    Parameters
    ----------
    wanted
        Parameters of `Principled`, and others that it may get, by name, as far as they are not
        neutral; `alpha` may be. `base_color` is always there. Values are numbers, colors or textures.
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
