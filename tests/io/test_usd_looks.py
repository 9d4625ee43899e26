"""What of USD is shown as usdview shows it: lights, colors of instances, opacities, purposes, lenses."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from inside import Losses, write_image

import wavefront as wf

pytest.importorskip("pxr")
SQUARE = """int[] faceVertexCounts = [4]
 int[] faceVertexIndices = [0, 1, 2, 3]
 point3f[] points = [(0, 0, 0), (2, 0, 0), (2, 1, 0), (0, 1, 0)]
 uniform token subdivisionScheme = "none"
"""


def board(more: str = "", api: str = "") -> str:
    meta = f'(prepend apiSchemas = ["{api}"])' if api else ""
    return f'def Mesh "board" {meta}\n{{\n {SQUARE} {more}\n}}\n'


def paint(inputs: str, name: str = "paint", more: str = "") -> str:
    return f"""def Material "{name}"
{{
 token outputs:surface.connect = </{name}/s.outputs:surface>
 def Shader "s"
 {{
 uniform token info:id = "UsdPreviewSurface"
 {inputs}
 token outputs:surface
 }}
 {more}
}}
"""


def load(folder: Path, body: str, header: str = "", strict: bool = True) -> wf.Scene:
    path = folder / "a.usda"
    path.write_text(f"#usda 1.0\n(metersPerUnit = 1\n{header})\n{body}")
    return wf.load(path, strict=strict, progress=False)


def glow(shape: Any) -> list[float]:
    return np.ravel(shape.emission).tolist()


@pytest.mark.parametrize(("normalize", "radiance"), [(0, 6.0), (1, 3.0)])
def test_a_mesh_that_is_a_light_shines(tmp_path: Path, normalize: int, radiance: float) -> None:
    more = f"float inputs:intensity = 3\n float inputs:exposure = 1\n bool inputs:normalize = {normalize}"
    (shape,) = load(tmp_path, board(more, "MeshLightAPI")).shapes
    np.testing.assert_allclose(glow(shape), radiance)
    ball = f'def Sphere "s" (prepend apiSchemas = ["LightAPI"])\n{{\n {more}\n}}\n'
    (shape,) = load(tmp_path, ball).shapes
    assert glow(shape)[0] == pytest.approx(6 / (4 * np.pi) if normalize else 6, rel=1e-3)


def test_the_light_of_a_mesh_and_of_its_material(tmp_path: Path) -> None:
    bound = "float inputs:intensity = 2\n rel material:binding = </paint>\n"
    bound += " uniform token light:materialSyncMode = "
    api = 'MeshLightAPI", "MaterialBindingAPI'
    shining = paint("color3f inputs:emissiveColor = (1, 0.5, 0)")
    tinted = board(bound + '"materialGlowTintsLight"', api)
    assert glow(load(tmp_path, shining + tinted).shapes[0]) == [2, 1, 0]
    assert glow(load(tmp_path, paint("") + tinted).shapes[0]) == [2, 2, 2]
    (alone,) = load(tmp_path, shining + board(bound + '"noMaterialResponse"', api)).shapes
    assert glow(alone) == [2, 2, 2]
    assert not np.ravel(alone.material.bsdf.reflectance).any()
    with pytest.raises(wf.SceneError, match=r"/board: light:materialSyncMode 'independent'"):
        load(tmp_path, shining + board(bound + '"independent"', api))


def test_point_lights_of_no_radius(tmp_path: Path) -> None:
    """Their power is that of a sphere, which `normalize` makes independent of its radius."""
    body = board().replace("{", "{{").replace("}", "}}")
    body += 'def SphereLight "l"\n{{\n float inputs:intensity = 100\n {}\n}}\n'
    for more in ("", "bool treatAsPoint = 1"):
        own = f"float inputs:radius = 0\n bool inputs:normalize = 1\n {more}"
        (light,) = load(tmp_path, body.format(own)).lights
        assert isinstance(light, wf.PointLight)
        np.testing.assert_allclose(np.ravel(light.intensity), 25)
    small = "float inputs:radius = 0.01\n bool inputs:normalize = 1\n bool treatAsPoint = 1"
    np.testing.assert_allclose(np.ravel(load(tmp_path, body.format(small)).lights[0].intensity), 25)
    spot = "float inputs:radius = 0\n bool inputs:normalize = 1\n float inputs:shaping:cone:angle = 30"
    assert isinstance(load(tmp_path, body.format(spot)).lights[0], wf.SpotLight)
    with pytest.warns(UserWarning, match=r"/l: inputs:radius is 0 and gives no light; left out"):
        assert not load(tmp_path, body.format("float inputs:radius = 0"), strict=False).lights


@pytest.mark.parametrize(
    ("kind", "own", "area"),
    [
        ("Disk", "float inputs:radius = 0", np.pi * 1e-6),
        ("Rect", "float inputs:width = 0", 1e-3),
        ("Cylinder", "float inputs:radius = 0", 2 * np.pi * 1e-3),
        ("Cylinder", "float inputs:length = 0", np.pi * 1e-3),
    ],
)
def test_other_lights_of_no_size_keep_their_power(tmp_path: Path, kind: str, own: str, area: float) -> None:
    body = board() + f'def {kind}Light "l"\n{{\n {own}\n bool inputs:normalize = 1\n}}\n'
    with pytest.warns(UserWarning, match=r"/l: inputs:\w+ is 0; 0\.001 meters in its place"):
        _, light = load(tmp_path, body, strict=False).shapes
    assert glow(light)[0] == pytest.approx(1 / area, rel=1e-3)


COPIES = """def PointInstancer "many"
{
 rel prototypes = [</many/board>]
 int[] protoIndices = [0, 0, 0]
 point3f[] positions = [(0, 0, 0), (3, 0, 0), (6, 0, 0)]
 %s
}
"""


def test_instances_have_colors_and_opacities_of_their_own(tmp_path: Path) -> None:
    colors = "color3f[] primvars:displayColor = [(1, 0, 0), (0, 0, 1), (1, 0, 0)]"
    veils = "float[] primvars:displayOpacity = [1, 0.5, 0.25]"
    own = f'{colors} (interpolation = "vertex")\n {veils} (interpolation = "vertex")\n'
    shapes = load(tmp_path, COPIES % (own + board())).shapes
    assert len({id(shape.mesh) for shape in shapes}) == 1
    found = {shape.transform[0, 3]: shape.material for shape in shapes}
    seen = [np.ravel(found[x].bsdf.reflectance).tolist() for x in (0, 3, 6)]
    assert seen == [[1, 0, 0], [0, 0, 1], [1, 0, 0]]
    assert found[0].alpha is None
    assert [float(np.ravel(found[x].alpha)[0]) for x in (3, 6)] == [0.5, 0.25]
    fewer = own.replace(", (1, 0, 0)]", "]")
    with pytest.raises(wf.SceneError, match=r"/many: displayColor has 2 values for 3 instances; left out"):
        load(tmp_path, COPIES % (fewer + board()))


def test_instances_color_balls_and_materials_that_read_their_colors(tmp_path: Path) -> None:
    own = 'color3f[] primvars:displayColor = [(1, 0, 0), (0, 1, 0), (0, 0, 1)] (interpolation = "vertex")\n'
    balls = load(tmp_path, (COPIES % (own + 'def Sphere "board"\n{\n}\n'))).shapes
    found = {ball.center[0]: np.ravel(ball.material.bsdf.reflectance).tolist() for ball in balls}
    assert found == {0: [1, 0, 0], 3: [0, 1, 0], 6: [0, 0, 1]}
    reader = """def Shader "r"
 {
 uniform token info:id = "UsdPrimvarReader_float3"
 string inputs:varname = "displayColor"
 float3 outputs:result
 }
"""
    look = paint("color3f inputs:diffuseColor.connect = </paint/r.outputs:result>", more=reader)
    bound = board("rel material:binding = </paint>", "MaterialBindingAPI")
    shapes = load(tmp_path, look + COPIES % (own + bound)).shapes
    found = {
        shape.transform[0, 3] if isinstance(shape, wf.Instance) else shape.vertices[:, 0].min(): np.ravel(
            shape.material.bsdf.base_color
        ).tolist()
        for shape in shapes
    }
    assert found == {0: [1, 0, 0], 3: [0, 1, 0], 6: [0, 0, 1]}


def test_instances_inherit_colors_from_above_their_prototype(tmp_path: Path) -> None:
    copies = "".join(
        f"""def Xform "copy{i}" (instanceable = true
 prepend references = </model>)
{{
 color3f[] primvars:displayColor = [{color}]
}}
"""
        for i, color in enumerate(("(1, 0, 0)", "(0, 0, 1)"))
    )
    shapes = load(tmp_path, f'class Xform "model"\n{{\n{board()}}}\n{copies}').shapes
    assert [np.ravel(shape.material.bsdf.reflectance).tolist() for shape in shapes] == [[1, 0, 0], [0, 0, 1]]
    assert shapes[0].mesh is shapes[1].mesh


def alpha_seen(folder: Path, body: str) -> Any:
    (shape,) = load(folder, body).shapes
    camera = wf.Camera.orthographic((1, 0.5, 5), (1, 0.5, 0), height=1, size=(8, 4))
    return wf.render(
        wf.Scene([shape], [wf.Environment(1)], camera), 64, background="transparent", progress=False
    )


def test_display_opacities(tmp_path: Path) -> None:
    half = "float[] primvars:displayOpacity = [0.5]"
    assert alpha_seen(tmp_path, board(half)).alpha.mean() == pytest.approx(0.5, abs=0.05)
    sides = 'float[] primvars:displayOpacity = [0, 1, 1, 0] (interpolation = "vertex")'
    sides += "\n color3f[] primvars:displayColor = [(1, 0, 0)]"
    seen = alpha_seen(tmp_path, board(sides)).alpha
    assert seen[:, 0].mean() == pytest.approx(1 / 16, abs=0.06)
    assert seen[:, 7].mean() == pytest.approx(15 / 16, abs=0.06)
    solids = f'def Cube "c"\n{{\n {half}\n}}\n', f'def Sphere "c"\n{{\n {half}\n}}\n'
    for each in solids:
        material = load(tmp_path, each).shapes[0].material
        assert material.alpha is not None


def test_a_shader_may_read_an_opacity(tmp_path: Path) -> None:
    reader = """def Shader "r"
 {
 uniform token info:id = "UsdPrimvarReader_float"
 string inputs:varname = "displayOpacity"
 float inputs:fallback = 0.25
 float outputs:result
 }
"""
    look = paint("float inputs:opacity.connect = </paint/r.outputs:result>", more=reader)
    bound = "rel material:binding = </paint>\n float[] primvars:displayOpacity = [0.5]"
    seen = alpha_seen(tmp_path, look + board(bound, "MaterialBindingAPI"))
    assert seen.alpha.mean() == pytest.approx(0.5, abs=0.05)
    seen = alpha_seen(tmp_path, look + board(bound.partition("\n")[0], "MaterialBindingAPI"))
    assert seen.alpha.mean() == pytest.approx(0.25, abs=0.05)


def test_readers_of_primvars_have_fallbacks(tmp_path: Path) -> None:
    reader = """def Shader "r"
 {
 uniform token info:id = "UsdPrimvarReader_float3"
 string inputs:varname = "tint"
 float3 inputs:fallback = (1, 0.5, 0)
 float3 outputs:result
 }
"""
    look = paint("color3f inputs:diffuseColor.connect = </paint/r.outputs:result>", more=reader)
    (shape,) = load(tmp_path, look + board("rel material:binding = </paint>", "MaterialBindingAPI")).shapes
    np.testing.assert_allclose(shape.colors[:, :3], [[1, 0.5, 0]] * len(shape.colors))


@pytest.mark.parametrize(
    ("name", "scale", "bias", "shown"),
    [("diffuseColor", 3, 0, 1.0), ("diffuseColor", 1, -1, 0.0), ("emissiveColor", 1, -1, 0.0)],
)
def test_textures_beyond_their_range_are_clamped(
    tmp_path: Path, name: str, scale: float, bias: float, shown: float
) -> None:
    write_image(tmp_path / "a.png", np.full((2, 2, 3), 0.5, np.float32))
    image = f"""def Shader "t"
 {{
 uniform token info:id = "UsdUVTexture"
 asset inputs:file = @a.png@
 float4 inputs:scale = ({scale}, {scale}, {scale}, 1)
 float4 inputs:bias = ({bias}, {bias}, {bias}, 0)
 float3 outputs:rgb
 }}
"""
    look = paint(f"color3f inputs:{name}.connect = </paint/t.outputs:rgb>", more=image)
    body = look + board("rel material:binding = </paint>", "MaterialBindingAPI")
    with pytest.warns(UserWarning, match=rf"/paint/s: inputs:{name}, a texture, is .*; clamped to 0 to"):
        (shape,) = load(tmp_path, body, strict=False).shapes
    value = shape.emission if name == "emissiveColor" else shape.material.bsdf.base_color
    assert value.limits()[0] >= 0
    camera = wf.Camera.orthographic((1, 0.5, 5), (1, 0.5, 0), height=0.5, size=(2, 2))
    lights = [] if name == "emissiveColor" else [wf.Environment(1)]
    picture = wf.render(wf.Scene([shape], lights, camera), 4, aovs=("albedo",), progress=False)
    seen = picture.rgb if name == "emissiveColor" else picture.albedo
    np.testing.assert_allclose(seen, shown, atol=0.06)


def test_a_texture_without_a_file_shows_its_fallback(tmp_path: Path) -> None:
    image = """def Shader "t"
 {
 uniform token info:id = "UsdUVTexture"
 float4 inputs:fallback = (0, 0.75, 0, 1)
 float3 outputs:rgb
 }
"""
    look = paint("color3f inputs:diffuseColor.connect = </paint/t.outputs:rgb>", more=image)
    (shape,) = load(tmp_path, look + board("rel material:binding = </paint>", "MaterialBindingAPI")).shapes
    np.testing.assert_allclose(np.ravel(shape.material.bsdf.base_color), [0, 0.75, 0])


def test_materials_are_bound_for_purposes(tmp_path: Path) -> None:
    looks = paint("", "all") + paint("", "preview") + paint("", "full")
    names = {"": "all", ":preview": "preview", ":full": "full"}
    for bound, shown in (
        ((":preview", ":full"), "preview"),
        ((":preview",), "preview"),
        (("", ":full"), "all"),
        ((":full",), "full"),
    ):
        more = "\n ".join(f"rel material:binding{each} = </{names[each]}>" for each in bound)
        (shape,) = load(tmp_path, looks + board(more, "MaterialBindingAPI")).shapes
        assert shape.material.name == shown
    (shape,) = load(
        tmp_path, looks + board("rel material:binding:preview = </preview>", "MaterialBindingAPI")
    ).shapes
    assert shape.material.name == "preview"


@pytest.mark.parametrize("projection", ["perspective", "orthographic"])
def test_offsets_of_the_aperture_move_the_film(tmp_path: Path, projection: str) -> None:
    body = f"""def Camera "c"
{{
 token projection = "{projection}"
 float horizontalAperture = 20
 float verticalAperture = 10
 float focalLength = 20
 float horizontalApertureOffset = 5
 float verticalApertureOffset = -2
 double3 xformOp:translate = (0, 0, 2)
 uniform token[] xformOpOrder = ["xformOp:translate"]
}}
"""
    from pxr import Gf, Usd, UsdGeom

    camera = load(tmp_path, board() + body).camera
    stage = Usd.Stage.Open(str(tmp_path / "a.usda"))
    frustum = UsdGeom.Camera(stage.GetPrimAtPath("/c")).GetCamera(Usd.TimeCode.Default()).frustum
    matrix = frustum.ComputeViewMatrix() * frustum.ComputeProjectionMatrix()
    points = [(0.1, 0.2, 0), (-0.3, 0.1, 0.5)]
    there = np.array([matrix.Transform(Gf.Vec3d(*point)) for point in points])[:, :2]
    pixels, _ = camera.project(points)
    np.testing.assert_allclose(pixels / camera.size, (1 + there * (1, -1)) / 2, atol=1e-5)


def test_subdivision_that_is_not_set_is_one_notice(tmp_path: Path) -> None:
    body = "".join(board().replace("board", f"board{i}") for i in range(3))
    body = body.replace(' uniform token subdivisionScheme = "none"\n', "")
    assert len(load(tmp_path, body).shapes) == 3
    with pytest.warns(UserWarning, match=r"a\.usda: /board0: subdivisionScheme is not set") as told:
        scene = load(tmp_path, body, strict=False)
    assert len(told) == 1
    assert scene.losses == ()


def test_notices_are_no_errors_where_losses_are() -> None:
    losses = Losses("a.usda", strict=True)
    losses.notice("this", "/a", "shown so")
    losses.report()
    losses.note("that", "/a")
    with pytest.raises(wf.SceneError, match=r"^a\.usda: not honored: /a: that$"):
        losses.report()
    losses = Losses("a.usda")
    losses.notice("this", "/a", "shown so")
    losses.notice("this", "/b", "shown so")
    with pytest.warns(UserWarning, match=r"^a\.usda: /a: this; shown so$"):
        losses.report()
