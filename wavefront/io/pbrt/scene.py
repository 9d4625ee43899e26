"""Scenes of pbrt as scenes of this package: the statements in order, with their graphics state."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from ...arrays.vec import Doubles
from ...core.errors import SceneError
from ...motion import Keyframes, Motion, Product
from ...sampling.filters import GaussianFilter
from ...shapes.transform import Matrix, rotation, translation
from ..description.contents import Contents
from ..description.conversion import placed, shown
from ..description.entity import Entity
from ..description.views import looking
from ..repair import RawMesh
from ..sources import SceneFiles
from . import lights, materials, textures  # noqa: F401  they fill the table
from .entities import Job, retype, values_of
from .older import upgrade
from .parser import STATEMENTS, Parameter, Statement, statements
from .shapes import place, place_object
from .views import exposure_of, mirror_of

KINDS = {"Camera": "camera", "Film": "film", "Sampler": "sampler", "Integrator": "integrator"}
TARGETS = ("shape", "light", "material", "medium", "texture")
HARMLESS = "disablepixeljitter disabletexturefiltering disablewavelengthjitter msereferenceimage"
HARMLESS += " msereferenceout rendercoordsys seed pixelstats wavefront displacementedgescale"
MOST_OPEN = 4096  # attribute blocks inside each other


@dataclass(frozen=True, eq=False)
class State:
    """The graphics state, which holds for the shapes that follow."""

    matrices: Doubles = field(
        default_factory=lambda: np.tile(np.eye(4), (2, 1, 1))
    )  # when it begins and ends
    active: tuple[int, ...] = (0, 1)  # which of them transforms change
    reverse: bool = False
    material: Any = None  # an entity, or the name of one
    area: Entity | None = None
    inside: str = ""
    outside: str = ""
    defaults: dict[str, dict[str, Parameter]] = field(default_factory=dict)  # by target of Attribute


class Reader:
    """Carries out the statements of a scene.

    Parameters
    ----------
    job
        What they go to.
    """

    def __init__(self, job: Job) -> None:
        self.job, self.state, self.stack = job, State(), list[tuple[str, str, State]]()
        self.spaces: dict[str, Doubles] = {}
        self.options: dict[str, Entity] = {}
        self.shapes: list[Entity] = []
        self.lights: list[Entity] = []
        self.objects: dict[str, list[Entity]] = {}
        self.uses: dict[str, list[Doubles]] = {}  # places of objects, when they begin and end
        self.times = (0.0, 1.0)  # of both
        self.moves = False  # whether anything does
        self.ends: dict[int, Doubles] = {}  # (2, 4, 4) of entities that move, by their ids
        self.open_object: str | None = None
        self.in_world = False

    def run(self, statement: Statement) -> None:
        """Carry out a statement.

        Raises
        ------
        SceneError
            If it cannot be where it is, or what it names is not there.
        """
        name = statement.name
        wanted = STATEMENTS[name].in_world
        if wanted is not None and wanted != self.in_world:
            raise SceneError(f"{name} must come {'after' if wanted else 'before'} WorldBegin")
        if name in TRANSFORMS:
            self._transform(TRANSFORMS[name](statement.numbers), whole=name in ("Identity", "Transform"))
        else:
            getattr(self, f"_{name}")(statement)

    def finish(self) -> Contents:
        """Return the contents of the file."""
        job = self.job
        for name, where, _ in self.stack:
            job.files.losses.note(f"{name} has no end", where, done="it ends with the file")
        camera, film = self.options.get("Camera"), self.options.get("Film")
        # of pbrt, where nothing is stated
        settings = {"filter": GaussianFilter(windowed=True), "spp": 16, "max_bounces": 5}
        job.exposure = exposure_of(film, camera)
        if camera is not None:
            job.world = mirror_of(camera)
            with job.files.losses.part(camera.label):
                job.around = job.medium(camera.state.outside)
            job.film = ((1280, 720), None) if film is None else job.convert(film)
        for name in ("Sampler", "Integrator", "PixelFilter"):
            if name in self.options:
                settings |= job.convert(self.options[name])
        every = [*self.shapes, *(entity for entities in self.objects.values() for entity in entities)]
        job.insides = {entity.state.inside for entity in every}
        shapes = [self._moved(entity, shape) for entity in self.shapes for shape in place(entity)]
        for name, uses in self.uses.items():
            shapes += self._placed(name, np.array(uses))
        lamps = [
            self._moved(entity, light) for entity in self.lights if (light := job.convert(entity)) is not None
        ]
        lamps = lights.summed(lamps, job.files.losses)
        view = None if camera is None else self._moved(camera, job.convert(camera))
        shapes = shown(shapes, lamps, job.files.losses)
        if self.moves and camera is not None:  # as pbrt shows it
            open_, close = camera.number("shutteropen", 0.0), camera.number("shutterclose", 1.0)
            settings |= {"shutter": (open_, close)} if open_ < close else {}
        return Contents(lights=lamps, camera=view, shapes=shapes, settings=settings, medium=job.around)

    def _entity(
        self, kind: str, statement: Statement, target: str, type: str, name: str = "", variant: str = ""
    ) -> Entity:
        parameters = self.state.defaults.get(target, {}) | statement.parameters
        values = {key: values_of(parameter) for key, parameter in parameters.items()}
        entity = Entity(kind, type, name, statement.place, values, self.job, variant=variant)
        entity.types = {key: parameter.type for key, parameter in parameters.items()}
        entity.unread.difference_update(key for key, parameter in parameters.items() if parameter.optional)
        entity.matrix, entity.state = self.state.matrices[0], self.state
        retype(entity, type)
        if type:
            upgrade(entity)
        return entity

    def _moved(self, entity: Entity, converted: Any) -> Any:
        """Return the object of an entity; it moves between its transforms as AnimatedTransform of pbrt."""
        ends = self.ends.get(id(entity))
        if ends is None or converted is None:
            return converted
        with self.job.files.losses.part(entity.label, "its motion left out; it stands where it begins"):
            moving = converted.transformed(self._between(ends))
            self.moves = True
            return moving
        return converted

    def _between(self, ends: Doubles) -> Motion:
        """Return the motion from where something stands at its first transform, in the space of the scene."""
        world = self.job.world
        return Product(Keyframes(self.times, world @ ends), np.linalg.inv(world @ ends[0]))

    def _placed(self, name: str, uses: Doubles) -> list[Any]:
        """Return the shapes of an object at all its places (n, 2, 4, 4), when these begin and end."""
        still = np.array([np.array_equal(*ends) for ends in uses])
        shapes: list[Any] = place_object(self.objects[name], self.job, uses[still, 0]) if still.any() else []
        for ends in uses[~still]:
            moving = place_object(self.objects[name], self.job, ends[:1])
            with self.job.files.losses.part(f"ObjectInstance {name!r}", "its motion left out"):
                moving = [shape.transformed(self._between(ends)) for shape in moving]
                self.moves = True
            shapes += moving
        return shapes

    def _noted(self, entity: Entity) -> Entity:
        """Return an entity, and keep the two transforms between which it moves, if it does."""
        if not np.array_equal(*self.state.matrices):
            if self.open_object is None:
                self.ends[id(entity)] = self.state.matrices
            else:
                entity.lose("its motion in an object; it stands where it begins")
        return entity

    def _set(self, **changes: Any) -> None:
        self.state = replace(self.state, **changes)

    def _transform(self, matrix: Matrix, whole: bool) -> None:
        matrices = self.state.matrices.copy()
        for i in self.state.active:
            with np.errstate(over="ignore", invalid="ignore"):
                matrices[i] = matrix if whole else matrices[i] @ matrix
        if not np.isfinite(matrices).all() or (np.abs(matrices) > 1e100).any():
            raise SceneError("the transform has elements that are too large")
        if not (matrices[:, 3] == (0, 0, 0, 1)).all():
            raise SceneError(
                f"the transform has the last row {matrices[0, 3].tolist()}; it must be [0, 0, 0, 1]"
            )
        self._set(matrices=matrices)

    def _push(self, statement: Statement) -> None:
        if len(self.stack) == MOST_OPEN:
            raise SceneError(f"blocks are nested deeper than {MOST_OPEN}")
        self.stack.append((statement.name, statement.place, self.state))

    def _pop(self, statement: Statement) -> None:
        begin = statement.name.replace("End", "Begin")
        if not self.stack or self.stack[-1][0] != begin:
            raise SceneError(f"{statement.name} has no {begin}")
        self.state = self.stack.pop()[2]

    _AttributeBegin = _TransformBegin = _push
    _AttributeEnd = _TransformEnd = _pop

    def _WorldBegin(self, statement: Statement) -> None:
        self.in_world = True
        self._set(matrices=State().matrices, active=(0, 1))
        self.spaces["world"] = self.state.matrices

    def _CoordinateSystem(self, statement: Statement) -> None:
        self.spaces[statement.words[0]] = self.state.matrices

    def _CoordSysTransform(self, statement: Statement) -> None:
        if statement.words[0] not in self.spaces:
            raise SceneError(f"there is no coordinate system {statement.words[0]!r}")
        self._set(matrices=self.spaces[statement.words[0]])

    def _ActiveTransform(self, statement: Statement) -> None:
        times = {"StartTime": (0,), "EndTime": (1,), "All": (0, 1)}
        if statement.words[0] not in times:
            raise SceneError(
                f"ActiveTransform is {statement.words[0]!r}; it must be one of {', '.join(times)}"
            )
        self._set(active=times[statement.words[0]])

    def _ReverseOrientation(self, statement: Statement) -> None:
        self._set(reverse=not self.state.reverse)

    def _Attribute(self, statement: Statement) -> None:
        target = statement.words[0]
        if target not in TARGETS:
            raise SceneError(f"Attribute is for {target!r}; it must be one of {', '.join(TARGETS)}")
        optional = {
            name: replace(parameter, optional=True) for name, parameter in statement.parameters.items()
        }
        defaults = self.state.defaults.get(target, {}) | optional
        self._set(defaults=self.state.defaults | {target: defaults})

    def _ColorSpace(self, statement: Statement) -> None:
        if statement.words[0] != "srgb":
            what = f"ColorSpace {statement.words[0]!r}; 'srgb' in its place"
            self.job.files.losses.note(what, statement.place)

    def _Option(self, statement: Statement) -> None:
        name, value = statement.words
        if name.lower() not in HARMLESS.split() and value != "false":
            self.job.files.losses.note(f"Option {name!r}", statement.place)

    def _TransformTimes(self, statement: Statement) -> None:
        start, end = statement.numbers
        if not start < end:
            raise SceneError(f"TransformTimes is {start:g} {end:g}; the end must be after the start")
        self.times = float(start), float(end)

    def _Accelerator(self, statement: Statement) -> None:
        """Do nothing: pictures do not depend on it."""

    def _option(self, statement: Statement) -> None:
        kind = KINDS.get(statement.name, "filter")
        entity = self._entity(kind, statement, "", statement.words[0])
        if statement.name == "Camera":
            if (np.abs(np.linalg.det(self.state.matrices[:, :3, :3])) < 1e-300).any():
                raise SceneError("the transform of the camera is singular")
            places = np.asarray(np.linalg.inv(self.state.matrices), np.float64)
            entity.matrix, self.spaces["camera"] = places[0], places
            if not np.array_equal(*places):
                self.ends[id(entity)] = places
        self.options[statement.name] = entity

    _Camera = _Film = _Sampler = _Integrator = _PixelFilter = _option

    def _Texture(self, statement: Statement) -> None:
        name, kind, type = statement.words
        if kind not in ("float", "spectrum", "color"):
            raise SceneError(f"the texture {name!r} is of {kind!r}; it must be of float or spectrum")
        variant = "spectrum" if kind == "color" else kind
        entity = self._entity("texture", statement, "texture", type, name, variant)
        self._name(f"{variant} texture", name, entity)

    def _name(self, kind: str, name: str, entity: Entity) -> None:
        if self.job.named.setdefault((kind, name), entity) is not entity:
            raise SceneError(f"there is a {kind} {name!r} already")

    def _Material(self, statement: Statement) -> None:
        type = statement.words[0] or "interface"  # as in pbrt
        self._set(material=self._entity("material", statement, "material", type))

    def _make(self, statement: Statement) -> None:
        """Note a named material or medium, whose type is a parameter."""
        target = statement.name.removeprefix("MakeNamed").lower()
        entity = self._entity(target, statement, target, "", statement.words[0])
        retype(entity, entity.text("type", ""))
        if not entity.type:
            raise SceneError(f"{statement.name} {entity.name!r} has no type")
        del entity.values["type"], entity.types["type"]
        upgrade(entity)
        self._name(target, entity.name, entity)

    _MakeNamedMaterial = _MakeNamedMedium = _make

    def _NamedMaterial(self, statement: Statement) -> None:
        self._set(material=statement.words[0])

    def _MediumInterface(self, statement: Statement) -> None:
        self._set(inside=statement.words[0], outside=statement.words[-1])

    def _LightSource(self, statement: Statement) -> None:
        self.lights.append(self._noted(self._entity("light", statement, "light", statement.words[0])))

    def _AreaLightSource(self, statement: Statement) -> None:
        self._set(area=self._entity("area light", statement, "light", statement.words[0]))

    def _Shape(self, statement: Statement) -> None:
        entity = self._noted(self._entity("shape", statement, "shape", statement.words[0]))
        (self.shapes if self.open_object is None else self.objects[self.open_object]).append(entity)

    def _ObjectBegin(self, statement: Statement) -> None:
        name = statement.words[0]
        if self.open_object is not None:
            raise SceneError("ObjectBegin is inside another object")
        if name in self.objects:
            raise SceneError(f"there is an object {name!r} already")
        self._push(statement)
        self.open_object, self.objects[name] = name, []

    def _ObjectEnd(self, statement: Statement) -> None:
        self._pop(statement)
        self.open_object = None

    def _ObjectInstance(self, statement: Statement) -> None:
        name = statement.words[0]
        if self.open_object is not None:
            raise SceneError("ObjectInstance is inside an object")
        if name not in self.objects:
            raise SceneError(f"there is no object {name!r}")
        self.uses.setdefault(name, []).append(self.state.matrices)


def read_scene(files: SceneFiles, data: bytes, read_mesh: Callable[[Path], list[RawMesh]]) -> Contents:
    """Return the contents of a file.

    Parameters
    ----------
    files
        The files that it may read.
    data
        Its content.
    read_mesh
        Returns the meshes of a ply file.

    Raises
    ------
    SceneError
        If nothing of it can be shown, or a limit is passed. What is damaged is noted with file and line.
    """
    reader = Reader(Job(files.name, files, files.existing, read_mesh))
    reader.job.instead["film"] = ((1280, 720), None), "the default in its place"
    for statement in statements(files, Path(files.name), data):
        with files.losses.part(statement.place), placed(statement.place):
            reader.run(statement)
    with placed(files.name):
        return reader.finish()


def _look_at(numbers: list[float]) -> Matrix:
    """Return the matrix to a camera, whose axes are right, up and ahead: a left-handed space."""
    return np.asarray(np.linalg.inv(looking("LookAt", *np.reshape(numbers, (3, 3)))), np.float64)


TRANSFORMS: dict[str, Callable[[list[float]], Matrix]] = {
    "Identity": lambda numbers: np.eye(4),
    "Translate": lambda numbers: translation("Translate", numbers),
    "Scale": lambda numbers: np.diag([*numbers, 1.0]),
    "Rotate": lambda numbers: rotation("Rotate", numbers[1:], numbers[0], (0, 0, 0)),
    "LookAt": _look_at,
    "Transform": lambda numbers: np.reshape(numbers, (4, 4)).T,
    "ConcatTransform": lambda numbers: np.reshape(numbers, (4, 4)).T,
}
