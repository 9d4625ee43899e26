"""Types of entities, the table of those that are converted, and spectra of their parameters."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ...arrays.vec import luminance
from ...bsdfs.dielectric import dispersed
from ...colors.spectrum import blackbody, spectrum_rgb
from ...core.errors import SceneError
from ...core.suggestions import did_you_mean
from ...shapes.transform import Matrix
from ..description.conversion import Conversion
from ..description.entity import Entity, Table
from ..spectra import METALS
from .parser import NUMBERS, Parameter

NEUTRAL, WARM = ("stdillum-D65", "illum-acesD60"), "stdillum-A"
# of glasses: index at 587.6 nm and Abbe number, by Schott's and Hoya's data sheets
GLASSES = {"BK7": (1.5168, 64.2), "BAF10": (1.67, 47.1), "FK51A": (1.4866, 84.5), "LASF9": (1.8503, 32.2)}
GLASSES |= {"F5": (1.6727, 32.2), "F10": (1.7283, 28.4), "F11": (1.7847, 25.8)}
BRASS = ((0.444, 0.527, 1.094), (3.695, 2.765, 1.829))  # CuZn, at 650, 550 and 450 nm
# spectra of indices as RGB
NAMED = {f"glass-{name}": dispersed(*lines) for name, lines in GLASSES.items()}
for _name, _both in (METALS | {"CuZn": BRASS}).items():
    NAMED |= {f"metal-{_name}-eta": np.array(_both[0]), f"metal-{_name}-k": np.array(_both[1])}
TABLE = Table("pbrt", harmless={"shape": "alpha"})  # it is read with the material
converts, unsupported = TABLE.converts, TABLE.unsupported


def retype(entity: Entity, type: str) -> None:
    """Give an entity a type, which messages name."""
    entity.retype(type)
    named = f" {entity.name!r}" if entity.name else ""
    entity.title = f"{entity.variant} {entity.kind} {type!r}{named}".lstrip()


def placement(entity: Entity) -> Matrix:
    """Return the matrix of an entity to the scene."""
    matrix: Matrix = entity.job.world @ entity.matrix
    return matrix


def values_of(parameter: Parameter) -> Any:
    """Return the values of a parameter: (n,) numbers, rows (n, k) of vectors or colors, or a list."""
    if parameter.type == "bool":
        return [word == "true" for word in parameter.values]
    count = NUMBERS.get(parameter.type, 1)
    return parameter.values if count == 1 else parameter.values.reshape(-1, count)


def spectrum(entity: Entity, name: str, default: Any, use: str = "albedo") -> Any:
    """Return a number, or a color (3,); `use` is "albedo", "light" or "unbounded".

    Light of a spectrum or a black body has the luminance 1, as in pbrt; that of an rgb has its own.
    """
    return entity.or_default(default, lambda: _spectrum(entity, name, default, use))


def _spectrum(entity: Entity, name: str, default: Any, use: str) -> Any:
    values = entity.get(name, None, *SPECTRA)
    return default if values is None else SPECTRA[entity.types[name]](entity, name, values, use)


def _rgb(entity: Entity, name: str, values: Any, use: str) -> Any:
    high = 1.0 if use == "albedo" else np.inf
    color = entity.lost.within(name, np.ravel(values[:1]), 0.0, high, entity.label)
    return float(color[0]) if entity.types[name] == "float" else color


def _black_body(entity: Entity, name: str, values: Any, use: str) -> Any:
    return _shining(blackbody(float(values[0])), use)


def _sampled(entity: Entity, name: str, values: Any, use: str) -> Any:
    """Return the color of a name, a file, pairs of wavelength and value, or one value for all."""
    if isinstance(values[0], str):
        return _named(entity, name, values[0], use)
    if len(values) == 1:
        return np.ones(3) if use == "light" else float(values[0])
    if len(values) % 2:
        raise SceneError(f"{name} has {len(values)} numbers; it must be pairs of wavelength and value")
    return _of_pairs(values.reshape(-1, 2), use)


def _named(entity: Entity, name: str, label: str, use: str) -> Any:
    """Return the color of a spectrum that pbrt knows, or of a file."""
    if label == WARM:
        return _shining(blackbody(2856.0), use)
    if use == "light" and "illum-" in label:
        if label not in NEUTRAL:
            entity.lose(f"{name} {label!r}; white in its place")
        return np.ones(3)
    return NAMED[label] if label in NAMED else _of_pairs(entity.job.spectrum(label), use)


def _of_pairs(pairs: Any, use: str) -> Any:
    return _shining(spectrum_rgb(pairs, emission=use == "light", bounded=use == "albedo"), use)


def _shining(color: Any, use: str) -> Any:
    """Return a color; that of light has the luminance 1."""
    bright = float(luminance(color))
    return color / bright if use == "light" and bright > 0 else color


# types of parameters that may be a spectrum
SPECTRA: dict[str, Callable[[Entity, str, Any, str], Any]] = {
    "rgb": _rgb,
    "color": _rgb,
    "spectrum": _sampled,
    "blackbody": _black_body,
    "float": _rgb,
}


@dataclass
class Job(Conversion):
    """The conversion of one scene."""

    table = TABLE
    named: dict[tuple[str, str], Entity] = field(default_factory=dict)  # by kind and name
    film: Any = None  # the size of the picture, and its crop
    exposure: float = 1.0  # factor of all light, by the film
    world: Matrix = field(default_factory=lambda: np.eye(4))  # to the space of the scene: may mirror
    around: Any = None  # the medium where the camera stands
    insides: set[str] = field(default_factory=set)  # names of the media inside of shapes

    def refer(self, kind: str, name: str) -> Entity:
        """Return a named entity."""
        if (kind, name) not in self.named:
            hint = did_you_mean(name, [known for of, known in self.named if of == kind])
            raise SceneError(f"there is no {kind} {name!r}{hint}")
        return self.named[kind, name]

    def medium(self, name: str) -> Any:
        """Return a medium by its name; None where there is none."""
        return self.convert(self.refer("medium", name)) if name else None
