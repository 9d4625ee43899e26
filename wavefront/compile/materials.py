"""The materials of a scene, numbered, grouped and tabulated."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy

import numpy as np

from ..arrays.soa import soa
from ..arrays.state import SurfaceInteraction
from ..arrays.vec import Bools, Floats, Ints, f4
from ..bsdfs import Bsdf
from ..core.errors import SceneError, warn_caller
from ..core.plural import plural
from ..materials import Material, Opacity
from ..shapes import CurvedShape, Instance, Mesh, Shape
from ..shapes.attributes import ATTRIBUTES
from ..shapes.instance import kinds_of
from ..textures.base import BaseTexture
from ..textures.normal_map import BaseNormalMap


@soa
class ParameterTable(BaseTexture):
    """The values of one parameter for the BSDFs of many materials, one column per material."""

    table: Floats  # (c, materials)

    def at(self, surface: SurfaceInteraction) -> Floats:
        """Return the values of the hit points' materials, (c, n)."""
        return self.table.take(surface.material, -1)


@soa
class MaterialTable:
    """The materials of a scene: BSDFs, gathered into groups that are shaded together, and normal maps."""

    group_of: Ints  # (materials,) the group of each material
    groups: tuple[Bsdf, ...]  # groups that are `specular` come last
    normal_map_of: Ints  # (materials,) the normal map of each material, -1 for none
    normal_maps: tuple[BaseNormalMap, ...]
    dispersive: bool = False  # some group is


@soa
class Opacities:
    """The opacities of a scene's surfaces (alpha)."""

    has_alpha: Bools  # (m + k + 1,) of primitives; the last entry, False, is for a miss
    constant: Floats  # (materials,) opacity of each material; 1 where it varies
    varying: list[tuple[int, Opacity]]  # materials whose opacity varies

    def at(self, surface: SurfaceInteraction) -> Floats:
        """Return the opacities at hit points, (n,), in [0, 1]."""
        alpha = self.constant.take(surface.material)
        for material, opacity in self.varying:
            lanes = np.flatnonzero(surface.material == material)
            if lanes.size:
                alpha[lanes] = opacity.at(surface.take(lanes))
        return alpha


def group_materials(materials: Sequence[Material]) -> MaterialTable:
    """Merge BSDFs that differ only in the values of constant parameters into one group each.

    The merged BSDF finds its values in a `ParameterTable`, so a scene of a hundred plain colors is shaded as
    one group. Groups that have only delta lobes come last.
    """
    bsdfs = [material.bsdf for material in materials]
    members: dict[object, list[int]] = {}
    for i, bsdf in enumerate(bsdfs):
        members.setdefault(_group_key(bsdf), []).append(i)
    group_of = np.empty(len(materials), np.intp)
    ordered = sorted(members.values(), key=lambda numbers: bsdfs[numbers[0]].specular)
    for group, numbers in enumerate(ordered):
        group_of[numbers] = group
    groups = tuple(_merge(bsdfs, numbers) for numbers in ordered)
    normal_maps = {id(m.normal_map): m.normal_map for m in materials if m.normal_map is not None}
    number_of = {key: number for number, key in enumerate(normal_maps)}
    normal_map_of = np.array([number_of.get(id(material.normal_map), -1) for material in materials], np.intp)
    dispersive = any(bsdf.dispersive for bsdf in groups)
    return MaterialTable(group_of, groups, normal_map_of, tuple(normal_maps.values()), dispersive)


def absorption_table(materials: Sequence[Material]) -> Floats | None:
    """Return the absorption behind the surfaces of each material, (3, materials), if there is any."""
    table = np.zeros((3, len(materials)), f4)
    for i, material in enumerate(materials):
        if material.interior is not None:
            table[:, i] = np.ravel(material.interior.sigma_a)
    return table if table.any() else None


def opacity_table(materials: Sequence[Material], has_alpha: Bools) -> Opacities | None:
    """Return the opacities of materials, None if all surfaces are opaque."""
    if not has_alpha.any():
        return None
    constant, varying = np.ones(len(materials), f4), []
    for i, material in enumerate(materials):
        if material.opacity is None:
            continue
        if material.opacity.constant is None:
            varying.append((i, material.opacity))
        else:
            constant[i] = material.opacity.constant
    return Opacities(has_alpha, constant, varying)


def find_alpha(
    materials: Sequence[Material], material_of: Ints, meshes: Sequence[Mesh], instances: Sequence[Instance]
) -> Bools:
    """Return a mask of the primitives (m + k + 1,) with an opacity below 1; a miss, at the end, has none."""
    has_alpha = np.array([material.opacity is not None for material in materials], np.bool_)
    mask = np.append(has_alpha.take(material_of), False)
    kinds, _ = kinds_of(instances)
    placed = {id(shape.mesh) for shape in kinds if shape.material.opacity is not None}
    start = 0
    for mesh in meshes:
        end = start + len(mesh.faces)
        opacity = mesh.material.opacity
        if opacity is not None and mesh.uvs is not None and mask[start:end].any():
            mask[start:end] &= ~opacity.is_one_over(mesh.uvs.take(mesh.faces, 0))
        mask[start:end] |= id(mesh) in placed
        start = end
    return mask


def find_nonscattering_lights(
    materials: Sequence[Material], material_of: Ints, light_of: Ints, lights: int
) -> Bools | None:
    """Return a mask of the lights (lights,) whose surface has a black BSDF; None when none has."""
    black = np.array([material.bsdf.black for material in materials], np.bool_).take(material_of)
    nonscattering = np.zeros(lights, np.bool_)
    nonscattering[light_of.compress(black & (light_of >= 0))] = True
    return nonscattering if nonscattering.any() else None


def _is_constant(value: object) -> bool:
    return isinstance(value, np.ndarray) and value.dtype == f4 and value.shape in ((3, 1), (1,))


def _group_key(bsdf: Bsdf) -> object:
    """Return equal keys for BSDFs that may be merged; one with a texture is merged with itself alone."""
    parameters = vars(bsdf)
    if not all(
        _is_constant(v) or isinstance(v, bool | int | float | str | tuple | None) for v in parameters.values()
    ):
        return id(bsdf)
    shapes = tuple((k, v.shape if _is_constant(v) else v) for k, v in sorted(parameters.items()))
    return type(bsdf), bsdf.specular, shapes


def _merge(bsdfs: Sequence[Bsdf], numbers: list[int]) -> Bsdf:
    first = bsdfs[numbers[0]]
    if len(numbers) == 1:
        return first
    merged = copy(first)
    for name, value in vars(first).items():
        values = [getattr(bsdfs[number], name) for number in numbers]
        if _is_constant(value) and not all(np.array_equal(value, other) for other in values):
            table = np.zeros((*value.shape[:-1], len(bsdfs)), f4)
            table[..., numbers] = np.concatenate(values, -1)
            vars(merged)[name] = ParameterTable(table)
    return merged


def attributes_read(shapes: Sequence[Shape]) -> list[str]:
    """Return the names of the attributes that materials read; warn of meshes that lack any of theirs.

    Raises
    ------
    SceneError
        If a parameter reads an unknown attribute.
    """
    read: set[str] = set()
    lacking: dict[str, dict[int, str]] = {}  # attribute -> names of the meshes that lack it, by identity
    of_material: dict[int, set[str]] = {}
    for shape in kinds_of(shapes)[0]:
        mesh = shape.mesh if isinstance(shape, Instance) else shape
        glow = shape.emission.reads if isinstance(shape.emission, BaseTexture) else ()
        if id(shape.material) not in of_material:
            of_material[id(shape.material)] = _reads(shape.material)
        for name in sorted(of_material[id(shape.material)].union(glow)):
            if name not in ATTRIBUTES:
                known = ", ".join(ATTRIBUTES)
                raise SceneError(f"{shape.name}: its material reads {name!r}; it must be one of {known}")
            read.add(name)
            if isinstance(mesh, Mesh) and ATTRIBUTES[name].array_of(mesh) is None:
                lacking.setdefault(ATTRIBUTES[name].title, {})[id(mesh)] = shape.name
    for title, names in lacking.items():
        problem = plural(
            len(names),
            f"mesh lacks the {title} that its material reads",
            f"meshes lack the {title} that their materials read",
        )
        warn_caller(f"{problem}, first: {next(iter(names.values()))!r}")
    return sorted(read)


def _reads(material: Material) -> set[str]:
    """Return the names of the attributes that a material reads, but for its emission."""
    out = _parameters_read(material.bsdf)
    if material.opacity is not None:
        out |= _parameters_read(material.opacity)
    return out if material.normal_map is None else out.union(material.normal_map.reads)


def _parameters_read(thing: Bsdf | Opacity, within: tuple[Bsdf | Opacity, ...] = ()) -> set[str]:
    """Return the names of the attributes that a BSDF, inside of others, or an opacity reads.

    Raises
    ------
    SceneError
        If a BSDF is a part of itself.
    """
    if any(thing is outer for outer in within):
        raise SceneError(
            f"{type(thing).__name__}: an attribute of it is the BSDF itself, or has it as a part"
        )
    out: set[str] = set()
    for value in vars(thing).values():
        if isinstance(value, BaseTexture):
            out.update(value.reads)
        elif isinstance(value, Bsdf):
            out |= _parameters_read(value, (*within, thing))
    return out


def number_materials(
    meshes: Sequence[Mesh], curved: Sequence[CurvedShape], instances: Sequence[Instance]
) -> tuple[list[Material], Ints, Ints | None]:
    """Return the distinct materials, and their numbers for each table row and for each instance.

    The number of an instance with its mesh's material is -1; the last result is None if all have that.
    """
    numbers: dict[int, int] = {}
    of_parts: dict[tuple[int, ...], int] = {}
    materials: list[Material] = []
    of_kind: list[int] = []
    kinds, kind = kinds_of([*meshes, *curved, *instances])
    for shape in kinds:
        material = shape.material
        if id(material) not in numbers:
            number = of_parts.setdefault(material_parts(material), len(materials))
            numbers[id(material)] = number
            if number == len(materials):
                materials.append(material)
        of_kind.append(numbers[id(material)])
    rows, of_shape = len(meshes) + len(curved), np.array(of_kind, np.intp)[kind]
    counts = [len(mesh.faces) for mesh in meshes] + [shape.count for shape in curved]
    of_row = np.repeat(of_shape[:rows], counts)
    others = [isinstance(shape, Instance) and shape.material is not shape.mesh.material for shape in kinds]
    replaces = np.array(others, np.bool_)[kind][rows:]
    replaced = np.where(replaces, of_shape[rows:], -1) if replaces.any() else None
    return materials, of_row, replaced


def material_parts(material: Material) -> tuple[int, ...]:
    """Return equal keys for materials of the same parts, such as two that hold one BSDF and nothing else."""
    return tuple(id(part) for name, part in vars(material).items() if name != "name")
