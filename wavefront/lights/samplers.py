"""Light samplers, which choose one light for each point."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable
from typing import Protocol, TypeAlias

import numpy as np

from ..arrays.vec import Bools, Doubles, Floats, Ints, broadcast, f4
from ..core.registry import Registry
from ..sampling.discrete import Discrete, rounded_up
from .base import Emitters
from .tree import LightTreeSampler

MOST_CELLS = 32**3
MOST_ENTRIES = 2**21  # cells times lights
MOST_IN_GRID = 2**16  # lights; a tree has less noise for more of them, as a grid has too few cells then
BY_POWER = 0.05  # part of the probability that is proportional to power, so that no light is left out


class LightSampler(Protocol):
    """Base class of light samplers, which choose a light for each point.

    Examples
    --------
    >>> class First(wf.LightSampler):
    ...     def __init__(self, power, half_size, irradiance):
    ...         pass
    ...     def sample(self, point, u):
    ...         return np.zeros(len(u), np.intp), np.ones(len(u), np.float32)
    ...     def pmf(self, light, point):
    ...         return (light == 0).astype(np.float32)
    >>> scene = [wf.Sphere((0, 0, 0), 1), wf.PointLight((0, 3, 3), 20)]
    >>> wf.render(scene, spp=1, size=(8, 8), light_sampler=First).shape
    (8, 8, 3)
    """

    @abstractmethod
    def sample(self, point: Floats, u: Floats) -> tuple[Ints, Floats]:
        """Return a light (n,) for each point (3, n) from u (n,), and its probability (n,)."""

    @abstractmethod
    def pmf(self, light: Ints, point: Floats) -> Floats:
        """Probability (n,) that `light` (n,) is chosen at points (3, n)."""


class Irradiance(Protocol):
    """What each light brings to parts of the scene, and where it is."""

    @property
    def emitters(self) -> Emitters:
        """Where the lights are; NaN for those that are nowhere."""

    def __call__(self, center: Doubles, radius: float, /) -> Doubles:
        """Return a bound on the irradiance (c, k) by each light within `radius` of points `center` (3, c)."""


# Called with the power (k,) of each light, all above 0; half of the scene's extent (3,), whose middle is the
# origin; and the lights' irradiance. All lengths are scene units.
LightSamplerMaker: TypeAlias = Callable[[Doubles, Doubles, Irradiance], LightSampler]


class SingleLightSampler:
    """The sampler of a scene with one light."""

    def sample(self, point: Floats, u: Floats) -> tuple[Ints, Floats]:
        """Return light 0."""
        n = point.shape[1]
        return broadcast(np.intp(0), n), broadcast(f4(1), n)

    def pmf(self, light: Ints, point: Floats) -> Floats:
        """Return 1."""
        return broadcast(f4(1), len(light))


class WeightedLightSampler:
    """The same probabilities at every point, in proportion to `weights` (k,)."""

    def __init__(self, weights: Doubles) -> None:
        self.table = Discrete(weights)

    def sample(self, point: Floats, u: Floats) -> tuple[Ints, Floats]:
        """Choose by inverting the cumulative weights."""
        light, chance, _ = self.table.sample(u)
        return light, chance

    def pmf(self, light: Ints, point: Floats) -> Floats:
        """Return the weight of each light."""
        return self.table.pmf(light)


class HalvedLightSampler:
    """Two samplers of different lights, each of which takes half of the samples."""

    def __init__(self, first: SubsetLightSampler, second: SubsetLightSampler) -> None:
        self.first, self.second = first, second

    def sample(self, point: Floats, u: Floats) -> tuple[Ints, Floats]:
        """Let the first choose where u is below 1/2."""
        light, chance = np.empty(len(u), np.intp), np.empty(len(u), f4)
        below = u < f4(0.5)
        for choice, lanes, begin in ((self.first, below, 0), (self.second, ~below, 1)):
            at = np.flatnonzero(lanes)
            light[at], chance[at] = choice.sample(point.take(at, 1), f4(2) * u.take(at) - f4(begin))
        return light, chance * f4(0.5)

    def pmf(self, light: Ints, point: Floats) -> Floats:
        """Return half of the probability; only one of the two is not 0."""
        return f4(0.5) * (self.first.pmf(light, point) + self.second.pmf(light, point))


class SubsetLightSampler:
    """A sampler of some of the lights; the others are never chosen.

    Parameters
    ----------
    choice
        Of one of the k lights.
    chosen
        (k,) their numbers, rising.
    lights
        How many lights there are in all.
    """

    def __init__(self, choice: LightSampler, chosen: Ints, lights: int) -> None:
        self.choice, self.chosen = choice, chosen
        self.place = np.full(lights, -1, np.intp)
        self.place[chosen] = np.arange(len(chosen))

    def sample(self, point: Floats, u: Floats) -> tuple[Ints, Floats]:
        """Choose one of them."""
        light, chance = self.choice.sample(point, u)
        return self.chosen.take(light), chance

    def pmf(self, light: Ints, point: Floats) -> Floats:
        """Return the probability of each light, 0 for the others."""
        place = self.place.take(light)
        return np.where(place < 0, f4(0), self.choice.pmf(np.maximum(place, 0), point))


class SpatialLightSampler:
    """Probabilities by position: each cell of a grid weights all lights by their irradiance there.

    Lights that are near, and lights that face the cell, are chosen more often. A small part of the
    probability is proportional to power.

    Parameters
    ----------
    low, high
        (3,) corners of the scene, scene units.
    irradiance
        Called with cell centers (3, c) and the cells' radius; returns what each light brings to
        each cell at most, (c, k).
    power
        (k,) estimated power of each light.
    """

    def __init__(self, low: Doubles, high: Doubles, irradiance: Irradiance, power: Doubles) -> None:
        cells = int(np.clip(MOST_ENTRIES // len(power), 1, MOST_CELLS))
        self.low, self.shape, size = _grid(low, high, cells)
        centers = np.indices(self.shape).reshape(3, -1) + 0.5
        weight = irradiance(self.low[:, None] + centers * size[:, None], float(np.linalg.norm(size)) / 2)
        total = weight.sum(1, keepdims=True)
        share = power / power.sum()
        table = np.where(total > 0, weight / np.where(total > 0, total, 1), share)
        table = (1 - BY_POWER) * table + BY_POWER * share
        self.lights = len(power)
        self.inverse_size = 1 / size
        self.chance = table.astype(f4).ravel()
        cumulative = np.cumsum(table, 1)
        cumulative /= cumulative[:, -1:]
        # where each light but the last ends, and then ones, so that a bisection halves what is left
        self.ends = (1 << (self.lights - 1).bit_length()) - 1
        ends = np.ones((len(table), self.ends), f4)
        ends[:, : self.lights - 1] = rounded_up(cumulative[:, :-1])
        self.end = ends.ravel()

    def sample(self, point: Floats, u: Floats) -> tuple[Ints, Floats]:
        """Choose by inverting the cumulative weights of each point's cell, by bisection of all at once."""
        cell = self._cell(point)
        light, before, step = np.zeros(len(cell), np.intp), cell * self.ends - 1, (self.ends + 1) // 2
        while step:
            light += (u >= self.end.take(before + light + step)) * np.intp(step)
            step //= 2
        return light, self.chance.take(cell * self.lights + light)

    def pmf(self, light: Ints, point: Floats) -> Floats:
        """Return the weight of each light in its point's cell."""
        return self.chance.take(self._cell(point) * self.lights + light)

    def _cell(self, point: Floats) -> Ints:
        """Return the number of the cell of each point (n,); points outside belong to the nearest."""
        cell = np.zeros(point.shape[1], np.intp)
        for row, low, inverse, count in zip(point, self.low, self.inverse_size, self.shape, strict=True):
            along = np.clip((row - f4(low)) * f4(inverse), f4(0), f4(count - 1)).astype(np.intp)
            cell = cell * count + along
        return cell


def spatial(power: Doubles, half_size: Doubles, irradiance: Irradiance) -> LightSampler:
    """Return a sampler by the lights' irradiance around a point: a grid, or a tree of very many lights."""
    if len(power) > MOST_IN_GRID:
        emitters = irradiance.emitters
        placed = np.isfinite(emitters.extent2)
        if placed.any():
            return _tree(power, float(np.linalg.norm(half_size)), emitters, placed)
    return SpatialLightSampler(-half_size, half_size, irradiance, power)


def _tree(power: Doubles, scene_radius: float, emitters: Emitters, placed: Bools) -> LightSampler:
    """Return a tree of the lights that are `placed` (k,); the others are chosen by power."""
    if placed.all():
        return LightTreeSampler(emitters, power, scene_radius)
    inside, others = np.flatnonzero(placed), np.flatnonzero(~placed)
    tree = LightTreeSampler(emitters.take(inside), power.take(inside), scene_radius)
    return HalvedLightSampler(
        SubsetLightSampler(tree, inside, len(power)),
        SubsetLightSampler(WeightedLightSampler(power.take(others)), others, len(power)),
    )


def by_power(power: Doubles, half_size: Doubles, irradiance: Irradiance) -> LightSampler:
    """Return a sampler by power, the same at every point."""
    return WeightedLightSampler(power)


def uniform(power: Doubles, half_size: Doubles, irradiance: Irradiance) -> LightSampler:
    """Return a sampler with equal probabilities."""
    return WeightedLightSampler(np.ones_like(power))


LIGHT_SAMPLERS: Registry[LightSamplerMaker] = Registry(
    "light_sampler",
    "a function of (power, half_size, irradiance)",
    {"spatial": spatial, "power": by_power, "uniform": uniform},
)


def _grid(low: Doubles, high: Doubles, cells: int) -> tuple[Doubles, tuple[int, int, int], Doubles]:
    """Return the corner, the counts and the cell size (3,) of a grid of nearly cubic cells."""
    extent = np.maximum(high - low, 1e-3 * max(float((high - low).max()), 1e-30))
    side = (extent.prod() / cells) ** (1 / 3)
    counts = np.clip(np.floor(extent / side + 1e-6), 1, cells).astype(int)  # the same at every scale
    while counts.prod() > cells:
        counts[np.argmax(counts)] -= 1
    return low, (int(counts[0]), int(counts[1]), int(counts[2])), extent / counts
