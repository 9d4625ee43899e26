"""Geometry and coordinates that are hardly there: finite pictures without a warning of NumPy.

Warnings are errors in the tests.
"""

import warnings

import numpy as np
import pytest
from significance import render

import wavefront as wf

TEXELS = np.random.default_rng(0).random((8, 8, 3), np.float32)
NORMALS = wf.NormalMap(wf.Texture(TEXELS, srgb=False))
BUMPS = wf.BumpMap(wf.Texture(TEXELS, srgb=False, channel=0), 0.3)
VARNISH = wf.Principled(0.5, 0.3, 0.2, clearcoat=1.0, sheen=0.5)
MATERIALS = {
    "texture": wf.Diffuse(wf.Texture(TEXELS)),
    "normal map": wf.Material(VARNISH, normal_map=NORMALS),
    "bump map": wf.Material(VARNISH, normal_map=BUMPS),
    "normal-mapped glass": wf.Material(wf.Dielectric(1.5), normal_map=NORMALS),
}
PLACES = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.3]])
FACES = [[0, 1, 2], [0, 2, 3]]
UP = np.tile([0.0, 0.0, 1.0], (4, 1))
LEANING = np.array([[0, 0, 1], [0, 0.5, 1], [0, 0, -1], [1, 0, 0.0]])
TINY = [1e-10, 1e-30, 1e-42, 1e-200, 0.0]


def quad(material, vertices=PLACES, uvs=PLACES[:, :2], **arguments):
    return wf.Mesh(vertices, FACES, uvs=uvs, material=material, **arguments)


def check(*shapes, size=1.0, columns=1, rows=1):
    """Render shapes around the origin in light that only light samples find, and in light that both find."""
    target = np.array([0.5 * columns, 0.5 * rows, 0]) * size
    camera = wf.Camera.look_at(
        target + np.array([0.1, 0.2, 2 * rows]) * size, target, size=(8 * columns, 8 * rows)
    )
    lights = [wf.Environment(1.0), wf.PointLight(target + size / 2, rows * size * size)]
    image = render(wf.Scene(list(shapes), lights, camera), 4)
    assert np.isfinite(image.rgb).all()
    assert image.metadata["bad_samples"] == 0


def check_each(*arguments):
    """Render a quad of each material, a row, with each of the arguments, a column, in one picture."""
    check(
        *(
            quad(material, PLACES + np.array([column, row, 0]), **each)
            for column, each in enumerate(arguments)
            for row, material in enumerate(MATERIALS.values())
        ),
        columns=len(arguments),
        rows=len(MATERIALS),
    )


@pytest.mark.parametrize("normals", [None, LEANING], ids=["flat", "smooth"])
@pytest.mark.parametrize("axes", [[1, 1], [1, 0], [0, 1]], ids=["uv", "u", "v"])
def test_texture_coordinates_that_span_hardly_any_area(normals, axes):
    check_each(*({"uvs": PLACES[:, :2] * np.where(axes, tiny, 1), "normals": normals} for tiny in TINY))


@pytest.mark.parametrize("normal_map", [NORMALS, BUMPS], ids=["normals", "heights"])
def test_a_normal_map_without_tangents_tilts_nothing(normal_map):
    """Bit by bit: where coordinates span too little to say what is along them, there is no tilt."""
    matte = wf.Diffuse(0.5)
    camera = wf.Camera.look_at((0.6, 0.7, 2), (0.5, 0.5, 0), size=(12, 12))
    for tiny in (1e-42, 1e-200, 0.0):
        plain, carved = (
            render(wf.Scene(quad(m, uvs=PLACES[:, :2] * [tiny, 1]), [wf.Environment(1.0)], camera), 4).rgb
            for m in (matte, wf.Material(matte, normal_map=normal_map))
        )
        assert np.array_equal(plain, carved)


def test_large_texture_coordinates():
    check_each(*({"uvs": PLACES[:, :2] * large, "normals": UP} for large in (1e5, 1e19, 3e38)))


def test_texture_coordinates_beyond_float32_are_named():
    with pytest.raises(wf.SceneError, match=r"mesh: uvs\[1\]\[0\] is 1e\+39"):
        quad(wf.Diffuse(0.5), uvs=PLACES[:, :2] * 1e39)
    with pytest.raises(wf.SceneError, match=r"mesh: uvs1\[1\]\[0\] is -1e\+300; its size must be at most"):
        quad(wf.Diffuse(0.5), uvs1=PLACES[:, :2] * -1e300)


def test_normals_and_tangents_of_any_length():
    """Only their directions count; of those without a length, the face's."""
    sizes = (0.0, 1e-300, 1e-30, 1e39, 1e308)
    check_each(*({"normals": LEANING * size} for size in sizes))
    check_each(*({"normals": UP, "tangents": np.tile([size, 0, 0, 1], (4, 1))} for size in sizes))


def test_the_length_of_normals_changes_no_bit():
    camera = wf.Camera.look_at((0.6, 0.7, 2), (0.5, 0.5, 0), size=(12, 12))
    images = [
        render(wf.Scene(quad(wf.Diffuse(0.5), normals=LEANING * size), [wf.Environment(1.0)], camera), 4).rgb
        for size in (1.0, 2.0**-700, 2.0**900)
    ]
    assert np.array_equal(images[0], images[1])
    assert np.array_equal(images[0], images[2])


def test_given_arrays_are_left_alone():
    normals = LEANING * 1e200
    quad(wf.Diffuse(0.5), normals=normals)
    assert np.array_equal(normals, LEANING * 1e200)


@pytest.mark.parametrize("material", MATERIALS.values(), ids=MATERIALS)
def test_tiny_shapes_alone_and_beside_large_ones(material):
    large = quad(material, PLACES * 3 - 1, normals=UP)
    for size in (1e-3, 1e-12, 1e-30):
        check(quad(material, PLACES * size, normals=UP), size=size)
        check(quad(material, PLACES * size, normals=UP), large)
        check(wf.Sphere((0.4, 0.4, 0.05), size, material=material), large)


@pytest.mark.parametrize("material", MATERIALS.values(), ids=MATERIALS)
def test_slivers(material):
    for height in (1e-7, 1e-15, 1e-25, 1e-45, 1e-150):
        thin = np.array([[0, 0, 0], [1, 0, 0], [0.5, height, 0], [0, 1, 0]])
        check(quad(material, thin, uvs=thin[:, :2]))
        check(quad(material, thin, normals=UP))


@pytest.mark.parametrize("material", MATERIALS.values(), ids=MATERIALS)
def test_instances_that_shrink_and_flatten(material):
    for uvs in (PLACES[:, :2], PLACES[:, :2] * 1e-30):
        mesh = quad(material, uvs=uvs, normals=UP)
        places = [np.eye(4), np.diag([1e-10, 1e-10, 1e-10, 1]), np.diag([1, 1e-8, 1, 1])]
        check(*[wf.Instance(mesh, place) for place in places])


def test_what_is_brighter_than_float32_is_infinite_without_a_warning():
    """Its variance is; the picture itself is not."""
    area_light = quad(wf.Diffuse(0.0), emission=1e25)
    camera = wf.Camera.look_at((0.6, 0.7, 2), (0.5, 0.5, 0), size=(12, 12))
    image = render(wf.Scene(area_light, camera=camera), 4)
    assert np.isfinite(image.rgb).all()
    assert image.rgb.max() == pytest.approx(1e25)


@pytest.mark.parametrize("size", [1.0, 1e-30, 1e-200, 1e30])
def test_faces_of_zero_area_in_memory_are_counted(size):
    """Once for each mesh, when it is made: a face whose corners are in a point, and one on a line."""
    points = [*PLACES, (2, 0, 0), (3, 0, 0)]
    with pytest.warns(UserWarning, match="zero area") as caught:
        mesh = wf.Mesh(np.array(points) * size, [[0, 1, 2], [1, 4, 5], [0, 2, 3], [3, 3, 3]], name="strip")
    wf.Scene(mesh).check()
    assert [str(each.message) for each in caught] == ["strip: dropped 2 faces of zero area, first: face 1"]
    assert caught[0].filename == __file__


def test_a_face_of_zero_area_in_memory_is_not_hit():
    vertices = np.concatenate([PLACES, [[2, 0, 0]]])
    camera = wf.Camera.look_at((0.6, 0.7, 2), (0.5, 0.5, 0), size=(12, 12))
    with pytest.warns(UserWarning, match="mesh: dropped 1 face of zero area, first: face 2"):
        found = render([(vertices, [*FACES, [0, 1, 4]]), wf.Environment(1.0)], 4, camera=camera)
    assert np.array_equal(
        found.rgb, render(wf.Scene(wf.Mesh(PLACES, FACES), [wf.Environment(1.0)], camera), 4).rgb
    )


def _load(tmp_path):
    path = tmp_path / "strip.obj"
    path.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 2 0 0\nf 1 2 3\nf 1 2 4\n")
    wf.load(path)


def _save(tmp_path):
    wf.Image(np.full((2, 2, 3), np.nan, np.float32)).save(tmp_path / "nan.png")


def _read_missing_uvs(tmp_path):
    mesh = wf.Mesh(PLACES, [[0, 1, 2]], material=wf.Diffuse(wf.Texture(np.ones((2, 2, 3)) / 2)))
    wf.render(wf.Scene([mesh], wf.Environment(1)), 1, size=(8, 8), progress=False)


@pytest.mark.parametrize(
    "call",
    [
        _load,
        _save,
        _read_missing_uvs,
        lambda tmp_path: wf.Camera.look_at((0, 0, 4), (0, 0, 0), fov=0.7),
        lambda tmp_path: wf.Scene([wf.Sphere((0, 0, 0), 1)]).framing_camera(fov=0.7),
        lambda tmp_path: wf.Environment(np.full((4, 8, 3), -1.0) + np.eye(4, 8)[:, :, None] * 3),
        lambda tmp_path: wf.Environment(np.full((4, 8, 4), 0.5, np.float32)),
    ],
    ids=["load", "save", "lacking uvs", "fov", "framing fov", "negative pixels", "transparent pixels"],
)
def test_warnings_are_at_the_line_of_the_caller(call, tmp_path):
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", UserWarning)
        call(tmp_path)
    assert {each.filename for each in caught if issubclass(each.category, UserWarning)} == {__file__}
