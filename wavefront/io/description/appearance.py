"""Materials of files: parameters by the names of `Principled`, and the classes that fit them."""

from __future__ import annotations

import inspect
from copy import copy
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ...arrays.vec import Doubles, f4
from ...bsdfs import Bsdf, Dielectric, Diffuse, NullSurface, Principled, ThinDielectric
from ...colors import srgb_to_linear
from ...materials import Material
from ...media import Medium
from ...textures.image import Texture
from ...textures.normal_map import BaseNormalMap
from ...textures.vertex_colors import VertexColors
from ..repair import RawMesh, Table

PARAMETERS = frozenset(inspect.signature(Principled).parameters)
BASES: dict[type[Bsdf], str] = {Diffuse: "reflectance", Principled: "base_color"}
PLAIN = frozenset(("base_color", "transmission", "ior", "roughness", "thin"))
F0 = 0.04  # reflectance of a `Principled` of index 1.5 along the normal, which `specular_color` multiplies
FILM = ("film_thickness", "film_ior")
GLASS = PLAIN.union(("roughness_v", "rotation"), FILM)


@dataclass
class MaterialSpec:
    """The appearance of a surface in a file."""

    material: Material
    emission: Doubles | Texture | None = None  # radiance, (3,) or varying
    two_sided: bool = False  # the emission leaves both sides
    lost: list[str] = field(default_factory=list)  # properties that are not supported
    alpha: Any = None  # number or texture in glTF's alpha modes MASK and BLEND
    cutoff: float | None = None  # as `alpha_cutoff` of `Material`
    # the same with base color times vertex colors; the key says whether opacity is multiplied, too
    tinted: dict[bool, MaterialSpec] = field(default_factory=dict)


# of a mesh with vertex colors and without a material
COLORED = MaterialSpec(Material(Diffuse(VertexColors())))


def assign_material(raw: RawMesh, spec: MaterialSpec | None) -> bool:
    """Set the material and emission of a mesh, and multiply the base color by its vertex colors.

    Returns False if the material has no base color to multiply.
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
    """Return True where a vertex color is less than opaque."""
    return raw.colors is not None and bool((raw.colors[:, 3:] < 1).any())


def _tinted(spec: MaterialSpec, faint: bool) -> tuple[MaterialSpec, bool]:
    name = next((name for kind, name in BASES.items() if isinstance(spec.material.bsdf, kind)), None)
    if name is None:
        return spec, False
    if faint not in spec.tinted:
        material, bsdf = copy(spec.material), copy(spec.material.bsdf)
        base = getattr(bsdf, name)
        setattr(bsdf, name, VertexColors(base.ravel() if isinstance(base, np.ndarray) else base))
        material.bsdf = bsdf
        if faint:
            material.alpha, material.alpha_cutoff = VertexColors(spec.alpha, channel=3), spec.cutoff
        spec.tinted[faint] = MaterialSpec(material, spec.emission, spec.two_sided)
    return spec.tinted[faint], True


def null_surface(name: str | None = None) -> Material:
    """Return the material of a surface that light passes as if it were not there: the border of a medium."""
    return Material(NullSurface(), alpha=0.0, name=name)


def build_material(
    wanted: dict[str, Any], normal_map: BaseNormalMap | None = None
) -> tuple[Material, list[str]]:
    """Return a material, and the names of the unsupported parameters.

    Parameters
    ----------
    wanted
        Parameters by name, without neutral values: those of `Principled`, `alpha` and `alpha_cutoff` of
        `Material`, and `absorption` of its interior. `base_color` is always included. Values are numbers,
        colors or textures.
    normal_map
        Of the material.
    """
    wanted = dict(wanted)
    alpha, cutoff = wanted.pop("alpha", None), wanted.pop("alpha_cutoff", None)
    absorption = wanted.pop("absorption", None)
    bsdf, lost = _build_bsdf(wanted)
    encloses = bsdf.transmissive and not wanted.get("thin")  # light travels through the interior
    interior = Medium(absorption) if encloses and absorption is not None else None
    return Material(bsdf, alpha=alpha, alpha_cutoff=cutoff, normal_map=normal_map, interior=interior), lost


def _build_bsdf(wanted: dict[str, Any]) -> tuple[Bsdf, list[str]]:
    """Return a BSDF, and the names of the parameters that it does not honor."""
    spread = wanted.pop("dispersion", None)
    lost = [name for name in wanted if name not in PARAMETERS]
    known = {name: value for name, value in wanted.items() if name in PARAMETERS}
    if known.keys() == {"base_color"}:
        return Diffuse(known["base_color"]), lost
    # for pure glass the BSDFs of glass are better: they can be smooth
    transmission = known.get("transmission", 0.0)
    if known.keys() <= GLASS and not isinstance(transmission, Texture) and transmission == 1:
        return _glass(known, spread or 0.0, lost), lost
    if spread is not None:
        lost.append("dispersion")
    return Principled(**known), lost


def _glass(known: dict[str, Any], spread: float, lost: list[str]) -> Bsdf:
    ior, roughness, tint = known.get("ior", 1.5), known.get("roughness", 0.5), known["base_color"]
    more = {name: known[name] for name in sorted(GLASS - PLAIN) if name in known}
    if known.get("thin"):
        lost += [name for name in FILM if more.pop(name, None) is not None]
        return ThinDielectric(ior, roughness, transmittance=tint, **more)
    half = (ior - 1) * 0.025 * spread  # KHR_materials_dispersion, "Implementation notes"
    index = (max(ior - half, 1.0), ior, ior + half) if half else ior
    return Dielectric(index, roughness, transmittance=tint, **more)


def from_srgb(colors: Table) -> Table:
    """Decode colors (n, k), rounded to 8 bits, to linear values; those outside [0, 1] are unchanged."""
    inside = (colors >= 0) & (colors <= 1)
    codes = np.rint(np.where(inside, colors, 0) * 255).astype(f4)
    return np.where(inside, srgb_to_linear(codes / f4(255)), colors)
