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
from ..description.computed import computed, product
from ..spectra import INDICES, METALS
from .nodes import Job, Node, plugin, unsupported
from .textures import as_color, bitmap, color, roughness, scalar

LEAST_INDEX = 1e-6
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


def _named(node: Node, bsdf: Bsdf) -> Material:
    return Material(bsdf, name=node.id or None)


@plugin("conductor", "bsdf", "material eta k specular_reflectance")
@plugin(
    "roughconductor",
    "bsdf",
    "material eta k specular_reflectance alpha alpha_u alpha_v distribution",
    harmless="sample_visible",
)
def _conductor(node: Node, job: Job) -> Material:
    facets = _facets(node, job) if node.plugin == "roughconductor" else {}
    tint = color(node, "specular_reflectance", 1.0, job)
    name = node.or_default("none", lambda: _metal(node))
    if "eta" in node.values or name == "none":
        if node.plugin == "conductor" and "eta" not in node.values:
            return _named(node, Mirror(tint))
        eta, k = (color(node, each, to, job, "unbounded") for each, to in (("eta", 0.0), ("k", 1.0)))
        eta = eta if isinstance(eta, BaseTexture) else np.maximum(eta, LEAST_INDEX)
        k = k if isinstance(k, BaseTexture) else np.maximum(k, 0)
    else:
        base = name.removesuffix("_palik") if name not in METALS else name
        eta, k = METALS[base]
        if base != name:
            node.lose(f"material {name!r}; {base!r} in its place")
        eta = np.maximum(eta, LEAST_INDEX)
    return _named(node, Conductor(eta, k, reflectance=tint, **facets))


def _metal(node: Node) -> str:
    """Return the name of the metal, which may be none."""
    name = node.text("material", "none")
    base = name.removesuffix("_palik") if name not in METALS else name
    return name if base in METALS else str(one_of("material", name, ("none", *METALS)))


@plugin("twosided", "bsdf", holds="bsdf", harmless="allow_transmission")
def _two_sided(node: Node, job: Job) -> Material:
    front, *back = node.held("bsdf") or [job.only(node, "bsdf")]
    material = _inner(front, job)
    if not back or back[0] is front:
        return material
    behind = _inner(back[0], job)
    if (behind.alpha, behind.normal_map) != (None, None):
        node.lose("the mask or the normal map of its back")
    return job.changed(material, bsdf=Sides(material.bsdf, behind.bsdf))


@plugin("mask", "bsdf", "opacity", holds="bsdf texture")
def _mask(node: Node, job: Job) -> Material:
    material = _inner(job.only(node, "bsdf"), job)
    if material.alpha is not None:
        node.lose("opacity, as there is another mask in it")
        return material
    return job.changed(material, alpha=scalar(node, "opacity", 0.5, job))


plugin("null", "bsdf")(lambda node, job: Material(Diffuse(0), alpha=0.0, name=node.id or None))
plugin("measured", "bsdf", "filename", note="spectra become RGB under D65")(
    lambda node, job: _named(node, job.measured(node))
)


@plugin("polarizer circular", "bsdf", "transmittance", harmless="theta polarizing left_handed", note=HALF)
@plugin("retarder", "bsdf", "transmittance", harmless="theta delta", note="as in scenes without polarization")
def _filter(node: Node, job: Job) -> Material:
    """Return a pane that light passes straight: half of it, as light has no polarization here."""
    passing = color(node, "transmittance", 1.0, job)
    passing = computed(product, passing, 1.0 if node.plugin == "retarder" else 0.5)
    if isinstance(passing, BaseTexture) or np.ptp(passing) > 0:
        return _named(node, ThinDielectric(1.0, transmittance=passing))
    return Material(Diffuse(0), alpha=1 - float(np.mean(passing)), name=node.id or None)


@plugin("blendbsdf", "bsdf", "weight", holds="bsdf texture")
def _blend(node: Node, job: Job) -> Material:
    parts = node.held("bsdf")
    if len(parts) != 2:
        raise SceneError(f"holds {len(parts)} bsdfs; it needs two")
    first, second = (_inner(part, job) for part in parts)
    for part in (first, second):
        if part.alpha is not None or part.normal_map is not None:
            node.lose("the mask or the normal map of a bsdf in it")
    one, two = [first.bsdf, second.bsdf] if is_one_sided(node) else [_sided(part, job) for part in parts]
    return _named(node, Mix(one, two, scalar(node, "weight", 0.5, job)))


@plugin("bumpmap", "bsdf", f"scale {MAPPED}", holds="bsdf texture", note="nearest texels have no slopes")
def _bump(node: Node, job: Job) -> Material:
    image = job.only(node, "texture")
    return _mapped(node, job, image, lambda heights: BumpMap(heights, node.number("scale", 1.0)), "luminance")


@plugin("normalmap", "bsdf", f"normalmap {MAPPED}", holds="bsdf")
def _normal(node: Node, job: Job) -> Material:
    image = node.get("normalmap")
    if not isinstance(image, Node) or image.kind != "texture":
        raise SceneError(f"normalmap is {in_brief(image)}; it must be a texture")
    return _mapped(node, job, image, ShadingFrameMap, None)


unsupported("hair measured_polarized", "bsdf")


def _inner(node: Node, job: Job) -> Material:
    material: Material = job.convert(node)
    return material


def _mapped(node: Node, job: Job, image: Node, make: Any, channel: Any) -> Material:
    """Return the material in a plugin, with a map of its normals."""
    material = _inner(job.only(node, "bsdf"), job)
    if material.normal_map is not None:
        node.lose("the map, as there is another in its bsdf")
        return material
    if image.plugin == "bitmap":
        texture = bitmap(image, job, channel, plain=True)
    else:
        value = as_color(job.convert(image), "albedo")
        if isinstance(value, BaseTexture) and (channel is not None or not isinstance(value, Texture)):
            node.lose(f"a map by {image.plugin}")
            return material
        if not isinstance(value, Texture):
            value = Texture(np.broadcast_to(value, 3).astype(np.float32).reshape(1, 1, 3), channel=channel)
        texture = value
    if channel is not None and texture.filter == "nearest":
        return material  # steps have no slopes
    normal_map = make(texture)
    normal_map.folds_light = False
    normal_map.shadows_grazing = node.flag("use_shadowing_function", True)
    normal_map.mirrors_hidden = node.flag("flip_invalid_normals", True)
    if not normal_map.mirrors_hidden:
        node.lose("flip_invalid_normals")
    return job.changed(material, normal_map=normal_map)


def _ior(node: Node, name: str, default: str) -> float:
    """Return an index of refraction, given as a number or as the name of a material."""

    def read() -> float:
        value = node.get(name, default)
        if isinstance(value, str):
            return INDICES[one_of(name, value.lower(), INDICES)]
        return number(name, value, lambda x: x > 0, "above 0")

    return node.or_default(INDICES[default], read)


def _relative_index(node: Node, job: Job) -> dict[str, Any]:
    inside = "polypropylene" if "plastic" in node.plugin else "bk7"
    return {"ior": _ior(node, "int_ior", inside) / _ior(node, "ext_ior", "air")}


def _facets(node: Node, job: Job) -> dict[str, Any]:
    """Return the parameters of microfacets."""
    both = "plastic" not in node.plugin and bool({"alpha_u", "alpha_v"} & node.values.keys())
    facets: dict[str, Any] = {
        "roughness": roughness(node, "alpha_u" if both else "alpha", 0.1, job),
        "distribution": node.choice("distribution", "beckmann", ("beckmann", "ggx")),
        "shadowing": "separable",
        "multiscatter": False,
    }
    return facets | ({"roughness_v": roughness(node, "alpha_v", 0.1, job)} if both else {})


def _index_of_reflectance(node: Node, job: Job) -> dict[str, Any]:
    """Return the index by specular, which is the normal reflectance over 0.08, where there is no eta."""
    if "eta" in node.values:
        return {}
    part = node.number("specular", 0.5, lambda x: 0 <= x <= 1, "in [0, 1]")
    root = np.sqrt(0.08 * part)
    return {"ior": float((1 + root) / (1 - root))}


# what a parameter, with others, becomes in a way of its own
OTHERS: dict[str, Callable[[Node, Job], dict[str, Any]]] = {
    "int_ior": _relative_index,
    "distribution": _facets,
    "eta": lambda node, job: {"ior": scalar(node, "eta", 1.5, job, "unbounded")},
    "specular": _index_of_reflectance,
    "nonlinear": lambda node, job: {"nonlinear": node.flag("nonlinear")},
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
        parts = [word.partition(":") for word in words.split()]
        return [(names.partition("=")[0], names.rpartition("=")[2], float(to)) for names, _, to in parts]

    def convert(node: Node, job: Job) -> Material:
        found = {ours: color(node, theirs, default, job) for ours, theirs, default in split(colors)}
        found |= {
            ours: scalar(node, theirs, default, job, "unbounded" if theirs == "diff_trans" else "albedo")
            for ours, theirs, default in split(numbers)
        }
        for each in others.split():
            found |= OTHERS[each](node, job) if each in OTHERS else {}
        return _named(node, make(**found))

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


def is_one_sided(node: Node) -> bool:
    """Return whether the back of a BSDF is black."""
    if node.plugin in ("mask", "bumpmap", "normalmap", "blendbsdf"):
        return all(is_one_sided(part) for part in node.held("bsdf"))
    if node.plugin == "principled":
        passing = node.values.get("spec_trans", 0.0)
        return isinstance(passing, int | float) and passing == 0
    return node.plugin in ONE_SIDED


def _sided(node: Node, job: Job) -> Bsdf:
    """Return the BSDF of a plugin, whose back is black where Mitsuba has it so."""
    bsdf = _inner(node, job).bsdf
    return Sides(bsdf) if is_one_sided(node) else bsdf
