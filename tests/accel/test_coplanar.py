"""Faces that overlap in a plane: the first of them is hit, in every accelerator."""

from __future__ import annotations

import numpy as np
import pytest
from inside import coplanar, installed, make_accelerator, triangle
from rays import geometry, nothing, sphere_mesh

f4 = np.float32
NAMES = ["numpy", pytest.param("embree", marks=pytest.mark.skipif(not installed(), reason="no embreex"))]


def first_hits(triangles: np.ndarray, origin: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """Return the first of coplanar triangles (m, 3, 3) that each ray (3, n) meets, (n,), -1 for none."""
    n = origin.shape[1]
    hit = [
        triangle.hits_watertight(
            triangle.vertices(np.broadcast_to(each, (n, 3, 3))) - origin.astype(float),
            direction.astype(float),
        )
        for each in triangles
    ]
    return np.where(np.any(hit, 0), np.argmax(hit, 0), -1)


def rays_to(turned: np.ndarray, shift: np.ndarray, seed: int, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Return rays (3, n) from everywhere to points of a square, turned and moved."""
    rng = np.random.default_rng(seed)
    place = turned.T @ np.concatenate([rng.uniform(-0.99, 0.99, (2, n)), np.zeros((1, n))]) + shift[:, None]
    origin = (3 * rng.normal(size=(3, n)) + shift[:, None]).astype(f4)
    return origin, (place - origin).astype(f4)


def squares(order: tuple[int, ...]) -> np.ndarray:
    """Return two triangles each of three squares that overlap in the plane z = 0."""
    triangles = []
    for lowest, highest in np.array([(-1, 1), (-0.5, 0.75), (-0.875, 0.25)])[list(order)]:
        x, y = np.meshgrid((lowest, highest), (lowest, highest))
        corners = np.stack([x, y, np.zeros_like(x)], -1).reshape(4, 3)
        triangles += [corners[[0, 1, 3]], corners[[0, 3, 2]]]
    return np.array(triangles)


def scattered(count: int, seed: int) -> np.ndarray:
    """Return triangles of all sizes that overlap in the plane z = 0."""
    rng = np.random.default_rng(seed)
    size, place = rng.uniform(0.02, 1, (count, 1, 1)), rng.uniform(-0.6, 0.6, (count, 1, 2))
    corners = place + size * rng.uniform(-1, 1, (count, 3, 2))
    return np.concatenate([corners, np.zeros((count, 3, 1))], 2)


def orthogonal(seed: int) -> np.ndarray:
    return np.asarray(np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))[0])


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("order", [(0, 1, 2), (2, 1, 0), (1, 0, 2)])
@pytest.mark.parametrize("axes", [(0, 1, 2), (2, 0, 1), (1, 2, 0)])
def test_faces_that_overlap_in_a_plane(name: str, order: tuple[int, ...], axes: tuple[int, ...]) -> None:
    """The lowest id is hit, and the same in any batch."""
    turned, n = np.eye(3)[list(axes)], 3000
    triangles = (squares(order) @ turned).astype(f4)
    origin, direction = rays_to(turned, np.zeros(3), 8, n)
    accelerator = make_accelerator(geometry(triangles), name)
    hits = accelerator.closest(origin, direction, nothing(n))
    np.testing.assert_array_equal(hits.prim, first_hits(triangles, origin, direction))
    np.testing.assert_allclose(hits.t, 1, rtol=1e-5)
    parts = [slice(0, 1), slice(1, 1000), slice(1000, n)]
    again = [accelerator.closest(origin[:, part], direction[:, part], nothing(n)[part]) for part in parts]
    np.testing.assert_array_equal(np.concatenate([each.prim for each in again]), hits.prim)
    np.testing.assert_array_equal(np.concatenate([each.t for each in again]), hits.t)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("count", [3, 20, 300])
@pytest.mark.parametrize("shift", [(0.0, 0.0, 0.0), (0.3, -2.0, 40.0)])
def test_faces_that_overlap_in_any_plane(name: str, count: int, shift: tuple[float, ...]) -> None:
    """Their corners are rounded, so no two have the same plane; still the lowest id is hit by every ray."""
    for seed in range(2):
        turned, n = orthogonal(seed), 2000
        triangles = (scattered(count, seed) @ turned + shift).astype(f4)
        origin, direction = rays_to(turned, np.array(shift), seed, n)
        hits = make_accelerator(geometry(triangles), name).closest(origin, direction, nothing(n))
        np.testing.assert_array_equal(hits.prim, first_hits(triangles, origin, direction))


@pytest.mark.parametrize("name", NAMES)
def test_two_floors_of_many_faces_in_one_plane(name: str) -> None:
    """Both are in front of a third one in a parallel plane; the first in the list is hit."""
    turned = orthogonal(5)
    floors = [grid_of(count) for count in (37, 29)]
    behind = moved(grid_of(5), 0, 0, -1e-4)
    triangles = (np.concatenate([behind, *floors]) @ turned).astype(f4)
    origin, direction = rays_to(turned, np.zeros(3), 3, 4000)
    hits = make_accelerator(geometry(triangles), name).closest(origin, direction, nothing(4000))
    above, steep = turned[2] @ origin > 0, np.abs(turned[2] @ origin) > 0.1
    first = np.where(above, len(behind), 0)
    last = np.where(above, len(behind) + len(floors[0]), len(behind))
    assert ((hits.prim >= first) & (hits.prim < last) | ~steep).all()


def grid_of(count: int) -> np.ndarray:
    """Return the triangles of a square of `count` by `count` cells in the plane z = 0."""
    x, y = np.meshgrid(*[np.linspace(-1, 1, count + 1)] * 2, indexing="ij")
    points = np.stack([x, y, np.zeros_like(x)], -1)
    a, b, c, d = points[:-1, :-1], points[1:, :-1], points[1:, 1:], points[:-1, 1:]
    return np.concatenate([np.stack(corners, 2).reshape(-1, 3, 3) for corners in ((a, b, c), (a, c, d))])


def moved(triangles: np.ndarray, *by: float) -> np.ndarray:
    return triangles + np.array(by)


def test_which_faces_overlap() -> None:
    """Those that share an edge or a corner do not, nor do those of other planes, nor those side by side."""
    turned = orthogonal(2)

    def overlapping(triangles: np.ndarray) -> list[int]:
        corners = (triangles @ turned).astype(f4)
        plane = triangle.triangle_table(corners, False).plane
        found = coplanar.find_overlaps(corners, np.arange(len(corners)), plane)
        return [] if found is None else found.face.tolist()

    grid, some = grid_of(12), scattered(1, 3)
    angles = np.linspace(0, 2 * np.pi, 65)
    rim = np.stack([np.cos(angles), np.sin(angles), np.zeros(65)], -1)
    fan = np.stack([np.zeros((64, 3)), rim[:-1], rim[1:]], 1)
    for apart in (grid, fan, sphere_mesh(4), np.concatenate([grid, moved(grid, 0, 0, 1e-4)])):
        assert overlapping(apart) == []
    assert overlapping(np.concatenate([grid, moved(grid, 2, 0, 0), moved(some, 20, 0, 0)])) == []
    assert overlapping(np.concatenate([grid, moved(grid, 0, 2, 0), some * 0.1])) == [
        *(np.flatnonzero(has_common_area(grid, some[0] * 0.1))),
        4 * 144,
    ]


def has_common_area(triangles: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Return a mask (m,) of the triangles in the plane z = 0 that no edge separates from another one."""
    separated = np.zeros(len(triangles), bool)
    for number, each in enumerate(triangles):
        for a, b in ((each, other), (other, each)):
            for start, end, third in (a, a[[1, 2, 0]], a[[2, 0, 1]]):
                normal = np.cross([0, 0, 1], end - start)
                side = (b - start) @ normal * np.sign((third - start) @ normal)
                separated[number] |= side.max() <= 1e-6
    return ~separated


@pytest.mark.parametrize("name", NAMES)
def test_very_many_pairs_of_faces_do_not_take_for_ever(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Beyond a budget all faces of a plane count as overlapping, and the first is hit still."""
    monkeypatch.setattr(coplanar, "BUDGET", 100)
    monkeypatch.setattr(coplanar, "DENSE", 0)
    turned = orthogonal(4)
    triangles = (scattered(60, 4) @ turned).astype(f4)
    origin, direction = rays_to(turned, np.zeros(3), 4, 2000)
    hits = make_accelerator(geometry(triangles), name).closest(origin, direction, nothing(2000))
    np.testing.assert_array_equal(hits.prim, first_hits(triangles, origin, direction))
