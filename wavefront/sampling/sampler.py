"""Random numbers by address: pure functions of (seed, pixel, sample, bounce, dimension).

No sampler has a state, so a number does not depend on the wave, worker or machine that computes it.
All arithmetic is modulo 2³² or 2⁶⁴, on whole arrays.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum
from functools import lru_cache
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from ..arrays.state import Words
from ..arrays.vec import Floats, f4
from ..core.errors import SceneError
from ..core.registry import Registry

Longs = NDArray[np.uint64]

u4 = np.uint32
u8 = np.uint64

_MASK64 = (1 << 64) - 1
_GOLDEN = 0x9E3779B97F4A7C15  # 2⁶⁴ divided by the golden ratio, SplitMix64's increment
_UNIT = f4(2.0**-24)  # the unit of 24-bit fractions: the largest one, 1 − 2⁻²⁴, is exact in float32

VARIANTS = 16  # shuffled and scrambled copies of the Sobol sequence per stream; a power of two
BLOCK = 256  # consecutive samples per table; a power of two


class Dimension(IntEnum):
    """The random decisions at a path vertex. (bounce, dimension) addresses one stream.

    A decision that repeats at one vertex has a range of numbers (`numbers_of`). New decisions get
    numbers above all ranges, so that pictures of old seeds do not change.
    """

    PIXEL = 0  # 2-D: position within the pixel
    LENS = 1  # 2-D: position on the lens
    LIGHT = 2  # 1-D: which light
    LIGHT_POINT = 3  # 2-D: which point of the light
    LOBE = 4  # 1-D: which lobe of the BSDF
    DIRECTION = 5  # 2-D: direction within the lobe
    ROULETTE = 6  # 1-D: whether the path survives Russian roulette
    OPACITY = 7  # 1-D: whether the path hits a surface with alpha; repeats along the ray, up to 2²⁰
    GUIDE = 2**20  # 1-D: whether the direction comes from the guide's table
    GUIDE_DIRECTION = 2**20 + 1  # 2-D: direction from the table
    SPECULAR_SURFACE = 2**20 + 2  # 2-D: which primitive a path from a light begins at
    SPECULAR_POINT = 2**20 + 3  # 2-D: where on it
    TIME = 2**20 + 4  # 1-D: when a path is while the shutter is open
    MEDIUM = 2**21  # 2-D: where a medium scatters, by channel and distance; repeats along the ray, up to 2²²
    TRANSMITTANCE = 2**22  # of light samples through media; repeats along the ray, up to 2²³
    FEATURE = 2**23  # of a user's own features (`Feature.dimensions`), up to 2²⁴


# At the first vertex: decisions whose points are the last two coordinates of the points of PIXEL. What they
# bring is added, never multiplied, so both may use the same two.
WITH_PIXEL = (Dimension.LIGHT_POINT, Dimension.DIRECTION)

REPEATED = {
    Dimension.OPACITY: 2**20,
    Dimension.MEDIUM: 2**22,
    Dimension.TRANSMITTANCE: 2**23,
    Dimension.FEATURE: 2**24,
}  # decisions that repeat, and one past the last of their numbers


def numbers_of(dimension: Dimension) -> range:
    """Return the numbers that a decision may use in an address, one for each time that it is made."""
    return range(int(dimension), REPEATED.get(dimension, dimension + 1))


class Sampler(ABC):
    """Base class of samplers: uniform numbers by address.

    A sampler has no state. Its numbers depend only on the seed and the address. The numbers of a lane do not
    depend on the other lanes.

    Parameters
    ----------
    seed
        Any integer in [0, 2⁶⁴).
    width
        Width of the picture, pixels: pixel indices are row-major.

    Raises
    ------
    SceneError
        If the seed is out of range or not an integer.

    Examples
    --------
    >>> class Middle(wf.Sampler):
    ...     def draw_1d(self, pixel, sample, bounce, dimension):
    ...         return np.full(len(pixel), 0.5, np.float32)
    ...     def draw_2d(self, pixel, sample, bounce, dimension):
    ...         return np.full((2, len(pixel)), 0.5, np.float32)
    >>> scene = [wf.Sphere((0, 0, 0), 1), wf.PointLight((0, 3, 3), 20)]
    >>> wf.render(scene, spp=1, size=(8, 8), sampler=Middle).shape
    (8, 8, 3)
    """

    def __init__(self, seed: int = 0, width: int = 1) -> None:
        if isinstance(seed, bool) or not isinstance(seed, int | np.integer) or not 0 <= seed <= _MASK64:
            raise SceneError(f"seed is {seed!r}; it must be an integer in [0, 2**64)")
        self.seed, self.width = int(seed), width

    @abstractmethod
    def draw_1d(self, pixel: Words, sample: Words, bounce: int, dimension: int) -> Floats:
        """Return numbers in [0, 1), (n,), for pixel indices (n,) and sample indices (n,)."""

    @abstractmethod
    def draw_2d(self, pixel: Words, sample: Words, bounce: int, dimension: int) -> Floats:
        """Return points in [0, 1)², (2, n), for pixel indices (n,) and sample indices (n,)."""


class IndependentSampler(Sampler):
    """Independent uniform numbers from a counter-based hash.

    The 64-bit word (pixel, sample) is hashed by a bijection with keys for (seed, bounce, dimension); its
    upper and lower halves are the two coordinates.
    """

    def draw_1d(self, pixel: Words, sample: Words, bounce: int, dimension: int) -> Floats:
        """Return numbers in [0, 1), (n,)."""
        word = self.words(pixel, sample, bounce, dimension)
        return _high_fraction(word, np.empty(len(word), f4))

    def draw_2d(self, pixel: Words, sample: Words, bounce: int, dimension: int) -> Floats:
        """Return points in [0, 1)², (2, n)."""
        word = self.words(pixel, sample, bounce, dimension)
        out = np.empty((2, len(word)), f4)
        _fraction(word.astype(u4), out[1])  # the lower half of the word
        _high_fraction(word, out[0])
        return out

    def words(self, pixel: Words, sample: Words, bounce: int, dimension: int) -> Longs:
        """Return 64 random bits per lane, (n,)."""
        word = pixel.astype(u8)
        word <<= u8(32)
        word |= sample
        return _mix_longs(word, *_stream(self.seed, bounce, dimension).longs)


class SobolSampler(Sampler):
    """Padded two-dimensional Sobol points, shuffled and Owen-scrambled per pixel and stream.

    Every aligned block of 2ᵐ samples of one pixel and stream is a (0, m, 2)-net, so that any number of
    samples, up to 2³², is well distributed. At the first vertex, light points and directions are also
    stratified together with the position within the pixel: 4ᵐ samples are a (0, m, 4)-net in base 4.

    A stream (bounce, dimension) has `VARIANTS` shuffled and Owen-scrambled copies of the sequence. A
    hash of the pixel selects one of them, and a word for each coordinate that is XORed to it. An Owen
    scramble followed by an XOR has the distribution of an Owen scramble, so each pixel has the error of one
    and a distinct set of points. The scrambling itself is computed once per table, not once per path.

    Source: B. Burley, Practical Hash-based Owen Scrambling, JCGT 9(4), 2020 (padding, shuffling
    and scrambling by hash); A. Owen, Randomly Permuted (t,m,s)-Nets and (t,s)-Sequences, 1995;
    A. Ahmed, M. Pharr, V. Ostromoukhov and H. Huang, SZ Sequences, 2025 (the four coordinates).
    """

    def draw_1d(self, pixel: Words, sample: Words, bounce: int, dimension: int) -> Floats:
        """Return the first coordinate of `draw_2d`, (n,)."""
        stream = _stream(self.seed, bounce, dimension)
        word, variant = _pixel_words(stream, pixel)
        x = _points(stream, sample, variant, 1)[0]
        x ^= word
        return _fraction(x, np.empty(len(x), f4))

    def draw_2d(self, pixel: Words, sample: Words, bounce: int, dimension: int) -> Floats:
        """Return points in [0, 1)², (2, n)."""
        stream = _stream(self.seed, bounce, dimension)
        word, variant = _pixel_words(stream, pixel)
        x, y = _points(stream, sample, variant, 2)
        x ^= word
        y ^= _mix_again(word, stream.words[2])
        out = np.empty((2, len(x)), f4)
        _fraction(x, out[0])
        _fraction(y, out[1])
        return out


class BlueNoiseSampler(Sampler):
    """Sobol points whose error is distributed as blue noise over the screen.

    All pixels share one shuffled, Owen-scrambled sequence per stream. Each pixel XORs a point to it, from a
    second sequence that is indexed along a Morton curve through the pixels. So neighbors get well-separated
    numbers, and their errors tend to cancel. A hash decides for each square of the curve whether it runs
    along or down first; otherwise all pairs of neighbors would be horizontal, which is visible as stripes.
    Within a pixel the samples are distributed as those of `SobolSampler`, for any number of samples.

    Based on A. Ahmed and P. Wonka, Screen-Space Blue-Noise Diffusion of Monte Carlo Sampling Error via
    Hierarchical Ordering of Pixels, SIGGRAPH Asia 2020, which needs the number of samples in advance; the
    XOR in place of a longer index removes this requirement.
    """

    def draw_1d(self, pixel: Words, sample: Words, bounce: int, dimension: int) -> Floats:
        """Return the first coordinate of `draw_2d`, (n,)."""
        return self.draw_2d(pixel, sample, bounce, dimension)[0]

    def draw_2d(self, pixel: Words, sample: Words, bounce: int, dimension: int) -> Floats:
        """Return points in [0, 1)², (2, n)."""
        stream = _stream(self.seed, bounce, dimension)
        first = np.zeros(len(pixel), u4)
        width = u4(self.width)
        row = pixel // width
        place = _every_second_bit(pixel - row * width) | _every_second_bit(row) << u4(1)
        another = _stream(self.seed ^ _GOLDEN, bounce, dimension)
        shifts = _sequence(another, _mirror_squares(place, another.words[0]), first)
        out = np.empty((2, len(pixel)), f4)
        for word, shift, numbers in zip(_points(stream, sample, first, 2), shifts, out, strict=True):
            _fraction(word ^ shift, numbers)
        return out


SamplerMaker: TypeAlias = Callable[[int, int], Sampler]  # called with the seed and the width
SAMPLERS: Registry[SamplerMaker] = Registry(
    "sampler",
    "a subclass of wf.Sampler",
    {"sobol": SobolSampler, "bluenoise": BlueNoiseSampler, "independent": IndependentSampler},
)


def make_sampler(sampler: str | SamplerMaker, seed: int = 0, width: int = 1) -> Sampler:
    """Return a sampler, given by name or by its class, for images `width` pixels wide.

    Raises
    ------
    SceneError
        If there is no such sampler, or the seed is out of range.
    """
    return SAMPLERS.find(sampler)(seed, width)


def _mix64(x: int) -> int:
    """Return SplitMix64's output function of x, a bijection of 64-bit integers (Stafford's variant 13)."""
    x = ((x ^ (x >> 30)) * 0xBF58476D1CE4E5B9) & _MASK64
    x = ((x ^ (x >> 27)) * 0x94D049BB133111EB) & _MASK64
    return x ^ (x >> 31)


@dataclass(frozen=True, slots=True)
class Stream:
    """Random keys of one stream, (seed, bounce, dimension)."""

    longs: tuple[np.uint64, np.uint64]
    words: tuple[np.uint32, np.uint32, np.uint32, np.uint32]
    leader: Stream | None = None  # the one whose points have four coordinates, of which this has the last two


@lru_cache(maxsize=4096)
def _stream(seed: int, bounce: int, dimension: int) -> Stream:
    """Return the keys of a stream, which depend on every bit of the address."""
    state = _mix64(seed)
    for component in (bounce, dimension):
        state = _mix64((state ^ component) + _GOLDEN & _MASK64)
    keys = [_mix64(state + i * _GOLDEN & _MASK64) for i in range(1, 5)]
    words = [half for key in keys[2:] for half in (u4(key >> 32), u4(key & 0xFFFFFFFF))]
    leader = _stream(seed, 0, Dimension.PIXEL) if bounce == 0 and dimension in WITH_PIXEL else None
    return Stream((u8(keys[0]), u8(keys[1])), (words[0], words[1], words[2], words[3]), leader)


def _mix_longs(x: Longs, key: np.uint64, tweak: np.uint64) -> Longs:
    """Apply SplitMix64's output function to x (n,), in place, with a key before and between its rounds.

    Without the second key, two streams would have the same numbers at addresses that differ by an XOR.
    """
    shifted = np.empty_like(x)
    x ^= key
    x ^= np.right_shift(x, u8(30), out=shifted)
    x *= u8(0xBF58476D1CE4E5B9)
    x += tweak
    x ^= np.right_shift(x, u8(27), out=shifted)
    x *= u8(0x94D049BB133111EB)
    x ^= np.right_shift(x, u8(31), out=shifted)
    return x


def _mix_words(x: Words, key: np.uint32, tweak: np.uint32) -> Words:
    """Return a bijective 32-bit hash of x (n,), with keys as in `_mix_longs`.

    Source: C. Wellons, Prospecting for Hash Functions, 2018, lowbias32.
    """
    x = x ^ key
    shifted = x >> u4(16)
    x ^= shifted
    x *= u4(0x7FEB352D)
    x += tweak
    x ^= np.right_shift(x, u4(15), out=shifted)
    x *= u4(0x846CA68B)
    x ^= np.right_shift(x, u4(16), out=shifted)
    return x


def _mix_again(x: Words, key: np.uint32) -> Words:
    """Return a second word of 32 random bits, in place, from random bits x (n,)."""
    x += key
    x *= u4(0x9E3779B1)
    shifted = x >> u4(15)
    x ^= shifted
    x *= u4(0x85EBCA77)
    x ^= np.right_shift(x, u4(16), out=shifted)
    return x


def _pixel_words(stream: Stream, pixel: Words) -> tuple[Words, Words]:
    """Return the words (n,) by which pixels XOR the first coordinate, and the copies (n,) that they read."""
    word = _mix_words(pixel, *stream.words[:2])
    first = word if stream.leader is None else _mix_words(pixel, *stream.leader.words[:2])
    return word, first & u4(VARIANTS - 1)


def _points(stream: Stream, sample: Words, variant: Words, coordinates: int) -> list[Words]:
    """Return points `sample` (n,) of copies `variant` (n,) of a stream's sequence.

    These are the first `coordinates` coordinates as 32-bit fractions, (n,) each. They are read from a table
    for waves of a few consecutive samples, as in a render.
    """
    first, last = _extent(sample)
    block = first // BLOCK
    if last // BLOCK != block:
        return list(_sequence(stream, sample, variant)[:coordinates])
    table = _table(stream, block)
    if first == last:
        index = variant.astype(np.intp)
        table = table[:, (first - block * BLOCK) * VARIANTS :][:, :VARIANTS]
    else:
        index = ((sample - u4(block * BLOCK)) * u4(VARIANTS) + variant).astype(np.intp)
    return [row.take(index) for row in table[:coordinates]]


def _extent(sample: Words) -> tuple[int, int]:
    """Return the lowest and the highest of the indices (n,); 0 if there are none."""
    if not len(sample):
        return 0, 0
    if sample.strides == (0,):  # one value, from vec.broadcast
        return int(sample[0]), int(sample[0])
    return int(sample.min()), int(sample.max())


@lru_cache(maxsize=256)
def _table(stream: Stream, block: int) -> Words:
    """Return BLOCK points of all copies of a stream's sequence, (2, BLOCK·VARIANTS), ordered by sample."""
    sample = np.arange(BLOCK, dtype=u4).repeat(VARIANTS) + u4(block * BLOCK)
    variant = np.tile(np.arange(VARIANTS, dtype=u4), BLOCK)
    table = _sequence(stream, sample, variant)
    table.flags.writeable = False  # the cache shares the array
    return table


def _sequence(stream: Stream, sample: Words, variant: Words) -> Words:
    """Return shuffled and Owen-scrambled points as 32-bit fractions, (2, n)."""
    leader = stream.leader or stream
    shuffle = _variant_words(leader, variant)[0]
    _, scramble_x, scramble_y = _variant_words(stream, variant)
    index = _reverse(_owen(_reverse(sample), shuffle))
    # The first coordinate is the reversed index, so two reversals cancel.
    pair = (index, _pascal(index)) if leader is stream else _quaternary(index)
    x, y = (_reverse(_owen(*arguments)) for arguments in zip(pair, (scramble_x, scramble_y), strict=True))
    return np.stack([x, y])


def _variant_words(stream: Stream, variant: Words) -> Words:
    """Return keys of copies `variant` (n,), (3, n): for the shuffle and for two scrambles."""
    counter = np.arange(3 * VARIANTS, dtype=u4)
    seeds = _mix_words(_mix_words(counter, stream.words[3], stream.words[0]), *stream.words[1:3])
    return seeds.reshape(3, VARIANTS).take(variant, axis=1)


def _owen(x: Words, seed: Words) -> Words:
    """Return bit-reversed fractions x (n,), Owen-scrambled: a hash of the lower bits flips each bit.

    Source: S. Laine and T. Karras, Stratified Sampling for Stochastic Transparency, EGSR 2011,
    with the steps and constants of N. Vegdahl, Building a Better LK Hash, 2021.
    """
    x = x ^ x * u4(0x3D20ADEA)
    x += seed
    x *= (seed >> u4(16)) | u4(1)
    x ^= x * u4(0x05526C56)
    x ^= x * u4(0x53A22864)
    return x


def _pascal(index: Words) -> Words:
    """Return the second Sobol coordinate of `index` (n,), bit-reversed.

    The generator matrix is Pascal's triangle modulo 2: bit i of the result is the XOR of the bits
    j of the index for which i is a subset of j, a transform of five steps.
    """
    x = _pascal_of_digits(index)
    return x ^ (x >> u4(1)) & u4(0x55555555)


def _pascal_of_digits(x: Words) -> Words:
    """Return the same of digits of two bits: all steps of `_pascal` but the last."""
    for shift, mask in ((16, 0x0000FFFF), (8, 0x00FF00FF), (4, 0x0F0F0F0F), (2, 0x33333333)):
        x = x ^ (x >> u4(shift)) & u4(mask)
    return x


def _quaternary(index: Words) -> tuple[Words, Words]:
    """Return the third and fourth coordinate of `index` (n,), bit-reversed.

    Pairs of bits are numbers of GF(4), and the generator matrices have C(j, i) a^(j − i) for a = 0, 1, w and
    w², so that all four coordinates are a (0, 4)-sequence in base 4 (Niederreiter 1987). The second and
    fourth are multiplied by an invertible matrix digit by digit, so that the first two, and the last two,
    are also (0, 2)-sequences in base 2.
    """
    third = _times_powers(_pascal_of_digits(_times_powers(index, 1)), 2)
    fourth = _times_powers(_pascal_of_digits(_times_powers(index, 2)), 1)
    return third, fourth ^ (fourth >> u4(1)) & u4(0x55555555)


def _times_powers(x: Words, step: int) -> Words:
    """Return x (n,) with its digit i multiplied by w^(step·i); w³ = 1."""
    low, high = x & u4(0x55555555), x >> u4(1) & u4(0x55555555)
    both = low ^ high
    by_power = x, high | both << u4(1), both | low << u4(1)  # by 1, w and w² = w + 1
    masks = 0xC30C30C3, 0x0C30C30C, 0x30C30C30  # of the digits 0, 1 and 2, and so on by threes
    one, two, three = (by_power[i * step % 3] & u4(mask) for i, mask in enumerate(masks))
    return one | two | three


def _every_second_bit(x: Words) -> Words:
    """Return the lower 16 bits of x (n,), moved to the even bits."""
    for shift, mask in ((8, 0x00FF00FF), (4, 0x0F0F0F0F), (2, 0x33333333), (1, 0x55555555)):
        x = (x | x << u4(shift)) & u4(mask)
    return x


def _mirror_squares(place: Words, key: np.uint32) -> Words:
    """Mirror random squares of a Morton curve at their diagonal: swap bits 2i and 2i + 1 of `place` (n,).

    Whether a square is mirrored is a hash of the higher bits, which identify the square, as in `_owen`.
    """
    turned = _reverse(place)
    flips = _reverse(_owen(turned, np.full_like(turned, key)) ^ turned)
    swap = (place ^ place >> u4(1)) & flips >> u4(1) & u4(0x55555555)
    return place ^ (swap | swap << u4(1))


def _reverse(x: Words) -> Words:
    """Return x (n,) with its 32 bits in reverse order."""
    x = x.byteswap()
    for shift, mask in ((4, 0x0F0F0F0F), (2, 0x33333333), (1, 0x55555555)):
        x = (x >> u4(shift)) & u4(mask) | (x & u4(mask)) << u4(shift)
    return x


def _fraction(word: Words, out: Floats) -> Floats:
    """Return the top 24 bits of `word` (n,) as numbers in [0, 1) in `out`; `word` is overwritten."""
    word >>= u4(8)
    np.copyto(out, word.view(np.int32), casting="unsafe")  # signed integers convert twice as fast
    out *= _UNIT
    return out


def _high_fraction(word: Longs, out: Floats) -> Floats:
    """Return the top 24 bits of `word` (n,) as numbers in [0, 1) in `out`; `word` is overwritten."""
    word >>= u8(40)
    np.copyto(out, word.view(np.int64), casting="unsafe")
    out *= _UNIT
    return out
