"""Scene files of pbrt: tokens, includes, the graphics state, and what is refused."""

from __future__ import annotations

import gzip
import random
import re
import tracemalloc
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from counting import calls
from inside import SceneError, SceneFiles, Statement, main, statements, write_image
from scipy.spatial.transform import Rotation, Slerp

import wavefront as wf

BALL = 'Shape "sphere"\n'
POINT = 'Shape "trianglemesh" "point3 P" [ 1 2 3  1 3 3  2 2 3 ]\n'  # the first vertex is (1, 2, 3)
FULL = """Scale -1 1 1 LookAt 0 1 5 0 1 0 0 1 0
Camera "perspective" "float fov" 40 "float lensradius" .1 "float focaldistance" [ 5 ]
Film "rgb" "integer xresolution" 8 "integer yresolution" 6 "float iso" 200
Sampler "halton" "integer pixelsamples" 2
PixelFilter "box" Integrator "path" "integer maxdepth" 3
WorldBegin # comment
MakeNamedMaterial "red" "string type" "coateddiffuse" "rgb reflectance" [ .7 .1 .1 ] "float roughness" .1
Texture "board" "spectrum" "checkerboard" "rgb tex1" [ 1 1 1 ] "float uscale" 4
Texture "half" "spectrum" "scale" "texture tex" "board" "float scale" .5
LightSource "infinite" "blackbody L" 5000 LightSource "distant" "spectrum L" [ 400 1 500 .5 700 2 ]
ObjectBegin "pair" Material "diffuse" "texture reflectance" "half"
Shape "disk" Translate 0 1 0 Shape "cylinder"
ObjectEnd
AttributeBegin Rotate 30 0 1 0 ObjectInstance "pair" Translate 2 0 0 ObjectInstance "pair" AttributeEnd
AttributeBegin NamedMaterial "red" AreaLightSource "diffuse" "rgb L" [ 1 2 3 ] "bool twosided" true
Shape "trianglemesh" "point3 P" [ 0 0 0 1 0 0 1 1 0 0 1 0 ] "integer indices" [ 0 1 2 0 2 3 ] AttributeEnd
MakeNamedMedium "tea" "string type" "homogeneous" "rgb sigma_a" [ 1 2 3 ] "float sigma_s" 0
MediumInterface "tea" "" Material "dielectric" "spectrum eta" "glass-BK7" Shape "sphere" "float radius" 2
"""


def parse(folder: Path, text: str) -> list[Statement]:
    path = folder / "scene.pbrt"
    return list(statements(SceneFiles(path), path, text.encode()))


def load(folder: Path, body: str, header: str = "", **options: object) -> wf.Scene:
    path = folder / "scene.pbrt"
    path.write_text(f"{header}\nWorldBegin\n{body}\n")
    options = {"strict": True} | options
    return wf.load(path, **options)  # type: ignore[arg-type]


def test_statements_have_their_words_numbers_and_parameters(tmp_path: Path) -> None:
    text = (
        '# a comment\nTranslate 1 -.5 2e1\n Texture "a \\"b\\"" "float" # c\n "imagemap" "string filename" '
        '["x_1.png"]\r\n "bool invert" true "bool b" [ "false" ] "rgb c" [ .1 # mid\n .2 .3 ] "integer n" 4'
        ' "spectrum s" "metal-Au-k" "point3 P" [1 2 3\n4 5 6]'
    )
    move, texture = parse(tmp_path, text)
    assert (move.name, move.numbers, move.place.rpartition("/")[2]) == (
        "Translate",
        [1, -0.5, 20],
        "scene.pbrt line 2",
    )
    assert texture.words == ['a "b"', "float", "imagemap"]
    values = {name: (each.type, list(each.values)) for name, each in texture.parameters.items()}
    assert values == {
        "filename": ("string", ["x_1.png"]),
        "invert": ("bool", ["true"]),
        "b": ("bool", ["false"]),
        "c": ("rgb", [0.1, 0.2, 0.3]),
        "n": ("integer", [4]),
        "s": ("spectrum", ["metal-Au-k"]),
        "P": ("point3", [1, 2, 3, 4, 5, 6]),
    }
    assert texture.parameters["c"].place.endswith("line 5")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("LookAt 1e200 0 0 0 0 0 0 1 0", "LookAt needs a number here, of at most 1e\\+100, not '1e200'"),
        ('Camera "a" "integer n" 5000000000', "n is .*; it must be an integer of 32 bits"),
        ("\nTranslat 1 2 3", "line 2: there is no statement 'Translat'; did you mean 'Translate'"),
        ("Translate 1 2", "line 1: Translate needs a number here, .* not ''"),
        ("Translate 1 2 nan", "Translate needs a number here, .* not 'nan'"),
        ("Transform 1 2", "Transform needs 16 numbers in brackets, not 1"),
        ("Transform [ 1 2 ]", "needs 16 numbers in brackets, not 2"),
        ("Camera perspective", "Camera needs a string in quotes here, not 'perspective'"),
        ('Camera "perspective', "line 1: the string has no end in its line"),
        ('Camera "a\\x"', "has the unknown escape"),
        ('Camera "a" "float" 1', "line 1: 'float' declares no parameter"),
        ('Camera "a" "floats fov" 1', "declares no parameter"),
        ('Camera "a"\n"float fov" [ 1', "line 2: the list of float fov has no end"),
        ('Camera "a" "float fov" [ 1 1_0 ]', "fov has '1.0' where a finite number must be"),
        ('Camera "a" "float fov" "x"', "fov has '\"x\"' where a finite number must be"),
        ('Camera "a" "float fov" 1e999', "fov has '1e999' where a finite number must be"),
        ('Camera "a" "rgb c" [ 1 2 ]', "c has 2 numbers; a rgb has 3"),
        ('Camera "a" "integer n" 1.5', "n is .*; it must be an integer"),
        ('Camera "a" "bool b" 1', "b is .*; it must be true or false"),
        ('Camera "a" "string s" 1', "s is .*; it must be a string in quotes"),
        ('Camera "a" "float x" 1 "float x" 2', "x is given twice"),
    ],
)
def test_malformed_text_is_left_out_and_noted_with_its_line(tmp_path: Path, text: str, message: str) -> None:
    files = SceneFiles(tmp_path / "scene.pbrt")
    list(statements(files, tmp_path / "scene.pbrt", text.encode()))
    loss = files.losses.found[0]
    assert re.search(message, f"{loss.place}: {loss.part}")
    assert "scene.pbrt line " in loss.place
    assert loss.done == "left out"


@pytest.mark.parametrize(
    ("body", "message"),
    [
        ('Camera "perspective"', "Camera must come before WorldBegin"),
        ("AttributeEnd", "AttributeEnd has no AttributeBegin"),
        ("AttributeBegin ObjectEnd", "ObjectEnd has no ObjectBegin"),
        ("AttributeBegin", r"line \d: AttributeBegin has no end"),
        ('ObjectBegin "a" ObjectBegin "b"', "ObjectBegin is inside another object"),
        ('ObjectBegin "a" ObjectInstance "a"', "ObjectInstance is inside an object"),
        ('ObjectInstance "a"', "there is no object 'a'"),
        ('ObjectBegin "a" ObjectEnd ObjectBegin "a"', "there is an object 'a' already"),
        ('CoordSysTransform "a"', "there is no coordinate system 'a'"),
        ("ActiveTransform Never", "ActiveTransform is 'Never'"),
        ('Attribute "world" "float a" 1', "Attribute is for 'world'"),
        ('Texture "t" "rgb" "constant"', "it must be of float or spectrum"),
        ('Texture "t" "float" "constant" Texture "t" "float" "constant"', "a float texture 't' already"),
        ('MakeNamedMaterial "m"', "MakeNamedMaterial 'm' has no type"),
        (f'NamedMaterial "m" {BALL}', "shape 'sphere': there is no material 'm'"),
        (f'Material "difuse" {BALL}', "material 'difuse': pbrt has no such material; did you mean 'diffuse'"),
        (f'Material "diffuse" "texture reflectance" "t" {BALL}', "there is no spectrum texture 't'"),
        (
            'Texture "t" "spectrum" "scale" "texture tex" "t" '
            f'Material "diffuse" "texture reflectance" "t" {BALL}',
            "refers to itself",
        ),
        (f'Material "diffuse" "rgb reflectance" [ 1 2 3 ] {BALL}', "reflectance is 1 2 3; clamped to 1 1 1"),
        ('Shape "sphere" "string radius" "a"', "radius is a string; it must be a float"),
        ('Shape "sphere" "float radius" [ ]', "radius has no value"),
        ('Shape "sphere" "float radius" -1', "radius is -1.*; it must be above 0"),
        ('Shape "plymesh" "string filename" "no.ply"', "file 'no.ply' is missing"),
        ('Shape "plymesh" "string filename" "../no.ply"', "outside its folder"),
        ('Shape "trianglemesh"', "has no P"),
        ('Shape "trianglemesh" "point3 P" [ 1 2 3 ]', "has 1 points and no indices"),
        (POINT + '"integer indices" [ 0 1 ]', "has 2 indices; a face has 3"),
        (POINT + '"integer indices" [ 0 1 7 ]', "face 0 uses vertex 7"),
        (POINT + '"point2 uv" [ 0 1 ]', "uv has 1 rows; P has 3"),
        ("Scale 1e90 1 1 Scale 1e90 1 1", "the transform has elements that are too large"),
        ("Transform [ 1 0 0 1 0 1 0 0 0 0 1 0 0 0 0 1 ]", "the transform has the last row"),
        ("Rotate 3 0 0 0", "Rotate: axis"),
        ("LookAt 0 0 0 0 0 0 0 1 0", "LookAt: origin and target are both"),
        ('LightSource "point" "spectrum I" [ 1 2 3 ]', "it must be pairs of wavelength and value"),
        ('LightSource "point" "spectrum I" "no.spd"', "file 'no.spd' is missing"),
        ('Scale 0 1 1 LightSource "infinite" "string filename" "e.exr"', "of its directions is singular"),
        ('LightSource "sun"', "light 'sun': pbrt has no such light"),
    ],
)
def test_damage_costs_the_damaged_part(tmp_path: Path, body: str, message: str) -> None:
    """What is wrong is noted with its place; the ball before it is shown."""
    write_image(tmp_path / "e.exr", np.ones((2, 2, 3), np.float32))
    with pytest.warns(UserWarning, match=message) as caught:
        scene = load(tmp_path, f"{BALL} {body}", strict=False)
    assert len(caught) == 1
    assert isinstance(scene.shapes[0], wf.Sphere)
    assert all(loss.place.startswith(str(tmp_path)) for loss in scene.losses)
    with pytest.raises(SceneError, match=message):
        load(tmp_path, f"{BALL} {body}", strict=True)


@pytest.mark.parametrize(
    ("steps", "expected"),
    [
        ("Translate 1 2 3", (2, 4, 6)),
        ("Scale 2 3 4", (2, 6, 12)),
        ("Rotate 90 0 0 1", (-2, 1, 3)),
        ("Translate 1 0 0 Rotate 90 0 0 1", (-1, 1, 3)),
        ("Translate 1 0 0 Identity", (1, 2, 3)),
        ("Scale 9 9 9 Transform [ 1 0 0 0 0 1 0 0 0 0 1 0 5 6 7 1 ]", (6, 8, 10)),
        ("Translate 1 0 0 ConcatTransform [ 0 1 0 0 -1 0 0 0 0 0 1 0 0 0 0 1 ]", (-1, 1, 3)),
        ("LookAt 1 1 1 1 1 9 0 1 0", (0, 1, 2)),
        ("LookAt 0 0 0 9 0 0 0 1 0", (-3, 2, 1)),  # z ahead, y up, x to the right of a left-handed space
        ('Translate 1 0 0 CoordinateSystem "c" Identity CoordSysTransform "c"', (2, 2, 3)),
        ("AttributeBegin Scale 9 9 9 AttributeEnd Translate 1 0 0", (2, 2, 3)),
        ("TransformBegin Scale 9 9 9 TransformEnd Translate 1 0 0", (2, 2, 3)),
        ("Translate 1 0 0 ActiveTransform All Translate 1 0 0", (3, 2, 3)),
    ],
)
def test_transforms(tmp_path: Path, steps: str, expected: tuple[float, ...]) -> None:
    (mesh,) = load(tmp_path, f"{steps} {POINT}").shapes
    assert isinstance(mesh, wf.Mesh)
    np.testing.assert_allclose(mesh.vertices[0], expected, atol=1e-12)


MOVES = "Translate 1 0 0 ActiveTransform EndTime Translate 4 0 0 Rotate 90 0 0 1"


def at(shape: Any) -> Any:
    """Return where the first vertex of a mesh stands."""
    mesh = shape.to_mesh() if isinstance(shape, wf.Instance) else shape
    return mesh.vertices[0]


def test_what_moves_goes_from_its_first_transform_to_its_second(tmp_path: Path) -> None:
    scene = load(tmp_path, f"{MOVES} {POINT}")
    assert (scene.start, scene.end) == (0, 1)
    np.testing.assert_allclose(at(scene.shapes[0]), [2, 2, 3], atol=1e-12)
    np.testing.assert_allclose(at(scene.at(1).shapes[0]), [3, 1, 3], atol=1e-12)
    half = np.sqrt(0.5)  # turned by 45 degrees about (3, 0, 0)
    np.testing.assert_allclose(at(scene.at(0.5).shapes[0]), [3 + half - 2 * half, 3 * half, 3], atol=1e-12)


def pbrts_decomposition(matrix: Any) -> tuple[Any, Any, Any]:
    """Translation, rotation and scale as pbrt-v4's `AnimatedTransform::Decompose` computes them."""
    linear = matrix[:3, :3]
    rotation = linear
    for _ in range(100):
        rotation = (rotation + np.linalg.inv(rotation.T)) / 2
    return matrix[:3, 3], Rotation.from_matrix(rotation), np.linalg.inv(rotation) @ linear


def test_motion_is_that_of_pbrts_animated_transforms(tmp_path: Path) -> None:
    """T by lerp, R by slerp the shorter way, S by lerp, of a start with shear and an end with other axes."""
    start, end = (
        "Scale 2 1 3 Rotate 40 1 2 3 Translate 1 0 -2",
        "Rotate -100 0 3 1 Scale 1 0.5 2 Translate 0 4 0",
    )
    scene = load(tmp_path, f"{start} ActiveTransform EndTime {end} {POINT}")
    turn = lambda degrees, axis: Rotation.from_rotvec(  # noqa: E731
        np.radians(degrees) * np.array(axis) / np.linalg.norm(axis)
    ).as_matrix()
    first = np.diag([2, 1, 3]) @ turn(40, (1, 2, 3))
    matrices = [np.eye(4), np.eye(4)]
    matrices[0][:3, :3], matrices[0][:3, 3] = first, first @ (1, 0, -2)
    linear = first @ turn(-100, (0, 3, 1)) @ np.diag([1, 0.5, 2])
    matrices[1][:3, :3], matrices[1][:3, 3] = linear, matrices[0][:3, 3] + linear @ (0, 4, 0)
    (t0, r0, s0), (t1, r1, s1) = map(pbrts_decomposition, matrices)
    for part in (0.2, 0.5, 0.9):
        rotation = Slerp([0, 1], Rotation.concatenate([r0, r1]))(part).as_matrix()
        there = rotation @ ((1 - part) * s0 + part * s1) @ (1, 2, 3) + (1 - part) * t0 + part * t1
        np.testing.assert_allclose(at(scene.at(part).shapes[0]), there, atol=1e-9)


def test_transforms_have_times_and_the_shutter_is_that_of_the_camera(tmp_path: Path) -> None:
    camera = 'TransformTimes 2 4 Camera "perspective" "float shutteropen" 2.5 "float shutterclose" 3'
    scene = load(tmp_path, f"{MOVES} {POINT}", header=camera)
    assert (scene.start, scene.end) == (2, 4)
    assert scene.settings["shutter"] == (2.5, 3)
    assert "shutter" not in load(tmp_path, POINT, header=camera).settings


def test_cameras_lights_and_instances_move(tmp_path: Path) -> None:
    camera = 'ActiveTransform EndTime Translate 0 0 -4 ActiveTransform All Camera "perspective"'
    body = f"""AttributeBegin ActiveTransform EndTime Translate 0 6 0 LightSource "point" AttributeEnd
    ObjectBegin "thing" {POINT} ObjectEnd ObjectInstance "thing" {MOVES} ObjectInstance "thing"
    """
    scene = load(tmp_path, body, header=camera)
    assert scene.camera is not None
    assert scene.camera.moves
    still = scene.at(0.5)
    assert still.camera is not None
    np.testing.assert_allclose(still.camera.origin, np.add(scene.camera.origin, (0, 0, 2)), atol=1e-12)
    np.testing.assert_allclose(still.camera.rotation, scene.camera.rotation, atol=1e-12)
    np.testing.assert_allclose(still.lights[0].position, [0, 3, 0], atol=1e-12)  # type: ignore[attr-defined]
    assert [shape.moves for shape in scene.shapes] == [False, True]
    np.testing.assert_allclose(at(scene.at(1).shapes[1]), [-3, 1, 3], atol=1e-12)


def test_infinite_lights_turn_while_the_shutter_is_open(tmp_path: Path) -> None:
    write_image(tmp_path / "e.exr", np.random.default_rng(1).random((8, 8, 3)).astype(np.float32))
    turn = "Rotate 20 1 0 0 ActiveTransform EndTime Rotate 70 0 1 2"
    scene = load(tmp_path, f'{turn} LightSource "infinite" "string filename" "e.exr" Identity {POINT}')
    scene.camera = wf.Camera.look_at((0, 0, -9), (0, 0, -10), fov=90, size=(4, 4))
    steps = list(wf.trace(scene, shutter=(0.2, 0.9)))
    paths = next(step.paths for step in steps if step.stage == "generate")
    for lane in range(16):
        due = scene.at(paths.time[lane]).lights[0].record(np.zeros(3)).le(paths.direction[:, [lane]])[:, 0]
        np.testing.assert_allclose(steps[-1].light[:, paths.slot[lane]], due, rtol=1e-4)


@pytest.mark.parametrize(
    ("body", "message"),
    [
        (f"ActiveTransform EndTime Scale 1 0 1 {POINT}", "singular.*its motion left out; it stands"),
        (f"ActiveTransform EndTime Scale -1 1 1 {POINT}", "one mirrors and the other does not"),
        (
            f'ObjectBegin "a" {MOVES} {POINT} ObjectEnd ObjectInstance "a"',
            "its motion in an object; it stands where it begins",
        ),
        (f'ActiveTransform EndTime Scale 2 2 2 LightSource "infinite" Identity {POINT}',
         "must be a rotation.*its motion left out"),
    ],
)  # fmt: skip
def test_motion_that_cannot_be_is_left_out(tmp_path: Path, body: str, message: str) -> None:
    with pytest.warns(UserWarning, match=f"(?s){message}"):
        scene = load(tmp_path, body, strict=False)
    assert not scene.moves
    assert "shutter" not in scene.settings


def test_times_that_do_not_rise_are_noted(tmp_path: Path) -> None:
    with pytest.warns(UserWarning, match="TransformTimes is 4 4; the end must be after the start"):
        load(tmp_path, f"TransformTimes 4 4 {POINT}", strict=False)


def test_included_files_take_part_as_if_they_stood_there(tmp_path: Path) -> None:
    (tmp_path / "sub").mkdir()
    (tmp_path / "sub" / "move.pbrt").write_text("Translate 1 0 0")
    (tmp_path / "more.pbrt.gz").write_bytes(gzip.compress(b'Include "sub/move.pbrt" Translate 1 0 0'))
    for word, x in (("Include", 3), ("Import", 1)):  # an import keeps its graphics state to itself
        (mesh,) = load(tmp_path, f'{word} "more.pbrt.gz" {POINT}').shapes
        assert mesh.vertices[0].tolist() == [x, 2, 3]


def test_bombs_are_refused(tmp_path: Path) -> None:
    (tmp_path / "self.pbrt").write_text('\nInclude "self.pbrt"')
    with pytest.raises(
        SceneError, match=r"self.pbrt line 2: files include each other; the limit is 15 levels"
    ):
        load(tmp_path, 'Include "self.pbrt"')
    (tmp_path / "0.pbrt").write_text(BALL)
    for i in range(1, 12):
        (tmp_path / f"{i}.pbrt").write_text(f'Include "{i - 1}.pbrt"\n' * 10)
    with pytest.raises(SceneError, match=r"line \d+: includes more than 1024 files.*LoadLimits.includes"):
        load(tmp_path, 'Include "11.pbrt"')
    (tmp_path / "big.pbrt.gz").write_bytes(gzip.compress(b" " * 10**6))
    with pytest.raises(SceneError, match="more than 1000 bytes unpacked"):
        load(tmp_path, 'Include "big.pbrt.gz"', limits=wf.LoadLimits(unpacked_bytes=1000))
    for content, message in ((b"no", "is no gzip file"), (gzip.compress(b"#" * 99)[:-9], "ends before")):
        (tmp_path / "bad.pbrt.gz").write_bytes(content)
        with pytest.raises(SceneError, match=message):
            load(tmp_path, 'Include "bad.pbrt.gz"')
    limits = wf.LoadLimits(instances=5, triangles=200)
    with pytest.raises(SceneError, match=r"more than 5 instances.*LoadLimits.instances"):
        load(
            tmp_path, f'ObjectBegin "a" {POINT} {POINT} ObjectEnd ' + 'ObjectInstance "a" ' * 3, limits=limits
        )
    with pytest.raises(SceneError, match=r"LoadLimits.triangles"):
        load(tmp_path, POINT.replace("trianglemesh", "loopsubdiv") + '"integer levels" 16', limits=limits)
    with pytest.raises(SceneError, match=r"LoadLimits.triangles"):
        load(tmp_path, 'Shape "cylinder"', limits=limits)
    with pytest.raises(SceneError, match="nested deeper than"):
        load(tmp_path, "AttributeBegin " * 5000)


def test_nothing_that_can_be_shown_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match=r"scene.pbrt: has no shapes$"):
        load(tmp_path, "")
    with pytest.raises(SceneError, match=r"has no shapes: line 3: there is no statement 'Shap'.*; left out$"):
        load(tmp_path, 'Shap "sphere"')


def test_light_from_far_away_alone_is_a_scene(tmp_path: Path) -> None:
    scene = load(tmp_path, 'LightSource "infinite" "rgb L" [ 1 .5 .25 ]', 'Camera "perspective"')
    image = wf.render(scene, spp=1, size=(4, 4), progress=False)
    np.testing.assert_allclose(image.rgb, np.broadcast_to([1, 0.5, 0.25], (4, 4, 3)))


def test_lights_from_far_away_are_added(tmp_path: Path) -> None:
    one, two = 'LightSource "infinite" "rgb L" [ 1 .5 .25 ] ', 'LightSource "infinite" "rgb L" [ 1 1 1 ]'
    (light,) = load(tmp_path, one + two + BALL).lights
    assert light.radiance.ravel().tolist() == [2, 1.5, 1.25]
    write_image(tmp_path / "e.exr", np.ones((2, 2, 3), np.float32))
    with pytest.warns(UserWarning, match="1 further light from all around; left out"):
        scene = load(tmp_path, f'LightSource "infinite" "string filename" "e.exr" {one} {BALL}', strict=False)
    assert len(scene.lights) == 1


@pytest.mark.parametrize(
    ("header", "body", "message"),
    [
        ('Camera "fisheye"', "", "no such camera; 'perspective' in its place"),
        (
            'Camera "perspective" "float shutteropen" 1',
            "",
            "is open for 0; it must be above 0; 1 in its place",
        ),
        ('Film "rgb" "integer pixelbounds" [ 9 5 0 5 ] Camera "perspective"', "", "its pixels end before"),
        ("", 'Material "conductor" "float roughness" -1', "roughness is -1; clamped to 0"),
        (
            "",
            'MakeNamedMaterial "a" "string type" "diffuse" Material "mix" "string materials" "a"',
            "it needs two",
        ),
        ("", "WorldEnd", "'WorldEnd'; it is one of pbrt-v3"),
        ("", 'Shape "sphere" "float radius" 1e300', "radius is 1e.300; it must be above 0"),
    ],
)
def test_what_stands_for_a_damaged_part(tmp_path: Path, header: str, body: str, message: str) -> None:
    with pytest.warns(UserWarning, match=message):
        scene = load(tmp_path, f"{body} {BALL}", header, strict=False)
    assert isinstance(scene.shapes[-1], wf.Sphere)
    assert "Camera" not in header or scene.camera is not None


def test_a_material_without_a_name_is_an_interface(tmp_path: Path) -> None:
    (ball,) = load(tmp_path, f'Material "" {BALL}').shapes
    assert ball.material.bsdf.invisible


@pytest.mark.parametrize(
    ("body", "header", "message"),
    [
        (f'Material "matte" "color Kd" [ .5 .25 1 ] {BALL}', "", "'matte'.*pbrt-v3"),
        (f'Material "uber" "rgb Kd" [ .5 .25 1 ] {BALL}', "", "'uber'.*pbrt-v3"),
        (
            f'Material "fabric" "rgb color" [ .5 .25 1 ] {BALL}',
            "",
            "no such material; a diffuse surface of its",
        ),
        (f'Material "diffuse" "rgb reflectance" [ .5 .25 1 ] {BALL} Shape "cone"', "", "'cone'.*pbrt-v3"),
        (
            f'Material "diffuse" "rgb reflectance" [ .5 .25 1 ] {BALL}',
            'SurfaceIntegrator "path" "integer maxdepth" 3',
            "'SurfaceIntegrator'; it is one of pbrt-v2",
        ),
        (f'Material "diffuse" "rgb reflectance" [ .5 .25 1 ] {BALL}', 'Film "image"', "'image'.*pbrt-v3"),
    ],
)
def test_files_of_older_versions(tmp_path: Path, body: str, header: str, message: str) -> None:
    """The message names the version; a material keeps its color."""
    with pytest.warns(UserWarning, match=message):
        (ball,) = load(tmp_path, body, header, strict=False).shapes
    color = np.ravel(ball.material.bsdf.reflectance)
    if "uber" in body:  # the coat takes some
        color = color / color[2]
        assert color[0] > color[1]
    else:
        assert color == pytest.approx([0.5, 0.25, 1])


def test_images_of_older_versions_light_as_they_did(tmp_path: Path) -> None:
    """Their first row is at z, and their first column at x."""
    pixels = np.zeros((8, 16, 3), np.float32)
    pixels[:4, :4] = 1  # z and x and y above 0
    write_image(tmp_path / "e.exr", pixels)
    with pytest.warns(UserWarning, match="mapname is of pbrt-v3"):
        scene = load(tmp_path, 'LightSource "infinite" "string mapname" "e.exr"', strict=False)
    (light,) = scene.lights
    towards = np.array([[1, 1, 1], [-1, 1, 1], [1, -1, 1], [1, 1, -1.0]]).T.astype(np.float32) / 3**0.5
    found = light.record(np.zeros(3)).le(towards)
    assert (found[0] > 0.5).tolist() == [True, False, False, False]


def test_a_medium_outside_that_is_inside_of_another_shape_is_no_loss(tmp_path: Path) -> None:
    fog = 'MakeNamedMedium "fog" "string type" "homogeneous"'
    outer = f'AttributeBegin MediumInterface "fog" "" Material "interface" Scale 9 9 9 {BALL} AttributeEnd'
    assert len(load(tmp_path, f'{fog} {outer} MediumInterface "" "fog" {BALL}').shapes) == 2


def test_damaged_text_costs_its_part_or_is_refused(tmp_path: Path) -> None:
    rng, path = random.Random(3), tmp_path / "scene.pbrt"
    words = FULL.split(" ")
    tally = [0, 0]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        for _ in range(80):
            if rng.random() < 0.5:
                text = bytearray(FULL.encode())
                for _ in range(rng.randrange(1, 3)):
                    text[rng.randrange(len(text))] = rng.choice(b' "[]#-.0e9\nx\\\xff')
                data = bytes(text)
            else:
                some = list(words)
                for _ in range(1):
                    at = rng.randrange(len(some))
                    some[at : at + rng.randrange(3)] = rng.choices(
                        [*words, "-1", "1e30", "0", "nan"], k=rng.randrange(3)
                    )
                data = " ".join(some).encode()
            path.write_bytes(data)
            try:
                assert wf.load(path, progress=False).shapes
                tally[0] += 1
            except SceneError as error:
                tally[1] += "scene.pbrt" in str(error)
    assert tally[0] > 53
    assert sum(tally) == 80


def test_a_long_list_is_read_at_once(tmp_path: Path) -> None:
    """Not number by number."""
    rows = np.random.default_rng(1).random((60_000, 3))
    text = "\n".join(" ".join(map(str, row)) for row in rows.tolist())
    assert calls(lambda: parse(tmp_path, f'Shape "trianglemesh" "point3 P" [ {text} ]')) < 1500


def test_the_command_line_renders_a_scene(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "scene.pbrt"
    path.write_text(FULL)
    assert main(["info", str(path)]) == 0
    assert "camera" in capsys.readouterr().out
    assert main(["render", str(path), "-o", str(tmp_path / "out.npy"), "--quiet"]) == 0
    assert np.load(tmp_path / "out.npy").shape == (6, 8, 3)


@pytest.mark.parametrize("honest", [True, False], ids=["says its size", "denies its size"])
@pytest.mark.parametrize("name", ["big.pbrt.gz", "big.ply.gz"])
def test_packed_files_are_refused_before_they_are_unpacked(tmp_path: Path, name: str, honest: bool) -> None:
    """Of one that says its size nothing is unpacked, and of another one as much as it may have."""
    packed = gzip.compress(b" " * 2**25)
    (tmp_path / name).write_bytes(packed if honest else packed[:-4] + bytes(4))
    use = 'Include "big.pbrt.gz"' if "pbrt" in name else 'Shape "plymesh" "string filename" "big.ply.gz"'
    tracemalloc.start()
    with pytest.raises(SceneError, match=f"{name}: has more than 8388608 bytes unpacked"):
        load(tmp_path, use, limits=wf.LoadLimits(unpacked_bytes=2**23))
    assert tracemalloc.get_traced_memory()[1] < (2**21 if honest else 2**24)
    with pytest.raises(SceneError, match=rf"{name}: what it holds takes .*LoadLimits\.memory_bytes"):
        load(tmp_path, use, limits=wf.LoadLimits(memory_bytes=2**10))
    tracemalloc.stop()


def test_a_file_that_is_included_often_allows_for_memory_once(tmp_path: Path) -> None:
    (tmp_path / "more.pbrt").write_text("#" * 1000)
    files = SceneFiles(tmp_path / "scene.pbrt", limits=wf.LoadLimits(memory_bytes=1))
    for _ in range(3):
        files.read(tmp_path / "more.pbrt")
    assert files.budget.most == 1 + 128 * 1000
