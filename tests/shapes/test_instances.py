"""Meshes placed many times: the same hits and pictures as of meshes of their own, and the memory of one."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import trimesh
from counting import calls
from inside import (
    FACES,
    CompiledScene,
    InstanceAccelerator,
    Intersections,
    PlateAccelerator,
    Rays,
    can_place,
    compile_scene,
    dot,
    installed,
    instance_bounds,
    interaction,
    intersect,
    kinds_of,
    lighted,
    make_accelerator,
    perturb_normals,
    surely_occluded,
)
from inside import instances as queries
from inside import scene as scene_module
from rays import nothing, same_bits
from significance import render
from trimesh.transformations import euler_matrix, translation_matrix

import wavefront as wf

f4 = np.float32
NAMES = ["numpy", pytest.param("embree", marks=pytest.mark.skipif(not installed(), reason="no embreex"))]
SKY = [wf.Environment(1)]
RED, BLUE = wf.Diffuse((0.8, 0.2, 0.1)), wf.Conductor.named("gold", roughness=0.4)


pytestmark = pytest.mark.usefixtures("shared_instances")


def bumpy(smooth: bool = False, **more) -> wf.Mesh:
    """A closed mesh of 320 triangles without any symmetry, away from its own origin."""
    ball = trimesh.creation.icosphere(2)
    vertices = ball.vertices * (1 + 0.2 * np.sin(3 * ball.vertices[:, :1] + 1)) + [3, 1, -2]
    uvs = ball.vertices[:, :2] * 0.5 + 0.5
    return wf.Mesh(vertices, ball.faces, normals=ball.vertices if smooth else None, uvs=uvs, **more)


def knot(**more) -> wf.Mesh:
    ring = trimesh.creation.torus(1, 0.3, 16, 8)
    return wf.Mesh(ring.vertices, ring.faces, **more)


def at(x: float, y: float, z: float, scale=1.0, turn=(0.0, 0.0, 0.0)) -> np.ndarray:
    """A matrix that scales, turns and moves."""
    return translation_matrix((x, y, z)) @ euler_matrix(*turn) @ np.diag([*np.broadcast_to(scale, 3), 1])


MATRICES = [
    at(0, 0, 0),
    at(4, 0, 0, 0.5, (0.3, 1, 2)),
    at(-4, 1, 0, (0.4, 1.5, 0.8), (1, 0, 0.5)),
    at(0, 4, 1, (-1, 0.7, 1), (0.2, 0.4, 0)),  # mirrored
    at(0, -4, 1, (-0.3, -0.7, -1), (0, 2, 1)),
    at(1, 1, -4, 1, (2, 2, 0)) @ at(0, 0, 0, (1, 0.3, 1), (0, 1, 1)),  # turned, then squashed askew
    at(0.3, 0.2, 0.1),  # through the first
]


def placed(mesh: wf.Mesh, matrices=MATRICES, **more) -> list[wf.Instance]:
    return [wf.Instance(mesh, matrix, **more) for matrix in matrices]


def mixture(smooth: bool = False) -> list:
    """Two meshes, each placed often, among things that are placed once."""
    first, second = bumpy(smooth, material=wf.Diffuse(0.5)), knot(material=BLUE)
    others = [at(2, 2, 2) @ matrix for matrix in MATRICES[:4]]
    return [
        *placed(first),
        wf.Sphere((-2, -1, 2), 0.7, material=wf.Dielectric(1.5)),
        *placed(second, others[:2]),
        wf.Rectangle((-8, -5, 8), (16, 0, 0), (0, 0, -16), material=wf.Diffuse(0.7)),
        *placed(second, others[2:], material=RED),
        wf.Instance(first, at(-3, -3, -3, 0.7), material=RED),
    ]


def alone(shapes: list) -> list:
    """The same shapes, every instance as a mesh of its own."""
    return [shape.to_mesh() if isinstance(shape, wf.Instance) else shape for shape in shapes]


def compiled(shapes: list, accel: str = "numpy") -> CompiledScene:
    return compile_scene(wf.Scene(shapes, SKY), lambda geometry: make_accelerator(geometry, accel))


def rays(n: int, reach: float, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    origin = rng.uniform(-reach, reach, (3, n))
    direction = rng.uniform(-reach, reach, (3, n)) * 0.6 - origin
    direction[:, : n // 8] *= np.eye(3)[rng.integers(0, 3, n // 8)].T  # along an axis
    direction[0, direction.max(0) == direction.min(0)] = 1
    return origin.astype(f4), (direction / np.linalg.norm(direction, axis=0)).astype(f4)


def piece(hits: Intersections, part) -> Intersections:
    return Intersections(hits.t[part], hits.prim[part], hits.b1[part], hits.b2[part])


def apart(t: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Differences (n,) of distances; two misses are at one place."""
    return np.abs(np.minimum(t, f4(1e6)) - np.minimum(other, f4(1e6)))


def on_ground(shapes: list, plate: bool, monkeypatch) -> CompiledScene:
    """Shapes on the ground that a render adds, which is met by arithmetic, or in the tree of other meshes."""
    if not plate:
        monkeypatch.setattr(scene_module, "beside_plate", lambda make, geometry, _: make(geometry))
    lit = lighted(wf.Scene(shapes), "studio", ground=True)
    found = compile_scene(lit, lambda geometry: make_accelerator(geometry, "numpy"))
    monkeypatch.undo()
    return found


# --- Hits -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("accel", NAMES)
def test_hits_are_those_of_meshes_of_their_own(accel):
    """The same triangle at the same distance; another one only where two are as near, or at an edge."""
    n = 40_000
    origin, direction = rays(n, 7)
    shapes = [shape for shape in mixture() if not isinstance(shape, wf.Mesh | wf.Sphere)]  # so ids agree
    shared, own = compiled(shapes, accel), compiled(alone(shapes), accel)
    assert isinstance(shared.accelerator, InstanceAccelerator)
    assert shared.accelerator.name == accel
    a = shared.accelerator.closest(origin, direction, nothing(n))
    b = own.accelerator.closest(origin, direction, nothing(n))
    assert (b.prim >= 0).mean() > 0.15
    # ids number instances in the order of the shapes, as they do meshes
    same = a.prim == b.prim
    assert (~same).sum() <= 4
    assert apart(a.t, b.t)[same].max() < 3e-5
    distance = np.full(n, 6, f4)
    blocked = shared.accelerator.occluded(origin, direction, distance, nothing(n))
    assert (blocked != (a.t < distance)).sum() <= 2
    assert (blocked != own.accelerator.occluded(origin, direction, distance, nothing(n))).sum() <= 4


def test_a_plate_beside_instances_changes_no_hit(monkeypatch):
    """Mirrored ones among them: the same bits but on the plate, and the same rays are blocked."""
    n, shapes = 20_000, [*placed(bumpy()), knot()]
    with_plate, plain = (on_ground(shapes, plate, monkeypatch) for plate in (True, False))
    first = len(shapes[-1].faces)  # of the plate, after the knot and before instances
    split, whole = with_plate.accelerator, plain.accelerator
    assert isinstance(split, InstanceAccelerator)
    assert isinstance(split._single, PlateAccelerator)
    assert isinstance(whole, InstanceAccelerator)
    assert not isinstance(whole._single, PlateAccelerator)
    origin, direction = rays(n, 7 * f4(with_plate.scale))
    left = np.random.default_rng(1).integers(-len(plain.normals), len(plain.normals), n)
    left[(left < 0) | (left >= first) & (left < first + FACES)] = -1
    a, b = split.closest(origin, direction, left), whole.closest(origin, direction, left)
    instanced, plate = b.prim >= first + FACES, (b.prim >= first) & (b.prim < first + FACES)
    assert instanced.sum() > 1000
    assert plate.sum() > 1000
    assert same_bits(piece(a, ~plate), piece(b, ~plate))
    assert (a.prim == b.prim).mean() > 0.999  # but on edges between patches
    assert apart(a.t, b.t).max() < 1e-4
    distance = np.random.default_rng(2).uniform(0, 8, n).astype(f4)
    clear = np.abs(b.t - distance) > 1e-3
    blocked = split.occluded(origin, direction, distance, left)
    assert np.array_equal(blocked[clear], whole.occluded(origin, direction, distance, left)[clear])
    sure, others = surely_occluded(split, origin, direction, distance, left)
    assert not (sure & plate)[b.t < distance].any()
    assert np.array_equal(sure | others, blocked)


@pytest.mark.parametrize("accel", NAMES)
@pytest.mark.parametrize("smooth", [False, True])
def test_surfaces_are_those_of_meshes_of_their_own(accel, smooth):
    """Normals of the front, smooth ones too, uvs, sides and materials, on all kinds of things."""
    n = 4000
    origin, direction = rays(n, 7, seed=3)
    first = mixture(smooth)
    first[0].mesh.material = wf.Diffuse(wf.Texture(np.random.default_rng(0).random((4, 4, 3))))  # needs uvs
    query = Rays(origin, direction, nothing(n))
    found = []
    for shapes in (first, alone(first)):
        scene = compiled(shapes, accel)
        hits = intersect(scene, query)
        lanes = hits.found
        surface = interaction(scene, query.take(lanes), hits.take(lanes))
        ids = scene.accelerator.closest(origin, direction, nothing(n)).prim
        assert np.array_equal(surface.prim, ids[lanes])
        color = np.full((9, n), np.nan)
        color[:, lanes] = [*surface.ng, *surface.ns, *surface.uv, surface.back_facing]
        groups = np.full(n, -1)
        kinds = [type(group).__name__ for group in scene.materials.groups]
        groups[lanes] = [
            sorted(set(kinds)).index(kinds[g]) for g in scene.materials.group_of.take(surface.material)
        ]
        found.append((hits.t, color, groups))
    (t, values, groups), (other_t, others, other_groups) = found
    same = (apart(t, other_t) < 1e-4) & (t < np.inf)
    assert (apart(t, other_t) > 1e-4).sum() <= 2
    assert same.sum() > 500
    assert np.array_equal(groups[same], other_groups[same])
    off = np.abs(values - others)[:, same].max(0)
    assert (off < 3e-4).mean() > 0.998  # next to an edge, the neighbor's normal
    assert np.unique(values[8, same]).tolist() == [0, 1]


def test_a_mirrored_instance_keeps_its_front():
    """Rays from outside meet the front, whatever the transform."""
    mesh = bumpy()
    for matrix in MATRICES:
        scene = compiled([*placed(mesh, [matrix, at(50, 0, 0)])])
        middle = np.append(mesh.bounds.mean(0), 1) @ matrix.T
        target = middle[:3] - scene.center
        origin = np.random.default_rng(0).normal(size=(3, 200)) * 30 + target[:, None]
        direction = target[:, None] - origin
        direction /= np.linalg.norm(direction, axis=0)
        inwards = Rays(origin.astype(f4), direction.astype(f4), nothing(200))
        hits = intersect(scene, inwards)
        lanes = hits.found
        assert lanes.size > 180
        assert not interaction(scene, inwards.take(lanes), hits.take(lanes)).back_facing.any()


# --- Exactness ------------------------------------------------------------------------------------

FAR = [(1.0, 0.0), (1e-3, 10.0), (1e3, 1e5), (1.0, -3e3), (1e-3, -3e3), (1e3, 1e7)]


@pytest.mark.parametrize("accel", NAMES)
@pytest.mark.parametrize(("scale", "shift"), FAR)
def test_no_ray_slips_through(accel, scale, shift):
    """Rays from inside a closed instance, aimed at its vertices, its edges and anywhere."""
    n = 15_000
    mesh = bumpy()
    matrix = at(shift, -0.7 * shift, 0.3 * shift, scale, (0.4, 1.1, 2)) @ at(0, 0, 0, (1, 0.5, 2))
    scene = compiled(placed(mesh, [matrix, at(0, 0, 0)]), accel)
    triangles = (scene_vertices(mesh, matrix) - scene.center)[mesh.faces]
    rng = np.random.default_rng(1)
    face, corner = rng.integers(0, len(triangles), n), rng.integers(0, 3, n)
    along = np.select([np.arange(n) % 3 == 0, np.arange(n) % 3 == 1], [0.0, 0.5], rng.random(n))[:, None]
    target = triangles[face, corner] * (1 - along) + triangles[face, (corner + 1) % 3] * along
    middle = triangles.mean((0, 1))
    origin = (middle + rng.uniform(-0.1, 0.1, (n, 3)) * np.ptp(triangles, axis=(0, 1)).min()).T.astype(f4)
    direction = (target.T - origin).astype(f4)
    hits = scene.accelerator.closest(origin, direction, nothing(n))
    assert (hits.prim >= 0).all()
    assert scene.accelerator.occluded(origin, direction, np.full(n, np.inf, f4), nothing(n)).all()
    # where they should be: float32 around the scene's center is what limits it
    room = 1e-5 * (np.abs(triangles).max() + np.abs(direction).max()) / np.linalg.norm(direction, axis=0)
    assert (np.abs(hits.t - 1) < 30 * room + 1e-4).mean() > 0.99


def scene_vertices(mesh: wf.Mesh, matrix: np.ndarray) -> np.ndarray:
    return mesh.vertices @ matrix[:3, :3].T + matrix[:3, 3]


@pytest.mark.parametrize("accel", NAMES)
@pytest.mark.parametrize(("scale", "shift"), [(1e3, 0), (1, -2e4), (1e-3, 30)])
@pytest.mark.filterwarnings("ignore:the picture is black")
def test_light_does_not_leak_in(accel, scale, shift):
    """Inside a closed instance it stays dark, however often paths bounce off its wall."""
    mesh = bumpy(smooth=True, material=wf.Diffuse(1))
    matrix = at(shift, 0.4 * shift, shift, scale, (1, 2, 3))
    middle = (np.append(mesh.bounds.mean(0), 1) @ matrix.T)[:3]
    camera = wf.Camera.look_at(middle, middle + np.array([0.3, 0, 1]) * scale, fov=120, size=(16, 16))
    scene = wf.Scene(placed(mesh, [matrix, at(0, 5, 0)]), [wf.Environment(1e4)], camera)
    image = render(scene, 16, accel=accel, max_bounces=20)
    assert image.rgb.max() == 0


VERTEX = at(0, 0, 0, 100) @ translation_matrix(-bumpy().vertices[0])  # puts a vertex at the origin
SQUASH = at(0, 0, 0, (0.005, 1, 1), (1, 2, 3)) @ at(0, 0, 0, 1, (1, 2, 3))


@pytest.mark.parametrize("accel", NAMES)
@pytest.mark.parametrize(
    ("matrix", "start", "aim"),
    [(VERTEX, 0.1, 0.05), (np.eye(4), 3000, 0.8), (SQUASH, 300, 0.3)],
    ids=["near the middle of a large one", "from afar", "squashed askew"],
)
def test_points_are_no_further_off_than_their_error(accel, matrix, start, aim):
    """Distances to the planes of the triangles in float64; and the bound is no wild guess either."""
    mesh, n, rng = bumpy(), 20_000, np.random.default_rng(0)
    if matrix is SQUASH:  # a box on end, so that rays meet its narrow sides too
        box = trimesh.creation.box(transform=np.linalg.inv(at(0, 0, 0, 1, (1, 2, 3))))
        mesh = wf.Mesh(box.vertices, box.faces)
    if matrix is not VERTEX:
        matrix = matrix @ translation_matrix(-mesh.bounds.mean(0))
    mirrored = np.diag([*[-0.99 if start == 300 else -1] * 3, 1])  # a box in the same place is no instance
    matrices = [matrix, mirrored @ matrix]  # so the scene's middle is the origin
    scene = compiled(placed(mesh, matrices), accel)
    assert scene.center == pytest.approx([0, 0, 0], abs=1e-9)
    origin = rng.normal(size=(3, n))
    origin *= start / np.linalg.norm(origin, axis=0)
    direction = rng.normal(size=(3, n)) * aim - origin
    query = Rays(origin.astype(f4), (direction / np.linalg.norm(direction, axis=0)).astype(f4), nothing(n))
    hits = intersect(scene, query)
    query, hits = query.take(hits.found), hits.take(hits.found)
    assert len(hits) > 500
    surface = interaction(scene, query, hits)
    corners = np.stack([scene_vertices(mesh, m)[mesh.faces] for m in matrices])[hits.instance - 2, hits.prim]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    off = np.abs((normal * (surface.point.T - corners[:, 0])).sum(1))
    assert 0.02 < (off / surface.error).max() < 1


@pytest.mark.parametrize("accel", NAMES)
def test_only_the_triangle_of_the_instance_left_is_skipped(accel):
    """The same triangle of another instance, in the same place or behind, is hit."""
    bent = wf.Mesh([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0.5]], [[0, 1, 2], [0, 2, 3]])
    scene = compiled(placed(bent, [at(0, 0, 0), at(0, 0, 1), at(0, 0, 2)]), accel)
    origin = np.array([[0.5], [-0.5], [-1e-3 - scene.center[2]]], f4).repeat(4, 1)
    direction = np.array([[0], [0], [1]], f4).repeat(4, 1)
    hits = scene.accelerator.closest(origin, direction, np.array([-1, 0, 1, 2]))
    assert hits.prim.tolist() == [0, 2, 0, 0]
    assert hits.t == pytest.approx([1e-3, 1 + 1e-3, 1e-3, 1e-3], rel=1e-3)
    near = np.full(4, 0.5, f4)
    blocked = scene.accelerator.occluded(origin, direction, near, np.array([-1, 0, 1, 2]))
    assert blocked.tolist() == [True, False, True, True]


@pytest.mark.parametrize("accel", NAMES)
@pytest.mark.parametrize("compared", [True, False])
def test_ties_go_to_the_lowest_id(accel, compared, monkeypatch):
    """Instances in the same place are meshes of their own, before all others, or compare as instances."""
    mesh = bumpy()
    if not compared:
        monkeypatch.setattr("wavefront.compile.overlaps.MOST_FACES", 0)
    scene = compiled([*placed(mesh, [at(0, 0, 0), at(9, 0, 0)] + [at(0, 0, 0)] * 12)], accel)
    origin, direction = rays(4000, 4)
    hits = scene.accelerator.closest(origin, direction, nothing(4000))
    first = hits.prim // len(mesh.faces)
    assert np.unique(first[hits.prim >= 0]).tolist() == [0, 13 if compared else 1]


def overlapping_squares(order):
    """Return three instances of a square that overlap in an oblique plane, and a mesh that overlaps them."""
    square = wf.Mesh([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], [[0, 1, 2], [0, 2, 3]])
    turned = at(0.3, -0.2, 0.1, 1, (0.4, 1.1, 0.2))
    shapes = [
        *placed(
            square, [turned @ at(0.1 * k, -0.2 * k, 0, (1 - 0.2 * k, 1, 1 + k), (0, 0, k)) for k in range(3)]
        ),
        wf.Instance(square, turned @ at(0.5, 0.5, 0, 0.7)).to_mesh(),
    ]
    return [shapes[number] for number in order], turned


@pytest.mark.parametrize("accel", NAMES)
@pytest.mark.parametrize("order", [(0, 1, 2, 3), (3, 2, 1, 0), (1, 3, 0, 2)])
def test_the_first_of_instances_and_meshes_that_overlap_in_a_plane_is_hit(accel, order):
    """The first in the scene, in every accelerator; an instance elsewhere still shares its mesh."""
    shapes, turned = overlapping_squares(order)
    away = at(0, 0, -9), at(0, 1, -11)
    shapes += placed(shapes[order.index(0)].mesh, away)
    camera = wf.Camera.look_at((turned @ [0.4, 0.1, 3, 1])[:3], turned[:3, 3], size=(60, 60))

    def seen(some):
        scene = wf.Scene(some, [wf.Environment(1)], camera)
        return render(scene, 1, accel=accel, aovs="shape_id", max_bounces=0).shape_id

    covered = np.array([seen([shape]) == 0 for shape in shapes[:4]])
    found = seen(shapes)
    there = covered.any(0)
    assert covered.sum(0).max() == 4
    np.testing.assert_array_equal(found[there], covered.argmax(0)[there])
    assert len(compiled(shapes, accel).accelerator.placements.mesh) == 2


@pytest.mark.parametrize("accel", NAMES)
def test_ties_go_to_the_lowest_id_whichever_is_traced_first(accel):
    """A triangle that two meshes have: the box of the later one begins nearer."""
    first = wf.Mesh([[0, 0, 0], [4, 0, 0], [0, 4, 0], [0, 0, -1]], [[0, 1, 2]])
    second = wf.Mesh(
        [[0, 0, 0], [4, 0, 0], [0, 4, 0], [8, 8, 2], [6, 8, 2], [8, 6, 2]], [[0, 1, 2], [3, 4, 5]]
    )
    both = [at(0, 0, 0), at(16, 0, 0)]
    for shapes, expected in (
        ([*placed(first, both), *placed(second, both)], 0),
        ([*placed(second, both), *placed(first, both)], 0),
    ):
        scene = compiled(shapes, accel)
        origin = (np.array([[1.0], [1.0], [9.0]]) - scene.center[:, None]).astype(f4)
        hits = scene.accelerator.closest(origin, np.array([[0], [0], [-1]], f4), nothing(1))
        assert (hits.t[0], hits.prim[0]) == (9, expected)


@pytest.mark.parametrize("accel", NAMES)
def test_the_same_bits_for_any_batch(accel, monkeypatch):
    n = 3000
    scene = compiled(mixture(), accel)
    trace = scene.accelerator
    origin, direction = rays(n, 7)
    exclude_prim = np.random.default_rng(0).integers(-1, 3000, n)
    distance = np.full(n, 5, f4)
    whole, blocked = (
        trace.closest(origin, direction, exclude_prim),
        trace.occluded(origin, direction, distance, exclude_prim),
    )
    for part in (slice(0, 1), slice(7, 8), slice(100, 164), slice(1000, 2999), slice(None, None, -1)):
        ray = np.ascontiguousarray(origin[:, part]), np.ascontiguousarray(direction[:, part])
        assert same_bits(trace.closest(*ray, exclude_prim[part]), piece(whole, part))
        assert np.array_equal(trace.occluded(*ray, distance[part], exclude_prim[part]), blocked[part])
    monkeypatch.setattr(queries, "PAIRS", 200)  # cuts the batch into small ones
    assert same_bits(trace.closest(origin, direction, exclude_prim), whole)
    monkeypatch.setattr(queries, "CHUNK", 64)
    assert np.array_equal(trace.occluded(origin, direction, distance, exclude_prim), blocked)


@pytest.mark.parametrize("accel", NAMES)
def test_the_same_picture_for_any_cut(accel):
    scene = wf.Scene(mixture(), SKY, wf.Camera.look_at((0, 3, 14), (0, 0, 0), size=(10, 8)))
    whole = render(scene, 5, accel=accel, workers=1).rgb.tobytes()
    for cut in ({"wave_size": 7}, {"wave_size": 64, "workers": 2}, {"wave_size": 4096, "workers": 3}):
        assert render(scene, 5, accel=accel, **cut).rgb.tobytes() == whole


def test_rays_that_are_none_meet_nothing():
    scene = compiled(placed(bumpy()))
    bad = np.full((3, 4), np.nan, f4)
    assert (scene.accelerator.closest(bad, bad, nothing(4)).prim == -1).all()
    assert not scene.accelerator.occluded(bad, bad, np.ones(4, f4), nothing(4)).any()
    empty = np.zeros((3, 0), f4)
    assert scene.accelerator.closest(empty, empty, nothing(0)).t.size == 0
    assert scene.accelerator.occluded(empty, empty, np.zeros(0, f4), nothing(0)).size == 0


def test_a_tree_over_many_instances_loses_none():
    """2000 small instances: all hits of the nearest found by testing each box of each."""
    rng = np.random.default_rng(5)
    ball = trimesh.creation.icosphere(0)
    mesh = wf.Mesh(ball.vertices, ball.faces)
    matrices = [
        at(*rng.uniform(-10, 10, 3), rng.uniform(0.05, 0.5, 3), rng.uniform(-3, 3, 3)) for _ in range(2000)
    ]
    shapes = placed(mesh, matrices)
    n = 2000
    origin, direction = rays(n, 10)
    shared, own = compiled(shapes), compiled(alone(shapes))
    a, b = (scene.accelerator.closest(origin, direction, nothing(n)) for scene in (shared, own))
    assert (b.prim >= 0).mean() > 0.3
    assert (apart(a.t, b.t) > 1e-4).sum() <= 1


# --- Pictures -------------------------------------------------------------------------------------


@pytest.mark.parametrize("accel", NAMES)
def test_pictures_are_those_of_meshes_of_their_own(accel):
    shapes = [*mixture(smooth=True), wf.Rectangle((-2, 9, -2), (4, 0, 0), (0, 0, 4), emission=12)]
    camera = wf.Camera.look_at((0, 4, 15), (0, 0, 0), fov=45, size=(48, 36))
    shared, own = (
        render(wf.Scene(some, [wf.Environment(0.3)], camera), 8, accel=accel).rgb
        for some in (shapes, alone(shapes))
    )
    # a path that takes another turn by rounding changes its pixel
    assert (np.abs(shared - own).max(2) > 1e-3 * (own.max(2) + 0.1)).mean() < 0.02
    assert shared.mean() == pytest.approx(own.mean(), rel=2e-3)


def test_absorption_is_that_of_the_instances_material():
    clear, red = wf.Dielectric(1.5), wf.Material(wf.Dielectric(1.5), interior=wf.Medium((0, 3, 3)))
    mesh = bumpy(smooth=True, material=clear)
    shapes = [wf.Instance(mesh, at(-3, 0, 0)), wf.Instance(mesh, at(0, 0, 0), material=red)]
    camera = wf.Camera.look_at((1.5, 1, 6), (1.5, 1, 0), fov=50, size=(16, 8))
    image = render(wf.Scene(shapes, SKY, camera), 16).rgb
    assert np.ptp(image[:, :8], axis=2).max() < 1e-3
    assert (image[:, 8:, 0] > image[:, 8:, 1] + 0.1).sum() > 3


@pytest.mark.parametrize("of_mesh", [True, False])
@pytest.mark.filterwarnings("ignore:the picture is black")
def test_an_alpha_may_be_that_of_some_instances(of_mesh):
    """Half-transparent in one place and solid in another, of one mesh; shadows too."""
    solid, half = wf.Diffuse(0), wf.Material(wf.Diffuse(0), alpha=0.5)
    square = wf.Mesh(
        [[-1, 0, 1], [1, 0, 1], [1, 0, -1], [-1, 0, -1]],
        [[0, 1, 2], [0, 2, 3]],
        material=half if of_mesh else solid,
    )
    left = wf.Instance(square, at(-3, 0, 0), material=half)
    right = wf.Instance(square, at(3, 0, 0), material=solid)
    floor = wf.Rectangle((-9, -2, 9), (18, 0, 0), (0, 0, -18), material=wf.Diffuse(1))
    sun = wf.DirectionalLight((0, -1, 0), np.pi)
    for integrator in ("full", "direct_mis"):
        for x, expected in ((-3, 0.25), (3, 0), (-6, 1)):
            camera = wf.Camera.look_at((x, 5, 0), (x, 0, 0), up=(0, 0, 1), fov=4, size=(16, 16))
            scene = wf.Scene([left, right, floor], [sun], camera)
            seen = render(scene, 64, integrator=integrator, max_bounces=1).rgb
            assert seen.mean() == pytest.approx(expected, abs=0.01)


@pytest.mark.parametrize("smooth", [False, True])
def test_normal_maps_lie_as_on_meshes_of_their_own(smooth):
    """Bumps follow the stretch of an instance, normal maps its tangents, mirrored or not."""
    x, y = np.meshgrid(np.arange(16), np.arange(16))
    height = np.sin(x * np.pi / 4) * np.cos(y * np.pi / 4) * 0.5 + 0.5
    mesh = bumpy(smooth, material=wf.Material(wf.Diffuse(0.5), normal_map=wf.BumpMap(height, 0.3)))
    matrices = MATRICES[1:5]
    if smooth:  # averages around a vertex are weighted by angles, which skewed transforms change
        matrices = [at(4, 0, 0, 0.5, (0.3, 1, 2)), at(0, 4, 1, (-1, 1, 1), (1, 2, 3)), at(-3, 0, 0, 1.3)]
    matrices = [matrix @ translation_matrix(-mesh.bounds.mean(0)) for matrix in matrices]
    n = 4000
    origin, direction = rays(n, 7, seed=3)
    query = Rays(origin, direction, nothing(n))
    found = []
    for shapes in (placed(mesh, matrices), alone(placed(mesh, matrices))):
        scene = compiled(shapes)
        hits = intersect(scene, query)
        lanes = hits.found
        surface = interaction(scene, query.take(lanes), hits.take(lanes))
        tangents = surface.dpduv.copy()
        perturb_normals(scene, surface)
        values = np.full((9, n), np.nan)
        values[:, lanes] = [*surface.ns, *tangents]
        found.append((hits.t, values, dot(surface.ns, surface.ng)))
    (t, values, lean), (other_t, others, _) = found
    assert (lean < 0.95).mean() > 0.2
    same = (apart(t, other_t) < 1e-4) & (t < np.inf)
    assert same.sum() > 300
    off = np.abs(values - others)[:3, same].max(0)
    assert np.quantile(off, 0.98) < 1e-4


# --- What is shared -------------------------------------------------------------------------------


def test_bright_lone_and_skewed_meshes_are_not_shared():
    light = bumpy(emission=3)
    cases = [
        [wf.Instance(bumpy(), MATRICES[3])],
        placed(light, MATRICES[:3]),
        placed(bumpy(), [at(0, 0, 0, (1, 1, 0.9e-3)), at(2, 0, 0, (1, 1, 0.9e-3))]),
    ]
    for shapes in cases:
        assert compiled(shapes).instances is None
    assert compiled(placed(bumpy(), MATRICES[:3])).instances is not None
    for shapes in cases:
        camera = wf.Scene(shapes).framing_camera(size=(12, 12))
        a, b = (render(wf.Scene(some, SKY, camera), 2) for some in (shapes, alone(shapes)))
        assert a.rgb.tobytes() == b.rgb.tobytes()


# --- The shape ------------------------------------------------------------------------------------

TRIANGLE = wf.Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]], name="tri")
PROJECTIVE = np.vstack([np.eye(4)[:3], [0, 0, 0.5, 1]])
BAD = [
    ((TRIANGLE, np.eye(3)), r"tri: transform must have shape \(4, 4\), got \(3, 3\)"),
    ((TRIANGLE, "here"), r"tri: transform must be numeric, got 'here'"),
    ((TRIANGLE, np.diag([1, np.nan, 1, 1])), r"tri: transform\[1\]\[1\] is nan; it must be finite"),
    ((TRIANGLE, np.diag([1, np.inf, 1, 1])), r"tri: transform\[1\]\[1\] is inf; it must be finite"),
    ((TRIANGLE, np.diag([1, 0, 1, 1])), r"tri: transform is singular: it stretches by 0 .* above 1e-12"),
    ((TRIANGLE, np.diag([0, 0, 0, 1])), r"tri: transform is singular: it stretches by 0 .* and 0 along"),
    ((TRIANGLE, PROJECTIVE), r"tri: transform has the last row \[0.0, 0.0, 0.5, 1.0\]; it must be"),
    ((TRIANGLE, np.diag([1e39] * 3 + [1])), r"tri: vertices\[1\]\[0\] is 1e\+39; its size must be at most"),
    (("ball", np.eye(4)), r"instance: mesh must be a wf.Mesh, got 'ball'"),
    ((wf.Sphere((0, 0, 0), 1), np.eye(4)), r"mesh must be a wf.Mesh, got <Sphere.*wf.Group\(...\).placed"),
]  # fmt: skip


@pytest.mark.parametrize(("arguments", "message"), BAD, ids=range(len(BAD)))
def test_bad_arguments_are_named(arguments, message):
    with pytest.raises(wf.SceneError, match=message):
        wf.Instance(*arguments)


def test_bad_materials_are_named():
    with pytest.raises(wf.SceneError, match=r"leaf: material is 'reed'; it must be one of"):
        wf.Instance(TRIANGLE, np.eye(4), material="reed", name="leaf")
    leaf = wf.Instance(TRIANGLE, np.eye(4))
    with pytest.raises(wf.SceneError, match=r"tri: material must be a material .*, got 3"):
        leaf.material = 3


def test_an_instance_is_a_shape():
    mesh = bumpy(material=RED, emission=(1, 2, 3))
    shape = wf.Instance(mesh, MATRICES[3])
    own = shape.to_mesh()
    assert shape.bounds == pytest.approx(own.bounds)
    assert shape.material is mesh.material
    assert shape.material.bsdf is RED
    assert shape.emission is mesh.emission
    shape.material = BLUE
    found = [thing.material.bsdf for thing in (shape, mesh, shape.to_mesh())]
    assert found == [BLUE, RED, BLUE]
    assert own.vertices == pytest.approx(scene_vertices(mesh, MATRICES[3]))
    assert wf.Scene(shape).bounds == pytest.approx(own.bounds)
    assert repr(wf.Instance(TRIANGLE, at(1, 2, 3))) == (
        "<Instance 'tri' of <Mesh 'tri': 3 vertices, 1 face>: at [1.0, 2.0, 3.0]>"
    )
    light = wf.Mesh(TRIANGLE.vertices, TRIANGLE.faces, emission=1)
    assert render(wf.Instance(light, np.eye(4)), 1, max_bounces=0).rgb.max() == 1


def test_bounds_are_of_vertices_that_faces_use():
    mesh = wf.Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0], [99, 99, 99]], [[0, 1, 2]])
    assert wf.Instance(mesh, at(1, 0, 0, 2)).bounds.tolist() == [[1, 0, 0], [3, 2, 0]]


# --- Files ----------------------------------------------------------------------------------------


def forest() -> trimesh.Scene:
    """A ball placed five times, three of them below a node that turns and mirrors; a box placed once."""
    scene = trimesh.Scene()
    scene.add_geometry(trimesh.creation.box(), node_name="box", geom_name="box", transform=at(0, -2, 0))
    scene.geometry["ball"] = trimesh.creation.icosphere(2)
    scene.graph.update("group", "world", matrix=at(0, 1, 0, (-1, 1, 0.5), (0, 0.5, 0)))
    for i, matrix in enumerate([at(-3, 0, 0), at(3, 0, 0, 0.5)]):
        scene.graph.update(f"a{i}", "world", matrix=matrix, geometry="ball")
    for i, matrix in enumerate([at(0, 2, 0), at(0, 0, 3, (1, 2, 1)), at(1, 1, -3, 0.4)]):
        scene.graph.update(f"b{i}", "group", matrix=matrix, geometry="ball")
    return scene


def test_nodes_that_share_a_mesh_become_instances(tmp_path):
    forest().export(tmp_path / "a.glb")
    scene = wf.load(tmp_path / "a.glb")
    balls = [shape for shape in scene.shapes if isinstance(shape, wf.Instance)]
    assert len(scene.shapes) == 6
    assert len(balls) == 5
    assert len({id(ball.mesh) for ball in balls}) == 1
    assert sum(np.linalg.det(ball.transform[:3, :3]) < 0 for ball in balls) == 3
    whole = wf.load_mesh(tmp_path / "a.glb", wf.Diffuse(0.5))
    assert len(whole.faces) == 5 * 320 + 12
    assert scene.bounds == pytest.approx(whole.bounds)
    camera = wf.Camera.look_at((0, 3, 12), (0, 0, 0), size=(24, 18))
    a, b = (render(wf.Scene(shapes, SKY, camera), 8).rgb for shapes in (scene.shapes, whole))
    assert (np.abs(a - b).max(2) > 1e-3).mean() < 0.01


def test_a_node_that_flattens_is_no_instance(tmp_path):
    """Its mesh is flat, but the scene is still read, and as before."""
    scene = forest()
    scene.graph.update("flat", "world", matrix=at(0, 0, 0, (1, 0, 1)), geometry="ball")
    scene.export(tmp_path / "a.glb")
    with pytest.warns(UserWarning, match="16 faces of zero area"):
        shapes = wf.load(tmp_path / "a.glb").shapes
    assert sum(isinstance(shape, wf.Instance) for shape in shapes) == 5
    assert sorted(len(shape.faces) for shape in shapes if isinstance(shape, wf.Mesh)) == [12, 304]


# --- Memory ---------------------------------------------------------------------------------------


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="memory is read from /proc")
@pytest.mark.slow
@pytest.mark.parametrize("accel", NAMES)
def test_twenty_million_triangles_fit(accel):
    """1 000 instances of 20 480 triangles, from a glb file to a picture, in less than 500 MB."""
    script = Path(__file__).parents[2] / "benchmarks" / "instances.py"
    command = [sys.executable, str(script), "--accel", accel, "--size", "96x72", "--spp", "1"]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert "= 20480000 triangles" in done.stdout
    name, _, peak, *_ = done.stdout.splitlines()[-1].split()
    assert name == accel
    assert 50 < float(peak) < 500e6 / 2**20


def test_many_instances_are_those_made_one_by_one():
    mesh = wf.Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]], name="leaf")
    transforms = np.tile(np.eye(4), (3, 1, 1))
    transforms[:, :3] += np.random.default_rng(0).random((3, 3, 4))
    material = wf.Diffuse(0.25)
    for options in ({}, {"material": material, "name": "red"}):
        for one, transform in zip(wf.Instance.many(mesh, transforms, **options), transforms, strict=True):
            alone = wf.Instance(mesh, transform, **options)
            assert (one.name, one.mesh, one.material.bsdf) == (alone.name, mesh, alone.material.bsdf)
            assert np.array_equal(one.transform, transform)
            assert np.array_equal(one.bounds, alone.bounds)
    assert wf.Instance.many(mesh, np.zeros((0, 4, 4))) == []


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda m: m[:, :3], r"leaf: transforms must have shape \(n, 4, 4\), got \(3, 3, 4\)"),
        (lambda m: m * np.nan, r"leaf: transforms\[0\]\[0\]\[0\] is nan; it must be finite"),
        (lambda m: m * [[[1]], [[2]], [[1]]], r"leaf: transforms\[1\]: transform has the last row"),
        (lambda m: m * [[1], [1], [0], [1]], r"leaf: transforms\[0\]: transform is singular"),
        (lambda m: m * [[1e39], [1e39], [1e39], [1]], r"leaf: transforms\[0\]: vertices\[1\]\[0\] is 1e\+39"),
    ],
)
def test_a_wrong_one_of_many_transforms_is_named(change, message):
    mesh = wf.Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]], name="leaf")
    with pytest.raises(wf.SceneError, match=message):
        wf.Instance.many(mesh, change(np.tile(np.eye(4), (3, 1, 1))))


@pytest.mark.parametrize("power", [-300, 0, 300])
def test_what_can_be_placed_is_decided_as_for_one(power):
    """Near the limit of the ratio of stretches, and at any scale."""
    mesh = wf.Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]], name="leaf")
    rng = np.random.default_rng(0)
    transforms = np.tile(np.eye(4), (60, 1, 1))
    for i, ratio in enumerate(np.logspace(-14, 0, 60)):
        left, right = (np.linalg.qr(rng.normal(size=(3, 3)))[0] for _ in range(2))
        transforms[i, :3, :3] = left @ np.diag([1, rng.uniform(ratio, 1), ratio]) @ right * 10.0**power

    def works(transform):
        try:
            return bool(wf.Instance(mesh, transform))
        except wf.SceneError:
            return False

    assert can_place(mesh, transforms).tolist() == [works(transform) for transform in transforms]


def test_a_scene_of_many_instances_is_prepared_fast():
    """Bounds, materials and matrices of instances are looked at together, not one by one."""
    mesh = wf.Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    transforms = np.tile(np.eye(4), (2**15, 1, 1))
    transforms[:, :3, 3] = np.random.default_rng(0).random((2**15, 3)) * 100
    scene = wf.Scene(wf.Instance.many(mesh, transforms), [wf.Environment(1.0)])
    assert calls(lambda: scene.bounds) < 9 * 2**15
    bounds = scene.bounds
    low, high = transforms[:, :3, 3].min(0), (transforms[:, :3, 3] + [1, 1, 0]).max(0)
    assert np.array_equal(bounds, [low, high])


def test_bounds_of_instances_are_those_of_each():
    """Bit for bit, whatever other instances stand beside them."""
    rng = np.random.default_rng(0)
    corners = (np.argsort(rng.random((n, n)), 1)[:, :3] for n in (3, 5, 400))
    meshes = [wf.Mesh(rng.normal(size=(len(faces), 3)), faces) for faces in corners]
    transforms = np.tile(np.eye(4), (500, 1, 1))
    transforms[:, :3] = rng.normal(size=(500, 3, 4))
    instances = [wf.Instance(meshes[i % 3], transform) for i, transform in enumerate(transforms)]
    together = instance_bounds(instances)
    for instance, box in zip(instances, together, strict=True):
        assert np.array_equal(instance.bounds, box)
        used = instance.to_mesh().bounds
        assert box == pytest.approx(used, rel=1e-12, abs=1e-12)


def test_instances_of_one_mesh_and_material_are_of_one_kind() -> None:
    class Own(wf.Instance):
        """May have an emission of its own."""

    mesh, gold, ball = wf.Box((0, 0, 0), 1), wf.Material(wf.Mirror(0.5)), wf.Sphere((0, 0, 0), 1)
    at = np.eye(4)
    painted = [wf.Instance(mesh, at, material=gold) for _ in range(2)]
    plain, other = [wf.Instance(mesh, at) for _ in range(2)], wf.Instance(wf.Box((0, 0, 0), 1), at)
    own = [Own(mesh, at), Own(mesh, at)]
    shapes = [plain[0], painted[0], ball, painted[1], *own, plain[1], other, ball, mesh]
    kinds, kind = kinds_of(shapes)
    assert kinds == [plain[0], painted[0], ball, *own, other, mesh]
    assert kind.tolist() == [0, 1, 2, 1, 3, 4, 0, 5, 2, 6]
    assert kinds_of([])[0] == []


def test_a_scene_of_many_instances_is_compiled_without_a_loop_over_them() -> None:
    leaf = wf.Mesh([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 1, 2)])

    def compiled(count: int) -> int:
        places = np.tile(np.eye(4), (count, 1, 1))
        places[:, 2, 3] = np.arange(count)
        camera = wf.Camera.look_at((0, 0, -5), (0, 0, 0), size=4)
        scene = wf.Scene(wf.Instance.many(leaf, places), SKY, camera)
        settings = {"accel": "numpy", "ground": False, "branches": 1, "progress": False, "workers": 1}
        return calls(lambda: wf.Session(scene, 1, **settings).close())

    compiled(1000)  # warm
    assert compiled(2000) - compiled(1000) <= 25 * 1000  # of C functions, most of them
