"""The compiled scene: flat arrays for the stages."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from copy import copy
from dataclasses import field, replace
from functools import partial
from typing import Any

import numpy as np

from ..accel import Accelerator, Geometry, Placements
from ..accel.apart import build_apart
from ..accel.plate import beside_plate
from ..arrays.soa import soa
from ..arrays.vec import Bools, Doubles, Floats, Ints
from ..camera import Camera
from ..lights import LightTable
from ..lights.choice import LightSamplerMaker
from ..scene import Scene
from ..shapes import Shape
from ..shapes.attributes import ATTRIBUTES, Corners, corner_values
from .absorption import absorbs_alone
from .curved import CurvedTable
from .exposure import exposed_scene, middle_of
from .geometry import compute_corner_normals, gather_triangles, same_as_next
from .instances import InstanceTable, own_frame, place_instances, sort_shapes
from .light_groups import BY_DEFAULT, LightGroups
from .lights import gather_lights
from .materials import (
    MaterialTable,
    attributes_read,
    find_alpha,
    find_nonscattering_lights,
    group_materials,
    number_materials,
)
from .media import MediaTable, glow_lights, media_of, media_table, phase_materials
from .morton import AnyOrder, MortonGrid
from .motion import (
    MotionTable,
    curved_that_move,
    light_motions,
    motion_table,
    place_accelerators,
    with_places,
)
from .moving_curved import with_curved
from .program import Facts, Program
from .scale import check_distance, check_lights, length_factor, scaled_shapes
from .shape_numbers import ShapeNumbers, number_shapes
from .specular_surfaces import SpecularSurfaces, find_specular_surfaces
from .touching import find_touching, may_meet

ROULETTE_AFTER = 2  # scattering events, by default
LARGE = 20_000  # triangles; from here on the order of rays matters more than sorting them costs


@soa
class CompiledScene:
    """A scene as flat arrays, relative to its center. Triangles come first, then curved primitives.

    An instanced mesh is in the arrays once, in its own coordinates. If the scene is extremely large or small,
    all lengths here and in the accelerator are in another unit (see scale.py).
    """

    scale: float  # power of two that lengths of the scene are multiplied by; 1 for most scenes
    center: Doubles  # (3,)
    accelerator: Accelerator
    triangles: int  # number of triangles
    normals: Floats  # (3, m) unit geometric normals of the triangles
    corner_normals: tuple[Floats, Floats, Floats] | None  # 3 × (3, m); None when no mesh is smooth
    # those that a material reads, by field of `SurfaceInteraction`; 3 × (width, m)
    attributes: dict[str, Corners]
    curved: CurvedTable  # k of them
    shape_numbers: ShapeNumbers  # which shapes of the user's scene the primitives belong to
    shape_names: tuple[str, ...]  # of those shapes
    # (m + k,) material of each primitive; with media, those of phase functions and of a miss follow
    material_of: Ints
    light_of: Ints  # (m + k + 1,) light of each primitive, and at the end that of a miss; -1 for none
    emissive: Bools  # (m + k + 1,) whether `light_of` names a light
    materials: MaterialTable
    lights: LightTable
    light_groups: LightGroups[str]
    light_efficacies: LightGroups[float]  # lm/W, for measurements
    instances: InstanceTable | None = None  # None when no mesh is instanced
    motion: MotionTable | None = None  # None where nothing moves while a shutter is open
    places: MortonGrid | AnyOrder = AnyOrder()  # orders the paths of large scenes
    roulette_after: float = ROULETTE_AFTER  # scattering events before Russian roulette may end paths
    specular_surfaces: SpecularSurfaces | None = None  # for light tracing; None without it
    media: MediaTable | None = None  # None where none are, or each absorbs alone (absorption.py)
    program: Program = field(default_factory=Program)  # its features, and where they act

    @property
    def interpolates(self) -> bool:
        """Whether any value is interpolated over triangles."""
        return bool(self.attributes) or self.corner_normals is not None

    @property
    def shading_normals(self) -> bool:
        """Whether any shading normals may differ from the normals of the surface."""
        return self.corner_normals is not None or self.curved.shading_normals

    def view(self, camera: Camera) -> Camera:
        """Return a camera of the scene in the unit of length of these arrays.

        Raises
        ------
        SceneError
            If it is so far away that float32 cannot measure its distance.
        """
        check_distance("Camera origin", camera.origin, self.center / self.scale, self.scale)
        view = camera.scaled(self.scale)
        if view.course is not None:  # paths of a moment need no more than its place
            view = copy(view)
            del view.course
        return view

    def seen_by(self, camera: Camera) -> CompiledScene:
        """Return the scene as the first rays of a camera meet it: sensors measure the light that is there."""
        if camera.sensor is None:
            return self
        return replace(self, program=self.program.of_sensors())


def gather_scene(
    scene: Scene,
    make_accelerator: Callable[[Geometry], Accelerator],
    light_sampler: str | LightSamplerMaker = "spatial",
    most_copies: int = 0,
    mis: bool = False,
    caustics: bool = False,
    asked: Mapping[str, Any] | None = None,
) -> Facts:
    """Gather a scene into flat arrays, and return these with the facts by which features decide.

    Parameters
    ----------
    scene
        The scene to render.
    make_accelerator
        Called with the `Geometry`; returns the `Accelerator`.
    light_sampler
        How a light is chosen for each point: see `LIGHT_SAMPLERS`.
    most_copies
        Up to this total of instanced triangles, each instance becomes a mesh of its own.
    mis
        Whether light samples are combined with BSDF samples by MIS. Environments then use MIS compensation.
    caustics
        Whether paths from lights find the light that comes by smooth glass and mirrors.
    asked
        Settings that features read.

    Raises
    ------
    SceneError
        If an emitting shape has no area, an emitting sphere has an alpha or a textured emission, a shape
        cannot emit light, a light is malformed, too far away or too strong for the scene's size, or the
        choice is unknown.
    """
    asked = asked or {}
    exposed = exposed_scene(scene, asked.get("shutter"))
    scene, (low, high) = exposed.scene, exposed.bounds
    radius = float(np.linalg.norm(high - low)) / 2
    scale = length_factor(radius)
    check_lights(scene.lights, (low + high) / 2, scale)
    low, high = low * scale, high * scale
    center, half_size = middle_of(exposed, low, high, scale)
    scaled = scaled_shapes(scene.shapes, scale)
    meshes, curved, instances, numbers = sort_shapes(scaled, most_copies, exposed.movers)
    placed: list[Shape] = [*meshes, *curved, *instances]
    shared = list({id(instance.mesh): instance.mesh for instance in instances}.values())
    sizes = np.array([len(mesh.faces) for mesh in meshes], np.intp)
    shape_of, once = np.repeat(numbers[: sizes.size], sizes), int(sizes.sum())
    vertices = [mesh.vertices - center for mesh in meshes] + [own_frame(mesh) for mesh in shared]
    meshes += shared
    triangles, normals = gather_triangles(meshes, vertices)
    user_materials, material_of, replaced = number_materials(meshes, curved, instances)
    around = None if scene.medium is None else scene.medium.scaled(scale)
    # what moves may be elsewhere at another time, so a table of media tells where it is
    alone = (lambda: False) if exposed.shutter else partial(absorbs_alone, placed, scene.lights, scale)
    filled = media_of(user_materials, around, alone)
    media = media_table(around, placed, user_materials, filled, center)
    glowing, of_media = glow_lights(media)
    phases = phase_materials(filled)
    user_materials += phases
    moving = curved_that_move(numbers, len(curved), len(instances), exposed)
    table_of_curved, placements, table, motion = CurvedTable.of(curved, center, moving), None, None, None
    still = len(table_of_curved.kinds) - moving
    if shared:
        placements, table = place_instances(instances, shared, center, once, len(table_of_curved), replaced)
    if moving:
        placements, table = with_curved(
            placements, table, table_of_curved.kinds[still:], once, len(shared), len(material_of)
        )
    if exposed.shutter is not None:
        motion = motion_table(
            exposed,
            instances,
            table_of_curved.kinds[still:],
            numbers,
            shared,
            center,
            scale,
            placements,
            once,
            len(material_of),
            [name for name in attributes_read(placed) if ATTRIBUTES[name].vectors],
        )
        reach = float(np.linalg.norm(half_size))
        motion.lights, motion.motion_of_light = light_motions(exposed, center, scale, reach)
    if media is not None and placements is not None and motion is not None:
        media.bounds = with_places(media.bounds, placements)
    lights, numbered, light_of, environment = gather_lights(
        scene,
        scaled,
        scale,
        meshes,
        curved,
        vertices,
        center,
        half_size,
        light_sampler,
        mis,
        glowing,
        motion,
    )
    if media is not None and glowing:
        media.light_of[of_media] = (
            len(lights) - int(environment >= 0) - len(glowing) + np.arange(len(glowing))
        )
    read = sorted({*attributes_read(placed), *lights.reads})
    attributes = {name: corner_values(name, meshes) for name in read}
    smooth = any(mesh.normals is not None for mesh in meshes)
    del vertices
    has_alpha = find_alpha(user_materials, material_of, meshes, instances)
    nonscattering_lights = find_nonscattering_lights(user_materials, material_of, light_of, len(lights))
    weights = bool(attributes) or smooth
    shape_numbers = number_shapes(meshes, curved, instances, numbers, moving)
    interchangeable = None if weights else same_as_next(material_of[:once], light_of[:once], shape_of)
    geometry = Geometry(triangles[:once], table_of_curved.kinds[:still], weights, interchangeable)
    moves = None if exposed.changed is None else exposed.changed.take(shape_of)
    accelerator = beside_plate(partial(build_apart, make_accelerator, moves), geometry, has_alpha)
    if placements is not None:
        ends = np.cumsum([len(mesh.faces) for mesh in shared])
        parts = np.split(triangles[once:], ends[:-1])[: len(shared)]
        accelerator = place_accelerators(
            accelerator, parts, placements, motion, once, weights, make_accelerator
        )
    specular, groups_of = None, group_materials(user_materials)
    if caustics and len(lights) > int(environment >= 0):  # one is not at infinity
        counts = [0, 0, *(len(instance.mesh.faces) for instance in instances)]
        counts += [len(kind) for kind in table_of_curved.kinds[still:]]
        specular = find_specular_surfaces(
            triangles,
            once,
            table_of_curved,
            still,
            material_of,
            light_of,
            groups_of,
            counts,
            table,
            motion if motion is not None and motion.motions is not None else None,
        )
    groups, efficacies = numbered.groups(), numbered.efficacies()
    if media is not None:
        holds = (media.entry_of > 0).take(material_of[:once])
        if motion is not None and placements is not None:
            media.meet = _may_meet(placed, center, placements, motion, len(meshes) - len(shared), len(curved))
        media.touching = find_touching(triangles[:once], shape_of, material_of[:once], holds)
        # events in media have the numbers from -2 down, so their entries are those before that of a miss
        rows = np.arange(len(user_materials) - len(phases), len(user_materials))
        material_of = np.concatenate([material_of, rows[::-1], [0]])
        light_of = np.append(light_of, np.full(len(phases), -1))
        has_alpha = np.append(has_alpha, np.zeros(len(phases), np.bool_))
        if media.glows:
            groups, efficacies = (
                groups.with_light(BY_DEFAULT.group),
                efficacies.with_light(BY_DEFAULT.efficacy),
            )
    light_of = np.append(light_of, environment)
    compiled = CompiledScene(
        scale=scale,
        center=center,
        accelerator=accelerator,
        triangles=len(triangles),
        normals=normals,
        corner_normals=compute_corner_normals(meshes, normals),
        attributes=attributes,
        curved=table_of_curved,
        shape_numbers=shape_numbers,
        shape_names=tuple(shape.name for shape in scene.shapes),
        material_of=material_of,
        light_of=light_of,
        emissive=light_of >= 0,
        materials=groups_of,
        lights=lights,
        light_groups=groups,
        light_efficacies=efficacies,
        instances=table,
        motion=motion,
        specular_surfaces=specular,
        media=media,
        places=MortonGrid.over(half_size) if len(triangles) >= LARGE else AnyOrder(),
    )
    return Facts(
        scene=scene,
        compiled=compiled,
        materials=user_materials,
        nonscattering_lights=nonscattering_lights,
        corners=triangles,
        has_alpha=has_alpha,
        asked=asked,
        user_features=asked.get("features", ()),
        features=[],
    )


def _may_meet(
    placed: Sequence[Shape],
    center: Doubles,
    placements: Placements,
    motion: MotionTable,
    meshes: int,
    curved: int,
) -> bool:
    """Return whether a shape that encloses anything moves, and may come to lie on another such shape.

    Parameters
    ----------
    placed
        Meshes, curved shapes and instances, so many of the first two kinds; the last curved ones move.
    """
    low, high = (np.stack([shape.bounds[side] - center for shape in placed]) for side in (0, 1))
    instances = len(placed) - meshes - curved
    columns = np.arange(placements.mesh.size)
    of_column = np.where(columns < instances, meshes + curved + columns, 0)
    of_column[instances:] = np.arange(meshes + curved - (columns.size - instances), meshes + curved)
    low[of_column], high[of_column] = placements.low.T, placements.high.T
    moves = np.zeros(len(placed), np.bool_)
    moves[of_column] = motion.mover[2:] >= 0
    holds = np.array([shape.material.encloses for shape in placed], np.bool_)
    return may_meet(low[holds], high[holds], moves[holds])
