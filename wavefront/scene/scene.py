"""Scenes: shapes, lights and a camera, as the user puts them together."""

from __future__ import annotations

import os
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping, Sequence
from copy import copy
from typing import Any, ClassVar, Self, SupportsIndex, TypeAlias, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from ..accel import AcceleratorCache
from ..arrays.elementary import sin_cos
from ..arrays.vec import Bools, Doubles
from ..camera import Camera, ImageSize, check_camera, field_of_view, image_size, upward
from ..camera.framing import FILL, Balls, fitting_offset, turned_balls
from ..core.errors import SceneError, finite_array, in_brief, mapping, number
from ..core.plural import plural
from ..core.suggestions import Answers, did_you_mean, suggests_keywords
from ..lights import Environment, Light
from ..media import BaseMedium
from ..motion import Moving
from ..shapes import Group, Instance, Mesh, PrimitiveArray, Shape
from ..shapes.instance import instance_bounds, instance_hulls, kinds_of, of_class, unshaded
from .file_moments import FileMoments
from .html import scene_html
from .loss import Loss
from .moments import MOMENTS, Moments

AUTO = "auto"
FRAMING_FOV = 40.0  # degrees
# directions from the center of a scene to its framing camera, where y is up
VIEWS = {
    "three_quarter": (0.5736, 0.4040, 0.8192),  # 35° to the right of the front, 22° above
    "front": (0.0, 0.0, 1.0),
    "back": (0.0, 0.0, -1.0),
    "left": (-1.0, 0.0, 0.0),
    "right": (1.0, 0.0, 0.0),
    "top": (0.0, 1.0, 0.0),
    "bottom": (0.0, -1.0, 0.0),
    "iso": (1.0, 1.0, 1.0),
}
VIEW_NAMES = {"isometric": "iso", "side": "right"}  # other names of views
FRAMING_VIEW = "three_quarter"
FLAT = 0.15  # of things: thickness relative to their second largest extent
BROAD = 0.766  # cosine, of 40°, between the view of a flat thing and the normal of its broad side, at least
MIN_DISTANCE = 1e-2  # of a framing camera from the center, in radii of the scene


class Scene(Answers):
    """Shapes, lights and a camera.

    Parameters
    ----------
    shapes
        `Mesh`, `Sphere`, `Spheres`, `Cylinders`, `Capsules`, `SignedDistanceGrid`, `Instance` and `Group`
        objects, and what functions such as `Rectangle` return; shapes with an emission are lights. Objects of
        trimesh are converted.
    lights
        `PointLight`, `SpotLight`, `DirectionalLight` and `Environment` objects, or any `Light`; at most one
        `Environment`. A scene without light is lit as in a studio: see `render`.
    camera
        Without a camera, `render` uses `framing_camera`.
    up
        The up direction for that camera, for ready-made light and for the ground: (3,), or the name of an
        axis. None is y. `load` sets it to z for formats that have z up.
    settings
        Settings of `render` by name, such as `spp` and `max_bounces`: those of the scene's file. They count
        where none are given for a render; `spp` not where `noise`, `seconds` or `samples` is given.
    medium
        A `Medium` that fills all space around the shapes, such as fog. It has no end, so no light at infinity
        gets through what absorbs or scatters. None: nothing.

    Notes
    -----
    Everything may be changed between renders. Values that are assigned or added to the lists are checked as
    in the constructor. The accelerator of a render is kept with the scene, and is used again as long as no
    vertex and no sphere has moved.

    A scene in which something moves is also a still one, that of its start: `render` shows this one. `at`
    gives the scene of another time. Framing, ready-made light and ground are those of all its times.

    Attributes
    ----------
    moves, start, end, duration
        Whether something moves, from when to when, and how long, seconds.
    animations
        Names of the animations of its file, of which `load` reads one.
    moment
        The time of a scene that `at` returned; None for others.
    losses
        What of its file a scene does not show as the file says: a tuple of `Loss`. It is empty for a scene
        made in Python.

    Raises
    ------
    SceneError
        If there is no shape, or an element is of the wrong type.

    Examples
    --------
    >>> floor = wf.Rectangle((-1, 0, 1), (2, 0, 0), (0, 0, -2))
    >>> scene = wf.Scene([floor], lights=[wf.PointLight((0, 2, 0), 10)])
    >>> scene.add(wf.Sphere((0, 0.5, 0), 0.5)).bounds
    array([[-1.,  0., -1.],
           [ 1.,  1.,  1.]])
    """

    @suggests_keywords
    def __init__(
        self,
        shapes: Iterable[Any] | Any,
        lights: Iterable[Light] | Light = (),
        camera: Camera | None = None,
        *,
        up: ArrayLike | None = None,
        settings: Mapping[str, Any] | None = None,
        medium: BaseMedium | None = None,
    ) -> None:
        self.shapes = shapes
        self.lights = lights
        self.camera = camera
        self.up = up
        self.settings = mapping("Scene settings", settings)
        self.medium = medium
        self.losses: tuple[Loss, ...] = ()  # parts of its file that it does not show as the file says
        self.lights_of_file: list[int] | None = None  # their ids, where it was read from a file
        self.animations: tuple[str, ...] = ()
        self.moment: float | None = None
        self.file_moments: FileMoments | None = None  # where its file is read anew for each time
        self._whole: Scene | None = None  # of which this is a moment
        self._moments: Moments | None = None  # the shapes that move, once they were asked for
        self._reach: Doubles | None = None
        self.accelerators = AcceleratorCache()  # of the last render, for the next one
        self.check()

    def __repr__(self) -> str:
        """Return the numbers of shapes and lights."""
        return (
            f"<Scene: {plural(len(self.shapes), 'shape')}, {plural(len(self.lights), 'light')}, "
            f"camera={self.camera is not None}>"
        )

    def _repr_html_(self) -> str:
        """Show counts, bounds, materials and lights in a notebook."""
        return scene_html(self.shapes, self.lights, self.camera, self.bounds if self.shapes else None)

    @property
    def shapes(self) -> list[Shape]:
        """The shapes of the scene."""
        return self._shapes

    @shapes.setter
    def shapes(self, shapes: Any) -> None:
        self._shapes = Shapes(shapes)

    @property
    def lights(self) -> list[Light]:
        """The lights of the scene, besides emitting shapes."""
        return self._lights

    @lights.setter
    def lights(self, lights: Any) -> None:
        self._lights = Lights(lights)

    @property
    def camera(self) -> Camera | None:
        """The camera; None means `framing_camera`."""
        return self._camera

    @camera.setter
    def camera(self, camera: Camera | None) -> None:
        self._camera = check_camera("camera", camera)

    @property
    def up(self) -> Doubles | None:
        """The up direction, (3,) of any length; None means y."""
        return self._up

    @up.setter
    def up(self, up: ArrayLike | None) -> None:
        self._up = None if up is None else upward("up", up)

    @property
    def medium(self) -> BaseMedium | None:
        """The medium that fills all space around the shapes; None for nothing."""
        return self._medium

    @medium.setter
    def medium(self, medium: BaseMedium | None) -> None:
        if medium is not None and not isinstance(medium, BaseMedium):
            raise SceneError(f"medium must be a Medium such as wf.Medium(scattering=0.1), got {medium!r}")
        self._medium = medium

    @suggests_keywords
    def vertical(self, up: ArrayLike = AUTO) -> Doubles:
        """Return the up direction (3,), of any length, given a vector, the name of an axis, or "auto"."""
        if isinstance(up, str) and up == AUTO:
            return upward("up", "y") if self.up is None else self.up
        return upward("up", up)

    def add(self, *items: Any) -> Self:
        """Add shapes, objects of trimesh, and lights; return the scene.

        Raises
        ------
        SceneError
            If an item is something else, or a second `Environment`; the scene is then unchanged.
        """
        shapes = Shapes([item for item in items if not isinstance(item, Light)])
        lights = Lights([*self.lights, *(item for item in items if isinstance(item, Light))])
        _check_environments(lights)
        self.shapes.extend(shapes)
        self._lights = lights
        return self

    def check(self) -> None:
        """Check the scene as a whole.

        Raises
        ------
        SceneError
            If there is no shape, more than one `Environment`, or a face with an invalid index.
        """
        if not self.shapes:
            raise SceneError("the scene has no shapes")
        _check_environments(self.lights)
        for shape in kinds_of(self.shapes)[0]:
            if isinstance(shape, Mesh | PrimitiveArray):
                shape.check()

    # --- Time -----------------------------------------------------------------------------------------

    @property
    def _moving(self) -> Moments:
        """The shapes that move."""
        if self._moments is None or not self._moments.fits(self.shapes):
            self._moments, self._reach = Moments(self.shapes), None
        return self._moments

    @property
    def start(self) -> float:
        """When something begins to move, seconds; 0 if nothing does."""
        return self._span()[0]

    @property
    def end(self) -> float:
        """When all motions are over, seconds; 0 if there are none."""
        return self._span()[1]

    @property
    def duration(self) -> float:
        """How long something moves, seconds."""
        start, end = self._span()
        return end - start

    @property
    def moves(self) -> bool:
        """Whether a shape, a light or the camera moves or deforms."""
        return self.file_moments is not None or any(seen.moves for seen in self._seen) or self._moving.any

    @property
    def _seen(self) -> list[Moving]:
        """Lights and camera."""
        return [*self.lights, *([] if self.camera is None else [self.camera])]

    def _span(self) -> tuple[float, float]:
        spans = [*self._moving.spans, *(seen.time_span for seen in self._seen if seen.moves)]
        spans += [] if self.file_moments is None else [self.file_moments.span]
        return min(span[0] for span in spans or [(0.0, 0.0)]), max(span[1] for span in spans or [(0.0, 0.0)])

    def at(self, time: float) -> Scene:
        """Return the scene at a time, in which nothing moves.

        Still objects are shared with this scene: meshes, textures, and the trees of the last render. The
        first call looks for motions; further ones take 0.1 to 0.2 s for 100 000 moving instances.

        Parameters
        ----------
        time
            Seconds. Before and after the keys of a motion, its first and its last one hold.

        Raises
        ------
        SceneError
            If the time is not finite, or nothing is left to be seen at it.

        Examples
        --------
        >>> fall = wf.Keyframes([0, 0.5], [(0, 2, 0), (0, 0, 0)])
        >>> ball = wf.Sphere((0, 0, 0), 1).transformed(fall)
        >>> scene = wf.Scene([ball, wf.Plane((0, -1, 0), (0, 1, 0))])
        >>> scene.at(0.25).shapes[0].center.tolist()
        [0.0, 1.0, 0.0]
        """
        time, moving = number("time", time), self._moving
        if not (moving.any or self.file_moments is not None or any(seen.moves for seen in self._seen)):
            return self
        moment = self._moment(time)
        if moment is None:
            raise SceneError(f"at {time:g} s the scene has no shapes: all of them have no size")
        return moment

    def _moment(self, time: float) -> Scene | None:
        """Return the scene at a time, s; None where no shape has a size."""
        if self.file_moments is not None:
            shapes, lights, camera = self.file_moments.at(self, time)
        else:
            shapes, lights = self._moving.at(time), [light.at(time) for light in self.lights]
            camera = None if self.camera is None else self.camera.at(time)
        if not shapes:
            return None
        moment = copy(self)
        moment._shapes, moment._lights = _checked(Shapes, shapes), _checked(Lights, lights)
        moment._camera = camera
        if self.has_lights_of_file:
            moment.lights_of_file = [id(light) for light in moment._lights]
        moment.moment, moment._whole, moment._moments, moment.file_moments = time, self, None, None
        return moment

    @property
    def whole(self) -> Scene:
        """The scene with all its times, of which this one may be a moment."""
        return self._source

    @property
    def changed(self) -> Bools | None:
        """Which shapes of a moment are not those of the scene itself, (n,); None where it is no moment."""
        if self._whole is None:
            return None
        own = set(map(id, self._whole.shapes))
        return np.array([id(shape) not in own for shape in self.shapes])

    @property
    def _source(self) -> Scene:
        """The scene with all times: this one, or the one that it is a moment of."""
        return self if self._whole is None else self._whole

    @property
    def _samples(self) -> Iterable[Scene]:
        """Scenes of some times, which together reach as far as the shapes ever do."""
        source = self._source
        if source.file_moments is not None:
            return source.file_moments.samples(source)
        if not source._moving.any:
            return [self]
        plain = copy(source)
        plain._shapes, plain._moments = Shapes([unshaded(shape) for shape in source.shapes]), None
        moments = (plain._moment(time) for time in np.linspace(*source._span(), MOMENTS))  # not all at once
        return (moment for moment in moments if moment is not None)

    @property
    def reach(self) -> Doubles:
        """The bounds (2, 3) of all times of the scene, or of the one that it is a moment of."""
        source = self._source
        if not source._moving.any and source.file_moments is None:
            return self.bounds
        if source._reach is None:
            source._reach = _around(source._boxes())
        return source._reach

    def _boxes(self) -> Doubles:
        """Return the bounds (n, 2, 3) of all shapes at some times; of those that stand still, once."""
        own, seen, boxes = set(map(id, self.shapes)), set[int](), []
        for moment in self._samples:
            there = set(map(id, moment.shapes))
            seen |= there & own
            boxes.append(_boxes_of([shape for shape in moment.shapes if id(shape) not in own]))
        return np.concatenate([*boxes, _boxes_of([shape for shape in self.shapes if id(shape) in seen])])

    # --- Where it is ----------------------------------------------------------------------------------

    @property
    def bounds(self) -> Doubles:
        """Lower and upper corner of all shapes, (2, 3), scene units."""
        return _around(_boxes_of(self.shapes))

    @property
    def has_lights_of_file(self) -> bool:
        """True if it was read from a file that need not say all of the light, and has its lights."""
        return self.lights_of_file is not None and self.lights_of_file == [id(light) for light in self.lights]

    @property
    def emits(self) -> bool:
        """True if the scene has any light, also of a medium that glows."""
        kinds, _ = kinds_of(self.shapes)
        media = [self.medium, *(shape.material.interior for shape in kinds)]
        shines = any(shape.emission is not None for shape in kinds)
        return bool(self.lights) or shines or any(medium.glows for medium in media if medium is not None)

    @suggests_keywords
    def framing_camera(
        self,
        fov: float = FRAMING_FOV,
        size: ImageSize = (512, 512),
        *,
        up: ArrayLike = AUTO,
        direction: ArrayLike = FRAMING_VIEW,
        turning: bool = False,
    ) -> Camera:
        """Return a camera that frames the scene: it fills 85 % of the picture's width or height.

        Parameters
        ----------
        fov
            Vertical field of view, degrees.
        size
            (width, height) in pixels.
        up
            Up direction of the picture: (3,), or the name of an axis; "auto" is that of the scene. With "y"
            the front is the side of +z, with "z" that of -y.
        direction
            The view: "three_quarter" (35° to the right of the front and 22° above), "front",
            "back", "left", "right", "top", "bottom" or "iso"; or (3,) from the center of the scene to the
            camera, of any length.
        turning
            Leave space for a whole turn of the scene about the vertical through its center, as for
            `turntable`.

        Raises
        ------
        SceneError
            If an argument is malformed or out of range.
        """
        shapes = self._source.shapes
        framed = [shape for shape in shapes if shape.framed]
        if framed and len(framed) < len(shapes):
            return Scene(framed).framing_camera(fov, size, up=up, direction=direction)
        size = image_size(size)
        fov = field_of_view(fov)
        turn = turned_up(self.vertical(up))
        view = view_direction("direction", direction)
        if isinstance(direction, str):
            view = turn @ view
        low, high = self.reach
        middle, reach = (low + high) / 2, float(np.linalg.norm(high - low)) / 2 or 1.0
        camera_up = turn[:, 1]
        # seen from above or below, the front is at the bottom of the picture
        if np.linalg.norm(np.cross(camera_up, view)) < 1e-6:
            camera_up = -turn[:, 2] * np.sign(view @ camera_up)
        axes = Camera.look_at(middle + view * reach, middle, camera_up).rotation
        centers, radii = self._hull()
        balls = (centers - middle, radii)
        if turning:
            balls = turned_balls(balls, turn)
        sin, cos = sin_cos(np.float64(np.radians(fov) / 2))
        half = FILL * float(sin / cos)
        x, y, z = fitting_offset(balls, axes, (half * size[0] / size[1], half))
        target, distance = middle + axes[:, 0] * x + axes[:, 1] * y, max(z, MIN_DISTANCE * reach)
        return Camera.look_at(target + axes[:, 2] * distance, target, axes[:, 1], fov, size=size)

    def chosen_view(self, up: ArrayLike = AUTO) -> Doubles | str:
        """Return the view of a camera that frames the scene where none is given: a name, or a direction (3,).

        It is "three_quarter". Of a flat scene without light of its own it is turned towards the broad side,
        and from above if that is level.
        """
        if self.emits:
            return FRAMING_VIEW
        shapes = self._source.shapes
        framed = [shape for shape in shapes if shape.framed]
        if framed and len(framed) < len(shapes):
            return Scene(framed, up=self.up).chosen_view(up)
        turn = turned_up(self.vertical(up))
        view, normal = turn @ view_direction("view", FRAMING_VIEW), _flat_normal(*self._hull())
        if normal is None or abs(view @ normal) >= BROAD:
            return FRAMING_VIEW
        height = normal @ turn[:, 1]
        normal = normal * np.sign(height if abs(height) > 0.2 else view @ normal or 1.0)
        sideways = view - (view @ normal) * normal
        sideways /= np.linalg.norm(sideways)
        return np.asarray(BROAD * normal + np.sqrt(1 - BROAD * BROAD) * sideways)

    def _hull(self) -> Balls:
        """Return balls whose convex hull holds all shapes, at all times."""
        centers, radii = zip(*(moment._hull_now() for moment in self._samples), strict=True)
        return np.concatenate(centers), np.concatenate(radii)

    def _hull_now(self) -> Balls:
        hulls = [shape.hull() for shape in self.shapes if not isinstance(shape, Instance)]
        instances = [shape for shape in self.shapes if isinstance(shape, Instance)]
        hulls += [(points, np.zeros(len(points))) for points in instance_hulls(instances)]
        return np.concatenate([centers for centers, _ in hulls]), np.concatenate(
            [radii for _, radii in hulls]
        )


def boxes_over_time(shapes: Sequence[Shape], times: Iterable[float]) -> list[Doubles]:
    """Return the box (2, 3) around shapes that move, at each time at which one of them has a size."""
    moments = Moments(shapes)
    return [_around(_boxes_of(there)) for there in map(moments.at, times) if there]


def _boxes_of(shapes: Sequence[Shape]) -> Doubles:
    """Return the bounds (n, 2, 3) of shapes, in any order."""
    instances = of_class(shapes, Instance)
    others = () if len(instances) == len(shapes) else shapes
    alone = [shape.bounds for shape in others if not isinstance(shape, Instance)]
    return np.concatenate([np.array(alone).reshape(-1, 2, 3), instance_bounds(instances)])


def _around(boxes: Doubles) -> Doubles:
    """Return the box (2, 3) around others (n, 2, 3)."""
    return np.stack([boxes[:, 0].min(0), boxes[:, 1].max(0)])


def _flat_normal(points: Doubles, radii: Doubles) -> Doubles | None:
    """Return the unit normal (3,) of the broad side of balls (n, 3), (n,); None where they are not flat."""
    middle = points - points.mean(0)
    size = float(np.abs(middle).max())
    if not size > 0 or len(points) < 3:
        return None
    _, axes = np.linalg.eigh((middle / size).T @ (middle / size))
    along = middle @ axes
    thin, other, _ = np.sort((along + radii[:, None]).max(0) - (along - radii[:, None]).min(0))
    normal = np.round(axes[:, 0], 6)  # the same on all processors
    return normal / np.sqrt((normal * normal).sum()) if thin < FLAT * other else None


def view_direction(name: str, view: ArrayLike) -> Doubles:
    """Return the unit direction (3,) of a view, from its name, where y is up, or from a vector.

    Raises
    ------
    SceneError
        If there is no such view, or the vector is malformed or zero.
    """
    if isinstance(view, str):
        plain = view.strip().lower().replace(" ", "_").replace("-", "_")
        view = VIEW_NAMES.get(plain, plain if plain in VIEWS else view)
        if view not in VIEWS:
            known = ", ".join(VIEWS)
            hint = did_you_mean(view, VIEWS)
            raise SceneError(f"{name} is {view!r}; it must be a direction (3,), or one of {known}{hint}")
        view = VIEWS[view]
    direction = finite_array(name, view, (3,))
    if not direction.any():
        raise SceneError(f"{name} is {direction.tolist()}; it must not be zero")
    direction = direction / np.abs(direction).max()
    return direction / np.linalg.norm(direction)


C = TypeVar("C", bound="CheckedList[Any]")
T = TypeVar("T")
Importer: TypeAlias = Callable[..., Scene]  # of an object, and `smooth` as for `load`
_IMPORTERS: dict[str, Importer] = {}  # by the package of an object's class


def register_importer(package: str, convert: Importer) -> None:
    """Let scenes take objects of a package's classes in place of shapes.

    Parameters
    ----------
    package
        First part of the name of the modules that define the classes.
    convert
        Called with an object, and with `smooth` where that is given; returns a scene, whose shapes are used.
    """
    _IMPORTERS[package] = convert


def importer(item: Any) -> Importer | None:
    """Return the function that converts an object of another package to a scene, or None."""
    if isinstance(item, np.ndarray):  # trimesh and PyVista have classes of their own for arrays, too
        return None
    packages = (kind.__module__.split(".")[0] for kind in type(item).__mro__)
    return next((_IMPORTERS[package] for package in packages if package in _IMPORTERS), None)


class CheckedList(list[T], ABC):
    """A list that checks and converts its elements.

    Parameters
    ----------
    items
        A list, or a single element.
    """

    name: ClassVar[str]
    allowed: ClassVar[str]  # for messages

    def __init__(self, items: Any = ()) -> None:
        super().__init__()
        self.extend([items] if self.converted(items) is not None else items)

    @abstractmethod
    def converted(self, item: Any) -> list[T] | None:
        """Return the elements for an item, None if the item is not allowed."""

    @abstractmethod
    def hint(self, item: Any) -> str:
        """Return where an item belongs that is not allowed here, for messages; "" where that is unknown."""

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
        """Return the elements for items; `first` is the index of the first one in the list, for messages."""
        if isinstance(items, str | dict) or not isinstance(items, Iterable):
            hint = self.hint(items)
            raise SceneError(f"{self.name} must be a list of {self.allowed}, got {in_brief(items)}{hint}")
        checked: list[T] = []
        for at, item in enumerate(items, first):
            elements = self.converted(item)
            if elements is None:
                what, hint = in_brief(item), self.hint(item)
                raise SceneError(f"{self.name}[{at}] is {what}; it must be one of {self.allowed}{hint}")
            checked += elements
        return checked


class Shapes(CheckedList[Shape]):
    """The shapes of a scene."""

    name = "shapes"
    allowed = (
        "wf.Mesh, wf.Rectangle, wf.Disk, wf.Sphere, wf.Spheres, wf.Cylinders, wf.Capsules, "
        "wf.SignedDistanceGrid, wf.Instance, wf.Group, or a mesh or scene of trimesh"
    )

    def converted(self, item: Any) -> list[Shape] | None:
        """Return a shape, or those of a group or of an object of another package."""
        if isinstance(item, Shape | Group):
            return list(item) if isinstance(item, Group) else [item]
        convert = importer(item)
        return None if convert is None else convert(item).shapes

    def hint(self, item: Any) -> str:
        """Return where lights and files belong."""
        if isinstance(item, Light):
            return "; lights are given as lights=[...]"
        return "; wf.load(path) reads a file as a scene" if isinstance(item, str | os.PathLike) else ""


class Lights(CheckedList[Light]):
    """The lights of a scene."""

    name = "lights"
    allowed = (
        "wf.PointLight, wf.SpotLight, wf.DirectionalLight, wf.Environment, wf.PointLights, or a wf.Light of "
        "your own"
    )

    def converted(self, item: Any) -> list[Light] | None:
        """Return a light."""
        return [item] if isinstance(item, Light) else None

    def hint(self, item: Any) -> str:
        """Return where shapes and cameras belong."""
        if isinstance(item, Camera):
            return "; a camera is given as camera=..."
        return "; emitting shapes belong to the shapes" if isinstance(item, Shape) else ""


def _checked(kind: type[C], items: Iterable[Any]) -> C:
    """Return a list whose elements have been checked."""
    checked = kind.__new__(kind)
    list.extend(checked, items)
    return checked


def _check_environments(lights: Sequence[Light]) -> None:
    if sum(isinstance(light, Environment) for light in lights) > 1:
        raise SceneError("the scene has more than one Environment; at most one is allowed")


def turned_up(up: Doubles) -> Doubles:
    """Return the shortest rotation (3, 3) that takes +y to the direction of `up` (3,)."""
    up = up / np.abs(up).max()
    up = up / np.linalg.norm(up)
    cos = up[1]
    if cos < -1 + 1e-12:
        return np.diag([1.0, -1.0, -1.0])
    x, _, z = np.cross((0.0, 1.0, 0.0), up)
    skew = np.array([[0.0, -z, 0.0], [z, 0.0, -x], [0.0, x, 0.0]])
    return np.eye(3) + skew + skew @ skew / (1 + cos)
