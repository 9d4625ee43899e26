"""What statements make: their parameters, and the table of those that are converted."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, TypeVar

import numpy as np

from ...arrays.vec import Doubles, luminance
from ...bsdfs.dielectric import dispersed
from ...colors.spectrum import blackbody, spectrum_rgb
from ...core.errors import SceneError
from ...core.suggestions import did_you_mean
from ...shapes.transform import Matrix
from ..description.conversion import Conversion, Part
from ..losses import Losses
from ..spectra import METALS
from .parser import NUMBERS, Parameter

NEUTRAL = ("stdillum-D65", "illum-acesD60")
# of glasses: index at 587.6 nm and Abbe number, by Schott's and Hoya's data sheets
GLASSES = {"BK7": (1.5168, 64.2), "BAF10": (1.67, 47.1), "FK51A": (1.4866, 84.5), "LASF9": (1.8503, 32.2)}
GLASSES |= {"F5": (1.6727, 32.2), "F10": (1.7283, 28.4), "F11": (1.7847, 25.8)}
BRASS = ((0.444, 0.527, 1.094), (3.695, 2.765, 1.829))  # CuZn, at 650, 550 and 450 nm
# spectra of indices as RGB
NAMED = {f"glass-{name}": dispersed(*given) for name, given in GLASSES.items()}
for _name, _both in (METALS | {"CuZn": BRASS}).items():
    NAMED |= {f"metal-{_name}-eta": np.array(_both[0]), f"metal-{_name}-k": np.array(_both[1])}
Converter = Callable[["Entity", "Job"], Any]
TABLE: dict[tuple[str, str], Converter | None] = {}  # by kind and type; None: it is not supported
C = TypeVar("C", bound=Converter)


def converts(kind: str, types: str) -> Callable[[C], C]:
    """Put a function that converts entities into the table; the types are a list of words."""

    def add(convert: C) -> C:
        TABLE.update({(kind, name): convert for name in types.split()})
        return convert

    return add


def unsupported(kind: str, types: str) -> None:
    """Put types into the table that pbrt has, and that are not supported."""
    TABLE.update({(kind, name): None for name in types.split()})


@dataclass(eq=False)
class Entity(Part):
    """A shape, a material, a light, ... with its parameters."""

    kind: str  # as "float texture"
    type: str
    place: str  # file and line
    values: dict[str, Parameter]
    lost: Losses  # of all entities
    matrix: Matrix = field(default_factory=lambda: np.eye(4))  # to the world, where it was stated
    state: Any = None  # the graphics state of a shape
    unread: set[str] = field(default_factory=set)
    name: str = ""  # of named ones

    @property
    def label(self) -> str:  # type: ignore[override]
        """Where it is, and what, for messages."""
        return f"{self.place}: {self._what}"

    @property
    def _what(self) -> str:
        return f"{self.kind} {self.type!r}{f' {self.name!r}' if self.name else ''}"

    def lose(self, what: str) -> None:
        """Note something that is not honored."""
        self.lost.note(f"{self._what}: {what}", self.place)

    def get(self, name: str, types: tuple[str, ...]) -> Any:
        """Return the values of a parameter, which must be of one of some types; None if it is absent."""
        self.unread.discard(name)
        given = self.values.get(name)
        if given is None:
            return None
        if given.type not in types:
            raise SceneError(f"{name} is a {given.type}; it must be a {' or '.join(types)}")
        if not len(given.values):
            raise SceneError(f"{name} has no value")
        return given.values

    def harmless(self, names: str) -> None:
        """Note that parameters do not change the picture."""
        self.unread -= set(names.split())

    def array(self, name: str, types: tuple[str, ...]) -> Doubles | None:
        """Return rows of numbers (n, k), or numbers (n,) of a type that is one number; None if absent."""
        found = self.get(name, types)
        count = NUMBERS[types[0]]
        return None if found is None else found if count == 1 else found.reshape(-1, count)

    def one(self, name: str, default: Any, *types: str) -> Any:
        """Return the first value of a parameter of some types."""
        found, count = self.get(name, types), NUMBERS.get(types[0], 1)
        if found is None:
            return default
        if types == ("bool",):
            return found[0] == "true"
        return found[:count] if count > 1 else np.asarray(found).item(0)

    def spectrum(self, name: str, default: Any, job: Job, use: str = "albedo") -> Any:
        """Return a number, or a color (3,); `use` is "albedo", "light" or "unbounded".

        Light of a spectrum or a black body has the luminance 1, as in pbrt; that of an rgb has its own.
        """
        return self.or_default(default, lambda: self._spectrum(name, default, job, use))

    def _spectrum(self, name: str, default: Any, job: Job, use: str) -> Any:
        types = ("rgb", "color", "spectrum", "blackbody", "float")
        found = self.get(name, types)
        if found is None:
            return default
        kind = self.values[name].type
        if kind in ("rgb", "color", "float"):
            color = np.array(found[: NUMBERS[kind]])
            color = self.lost.within(name, color, 0.0, 1.0 if use == "albedo" else np.inf, self.label)
            return float(color[0]) if kind == "float" else color
        if kind == "blackbody":
            color = blackbody(float(found[0]))
        elif isinstance(found[0], str):
            if use == "light" and "illum-" in found[0] and found[0] != "stdillum-A":
                if found[0] not in NEUTRAL:
                    self.lose(f"{name} {found[0]!r}; white in its place")
                return np.ones(3)
            if found[0] == "stdillum-A":
                color = blackbody(2856.0)
            elif found[0] in NAMED:
                return NAMED[found[0]]
            else:
                pairs = job.spectrum(found[0])
                color = spectrum_rgb(pairs, emission=use == "light", bounded=use == "albedo")
        elif len(found) == 1:
            return np.ones(3) if use == "light" else float(found[0])
        else:
            if len(found) % 2:
                raise SceneError(f"{name} has {len(found)} numbers; it must be pairs of wavelength and value")
            pairs = found.reshape(-1, 2)
            color = spectrum_rgb(pairs, emission=use == "light", bounded=use == "albedo")
        bright = float(luminance(color))
        return color / bright if use == "light" and bright > 0 else color


@dataclass
class Job(Conversion[Entity]):
    """The conversion of one scene."""

    named: dict[tuple[str, str], Entity] = field(default_factory=dict)  # by kind and name
    film: Any = None  # the size of the picture, and its crop
    exposure: float = 1.0  # factor of all light, by the film
    world: Matrix = field(default_factory=lambda: np.eye(4))  # to the space of the scene: may mirror
    around: Any = None  # the medium where the camera stands
    insides: set[str] = field(default_factory=set)  # names of the media inside of shapes

    def refer(self, kind: str, name: str) -> Entity:
        """Return a named entity."""
        if (kind, name) not in self.named:
            hint = did_you_mean(name, [each for of, each in self.named if of == kind])
            raise SceneError(f"there is no {kind} {name!r}{hint}")
        return self.named[kind, name]

    def medium(self, name: str) -> Any:
        """Return a medium by its name; None where there is none."""
        return self.convert(self.refer("medium", name)) if name else None

    def converted(self, entity: Entity) -> Any:
        """Return what becomes of an entity."""
        key = (entity.kind.removeprefix("float ").removeprefix("spectrum "), entity.type)
        if key not in TABLE:
            known = [name for kind, name in TABLE if kind == key[0]]
            raise SceneError(f"pbrt has no such {key[0]}{did_you_mean(entity.type, known)}")
        convert = TABLE[key]
        if convert is None:
            return self.replaced(entity, key[0])
        entity.unread = {name for name, given in entity.values.items() if not given.optional}
        if entity.kind == "shape":
            entity.unread.discard("alpha")  # it is read with the material
        made = convert(entity, self)
        for name in entity.values:
            if name in entity.unread:
                entity.lose(name)
        return made
