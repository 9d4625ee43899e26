"""The lights of a scene, gathered into one table."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import SceneError
from ..lights import (
    EnvironmentSum,
    InfiniteLight,
    Light,
    LightTable,
    RectangleLights,
    SphereLights,
    TriangleLights,
    TwoSidedRectangleLights,
    TwoSidedTriangleLights,
    first_of_pairs,
)
from ..lights.samplers import LightSamplerMaker
from ..lights.textured_emission import EmissionSource, TexturedEmission, has_textured_emission, mean_radiance
from ..scene import Scene
from ..shapes import Mesh, Sphere
from ..textures.base import BaseTexture
from ..vec import Floats, Ints, f4

AREA_LIGHTS = (RectangleLights, TwoSidedRectangleLights, TriangleLights, TwoSidedTriangleLights)


def _gather_lights(
    scene: Scene,
    scale: float,
    meshes: Sequence[Mesh],
    spheres: Sequence[Sphere],
    corners: Sequence[NDArray[np.float64]],
    center: NDArray[np.float64],
    half_size: NDArray[np.float64],
    choice: str | LightSamplerMaker,
    mis: bool,
) -> tuple[LightTable, Ints, int]:
    """Return the table of lights, the light of each primitive, and that of rays that hit nothing."""
    kinds: list[Light] = []
    light_of = np.full(sum(len(part) for part in corners) + len(spheres), -1, np.intp)
    count = 0

    def add(kind: type[Light], records: list[Any]) -> None:
        nonlocal count
        if records:
            kinds.append(kind.concatenate(records))
            count += len(kinds[-1])

    area_lights = _area_lights(meshes, corners)
    for kind in AREA_LIGHTS:
        members = [(faces, record) for faces, record in area_lights if type(record) is kind]
        number = count
        for faces, _ in members:
            light_of[faces] = number + np.arange(faces.shape[1])
            number += faces.shape[1]
        add(kind, [record for _, record in members])
    for sphere in spheres:
        if isinstance(sphere.emission, BaseTexture):
            raise SceneError(
                f"{sphere.name}: a sphere shines evenly; a mesh can shine by {sphere.emission!r}"
            )
        if sphere.emission is not None and sphere.material.opacity is not None:
            raise SceneError(
                f"{sphere.name}: a sphere that shines must be all there; its material has an alpha"
            )
    start = sum(len(part) for part in corners)
    emitting = np.array([sphere.emission is not None for sphere in spheres], np.bool_)
    light_of[start + np.flatnonzero(emitting)] = count + np.arange(emitting.sum())
    add(
        SphereLights,
        [
            SphereLights((s.center - center).astype(f4).reshape(3, 1), np.array([s.radius], f4), s.emission)
            for s in spheres
            if s.emission is not None
        ],
    )
    groups: dict[type[Light], list[Any]] = {}
    infinite: list[InfiniteLight] = []
    for light in scene.lights:
        record = (light if scale == 1 else light.scaled(scale)).record(center)
        if isinstance(record, InfiniteLight):
            infinite.append(record.compensated() if mis else record)
        else:
            groups.setdefault(type(record), []).append(record)
    for record_type, records in groups.items():
        add(record_type, records)
    environment = count if infinite else -1
    if infinite:
        kinds.append(EnvironmentSum.of(infinite))
    return LightTable(kinds, half_size, choice), light_of, environment


def _uneven(meshes: Sequence[Mesh], lights: int, light_of: Ints) -> TexturedEmission | None:
    """Return the lights that do not shine evenly, None when all do."""
    textured_emission = TexturedEmission(np.full(lights, -1, np.intp), np.full(lights, -1, np.intp), [])
    numbers: dict[tuple[int, bool], int] = {}
    start = 0
    for mesh in meshes:
        end = start + len(mesh.faces)
        if mesh.emission is not None and has_textured_emission(mesh):
            key = id(mesh.emission), mesh.two_sided
            if key not in numbers:
                numbers[key] = len(numbers)
                textured_emission.sources.append(EmissionSource(mesh.emission, mesh.two_sided))
            triangles = start + np.flatnonzero(light_of[start:end] >= 0)
            number = light_of.take(triangles)
            textured_emission.triangle[number], textured_emission.source[number] = triangles, numbers[key]
        start = end
    return textured_emission if textured_emission.sources else None


def _area_lights(
    meshes: Sequence[Mesh], corners: Sequence[NDArray[np.float64]]
) -> list[tuple[Ints, RectangleLights | TriangleLights]]:
    """Return the emitting rectangles and triangles of all meshes, a record for each kind.

    Only what shines evenly is taken for rectangles, as their points have no barycentric weights.
    With each record come its faces: (2, k) for rectangles, (1, k) for triangles.
    """
    emitting = [number for number, mesh in enumerate(meshes) if mesh.emission is not None]
    if not emitting:
        return []
    sizes = [len(part) for part in corners]
    starts = np.cumsum([0, *sizes])
    mesh_of = np.repeat(emitting, [sizes[number] for number in emitting])
    face = np.concatenate([np.arange(starts[number], starts[number + 1]) for number in emitting])
    triangles = np.concatenate([corners[number] for number in emitting])
    radiance = np.concatenate([_radiance(meshes[number], corners[number]) for number in emitting], 1)
    shining = _with_area(meshes, mesh_of, triangles)
    even = shining[~np.array([has_textured_emission(mesh) for mesh in meshes])[mesh_of[shining]]]
    first = first_of_pairs(triangles[even], mesh_of[even])
    pairs = even[np.stack([first, first + 1])]
    alone = shining[~np.isin(shining, pairs)]
    two_sided = np.array([mesh.two_sided for mesh in meshes])[mesh_of]
    found: list[tuple[Ints, RectangleLights | TriangleLights]] = []
    for chosen, rectangles, singles in (
        (~two_sided, RectangleLights, TriangleLights),
        (two_sided, TwoSidedRectangleLights, TwoSidedTriangleLights),
    ):
        pair, single = pairs[:, chosen[pairs[0]]], alone[chosen[alone]]
        if pair.size:
            found.append((face[pair], rectangles.from_pairs(triangles[pair[0]], radiance[:, pair[0]])))
        if single.size:
            found.append((face[single][None], singles.from_triangles(triangles[single], radiance[:, single])))
    return found


def _radiance(mesh: Mesh, triangles: NDArray[np.float64]) -> Floats:
    """Return the radiance of each face of an emitting mesh, its mean where it varies, (3, k)."""
    if has_textured_emission(mesh):
        return mean_radiance(mesh, triangles)
    return np.broadcast_to(np.asarray(mesh.emission, f4), (3, len(triangles)))


def _with_area(meshes: Sequence[Mesh], mesh_of: Ints, triangles: NDArray[np.float64]) -> Ints:
    """Return which triangles (k, 3, 3) of emitting meshes, numbered `mesh_of` (k,), have an area."""
    edges = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    shining = np.flatnonzero((edges != 0).any(1))
    dark = mesh_of[~np.isin(mesh_of, mesh_of[shining])]
    if dark.size:
        mesh = meshes[dark[0]]
        raise SceneError(f"{mesh.name}: a light must have an area; all {len(mesh.faces)} faces have none")
    return shining
