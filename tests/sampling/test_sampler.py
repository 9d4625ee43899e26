"""Random numbers by address: purity, uniformity, independence of addresses, and stratification."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from inside import (
    BLOCK,
    SAMPLERS,
    VARIANTS,
    BlueNoiseSampler,
    Dimension,
    IndependentSampler,
    Sampler,
    SceneError,
    SobolSampler,
    make_sampler,
    numbers_of,
)
from scipy import stats

import wavefront.sampling.sampler as module

KINDS = {"independent": IndependentSampler, "sobol": SobolSampler, "bluenoise": BlueNoiseSampler}
some = settings(max_examples=settings.default.max_examples * 2 // 5)
names = pytest.mark.parametrize("name", sorted(SAMPLERS))
words = st.integers(0, 2**32 - 1)
seeds = st.integers(0, 2**64 - 1)
bounces = st.integers(0, 2**16)
dimensions = st.sampled_from(Dimension)


def u4(values: object) -> np.ndarray:
    return np.asarray(values, np.uint32)


def one_pixel(sampler: Sampler, pixel: int, count: int, bounce: int = 1, dimension: int = 5, first: int = 0):
    """Points (2, count) of consecutive samples of one pixel."""
    sample = np.arange(count, dtype=np.uint32) + np.uint32(first)
    return sampler.draw_2d(np.full(count, pixel, np.uint32), sample, bounce, dimension)


def grid(sampler: Sampler, pixels: int, samples: int, bounce: int = 1, dimension: int = 5):
    """Points (2, pixels, samples) of a block of addresses."""
    pixel = np.arange(pixels, dtype=np.uint32).repeat(samples)
    sample = np.tile(np.arange(samples, dtype=np.uint32), pixels)
    return sampler.draw_2d(pixel, sample, bounce, dimension).reshape(2, pixels, samples)


# Addresses


@names
@some
@given(
    seed=seeds,
    addresses=st.lists(st.tuples(words, words), min_size=1, max_size=20),
    bounce=bounces,
    dim=dimensions,
)
def test_numbers_do_not_depend_on_the_batch(name, seed, addresses, bounce, dim):
    sampler = make_sampler(name, seed, 1 << 16)
    pixel, sample = u4(addresses).T.copy()
    together_1d = sampler.draw_1d(pixel, sample, bounce, dim)
    together_2d = sampler.draw_2d(pixel, sample, bounce, dim)
    assert together_1d.dtype == together_2d.dtype == np.float32
    assert together_1d.shape == pixel.shape
    assert together_2d.shape == (2, len(pixel))
    for i in range(len(pixel)):
        lane = slice(i, i + 1)
        assert sampler.draw_1d(pixel[lane], sample[lane], bounce, dim)[0] == together_1d[i]
        assert (sampler.draw_2d(pixel[lane], sample[lane], bounce, dim)[:, 0] == together_2d[:, i]).all()


@names
def test_inputs_are_left_alone(name):
    pixel, sample = u4(range(100)), u4(range(100))
    make_sampler(name, 1, 1 << 16).draw_2d(pixel, sample, 0, 0)
    make_sampler(name, 1, 1 << 16).draw_1d(pixel, sample, 0, 0)
    assert (pixel == np.arange(100)).all()
    assert (sample == np.arange(100)).all()


@names
def test_no_lanes_give_no_numbers(name):
    sampler = make_sampler(name)
    assert sampler.draw_1d(u4([]), u4([]), 0, 0).shape == (0,)
    assert sampler.draw_2d(u4([]), u4([]), 0, 0).shape == (2, 0)


def test_table_and_direct_evaluation_agree():
    """Waves within one block of samples read a table, others do not; the bits are the same."""
    sampler = SobolSampler(9)
    for first in (0, BLOCK, 2**32 - BLOCK):
        table = one_pixel(sampler, 7, BLOCK, first=first)
        lone = np.concatenate(
            [one_pixel(sampler, 7, 1, first=first + i) for i in range(0, BLOCK, 37)], axis=1
        )
        assert (table[:, ::37] == lone).all()
        wide = sampler.draw_2d(u4([7] * (BLOCK + 1)), u4([*range(first, first + BLOCK), first ^ BLOCK]), 1, 5)
        assert (wide[:, :-1] == table).all()


@names
def test_frozen_values(name):
    """A picture made with a seed stays that picture: these may change only with a changelog entry."""
    points = make_sampler(name, 0x0123456789ABCDEF, 1 << 16).draw_2d(
        u4([0, 1, 1000, 2**32 - 1]), u4([0, 5, 300, 2**32 - 1]), 3, Dimension.LIGHT_POINT
    )
    assert (points * 2**24).astype(int).tolist() == FROZEN[name]


def test_hash_is_splitmix64():
    """First outputs of SplitMix64 from state 1234567, as published with its reference implementation."""
    published = [6457827717110365317, 3203168211198807973, 9817491932198370423]
    states = [(1234567 + (i + 1) * 0x9E3779B97F4A7C15) % 2**64 for i in range(3)]
    assert [module._mix64(state) for state in states] == published
    lanes = module._mix_longs(np.array(states, np.uint64), np.uint64(0), np.uint64(0))
    assert lanes.tolist() == published


@names
@some
@given(seed=seeds, bit=st.integers(0, 63))
def test_every_bit_of_the_seed_counts(name, seed, bit):
    a = one_pixel(make_sampler(name, seed, 1 << 16), 3, 16)
    b = one_pixel(make_sampler(name, seed ^ (1 << bit)), 3, 16)
    assert (a != b).mean() > 0.9


@names
@some
@given(pixel=words, bounce=bounces, dim=dimensions, bit=st.integers(0, 31))
def test_every_part_of_the_address_counts(name, pixel, bounce, dim, bit):
    sampler = make_sampler(name, 1, 1 << 16)
    here = one_pixel(sampler, pixel, 8, bounce, dim)
    for other in (
        one_pixel(sampler, pixel ^ (1 << bit), 8, bounce, dim),
        one_pixel(sampler, pixel, 8, bounce + 1, dim),
        one_pixel(sampler, pixel, 8, bounce, (dim + 1) % len(Dimension)),
        one_pixel(sampler, pixel, 8, bounce, dim, first=8),
    ):
        assert (here != other).mean() > 0.8


def test_no_two_decisions_share_numbers():
    """Also where decisions repeat along a ray: their ranges are disjoint."""
    ranges = sorted((numbers_of(dimension) for dimension in Dimension), key=lambda numbers: numbers.start)
    assert all(len(numbers) > 0 for numbers in ranges)
    assert all(before.stop <= after.start for before, after in itertools.pairwise(ranges))
    assert numbers_of(Dimension.OPACITY) == range(7, 2**20)
    assert numbers_of(Dimension.LIGHT) == range(2, 3)


# Range and uniformity


@names
def test_numbers_stay_below_one(name):
    u = one_pixel(make_sampler(name, 2, 1 << 16), 5, 1 << 20)
    assert u.min() >= 0
    assert u.max() < 1
    assert u.max() > 1 - 1e-5


def test_the_largest_word_stays_below_one():
    top = module._fraction(u4([0xFFFFFFFF]), np.empty(1, np.float32))
    assert top[0] == np.float32(1 - 2.0**-24)
    top = module._high_fraction(np.array([2**64 - 1], np.uint64), np.empty(1, np.float32))
    assert top[0] == np.float32(1 - 2.0**-24)


@names
@pytest.mark.parametrize("along", ["pixel", "sample"])
def test_points_are_uniform(name, along):
    """Chi-square over 64 × 64 cells; many pixels with one sample each, or one pixel's samples."""
    n = 1 << 18
    run, still = np.arange(n, dtype=np.uint32), np.full(n, 11, np.uint32)
    address = (run, still) if along == "pixel" else (still, run)
    u = make_sampler(name, 4, 512).draw_2d(*address, 2, Dimension.DIRECTION)
    cell = (u[0] * 64).astype(int) * 64 + (u[1] * 64).astype(int)
    assert stats.chisquare(np.bincount(cell, minlength=4096)).pvalue > 1e-3


def test_low_bits_of_independent_numbers_are_uniform():
    u = one_pixel(IndependentSampler(8), 1, 1 << 18)
    for row in u:
        low = (row * 2**24).astype(int) & 255
        assert stats.chisquare(np.bincount(low, minlength=256)).pvalue > 1e-3


# Independence of addresses


def shifted(sampler: Sampler, pixel: int, sample: int, bounce: int, dimension: int):
    """Points (2, n) of 256 × 256 addresses, all moved by the arguments."""
    p = np.arange(256, dtype=np.uint32).repeat(256) + np.uint32(pixel)
    s = np.tile(np.arange(256, dtype=np.uint32), 256) + np.uint32(sample)
    return sampler.draw_2d(p, s, 2 + bounce, 3 + dimension)


@pytest.mark.parametrize(
    "step",
    [(1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1), (512, 0, 0, 0), (0, 0, 1, -1), (1, 0, 1, 1)],
)
def test_independent_neighbors_are_independent(step):
    """No correlation and a uniform joint histogram of each pair of coordinates."""
    sampler = IndependentSampler(6)
    here, there = shifted(sampler, 0, 0, 0, 0), shifted(sampler, *step)
    n = here.shape[1]
    for a in here:
        for b in there:
            assert abs(np.corrcoef(a, b)[0, 1]) < 4.5 / np.sqrt(n)
            joint = np.bincount((a * 16).astype(int) * 16 + (b * 16).astype(int), minlength=256)
            assert stats.chisquare(joint).pvalue > 1e-4


def test_streams_are_not_one_stream_at_other_addresses():
    """With a key at the input alone, stream b would be stream a at an XOR of the address."""
    a, b = (module._stream(1, 2, dimension).longs for dimension in (3, 4))
    word = np.arange(64, dtype=np.uint64) << np.uint64(32)
    moved = word ^ a[0] ^ b[0]
    assert (module._mix_longs(word.copy(), *a) != module._mix_longs(moved, *b)).all()
    a, b = (module._stream(1, 2, dimension).words for dimension in (3, 4))
    pixel = np.arange(64, dtype=np.uint32)
    assert (module._mix_words(pixel, a[0], a[1]) != module._mix_words(pixel ^ a[0] ^ b[0], b[0], b[1])).all()


def test_coordinates_of_a_point_are_uncorrelated():
    x, y = shifted(IndependentSampler(6), 0, 0, 0, 0)
    assert abs(np.corrcoef(x, y)[0, 1]) < 4.5 / np.sqrt(len(x))


@pytest.mark.parametrize(
    ("bounce", "step"),
    [
        (2, (1, 0, 0, 0)),
        (2, (512, 0, 0, 0)),
        (2, (0, 0, 1, 0)),
        (2, (0, 0, 0, 1)),
        (2, (0, 0, 1, -1)),
        (0, (0, 0, 0, -Dimension.LIGHT_POINT)),
        (0, (0, 0, 0, Dimension.DIRECTION - Dimension.LIGHT_POINT)),
    ],
)
def test_errors_of_sobol_pixels_and_streams_are_uncorrelated(bounce, step):
    """Sums over 16 samples of one pixel and stream say nothing about those of another."""
    sampler = SobolSampler(12)
    address = [u4(range(20_000)).repeat(16), np.tile(u4(range(16)), 20_000), bounce, Dimension.LIGHT_POINT]
    here = sampler.draw_2d(*address)
    pixel, sample, bounce, dimension = address
    there = sampler.draw_2d(pixel + np.uint32(step[0]), sample, bounce + step[2], dimension + step[3])
    for f in (lambda u: u[0], lambda u: u[1], lambda u: u[0] * u[1], lambda u: np.cos(9 * u[0] + 5 * u[1])):
        a, b = (f(u).reshape(-1, 16).mean(axis=1, dtype=np.float64) for u in (here, there))
        assert abs(np.corrcoef(a, b)[0, 1]) < 4.5 / np.sqrt(len(a))


@pytest.mark.parametrize(("samples", "rows"), [(16, (0, 0)), (256, (1, 1)), (64, (0, 1))])
def test_sobol_streams_pair_at_random(samples, rows):
    """Shuffling: within a pixel, the covariance of two streams falls as that of random pairs does.

    A shuffle that keeps every aligned block together flips pairs of samples as one, so the
    variance is up to twice that of free pairs; without a shuffle it grows with the samples.
    """
    excess = []
    for seed in range(100):
        sampler = SobolSampler(seed)
        a = grid(sampler, 64, samples, dimension=3)[rows[0]] - 0.5
        b = grid(sampler, 64, samples, dimension=5)[rows[1]] - 0.5
        excess.append(144 * samples * np.mean((a * b).mean(axis=1, dtype=np.float64) ** 2))
    assert 1 < np.mean(excess) < 2


def test_sobol_pixels_use_all_copies_and_distinct_points():
    u = grid(SobolSampler(3), 4096, 2)
    assert len(np.unique(u[0, :, 0])) > 4080
    # The XOR between a pixel's first two points belongs to its copy of the sequence.
    fixed = (u * 2**24).astype(np.uint32)
    assert len(np.unique(fixed[0, :, 0] ^ fixed[0, :, 1])) == VARIANTS


# Stratification


stratified = pytest.mark.parametrize("name", ["sobol", "bluenoise"])


def test_unscrambled_points_are_sobols():
    index = np.arange(4096, dtype=np.uint32)
    ours = np.stack([module._reverse(index), module._reverse(module._pascal(index))]) / 2.0**32
    # SciPy walks the sequence in Gray-code order.
    oracle = stats.qmc.Sobol(2, scramble=False, bits=32).random(4096).T
    gray = index ^ (index >> 1)
    assert (ours[:, gray] == oracle).all()


def times(a: int, b: int) -> int:
    """Product of two numbers of GF(4), whose bits are those of polynomials modulo w² + w + 1."""
    product = (a if b & 1 else 0) ^ (a << 1 if b & 2 else 0)
    return product ^ (0b111 if product & 4 else 0)


@given(index=words)
def test_four_coordinates_are_of_pascals_matrices_over_gf4(index):
    """Digit i is the sum of C(j, i) a^(j − i) times digit j, for a = w, and for a = w².

    Of those of w² the higher bit is added to the lower one.
    """
    digits = [index >> 2 * j & 3 for j in range(16)]
    third, fourth = module._quaternary(u4([index]))
    for base, found in ((2, third), (3, fourth)):
        powers = [1, base, times(base, base)]
        for i in range(16):
            digit = 0
            for j in range(i, 16):
                digit ^= times(powers[(j - i) % 3], digits[j]) if i & j == i else 0
            digit ^= digit >> 1 if base == 3 else 0
            assert int(found[0]) >> 2 * i & 3 == digit


@stratified
@pytest.mark.parametrize("dimension", [Dimension.LIGHT_POINT, Dimension.DIRECTION])
def test_first_vertex_is_stratified_together_with_the_pixel(name, dimension):
    """Each aligned block of 4ᵐ samples has one point in each of the elementary intervals of base 4."""
    sampler = make_sampler(name, 3, 64)
    for m, first in ((1, 8), (2, 0), (3, 64), (4, 256)):
        pair = [one_pixel(sampler, 70, 4**m, 0, each, first) for each in (Dimension.PIXEL, dimension)]
        points = np.concatenate(pair)
        for exponents in itertools.product(range(m + 1), repeat=4):
            if sum(exponents) == m:
                cells = (points * 4.0 ** np.array(exponents)[:, None]).astype(int)
                assert len(np.unique(cells, axis=1).T) == 4**m


@stratified
@pytest.mark.parametrize("bounce", [0, 1])
def test_points_of_a_decision_are_nets(name, bounce):
    """Each aligned block of 2ᵐ samples has one point in each elementary interval, at any vertex."""
    sampler = make_sampler(name, 3, 64)
    for m, first in ((1, 6), (3, 8), (6, 128), (7, 0)):
        points = one_pixel(sampler, 70, 2**m, bounce, Dimension.DIRECTION, first)
        for k in range(m + 1):
            cells = (points * [[2**k], [2 ** (m - k)]]).astype(int)
            assert len(np.unique(cells, axis=1).T) == 2**m


@given(word=words)
def test_reversal_is_the_reversal_of_the_bits(word):
    assert module._reverse(u4([word]))[0] == int(f"{word:032b}"[::-1], 2)


@given(a=words, b=words, seed=words)
def test_owen_scrambling_keeps_the_tree(a, b, seed):
    """Two words that agree in their low k bits, and differ next, still do after the scramble."""
    before = a ^ b
    x, y = module._owen(u4([a, b]), u4([seed, seed]))
    after = int(x) ^ int(y)
    assert (before & -before) == (after & -after)


@pytest.mark.parametrize("bit", [0, 1, 2, 4, 8, 16, 24])
def test_owen_scrambling_avalanches_upwards(bit):
    """Words that differ in one bit get independent flips in all bits above it."""
    seed = module._mix_words(np.arange(1 << 14, dtype=np.uint32), np.uint32(1), np.uint32(2))
    for word in (0, 0x12345678):
        a, b = (module._owen(np.full(len(seed), w, np.uint32), seed) for w in (word, word ^ (1 << bit)))
        differ = ((a ^ b)[:, None] >> np.arange(bit + 1, 32, dtype=np.uint32)) & 1
        assert np.abs(differ.mean(axis=0) - 0.5).max() < 0.02


# What it is good for


def rms_error(sampler: Sampler, samples: int) -> float:
    """RMS error over 256 pixels of the mean of a smooth function with a known integral."""
    x, y = grid(sampler, 256, samples).astype(np.float64)
    estimate = (np.sin(np.pi * x) * np.exp(y)).mean(axis=1)
    return float(np.sqrt(np.mean((estimate - 2 / np.pi * (np.e - 1)) ** 2)))


def test_sobol_error_falls_faster_than_independent():
    """RMS slopes: −1/2 for independent, −3/2 for Owen scrambling on a smooth function (Owen 1997)."""
    counts = [4, 16, 64, 256, 1024]
    slopes = {
        name: np.polyfit(
            np.log(counts), [np.log(rms_error(make_sampler(name, 1, 1 << 16), n)) for n in counts], 1
        )[0]
        for name in KINDS
    }
    assert -0.6 < slopes["independent"] < -0.4
    assert slopes["sobol"] < -1.25
    assert slopes["bluenoise"] < -1.25


@pytest.mark.parametrize(("samples", "most"), [(1, 0.3), (4, 0.45)])
def test_blue_noise_cancels_between_neighbors(samples, most):
    """Averaged over 4 × 4 pixels the error of a smooth function is far below that of Sobol's, RMS."""
    side, error = 64, {}
    pixel = np.arange(side * side, dtype=np.uint32).repeat(samples)
    sample = np.tile(np.arange(samples, dtype=np.uint32), side * side)
    for name in ("sobol", "bluenoise"):
        squares = []
        for seed in range(8):
            x, y = make_sampler(name, seed, side).draw_2d(pixel, sample, 0, Dimension.DIRECTION).astype(float)
            value = (np.sin(np.pi * x) * np.exp(y)).reshape(side // 4, 4, side // 4, 4, samples)
            squares.append((value.mean((1, 3, 4)) - 2 / np.pi * (np.e - 1)) ** 2)
        error[name] = np.sqrt(np.mean(squares))
    assert error["bluenoise"] < most * error["sobol"]


def test_blue_noise_has_no_stripes():
    """Pairs of neighbors cancel as well one above the other as side by side."""
    side, squares = 64, {"across": [], "down": []}
    pixel, sample = np.arange(side * side, dtype=np.uint32), np.zeros(side * side, np.uint32)
    for seed in range(32):
        x, _ = BlueNoiseSampler(seed, side).draw_2d(pixel, sample, 0, Dimension.DIRECTION).astype(float)
        x = x.reshape(side, side) - 0.5
        squares["across"].append((x[:, ::2] + x[:, 1::2]) ** 2)
        squares["down"].append((x[::2] + x[1::2]) ** 2)
    across, down = (np.mean(square) for square in squares.values())
    assert across == pytest.approx(down, rel=0.1)
    assert across < 0.75 / 6  # of the mean square of two independent numbers


@given(start=st.integers(0, 2**20 - 1), key=words)
def test_turned_squares_hold_together(start, key):
    """Pixels of one square of the curve stay in one square, at every scale."""
    place = np.arange(1 << 12, dtype=np.uint32) + np.uint32(start << 12)
    turned = module._mirror_squares(place, np.uint32(key))
    assert (np.sort(turned & 0xFFF) == np.arange(1 << 12)).all()
    for shift in range(2, 13, 2):
        squares = (turned >> shift).reshape(-1, 1 << shift)
        assert (squares == squares[:, :1]).all()


def test_half_of_the_squares_are_turned():
    place = np.arange(1 << 16, dtype=np.uint32)
    turned = module._mirror_squares(place, np.uint32(0x9E3779B9)) ^ place
    for level in range(0, 10, 2):
        second = (place >> level & 3) == 1
        assert (turned[second] >> level & 3 == 3).mean() == pytest.approx(0.5, abs=0.12)


def test_blue_noise_keeps_the_error_of_a_pixel():
    for n in (16, 64, 100):
        assert rms_error(BlueNoiseSampler(1, 16), n) < 1.15 * rms_error(SobolSampler(1), n)


@stratified
def test_no_cliff_between_powers_of_two(name):
    """Any number of samples does better than the power of two below it would at independent rate."""
    errors = {}
    for n in (16, 24, 31, 32, 33, 48, 63, 64):
        squares = [rms_error(make_sampler(name, seed, 16), n) ** 2 for seed in range(8)]
        errors[n] = np.mean(squares) ** 0.5  # over seeds, since the pixels of one share a scramble
    for n, error in errors.items():
        assert error < 0.6 * rms_error(IndependentSampler(1), n), n
        assert error < 1.1 * errors[16]


@names
def test_estimates_are_unbiased(name):
    """Mean over seeds and pixels of the estimate with three samples, Student t."""
    means = []
    for seed in range(64):
        x, y = grid(make_sampler(name, seed, 16), 256, 3).astype(np.float64)
        means.append((np.sin(np.pi * x) * np.exp(y)).mean())
    assert stats.ttest_1samp(means, 2 / np.pi * (np.e - 1)).pvalue > 1e-3


# Errors


@pytest.mark.parametrize("seed", [-1, 2**64, 1.5, "7", None, True])
def test_bad_seeds_are_refused(seed):
    with pytest.raises(SceneError, match=rf"seed is {seed!r}; .*2\*\*64"):
        make_sampler("sobol", seed)


@pytest.mark.parametrize("seed", [0, 2**64 - 1, np.int64(5), np.uint64(2**64 - 1)])
def test_good_seeds_are_taken(seed):
    assert make_sampler("independent", seed).seed == int(seed)


def test_unknown_names_are_refused():
    with pytest.raises(SceneError, match=r"sampler is 'halton'; .*sobol, bluenoise, independent"):
        make_sampler("halton")


@names
def test_names_lead_to_their_class(name):
    assert type(make_sampler(name, 0, 64)) is KINDS[name]


FROZEN = {
    "bluenoise": [[3486802, 14553752, 16239200, 7857590], [6536665, 12589817, 15490235, 9100319]],
    "independent": [[4621346, 5665273, 15568934, 13404344], [13228205, 12351716, 9199278, 15940893]],
    "sobol": [[12699615, 13835210, 8659803, 4970334], [2091025, 10096002, 14757691, 5364162]],
}
