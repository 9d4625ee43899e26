"""Rays that meet what deforms at their times meet what a still accelerator has of it then."""

import numpy as np
import pytest
from inside import (
    DeformingAccelerator,
    Geometry,
    NumpyAccelerator,
    SpherePrimitives,
    SweptSpheres,
    SweptTriangles,
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
        steps = [SweptTriangles(*forms[at : at + 2]) for at in range(2)]
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
    moving = DeformingAccelerator(np.array([0.0, 1.0]), [SweptTriangles(*forms)], False)
    rng = np.random.default_rng(4)
    time, face, along = rng.random(N), rng.integers(0, len(corners), N), rng.random((N, 1))
    then = forms[0][face] + (forms[1][face] - forms[0][face]) * time[:, None, None]
    origin = np.zeros((3, N), np.float32)  # within
    direction = (then[:, 0] * along + then[:, 1] * (1 - along)).T.astype(np.float32)
    assert np.isfinite(moving.at(time).closest(origin, direction, np.full(N, -1)).t).all()
