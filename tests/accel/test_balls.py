"""Balls around a few curved primitives."""

import numpy as np
import pytest
from inside import ARRAYS_ALL as ALL
from inside import (
    MOST,
    BoundingBalls,
    CapsulePrimitives,
    CurvedPrimitives,
    CylinderPrimitives,
    Geometry,
    NumpyAccelerator,
    SpherePrimitives,
    bounding_balls,
)
from rays import nothing, random_rays

import wavefront as wf

f4 = np.float32
HERE = np.zeros(3)
SPHERES = SpherePrimitives.from_shapes([wf.Sphere((0.3, 0.1, 0), 0.4), wf.Sphere((-0.5, 0, 0), 0.2)], HERE)
STICK = [((0.1, -0.3, 0.2),), ((0.5, 0.4, -0.6),), 0.13]
KINDS = [
    SPHERES,
    CapsulePrimitives.from_shapes([wf.Capsules(*STICK)], HERE),
    CylinderPrimitives.from_shapes([wf.Cylinders(*STICK)], HERE),
]


def unfiltered(kind: CurvedPrimitives) -> NumpyAccelerator:
    return NumpyAccelerator(Geometry(np.zeros((0, 3, 3), f4), (kind,)))


def check(kind: CurvedPrimitives, origin: np.ndarray, direction: np.ndarray, left: np.ndarray) -> float:
    """No ray that hits is left out; return the part of the rays that pass and are kept all the same."""
    hit = unfiltered(kind).closest(origin, direction, left).prim >= 0
    lanes = BoundingBalls.of([kind]).near(origin, direction, left)
    kept = np.zeros(hit.size, bool)
    kept[lanes] = True
    assert not (hit & ~kept).any()
    return float((kept & ~hit).mean())


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: type(kind).__name__)
@pytest.mark.parametrize("length", [1e-3, 1, 1e4])
def test_no_ray_that_hits_is_left_out(kind: CurvedPrimitives, length: float) -> None:
    origin, direction = random_rays(8000, 3)
    direction *= f4(length)
    at = SPHERES.centers[:, np.arange(8000) % 2] - origin
    direction[:, ::2] = at[:, ::2] * f4(length)  # half of them aimed
    kept = check(kind, origin, direction, nothing(8000))
    assert kept < 0.01 or kind is not SPHERES


@pytest.mark.parametrize("away", [1.01, 3, 300, 1e4])
def test_lines_that_touch_a_sphere(away: float) -> None:
    rng = np.random.default_rng(1)
    normal, across = rng.normal(size=(2, 3, 20_000))
    normal /= np.linalg.norm(normal, axis=0)
    across -= normal * (across * normal).sum(0)
    across /= np.linalg.norm(across, axis=0)
    inside = 1 - rng.uniform(0, 1e-6, 20_000)
    center, radius = SPHERES.centers[:, :1].astype(float), float(SPHERES.radii[0])
    touch = center + normal * radius * inside
    origin = touch - across * radius * np.sqrt(away**2 - 1)
    check(SPHERES, origin.astype(f4), (touch - origin).astype(f4), nothing(20_000))


def test_rays_that_leave_a_sphere_for_the_outside_are_left_out() -> None:
    rng = np.random.default_rng(2)
    normal, direction = rng.normal(size=(2, 3, 5000)).astype(f4)
    normal /= np.linalg.norm(normal, axis=0)
    origin = SPHERES.centers[:, :1] + normal * SPHERES.radii[0]
    out = (normal * direction).sum(0) > 0.01
    left = np.zeros(5000, np.intp)
    assert check(SPHERES, origin, direction, left) < 0.02
    assert check(SPHERES, origin[:, out], direction[:, out], left[out]) < 0.02
    assert check(SPHERES, origin, direction, nothing(5000)) > 0.2  # whatever leaves elsewhere is tested


def test_rays_that_leave_a_sphere_along_its_tangents() -> None:
    rng = np.random.default_rng(4)
    normal, across = rng.normal(size=(2, 3, 20_000))
    normal /= np.linalg.norm(normal, axis=0)
    across -= normal * (across * normal).sum(0)
    origin = SPHERES.centers[:, :1] + normal * SPHERES.radii[0]
    direction = across - normal * rng.uniform(-2e-7, 2e-7, 20_000)
    check(SPHERES, origin.astype(f4), direction.astype(f4), np.zeros(20_000, np.intp))


def test_rays_that_are_none_are_kept_and_hit_nothing() -> None:
    origin, direction = np.zeros((3, 3), f4), np.full((3, 3), np.nan, f4)
    origin[:, 1], direction[:, 2] = 3e30, 0
    assert BoundingBalls.of([SPHERES]).near(origin, direction, nothing(3)) == ALL
    assert (unfiltered(SPHERES).closest(origin, direction, nothing(3)).prim < 0).all()


def test_many_primitives_have_no_balls() -> None:
    ball = wf.Sphere((0, 0, 0), 1)
    several = [SpherePrimitives.from_shapes([ball] * count, HERE) for count in (MOST, MOST + 1)]
    assert bounding_balls(several[:1]) is not None
    assert bounding_balls(several[1:]) is None
    assert bounding_balls(several) is None


@pytest.mark.parametrize("offset", [0, 300])
def test_rays_to_every_corner_come_near_the_ball_of_triangles(offset: float) -> None:
    triangles = (np.random.default_rng(4).normal(size=(40, 3, 3)) + offset).astype(f4)
    ball = BoundingBalls.around(triangles)
    corners = triangles.reshape(-1, 3).T
    origin, _ = random_rays(corners.shape[1], 5, 50)
    assert ball.near(origin, corners - origin, nothing(0)) == ALL
    elsewhere = np.random.default_rng(6).normal(size=corners.shape).astype(f4)
    assert np.size(ball.near(origin, elsewhere, nothing(0))) < 20
