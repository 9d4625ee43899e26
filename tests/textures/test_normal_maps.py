"""Normal maps and bump maps: the normals they give, that they gain no light, and every complaint."""

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from inside import (
    Hits,
    Rays,
    compile_scene,
    ensure_valid_reflection,
    interaction,
    intersect,
    make_accelerator,
    mirror_hidden,
    perturb_normals,
)
from significance import Mean, assert_same_images, render, repeat

import wavefront as wf

F4 = np.float32
CORNERS = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], float)
FACES = [[0, 1, 2], [0, 2, 3]]
FLAT = np.array([0.5, 0.5, 1])
TILT = np.array([0.65, 0.425, 1])  # a texel whose normal leans to +x, and a little to -y


def texel(code):
    """An image of one texel."""
    return np.array(code, F4).reshape(1, 1, -1)


def lean(code):
    """The unit normal that a texel says, float64."""
    normal = 2 * np.asarray(code, F4).astype(float) - 1
    return normal / np.linalg.norm(normal)


def normals(shape, normal_map, origin=(0.3, 0.4, 5), direction=(0, 0, -1), n=1):
    """The geometric and the shading normals, (3,) each, where a ray meets a shape with a normal map."""
    shape.material = wf.Material(wf.Diffuse(0.5), normal_map=normal_map)
    scene = wf.Scene(shape, lights=[wf.Environment(1.0)])
    compiled = compile_scene(scene, lambda geometry: make_accelerator(geometry, "numpy"))
    o = np.repeat((np.array(origin) - compiled.center).astype(F4).reshape(3, 1), n, 1)
    d = np.repeat(np.array(direction, F4).reshape(3, 1), n, 1)
    hit = compiled.accelerator.closest(o, d, np.full(n, -1))
    assert (hit.prim >= 0).all()
    rays = SimpleNamespace(origin=o, direction=d)
    surface = interaction(compiled, rays, Hits(hit.t, hit.prim, hit.b1, hit.b2))
    perturb_normals(compiled, surface)
    return surface.ng[:, 0], surface.ns[:, 0]


def square(z=0.0, uvs=CORNERS, **arguments):
    return wf.Mesh(np.column_stack([CORNERS, np.full(4, z)]), FACES, uvs=uvs, **arguments)


# ---- the normals --------------------------------------------------------------------------------


def test_a_normal_map_leans_along_u_and_v():
    ng, ns = normals(square(), wf.NormalMap(texel(TILT)))
    assert ng.tolist() == [0, 0, 1]
    assert ns == pytest.approx(lean(TILT), abs=1e-6)


def test_strength_scales_the_lean():
    n = lean(TILT) * [0.25, 0.25, 1]
    assert normals(square(), wf.NormalMap(texel(TILT), 0.25))[1] == pytest.approx(
        n / np.linalg.norm(n), abs=1e-6
    )


@pytest.mark.parametrize(
    ("matrix", "axes"),
    [
        ([[0, -1], [1, 0]], [[0, 1, 0], [-1, 0, 0]]),  # u runs along +y, v along -x
        ([[-1, 0], [0, 1]], [[-1, 0, 0], [0, 1, 0]]),  # mirrored
        ([[3, 0], [0, 0.1]], [[1, 0, 0], [0, 1, 0]]),  # stretched: directions alone count
    ],
)
def test_the_lean_follows_the_texture_coordinates(matrix, axes):
    """With u, v such that place = matrix · (u, v), the axes of the map lie along its columns."""
    uvs = np.linalg.solve(np.array(matrix, float), CORNERS.T).T
    expected = lean(TILT) @ np.array([*axes, [0, 0, 1]], float)
    assert normals(square(uvs=uvs), wf.NormalMap(texel(TILT)))[1] == pytest.approx(expected, abs=1e-6)
    # and the same when not the mesh but the texture is turned
    transform = np.eye(3)
    transform[:2, :2] = np.linalg.inv(matrix)
    texture = wf.Texture(texel(TILT), srgb=False, transform=transform)
    assert normals(square(), wf.NormalMap(texture))[1] == pytest.approx(expected, abs=1e-6)
    second = wf.Texture(texel(TILT), srgb=False, uv_set=1)
    assert normals(square(uvs1=uvs), wf.NormalMap(second))[1] == pytest.approx(expected, abs=1e-6)


@pytest.mark.parametrize("second", [False, True])
@pytest.mark.parametrize("hand", [1, -1, 0.5, -2])
@pytest.mark.parametrize("along", [[1, 0, 0], [0, 1, 0], [-0.6, 0.8, 0]])
def test_tangents_of_the_mesh_go_before_its_texture_coordinates(along, hand, second):
    """Red leans along the tangent, green along normal × tangent, or against it where w is below 0."""
    given = np.tile([*along, hand], (4, 1))
    mesh = square(normals=[[0, 0, 1]] * 4, uvs1=CORNERS, tangents=given)
    texture = wf.Texture(texel(TILT), srgb=False, uv_set=int(second))
    across = np.cross([0, 0, 1], along) * np.sign(hand)
    expected = lean(TILT) @ np.array([along, across, [0, 0, 1]])
    assert normals(mesh, wf.NormalMap(texture))[1] == pytest.approx(expected, abs=1e-6)


def test_bumps_lie_by_the_texture_coordinates_whatever_the_tangents():
    slope = wf.BumpMap(np.tile(np.linspace(0, 1, 8), (8, 1)), 0.3)
    up = [[0, 0, 1]] * 4
    turned = square(normals=up, tangents=[[0, 1, 0, -1]] * 4)
    assert np.array_equal(normals(turned, slope)[1], normals(square(normals=up), slope)[1])
    assert normals(turned, slope)[1][0] < -0.1


@pytest.mark.parametrize(
    "matrix", [np.diag([-1.0, 1, 1]), np.diag([2, 1, -1.0]), [[0, -1, 0], [3, 0, 0], [0, 0, 1]]]
)
@pytest.mark.parametrize("shared", [False, True])
def test_tangents_move_with_their_mesh(matrix, shared):
    """A mirrored mesh shows the mirrored normal map, shared or as a mesh of its own."""
    along, across = np.array([0.6, 0.8, 0]), np.array([0.8, -0.6, 0])
    mesh = square(normals=[[0, 0, 1]] * 4, tangents=[[*along, -1]] * 4)
    mesh.material = wf.Material(wf.Diffuse(0.5), normal_map=wf.NormalMap(texel(TILT)))
    place = np.eye(4)
    place[:3, :3] = matrix
    other = np.eye(4)
    other[:3, 3] = 50
    shapes = [wf.Instance(mesh, place), wf.Instance(mesh, other)]
    scene = wf.Scene(shapes, lights=[wf.Environment(1.0)])
    compiled = compile_scene(
        scene, lambda geometry: make_accelerator(geometry, "numpy"), most_copies=0 if shared else 1000
    )
    assert (compiled.instances is not None) == shared
    o = (matrix @ np.array([0.5, 0.4, 0]) + np.array([0, 0, 5]) - compiled.center).astype(F4).reshape(3, 1)
    d = np.array([[0], [0], [-1]], F4)
    hits = intersect(compiled, Rays(o, d, np.full(1, -1)))
    surface = interaction(compiled, Rays(o, d, np.full(1, -1)), hits)
    perturb_normals(compiled, surface)
    moved = [np.asarray(matrix) @ axis for axis in (along, across)]
    red = moved[0] / np.linalg.norm(moved[0])
    green = np.cross([0, 0, 1], red)
    green *= np.sign(green @ moved[1])
    front = np.sign(matrix[2][2])  # seen from behind, a normal map is turned round
    expected = front * (lean(TILT) @ np.array([red, green, [0, 0, front]]))
    assert surface.ns[:, 0] == pytest.approx(expected, abs=1e-5)


def test_from_behind_the_normal_map_is_turned_round():
    ng, ns = normals(square(), wf.NormalMap(texel(TILT)), origin=(0.3, 0.4, -5), direction=(0, 0, 1))
    assert ng.tolist() == [0, 0, -1]
    assert ns == pytest.approx(-lean(TILT), abs=1e-6)


@pytest.mark.parametrize(("x", "y"), [(0.25, 0.6), (-0.5, -0.3), (0.0, 0.0)])
def test_a_normal_map_on_a_sphere(x, y):
    _, ns = normals(wf.Sphere((0, 0, 0), 2), wf.NormalMap(texel(TILT)), (2 * x, 2 * y, 9))
    z = np.array([x, y, np.sqrt(1 - x * x - y * y)])
    east = np.cross([0, 1, 0], z)
    east /= np.linalg.norm(east)
    expected = lean(TILT) @ np.stack([east, np.cross(z, east), z])
    assert ns == pytest.approx(expected, abs=1e-5)


def test_tangents_are_shared_around_a_smooth_vertex():
    """On a smooth cylinder the map leans along the ring, not along each facet."""
    k = np.arange(9)
    angle = k * np.pi / 4
    ring = np.stack([np.sin(angle), np.zeros(9), np.cos(angle)], 1)
    vertices = np.vstack([ring, ring]) + np.repeat([[0, -1, 0], [0, 1, 0]], 9, 0)
    uvs = np.vstack([np.stack([k / 8, np.zeros(9)], 1), np.stack([k / 8, np.ones(9)], 1)])
    i = np.arange(8)
    faces = np.vstack([np.stack([i, i + 1, i + 10], 1), np.stack([i, i + 10, i + 9], 1)])
    tube = wf.Mesh(vertices, faces, uvs=uvs, normals=np.vstack([ring, ring]))
    flat = wf.Mesh(vertices, faces, uvs=uvs)
    ray = (3.0, 0.1, 3.02), (-(0.5**0.5), 0, -(0.5**0.5))  # close to the edge at 45°
    normal_map = wf.NormalMap(texel([0.6, 0.5, 1]))
    (_, smooth), (_, edgy) = normals(tube, normal_map, *ray), normals(flat, normal_map, *ray)
    lean_angle = np.arctan2(0.2, 1)
    assert np.arctan2(smooth[0], smooth[2]) == pytest.approx(np.pi / 4 + lean_angle, abs=0.03)
    assert np.arctan2(edgy[0], edgy[2]) == pytest.approx(np.pi / 8 + lean_angle, abs=0.001)


def test_mirrored_halves_keep_their_own_tangents():
    """Where u runs both ways from a seam, the tangents of the halves do not cancel."""
    vertices = [[-1, 0, 0], [0, 0, 0], [1, 0, 0], [-1, 1, 0], [0, 1, 0], [1, 1, 0]]
    uvs = [[1, 0], [0, 0], [1, 0], [1, 1], [0, 1], [1, 1]]
    faces = [[0, 1, 4], [0, 4, 3], [1, 2, 5], [1, 5, 4]]
    both = wf.Mesh(vertices, faces, uvs=uvs, normals=[[0, 0, 1]] * 6)
    for x in (-0.6, -0.01, 0.01, 0.6):
        _, ns = normals(both, wf.NormalMap(texel([0.65, 0.5, 1])), (x, 0.3, 5))
        assert np.sign(ns[0]) == np.sign(x)
        assert abs(ns[0]) == pytest.approx(0.3 / np.hypot(0.3, 1), abs=1e-5)


@pytest.mark.parametrize("wrap", ["repeat", "mirror", "clamp"])
@pytest.mark.parametrize("place", [(0.3, 0.4), (0.7, 0.15)])
def test_a_bump_map_is_the_surface_that_it_shows(wrap, place):
    """The normal is that of z = height · h(x, y); here h is a ramp, by bilinear texels exactly."""
    n = 16
    across, up = (np.arange(n) + 0.5) / n, ((np.arange(n) + 0.5) / n)[::-1]
    ramp = 0.3 * across[None, :] + 0.5 * up[:, None]
    place = (*place, 5)
    for height in (1.0, -0.5):
        expected = np.array([-0.3 * height, -0.5 * height, 1])
        expected /= np.linalg.norm(expected)
        normal_map = wf.BumpMap(wf.Texture(ramp, srgb=False, channel=0, wrap=wrap), height)
        assert normals(square(), normal_map, place)[1] == pytest.approx(expected, abs=1e-4)
    # twice as large a surface under the same picture is half as steep
    large = wf.Mesh(np.column_stack([2 * CORNERS, np.zeros(4)]), FACES, uvs=CORNERS)
    _, ns = normals(large, wf.BumpMap(ramp), (2 * place[0], 2 * place[1], 5))
    assert ns == pytest.approx(np.array([-0.15, -0.25, 1]) / np.sqrt(1 + 0.15**2 + 0.25**2), abs=1e-4)
    # and so it is where the texture is turned: u' = v, v' = 1 - u
    turned = wf.Texture(ramp, srgb=False, channel=0, transform=[[0, 1, 0], [-1, 0, 1], [0, 0, 1]])
    _, ns = normals(square(), wf.BumpMap(turned), place)
    assert ns == pytest.approx(np.array([0.5, -0.3, 1]) / np.sqrt(1.34), abs=1e-4)


def test_a_bump_map_on_a_sphere():
    """Height that rises with latitude leans the normals down: by height / (π · radius)."""
    n = 64
    ramp = np.repeat(((np.arange(n) + 0.5) / n)[::-1, None], n, 1)
    _, ns = normals(wf.Sphere((0, 0, 0), 2), wf.BumpMap(ramp, 0.5), (0, 0, 9))
    slope = 0.5 / (np.pi * 2)
    assert ns == pytest.approx(np.array([0, -slope, 1]) / np.hypot(1, slope), abs=1e-4)


@settings(max_examples=60)
@given(st.integers(0, 2**32 - 1), st.sampled_from(["repeat", "mirror", "clamp"]))
def test_the_gradient_is_the_slope_of_the_lookup(seed, wrap):
    rng = np.random.default_rng(seed)
    image = rng.random((5, 7), F4)
    matrix = np.eye(3)
    matrix[:2] = rng.uniform(-2, 2, (2, 3))
    texture = wf.Texture(image, channel=0, wrap=wrap, transform=matrix)
    points = rng.uniform(-1, 1, (2, 40)).astype(F4)
    found = texture.gradient(points)
    # the mean slope over one texel along each axis of the image, by the lookup itself
    axes = np.linalg.inv(matrix[:2, :2]) / [7, 5]
    along = [
        texture.lookup((points + step[:, None] / 2).astype(F4))
        - texture.lookup((points - step[:, None] / 2).astype(F4))
        for step in axes.T
    ]
    expected = (matrix[:2, :2] * [[7], [5]]).T @ np.stack(along)
    u, v = matrix[:2] @ np.vstack([points, np.ones(40)])
    # where the lookup is mirrored or ends within the texel, the two may differ
    inner = (np.abs(u - np.round(u)) > 0.6 / 7) & (np.abs(v - np.round(v)) > 0.6 / 5)
    inner |= wrap == "repeat"
    size = np.abs(matrix[:2, :2]).max() * 7
    assert found[:, inner] == pytest.approx(expected[:, inner], abs=2e-4 * size)


# ---- a flat normal map is none ----------------------------------------------------------------------


def hall(normal_map=None, seen=(2.0, 1.4, 3.0)):
    """A smooth ball, an analytic one and a floor, with metal, glass and matte materials."""
    materials = [wf.Conductor.named("gold", roughness=0.3), wf.Dielectric(1.5), wf.OrenNayar(0.7)]
    if normal_map is not None:
        materials = [wf.Material(material, normal_map=normal_map) for material in materials]
    turn = np.linspace(0, 2 * np.pi, 17)
    up = np.linspace(0.02, np.pi - 0.02, 9)
    a, b = np.meshgrid(turn, up)
    points = np.stack([np.sin(a) * np.sin(b), np.cos(b), np.cos(a) * np.sin(b)], -1).reshape(-1, 3)
    i, j = (k.ravel() for k in np.meshgrid(np.arange(16), np.arange(8)))
    p = j * 17 + i
    faces = np.vstack([np.stack([p, p + 17, p + 18], 1), np.stack([p, p + 18, p + 1], 1)])
    uvs = np.stack([a / (2 * np.pi), 1 - b / np.pi], -1).reshape(-1, 2)
    ball = wf.Mesh(points, faces, normals=points, uvs=uvs, material=materials[0])
    glass = wf.Sphere((2, 0, 0), 1, material=materials[1])
    floor = wf.Rectangle((-3, -1, 3), (9, 0, 0), (0, 0, -6), material=materials[2])
    camera = wf.Camera.look_at(seen, (1, 0, 0), fov=60, size=(24, 16))
    return wf.Scene([ball, glass, floor], [wf.Environment(1.0), wf.PointLight((1, 3, 2), 20)], camera)


@pytest.mark.parametrize(
    "normal_map",
    [
        wf.NormalMap(np.broadcast_to(FLAT.astype(F4), (4, 4, 3))),
        wf.NormalMap(texel(TILT), strength=0),
        wf.BumpMap(np.full((4, 4), 0.7, F4), 3.0),
        wf.BumpMap(np.random.default_rng(0).random((4, 4), F4), 0.0),
    ],
    ids=["normals", "strength 0", "heights", "height 0"],
)
def test_a_flat_normal_map_changes_no_bit(normal_map):
    plain = render(hall(), 4).rgb
    assert np.array_equal(render(hall(normal_map), 4).rgb, plain)


def test_a_flat_8_bit_normal_map_changes_little():
    # (128, 128, 255) leans by 0.3°
    plain = render(hall(), 64).rgb
    codes = np.broadcast_to(np.uint8([128, 128, 255]), (4, 4, 3))
    found = render(hall(wf.NormalMap(codes)), 64).rgb
    assert not np.array_equal(found, plain)
    assert found.mean((0, 1)) == pytest.approx(plain.mean((0, 1)), rel=2e-3)


def test_a_face_without_area_in_its_coordinates_keeps_its_normal():
    same_uv = square(uvs=np.full((4, 2), 0.5))
    assert normals(same_uv, wf.NormalMap(texel(TILT)))[1].tolist() == [0, 0, 1]
    ramp = np.random.default_rng(0).random((4, 4))
    assert normals(same_uv, wf.BumpMap(ramp))[1].tolist() == [0, 0, 1]


def test_wave_size_and_workers_change_no_bit():
    normal_map = wf.NormalMap(np.random.default_rng(0).random((16, 16, 3), F4) * [1, 1, 0.5] + [0, 0, 0.5])
    scene = hall(normal_map)
    whole = render(scene, 4).rgb
    assert np.array_equal(whole, render(scene, 4, workers=3).rgb)
    bumpy = hall(wf.BumpMap(np.random.default_rng(0).random((16, 16), F4), 0.1))
    one = normals(bumpy.shapes[1], bumpy.shapes[1].material.normal_map, (2.3, 0.2, 5))[1]
    many = normals(bumpy.shapes[1], bumpy.shapes[1].material.normal_map, (2.3, 0.2, 5), n=1000)[1]
    assert np.array_equal(one, many)


# ---- light ----------------------------------------------------------------------------------------

ROUGH = np.random.default_rng(1).random((64, 64, 3), F4)  # normals of every direction
TURNED = np.concatenate([ROUGH[..., :2], 0.5 + ROUGH[..., 2:] / 2], 2)
STRONG = wf.NormalMap(TURNED, 2.0)
STEEP = wf.BumpMap(ROUGH[..., 0], 0.2)


def furnace(material, angle=0.0, size=(16, 16)):
    """The radiance of a square in even light of radiance 1, seen from an angle to its normal."""
    eye = np.array([0.5 + 3 * np.sin(angle), 0.5, 3 * np.cos(angle)])
    height = 0.5 * min(1.0, np.cos(angle))
    camera = wf.Camera.orthographic(eye, (0.5, 0.5, 0), height=height, size=size)
    scene = wf.Scene(square(material=material), [wf.Environment(1.0)], camera)
    return render(scene, 64, integrator="naive", max_bounces=1).rgb


MATERIALS = [
    wf.Diffuse(1.0),
    wf.OrenNayar(1.0, 0.5, energy_preserving=True),
    wf.Conductor.named("silver", roughness=0.3),
    wf.Principled(1.0, metallic=0.3, roughness=0.4, clearcoat=0.5),
    wf.Dielectric(1.5, 0.3),
    wf.ThinDielectric(1.5),
]


@pytest.mark.parametrize("normal_map", [STRONG, STEEP], ids=["normals", "heights"])
@pytest.mark.parametrize("material", MATERIALS, ids=lambda m: type(m).__name__)
@pytest.mark.parametrize("angle", [0.0, 1.0, 1.5])
def test_a_white_furnace_gains_nothing(material, normal_map, angle):
    mean = Mean.of(
        furnace(wf.Material(material, normal_map=normal_map), angle).reshape(-1, 3).mean(1, dtype=np.float64)
    )
    assert mean.error < 0.01
    assert mean.value - 4 * mean.error <= 1 + 1e-5
    assert mean.value > 0.4  # and is not black


@pytest.mark.parametrize("folds", [False, True])
def test_a_matte_tilted_patch_loses_what_lies_below_unless_it_is_folded(folds):
    """A normal that leans by θ sends (1 - cosθ)/2 of its light to the side below the surface."""
    for code in ([0.65, 0.5, 1], [0.5, 0.85, 1]):
        kept = 1 if folds else (1 + lean(code)[2]) / 2
        lean_map = wf.NormalMap(texel(code))
        lean_map.folds_light = folds
        image = furnace(wf.Material(wf.Diffuse(1.0), normal_map=lean_map))
        assert image.mean() == pytest.approx(kept, abs=0.005)


@pytest.mark.parametrize("angle", [0.0, 0.8, 1.3, 1.55])
def test_a_mirror_has_no_black_facets(angle):
    """However its normals lean, every ray finds the light."""
    for normal_map in (STRONG, STEEP):
        assert furnace(wf.Material(wf.Mirror(1.0), normal_map=normal_map), angle) == pytest.approx(
            1.0, rel=1e-5
        )


@pytest.mark.filterwarnings("ignore:the picture is black")
def test_light_does_not_leak_from_behind():
    area_light = square(z=-0.5, emission=5.0)
    camera = wf.Camera.orthographic((0.5, 0.5, 3), (0.5, 0.5, 0), height=0.9, size=(16, 16))
    below = wf.PointLight((0.5, 0.5, -0.2), 5)
    for material in (wf.Diffuse(1.0), wf.Conductor.named("gold", 0.4)):
        patch = square(material=wf.Material(material, normal_map=STRONG))
        assert render(wf.Scene([patch, area_light], [below], camera), 32).rgb.max() == 0


def directions(n, seed):
    v = np.random.default_rng(seed).normal(size=(3, n))
    return (v / np.linalg.norm(v, axis=0)).astype(F4)


def on_side(wo, ng, least):
    """Turn wo to the side of ng, and some of them to cosines down to `least`."""
    cos = (wo * ng).sum(0)
    along = (wo - ng * cos) / np.sqrt(1 - cos**2)
    small = least ** np.random.default_rng(5).random(len(cos))
    cos = np.where(np.arange(len(cos)) % 3 == 0, small, np.abs(cos))
    return (along * np.sqrt(1 - cos**2) + ng * cos).astype(F4)


def test_upright_normals_mirror_to_above_the_surface():
    n = 30_000
    ng, perturbed = directions(n, 0), directions(n, 1)
    wo = on_side(directions(n, 2), ng, 1e-7)
    ns = ensure_valid_reflection(wo, ng, ng.copy(), perturbed.copy())
    assert ns.dtype == F4
    assert np.linalg.norm(ns, axis=0) == pytest.approx(np.ones(n), abs=1e-4)
    assert ((ns * wo).sum(0) > 0).all()
    ns = ns.astype(float)
    mirrored = 2 * (ns * wo).sum(0) * ns - wo
    cos = (ng * wo).sum(0)
    clear = cos > 0.01  # of rounding
    assert clear.sum() > n / 2
    assert ((mirrored * ng).sum(0) >= np.minimum(0.9 * cos, 0.01) * 0.9)[clear].all()


@pytest.mark.parametrize(("cosine", "least", "lean"), [(0.3, 0.01, 15), (0.005, 0.9 * 0.005, 0.1)])
def test_reflections_are_raised_to_a_cosine_that_is_shallower(cosine, least, lean):
    """To 0.01 with the surface, or to 0.9 of that of wo, before the direction is normalized."""
    wo, angle = np.array([[np.sqrt(1 - cosine**2)], [0], [cosine]]), np.radians(-lean)
    perturbed, ng = np.array([[np.sin(angle)], [0], [np.cos(angle)]]), np.array([[0.0], [0], [1]])
    low = 2 * (perturbed * wo).sum() * perturbed - wo
    assert low[2, 0] < least
    size = np.sqrt(low[0, 0] ** 2 + least**2)
    normal = ensure_valid_reflection(wo, ng, ng.copy(), perturbed)
    reflected = 2 * (normal * wo).sum() * normal - wo
    assert reflected[2, 0] == pytest.approx(least / size, rel=1e-4)


def test_a_faint_normal_map_changes_little_where_normals_are_smooth():
    """Interpolated normals may mirror to below their facet; a normal map is not to blame for that."""
    n = 10_000
    ng = directions(n, 0)
    smooth = ng + 0.5 * directions(n, 1)
    smooth = (smooth / np.linalg.norm(smooth, axis=0)).astype(F4)
    wo = on_side(directions(n, 2), ng, 1e-2)
    seen = (wo * smooth).sum(0) > 0.05
    below = 2 * (wo * smooth).sum(0) * (smooth * ng).sum(0) - (wo * ng).sum(0) < 0
    assert (seen & below).sum() > 300
    perturbed = smooth + F4(1e-3) * directions(n, 3)
    perturbed = (perturbed / np.linalg.norm(perturbed, axis=0)).astype(F4)
    ns = ensure_valid_reflection(wo, ng, smooth, perturbed.copy())
    assert np.abs(ns - smooth)[:, seen].max() < 0.03


def test_every_integrator_sees_the_same_normal_map():
    scene = hall(wf.NormalMap(texel(TILT)), seen=(1, 3, 2))
    scene = wf.Scene(scene.shapes[2], [wf.Environment((0.5, 1.0, 2.0))], scene.camera)
    means = [
        render(scene, 256, integrator=name, max_bounces=1).rgb.mean((0, 1))
        for name in ("naive", "direct_simple", "direct_mis", "full")
    ]
    for mean in means[1:]:
        assert mean == pytest.approx(means[0], rel=0.01)


# ---- as Mitsuba has it ----------------------------------------------------------------------------


def shadowing(image):
    """A normal map that shadows grazing light, and whose hidden normals are mirrored."""
    normal_map = wf.NormalMap(image)
    normal_map.shadows_grazing = normal_map.mirrors_hidden = True
    normal_map.folds_light = False
    return normal_map


def test_hidden_normals_are_mirrored_at_the_smooth_one():
    n = 10_000
    smooth, perturbed = directions(n, 0), directions(n, 1)
    wo = on_side(directions(n, 2), smooth, 1e-2)
    perturbed *= np.sign((perturbed * smooth).sum(0))
    found = mirror_hidden(wo, smooth, perturbed.copy())
    hidden = (wo * perturbed).sum(0) <= 0
    mirrored = 2 * (perturbed * smooth).sum(0) * smooth - perturbed
    expected = np.where(hidden, mirrored, perturbed)
    assert n / 8 < hidden.sum() < n / 2
    clear = (wo * expected).sum(0) > 1e-3
    assert clear.mean() > 0.99
    assert found[:, clear] == pytest.approx(expected[:, clear], abs=1e-6)
    assert ((found * wo).sum(0) > 0).all()


@pytest.mark.parametrize("angle", [-1.4, -0.7, 0.0, 0.5, 1.0, 1.5])
def test_grazing_light_is_shadowed(angle):
    """The radiance of a tilted matte patch under the sun, beside that of the same map without shadows."""
    code = [0.75, 0.5, 1]  # tan θ is 1/2 here
    camera = wf.Camera.orthographic((0.5, 0.5, 3), (0.5, 0.5, 0), height=0.9, size=(4, 4))
    sun = wf.DirectionalLight((-np.sin(angle), 0, -np.cos(angle)), 2.0)
    seen, plain = [], wf.NormalMap(texel(code))
    plain.folds_light = False
    for normal_map in (shadowing(texel(code)), plain, None):
        patch = square(material=wf.Material(wf.Diffuse(0.5), normal_map=normal_map))
        beside = wf.Sphere(
            (9, 9, 0), 1, material=wf.Material(wf.Diffuse(0.5), normal_map=shadowing(texel(code)))
        )
        seen.append(render(wf.Scene([patch, beside], [sun], camera), 1, max_bounces=1).rgb.mean())
    left = 2 / (1 + np.sqrt(1 + 0.125 * 0.25 * np.tan(angle) ** 2))
    tilted = max(np.cos(angle) + 0.5 * np.sin(angle), 0) / np.sqrt(1.25)
    due = np.array([tilted * left, tilted, np.cos(angle)]) / np.pi
    assert seen == pytest.approx(due, rel=2e-5, abs=1e-7)


def beside_a_wall(bsdf, *lights, emission=None):
    """A mapped floor, all of whose light comes from a low wall."""
    material = wf.Material(bsdf, normal_map=shadowing(TURNED))
    boards = [
        wf.Rectangle((-2, 0, 2), (4, 0, 0), (0, 0, -4), material=material),
        wf.Rectangle((-2, 0, -2), (4, 0, 0), (0, 1, 0), material=wf.Diffuse(0.9), emission=emission),
    ]
    camera = wf.Camera.look_at((0, 3, 0), (0, 0, 0), up=(0, 0, -1), fov=40, size=(16, 16))
    return wf.Scene(boards, lights, camera)


WAYS = [({"reuse": True}, 32), pytest.param({"guide": True}, 32, marks=pytest.mark.slow), ({}, 0)]


@pytest.mark.parametrize("bsdf", [wf.Diffuse(1.0), wf.Conductor.named("silver", roughness=0.3)])
@pytest.mark.parametrize(("options", "spp"), WAYS, ids=["reuse", "guide", "emission"])
@pytest.mark.first(3)
def test_light_from_a_wall_is_shadowed_however_it_is_found(bsdf, options, spp):
    """The wall is lit by the sun; or it shines, so that light samples and BSDF samples find it."""
    if options:
        scene, bounces = beside_a_wall(bsdf, wf.DirectionalLight((0, 0, -1), 1)), 2
        expected = repeat(scene, 64, runs=8, reuse=False, max_bounces=bounces, first_seed=100)
    else:
        scene, bounces, spp = beside_a_wall(bsdf, emission=1.0), 1, 16
        expected = repeat(scene, 128, runs=8, integrator="naive", max_bounces=bounces, first_seed=100)
    assert_same_images(repeat(scene, spp, runs=8, max_bounces=bounces, **options), expected, 0.02)


# ---- complaints -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: wf.NormalMap(np.zeros((2, 2))), "NormalMap: .* gives numbers; it must give three channels"),
        (lambda: wf.NormalMap(wf.Texture(np.zeros((2, 2, 3)), channel=0)), "gives numbers"),
        (
            lambda: wf.NormalMap(wf.Texture(np.zeros((2, 2, 3), np.uint8))),
            "NormalMap: .* is decoded from sRGB; pass srgb=False",
        ),
        (lambda: wf.BumpMap(wf.Texture(np.zeros((2, 2), np.uint8), channel=0)), "BumpMap: .* from sRGB"),
        (lambda: wf.BumpMap(wf.Texture(np.zeros((2, 2, 3)))), "BumpMap: .* gives colors"),
        (lambda: wf.NormalMap(texel(FLAT), np.inf), "NormalMap strength is inf; it must be finite"),
        (lambda: wf.BumpMap(texel(FLAT), "high"), "BumpMap height must be a number, got 'high'"),
        (
            lambda: wf.NormalMap(wf.Texture(texel(FLAT), transform=np.diag([0, 1, 1]))),
            "NormalMap: the transform of .* is singular; it must be invertible",
        ),
        (
            lambda: wf.Material(wf.Diffuse(0.5), normal_map=wf.Texture(texel(FLAT))),
            "Material normal_map must be a NormalMap or a BumpMap, got <Texture",
        ),
        (
            lambda: wf.Mix(wf.Diffuse(0.5), wf.Material(wf.Mirror(), normal_map=STEEP)),
            "Mix second must be a Bsdf such as",
        ),
        (lambda: wf.NormalMap(np.ones((1, 1, 3)), 1e10), r"NormalMap strength is 1\d+\.0"),
        (lambda: wf.BumpMap(np.ones((1, 1)), -1e39), r"BumpMap height is -1e\+39"),
        (lambda: square(tangents=[[1, 0, 0, 1]] * 4), "mesh: has tangents without normals"),
        (
            lambda: square(normals=[[0, 0, 1]] * 4, tangents=[[1, 0, 0]] * 4),
            r"mesh: tangents must have shape \(n, 4\), got \(4, 3\)",
        ),
    ],
)
def test_complaints(make, message):
    with pytest.raises(wf.SceneError, match=message):
        make()


def test_a_mesh_without_coordinates_is_named():
    bare = wf.Mesh(np.column_stack([CORNERS, np.zeros(4)]), FACES, name="bare")
    with pytest.warns(UserWarning, match=r"1 mesh lacks the texture coordinates .* first: 'bare'") as found:
        assert normals(bare, wf.NormalMap(texel(TILT)))[1].tolist() == [0, 0, 1]
    assert len(found) == 1


def test_maps_show_their_image():
    assert repr(STRONG).startswith("NormalMap(<Texture 'array': 64 × 64>")
    assert repr(STEEP).startswith("BumpMap(")
