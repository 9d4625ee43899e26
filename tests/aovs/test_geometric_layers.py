"""Geometric AOVs: closed forms at every pixel, the ids of the user's shapes, and all cameras."""

import numpy as np
import pytest
import trimesh
from inside import installed
from trimesh.ray.ray_triangle import RayMeshIntersector
from trimesh.transformations import euler_matrix, translation_matrix

import wavefront as wf

GEOMETRIC = (
    "position",
    "depth",
    "distance",
    "normal",
    "normal_geometric",
    "uv",
    "shape_id",
    "instance_id",
    "material_id",
)
ACCELERATORS = ["numpy", pytest.param("embree", marks=pytest.mark.skipif(not installed(), reason="none"))]
SKY = wf.Environment(1)
SIZE = (64, 48)
EYE, TARGET = np.array([1.0, 2, 6]), np.array([0.2, 0.1, 0])
TURN = (wf.Camera.look_at(EYE, TARGET, up=(0.2, 1, 0)).rotation * (1, -1, -1)).T  # to camera space
K = [[60, 3, 33], [0, 55, 22], [0, 0, 1]]
CAMERAS = {
    "perspective": wf.Camera.look_at(EYE, TARGET, fov=50, size=SIZE),
    "shifted lens": wf.Camera.look_at(EYE, TARGET, size=SIZE, shift=(0.2, -0.1), aperture=0.3),
    "crop": wf.Camera.look_at(EYE, TARGET, fov=50, size=SIZE, crop=(10, 5, 50, 40)),
    "calibrated": wf.Camera.from_intrinsics(K, TURN, -TURN @ EYE, SIZE),
    "distorted": wf.Camera.from_intrinsics(
        K, TURN, -TURN @ EYE, SIZE, distortion=(-0.28, 0.08, 0.0003, 0.0002)
    ),
    "orthographic": wf.Camera.orthographic(EYE, TARGET, height=5, size=SIZE),
    "panorama": wf.Camera.panorama(EYE, TARGET, size=(96, 48)),
    "fisheye": wf.Camera.fisheye(
        [[20, 0, 33], [0, 19, 22], [0, 0, 1]], (-0.1, 0, 0, 0), TURN, -TURN @ EYE, SIZE
    ),
}


def layers(shapes, camera, names=GEOMETRIC, **settings) -> wf.Image:
    """Return a picture of one sample with AOVs."""
    return wf.render(wf.Scene(shapes, [SKY], camera), spp=1, aovs=names, **settings)


def film_points(camera: wf.Camera) -> np.ndarray:
    """Return the centers (h, w, 2) of the pixels that are rendered, in pixels of the whole picture."""
    x0, y0, x1, y1 = camera.window
    return np.stack(np.meshgrid(np.arange(x0, x1) + 0.5, np.arange(y0, y1) + 0.5), -1)


def exact_rays(camera: wf.Camera) -> tuple[np.ndarray, np.ndarray]:
    """Return origins and unit directions (h, w, 3) in float64, of perspective cameras without a shift."""
    film = film_points(camera)
    pitch = 2 * np.tan(np.radians(camera.fov) / 2) / camera.resolution[1]
    x, y = (film - np.array(camera.resolution) / 2).transpose(2, 0, 1) * pitch
    direction = np.stack([x, -y, np.full_like(x, -1)], -1) @ camera.rotation.T
    direction /= np.linalg.norm(direction, axis=-1, keepdims=True)
    return np.broadcast_to(camera.origin, direction.shape), direction


@pytest.mark.parametrize("accel", ACCELERATORS)
@pytest.mark.parametrize("scale", [1, 1e9, 1e-9])
def test_a_sphere_has_its_closed_form_at_every_pixel(accel: str, scale: float) -> None:
    """Also where lengths are rendered in another unit, and away from the origin."""
    center, radius = np.array([0.3, -0.2, 0.5]) * scale, 1.3 * scale
    camera = wf.Camera.look_at(EYE * scale, TARGET * scale, fov=50, size=SIZE)
    image = layers(wf.Sphere(center, radius), camera, accel=accel)
    origin, direction = exact_rays(camera)
    b = ((center - origin) * direction).sum(-1)
    beside = np.linalg.norm(center - origin - b[..., None] * direction, axis=-1) / radius
    hit = beside < 1
    sure = np.abs(beside - 1) > 1e-3  # not within a thousandth of the outline
    distance = np.where(hit, b - np.sqrt(np.where(hit, radius**2 * (1 - beside**2), 0)), np.nan)
    position = origin + distance[..., None] * direction
    normal = (position - center) / radius
    assert hit.sum() > 300
    assert ((image.shape_id == 0) == hit)[sure].all()
    assert (image.instance_id == -1).all()
    at, miss = hit & sure, ~hit & sure
    assert image.distance[at] == pytest.approx(distance[at], rel=3e-6)
    forward = -camera.rotation[:, 2]
    assert image.depth[at] == pytest.approx(((position - origin) @ forward)[at], rel=3e-6)
    assert np.abs(image.position - position)[at].max() < 2e-5 * scale
    for name in ("normal", "normal_geometric"):
        assert np.abs(image.layers[name] - normal)[at].max() < 3e-5
    u = np.arctan2(normal[..., 0], normal[..., 2]) / (2 * np.pi) + 0.5
    v = 1 - np.arccos(normal[..., 1]) / np.pi
    assert np.abs(image.uv - np.stack([u, v], -1))[at].max() < 2e-5
    for name in ("position", "depth", "distance", "normal", "normal_geometric", "uv"):
        assert np.isnan(image.layers[name][miss]).all()
    assert (image.shape_id[miss] == -1).all()


@pytest.mark.parametrize("accel", ACCELERATORS)
def test_a_tilted_plane_has_its_closed_form_at_every_pixel(accel: str) -> None:
    """The center ray is not a sample: it does not depend on the filter, the seed or the samples."""
    corner, u, v = np.array([-2.0, -1, -1]), np.array([4, 0.5, 0.2]), np.array([0.1, 1.5, -3])
    camera = CAMERAS["crop"]
    image = layers(wf.Rectangle(corner, u, v), camera, accel=accel, seed=3, filter="gaussian")
    origin, direction = exact_rays(camera)
    normal = np.cross(u, v) / np.linalg.norm(np.cross(u, v))
    distance = (corner - origin) @ normal / (direction @ normal)
    position = origin + distance[..., None] * direction
    gram = np.array([[u @ u, u @ v], [u @ v, v @ v]])
    uv = np.stack([(position - corner) @ u, (position - corner) @ v], -1) @ np.linalg.inv(gram)
    edge = np.minimum(uv, 1 - uv).min(-1)
    at, miss = (edge > 1e-4) & (distance > 0), edge < -1e-4
    assert at.sum() > 200
    assert miss.sum() > 200
    facing = normal * np.sign(camera.origin @ normal - corner @ normal)
    assert image.distance[at] == pytest.approx(distance[at], rel=2e-6)
    assert image.depth[at] == pytest.approx(((position - origin) @ -camera.rotation[:, 2])[at], rel=2e-6)
    assert np.abs(image.position - position)[at].max() < 2e-5
    assert np.abs(image.uv - uv)[at].max() < 1e-5
    assert np.abs(image.normal - facing)[at].max() < 1e-6
    assert (image.normal == image.normal_geometric)[at].all()
    assert np.isnan(image.depth[miss]).all()


@pytest.mark.parametrize("name", CAMERAS)
def test_a_projected_point_lands_on_the_pixel_that_its_position_names(name: str) -> None:
    """To a hundredth of a pixel, for all cameras; depth is the one of project()."""
    camera = CAMERAS[name]
    shapes = [wf.Sphere((0, 0, 0), 1), wf.Rectangle((-20, -1, -20), (0, 0, 40), (40, 0, 0))]
    image = layers(shapes, camera, ("position", "depth", "shape_id"))
    met = image.shape_id >= 0
    assert met.mean() > 0.2
    pixels, depth = camera.project(image.position[met])
    assert np.abs(pixels - film_points(camera)[met]).max() < 0.01
    assert depth == pytest.approx(image.depth[met], rel=1e-5)
    assert np.isnan(image.depth[~met]).all()


def eight_objects() -> list[wf.Mesh]:
    """Return overlapping boxes, balls and rings as meshes."""
    parts = [
        trimesh.creation.box((1.2, 0.9, 1.4)),
        trimesh.creation.icosphere(2, 0.7),
        trimesh.creation.torus(0.8, 0.25, 24, 12),
        trimesh.creation.cylinder(0.4, 1.6),
    ] * 2
    out = []
    for at, part in enumerate(parts):
        angle = 2 * np.pi * at / 8
        move = translation_matrix((1.4 * np.cos(angle), 1.2 * np.sin(angle), 0.3 * np.sin(2 * angle)))
        part = part.copy().apply_transform(move @ euler_matrix(at, 0.5 * at, 0.3))
        out.append(wf.Mesh(part.vertices, part.faces, name=f"object {at}"))
    return out


@pytest.mark.parametrize("accel", ACCELERATORS)
def test_ids_of_overlapping_objects_are_those_of_trimesh(accel: str) -> None:
    meshes = eight_objects()
    camera = wf.Camera.look_at(EYE, TARGET, fov=40, size=(96, 72))
    image = layers(meshes, camera, ("shape_id", "distance"), accel=accel)
    whole = trimesh.util.concatenate([trimesh.Trimesh(m.vertices, m.faces, process=False) for m in meshes])
    origin, direction = exact_rays(camera)
    triangle, ray, point = RayMeshIntersector(whole).intersects_id(
        origin.reshape(-1, 3), direction.reshape(-1, 3), multiple_hits=True, return_locations=True
    )
    far = np.linalg.norm(point - camera.origin, axis=1)
    nearest = np.full(direction[..., 0].size, np.inf)
    np.minimum.at(nearest, ray, far)
    number = np.repeat(np.arange(8), [len(m.faces) for m in meshes])
    expected = np.full(nearest.size, -1)
    first = far <= nearest[ray]
    expected[ray[first]] = number[triangle[first]]
    expected = expected.reshape(72, 96)
    padded = np.pad(expected, 1, mode="edge")
    around = [padded[1 + dy : 73 + dy, 1 + dx : 97 + dx] for dy in (-1, 0, 1) for dx in (-1, 0, 1)]
    inside = np.all([each == expected for each in around], axis=0)
    assert set(range(8)) <= set(expected[inside].tolist())
    assert (image.shape_id == expected)[inside].mean() >= 0.999
    met = inside & (expected >= 0) & (image.shape_id == expected)
    assert image.distance[met] == pytest.approx(nearest.reshape(72, 96)[met], rel=1e-5)
    assert image.names["shape"] == {at: f"object {at}" for at in range(8)}


@pytest.mark.parametrize("accel", ACCELERATORS)
def test_instances_have_numbers_and_texture_coordinates_of_their_own(accel) -> None:
    """Whether they share a mesh or, for Embree, were copied to meshes, between other shapes and mirrored."""
    square = wf.Mesh(
        [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]],
        [[0, 1, 2], [0, 2, 3]],
        uvs=[[0, 0], [1, 0], [1, 1], [0, 1]],
        name="square",
    )
    steel = wf.Material(wf.Conductor.named("gold"), name="gold")
    places = [np.diag([1.0, 1, 1, 1]), np.diag([-1.0, 1, 1, 1]), translation_matrix((-1.0, -1.5, 0))]
    shapes = [
        wf.Instance(square, places[0], name="right"),
        wf.Sphere((0, 3, 0), 0.5),
        wf.Instance(square, places[1], material=steel, name="left"),
        wf.Rectangle((-5, -5, -1), (10, 0, 0), (0, 10, 0), name="wall"),
        wf.Instance(square, places[2] @ np.diag([2.0, 1, 1, 1]), name="below"),
    ]
    camera = wf.Camera.look_at((0, 0, 9), (0, 0, 0), fov=45, size=(80, 80))
    image = layers(shapes, camera, GEOMETRIC, accel=accel)
    assert set(np.unique(image.shape_id)) == {0, 1, 2, 3, 4}
    assert image.names["shape"] == {0: "right", 1: "sphere", 2: "left", 3: "wall", 4: "below"}
    assert image.names["instance"] == {0: "right", 1: "left", 2: "below"}
    assert "gold" in image.names["material"].values()
    for shape, instance in enumerate((0, -1, 1, -1, 2)):
        assert (image.instance_id[image.shape_id == shape] == instance).all()
    gold = next(number for number, name in image.names["material"].items() if name == "gold")
    assert ((image.material_id == gold) == (image.shape_id == 2)).all()
    x, y = image.position[..., 0], image.position[..., 1]
    for shape, u, v in ((0, x, y), (2, -x, y), (4, (x + 1) / 2, y + 1.5)):
        at = image.shape_id == shape
        assert image.uv[at] == pytest.approx(np.stack([u, v], -1)[at], abs=1e-5)
        assert (image.normal[at] == (0, 0, 1)).all()


def test_shapes_side_by_side_keep_their_ids() -> None:
    """Two triangles that form a rectangle and have one material are two shapes all the same."""
    gray = wf.Diffuse(0.5)
    corners = np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
    shapes = [wf.Mesh(corners, [face], material=gray) for face in ([0, 1, 2], [0, 2, 3])]
    camera = wf.Camera.look_at((0, 0, 4), (0, 0, 0), fov=40, size=(32, 32))
    image = layers(shapes, camera, ("shape_id", "position", "material_id"))
    x, y, _ = image.position.transpose(2, 0, 1)
    assert (image.shape_id[x > y + 1e-3] == 0).all()
    assert (image.shape_id[x < y - 1e-3] == 1).all()
    assert set(np.unique(image.material_id)) == {-1, 0}


@pytest.mark.parametrize(("alpha", "met"), [(0.6, 1), (0.4, 0), (0.5, 1)])
def test_a_surface_with_alpha_is_met_from_one_half_on(alpha: float, met: int) -> None:
    veil = wf.Rectangle(
        (-9, -9, 1), (18, 0, 0), (0, 18, 0), material=wf.Material(wf.Diffuse(0.5), alpha=alpha)
    )
    wall = wf.Rectangle((-9, -9, 0), (18, 0, 0), (0, 18, 0))
    camera = wf.Camera.look_at((0, 0, 5), (0, 0, 0), size=(16, 16))
    image = layers([wall, veil], camera)
    assert (image.shape_id == met).all()
    assert image.depth == pytest.approx(5.0 - met, rel=1e-6)
    pixels, _ = camera.project(image.position.reshape(-1, 3))
    assert np.abs(pixels - film_points(camera).reshape(-1, 2)).max() < 0.01


def test_normal_is_that_of_shading_with_the_normal_map() -> None:
    texels = np.full((1, 1, 3), (0.6, 0.5, 0.5 + 0.5 * 0.98))
    material = wf.Material(wf.Diffuse(0.5), normal_map=wf.NormalMap(wf.Texture(texels, srgb=False)))
    wall = wf.Rectangle((-9, -9, 0), (18, 0, 0), (0, 18, 0), material=material)
    image = layers(wall, wf.Camera.look_at((0, 0, 5), (0, 0, 0), size=(8, 8)))
    tilted = np.array([0.2, 0, 0.98]) / np.hypot(0.2, 0.98)
    assert image.normal.reshape(-1, 3) == pytest.approx(np.tile(tilted, (64, 1)), abs=1e-2)
    assert (image.normal_geometric == (0, 0, 1)).all()


def test_the_ground_and_lights_that_are_added_come_after_the_users_shapes() -> None:
    ball = wf.Sphere((0, 0, 0), 1, name="ball")
    image = wf.render([ball], spp=1, size=(32, 32), ground=True, lighting="studio", aovs="shape_id")
    assert image.names["shape"] == {0: "ball", 1: "ground"}
    assert image.shape_id[16, 16] == 0
    assert (image.shape_id == 1).any()


def test_layers_are_the_same_bits_for_any_division_of_the_work() -> None:
    shapes, camera = eight_objects(), CAMERAS["perspective"]
    first = layers(shapes, camera, GEOMETRIC, accel="numpy")
    for settings in ({"workers": 2, "executor": "threads"}, {"wave_size": 50}, {"seed": 5}):
        other = layers(shapes, camera, GEOMETRIC, accel="numpy", **settings)
        for name in GEOMETRIC:
            assert first.layers[name].tobytes() == other.layers[name].tobytes(), name


def test_layers_do_not_change_the_picture() -> None:
    shapes, camera = [*eight_objects()[:2], wf.Rectangle((-3, -2, -3), (0, 0, 6), (6, 0, 0))], CAMERAS["crop"]
    assert layers(shapes, camera).rgb.tobytes() == layers(shapes, camera, ()).rgb.tobytes()


def test_pictures_of_a_session_have_layers_each_its_own() -> None:
    scene = wf.Scene([wf.Sphere((0, 0, 0), 1)], [SKY], CAMERAS["perspective"])
    with wf.Session(scene, spp=4, aovs=("depth", "shape_id")) as session:
        pictures = list(session)
        assert len(pictures) > 1
        for image in pictures:
            assert image.depth.tobytes() == pictures[0].depth.tobytes()
            assert image.names["shape"] == {0: "sphere"}
        assert pictures[0].depth is not pictures[1].depth
        session.set_camera(CAMERAS["orthographic"], size=(20, 10))
        other = session.run()
    assert other.depth.shape == (10, 20)
    fresh = wf.render(scene, spp=4, camera=CAMERAS["orthographic"], size=(20, 10), aovs=("depth", "shape_id"))
    assert other.depth.tobytes() == fresh.depth.tobytes()


def test_a_layer_that_was_not_asked_for_is_an_error() -> None:
    image = layers(wf.Sphere((0, 0, 0), 1), CAMERAS["perspective"], ("depth",))
    with pytest.raises(AttributeError, match=r"aovs=\('uv',\)"):
        _ = image.uv


def test_names_come_from_nodes_and_materials_of_files(tmp_path) -> None:
    box = trimesh.creation.box((1, 1, 1))
    paint = trimesh.visual.material.PBRMaterial(name="red paint", baseColorFactor=[200, 20, 20, 255])
    box.visual = trimesh.visual.TextureVisuals(uv=np.zeros((len(box.vertices), 2)), material=paint)
    both = trimesh.Scene()
    both.geometry["crate"] = box
    for name, x in (("left crate", -1.0), ("right crate", 1.0)):
        both.graph.update(name, matrix=translation_matrix((x, 0, 0)), geometry="crate")
    both.export(tmp_path / "crates.glb")
    for scene in (wf.load(tmp_path / "crates.glb"), both):
        ids = ("shape_id", "instance_id", "material_id")
        image = wf.render(scene, spp=1, size=(40, 20), ground=False, aovs=ids)
        assert sorted(image.names["shape"].values()) == ["left crate", "right crate"]
        assert image.names["instance"] == image.names["shape"]
        assert image.names["material"] == {0: "red paint"}
        left = next(at for at, name in image.names["shape"].items() if name == "left crate")
        assert image.shape_id[10, 13] == left
    lines = "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl blue tin\nf 1 2 3\n"
    (tmp_path / "a.obj").write_text(lines)
    (tmp_path / "a.mtl").write_text("newmtl blue tin\nKd 0 0 1\n")
    image = wf.render(tmp_path / "a.obj", spp=1, size=(8, 8), ground=False, aovs="material_id")
    assert image.names["material"] == {0: "blue tin"}


def test_uv_of_a_folded_mesh_in_tilted_and_sheared_instances() -> None:
    """Texture coordinates are a linear function of the place on the mesh, wherever it is put."""
    vertices = 0.5 * np.array([[-1, -1, 0.4], [1, -1, 0], [1, 1, 0.5], [-1, 1, -0.3], [0, 0, 0.9]])
    uvs = np.stack([vertices[:, 0] + 0.3 * vertices[:, 2], vertices[:, 1] - 0.2 * vertices[:, 2]], 1)
    faces = [[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]]
    tent = wf.Mesh(vertices, faces, uvs=uvs)
    shear = np.eye(4)
    shear[0, 2], shear[1, 0], shear[2, 1] = 0.7, 0.3, -0.4
    places = [
        translation_matrix((x, y, 0.2)) @ euler_matrix(0.4 * x, 0.5, y) @ shear
        for x, y in ((-1.4, 0), (1.3, 0.3))
    ]
    scene = wf.Scene([wf.Instance(tent, place) for place in places], [SKY])
    scene.camera = wf.Camera.look_at((0.3, 0.5, 8), (0, 0, 0), fov=24, size=SIZE)
    image = wf.render(scene, 1, aovs=("uv", "position", "shape_id"), workers=1, accel="numpy", progress=False)
    layers = image.layers
    for number, place in enumerate(places):
        seen = layers["shape_id"] == number
        assert seen.sum() > 100
        world = np.c_[layers["position"][seen].astype(float), np.ones(seen.sum())]
        x, y, z = (world @ np.linalg.inv(place).T)[:, :3].T
        due = np.stack([x + 0.3 * z, y - 0.2 * z], 1)
        np.testing.assert_allclose(layers["uv"][seen], due, atol=2e-5)
