"""Surfaces of signed distances on grids: cells as primitives, and the shape."""

import struct
from pathlib import Path

import numpy as np
import pytest
from inside import (
    DistanceGridPrimitives,
    Geometry,
    NumpyAccelerator,
    Rays,
    _first_root,
    compile_scene,
    interaction,
    intersect,
    offset_origin,
)
from rays import check_batches, nothing

import wavefront as wf

f4 = np.float32
BOX = [(-1, -1, -1), (1, 1, 1)]
SKEWED = np.eye(4)
SKEWED[:3] = np.random.default_rng(3).normal(size=(3, 4))


def grid(n: int) -> np.ndarray:
    return np.mgrid[-1 : 1 : n * 1j, -1 : 1 : n * 1j, -1 : 1 : n * 1j]


def sphere(n: int, radius: float = 0.7) -> np.ndarray:
    return np.sqrt((grid(n) ** 2).sum(0)) - radius


def torus(n: int) -> np.ndarray:
    z, y, x = grid(n)
    return np.hypot(np.hypot(x, z) - 0.6, y) - 0.25


def noise(n: int) -> np.ndarray:
    """Closed, and rough from cell to cell."""
    values = np.random.default_rng(n).normal(size=(n, n, n))
    values[[0, -1]] = values[:, [0, -1]] = values[:, :, [0, -1]] = 1
    return values


def cube(n: int) -> np.ndarray:
    """With faces in planes of the grid, where the values are exactly 0."""
    return np.abs(grid(n)).max(0) - 0.5


CLOSED = {"torus": torus(17), "noise": noise(8), "cube": cube(9), "binary": np.where(cube(9) <= 0, -1.0, 0)}
closed = pytest.mark.parametrize("name", CLOSED)


def accelerator(shape: wf.SignedDistanceGrid) -> NumpyAccelerator:
    cells = DistanceGridPrimitives.from_shapes([shape], np.zeros(3))
    return NumpyAccelerator(Geometry(np.zeros((0, 3, 3), f4), (cells,)))


def field(values: np.ndarray, place: np.ndarray) -> np.ndarray:
    """Trilinear values at points (3, n), in steps of the grid."""
    last = np.array(values.shape[::-1])[:, None] - 2
    low = np.clip(np.floor(place), 0, last).astype(int)
    part, out = place - low, 0.0
    for i, j, k in np.ndindex(2, 2, 2):
        weight = np.prod([np.where(side, p, 1 - p) for side, p in zip((i, j, k), part, strict=True)], 0)
        out = out + weight * values[low[2] + k, low[1] + j, low[0] + i]
    return out


@pytest.mark.parametrize("seed", range(4))
def test_the_first_root_of_the_trilinear_field_is_hit(seed: int) -> None:
    """Along rays through random grids, against dense samples of the field in float64."""
    rng = np.random.default_rng(seed)
    values = rng.normal(size=rng.integers(3, 7, 3)).astype(f4)
    matrix = np.eye(4)
    matrix[:3] = rng.normal(size=(3, 4))
    shape = wf.SignedDistanceGrid(values, matrix)
    cells = np.array(values.shape[::-1]) - 1.0
    target = matrix[:3, :3] @ rng.random((3, 200)) + matrix[:3, 3:]
    origin = np.where(
        np.arange(200) < 50, target + 0.01 * rng.normal(size=(3, 200)), rng.normal(size=(3, 200))
    )
    origin = origin.astype(f4)
    direction = target + 0.1 * rng.normal(size=(3, 200)) - origin
    direction = (direction / np.linalg.norm(direction, axis=0)).astype(f4)
    t = accelerator(shape).closest(origin, direction, nothing(200)).t
    inverse = np.linalg.inv(matrix)

    def places(at: np.ndarray) -> np.ndarray:
        points = origin[:, :, None].astype(float) + direction[:, :, None].astype(float) * at
        return (np.tensordot(inverse[:3, :3], points, 1) + inverse[:3, 3, None, None]) * cells[:, None, None]

    samples = np.broadcast_to(np.linspace(0, 8, 2001)[1:], (200, 2000))
    place = places(samples)
    there = ((place >= 0) & (place <= cells[:, None, None])).all(0) & (samples < t[:, None] - 1e-5)
    value = field(values, place.reshape(3, -1)).reshape(there.shape)
    before = np.where(there, value >= 0, np.nan)
    assert not (
        np.nanmax(before, 1, initial=0, where=there) > np.nanmin(before, 1, initial=1, where=there)
    ).any()
    hit = t < np.inf
    assert hit.sum() > 80
    ends = [places(np.where(hit, t, 0)[:, None].astype(float) + step)[:, hit, 0] for step in (-1e-4, 0, 1e-4)]
    low, on, high = (field(values, np.clip(end, 0, cells[:, None])) for end in ends)
    assert (np.abs(on) <= 1e-2 * np.maximum(np.abs(high - low), 1e-6)).mean() > 0.97
    assert np.abs(on).max() < 1e-3


@closed
def test_no_ray_leaks_through_the_borders_of_cells(name: str) -> None:
    """From corners of cells along lines that pass through edges and corners."""
    rng, values, n = np.random.default_rng(1), CLOSED[name], 10_000
    last = np.array(values.shape[::-1]) - 1.0
    matrix = np.diag([*last, 1.0])
    z, y, x = np.nonzero(values < 0)
    start = rng.integers(0, x.size, n)
    origin = np.stack([x, y, z])[:, start].astype(f4)
    direction = rng.integers(-3, 4, (3, n)).astype(f4)
    direction[:, (direction == 0).all(0)] = 1
    tree = accelerator(wf.SignedDistanceGrid(values, matrix))
    assert np.isfinite(tree.closest(origin, direction, nothing(n)).t).all()
    assert tree.occluded(origin, direction, np.full(n, 1e6, f4), nothing(n)).all()


@pytest.mark.parametrize("transform", [BOX, SKEWED], ids=["box", "skewed"])
@closed
def test_rays_go_in_and_out_in_turn(name: str, transform: object) -> None:
    """Each ray that continues behind a surface meets the other side of one next, and the outside last."""
    shape = wf.SignedDistanceGrid(CLOSED[name], transform)
    scene = compile_scene(wf.Scene(shape, [wf.Environment(1)]), NumpyAccelerator)
    rng, n = np.random.default_rng(0), 3000
    half = np.ptp(shape.bounds, axis=0)[:, None] / 2
    origin = rng.normal(size=(3, n))
    origin *= 3 * np.linalg.norm(half) / np.linalg.norm(origin, axis=0)
    direction = rng.uniform(-1, 1, (3, n)) * half - origin
    direction = (direction / np.linalg.norm(direction, axis=0)).astype(f4)
    rays, inside, lanes, met = (
        Rays(origin.astype(f4), direction, nothing(n)),
        np.zeros(n, bool),
        np.arange(n),
        0,
    )
    while lanes.size:
        hits = intersect(scene, rays)
        found = np.isfinite(hits.t)
        assert not inside[lanes[~found]].any()
        on = np.flatnonzero(found)
        rays, hits, lanes = rays.take(on), hits.take(on), lanes[on]
        surface = interaction(scene, rays, hits)
        np.testing.assert_array_equal(surface.back_facing, inside[lanes])
        inside[lanes] = ~surface.back_facing
        out = offset_origin(surface, (surface.ng * rays.direction).sum(0))
        rays, met = Rays(out, rays.direction, surface.prim), met + lanes.size
    assert met > 2000


def test_a_ray_that_leaves_the_surface_does_not_meet_it_again() -> None:
    """Wherever its origin is rounded to."""
    shape = wf.SignedDistanceGrid(sphere(17), BOX)
    tree = accelerator(shape)
    origin = np.array([[0.01], [0.02], [3]], f4)
    down = np.array([[0], [0], [-1]], f4)
    first = tree.closest(origin, down, nothing(1))
    for shift in (-1e-7, 0, 1e-7):
        on = (origin + down * (first.t + f4(shift))).astype(f4)
        assert tree.closest(on, -down, first.prim).t.item() == np.inf
        np.testing.assert_allclose(tree.closest(on, down, first.prim).t, 1.4, atol=0.02)


def test_batches_have_the_same_bits() -> None:
    check_batches(accelerator(wf.SignedDistanceGrid(torus(17), BOX)), 100)


def test_points_normals_and_their_continuity() -> None:
    """Normals are those of a sphere; smooth ones do not jump between cells, those of the surface do."""
    turns = np.linspace(0, 0.4, 4000)
    direction = np.stack([np.cos(turns), np.sin(turns), 0.3 * np.ones(4000)])
    direction = (direction / np.linalg.norm(direction, axis=0)).astype(f4)
    jumps = []
    for smooth in (True, False):
        shape = wf.SignedDistanceGrid(sphere(17), BOX, smooth=smooth)
        scene = compile_scene(wf.Scene(shape, [wf.Environment(1)]), NumpyAccelerator)
        rays = Rays(5 * direction, -direction, nothing(4000))
        surface = interaction(scene, rays, intersect(scene, rays))
        value = field(shape.values, (surface.point.astype(float) + 1) * 8)
        assert (np.abs(value) <= 2 * surface.error).all()
        assert surface.error.max() < 1e-6
        assert (surface.ns * direction).sum(0).min() > 0.99
        jumps.append(np.linalg.norm(np.diff(surface.ns, axis=1), axis=0).max())
    assert jumps[0] < 1e-3 < 1e-2 < jumps[1]


def test_normals_are_those_of_the_cells_around_a_corner() -> None:
    """Of ax² + bx for each axis, xy² and yz², whose slopes in a cell are known: that of x² is 2i + 1."""
    rng = np.random.default_rng(4)
    a, b, sizes = np.array([0.3, -0.2, 0.25]), np.array([-1.5, 1.2, -1.9]), np.array([6, 8, 9])
    x, y, z = (np.arange(n) for n in sizes)
    parts = [a[k] * at**2 + b[k] * at for k, at in enumerate((x, y, z))]
    values = parts[0] + parts[1][:, None] + parts[2][:, None, None] + 2.1
    across = 0.03, 0.02
    values = values + across[0] * x * (y**2)[:, None] + across[1] * y[:, None] * (z**2)[:, None, None]
    shape = wf.SignedDistanceGrid(values, SKEWED)
    scene = compile_scene(wf.Scene(shape, [wf.Environment(1)]), NumpyAccelerator)
    turn = SKEWED[:3, :3]
    target = turn @ rng.random((3, 2000)) + SKEWED[:3, 3:]
    origin = (target + 3 * rng.normal(size=(3, 2000))).astype(f4)
    direction = ((target - origin) / np.linalg.norm(target - origin, axis=0)).astype(f4)
    rays = Rays(origin - scene.center[:, None].astype(f4), direction, nothing(2000))
    hits = intersect(scene, rays)
    rays, hits = rays.take(hits.found), hits.take(hits.found)
    surface = interaction(scene, rays, hits)
    place = np.linalg.solve(turn, surface.point + scene.center[:, None] - SKEWED[:3, 3:])
    place *= (sizes - 1)[:, None]
    corner = np.rint(place)
    second = place - corner + 0.5
    squares = [np.interp(at, np.arange(n), np.arange(n) ** 2) for at, n in zip(place, sizes, strict=True)]
    total = 0
    for sides in np.ndindex(2, 2, 2):
        cell = np.clip(corner + np.reshape(sides, (3, 1)) - 1, 0, (sizes - 2)[:, None])
        slope = a[:, None] * (2 * cell + 1) + b[:, None]
        slope[0] += across[0] * squares[1]
        slope[1] += across[0] * place[0] * (2 * cell[1] + 1) + across[1] * squares[2]
        slope[2] += across[1] * place[1] * (2 * cell[2] + 1)
        slope *= (sizes - 1)[:, None]
        weight = np.prod([w if side else 1 - w for side, w in zip(sides, second, strict=True)], 0)
        total = total + weight * slope / np.linalg.norm(slope, axis=0)
    normal = np.linalg.solve(turn.T, total)
    normal *= np.where(surface.back_facing, -1, 1) / np.linalg.norm(normal, axis=0)
    inside = (normal * surface.ng).sum(0) > 0.01
    inside &= (normal * surface.wo).sum(0) > 0.01
    inside &= (np.abs(second) > 1e-3).all(0) & (np.abs(second - 1) > 1e-3).all(0)  # both corners are nearest
    assert inside.sum() > 300
    np.testing.assert_allclose(surface.ns[:, inside], normal[:, inside], atol=2e-4)


def test_the_first_change_of_sign_of_a_cubic_is_found() -> None:
    """Beside the roots by eigenvalues, of cubics by their Bernstein coefficients."""
    b = np.random.default_rng(0).normal(size=(4, 3000))
    power = np.stack(
        [b[0], 3 * (b[1] - b[0]), 3 * (b[2] - 2 * b[1] + b[0]), b[3] - 3 * b[2] + 3 * b[1] - b[0]]
    )
    due = np.full(3000, np.inf)
    for k in range(3000):
        roots = np.roots(power[::-1, k])
        real = roots[np.abs(roots.imag) < 1e-9].real
        due[k] = min(real[(real > 0) & (real < 1)], default=np.inf)
    with np.errstate(all="ignore"):
        found = _first_root(b, b[0] >= 0)
    assert np.isfinite(due).sum() > 1000
    np.testing.assert_allclose(found, due, atol=1e-9)


def test_grids_of_several_sizes_in_one_scene() -> None:
    """Rays meet the nearest of them, as if each were alone, and have its normals."""
    rng, n = np.random.default_rng(2), 500
    shapes = [
        wf.SignedDistanceGrid(sphere(9), BOX),
        wf.SignedDistanceGrid(torus(12), BOX, smooth=False).translated((1, 0.5, 0)),
    ]
    origin = rng.normal(size=(3, n)) * 4
    direction = rng.uniform(-1, 1, (3, n)) - origin
    rays = Rays(origin.astype(f4), (direction / np.linalg.norm(direction, axis=0)).astype(f4), nothing(n))

    def seen(some: list) -> tuple[np.ndarray, np.ndarray]:
        scene = compile_scene(wf.Scene(some, [wf.Environment(1)]), NumpyAccelerator)
        moved = Rays(rays.origin - scene.center[:, None].astype(f4), rays.direction, rays.exclude_prim)
        hits = intersect(scene, moved)
        met = hits.found
        normal = np.zeros((3, n))
        normal[:, met] = interaction(scene, moved.take(met), hits.take(met)).ns
        return hits.t, normal

    t, normal = seen(shapes)
    alone = [seen([shape]) for shape in shapes]
    first = np.argmin([each[0] for each in alone], 0)
    np.testing.assert_allclose(t, np.choose(first, [each[0] for each in alone]), rtol=1e-5)
    due = np.where(first, alone[1][1], alone[0][1])
    assert (np.abs(normal - due).max(0) < 1e-2).mean() > 0.99  # not where rays graze
    assert 50 < first.sum() < n - 50


# --- the shape ------------------------------------------------------------------------------------


def look(shape: object, spp: int = 64, **options: object) -> wf.Image:
    camera = wf.Camera.look_at((0, 1, 4), (0, 0, 0), size=(32, 32))
    floor = wf.Rectangle((-3, -1, 3), (6, 0, 0), (0, 0, -6))
    lights = [wf.PointLight((2, 3, 2), 20), wf.Environment(0.3)]
    return wf.render(wf.Scene([shape, floor], lights, camera=camera), spp, **options)


def test_the_distances_of_a_sphere_are_that_sphere() -> None:
    made = wf.SignedDistanceGrid(sphere(97), BOX, material=wf.Diffuse(0.8))
    ball = wf.Sphere((0, 0, 0), 0.7, material=wf.Diffuse(0.8))
    a, b = look(made, seed=1), look(ball, seed=2)
    assert wf.compare(a, b).p_value > 1e-3


def test_glass_in_a_furnace_is_invisible() -> None:
    made = wf.SignedDistanceGrid(torus(25), BOX, smooth=False, material=wf.Dielectric(1.5))
    image = wf.render(wf.Scene(made, [wf.Environment(1.0)]), 4, size=(16, 16), max_bounces=1000)
    np.testing.assert_allclose(image.rgb, 1, atol=0.02)


def test_media_inside_absorb_along_the_chord() -> None:
    fog = wf.Material(wf.Dielectric(1.0), interior=wf.Medium(absorption=1.0))
    camera = wf.Camera.look_at((0, 0, 400), (0, 0, 0), fov=0.001, size=(1, 1))
    scene = wf.Scene(wf.SignedDistanceGrid(cube(9), BOX, material=fog), [wf.Environment(1)], camera=camera)
    np.testing.assert_allclose(wf.render(scene, 4).rgb, np.exp(-1), rtol=1e-4)


def test_transforms_are_those_of_the_values() -> None:
    shape = wf.SignedDistanceGrid(torus(17), BOX)
    np.testing.assert_allclose(shape.bounds, [(-0.85, -0.25, -0.85), (0.85, 0.25, 0.85)], atol=0.02)
    moved = shape.scaled((1, 2, 1)).rotated("x", 90).translated((0, 0, 3))
    np.testing.assert_allclose(moved.bounds, [(-0.85, -0.85, 2.5), (0.85, 0.85, 3.5)], atol=0.03)
    centers, radii = shape.hull()
    assert shape.count == len(centers) == len(radii)
    pictures = [look(shape.scaled(2.0**k).scaled(2.0**-k), 1).rgb for k in (0, 30)]
    np.testing.assert_array_equal(*pictures)


@pytest.mark.parametrize(
    ("values", "transform", "message"),
    [
        (np.zeros((3, 3)), BOX, "values must have shape"),
        (np.zeros((1, 3, 3)), BOX, r"values has shape \(1, 3, 3\); it must have at least 2"),
        (np.full((2, 2, 2), np.nan), BOX, "values.*nan"),
        (np.ones((2, 2, 2)), BOX, "values are from 1 to 1; some must be below 0"),
        (-np.ones((2, 2, 2)), BOX, "values are from -1 to -1; some must be below 0"),
        (sphere(4) * 1e39, BOX, "their size must be at most"),
        (sphere(4), np.zeros((4, 4)), "transform must be an affine matrix"),
        (sphere(4), np.eye(4) * [1e39, 1, 1, 1], "its size must be at most"),
    ],
)
def test_what_is_wrong_is_named(values: np.ndarray, transform: object, message: str) -> None:
    with pytest.raises(wf.SceneError, match=message):
        wf.SignedDistanceGrid(values, transform)


def test_they_cannot_shine() -> None:
    shape = wf.SignedDistanceGrid(sphere(5), BOX, material=wf.Material(wf.Diffuse(0), emission=1))
    with pytest.raises(wf.SceneError, match="a SignedDistanceGrid cannot emit light"):
        wf.render(wf.Scene(shape), 1, size=(8, 8))


def test_grids_of_mitsuba(tmp_path: Path) -> None:
    """From a file and from a dictionary, placed by to_world, and by an instance of a group."""
    values = sphere(6).astype("<f4")
    header = struct.pack("<3sB5i6f", b"VOL", 3, 1, 6, 6, 6, 1, 0, 0, 0, 1, 1, 1)
    (tmp_path / "ball.vol").write_bytes(header + values.tobytes())
    move = np.diag([2.0, 2, 2, 1])
    of_file = {
        "type": "sdfgrid",
        "filename": str(tmp_path / "ball.vol"),
        "to_world": move,
        "normals": "analytic",
    }
    of_array = {"type": "sdfgrid", "grid": values[..., None]}
    group = {"type": "shapegroup", "id": "group", "part": of_array}
    placed = {"type": "instance", "to_world": move, "group": {"type": "ref", "id": "group"}}
    made = {"type": "scene", "a": of_file, "group": group, "b": placed}
    first, second = wf.from_mitsuba(made, strict=True).shapes
    assert (first.smooth, second.smooth) == (False, True)
    for shape in (first, second):
        np.testing.assert_array_equal(shape.values, values)
        np.testing.assert_array_equal(shape.transform, move)
    with pytest.raises(wf.SceneError, match=r"grid has shape \(6, 6, 6\)"):
        wf.from_mitsuba({"type": "scene", "a": {"type": "sdfgrid", "grid": values}}, strict=True)
