"""The groups of lights: for which layer of radiance each light counts, and by which efficacy for lux."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterator, Sequence
from dataclasses import replace
from typing import Generic, NamedTuple, TypeVar

import numpy as np

from ..arrays.soa import soa
from ..arrays.vec import Doubles, Floats, Ints
from ..colors import EFFICACY
from ..core.errors import number
from ..film.aov_names import DEFAULT_GROUP, group_name
from ..lights import EnvironmentSum, InfiniteLight, Light, PatchedEnvironment, SkyPatches
from ..shapes import CurvedShape, Mesh

PATCHED = -2  # the group of an environment whose patches are groups

K = TypeVar("K", bound=Hashable)  # key of a group: its number, or its name


class LightKey(NamedTuple):
    """The key by which lights are put into groups."""

    group: str
    efficacy: float  # lm/W


BY_DEFAULT = LightKey(DEFAULT_GROUP, EFFICACY)  # light of media


@soa
class LightGroups(Generic[K]):
    """The group of each light of a scene, and of the parts of its environment."""

    names: tuple[K, ...]
    of_light: Ints  # (lights,) number of the group; -1 of an environment of several groups, PATCHED
    environment: tuple[tuple[K, InfiniteLight], ...]  # the groups of the environment, and their lights
    patches: SkyPatches | None = None  # of an environment each of whose patches is a group, the first ones

    @property
    def need_directions(self) -> bool:
        """Whether the group of light depends on where it comes from."""
        return len(self.environment) > 1 or self.patches is not None

    def with_light(self, name: K) -> LightGroups[K]:
        """Return the groups with one more light, the last one, in the group of this name."""
        names = self.names if name in self.names else (*self.names, name)
        return replace(self, names=names, of_light=np.append(self.of_light, names.index(name)))

    def parts_of_environment(self, wi: Floats, time: Doubles | None) -> Iterator[tuple[K, Floats]]:
        """Yield each group of the environment, and its part (3, n) of the radiance from wi (3, n).

        `time` (n,) is when the light comes; None where nothing moves.
        """
        radiances = [light.le_at(wi, time) for _, light in self.environment]
        total = np.zeros_like(wi)
        for radiance in radiances:
            total += radiance
        total[total == 0] = 1
        for (name, _), radiance in zip(self.environment, radiances, strict=True):
            yield name, radiance / total


def primitive_count(shape: Mesh | CurvedShape) -> int:
    """Return the number of triangles, or other primitives, of a shape."""
    return len(shape.faces) if isinstance(shape, Mesh) else shape.count


class GroupNumbers:
    """Numbers the groups of the lights of a scene, while its table of lights is built."""

    def __init__(self) -> None:
        self._numbers: dict[LightKey, int] = {}
        self._of_light: list[Ints] = []
        self._environment: list[tuple[LightKey, InfiniteLight]] = []

    def number(self, light: Light) -> int:
        """Return the number of the key of a light.

        Raises
        ------
        SceneError
            If the group of a light is no name, or its efficacy is not above 0.
        """
        return self._number(_key(light))

    def default(self) -> int:
        """Return the number of light of media."""
        return self._number(BY_DEFAULT)

    def of_shapes(self, shapes: Sequence[Mesh | CurvedShape]) -> Ints:
        """Return the group of each primitive of shapes; -1 for dark shapes."""
        keys = [LightKey(shape.material.group, shape.material.efficacy) for shape in shapes]
        numbers = [
            -1 if shape.emission is None else self._number(key)
            for shape, key in zip(shapes, keys, strict=True)
        ]
        return np.repeat(np.array(numbers, np.intp), [primitive_count(shape) for shape in shapes])

    def add(self, numbers: Ints) -> None:
        """Add the next lights of the table by their numbers (k,)."""
        self._of_light.append(numbers)

    def add_to_environment(self, light: Light, record: InfiniteLight) -> None:
        """Add a part of the environment."""
        self.number(light)
        self._environment.append((_key(light), record))

    def _number(self, key: LightKey) -> int:
        return self._numbers.setdefault(key, len(self._numbers))

    def groups(self) -> LightGroups[str]:
        """Return the groups by their names; the environment is the last light."""
        by_name = self._by(lambda key: key.group)
        if len(by_name.environment) != 1 or not isinstance(by_name.environment[0][1], PatchedEnvironment):
            return by_name
        patched = by_name.environment[0][1]
        of_light = np.append(by_name.of_light[:-1] + len(patched.names), PATCHED)
        return LightGroups((*patched.names, *by_name.names), of_light, (), patched.patches)

    def efficacies(self) -> LightGroups[float]:
        """Return the lights by their efficacy, lm/W; the environment is the last light."""
        return self._by(lambda key: key.efficacy)

    def _by(self, name_of: Callable[[LightKey], K]) -> LightGroups[K]:
        """Return the groups of lights by their names, as `name_of` gives them."""
        names = tuple(dict.fromkeys(map(name_of, self._numbers)))
        group = np.array([names.index(name_of(key)) for key in self._numbers], np.intp)
        of_light = group.take(np.concatenate([np.zeros(0, np.intp), *self._of_light]))
        joined: dict[K, list[InfiniteLight]] = {}
        for key, light in self._environment:
            joined.setdefault(name_of(key), []).append(light)
        parts = tuple((name, EnvironmentSum.of(lights)) for name, lights in joined.items())
        if parts:
            of_light = np.append(of_light, names.index(parts[0][0]) if len(parts) == 1 else -1)
        return LightGroups(names, of_light, parts)


def _key(light: Light) -> LightKey:
    name = type(light).__name__
    efficacy = number(f"{name} efficacy", light.efficacy, lambda x: x > 0, "above 0 lm/W")
    return LightKey(group_name(f"{name} group", light.group), efficacy)
