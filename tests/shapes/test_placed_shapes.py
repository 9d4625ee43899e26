"""Copies of curved shapes by matrices: they are where the matrices put them, and keep their shape."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from inside import SpherePrimitives

import wavefront as wf

TURN = np.array([[0.36, 0.48, -0.8], [-0.8, 0.6, 0.0], [0.48, 0.64, 0.6]])  # a rotation


def at(x: float, y: float, z: float, scale: float = 1.0, turn: np.ndarray = TURN) -> np.ndarray:
    """Return a matrix that turns, scales and moves."""
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = scale * turn, (x, y, z)
    return matrix


def sees(shape: Any) -> wf.Image:
    """Return a picture of a shape, with its depth."""
    camera = wf.Camera.look_at((0, 0, 8), (0, 0, 0), fov=40, size=(48, 36))
    scene = wf.Scene(shape, [wf.Environment(0.5), wf.PointLight((3, 3, 5), 50)], camera)
    return wf.render(scene, 4, aovs=("depth", "normal"), progress=False)


def test_a_placed_sphere_is_the_sphere_at_its_place() -> None:
    """Center and radius by hand, the depth of its nearest point, and the bits of the picture."""
    red = wf.Diffuse((0.8, 0.1, 0.1))
    ball = wf.Sphere((1, 0, 0), 0.5, material=red, name="ball")
    placed = ball.placed(at(-0.72, 1.6, -0.96, 2))
    assert placed.center == pytest.approx((0, 0, 0), abs=1e-15)
    assert placed.radius == pytest.approx(1, rel=1e-15)
    assert (placed.material, placed.name) == (ball.material, "ball")
    assert ball.radius == 0.5
    axis = wf.Camera.look_at((0, 0, 8), (0, 0, 0), fov=1, size=(1, 1))
    depth = wf.render(
        wf.Scene(placed, [wf.Environment(1)], axis), 1, aovs="depth", filter="box", progress=False
    ).depth
    assert depth[0, 0] == pytest.approx(7, abs=1e-4)
    there = wf.Sphere(placed.center, placed.radius, material=red)
    assert sees(placed).rgb.tobytes() == sees(there).rgb.tobytes()


def test_a_sphere_turns_its_texture() -> None:
    """A point of the turned sphere has the coordinates of that point before; derivatives turn with it."""
    center = np.array([0.5, -1, 2])
    other = wf.Sphere((9, 9, 9), 1)  # of the same table, without a rotation
    plain, turned = wf.Sphere(center, 2), wf.Sphere(center, 2, transform=TURN)
    normal = np.random.default_rng(0).normal(size=(3, 50))
    normal /= np.linalg.norm(normal, axis=0)
    before, after = (
        ((matrix @ normal) * 2 + center[:, None]).astype(np.float32) for matrix in (np.eye(3), TURN)
    )
    one = np.ones(50, np.intp)
    first, second = (SpherePrimitives.from_shapes([other, ball], np.zeros(3)) for ball in (plain, turned))
    assert second.uv(one, after) == pytest.approx(first.uv(one, before), abs=1e-5)
    expected = (TURN @ first.dpduv(one, before).reshape(2, 3, 50)).reshape(6, 50)
    assert second.dpduv(one, after) == pytest.approx(expected, abs=2e-5)
    assert second.uv(0 * one, after) == pytest.approx(first.uv(0 * one, after), abs=1e-6)
    assert turned.placed(at(0, 0, 0, 3, TURN)).transform == pytest.approx(TURN @ TURN)
    assert turned.lengths_times(2).transform is turned.transform
    with pytest.raises(wf.SceneError, match="transform must be a rotation"):
        wf.Sphere((0, 0, 0), 1, transform=2 * np.eye(3))


COLORS = [(1, 0, 0), (0, 1, 0)]
POINTS, ENDS = np.array([(0, 0, 0), (1, 0, 0.5)]), np.array([(0, 1, 0), (1, 1, 1)])


@pytest.mark.parametrize(
    "make",
    [lambda points, ends, size, colors: wf.Spheres(points, size, colors), wf.Cylinders, wf.Capsules],
    ids=["spheres", "cylinders", "capsules"],
)
@pytest.mark.parametrize("radii", [0.2, (0.2, 0.3)], ids=["one radius", "radii"])
def test_copies_are_one_shape(make: Any, radii: Any) -> None:
    """Of each transform one after the other; each copy is what it is alone, with its colors."""
    shape = make(POINTS, ENDS, radii, COLORS)
    matrices = np.stack([at(-1, 0, 0), at(1, 0.5, -1, 1.5), at(0, -1, 0, 0.5, -TURN)])
    several = shape.placed(matrices)
    alone = [shape.placed(matrix) for matrix in matrices]
    assert several.count == 6
    assert several.colors.tolist() == 3 * shape.colors.tolist()
    for name in ("centers", "starts", "ends", "radii"):
        if hasattr(shape, name):
            parts = np.concatenate([getattr(one, name) for one in alone])
            assert np.abs(getattr(several, name) - parts).max() < 1e-15
    moves = [(1, TURN, (-1, 0, 0)), (1.5, TURN, (1, 0.5, -1)), (0.5, -TURN, (0, -1, 0))]
    points = np.concatenate([POINTS @ (factor * turn).T + shift for factor, turn, shift in moves])
    assert np.abs((several.centers if hasattr(several, "centers") else several.starts) - points).max() < 1e-12
    sizes = np.concatenate([np.broadcast_to(radii, 2) * f for f in (1, 1.5, 0.5)])
    assert np.abs(several.radii - sizes).max() < 1e-15
    together, apart = sees(several), sees(alone)
    assert np.array_equal(together.depth, apart.depth, equal_nan=True)
    assert np.isfinite(together.depth).sum() > 30
    assert together.rgb.tobytes() == apart.rgb.tobytes()


def test_a_turned_capsule_is_what_a_mesh_is_that_is_placed() -> None:
    """Its surface lies between those of meshes that are a little smaller and a little larger."""
    trimesh = pytest.importorskip("trimesh")
    capsule = wf.Capsules([(0, 0, 0)], [(0, 0, 1)], 0.4)
    round_ = trimesh.creation.capsule(height=1, radius=0.4, count=[64, 64])
    low, high = round_.bounds
    mesh = wf.Mesh(round_.vertices - ((low + high) / 2 - (0, 0, 0.5)), round_.faces)
    matrix = at(0.3, -0.2, 0.4, 1.7)
    exact, faceted = sees(capsule.placed(matrix)), sees(wf.Instance(mesh, matrix))
    both = np.isfinite(exact.depth) & np.isfinite(faceted.depth)
    assert both.sum() > 150
    assert (np.isfinite(exact.depth) ^ np.isfinite(faceted.depth)).sum() < 5
    assert np.abs(exact.depth - faceted.depth)[both].mean() < 3e-3


@pytest.mark.parametrize(
    ("transform", "message"),
    [
        (np.diag([1, 1, 2, 1]), "stretches by 1 along one axis and 2 along another"),
        (np.diag([1, 1, 0, 1]), "stretches by 0 along one axis"),
        (np.diag([1, 1, 1, 2]), "has the last row"),
        (np.eye(3), r"must have shape \(4, 4\)"),
        (np.full((4, 4), np.nan), "transform"),
    ],
)
def test_transforms_that_change_the_shape_are_refused(transform: np.ndarray, message: str) -> None:
    for shape in (
        wf.Sphere((0, 0, 0), 1),
        wf.Spheres([(0, 0, 0)], 1),
        wf.Capsules([(0, 0, 0)], [(1, 0, 0)], 1),
    ):
        with pytest.raises(wf.SceneError, match=message):
            shape.placed(transform)
