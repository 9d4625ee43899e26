"""The edge of the shadow on smooth meshes is that of the round surface, and no light gets through them."""

import numpy as np
import pytest
import trimesh
from inside import (
    MEMBERS,
    FirstPoints,
    NumpyAccelerator,
    Rays,
    ShadowTerminator,
    SharedPoints,
    attenuate,
    compile_scene,
    connect,
    heights_of,
    highest,
    interaction,
    intersect,
    normalize,
    shading,
)

import wavefront as wf

SUN = wf.DirectionalLight((-1, -0.3, -0.2), 3.0)
BALL = trimesh.creation.icosphere(2, 1.0)
CAMERA = wf.Camera.orthographic((0, 0, 5), (0, 0, 0), (0, 1, 0), height=2.2, size=(96, 96))
FAST = {"spp": 4, "progress": False, "workers": 1, "branches": 1, "reuse": False}


def ball(material=None, normals=BALL.vertices):
    return wf.Mesh(BALL.vertices, BALL.faces, normals=normals, material=material or wf.Diffuse(0.8))


def edge(shape, **settings):
    """Return the column at which each row in the middle begins to be lit."""
    image = wf.render(wf.Scene([shape], [SUN], CAMERA), **FAST, **settings)
    return np.array([np.argmax(row) for row in image.rgb[14:80, :, 0] > 0.02])


@pytest.mark.parametrize("accel", ["numpy", "embree"])
def test_the_edge_is_that_of_a_sphere(accel) -> None:
    if accel == "embree":
        pytest.importorskip("embreex")
    assert np.abs(edge(ball(), accel=accel) - edge(wf.Sphere((0, 0, 0), 1))).max() <= 1
    assert np.abs(edge(ball(normals=None)) - edge(wf.Sphere((0, 0, 0), 1))).max() > 3


@pytest.mark.parametrize("mirror", [1, -1])
def test_instances_have_it_as_meshes_do(mirror) -> None:
    """Also mirrored and stretched ones, of which the mesh holds the vertices and normals of the result."""
    matrix = np.diag([mirror * 1.5, 1.0, 0.7, 1.0])
    placed = BALL.vertices * np.diag(matrix)[:3]
    faces = BALL.faces if mirror > 0 else BALL.faces[:, ::-1]
    mesh = wf.Mesh(placed, faces, normals=BALL.vertices / np.diag(matrix)[:3], material=wf.Diffuse(0.8))
    one, two = (
        wf.render(wf.Scene(shapes, [SUN], CAMERA), **FAST).rgb[..., 0]
        for shapes in ([mesh], [wf.Instance(ball(), matrix)])
    )
    assert np.abs(one - two).mean() < 1e-3
    assert ((one > 0.02) != (two > 0.02)).mean() < 2e-3


def test_rays_start_at_one_place_whatever_else_is_in_the_wave() -> None:
    """Where other rays cross their surfaces, all origins are computed anew."""
    camera = wf.Camera.orthographic((0, 0, 5), (0, 0, 0), (0, 1, 0), height=2.2, size=(16, 16))
    sheet = wf.Rectangle((-2, -2, 2), (2, 0, 0), (0, 4, 0), material=wf.ThinDielectric(1.5))
    scene = wf.Scene([ball(), sheet], [SUN, wf.Environment(1.0)], camera)
    one, many = (wf.render(scene, **FAST, accel="numpy", wave_size=size).rgb for size in (23, 4096))
    assert np.array_equal(one, many)


def test_a_white_ball_in_a_white_sky_is_white() -> None:
    """No light is lost where normals disagree: before, about one in 1 000."""
    white = ball(wf.Diffuse(1.0))
    image = wf.render(wf.Scene([white], [wf.Environment(1)], CAMERA), max_bounces=30, **FAST)
    np.testing.assert_allclose(image.rgb, 1, rtol=1e-5)


@pytest.mark.filterwarnings("ignore:the picture is black")
@pytest.mark.parametrize("thickness", [1.0, 0.02])
def test_no_light_gets_through(thickness) -> None:
    """Of a lamp inside of a box, or a thin case, whose normals are as round as can be."""
    box = trimesh.creation.box((1, thickness, 1))
    outwards = np.sign(box.vertices)[box.faces].reshape(-1, 3)
    normals = outwards + np.repeat(box.face_normals, 3, 0) * 0.45  # 44.3° from that of the face
    faces = np.arange(len(normals)).reshape(-1, 3)
    case = wf.Mesh(box.vertices[box.faces].reshape(-1, 3), faces, normals=normals, material=wf.Diffuse(0.8))
    lamp = wf.Sphere((0, 0, 0), 0.3 * thickness, emission=50)
    camera = wf.Camera.look_at((2, 1.5, 3), (0, 0, 0), fov=35, size=(48, 48))
    far = wf.PointLight((0, 0, -9), 1e-9)
    for shapes in ([case, lamp], [wf.Instance(case, np.diag([-1.0, 1, 1, 1])), lamp]):
        image = wf.render(wf.Scene(shapes, [far], camera), **{**FAST, "spp": 16})
        assert image.rgb.max() < 1e-6


@pytest.mark.parametrize("degrees", [44.0, 46.0])
def test_boxes_are_not_round(degrees) -> None:
    """The least that is: normals of a box lean by 54.7 degrees."""
    lean = np.tan(np.radians(degrees))
    roof = [[1, 0, 0], [-1, 1, 0], [-1, -1, 0]]
    mesh = wf.Mesh(roof, [[0, 1, 2]], normals=[[lean, 0, 1], [0, 0, 1], [0, 0, 1]])
    assert (compiled(mesh).program.find(ShadowTerminator) is not None) == (degrees < 45)
    box = trimesh.creation.box((1, 1, 1))
    cube = wf.Mesh(box.vertices, box.faces, normals=box.vertices)
    assert compiled(cube).program.find(ShadowTerminator) is None


def compiled(shape):
    return compile_scene(wf.Scene([shape], [SUN]), NumpyAccelerator)


def test_what_it_is_for() -> None:
    """Opaque triangles of which at least one normal differs from that of the triangle, however little."""
    flat = np.array([[0, 0, 1]] * 3)
    bent = flat + np.array([[1e-6, 0, 0], [0, 0, 0], [0, 0, 0]])
    corners, faces = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]]), np.array([[0, 1, 2]])
    for normals, found in ((flat, False), (bent, True)):
        program = compiled(wf.Mesh(corners, faces, normals=normals)).program
        assert (program.find(ShadowTerminator) is not None) == found
    glass = wf.Mesh(corners, faces, normals=bent, material=wf.Dielectric(1.5))
    assert compiled(glass).program.find(ShadowTerminator) is None


def test_flat_neighbors_and_hollows_keep_their_bits() -> None:
    """Beside a smooth ball far away; and where the round surface is below the triangles."""
    floor = wf.Rectangle((-1, 0, 1), (2, 0, 0), (0, 0, -2), material=wf.Diffuse(0.6))
    far = wf.Mesh(BALL.vertices * 0.01 + (50, 0, 0), BALL.faces, normals=BALL.vertices)
    rough = wf.Mesh(BALL.vertices * 0.01 + (50, 0, 0), BALL.faces)
    camera = wf.Camera.look_at((0, 2, 3), (0, 0, 0), size=(24, 24))
    light = [wf.PointLight((0.2, 1, 0.1), 5)]
    one, two = (wf.render(wf.Scene([floor, each], light, camera), **FAST).rgb for each in (far, rough))
    np.testing.assert_array_equal(one, two)
    inside = wf.Mesh(BALL.vertices, BALL.faces[:, ::-1], normals=-BALL.vertices, material=wf.Diffuse(0.5))
    scene = wf.Scene(
        [inside], [wf.PointLight((0.2, 0.1, 0), 0.5)], wf.Camera.look_at((0, 0, 0), (0, 0, -1), size=(24, 24))
    )
    program = compiled(inside).program.find(ShadowTerminator)
    assert program is not None
    assert (program.heights >= 0).all()
    assert wf.render(scene, **FAST).rgb.min() > 0


def test_heights_are_above_the_planes_of_vertices() -> None:
    """By the formula: (v_j - v_i)·n_i, 0 for a triangle with its own normal."""
    corners = np.array([[[0, 0, 0], [2, 0, 0], [0, 3, 0]]], np.float32)
    ng = np.array([[0], [0], [1]], np.float32)
    tilted = np.array([[0.6], [0], [0.8]], np.float32)
    heights = heights_of(corners, (tilted, ng, ng), ng)
    np.testing.assert_allclose(heights[:, 0], [1.2, 0, 0, 0, 0, 0])
    assert not heights_of(corners, (ng, ng, ng), ng).any()
    for cosine, some in ((0.708, True), (0.706, False)):  # of the normal that leans most
        leaning = np.array([[np.sqrt(1 - cosine**2)], [0], [cosine]], np.float32)
        assert heights_of(corners, (leaning, ng, ng), ng).any() == some


def bent_triangle(material):
    """A triangle at z = 0 whose normals lean by 30 degrees to where it ends in a point."""
    corners = np.array([[1.0, 0, 0], [-0.5, 0.8, 0], [-0.5, -0.8, 0]])
    return wf.Mesh(corners, [[0, 1, 2]], normals=np.tile((0.5, 0, 0.75**0.5), (3, 1)), material=material)


def seen_from_above(scene, rng):
    """Points of the triangle, ready to be shaded."""
    point = rng.uniform(-0.4, 0.4, (2, MEMBERS)).astype(np.float32)
    away = np.stack([*point, np.full(MEMBERS, 2, np.float32)]) - scene.center[:, None].astype(np.float32)
    down = np.repeat(np.array([[0], [0], [-1]], np.float32), MEMBERS, 1)
    rays = Rays(away, down, np.full(MEMBERS, -1))
    return shading(scene, interaction(scene, rays, intersect(scene, rays)))


@pytest.mark.parametrize("material", [wf.Diffuse(0.7), wf.Plastic(0.5, roughness=0.3)])
def test_shared_points_below_the_triangle_are_seen_only_past_it(material) -> None:
    """A connection has the value that a path of its own has, and its ray meets the triangle."""
    scene, rng = compiled(bent_triangle(material)), np.random.default_rng(1)
    lit = seen_from_above(scene, rng).lit()
    grid = np.arange(MEMBERS)[:, None]
    first = FirstPoints.of(lit, None, grid)
    assert first is not None
    dives = {True: 0, False: 0}
    for x, y in [(0.4, 0), (0.2, 0.1), (3, 0), (3, 2)]:
        at = np.array([[x], [y], [-0.04]], np.float32) - scene.center[:, None].astype(np.float32)
        toward = lit.start.mean(1)[:, None] - at
        ng, zero = toward / np.linalg.norm(toward), np.zeros(1, np.intp)
        target = SharedPoints(zero, zero, at, np.zeros(1, np.float32), ng, ng, np.ones((3, 1), np.float32))
        attenuate(scene, [found := connect(scene, first, target, np.array([True]), MEMBERS - 1)])
        wi, distance = normalize(at - lit.start), np.linalg.norm(at - lit.start, axis=0)
        local = lit.frame.to_local(wi)
        f = highest(lit.evaluate(local)[0] * lit.cosines(local, wi)[0])
        seen = ~scene.accelerator.occluded(lit.start, wi, distance * 0.999, np.full(MEMBERS, -1))
        np.testing.assert_array_equal((found.geometry[:, 0] > 0)[:-1], (seen & (f > 0))[:-1])
        np.testing.assert_allclose(highest(found.f[..., 0]), f, rtol=1e-4)
        for each in (True, False):
            dives[each] += np.count_nonzero((f > 0) & (seen == each))
    assert min(dives.values()) > 5


@pytest.mark.filterwarnings("ignore:the picture is")
@pytest.mark.parametrize("mirror", ["the triangle", "what is behind it"])
def test_paths_from_lights_do_not_find_what_goes_below_triangles(mirror) -> None:
    """All light here goes below a triangle: paths from the camera find it, and nothing is added to it."""
    if mirror == "the triangle":
        shapes = [
            bent_triangle(wf.Mirror(1)),
            wf.Rectangle((-1.2, -1, -0.2), (0, 2, 0), (0, 0, 1.5), material=wf.Diffuse(0.8)),
            wf.Sphere((2.5, 0, -0.5), 0.45, emission=9),
        ]
        camera = wf.Camera.look_at((0.5, -2, 2.5), (-1.2, 0, 0.4), fov=40, size=(24, 24))
    else:
        shapes = [
            bent_triangle(wf.Diffuse(0.8)),
            wf.Rectangle((-2, -2, -1.5), (4, 0, 0), (0, 4, 0), material=wf.Mirror(0.9)),
            wf.Sphere((1.6, 0, -0.8), 0.2, emission=9),
        ]
        camera = wf.Camera.look_at((0, 0, 4), (0, 0, 0), up=(0, 1, 0), fov=14, size=(24, 24))
    one, two = (
        wf.render(wf.Scene(shapes, [], camera), **{**FAST, "spp": 32}, max_bounces=3, caustics=caustics).rgb
        for caustics in (False, True)
    )
    assert one.mean() > 1e-5
    np.testing.assert_allclose(two, one, rtol=1e-5)
