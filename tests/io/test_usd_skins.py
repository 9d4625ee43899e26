"""Skeletons and blend shapes of USD."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import wavefront as wf

pytest.importorskip("pxr")
BODY = """def SkelRoot "root" (prepend apiSchemas = ["SkelBindingAPI"])
{
 double3 xformOp:translate = (0, 0, 5)
 uniform token[] xformOpOrder = ["xformOp:translate"]
 rel skel:skeleton = </root/bones>
 def Skeleton "bones" (prepend apiSchemas = ["SkelBindingAPI"])
 {
 uniform token[] joints = ["a", "a/b"]
 uniform matrix4d[] bindTransforms = [
  ((1,0,0,0),(0,1,0,0),(0,0,1,0),(0,0,0,1)), ((1,0,0,0),(0,1,0,0),(0,0,1,0),(0,1,0,1))]
 uniform matrix4d[] restTransforms = [
  ((1,0,0,0),(0,1,0,0),(0,0,1,0),(0,0,0,1)), ((0,1,0,0),(-1,0,0,0),(0,0,1,0),(0,1,0,1))]
 %(source)s
 }
 %(animation)s
 def Mesh "skin" (prepend apiSchemas = ["SkelBindingAPI"])
 {
 int[] faceVertexCounts = [4]
 int[] faceVertexIndices = [0, 1, 2, 3]
 point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 2, 0), (0, 2, 0)]
 uniform token subdivisionScheme = "none"
 int[] primvars:skel:jointIndices = [0, 0, 1, 1] (elementSize = 1
 interpolation = "vertex")
 float[] primvars:skel:jointWeights = [1, 1, 1, 1] (elementSize = 1
 interpolation = "vertex")
 %(more)s
 }
}
"""
PLAIN = {"source": "", "animation": "", "more": ""}
MOVES = {
    "source": "rel skel:animationSource = </root/moves>",
    "animation": """def SkelAnimation "moves"
 {
 uniform token[] joints = ["a", "a/b"]
 uniform token[] blendShapes = ["wide"]
 float[] blendShapeWeights = [0.5]
 float3[] translations.timeSamples = { 1: [(0, 0, 0), (0, 1, 0)], 3: [(4, 0, 0), (0, 1, 0)] }
 quatf[] rotations = [(1, 0, 0, 0), (1, 0, 0, 0)]
 half3[] scales = [(1, 1, 1), (1, 1, 1)]
 }""",
    "more": "",
}
SHAPES = """uniform token[] skel:blendShapes = ["wide"]
 rel skel:blendShapeTargets = </root/skin/wide>
 def BlendShape "wide"
 {
 uniform vector3f[] offsets = [(0, 0, 0), (2, 0, 0), (2, 0, 0), (0, 0, 0)]
 }
"""


def corners(folder: Path, body: str, time: float | None = None) -> list[list[float]]:
    path = folder / "a.usda"
    path.write_text(f"#usda 1.0\n(metersPerUnit = 1)\n{body}")
    (shape,) = wf.load(path, strict=True, time=None if time is None else time / 24, progress=False).shapes
    matrix = shape.transform if isinstance(shape, wf.Instance) else np.eye(4)
    points = (shape.mesh if isinstance(shape, wf.Instance) else shape).vertices
    return np.round(points @ matrix[:3, :3].T + matrix[:3, 3], 5).tolist()


def test_a_skin_is_shown_at_rest(tmp_path: Path) -> None:
    """The upper joint is turned by 90 degrees about (0, 1, 0) from where the mesh is bound to it."""
    seen = corners(tmp_path, BODY % PLAIN)
    assert seen == [[0, 0, 5], [1, 0, 5], [-1, 2, 5], [-1, 1, 5]]


def test_a_skin_is_shown_as_it_is_animated(tmp_path: Path) -> None:
    for time, x in ((1, 0), (2, 2), (3, 4)):
        seen = corners(tmp_path, BODY % MOVES, time)
        assert seen == [[x, 0, 5], [x + 1, 0, 5], [x + 1, 2, 5], [x, 2, 5]]


def test_blend_shapes_are_shown(tmp_path: Path) -> None:
    seen = corners(tmp_path, BODY % {**MOVES, "more": SHAPES}, 1)
    assert seen == [[0, 0, 5], [2, 0, 5], [2, 2, 5], [0, 2, 5]]


def test_instances_have_skins(tmp_path: Path) -> None:
    model = f'class Xform "model"\n{{\n{BODY % PLAIN}}}\n'.replace("</root", "</model/root")
    copy = 'def Xform "copy" (instanceable = true\n prepend references = </model>)\n{\n}\n'
    seen = corners(tmp_path, model + copy)
    assert seen == [[0, 0, 5], [1, 0, 5], [-1, 2, 5], [-1, 1, 5]]
