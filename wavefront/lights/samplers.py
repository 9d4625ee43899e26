"""Light samplers, which choose one light for each point."""

from __future__ import annotations

from copy import copy

import numpy as np

from ..arrays.vec import ALL, Bools, Doubles, Floats, Ints, Lanes, broadcast, f4
from ..core.registry import Registry
from ..sampling.discrete import Discrete
from .base import Emitters, Receiver
from .choice import Irradiance, LightSampler, LightSamplerMaker
from .grid import SpatialLightSampler
from .tree import LightTreeSampler

MOST_IN_GRID = 2**16  # lights; a tree has less noise for more of them, as a grid has too few cells then


class SingleLightSampler(LightSampler):
    """The sampler of a scene with one light."""

    def sample(self, point: Floats, u: Floats) -> tuple[Ints, Floats]:
        """Return light 0."""
        n = point.shape[1]
        return broadcast(np.intp(0), n), broadcast(f4(1), n)

    def pmf(self, light: Ints, point: Floats) -> Floats:
        """Return 1."""
        return broadcast(f4(1), len(light))


class WeightedLightSampler(LightSampler):
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


class HalvedLightSampler(LightSampler):
    """Two samplers of different lights, each of which takes half of the samples."""

    def __init__(self, first: SubsetLightSampler, second: SubsetLightSampler) -> None:
        self.first, self.second = first, second
        self.takes_receiver = first.takes_receiver
        self.receiver: Receiver | None = None

    def sample(self, point: Floats, u: Floats) -> tuple[Ints, Floats]:
        """Let the first choose where u is below 1/2."""
        light, chance = np.empty(len(u), np.intp), np.empty(len(u), f4)
        below = u < f4(0.5)
        for choice, lanes, begin in ((self.first, below, 0), (self.second, ~below, 1)):
            at = np.flatnonzero(lanes)
            v = f4(2) * u.take(at) - f4(begin)
            light[at], chance[at] = self._lit(choice, at).sample(point.take(at, 1), v)
        return light, chance * f4(0.5)

    def pmf(self, light: Ints, point: Floats) -> Floats:
        """Return half of the probability; only one of the two is not 0."""
        first, second = (self._lit(choice, ALL).pmf(light, point) for choice in (self.first, self.second))
        return f4(0.5) * (first + second)

    def lighting(self, receiver: Receiver) -> LightSampler:
        """Let both know the surfaces."""
        bound = copy(self)
        bound.receiver = receiver
        return bound

    def _lit(self, choice: LightSampler, lanes: Lanes) -> LightSampler:
        return choice if self.receiver is None else choice.lighting(self.receiver.take(lanes))


class SubsetLightSampler(LightSampler):
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
        self.takes_receiver = choice.takes_receiver
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

    def lighting(self, receiver: Receiver) -> LightSampler:
        """Let the sampler of the lights know the surfaces."""
        bound = copy(self)
        bound.choice = self.choice.lighting(receiver)
        return bound


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
