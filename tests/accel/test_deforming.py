"""Rays that meet what deforms at their times meet what a still accelerator has of it then."""

import numpy as np
import pytest
from inside import (
    DeformingAccelerator,
    Geometry,
    NumpyAccelerator,
    PrimitiveTree,
    SpherePrimitives,
    SweptSpheres,
    SweptTriangles,
    joined_steps,
)

import wavefront as wf

N = 1500
TIMES = np.array([1.0, 1.5, 3.0])


def rays(rng):
    origin = np.float32(rng.normal(size=(3, N)) * 0.3 + [[0], [0], [4]])
    direction = np.float32(rng.normal(size=(3, N)) * 0.5) - origin
    return origin, direction / np.float32(np.linalg.norm(direction, axis=0)), np.full(N, -1)


def triangles():
    """A bent sheet at three times, (3, m, 3, 3)."""
    u, v = np.meshgrid(np.linspace(-1, 1, 16), np.linspace(-1, 1, 16), indexing="ij")
    forms = [
        np.stack([u * a + c, v, b * np.sin(3 * u)], -1)
        for a, b, c in ((1, 0.1, 0), (0.6, 0.4, 0.2), (1, -0.5, 1))
    ]
    corner = np.stack([np.stack([f[:-1, :-1], f[1:, :-1], f[:-1, 1:]], 2) for f in forms])
    return corner.reshape(3, -1, 3, 3).astype(np.float32)


def spheres():
    """Centers at three times, (3, 3, k), and radii."""
    rng = np.random.default_rng(5)
    return rng.uniform(-1, 1, (3, 3, 300)).astype(np.float32), rng.uniform(0.02, 0.1, 300).astype(np.float32)


def moving_and_still(kind):
    """What deforms, and a function from a step and a part of it to what is still."""
    if kind == "triangles":
        forms = triangles()
        steps = [SweptTriangles(forms[at : at + 2], np.array([0.0, 1.0])) for at in range(2)]
    else:
        forms, radii = spheres()
        steps = [SweptSpheres(*forms[at : at + 2], radii) for at in range(2)]

    def still(step, part):
        then = forms[step] + (forms[step + 1].astype(float) - forms[step]) * part
        if kind == "triangles":
            return NumpyAccelerator(Geometry(then.astype(np.float32)))
        nothing = np.zeros((0, 3, 3), np.float32)
        return NumpyAccelerator(Geometry(nothing, (SpherePrimitives(then.astype(np.float32), radii),)))

    return DeformingAccelerator(TIMES, steps, True), still


@pytest.mark.parametrize("kind", ["triangles", "spheres"])
def test_rays_meet_what_is_there_at_their_times(kind):
    rng = np.random.default_rng(2)
    moving, still = moving_and_still(kind)
    for step, part in ((0, 0.0), (0, 0.3), (1, 0.7), (1, 1.0)):
        origin, direction, nothing = rays(rng)
        time = np.full(N, TIMES[step] + part * (TIMES[step + 1] - TIMES[step]))
        found = moving.at(time).closest(origin, direction, nothing)
        expected = still(step, part).closest(origin, direction, nothing)
        same = found.prim == expected.prim
        assert same.mean() > 0.999  # rounding decides at edges
        met = same & (found.prim >= 0)
        assert met.mean() > 0.05
        np.testing.assert_allclose(found.t[met], expected.t[met], rtol=1e-5)
        np.testing.assert_allclose(found.b1[met], expected.b1[met], atol=2e-4)
        for distance in (np.full(N, 3.9, np.float32), np.full(N, np.inf, np.float32)):
            blocked = moving.at(time).occluded(origin, direction, distance, nothing)
            assert (
                blocked == still(step, part).occluded(origin, direction, distance, nothing)
            ).mean() > 0.999


@pytest.mark.parametrize("kind", ["triangles", "spheres"])
def test_each_ray_has_its_own_time_and_no_ray_knows_of_others(kind):
    rng = np.random.default_rng(3)
    moving, still = moving_and_still(kind)
    origin, direction, nothing = rays(rng)
    time = rng.uniform(1, 3, N)
    found = moving.at(time).closest(origin, direction, nothing)
    for lane in np.flatnonzero(found.prim >= 0)[:20].tolist():
        step = int(time[lane] >= 1.5)
        part = (time[lane] - TIMES[step]) / (TIMES[step + 1] - TIMES[step])
        one = origin[:, [lane]], direction[:, [lane]], nothing[:1]
        assert abs(still(step, part).closest(*one).t[0] - found.t[lane]) < 1e-4
        alone = moving.at(time[[lane]]).closest(*one)
        assert (alone.t[0], alone.prim[0]) == (found.t[lane], found.prim[lane])


def test_edges_let_no_ray_through():
    """Rays to points on the edges of a closed mesh that deforms, at any time, meet it."""
    box = wf.Box((0, 0, 0), 1)
    corners = box.vertices[box.faces].astype(np.float32)
    forms = np.stack([corners, corners * np.float32([1.3, 0.7, 1])])
    moving = DeformingAccelerator(np.array([0.0, 1.0]), [SweptTriangles(forms, np.array([0.0, 1.0]))], False)
    rng = np.random.default_rng(4)
    time, face, along = rng.random(N), rng.integers(0, len(corners), N), rng.random((N, 1))
    then = forms[0][face] + (forms[1][face] - forms[0][face]) * time[:, None, None]
    origin = np.zeros((3, N), np.float32)  # within
    direction = (then[:, 0] * along + then[:, 1] * (1 - along)).T.astype(np.float32)
    assert np.isfinite(moving.at(time).closest(origin, direction, np.full(N, -1)).t).all()


def bent(off):
    """A sheet of triangles at three times, with corners up to `off` edges beside lines between the ends."""
    first, last = triangles()[:2]
    edge = np.linalg.norm(first[:, 1] - first[:, 0], axis=1).mean()
    wave = np.sin(40 * first[..., [1, 2, 0]]) * off * edge
    return [first, (0.6 * first + 0.4 * last + wave).astype(np.float32), last]


def test_steps_along_lines_are_joined():
    times = np.array([0, 0.4, 1])
    for off, joined in ((0, True), (0.03, True), (1, False)):
        ends, steps = joined_steps(times, bent(off))
        assert (ends.tolist(), len(steps)) == (([0, 1], 1) if joined else ([0, 0.4, 1], 2))


@pytest.mark.parametrize("off", [0.03, 1])
def test_rays_meet_what_is_beside_lines(off):
    rng, times, forms = np.random.default_rng(6), np.array([0, 0.4, 1]), bent(off)
    moving = DeformingAccelerator(*joined_steps(times, forms), True)
    for time in (0.2, 0.4, 0.55):
        origin, direction, nothing = rays(rng)
        found = moving.at(np.full(N, time)).closest(origin, direction, nothing)
        before, after, part = (*forms[:2], time / 0.4) if time < 0.4 else (*forms[1:], (time - 0.4) / 0.6)
        then = before + (after.astype(float) - before) * part
        expected = NumpyAccelerator(Geometry(then.astype(np.float32))).closest(origin, direction, nothing)
        met = (found.prim == expected.prim) & (found.prim >= 0)
        assert (found.prim == expected.prim).mean() > 0.999
        np.testing.assert_allclose(found.t[met], expected.t[met], rtol=1e-5)


def test_what_goes_far_costs_few_tests(monkeypatch):
    """The boxes of its tree go along: rays come to hardly more leaves than where it stands still."""
    u, v = np.meshgrid(np.linspace(-1, 1, 120), np.linspace(-1, 1, 120), indexing="ij")
    sheet = np.stack([u, v, 0.1 * np.sin(9 * u) * np.sin(8 * v)], -1)
    still = np.stack([sheet[:-1, :-1], sheet[1:, :-1], sheet[:-1, 1:]], 2).reshape(-1, 3, 3)
    forms = [np.float32(still * (1, 1 - d, 1) + (2 * d, 0, 0)) for d in (-0.3, 0.3)]
    visits, visit = [], PrimitiveTree._visit

    def counted(tree, n, features, tests, leaf, lane):
        visits.append(leaf.size)
        visit(tree, n, features, tests, leaf, lane)

    monkeypatch.setattr(PrimitiveTree, "_visit", counted)
    origin, direction, nothing = rays(np.random.default_rng(7))
    NumpyAccelerator(Geometry(np.float32(still))).closest(origin, direction, nothing)
    once = sum(visits)
    visits.clear()
    moving = DeformingAccelerator(*joined_steps(np.array([0.0, 1.0]), forms), True)
    moving.at(np.full(N, 0.5)).closest(origin, direction, nothing)
    assert 0.3 * once < sum(visits) < 1.5 * once
