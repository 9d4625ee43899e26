"""glTF: what is damaged costs its part, and one warning names it; an error where nothing can be shown."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from gltf_builder import TRIANGLE, Builder
from inside import Mesh

import wavefront as wf

CORNERS = np.array([0, 1, 2], np.uint16)
Change = Callable[[Any], None]


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "a.gltf"


def two_meshes() -> Any:
    """A triangle that a test breaks, and one that must stay, on nodes of their own."""
    build = Builder()
    build.mesh(indices=CORNERS).mesh(indices=CORNERS)
    build.json["nodes"] = [{"mesh": 0}, {"mesh": 1}]
    build.json["scenes"][0]["nodes"] = [0, 1]
    build.json["materials"] = [{"name": "red"}]
    return build


def put(**changes: Any) -> Change:
    """Return a function that changes the JSON at dotted places."""

    def change(build: Any) -> None:
        for place, value in changes.items():
            *parents, last = [int(key) if key.isdigit() else key for key in place.split("__")]
            at = build.json
            for key in parents:
                at = at[key]
            at[last] = value

    return change


def part(indices: Any = None, colors: Any = None, vertices: Any = None, mode: int = 4) -> Change:
    """Return a function that gives the mesh to break other indices, colors or vertices."""

    def change(build: Any) -> None:
        (primitive,) = build.json["meshes"][0]["primitives"]
        primitive["mode"] = mode
        if indices is not None:
            primitive["indices"] = build.accessor(np.array(indices, np.uint16))
        for key, values in (("COLOR_0", colors), ("POSITION", vertices)):
            if values is not None:
                primitive["attributes"][key] = build.accessor(np.array(values, np.float32))

    return change


def spoiled(name: str, values: Any) -> Change:
    """Return a function that gives the mesh to break one more attribute."""

    def change(build: Any) -> None:
        build.json["meshes"][0]["primitives"][0]["attributes"][name] = build.accessor(np.asarray(values))

    return change


def of_scene(**extra: Any) -> Change:
    """Return a function that puts something beside the meshes."""
    return lambda build: build.json.update(extra)


def lamp(**light: Any) -> Change:
    """Return a function that puts a light on the first node."""

    def change(build: Any) -> None:
        build.json["nodes"][0]["extensions"] = {"KHR_lights_punctual": {"light": 0}}
        build.json["extensions"] = {"KHR_lights_punctual": {"lights": [light]}}

    return change


def with_camera(camera: Any) -> Change:
    """Return a function that puts a camera on the first node."""

    def change(build: Any) -> None:
        build.json["nodes"][0]["camera"] = 0
        build.json["cameras"] = [camera]

    return change


def read(path: Path, message: str) -> list[Any]:
    """Return the shapes of a file, whose one warning has a message; with `strict` that is an error."""
    with pytest.warns(UserWarning, match=message) as record:
        shapes = wf.load(path).shapes
    assert len(record) == 1
    with pytest.raises(wf.SceneError, match=message):
        wf.load(path, strict=True)
    return shapes


GONE: list[tuple[Change, str]] = [  # the mesh to break is left out
    (put(nodes__0__mesh=-1), r"nodes\[0\]: meshes\[-1\] does not exist; there are 2; left out"),
    (put(nodes__0__mesh="x"), r"meshes\['x'\] does not exist"),
    (put(nodes__0__mesh=[0]), r"meshes\[\[0\]\] does not exist"),
    (put(nodes__0=None), r"nodes\[0\] is not an object; left out"),
    (put(scenes__0__nodes=[7, 1]), r"nodes\[7\] does not exist; there are 2; left out"),
    (put(scenes__0__nodes=[{}, 1]), r"nodes\[\{\}\] does not exist"),
    (
        put(nodes__0__scale=[1, 1e101, 1]),
        r"nodes\[0\]: its matrix to the scene has .* above 1e\+100",
    ),
    (put(meshes__0__primitives=7), r"meshes\[0\] is malformed"),
    (put(meshes__0__primitives__0=7), r"meshes\[0\]\.primitives\[0\] is malformed"),
    (put(meshes__0__primitives__0__attributes={}), r"'mesh0' has no POSITION"),
    (
        put(accessors__0__count=4),
        r"accessors\[0\] has 4 elements, which its buffer view cannot .*left out",
    ),
    (put(accessors__0__count=-3), r"accessors\[0\]\.count is -3; it must be a whole number, at least 0"),
    (put(accessors__0__type="VEC2"), r"has POSITION with 2 components; it must have 3"),
    (put(accessors__0__type="VEC9"), r"accessors\[0\] is 'VEC9' of 5126, which glTF does not have"),
    (put(accessors__0__componentType=9), r"accessors\[0\] is 'VEC3' of 9"),
    (put(accessors__1__componentType=5126, accessors__1__count=1), r"indices of type float32"),
    (put(bufferViews__0__byteLength=10**9), r"bufferViews\[0\] ends at byte 1000000000"),
    (put(bufferViews__0__buffer=2), r"buffers\[2\] does not exist"),
    (put(bufferViews__0=[]), r"bufferViews\[0\] is not an object"),
    (
        part([0, 1, 3]),
        r"1 face with .*: face 0 uses vertex 3; .* in \[0, 2\]; left out",
    ),
    (part([0, 1], mode=5), "a strip or fan needs at least 3; left out"),
    (
        part(vertices=[[0, 0, 0], [np.nan, 0, 0], [0, 1, 0]]),
        "1 face with a vertex that is not fin.*; left out",
    ),
]


@pytest.mark.parametrize(("change", "message"), GONE)
def test_a_damaged_mesh_costs_itself(path: Path, change: Change, message: str) -> None:
    build = two_meshes()
    build.json["buffers"] = []
    change(build)
    (sound,) = read(build.gltf(path), message)
    assert sound.name == "mesh1"


KEPT: list[tuple[Change, str]] = [  # the mesh to break is shown without something
    (put(scene=3), r"scenes\[3\] does not exist; there are 1; another in its place"),
    (put(scenes=5), r"scenes is 5; left out, as it must be a list"),
    (put(scenes__0__nodes=5), r"scenes\[0\]: nodes is 5; it must be a list; another in its place"),
    (put(nodes__0__children=[0]), r"nodes\[0\]: is reached twice; nodes must form a tree; left out"),
    (put(nodes__0__children=[1]), r"nodes\[1\]: is reached twice"),
    (put(nodes__0__children=3), r"nodes\[0\]\.children is 3; left out"),
    (put(nodes__0__scale=[1, 2]), r"nodes\[0\]: scale is \[1, 2\]; \[1, 1, 1\] in its place"),
    (
        put(nodes__0__translation=[1, 2, float("nan")]),
        r"nodes\[0\]: translation is \[1, 2, nan\]; \[0, 0",
    ),
    (put(nodes__0__rotation="up"), r"nodes\[0\]: rotation is 'up'; \[0, 0, 0, 1\] in its place"),
    (put(nodes__0__matrix=[1, 0]), r"nodes\[0\]: matrix is \[1, 0\]; \[1.0, 0.0, .* in its place"),
    (
        put(nodes__0__skin=4),
        r"nodes\[0\]\.skin: skins\[4\] does not exist; there are 0; the mesh by its",
    ),
    (put(nodes__0__extensions=7), r"nodes\[0\]\.extensions"),
    (
        put(meshes__0__primitives__0__material=4),
        r"materials\[4\] does not exist; .*; the default mat",
    ),
    (put(meshes__0__primitives__0__material=[4]), r"materials\[\[4\]\] does not exist"),
    (part([0, 1, 2, 0]), "has 4 indices; triangles need a multiple of 3; the last ones are left out"),
    (part(colors=np.ones((3, 2))), r"COLOR_0: 'mesh0' has COLOR_0 with 2 components; .* 3 or 4; left out"),
    (spoiled("NORMAL", np.zeros((2, 3), np.float32)), "'mesh0' has 2 of NORMAL; it has 3 vertices; left out"),
    (spoiled("TEXCOORD_0", np.zeros((3, 3), np.float32)), "has TEXCOORD_0 with 3 components; it must have 2"),
    (spoiled("JOINTS_0", np.zeros((3, 4), np.uint8)), "has no WEIGHTS for all of its JOINTS; left out"),
    (put(meshes__0__primitives__0__targets=[{"POSITION": 77}]), r"targets: accessors\[77\] does not exist"),
    (
        lamp(type="point", intensity="bright"),
        r"light 0: intensity is \['bright'\]; .* finite number; left",
    ),
    (lamp(type="spot", spot=[1]), r"light 0 is malformed"),
    (lamp(type="point", intensity=-1e-9), r"light 0: intensity is -1e-09; clamped to 0"),
    (
        lamp(type="spot", spot={"outerConeAngle": float(np.float32(np.pi / 2))}),
        r"light 0: outerConeAngle is 1\.5707963705062866; clamped to 1\.5707963267948966",
    ),
    (
        lamp(type="spot", spot={"innerConeAngle": 0.7, "outerConeAngle": 0.6}),
        r"light 0: innerConeAngle is 0\.7; clamped to 0\.6",
    ),
    (put(nodes__0__extensions={"KHR_lights_punctual": {"light": 3}}), "light 3 does not exist; there are 0"),
    (with_camera({"type": "perspective"}), r"cameras\[0\]: yfov is \[None\].*; left out"),
    (
        with_camera({"type": "perspective", "perspective": {"yfov": -1}}),
        r"yfov is -1; .*; left out",
    ),
    (
        with_camera({"type": "perspective", "perspective": {"yfov": 4}}),
        r"fov is 229.*; left out",
    ),
    (
        with_camera({"type": "fisheye"}),
        r"type is 'fisheye'; it must be .*; left out",
    ),
    (with_camera(3), r"cameras\[0\] is not an object; left out"),
    (put(nodes__0__camera=2), r"nodes\[0\]\.camera: cameras\[2\] does not exist"),
    (
        of_scene(extensionsRequired=["EXT_moss"], extensionsUsed=["EXT_moss"]),
        "not honored: .*EXT_moss, which it requires",
    ),
    (of_scene(extensionsUsed=7), "extensionsUsed is 7; left out, as it must be a list"),
    (of_scene(animations=[{}]), r"animations\[0\] is malformed: KeyError: 'samplers'; left out"),
    (of_scene(asset={}), r"asset\.version is missing; read as version 2\.0"),
]


@pytest.mark.parametrize(("change", "message"), KEPT)
def test_other_damage_leaves_the_mesh(path: Path, change: Change, message: str) -> None:
    build = two_meshes()
    change(build)
    shapes = read(build.gltf(path), message)
    assert {shape.name for shape in shapes} == {"mesh0", "mesh1"}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (put(asset__version="1.0"), r"a\.gltf: is glTF version '1\.0'; only version 2 is read"),
        (put(nodes=5), r"a\.gltf: has no faces:\n  nodes is 5; .*|nodes is 5; it must be a list"),
        (put(scenes__0__nodes=[7, 8]), r"a\.gltf: has no faces:\n  nodes\[8\].*\n  nodes\[7\]"),
        (put(meshes=[]), r"a\.gltf: has no faces:\n.*meshes\[1\] does not exist; there are 0; left out"),
        (put(accessors__0__count=10**15), r"accessors\[0\] has 1000000000000000 elements; the limit is"),
        (put(buffers=[{"byteLength": 36, "uri": "d.bin"}]), r"buffers\[0\]: .*d\.bin: there is no such file"),
        (
            put(buffers=[{"byteLength": 36, "uri": "data:;base64,%%"}]),
            r"buffers\[0\] has damaged base64 data",
        ),
        (put(buffers=[{"byteLength": 36, "uri": "../d.bin"}]), r"refers to '\.\./d\.bin', which is outside"),
    ],
)
def test_an_error_where_nothing_can_be_shown_or_a_limit_is_passed(
    path: Path, change: Change, message: str
) -> None:
    build = two_meshes()
    text = json.loads(build.gltf(path).read_text())
    build.json["buffers"] = text["buffers"]
    change(build)
    path.write_text(json.dumps(build.json))
    with pytest.raises(wf.SceneError, match=message):
        wf.load(path)


def test_a_missing_buffer_costs_what_is_in_it(path: Path) -> None:
    build = two_meshes()
    text = json.loads(build.gltf(path).read_text())
    text["buffers"].append({"byteLength": 36, "uri": "d.bin"})
    text["bufferViews"][0]["buffer"] = 1
    path.write_text(json.dumps(text))
    (sound,) = read(path, r"primitives\[0\]: buffers\[1\]: .*d\.bin: there is no such file; left out")
    assert sound.name == "mesh1"


def test_a_short_buffer_is_read_as_far_as_it_goes(path: Path) -> None:
    text = two_meshes().gltf(path).read_text()
    path.write_text(text.replace('"buffers": [{"byteLength": ', '"buffers": [{"byteLength": 9'))
    assert len(read(path, r"buffers\[0\]: has 88 bytes; it claims 988; what is there is read")) == 2


@pytest.mark.parametrize("share", [0.1, 0.3, 0.6])
def test_a_glb_whose_json_is_cut_is_an_error(tmp_path: Path, share: float) -> None:
    path = two_meshes().glb(tmp_path / "a.glb")
    path.write_bytes(path.read_bytes()[: int(path.stat().st_size * share)])
    with pytest.raises(wf.SceneError, match=r"a\.glb: "):
        wf.load(path)


def test_a_glb_that_is_cut_shows_what_is_there(tmp_path: Path) -> None:
    path = two_meshes().glb(tmp_path / "a.glb")
    path.write_bytes(path.read_bytes()[:-10])
    (first,) = read(path, r"a\.glb: \d things.*\n.*claims \d+ bytes; it has \d+; what is there is read")
    assert first.name == "mesh0"


BESIDE = "KHR_materials_pbrSpecularGlossiness"
MATERIALS: list[tuple[dict[str, Any], str]] = [
    ({"pbrMetallicRoughness": {"metallicFactor": 2}}, r"materials\[0\]\.metallicFactor is 2; clamped to 1"),
    ({"pbrMetallicRoughness": {"roughnessFactor": 1.0000001}}, "roughnessFactor is 1.0000001; clamped to 1"),
    ({"pbrMetallicRoughness": {"metallicFactor": -1e-9}}, "metallicFactor is -1e-09; clamped to 0"),
    (
        {"pbrMetallicRoughness": {"baseColorFactor": [1, 1, 1]}},
        r"Factor is \[1, 1, 1\]; .*; the default",
    ),
    (
        {"pbrMetallicRoughness": {"baseColorFactor": [1.00016, 1, 1, 1]}},
        "is 1.00016 1 1 1; clamped to 1 1 1",
    ),
    ({"pbrMetallicRoughness": 3}, r"materials\[0\] is malformed: .*; the default material in its place"),
    ({"emissiveFactor": [-1, 0, 0]}, "emissiveFactor is -1 0 0; clamped to 0 0 0"),
    ({"emissiveFactor": [1.5, 0, 0]}, r"emissiveFactor is \[1\.5, 0\.0, 0\.0\], above 1; taken as it is"),
    (
        {"extensions": {BESIDE: {"glossinessFactor": 2}}},
        "glossinessFactor is 2; clamped to 1",
    ),
    ({"extensions": {BESIDE: {"specularFactor": [1, 1]}}}, r"materials\[0\]\.specularFactor is \[1, 1\]"),
    (
        {"extensions": {BESIDE: {"diffuseTexture": 3}}},
        r"diffuseTexture is 3; it must be .*; gray in its place",
    ),
    ({"alphaMode": "GLASS"}, "alphaMode is 'GLASS'; OPAQUE in its place, as it must be OPAQUE, MASK"),
    (
        {"name": "red", "normalTexture": {"index": 3}},
        r"'red'\.normalTexture: textures\[3\] does not exist.*; left out",
    ),
    ({"normalTexture": 3}, r"materials\[0\]\.normalTexture is 3; it must be an object; left out"),
    (
        {"extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": 1e39}}},
        r"materials\[0\]\.emissiveStrength is 1e\+39; clamped to 3\.40282\d*e\+38",
    ),
    (
        {"extensions": {"KHR_materials_sheen": [1]}},
        "KHR_materials_sheen is malformed: .*; left out",
    ),
    (
        {"extensions": {"KHR_materials_transmission": {"transmissionFactor": 1.0000001}}},
        "transmissionFactor is 1.0000001; clamped to 1",
    ),
]


@pytest.mark.parametrize(("material", "message"), MATERIALS)
def test_damage_to_a_material_costs_that_property(path: Path, material: dict[str, Any], message: str) -> None:
    assert len(read(Builder().material(**material).gltf(path), message)) == 1


@pytest.mark.parametrize(
    ("textures", "change", "message"),
    [
        (
            [{"source": 7}],
            {},
            r"baseColorTexture: images\[7\] does not exist; .*; gray in its place",
        ),
        ([{}], {}, "its image is given by nothing, which is not read; gray in its place"),
        (
            [{"extensions": {"KHR_texture_basisu": {"source": 0}}}],
            {},
            "given by KHR_texture_basisu, which",
        ),
        (
            [{"source": 0, "sampler": 4}],
            {},
            r"its sampler: samplers\[4\] does not exist; .*; left out",
        ),
        (
            [{"source": 0}],
            {"KHR_texture_transform": {"scale": 2}},
            "KHR_texture_transform: scale is 2; .*left",
        ),
    ],
)
def test_damage_to_a_texture_costs_it(path: Path, textures: Any, change: Any, message: str) -> None:
    build = Builder()
    info = build.image(np.zeros((2, 2, 3), np.uint8)) | {"extensions": change}
    build.json["textures"] = textures
    build.material(pbrMetallicRoughness={"baseColorTexture": info})
    (mesh,) = read(build.gltf(path), message)
    assert isinstance(mesh.material.bsdf.base_color, wf.Texture)


def test_webp_textures_are_read(tmp_path: Path) -> None:
    from PIL import Image

    Image.new("RGB", (2, 2), (255, 0, 0)).save(tmp_path / "t.webp", lossless=True)
    build = Builder()
    build.json["images"] = [{"uri": "t.webp"}]
    build.json["textures"] = [{"extensions": {"EXT_texture_webp": {"source": 0}}}]
    build.json["extensionsRequired"] = build.json["extensionsUsed"] = ["EXT_texture_webp"]
    build.material(pbrMetallicRoughness={"baseColorTexture": {"index": 0}})
    (mesh,) = wf.load(build.gltf(tmp_path / "a.gltf"), strict=True).shapes
    np.testing.assert_array_equal(mesh.material.bsdf.base_color.mean(), [1, 0, 0])  # type: ignore[attr-defined]


def test_a_primitive_without_material_has_that_of_the_standard_beside_others(path: Path) -> None:
    build = two_meshes()
    build.json["meshes"][1]["primitives"][0]["material"] = 0
    red, bare = wf.load(build.gltf(path), strict=True).shapes[::-1]
    assert (bare.name, red.name) == ("mesh0", "mesh1")
    bsdf: Any = bare.material.bsdf
    assert bsdf.base_color.ravel().tolist() == [1, 1, 1]
    assert (bsdf.metallic, bsdf.roughness) == (1, 1)
    del build.json["materials"]
    del build.json["meshes"][1]["primitives"][0]["material"]
    for mesh in wf.load(build.gltf(path), strict=True).shapes:  # as one of stl
        assert isinstance(mesh, Mesh)
        assert repr(mesh.material) == repr(Mesh(TRIANGLE, [[0, 1, 2]]).material)
