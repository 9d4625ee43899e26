"""Samplers fill the unit interval and the unit square evenly: the density of their numbers is 1."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from inside import SAMPLERS, _mix_longs, _stream, make_sampler
from jacobians import some

words = st.integers(0, 2**32 - 1)
addresses = {
    "seed": st.integers(0, 2**64 - 1),
    "pixel": words,
    "bounce": st.integers(0, 2**18),
    "dimension": st.integers(0, 2**20 + 3),
}
nets = pytest.mark.parametrize("name", [name for name in sorted(SAMPLERS) if name != "independent"])


def numbers(name: str, n: int, seed: int, pixel: int, bounce: int, dimension: int, block: int = 0):
    """The numbers of n consecutive samples, (2, n)."""
    sample = np.arange(n, dtype=np.uint32) + np.uint32(block * n)
    return make_sampler(name, seed, 640).draw_2d(np.full(n, pixel, np.uint32), sample, bounce, dimension)


@nets
@some
@given(m=st.integers(0, 10), block=st.integers(0, 2**12), data=st.data(), **addresses)
def test_every_interval_has_its_part(name: str, m: int, block: int, data: st.DataObject, **address) -> None:
    """Of 2ᵐ consecutive samples one is in each of 2ᵐ equal rectangles, of any shape."""
    rows = 2 ** data.draw(st.integers(0, m))
    u = numbers(name, 2**m, block=block, **address).astype(float)
    cell = (u[0] * rows).astype(int) * (2**m // rows) + (u[1] * (2**m // rows)).astype(int)
    assert (np.bincount(cell, minlength=2**m) == 1).all()


@some
@given(seed=addresses["seed"], bounce=addresses["bounce"], start=st.integers(0, 2**64 - 4096))
def test_independent_numbers_are_a_permutation(seed: int, bounce: int, start: int) -> None:
    """The hash loses no word and repeats none, so over all addresses each number is drawn equally often."""
    keys = _stream(seed, bounce, 5).longs
    word = np.uint64(start) + np.arange(2048, dtype=np.uint64)
    hashed = _mix_longs(word.copy(), *keys)
    assert (unhashed(hashed, *keys) == word).all()


def unhashed(x: np.ndarray, key: np.uint64, tweak: np.uint64) -> np.ndarray:
    """Undo `_mix_longs`, step by step: products by the inverses modulo 2⁶⁴."""
    modulus = 1 << 64
    first, second = (
        np.uint64(pow(factor, -1, modulus)) for factor in (0xBF58476D1CE4E5B9, 0x94D049BB133111EB)
    )
    x = x ^ (x >> np.uint64(31)) ^ (x >> np.uint64(62))
    x = x * second
    x = x ^ (x >> np.uint64(27)) ^ (x >> np.uint64(54))
    x = (x - tweak) * first
    x = x ^ (x >> np.uint64(30)) ^ (x >> np.uint64(60))
    return x ^ key
