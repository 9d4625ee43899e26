"""Names of images and other files as their author's disk had them, in every format that refers to files."""

import json
import os
import sys
import warnings

import numpy as np
import pytest
from inside import SceneError, SceneFiles
from PIL import Image as Pil

import wavefront as wf

RED = (1.0, 0.0, 0.0)
FACE = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nusemtl m\nf 1/1 2/2 3/3\n"
NAMES = [  # of textures/tex.png, or of tex.png
    "C:\\Users\\someone\\Desktop\\tex.png",
    "D:tex.png",
    "\\\\server\\share\\tex.png",
    "/home/someone/tex.png",
    "../textures/tex.png",
    "..\\..\\tex.png",
    "file:///C:/Users/someone/tex.png",
    "file:/home/someone/tex.png",
    "http://example.org/a/tex.png?raw=1#top",
    "somewhere/else/tex.png",
    "TEX.PNG",
    "C:/Users/A%20B/te%78.png",
    "'C:/Users/someone/tex.png'",
]


def write_obj(folder, name):
    (folder / "m.mtl").write_text(f"newmtl m\nKd 1 1 1\nmap_Kd {name}\n")
    (folder / "a.obj").write_text("mtllib m.mtl\n" + FACE)
    return folder / "a.obj"


def write_ply(folder, name):
    lines = ["ply", "format ascii 1.0", f"comment TextureFile {name}", "element vertex 3"]
    lines += [f"property float {x}" for x in ("x", "y", "z", "s", "t")]
    lines += ["element face 1", "property list uchar int vertex_indices", "end_header"]
    (folder / "a.ply").write_text("\n".join([*lines, "0 0 0 0 0", "1 0 0 1 0", "0 1 0 0 1", "3 0 1 2", ""]))
    return folder / "a.ply"


def write_gltf(folder, name):
    points, uvs = np.eye(3, dtype="<f4"), np.eye(3, 2, dtype="<f4")
    (folder / "a.bin").write_bytes(points.tobytes() + uvs.tobytes())
    material = {"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}, "metallicFactor": 0}}
    document = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "material": 0}]}],
        "materials": [material],
        "textures": [{"source": 0}],
        "images": [{"uri": name}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"},
            {"bufferView": 1, "componentType": 5126, "count": 3, "type": "VEC2"},
        ],
        "bufferViews": [
            {"buffer": 0, "byteLength": 36},
            {"buffer": 0, "byteOffset": 36, "byteLength": 24},
        ],
        "buffers": [{"uri": "a.bin", "byteLength": 60}],
    }
    (folder / "a.gltf").write_text(json.dumps(document))
    return folder / "a.gltf"


def write_dae(folder, name):
    quoted = name.replace("&", "&amp;")
    text = f"""<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
    <asset><up_axis>Y_UP</up_axis></asset>
    <library_images><image id="i"><init_from>{quoted}</init_from></image></library_images>
    <library_effects><effect id="e"><profile_COMMON>
    <newparam sid="s"><surface type="2D"><init_from>i</init_from></surface></newparam>
    <newparam sid="p"><sampler2D><source>s</source></sampler2D></newparam>
    <technique sid="t"><phong><diffuse><texture texture="p" texcoord="U"/></diffuse></phong></technique>
    </profile_COMMON></effect></library_effects>
    <library_materials><material id="m"><instance_effect url="#e"/></material></library_materials>
    <library_geometries><geometry id="g"><mesh>
    <source id="v"><float_array id="va" count="9">0 0 0 1 0 0 0 1 0</float_array><technique_common>
    <accessor source="#va" count="3" stride="3"><param name="X" type="float"/><param name="Y" type="float"/>
    <param name="Z" type="float"/></accessor></technique_common></source>
    <source id="u"><float_array id="ua" count="6">0 0 1 0 0 1</float_array><technique_common>
    <accessor source="#ua" count="3" stride="2"><param name="S" type="float"/><param name="T" type="float"/>
    </accessor></technique_common></source>
    <vertices id="p"><input semantic="POSITION" source="#v"/></vertices>
    <triangles count="1" material="mm"><input semantic="VERTEX" source="#p" offset="0"/>
    <input semantic="TEXCOORD" source="#u" offset="1" set="0"/><p>0 0 1 1 2 2</p></triangles>
    </mesh></geometry></library_geometries>
    <library_visual_scenes><visual_scene id="w"><node><instance_geometry url="#g"><bind_material>
    <technique_common><instance_material symbol="mm" target="#m"><bind_vertex_input semantic="U"
    input_semantic="TEXCOORD" input_set="0"/></instance_material></technique_common></bind_material>
    </instance_geometry></node></visual_scene></library_visual_scenes>
    <scene><instance_visual_scene url="#w"/></scene></COLLADA>"""
    (folder / "a.dae").write_text(text)
    return folder / "a.dae"


def write_mitsuba(folder, name):
    (folder / "a.xml").write_text(
        f"""<scene version="3.0.0"><shape type="rectangle"><bsdf type="twosided"><bsdf type="diffuse">
        <texture type="bitmap" name="reflectance"><string name="filename" value="{name}"/></texture>
        </bsdf></bsdf></shape></scene>"""
    )
    return folder / "a.xml"


def write_pbrt(folder, name):
    quoted = name.replace("\\", "\\\\")
    (folder / "a.pbrt").write_text(
        f"""WorldBegin Texture "t" "spectrum" "imagemap" "string filename" "{quoted}"
        Material "diffuse" "texture reflectance" "t"
        Shape "trianglemesh" "point3 P" [ 0 0 0 1 0 0 0 1 0 ] "point2 uv" [ 0 0 1 0 0 1 ]\n"""
    )
    return folder / "a.pbrt"


def write_usd(folder, name):
    (folder / "a.usda").write_text(
        f"""#usda 1.0
def Material "m"
{{
    token outputs:surface.connect = </m/s.outputs:surface>
    def Shader "s"
    {{
        uniform token info:id = "UsdPreviewSurface"
        color3f inputs:diffuseColor.connect = </m/t.outputs:rgb>
        token outputs:surface
    }}
    def Shader "t"
    {{
        uniform token info:id = "UsdUVTexture"
        asset inputs:file = @{name}@
        float3 outputs:rgb
    }}
}}
def Mesh "q" (prepend apiSchemas = ["MaterialBindingAPI"])
{{
    int[] faceVertexCounts = [3]
    int[] faceVertexIndices = [0, 1, 2]
    point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0)]
    texCoord2f[] primvars:st = [(0, 0), (1, 0), (0, 1)] (interpolation = "vertex")
    uniform token subdivisionScheme = "none"
    rel material:binding = </m>
}}
"""
    )
    return folder / "a.usda"


WRITERS = [write_obj, write_ply, write_gltf, write_dae, write_mitsuba, write_pbrt]
try:
    import pxr  # noqa: F401
except ImportError:
    pass
else:
    WRITERS.append(write_usd)


def color_of(path, **options):
    """Load a file; return the mean of its base color, and the messages."""
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        (shape,) = wf.load(path, **options).shapes
    material = getattr(shape, "mesh", shape).material
    if material is None:
        return (0.5, 0.5, 0.5), [str(each.message) for each in said]
    bsdf = material.bsdf
    value = bsdf.reflectance if hasattr(bsdf, "reflectance") else bsdf.base_color
    mean = value.mean() if isinstance(value, wf.Texture) else np.ravel(value)
    return tuple(np.broadcast_to(mean, 3).tolist()), [str(each.message) for each in said]


@pytest.fixture
def scene(tmp_path):
    """A folder for a scene, and beside it one of images."""
    for name in ("scene", "images"):
        (tmp_path / name).mkdir()
    return tmp_path / "scene"


@pytest.mark.parametrize("write", WRITERS)
@pytest.mark.parametrize("name", NAMES)
def test_an_image_is_found_by_the_end_of_its_path(scene, write, name):
    Pil.new("RGB", (4, 4), (255, 0, 0)).save(scene / "tex.png")
    color, said = color_of(write(scene, name))
    assert color == pytest.approx(RED)
    (message,) = said
    assert "'tex.png' in its place" in message


@pytest.mark.parametrize("write", WRITERS)
def test_a_missing_image_is_gray_and_named(scene, write):
    """Wherever it is said to be; `strict` refuses."""
    for name in ("no.png", "C:\\no.png", "/etc/passwd", "../../no.png", "http://a.b/no.png", "n" * 3000):
        path = write(scene, name)
        color, (message,) = color_of(path)
        assert max(color) - min(color) < 1e-6
        assert 0.1 < color[0] < 0.6
        assert name[:5].replace("\\", "\\\\") in message or name[:5] in message
        with pytest.raises(SceneError, match=r"texture|image|file"):
            wf.load(path, strict=True)


@pytest.mark.parametrize("write", WRITERS)
def test_a_damaged_image_is_gray_and_named(scene, write):
    for data in (b"", b"hello", b"\x89PNG\r\n\x1a\n" + bytes(40)):
        (scene / "tex.png").write_bytes(data)
        color, (message,) = color_of(write(scene, "tex.png"))
        assert max(color) - min(color) < 1e-6
        assert 0.1 < color[0] < 0.6
        assert "tex.png" in message


@pytest.mark.parametrize("write", WRITERS)
def test_limits_refuse_the_scene(scene, write):
    """They are no damage of a part."""
    Pil.new("RGB", (40, 40), (255, 0, 0)).save(scene / "tex.png")
    path = write(scene, "tex.png")
    assert color_of(path)[0] == pytest.approx(RED)
    with pytest.raises(SceneError, match="the limit is 100"):
        color_of(path, limits=wf.LoadLimits(pixels=100))


@pytest.mark.parametrize("write", [write_obj, write_gltf, write_mitsuba])
def test_search_paths_and_folders_below(scene, write):
    """The longest end of the path that fits is taken; folders beside the scene are not read."""
    images = scene.parent / "images"
    Pil.new("RGB", (4, 4), (255, 0, 0)).save(images / "tex.png")
    path = write(scene, "C:\\work\\textures\\tex.png")
    assert color_of(path)[0] == pytest.approx((0.5, 0.5, 0.5))
    assert color_of(path, search_paths=images)[0] == pytest.approx(RED)
    (scene / "Textures").mkdir()
    Pil.new("RGB", (4, 4), (0, 255, 0)).save(scene / "Textures" / "Tex.png")
    (images / "tex.png").unlink()
    assert color_of(path, search_paths=images)[0] == pytest.approx((0, 1, 0))


def test_names_that_a_uri_writes_otherwise_are_no_loss(scene):
    Pil.new("RGB", (4, 4), (255, 0, 0)).save(scene / "my tex.png")
    for write in WRITERS:
        assert color_of(write(scene, "my%20tex.png")) == (pytest.approx(RED), [])


def test_material_files_are_found_as_images_are(scene):
    path = write_obj(scene, "tex.png")
    Pil.new("RGB", (4, 4), (255, 0, 0)).save(scene / "tex.png")
    for name in ("C:\\models\\m.mtl", "/home/a/m.mtl", "M.MTL", "../m.mtl"):
        path.write_text(f"mtllib {name}\n" + FACE)
        color, (message,) = color_of(path)
        assert color == pytest.approx(RED)
        assert "'m.mtl' in its place" in message


def test_what_is_found_is_inside_the_folders(scene):
    """Also behind links, and by names of other cases."""
    secret = scene.parent / "secret.png"
    Pil.new("RGB", (4, 4), (255, 0, 0)).save(secret)
    os.symlink(secret, scene / "secret.png")
    os.symlink(scene.parent, scene / "up")
    files = SceneFiles(scene / "a.obj")
    for name in (
        "../secret.png",
        str(secret),
        "SECRET.PNG",
        "C:\\up\\secret.png",
        "Up/secret.png",
        "file:///secret.png",
    ):
        with pytest.raises(SceneError, match=r"refers to|missing"):
            files.stored(files.find(name))


def test_what_libraries_open_by_its_name_is_found_by_its_very_name(scene):
    (scene / "f.usda").write_text("")
    files = SceneFiles(scene / "a.usda")
    assert files.named("./f.usda").name == "f.usda"
    assert not files.named("sub/f.usda").exists()
    for name in ("../f.usda", "C:\\f.usda", "/home/f.usda"):
        assert files.find(name) == scene / "f.usda"
        with pytest.raises(SceneError, match=r"refers to"):
            files.named(name)


def test_no_file_outside_is_opened(scene):
    """Whatever names a scene has: each path that Python opens meanwhile is inside of the folder."""
    outside = scene.parent / "images"
    Pil.new("RGB", (4, 4), (255, 0, 0)).save(outside / "tex.png")
    os.symlink(outside / "tex.png", scene / "link.png")
    opened, hostile = (
        [],
        (str(outside / "tex.png"), "../images/tex.png", "link.png", f"file://{outside}/tex.png"),
    )

    def heard(event, arguments):
        if event == "open" and LISTENING:
            opened.append(arguments[0])

    LISTENING = []
    sys.addaudithook(heard)
    for write in WRITERS:
        for name in hostile:
            path = write(scene, name)
            LISTENING.append(True)
            color_of(path)
            LISTENING.clear()
    inside = [each for each in opened if isinstance(each, str | bytes | os.PathLike)]
    assert any(os.fspath(each).endswith("a.obj") for each in inside)
    bad = [each for each in inside if os.path.realpath(os.fspath(each)).startswith(str(outside))]
    assert bad == []


# --- Channels that an image lacks ----------------------------------------------------------------------


@pytest.mark.parametrize("mode", ["1", "L", "LA", "RGB", "RGBA", "P", "I;16"])
@pytest.mark.parametrize("channel", [0, 1, 2, 3, "luminance", None])
def test_files_have_all_channels(tmp_path, mode, channel):
    """Gray counts as all colors, and a missing alpha as 1; arrays have what they have."""
    gray = np.array([[0, 255], [255, 0]], np.uint8)
    image = Pil.fromarray(gray if mode != "I;16" else gray.astype(np.uint16) * 257)
    if mode in ("LA", "RGBA"):
        image = image.convert(mode)
        image.putalpha(Pil.fromarray(np.array([[255, 255], [0, 0]], np.uint8)))
    elif mode != "I;16":
        image = image.convert(mode)
    image.save(tmp_path / "a.png")
    texture = wf.Texture(tmp_path / "a.png", srgb=False, channel=channel, filter="nearest")
    uv = np.array([[0.25, 0.75, 0.25, 0.75], [0.75, 0.75, 0.25, 0.25]], np.float32)
    found = texture.lookup(uv)
    alpha = [1, 1, 0, 0] if mode in ("LA", "RGBA") else [1, 1, 1, 1]
    wanted = np.array(alpha if channel == 3 else [0, 1, 1, 0], np.float32)
    assert texture.has_alpha == (mode in ("LA", "RGBA"))
    assert found == pytest.approx(np.broadcast_to(wanted, found.shape))
    assert texture.mean() == pytest.approx(wanted.mean())
    bilinear = wf.Texture(tmp_path / "a.png", srgb=False, channel=channel)
    assert bilinear.lookup(uv) == pytest.approx(np.broadcast_to(wanted, found.shape))


def test_arrays_have_the_channels_that_they_have(tmp_path):
    values = np.linspace(0, 1, 8, dtype=np.float32).reshape(2, 2, 2)
    np.save(tmp_path / "a.npy", values)
    for source in (values, tmp_path / "a.npy"):
        assert wf.Texture(source, channel=1).mean() == pytest.approx(values[..., 1].mean())
        with pytest.raises(SceneError, match="channel is 2"):
            wf.Texture(source, channel=2)
