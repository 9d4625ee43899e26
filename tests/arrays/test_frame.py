"""Frames: orthonormal and right-handed for every normal, and a way there and back."""

import numpy as np
import pytest
import strategies
from hypothesis import given
from hypothesis import strategies as st
from inside import Frame, cross, dot, f4, length, normalize

CLOSE = 2e-6


@given(strategies.unit_vectors())
def test_axes_are_orthonormal(z: np.ndarray) -> None:
    """Three unit vectors at right angles, also at and around both poles."""
    frame = Frame.from_normal(z)
    assert (frame.z == z).all()
    axes = frame.x, frame.y, frame.z
    for i, a in enumerate(axes):
        for j, b in enumerate(axes):
            assert dot(a, b) == pytest.approx(float(i == j), abs=CLOSE)


@given(strategies.unit_vectors())
def test_axes_are_right_handed(z: np.ndarray) -> None:
    frame = Frame.from_normal(z)
    assert cross(frame.x, frame.y) == pytest.approx(z, abs=CLOSE)


@given(strategies.unit_vectors(), st.data())
def test_there_and_back(z: np.ndarray, data) -> None:
    """to_local undoes to_world; the normal is the local z axis; lengths stay."""
    frame = Frame.from_normal(z)
    v = data.draw(strategies.vectors(z.shape[1]))
    assert frame.to_world(frame.to_local(v)) == pytest.approx(v, abs=1e-4)
    assert frame.to_local(frame.to_world(v)) == pytest.approx(v, abs=1e-4)
    assert length(frame.to_local(v)) == pytest.approx(length(v), rel=1e-5)
    up = frame.to_local(z)
    assert up == pytest.approx(np.broadcast_to([[0], [0], [1]], up.shape), abs=CLOSE)


@given(strategies.unit_vectors(min_count=2), st.data())
def test_columns_do_not_depend_on_their_neighbors(z: np.ndarray, data) -> None:
    v = data.draw(strategies.vectors(z.shape[1]))
    k = data.draw(st.integers(0, z.shape[1] - 1))
    whole = Frame.from_normal(z).to_world(v)
    alone = Frame.from_normal(z[:, k : k + 1].copy()).to_world(v[:, k : k + 1].copy())
    assert alone[:, 0].tobytes() == whole[:, k].tobytes()


@given(strategies.vectors(7))
def test_normalize(v: np.ndarray) -> None:
    unit = normalize(v)
    assert length(unit) == pytest.approx(1, abs=1e-6)
    assert dot(unit, v) == pytest.approx(length(v), rel=1e-6)


def test_normalize_leaves_zero() -> None:
    assert (normalize(np.zeros((3, 2), f4)) == 0).all()
