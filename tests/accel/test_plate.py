"""A plate beside other triangles is met by arithmetic: as the accelerators of all triangles meet it."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from inside import (
    FACES,
    Geometry,
    NumpyAccelerator,
    Plate,
    PlateAccelerator,
    RayCounter,
    SpherePrimitives,
    beside_plate,
    plate,
    surely_occluded,
)
from rays import random_rays, sphere_mesh

import wavefront as wf

f4 = np.float32
TURNED = np.array([0.48, 0.6, 0.64])
RAYS = 4000


def corners_of(normal: object, half: float = 3.0, below: float = 1.001) -> np.ndarray:
    axis = np.asarray(normal, float)
    mesh = plate(-below * axis, axis, half, material=wf.Material(wf.Diffuse(0.5)), name="ground")
    return mesh.vertices[mesh.faces].astype(f4)


def with_ball(floor: np.ndarray) -> np.ndarray:
    return np.concatenate([sphere_mesh(2).astype(f4), floor])


def rays_around(n: int, seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return rays that start and lead anywhere around a ball and its floor, a third on a triangle."""
    origin, direction = random_rays(n, seed, 2.5)
    return origin, direction, np.random.default_rng(seed).integers(-320, 320 + FACES, n).clip(-1)


@pytest.mark.parametrize("normal", [(0, 1, 0), (0, 0, 1), (-1, 0, 0), TURNED])
def test_rays_meet_a_plate_where_they_meet_its_triangles(normal: object) -> None:
    triangles = with_ball(corners_of(normal))
    whole = NumpyAccelerator(Geometry(triangles))
    split = beside_plate(NumpyAccelerator, Geometry(triangles), np.zeros(len(triangles), bool))
    assert isinstance(split, PlateAccelerator)
    origin, direction, left = rays_around(RAYS, 1)
    # all of a plate is left together: it is flat
    left[left >= split.first] = -1
    a, b = whole.closest(origin, direction, left), split.closest(origin, direction, left)
    met = np.isfinite(a.t)
    assert np.array_equal(met, np.isfinite(b.t))
    assert 0.2 < met.mean() < 0.95
    assert (a.prim >= split.first).sum() > 200
    assert np.allclose(a.t[met], b.t[met], rtol=1e-5, atol=1e-5)
    assert (a.prim == b.prim).mean() > 0.999  # but on edges between patches
    same = met & (a.prim == b.prim)
    assert np.allclose(a.b1[same], b.b1[same], atol=2e-5)
    assert np.allclose(a.b2[same], b.b2[same], atol=2e-5)
    distance = np.random.default_rng(2).uniform(0, 4, RAYS).astype(f4)
    clear = ~(np.abs(a.t - distance) < 1e-4)
    blocked = split.occluded(origin, direction, distance, left)
    assert np.array_equal(whole.occluded(origin, direction, distance, left)[clear], blocked[clear])


def test_rays_that_leave_a_plate_do_not_meet_it() -> None:
    split = beside_plate(NumpyAccelerator, Geometry(with_ball(corners_of((0, 1, 0)))), np.zeros(338, bool))
    origin, direction = random_rays(RAYS, 3, 2.5)
    origin[1] = -1.001 + np.random.default_rng(4).normal(size=RAYS) * 1e-6
    for face in (split.first, split.first + FACES - 1):
        found = split.closest(origin, direction, np.full(RAYS, face))
        assert (found.prim < split.first).all()
        assert not split.surely_occluded(origin, direction, np.full(RAYS, 9, f4), np.full(RAYS, face))[
            1
        ].any()


@pytest.mark.parametrize("place", [(0, 0), (5, 1), (FACES - 1, 2)])
def test_what_is_a_plate_but_for_one_corner_is_none(place: tuple[int, int]) -> None:
    floor = corners_of(TURNED)
    assert Plate.of(floor) is not None
    floor[place] += f4(1e-4)
    assert Plate.of(floor) is None
    triangles = with_ball(floor)
    made = beside_plate(NumpyAccelerator, Geometry(triangles), np.zeros(len(triangles), bool))
    assert isinstance(made, NumpyAccelerator)


def test_leaning_short_and_lonely_plates_are_none() -> None:
    floor = corners_of((0, 1, 0))
    assert Plate.of(floor[:-1]) is None
    assert Plate.of(floor * f4(0)) is None
    for bend in ((1, 1, 0.999), (1, 1, 1.001)):
        assert Plate.of(floor * np.array(bend, f4)) is None
    leaning = floor.copy()
    leaning[..., 0] += f4(0.001) * leaning[..., 2]
    assert Plate.of(leaning) is None
    assert isinstance(
        beside_plate(NumpyAccelerator, Geometry(floor), np.zeros(FACES, bool)), NumpyAccelerator
    )
    spheres = SpherePrimitives(np.zeros((3, 1), f4), np.ones(1, f4))
    geometry = Geometry(with_ball(floor), (spheres,))
    assert isinstance(beside_plate(NumpyAccelerator, geometry, np.zeros(339, bool)), NumpyAccelerator)


def test_only_opaque_things_block_surely() -> None:
    geometry, has_alpha = Geometry(with_ball(corners_of((0, 1, 0)))), np.zeros(338, bool)
    has_alpha[320:] = True  # those of the plate
    origin, direction, left = rays_around(RAYS, 5)
    left[left >= 320] = -1
    far = np.full(RAYS, np.inf, f4)
    opaque = beside_plate(NumpyAccelerator, geometry, has_alpha)
    met = opaque.occluded(origin, direction, far, left)
    blocked, others = surely_occluded(RayCounter(opaque), origin, direction, far, left)
    ball = NumpyAccelerator(Geometry(geometry.triangles[:320]))
    assert np.array_equal(blocked, ball.occluded(origin, direction, far, left))
    assert np.array_equal(blocked ^ others, met)
    assert others.sum() > 100
    has_alpha[7] = True  # one triangle of the ball
    for each in (beside_plate(NumpyAccelerator, geometry, has_alpha), NumpyAccelerator(geometry)):
        blocked, others = surely_occluded(each, origin, direction, far, left)
        assert not blocked.any()
        assert np.array_equal(others, met)


def test_the_ball_of_the_rest_holds_rays_that_touch_its_corners() -> None:
    triangles = with_ball(corners_of((0, 1, 0)))
    split = beside_plate(NumpyAccelerator, Geometry(triangles), np.zeros(338, bool))
    corner = triangles[:320].reshape(-1, 3).T
    rng = np.random.default_rng(6)
    tangent = np.cross(corner.T, rng.normal(size=(corner.shape[1], 3))).T
    tangent = (tangent / np.linalg.norm(tangent, axis=0)).astype(f4)
    for away in (2, 50, 1e4):
        near = split._near((corner - f4(away) * tangent).astype(f4), tangent)
        assert near.size == corner.shape[1]
    assert split._near(f4([[0], [1.1], [0]]), f4([[0], [1], [0]])).size == 0


def test_it_can_be_sent_to_workers() -> None:
    split = beside_plate(NumpyAccelerator, Geometry(with_ball(corners_of(TURNED))), np.zeros(338, bool))
    origin, direction, left = rays_around(100, 7)
    there = pickle.loads(pickle.dumps(split))
    assert np.array_equal(there.closest(origin, direction, left).t, split.closest(origin, direction, left).t)
