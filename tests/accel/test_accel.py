"""Ray queries: watertight, exact, the same bits for any batch; NumPy and Embree."""

from __future__ import annotations

import gc
import tracemalloc
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from inside import (
    Accelerator,
    Geometry,
    NumpyAccelerator,
    SceneError,
    build_tree,
    installed,
    make_accelerator,
    stable_order,
)
from rays import (
    PLACES,
    aimed_rays,
    brute_force,
    check_batches,
    geometry,
    nothing,
    random_rays,
    same_bits,
    sphere_mesh,
)

f4 = np.float32
NAMES = ["numpy", pytest.param("embree", marks=pytest.mark.skipif(not installed(), reason="no embreex"))]


# --- watertightness -------------------------------------------------------------------------------


@pytest.mark.parametrize(("scale", "offset"), PLACES)
@pytest.mark.parametrize("subdivisions", [0, pytest.param(2, marks=pytest.mark.slow), 4])
def test_no_ray_escapes_a_closed_mesh(subdivisions: int, scale: float, offset: float) -> None:
    """Case 20 of the reference values, with a fortieth of its rays."""
    triangles = (sphere_mesh(subdivisions) * scale + offset).astype(f4)
    rays = aimed_rays(triangles.astype(float), 10_000, 1)
    hits = make_accelerator(geometry(triangles), "numpy").closest(*rays, nothing(10_000))
    assert (hits.prim < 0).sum() == 0


@pytest.mark.slow
@pytest.mark.parametrize(("scale", "offset"), PLACES)
def test_no_ray_of_a_million_escapes(scale: float, offset: float) -> None:
    triangles = (sphere_mesh(5) * scale + offset).astype(f4)
    rays = aimed_rays(triangles.astype(float), 1_000_000, 2)
    hits = make_accelerator(geometry(triangles), "numpy").closest(*rays, nothing(1_000_000))
    assert (hits.prim < 0).sum() == 0


def facing_targets(triangles: np.ndarray, origin: np.ndarray) -> np.ndarray:
    """Vertices and points of edges, (k, 3), all of whose triangles are seen from the same side.

    A ray from `origin` at one of them cannot pass, whether the mesh is closed or not.
    """
    corner, face = np.unique(triangles.reshape(-1, 3), axis=0, return_inverse=True)
    face = face.reshape(-1, 3)
    normal = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    toward = (normal * (triangles.mean(1) - origin)).sum(1)
    toward /= np.linalg.norm(normal, axis=1) * np.linalg.norm(triangles.mean(1) - origin, axis=1) + 1e-300
    edge = np.sort(np.concatenate([face[:, [0, 1]], face[:, [1, 2]], face[:, [2, 0]]]), 1)
    pair, of_pair, count = np.unique(edge, axis=0, return_inverse=True, return_counts=True)
    of_pair, side = of_pair.reshape(-1), np.tile(toward, 3)
    low, high = np.full(len(pair), np.inf), np.full(len(pair), -np.inf)
    np.minimum.at(low, of_pair, side)
    np.maximum.at(high, of_pair, side)
    inner = (count == 2) & ((low > 0.05) | (high < -0.05))
    closed = np.ones(len(corner), bool)
    closed[pair[~inner].ravel()] = False
    at = np.random.default_rng(1).random((int(inner.sum()), 1))
    along = corner[pair[inner, 0]] * (1 - at) + corner[pair[inner, 1]] * at
    return np.concatenate([corner[closed], along])


def test_no_ray_passes_between_the_triangles_of_a_mesh() -> None:
    """Aimed at vertices and edges from eight places; 0 misses, and none far behind its target."""
    triangles = sphere_mesh(4).astype(f4)
    center, size = triangles.mean((0, 1), dtype=float), float(np.ptp(triangles, axis=(0, 1)).max())
    accelerator = make_accelerator(geometry(triangles), "numpy")
    aimed = 0
    for corner in np.stack(np.meshgrid(*[(-1.0, 1.0)] * 3), -1).reshape(-1, 3):
        origin = (center + corner * size).astype(f4)
        target = facing_targets(triangles.astype(float), origin.astype(float))
        rays = np.tile(origin[:, None], len(target)), np.ascontiguousarray((target - origin).T, f4)
        hits = accelerator.closest(*rays, nothing(len(target)))
        assert (hits.prim < 0).sum() == 0
        assert (hits.t <= 1 + 1e-4).all()
        aimed += len(target)
    assert aimed > 1000


def test_rays_at_the_vertices_of_a_box_from_exact_points() -> None:
    box = np.asarray(trimesh.creation.box(extents=(2, 2, 2)).triangles)
    grid = np.stack(np.meshgrid(*[np.linspace(-0.75, 0.75, 7)] * 3), -1).reshape(-1, 3)
    target = np.stack(np.meshgrid(*[(-1.0, 0.0, 1.0)] * 3), -1).reshape(-1, 3)
    target = target[np.abs(target).max(1) == 1]
    origin = np.repeat(grid, len(target), 0).T.astype(f4)
    direction = np.tile(target, (len(grid), 1)).T.astype(f4) - origin
    hits = make_accelerator(geometry(box), "numpy").closest(origin, direction, nothing(origin.shape[1]))
    np.testing.assert_array_equal(hits.t, 1)


def check_against_brute_force(
    triangles: np.ndarray, origin: np.ndarray, direction: np.ndarray, size: float = 1.0
) -> None:
    """Hit for hit, but for rays that graze an edge or begin on a surface within rounding."""
    hits = make_accelerator(geometry(triangles), "numpy").closest(origin, direction, nothing(origin.shape[1]))
    t, weight = brute_force(triangles, origin, direction)
    back_facing = (weight >= 0) & (t > 0)
    nearest = np.where(back_facing, t, np.inf).min(0)
    doubtful = (np.abs(weight) < 1e-5) | ((weight >= 0) & (np.abs(t) < 1e-6 * size))
    clear = ~doubtful.any(0)
    np.testing.assert_array_equal(np.isfinite(hits.t[clear]), np.isfinite(nearest[clear]))
    hit = clear & np.isfinite(nearest)
    np.testing.assert_allclose(hits.t[hit], nearest[hit], rtol=1e-6, atol=1e-7 * size)
    column = np.flatnonzero(hit)
    np.testing.assert_allclose(t[hits.prim[column], column], nearest[column], rtol=1e-6, atol=1e-7 * size)
    corners = triangles[hits.prim[column]].astype(float)
    b1, b2 = hits.b1[column, None].astype(float), hits.b2[column, None].astype(float)
    point = corners[:, 0] * (1 - b1 - b2) + corners[:, 1] * b1 + corners[:, 2] * b2
    wanted = (origin + nearest * direction.astype(float))[:, column].T
    np.testing.assert_allclose(point, wanted, atol=2e-5 * size)


@settings(max_examples=30, deadline=None, derandomize=True)
@given(
    st.integers(1, 400), st.integers(0, 10**6), st.sampled_from([0.02, 0.3, 2.0]), st.sampled_from([0.0, 3.0])
)
def test_random_soup_agrees_with_brute_force(count: int, seed: int, size: float, far: float) -> None:
    rng = np.random.default_rng(seed)
    triangles = rng.uniform(-1, 1, (count, 1, 3)) + rng.normal(size=(count, 3, 3)) * size
    origin, direction = random_rays(200, seed + 1, 1.5 + 20 * far)
    check_against_brute_force(triangles.astype(f4), origin, direction, 1 + 20 * far)


# --- the same bits --------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def mixed() -> Accelerator:
    rng = np.random.default_rng(5)
    centers, radii = rng.uniform(-1, 1, (300, 3)), rng.uniform(0.01, 0.05, 300)
    return make_accelerator(geometry(sphere_mesh(4), centers, radii), "numpy")


@pytest.fixture(scope="module")
def small() -> Accelerator:
    boxes = [trimesh.creation.box(extents=(s, s, s)).triangles for s in (2, 0.5, 0.3)]
    return make_accelerator(geometry(np.concatenate(boxes), [(0.6, 0, 0)], [0.2]), "numpy")


@pytest.fixture(params=["mixed", "small"])
def accelerator(request: pytest.FixtureRequest) -> Iterator[Accelerator]:
    return request.getfixturevalue(request.param)


@pytest.mark.parametrize("size", [1, pytest.param(64, marks=pytest.mark.slow), 4096])
def test_batches_have_the_same_bits(accelerator: Accelerator, size: int) -> None:
    check_batches(accelerator, size)


def test_order_does_not_matter(accelerator: Accelerator) -> None:
    n = 8_000
    origin, direction = random_rays(n, 8)
    order = np.random.default_rng(9).permutation(n)
    straight = accelerator.closest(origin, direction, nothing(n))
    shuffled = accelerator.closest(origin[:, order], direction[:, order], nothing(n))
    for name in ("t", "prim", "b1", "b2"):
        np.testing.assert_array_equal(getattr(shuffled, name), getattr(straight, name)[order])


def test_threads_do_not_disturb_each_other(accelerator: Accelerator) -> None:
    rays = [(*random_rays(2000, seed), nothing(2000)) for seed in range(6)]
    alone = [accelerator.closest(*r) for r in rays]
    with ThreadPoolExecutor(4) as pool:
        together = list(pool.map(lambda r: accelerator.closest(*r), rays))
    assert all(same_bits(a, b) for a, b in zip(alone, together, strict=True))


def test_queries_leave_nothing_to_the_garbage_collector(accelerator: Accelerator) -> None:
    # what waits for it is rays by the megabyte
    origin, direction = random_rays(2000, 13)
    origin[:, ::5] = 0  # some doubtful
    while gc.collect():  # what other tests have left may need more than one round
        pass
    gc.disable()
    try:
        accelerator.closest(origin, direction, nothing(2000))
        accelerator.occluded(origin, direction, np.full(2000, 0.7, f4), nothing(2000))
        assert gc.collect() == 0
    finally:
        gc.enable()


@pytest.mark.parametrize("name", NAMES)
def test_occluded_means_closer_than_the_distance(name: str) -> None:
    accelerator = make_accelerator(geometry(sphere_mesh(3), [(0, 0, 0)], [0.3]), name)
    origin, direction = random_rays(5000, 10)
    exclude_prim = np.random.default_rng(1).integers(-1, 1281, 5000)
    hits = accelerator.closest(origin, direction, exclude_prim)
    hit = np.isfinite(hits.t)
    for factor, expected in ((0.999, False), (1.001, True)):
        distance = np.where(hit, hits.t * f4(factor), f4(10)).astype(f4)
        blocked = accelerator.occluded(origin, direction, distance, exclude_prim)
        np.testing.assert_array_equal(blocked, hit & expected)


def test_occluded_leaves_out_the_distance_itself() -> None:
    accelerator = make_accelerator(geometry([[(0, 0, 1), (1, 0, 1), (0, 1, 1)]]), "numpy")
    origin, direction = np.full((3, 2), (0.2,), f4), np.zeros((3, 2), f4)
    origin[2], direction[2] = 0, 1
    distance = np.array([1, np.nextafter(f4(1), f4(2))], f4)
    assert accelerator.occluded(origin, direction, distance, nothing(2)).tolist() == [False, True]


# --- special rays and triangles -------------------------------------------------------------------


@pytest.mark.parametrize("name", NAMES)
def test_ties_go_to_the_lowest_id(name: str) -> None:
    one = [(0, 0, 1), (1, 0, 1), (0, 1, 1)]
    triangles = [[(0, 0, 3), (1, 0, 3), (0, 1, 3)], one, [one[1], one[2], one[0]], one[::-1]]
    accelerator = make_accelerator(geometry(triangles), name)
    origin, direction = np.array([[0.2], [0.2], [0]], f4), np.array([[0], [0], [1]], f4)
    hits = accelerator.closest(origin, direction, nothing(1))
    assert hits.prim[0] == 1
    assert hits.t[0] == 1


def test_a_tie_across_the_leaves_of_a_tree_goes_to_the_lowest_id() -> None:
    mesh = sphere_mesh(3)
    doubled = np.concatenate([mesh, mesh[::-1]])
    origin, direction = random_rays(4000, 11)
    alone = make_accelerator(geometry(mesh), "numpy").closest(origin, direction, nothing(4000))
    both = make_accelerator(geometry(doubled), "numpy").closest(origin, direction, nothing(4000))
    np.testing.assert_array_equal(both.prim, alone.prim)
    np.testing.assert_array_equal(both.t, alone.t)


@pytest.mark.parametrize("name", NAMES)
def test_degenerate_triangles_are_never_hit(name: str) -> None:
    point, line = [(0, 0, 1)] * 3, [(-1, -1, 1), (0, 0, 1), (1, 1, 1)]
    behind = [(-1, -1, 2), (1, -1, 2), (0, 1, 2)]
    accelerator = make_accelerator(geometry([point, line, behind]), name)
    rays = np.array([[0], [0], [0]], f4), np.array([[0], [0], [1]], f4)
    assert accelerator.closest(*rays, nothing(1)).prim.tolist() == [2]
    only = make_accelerator(geometry([point, line]), name)
    assert only.closest(*rays, nothing(1)).prim.tolist() == [-1]


@pytest.mark.parametrize("subdivisions", [1, 4])
def test_rays_along_axes_with_either_zero(subdivisions: int) -> None:
    accelerator = make_accelerator(geometry(sphere_mesh(subdivisions)), "numpy")
    rng = np.random.default_rng(12)
    n = 1000
    for tiny in (0.0, -0.0, 1e-40, -1e-40, 1e-30):
        for axis in range(3):
            origin = rng.uniform(-0.4, 0.4, (3, n)).astype(f4)
            origin[:, ::4] = 0
            direction = np.full((3, n), tiny, f4)
            direction[axis] = np.where(np.arange(n) % 2, 1, -1)
            hits = accelerator.closest(origin, direction, nothing(n))
            assert (hits.prim >= 0).all()
            assert (hits.t < 1.41).all()


def test_rays_on_the_faces_of_boxes() -> None:
    """Many cubes in a grid: rays start on and run in the planes of box faces of the tree."""
    cube = np.asarray(trimesh.creation.box(extents=(1, 1, 1)).triangles)
    grid = np.stack(np.meshgrid(*[np.arange(4) * 2.0] * 3), -1).reshape(-1, 1, 1, 3)
    accelerator = make_accelerator(geometry((cube + grid).reshape(-1, 3, 3)), "numpy")
    y, z = (v.ravel() for v in np.meshgrid(np.arange(4) * 2.0, np.arange(4) * 2.0))
    for back_facing in (0.0, 0.25):
        origin = np.stack([np.full(16, 0.5), y + back_facing, z + back_facing]).astype(f4)
        direction = np.tile(np.array([[1], [0], [-0.0]], f4), 16)
        hits = accelerator.closest(origin, direction, nothing(16))
        np.testing.assert_array_equal(hits.t, 1)


@pytest.mark.parametrize("name", NAMES)
def test_nothing_and_nobody(name: str) -> None:
    empty = make_accelerator(geometry(), name)
    rays = random_rays(5, 0)
    assert (empty.closest(*rays, nothing(5)).prim == -1).all()
    assert np.isinf(empty.closest(*rays, nothing(5)).t).all()
    assert not empty.occluded(*rays, np.full(5, np.inf, f4), nothing(5)).any()
    full = make_accelerator(geometry(sphere_mesh(1), [(0, 0, 0)], [1]), name)
    none = np.zeros((3, 0), f4)
    assert full.closest(none, none, nothing(0)).t.shape == (0,)
    assert full.occluded(none, none, np.zeros(0, f4), nothing(0)).shape == (0,)


def test_rays_that_are_none_hit_nothing() -> None:
    for subdivisions in (1, 3):
        accelerator = make_accelerator(geometry(sphere_mesh(subdivisions), [(0, 0, 0)], [0.5]), "numpy")
        origin, direction = np.zeros((3, 4), f4), np.zeros((3, 4), f4)
        direction[0, 1], origin[1, 2], direction[2, 3] = np.nan, np.nan, 1
        assert (accelerator.closest(origin, direction, nothing(4)).prim >= 0).tolist() == [False] * 3 + [True]


def test_t_scales_with_the_direction() -> None:
    accelerator = make_accelerator(geometry(sphere_mesh(3)), "numpy")
    origin, direction = random_rays(2000, 13)
    factor = np.random.default_rng(1).choice(np.array([0.25, 1, 8], f4), 2000)
    one, other = (accelerator.closest(origin, d, nothing(2000)) for d in (direction, direction * factor))
    np.testing.assert_array_equal(one.prim, other.prim)
    np.testing.assert_array_equal(one.t, other.t * factor)


@pytest.mark.parametrize("name", NAMES)
def test_the_triangle_a_ray_leaves_is_not_hit(name: str) -> None:
    mesh = sphere_mesh(3).astype(f4)
    accelerator = make_accelerator(geometry(mesh), name)
    rng = np.random.default_rng(14)
    left = rng.integers(0, len(mesh), 3000)
    weights = rng.dirichlet((1, 1, 1), 3000)
    origin = np.ascontiguousarray((mesh[left] * weights[:, :, None]).sum(1).T, f4)
    direction = -origin + rng.uniform(-0.5, 0.5, (3, 3000)).astype(f4)
    hits = accelerator.closest(origin, direction, left)
    assert (hits.prim != left).all()
    assert (hits.prim >= 0).all()
    assert (hits.t > 0.1).mean() > 0.999
    near = np.full(3000, 0.05, f4)
    assert accelerator.occluded(origin, direction, near, left).mean() < 0.001


# --- spheres --------------------------------------------------------------------------------------


@pytest.mark.parametrize("count", [5, 3000])
def test_spheres_agree_with_the_quadratic(count: int) -> None:
    rng = np.random.default_rng(15)
    centers = rng.uniform(-1, 1, (count, 3)).astype(f4)
    radii = (rng.uniform(0.2, 1, count) / count ** (1 / 3)).astype(f4)
    origin, direction = random_rays(300, 16)
    hits = make_accelerator(geometry((), centers, radii), "numpy").closest(origin, direction, nothing(300))
    f = origin[None].astype(float) - centers[:, :, None]
    d = direction.astype(float)[None]
    a, b = (d * d).sum(1), (f * d).sum(1)
    root2 = b * b - a * ((f * f).sum(1) - radii[:, None].astype(float) ** 2)
    with np.errstate(invalid="ignore"):
        roots = np.stack([(-b - np.sqrt(root2)) / a, (-b + np.sqrt(root2)) / a])
    nearest = np.where(roots > 0, roots, np.inf).min((0, 1))
    clear = ~(np.abs(root2) < 1e-9).any(0)
    np.testing.assert_allclose(hits.t[clear], nearest[clear], rtol=1e-6)


@pytest.mark.parametrize("name", NAMES)
def test_from_inside_outside_and_on_a_sphere(name: str) -> None:
    accelerator = make_accelerator(geometry([[(9, 9, 9), (9, 8, 9), (8, 9, 9)]], [(0, 0, 0)], [1]), name)
    origin = np.array([[0, -3, 1, 1, 1], [0] * 5, [0] * 5], f4)
    direction = np.array([[1, 1, 1, -1, -1], [0] * 5, [0] * 5], f4)
    exclude_prim = np.array([-1, -1, 1, 1, -1])
    hits = accelerator.closest(origin, direction, exclude_prim)
    np.testing.assert_array_equal(hits.t, [1, 2, np.inf, 2, 2])
    np.testing.assert_array_equal(hits.prim, [1, 1, -1, 1, 1])
    assert not hits.b1.any()
    far = np.full(5, 2.5, f4)
    assert accelerator.occluded(origin, direction, far, exclude_prim).tolist() == [
        True,
        True,
        False,
        True,
        True,
    ]


# --- build, and the choice of accelerator ---------------------------------------------------------


@pytest.mark.parametrize("count", [1, 65, 1000, 20_000, pytest.param(200_000, marks=pytest.mark.slow)])
def test_the_tree_holds_each_primitive_once_inside_its_boxes(count: int) -> None:
    rng = np.random.default_rng(17)
    low = rng.uniform(-1, 1, (3, count)).astype(f4)
    high = low + rng.uniform(0, 0.1, (3, count)).astype(f4)
    tree = build_tree(low, high, 16, 8)
    np.testing.assert_array_equal(np.sort(tree.prim[tree.prim >= 0]), np.arange(count))
    node, slot = np.nonzero(tree.child < 0)
    leaf = -1 - tree.child[node, slot]
    np.testing.assert_array_equal(np.sort(leaf), np.arange(len(tree.prim)))
    for members, n, s in zip(tree.prim[leaf], node, slot, strict=True):
        members = members[members >= 0]
        assert (low[:, members].min(1) >= tree.low[n, s]).all()
        assert (high[:, members].max(1) <= tree.high[n, s]).all()


def test_building_takes_little_memory() -> None:
    """Per triangle, beyond what is kept; float64 copies of all corners would take more."""
    count = 300
    x, y = np.meshgrid(*[np.linspace(0, 1, count + 1)] * 2, indexing="ij")
    points = np.stack([x, y, np.sin(9 * x)], -1).astype(f4)
    a, b, c, d = points[:-1, :-1], points[1:, :-1], points[1:, 1:], points[:-1, 1:]
    triangles = np.concatenate([np.stack(t, 2).reshape(-1, 3, 3) for t in ((a, b, c), (a, c, d))])
    tracemalloc.start()
    accelerator = NumpyAccelerator(Geometry(triangles, weights=False))
    kept, most = (size / len(triangles) for size in tracemalloc.get_traced_memory())
    tracemalloc.stop()
    assert accelerator.name == "numpy"
    assert kept < 150
    assert most < 350


@pytest.mark.parametrize("count", [10, 70_000, 200_000])
def test_stable_order_is_a_stable_sort(count: int) -> None:
    values = np.random.default_rng(count).integers(0, count, 300_000)
    np.testing.assert_array_equal(stable_order(values), np.argsort(values, kind="stable"))


def test_many_equal_boxes_can_be_built() -> None:
    same = np.zeros((3, 5000), f4)
    tree = build_tree(same, same + 1, 32, 8)
    assert (tree.prim >= 0).sum() == 5000


@pytest.mark.skipif(not installed(), reason="no embreex")
def test_embree_agrees() -> None:
    mesh = sphere_mesh(4)
    origin, direction = random_rays(20_000, 18)
    ours, theirs = (
        make_accelerator(geometry(mesh, [(0.2, 0, 0)], [0.5]), a).closest(origin, direction, nothing(20_000))
        for a in ("numpy", "embree")
    )
    np.testing.assert_array_equal(np.isfinite(ours.t), np.isfinite(theirs.t))
    hit = np.isfinite(ours.t)
    np.testing.assert_allclose(ours.t[hit], theirs.t[hit], rtol=2e-6, atol=1e-7)
    assert (ours.prim != theirs.prim).sum() <= 2  # on an edge
    same = ours.prim == theirs.prim
    np.testing.assert_allclose(ours.b1[same], theirs.b1[same], atol=1e-4)


@pytest.mark.skipif(not installed(), reason="no embreex")
def test_hit_for_hit_against_embree() -> None:
    """The two differ only where a ray meets an edge within float32's rounding, or two triangles at once."""
    rng = np.random.default_rng(4)
    triangles = (sphere_mesh(5) * rng.uniform(0.8, 1, 3)).astype(f4)
    triangles = np.concatenate([triangles, triangles[:, ::-1] * f4(0.5)])
    n = 100_000
    center, size = triangles.mean((0, 1), dtype=float), float(np.ptp(triangles, axis=(0, 1)).max())
    origin, direction = random_rays(n, 20)
    origin = (origin * size + center[:, None]).astype(f4)
    ours, theirs = (
        make_accelerator(geometry(triangles), a).closest(origin, direction, nothing(n))
        for a in ("numpy", "embree")
    )
    with np.errstate(invalid="ignore"):
        far = ~(np.abs(ours.t - theirs.t) <= 2e-6 * ours.t + 1e-6 * size)
    differ = np.flatnonzero((far | (ours.prim != theirs.prim)) & ((ours.prim >= 0) | (theirs.prim >= 0)))
    explained = 0
    for ray in differ:
        hits = [prim for prim in (ours.prim[ray], theirs.prim[ray]) if prim >= 0]
        t, weight = brute_force(triangles[hits], origin[:, ray, None], direction[:, ray, None])
        corner = triangles[hits].astype(float)
        normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
        cosine = np.abs(normal @ direction[:, ray]) / np.linalg.norm(normal, axis=1)
        length = np.linalg.norm(corner - np.roll(corner, 1, 1), axis=2).min(1)
        graze = (np.abs(weight[:, 0]) < 2e-6 * size / (length * cosine)).any()
        tie = len(hits) == 2 and abs(t[0, 0] - t[1, 0]) < 1e-6 * size / cosine.min()
        explained += bool(graze or tie)
    assert explained == differ.size
    assert differ.size < 1e-3 * n


@pytest.mark.skipif(not installed(), reason="no embreex")
def test_embree_never_meets_a_triangle_that_is_surely_behind() -> None:
    """Rays that leave slivers and large triangles, from a few roundings beside them, also along them."""
    rng = np.random.default_rng(21)
    n, sure, met, cases = 4000, 0, 0, 0
    for far in np.repeat([0.0, 1.0, 100.0], 60):
        corners = (rng.normal(size=(3, 3)) + far * rng.normal(size=3)).astype(f4)
        corners[2] = corners[1] + (corners[2] - corners[1]) * f4(10.0 ** rng.uniform(-3, 0))
        accelerator = make_accelerator(geometry([corners]), "embree")
        edge, other = (corners[1:] - corners[0]).astype(float)
        normal = np.cross(edge, other)
        normal /= np.linalg.norm(normal)
        weights = rng.dirichlet((1, 1, 1), n)
        height = 10.0 ** rng.uniform(-9, -2, n) * (1 + far) * rng.choice([-1, 1], n)
        origin = (weights @ corners + normal * height[:, None]).T.astype(f4)
        direction = rng.normal(size=(n, 3))
        direction -= normal * (direction @ normal * (1 - 10.0 ** rng.uniform(-7, 0, n)))[:, None]
        direction = (direction / np.linalg.norm(direction, axis=1)[:, None]).T.astype(f4)
        behind = accelerator._planes.certainly_missed(origin, direction, np.zeros(n, int))
        hit = np.isfinite(accelerator.closest(origin, direction, nothing(n)).t)
        assert not (behind & hit).any()
        sure, met, cases = sure + behind.sum(), met + hit.sum(), cases + n
    assert sure > 0.1 * cases
    assert met > 0.1 * cases


def test_names() -> None:
    """Embree would do nothing for a geometry without triangles."""
    assert make_accelerator(Geometry(np.zeros((0, 3, 3), np.float32)), "auto").name == "numpy"
    assert make_accelerator(geometry(), "numpy").name == "numpy"
    assert make_accelerator(geometry(np.eye(3)[None]), "auto").name == ("embree" if installed() else "numpy")
    with pytest.raises(SceneError, match=r"'gpu'.*auto, numpy, embree"):
        make_accelerator(geometry(), "gpu")


def test_embree_that_is_not_installed(missing) -> None:
    missing("embreex")
    assert make_accelerator(geometry(), "auto").name == "numpy"
    with pytest.raises(SceneError, match=r"pip install embreex"):
        make_accelerator(geometry(), "embree")


def test_rays_that_leave_a_sphere_anywhere_on_it_meet_only_its_far_side() -> None:
    rng = np.random.default_rng(19)
    normal = rng.normal(size=(3, 5000))
    normal /= np.linalg.norm(normal, axis=0)
    origin, direction = (0.7 * normal).astype(f4), rng.normal(size=(3, 5000)).astype(f4)
    direction /= np.linalg.norm(direction, axis=0)
    accelerator = make_accelerator(geometry((), [(0, 0, 0)], [0.7]), "numpy")
    hits = accelerator.closest(origin, direction, np.zeros(5000, np.intp))
    chord = -2 * (origin.astype(float) * direction).sum(0)
    np.testing.assert_array_equal(np.isfinite(hits.t), chord > 0)
    np.testing.assert_allclose(hits.t[chord > 0], chord[chord > 0], rtol=1e-5)
