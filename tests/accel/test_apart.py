"""Triangles that move beside many that stand still: two trees, and the hits of one."""

from typing import Any

import numpy as np
import pytest
from inside import (
    ApartAccelerator,
    Geometry,
    SpherePrimitives,
    build_apart,
    installed,
    make_accelerator,
    still_triangles,
)
from rays import nothing, random_rays, same_bits

f4 = np.float32
NAMES = ["numpy", pytest.param("embree", marks=pytest.mark.skipif(not installed(), reason="no embreex"))]


@pytest.fixture(autouse=True)
def few_are_many(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("wavefront.accel.apart.LEAST", 8)


def soup(count: int, seed: int = 0) -> Any:
    """Small triangles at random places around the origin."""
    rng = np.random.default_rng(seed)
    return (rng.normal(size=(count, 1, 3)) + rng.normal(0, 0.4, (count, 3, 3))).astype(f4)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("balls", [0, 1])
def test_hits_are_those_of_one_accelerator(name: str, balls: int) -> None:
    moves = np.random.default_rng(1).random(300) < 0.1
    kinds = (SpherePrimitives(np.zeros((3, 1), f4), np.full(1, 0.3, f4)),) * balls
    geometry = Geometry(soup(300), kinds)
    whole = make_accelerator(geometry, name)
    parts = build_apart(lambda part: make_accelerator(part, name), moves, geometry)
    assert isinstance(parts, ApartAccelerator)
    assert parts.name == name
    origin, direction = random_rays(4000, 3)
    for left in (nothing(4000), whole.closest(origin, direction, nothing(4000)).prim):
        due, found = (each.closest(origin, direction, left) for each in (whole, parts))
        if name == "embree" and left.max() >= 0:  # it begins again beyond a hit that is left out
            np.testing.assert_array_equal(found.prim, due.prim)
            np.testing.assert_allclose(found.t, due.t, rtol=1e-5)
        else:
            assert same_bits(found, due)
        near = np.where(np.isfinite(due.t), due.t, 1) * f4(0.99)
        for distance in (near, near * f4(1.02)):
            rays = origin, direction, distance, left
            np.testing.assert_array_equal(parts.occluded(*rays), whole.occluded(*rays))
    assert len(np.unique(moves[due.prim[(due.prim >= 0) & (due.prim < 300)]])) == 2


def square(x: float, z: float, size: float = 1.0) -> Any:
    """The two triangles of a level square."""
    a, b = np.array([x, 0, z]), np.array([x + size, 0, z])
    up = np.array([0, size, 0])
    return np.array([[a, b, b + up], [a, b + up, a + up]], f4)


def test_what_overlaps_in_a_plane_goes_along() -> None:
    row = [square(3 * k, 0) for k in range(6)]
    bridge = square(0.5, 0, 3)  # from the first to the second of the row
    moving = [square(-0.5, 0), square(6, 2)]  # on the first one; in another plane
    triangles = np.concatenate([*row, bridge, *moving])
    moves = np.arange(len(triangles)) >= 14
    others = np.zeros(40, bool)
    still = still_triangles(np.concatenate([triangles, soup(40) + f4(50)]), np.append(moves, others))
    assert still is not None
    assert set(np.flatnonzero(~still).tolist()) == {0, 1, 2, 3, 12, 13, 14, 15, 16, 17}


def test_equal_triangles_and_too_many_that_move_stay_together() -> None:
    triangles = soup(40)
    moves = np.arange(40) >= 36
    assert still_triangles(triangles, moves) is not None
    assert still_triangles(triangles, np.arange(40) >= 30) is None  # a quarter
    assert still_triangles(triangles, np.zeros(40, bool)) is None
    assert still_triangles(triangles[:10], np.arange(10) >= 9) is not None
    assert still_triangles(triangles[:9], np.arange(9) >= 7) is None  # fewer than LEAST stand still
    triangles[39] = triangles[3, ::-1]
    assert still_triangles(triangles, moves) is None
    triangles[39], triangles[4] = triangles[38], triangles[3]  # within a part
    assert still_triangles(triangles, moves) is not None


def test_pairs_that_are_torn_apart_are_no_quadrilaterals() -> None:
    parts: list[Geometry] = []
    geometry = Geometry(soup(40), interchangeable=np.arange(40) % 2 == 0)
    moves = np.zeros(40, bool)
    moves[[5, 20, 21]] = True

    def make(part: Geometry) -> Any:
        parts.append(part)
        return make_accelerator(part, "numpy")

    build_apart(make, moves, geometry)
    still, moving = (part.interchangeable for part in parts)
    assert still is not None
    assert moving is not None
    assert np.flatnonzero(~moves)[still].tolist() == [k for k in range(0, 40, 2) if k not in (4, 20)]
    assert moving.tolist() == [False, True, False]
