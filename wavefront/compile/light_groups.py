"""The groups of lights: for which layer of radiance each light counts."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from ..arrays.soa import soa
from ..arrays.vec import Floats, Ints
from ..film.aov_names import DEFAULT_GROUP, group_name
from ..lights import EnvironmentSum, InfiniteLight, Light, PatchedEnvironment, SkyPatches
from ..shapes import CurvedShape, Mesh

PATCHED = -2  # the group of an environment whose patches are groups


@soa
class LightGroups:
    """The group of each light of a scene, and of the parts of its environment."""

    names: tuple[str, ...]
    of_light: Ints  # (lights,) number of the group; -1 of an environment of several groups, PATCHED
    environment: tuple[tuple[str, InfiniteLight], ...]  # the groups of the environment, and what they send
    patches: SkyPatches | None = None  # of an environment each of whose patches is a group, the first ones

    @property
    def need_directions(self) -> bool:
        """Whether the group of light depends on where it comes from."""
        return len(self.environment) > 1 or self.patches is not None

    def with_media(self) -> LightGroups:
        """Return the groups with light of media, number -1, in the default one."""
        names = self.names if DEFAULT_GROUP in self.names else (*self.names, DEFAULT_GROUP)
        return replace(self, names=names, of_light=np.append(self.of_light, names.index(DEFAULT_GROUP)))

    def parts_of_environment(self, wi: Floats) -> Iterator[tuple[str, Floats]]:
        """Yield each group of the environment, and its part (3, n) of the radiance from wi (3, n)."""
        radiances = [light.le(wi) for _, light in self.environment]
        total = np.zeros_like(wi)
        for radiance in radiances:
            total += radiance
        total[total == 0] = 1
        for (name, _), radiance in zip(self.environment, radiances, strict=True):
            yield name, radiance / total


def primitive_count(shape: Mesh | CurvedShape) -> int:
    """Return how many triangles, or other primitives, a shape has."""
    return len(shape.faces) if isinstance(shape, Mesh) else shape.count


class GroupNumbers:
    """Numbers the groups of the lights of a scene, while its table of lights is built."""

    def __init__(self) -> None:
        self._numbers: dict[str, int] = {}
        self._of_light: list[Ints] = []
        self._environment: dict[str, list[InfiniteLight]] = {}

    def number(self, light: Light) -> int:
        """Return the number of the group of a light.

        Raises
        ------
        SceneError
            If the group of a light is no name.
        """
        return self._number(group_name(f"{type(light).__name__} group", light.group))

    def default(self) -> int:
        """Return the number of the default group."""
        return self._number(DEFAULT_GROUP)

    def of_shapes(self, shapes: Sequence[Mesh | CurvedShape]) -> Ints:
        """Return the group of each primitive of shapes; it is -1 of those that are dark."""
        numbers = [-1 if shape.emission is None else self._number(shape.material.group) for shape in shapes]
        return np.repeat(np.array(numbers, np.intp), [primitive_count(shape) for shape in shapes])

    def add(self, numbers: Ints) -> None:
        """Add the next lights of the table by the numbers (k,) of their groups."""
        self._of_light.append(numbers)

    def add_to_environment(self, light: Light, record: InfiniteLight) -> None:
        """Add a part of the environment."""
        self.number(light)
        self._environment.setdefault(light.group, []).append(record)

    def _number(self, name: str) -> int:
        return self._numbers.setdefault(name, len(self._numbers))

    def groups(self) -> LightGroups:
        """Return the groups; the environment is the last light."""
        parts = tuple((name, EnvironmentSum.of(lights)) for name, lights in self._environment.items())
        if len(parts) == 1 and isinstance(parts[0][1], PatchedEnvironment):
            self.add(np.array([PATCHED]))
            numbers = np.concatenate([np.zeros(0, np.intp), *self._of_light])
            numbers = np.where(numbers >= 0, numbers + len(parts[0][1].names), numbers)
            return LightGroups((*parts[0][1].names, *self._numbers), numbers, (), parts[0][1].patches)
        if parts:
            self.add(np.array([self._number(parts[0][0]) if len(parts) == 1 else -1]))
        return LightGroups(
            tuple(self._numbers), np.concatenate([np.zeros(0, np.intp), *self._of_light]), parts
        )
