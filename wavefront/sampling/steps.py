"""Random numbers for decisions that are made step by step, without a bound on the steps."""

from __future__ import annotations

from typing import Self

import numpy as np
from numpy.typing import NDArray

from ..arrays.soa import soa
from ..arrays.state import SoA, Words
from ..arrays.vec import Floats, f4
from .sampler import IndependentSampler

GOLDEN = 0x9E3779B97F4A7C15  # SplitMix64's increment
LANES = 2  # of numbers that a step has


@soa
class StepNumbers(SoA):
    """Numbers by address: a key for each lane, and the number of the step (SplitMix64).

    Source: G. Steele, D. Lea and C. Flood, "Fast Splittable Pseudorandom Number Generators", OOPSLA 2014.
    """

    key: NDArray[np.uint64]  # (n,)

    @classmethod
    def of(cls, seed: int, pixel: Words, sample: Words, bounce: int, dimension: int) -> Self:
        """Return the numbers of a decision of paths (n,)."""
        return cls(IndependentSampler(seed).words(pixel, sample, bounce, dimension))

    def again(self) -> Self:
        """Return other numbers, for the next part of a ray."""
        return type(self)(self.key * np.uint64(0xD1342543DE82EF95) + np.uint64(GOLDEN))

    def draw(self, step: int, lane: int = 0) -> Floats:
        """Return a number in [0, 1) for each column, (n,), for step ≥ 0; each step has two lanes."""
        x = self.key + np.uint64((LANES * step + lane + 1) * GOLDEN % 2**64)
        x = (x ^ (x >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
        x = (x ^ (x >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
        return ((x ^ (x >> np.uint64(31))) >> np.uint64(40)).astype(f4) * f4(2.0**-24)
