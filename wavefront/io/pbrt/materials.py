"""Materials of pbrt."""

from __future__ import annotations

from collections.abc import Callable
from copy import copy
from typing import Any

import numpy as np

from ...arrays.elementary import exp
from ...arrays.vec import f4
from ...bsdfs import (
    Bsdf,
    Conductor,
    Dielectric,
    Diffuse,
    DiffuseTransmission,
    Mix,
    Plastic,
    Principled,
    ThinDielectric,
)
from ...bsdfs.fresnel import fresnel_dielectric
from ...core.errors import SceneError
from ...materials import Material
from ...media import GridMedium, HenyeyGreenstein, Medium
from ...textures.base import BaseTexture
from ...textures.image import Texture
from ...textures.normal_map import BumpMap, NormalMap
from ..description.appearance import null_surface
from ..description.computed import Value, at_least, clipped, computed
from ..description.conversion import GRAY
from ..description.entity import Entity
from .entities import NAMED, converts, placement, spectrum, unsupported
from .textures import color, fourth_root, scalar, square_root

LEAST_INDEX = 1e-6
CELLS = 1024  # of the cosine, for integrals over directions


def _albedo(entity: Entity, name: str, default: float, factor: float = 1.0) -> Value:
    """Return a reflectance times a factor."""
    return clipped(color(entity, name, default), factor)


def _roughness(entity: Entity, prefix: str = "") -> dict[str, Value]:
    """Return the roughness, α = roughness², along u and v."""
    root = fourth_root if entity.flag("remaproughness", True) else square_root
    names = [f"{prefix}{axis}roughness" for axis in ("u", "v")]
    base = scalar(entity, f"{prefix}roughness", 0.0)
    u, v = (scalar(entity, name, 0.0) if name in entity.values else base for name in names)
    u, v = (
        value
        if isinstance(value, BaseTexture)
        else float(entity.lost.within(f"{prefix}roughness", value, 0, np.inf, entity.label))
        for value in (u, v)
    )
    if u is v or (not isinstance(u, BaseTexture) and u == v):
        return {"roughness": computed(root, u)}
    return {"roughness": computed(root, u), "roughness_v": computed(root, v)}


def _index(entity: Entity, name: str, default: float = 1.5) -> Any:
    """Return an index of refraction: a number, or one for each channel."""
    value = np.maximum(spectrum(entity, name, default, "unbounded"), LEAST_INDEX)
    return float(value) if np.ndim(value) == 0 else value


def _with_bumps(entity: Entity, bsdf: Any) -> Material:
    """Return a material with the bumps of its entity."""
    bumps: Any = None
    file = entity.text("normalmap", "")
    if file:
        bumps = NormalMap(Texture(entity.job.picture(entity, file), srgb=False))
    height = scalar(entity, "displacement", 0.0)
    if isinstance(height, Texture) and not file:
        heights = copy(height)
        heights.srgb = False  # it is decoded all the same
        bumps = BumpMap(heights)
    elif isinstance(height, BaseTexture):
        entity.lose("displacement")
    if bumps is not None:
        bumps.folds_light = False
    return Material(bsdf, normal_map=bumps, name=entity.name or None)


def _surface(types: str, harmless: str = "") -> Callable[[Callable[[Entity], Bsdf]], Any]:
    """Put a function that returns the BSDF of materials into the table."""
    add = converts("material", types, harmless=harmless)
    return lambda make: add(lambda entity: _with_bumps(entity, make(entity)))


@_surface("coateddiffuse subsurface", harmless="maxdepth nsamples")
def _coated_diffuse(entity: Entity) -> Plastic:
    below = entity.type == "subsurface"
    if below:
        entity.harmless("mfp sigma_a sigma_s scale name g")
        entity.lose("light below the surface; a coated diffuse surface in its place")
    ior = float(np.mean(_index(entity, "eta", 1.33 if below else 1.5)))
    facets = _roughness(entity)
    if facets.pop("roughness_v", None) is not None:
        entity.lose("vroughness")
    thick = 0.0 if below else _layer(entity)
    base = _albedo(entity, "reflectance", 0.5)
    if thick:
        base = computed(_below_coat, base, *_coat(thick, ior))
    return Plastic(base, ior=ior, nonlinear=True, multiscatter=False, **facets)


def _coat(thickness: float, ior: float) -> tuple[float, ...]:
    """Return the parts of light that an absorbing coat lets in and out, and it and a clear one reflect."""
    cos = (np.arange(CELLS) + 0.5) / CELLS
    inside = fresnel_dielectric(cos.astype(f4), np.full(1, 1 / ior, f4))[0].astype(float)
    refracted = np.sqrt(np.maximum(1 - (1 - cos * cos) / ior**2, 1e-9))
    transmitted = exp((-thickness / refracted).astype(f4))
    once = exp((-thickness / cos).astype(f4)).astype(float)
    factors = (transmitted, once * (1 - inside), once * once * inside, inside)  # weighted by the cosine
    return tuple(float((2 * cos * factor).mean()) for factor in factors)


def _below_coat(base: Any, entry: Any, leaving: Any, back: Any, clear: Any) -> Any:
    """Return the base that reflects as much below a clear coat as this base below its absorbing coat."""
    out = entry * leaving * base / (1 - back * base)
    return out / (1 - clear + clear * out)


def _layer(entity: Entity) -> float:
    """Return the thickness of the medium between two layers; it only absorbs."""
    for name in ("albedo", "g"):
        value = color(entity, name, 0.0)
        if isinstance(value, BaseTexture) or np.any(value):
            entity.lose(name)
    thick = scalar(entity, "thickness", 0.01)
    if isinstance(thick, BaseTexture):
        entity.lose("the texture thickness; 0.01 in its place")
        return 0.01
    return max(thick, 0.0)


@_surface("coatedconductor", harmless="maxdepth nsamples")
def _coated_conductor(entity: Entity) -> Principled:
    """Return a metal with a clear coat; its reflectance is that inside of the coat."""
    eta, k = _metal(entity, "conductor.")
    _layer(entity)
    coat, metal = (_roughness(entity, f"{name}.") for name in ("interface", "conductor"))
    ior = float(np.mean(_index(entity, "interface.eta")))
    entity.lose("the light between its layers; a metal with a clearcoat in its place")
    base = computed(_reflectance, eta, k, ior, rising=False)
    return Principled(
        base, 1.0, clearcoat=1.0, clearcoat_roughness=coat["roughness"], **metal, multiscatter=False
    )


def _reflectance(eta: Any, k: Any, ior: Any = 1.0) -> Any:
    """Return the reflectance of a metal at normal incidence, in a clear material of index `ior`."""
    n, k2 = eta / ior, (k / ior) ** 2
    return ((n - 1) ** 2 + k2) / ((n + 1) ** 2 + k2)


def _extinction(reflectance: Any) -> Any:
    """Return k of a conductor of index 1 that has this reflectance."""
    reflected = np.clip(reflectance, 0, 0.9999)
    return 2 * np.sqrt(reflected) / np.sqrt(1 - reflected)


def _metal(entity: Entity, prefix: str) -> tuple[Value, Value]:
    """Return η and k, given as such or by a reflectance."""
    if "reflectance" in entity.values:
        if {f"{prefix}eta", f"{prefix}k"} & entity.values.keys():
            raise SceneError(f"has reflectance, and {prefix}eta or {prefix}k; give one of them")
        return 1.0, computed(_extinction, color(entity, "reflectance", 0.5))
    eta, k = (
        color(entity, f"{prefix}{name}", NAMED[f"metal-Cu-{name}"], "unbounded") for name in ("eta", "k")
    )
    return at_least(eta, LEAST_INDEX), k


_surface("diffuse")(lambda entity: Diffuse(_albedo(entity, "reflectance", 0.5)))
_surface("measured")(lambda entity: entity.job.measured(entity))
_surface("conductor")(lambda entity: Conductor(*_metal(entity, ""), **_roughness(entity), multiscatter=False))
_surface("dielectric")(
    lambda entity: Dielectric(_index(entity, "eta"), **_roughness(entity), multiscatter=False)
)
_surface("thindielectric")(lambda entity: ThinDielectric(float(np.mean(_index(entity, "eta")))))


@_surface("diffusetransmission")
def _diffuse_transmission(entity: Entity) -> DiffuseTransmission:
    factor = entity.number("scale", 1.0)
    sides = (_albedo(entity, name, 0.25, factor) for name in ("reflectance", "transmittance"))
    return DiffuseTransmission(*sides)


@_surface("mix")
def _mix(entity: Entity) -> Mix:
    names, materials = entity.get("materials", None, "string") or [], list[Material]()
    for name in names[:2]:
        with entity.lost.part(entity.label):
            materials.append(entity.job.convert(entity.job.refer("material", name)))
    if len(materials) == 1:
        entity.lose(f"{names} has one material that there is; it needs two")
        materials *= 2
    if len(materials) != 2:
        raise SceneError(f"materials names {len(names)} materials; it needs two that there are")
    first, second = materials
    if first.bsdf.invisible or second.bsdf.invisible:
        raise SceneError("materials has an 'interface'; it cannot be mixed")
    if first.normal_map is not None or second.normal_map is not None:
        entity.lose("the bumps of its materials")
    return Mix(first.bsdf, second.bsdf, scalar(entity, "amount", 0.5))


converts("material", "interface none")(lambda entity: null_surface(entity.name or None))


@_surface("hair")
def _hair(entity: Entity) -> Diffuse:
    entity.lose("a diffuse surface in its place")
    return Diffuse(_albedo(entity, "color" if "color" in entity.values else "reflectance", 0.5))


@converts("medium", "homogeneous")
def _homogeneous(entity: Entity) -> Medium | None:
    if entity.text("preset", ""):
        entity.lose("preset; left out")
        return None
    absorbed, scattered = (spectrum(entity, name, 1.0, "unbounded") for name in ("sigma_a", "sigma_s"))
    glow = spectrum(entity, "Le", 0.0, "light") * (entity.number("Lescale", 1.0) * entity.job.exposure)
    return Medium(
        absorbed,
        scattered,
        phase=HenyeyGreenstein(entity.number("g", 0.0)),
        scale=entity.number("scale", 1.0),
        emission=glow * absorbed,
    )


@converts("medium", "uniformgrid")
def _grid(entity: Entity) -> GridMedium:
    density = _voxels(entity, "density", "float")
    if density is None:
        raise SceneError("has no density")
    absorbed, scattered = (spectrum(entity, name, 1.0, "unbounded") for name in ("sigma_a", "sigma_s"))
    glow = spectrum(entity, "Le", 0.0, "light") * entity.job.exposure * absorbed
    factor = _voxels(entity, "Lescale", "float")
    if factor is not None:
        glow = (density * factor)[..., None] * np.broadcast_to(glow, 3)
    return GridMedium(density, **_placed(entity), absorption=absorbed, scattering=scattered, emission=glow)


@converts("medium", "rgbgrid")
def _color_grid(entity: Entity) -> GridMedium:
    absorbed, scattered, light = (_voxels(entity, name, "rgb") for name in ("sigma_a", "sigma_s", "Le"))
    grids = [grid for grid in (absorbed, scattered) if grid is not None]
    if not grids:
        raise SceneError("has no sigma_a and no sigma_s")
    absorbed, scattered = (np.ones_like(grids[0]) if grid is None else grid for grid in (absorbed, scattered))
    factor = entity.number("Lescale", 1.0) * entity.job.exposure
    extinction = absorbed + scattered
    return GridMedium(
        extinction,
        **_placed(entity),
        albedo=scattered / np.where(extinction == 0, 1, extinction),
        emission=None if light is None else absorbed * light * factor,
    )


def _placed(entity: Entity) -> dict[str, Any]:
    """Return where a grid is, and its phase function and scale."""
    low, high = entity.vector("p0", (0.0, 0.0, 0.0)), entity.vector("p1", (1.0, 1.0, 1.0))
    box = np.diag([*(high - low), 1.0])
    box[:3, 3] = low
    phase, scale = HenyeyGreenstein(entity.number("g", 0.0)), entity.number("scale", 1.0)
    return {"transform": placement(entity) @ box, "phase": phase, "scale": scale}


def _voxels(entity: Entity, name: str, kind: str) -> Any:
    """Return the numbers (z, y, x) or colors (z, y, x, 3) of a grid; None without."""
    size = tuple(entity.whole(axis, 1, 1) for axis in ("nz", "ny", "nx"))
    voxels, count = entity.get(name, None, kind), np.prod(size, dtype=float)
    if voxels is None:
        return None
    if len(voxels) != count:
        what = "numbers" if kind == "float" else "colors"
        raise SceneError(f"{name} has {len(voxels)} {what}; nx, ny and nz make {count:g}")
    return voxels.reshape(*size, *voxels.shape[1:])


unsupported("medium", "cloud nanovdb")


def material_of(shape: Entity, alpha: Value) -> Material:
    """Return the material of a shape, with its opacity and its medium."""
    state, job, losses = shape.state, shape.job, shape.lost
    material, inside, outside = state.material, None, None
    if isinstance(material, str):
        name, material = material, None
        with losses.part(shape.label, done="gray in its place"):
            material = job.refer("material", name)
    base: Material = GRAY if material is None else job.convert(material)
    if state.inside != state.outside:
        with losses.part(shape.label):
            inside = job.medium(state.inside)
        with losses.part(shape.label):
            outside = job.medium(state.outside)
    if outside not in (None, job.around) and state.outside not in job.insides:
        shape.lose(f"the medium {state.outside!r} outside")
    if alpha is None and inside is None:
        return base
    changed: Material = job.changed(base, interior=inside, alpha=alpha)
    return changed
