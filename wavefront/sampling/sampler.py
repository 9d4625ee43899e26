"""Random numbers by address: pure functions of (seed, pixel, sample, bounce, dimension).

No sampler has a state, so a number does not depend on which wave, worker or machine asks for it.
All arithmetic is whole-array and modulo 2³² or 2⁶⁴.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from enum import IntEnum
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from ..errors import SceneError
from ..state import Words
from ..vec import Floats, f4

Longs = NDArray[np.uint64]

u4 = np.uint32
u8 = np.uint64

_MASK64 = (1 << 64) - 1
_UNIT = f4(2.0**-24)  # one step of a 24-bit fraction: the largest number is 1 − 2⁻²⁴, exact in float32


class Dimension(IntEnum):
    """Every random decision of a path vertex. (bounce, dimension) addresses one stream."""

    PIXEL = 0  # 2-D: position within the pixel
    LENS = 1  # 2-D: position on the lens
    LIGHT = 2  # 1-D: which light
    LIGHT_POINT = 3  # 2-D: which point of the light
    LOBE = 4  # 1-D: which lobe of the BSDF
    DIRECTION = 5  # 2-D: direction within the lobe
    ROULETTE = 6  # 1-D: whether the path goes on
    OPACITY = 7  # 1-D: whether the surface is there


class Sampler(ABC):
    """Uniform numbers by address.

    Parameters
    ----------
    seed
        Any integer in [0, 2⁶⁴).

    Raises
    ------
    SceneError
        If the seed is not such an integer.
    """

    def __init__(self, seed: int = 0) -> None:
        if isinstance(seed, bool) or not isinstance(seed, int | np.integer) or not 0 <= seed <= _MASK64:
            raise SceneError(f"seed is {seed!r}; it must be an integer in [0, 2**64)")
        self.seed = int(seed)

    @abstractmethod
    def draw_1d(self, pixel: Words, sample: Words, bounce: int, dimension: int) -> Floats:
        """Numbers in [0, 1), (n,), for pixel indices (n,) and sample indices (n,)."""

    @abstractmethod
    def draw_2d(self, pixel: Words, sample: Words, bounce: int, dimension: int) -> Floats:
        """Points in [0, 1)², (2, n), for pixel indices (n,) and sample indices (n,)."""


class IndependentSampler(Sampler):
    """Independent uniform numbers from a counter-based hash.

    The 64-bit word (pixel, sample) goes through a bijective finaliser, keyed per
    (seed, bounce, dimension); its upper and lower halves are the two coordinates.
    """

    def draw_1d(self, pixel: Words, sample: Words, bounce: int, dimension: int) -> Floats:
        """Numbers in [0, 1), (n,)."""
        return _fraction(self._hash(pixel, sample, bounce, dimension) >> u8(32))

    def draw_2d(self, pixel: Words, sample: Words, bounce: int, dimension: int) -> Floats:
        """Points in [0, 1)², (2, n)."""
        word = self._hash(pixel, sample, bounce, dimension)
        return np.stack([_fraction(word >> u8(32)), _fraction(word & u8(0xFFFFFFFF))])

    def _hash(self, pixel: Words, sample: Words, bounce: int, dimension: int) -> Longs:
        """64 random bits per lane, (n,)."""
        word = pixel.astype(u8)
        word <<= u8(32)
        word |= sample
        return _mix_lanes(word, *_keys(self.seed, bounce, dimension)[:2])


class SobolSampler(Sampler):
    """Padded two-dimensional Sobol points, shuffled and Owen-scrambled per pixel and stream.

    Every aligned block of 2ᵐ samples of one pixel and stream is a (0, m, 2)-net. The
    samples may number up to 2³².

    Source: B. Burley, Practical Hash-based Owen Scrambling, JCGT 9(4), 2020.
    """

    def draw_1d(self, pixel: Words, sample: Words, bounce: int, dimension: int) -> Floats:
        """Numbers in [0, 1), (n,)."""
        seeds = self._seeds(pixel, bounce, dimension)
        index = _shuffled(sample, seeds)
        return _fraction(_reverse(_laine_karras(index, _reseed(seeds, 0x9E3779B9))))

    def draw_2d(self, pixel: Words, sample: Words, bounce: int, dimension: int) -> Floats:
        """Points in [0, 1)², (2, n)."""
        seeds = self._seeds(pixel, bounce, dimension)
        index = _shuffled(sample, seeds)
        x = _laine_karras(index, _reseed(seeds, 0x9E3779B9))
        y = _laine_karras(_pascal(index), _reseed(seeds, 0x85EBCA77))
        return np.stack([_fraction(_reverse(x)), _fraction(_reverse(y))])

    def _seeds(self, pixel: Words, bounce: int, dimension: int) -> Words:
        """32 random bits per pixel and stream, (n,)."""
        key = _keys(self.seed, bounce, dimension)[2]
        return _mix_words(pixel ^ key)


SAMPLERS: dict[str, type[Sampler]] = {"independent": IndependentSampler, "sobol": SobolSampler}


def make_sampler(name: str, seed: int = 0, width: int = 1) -> Sampler:
    """Return the sampler called `name` for images `width` pixels wide.

    Raises
    ------
    SceneError
        If there is no such sampler, or the seed is out of range.
    """
    if name not in SAMPLERS:
        raise SceneError(f"sampler is {name!r}; it must be one of {', '.join(map(repr, SAMPLERS))}")
    return SAMPLERS[name](seed)


def _mix64(x: int) -> int:
    """SplitMix64's output function, a bijection of 64-bit integers (Stafford's variant 13)."""
    x = ((x ^ (x >> 30)) * 0xBF58476D1CE4E5B9) & _MASK64
    x = ((x ^ (x >> 27)) * 0x94D049BB133111EB) & _MASK64
    return x ^ (x >> 31)


@lru_cache(maxsize=4096)
def _keys(seed: int, bounce: int, dimension: int) -> tuple[np.uint64, np.uint64, np.uint32]:
    """Random keys of one stream."""
    state = _mix64(seed + 0x9E3779B97F4A7C15 & _MASK64)
    state = _mix64(state ^ _mix64((bounce << 32 | dimension) + 0x632BE59BD9B4E019 & _MASK64))
    first = _mix64(state + 0x9E3779B97F4A7C15 & _MASK64)
    second = _mix64(state + 2 * 0x9E3779B97F4A7C15 & _MASK64)
    return u8(first), u8(second), u4(first >> 32)


def _mix_lanes(x: Longs, key: np.uint64, tweak: np.uint64) -> Longs:
    """SplitMix64's output function on lanes (n,), in place, keyed before and between the rounds.

    The second key keeps two streams from being one permutation of another by an XOR of addresses.
    """
    x ^= key
    x ^= x >> u8(30)
    x *= u8(0xBF58476D1CE4E5B9)
    x += tweak
    x ^= x >> u8(27)
    x *= u8(0x94D049BB133111EB)
    x ^= x >> u8(31)
    return x


def _mix_words(x: Words) -> Words:
    """Bijective 32-bit hash of lanes (n,), in place (C. Wellons, lowbias32)."""
    x ^= x >> u4(16)
    x *= u4(0x7FEB352D)
    x ^= x >> u4(15)
    x *= u4(0x846CA68B)
    x ^= x >> u4(16)
    return x


def _reseed(seeds: Words, constant: int) -> Words:
    """Another word of 32 random bits from `seeds` (n,)."""
    return _mix_words(seeds ^ u4(constant))


def _reverse(x: Words) -> Words:
    """The 32 bits of each lane (n,) in reverse order."""
    x = x.byteswap()
    for shift, mask in ((4, 0x0F0F0F0F), (2, 0x33333333), (1, 0x55555555)):
        x = (x >> u4(shift)) & u4(mask) | (x & u4(mask)) << u4(shift)
    return x


def _laine_karras(x: Words, seed: Words) -> Words:
    """Owen-scramble bit-reversed fractions (n,): each bit is flipped by a hash of those below it.

    Source: S. Laine and T. Karras, Stratified Sampling for Stochastic Transparency, EGSR 2011,
    with the constants of N. Vegdahl, Building a Better LK Hash, 2021.
    """
    x = x ^ x * u4(0x3D20ADEA)
    x += seed
    x *= (seed >> u4(16)) | u4(1)
    x ^= x * u4(0x05526C56)
    x ^= x * u4(0x53A22864)
    return x


def _shuffled(sample: Words, seed: Words) -> Words:
    """Permute sample indices (n,) such that every aligned block of 2ᵐ maps to such a block."""
    return _reverse(_laine_karras(_reverse(sample), seed))


def _pascal(index: Words) -> Words:
    """Second Sobol coordinate of `index` (n,), its bits reversed.

    The generator matrix is Pascal's triangle modulo 2: bit i of the result is the XOR of the bits
    j of the index with i a subset of j, a transform of five steps.
    """
    x = index ^ (index >> u4(16))
    for shift, mask in ((8, 0x00FF00FF), (4, 0x0F0F0F0F), (2, 0x33333333), (1, 0x55555555)):
        x ^= (x >> u4(shift)) & u4(mask)
    return x


def _fraction(word: Words | Longs) -> Floats:
    """The top 24 of 32 bits (n,) as a number in [0, 1), (n,) float32."""
    return (word.astype(u4) >> u4(8)).view(np.int32).astype(f4) * _UNIT
