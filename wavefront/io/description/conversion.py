"""The conversion of the entities of a scene, each once, with replacements for damaged ones."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from copy import copy
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar, TypeVar

from ...bsdfs import Diffuse, Measured
from ...core.errors import LimitError, SceneError
from ...core.plural import plural
from ...lights import Environment, Light, Sky
from ...materials import Material
from ...media import Isotropic
from ...shapes import Shape, Sphere
from ...textures.base import BaseTexture
from ...textures.image import StoredImage
from ..losses import Losses
from ..repair import RawMesh
from ..sources import GRAY as GRAY_PIXEL
from ..sources import SceneFiles
from ..spectra import read_spectrum
from .appearance import null_surface
from .entity import Entity, Table

MOST_INCLUDED = 15  # files inside each other
GRAY = Material(Diffuse(0.5))
# the replacement of an entity that is not supported, by its kind, and the words for it in the warning
INSTEAD: dict[str, tuple[Any, str]] = {
    **dict.fromkeys(("bsdf", "material"), (GRAY, "a gray Diffuse in its place")),
    **dict.fromkeys(("rfilter", "filter"), ({}, "the default in its place")),
    "texture": (0.5, "0.5 in its place"),
    "integrator": ({}, "path tracing in its place"),
    "phase": (Isotropic(), "isotropic in its place"),
    "shape": ((), "left out"),
    "sampler": ({}, "the default in its place"),
}
T = TypeVar("T")


class PlacedError(SceneError):
    """An error whose message names its place in a file."""


@contextmanager
def placed(place: str, name: str = "") -> Iterator[None]:
    """Give errors a place, unless they have one; the name or file that they begin with is left out."""
    try:
        yield
    except PlacedError:
        raise
    except SceneError as error:
        message = str(error).removeprefix(f"{name}: ").removeprefix(f"{place.rpartition(' line ')[0]}: ")
        raise PlacedError(f"{place}: {message}") from error


def check_included(place: str, files: SceneFiles, count: int, depth: int) -> None:
    """Refuse a file that is included where there are too many, or too many inside each other."""
    most = files.limits.includes
    if count > most:
        error = LimitError(f"{place}: includes more than {most} files; the limit is LoadLimits.includes")
        raise PlacedError(str(error)) from error
    if depth == MOST_INCLUDED:
        raise PlacedError(f"{place}: files include each other; the limit is {MOST_INCLUDED} levels")


@dataclass
class Conversion:
    """The conversion of one scene."""

    table: ClassVar[Table]  # the types of the format

    name: str  # for messages
    files: SceneFiles
    find: Callable[[str], Path]  # the path of a file that the scene names
    read_mesh: Callable[[Path], list[RawMesh]]
    made: dict[Any, Any] = field(default_factory=dict)  # the objects of entities
    making: list[Entity] = field(default_factory=list)  # being converted, each within the one before
    triangles: int = 0
    instances: int = 0
    instead: dict[str, tuple[Any, str]] = field(default_factory=lambda: dict(INSTEAD))

    def convert(self, entity: Entity) -> Any:
        """Return the object that an entity becomes; the same object for the same entity."""
        if entity not in self.made:
            if entity in self.making:
                raise SceneError(f"{entity.label}: refers to itself")
            self.making.append(entity)
            try:
                self.made[entity] = self._sound(entity)
            finally:
                self.making.pop()
        return self.made[entity]

    def _sound(self, entity: Entity) -> Any:
        """Return the object of an entity; of a damaged one its replacement, which is noted."""
        if entity.kind == "scene":
            with placed(entity.label, self.name):
                return self.converted(entity)
        try:
            with placed(entity.label, self.name):
                return self.converted(entity)
        except SceneError:
            make, done = self.stand_in(entity)
            with self.files.losses.part(entity.label, done):
                raise
        return make()

    def stand_in(self, entity: Entity) -> tuple[Callable[[], Any], str]:
        """Return a function that makes the replacement of a damaged entity, and the words for its note."""
        replacement, done = self.instead.get(entity.kind, (None, "left out"))
        return lambda: replacement, done

    def converted(self, entity: Entity) -> Any:
        """Return the object of an entity, and note the parameters that have no effect."""
        maker = self.table.find(entity.kind, entity.type)
        if maker.convert is None:
            return self.replaced(entity)
        entity.check()
        converted = maker.convert(entity)
        entity.report()
        return converted

    def replaced(self, entity: Entity) -> Any:
        """Return the replacement of an entity that is not supported, which is noted."""
        replacement, what = self.instead.get(entity.kind, (None, "left out"))
        entity.lose(what)
        return replacement

    def once(self, key: Any, make: Callable[[], Any]) -> Any:
        """Return the object of a key, made at the first call."""
        if key not in self.made:
            self.made[key] = make()
        return self.made[key]

    def changed(self, material: Material, **parts: Any) -> Material:
        """Return a material with other parts; the same object for the same parts."""

        def make() -> tuple[Material, Any]:
            other = copy(material)
            for name, value in parts.items():
                setattr(other, name, value)
            other.derive()
            return other, (material, parts)  # these are kept, as the key has their ids

        values = (value if isinstance(value, float) else id(value) for value in parts.values())
        changed_material: Material = self.once((id(material), *parts, *values), make)[0]
        return changed_material

    def picture(self, entity: Entity, reference: str, instead: StoredImage = GRAY_PIXEL) -> StoredImage:
        """Return the image whose file an entity names; a gray one if it is missing or damaged."""
        read = lambda: self.files.stored(self.find(reference))  # noqa: E731
        return self.files.shown(reference, read, entity.label, instead) or instead

    def measured(self, entity: Entity) -> Measured:
        """Return the BSDF of the measured material whose file an entity names."""
        path = self.find(entity.text("filename", ""))
        bsdf: Measured = self.once(
            ("measured", path), lambda: Measured.from_bytes(str(path), self.files.read(path))
        )
        return bsdf

    def spectrum(self, reference: str) -> list[tuple[float, float]]:
        """Return the wavelengths and values of a file."""
        path = self.find(reference)
        return read_spectrum(path, self.files.read(path))

    def count(self, faces: Any) -> None:
        """Count triangles, and refuse them if there are too many in all."""
        self.triangles += len(faces)
        self.files.limits.check_triangles(self.name, self.triangles)

    def count_instances(self, count: int) -> None:
        """Count instances, and refuse them if there are too many in all."""
        self.instances += count
        most = self.files.limits.instances
        if self.instances > most:
            raise LimitError(f"there are more than {most} instances; the limit is LoadLimits.instances")


def only_one(lights: Sequence[Light], losses: Losses) -> list[Light]:
    """Return lights with the first `Environment` alone; others are noted."""
    around = [light for light in lights if isinstance(light, Environment)]
    if len(around) > 1:
        further = plural(len(around) - 1, "further light from all around", "further lights from all around")
        losses.note(further, done="left out")
    return [light for light in lights if light not in around[1:]]


def shown(shapes: list[Shape], lights: Sequence[Light], losses: Losses) -> list[Shape]:
    """Return the shapes of a scene; an invisible sphere if it has nothing but light from far away.

    Raises
    ------
    SceneError
        If there is neither.
    """
    if shapes:
        return shapes
    if not any(isinstance(light, Environment | Sky) for light in lights):
        raise losses.nothing("has no shapes")
    return [Sphere((0, 0, 0), 1, material=null_surface(), name="nothing")]


def textures_in(root: Any, kind: type[T] = BaseTexture) -> list[T]:  # type: ignore[assignment]
    """Return the textures of a kind that a material, a BSDF or a tuple of these holds."""
    visited: dict[int, Any] = {}
    waiting = [root]
    while waiting:
        node = waiting.pop()
        if id(node) not in visited and (isinstance(node, tuple) or hasattr(node, "__dict__")):
            visited[id(node)] = node
            inside = (
                () if isinstance(node, kind) else node if isinstance(node, tuple) else vars(node).values()
            )
            waiting += inside
    return [node for node in visited.values() if isinstance(node, kind)]
