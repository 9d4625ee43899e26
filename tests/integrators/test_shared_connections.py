"""What first points receive from shared points, against the balance heuristic written out in float64.

The points lie at any distance of each other, in place of those of neighboring pixels, for which 1/distance²
hardly differs and cancels.
"""

from types import SimpleNamespace
from unittest.mock import MagicMock

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from inside import MEMBERS as MEMBERS_OF_TILES
from inside import (
    FirstPoints,
    Guidance,
    GuideCells,
    GuideTable,
    Paths,
    PictureTiles,
    SharedPoints,
    SurfaceInteraction,
    WaveTiles,
    _arriving,
    add_shared,
    as_shared,
    attenuate,
    compile_scene,
    connect,
    make_accelerator,
    reuse,
)

import wavefront as wf

f4 = np.float32
some = settings(max_examples=settings.default.max_examples * 3 // 10)
MEMBERS, TILES = 3, 2
number = st.integers(0, 2**32)
# Far away, so that nothing is between the points; and a screen that stands between some of them.
FAR = wf.Rectangle((50, 50, 50), (1, 0, 0), (0, 1, 0))
SCREEN = wf.Rectangle((0, -20, 0.5), (20, 0, 0), (0, 40, 0))


def compiled(*shapes):
    scene = wf.Scene([*shapes], [wf.PointLight((0, 0, 9), 1)])
    return compile_scene(scene, lambda geometry: make_accelerator(geometry, "numpy"))


OPEN, SCREENED = compiled(FAR), compiled(FAR, SCREEN)


def directions(rng: np.random.Generator, *shape: int) -> np.ndarray:
    v = rng.normal(size=(3, *shape))
    return (v / np.linalg.norm(v, axis=0)).astype(f4)


def guidance(rng: np.random.Generator, n: int) -> Guidance:
    """A table of 8 × 8 bins, and a share of each point."""
    bins = rng.random((1, 64))
    cells = GuideCells(np.zeros(3, f4), f4(1), 0)
    table = GuideTable.of_bins(cells, np.zeros(6, np.intp), bins / bins.sum(), np.array([0.5]))
    return Guidance(table, np.zeros(n, np.intp), rng.uniform(0, 0.8, n).astype(f4))


def first_points(
    rng: np.random.Generator, guided: bool, center: np.ndarray, bent: bool = False
) -> FirstPoints:
    """Points near z = 0 that face up more or less; one of the tiles lacks a member.

    If they are bent, their geometric normals are not their shading normals.
    """
    shape = (MEMBERS, TILES)
    present = np.ones(shape, bool)
    present[2, 1] = False
    start = rng.uniform(-2, 2, (3, *shape)) * np.array([1, 1, 0.1]).reshape(3, 1, 1) - center.reshape(3, 1, 1)
    normal = directions(rng, MEMBERS * TILES)
    normal[2] = np.abs(normal[2])
    return FirstPoints(
        present,
        start.astype(f4),
        np.zeros(shape, f4),
        np.full(MEMBERS * TILES, -1),
        normal,
        None,
        rng.uniform(0.2, 1, (3, *shape)).astype(f4),
        directions(rng, MEMBERS * TILES) if bent else None,
        guidance(rng, MEMBERS * TILES) if guided else None,
    )


def shared_points(rng: np.random.Generator, branches: int, center: np.ndarray) -> SharedPoints:
    """A point for each path and branch, 0.7 to 5 above, that faces down more or less."""
    k = MEMBERS * TILES * branches
    point = rng.uniform((-2, -2, 0.7), (2, 2, 5), (k, 3)).T - center.reshape(3, 1)
    ng = directions(rng, k)
    ng[2] = -np.abs(ng[2])
    zero = np.zeros(k, np.intp)
    return SharedPoints(zero, zero, point.astype(f4), np.zeros(k, f4), ng, ng, np.ones((3, k), f4))


def one_connection(first: FirstPoints, target: SharedPoints, point: int, member: int, tile: int):
    """cos/π, the density 1/sr, and cos_y/distance² from a first point to a shared one, in float64."""
    start = first.start[:, member, tile].astype(float)
    column = member * TILES + tile
    away = target.point[:, point].astype(float) - start
    distance2 = float(away @ away)
    wi = away / np.sqrt(distance2)
    cos = max(float(first.normal[:, column].astype(float) @ wi), 0.0)
    if first.ng is not None and first.ng[:, column].astype(float) @ wi <= 0:
        cos = 0.0
    pdf = cos / np.pi
    if first.guidance is not None and cos > 0:
        share = float(first.guidance.share[column])
        of_table = first.guidance.table.pdf(np.array([0]), wi.reshape(3, 1).astype(f4))
        pdf = (1 - share) * pdf + share * float(of_table[0])
    geometry = max(float(-target.ng[:, point].astype(float) @ wi), 0.0) / distance2
    if not first.present[member, tile] or cos == 0:
        geometry = 0.0
    return cos / np.pi, pdf, geometry, start, away


def blocked(start: np.ndarray, away: np.ndarray, center: np.ndarray) -> bool:
    """Whether the screen is between."""
    at = start + center + away * (0.5 - (start + center)[2]) / away[2]
    return bool(at[0] > 0)


@some
@given(seed=number, guided=st.booleans(), bent=st.booleans())
def test_connections(seed: int, guided: bool, bent: bool) -> None:
    """BSDF times cosine, density, geometry; a ray of the length of the distance."""
    rng = np.random.default_rng(seed)
    center = OPEN.center
    first, points = first_points(rng, guided, center, bent), shared_points(rng, 1, center)
    target, there = points.take(np.array([0, 1])), np.array([True, seed % 2 == 0])
    found = connect(OPEN, first, target, there, 1)
    # where a guide is, directions below the surface have a density but no value
    for tile in range(TILES):
        for member in range(MEMBERS):
            f, pdf, geometry, start, away = one_connection(first, target, tile, member, tile)
            geometry *= there[tile]
            assert found.geometry[member, tile] == pytest.approx(geometry, rel=2e-4, abs=1e-9)
            if geometry > 0:
                assert found.f[0, member, tile] == pytest.approx(f, rel=2e-4, abs=1e-7)
                assert found.pdf[member, tile] == pytest.approx(pdf, rel=2e-3, abs=1e-7)
    # the path that found a point is not traced again
    cells = [divmod(int(lane), TILES) for lane in found.lanes]
    assert all(member != 1 for member, _ in cells)
    due = {(member, tile) for member in (0, 2) for tile in range(TILES) if found.geometry[member, tile] > 0}
    assert set(cells) == due
    for lane, (member, tile) in enumerate(cells):
        _, _, _, start, away = one_connection(first, target, tile, member, tile)
        assert found.rays.distance[lane] == pytest.approx(np.linalg.norm(away), rel=1e-5)
        np.testing.assert_allclose(found.rays.direction[:, lane], away / np.linalg.norm(away), atol=1e-5)
        np.testing.assert_allclose(found.rays.origin[:, lane], start, atol=1e-6)


@some
@given(seed=number, guided=st.booleans(), branches=st.integers(1, 2), screen=st.booleans())
def test_light_from_shared_points(seed: int, guided: bool, branches: int, screen: bool) -> None:
    """Σ_j f_i(y_j) cos_i G_ij V_ij R_j / (branches · Σ_k p_kj), with p_kj = pdf · G · V."""
    rng = np.random.default_rng(seed)
    scene = SCREENED if screen else OPEN
    center = scene.center
    first, points = first_points(rng, guided, center), shared_points(rng, branches, center)
    light = rng.uniform(0.1, 3, (3, len(points))).astype(f4)
    numbers = np.arange(len(points)).reshape(branches, MEMBERS, TILES)
    numbers[0, 2, 1] = -1  # the path that is not there
    if branches == 2:
        numbers[1, 2, 1] = -1
    (arriving,), lost = _arriving(scene, first, points, [light], [each.copy() for each in numbers])
    due, left = np.zeros((3, MEMBERS, TILES)), set()
    for branch in range(branches):
        for tile in range(TILES):
            for finder in range(MEMBERS):
                point = int(numbers[branch, finder, tile])
                if point < 0:
                    continue
                rows = []
                for member in range(MEMBERS):
                    f, pdf, geometry, start, away = one_connection(first, points, point, member, tile)
                    hidden = screen and member != finder and blocked(start, away, center)
                    rows.append((f, pdf, 0.0 if hidden else geometry))
                total = sum(pdf * geometry for _, pdf, geometry in rows)
                if total == 0:
                    left.add(point)
                    continue
                for member, (f, _, geometry) in enumerate(rows):
                    due[:, member, tile] += f * geometry / (branches * total) * light[:, point]
    due *= first.albedo
    np.testing.assert_allclose(arriving, due, rtol=5e-3, atol=1e-5)
    assert {int(each) for group in lost for each in group} == left


def test_nothing_comes_from_behind_or_from_the_point_itself() -> None:
    """A shared point that faces away, and one that rounding puts on the first point."""
    rng = np.random.default_rng(0)
    first, points = first_points(rng, False, OPEN.center), shared_points(rng, 1, OPEN.center)
    points.ng *= f4(-1)
    attenuate(OPEN, [found := connect(OPEN, first, points.take(np.array([0, 1])), np.ones(2, bool), 0)])
    assert not found.geometry.any()
    points.point[:, 0] = first.start[:, 0, 0]
    found = connect(OPEN, first, points.take(np.array([0, 0])), np.ones(2, bool), 0)
    assert found.geometry[0, 0] == 0
    assert np.isfinite(found.geometry).all()


def test_paths_begin_anew_at_shared_points() -> None:
    """With a throughput of 1; roulette goes by the one that they had."""
    n = 4
    had = np.random.default_rng(0).uniform(0.1, 1, (3, n)).astype(f4)
    scale = np.arange(1, n + 1, dtype=f4)
    paths = Paths(
        slot=np.array([7, 3, 5, 1]),
        pixel=np.arange(n, dtype=np.uint32),
        sample=np.arange(n, dtype=np.uint32),
        origin=np.zeros((3, n), f4),
        direction=np.ones((3, n), f4),
        exclude_prim=np.zeros(n, np.intp),
        throughput=had,
        pdf=np.ones(n, f4),
        specular=np.zeros(n, bool),
        roulette_scale=scale,
    )
    anew = as_shared(paths)
    assert (anew.throughput == 1).all()
    assert anew.slot.tolist() == [0, 1, 2, 3]
    np.testing.assert_allclose(anew.roulette_scale, scale * had.max(0))


def test_what_nobody_reaches_stays_with_its_path(monkeypatch: pytest.MonkeyPatch) -> None:
    """The others receive light times the throughput of their first points."""
    rng = np.random.default_rng(1)
    lit = SimpleNamespace(
        groups=[(slice(0, 2), wf.Diffuse(0.5))],
        surface=MagicMock(unmapped=None, folds=None, __len__=lambda _: 2),
    )
    lit.albedo = lambda: np.ones((3, 2), f4)
    paths = SimpleNamespace(
        media=None, slot=np.array([1, 0]), throughput=rng.uniform(0.2, 1, (3, 2)).astype(f4)
    )
    points = shared_points(rng, 1, OPEN.center).take(np.array([0, 1]))
    points.slot[:] = 0, 1
    points.throughput = rng.uniform(0.2, 1, (3, 2)).astype(f4)
    light = rng.uniform(0.2, 1, (3, 2)).astype(f4)
    light[:, 0] = 1  # is no other than any light
    tiles = WaveTiles.of(np.array([0, 0], np.uint32), np.array([0, 1], np.uint32), PictureTiles(100, 1))
    arrived = rng.uniform(0.2, 1, (3, MEMBERS_OF_TILES, tiles.count)).astype(f4)

    def first_of(lit, albedo, lane_in, media):
        return SimpleNamespace(present=lane_in >= 0)

    def arriving(scene, first, points, lights, numbers, glossy):
        asked.extend(sorted(int(each) for each in np.unique(numbers) if each >= 0))
        return [arrived[:, :, : first.present.shape[1]]], [np.array([1])]

    monkeypatch.setattr(reuse.FirstPoints, "of", first_of)
    monkeypatch.setattr(reuse, "_arriving", arriving)
    asked: list[int] = []
    L = np.ones((3, 2), f4)
    shade = SimpleNamespace(lit=lambda: lit)
    add_shared(OPEN, [(L, light)], paths, shade, points, tiles, 1)
    due = np.ones((3, 2))
    due[:, 1] += points.throughput[:, 1] * light[:, 1]
    grid = tiles.grid(paths.slot)
    for member, tile in zip(*np.nonzero(grid >= 0), strict=True):
        lane = grid[member, tile]
        due[:, paths.slot[lane]] += paths.throughput[:, lane] * arrived[:, member, tile]
    np.testing.assert_allclose(L, due, rtol=1e-6)
    assert asked == [0, 1]
    light[:, 0] = 0
    asked.clear()
    add_shared(OPEN, [(L, light)], paths, shade, points, tiles, 1)
    assert asked == [1]


def test_the_first_of_all_points_is_shared() -> None:
    """Its number is 0, also where nobody has found another one."""
    rng = np.random.default_rng(2)
    first, points = first_points(rng, False, OPEN.center), shared_points(rng, 1, OPEN.center)
    points.ng = np.repeat(f4([[0], [0], [-1]]), len(points), 1)
    first.normal[:] = f4([[0], [0], [1]])
    numbers = np.full((MEMBERS, TILES), -1)
    numbers[1, 0] = 0
    (arriving,), lost = _arriving(OPEN, first, points, [np.ones((3, len(points)), f4)], [numbers])
    assert (arriving[:, :, 0] > 0).all()
    assert not arriving[:, :, 1].any()
    assert not any(each.size for each in lost)


@pytest.mark.parametrize(("albedo", "there"), [(0.0, False), (1.0, True), (0.5, True)])
def test_black_first_points_take_no_part(albedo: float, there: bool) -> None:
    n = 4
    up, zero = np.repeat(f4([[0], [0], [1]]), n, 1), np.zeros(n, f4)
    lane = np.zeros(n, np.intp)
    surface = SurfaceInteraction(np.zeros((3, n), f4), zero, up, up, up, lane, lane, np.zeros(n, bool))
    lit = SimpleNamespace(surface=surface, start=np.zeros((3, n), f4), guidance_at=lambda lanes: None)
    lane_in = np.array([[0, 1], [2, -1]])
    first = FirstPoints.of(lit, np.full((3, n), albedo, f4), lane_in)
    assert first is not None
    assert np.array_equal(first.present, (lane_in >= 0) & there)


def test_materials_that_look_alike_from_all_sides_are_shared() -> None:
    """Not glossy ones, and none with a normal map, be it the first of the scene."""
    bumps = wf.NormalMap(np.full((2, 2, 3), (0.5, 0.5, 1.0), f4))
    uvs = [[0, 0], [1, 0], [0, 1]]
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], float)
    kinds = [wf.Material(wf.Diffuse(0.5), normal_map=bumps), wf.Diffuse(0.5), wf.Principled(0.5)]
    meshes = [wf.Mesh(corners + k, [[0, 1, 2]], uvs=uvs, material=kind) for k, kind in enumerate(kinds)]
    assert reuse.shared_materials(compiled(*meshes)).tolist() == [False, True, False]
