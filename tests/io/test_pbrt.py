"""Scenes of pbrt: what becomes of each directive, type and parameter, and what is not honored."""

from __future__ import annotations

import gzip
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import trimesh
from expected import Near, check
from inside import ENTITIES_TABLE as TABLE
from inside import IO_METALS as METALS
from inside import luminance, noise, sphere_to_square, square_to_sphere, write_image
from measurements import adaptive_fields, tensor_file

import wavefront as wf

BALL = 'Shape "sphere"\n'
SQUARE = 'Shape "trianglemesh" "point3 P" [ 0 0 0 1 0 0 1 1 0 0 1 0 ] "integer indices" [ 0 1 2 0 2 3 ]\n'
PAINTED = 'Material "diffuse" "texture reflectance" "t"'
DOCS = Path(__file__).parents[2] / "docs" / "pbrt.md"


def load(folder: Path, body: str, header: str = "", strict: bool = True) -> wf.Scene:
    path = folder / "scene.pbrt"
    path.write_text(f"{header}\nWorldBegin\n{body}\n")
    return wf.load(path, strict=strict)


def light(folder: Path, statement: str, header: str = "") -> Any:
    (found,) = load(folder, f"{statement} {BALL}", header).lights
    return found


def shape(folder: Path, statement: str) -> Any:
    (found,) = load(folder, statement).shapes
    return found


def material(folder: Path, statement: str) -> Any:
    return shape(folder, f"{statement}\n{SQUARE}").material


def at(texture: Any, u: float, v: float) -> Any:
    surface = SimpleNamespace(uv=np.array([[u], [v]], np.float32))
    return texture.at(surface)[..., 0]


def rows(values: Any) -> Any:
    return np.ravel(values).tolist()


def camera(folder: Path, header: str) -> Any:
    return load(folder, BALL, header).camera


def film(folder: Path, parameters: str) -> Any:
    return camera(folder, f'Camera "perspective" Film "rgb" {parameters}')


def exposed(folder: Path, header: str) -> Any:
    return light(folder, 'LightSource "point"', header)


def emitter(folder: Path, statement: str) -> Any:
    return shape(folder, f'AreaLightSource "diffuse" {statement}')


def bsdf(folder: Path, statement: str) -> Any:
    return material(folder, f"{TWO if 'mix' in statement else ''} Material {statement}").bsdf


E, RGB, GRAY = [0.5, 1, 2], "[ .5 1 2 ]", '"rgb reflectance" [ .5 .5 .5 ]'
CU, AU = METALS["Cu"], METALS["Au"]
TWO = 'MakeNamedMaterial "a" "string type" "diffuse" MakeNamedMaterial "b" "string type" "conductor" '
ROUGH = '"float uroughness" .0625 "float vroughness" .0016 "bool remaproughness" false'
SHEET = '"rgb reflectance" [ .2 .4 .8 ] "rgb transmittance" [ .6 .2 .1 ] "float scale" .5'
# what makes something of a text, this, and what it is
READ = [
    (camera, 'Scale 2 2 2 Camera "perspective" "float lensradius" 3', {"projection.aperture": 3}),
    (
        camera,
        'Scale 2 2 2 Camera "perspective" "float lensradius" 3 "float focaldistance" 8',
        {"projection.focus": 4},
    ),
    (film, "", {"resolution": (1280, 720), "window": (0, 0, 1280, 720)}),
    (film, '"integer xresolution" 20 "integer yresolution" 10', {"window": (0, 0, 20, 10)}),
    (film, '"integer pixelbounds" [ 10 30 5 700 ]', {"window": (10, 5, 30, 700)}),
    (film, '"float cropwindow" [ .25 .5 .5 1 ]', {"window": (320, 360, 640, 720)}),
    (film, '"float cropwindow" [ 0 1 0 1 ]', {"resolution": (1280, 720), "window": (0, 0, 1280, 720)}),
    # iso and shutter multiply all light
    (exposed, 'Camera "perspective" "float shutterclose" .5 Film "rgb" "float iso" 800', {"intensity": 4}),
    (light, f'LightSource "point" "rgb I" {RGB} "float scale" 3', {"intensity": [1.5, 3, 6]}),
    (light, 'LightSource "point" "float power" 4', {"intensity": Near(1 / np.pi)}),
    (light, 'Translate 1 0 0 LightSource "point" "point3 from" [ 1 2 3 ]', {"position": [2, 2, 3]}),
    (light, 'Attribute "light" "float scale" 5 LightSource "point"', {"intensity": 5}),
    (light, 'Translate 1 0 0 LightSource "goniometric"', {"position": [1, 0, 0]}),
    (light, f'LightSource "distant" "rgb L" {RGB} "float scale" 2', {"irradiance": [1, 2, 4]}),
    (light, 'LightSource "distant" "float illuminance" 7', {"irradiance": Near(7)}),
    (light, 'LightSource "distant" "point3 from" [ 0 0 2 ] "point3 to" [ 0 0 0 ]', {"direction": [0, 0, -1]}),
    (light, 'Rotate 90 1 0 0 LightSource "distant"', {"direction": Near([0, -1, 0])}),
    (light, f'LightSource "infinite" "rgb L" {RGB}', {"radiance": E}),
    (light, 'LightSource "infinite" "float illuminance" 3', {"radiance": Near(3 / np.pi)}),
    (light, 'LightSource "infinite" "spectrum L" "stdillum-D65"', {"radiance": 1}),
    (light, 'LightSource "spot" "float conedeltaangle" 0', {"angle": 60}),
    (light, 'LightSource "spot" "float coneangle" 20 "float conedeltaangle" 0', {"angle": 40}),
    (light, f'LightSource "spot" "rgb I" {RGB}', {"intensity": E}),
    (light, 'LightSource "spot" "point3 to" [ 0 3 0 ]', {"direction": [0, 1, 0]}),
    (
        light,
        'LightSource "spot" "float power" 1 "float coneangle" 60 "float conedeltaangle" 0',
        {"intensity": Near(1 / np.pi)},
    ),
    (emitter, f'"rgb L" [ 1 2 3 ] "float scale" 2 {SQUARE}', {"emission": [2, 4, 6], "two_sided": False}),
    (emitter, f'"bool twosided" true {SQUARE}', {"emission": 1, "two_sided": True}),
    (
        emitter,
        f'"float power" 5 "rgb L" [ 2 2 2 ] Scale 2 2 2 {SQUARE}',
        {"emission": Near(5 / (4 * np.pi), 1e-5)},
    ),
    (emitter, f'"float power" 5 "bool twosided" true {SQUARE}', {"emission": Near(5 / (2 * np.pi), 1e-5)}),
    (
        emitter,
        '"float power" 5 Shape "sphere" "float radius" 3',
        {"emission": Near(5 / (36 * np.pi**2), 1e-5)},
    ),
    (material, "", {"bsdf": wf.Diffuse, "bsdf.reflectance": 0.5}),
    (material, 'Material "interface"', {"bsdf": wf.NullSurface}),
    (
        bsdf,
        '"diffuse" "rgb reflectance" [ .1 .2 .3 ]',
        {"": wf.Diffuse, "reflectance": Near([0.1, 0.2, 0.3])},
    ),
    (bsdf, '"diffuse" "spectrum reflectance" [ 300 .25 900 .25 ]', {"reflectance": Near(0.25, 1e-3)}),
    (
        material,
        'Attribute "material" "rgb reflectance" [ .1 .1 .1 ] Material "diffuse"',
        {"bsdf.reflectance": Near(0.1)},
    ),
    (  # without a warning
        material,
        'Attribute "material" "rgb reflectance" [ .1 .1 .1 ] Material "dielectric"',
        {"bsdf": wf.Dielectric},
    ),
    (
        bsdf,
        f'"coateddiffuse" {GRAY} "float thickness" 0',
        {"": wf.Plastic, "reflectance": 0.5, "roughness": 0},
    ),
    (bsdf, '"coateddiffuse" "float eta" 1.7', {"": wf.Plastic, "ior": Near(1.7), "multiscatter": False}),
    (bsdf, '"coateddiffuse" "float roughness" .0625', {"roughness": 0.5}),
    (bsdf, '"conductor"', {"": wf.Conductor, "eta": Near(CU[0]), "k": Near(CU[1]), "roughness": 0}),
    (bsdf, '"conductor" "spectrum eta" "metal-Au-eta"', {"eta": Near(AU[0])}),
    (bsdf, '"conductor" "spectrum k" "metal-CuZn-k"', {"k": Near([3.695, 2.765, 1.829])}),
    (bsdf, '"conductor" "rgb reflectance" [ .25 .25 .25 ]', {"eta": 1, "k": Near(2 / np.sqrt(3))}),
    (bsdf, f'"conductor" {ROUGH}', {"roughness": 0.25, "roughness_v": Near(0.04)}),
    (bsdf, '"dielectric"', {"": wf.Dielectric, "ior": 1.5, "roughness": 0}),
    (bsdf, '"dielectric" "float eta" 1.3 "float roughness" .0625', {"ior": Near(1.3), "roughness": 0.5}),
    (bsdf, '"thindielectric" "float eta" 1.4', {"": wf.ThinDielectric, "ior": Near(1.4)}),
    (bsdf, '"mix" "string materials" [ "a" "b" ] "float amount" .3', {"": wf.Mix, "weight": Near(0.3)}),
    (
        bsdf,
        f'"diffusetransmission" {SHEET}',
        {
            "": wf.DiffuseTransmission,
            "reflectance": Near([0.1, 0.2, 0.4]),
            "transmittance": Near([0.3, 0.1, 0.05]),
        },
    ),
    (
        shape,
        'Translate 1 2 3 Rotate 30 1 0 0 Scale 2 2 2 Shape "sphere" "float radius" 3',
        {"center": [1, 2, 3], "radius": Near(6)},
    ),
]


@pytest.mark.parametrize(
    ("make", "text", "due"), READ, ids=[f"{make.__name__} {text}" for make, text, _ in READ]
)
def test_what_types_become(tmp_path: Path, make: Any, text: str, due: dict[str, Any]) -> None:
    check(make(tmp_path, text), due)


# ---- cameras, films and settings


def raster(point: Any, matrix: Any, fov: float, window: Any, size: Any) -> Any:
    """Return where pbrt sees a point: `matrix` takes the world to x right, y up and z ahead."""
    x, y, z = (matrix @ [*point, 1])[:3]
    scale = np.tan(np.radians(fov) / 2) * z if fov else 1
    x0, x1, y0, y1 = window
    return (x / scale - x0) / (x1 - x0) * size[0], (y1 - y / scale) / (y1 - y0) * size[1]


TURN = np.array([[0, 0, 1, 2], [0, 1, 0, -1], [-1, 0, 0, 6], [0, 0, 0, 1.0]])
STATED = "Transform [ 0 0 -1 0 0 1 0 0 1 0 0 0 2 -1 6 1 ]"


@pytest.mark.parametrize("mirror", [False, True])
@pytest.mark.parametrize(
    ("camera", "size", "fov", "window"),
    [
        ('"perspective" "float fov" 50', (80, 40), 50, (-2, 2, -1, 1)),
        ('"perspective"', (40, 80), 90, (-1, 1, -2, 2)),
        ('"perspective" "float screenwindow" [ -1 .5 -.2 .7 ]', (50, 30), 90, (-1, 0.5, -0.2, 0.7)),
        ('"perspective" "float frameaspectratio" 3', (50, 30), 90, (-3, 3, -1, 1)),
        ('"orthographic" "float screenwindow" [ -4 2 -1 2 ]', (60, 30), None, (-4, 2, -1, 2)),
    ],
)
def test_cameras_see_points_where_pbrt_does(
    tmp_path: Path, camera: str, size: Any, fov: Any, window: Any, mirror: bool
) -> None:
    header = f"{'Scale -1 1 1' if mirror else ''} {STATED}"
    header += f' Camera {camera} Film "rgb" "integer xresolution" {size[0]} "integer yresolution" {size[1]}'
    if mirror:  # Transform replaces what is above it
        header = header.replace("Transform", "ConcatTransform")
    matrix = np.diag([-1 if mirror else 1, 1, 1, 1]) @ TURN
    scene = load(tmp_path, "Translate .3 .2 -.1 " + SQUARE, header)
    assert scene.camera is not None
    pixels, _ = scene.camera.project(scene.shapes[0].vertices)
    expected = [raster(p, matrix, fov, window, size) for p in ((0.3, 0.2, -0.1), (1.3, 0.2, -0.1))]
    np.testing.assert_allclose(pixels[:2], expected, atol=1e-3)


@pytest.mark.parametrize("mirror", [False, True])
def test_spherical_cameras_see_points_where_pbrt_does(tmp_path: Path, mirror: bool) -> None:
    """θ = πv is the angle from y, and φ = 2πu turns from x to z, in SphericalCamera::GenerateRay."""
    header = f"{'Scale -1 1 1' if mirror else ''} {STATED}".replace("Transform", "ConcatTransform")
    header += ' Camera "spherical" "string mapping" "equirectangular" Film "rgb" '
    header += '"integer xresolution" 80 "integer yresolution" 40'
    scene = load(tmp_path, "Translate .3 .2 -.1 " + SQUARE, header)
    x, y, z, _ = (
        np.diag([-1 if mirror else 1, 1, 1, 1])
        @ TURN
        @ np.array([[0.3, 1.3], [0.2, 0.2], [-0.1, -0.1], [1, 1]])
    )
    phi = np.arctan2(z, x) % (2 * np.pi)
    theta = np.arccos(y / np.sqrt(x * x + y * y + z * z))
    assert scene.camera is not None
    pixels, _ = scene.camera.project(scene.shapes[0].vertices)
    np.testing.assert_allclose(
        pixels[:2], np.stack([phi / (2 * np.pi) * 80, theta / np.pi * 40], 1), atol=1e-4
    )
    equal = header.replace('"string mapping" "equirectangular"', "")
    with pytest.raises(wf.SceneError, match="mapping 'equalarea'; 'equirectangular' in its place"):
        load(tmp_path, SQUARE, equal)


@pytest.mark.parametrize(
    ("header", "expected"),
    [
        ("", {}),
        ('Sampler "zsobol" "integer pixelsamples" 64', {"spp": 64}),
        ('Sampler "stratified" "integer xsamples" 3 "integer ysamples" 5', {"spp": 15}),
        ('Integrator "path" "integer maxdepth" 9 "string lightsampler" "bvh"', {"max_bounces": 9}),
        ('PixelFilter "box"', {"filter": "box"}),
        ('PixelFilter "box" "float xradius" 1 "float yradius" 1', {"filter": wf.BoxFilter(1.0)}),
        ('PixelFilter "triangle"', {"filter": wf.TentFilter(2.0)}),
        ('PixelFilter "triangle" "float xradius" 1 "float yradius" 1', {"filter": "tent"}),
        (
            'PixelFilter "gaussian" "float xradius" 2 "float yradius" 2 "float sigma" 1',
            {"filter": wf.GaussianFilter(2.0, 1.0, windowed=True)},
        ),
        ('Option "seed" 4 Accelerator "bvh" TransformTimes 0 1 ColorSpace "srgb"', {}),
    ],
)
def test_settings(tmp_path: Path, header: str, expected: dict[str, Any]) -> None:
    found = load(tmp_path, BALL, header).settings
    usual = {"filter": wf.GaussianFilter(1.5, 0.5, windowed=True), "spp": 16, "max_bounces": 5}
    assert found == usual | expected


# ---- lights


@pytest.mark.parametrize(
    "given",
    [
        '"blackbody L" 3000',
        '"spectrum L" [ 400 1 500 3 700 9 ]',
        '"spectrum L" [ 7 ]',
        '"spectrum L" "stdillum-A"',
    ],
)
def test_light_of_a_spectrum_has_luminance_1(tmp_path: Path, given: str) -> None:
    found = light(tmp_path, f'LightSource "distant" {given} "float scale" 2').irradiance
    assert luminance(np.ravel(found)) == pytest.approx(2, rel=1e-5)
    assert (found[0] > found[2]) == ("7 ]" not in given)


def test_a_spot_that_falls_off_keeps_its_power(tmp_path: Path) -> None:
    text = 'LightSource "spot" "float power" 2 "float coneangle" 50 "float conedeltaangle" 20'
    spot = light(tmp_path, text)
    assert (spot.angle, spot.falloff) == (100, "smoothstep")
    assert spot.blend == pytest.approx(0.4)
    assert spot.record(np.zeros(3)).power(1)[0] == pytest.approx(2, rel=1e-4)


def test_area_lights_show_images(tmp_path: Path) -> None:
    write_image(tmp_path / "a.exr", np.array([[[4, 0, 0]], [[0, 0, 2]]], np.float32))
    found = shape(tmp_path, f'AreaLightSource "diffuse" "string filename" "a.exr" "float scale" 3 {SQUARE}')
    assert at(found.emission, 0.5, 0.9).tolist() == [12, 0, 0]
    assert found.uvs is not None


@pytest.mark.parametrize("header", ["", 'Camera "perspective"'])  # a camera without Scale -1 1 1 mirrors
def test_goniometric_lights_shine_as_their_image_says(tmp_path: Path, header: str) -> None:
    size = 64
    u, v = np.meshgrid(*2 * [(np.arange(size) + 0.5) / size])
    image = (square_to_sphere(u, v)[..., None] * [[[[0.3]]], [[[0.2]]], [[[0.1]]]]).sum(0) + 0.5
    write_image(tmp_path / "e.exr", np.repeat(image, 3, 2).astype(np.float32))
    statement = 'LightSource "goniometric" "string filename" "e.exr" "rgb I" [ 1 2 3 ]'
    found = light(tmp_path, f"Translate 1 2 3 Rotate 90 1 0 0 {statement}", header)
    x, y, z = world = square_to_sphere(*np.random.default_rng(2).random((2, 500)))
    points = np.stack([-1 - x if header else 1 + x, 2 + y, 3 + z])
    seen = found.record(np.zeros(3)).sample_li(points.astype(np.float32), np.zeros((2, 500), np.float32))
    # the light's x, y and z are the world's x, z and -y, and those of the image x, z and y of the light
    expected = 0.5 + 0.3 * world[0] + 0.2 * -world[1] + 0.1 * world[2]
    np.testing.assert_allclose(seen.radiance, np.outer([1, 2, 3], expected), atol=0.02)
    np.testing.assert_allclose(seen.wi, -world * [[-1 if header else 1], [1], [1]], atol=1e-5)
    bright = light(tmp_path, statement.partition('"rgb')[0] + '"float power" 8').record(np.zeros(3))
    assert bright.power(1)[0] == pytest.approx(8, rel=1e-3)
    write_image(tmp_path / "e.exr", np.ones((2, 3, 3), np.float32))
    with pytest.raises(wf.SceneError, match="3 × 2 pixels; it must be square"):
        light(tmp_path, statement)


def test_the_square_of_directions_is_that_of_pbrt() -> None:
    # of EqualAreaSquareToSphere: the middle is z, the middles of the edges are the other axes, the corners -z
    points = np.array([[0.5, 1, 0.5, 0, 0.5, 0], [0.5, 0.5, 1, 0.5, 0, 0]])
    expected = [[0, 0, 1], [1, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0], [0, 0, -1]]
    np.testing.assert_allclose(square_to_sphere(*points).T, expected, atol=1e-12)
    x, y = np.random.default_rng(1).random((2, 2000))
    direction = square_to_sphere(x, y)
    np.testing.assert_allclose((direction**2).sum(0), 1, atol=1e-12)
    np.testing.assert_allclose(sphere_to_square(direction), [x, y], atol=1e-9)
    assert (np.abs(direction.mean(1)) < 5 / np.sqrt(3 * 2000)).all()


@pytest.mark.parametrize("header", ["", 'Camera "perspective"'])  # a camera without Scale -1 1 1 mirrors
def test_environments_show_their_image_where_pbrt_does(tmp_path: Path, header: str) -> None:
    size = 32
    u, v = np.meshgrid(*2 * [(np.arange(size) + 0.5) / size])
    image = square_to_sphere(u, v).transpose(1, 2, 0) * 0.4 + 0.5  # its colors are the directions
    write_image(tmp_path / "e.exr", image.astype(np.float32))
    turn = "Rotate 90 1 0 0"  # the light's z is the world's -y, and its y the world's z
    text = f'{turn} LightSource "infinite" "string filename" "e.exr" "float scale" 2'
    record = light(tmp_path, text, header).record(np.zeros(3))
    x, y, z = world = square_to_sphere(*np.random.default_rng(2).random((2, 500)))
    scene = np.stack([-x if header else x, y, z]).astype(np.float32)
    expected = 2 * (np.stack([x, z, -y]) * 0.4 + 0.5)
    np.testing.assert_allclose(record.le(scene), expected, atol=0.04)
    assert world.shape == (3, 500)
    lit = 'LightSource "infinite" "string filename" "e.exr" "float illuminance" 5'
    record = light(tmp_path, lit).record(np.zeros(3))
    up = square_to_sphere(*np.random.default_rng(3).random((2, 4000)))
    found = luminance(record.le(up.astype(np.float32))) * np.maximum(up[2], 0)
    # the scale of pbrt brings twice what is asked for, as it counts half of the sphere for all of it
    assert found.mean() * 4 * np.pi == pytest.approx(2 * 5, abs=5 * found.std() / np.sqrt(4000) * 4 * np.pi)


def test_projections_are_not_mirrored(tmp_path: Path) -> None:
    write_image(tmp_path / "p.exr", np.array([[[9, 0, 0], [0, 9, 0]]], np.float32))
    camera = 'LookAt 0 0 0 0 0 1 0 1 0 Camera "perspective"'
    text = f'LightSource "projection" "string filename" "p.exr" "float fov" 60 {BALL}'
    for header in (camera, "Scale -1 1 1 " + camera):
        with pytest.warns(UserWarning, match="the fall of its light"):
            scene = load(tmp_path, text, header, strict=False)
        (lamp,) = scene.lights
        assert scene.camera is not None
        point = scene.camera.origin + scene.camera.rotation @ [
            -0.3,
            0,
            -1,
        ]  # left of the middle, for the camera
        seen = lamp.record(np.zeros(3)).sample_li(point.astype(np.float32)[:, None], None).radiance
        assert (seen[0] > seen[1]) == ("Scale" not in header)


# ---- materials


def test_measured_materials(tmp_path: Path) -> None:
    (tmp_path / "metal.bsdf").write_bytes(tensor_file(adaptive_fields()))
    statement = 'Material "measured" "string filename" "metal.bsdf"'
    assert type(material(tmp_path, statement).bsdf) is wf.Measured
    with pytest.raises(wf.SceneError, match="the limit is 1000"):
        wf.load(tmp_path / "scene.pbrt", limits=wf.LoadLimits(file_bytes=1000))
    (tmp_path / "metal.bsdf").write_bytes(b"none")
    with pytest.raises(wf.SceneError, match=r"line 3: material 'measured': .*metal\.bsdf: begins neither"):
        material(tmp_path, statement)


def test_glass_disperses_by_its_abbe_number(tmp_path: Path) -> None:
    red, green, blue = rows(material(tmp_path, 'Material "dielectric" "spectrum eta" "glass-F11"').bsdf.ior)
    assert 1.77 < red < green < blue < 1.83
    lines = 1 / np.square([0.4861, 0.6563, 0.464, 0.611])  # F and C, between which Abbe's number is defined
    assert blue - red == pytest.approx(
        0.7847 / 25.8 * (lines[2] - lines[3]) / (lines[0] - lines[1]), rel=1e-3
    )
    assert material(
        tmp_path, 'Material "thindielectric" "spectrum eta" "glass-BK7"'
    ).bsdf.ior == pytest.approx(1.518, abs=2e-3)


@pytest.mark.parametrize(("thickness", "base", "within"), [(0.01, 0.8, 0.002), (0.1, 0.3, 0.02)])
def test_the_coat_of_a_diffuse_surface_takes_light(
    tmp_path: Path, thickness: float, base: float, within: float
) -> None:
    text = (
        f'Material "coateddiffuse" "float thickness" {thickness} "rgb reflectance" [ {base} {base} {base} ]'
    )
    found = rows(material(tmp_path, text).bsdf.reflectance)[0]
    cos = (np.arange(100_000) + 0.5) / 100_000
    sin2 = (1 - cos * cos) * 1.5**2
    out = np.sqrt(np.maximum(1 - sin2, 0))
    parallel, across = (1.5 * out - cos) / (1.5 * out + cos), (1.5 * cos - out) / (1.5 * cos + out)
    inside = np.where(sin2 >= 1, 1, (parallel**2 + across**2) / 2)
    loss = np.exp(-thickness / cos)
    back, clear = (2 * cos * inside * [loss**2, np.ones_like(cos)]).mean(1)
    leaving = (2 * cos * loss * (1 - inside)).mean()
    for up in (0.4, 1.0):  # the cosine of the light that enters
        entry = np.exp(-thickness / np.sqrt(1 - (1 - up**2) / 1.5**2))
        expected = entry * base * leaving / (1 - base * back)  # a series of reflections at base and boundary
        assert found * (1 - clear) / (1 - found * clear) == pytest.approx(expected, rel=within)


def test_bumps_opacity_and_media(tmp_path: Path) -> None:
    write_image(tmp_path / "h.exr", np.random.default_rng(1).random((4, 4, 3)).astype(np.float32))
    write_image(tmp_path / "n.exr", np.full((4, 4, 3), 0.5, np.float32))
    image = 'Texture "h" "float" "imagemap" "string filename" "h.exr" "float scale" 3 '
    bumps = material(tmp_path, image + 'Material "diffuse" "texture displacement" "h"').normal_map
    assert isinstance(bumps, wf.BumpMap)
    assert (bumps.texture.scale == 3).all()
    assert isinstance(
        material(tmp_path, 'Material "diffuse" "string normalmap" "n.exr"').normal_map, wf.NormalMap
    )
    body = image + 'Material "diffuse" ' + SQUARE.strip()
    assert shape(tmp_path, body + '"float alpha" .25').material.alpha == np.float32(0.25)
    assert at(shape(tmp_path, body + '"texture alpha" "h"').material.alpha, 0.5, 0.5) > 0


def test_media_fill_shapes_and_space(tmp_path: Path) -> None:
    tea = """MakeNamedMedium "tea" "string type" "homogeneous" "rgb sigma_a" [ 1 2 3 ] "rgb sigma_s" [ 4 5 6 ]
    "float scale" 2 "float g" .5 "rgb Le" [ 1 1 2 ] "float Lescale" 3 """
    inside = shape(tmp_path, f'{tea} MediumInterface "tea" "" Material "interface" {BALL}').material.interior
    assert (rows(inside.sigma_a), rows(inside.sigma_s)) == ([2, 4, 6], [8, 10, 12])
    assert rows(inside.glow) == [6, 12, 36]  # σa times Le, as in pbrt
    assert inside.phase.g == 0.5
    fog = 'MakeNamedMedium "fog" "string type" "homogeneous" MediumInterface "" "fog" Camera "perspective"'
    scene = load(tmp_path, f'{tea} {SQUARE} MediumInterface "tea" "fog" {BALL}', fog)
    assert scene.medium is not None
    assert rows(scene.medium.sigma_s) == [1, 1, 1]  # type: ignore[attr-defined]
    assert [each.material.interior is None for each in scene.shapes] == [True, False]
    numbers = " ".join(map(str, range(6)))
    smoke = f"""MakeNamedMedium "s" "string type" "uniformgrid" "integer nx" 3 "integer nz" 2 "float density"
    [ {numbers} ] "rgb sigma_a" [ 1 2 3 ] "float scale" 2 "point3 p1" [ 3 4 5 ] "point3 p0" [ 1 2 3 ]"""
    use = f'MediumInterface "s" "" Material "interface" {BALL}'
    glow = '"rgb Le" [ 1 1 2 ] "float Lescale"'
    grid = shape(tmp_path, f"Translate 0 0 1 {smoke} {use}").material.interior
    assert grid.density.tolist() == [[[0, 1, 2]], [[3, 4, 5]]]
    assert grid.bounds.tolist() == [[1, 2, 4], [3, 4, 6]]
    assert (rows(grid.sigma_a), rows(grid.sigma_s)) == ([2, 4, 6], [2, 2, 2])
    grid = shape(tmp_path, f"{smoke} {glow} [ {numbers} ] {use}").material.interior
    assert grid.glow_grid[1, 0, 2].tolist() == [2 * 25 * each for each in (1, 2, 6)]
    with pytest.raises(wf.SceneError, match="Lescale has 1 numbers; nx, ny and nz make 6"):
        load(tmp_path, f"{smoke} {glow} 1 {use}")
    smoke = f"""MakeNamedMedium "s" "string type" "rgbgrid" "integer nx" 2 "rgb sigma_s" [ 1 2 3 4 5 6 ]
    "rgb Le" [ 1 1 1 2 3 4 ] "float Lescale" 5 "float scale" 2 "float g" .5 {{}} {use}"""
    grid = shape(tmp_path, smoke.format('"rgb sigma_a" [ 3 2 1 0 5 0 ]')).material.interior
    assert grid.density.tolist() == [[[[4, 4, 4], [4, 10, 6]]]]
    assert grid.albedo.ravel().tolist() == pytest.approx([1 / 4, 2 / 4, 3 / 4, 1, 1 / 2, 1])
    assert grid.glow_grid.ravel().tolist() == [30, 20, 10, 0, 150, 0]
    assert (grid.scale, grid.phase.g) == (2, 0.5)
    grid = shape(tmp_path, smoke.format("")).material.interior  # it absorbs 1 where nothing is said
    assert grid.density.ravel().tolist() == [2, 3, 4, 5, 6, 7]
    for body, message in (
        (smoke.format('"rgb sigma_a" [ 1 1 1 ]'), "sigma_a has 1 colors; nx, ny and nz make 2"),
        (f'MakeNamedMedium "s" "string type" "rgbgrid" {use}', "has no sigma_a and no sigma_s"),
    ):
        with pytest.raises(wf.SceneError, match=message):
            load(tmp_path, body)
    same = shape(tmp_path, f'{tea} MediumInterface "tea" {BALL}')  # the same on both sides
    assert same.material.interior is None


def test_light_through_a_sheet(tmp_path: Path) -> None:
    """A sheet before or behind which the sun stands has the radiance E·part/π."""
    sheet = '''LookAt 0 0 5 0 0 0 0 1 0 Camera "perspective" "float fov" 5 Film "rgb" "integer xresolution" 8
    "integer yresolution" 8 WorldBegin LightSource "distant" "point3 from" [ 0 0 {z} ] "point3 to" [ 0 0 0 ]
    "rgb L" [ 1 2 3 ] Material "diffusetransmission" "rgb reflectance" [ .2 .4 .8 ]
    "rgb transmittance" [ .6 .2 .1 ] Shape "disk"'''
    for z, expected in ((1, (0.2, 0.8, 2.4)), (-1, (0.6, 0.4, 0.3))):
        path = tmp_path / "sheet.pbrt"
        path.write_text(sheet.replace("{z}", str(z)))
        mean = wf.render(wf.load(path, strict=True), 4, progress=False).rgb.mean((0, 1))
        assert mean == pytest.approx(np.array(expected) / np.pi, rel=1e-5)


@pytest.mark.parametrize(
    "inside",
    [
        'LightSource "point" "rgb I" [ 3.14159265 3.14159265 3.14159265 ]',
        'LightSource "point" "rgb I" [ 1 1 1 ] "float power" 39.4784176',  # 4π²
        'AreaLightSource "diffuse" "rgb L" [ .5 .5 .5 ] ReverseOrientation',
    ],
    ids=["point", "power", "area"],
)
def test_inside_of_a_ball_all_is_equally_bright(tmp_path: Path, inside: str) -> None:
    """The closed forms of pbrt's tests of integrators: half of the light is scattered, half of that, ..."""
    path = tmp_path / "ball.pbrt"
    path.write_text(
        f"""LookAt 0 0 -.4 0 .1 1 0 1 0 Camera "perspective" "float fov" 45 Film "rgb"
        "integer xresolution" 12 "integer yresolution" 12 Integrator "path" "integer maxdepth" 60 WorldBegin
        {inside} Material "diffuse" "rgb reflectance" [ .5 .5 .5 ] Shape "sphere" "float radius" 1"""
    )
    mean = wf.render(wf.load(path, strict=True), 64, progress=False).mean()
    assert (np.abs(mean.value - 1) <= 4 * mean.standard_error + 1e-5).all()


# ---- textures


IMAGE_I, IMAGE_C = (f'"imagemap" "string filename" "{name}" ' for name in ("i.exr", "c.png"))


@pytest.mark.parametrize(
    ("texture", "point", "expected"),
    [
        ('"constant" "rgb value" [ .1 .2 .3 ]', (0, 0), [0.1, 0.2, 0.3]),
        ('"checkerboard"', (0.5, 0.5), [1, 1, 1]),
        ('"checkerboard"', (0.99, 0.99), [1, 1, 1]),
        ('"checkerboard" "float uscale" 4 "float vscale" 2', (0.3, 0.2), [0, 0, 0]),
        ('"checkerboard" "float uscale" 4 "float vscale" 2', (0.3, 0.7), [1, 1, 1]),
        ('"checkerboard" "float udelta" 1', (0.5, 0.5), [0, 0, 0]),
        ('"checkerboard" "rgb tex1" [ .1 .2 .3 ]', (0.5, 0.5), [0.1, 0.2, 0.3]),
        ('"checkerboard" "texture tex2" "i" "float udelta" 1', (0.25, 0.75), [0.5, 0, 0]),
        ('"mix" "rgb tex1" [ .2 0 0 ] "float amount" .25', (0, 0), [0.4, 0.25, 0.25]),
        ('"mix" "texture tex1" "i" "texture amount" "f"', (0.25, 0.75), [0.75, 0.5, 0.5]),
        ('"scale" "texture tex" "i" "float scale" .5', (0.25, 0.75), [0.25, 0, 0]),
        ('"scale" "texture tex" "i" "texture scale" "f"', (0.25, 0.75), [0.25, 0, 0]),
        ('"scale" "texture tex" "i" "float scale" 9', (0.25, 0.75), [1, 0, 0]),  # clamped
        (IMAGE_I, (0.75, 0.75), [0, 0.5, 0]),
        (IMAGE_I, (0.25, 0.25), [0, 0, 0.5]),
        (IMAGE_I + '"bool invert" true', (0.25, 0.25), [1, 1, 0.5]),
        (IMAGE_I + '"float uscale" .5', (0.5, 0.75), [0.5, 0, 0]),
        (IMAGE_I + '"string wrap" "clamp"', (9, 0.75), [0, 0.5, 0]),
        (IMAGE_I + '"string filter" "point"', (0.1, 0.9), [0.5, 0, 0]),
        (IMAGE_C, (0.5, 0.5), [0.2158] * 3),
        (IMAGE_C + '"string encoding" "linear"', (0, 0), [0.502] * 3),
        (IMAGE_C + '"string encoding" "gamma 2"', (0, 0), [0.252] * 3),
    ],
)
def test_textures(tmp_path: Path, texture: str, point: Any, expected: Any) -> None:
    write_image(
        tmp_path / "i.exr", np.array([[[0.5, 0, 0], [0, 0.5, 0]], [[0, 0, 0.5], [0, 0, 0]]], np.float32)
    )
    from PIL import Image

    Image.fromarray(np.full((2, 2, 3), 128, np.uint8)).save(tmp_path / "c.png")
    others = """Texture "i" "spectrum" "imagemap" "string filename" "i.exr"
    Texture "f" "float" "constant" "float value" .5"""
    found = material(
        tmp_path, f'{others} Texture "t" "spectrum" {texture} Material "diffuse" "texture reflectance" "t"'
    ).bsdf.reflectance
    value = at(found, *point) if isinstance(found, wf.BaseTexture) else np.ravel(found)
    np.testing.assert_allclose(np.broadcast_to(value, 3), expected, atol=1e-3)


@pytest.mark.parametrize("count", [1, 2, 3, 5])
def test_no_point_changes_the_texture_of_another(tmp_path: Path, count: int) -> None:
    write_image(tmp_path / "i.exr", np.random.default_rng(1).random((4, 4, 3)).astype(np.float32) * 0.5)
    text = """Texture "i" "spectrum" "imagemap" "string filename" "i.exr"
    Texture "f" "float" "imagemap" "string filename" "i.exr"
    Texture "g" "float" "scale" "texture tex" "f" "texture scale" "f"
    Texture "t" "spectrum" "mix" "rgb tex1" [ .1 .2 .3 ] "texture tex2" "i" "texture amount" "g"
    Material "conductor" "texture reflectance" "t" "texture roughness" "g" """
    bsdf = material(tmp_path, text).bsdf
    uv = np.random.default_rng(2).random((2, count), np.float32)
    for texture in (bsdf.k, bsdf.roughness):
        alone = [at(texture, *point) for point in uv.T]
        np.testing.assert_array_equal(texture.at(SimpleNamespace(uv=uv)).T, alone)


BILERP = 'Texture "t" "%s" "bilerp" "float uscale" 2 %s '


def test_bilerp_goes_on_beyond_its_corners(tmp_path: Path) -> None:
    corners = " ".join(
        f'"rgb v{i}{j}" [ {i * 0.2 + j * 0.1} {i * j * 0.5} .25 ]' for i in (0, 1) for j in (0, 1)
    )
    paint = 'Material "diffuse" "texture reflectance" "t"'
    found = material(tmp_path, BILERP % ("spectrum", corners) + paint).bsdf.reflectance
    for u, v in ((0, 0), (0.25, 0.75), (0.75, 0.5)):
        s, t = 2 * u, v
        np.testing.assert_allclose(at(found, u, v), [0.2 * s + 0.1 * t, 0.5 * s * t, 0.25], atol=1e-6)
    numbers = 'Material "conductor" "texture roughness" "t" "bool remaproughness" false'
    rough = material(
        tmp_path,
        BILERP % ("float", '"float v00" .04 "float v01" .04 "float v10" .36 "float v11" .36') + numbers,
    )
    assert at(rough.bsdf.roughness, 0.25, 0.5) == pytest.approx(np.sqrt(0.2))


DOTS = ["0000000", "1111101", "1111001", "0110111", "1111111", "1011101", "1000001"]
NOISE = [
    (0.25, 0.75, 0.13346624),
    (3.1, 2.6, 0.44213372),
    (-1.7, 4.2, -0.21442018),
    (100.3, -250.9, 0.11975842),
    (255.5, 256.5, -0.25),
    (0, 0, 0.5),
    (12345.25, 7.125, -0.09104389),
]


def test_dots_are_those_of_pbrt(tmp_path: Path) -> None:
    text = """Texture "t" "spectrum" "dots" "rgb inside" [ .5 .25 0 ] "rgb outside" [ 0 0 .75 ]
    "float uscale" 8 "float vscale" 8 Material "diffuse" "texture reflectance" "t" """
    texture = material(tmp_path, text).bsdf.reflectance
    u, v = np.meshgrid(*2 * [(np.arange(400, dtype=np.float32) + 0.5) / 400])
    red, green, blue = texture.at(SimpleNamespace(uv=np.stack([u.ravel(), v.ravel()])))
    inside = (red > 0.2).reshape(400, 400)
    assert set(np.unique(np.stack([red, green, blue], 1), axis=0).ravel().tolist()) == {0, 0.25, 0.5, 0.75}
    cells = inside[25:375, 25:375].reshape(7, 50, 7, 50).mean((1, 3))  # whole cells around 1, 2, ... 7
    assert ((cells == 0) | (np.abs(cells - np.pi * 0.35**2) < 0.01)).all()
    for column, row in np.argwhere(cells.T > 0):
        part = np.argwhere(inside[25 + 50 * row :, 25 + 50 * column :][:50, :50]).mean(0)[::-1]
        found = (part + 0.5) / 50 - 0.5  # from the middle of the cell
        x, y = np.float32(column + 1), np.float32(row + 1)
        shift = noise(np.array([x + 1.5, x + 4.5], np.float32), np.array([y + 2.8, y + 9.8], np.float32))
        np.testing.assert_allclose(found, 0.15 * shift, atol=3e-3)
    # of Noise(x + 0.5, y + 0.5) of pbrt-v4, compiled: the rows are y from 1 on
    assert ["".join("01"[int(cell > 0)] for cell in row) for row in cells] == DOTS


def test_the_noise_is_that_of_pbrt() -> None:
    """Values of Noise(x, y) of pbrt-v4, compiled."""
    x, y, expected = np.array(NOISE, np.float32).T
    np.testing.assert_allclose(noise(x, y), expected, atol=2e-6)


def test_a_direction_mixes_textures(tmp_path: Path) -> None:
    text = """Rotate 90 1 0 0 Texture "t" "spectrum" "directionmix" "rgb tex1" [ 1 0 0 ] "rgb tex2" [ 0 1 0 ]
    "vector3 dir" [ 0 2 0 ] Rotate -90 1 0 0 Material "diffuse" "texture reflectance" "t" """
    texture = material(tmp_path, text).bsdf.reflectance  # along the world's z
    normals = np.array([[0, 0, 1], [0, 0, -1], [1, 0, 0], [0, 0.6, 0.8]], np.float32).T
    found = texture.at(SimpleNamespace(ng=normals)).T
    np.testing.assert_allclose(found, [[1, 0, 0], [1, 0, 0], [0, 1, 0], [0.8, 0.2, 0]], atol=1e-6)


MAPPED = """Translate 1 0 0 Texture "t" "spectrum" "imagemap" "string filename" "i.exr" "string mapping" "%s"
    %s Translate -1 0 0 Material "diffuse" "texture reflectance" "t" """


@pytest.mark.parametrize("header", ["", 'Camera "perspective"'])
@pytest.mark.parametrize("kind", ["planar", "cylindrical", "spherical"])
def test_mappings_by_the_place(tmp_path: Path, kind: str, header: str) -> None:
    """Of points relative to (1, 0, 0), where the texture was stated."""
    write_image(tmp_path / "i.exr", np.full((2, 2, 3), 0.5, np.float32))
    more = '"vector3 v1" [ 0 2 0 ] "vector3 v2" [ 1 0 1 ] "float udelta" 3 "float vdelta" 4' * (
        kind == "planar"
    )
    ball = 'Translate 1.5 .25 0 Shape "sphere" "float radius" 2'  # the axis is inside of it
    (mesh,) = load(tmp_path, MAPPED % (kind, more) + ball, header).shapes
    texture = mesh.material.bsdf.reflectance
    assert texture.uv_set == 1
    assert mesh.uvs is not None
    x, y, z = (mesh.vertices * (-1 if header else 1, 1, 1) - (1, 0, 0)).T
    turn = np.arctan2(y, x) / (2 * np.pi)
    if kind == "planar":
        expected = np.stack([2 * y + 3, x + z + 4], 1)
    elif kind == "cylindrical":
        expected = np.stack([turn + 0.5, z], 1)
    else:
        expected = np.stack([np.arccos(z / np.sqrt(x * x + y * y + z * z)) / np.pi, turn % 1], 1)
    off = mesh.uvs1 - expected
    np.testing.assert_allclose(off, np.rint(off) * (kind != "planar"), atol=1e-9)
    spread = np.ptp(mesh.uvs1[mesh.faces], axis=1)
    if kind != "planar":  # none but the two triangles around the axis spans the texture where its ends meet
        assert (spread[:, 0 if kind == "cylindrical" else 1] > 0.5).sum() <= 2
        assert np.rint(off).any()


def test_corners_on_the_axis_get_the_turn_of_the_others(tmp_path: Path) -> None:
    write_image(tmp_path / "i.exr", np.full((2, 2, 3), 0.5, np.float32))
    fan = 'Shape "trianglemesh" "point3 P" [ 1 0 0 2 0 0 1 1 0 ]'
    for order, at_axis in (("0 1 2", 0), ("1 2 0", 2)):
        mesh = shape(tmp_path, MAPPED % ("cylindrical", "") + f'{fan} "integer indices" [ {order} ]')
        turns = mesh.uvs1[mesh.faces[0], 0]
        np.testing.assert_allclose(np.sort(turns), [0.5, 0.625, 0.75])
        assert turns[at_axis] == pytest.approx(0.625)


def test_mappings_beside_others_and_in_objects(tmp_path: Path) -> None:
    write_image(tmp_path / "i.exr", np.full((2, 2, 3), 0.5, np.float32))
    one = MAPPED % ("spherical", "")
    two = one.replace('"t"', '"s"', 1).replace("spherical", "planar")
    both = f"""{two} {one} Texture "p" "spectrum" "scale" "texture tex" "t" "float scale" .5
    Texture "m" "spectrum" "mix" "texture tex1" "p" "texture tex2" "s"
    Material "diffuse" "texture reflectance" "m" """
    with pytest.raises(wf.SceneError, match="a second mapping by the place; the first one in its place"):
        shape(tmp_path, both + SQUARE)
    with pytest.raises(wf.SceneError, match="where its instances are"):
        load(tmp_path, f'{one} ObjectBegin "o" {SQUARE} ObjectEnd ObjectInstance "o"')
    flat = one.replace('"string mapping"', '"string other"')
    with pytest.raises(wf.SceneError, match="other"):
        shape(tmp_path, flat + SQUARE)
    with pytest.raises(wf.SceneError, match="the transform of its mapping is singular"):
        shape(tmp_path, f"Scale 1 0 1 {one} Identity {SQUARE}")


def test_textures_of_numbers_make_roughness(tmp_path: Path) -> None:
    write_image(tmp_path / "r.exr", np.full((2, 2, 3), 0.0625, np.float32))
    text = """Texture "r" "float" "imagemap" "string filename" "r.exr"
    Material "conductor" "texture roughness" "r" """
    assert at(material(tmp_path, text).bsdf.roughness, 0.5, 0.5) == pytest.approx(0.5)
    assert at(
        material(tmp_path, f'{text} "bool remaproughness" false').bsdf.roughness, 0, 0
    ) == pytest.approx(0.25)


# ---- shapes


def area(mesh: Any) -> float:
    a, b, c = (mesh.vertices[mesh.faces[:, i]] for i in range(3))
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)


def front(mesh: Any) -> Any:
    """Return the normals of the fronts of the faces, and the middles of the faces."""
    a, b, c = (mesh.vertices[mesh.faces[:, i]] for i in range(3))
    return np.cross(b - a, c - a), (a + b + c) / 3


@pytest.mark.parametrize(
    ("statement", "expected"),
    [
        ('Shape "sphere" "float radius" 2 "float zmax" 1', 2 * np.pi * 2 * 3),
        ('Shape "sphere" "float phimax" 90', np.pi),
        ('Shape "disk" "float radius" 2 "float innerradius" 1', 3 * np.pi),
        ('Shape "disk" "float phimax" 180', np.pi / 2),
        ('Shape "cylinder" "float radius" 2 "float zmin" 0 "float zmax" 3', 12 * np.pi),
        (SQUARE, 1),
        ('Shape "bilinearmesh" "point3 P" [ 0 0 0 2 0 0 0 3 0 2 3 0 ]', 6),
    ],
)
def test_areas(tmp_path: Path, statement: str, expected: float) -> None:
    assert area(shape(tmp_path, statement)) == pytest.approx(expected, rel=2e-3)


def test_stretched_spheres_are_meshes(tmp_path: Path) -> None:
    egg = shape(tmp_path, 'Scale 1 1 3 Shape "sphere"')
    np.testing.assert_allclose(np.ptp(egg.vertices, axis=0), [2, 2, 6])
    np.testing.assert_allclose((egg.vertices**2 / [1, 1, 9]).sum(1), 1)


@pytest.mark.parametrize("before", ["", "Scale 1 1 -1", "Scale -1 1 1 Rotate 20 1 1 0"])
@pytest.mark.parametrize(
    "statement",
    [
        'Shape "sphere" "float zmax" .5',
        'Shape "cylinder"',
        SQUARE + '"normal N" [ 0 0 -1 0 0 -1 0 0 -1 0 0 -1 ]',
    ],
)
def test_fronts_are_where_pbrt_has_them(tmp_path: Path, statement: str, before: str) -> None:
    for reverse, sign in (("", 1), ("ReverseOrientation", -1)):
        mesh = shape(tmp_path, f"{reverse} {before} {statement}")
        normal, middle = front(mesh)
        if "N" in statement:
            matrix = shape(
                tmp_path, f'{before} Shape "trianglemesh" "point3 P" [ 0 0 -1 1 0 0 0 1 0 ]'
            ).vertices
            middle = matrix[:1]  # the mesh itself has the origin on it: its front looks to -z
        assert ((normal * middle).sum(1) * sign > 0).all()
        if mesh.normals is not None:
            assert ((normal * mesh.normals[mesh.faces[:, 0]]).sum(1) > 0).all()


def test_meshes_take_normals_and_texture_coordinates(tmp_path: Path) -> None:
    mesh = shape(tmp_path, SQUARE + '"point2 uv" [ 0 0 2 0 2 2 0 2 ] "normal N" [ 0 0 1 0 0 1 0 1 1 0 0 2 ]')
    assert mesh.uvs.tolist() == [[0, 0], [2, 0], [2, 2], [0, 2]]
    np.testing.assert_allclose(mesh.normals[2:], [[0, 0.5**0.5, 0.5**0.5], [0, 0, 1]])
    assert shape(tmp_path, SQUARE).normals is None
    board = 'Texture "t" "spectrum" "checkerboard" Material "diffuse" "texture reflectance" "t" '
    assert shape(tmp_path, board + SQUARE).uvs.tolist() == [[0, 0], [1, 0], [1, 1]] * 2


def turn(x: Any, y: Any) -> Any:
    return np.arctan2(y, x) / (2 * np.pi) % 1


@pytest.mark.parametrize(
    ("statement", "expected"),
    [
        ('Shape "sphere" "float zmax" .5', lambda x, y, z: (turn(x, y), (1 - np.arccos(z) / np.pi) * 1.5)),
        ('Shape "sphere" "float phimax" 180', lambda x, y, z: (2 * turn(x, y), 1 - np.arccos(z) / np.pi)),
        ('Shape "disk" "float innerradius" .5', lambda x, y, z: (turn(x, y), 2 - 2 * np.hypot(x, y))),
        ('Shape "cylinder" "float zmax" 3', lambda x, y, z: (turn(x, y), (z + 1) / 4)),
        ('Shape "bilinearmesh" "point3 P" [ 0 0 0 1 0 0 0 1 0 1 1 0 ]', lambda x, y, z: (x, y)),
    ],
)
def test_texture_coordinates(tmp_path: Path, statement: str, expected: Any) -> None:
    mesh = shape(tmp_path, statement)
    with np.errstate(invalid="ignore"):
        found = np.stack(expected(*np.clip(mesh.vertices, -1 if "sphere" in statement else -9, 9).T), 1)
    seam = (np.abs(mesh.uvs[:, 0] - 0.5) > 0.49) | (np.hypot(*mesh.vertices.T[:2]) < 1e-9)  # u may be 0 or 1
    inner = ~seam | ("bilinear" in statement)
    np.testing.assert_allclose(mesh.uvs[inner], found[inner], atol=1e-6)
    assert inner.any()


@pytest.mark.parametrize("name", ["ball.ply", "ball.ply.gz"])
def test_ply_files(tmp_path: Path, name: str) -> None:
    data = trimesh.creation.icosphere(subdivisions=1).export(file_type="ply")
    (tmp_path / name).write_bytes(gzip.compress(data) if name.endswith("gz") else data)
    mesh = shape(tmp_path, f'Translate 0 0 5 Shape "plymesh" "string filename" "{name}"')
    assert (mesh.name, len(mesh.faces)) == ("ball", 80)
    assert mesh.vertices[:, 2].mean() == pytest.approx(5)


def test_loop_subdivision(tmp_path: Path) -> None:
    solid = """Shape "loopsubdiv" "point3 P" [ 1 1 1 -1 -1 1 -1 1 -1 1 -1 -1 ]
    "integer indices" [ 0 2 1 0 1 3 0 3 2 1 2 3 ]"""
    assert len(shape(tmp_path, f'{solid} "integer levels" 2').faces) == 64


def test_objects_are_placed_by_both_transforms(tmp_path: Path) -> None:
    body = f"""Translate 1 0 0 ObjectBegin "o" Translate 0 1 0 {SQUARE} {BALL} ObjectEnd
    Translate 0 0 1 ObjectInstance "o" """
    scene = load(tmp_path, f'{body} Scale -2 1 1 ObjectInstance "o"')
    assert all(isinstance(each, wf.Instance) for each in scene.shapes)
    assert len({id(each.mesh) for each in scene.shapes}) == 2  # type: ignore[attr-defined]
    flat = [each.to_mesh() for each in scene.shapes[::2]]  # type: ignore[attr-defined]
    # each transform holds all that was in force where it was stated: 1 + 1 in x
    assert [mesh.vertices[0].tolist() for mesh in flat] == [[2, 1, 1], [-1, 1, 1]]
    assert (front(flat[0])[0][:, 2] > 0).all()
    assert (front(flat[1])[0][:, 2] > 0).all()  # a reflection keeps the front


def test_objects_are_mirrored_with_the_world(tmp_path: Path) -> None:
    made = f'ObjectBegin "o" Translate 1 0 0 {SQUARE} ObjectEnd'
    body = f'{made} Translate 2 3 4 Rotate 90 0 0 1 ObjectInstance "o"'
    (mesh,) = load(tmp_path, body, 'Camera "perspective"').shapes
    np.testing.assert_allclose(mesh.bounds, [[-2, 4, 4], [-1, 5, 4]], atol=1e-12)
    assert (front(mesh.to_mesh())[0][:, 2] > 0).all()  # type: ignore[attr-defined]


def test_balls_of_objects_are_exact_unless_they_are_stretched(tmp_path: Path) -> None:
    body = f'ObjectBegin "o" Translate 0 1 0 {BALL} ObjectEnd Scale 2 -2 2 ObjectInstance "o"'
    (ball,) = load(tmp_path, body).shapes
    assert isinstance(ball, wf.Sphere)
    assert (ball.center.tolist(), ball.radius) == ([0, -2, 0], 2 * shape(tmp_path, BALL).radius)


# ---- what is not honored


# what may be before WorldBegin, and what after it
IN_HEADER = [
    ('Film "rgb" "string sensor" "canon_eos_5d" Camera "perspective"', "line 1: film 'rgb': sensor"),
    ('Film "rgb" "float maxcomponentvalue" 9 Camera "perspective"', "film 'rgb': maxcomponentvalue"),
    ('Camera "realistic"', "camera 'realistic': a perspective camera in its place"),
    ('Scale 1 1 2 Camera "perspective"', "camera 'perspective': a transform that scales unevenly"),
    ('PixelFilter "mitchell"', "filter 'mitchell': the default in its place"),
    ('PixelFilter "triangle" "float xradius" 1', "filter 'triangle': yradius; 1 in its place"),
    ('Integrator "bdpt"', "integrator 'bdpt': path tracing in its place"),
    ('Integrator "randomwalk"', "integrator 'randomwalk': path tracing in its place"),
    ('Integrator "path" "bool regularize" true', "integrator 'path': regularize"),
    ('ColorSpace "rec2020"', "line 1: ColorSpace 'rec2020'; 'srgb' in its place"),
    ('Option "forcediffuse" true', "line 1: Option 'forcediffuse'"),
]
IN_WORLD = [
    ('Shape "curve"', "line 3: shape 'curve': left out"),
    (f'{BALL} Shape "curve" Shape "curve"', "line 4: shape 'curve': left out"),
    (f'{BALL} Shape "curve"\nShape "curve"\nShape "curve"', "line 4: shape 'curve': left out (2 more)"),
    ('Shape "disk" "float size" 2', "line 3: shape 'disk': size"),
    ('Shape "bilinearmesh" "point3 P" [ 0 0 0 1 0 0 0 1 0 1 1 1 ]', "the curvature of its patches"),
    ('Material "hair"', "material 'hair': a diffuse surface in its place"),
    ('Material "subsurface"', "material 'subsurface': light below the surface"),
    ('Material "coatedconductor"', "material 'coatedconductor': the light between its layers"),
    ('Material "coateddiffuse" "float albedo" .5', "material 'coateddiffuse': albedo"),
    ('Material "coateddiffuse" "float uroughness" .5', "material 'coateddiffuse': vroughness"),
    ('MakeNamedMaterial "n" "string type" "diffuse" "float z" 1 NamedMaterial "n"', "'diffuse' 'n': z"),
    ('Texture "t" "float" "fbm" Material "diffuse" "texture displacement" "t"', "'fbm' 't': 0.5"),
    (
        f'Texture "t" "spectrum" "checkerboard" "integer dimension" 3 {PAINTED}',
        "texture 'checkerboard' 't': dimension 3",
    ),
    ('LightSource "infinite" "point3 portal" [ 0 0 0 1 0 0 1 1 0 0 1 0 ]', "light 'infinite': portal"),
    ('LightSource "distant" "spectrum L" "stdillum-F2"', "L 'stdillum-F2'; white in its place"),
    ('MakeNamedMedium "m" "string type" "cloud" MediumInterface "m" ""', "medium 'cloud' 'm': left out"),
    ('MakeNamedMedium "m" "string type" "homogeneous" MediumInterface "" "m"', "the medium 'm' outside"),
    ('AreaLightSource "diffuse" Shape "sphere" "float alpha" 0', "'sphere': alpha 0 of an area light"),
    (
        f'AreaLightSource "diffuse" ObjectBegin "o" {SQUARE} ObjectEnd ObjectInstance "o"',
        "shape 'trianglemesh': the light of a shape in an object",
    ),
]


@pytest.mark.parametrize(
    ("header", "body", "message"),
    [(text, "", message) for text, message in IN_HEADER] + [("", *each) for each in IN_WORLD],
)
def test_what_is_not_honored_is_one_warning(tmp_path: Path, header: str, body: str, message: str) -> None:
    with pytest.warns(UserWarning, match="not honored") as caught:
        load(tmp_path, f"{body} {BALL}", header, strict=False)
    assert [message in str(each.message) for each in caught] == [True]
    assert "scene.pbrt: not honored: line " in str(caught[0].message)
    with pytest.raises(wf.SceneError, match="not honored"):
        load(tmp_path, f"{body} {BALL}", header)


def test_pictures_have_pbrts_brightness_and_sides(tmp_path: Path) -> None:
    header = """LookAt 0 0 0 0 0 1 0 1 0 Camera "perspective" "float fov" 90 PixelFilter "box"
    Film "rgb" "integer xresolution" 8 "integer yresolution" 8 "float iso" 50"""
    body = """LightSource "distant" "point3 from" [ 0 0 -1 ] "point3 to" [ 0 0 0 ] "float illuminance" 3
    Translate 0 0 1 Material "diffuse" "rgb reflectance" [ .5 0 0 ]
    Shape "trianglemesh" "point3 P" [ 0 -2 0 2 -2 0 2 2 0 0 2 0 ] "integer indices" [ 0 1 2 0 2 3 ]
    Material "diffuse" "rgb reflectance" [ 0 .5 0 ] Translate -2 0 0
    Shape "trianglemesh" "point3 P" [ 0 -2 0 2 -2 0 2 2 0 0 2 0 ] "integer indices" [ 0 1 2 0 2 3 ]"""
    for mirror in (False, True):
        scene = load(tmp_path, body, ("Scale -1 1 1 " if mirror else "") + header)
        red, green, _ = wf.render(scene, spp=1, progress=False).rgb.transpose(2, 0, 1)
        if mirror:
            red, green = green, red
        np.testing.assert_allclose(red[:, 4:], 0.5 * 0.5 * 3 / np.pi, rtol=1e-5)
        np.testing.assert_allclose(green[:, :4], 0.5 * 0.5 * 3 / np.pi, rtol=1e-5)


def test_the_documentation_names_all_types() -> None:
    text = DOCS.read_text()
    assert [key for key in TABLE.makers if f"`{key[1]}`" not in text] == []


def test_a_surface_of_loops_may_have_vertices_without_faces(tmp_path) -> None:
    path = tmp_path / "a.pbrt"
    path.write_text(
        'WorldBegin\nShape "loopsubdiv" "integer levels" 1 "integer indices" [0 1 2 0 2 9] '
        '"point3 P" [0 0 0 1 0 0 1 1 0 0 1 0]\n'
    )
    with pytest.warns(UserWarning, match="face with a vertex that does not exist"):
        scene = wf.load(path)
    assert len(scene.shapes[0].faces) == 4
