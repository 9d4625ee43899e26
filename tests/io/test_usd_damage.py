"""What is damaged in one part of a file of USD costs that part, with one warning."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import wavefront as wf

pytest.importorskip("pxr")
POINTS = "point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]"
FACES = "int[] faceVertexCounts = [4]\n int[] faceVertexIndices = [0, 1, 2, 3]"
BALL = 'def Sphere "ball"\n{\n}\n'


def mesh(more: str = "", faces: str = FACES, points: str = POINTS, name: str = "m") -> str:
    scheme = 'uniform token subdivisionScheme = "none"'
    return f'def Mesh "{name}"\n{{\n {faces}\n {points}\n {scheme}\n {more}\n}}\n'


def load(folder: Path, body: str, message: str, header: str = "metersPerUnit = 1") -> wf.Scene:
    """Return a scene with one warning; the same file is an error where it is strict."""
    path = folder / "a.usda"
    path.write_text(f"#usda 1.0\n({header})\n{body}")
    with pytest.raises(wf.SceneError, match=message):
        wf.load(path, strict=True, progress=False)
    with pytest.warns(UserWarning, match=message) as told:
        scene = wf.load(path, progress=False)
    assert len(told) == 1
    assert scene.losses
    return scene


def area(scene: wf.Scene) -> float:
    a, b, c = scene.shapes[0].vertices[scene.shapes[0].faces].transpose(1, 0, 2)
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)


@pytest.mark.parametrize(
    ("more", "message"),
    [
        (
            'color3f[] primvars:displayColor = [(1, 0, 0), (0, 1, 0)] (interpolation = "{}")',
            "displayColor has 2",
        ),
        ('float[] primvars:displayOpacity = [0.5, 1] (interpolation = "{}")', "displayOpacity has 2 values"),
        ('normal3f[] normals = [(0, 0, 1)] (interpolation = "{}")', "normals has 1 value, too few"),
        ('normal3f[] primvars:normals = [(0, 0, 1)] (interpolation = "{}")', "normals has 1 value, too few"),
        ('texCoord2f[] primvars:st = [(0, 0)] (interpolation = "{}")', "st has 1 value, too few"),
        (
            'float[] primvars:displayColor = [1, 0, 0, 1] (interpolation = "{}")',
            "displayColor must have rows of 3",
        ),
    ],
)
@pytest.mark.parametrize("kind", ["vertex", "faceVarying", "varying", "odd"])
def test_a_primvar_that_does_not_fit_is_left_out(tmp_path: Path, more: str, message: str, kind: str) -> None:
    sound = "color3f[] primvars:displayColor = [(0, 0, 1)]\n " if "displayColor" not in more else ""
    scene = load(tmp_path, mesh(sound + more.format(kind)), f"/m: {message}.*; left out")
    assert area(scene) == pytest.approx(1)
    colors = scene.shapes[0].colors
    assert (colors is None) == (not sound)


def test_indices_of_a_primvar_that_do_not_exist(tmp_path: Path) -> None:
    """usd-core says so at its standard error."""
    more = 'color3f[] primvars:displayColor = [(1, 0, 0)] (interpolation = "vertex")\n'
    more += " int[] primvars:displayColor:indices = [0, 1, 2, 3]"
    scene = load(tmp_path, mesh(more), r"usd-core: For primvar .* </m>: Found 3 invalid indices")
    assert scene.shapes[0].colors is None


@pytest.mark.parametrize("kind", ["texCoord3f", "float3", "double3", "half3"])
def test_texture_coordinates_of_three_numbers(tmp_path: Path, kind: str) -> None:
    rows = "[(0, 0.5, 9), (1, 0, 9), (1, 1, 9), (0, 1, 9)]"
    path = tmp_path / "a.usda"
    path.write_text("#usda 1.0\n" + mesh(f'{kind}[] primvars:st = {rows} (interpolation = "vertex")'))
    (shape,) = wf.load(path, strict=True).shapes
    np.testing.assert_allclose(shape.uvs, [(0, 0.5), (1, 0), (1, 1), (0, 1)])


def test_colors_with_an_opacity(tmp_path: Path) -> None:
    path = tmp_path / "a.usda"
    path.write_text("#usda 1.0\n" + mesh("color4f[] primvars:displayColor = [(1, 0, 0.5, 1)]"))
    np.testing.assert_allclose(wf.load(path, strict=True).shapes[0].colors[0, :3], [1, 0, 0.5])


@pytest.mark.parametrize(
    ("faces", "message", "left"),
    [
        ("[2, 4], [0, 1, 0, 1, 2, 3]", "1 face of less than 3 corners; left out", 1),
        ("[4, 1, 0, -3], [0, 1, 2, 3, 0]", "3 faces of less than 3 corners; left out", 1),
        ("[3, 3], [0, 1, 2, 0, 2, 9]", "faceVertexIndices has 9; there are 4 points; 1 face left", 0.5),
        ("[3, 3], [0, -1, 2, 0, 2, 3]", "faceVertexIndices has -1; there are 4 points; 1 face left out", 0.5),
        (
            "[4, 3], [0, 1, 2, 9, 0, 2, 3]",
            "faceVertexIndices has 9; there are 4 points; 1 face left out",
            0.5,
        ),
        ("[3, 4], [0, 1, 2, 0, 2, 3]", "add up to 7 for 6 faceVertexIndices; 1 face and what", 0.5),
        ("[3], [0, 1, 2, 0, 2, 3]", "add up to 3 for 6 faceVertexIndices; 0 faces and what", 0.5),
    ],
)
def test_faces_that_are_damaged_are_left_out(tmp_path: Path, faces: str, message: str, left: float) -> None:
    counts, indices = faces.split("], ")
    own = f"int[] faceVertexCounts = {counts}]\n int[] faceVertexIndices = {indices}"
    assert area(load(tmp_path, mesh(faces=own), message)) == pytest.approx(left)


def test_colors_of_faces_follow_their_faces(tmp_path: Path) -> None:
    own = "int[] faceVertexCounts = [2, 3, 3]\n int[] faceVertexIndices = [0, 1, 0, 1, 2, 0, 2, 3]"
    more = 'color3f[] primvars:displayColor = [(1, 1, 1), (1, 0, 0), (0, 0, 1)] (interpolation = "uniform")'
    (shape,) = load(tmp_path, mesh(more, own), "1 face of less than 3").shapes
    seen = [shape.colors[face, :3].tolist() for face in shape.faces]
    assert seen == [[[1, 0, 0]] * 3, [[0, 0, 1]] * 3]


def test_a_stray_normal_is_that_of_a_face(tmp_path: Path) -> None:
    more = 'normal3f[] normals = [(0, 0, 1), (nan, 0, 0), (0, 0, 1), (0, 0, 1)] (interpolation = "vertex")'
    (shape,) = load(tmp_path, mesh(more), "1 normal is not finite").shapes
    np.testing.assert_allclose(shape.normals, [[0, 0, 1]] * 4)


INSTANCER = 'def PointInstancer "p"\n{\n rel prototypes = [</p/s>, </gone>]\n'
PLACES = " point3f[] positions = [(0, 0, 0), (1, 0, 0)]\n"
LOOK = """def Material "look"
{
 token outputs:surface.connect = </look/s.outputs:surface>
 def Shader "s"
 {
 uniform token info:id = "UsdPreviewSurface"
 %s
 token outputs:surface
 }
}
"""
BOUND = LOOK + BALL.replace(
    '"ball"\n{', '"bound" (prepend apiSchemas = ["MaterialBindingAPI"])\n{\n rel material:binding = </look>'
)


@pytest.mark.parametrize(
    ("body", "message"),
    [
        (mesh(faces="int[] faceVertexCounts = [2]\n int[] faceVertexIndices = [0, 1]"), "/m: has no faces"),
        (mesh(faces="int[] faceVertexCounts = [3]\n int[] faceVertexIndices = [7, 8, 9]"),
         "/m: has no faces"),
        ('def Sphere "s"\n{\n double radius = -1\n}\n', "/s: .*radius.*left out"),
        ('def Cylinder "s"\n{\n double radius = 0\n}\n', "/s: radius is 0.*left out"),
        ('def Cube "s"\n{\n double size = nan\n}\n', "/s: size is nan.*left out"),
        ('def Cone "s"\n{\n uniform token axis = "W"\n}\n', "/s: axis.*left out"),
        ('def Camera "s"\n{\n float focalLength = 0\n}\n', "/s: its apertures.*left out"),
        ('def DiskLight "s"\n{\n float inputs:intensity = nan\n}\n', "/s: .*nan.*left out"),
        ('def SphereLight "s"\n{\n float inputs:radius = -1\n}\n', "/s: .*left out"),
        ('def DistantLight "s"\n{\n custom color3f inputs:color = (nan, 1, 1)\n}\n', "/s: .*nan.*left out"),
        ('def Sphere "s"\n{\n matrix4d xformOp:transform = ((nan,0,0,0),(0,1,0,0),(0,0,1,0),(0,0,0,1))\n'
         ' uniform token[] xformOpOrder = ["xformOp:transform"]\n}\n', "/s: .*left out"),
        ('def Sphere "s"\n{\n uniform token[] xformOpOrder = ["xformOp:gone"]\n}\n',
         "/s: is damaged: .*gone.*; its transform left out"),
        (INSTANCER + " int[] protoIndices = [0, 5]\n" + PLACES + BALL.replace("ball", "s") + "}\n",
         "/p: protoIndices has 5; there are 2; left out"),
        (INSTANCER + " int[] protoIndices = [0, 1]\n" + PLACES + BALL.replace("ball", "s") + "}\n",
         "/p: its prototype /gone cannot be placed; left out"),
        (INSTANCER + " int[] protoIndices = [0]\n" + PLACES + BALL.replace("ball", "s") + "}\n",
         "/p: .*left out"),
        (BOUND % "float inputs:roughness = 1.5", "/look/s: inputs:roughness is 1.5; clamped to 1"),
        (BOUND % "float inputs:metallic = nan", "/look/s: inputs:metallic is nan; its default in its place"),
        (BOUND % "float inputs:ior = 0", "/look/s: inputs:ior is 0; clamped"),
        (BOUND % "float inputs:opacity = 1.0000001", "/look/s: inputs:opacity is 1.0000001.*; clamped to 1"),
        (BOUND % "color3f inputs:diffuseColor = (1.2, 0, 0)",
         "/look/s: inputs:diffuseColor is 1.2.*; clamped"),
        (BOUND % "color3f inputs:emissiveColor = (-1, 0, 0)",
         "/look/s: inputs:emissiveColor is -1 0 0; clamped"),
        (BOUND % 'string inputs:roughness = "rough"', "/look/s: is damaged: .*; the default of roughness"),
        (BOUND % "float inputs:diffuseColor = 1", "/look/s: is damaged: .*; the default of diffuseColor"),
    ],
)  # fmt: skip
def test_a_damaged_prim_costs_that_prim(tmp_path: Path, body: str, message: str) -> None:
    scene = load(tmp_path, body + BALL, message)
    assert "ball" in [shape.name for shape in scene.shapes]
    assert all("nan" not in str(getattr(shape, "radius", 0)) for shape in scene.shapes)


def test_units_that_cannot_be(tmp_path: Path) -> None:
    scene = load(tmp_path, BALL, "metersPerUnit is 0 meters; 0.01 in its place", "metersPerUnit = 0")
    assert scene.shapes[0].radius == pytest.approx(0.01)


def test_what_shows_nothing_at_all_is_an_error(tmp_path: Path) -> None:
    path = tmp_path / "a.usda"
    path.write_text('#usda 1.0\ndef Sphere "s"\n{\n double radius = -1\n}\n')
    with pytest.raises(wf.SceneError, match=r"a\.usda: has no faces: /s: .*radius"):
        wf.load(path)


def test_warnings_are_those_of_the_file_that_is_loaded(tmp_path: Path, capfd: Any) -> None:
    indices = "color3f[] primvars:displayColor = [(1, 0, 0)]\n int[] primvars:displayColor:indices = [5]"
    load(tmp_path, mesh(indices), "usd-core: .*invalid ind")
    path = tmp_path / "b.usda"
    path.write_text("#usda 1.0\n" + BALL)
    assert wf.load(path, strict=True).losses == ()
    assert capfd.readouterr().err == ""
