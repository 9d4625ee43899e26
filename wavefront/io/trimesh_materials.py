"""Materials of trimesh: those of its objects, and those that it makes of COLLADA's."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..bsdfs import Diffuse
from ..codecs.raster import codes_of
from ..core.errors import printable
from ..materials import Material
from ..textures.image import StoredImage, Texture
from ..textures.normal_map import NormalMap
from .description.appearance import MaterialSpec, build_material
from .description.mtl.entry import Entry
from .description.mtl.keywords import BUMPS
from .description.mtl.materials import MATTE, spec
from .description.parameters import METALLIC_ROUGHNESS, fill
from .losses import Losses

INVENTED = 102  # code of the colors of trimesh's SimpleMaterial where none are given


def material_spec(material: Any, losses: Losses, bare: bool = False) -> MaterialSpec:
    """Return the material of a trimesh `PBRMaterial` or `SimpleMaterial`.

    If `bare`, the colors and the exponent of the highlight count only if the material has its own `Kd`, `Ks`
    or `Ns`. Otherwise those that trimesh would write into a file count.
    """
    if hasattr(material, "baseColorFactor"):
        loaded = _pbr(material)
    elif hasattr(material, "diffuse"):
        loaded = _simple(material, f"trimesh material {material.name!r}", bare, losses)
    else:
        loaded = MaterialSpec(Material(Diffuse(MATTE)), lost=[type(material).__name__])
    name = getattr(material, "name", None)
    loaded.material.name = printable(str(name)) if name else None
    return loaded


def is_blank(material: Any) -> bool:
    """Return whether a material is trimesh's default for a mesh with only texture coordinates."""
    image = getattr(material, "image", None)
    plain = getattr(material, "kwargs", None) == {} and material.name in (None, "", "material_0")
    return (
        plain
        and image is not None
        and max(image.size) <= 2
        and not np.ptp(codes_of(image), axis=(0, 1)).any()
    )


def _picture(image: Any) -> StoredImage:
    """Return the stored values of a PIL image."""
    return StoredImage(codes_of(image), "image")


class _Textures:
    """The images of a material as textures; each is converted once."""

    def __init__(self, material: Any) -> None:
        self._material, self._stored = material, dict[str, StoredImage]()

    def __call__(self, name: str, **arguments: Any) -> Texture | None:
        """Return the texture of an image, None if there is none."""
        image = getattr(self._material, name)
        if image is None:
            return None
        if name not in self._stored:
            self._stored[name] = _picture(image)
        return Texture(self._stored[name], **arguments)


def _pbr(material: Any) -> MaterialSpec:
    """Read glTF's model; trimesh rounds its colors to 8 bits, and they are linear."""
    texture = _Textures(material)
    factor = np.asarray(_property(material, "baseColorFactor", np.full(4, 255))) / 255.0
    base = texture("baseColorTexture", scale=factor[:3])
    wanted: dict[str, Any] = {"base_color": factor[:3] if base is None else base}
    cutoff = float(_property(material, "alphaCutoff", 0.5)) if material.alphaMode == "MASK" else None
    alpha: Any = float(factor[3]) if material.alphaMode in ("MASK", "BLEND") else None
    if alpha is not None and base is not None and base.has_alpha:
        alpha = texture("baseColorTexture", srgb=False, channel=3, scale=alpha)
    if isinstance(alpha, Texture) or alpha not in (None, 1):
        wanted |= {"alpha": alpha, "alpha_cutoff": cutoff}
    fill(
        wanted,
        METALLIC_ROUGHNESS,
        lambda row: float(_property(material, row.theirs, row.default)),
        lambda row, value: (
            texture(row.image, srgb=False, channel=row.channel, scale=value) if value else None
        ),
    )
    built, lost = build_material(wanted, _normal_map(material))
    occluded = ["occlusionTexture"] if material.occlusionTexture is not None else []
    two_sided = bool(material.doubleSided)
    return MaterialSpec(built, _radiance(material, texture), two_sided, occluded + lost, alpha, cutoff)


def _radiance(material: Any, texture: _Textures) -> Any:
    glow = np.asarray(_property(material, "emissiveFactor", np.zeros(3)), np.float64)
    if not glow.any():
        return None
    varying = texture("emissiveTexture", scale=glow)
    return glow if varying is None else varying


def _normal_map(material: Any) -> NormalMap | None:
    bumps = material.normalTexture  # trimesh does not keep its scale
    if bumps is None or bumps.size == (1, 1):  # which is even, or in place of a missing image
        return None
    return NormalMap(Texture(_picture(bumps), False))


def _property(material: Any, name: str, default: Any) -> Any:
    """Return a property of a material, or its default where it is not given."""
    value = getattr(material, name)
    return default if value is None else value


def _simple(material: Any, where: str, bare: bool, losses: Losses) -> MaterialSpec:
    """Read an MTL material: trimesh keeps its lines as lists of words."""
    entry = Entry(where, str(material.name or ""), losses=losses)
    lines = {key: value for key, value in material.kwargs.items() if key != "name"}
    if not bare:
        plain = material.image is not None  # then a color that was not given is no factor of it
        for key, codes in (("kd", material.diffuse), ("ks", material.specular)):
            if plain and (np.asarray(codes)[:3] == INVENTED).all():
                continue
            lines.setdefault(key, [f"{code / 255:.8f}" for code in np.asarray(codes)[:3]])
        lines.setdefault("ns", f"{material.glossiness:.8f}")
    for key, value in lines.items():
        words = value if isinstance(value, list | tuple | np.ndarray) else [value]
        entry.lines[key.lower()] = (key, 0, " ".join(str(word) for word in words))
    if material.image is not None:
        entry.images["map_kd"] = _picture(material.image)
        entry.lines["map_kd"] = ("map_kd", 0, "image")
    # of the other images trimesh keeps only the names, without a folder
    gone = [key for key in entry.lines if _is_map(key) and key not in entry.images]
    gone = [entry.lines.pop(key)[0] for key in gone]
    loaded = spec(entry)
    loaded.lost = [*gone, *entry.unread(), *loaded.lost]
    return loaded


def _is_map(key: str) -> bool:
    return key.startswith("map_") or key in BUMPS
