"""Curved primitives: spheres, cylinders and capsules given by arrays."""

import warnings

import numpy as np
import pytest
import trimesh
from counting import calls
from hypothesis import given, settings
from hypothesis import strategies as st
from inside import (
    CapsulePrimitives,
    CurvedPrimitives,
    CylinderPrimitives,
    Geometry,
    Hits,
    NumpyAccelerator,
    Rays,
    SpherePrimitives,
    compile_scene,
    installed,
    interaction,
    make_accelerator,
)
from rays import check_batches, nothing, random_rays
from strategies import seeds

import wavefront as wf

f4 = np.float32
ACCELS = ["numpy", pytest.param("embree", marks=pytest.mark.skipif(not installed(), reason="no embreex"))]
HERE = np.zeros(3)


def tubes(*args: object) -> wf.Cylinders:
    return wf.Cylinders(*args, caps=False)


def kind(shape: object) -> CurvedPrimitives:
    """The primitives of a shape about the origin."""
    made = CapsulePrimitives if isinstance(shape, wf.Capsules) else CylinderPrimitives
    return made.from_shapes([shape], HERE)


def sticks(shape: object, count: int, seed: int = 0, thin: float = 0.02) -> object:
    rng = np.random.default_rng(seed)
    starts = rng.uniform(-1, 1, (count, 3))
    return shape(starts, starts + 0.2 * rng.normal(size=(count, 3)), rng.uniform(0.1 * thin, thin, count))


def distances(primitives: CurvedPrimitives, origin: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """The exact decision for all pairs of primitive and ray, (k, n)."""
    k, n = len(primitives), origin.shape[1]
    prim = np.repeat(np.arange(k), n)
    o, d = np.tile(origin.astype(float), k), np.tile(direction.astype(float), k)
    with np.errstate(all="ignore"):
        return primitives.distance(prim, o, d, np.zeros(k * n, bool)).reshape(k, n)


def from_axis(start: np.ndarray, end: np.ndarray, point: np.ndarray) -> np.ndarray:
    """Distances (n,) of points (3, n) from a segment, in extended precision."""
    a, b, p = (np.asarray(x, np.longdouble) for x in (start, end, point))
    span = b - a
    size2 = (span * span).sum()
    along = np.clip(((p.T - a) * span).sum(1) / (size2 or 1), 0, 1)
    return np.sqrt((((p.T - a) - along[:, None] * span) ** 2).sum(1))


# --- tree, filter and exact decision --------------------------------------------------------------


@pytest.mark.parametrize("thin", [0.3, 0.02, 1e-5])
@pytest.mark.parametrize("count", [3, 500])
@pytest.mark.parametrize("shape", [wf.Cylinders, wf.Capsules, tubes])
def test_the_filter_and_the_tree_lose_no_hit(shape: object, count: int, thin: float) -> None:
    primitives = kind(sticks(shape, count, thin=thin))
    accelerator = NumpyAccelerator(Geometry(np.zeros((0, 3, 3), f4), (primitives,)))
    origin, direction = random_rays(400, 1)
    aimed = primitives.start[:, np.arange(200) % count] - origin[:, :200]
    direction[:, :200] = aimed / np.linalg.norm(aimed, axis=0)
    all_t = distances(primitives, origin, direction)
    hits = accelerator.closest(origin, direction, nothing(400))
    np.testing.assert_array_equal(hits.t, all_t.min(0).astype(f4))
    found = np.flatnonzero(hits.t < np.inf)
    np.testing.assert_array_equal(hits.prim[found], all_t.argmin(0)[found])
    assert found.size > 20
    distance = np.full(400, 0.6, f4)
    blocked = accelerator.occluded(origin, direction, distance, nothing(400))
    np.testing.assert_array_equal(blocked, hits.t < distance)


@pytest.mark.parametrize("size", [1, 1000])
@pytest.mark.parametrize("shape", [wf.Cylinders, wf.Capsules, tubes])
def test_batches_have_the_same_bits(shape: object, size: int) -> None:
    check_batches(NumpyAccelerator(Geometry(np.zeros((0, 3, 3), f4), (kind(sticks(shape, 200)),))), size)


@pytest.mark.parametrize("accel", ACCELS)
def test_kinds_stand_side_by_side(accel: str) -> None:
    """The ids count triangles, then spheres, cylinders and capsules."""
    at = np.array([[3.0 * i, 0, 0] for i in range(4)])
    quad = np.array([[(-0.5, -0.5, 0), (0.5, -0.5, 0), (0.5, 0.5, 0)]], f4)
    up = np.array([0, 1.0, 0])
    curved = (
        SpherePrimitives(at[1].reshape(3, 1).astype(f4), np.ones(1, f4)),
        kind(wf.Cylinders([at[2] - up], [at[2] + up], 0.5)),
        kind(wf.Capsules([at[3] - up], [at[3] + up], 0.25)),
    )
    accelerator = make_accelerator(Geometry(quad, curved), accel)
    origin = (at + np.array([0.1, -0.1, 5])).T.astype(f4)
    direction = np.repeat(np.array([[0], [0], [-1]], f4), 4, 1)
    hits = accelerator.closest(origin, direction, nothing(4))
    assert hits.prim.tolist() == [0, 1, 2, 3]
    assert not hits.b1[1:].any()
    expected = [5, 5 - np.sqrt(1 - 0.02), 5 - np.sqrt(0.25 - 0.01), 5 - np.sqrt(0.0625 - 0.01)]
    np.testing.assert_allclose(hits.t, expected, rtol=1e-6)


# --- exact decision against extended precision ----------------------------------------------------


@settings(max_examples=150)
@given(
    seed=seeds,
    long=st.floats(0, 5),
    thin=st.floats(-5, 0),
    near=st.sampled_from([-0.5, -1e-3, -1e-6, 1e-6, 1e-3, 1.0]),
)
def test_lines_near_the_surface_of_a_capsule(seed: int, long: float, thin: float, near: float) -> None:
    """A line at a distance of (1 + near) radii from the axis hits if that is below 1, however thin it is."""
    rng = np.random.default_rng(seed)
    radius, size = 10.0**thin, 10.0**long - 1
    axis = rng.normal(size=3)
    axis /= np.linalg.norm(axis)
    start = rng.normal(size=3)
    primitives = kind(wf.Capsules([start], [start + size * axis], radius))
    sideways = rng.normal(size=(3, 40))
    sideways -= axis[:, None] * (axis @ sideways)
    sideways /= np.linalg.norm(sideways, axis=0)
    point = start[:, None] + axis[:, None] * size * rng.random(40) + sideways * radius * (1 + near)
    direction = np.cross(sideways.T, rng.normal(size=(40, 3))).T
    direction /= np.linalg.norm(direction, axis=0)
    origin = point - direction * rng.uniform(0, 3, 40)
    t = distances(primitives, origin, direction)[0]
    ends = start, start + size * axis
    if near > 0:  # tangential to a larger capsule, which is convex
        assert (t == np.inf).all()
        return
    inside = from_axis(*ends, origin) < radius
    assert (t[~inside] < np.inf).all()
    on = origin.astype(np.longdouble) + direction * t.astype(np.longdouble)
    bound = 2e-14 * (1 + size) * (1 + 1 / np.sqrt(-near))  # float64, and grazing
    assert (np.abs(from_axis(*ends, on) - radius) < bound).all()


def test_a_ray_along_the_axis_meets_the_ends() -> None:
    for shape, expected in ((wf.Cylinders, 2), (wf.Capsules, 1.5), (tubes, np.inf)):
        primitives = kind(shape([(0, 0, 0)], [(0, 0, 7)], 0.5))
        for off in (0.0, 1e-300, 1e-12):
            origin, direction = np.array([[off], [0], [-2]]), np.array([[off], [0], [1.0]])
            np.testing.assert_allclose(distances(primitives, origin, direction), [[expected]], atol=1e-9)
        beside = distances(primitives, np.array([[0.51], [0], [-2]]), np.array([[0.0], [0], [1]]))
        assert beside.item() == np.inf


@pytest.mark.parametrize(
    ("shape", "expected"),
    [(wf.Capsules, [2, 1, 1.5, 3]), (wf.Cylinders, [2, 1, 0.5, 4]), (tubes, [2, 1, np.inf, np.inf])],
)
def test_from_outside_inside_and_on_it(shape: object, expected: list) -> None:
    primitives = kind(shape([(0, 0, 0)], [(0, 0, 1)], 1))
    origin = np.array([[-3, 0, 0.5], [0, 0, 0.5], [0, 0, 0.5], [0, 0, 5.0]]).T
    direction = np.array([[1, 0, 0], [1, 0, 0], [0, 0, 1], [0, 0, -1.0]]).T
    np.testing.assert_allclose(distances(primitives, origin, direction)[0], expected)
    on, along = np.array([[1, 0, 0.5]] * 2).T, np.array([[1, 0, 0], [-1.0, 0, 0]]).T
    for shift in (-1e-7, 0, 1e-7):  # rounded to either side
        start = on + np.array([[shift], [0], [0]])
        with np.errstate(all="ignore"):
            t = primitives.distance(np.zeros(2, int), start, along, np.ones(2, bool))
        np.testing.assert_allclose(t, [np.inf, 2], atol=1e-6)


# --- closed forms ---------------------------------------------------------------------------------


@pytest.mark.parametrize("angle", [0, pytest.param(35, marks=pytest.mark.slow), 60, 90])
@pytest.mark.parametrize("shape", [wf.Cylinders, wf.Capsules])
def test_silhouettes_have_their_areas(shape: object, angle: float) -> None:
    """Of a cylinder 2rL·sin + πr²·cos (up to the overlap), of a capsule 2rL·sin + πr²."""
    size, radius, side, steps = 1.5, 0.4, 3.0, 700
    sin, cos = np.sin(np.radians(angle)), np.cos(np.radians(angle))
    half = np.array([0.8 * sin, 0.6 * sin, cos]) * size / 2
    primitives = kind(shape([-half], [half], radius))
    grid = (np.arange(steps) + 0.5) / steps * side - side / 2
    x, y = np.meshgrid(grid, grid)
    origin = np.stack([x.ravel(), y.ravel(), np.full(steps * steps, 5.0)]).astype(f4)
    direction = np.repeat(np.array([[0], [0], [-1]], f4), steps * steps, 1)
    accelerator = NumpyAccelerator(Geometry(np.zeros((0, 3, 3), f4), (primitives,)))
    hit = accelerator.closest(origin, direction, nothing(steps * steps)).prim >= 0
    ends = np.pi * radius**2 * (cos if shape is wf.Cylinders else 1)
    # An error of a cell along the outline, which is at most 8 long, averages out to a small part of it.
    assert abs(hit.mean() * side**2 - (2 * radius * size * sin + ends)) < 8 * side / steps * 0.1


@pytest.mark.parametrize(
    "shape", [wf.Spheres([(0, 0, 0)], 0.6), sticks(wf.Capsules, 1), sticks(wf.Cylinders, 1)], ids=repr
)
def test_a_convex_white_body_in_a_furnace_is_invisible(shape: object) -> None:
    shape.material = wf.Diffuse(1.0)
    image = wf.render(wf.Scene(shape, [wf.Environment(1.0)]), 4, size=(32, 32), integrator="naive")
    np.testing.assert_allclose(image.rgb, 1, rtol=1e-6)


@pytest.mark.parametrize("shape", [wf.Cylinders, wf.Capsules])
def test_a_body_of_air_is_invisible(shape: object) -> None:
    """Each ray that enters a closed body leaves it on the far side."""
    body = sticks(shape, 30, thin=0.3)
    body.material = wf.Dielectric(1.0)
    image = wf.render(wf.Scene(body, [wf.Environment(1.0)]), 4, size=(48, 48), max_bounces=200)
    np.testing.assert_allclose(image.rgb, 1, rtol=1e-5)


# --- surface data ---------------------------------------------------------------------------------


def surfaces(shape: object, texture: bool = True) -> tuple[object, object]:
    """The surface where random rays meet a shape, and the compiled scene."""
    look = wf.Material(
        wf.Diffuse(wf.VertexColors()),
        normal_map=wf.BumpMap(wf.Texture(np.eye(4, dtype=f4), srgb=False, channel=0), 0.01),
    )
    shape.material = look
    scene = compile_scene(wf.Scene(shape, [wf.Environment(1)]), NumpyAccelerator)
    origin, direction = random_rays(4000, 3)
    found = scene.accelerator.closest(origin, direction, nothing(4000))
    on = np.flatnonzero(found.prim >= 0)
    rays = Rays(origin, direction, nothing(4000)).take(on)
    return interaction(scene, rays, Hits(found.t, found.prim, found.b1, found.b2).take(on)), scene


@pytest.mark.parametrize("shape", [wf.Cylinders, wf.Capsules, tubes])
def test_points_lie_on_the_surface_and_normals_stand_on_it(shape: object) -> None:
    body = sticks(shape, 40, thin=0.2)
    surface, scene = surfaces(body)
    assert len(surface) > 300
    primitives = scene.curved.kinds[0]
    start = body.starts[surface.prim].T - scene.center[:, None]
    span = (body.ends - body.starts)[surface.prim].T
    size = np.linalg.norm(span, axis=0)
    relative = surface.point - start
    along = (relative * span).sum(0) / size
    outward = relative - span / size * along
    away, radius = np.linalg.norm(outward, axis=0), body.radii[surface.prim]
    normal = surface.ng * np.where(surface.back_facing, -1, 1)
    np.testing.assert_allclose(np.linalg.norm(normal, axis=0), 1, rtol=1e-6)
    on_side = np.abs(away - radius) < 2e-7
    if shape is wf.Capsules:
        axis_point = span / size * np.clip(along, 0, size)
        away = np.linalg.norm(relative - axis_point, axis=0)
        np.testing.assert_allclose(away, radius, atol=2e-7)
        assert (np.abs(away - radius) <= surface.error).all()
        np.testing.assert_allclose(normal * radius, relative - axis_point, atol=1e-6)
    else:
        on_cap = ~on_side
        np.testing.assert_allclose((normal * radius)[:, on_side], outward[:, on_side], atol=1e-6)
        height = np.minimum(np.abs(along), np.abs(along - size))
        assert (height[on_cap] < 2e-7).all()
        assert on_cap.any() == (shape is wf.Cylinders)
        assert (np.abs(away - radius)[on_side] <= surface.error[on_side]).all()
        from_middle = (relative - span / 2)[:, on_cap]
        assert ((normal[:, on_cap] * from_middle).sum(0) > 0).all()
    assert (surface.error < 1e-5).all()
    assert len(primitives) == 40


@pytest.mark.parametrize("shape", [wf.Cylinders, wf.Capsules])
def test_texture_coordinates_and_their_derivatives(shape: object) -> None:
    """Against finite differences on the surface; u turns once, v rises from end to end."""
    surface, scene = surfaces(sticks(shape, 5, thin=0.3))
    primitives = scene.curved.kinds[0]
    prim, point, step = surface.prim, surface.point.astype(np.float64), 1e-4
    uv = primitives.uv(prim, surface.point)
    assert uv.min() >= 0
    assert uv.max() <= 1
    dpdu, dpdv = surface.dpduv[:3].astype(float), surface.dpduv[3:].astype(float)
    body = (np.linalg.norm(dpdv, axis=0) > 0) & (np.abs(uv[0] - 0.5) < 0.45) & (uv[1] > 0.05) & (uv[1] < 0.95)
    assert body.sum() > 100
    for number, tangent in enumerate((dpdu, dpdv)):
        away = (point + step * tangent).astype(f4)
        change = (primitives.uv(prim, away) - uv)[:, body] / step
        expected = np.array([[1.0], [0]] if number == 0 else [[0.0], [1]])
        assert np.abs(change - expected).max() < 0.03
    outward = surface.ng * np.where(surface.back_facing, -1, 1)
    assert (np.cross(dpdu.T, dpdv.T).T * outward).sum(0)[body].min() > 0


# --- shapes ---------------------------------------------------------------------------------------


def look(*shapes: object, accel: str = "numpy", **options: object) -> np.ndarray:
    scene = wf.Scene([*shapes, wf.Rectangle((-3, -1.3, 3), (6, 0, 0), (0, 0, -6))], [wf.Environment(1)])
    scene.camera = wf.Camera.look_at((0, 1, 6), (0, 0, 0), size=(40, 40))
    return wf.render(scene, 4, accel=accel, **options).rgb


@pytest.mark.parametrize("accel", ACCELS)
@pytest.mark.parametrize("count", [20, 300])
def test_spheres_are_many_single_spheres(accel: str, count: int) -> None:
    rng = np.random.default_rng(4)
    centers, colors = rng.uniform(-1, 1, (count, 3)), rng.random((count, 3))
    radii = rng.uniform(0.02, 0.2, count)
    rows = zip(centers, radii, map(wf.Diffuse, colors), strict=True)
    single = [wf.Sphere(center, radius, material=material) for center, radius, material in rows]
    np.testing.assert_array_equal(
        look(wf.Spheres(centers, radii, colors), accel=accel), look(*single, accel=accel)
    )


def test_spheres_shine_as_single_ones() -> None:
    centers = np.array([(-1, 0, 0), (1, 0, 0), (0, 1, 0)])
    single = [wf.Sphere(c, 0.3, emission=(3, 2, 1), material=wf.Diffuse(0)) for c in centers]
    many = wf.Spheres(centers, 0.3, emission=(3, 2, 1), material=wf.Diffuse(0))
    np.testing.assert_array_equal(look(many), look(*single))


def test_a_capsule_without_length_is_a_sphere() -> None:
    capsule = wf.Capsules([(0, 0, 0)], [(0, 0, 0)], 1, material=wf.Mirror(0.9))
    np.testing.assert_allclose(
        look(capsule), look(wf.Sphere((0, 0, 0), 1, material=wf.Mirror(0.9))), atol=1e-4
    )


@pytest.mark.skipif(not installed(), reason="no embreex")
def test_both_accelerators_make_one_picture() -> None:
    shapes = [sticks(shape, 200) for shape in (wf.Cylinders, wf.Capsules, tubes)]
    floorless = wf.Scene(shapes, [wf.Environment(1)])
    a, b = (wf.render(floorless, 4, size=(40, 40), accel=accel).rgb for accel in ("numpy", "embree"))
    np.testing.assert_array_equal(a, b)


@pytest.mark.parametrize("shape", [wf.Cylinders, wf.Capsules])
def test_a_power_of_two_in_size_changes_no_bit(shape: object) -> None:
    body = sticks(shape, 50, thin=0.2)
    pictures = []
    for factor in (1.0, 2.0**-40, 2.0**40):
        scene = wf.Scene(body.scaled(factor), [wf.Environment(1)])
        pictures.append(wf.render(scene, 2, size=(32, 32)).rgb)
    np.testing.assert_array_equal(pictures[0], pictures[1])
    np.testing.assert_array_equal(pictures[0], pictures[2])


def test_colors_are_shown_and_may_be_transparent() -> None:
    ends = np.array([(-1, 0, 0), (1, 0, 0)]), np.array([(-1, 1, 0), (1, 1, 0)])
    glow = {"integrator": "direct_mis"}
    red = look(wf.Capsules(*ends, 0.4, [(1, 0, 0), (0, 1, 0)]), **glow)
    assert red[18, 11, 1] < 0.01 < red[18, 11, 0]
    assert red[18, 28, 0] < 0.01 < red[18, 28, 1]
    clear = wf.Material(wf.Diffuse(wf.VertexColors()), alpha=wf.VertexColors(channel=3))
    gone = wf.Capsules(*ends, 0.4, [(1, 0, 0, 0), (0, 1, 0, 0)], material=clear)
    np.testing.assert_allclose(look(gone, **glow), look(**glow), atol=0.2)
    assert np.abs(look(gone, **glow) - look(**glow)).mean() < 0.01


def test_colors_alone_leave_the_accelerator_as_it_is() -> None:
    body = sticks(wf.Capsules, 30)
    body.colors = np.ones((30, 3))
    scene = wf.Scene(body, [wf.Environment(1)])
    made = []

    class Counted(NumpyAccelerator):
        name = "counted"

        def __init__(self, geometry: Geometry) -> None:
            made.append(geometry)
            super().__init__(geometry)

    for change, count in ((None, 1), ("colors", 1), ("radii", 2)):
        if change:
            setattr(body, change, getattr(body, change) * 0.5)
        wf.render(scene, 1, size=(8, 8), accel=Counted, executor="threads")
        assert len(made) == count, change


def test_a_hundred_thousand_are_set_up_together() -> None:
    """None by itself: the calls grow with the depth of the tree."""
    rng = np.random.default_rng(5)
    centers, colors = rng.uniform(-1, 1, (100_000, 3)), rng.random((100_000, 3))
    scene = wf.Scene(wf.Spheres(centers, 0.005, colors), [wf.Environment(1)])
    assert calls(lambda: compile_scene(scene, NumpyAccelerator)) < 25_000


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: wf.Spheres([(0, 0, 0)], 0), r"spheres: radii is 0; it must be above 0"),
        (lambda: wf.Spheres([(0, 0, 0)] * 2, [1, -1]), r"spheres: radii\[1\] is -1; it must be above 0"),
        (lambda: wf.Spheres([(0, 0, 0)] * 3, [1, 1]), r"one number, or one for each of 3, got 2"),
        (lambda: wf.Spheres(np.zeros((0, 3)), 1), r"spheres: centers is empty"),
        (lambda: wf.Spheres([(0, 0)], 1), r"spheres: centers must have shape"),
        (lambda: wf.Spheres([(0, 0, 0)], 1, [(2, 0, 0)]), r"colors\[0\]\[0\] is 2"),
        (lambda: wf.Spheres([(0, 0, 0)], 1, np.ones((2, 3))), r"colors must have a row for each of 1, got 2"),
        (lambda: wf.Cylinders([(0, 0, 0)], [(0, 0, 0)], 1), r"starts\[0\] and ends\[0\] are both"),
        (lambda: wf.Capsules([(0, 0, 0)], np.zeros((2, 3)), 1), r"capsules: has 1 start and 2 ends"),
        (lambda: wf.Edges(np.zeros((1, 3)), 1), r"edges: lines has no edges"),
        (lambda: wf.Edges(7, 1), r"edges: lines must be a mesh, a path, or points \(n, 3\), got 7"),
    ],
)
def test_what_is_wrong_is_named(make: object, message: str) -> None:
    with pytest.raises(wf.SceneError, match=message):
        make()


@pytest.mark.parametrize("shape", [wf.Cylinders, wf.Capsules])
def test_bounds_hold_the_shape_and_touch_it(shape: object) -> None:
    axis, radius = np.array([0.6, 0, 0.8]), 0.5
    body = shape([(0, 0, 0)], [2 * axis], radius)
    turn = np.linspace(0, 2 * np.pi, 721)[:, None]
    around = radius * (np.cos(turn) * (0.8, 0, -0.6) + np.sin(turn) * (0, 1, 0))
    if shape is wf.Capsules:
        tilt = np.linspace(-np.pi / 2, np.pi / 2, 721)[:, None, None]
        around = (np.cos(tilt) * around + radius * np.sin(tilt) * axis).reshape(-1, 3)
    points = np.concatenate([around, around + 2 * axis])
    np.testing.assert_allclose(body.bounds, [points.min(0), points.max(0)], atol=1e-4)


@pytest.mark.parametrize(("cloud", "maker"), [(True, "Points"), (False, "Edges")])
def test_clouds_and_paths_in_place_of_shapes_get_a_hint(cloud: bool, maker: str) -> None:
    points = np.eye(3)
    given = trimesh.PointCloud(points) if cloud else trimesh.load_path(points)
    with pytest.raises(wf.SceneError, match=rf"; wf\.{maker}\(it, radius\) is a shape"):
        wf.Scene([given])


def test_cylinders_cannot_shine() -> None:
    glow = wf.Material(wf.Diffuse(0), emission=1)
    shape = wf.Cylinders([(0, 0, 0)], [(0, 1, 0)], 0.1, material=glow, name="rod")
    with pytest.raises(wf.SceneError, match="rod: a Cylinders cannot emit light"):
        wf.render(wf.Scene(shape), 1, size=(8, 8))


# --- points and edges -----------------------------------------------------------------------------


def test_points_take_clouds_of_trimesh_and_their_colors() -> None:
    places = np.random.default_rng(6).random((7, 3))
    colors = np.random.default_rng(7).integers(0, 256, (7, 4), np.uint8)
    cloud = wf.Points(trimesh.PointCloud(places, colors), 0.1)
    np.testing.assert_array_equal(cloud.centers, places)
    np.testing.assert_array_equal(cloud.colors, wf.Spheres(places, 0.1, colors).colors)
    assert wf.Points(trimesh.PointCloud(places), 0.1).colors is None
    assert wf.Points(places, np.full(7, 0.1)).count == 7


def test_edges_of_meshes_are_there_once() -> None:
    box = trimesh.creation.box()
    assert wf.Edges(box, 0.1).count == 18  # twelve edges and six diagonals
    loose = wf.Mesh(box.triangles.reshape(-1, 3), np.arange(36).reshape(-1, 3))  # no vertex is shared
    edges = wf.Edges(loose, 0.1)
    assert edges.count == 18
    np.testing.assert_allclose(
        np.sort(np.linalg.norm(edges.starts - edges.ends, axis=1)), [1] * 12 + [np.sqrt(2)] * 6
    )


def test_edges_of_lines() -> None:
    line = [(0, 0, 0), (1, 0, 0), (1, 1, 0)]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        path = trimesh.load_path(np.array(line, float))
    for lines in (line, [np.array(line)], path):
        edges = wf.Edges(lines, 0.1)
        assert edges.count == 2
        np.testing.assert_allclose(np.linalg.norm(edges.ends - edges.starts, axis=1), 1)
    flat = trimesh.path.creation.circle_pattern(1.0, 0.3, 4)
    assert (wf.Edges(flat, 0.1).starts[:, 2] == 0).all()
