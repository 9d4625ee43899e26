"""Quadrilaterals: pairs of triangles that one test serves must be hit like the triangles they are."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from inside import (
    Accelerator,
    Geometry,
    are_parallelograms,
    compile_scene,
    corners,
    find_quads,
    make_accelerator,
)
from rays import PLACES, aimed_rays, brute_force, check_batches, geometry, nothing, random_rays

import wavefront as wf

f4 = np.float32
SQUARE = np.array([(0.0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)])


def fan(*corners: np.ndarray) -> np.ndarray:
    """Two triangles for each quadrilateral (4, 3)."""
    return np.array([[q[[0, 1, 2]], q[[0, 2, 3]]] for q in corners]).reshape(-1, 3, 3)


def turn(seed: int) -> np.ndarray:
    q, r = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    return q * np.sign(np.diag(r))


def box(half: tuple[float, float, float] = (1, 1, 1), seed: int = 0) -> np.ndarray:
    """A turned box of six quadrilaterals (12, 3, 3)."""
    corner = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * half @ turn(seed).T
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return fan(*(corner[list(q)] for q in quads))


def trapezoids(count: int, seed: int) -> np.ndarray:
    """Convex plane quadrilaterals anywhere, of all kinds of shapes."""
    rng = np.random.default_rng(seed)
    angle = np.sort(rng.uniform(0, 2 * np.pi, (count, 4)), 1)
    flat = np.stack([np.cos(angle) * rng.uniform(0.1, 2), np.sin(angle), 0 * angle], -1)
    placed = [q @ turn(seed + i).T + rng.uniform(-1, 1, 3) for i, q in enumerate(flat)]
    return fan(*placed)


@pytest.mark.parametrize("seed", range(5))
def test_the_faces_of_a_box_are_found(seed: int) -> None:
    """Though its turned corners are not quite in one plane in float32."""
    np.testing.assert_array_equal(find_quads(box((1, 0.3, 2), seed).astype(f4)), range(0, 12, 2))


@pytest.mark.parametrize(
    "bent",
    [
        [(0.0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 1e-6)],
        [(0.0, 0, 0), (1, 0, 0), (1, 1, 0), (0.6, 0.4, 0)],
        [(0.0, 0, 0), (1, 0, 0), (1, 1, 0), (0.5, 0.5, 0)],
        [(0.0, 0, 0), (1, 0, 0), (2, 0, 0), (0, 1, 0)],
        [(0.0, 0, 0), (1, 0, 0), (1, 1, 0), (2, 0.5, 0)],
    ],
    ids=["bent", "dented", "three in a line", "no first half", "folded"],
)
def test_others_are_not(bent: list) -> None:
    assert find_quads(fan(np.array(bent)).astype(f4)).size == 0


def test_a_strip_is_paired_once() -> None:
    """A regular hexagon is a fan of four: two pairs, not three."""
    angle = np.arange(6) * np.pi / 3
    ring = np.stack([np.cos(angle), np.sin(angle), 0 * angle], 1)
    triangles = np.array([ring[[0, k, k + 1]] for k in range(1, 5)])
    np.testing.assert_array_equal(find_quads(triangles.astype(f4)), [0, 2])


def test_a_triangle_between_quadrilaterals_stays_alone() -> None:
    triangles = np.concatenate([fan(SQUARE), SQUARE[None, :3] + 5, fan(SQUARE + 9)])
    np.testing.assert_array_equal(find_quads(triangles.astype(f4)), [0, 3])


def test_parallelograms_are_told_from_others() -> None:
    quads = np.array([SQUARE, SQUARE + 0.1, SQUARE * (1, 1, 0) * 0.3 + 1, SQUARE, SQUARE], f4)
    quads[3, 2] += (0.2, 0.1, 0)
    quads[4, 1, 0] = 0.5
    found = corners(fan(*quads), np.arange(0, 10, 2))
    assert are_parallelograms(found, 2.0).tolist() == [True] * 3 + [False] * 2


@pytest.mark.parametrize(("scale", "offset"), PLACES)
@pytest.mark.parametrize("seed", [0, *(pytest.param(k, marks=pytest.mark.slow) for k in (1, 2))])
def test_no_ray_escapes_a_box(seed: int, scale: float, offset: float) -> None:
    """Aimed at corners, edges, diagonals and anywhere, from inside."""
    triangles = (box((1, 0.8, 1.2), seed) * scale + offset).astype(f4)
    origin, direction = aimed_rays(triangles.astype(float), 30_000, 1)
    target = origin + direction
    center = triangles.mean((0, 1), dtype=float)[:, None]
    origin = ((origin - center) * 0.5 + center).astype(f4)  # within the box
    hits = make_accelerator(geometry(triangles), "numpy").closest(origin, target - origin, nothing(30_000))
    assert (hits.prim < 0).sum() == 0


@settings(max_examples=30, deadline=None, derandomize=True)
@given(st.integers(1, 40), st.integers(0, 10**6), st.sampled_from([0.0, 3.0]))
def test_quadrilaterals_agree_with_brute_force(count: int, seed: int, far: float) -> None:
    """Which half is hit, where, and how far, but for the corners' own rounding."""
    triangles = trapezoids(count, seed).astype(f4)
    size = 1 + 20 * far
    origin, direction = random_rays(200, seed + 1, 1.5 + 20 * far)
    hits = make_accelerator(geometry(triangles), "numpy").closest(origin, direction, nothing(200))
    t, weight = brute_force(triangles, origin, direction)
    clear = ~((np.abs(weight) < 1e-5) | ((weight >= 0) & (np.abs(t) < 1e-6 * size))).any(0)
    nearest = np.where((weight >= 0) & (t > 0), t, np.inf)
    prim = np.where(np.isfinite(nearest.min(0)), nearest.argmin(0), -1)
    np.testing.assert_array_equal(hits.prim[clear], prim[clear])
    hit = np.flatnonzero(clear & (prim >= 0))
    corner = triangles[prim[hit]].astype(float)
    normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    cosine = np.abs((normal.T * direction[:, hit]).sum(0)) / np.linalg.norm(normal, axis=1)
    allowed = 2.0**-23 * (np.abs(triangles).max() / cosine + nearest.min(0)[hit])
    assert (np.abs(hits.t[hit] - nearest.min(0)[hit]) <= allowed).all()
    b1, b2 = hits.b1[hit, None].astype(float), hits.b2[hit, None].astype(float)
    point = corner[:, 0] * (1 - b1 - b2) + corner[:, 1] * b1 + corner[:, 2] * b2
    wanted = (origin + nearest.min(0) * direction.astype(float))[:, hit].T
    assert (np.abs(point - wanted).max(1) <= 2e-5 * size + 4 * allowed).all()


def room() -> Accelerator:
    triangles = np.concatenate([box((1, 1, 1)), box((0.3, 0.4, 0.2), 3), box((0.2, 0.2, 0.6), 4) + 0.4])
    return make_accelerator(geometry(triangles, [(0.6, 0, 0)], [0.2]), "numpy")


@pytest.mark.parametrize("size", [1, 64, 4096])
def test_batches_have_the_same_bits(size: int) -> None:
    check_batches(room(), size)


def test_halves_are_told_apart_unless_they_look_alike() -> None:
    """Of quadrilaterals that look the same all over, hits name the first half; nothing else changes."""
    triangles = trapezoids(12, 5)
    rays = *random_rays(2000, 6), nothing(2000)
    both = make_accelerator(geometry(triangles), "numpy").closest(*rays)
    interchangeable = np.zeros(24, bool)
    interchangeable[[0, 1, 2, 8, 9, 22]] = True  # four quadrilaterals, and what lies between two of them
    some = make_accelerator(replace(geometry(triangles), interchangeable=interchangeable), "numpy").closest(
        *rays
    )
    one = np.isin(both.prim, [1, 3, 9, 23])
    assert one.sum() > 20
    assert (both.prim % 2 == 1)[~one].sum() > 20
    np.testing.assert_array_equal(some.prim, both.prim - one)
    interchangeable[:] = True
    every = make_accelerator(replace(geometry(triangles), interchangeable=interchangeable), "numpy").closest(
        *rays
    )
    np.testing.assert_array_equal(every.prim, np.where(both.prim < 0, -1, both.prim // 2 * 2))
    np.testing.assert_array_equal(some.t, both.t)
    np.testing.assert_array_equal(every.t, both.t)


def alike_in(scene: wf.Scene) -> list[bool] | None:
    """What a compiled scene says to its accelerator of triangles that look alike."""
    seen: list[Geometry] = []

    def build(given: Geometry) -> Accelerator:
        seen.append(given)
        return make_accelerator(given, "numpy")

    compile_scene(scene, build)
    return None if seen[0].interchangeable is None else seen[0].interchangeable.tolist()


def test_triangles_look_alike_by_material_and_light_where_nothing_varies() -> None:
    """Halves of a light that are two lights are told apart, and all where normals or textures vary."""
    gray, dark = wf.Diffuse(0.5), wf.Diffuse(0.1)
    square = SQUARE, [(0, 1, 2), (0, 2, 3)]
    kite = SQUARE * (1, 1, 1) + [(0, 0, 1), (0, 0, 1), (1, 1, 1), (0, 0, 1)], square[1]
    floor, wall = wf.Mesh(*square, material=gray), wf.Mesh(*kite, material=dark)
    light = wf.Rectangle((0, 0, 2), (1, 0, 0), (0, 1, 0), emission=1)
    uneven = wf.Mesh(kite[0] + (0, 0, 3), square[1], emission=1)
    assert alike_in(wf.Scene([floor, wall, light, uneven])) == [True, False] * 3 + [False, False]
    beside = wf.Mesh(*kite, material=gray)  # a shape of its own, with its own number
    assert alike_in(wf.Scene([floor, beside, light]))[:4] == [True, False] * 2
    smooth = wf.Mesh(*square, normals=np.tile((0.0, 0, 1), (4, 1)), material=gray)
    assert alike_in(wf.Scene([smooth, wall, light])) is None


def test_neither_half_is_hit_by_a_ray_that_leaves_the_other() -> None:
    accelerator = make_accelerator(geometry(fan(SQUARE, SQUARE + np.array((0, 0, 1)))), "numpy")
    origin = np.array([[0.7, 0.3, -1], [0.3, 0.7, -1]], f4).T.copy()
    direction = np.array([[0, 0, 1.0]] * 2, f4).T.copy()
    for exclude_prim in (0, 1):
        hits = accelerator.closest(origin, direction, np.full(2, exclude_prim))
        np.testing.assert_array_equal(hits.prim, [2, 3])
    np.testing.assert_array_equal(accelerator.closest(origin, direction, nothing(2)).prim, [0, 1])
    np.testing.assert_array_equal(accelerator.closest(origin, direction, np.full(2, 2)).prim, [0, 1])


@pytest.mark.parametrize("reach", [1.0, 1e-3, 30.0, np.inf])
def test_shadow_rays_end_where_they_end(reach: float) -> None:
    """A ray is blocked if the closest hit is nearer than its end, also when the end is on a surface."""
    accelerator = room()
    n = 20_000
    origin, direction = random_rays(n, 11, 0.9)
    direction *= np.random.default_rng(3).uniform(0.1, 10, n).astype(f4)
    t = accelerator.closest(origin, direction, nothing(n)).t
    at_random = np.random.default_rng(12).uniform(0, 2, n) * reach
    for distance in (at_random.astype(f4), t, np.nextafter(t, f4(np.inf)), np.nextafter(t, f4(0))):
        blocked = accelerator.occluded(origin, direction, distance, nothing(n))
        np.testing.assert_array_equal(blocked, t < distance)
    assert (t < at_random).any()


def test_ties_of_halves_with_others_go_to_the_lowest_id() -> None:
    """A triangle between two quadrilaterals in the same place."""
    triangles = np.concatenate([fan(SQUARE), SQUARE[None, [0, 1, 2]], fan(SQUARE)])
    accelerator = make_accelerator(geometry(triangles), "numpy")
    rng = np.random.default_rng(1)
    origin = np.stack([*rng.random((2, 500)), np.full(500, 2.0)]).astype(f4)
    direction = np.tile(np.array([[0], [0], [-1]], f4), 500)
    prim = accelerator.closest(origin, direction, nothing(500)).prim
    np.testing.assert_array_equal(prim, np.where(origin[1] > origin[0], 1, 0))


@pytest.mark.parametrize("length", [1e-12, 1.0, 1e12, 1e25])
def test_rays_are_blocked_however_long_their_directions(length: float) -> None:
    """The last one's length is not a float32. Some end before the square, some beyond, and one behind."""
    accelerator = make_accelerator(geometry(fan(SQUARE)), "numpy")
    origin = np.tile(np.array([[0.3], [0.4], [0.5]], f4), 7)
    direction = np.tile(np.array([[0], [0], [-length]], f4), 7)
    direction[2, 0] = length
    distance = (np.array([-2, -2, 0, 0.25, 0.499, 0.501, np.inf]) / length).astype(f4)
    blocked = accelerator.occluded(origin, direction, distance, nothing(7))
    assert blocked.tolist() == [False] * 5 + [True] * 2


def test_a_bad_ray_does_not_disturb_others() -> None:
    accelerator = make_accelerator(geometry(fan(SQUARE)), "numpy")
    origin = np.tile(np.array([[0.3], [0.4], [0.5]], f4), 3)
    direction = np.tile(np.array([[0], [0], [-1]], f4), 3)
    distance = np.array([np.nan, 2, 0.25], f4)
    direction[0, 0] = np.nan
    assert accelerator.occluded(origin, direction, distance, nothing(3)).tolist() == [False, True, False]


@pytest.mark.parametrize("away", [3e2, 3e4, 3e6])
def test_rays_that_pass_far_away_in_the_plane_hit_nothing(away: float) -> None:
    """All edge functions are nothing but rounding there."""
    accelerator = make_accelerator(geometry(fan(SQUARE @ turn(5).T)), "numpy")
    n = 4000
    rng = np.random.default_rng(7)
    angle = rng.uniform(0, 2 * np.pi, (2, n))
    origin = turn(5) @ np.stack([np.cos(angle[0]), np.sin(angle[0]), np.zeros(n)]) * away
    direction = turn(5) @ np.stack([np.cos(angle[1]), np.sin(angle[1]), np.zeros(n)])
    hits = accelerator.closest(origin.astype(f4), direction.astype(f4), nothing(n))
    past = np.linalg.norm(np.cross(origin, direction, axis=0), axis=0) > 10
    assert past.sum() > 0.9 * n
    assert (hits.prim[past] == -1).all()
