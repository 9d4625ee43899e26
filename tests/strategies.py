"""Strategies of hypothesis for this project's arrays."""

import numpy as np
from hypothesis import strategies as st
from inside import f4

POLES = np.array(
    [[0, 0, 1], [0, 0, -1], [0, -0.0, -1], [1e-30, 0, 1], [1e-4, 0, -1], [1, 0, 0], [0, 1, -0.0]]
).T

seeds = st.integers(0, 2**63)


@st.composite
def unit_vectors(draw, min_count: int = 1, max_count: int = 20):
    """Unit vectors (3, n) float32, half of them the poles and their neighborhood."""
    count = draw(st.integers(min_count, max_count))
    rng = np.random.default_rng(draw(seeds))
    poles = POLES[:, rng.integers(0, POLES.shape[1], count)]
    v = np.where(rng.random(count) < 0.5, poles, rng.normal(size=(3, count)))
    return (v / np.linalg.norm(v, axis=0)).astype(f4)


@st.composite
def vectors(draw, count: int, reach: float = 100):
    """Vectors (3, count) float32."""
    rng = np.random.default_rng(draw(seeds))
    return rng.uniform(-reach, reach, (3, count)).astype(f4)


@st.composite
def index_lists(draw, count: int):
    """Any indices into `count` columns, with repeats, perhaps none."""
    return np.array(draw(st.lists(st.integers(0, count - 1), max_size=2 * count)), np.intp)


@st.composite
def rotations(draw):
    """A proper rotation (3, 3), uniform by a random seed."""
    rng = np.random.default_rng(draw(seeds))
    q, r = np.linalg.qr(rng.normal(size=(3, 3)))
    q = q * np.sign(np.diag(r))
    return q * np.linalg.det(q)
