"""Scenes of USD, where usd-core is installed: each kind of prim, and what is not honored."""

from __future__ import annotations

import random
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from expected import Near, check
from inside import write_image

import wavefront as wf

TRIANGLE = """int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    point3f[] points = [(0, 0, 0), (2, 0, 0), (2, 1, 0), (0, 1, 0)]
    uniform token subdivisionScheme = "none"
"""
MESH = f'def Mesh "board"\n{{\n    {TRIANGLE}}}\n'
PAINT = """def Material "paint"
{
    token outputs:surface.connect = </paint/shader.outputs:surface>
    def Shader "shader"
    {
        uniform token info:id = "UsdPreviewSurface"
        %s
        token outputs:surface
    }
    %s
}
"""
BOUND = f"""def Mesh "board" (prepend apiSchemas = ["MaterialBindingAPI"])
{{
    {TRIANGLE}
    texCoord2f[] primvars:st = [(0, 0), (1, 0), (1, 1), (0, 1)] (interpolation = "vertex")
    rel material:binding = </paint>
}}
"""
IMAGE = """def Shader "image"
    {
        uniform token info:id = "UsdUVTexture"
        asset inputs:file = @a.png@
        token inputs:wrapS = "mirror"
        token inputs:wrapT = "clamp"
        float4 inputs:scale = (0.5, 0.5, 0.5, 1)
        float2 inputs:st.connect = </paint/move.outputs:result>
        float3 outputs:rgb
        float outputs:g
    }
    def Shader "move"
    {
        uniform token info:id = "UsdTransform2d"
        float inputs:rotation = 90
        float2 inputs:scale = (2, 3)
        float2 inputs:translation = (0.25, 0.5)
        float2 outputs:result
    }"""


@pytest.fixture(autouse=True)
def _needs_usd(request: pytest.FixtureRequest) -> None:
    if "missing" not in request.node.name:
        pytest.importorskip("pxr")


def load(
    folder: Path, body: str, header: str = "metersPerUnit = 1", strict: bool = True, **options: Any
) -> wf.Scene:
    path = folder / "scene.usda"
    path.write_text(f"#usda 1.0\n({header})\n{body}")
    return wf.load(path, strict=strict, **options)


def rows(value: Any) -> Any:
    return np.asarray(value).ravel().tolist()


def test_usd_core_that_is_missing_is_named(tmp_path: Path, missing: Any) -> None:
    missing("pxr")
    with pytest.raises(wf.SceneError, match=r"scene\.usda: files of USD need usd-core: pip install usd-core"):
        load(tmp_path, MESH)


def test_meshes_transforms_units_and_what_is_up(tmp_path: Path) -> None:
    body = f"""def Xform "a"
{{
    double3 xformOp:translate = (1, 2, 3)
    float xformOp:rotateZ = 90
    uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateZ"]
    {MESH}
}}
"""
    scene = load(tmp_path, body, 'metersPerUnit = 0.1\nupAxis = "Z"')
    (board,) = scene.shapes
    np.testing.assert_allclose(board.vertices.min(0), [0, 0.2, 0.3], atol=1e-6)
    np.testing.assert_allclose(board.vertices.max(0), [0.1, 0.4, 0.3], atol=1e-6)
    assert len(board.faces) == 2
    assert rows(scene.up) == [0, 0, 1]
    assert board.name == "board"


def test_orientation_turns_faces(tmp_path: Path) -> None:
    for text, z in (("", 1), ('uniform token orientation = "leftHanded"', -1)):
        (mesh,) = load(tmp_path, MESH.replace("{\n", "{\n" + text + "\n", 1)).shapes
        a, b, c = mesh.vertices[mesh.faces[0]]
        assert np.sign(np.cross(b - a, c - a)[2]) == z


def test_primvars_of_every_interpolation(tmp_path: Path) -> None:
    for kind, count in (("constant", 1), ("uniform", 1), ("vertex", 4), ("faceVarying", 4)):
        colors = [(0.1 * i, 0.5, 1) for i in range(count)]
        text = f'color3f[] primvars:displayColor = {colors} (interpolation = "{kind}")\n'
        (mesh,) = load(tmp_path, MESH.replace("{\n", "{\n" + text, 1)).shapes
        for corner, color in zip(mesh.vertices, mesh.colors, strict=True):
            number = [[0, 0], [2, 0], [2, 1], [0, 1]].index(corner[:2].tolist()) if count > 1 else 0
            np.testing.assert_allclose(color[:3], colors[number], atol=1e-6)
        assert isinstance(mesh.material.bsdf.reflectance, wf.VertexColors)


def test_subsets_have_materials_of_their_own(tmp_path: Path) -> None:
    body = MESH.replace("[4]", "[3, 3]").replace("[0, 1, 2, 3]", "[0, 1, 2, 0, 2, 3]")
    body = body.replace(
        "}\n",
        """
    def GeomSubset "second" (prepend apiSchemas = ["MaterialBindingAPI"])
    {
        uniform token elementType = "face"
        uniform token familyName = "materialBind"
        int[] indices = [1]
        rel material:binding = </paint>
    }
}
""",
    )
    paint = PAINT % ("color3f inputs:diffuseColor = (0.2, 0.4, 0.6)", "")
    second, first = load(tmp_path, paint + body).shapes
    assert [len(second.faces), len(first.faces)] == [1, 1]
    np.testing.assert_allclose(rows(second.material.bsdf.base_color), [0.2, 0.4, 0.6], atol=1e-6)
    assert first.material.name is None


def surface(folder: Path, inputs: str) -> Any:
    """Return the mesh of a UsdPreviewSurface with inputs, which semicolons divide."""
    write_image(folder / "a.png", np.full((4, 4, 3), 0.5, np.float32))
    lines = "\n".join(f"        {each}" for each in inputs.split("; "))
    (mesh,) = load(folder, PAINT % (lines, IMAGE) + BOUND).shapes
    return mesh


SHINY = "float inputs:clearcoat = 0.5; float inputs:clearcoatRoughness = 0.125"
SPECULAR = "int inputs:useSpecularWorkflow = 1; float inputs:metallic = 1; float inputs:ior = 1.2"
TINT = "color3f inputs:specularColor"


@pytest.mark.parametrize(
    ("inputs", "due"),
    [
        ("", {"material.bsdf.base_color": Near(0.18), "material.bsdf.metallic": 0, "emission": None}),
        ("", {"material.bsdf.roughness": 0.5, "material.bsdf.ior": 1.5, "material.alpha": None}),
        ("", {"material.bsdf.clearcoat": 0, "material.bsdf.clearcoat_roughness": Near(0.01)}),
        ("", {"uvs": [[0, 0], [1, 0], [1, 1], [0, 1]]}),
        ("color3f inputs:emissiveColor = (1, 2, 3)", {"emission": [1, 2, 3]}),
        ("float inputs:metallic = 0.25", {"material.bsdf.metallic": 0.25}),
        ("float inputs:roughness = 0.75", {"material.bsdf.roughness": 0.75}),
        ("float inputs:ior = 1.4", {"material.bsdf.ior": Near(1.4)}),
        (SHINY, {"material.bsdf.clearcoat": 0.5, "material.bsdf.clearcoat_roughness": 0.125}),
        ("float inputs:opacity = 0.5", {"material.alpha": 0.5}),
        (
            SPECULAR,
            {"material.bsdf.metallic": 0, "material.bsdf.ior": 1.5, "material.bsdf.specular_color": 0},
        ),
        (f"{SPECULAR}; {TINT} = (0.1, 0.2, 0.4)", {"material.bsdf.specular_color": Near([2.5, 5, 10])}),
        (
            f"{SPECULAR}; {TINT}.connect = </paint/image.outputs:rgb>",
            {"material.bsdf.specular_color.scale": Near(12.5)},
        ),
        (f"float inputs:metallic = 1; {TINT} = (0.1, 0.2, 0.4)", {"material.bsdf.specular_color": 1}),
    ],
)
def test_preview_surfaces(tmp_path: Path, inputs: str, due: Any) -> None:
    check(surface(tmp_path, inputs), due)


def test_textures(tmp_path: Path) -> None:
    write_image(tmp_path / "a.png", np.full((4, 4, 3), 0.5, np.float32))
    text = """color3f inputs:diffuseColor.connect = </paint/image.outputs:rgb>
        float inputs:roughness.connect = </paint/image.outputs:g>"""
    (mesh,) = load(tmp_path, PAINT % (text, IMAGE) + BOUND).shapes
    base, rough = mesh.material.bsdf.base_color, mesh.material.bsdf.roughness
    assert (base.srgb, rough.srgb, rough.scalar) == (True, False, True)
    assert base.wrap == ("mirror", "clamp")
    np.testing.assert_allclose(base.transform, [[0, -3, 0.25], [2, 0, 0.5], [0, 0, 1]], atol=1e-6)
    np.testing.assert_allclose(np.ravel(base.scale), 0.5)
    for given, message in (
        ("asset inputs:file = @a.png@", "string inputs:file = 3"),
        ('"UsdUVTexture"', "3"),
    ):
        with pytest.raises(wf.SceneError, match=r"scene\.usda"):
            load(tmp_path, (PAINT % (text, IMAGE)).replace(given, message) + BOUND)
    with pytest.raises(wf.SceneError, match=r"/paint/image: file is .*; it must be an asset path"):
        load(
            tmp_path,
            (PAINT % (text, IMAGE)).replace("asset inputs:file = @a.png@", "odd inputs:file = 3") + BOUND,
        )
    (tmp_path / "a.png").unlink()
    for given, color in (("", [0.18] * 3), ("float4 inputs:fallback = (0.7, 0.1, 0.2, 1)", [0.7, 0.1, 0.2])):
        image = IMAGE.replace("asset inputs:file", f"{given}\n        asset inputs:file")
        with pytest.warns(UserWarning, match=r"/paint/image: texture 'a\.png' is missing; left out"):
            scene = load(tmp_path, PAINT % (text, image) + BOUND, strict=False)
        found = scene.shapes[0].material.bsdf
        assert found.base_color.ravel() == pytest.approx(color)


READERS = """def Shader "%s"
    {
        uniform token info:id = "UsdUVTexture"
        asset inputs:file = @a.png@
        float2 inputs:st.connect = </paint/%s.outputs:result>
        float3 outputs:rgb
        float outputs:r
    }
    def Shader "%s"
    {
        uniform token info:id = "UsdPrimvarReader_float2"
        string inputs:varname = "%s"
        float2 outputs:result
    }
    """


def textured_board(folder: Path, *readers: tuple[str, str, str], extra: str = "") -> str:
    """Return a mesh with `st` and a `UVMap` at each corner, with textures of (input, output, primvar)."""
    write_image(folder / "a.png", np.linspace(0, 1, 48, dtype=np.float32).reshape(4, 4, 3))
    inputs = [
        f"{kind} inputs:{name}.connect = </paint/i{i}.outputs:{'rgb' if 'color' in kind else 'r'}>"
        for i, (kind, name, _) in enumerate(readers)
    ]
    shaders = [READERS % (f"i{i}", f"r{i}", f"r{i}", each[2]) for i, each in enumerate(readers)]
    map_ = "texCoord2f[] primvars:UVMap = [(0, 0.5), (0.25, 0), (1, 0.25), (0.75, 1)]"
    board = BOUND.replace("    rel", f'    {map_} (interpolation = "faceVarying")\n{extra}    rel')
    return PAINT % ("\n        ".join(inputs), "".join(shaders)) + board


UV_MAP = [[0, 0.5], [0.25, 0], [1, 0.25], [0.75, 1]]


def test_textures_use_the_primvar_that_is_read_for_them(tmp_path: Path) -> None:
    """Blender calls its coordinates UVMap."""
    base = ("color3f", "diffuseColor", "UVMap")
    (mesh,) = load(tmp_path, textured_board(tmp_path, base)).shapes
    assert mesh.uvs[mesh.faces].reshape(-1, 2).tolist() == [UV_MAP[i] for i in (0, 1, 2, 0, 2, 3)]
    assert mesh.uvs1 is None
    move = IMAGE.replace(
        "float2 inputs:scale",
        "float2 inputs:in.connect = </paint/r0.outputs:result>\n        float2 inputs:scale",
    )
    text = (
        textured_board(tmp_path, base)
        .replace("/paint/i0.", "/paint/image.")
        .replace('def Shader "i0"', move + '\n    def Shader "i0"')
    )
    (moved,) = load(tmp_path, text).shapes
    assert moved.uvs.tolist() == mesh.uvs.tolist()
    np.testing.assert_allclose(moved.material.bsdf.base_color.transform[:2, 2], [0.25, 0.5])
    image = wf.render(wf.Scene([moved], [wf.Environment(1)]), spp=1, size=(8, 8), progress=False)
    assert np.isfinite(image.rgb).all()


def test_a_second_primvar_is_the_second_set(tmp_path: Path) -> None:
    readers = (
        ("color3f", "diffuseColor", "UVMap"),
        ("float", "roughness", "st"),
        ("float", "metallic", "UVMap"),
    )
    (mesh,) = load(tmp_path, textured_board(tmp_path, *readers)).shapes
    bsdf = mesh.material.bsdf
    assert [each.uv_set for each in (bsdf.base_color, bsdf.roughness, bsdf.metallic)] == [0, 1, 0]
    assert mesh.uvs[mesh.faces[0]].tolist() == UV_MAP[:3]
    assert mesh.uvs1[mesh.faces[0]].tolist() == [[0, 0], [1, 0], [1, 1]]


def test_the_first_coordinates_are_loaded_for_materials_without_textures(tmp_path: Path) -> None:
    text = (
        textured_board(tmp_path)
        .replace("primvars:st", "primvars:other")
        .replace("texCoord2f[] primvars:o", "float[] primvars:o")
    )
    text = text.replace("[(0, 0), (1, 0), (1, 1), (0, 1)]", "[0, 1, 2, 3]")
    (mesh,) = load(tmp_path, text).shapes
    assert mesh.uvs[mesh.faces[0]].tolist() == UV_MAP[:3]


def test_primvars_that_are_missing_or_too_many_are_named(tmp_path: Path) -> None:
    base = ("color3f", "diffuseColor", "uv")
    with pytest.raises(wf.SceneError, match="/board: primvars:uv, which is missing; zeros in its place"):
        load(tmp_path, textured_board(tmp_path, base))
    with pytest.warns(UserWarning, match="/board: primvars:uv, which is missing"):
        (mesh,) = load(tmp_path, textured_board(tmp_path, base), strict=False).shapes
    assert not mesh.uvs.any()
    three = [("float", name, name) for name in ("roughness", "metallic", "clearcoat")]
    extra = "".join(
        f'    texCoord2f[] primvars:{name} = [(0, 0)] (interpolation = "constant")\n' for _, name, _ in three
    )
    with pytest.raises(wf.SceneError, match=r"/paint/r2: the primvar 'clearcoat'"):
        load(tmp_path, textured_board(tmp_path, *three, extra=extra))
    with pytest.raises(wf.SceneError, match="/paint/r0: its varname, which is empty"):
        load(tmp_path, textured_board(tmp_path, ("float", "roughness", "")))
    narrow = '    float[] primvars:uv = [1, 2, 3, 4] (interpolation = "vertex")\n'
    with pytest.raises(wf.SceneError, match="/board: uv must have rows of 2 numbers"):
        load(tmp_path, textured_board(tmp_path, base, extra=narrow))
    with pytest.raises(wf.SceneError, match="/paint/r0: the shader 'UsdPrimvarReader_int'"):
        load(tmp_path, textured_board(tmp_path, base).replace("Reader_float2", "Reader_int"))


def test_colors_are_those_of_the_primvar_that_is_read(tmp_path: Path) -> None:
    reader = """def Shader "read"
    {
        uniform token info:id = "UsdPrimvarReader_float3"
        string inputs:varname = "tint"
        float3 outputs:result
    }"""
    extra = "".join(
        f'    color3f[] primvars:{name} = [({value}, 0, 1)] (interpolation = "constant")\n'
        for name, value in (("displayColor", 0), ("tint", 0.5))
    )
    paint = PAINT % ("color3f inputs:diffuseColor.connect = </paint/read.outputs:result>", reader)
    (mesh,) = load(tmp_path, paint + BOUND.replace("    rel", f"{extra}    rel")).shapes
    assert isinstance(mesh.material.bsdf.base_color, wf.VertexColors)
    assert mesh.colors[0, :3].tolist() == [0.5, 0, 1]


def test_instances_share_their_mesh(tmp_path: Path) -> None:
    copies = "".join(
        f"""def Xform "copy{i}" (instanceable = true
    prepend references = </model>)
{{
    double3 xformOp:translate = ({i}, 0, 0)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}}
"""
        for i in (1, 2)
    )
    scene = load(tmp_path, f'def Xform "model"\n{{\n{MESH}}}\n{copies}')
    shapes = scene.shapes
    assert len(shapes) == 3
    assert shapes[-1].mesh is shapes[-2].mesh
    assert [shape.transform[0, 3] for shape in shapes[-2:]] == [1, 2]


def test_point_instancers(tmp_path: Path) -> None:
    body = f"""def PointInstancer "many"
{{
    int[] protoIndices = [0, 0, 0]
    point3f[] positions = [(0, 0, 0), (5, 0, 0), (0, 7, 0)]
    float3[] scales = [(1, 1, 1), (2, 2, 2), (1, 1, 1)]
    rel prototypes = [</many/board>]
    {MESH}
}}
"""
    shapes = load(tmp_path, body).shapes
    assert [rows(shape.transform[:3, 3]) for shape in shapes] == [[0, 0, 0], [5, 0, 0], [0, 7, 0]]
    assert [shape.transform[0, 0] for shape in shapes] == [1, 2, 1]
    with pytest.raises(wf.SceneError, match=r"scene\.usda: .*/many: protoIndices has 3; there are 1"):
        load(tmp_path, body.replace("[0, 0, 0]", "[0, 3, 0]", 1))
    with pytest.raises(wf.SceneError, match=r"LoadLimits\.instances"):
        load(tmp_path, body, limits=wf.LoadLimits(instances=1))


@pytest.mark.parametrize("normalize", [0, 1])
def test_lights_with_areas(tmp_path: Path, normalize: int) -> None:
    common = f"float inputs:intensity = 3 float inputs:exposure = 1 bool inputs:normalize = {normalize}"
    common = "\n".join(
        f"    {part}" for part in common.replace(" float", "\nfloat").replace(" bool", "\nbool").split("\n")
    )
    body = MESH
    for name, own in (("Sphere", "radius = 2"), ("Disk", "radius = 2"), ("Rect", "width = 4")):
        body += f'def {name}Light "l{name}"\n{{\n{common}\n    float inputs:{own}\n}}\n'
    _, ball, disk, board = load(tmp_path, body).shapes
    areas = [16 * np.pi, 4 * np.pi, 4] if normalize else [1, 1, 1]
    for shape, area in zip((ball, disk, board), areas, strict=True):
        np.testing.assert_allclose(np.ravel(shape.emission), 6 / area, rtol=1e-5)
    assert ball.radius == 2
    for mesh, extent in ((disk, 2), (board, 2)):
        a, b, c = mesh.vertices[mesh.faces[0]]
        assert np.cross(b - a, c - a)[2] < 0
        assert np.abs(mesh.vertices[:, 0]).max() == pytest.approx(extent, rel=0.01)


def test_panels_may_be_stretched_and_balls_not(tmp_path: Path) -> None:
    body = """def RectLight "panel"
{
    float3 xformOp:scale = (2, 3, 1)
    uniform token[] xformOpOrder = ["xformOp:scale"]
}
"""
    _, panel = load(tmp_path, MESH + body).shapes
    np.testing.assert_allclose(panel.vertices.max(0), [1, 1.5, 0])
    with pytest.raises(wf.SceneError, match="/panel: its stretch"):
        load(tmp_path, MESH + body.replace("Rect", "Sphere"))


PLACED = "double3 xformOp:translate = (0, 4, 0); float xformOp:rotateX = -90; "
PLACED += 'uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateX"]'
POINT = f"float inputs:radius = 0.5; float inputs:intensity = 3; bool treatAsPoint = 1; {PLACED}"
CONE = "float inputs:shaping:cone:angle = 30; float inputs:shaping:cone:softness = 0.25"
SUN = "float inputs:intensity = 5; float inputs:angle = 1"
EVEN = "bool inputs:normalize = 1"
SEEN = "float horizontalAperture = 36; float verticalAperture = 24; float focalLength = 50"


@pytest.mark.parametrize(
    ("kind", "lines", "due"),
    [
        # what is not written is as the schema says
        ("SphereLight", "", {"shapes[1].radius": 0.5, "shapes[1].emission": 1}),
        ("DiskLight", "", {"shapes[1].bounds": Near([[-0.5, -0.5, 0], [0.5, 0.5, 0]], 1e-3)}),
        ("RectLight", "", {"shapes[1].bounds": [[-0.5, -0.5, 0], [0.5, 0.5, 0]]}),
        ("CylinderLight", "", {"shapes[1].bounds": Near([[-0.5, -0.5, -0.5], [0.5, 0.5, 0.5]], 1e-3)}),
        ("DistantLight", "", {"lights[0].angle": Near(0.53)}),
        ("DomeLight", "", {"lights[0]": wf.Environment, "lights[0].radiance": 1}),
        ("DomeLight", "color3f inputs:color = (1, 0.5, 0.25)", {"lights[0].radiance": [1, 0.5, 0.25]}),
        # at points
        ("SphereLight", POINT, {"lights[0]": wf.PointLight, "lights[0].position": Near([0, 4, 0])}),
        ("SphereLight", POINT, {"lights[0].intensity": Near(3 * np.pi / 4)}),
        (
            "SphereLight",
            f"{POINT}; {CONE}",
            {"lights[0]": wf.SpotLight, "lights[0].position": Near([0, 4, 0])},
        ),
        ("SphereLight", f"{POINT}; {CONE}", {"lights[0].angle": 60, "lights[0].blend": 0.25}),
        ("SphereLight", f"{POINT}; {CONE}", {"lights[0].direction": Near([0, -1, 0])}),
        ("SphereLight", f"{POINT}; {CONE}", {"lights[0].intensity": Near(3 * np.pi / 4)}),
        # at infinity
        ("DistantLight", f"{SUN}; {EVEN}", {"lights[0].direction": Near([0, 0, -1]), "lights[0].angle": 1}),
        ("DistantLight", f"{SUN}; {EVEN}", {"lights[0].irradiance": Near(5)}),
        ("DistantLight", SUN, {"lights[0].irradiance": Near(5 * np.pi * np.sin(np.radians(0.5)) ** 2)}),
        ("DomeLight", "asset inputs:texture:file = @sky.exr@", {"lights[0]": wf.Environment}),
        # cameras
        ("Camera", SEEN, {"camera.size": (768, 512), "camera.fov": Near(np.degrees(2 * np.arctan(12 / 50)))}),
        (
            "Camera",
            f"{SEEN}; float fStop = 2; float focusDistance = 8",
            {"camera.projection.aperture": Near(2.5), "camera.projection.focus": 8},
        ),
        ("Camera", PLACED, {"camera.origin": Near([0, 4, 0])}),
    ],
)
def test_lights_and_cameras(tmp_path: Path, kind: str, lines: str, due: Any) -> None:
    write_image(tmp_path / "sky.exr", np.linspace(0, 1, 96, dtype=np.float32).reshape(4, 8, 3))
    body = "\n".join(f"    {each}" for each in lines.split("; "))
    check(load(tmp_path, f'{MESH}def {kind} "it"\n{{\n{body}\n}}\n'), due)


PARTS = """    double radius = 2
    double height = 6
    double size = 4
    double width = 3
    double length = 5
"""


@pytest.mark.parametrize(
    ("kind", "volume", "extent"),
    [
        ("Cube", 64, (4, 4, 4)),
        ("Sphere", 32 / 3 * np.pi, (4, 4, 4)),
        ("Cylinder", 24 * np.pi, (4, 4, 6)),
        ("Cone", 8 * np.pi, (4, 4, 6)),
        ("Capsule", (24 + 32 / 3) * np.pi, (4, 4, 10)),
    ],
)
@pytest.mark.parametrize("axis", ["X", "Y", "Z"])
def test_solids(tmp_path: Path, kind: str, volume: float, extent: Any, axis: str) -> None:
    stretch = '    float3 xformOp:scale = (1, 1, 2)\n    uniform token[] xformOpOrder = ["xformOp:scale"]\n'
    own = "" if kind in ("Cube", "Sphere") else f'    uniform token axis = "{axis}"\n'
    body = f'def {kind} "solid"\n{{\n{PARTS}{own}{stretch}}}\n'
    (mesh,) = load(tmp_path, body).shapes
    size = np.roll(extent, "ZXY".index(axis)) if own else np.array(extent)
    np.testing.assert_allclose(np.ptp(mesh.bounds, axis=0), size * (1, 1, 2), rtol=1e-3)
    np.testing.assert_allclose(mesh.bounds.mean(0), 0, atol=1e-12)
    a, b, c = mesh.vertices[mesh.faces].transpose(1, 0, 2)
    inside = float((np.cross(a, b) * c).sum() / 6)  # above 0 where the fronts are outside
    assert inside == pytest.approx(2 * volume, rel=2e-3)
    if mesh.normals is not None:
        ahead = (np.cross(b - a, c - a)[:, None] * mesh.normals[mesh.faces]).sum(2)
        assert (ahead > 0).all()
    assert mesh.name == "solid"


def test_the_apex_of_a_cone_is_above(tmp_path: Path) -> None:
    (mesh,) = load(tmp_path, f'def Cone "solid"\n{{\n{PARTS}    uniform token axis = "Y"\n}}\n').shapes
    top = mesh.vertices[mesh.vertices[:, 1] > 2.99]
    np.testing.assert_allclose(top, [[0, 3, 0]] * len(top), atol=1e-12)
    side = mesh.normals[:, 1] > -0.9  # its normals are perpendicular to the lines to the apex
    along = (np.array([0, 3, 0]) - mesh.vertices[side]) * mesh.normals[side]
    np.testing.assert_allclose(along.sum(1), 0, atol=1e-9)
    assert side.sum() > 200


def test_planes(tmp_path: Path) -> None:
    for axis, size, normal in (("Z", (3, 5, 0), 2), ("X", (0, 5, 3), 0), ("Y", (3, 0, 5), 1)):
        (mesh,) = load(tmp_path, f'def Plane "p"\n{{\n{PARTS}    uniform token axis = "{axis}"\n}}\n').shapes
        np.testing.assert_allclose(np.ptp(mesh.bounds, axis=0), size)
        a, b, c = mesh.vertices[mesh.faces[0]]
        assert np.cross(b - a, c - a)[normal] > 0


def test_solids_show_their_color_or_material(tmp_path: Path) -> None:
    color = "    color3f[] primvars:displayColor = [(0.25, 0.5, 0.75)]\n"
    for kind in ("Sphere", "Cube"):
        (shape,) = load(tmp_path, f'def {kind} "s"\n{{\n{color}}}\n').shapes
        assert isinstance(shape, wf.Sphere) == (kind == "Sphere")
        camera = wf.Camera.look_at((0, 0, 9), (0, 0, 0), fov=2, size=(2, 2))
        scene = wf.Scene([shape], [wf.Environment(1)], camera=camera)
        picture = wf.render(scene, 16, progress=False).rgb
        np.testing.assert_allclose(picture.mean((0, 1)), [0.25, 0.5, 0.75], rtol=0.02)
    bound = BOUND.replace("Mesh", "Cube").replace(TRIANGLE, "")
    (cube,) = load(tmp_path, PAINT % ("float inputs:roughness = 0.25", "") + bound).shapes
    assert float(np.ravel(cube.material.bsdf.roughness)[0]) == 0.25
    with pytest.raises(wf.SceneError, match=r"/s: radius is 0\.0; it must be above 0"):
        load(tmp_path, 'def Cylinder "s"\n{\n    double radius = 0\n}\n')


def test_cylinder_lights_shine_from_their_sides(tmp_path: Path) -> None:
    own = "    float inputs:intensity = 3\n    float inputs:radius = 0.5\n    float inputs:length = 4\n"
    scale = '    float3 xformOp:scale = (2, 3, 3)\n    uniform token[] xformOpOrder = ["xformOp:scale"]\n'
    for normalize, radiance in ((0, 3), (1, 3 / (2 * np.pi * 1.5 * 8))):
        body = f'def CylinderLight "l"\n{{\n{own}{scale}    bool inputs:normalize = {normalize}\n}}\n'
        _, tube = load(tmp_path, MESH + body, "metersPerUnit = 0.1").shapes
        np.testing.assert_allclose(np.ravel(tube.emission), radiance, rtol=1e-5)
        np.testing.assert_allclose(np.ptp(tube.bounds, axis=0), [0.8, 0.3, 0.3], rtol=1e-3)
        a, b, c = tube.vertices[tube.faces].transpose(1, 0, 2)
        normal = np.cross(b - a, c - a)
        assert np.abs(normal[:, 0]).max() < 1e-12  # no ends
        assert ((a + b + c) * normal).sum(1).min() > 0


def test_orthographic_cameras(tmp_path: Path) -> None:
    body = """def Camera "view"
{
    token projection = "orthographic"
    float horizontalAperture = 60
    float verticalAperture = 40
    double3 xformOp:translate = (0, 0, 9)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
"""
    camera = load(tmp_path, MESH + body, "metersPerUnit = 0.5").camera
    assert camera.size == (768, 512)
    pixels, _ = camera.project([(1.5, 1, 0), (-1.5, -1, -7)])  # 6 by 4 units of half a meter
    np.testing.assert_allclose(pixels, [[768, 0], [0, 512]], atol=1e-4)


def test_instances_have_the_materials_that_are_bound_to_them(tmp_path: Path) -> None:
    copies = "".join(
        f"""def Xform "copy{i}" (instanceable = true
    prepend references = </model>
    prepend apiSchemas = ["MaterialBindingAPI"])
{{
    rel material:binding = </{name}>
}}
"""
        for i, name in enumerate(("paint", "gloss", "paint"))
    )
    paints = PAINT % ("", "") + (PAINT % ("", "")).replace("paint", "gloss")
    shapes = load(tmp_path, f'{paints}class Xform "model"\n{{\n{MESH}}}\n{copies}').shapes
    assert [shape.material.name for shape in shapes] == ["paint", "gloss", "paint"]
    assert shapes[0].mesh is shapes[2].mesh


def test_the_first_time_counts(tmp_path: Path) -> None:
    body = MESH.replace(
        "{\n",
        """{
    double3 xformOp:translate.timeSamples = { 5: (1, 0, 0), 9: (2, 0, 0) }
    uniform token[] xformOpOrder = ["xformOp:translate"]
""",
        1,
    )
    (mesh,) = load(tmp_path, body, "metersPerUnit = 1\nstartTimeCode = 5\nendTimeCode = 9").shapes
    assert mesh.vertices[:, 0].min() == 1
    (mesh,) = load(
        tmp_path, body, "metersPerUnit = 1\nstartTimeCode = 5\nendTimeCode = 9", time=7 / 24
    ).shapes
    assert mesh.vertices[:, 0].min() == 1.5
    with pytest.raises(wf.SceneError, match="time is nan; it must be finite"):
        load(tmp_path, body, time=np.nan)


def test_errors_name_file_and_prim(tmp_path: Path) -> None:
    warm = "    bool inputs:enableColorTemperature = 1\n    float inputs:colorTemperature = 3\n"
    for body, message in (
        (f'def SphereLight "l"\n{{\n{warm}}}\n', "/l: inputs:colorTemperature is 3; clamped to 1000"),
        ('def SphereLight "l"\n{\n    float inputs:intensity = nan\n}\n', "/l: "),
        ('def Sphere "s"\n{\n    double radius = -1\n}\n', "/s: "),
    ):
        with pytest.raises(wf.SceneError, match=f"^{tmp_path}/scene.usda: {message}"):
            load(tmp_path, MESH + body)


def test_panels_show_textures_and_lights_have_a_temperature(tmp_path: Path) -> None:
    write_image(tmp_path / "a.exr", np.array([[[1, 0, 0], [0, 1, 0]], [[0, 0, 1], [1, 1, 1]]], np.float32))
    warm = "    bool inputs:enableColorTemperature = 1\n    float inputs:colorTemperature = 3000\n"
    own = "    asset inputs:texture:file = @a.exr@\n    float inputs:intensity = 2\n"
    body = f'def RectLight "panel"\n{{\n{own}}}\n'
    ball = f'def SphereLight "ball"\n{{\n    float inputs:intensity = 2\n{warm}}}\n'
    scene = load(tmp_path, MESH + body + ball)
    _, panel, lamp = scene.shapes
    glow = np.ravel(lamp.emission)
    assert glow @ [0.2126, 0.7152, 0.0722] == pytest.approx(2, rel=1e-3)
    assert glow[0] / glow[2] == pytest.approx(6.4, rel=0.03)  # #ffb16e, of tables of 3000 K
    camera = wf.Camera.look_at((0, 0, -5), (0, 0, 0), fov=2 * np.degrees(np.arctan(0.1)), size=(2, 2))
    picture = wf.render(wf.Scene([panel], camera=camera), 64, filter="box", progress=False).rgb
    pixels = picture.reshape(4, 3)  # upright where it is seen from its front
    assert pixels[:3].argmax(1).tolist() == [0, 1, 2]
    assert pixels[3].min() > 0.9 > pixels[:3].min(1).max()


def test_what_is_hidden_is_left_out(tmp_path: Path) -> None:
    hidden = MESH.replace("board", "hidden").replace("{\n", '{\n    token visibility = "invisible"\n', 1)
    guide = MESH.replace("board", "guide").replace("{\n", '{\n    uniform token purpose = "guide"\n', 1)
    assert [shape.name for shape in load(tmp_path, MESH + hidden + guide).shapes] == ["board"]


@pytest.mark.parametrize(
    ("body", "message"),
    [
        (f'def BasisCurves "hair"\n{{\n}}\n{MESH}', "/hair: a BasisCurves; left out"),
        (MESH + 'def CylinderLight "l"\n{\n    bool treatAsLine = 1\n}\n', "/l: treatAsLine"),
        (PAINT % ("float inputs:displacement = 1", "") + BOUND, "/paint/shader: displacement"),
        (MESH + 'def SphereLight "l"\n{\n    float inputs:shaping:cone:angle = 9\n}\n', "/l: its radius"),
        (
            MESH + 'def DiskLight "l"\n{\n    float inputs:shaping:cone:angle = 9\n}\n',
            "/l: inputs:shaping:cone",
        ),
        (
            MESH + 'def SphereLight "l"\n{\n    asset inputs:shaping:ies:file = @a.ies@\n}\n',
            "/l: inputs:shaping:ies:file",
        ),
        (PAINT.replace("UsdPreviewSurface", "Other") % ("", "") + BOUND, "/paint: its surface shader"),
        (MESH.replace('"none"', '"catmullClark"'), "/board: subdivisionScheme"),
        (
            MESH + 'def DomeLight "d"\n{\n    token inputs:texture:format = "angular"\n}\n',
            "/d: inputs:texture",
        ),
    ],
)
def test_what_is_not_honored_is_one_warning(tmp_path: Path, body: str, message: str) -> None:
    with pytest.raises(wf.SceneError, match=f"not honored: {message}"):
        load(tmp_path, body)
    with pytest.warns(UserWarning, match=message):
        load(tmp_path, body, strict=False)


def test_files_elsewhere_and_malformed_ones_are_refused(tmp_path: Path) -> None:
    inner = tmp_path / "inner"
    inner.mkdir()
    (tmp_path / "other.usda").write_text(f'#usda 1.0\ndef "model"\n{{\n{MESH}}}\n')
    body = 'def Xform "a" (prepend references = @../other.usda@</model>)\n{\n}\n'
    with pytest.raises(wf.SceneError, match="outside its folder"):
        load(inner, body)
    assert load(inner, body, search_paths=tmp_path).shapes
    with pytest.raises(wf.SceneError, match=r"scene\.usda: cannot be read: .*scene\.usda"):
        load(tmp_path, 'def Mesh "a\n')
    for wrong in ("[0, 1, 2, 9]", "[0, 1, 2]"):
        with pytest.raises(wf.SceneError, match="/board: faceVertex"):
            load(tmp_path, MESH.replace("[0, 1, 2, 3]", wrong))


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.first(2)
def test_mutated_files_give_a_scene_or_a_typed_error(tmp_path: Path, seed: int) -> None:
    """Words exchanged, left out and repeated, and numbers that are odd."""
    chance = random.Random(seed)
    light = (
        'def SphereLight "l"\n{\n    float inputs:radius = 2\n}\ndef Camera "c"\n{\n    float fStop = 2\n}\n'
    )
    words = (PAINT % ("float inputs:roughness = 0.5", "") + BOUND + light).replace("(", " ( ").split(" ")
    refused = 0
    for _ in range(40):
        text = list(words)
        for _ in range(chance.randint(0, 2)):
            at = chance.randrange(len(text))
            text[at] = chance.choice([text[chance.randrange(len(text))], "", "-1", "1e300", "nan", "[]"])
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            try:
                load(tmp_path, " ".join(text), strict=False)
            except wf.SceneError:
                refused += 1
    assert 0 < refused < 40


def test_binary_files_and_archives_with_images(tmp_path: Path) -> None:
    from pxr import Usd, UsdUtils

    write_image(tmp_path / "a.png", np.full((4, 4, 3), 0.5, np.float32))
    text = "color3f inputs:diffuseColor.connect = </paint/image.outputs:rgb>"
    load(tmp_path, PAINT % (text, IMAGE) + BOUND)
    source = str(tmp_path / "scene.usda")
    Usd.Stage.Open(source).Export(str(tmp_path / "scene.usdc"))
    assert UsdUtils.CreateNewUsdzPackage(source, str(tmp_path / "packed.usdz"))
    (mesh,) = wf.load(tmp_path / "scene.usdc", strict=True).shapes
    assert mesh.material.bsdf.base_color.size == (4, 4)
    (tmp_path / "alone").mkdir()
    (tmp_path / "packed.usdz").rename(tmp_path / "alone" / "packed.usdz")
    (mesh,) = wf.load(tmp_path / "alone" / "packed.usdz", strict=True).shapes
    assert mesh.material.bsdf.base_color.size == (4, 4)
    assert mesh.material.bsdf.base_color.wrap == ("mirror", "clamp")


@pytest.mark.parametrize(
    ("body", "message"),
    [
        (MESH.replace("board", "torn").replace("[4]", "[7]"), "/torn: .* left out"),
        ('def SphereLight "lamp"\n{\n    float inputs:radius = -1\n}\n', "/lamp: .*radius.*; left out"),
        (
            'def PointInstancer "many"\n{\n    rel prototypes = </board>\n    int[] protoIndices = [5]\n'
            "    point3f[] positions = [(0, 0, 0)]\n}\n",
            "/many: protoIndices has 5; there are 1; left out",
        ),
        (
            'def PointInstancer "many"\n{\n    rel prototypes = </board>\n    int[] protoIndices = [0, 0]\n'
            "    point3f[] positions = [(0, 0, 0)]\n}\n",
            r"usd-core: /many -- found \[1\] positions, but expected \[2\]",
        ),
    ],
)
def test_a_damaged_prim_costs_itself_and_what_usd_core_says_is_listed(
    tmp_path: Path, body: str, message: str, capfd: pytest.CaptureFixture[str]
) -> None:
    with pytest.warns(UserWarning, match=message) as told:
        scene = load(tmp_path, MESH + body, strict=False)
    assert len(told) == 1
    assert scene.shapes[0].name == "board"
    assert "positions" not in capfd.readouterr().err
    with pytest.raises(wf.SceneError, match=message):
        load(tmp_path, MESH + body)
