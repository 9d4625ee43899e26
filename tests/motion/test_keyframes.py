"""Keyframes: matrices at certain times, and what lies between them."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from inside import (
    CUBIC,
    LINEAR,
    STEP,
    Product,
    Together,
    Track,
    Trs,
    Turn,
    polar,
    quaternions_of,
    rotation_of,
    slerp,
)
from inside import motion_product as product
from strategies import rotations, seeds

import wavefront as wf

EPS = np.finfo(np.float64).eps
some = settings(max_examples=settings.default.max_examples // 4)
CLOSE = 64 * EPS  # some tens of roundings


def matrix(linear, shift=(0, 0, 0)):
    out = np.eye(4)
    out[:3, :3], out[:3, 3] = linear, shift
    return out


@st.composite
def affine(draw, mirror=None):
    """An affine matrix whose scales are from 1/8 to 8."""
    rng = np.random.default_rng(draw(seeds))
    first, second = draw(rotations()), draw(rotations())
    sign = draw(st.sampled_from([-1, 1])) if mirror is None else mirror
    return matrix(sign * first @ np.diag(2.0 ** rng.uniform(-3, 3, 3)) @ second, rng.uniform(-9, 9, 3))


def turned(axis, degrees):
    return wf.shapes.transform.rotation("x", axis, degrees, (0, 0, 0))[:3, :3]


@some
@given(affine())
def test_polar_parts_multiply_to_the_matrix(m):
    rotation, stretch = polar(m[None, :3, :3])
    size = np.abs(m[:3, :3]).max()
    np.testing.assert_allclose(rotation[0] @ stretch[0], m[:3, :3], atol=CLOSE * size)
    np.testing.assert_allclose(rotation[0].T @ rotation[0], np.eye(3), atol=CLOSE)
    assert np.linalg.det(rotation[0]) > 0
    assert (stretch[0] == stretch[0].T).all()
    factors = np.linalg.eigvalsh(stretch[0])
    assert (factors > 0).all() if np.linalg.det(m[:3, :3]) > 0 else (factors < 0).all()


@given(rotations())
def test_quaternions_are_those_of_rotations(rotation):
    quaternion = quaternions_of(rotation[None])
    np.testing.assert_allclose(rotation_of(quaternion)[0], rotation, atol=CLOSE)


@given(rotations(), rotations(), st.floats(0, 1))
def test_slerp_turns_evenly_the_shorter_way(a, b, part):
    qa, qb = quaternions_of(a[None]), quaternions_of(b[None])
    between = rotation_of(slerp(qa, qb, np.array([[part]])))[0]

    def angle(first, second):
        cos = (np.trace(first.T @ second) - 1) / 2
        return np.arccos(np.clip(cos, -1, 1))

    whole = angle(a, b)
    assert angle(a, between) == pytest.approx(part * whole, abs=1e-6)
    assert angle(between, b) == pytest.approx((1 - part) * whole, abs=1e-6)
    np.testing.assert_array_equal(slerp(qa, -qb, np.array([[part]])), slerp(qa, qb, np.array([[part]])))


@some
@given(affine(1), affine(1), affine(1))
def test_keys_are_met_and_ends_hold(a, b, c):
    motion = wf.Keyframes([1, 2, 4], [a, b, c])
    scale = max(np.abs(each).max() for each in (a, b, c))
    for time, want in ((0, a), (1, a), (2, b), (4, c), (9, c)):
        np.testing.assert_allclose(motion.at(time), want, atol=CLOSE * scale)
    assert (motion.start, motion.end) == (1, 4)


@some
@given(affine(), affine(), st.floats(0, 3))
def test_one_time_has_the_bits_of_many(a, b, time):
    sign = np.sign(np.linalg.det(a[:3, :3]) * np.linalg.det(b[:3, :3]))
    motion = wf.Keyframes([0.5, 2], [a, b @ np.diag([sign, 1, 1, 1])])
    many = motion.at_times(np.array([3.0, time, -1.0, 1.0]))
    np.testing.assert_array_equal(many[1], motion.at(time))


@some
@given(st.lists(affine(1), min_size=2, max_size=5), st.floats(-1, 4))
def test_many_motions_have_the_bits_of_each(matrices, time):
    keys = [wf.Keyframes([0, 1 + k, 2 + k], [m, matrices[0], m]) for k, m in enumerate(matrices)]
    one = wf.Keyframes([0.5], [matrices[-1]])
    nested = Product(keys[0], Product(matrices[1], keys[1]))
    cubic = Trs(
        Track(np.array([0.0, 2]), np.arange(18.0).reshape(2, 3, 3), CUBIC),
        Track(np.array([0.0]), np.array([[0.0, 0, 0, 1]]), turns=True),
        Track(np.array([0.0, 1]), np.ones((2, 3)), STEP),
    )
    motions = [*keys, one, nested, cubic, Product(nested, keys[0]), keys[0]]
    together = Together(motions).at(time)
    for found, motion in zip(together, motions, strict=True):
        np.testing.assert_array_equal(found, motion.at(time))


def test_translation_is_linear_and_exact():
    motion = wf.Keyframes([0, 2], [matrix(np.eye(3)), matrix(np.eye(3), (4, 0, -2))])
    np.testing.assert_array_equal(motion.at(0.5), matrix(np.eye(3), (1, 0, -0.5)))


def test_rotation_turns_evenly_and_stretch_changes_linearly():
    a, b = np.diag([1.0, 2, 3]), turned("z", 90) @ np.diag([3.0, 2, 1])
    motion = wf.Keyframes([0, 1], [matrix(a), matrix(b)])
    want = turned("z", 30) @ np.diag([1 + 2 / 3, 2, 3 - 2 / 3])
    np.testing.assert_allclose(motion.at(1 / 3)[:3, :3], want, atol=CLOSE * 3)


def test_a_mirror_stays_a_mirror_between_keys():
    mirror = np.diag([-1.0, 1, 1])
    motion = wf.Keyframes([0, 1], [matrix(mirror), matrix(turned("y", 120) @ mirror)])
    between = motion.at_times(np.linspace(0, 1, 9))[:, :3, :3]
    np.testing.assert_allclose(np.linalg.det(between), -1, atol=CLOSE)
    np.testing.assert_allclose(between[2], turned("y", 30) @ mirror, atol=CLOSE)


def test_turns_are_steady_and_go_around_once():
    turn = Turn(np.array([0.0, 2, 0]), np.array([1.0, 0, 0]), 360, 1, 3)
    np.testing.assert_allclose(turn.at(3), np.eye(4), atol=CLOSE)
    due = wf.shapes.transform.rotation("x", "y", 45, (1, 0, 0))
    np.testing.assert_allclose(turn.at(1.25), due, atol=CLOSE)
    np.testing.assert_array_equal(turn.at(0), turn.at(1))


def test_products_are_exact_between_keys():
    spin = wf.Keyframes([0, 1], [matrix(np.eye(3)), matrix(turned("y", 90))])
    arm = matrix(np.eye(3), (1, 0, 0))
    place = Product(spin, arm).at(0.5)[:3, 3]
    np.testing.assert_allclose(np.linalg.norm(place), 1, atol=CLOSE)  # on the circle, not on its chord
    np.testing.assert_array_equal(product(arm, arm), arm @ arm)


def test_tracks_of_steps_lines_and_splines():
    keys, values = np.array([0.0, 1, 3]), np.array([[1.0], [5], [2]])
    assert Track(keys, values, STEP).at_times(np.array([-1, 0.9, 1, 2.9, 3, 9])).ravel().tolist() == [
        1, 1, 5, 5, 2, 2,
    ]  # fmt: skip
    assert Track(keys, values, LINEAR).at(2.0) == 3.5
    # a cubic polynomial is met exactly by the Hermite spline of its values and slopes
    spline = np.stack([3 * keys**2, keys**3, 3 * keys**2], 1)[..., None]
    times = np.linspace(0, 3, 13)
    found = Track(keys, spline, CUBIC).at_times(times)[:, 0]
    np.testing.assert_allclose(found, times**3, atol=CLOSE * 27)


@pytest.mark.parametrize(
    ("times", "matrices", "message"),
    [
        ([], [], r"Keyframes times has 0 times; it must have at least 1"),
        ([0, 0], [np.eye(4)] * 2, r"times\[1\] is 0, after Keyframes times\[0\] = 0; times must rise"),
        ([0, 1], [np.eye(4)], r"Keyframes has 2 times and 1 matrices"),
        ([0, np.nan], [np.eye(4)] * 2, r"times\[1\] is nan; it must be finite"),
        ([0], [np.eye(3)], r"matrices must have shape \(n, 4, 4\)"),
        ([0], [2 * np.eye(4)], r"matrices\[0\] has the last row \[0.0, 0.0, 0.0, 2.0\]"),
        ([0, 1], [np.eye(4), np.diag([1, 0, 1, 1])], r"matrices\[1\] is singular: it stretches by 0"),
        ([0, 1], [np.eye(4), np.diag([1, -1, 1, 1])], r"matrices\[0\] and \[1\]: one mirrors"),
    ],
)
def test_malformed_keyframes(times, matrices, message):
    with pytest.raises(wf.SceneError, match=message):
        wf.Keyframes(times, matrices)


def test_a_motion_of_ones_own_must_return_matrices():
    class Odd(wf.Motion):
        start = end = 0.0

        def at_times(self, times):
            return np.zeros((len(times), 3, 3))

    with pytest.raises(wf.SceneError, match=r"Odd.at_times must have shape \(1, 4, 4\)"):
        wf.Instance(wf.Box((0, 0, 0), 1), Odd())
