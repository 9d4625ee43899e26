"""The material of the lines of MTL, by the rules that `wavefront.io.mtl` lists."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ....arrays.vec import Doubles
from ....bsdfs import Dielectric, Diffuse, Mirror
from ....core.errors import SceneError, exact
from ....materials import Material
from ....textures.normal_map import BaseNormalMap, BumpMap, NormalMap
from ..appearance import MaterialSpec, build_material
from ..parameters import fill
from .entry import Entry
from .keywords import BUMPS, PBR, Kind

# values of `illum`
GLASS = (4, 6, 7, 9)
MIRROR = (3, 5, 8)
NO_HIGHLIGHT = (0, 1)
LARGEST_ILLUM = 9

GLASS_IOR = 1.5
MATTE = 0.5  # default reflectance
KS_F0 = 0.08  # the reflectance of `Ks 1`
LARGEST_NS = 1000.0
LEAST_F0 = 0.02  # of dielectrics; a lower reflectance is weaker at all angles


def spec(entry: Entry) -> MaterialSpec:
    """Convert one entry to a material; the keywords that it uses are added to `entry.read`."""
    entry.mend()
    factor = entry.color("ke", 0.0)
    if "map_ke" in entry.lines and not factor.any():
        factor = np.ones(3)
    texture = entry.texture("map_ke", factor)
    radiance = texture if texture is not None else factor if factor.any() else None
    material, lost = _material(entry)
    material.normal_map = _normal_or_bump_map(entry)
    return MaterialSpec(material, radiance, lost=lost)


def _material(entry: Entry) -> tuple[Material, list[str]]:
    illum = int(entry.number("illum", 2))
    if not 0 <= illum <= LARGEST_ILLUM:
        entry.read.discard("illum")
    ior = entry.number("ni", 1.0)
    extended = any(entry.has(row.theirs, row.image) for row in PBR)
    if _is_glass(entry, illum, ior):
        return Material(_glass(entry)), []
    if illum in MIRROR and not extended and "ks" in entry.lines and entry.color("ks", 0.0).any():
        return Material(Mirror(entry.color("ks", 0.0)), alpha=_alpha(entry)), []
    physical = entry.has("pr", "map_pr", "pm", "map_pm")
    wanted = _gloss(entry, illum, physical) | _wanted(entry)
    material, lost = build_material(wanted)
    if type(material.bsdf) is not Diffuse and not physical and "roughness" not in wanted:
        # a default gloss would be an invention if the file has none
        material, lost = build_material({**wanted, "roughness": 1.0, "specular": 0.0})
    return material, lost


def _is_glass(entry: Entry, illum: int, ior: float) -> bool:
    if _opacity(entry) < 1 and ior != 1 and "map_d" not in entry.lines:
        return True
    if illum not in GLASS or "tf" in entry.lines or ior != 1 or _opacity(entry) < 1:
        return illum in GLASS
    kd = entry.color("kd", 0.0)
    return not ("map_kd" in entry.lines or "d" in entry.lines or kd.any())


def _gloss(entry: Entry, illum: int, physical: bool) -> dict[str, Any]:
    """Return the parameters of `Principled` for the gloss of `Ks` and `Ns`, if there is one."""
    color = _highlight(entry, illum)
    gloss: dict[str, Any] = {}
    if color.any():
        gloss = _specular(entry, float(color.max()))
        if np.ptp(color):
            gloss["specular_color"] = color / color.max()
    if color.any() or (physical and "ns" in entry.lines):
        gloss["roughness"] = 1 - float(np.sqrt(_exponent(entry) / LARGEST_NS))
    return gloss


def _highlight(entry: Entry, illum: int) -> Doubles:
    """Return `Ks`, black where there is no highlight."""
    if illum in NO_HIGHLIGHT or entry.number("ns", LARGEST_NS) == 0:
        entry.read.update(("ks", "map_ks", "map_ns"))
        return np.zeros(3)
    color = entry.color("ks", 0.0)
    return np.ones(3) if "map_ks" in entry.lines and not color.any() else color


def _exponent(entry: Entry) -> float:
    """Return `Ns`, clamped to [0, `LARGEST_NS`]: larger values do not sharpen the highlight."""
    value = entry.number("ns", 0.0)
    if value < 0:
        entry.note("ns", exact(value), "clamped, as it must be at least 0")
    return min(max(value, 0.0), LARGEST_NS)


def _specular(entry: Entry, strength: float) -> dict[str, Any]:
    """Return the index and the strength of a gloss whose largest reflectance is `KS_F0` · `strength`."""
    f0 = KS_F0 * strength
    weight = min(f0 / LEAST_F0, 1.0)
    root = float(np.sqrt(f0 / weight))
    texture = entry.texture("map_ks", weight)
    return {"ior": (1 + root) / (1 - root), "specular": weight if texture is None else texture}


def _wanted(entry: Entry) -> dict[str, Any]:
    """Return the parameters of `Principled` in a file."""
    wanted: dict[str, Any] = {"base_color": _base(entry)}
    fill(
        wanted,
        PBR,
        lambda row: entry.clamped(row.theirs, row.default) if entry.has(row.theirs) else None,
        lambda row, factor: entry.texture(row.image, factor),
    )
    return wanted | {"alpha": _alpha(entry)}


def _base(entry: Entry) -> Any:
    color = entry.color("kd", 1.0 if "map_kd" in entry.lines else MATTE)
    texture = entry.texture("map_kd", color if color.any() else 1.0)
    return entry.color("kd", MATTE) if texture is None else texture


def _glass(entry: Entry) -> Dielectric:
    _opacity(entry)
    ior = entry.number("ni", GLASS_IOR)
    entry.read.update(("d", "tr", "kd"))  # glass has no matte part, but files give it a Kd
    return Dielectric(ior, entry.clamped("pr", 0.0), transmittance=entry.color("tf", 1.0))


def _alpha(entry: Entry) -> Any:
    """Return the opacity: a number or a texture."""
    factor = _opacity(entry)
    entry.read.update(("d", "tr"))
    texture = entry.texture("map_d", factor)
    return factor if texture is None else texture


def _opacity(entry: Entry) -> float:
    """Return the opacity in [0, 1] from `d`, else from `Tr`."""
    if "d" in entry.lines:
        value = entry.number("d", 1.0)
        entry.read.add("tr")
    else:
        clear = entry.number("tr", 0.0)
        value = 1.0 if clear == 1 else 1.0 - clear
    if value == 1:
        entry.read.update(("d", "tr"))
    else:  # only keywords that the material then uses count as read
        entry.read.difference_update(("d", "tr"))
    return value


def _normal_or_bump_map(entry: Entry) -> BaseNormalMap | None:
    """Return the normal map or bump map. If there are both, only `norm` is read."""
    for key in BUMPS:
        if key in entry.lines:
            is_normal = key == "norm" or _looks_like_normals(entry, key)
            bumps = _bumps(entry, key, _normal_map if is_normal else _bump_map)
            if bumps is not None:
                return bumps
    return None


def _bumps(
    entry: Entry, key: str, make: Callable[[Entry, str], BaseNormalMap | None]
) -> BaseNormalMap | None:
    try:
        return make(entry, key)
    except SceneError as error:
        entry.leave_out(key, error)
        return None


def _normal_map(entry: Entry, key: str) -> NormalMap | None:
    texture = entry.texture(key, kind=Kind.DATA)
    return None if texture is None else NormalMap(texture, entry.multiplier(key))


def _bump_map(entry: Entry, key: str) -> BumpMap | None:
    texture = entry.texture(key)
    return None if texture is None else BumpMap(texture, entry.multiplier(key))


def _looks_like_normals(entry: Entry, key: str) -> bool:
    """Return whether the mean of an image is about (0.5, 0.5, 1), as in normal maps."""
    if "-imfchan" in entry.image(key).options:
        return False
    texture = entry.texture(key, kind=Kind.DATA)
    if texture is None or texture.channels < 3:
        return False
    red, green, blue = texture.mean()
    return abs(red - 0.5) < 0.1 and abs(green - 0.5) < 0.1 and blue > 0.75
