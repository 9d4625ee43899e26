"""The lights of a scene, gathered into one table."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, TypeAlias

import numpy as np

from ..arrays.vec import Doubles, Floats, Ints, f4
from ..core.errors import SceneError
from ..core.plural import plural
from ..lights import (
    Environment,
    EnvironmentSum,
    InfiniteLight,
    Light,
    LightRecord,
    LightTable,
    RectangleLights,
    SphereLights,
    TexturedSphereLights,
    TexturedTriangleLights,
    TriangleLights,
    TwoSidedRectangleLights,
    TwoSidedTexturedTriangleLights,
    TwoSidedTriangleLights,
    first_of_pairs,
)
from ..lights.choice import LightSamplerMaker
from ..lights.textured_emission import has_textured_emission, mean_radiance
from ..lights.textured_sphere import mean_sphere_radiance
from ..scene import Scene
from ..shapes import CurvedShape, Mesh, Shape, Sphere, Spheres
from ..shapes.attributes import ATTRIBUTES
from ..textures.base import BaseTexture
from .light_groups import GroupNumbers, primitive_count
from .motion import MotionTable
from .moving_lights import moving_light, moving_parts

# A record, and the primitives of its lights: (..., k) a column per light, or (..., m) of one light, or none.
Emitter: TypeAlias = tuple[LightRecord, Ints | None]


def find_backdrop(
    scene: Scene, scale: float, center: Doubles, motion: MotionTable | None
) -> InfiniteLight | None:
    """Return the light at infinity that the camera sees; None if it is the one that lights the scene."""
    shown = [light.backdrop or light if isinstance(light, Environment) else light for light in scene.lights]
    if shown == list(scene.lights):
        return None
    records = [
        moving_light(light, _checked_record(light, scale, center), number, motion)
        for number, light in enumerate(shown)
    ]
    return EnvironmentSum.of([record for record in records if isinstance(record, InfiniteLight)])


def gather_lights(
    scene: Scene,
    scaled: Sequence[Shape],
    scale: float,
    meshes: Sequence[Mesh],
    curved: Sequence[CurvedShape],
    vertices: Sequence[Doubles],
    center: Doubles,
    half_size: Doubles,
    choice: str | LightSamplerMaker,
    mis: bool,
    glowing: Sequence[LightRecord] = (),
    motion: MotionTable | None = None,
) -> tuple[LightTable, GroupNumbers, Ints, int]:
    """Return the lights, their groups, and the light of each primitive and of rays that miss.

    Parameters
    ----------
    scene
        The scene to render.
    scaled, scale
        Its shapes with all lengths multiplied by `scale`, in the same order.
    meshes, curved, vertices
        The shapes that are traced, and the vertices (n, 3) of each mesh, relative to `center` (3,).
    half_size
        Half of the scene's extent, (3,).
    choice, mis
        As for `compile_scene`.
    glowing
        The lights of media; they are the last ones before those at infinity, in the default group.
    motion
        The shapes and lights that move while a shutter is open.

    Raises
    ------
    SceneError
        If a light is malformed, or a shape cannot emit light as it should.
    """
    traced: list[Mesh | CurvedShape] = [*meshes, *curved]
    first_row, primitives = _first_rows(traced)
    emitters: list[Emitter] = [
        *_area_lights(meshes, vertices, motion),
        *_sphere_lights(curved, first_row, center),
    ]
    if motion is not None:
        emitters = [moved for emitter in emitters for moved in moving_parts(*emitter, motion)]
    groups = GroupNumbers()
    of_row = groups.of_shapes(traced)
    for _, rows in emitters:
        assert rows is not None
        groups.add(of_row[np.atleast_2d(rows)[0]])
    kinds_of_light: dict[object, list[tuple[LightRecord, int]]] = {}
    infinite: list[InfiniteLight] = []
    surfaces: list[tuple[Emitter, int]] = []
    for number, light in enumerate(scene.lights):
        record = moving_light(light, _checked_record(light, scale, center), number, motion)
        if isinstance(record, InfiniteLight):
            infinite.append(record.compensated() if mis else record)
            groups.add_to_environment(light, infinite[-1])
        elif light.shape is not None:
            emitter: Emitter = record, _rows_of(light, record, scene.shapes, scaled, first_row)
            surfaces.append((emitter, groups.number(light)))
        else:
            key = type(record), *map(id, record.shared())
            kinds_of_light.setdefault(key, []).append((record, groups.number(light)))
    for of_kind in kinds_of_light.values():
        records, numbers = zip(*of_kind, strict=True)
        emitters.append((type(records[0]).concatenate(records), None))
        groups.add(np.repeat(numbers, [len(record) for record in records]))
    for emitter, number in surfaces:
        emitters.append(emitter)
        groups.add(np.full(len(emitter[0]), number))
    for record in glowing:
        emitters.append((record, None))
        groups.add(np.array([groups.default()]))
    light_of, count = _lights_of_primitives(emitters, primitives)
    kinds = [record for record, _ in emitters]
    if infinite:
        kinds.append(EnvironmentSum.of(infinite))
    return LightTable(kinds, half_size, choice), groups, light_of, count if infinite else -1


def _first_rows(shapes: Sequence[Mesh | CurvedShape]) -> tuple[dict[int, int], int]:
    """Return the first primitive of each shape, by its id, and the number of all primitives."""
    first_row, count = {}, 0
    for shape in shapes:
        first_row[id(shape)] = count
        count += primitive_count(shape)
    return first_row, count


def _checked_record(light: Light, scale: float, center: Doubles) -> LightRecord:
    """Return the record of a light whose lengths are multiplied by `scale`, relative to `center` (3,)."""
    record = (light if scale == 1 else light.scaled(scale)).record(center)
    if not isinstance(record, LightRecord):
        raise SceneError(f"{type(light).__name__}: record must return a wf.LightRecord, got {record!r}")
    unknown = [name for name in record.reads if name not in ATTRIBUTES]
    if unknown:
        raise SceneError(
            f"{type(light).__name__} reads {unknown[0]!r}; it must be one of {', '.join(ATTRIBUTES)}"
        )
    return record


def _lights_of_primitives(emitters: Sequence[Emitter], primitives: int) -> tuple[Ints, int]:
    """Return the light (primitives,) of each primitive, -1 for none, and the number of lights."""
    light_of, count = np.full(primitives, -1, np.intp), 0
    for record, rows in emitters:
        if rows is not None:
            if (light_of[rows] >= 0).any():
                raise SceneError(f"{type(record).__name__}: its shape is a light already")
            light_of[rows] = count + np.arange(len(record))
        count += len(record)
    return light_of, count


def _rows_of(
    light: Light,
    record: LightRecord,
    shapes: Sequence[Shape],
    scaled: Sequence[Shape],
    first_row: dict[int, int],
) -> Ints:
    """Return the primitives (m,) of the shape of a light."""
    name, shape = type(light).__name__, light.shape
    assert shape is not None
    same = [traced for original, traced in zip(shapes, scaled, strict=True) if original is shape]
    if not same:
        raise SceneError(f"{name}: its shape {shape.name!r} is not in the scene; add it to the shapes")
    if id(same[0]) not in first_row:
        raise SceneError(f"{name}: its shape {shape.name!r} must be a wf.Mesh or a wf.Sphere")
    assert isinstance(shape, Mesh | CurvedShape)
    if shape.material.opacity is not None:
        raise SceneError(f"{name}: its shape {shape.name!r} must be opaque; its material has an alpha")
    faces = primitive_count(shape)
    if len(record) not in (1, faces):
        raise SceneError(
            f"{name}: record has {plural(len(record), 'column')}; "
            f"it must have 1, or {faces}, one for each face"
        )
    return first_row[id(same[0])] + np.arange(faces)


def _sphere_lights(
    curved: Sequence[CurvedShape], first_row: dict[int, int], center: Doubles
) -> list[Emitter]:
    """Return the lights of emitting spheres, if there are any."""
    emitting = [shape for shape in curved if shape.emission is not None]
    for shape in emitting:
        if not isinstance(shape, Sphere | Spheres):
            raise SceneError(
                f"{shape.name}: a {type(shape).__name__} cannot emit light; a wf.Sphere or a wf.Mesh can"
            )
        if shape.material.opacity is not None:
            raise SceneError(f"{shape.name}: an emitting sphere must be opaque; its material has an alpha")
    if not emitting:
        return []
    rows = [first_row[id(shape)] + np.arange(shape.count) for shape in emitting]
    lights = SphereLights.concatenate([_lights_of_spheres(shape, center) for shape in emitting])
    emissions, source_of = _distinct_emissions(
        [shape.emission if isinstance(shape.emission, BaseTexture) else None for shape in emitting]
    )
    every = np.concatenate(rows)
    if not emissions:
        return [(lights, every)]
    source = np.repeat(source_of, [shape.count for shape in emitting])
    prim = np.where(source >= 0, every, -1)
    plain = lights.center, lights.radius, lights.radiance
    return [(TexturedSphereLights(*plain, prim=prim, source=source, emissions=emissions), every)]


def _lights_of_spheres(shape: Any, center: Doubles) -> SphereLights:
    """Return the lights of a shape of emitting spheres, relative to `center` (3,); the mean of a texture."""
    middles = np.ascontiguousarray((shape.centers - center).T, f4)
    if isinstance(shape.emission, BaseTexture):
        radiance = mean_sphere_radiance(shape)
    else:
        radiance = np.repeat(shape.emission, shape.count, 1)
    radii = np.broadcast_to(shape.radii, shape.count).astype(f4)
    return SphereLights(middles, radii, radiance)


def _area_lights(
    meshes: Sequence[Mesh], vertices: Sequence[Doubles], motion: MotionTable | None
) -> list[Emitter]:
    """Return the emitting rectangles and triangles of all meshes, a record for each kind.

    Only uniform emission is taken for rectangles, as their points have no barycentric weights.
    With each record come its faces: (2, k) for rectangles, (k,) for triangles.
    """
    emitting = [number for number, mesh in enumerate(meshes) if mesh.emission is not None]
    if not emitting:
        return []
    sizes = [len(mesh.faces) for mesh in meshes]
    starts = np.cumsum([0, *sizes])
    corners = {number: vertices[number].take(meshes[number].faces, 0) for number in emitting}
    mesh_of = np.repeat(emitting, [sizes[number] for number in emitting])
    face = np.concatenate([np.arange(starts[number], starts[number + 1]) for number in emitting])
    triangles = np.concatenate(list(corners.values()))
    radiance = np.concatenate([_radiance(meshes[number], corners[number]) for number in emitting], 1)
    emissions, source_of = _textured_emissions(meshes)
    source = source_of[mesh_of]
    shining = _with_area(meshes, mesh_of, triangles)
    even = shining[source[shining] < 0]
    if motion is not None:  # meshes that deform are made of triangles
        even = even[motion.is_rigid(face[even])]
    first = first_of_pairs(triangles[even], mesh_of[even])
    pairs = even[np.stack([first, first + 1])]
    alone = shining[~np.isin(shining, pairs)]
    two_sided = np.array([mesh.two_sided for mesh in meshes])[mesh_of]
    emitters: list[Emitter] = []
    for rectangles, side in ((RectangleLights, ~two_sided), (TwoSidedRectangleLights, two_sided)):
        pair = pairs[:, side[pairs[0]]]
        if pair.size:
            emitters.append((rectangles.from_pairs(triangles[pair[0]], radiance[:, pair[0]]), face[pair]))
    for plain, textured, side in (
        (TriangleLights, TexturedTriangleLights, ~two_sided),
        (TwoSidedTriangleLights, TwoSidedTexturedTriangleLights, two_sided),
    ):
        single = alone[side[alone]]
        columns = triangles[single], radiance[:, single]
        if (source[single] >= 0).any():
            prim = np.where(source[single] >= 0, face[single], -1)
            emitters.append((textured.textured(*columns, prim, source[single], emissions), face[single]))
        elif single.size:
            emitters.append((plain.from_triangles(*columns), face[single]))
    return emitters


def _textured_emissions(meshes: Sequence[Mesh]) -> tuple[tuple[Floats | BaseTexture, ...], Ints]:
    """Return the distinct emissions of meshes that are not uniform, and their numbers, -1 for none."""
    return _distinct_emissions(
        [
            mesh.emission if mesh.emission is not None and has_textured_emission(mesh) else None
            for mesh in meshes
        ]
    )


def _distinct_emissions(
    shape_emissions: Sequence[Floats | BaseTexture | None],
) -> tuple[tuple[Floats | BaseTexture, ...], Ints]:
    """Return emissions, each once, and the number of that of each shape, -1 for None."""
    numbers: dict[int, int] = {}
    emissions: list[Floats | BaseTexture] = []
    of_shape = np.full(len(shape_emissions), -1, np.intp)
    for shape, emission in enumerate(shape_emissions):
        if emission is None:
            continue
        if id(emission) not in numbers:
            numbers[id(emission)] = len(emissions)
            emissions.append(emission)
        of_shape[shape] = numbers[id(emission)]
    return tuple(emissions), of_shape


def _radiance(mesh: Mesh, triangles: Doubles) -> Floats:
    """Return the radiance of each face of an emitting mesh, its mean where it varies, (3, k)."""
    if has_textured_emission(mesh):
        return mean_radiance(mesh, triangles)
    return np.broadcast_to(np.asarray(mesh.emission, f4), (3, len(triangles)))


def _with_area(meshes: Sequence[Mesh], mesh_of: Ints, triangles: Doubles) -> Ints:
    """Return which triangles (k, 3, 3) of emitting meshes, numbered `mesh_of` (k,), have an area."""
    edges = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    shining = np.flatnonzero((edges != 0).any(1))
    dark = mesh_of[~np.isin(mesh_of, mesh_of[shining])]
    if dark.size:
        mesh = meshes[dark[0]]
        faces = plural(len(mesh.faces), "face has", "faces have")
        raise SceneError(f"{mesh.name}: a light must have an area; its {faces} none")
    return shining
