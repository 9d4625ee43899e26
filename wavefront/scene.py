"""Scenes: what the user puts together, and the flat arrays that a render works on."""

from __future__ import annotations

import warnings
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Sequence
from copy import copy
from typing import Any, ClassVar, Self, SupportsIndex, TypeAlias, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .accel import Accelerator, Geometry, InstanceAccelerator, KeptAccelerators
from .bsdfs import Bsdf, Opacity, Relief, Spatial
from .camera import Camera, field_of_view, image_size, upward
from .elementary import arctan2, sin_cos
from .errors import SceneError, finite_array
from .instances import InstanceTable, own_frame, place, resolve
from .lights import (
    Environment,
    InfiniteLight,
    Light,
    LightTable,
    RectangleLights,
    Sky,
    SphereLights,
    TriangleLights,
    TwoSidedRectangleLights,
    TwoSidedTriangleLights,
    UserLight,
    first_of_pairs,
)
from .record import record
from .scale import check_distance, check_lights, length_factor, scaled_shapes
from .shapes import Instance, Mesh, Shape, Sphere
from .shapes.attributes import ATTRIBUTES, Corners, corner_values
from .shapes.instance import instance_bounds
from .state import Surface
from .suggestions import suggests_keywords
from .uneven import Source, Uneven, is_uneven, mean_radiance
from .vec import Bools, Floats, Ints, cross, f4, length

FRAMING_VIEW = 0.35, 0.3, 1.0  # from the middle of a scene whose up is y to the camera that frames it
AREA_LIGHTS = (RectangleLights, TwoSidedRectangleLights, TriangleLights, TwoSidedTriangleLights)


class Scene:
    """Shapes, lights and a camera.

    Parameters
    ----------
    shapes
        `Mesh`, `Sphere` and `Instance` objects, and what `Rectangle` and `Disk` return; one with an
        emission is a light. Objects of trimesh are converted.
    lights
        `PointLight`, `SpotLight`, `DirectionalLight` and `Environment` objects, at most one
        `Environment`. A scene where nothing shines is rendered in the light of a studio: see `render`.
    camera
        Without one the scene is framed.

    Notes
    -----
    All of it may be changed between renders; what is assigned or put into the lists is checked as it is
    here. What a render builds to find the nearest surfaces is kept with the scene, and used again as long
    as every vertex and sphere is where it was.

    Raises
    ------
    SceneError
        If there is no shape, or an element is of the wrong type.
    """

    @suggests_keywords
    def __init__(
        self,
        shapes: Iterable[Any] | Any,
        lights: Iterable[UserLight] | UserLight = (),
        camera: Camera | None = None,
    ) -> None:
        self.shapes = shapes
        self.lights = lights
        self.camera = camera
        self.accelerators = KeptAccelerators()  # of the last render, for the next
        self.check()

    def __repr__(self) -> str:
        """Count what the scene holds."""
        return (
            f"<Scene: {len(self.shapes)} shapes, {len(self.lights)} lights, camera={self.camera is not None}>"
        )

    @property
    def shapes(self) -> list[Shape]:
        """What the scene is made of."""
        return self._shapes

    @shapes.setter
    def shapes(self, shapes: Any) -> None:
        self._shapes = Shapes(shapes)

    @property
    def lights(self) -> list[UserLight]:
        """What shines beside the shapes."""
        return self._lights

    @lights.setter
    def lights(self, lights: Any) -> None:
        self._lights = Lights(lights)

    @property
    def camera(self) -> Camera | None:
        """What sees the scene; None frames it."""
        return self._camera

    @camera.setter
    def camera(self, camera: Camera | None) -> None:
        if camera is not None and not isinstance(camera, Camera):
            raise SceneError(f"camera must be a wf.Camera, got {camera!r}")
        self._camera = camera

    def add(self, *items: Any) -> Self:
        """Add shapes, objects of trimesh, and lights; return the scene.

        Raises
        ------
        SceneError
            If an item is something else, or a second `Environment`; the scene is then as it was.
        """
        shapes = Shapes([item for item in items if not isinstance(item, UserLight)])
        lights = Lights([*self.lights, *(item for item in items if isinstance(item, UserLight))])
        _check_environments(lights)
        self.shapes.extend(shapes)
        self._lights = lights
        return self

    def check(self) -> None:
        """Check what must hold of the scene as a whole.

        Raises
        ------
        SceneError
            If there is no shape, more than one `Environment`, or a face has an index that no vertex has.
        """
        if not self.shapes:
            raise SceneError("the scene has no shapes")
        _check_environments(self.lights)
        for shape in self.shapes:
            if isinstance(shape, Mesh):
                shape.check()

    @property
    def bounds(self) -> NDArray[np.float64]:
        """Lower and upper corner of all shapes, (2, 3), scene units."""
        instances = [shape for shape in self.shapes if isinstance(shape, Instance)]
        alone = [shape.bounds for shape in self.shapes if not isinstance(shape, Instance)]
        boxes = np.concatenate([np.array(alone).reshape(-1, 2, 3), instance_bounds(instances)])
        return np.stack([boxes[:, 0].min(0), boxes[:, 1].max(0)])

    @property
    def emits(self) -> bool:
        """Whether anything in the scene shines."""
        return bool(self.lights) or any(shape.emission is not None for shape in self.shapes)

    @suggests_keywords
    def framing_camera(
        self,
        fov: float = 40,
        size: tuple[int, int] = (512, 512),
        *,
        up: ArrayLike = (0, 1, 0),
        direction: ArrayLike | None = None,
    ) -> Camera:
        """Return a camera that sees the whole scene: from the front, a little above and to the right.

        Parameters
        ----------
        fov
            Vertical field of view, degrees.
        size
            (width, height) in pixels.
        up
            What is up in the picture: (3,), or the name of an axis, such as "z" for most STL and CAD
            files. With "y" the front is where z points, with "z" where -y does.
        direction
            (3,) from where the scene is seen instead: from its middle to the camera, of any length.

        Raises
        ------
        SceneError
            If an argument is malformed or out of range.
        """
        size = image_size(size)
        fov = field_of_view(fov)
        turn = turned_up(upward("up", up))
        low, high = self.bounds
        radius = float(np.linalg.norm(high - low)) / 2 or 1.0
        narrow = min(1.0, size[0] / size[1])
        sin, cos = sin_cos(np.float64(np.radians(fov) / 2))
        sin_half, _ = sin_cos(arctan2(sin * narrow, cos))
        view = turn @ FRAMING_VIEW
        if direction is not None:
            view = finite_array("direction", direction, (3,))
            if not view.any():
                raise SceneError(f"direction is {view.tolist()}; it must not be zero")
            view = view / np.abs(view).max()
        view = view / np.linalg.norm(view)
        eye = (low + high) / 2 + view * radius / sin_half
        upright = turn[:, 1]
        if (
            np.linalg.norm(np.cross(upright, view)) < 1e-6
        ):  # seen from above or below: the front is at the bottom
            upright = -turn[:, 2] * np.sign(view @ upright)
        return Camera.look_at(eye, (low + high) / 2, upright, fov=fov, size=size)


T = TypeVar("T")
Importer: TypeAlias = Callable[[Any], Scene]
_IMPORTERS: dict[str, Importer] = {}  # by the package of an object's type


def register_importer(package: str, convert: Importer) -> None:
    """Let objects of a package's types stand wherever a scene takes shapes.

    Parameters
    ----------
    package
        The first part of the name of the modules that define the types.
    convert
        Called with an object; returns a scene, of which the shapes are taken.
    """
    _IMPORTERS[package] = convert


def importer(item: Any) -> Importer | None:
    """Return what turns an object of another package into a scene, None where nothing does."""
    packages = (kind.__module__.split(".")[0] for kind in type(item).__mro__)
    return next((_IMPORTERS[package] for package in packages if package in _IMPORTERS), None)


class CheckedList(list[T], ABC):
    """A list that checks and converts what is put into it.

    Parameters
    ----------
    items
        A list, or a lone element.
    """

    name: ClassVar[str]
    allowed: ClassVar[str]  # for messages

    def __init__(self, items: Any = ()) -> None:
        super().__init__()
        self.extend([items] if self.converted(items) is not None else items)

    @abstractmethod
    def converted(self, item: Any) -> list[T] | None:
        """Return the elements that an item stands for, None if it stands for none."""

    def append(self, item: Any) -> None:
        """Add an element at the end."""
        self.extend([item])

    def extend(self, items: Any) -> None:
        """Add elements at the end."""
        super().extend(self._all(items, len(self)))

    def insert(self, index: SupportsIndex, item: Any) -> None:
        """Add an element before another."""
        self[index:index] = [item]

    def __iadd__(self, items: Any) -> Self:  # type: ignore[override, misc]
        """Add elements at the end."""
        self.extend(items)
        return self

    def __setitem__(self, index: Any, value: Any) -> None:
        """Replace elements."""
        if isinstance(index, slice):
            super().__setitem__(index, self._all(value, index.indices(len(self))[0]))
        else:
            first = range(len(self))[index]
            super().__setitem__(slice(first, first + 1), self._all([value], first))

    def _all(self, items: Any, first: int) -> list[T]:
        """Return the elements that items stand for; the first will be number `first` of the list."""
        if isinstance(items, str | dict) or not isinstance(items, Iterable):
            raise SceneError(f"{self.name} must be a list of {self.allowed}, got {items!r}")
        found: list[T] = []
        for number, item in enumerate(items, first):
            elements = self.converted(item)
            if elements is None:
                raise SceneError(f"{self.name}[{number}] is {item!r}; it must be one of {self.allowed}")
            found += elements
        return found


class Shapes(CheckedList[Shape]):
    """The shapes of a scene."""

    name = "shapes"
    allowed = "wf.Mesh, wf.Rectangle, wf.Disk, wf.Sphere, wf.Instance, or a mesh or scene of trimesh"

    def converted(self, item: Any) -> list[Shape] | None:
        """Return a shape, or those of an object of another package."""
        if isinstance(item, Shape):
            return [item]
        convert = importer(item)
        return None if convert is None else convert(item).shapes


class Lights(CheckedList[UserLight]):
    """The lights of a scene."""

    name = "lights"
    allowed = "wf.PointLight, wf.SpotLight, wf.DirectionalLight, wf.Environment"

    def converted(self, item: Any) -> list[UserLight] | None:
        """Return a light."""
        return [item] if isinstance(item, UserLight) else None


def _check_environments(lights: Sequence[UserLight]) -> None:
    if sum(isinstance(light, Environment) for light in lights) > 1:
        raise SceneError("the scene has more than one Environment; at most one is allowed")


def turned_up(up: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the shortest rotation (3, 3) that takes +y to the direction of `up` (3,)."""
    up = up / np.abs(up).max()
    up = up / np.linalg.norm(up)
    cos = up[1]
    if cos < -1 + 1e-12:
        return np.diag([1.0, -1.0, -1.0])
    x, _, z = np.cross((0.0, 1.0, 0.0), up)
    skew = np.array([[0.0, -z, 0.0], [z, 0.0, -x], [0.0, x, 0.0]])
    return np.eye(3) + skew + skew @ skew / (1 + cos)


@record
class Palette(Spatial):
    """A parameter of many alike materials, one column each, looked up by the material's number."""

    table: Floats  # (c, materials)

    def at(self, surface: Surface) -> Floats:
        """Return the column of each hit point's material."""
        return self.table.take(surface.material, -1)


@record
class Materials:
    """The materials of a scene, gathered into groups that are shaded together."""

    group_of: Ints  # (materials,) the group of each material
    groups: tuple[Bsdf, ...]  # those that are `specular` at the end
    reliefs: tuple[tuple[int, Relief], ...]  # the groups that have one, with it


@record
class Opacities:
    """Which surfaces are only partly there, and how much of them is."""

    partly: Bools  # (m + k + 1,) of each primitive, and at the end False for a miss
    constant: Floats  # (materials,) opacity of each material; 1 where it varies
    varying: list[tuple[int, Opacity]]  # materials whose opacity varies

    def at(self, surface: Surface) -> Floats:
        """Return the part of the light that meets surfaces, (n,), in [0, 1]."""
        found = self.constant.take(surface.material)
        for material, opacity in self.varying:
            lanes = np.flatnonzero(surface.material == material)
            if lanes.size:
                found[lanes] = opacity.at(surface.take(lanes))
        return found


@record
class CompiledScene:
    """A scene as flat arrays, relative to its centre. Triangles come first, then spheres.

    A mesh that is placed several times stands in the arrays once, in its own frame. Where the scene is
    extremely large or small, all lengths here and in what is traced are in another unit (see scale.py).
    """

    scale: float  # a power of two by which lengths of the scene are multiplied; 1 for most scenes
    centre: NDArray[np.float64]  # (3,)
    radius: float  # of the bounding sphere
    accelerator: Accelerator
    triangles: int  # number of triangles
    normals: Floats  # (3, m) unit geometric normals of the triangles
    corner_normals: tuple[Floats, Floats, Floats] | None  # 3 × (3, m); None when no mesh is smooth
    attributes: dict[str, Corners]  # by field of `Surface`, those that a material reads; 3 × (width, m)
    sphere_centers: Floats  # (3, k)
    sphere_radii: Floats  # (k,)
    material_of: Ints  # (m + k,) material of each primitive
    light_of: Ints  # (m + k + 1,) light of each primitive, and at the end that of a miss; -1 for none
    shines: Bools  # (m + k + 1,) whether there is one
    materials: Materials
    absorption: Floats | None  # (3, materials) per unit of length; None when nothing absorbs
    opacities: Opacities | None  # None when every surface is all there
    lights: LightTable
    black_lights: Bools | None  # (lights,) those whose surface scatters nothing; None when there are none
    uneven: Uneven | None  # the lights that do not shine evenly; None when all do
    instances: InstanceTable | None = None  # None when every mesh is placed once

    @property
    def interpolates(self) -> bool:
        """Whether anything varies between the corners of triangles."""
        return bool(self.attributes) or self.corner_normals is not None

    def view(self, camera: Camera) -> Camera:
        """Return a camera of the scene in the unit of these arrays.

        Raises
        ------
        SceneError
            If it is so far away that float32 cannot measure its distance.
        """
        check_distance("Camera origin", camera.origin, self.centre / self.scale, self.scale)
        return camera.scaled(self.scale)


def compile_scene(
    scene: Scene,
    make_accelerator: Any,
    light_choice: str = "place",
    most_copies: int = 0,
    mis: bool = False,
) -> CompiledScene:
    """Gather a scene into flat arrays.

    Parameters
    ----------
    scene
        What to render.
    make_accelerator
        Called with the `Geometry`; returns the `Accelerator`.
    light_choice
        How one light of many is chosen: "place", "power" or "uniform".
    most_copies
        Up to so many triangles in all, each instance is built as a mesh of its own.
    mis
        Whether light samples are weighted against BSDF samples, so that they may leave out light from
        all around, which those find better.

    Raises
    ------
    SceneError
        If an emitting shape has no area, an emitting sphere has an alpha or shines by a texture, a light
        is too far away or too strong for the scene's size, or the choice is unknown.
    """
    scene.check()
    low, high = scene.bounds
    radius = float(np.linalg.norm(high - low)) / 2
    scale = length_factor(radius)
    check_lights(scene.lights, (low + high) / 2, scale)
    low, high, radius = low * scale, high * scale, radius * scale
    centre = (low + high) / 2
    meshes, spheres, instances = resolve(scaled_shapes(scene.shapes, scale), most_copies)
    placed: list[Shape] = [*meshes, *spheres, *instances]
    shared = list({id(instance.mesh): instance.mesh for instance in instances}.values())
    once = sum(len(mesh.faces) for mesh in meshes)
    corners = [(mesh.vertices - centre).take(mesh.faces, 0) for mesh in meshes]
    corners += [own_frame(mesh).take(mesh.faces, 0) for mesh in shared]
    meshes += shared
    triangles = np.concatenate(corners) if corners else np.zeros((0, 3, 3))
    user_materials, material_of, replaced = _number_materials(meshes, spheres, instances)
    attributes = {name: corner_values(name, meshes) for name in _attributes_read(placed)}
    lights, light_of, environment = _gather_lights(
        scene, scale, meshes, spheres, corners, centre, (high - low) / 2, light_choice, mis
    )
    centers = np.array([s.center - centre for s in spheres]).reshape(-1, 3).T.astype(f4)
    radii = np.array([s.radius for s in spheres]).astype(f4)
    smooth = any(mesh.normals is not None for mesh in meshes)
    triangles32 = np.ascontiguousarray(triangles, f4)
    partly = _partly_there(user_materials, material_of, meshes, instances)
    black_lights = _black_lights(user_materials, material_of, light_of, len(lights))
    light_of = np.append(light_of, environment)
    weights = bool(attributes) or smooth
    normals = _face_normals(triangles)
    alike = None if weights else _alike(material_of[:once], light_of[:once])
    geometry = Geometry(triangles32[:once], np.ascontiguousarray(centers), radii, weights, alike)
    accelerator, table = make_accelerator(geometry), None
    if shared:
        placements, table = place(instances, shared, centre, once, len(spheres), replaced)
        none = np.zeros((3, 0), f4), np.zeros(0, f4)
        ends = np.cumsum([len(mesh.faces) for mesh in shared])
        parts = np.split(triangles32[once:], ends[:-1])
        built = [make_accelerator(Geometry(part, *none, weights)) for part in parts]
        accelerator = InstanceAccelerator(accelerator, built, placements)
    return CompiledScene(
        scale=scale,
        centre=centre,
        radius=radius,
        accelerator=accelerator,
        triangles=len(triangles),
        normals=normals,
        corner_normals=_corner_normals(meshes, normals),
        attributes=attributes,
        sphere_centers=geometry.centers,
        sphere_radii=geometry.radii,
        material_of=material_of,
        light_of=light_of,
        shines=light_of >= 0,
        materials=group_materials(user_materials),
        absorption=_absorption(user_materials),
        opacities=_opacities(user_materials, partly),
        lights=lights,
        black_lights=black_lights,
        uneven=_uneven(meshes, len(lights), light_of),
        instances=table,
    )


def _alike(material_of: Ints, light_of: Ints) -> Bools:
    """Tell which triangles (m,) look like the next, where no attribute varies over them."""
    same = np.zeros(material_of.size, np.bool_)
    same[:-1] = (np.diff(material_of) == 0) & (np.diff(light_of) == 0)
    return same


def group_materials(materials: Sequence[Bsdf]) -> Materials:
    """Merge materials that differ only in the values of constant parameters into one group each.

    The merged material finds its values in a `Palette`, so a scene of a hundred plain colours is
    shaded as one group. Groups that have only delta lobes come last.
    """
    members: dict[object, list[int]] = {}
    for i, material in enumerate(materials):
        members.setdefault(_group_key(material), []).append(i)
    group_of = np.empty(len(materials), np.intp)
    ordered = sorted(members.values(), key=lambda numbers: materials[numbers[0]].specular)
    for group, numbers in enumerate(ordered):
        group_of[numbers] = group
    groups = tuple(_merge(materials, numbers) for numbers in ordered)
    reliefs = tuple((number, bsdf.relief) for number, bsdf in enumerate(groups) if bsdf.relief is not None)
    return Materials(group_of, groups, reliefs)


def _absorption(materials: Sequence[Bsdf]) -> Floats | None:
    """Return the absorption behind the surfaces of each material, (3, materials), if there is any.

    Raises
    ------
    SceneError
        If one is a texture: it belongs to the space inside, not to the surface.
    """
    table = np.zeros((3, len(materials)), f4)
    for i, material in enumerate(materials):
        value = material.absorption
        if isinstance(value, Spatial):
            raise SceneError(f"{type(material).__name__} absorption must be a colour, not a texture")
        table[:, i] = np.ravel(value)
    return table if table.any() else None


def _opacities(materials: Sequence[Bsdf], partly: Bools) -> Opacities | None:
    """Return how much of the surfaces is there, None when all of them are."""
    if not partly.any():
        return None
    constant, varying = np.ones(len(materials), f4), []
    for i, material in enumerate(materials):
        if material.opacity is None:
            continue
        if material.opacity.constant is None:
            varying.append((i, material.opacity))
        else:
            constant[i] = material.opacity.constant
    return Opacities(partly, constant, varying)


def _partly_there(
    materials: Sequence[Bsdf], material_of: Ints, meshes: Sequence[Mesh], instances: Sequence[Instance]
) -> Bools:
    """Tell which primitives (m + k + 1,) are only partly there in some place; a miss, at the end, is not."""
    partly = np.array([material.opacity is not None for material in materials], np.bool_)
    found = np.append(partly.take(material_of), False)
    placed = {id(shape.mesh) for shape in instances if shape.material.opacity is not None}
    start = 0
    for mesh in meshes:
        end = start + len(mesh.faces)
        found[start:end] |= id(mesh) in placed
        start = end
    return found


def _black_lights(materials: Sequence[Bsdf], material_of: Ints, light_of: Ints, lights: int) -> Bools | None:
    """Tell which lights (lights,) are surfaces of a black material; None when none is."""
    black = np.array([material.black for material in materials], np.bool_).take(material_of)
    found = np.zeros(lights, np.bool_)
    found[light_of.compress(black & (light_of >= 0))] = True
    return found if found.any() else None


def _is_constant(value: object) -> bool:
    return isinstance(value, np.ndarray) and value.dtype == f4 and value.shape in ((3, 1), (1,))


def _group_key(material: Bsdf) -> object:
    """Materials with equal keys may be merged; one with a texture stands alone."""
    parameters = {
        name: value for name, value in vars(material).items() if name not in ("opacity", "emission")
    }
    if not all(_is_constant(v) or isinstance(v, bool | int | float | str) for v in parameters.values()):
        return id(material)
    shapes = tuple((k, v.shape if _is_constant(v) else v) for k, v in sorted(parameters.items()))
    return type(material), material.specular, shapes


def _merge(materials: Sequence[Bsdf], numbers: list[int]) -> Bsdf:
    first = materials[numbers[0]]
    if len(numbers) == 1:
        return first
    merged = copy(first)
    for name, value in vars(first).items():
        values = [getattr(materials[number], name) for number in numbers]
        if _is_constant(value) and not all(np.array_equal(value, other) for other in values):
            table = np.zeros((*value.shape[:-1], len(materials)), f4)
            table[..., numbers] = np.concatenate(values, -1)
            vars(merged)[name] = Palette(table)
    return merged


def _attributes_read(shapes: Sequence[Shape]) -> list[str]:
    """Return the names of what materials read; warn of meshes that lack what theirs reads.

    Raises
    ------
    SceneError
        If a parameter reads what does not exist.
    """
    read: set[str] = set()
    lacking: dict[str, dict[int, str]] = {}  # what -> the meshes that lack it, by identity, with their names
    seen: set[tuple[int, int]] = set()  # meshes and materials of instances
    of_material: dict[int, set[str]] = {}
    for shape in shapes:
        if isinstance(shape, Instance):
            pair = id(shape.mesh), id(shape.material)
            if pair in seen:
                continue
            seen.add(pair)
        mesh = shape.mesh if isinstance(shape, Instance) else shape
        glow = shape.emission.reads if isinstance(shape.emission, Spatial) else ()
        if id(shape.material) not in of_material:
            of_material[id(shape.material)] = _reads(shape.material)
        for name in sorted(of_material[id(shape.material)].union(glow)):
            if name not in ATTRIBUTES:
                known = ", ".join(ATTRIBUTES)
                raise SceneError(f"{shape.name}: its material reads {name!r}; it must be one of {known}")
            read.add(name)
            if isinstance(mesh, Mesh) and ATTRIBUTES[name].given(mesh) is None:
                lacking.setdefault(ATTRIBUTES[name].title, {})[id(mesh)] = shape.name
    for title, names in lacking.items():
        warnings.warn(
            f"{len(names)} meshes lack the {title} that their materials read, "
            f"first: {next(iter(names.values()))!r}",
            stacklevel=5,
        )
    return sorted(read)


def _reads(material: Bsdf | Opacity) -> set[str]:
    """Return the names of the attributes that the parameters of a material read."""
    out: set[str] = set()
    for value in vars(material).values():
        if isinstance(value, Spatial | Relief):
            out.update(value.reads)
        elif isinstance(value, Bsdf | Opacity):
            out.update(_reads(value))
    return out


def _number_materials(
    meshes: Sequence[Mesh], spheres: Sequence[Sphere], instances: Sequence[Instance]
) -> tuple[list[Bsdf], Ints, Ints | None]:
    """Return the distinct materials, and the numbers of each row's and of each instance's.

    An instance that has the material of its mesh has the number -1; when all have, there are none.
    """
    numbers: dict[int, int] = {}
    materials: list[Bsdf] = []
    of_shape: list[int] = []
    shapes: list[Shape] = [*meshes, *spheres, *instances]
    for shape in shapes:
        if id(shape.material) not in numbers:
            numbers[id(shape.material)] = len(materials)
            materials.append(shape.material)
        of_shape.append(numbers[id(shape.material)])
    rows = len(meshes) + len(spheres)
    counts = [len(mesh.faces) for mesh in meshes] + [1] * len(spheres)
    of_row = np.repeat(np.array(of_shape[:rows], np.intp), counts)
    own = [instance.material is not instance.mesh.material for instance in instances]
    replaced = np.where(own, np.array(of_shape[rows:], np.intp), -1) if any(own) else None
    return materials, of_row, replaced


def _face_normals(triangles: NDArray[np.float64]) -> Floats:
    """Return the unit normals of triangles (m, 3, 3), (3, m); 0 where they have no area."""
    a, b, c = np.ascontiguousarray(triangles.transpose(1, 2, 0))
    normal = cross(b - a, c - a)
    size = length(normal)
    return (normal / np.where(size > 0, size, 1)).astype(f4)


def _corner_normals(meshes: Sequence[Mesh], normals: Floats) -> tuple[Floats, Floats, Floats] | None:
    """Return the shading normals at the three corners; flat meshes and zero normals get the face's."""
    if all(mesh.normals is None for mesh in meshes):
        return None
    corners = normals.copy(), normals.copy(), normals.copy()
    start = 0
    for mesh in meshes:
        end = start + len(mesh.faces)
        if mesh.normals is not None:
            given = np.ascontiguousarray(mesh.normals.T)
            size = length(given)
            given = (given / np.where(size > 0, size, 1)).astype(f4)
            for corner, vertex in zip(corners, mesh.faces.T, strict=True):
                np.copyto(corner[:, start:end], given.take(vertex, 1), where=size.take(vertex) > 0)
        start = end
    return corners


def _gather_lights(
    scene: Scene,
    scale: float,
    meshes: Sequence[Mesh],
    spheres: Sequence[Sphere],
    corners: Sequence[NDArray[np.float64]],
    centre: NDArray[np.float64],
    half_size: NDArray[np.float64],
    choice: str,
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
        alike = [(faces, record) for faces, record in area_lights if type(record) is kind]
        number = count
        for faces, _ in alike:
            light_of[faces] = number + np.arange(faces.shape[1])
            number += faces.shape[1]
        add(kind, [record for _, record in alike])
    for sphere in spheres:
        if isinstance(sphere.emission, Spatial):
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
            SphereLights((s.center - centre).astype(f4).reshape(3, 1), np.array([s.radius], f4), s.emission)
            for s in spheres
            if s.emission is not None
        ],
    )
    groups: dict[type[Light], list[Any]] = {}
    infinite: list[InfiniteLight] = []
    for light in scene.lights:
        record = (light if scale == 1 else light.scaled(scale)).record(centre)
        if isinstance(record, InfiniteLight):
            infinite.append(record.compensated() if mis else record)
        else:
            groups.setdefault(type(record), []).append(record)
    for record_type, records in groups.items():
        add(record_type, records)
    environment = count if infinite else -1
    if infinite:
        kinds.append(Sky.of(infinite))
    return LightTable(kinds, half_size, choice), light_of, environment


def _uneven(meshes: Sequence[Mesh], lights: int, light_of: Ints) -> Uneven | None:
    """Return the lights that do not shine evenly, None when all do."""
    uneven = Uneven(np.full(lights, -1, np.intp), np.full(lights, -1, np.intp), [])
    numbers: dict[tuple[int, bool], int] = {}
    start = 0
    for mesh in meshes:
        end = start + len(mesh.faces)
        if mesh.emission is not None and is_uneven(mesh):
            key = id(mesh.emission), mesh.two_sided
            if key not in numbers:
                numbers[key] = len(numbers)
                uneven.sources.append(Source(mesh.emission, mesh.two_sided))
            triangles = start + np.flatnonzero(light_of[start:end] >= 0)
            number = light_of.take(triangles)
            uneven.triangle[number], uneven.source[number] = triangles, numbers[key]
        start = end
    return uneven if uneven.sources else None


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
    even = shining[~np.array([is_uneven(mesh) for mesh in meshes])[mesh_of[shining]]]
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
    if is_uneven(mesh):
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
