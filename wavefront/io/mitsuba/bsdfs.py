"""BSDFs of Mitsuba as materials."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ...arrays.state import SurfaceInteraction
from ...arrays.vec import Bools, Floats, Ints, cross, dot, f4, normalize
from ...bsdfs import (
    Bsdf,
    Conductor,
    Dielectric,
    Diffuse,
    Disney,
    Mirror,
    Mix,
    Plastic,
    Sides,
    ThinDielectric,
    ThinDisney,
)
from ...core.errors import SceneError, in_brief, number, one_of
from ...materials import Material
from ...textures.base import BaseTexture
from ...textures.image import Texture
from ...textures.normal_map import BumpMap, NormalMap
from ..description.appearance import null_surface
from ..description.computed import at_least, computed, product
from ..description.entity import ABOVE_0, Entity, Limit
from ..spectra import INDICES, METALS
from .nodes import plugin, unsupported
from .textures import as_color, bitmap, color, roughness, scalar

LEAST_INDEX = 1e-6
BLACK = Diffuse(0)
BENT = 3e-3  # a little more than the cosine to which such normals are bent
HALF = "a pane that lets half of the light through"
MAPPED = "use_shadowing_function flip_invalid_normals"
# the back is black
ONE_SIDED = ("diffuse", "conductor", "roughconductor", "plastic", "roughplastic", "pplastic", "measured")


class ShadingFrameMap(NormalMap):
    """A normal map in the frame of Mitsuba: along u, along normal × u, and along the normal."""

    def perturbed(self, surface: SurfaceInteraction, normal: Floats) -> tuple[Ints, Floats]:
        """Return the lanes whose normals the image changes, (k,), and their new normals, (3, k)."""
        along: Floats = getattr(surface, self.reads[1])[:3]
        x, y, z = self.texture.at(surface) * f4(2) - f4(1)
        lanes = np.flatnonzero(((x != 0) | (y != 0)) & (dot(along, along) > 0))
        x, y, z = x.take(lanes), y.take(lanes), z.take(lanes)
        normal, along = normal.take(lanes, 1), along.take(lanes, 1)
        tangent = normalize(along - normal * dot(along, normal))
        return lanes, normalize(tangent * x + cross(normal, tangent) * y + normal * z)


class FacingSides(Sides):
    """A surface that is black on its back, and where its shading normals face away from the viewer.

    Elsewhere such normals are bent towards the viewer.
    """

    def _back_of(self, wo: Floats) -> Bools:
        return super()._back_of(wo) | (wo[2] < BENT)


def _named(entity: Entity, bsdf: Bsdf) -> Material:
    return Material(bsdf, name=entity.name or None)


@plugin("conductor", "bsdf", "material eta k specular_reflectance")
@plugin(
    "roughconductor",
    "bsdf",
    "material eta k specular_reflectance alpha alpha_u alpha_v distribution",
    harmless="sample_visible",
)
def _conductor(entity: Entity) -> Material:
    facets = _facets(entity) if entity.type == "roughconductor" else {}
    tint = color(entity, "specular_reflectance", 1.0)
    name = entity.or_default("none", lambda: _metal(entity))
    if "eta" in entity.values or name == "none":
        if entity.type == "conductor" and "eta" not in entity.values:
            return _named(entity, Mirror(tint))
        eta, k = (color(entity, parameter, to, "unbounded") for parameter, to in (("eta", 0.0), ("k", 1.0)))
        k = at_least(k, 0)
    else:
        base = name.removesuffix("_palik") if name not in METALS else name
        eta, k = METALS[base]
        if base != name:
            entity.lose(f"material {name!r}; {base!r} in its place")
    return _named(entity, Conductor(at_least(eta, LEAST_INDEX), k, reflectance=tint, **facets))


def _metal(entity: Entity) -> str:
    """Return the name of the metal, which may be none."""
    name = entity.text("material", "none")
    base = name.removesuffix("_palik") if name not in METALS else name
    return name if base in METALS else str(one_of("material", name, ("none", *METALS)))


@plugin("twosided", "bsdf", holds="bsdf", harmless="allow_transmission")
def _two_sided(entity: Entity) -> Material:
    front, *back = entity.children("bsdf") or [entity.only("bsdf")]
    material = _inner(front)
    if not back or back[0] is front:
        return material
    behind = _inner(back[0])
    if (behind.alpha, behind.normal_map) != (None, None):
        entity.lose("the mask or the normal map of its back")
    return entity.job.changed(material, bsdf=Sides(material.bsdf, behind.bsdf))


@plugin("mask", "bsdf", "opacity", holds="bsdf texture")
def _mask(entity: Entity) -> Material:
    material = _inner(entity.only("bsdf"))
    if material.alpha is not None:
        entity.lose("opacity, as there is another mask in it")
        return material
    return entity.job.changed(material, alpha=scalar(entity, "opacity", 0.5))


plugin("null", "bsdf")(lambda entity: null_surface(entity.name or None))
plugin("measured", "bsdf", "filename", note="spectra become RGB under D65")(
    lambda entity: _named(entity, entity.job.measured(entity))
)


@plugin("polarizer circular", "bsdf", "transmittance", harmless="theta polarizing left_handed", note=HALF)
@plugin("retarder", "bsdf", "transmittance", harmless="theta delta", note="as in scenes without polarization")
def _filter(entity: Entity) -> Material:
    """Return a pane that light passes straight: half of it, as light has no polarization here."""
    passing = color(entity, "transmittance", 1.0)
    passing = computed(product, passing, 1.0 if entity.type == "retarder" else 0.5)
    if isinstance(passing, BaseTexture) or np.ptp(passing) > 0:
        return _named(entity, ThinDielectric(1.0, transmittance=passing))
    return Material(Diffuse(0), alpha=1 - float(np.mean(passing)), name=entity.name or None)


@plugin("blendbsdf", "bsdf", "weight", holds="bsdf texture")
def _blend(entity: Entity) -> Material:
    bsdfs = entity.children("bsdf")
    if len(bsdfs) != 2:
        raise SceneError(f"holds {len(bsdfs)} bsdfs; it needs two")
    first, second = (_inner(bsdf) for bsdf in bsdfs)
    for material in (first, second):
        if material.alpha is not None or material.normal_map is not None:
            entity.lose("the mask or the normal map of a bsdf in it")
    lobes = [first.bsdf, second.bsdf] if is_one_sided(entity) else [_sided(bsdf) for bsdf in bsdfs]
    return _named(entity, Mix(lobes[0], lobes[1], scalar(entity, "weight", 0.5)))


@plugin("bumpmap", "bsdf", f"scale {MAPPED}", holds="bsdf texture", note="nearest texels have no slopes")
def _bump(entity: Entity) -> Material:
    image = entity.only("texture")
    return _mapped(entity, image, lambda heights: BumpMap(heights, entity.number("scale", 1.0)), "luminance")


@plugin("normalmap", "bsdf", f"normalmap {MAPPED}", holds="bsdf")
def _normal(entity: Entity) -> Material:
    image = entity.get("normalmap")
    if not isinstance(image, Entity) or image.kind != "texture":
        raise SceneError(f"normalmap is {in_brief(image)}; it must be a texture")
    return _mapped(entity, image, ShadingFrameMap, None)


unsupported("bsdf", "hair measured_polarized")


def _inner(entity: Entity) -> Material:
    """Return the material of a plugin in another, which has its mask."""
    material: Material = entity.job.convert(entity)
    return solid(material, entity.job)


def solid(material: Material, job: Any) -> Material:
    """Return a material that scatters where its mask is not 0: black in place of a null surface."""
    return job.changed(material, bsdf=BLACK) if material.bsdf.invisible else material


def _mapped(entity: Entity, image: Entity, make: Any, channel: Any) -> Material:
    """Return the material in a plugin, with a map of its normals."""
    material = _inner(entity.only("bsdf"))
    if material.normal_map is not None:
        entity.lose("the map, as there is another in its bsdf")
        return material
    if image.type == "bitmap":
        texture = bitmap(image, channel, plain=True)
    else:
        value = as_color(entity.job.convert(image), "albedo")
        if isinstance(value, BaseTexture) and (channel is not None or not isinstance(value, Texture)):
            entity.lose(f"a map by {image.type}")
            return material
        if not isinstance(value, Texture):
            value = Texture(np.broadcast_to(value, 3).astype(np.float32).reshape(1, 1, 3), channel=channel)
        texture = value
    if channel is not None and texture.filter == "nearest":
        return material  # steps have no slopes
    normal_map = make(texture)
    normal_map.folds_light = False
    normal_map.shadows_grazing = entity.flag("use_shadowing_function", True)
    normal_map.mirrors_hidden = entity.flag("flip_invalid_normals", True)
    if not normal_map.mirrors_hidden:
        entity.lose("flip_invalid_normals")
    return entity.job.changed(material, normal_map=normal_map)


def _ior(entity: Entity, name: str, default: str) -> float:
    """Return an index of refraction, given as a number or as the name of a material."""

    def read() -> float:
        value = entity.get(name, default)
        if isinstance(value, str):
            return INDICES[one_of(name, value.lower(), INDICES)]
        return number(name, value, *ABOVE_0)

    return entity.or_default(INDICES[default], read)


def _relative_index(entity: Entity) -> dict[str, Any]:
    inside = "polypropylene" if "plastic" in entity.type else "bk7"
    return {"ior": _ior(entity, "int_ior", inside) / _ior(entity, "ext_ior", "air")}


def _facets(entity: Entity) -> dict[str, Any]:
    """Return the parameters of microfacets."""
    anisotropic = "plastic" not in entity.type and bool({"alpha_u", "alpha_v"} & entity.values.keys())
    facets: dict[str, Any] = {
        "roughness": roughness(entity, "alpha_u" if anisotropic else "alpha", 0.1),
        "distribution": entity.choice("distribution", "beckmann", ("beckmann", "ggx")),
        "shadowing": "separable",
        "multiscatter": False,
    }
    return facets | ({"roughness_v": roughness(entity, "alpha_v", 0.1)} if anisotropic else {})


def _index_of_reflectance(entity: Entity) -> dict[str, Any]:
    """Return the index by specular, which is the normal reflectance over 0.08, where there is no eta."""
    if "eta" in entity.values:
        return {}
    specular = entity.number("specular", 0.5, Limit(lambda x: 0 <= x <= 1, "in [0, 1]"))
    root = np.sqrt(0.08 * specular)
    return {"ior": float((1 + root) / (1 - root))}


# arguments that follow from a parameter together with others
OTHERS: dict[str, Callable[[Entity], dict[str, Any]]] = {
    "int_ior": _relative_index,
    "distribution": _facets,
    "eta": lambda entity: {"ior": scalar(entity, "eta", 1.5, "unbounded")},
    "specular": _index_of_reflectance,
    "nonlinear": lambda entity: {"nonlinear": entity.flag("nonlinear")},
}


def _model(
    name: str,
    make: Callable[..., Bsdf],
    colors: str,
    numbers: str = "",
    others: str = "",
    harmless: str = "",
    note: str = "",
) -> None:
    """Put a BSDF into the table of plugins; words are `ours=theirs:default`, or `name:default`."""

    def split(words: str) -> list[tuple[str, str, float]]:
        partitions = [word.partition(":") for word in words.split()]
        return [(names.partition("=")[0], names.rpartition("=")[2], float(to)) for names, _, to in partitions]

    def convert(entity: Entity) -> Material:
        arguments = {ours: color(entity, theirs, default) for ours, theirs, default in split(colors)}
        arguments |= {
            ours: scalar(entity, theirs, default, "unbounded" if theirs == "diff_trans" else "albedo")
            for ours, theirs, default in split(numbers)
        }
        for other in others.split():
            arguments |= OTHERS[other](entity) if other in OTHERS else {}
        return _named(entity, make(**arguments))

    read = [theirs for _, theirs, _ in split(f"{colors} {numbers}")]
    plugin(name, "bsdf", f"{' '.join(read)} {others}", harmless=harmless, note=note)(convert)


INDEX, FACETS = "int_ior ext_ior", "alpha alpha_u alpha_v distribution"
TINTS = "reflectance=specular_reflectance:1 transmittance=specular_transmittance:1"
PLASTIC = "reflectance=diffuse_reflectance:0.5 specular_reflectance:1"
SHEEN = "anisotropic:0 transmission=spec_trans:0 specular_tint=spec_tint:0 sheen:0 sheen_tint:0 flatness:0"
_model("diffuse", Diffuse, "reflectance:0.5")
_model("dielectric", Dielectric, TINTS, others=INDEX)
_model("roughdielectric", Dielectric, TINTS, others=f"{INDEX} {FACETS}", harmless="sample_visible")
_model("thindielectric", ThinDielectric, TINTS, others=INDEX)
_model("plastic", Plastic, PLASTIC, others=f"nonlinear {INDEX}")
_model(
    "roughplastic",
    Plastic,
    PLASTIC,
    others=f"nonlinear {INDEX} alpha distribution",
    harmless="sample_visible",
)
_model(
    "pplastic",
    Plastic,
    PLASTIC,
    others=f"{INDEX} alpha distribution",
    harmless="sample_visible",
    note="as roughplastic, without polarization",
)
_model(
    "principled",
    Disney,
    "base_color:0.5",
    f"roughness:0.5 metallic:0 {SHEEN} clearcoat:0 clearcoat_gloss:0",
    "eta specular",
    "main_specular_sampling_rate clearcoat_sampling_rate diffuse_reflectance_sampling_rate",
)
_model(
    "principledthin",
    ThinDisney,
    "base_color:0.5",
    f"roughness:0.5 {SHEEN} diffuse_transmission=diff_trans:0",
    "eta",
    harmless="diffuse_reflectance_sampling_rate specular_reflectance_sampling_rate "
    "diffuse_transmittance_sampling_rate specular_transmittance_sampling_rate",
)


def is_one_sided(entity: Entity) -> bool:
    """Return whether the back of a BSDF is black."""
    if entity.type in ("mask", "bumpmap", "normalmap", "blendbsdf"):
        return all(is_one_sided(child) for child in entity.children("bsdf"))
    if entity.type == "principled":
        passing = entity.values.get("spec_trans", 0.0)
        return isinstance(passing, int | float) and passing == 0
    return entity.type in ONE_SIDED


def _sided(entity: Entity) -> Bsdf:
    """Return the BSDF of a plugin, whose back is black where Mitsuba has it so."""
    bsdf = _inner(entity).bsdf
    return Sides(bsdf) if is_one_sided(entity) else bsdf
