"""glTF: geometry, nodes, materials, textures, lights and cameras, on small files written here."""

import json
import re
import warnings
from pathlib import Path
from types import SimpleNamespace

import imageio.v3 as iio
import numpy as np
import pytest
import trimesh
from counting import calls
from expected import Near, check
from gltf_builder import TRIANGLE, Builder
from inside import (
    KNOWN,
    Dielectric,
    Diffuse,
    DirectionalLight,
    Instance,
    LoadLimits,
    Material,
    Mesh,
    NormalMap,
    SceneError,
    SpotLight,
    SurfaceInteraction,
    Texture,
    ThinDielectric,
    VertexColors,
    from_trimesh,
    load,
    load_mesh,
    load_meshes,
    placing,
    srgb_to_linear,
)
from inside import document as gltf_document

from wavefront import Camera, Scene, render


@pytest.fixture
def build():
    return Builder()


@pytest.fixture
def path(tmp_path):
    return tmp_path / "a.gltf"


def soup(mesh, values=None):
    return (mesh.vertices if values is None else values)[mesh.faces]


def normal(mesh):
    """The geometric normals of the faces of a mesh, (m, 3)."""
    a, b, c = soup(mesh).transpose(1, 0, 2)
    return np.cross(b - a, c - a)


# ---- geometry -----------------------------------------------------------------------------------


def test_triangle_in_both_containers(build, tmp_path):
    build.mesh(
        {
            "POSITION": TRIANGLE,
            "NORMAL": np.tile(np.float32([[0, 0, 1]]), (3, 1)),
            "TEXCOORD_0": np.float32([[0, 0.25], [1, 0.25], [0, 1]]),
        },
        np.array([0, 1, 2], np.uint8),
    )
    for file in (build.gltf(tmp_path / "a.gltf"), build.glb(tmp_path / "a.glb")):
        (mesh,) = load_meshes(file)
        assert np.array_equal(soup(mesh)[0], TRIANGLE)
        assert np.array_equal(mesh.normals, [[0, 0, 1]] * 3)
        assert np.array_equal(mesh.uvs, [[0, 0.75], [1, 0.75], [0, 0]])  # v upwards
        assert mesh.material.bsdf.reflectance.ravel() == pytest.approx([0.5] * 3)


def test_an_external_buffer_with_a_space_in_its_name(build, path):
    build.mesh()
    (path.parent / "b c.bin").write_bytes(build.binary)
    build.json["buffers"] = [{"byteLength": len(build.binary), "uri": "b%20c.bin"}]
    path.write_text(json.dumps(build.json))
    assert np.array_equal(soup(load_meshes(path)[0])[0], TRIANGLE)


@pytest.mark.parametrize("kind", [np.uint8, np.uint16, np.uint32])
def test_index_types(build, path, kind):
    build.mesh(indices=np.array([2, 0, 1], kind))
    assert np.array_equal(soup(load_meshes(build.gltf(path))[0])[0], TRIANGLE[[2, 0, 1]])


def test_triangles_without_an_area_join_strips(build, path):
    """They are part of how strips are written, no defect; the turn of those behind them stays right."""
    corners = np.float32(
        [[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0], [5, 0, 0], [6, 0, 0], [5, 1, 0], [6, 1, 0]]
    )
    joined = np.array([0, 1, 2, 3, 3, 4, 4, 5, 6, 7], np.uint8)
    build.mesh({"POSITION": corners}, joined, mode=5).gltf(path)
    (mesh,) = load(path, strict=True).shapes
    found = soup(mesh)
    assert np.array_equal(found, corners[[[0, 1, 2], [2, 1, 3], [4, 5, 6], [6, 5, 7]]])
    with pytest.warns(UserWarning, match="trimesh object: 'GLTF': 4 faces of zero area"):
        (held,) = from_trimesh(trimesh.load_scene(path, process=False)).shapes  # which keeps them
    assert np.array_equal(normal(held), normal(mesh))


@pytest.mark.parametrize(
    ("mode", "expected"),
    [(5, [[0, 1, 2], [2, 1, 3], [4, 5, 6], [6, 5, 7]]), (6, [[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]])],
)
@pytest.mark.parametrize("kind", [np.uint8, np.uint16, np.uint32])
def test_strips_and_fans_that_begin_anew(build, path, mode, expected, kind):
    """The largest index is forbidden in glTF, and begins a new strip in graphics hardware."""
    corners = np.random.default_rng(0).random((8, 3), np.float32)
    largest = np.iinfo(kind).max
    build.mesh({"POSITION": corners}, np.array([0, 1, 2, 3, largest, 4, 5, 6, 7], kind), mode=mode).gltf(path)
    (mesh,) = load(path, strict=True).shapes
    assert np.array_equal(soup(mesh), corners[expected])


def test_interleaved_and_offset_views(build, path):
    rows = np.zeros((3, 5), np.float32)
    rows[:, :3], rows[:, 3:] = TRIANGLE, [[0, 0], [1, 0], [0, 1]]
    view = build.view(rows.tobytes(), byteStride=20)
    common = {"bufferView": view, "componentType": 5126, "count": 3}
    build.json["accessors"] = [{**common, "type": "VEC3"}, {**common, "type": "VEC2", "byteOffset": 12}]
    build.mesh({"POSITION": 0, "TEXCOORD_0": 1}).gltf(path)
    (mesh,) = load_meshes(path)
    assert np.array_equal(soup(mesh)[0], TRIANGLE)
    assert np.array_equal(mesh.uvs, [[0, 1], [1, 1], [0, 0]])


def test_sparse_and_normalized_accessors(build, path):
    build.accessor(TRIANGLE)
    at, new = build.view(np.array([2], np.uint16).tobytes()), build.view(np.float32([[0, 5, 0]]).tobytes())
    build.json["accessors"][0]["sparse"] = {
        "count": 1,
        "indices": {"bufferView": at, "componentType": 5123},
        "values": {"bufferView": new},
    }
    uvs = build.accessor(np.array([[0, 0], [65535, 0], [0, 13107]], np.uint16), normalized=True)
    build.mesh({"POSITION": 0, "TEXCOORD_0": uvs}).gltf(path)
    (mesh,) = load_meshes(path)
    assert np.array_equal(soup(mesh)[0], [[0, 0, 0], [1, 0, 0], [0, 5, 0]])
    assert mesh.uvs == pytest.approx(np.array([[0, 1], [1, 1], [0, 0.8]]))


def test_quantized_texture_coordinates_are_turned_upwards(build, path):
    """KHR_mesh_quantization has whole numbers, for a KHR_texture_transform to scale: 1 − v may be below 0."""
    uvs, uvs1 = np.array([[0, 0], [3, 0], [0, 5]], np.uint16), np.array([[0, 200], [3, 0], [0, 5]], np.uint8)
    build.mesh({"POSITION": TRIANGLE, "TEXCOORD_0": uvs, "TEXCOORD_1": uvs1}).gltf(path)
    (mesh,) = load_meshes(path)
    assert np.array_equal(mesh.uvs, [[0, 1], [3, 1], [0, -4]])
    assert np.array_equal(mesh.uvs1, [[0, -199], [3, 1], [0, -4]])


def test_nodes_place_and_repeat_meshes(build, path):
    half = np.sqrt(0.5)
    build.json["nodes"] = [
        {"children": [1, 2], "translation": [10, 0, 0]},
        {"mesh": 0, "rotation": [0, 0, half, half], "scale": [2, 1, 1], "translation": [0, 1, 0]},
        {"mesh": 0, "matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, -1, 0, 0, 0, 3, 1]},
    ]
    build.mesh({"POSITION": TRIANGLE, "NORMAL": np.tile(np.float32([[0, 0.6, 0.8]]), (3, 1))}).gltf(path)
    turned, mirrored = load_meshes(path)
    assert soup(turned)[0] == pytest.approx(np.array([[10, 1, 0], [10, 3, 0], [9, 1, 0]]))
    assert turned.normals[0] == pytest.approx([-0.6, 0, 0.8])
    a, b, c = soup(mirrored)[0]
    assert np.cross(b - a, c - a)[2] < 0
    assert mirrored.normals[0] == pytest.approx([0, 0.6, -0.8])
    assert {tuple(p) for p in soup(mirrored)[0]} == {(10, 0, 3), (11, 0, 3), (10, 1, 3)}


def test_a_flat_thing_may_be_scaled_by_0_across(build, path):
    build.json["nodes"][0]["scale"] = [1, 1, 0]
    build.mesh({"POSITION": TRIANGLE, "NORMAL": np.tile(np.float32([[0, 0, 1]]), (3, 1))}).gltf(path)
    assert np.array_equal(load_meshes(path)[0].normals, [[0, 0, 1]] * 3)


def instanced(build, **attributes):
    """Place the mesh of the first node by EXT_mesh_gpu_instancing."""
    attributes = {name: build.accessor(values) for name, values in attributes.items()}
    build.json["nodes"][0] |= {
        "name": "grass",
        "translation": [0, 0, 5],
        "extensions": {"EXT_mesh_gpu_instancing": {"attributes": attributes}},
    }
    build.json |= {"extensionsUsed": ["EXT_mesh_gpu_instancing"]}
    build.json |= {"extensionsRequired": ["EXT_mesh_gpu_instancing"]}
    return build.mesh()


def test_a_node_may_hold_many_instances(build, path):
    quarter = np.array([[0, 0, 0, 127], [0, 0, 90, 90]], np.int8)  # normalized; lengths do not matter
    build = instanced(
        build,
        TRANSLATION=np.float32([[1, 0, 0], [0, 2, 0]]),
        ROTATION=quarter,
        SCALE=np.float32([[1, 1, 1], [3, 1, 1]]),
    )
    build.json["accessors"][1]["normalized"] = True
    build.gltf(path)
    shapes = load(path).shapes
    assert [type(shape) for shape in shapes] == [Instance] * 2
    assert shapes[0].mesh is shapes[1].mesh
    turned, still = (shape.to_mesh().vertices for shape in shapes)  # the last comes first, as of nodes
    assert still == pytest.approx(TRIANGLE + np.array([1, 0, 5]))
    assert turned == pytest.approx(np.array([[0, 2, 5], [0, 5, 5], [-1, 2, 5]]), abs=1e-6)
    assert len(load_meshes(path)) == 2


def test_what_instances_have_besides_is_named(build, path):
    instanced(build, TRANSLATION=np.float32([[0, 0, 0]]), _COLOR=np.float32([[1, 0, 0]])).gltf(path)
    with pytest.warns(UserWarning, match=r"not honored: node 'grass': _COLOR of instances"):
        assert len(load(path).shapes) == 1


@pytest.mark.parametrize(
    ("attributes", "message"),
    [
        (
            {"TRANSLATION": np.zeros((2, 3), np.float32), "SCALE": np.ones((3, 3), np.float32)},
            r"EXT_mesh_gpu_instancing of node 'grass' has 2 of TRANSLATION, 3 of SCALE; it must be as many",
        ),
        ({"SCALE": np.ones((2, 4), np.float32)}, r"has SCALE with 4 components; it must have 3"),
        (
            {"TRANSLATION": np.float32([[0, 0, 0], [0, np.nan, 0]])},
            r"has TRANSLATION\[1\] \[0\.0, nan, 0\.0\]; it must be finite",
        ),
    ],
)
def test_bad_instances_are_named(build, path, attributes, message):
    """The mesh stands once at its node."""
    instanced(build, **attributes).gltf(path)
    with pytest.warns(UserWarning, match=message + ".*; the mesh once in its place"):
        assert len(load(path).shapes) == 1


def test_the_number_of_instances_is_limited(build, path):
    instanced(build, TRANSLATION=np.zeros((2**20 + 1, 3), np.int8)).gltf(path)
    message = r"a\.gltf: nodes\[0\]: its nodes place 1048577 meshes so far; the limit is 1048576"
    with pytest.raises(SceneError, match=message):
        load(path)


def many(build, count):
    """Place the mesh `count` times by an accessor without data."""
    build.json["accessors"] = [{"componentType": 5126, "count": count, "type": "VEC3"}]
    extension = {"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": 0}}}
    build.json["nodes"][0]["extensions"] = extension
    return build.mesh({"POSITION": build.accessor(TRIANGLE)})


def test_many_instances_load_fast(build, path):
    """Each costs some calls, and none of NumPy."""
    many(build, 2**12).gltf(path)
    assert calls(lambda: load(path)) < 30 * 2**12
    shapes = load(path).shapes
    assert len(shapes) == 2**12
    assert all(shape.mesh is shapes[0].mesh for shape in shapes)


def test_many_nodes_load_fast(build, path):
    """Their transforms are composed together."""
    turn = {"rotation": [0, 0, 0.6, 0.8], "scale": [1, 2, 1]}
    build.json["nodes"] = [{"mesh": 0, "translation": [i, 0, 0], **turn} for i in range(2_500)]
    build.json["scenes"][0]["nodes"] = list(range(2_500))
    build.mesh().gltf(path)
    assert calls(lambda: load(path)) < 100 * 2_500
    shapes = load(path).shapes
    assert [shape.transform[0, 3] for shape in shapes] == list(range(2_500))


def test_nodes_below_one_another(build, path):
    """A long chain is neither a recursion nor a wrong product."""
    build.json["nodes"] = [{"translation": [1, 0, 0], "children": [i + 1]} for i in range(4_999)]
    build.json["nodes"].append({"mesh": 0, "rotation": [0, 0, 1, 0]})
    (mesh,) = load_meshes(build.mesh().gltf(path))
    assert soup(mesh)[0] == pytest.approx(TRIANGLE * [-1, -1, 1] + [4_999, 0, 0])


def test_what_a_file_may_multiply_to_is_limited(build, path):
    """Over all nodes, and before anything is made; whoever wants more says so."""
    many(build, 2**20)
    build.json["nodes"] *= 1000
    build.json["scenes"][0]["nodes"] = list(range(1000))
    build.gltf(path)
    message = r"a\.gltf: nodes\[998\]: its nodes place 2097152 meshes so far; the limit is 1048576"
    with pytest.raises(SceneError, match=message):
        load(path)
    build.json["nodes"] = build.json["nodes"][:1]
    build.json["scenes"][0]["nodes"] = [0]
    build.json["accessors"][0]["count"] = 5
    build.gltf(path)
    assert len(load(path, limits=LoadLimits(instances=5)).shapes) == 5
    with pytest.raises(SceneError, match="place 5 meshes so far; the limit is 4 "):
        load(path, limits=LoadLimits(instances=4))


def test_how_many_triangles_are_copied_is_limited(build, path, monkeypatch):
    """As meshes of their own, instances need the memory of each."""
    many(build, 5).gltf(path)
    monkeypatch.setattr(placing, "MAX_COPIED_FACES", 3)
    assert len(load(path).shapes) == 5
    message = (
        r"a\.gltf: its 5 instances have 5 triangles together, its meshes 1; as meshes of their own, at most 3"
    )
    with pytest.raises(SceneError, match=message):
        load_meshes(path)
    monkeypatch.setattr(placing, "MAX_COPIED_FACES", 4)
    assert len(load_meshes(path)) == 5


def test_how_many_numbers_are_read_is_limited(build, path, monkeypatch):
    """Meshes may share an accessor, and each makes arrays of its own."""
    build.mesh()
    build.json["meshes"] *= 5
    build.json["nodes"] = [{"mesh": i} for i in range(5)]
    build.json["scenes"][0]["nodes"] = list(range(5))
    build.gltf(path)
    monkeypatch.setattr(gltf_document, "MAX_NUMBERS", 45)
    assert len(load(path).shapes) == 5
    build.json["meshes"] *= 2
    build.json["nodes"].append({"mesh": 5})
    build.json["scenes"][0]["nodes"].append(5)
    build.gltf(path)
    message = r"a\.gltf: accessors\[0\]: .* have 54 numbers so far; the limit is 45"
    with pytest.raises(SceneError, match=message):
        load(path)


def test_instances_without_a_volume(build, path, monkeypatch):
    """Those that are flattened become meshes of their own, up to a limit."""
    scale = np.float32([[1, 1, 1], [2, 1, 0], [1, 1, 0], [1, 2, 1]])
    instanced(build, SCALE=scale).gltf(path)
    shapes = load(path).shapes
    assert [type(shape) for shape in shapes] == [Instance, Mesh, Mesh, Instance]  # the last comes first
    assert [soup(shape)[0, 1, 0] for shape in shapes[1:3]] == [1, 2]
    monkeypatch.setattr(placing, "MAX_COPIES", 1)
    message = r"a\.gltf: 'mesh0' brings the meshes whose matrices are singular to 2; the limit is 1"
    with pytest.raises(SceneError, match=message):
        load(path)


# ---- cameras and lights ---------------------------------------------------------------------------


def punctual(b, node=(), **light):
    """Put one light of KHR_lights_punctual on the first node, which may have more."""
    b.json["nodes"][0] |= {"extensions": {"KHR_lights_punctual": {"light": 0}}, **dict(node)}
    b.json["extensions"] = {"KHR_lights_punctual": {"lights": [light]}}


HALF = np.sqrt(0.5)
QUARTER = {"rotation": [HALF, 0, 0, HALF]}  # about x; a light looks along -z
CONE = {"innerConeAngle": 0.15, "outerConeAngle": 0.6}


@pytest.mark.parametrize(
    ("node", "light", "due"),
    [
        ({"translation": [0, 2, 0]}, {"type": "point"}, {"position": [0, 2, 0], "intensity": 1}),
        ({}, {"type": "point", "color": [1, 0.5, 0], "intensity": 8}, {"intensity": [8, 4, 0]}),
        (
            {"translation": [1, 2, 3]},
            {"type": "spot"},
            {"": SpotLight, "position": [1, 2, 3], "angle": Near(90)},
        ),
        ({}, {"type": "spot", "spot": CONE}, {"angle": Near(np.degrees(1.2)), "blend": Near(0.75)}),
        ({}, {"type": "spot", "intensity": 8}, {"direction": [0, 0, -1], "intensity": 8}),
        (QUARTER, {"type": "directional"}, {"": DirectionalLight, "direction": Near([0, 1, 0])}),
        ({}, {"type": "directional", "intensity": 3}, {"direction": [0, 0, -1], "irradiance": 3}),
    ],
)
def test_lights(build, path, node, light, due):
    punctual(build.mesh(), node, **light)
    check(load(build.gltf(path)).lights[0], due)


SEEN = {"perspective": {"yfov": 0.5, "aspectRatio": 1.5, "znear": 1}, "type": "perspective"}


@pytest.mark.parametrize(
    ("node", "due"),
    [
        ({"translation": [1, 2, 3]}, {"origin": [1, 2, 3], "fov": Near(np.degrees(0.5)), "size": (768, 512)}),
        ({"rotation": [0, HALF, 0, HALF]}, {"rotation": Near([[0, 0, 1], [0, 1, 0], [-1, 0, 0]])}),
        # a scale has no say, not even one whose square is no number
        ({"scale": [2] * 3}, {"rotation": np.eye(3)}),
        ({"scale": [1e-200] * 3}, {"rotation": np.eye(3)}),
        ({"scale": [1e90] * 3}, {"rotation": np.eye(3)}),
    ],
)
def test_cameras(build, path, node, due):
    build.json["nodes"].append({"camera": 0, **node})
    build.json["scenes"][0]["nodes"] = [0, 1]
    build.json["cameras"] = [SEEN]
    check(load(build.mesh().gltf(path)).camera, due)


def test_orthographic_camera(build, path):
    build.json["nodes"][0]["camera"] = 0
    build.json["cameras"] = [
        {"type": "orthographic", "orthographic": {"xmag": 3, "ymag": 2, "znear": 0, "zfar": 9}}
    ]
    camera = load(build.mesh().gltf(path)).camera
    assert camera.size == (768, 512)
    origin, direction = camera.rays(np.float32([0, 768]), np.float32([0, 512]), np.zeros(3))
    assert np.abs(origin[:2, 0] - origin[:2, 1]) == pytest.approx([6, 4])
    assert direction[:, 0] == pytest.approx([0, 0, -1])


def test_the_camera_of_a_file_that_trimesh_read_is_named(build, path):
    """Trimesh leaves out the nodes above it."""
    build.json["nodes"].append({"camera": 0})
    build.json["scenes"][0]["nodes"] = [0, 1]
    build.json["cameras"] = [
        {"type": "perspective", "perspective": {"yfov": 0.5, "aspectRatio": 1, "znear": 1}}
    ]
    held = trimesh.load_scene(build.mesh().gltf(path))
    with pytest.warns(UserWarning, match="trimesh object: not honored: the camera of its glTF file"):
        assert from_trimesh(held).camera is None


# ---- materials ------------------------------------------------------------------------------------


@pytest.fixture
def given(build, path, principled_recorded):
    """Load a material as the parameters that `Principled` would be given."""

    def load_given(**material):
        (mesh,) = load_meshes(build.material(**material).gltf(path))
        material = mesh.material
        return material.bsdf.given | {"emission": mesh.emission, "opacity": material.opacity}

    return load_given


def at(texture, u, v):
    return texture.lookup(np.float32([[u], [v]]))[..., 0]


def pbr(**group):
    return {"pbrMetallicRoughness": group}


def extended(**extensions):
    return {"extensions": {f"KHR_materials_{name}": group for name, group in extensions.items()}}


def glossy(**group):
    return extended(pbrSpecularGlossiness=group)


def linear(*codes):
    return srgb_to_linear(np.float32(codes) / np.float32(255))


TEXEL, FADED = {"texel": [51, 102, 153, 204]}, {"texel": [255, 0, 188, 51]}
COLOR, GLOW = linear(51, 102, 153), {"emissiveFactor": [1, 0.5, 0]}
COAT, CLOTH = {"clearcoatFactor": 0.5}, {"sheenColorFactor": [1, 0.5, 0.25], "sheenRoughnessFactor": 0.5}
VARYING_COAT = {"clearcoatRoughnessFactor": 0.5, "clearcoatRoughnessTexture": TEXEL}
CLEAR, THIN = {"transmissionFactor": 1}, {"transmissionFactor": 0.5}
VOLUME = {"thicknessFactor": 1, "attenuationColor": [0.5, 1, 1], "attenuationDistance": 2}
GLASS = pbr(metallicFactor=0, roughnessFactor=0.25, baseColorFactor=[1, 0.5, 0, 1])
HALF_SEEN = pbr(baseColorTexture=FADED, baseColorFactor=[1, 1, 1, 0.5]) | {"alphaCutoff": 0.3}
TURNED = {"anisotropyStrength": 0.6, "anisotropyRotation": np.pi / 3}
# a material of a file, in which {"texel": ...} is an image of one pixel, and what it becomes
MATERIALS = [
    ({}, {"base_color": 1, "metallic": 1, "roughness": 1, "ior": 1.5, "emission": None}),
    (pbr(baseColorFactor=[0.8, 0.123456789, 0, 1]), {"base_color": [0.8, 0.123456789, 0]}),  # exactly
    (pbr(metallicFactor=0.3, roughnessFactor=0.7), {"metallic": 0.3, "roughness": 0.7}),
    (pbr(baseColorTexture=TEXEL, baseColorFactor=[0.5, 1, 1, 1]), {"base_color": Near(COLOR * [0.5, 1, 1])}),
    (pbr(metallicRoughnessTexture=TEXEL), {"roughness": Near(0.4), "metallic": Near(0.6)}),
    (pbr(metallicRoughnessTexture=TEXEL, roughnessFactor=0.5), {"roughness": Near(0.2)}),
    (pbr(metallicRoughnessTexture=TEXEL, metallicFactor=0.25), {"metallic": Near(0.15)}),
    # opacity counts in two modes
    (HALF_SEEN, {"material.opacity": None}),
    (HALF_SEEN | {"alphaMode": "BLEND"}, {"alpha": Near(0.1), "material.opacity.cutoff": None}),
    (HALF_SEEN | {"alphaMode": "MASK"}, {"alpha": Near(0.1), "material.opacity.cutoff": 0.3}),
    # emission and its strength
    (GLOW, {"emission": [1, 0.5, 0]}),
    (GLOW | extended(emissive_strength={"emissiveStrength": 10}), {"emission": [10, 5, 0]}),
    (GLOW | {"emissiveTexture": TEXEL}, {"emission": Near(COLOR * [1, 0.5, 0])}),
    # extensions
    (extended(ior={"ior": 1.33}), {"ior": 1.33}),
    (extended(transmission={"transmissionFactor": 0.9}), {"transmission": 0.9, "thin": True}),
    (extended(transmission=THIN | {"transmissionTexture": TEXEL}), {"transmission": Near(0.1)}),
    (extended(clearcoat={"clearcoatFactor": 0.5}), {"clearcoat": 0.5, "clearcoat_roughness": 0}),
    (extended(clearcoat=COAT | {"clearcoatRoughnessFactor": 0.1}), {"clearcoat_roughness": 0.1}),
    (extended(clearcoat=COAT | {"clearcoatTexture": TEXEL}), {"clearcoat": Near(0.1)}),
    (extended(clearcoat=COAT | VARYING_COAT), {"clearcoat": 0.5, "clearcoat_roughness": Near(0.2)}),
    (extended(sheen={"sheenColorFactor": [1, 0, 0]}), {"sheen": 1, "sheen_color": [1, 0, 0]}),
    (extended(sheen=CLOTH), {"sheen_roughness": 0.5}),
    (extended(sheen=CLOTH | {"sheenColorTexture": TEXEL}), {"sheen_color": Near(COLOR * [1, 0.5, 0.25])}),
    (extended(sheen=CLOTH | {"sheenRoughnessTexture": TEXEL}), {"sheen_roughness": Near(0.4)}),
    (extended(specular={"specularFactor": 0.2}), {"specular": 0.2}),
    (extended(specular={"specularTexture": TEXEL}), {"specular": Near(0.8)}),
    (
        extended(specular={"specularColorFactor": [2, 1, 0.5], "specularColorTexture": TEXEL}),
        {"specular_color": Near(COLOR * [2, 1, 0.5])},
    ),
    (
        extended(iridescence={"iridescenceFactor": 1, "iridescenceIor": 1.8}),
        {"film_thickness": 400, "film_ior": 1.8},
    ),
    (extended(iridescence={"iridescenceIor": 1.8}), {"film_thickness": 0}),
    # α along the tangent is mix(α, 1, strength²)
    (
        pbr(roughnessFactor=0.5) | extended(anisotropy=TURNED),
        {"roughness": Near(np.sqrt(0.25 + 0.75 * 0.36)), "roughness_v": 0.5, "rotation": Near(60)},
    ),
    (extended(anisotropy={}), {"roughness_v": None}),
    # specular-glossiness: a constant specular leaves a part of the diffuse color
    (glossy(), {"base_color": 0, "specular_color": Near(25), "roughness": 0, "metallic": 0, "ior": 1.5}),
    (
        glossy(diffuseTexture=FADED, diffuseFactor=[0.5, 1, 1, 0.5], specularFactor=[0, 0.25, 0.125])
        | {"alphaMode": "BLEND"},
        {"base_color": Near(0.75 * linear(255, 0, 188) * [0.5, 1, 1]), "alpha": Near(0.1)}
        | {"specular_color": Near([0, 6.25, 3.125])},
    ),
    (glossy(specularGlossinessTexture={"texel": [255, 0, 0]}, glossinessFactor=0.25), {"roughness": 0.75}),
]


ABSORBING = {"interior.absorption": Near([np.log(2) / 2, 0, 0])}
# the same, and its material
MADE = [
    # there is a medium where light gets in, and the surface is no thin sheet
    (extended(transmission=THIN, volume=VOLUME), ABSORBING),
    (extended(transmission={}, volume=VOLUME), {"interior": None}),
    (extended(transmission=THIN, volume=VOLUME | {"thicknessFactor": 0}), {"interior": None}),
    # glass
    (
        GLASS | extended(transmission=CLEAR),
        {"bsdf": ThinDielectric, "bsdf.roughness": 0.25, "bsdf.transmittance": [1, 0.5, 0]},
    ),
    (
        GLASS | extended(transmission=CLEAR, volume=VOLUME, ior={"ior": 1.33}),
        {"bsdf": Dielectric, "bsdf.ior": Near(1.33)},
    ),
    (GLASS | extended(transmission=CLEAR, volume=VOLUME), ABSORBING),
    (  # over a distance below float32: no division by zero
        GLASS | extended(transmission=CLEAR, volume=VOLUME | {"attenuationDistance": 1e-320}),
        {"interior.absorption": Near([np.log(2) / np.finfo(np.float32).tiny, 0, 0])},
    ),
    (
        pbr(metallicFactor=0) | extended(transmission=CLEAR, anisotropy={"anisotropyStrength": 1}),
        {"bsdf": ThinDielectric, "bsdf.roughness_v": 1},
    ),
]


def with_images(build, value):
    """Return a part of a material with images in it."""
    if not isinstance(value, dict):
        return value
    if "texel" in value:
        return build.image(np.uint8([[value["texel"]]]))
    return {name: with_images(build, each) for name, each in value.items()}


@pytest.mark.filterwarnings("ignore:.*lacks? the texture coordinates")
@pytest.mark.usefixtures("principled_recorded")
@pytest.mark.parametrize(("material", "due"), MATERIALS)
def test_materials(build, path, material, due):
    """Parameters are those that `Principled` would be given; textures are looked up."""
    (mesh,) = load_meshes(build.material(**with_images(build, material)).gltf(path))
    made, bsdf = mesh.material, mesh.material.bsdf
    found = getattr(bsdf, "given", {}) | {
        "emission": mesh.emission,
        "alpha": made.opacity and made.opacity.alpha,
    }
    found = {name: at(each, 0.5, 0.5) if isinstance(each, Texture) else each for name, each in found.items()}
    check(SimpleNamespace(**found, material=made), due)


@pytest.mark.parametrize(("material", "due"), MADE)
def test_glass_and_what_is_in_it(build, path, material, due):
    (mesh,) = load_meshes(build.material(**material).gltf(path))
    check(mesh.material, due)


def test_textures(given, build):
    codes = np.zeros((2, 2, 3), np.uint8)
    codes[0, 0] = [255, 188, 0]  # top left: u = v = 0 in glTF
    base, data = build.image(codes), build.image(codes)
    found = given(
        pbrMetallicRoughness={
            "baseColorTexture": base,
            "baseColorFactor": [0.5, 1, 1, 1],
            "metallicRoughnessTexture": data,
            "roughnessFactor": 0.5,
            "metallicFactor": 0.25,
        }
    )
    assert at(found["base_color"], 0.25, 0.75) == pytest.approx(
        [0.5, float(srgb_to_linear(np.float32(188 / 255))), 0]
    )
    assert at(found["base_color"], 0.25, 0.25).tolist() == [0, 0, 0]
    assert at(found["roughness"], 0.25, 0.75) == pytest.approx(0.5 * 188 / 255)
    assert at(found["metallic"], 0.25, 0.75) == 0


def test_one_image_is_decoded_once(given, build):
    both = build.image(np.zeros((4, 4, 3), np.uint8))
    found = given(pbrMetallicRoughness={"metallicRoughnessTexture": both})
    assert np.shares_memory(found["metallic"]._texels, found["roughness"]._texels)


def test_samplers(given, build):
    info = build.image(np.uint8([[[255, 0, 0], [0, 255, 0]]]))
    build.json["samplers"] = [{"wrapS": 33071, "wrapT": 33648, "magFilter": 9728}]
    build.json["textures"][0]["sampler"] = 0
    base = given(pbrMetallicRoughness={"baseColorTexture": info})["base_color"]
    assert (base.wrap, base.filter) == (("clamp", "mirror"), "nearest")
    assert at(base, 7.0, 0.5).tolist() == [0, 1, 0]
    del build.json["samplers"], build.json["textures"][0]["sampler"]


@pytest.mark.parametrize(
    ("sampler", "expected", "named"),
    [
        ({}, "bilinear", False),
        ({"magFilter": 9728}, "nearest", False),
        ({"minFilter": 9728}, "nearest", False),
        ({"magFilter": 9729, "minFilter": 9986}, "bilinear", False),
        ({"magFilter": 9728, "minFilter": 9987}, "nearest", False),
        ({"magFilter": 9728, "minFilter": 9729}, "nearest", True),
        ({"magFilter": 9729, "minFilter": 9728}, "bilinear", True),
    ],
)
def test_filters(build, path, sampler, expected, named):
    """Mipmaps are not needed; a filter of its own for small pictures is not honored."""
    info = build.image(np.uint8([[[255, 0, 0], [0, 255, 0]]]))
    build.json["samplers"] = [sampler]
    build.json["textures"][0]["sampler"] = 0
    build.material(emissiveFactor=[1, 1, 1], emissiveTexture=info).gltf(path)
    with warnings.catch_warnings(record=True) as record:
        warnings.simplefilter("always")
        (mesh,) = load_meshes(path)
    assert mesh.emission.filter == expected
    message = r"not honored: materials[0].emissiveTexture: minFilter (magFilter counts at all distances)"
    assert [message in str(entry.message) for entry in record] == [True] * named


def test_texture_transform_by_the_example_of_its_specification(given, build):
    # "utilizes only the lower left quadrant of the source image, rotated clockwise 90°"
    rng = np.random.default_rng(0)
    info = build.image(rng.integers(0, 256, (4, 4, 3), np.uint8))
    info["extensions"] = {
        "KHR_texture_transform": {"offset": [0, 1], "rotation": np.pi / 2, "scale": [0.5, 0.5]}
    }
    base = given(pbrMetallicRoughness={"baseColorTexture": info})["base_color"]
    plain = Texture(base._texels.reshape(4, 4, 3))
    for s, t in rng.random((10, 2)):  # s, t: glTF's own coordinates, t downwards
        moved = 0.5 * t, 1 - 0.5 * s
        assert moved[0] <= 0.5 <= moved[1]
        assert at(base, s, 1 - t) == pytest.approx(at(plain, moved[0], 1 - moved[1]), abs=1e-5)


@pytest.mark.parametrize("material", [{}, {"pbrMetallicRoughness": {"metallicFactor": 0}}])
@pytest.mark.parametrize("glass", [False, True])
def test_normal_map(build, path, material, glass):
    codes = np.uint8([[[128, 255, 255]]])
    info = build.image(codes) | {"scale": 0.5, "texCoord": 1}
    extensions = {"KHR_materials_transmission": {"transmissionFactor": 1}} if glass else {}
    (mesh,) = load_meshes(build.material(**material, normalTexture=info, extensions=extensions).gltf(path))
    normal_map = mesh.material.normal_map
    assert isinstance(normal_map, NormalMap)
    assert (normal_map.strength, normal_map.texture.uv_set) == (0.5, 1)
    assert at(normal_map.texture, 0.5, 0.5) == pytest.approx(codes[0, 0] / 255)


def tangent_space(build, **extra):
    attributes = {
        "POSITION": TRIANGLE,
        "NORMAL": np.tile(np.float32([[0, 0, 1]]), (3, 1)),
        "TEXCOORD_0": TRIANGLE[:, :2],
        "TANGENT": np.tile(np.float32([[0, 1, 0, -1]]), (3, 1)),
    }
    return build.mesh({key: value for key, value in (attributes | extra).items() if value is not None})


def test_tangents(build, path):
    """They are kept, turned with their node, and left out where there are no normals, as glTF demands."""
    tangent_space(build)
    (mesh,) = load_meshes(build.gltf(path))
    assert mesh.tangents.tolist() == [[0, 1, 0, -1]] * 3
    build.json["nodes"][0]["matrix"] = [
        0,
        2,
        0,
        0,
        2,
        0,
        0,
        0,
        0,
        0,
        2,
        0,
        5,
        0,
        0,
        1,
    ]  # x and y change places
    (mesh,) = load_meshes(build.gltf(path))
    assert mesh.tangents.tolist() == [[1, 0, 0, 1]] * 3
    turned = np.array([[0, -1, 0, 0], [1, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1.0]])
    assert load_mesh(path, transform=turned).tangents == pytest.approx(np.array([[0, 1, 0, 1.0]] * 3))
    again = Builder()
    (mesh,) = load_meshes(tangent_space(again, NORMAL=None).gltf(path))
    assert mesh.tangents is None


def test_bad_tangents(build, path):
    tangent_space(build, TANGENT=np.zeros((3, 3), np.float32)).gltf(path)
    with pytest.warns(UserWarning, match="has TANGENT with 3 components; it must have 4; left out"):
        (mesh,) = load_meshes(path)
    assert mesh.tangents is None
    again = Builder()
    tangent_space(again, TANGENT=np.float32([[1, 0, 0, 1], [np.nan, 0, 0, 1], [1, 0, 0, 1]])).gltf(path)
    with pytest.warns(UserWarning, match="1 tangent is not finite, first: vertex 1"):
        (mesh,) = load_meshes(path)
    assert mesh.tangents[1].tolist() == [0, 0, 0, 0]


@pytest.mark.parametrize("hand", [1, -1])
def test_the_handedness_of_tangents_is_seen_in_the_picture(build, path, hand):
    """A map that leans to green, lit from above: bright where green is up, dark where it is down.

    The light comes along (0, -1, -1)/√2 with irradiance π. The map's normal is (0, ±0.6, 0.8), so a white
    matte surface sends (0.8 ± 0.6)/√2.
    """
    tangent_space(build, TANGENT=np.tile(np.float32([[1, 0, 0, hand]]), (3, 1)))
    (mesh,) = load_meshes(build.gltf(path))
    mesh.material = Material(Diffuse(1.0), normal_map=NormalMap(np.float32([[[0.5, 0.8, 0.9]]])))
    sun = DirectionalLight((0, -1, -1), np.pi)
    camera = Camera.look_at((0.3, 0.3, 5), (0.3, 0.3, 0), fov=0.1, size=(2, 2))
    seen = render(Scene([mesh], [sun], camera), 4, workers=1, progress=False).rgb
    assert seen == pytest.approx(np.full((2, 2, 3), (0.8 + 0.6 * hand) / np.sqrt(2)), rel=1e-4)


def test_bad_normal_maps(build, path):
    info = build.image(np.zeros((1, 1), np.uint8)) | {"scale": "big"}
    for message in (r"normalTexture\.scale is \['big'\]", r"normalTexture: NormalMap: .* gives numbers"):
        with pytest.warns(UserWarning, match=rf"materials\[0\]\.{message}.*; left out"):
            mesh = load(build.material(normalTexture=info).gltf(path)).shapes[0]
        assert mesh.material.normal_map is None
        info["scale"] = 1


def test_textured_emission(given, build):
    info = build.image(np.uint8([[[255, 255, 255], [0, 0, 0]]]))
    strength = {"KHR_materials_emissive_strength": {"emissiveStrength": 4}}
    found = given(emissiveFactor=[1, 0.5, 0], emissiveTexture=info, extensions=strength)
    assert at(found["emission"], 0.25, 0.5) == pytest.approx([4, 2, 0])
    assert at(found["emission"], 0.75, 0.5) == pytest.approx([0, 0, 0])


def test_anisotropy_of_a_texture(given, build):
    """Red and green are a direction in [-1, 1], blue is multiplied by the strength."""
    info = build.image(np.uint8([[[0, 255, 102]]]))
    group = {"anisotropyStrength": 0.5, "anisotropyRotation": np.pi / 2, "anisotropyTexture": info}
    found = given(
        pbrMetallicRoughness={"roughnessFactor": 0.5}, extensions={"KHR_materials_anisotropy": group}
    )
    one = np.zeros((3, 1), np.float32)
    lane = np.zeros(1, np.intp)
    surface = SurfaceInteraction(one, one[0], one, one, one, lane, lane, one[0] > 0, uv=one[:2] + 0.5)
    assert found["rotation"].at(surface) == pytest.approx([225])
    assert found["roughness"].at(surface) ** 2 == pytest.approx([0.25 + 0.75 * 0.04], rel=1e-6)
    assert found["roughness_v"] == 0.5


def test_dispersion(build, path):
    """The spread of the indices is (ior − 1)·0.05·dispersion; and the film of a texture of thickness."""
    info = build.image(np.uint8([[[0, 51, 0]]]))
    extensions = {
        "KHR_materials_transmission": {"transmissionFactor": 1},
        "KHR_materials_volume": {"thicknessFactor": 1},
        "KHR_materials_ior": {"ior": 1.6},
        "KHR_materials_dispersion": {"dispersion": 2},
        "KHR_materials_iridescence": {
            "iridescenceFactor": 1,
            "iridescenceThicknessMinimum": 200,
            "iridescenceThicknessMaximum": 700,
            "iridescenceThicknessTexture": info,
        },
    }
    build.material(pbrMetallicRoughness={"metallicFactor": 0}, extensions=extensions).gltf(path)
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", ".*lacks? the texture coordinates")
        (mesh,) = load_meshes(path)
    glass = mesh.material.bsdf
    assert type(glass) is Dielectric
    assert glass.ior.ravel() == pytest.approx([1.57, 1.6, 1.63])
    assert at(glass.film_thickness, 0.5, 0.5) == pytest.approx(300)
    assert glass.film_ior == pytest.approx(1.3)


def test_the_texture_of_a_thickness_is_named(build, path):
    volume = {"thicknessFactor": 1, "thicknessTexture": build.image(np.zeros((1, 1, 3), np.uint8))}
    extensions = {"KHR_materials_transmission": {"transmissionFactor": 1}, "KHR_materials_volume": volume}
    build.material(extensions=extensions).gltf(path)
    with pytest.warns(UserWarning, match=r"not honored: .*: thicknessTexture") as record:
        load(path)
    assert len(record) == 1


def test_a_specular_color_above_1_raises_the_reflectance_to_at_most_1(build, path):
    """KHR_materials_specular: min(0.04 · color, 1), of ior 1.5."""
    build.material(extensions={"KHR_materials_specular": {"specularColorFactor": [1, 10, 100]}}).gltf(path)
    (mesh,) = load_meshes(path)
    found = mesh.material.bsdf.layers().base.gloss.schlick(np.zeros(1, np.float32)).ravel()
    assert found == pytest.approx([0.04, 0.4, 1])


# ---- specular-glossiness ---------------------------------------------------------------------------


def test_specular_glossiness_reflects_as_its_formulas_say(build, path):
    """c = diffuse·(1 − max(specular)), F0 = specular, α = (1 − glossiness)² in glTF's appendix B."""
    diffuse, specular, glossiness = np.array([0.9, 0.5, 0.2]), np.array([0.1, 0.3, 0.6]), 0.4
    group = {
        "diffuseFactor": [*diffuse, 1], "specularFactor": specular.tolist(), "glossinessFactor": glossiness,
    }  # fmt: skip
    metal = {"baseColorFactor": [1, 0, 0, 1]}  # does not count beside it
    (mesh,) = load_meshes(build.material(**glossy(**group), pbrMetallicRoughness=metal).gltf(path))
    material = mesh.material.bsdf
    material.conserve_energy = False  # the appendix to the letter
    wo, wi = (np.float32([[np.sin(t)], [0], [np.cos(t)]]) for t in (0.3, -0.9))
    half = (wo + wi) / np.linalg.norm(wo + wi)
    alpha2 = (1 - glossiness) ** 4
    spread = alpha2 / (np.pi * (half[2] ** 2 * (alpha2 - 1) + 1) ** 2)
    masked = [z * np.sqrt(alpha2 + (1 - alpha2) * y**2) for z, y in ((wi[2], wo[2]), (wo[2], wi[2]))]
    visible = 0.5 / (masked[0] + masked[1])
    fresnel = specular + (1 - specular) * (1 - (wo * half).sum()) ** 5
    base = diffuse * (1 - specular.max())
    expected = (1 - fresnel.max()) * base / np.pi + fresnel * spread * visible
    assert material.f(wo, wi).ravel() == pytest.approx(expected, rel=1e-4)


@pytest.mark.parametrize("textured", [False, True])
def test_the_texture_of_specular_and_glossiness(given, build, textured):
    """Colors are sRGB and glossiness is linear; the images may differ in size and in set of coordinates."""
    both = build.image(np.uint8([[[255, 0, 0, 0], [0, 188, 0, 51]]]))
    shade = build.image(np.uint8([[[255, 255, 255]], [[0, 188, 0]]])) | {"texCoord": 1}
    group = {"specularGlossinessTexture": both, "specularFactor": [0.5, 1, 1], "glossinessFactor": 0.5}
    group |= {"diffuseTexture": shade} if textured else {"diffuseFactor": [0.25, 0.5, 1, 1]}
    found = given(**glossy(**group))
    gray = float(srgb_to_linear(np.float32(188 / 255)))
    assert at(found["roughness"], 0.25, 0.5) == pytest.approx(1)
    assert at(found["roughness"], 0.75, 0.5) == pytest.approx(0.9)
    assert at(found["specular_color"], 0.25, 0.5) == pytest.approx([12.5, 0, 0])
    assert at(found["specular_color"], 0.75, 0.5) == pytest.approx([0, 25 * gray, 0])
    points = np.float32([[0.25, 0.75, 0.75], [0.5, 0.5, 0.5]])
    rows = np.float32([[0.5] * 3, [0.25, 0.25, 0.75]])
    surface = SimpleNamespace(uv=points, uv1=rows)
    left = np.array([0.5, 1 - gray, 1 - gray])
    diffuse = np.array([[0, gray, 0], [0, gray, 0], [1, 1, 1]]) if textured else [0.25, 0.5, 1]
    seen = found["base_color"].at(surface).T
    assert seen == pytest.approx(left[:, None] * diffuse, abs=1e-6)
    assert set(found["base_color"].reads) == ({"uv", "uv1"} if textured else {"uv"})


def test_vertex_colors_multiply_the_diffuse_part_alone(build, path):
    info = build.image(np.uint8([[[255, 0, 0, 0]]]))
    build.material(**glossy(specularGlossinessTexture=info, specularFactor=[0.5, 1, 1]))
    build.json["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"] = build.accessor(COLORS)
    (mesh,) = load_meshes(build.gltf(path))
    surface = SimpleNamespace(uv=np.float32([[0.5], [0.5]]), color=np.float32([[0.5], [1], [0], [1]]))
    assert mesh.material.bsdf.base_color.at(surface).ravel() == pytest.approx([0.25, 0.5, 0])
    assert at(mesh.material.bsdf.specular_color, 0.5, 0.5) == pytest.approx([12.5, 0, 0])


def test_what_specular_glossiness_excludes_is_named(build, path):
    extensions = glossy()["extensions"] | {
        "KHR_materials_clearcoat": {"clearcoatFactor": 1},
        "KHR_materials_emissive_strength": {"emissiveStrength": 2},
    }
    build.json["extensionsRequired"] = ["KHR_materials_pbrSpecularGlossiness"]
    build.material(extensions=extensions, emissiveFactor=[1, 1, 1]).gltf(path)
    message = r"not honored: materials.*: KHR_materials_clearcoat beside KHR_materials_pbrSpecularGlossiness"
    with pytest.warns(UserWarning, match=message) as record:
        (mesh,) = load_meshes(path)
    assert len(record) == 1
    assert mesh.emission.ravel().tolist() == [2, 2, 2]


# ---- what is not honored is named once ---------------------------------------------------------


def lose_light(b):
    punctual(b, type="area")


def lose_camera(b):
    b.json["nodes"] += [{"camera": 0}, {"camera": 0}]
    b.json["scenes"][0]["nodes"] = [0, 1, 2]
    b.json["cameras"] = [{"type": "perspective", "perspective": {"yfov": 1}}]


def lose_colors(b):
    colors = b.accessor(np.ones((3, 3), np.float32))
    b.json["meshes"][0]["primitives"][0]["attributes"]["COLOR_1"] = colors


def lose_lines(b):
    b.json["meshes"][0]["primitives"].append({"mode": 1, "attributes": {"POSITION": 0}})


def lose_scene(b):
    b.json["scenes"].append({"nodes": []})


def lose_extension(b):
    b.json["extensionsUsed"] = ["KHR_materials_unknown"]


def lose_range(b):
    punctual(b, type="point", range=5)


def lose_of_material(named, **material):
    """Give the triangle a material; return what to expect."""

    def lose(b):
        black = b.image(np.zeros((1, 1, 3), np.uint8))
        text = json.dumps(material).replace('"image"', json.dumps(black))
        b.json["materials"] = [{"name": "m", **json.loads(text)}]
        b.json["meshes"][0]["primitives"][0]["material"] = 0

    return lose, r"materials\[0\] 'm': " + named


@pytest.mark.filterwarnings("ignore:.*lacks? the texture coordinates")
@pytest.mark.parametrize(
    ("lose", "message"),
    [
        (lose_light, r"light 0: area light"),
        (lose_camera, r"cameras\[0\]: further cameras"),
        (lose_colors, r"mesh 'mesh0': COLOR_1"),
        (lose_lines, r"mesh 'mesh0': points and lines"),
        (lose_range, r"light 0: range of a light"),
        lose_of_material("occlusionTexture", occlusionTexture="image"),
        lose_of_material("ior 0", extensions={"KHR_materials_ior": {"ior": 0}}),
        lose_of_material(
            "clearcoatNormalTexture",
            extensions={"KHR_materials_clearcoat": {"clearcoatFactor": 1, "clearcoatNormalTexture": "image"}},
        ),
        lose_of_material(
            "iridescenceFactor or a texture of it .*",
            extensions={"KHR_materials_iridescence": {"iridescenceFactor": 0.5}},
        ),
        lose_of_material("dispersion", extensions={"KHR_materials_dispersion": {"dispersion": 1}}),
        lose_of_material("KHR_materials_unlit", extensions={"KHR_materials_unlit": {}}),
        (lose_scene, r"the file: further scenes"),
        (lose_extension, r"the file: KHR_materials_unknown"),
    ],
)
def test_what_is_not_honored_is_named(build, path, lose, message):
    lose(build.mesh())
    build.gltf(path)
    with pytest.warns(UserWarning, match=r"a\.gltf: not honored: " + message) as record:
        load(path)
    assert len(record) == 1
    with pytest.raises(SceneError, match="not honored"):
        load(path, strict=True)


# ---- vertex colors and a second set of texture coordinates -----------------------------------------

COLORS = np.array([[1, 0.5, 0.25], [0, 1, 0.125], [0.3, 0.1, 1]], np.float32)


@pytest.mark.parametrize(
    ("colors", "extra", "expected"),
    [
        (COLORS, {}, np.column_stack([COLORS, np.ones(3)])),
        (np.column_stack([COLORS, COLORS[:, 0]]), {}, np.column_stack([COLORS, COLORS[:, 0]])),
        (np.uint8([[255, 51, 0, 102]] * 3), {"normalized": True}, [[1, 0.2, 0, 0.4]] * 3),
        (np.uint16([[65535, 13107, 0]] * 3), {"normalized": True}, [[1, 0.2, 0, 1]] * 3),
    ],
)
def test_vertex_colors_are_linear(build, path, colors, extra, expected):
    build.mesh({"POSITION": TRIANGLE, "COLOR_0": build.accessor(colors, **extra)}).gltf(path)
    (mesh,) = load_meshes(path)
    assert mesh.colors == pytest.approx(np.array(expected))
    assert isinstance(mesh.material.bsdf, Diffuse)
    assert isinstance(mesh.material.bsdf.reflectance, VertexColors)
    assert mesh.material.bsdf.reflectance.times.ravel().tolist() == [1, 1, 1]


def test_vertex_colors_multiply_the_base_color(build, path):
    info = build.image(np.uint8([[[255, 0, 0], [0, 255, 0]]]))
    factor = {"baseColorFactor": [0.5, 1, 1, 1]}
    build.json["materials"] = [
        {"pbrMetallicRoughness": {"metallicFactor": 0, **factor}},
        {"pbrMetallicRoughness": {"baseColorTexture": info, **factor}},
    ]
    corners = {"POSITION": TRIANGLE, "TEXCOORD_0": TRIANGLE[:, :2]}
    for colored, material in ((True, 0), (True, 0), (False, 0), (True, 1)):
        build.mesh(corners | ({"COLOR_0": COLORS} if colored else {}), material=material)
    build.json["nodes"] = [{"mesh": i} for i in range(4)]
    build.json["scenes"][0]["nodes"] = [0, 1, 2, 3]
    first, second, plain, textured = load_meshes(build.gltf(path))
    assert first.material is second.material  # made once
    assert first.material.bsdf.base_color.times.ravel().tolist() == [0.5, 1, 1]
    assert plain.material.bsdf.base_color.ravel().tolist() == [0.5, 1, 1]
    assert isinstance(textured.material.bsdf.base_color.times, Texture)


@pytest.mark.parametrize("mode", ["OPAQUE", "MASK", "BLEND"])
@pytest.mark.parametrize("textured", [False, True])
def test_the_opacity_of_vertex_colors_counts_where_the_material_fades(build, path, mode, textured):
    info = build.image(np.uint8([[[255, 255, 255, 51]]]))
    group = {"baseColorTexture": info} if textured else {"baseColorFactor": [1, 1, 1, 0.5]}
    clear = np.column_stack([COLORS, np.float32([0.25, 0.5, 1])])
    build.material(pbrMetallicRoughness=group, alphaMode=mode, alphaCutoff=0.3)
    build.json["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"] = build.accessor(clear)
    (mesh,) = load_meshes(build.gltf(path))
    opacity = mesh.material.opacity
    if mode == "OPAQUE":
        assert opacity is None
        return
    assert opacity.cutoff == (0.3 if mode == "MASK" else None)
    assert opacity.alpha.channel == 3
    if textured:
        assert at(opacity.alpha.times, 0.5, 0.5) == pytest.approx(0.2)
    else:
        assert opacity.alpha.times == 0.5
    # opaque colors leave the opacity as it is
    build.json["accessors"][-1]["type"] = "VEC3"
    (mesh,) = load_meshes(build.gltf(path))
    plain = mesh.material.opacity
    assert plain is None if mode == "MASK" and not textured else not isinstance(plain.alpha, VertexColors)


def test_vertex_colors_fade_a_material_that_is_opaque_itself(build, path):
    clear = np.column_stack([COLORS, np.float32([0.25, 0.5, 1])])
    build.material(alphaMode="BLEND")
    build.json["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"] = build.accessor(clear)
    (mesh,) = load_meshes(build.gltf(path))
    assert mesh.material.opacity.alpha.times == 1
    (held,) = from_trimesh(trimesh.load_scene(path)).shapes
    assert held.material.opacity.alpha.channel == 3
    assert np.array_equal(mesh.colors, held.colors)


def test_vertex_colors_on_glass_are_named(build, path):
    build.material(
        pbrMetallicRoughness={"metallicFactor": 0},
        extensions={"KHR_materials_transmission": {"transmissionFactor": 1}},
    )
    build.json["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"] = build.accessor(COLORS)
    with pytest.warns(UserWarning, match=r"not honored: mesh 'mesh0': vertex colors"):
        (mesh,) = load_meshes(build.gltf(path))
    assert isinstance(mesh.material.bsdf, ThinDielectric)


def test_vertex_colors_out_of_range_are_clamped(build, path):
    beyond = np.float32([[2, 0, 0], [0, -1, 0], [0, 0, 0]])
    build.mesh({"POSITION": TRIANGLE, "COLOR_0": beyond})
    build.gltf(path)
    with pytest.warns(UserWarning, match=r"2 vertex colors are outside \[0, 1\]"):
        (mesh,) = load_meshes(path)
    assert mesh.colors.tolist() == [[1, 0, 0, 1], [0, 0, 0, 1], [0, 0, 0, 1]]
    with pytest.raises(SceneError, match="outside"):
        load(path, strict=True)


def test_a_second_set_of_texture_coordinates(build, path):
    info = build.image(np.uint8([[[255, 0, 0], [0, 255, 0]]]))
    second = np.float32([[0.25, 0], [0.5, 0.75], [1, 1]])
    moved = {"extensions": {"KHR_texture_transform": {"texCoord": 1, "scale": [2, 2]}}}
    for extra, expected in (({}, 0), ({"texCoord": 1}, 1), (moved | {"texCoord": 0}, 1)):
        again = Builder()
        again.__dict__ |= {"json": json.loads(json.dumps(build.json)), "binary": build.binary}
        again.json["materials"] = [{"pbrMetallicRoughness": {"baseColorTexture": info | extra}}]
        corners = {"POSITION": TRIANGLE, "TEXCOORD_0": TRIANGLE[:, :2], "TEXCOORD_1": second}
        (mesh,) = load_meshes(again.mesh(corners, material=0).gltf(path))
        assert mesh.uvs1 == pytest.approx(second * [1, -1] + [0, 1])
        assert mesh.material.bsdf.base_color.uv_set == expected


@pytest.mark.parametrize("extra", ["attribute", "texture"])
def test_a_third_set_of_texture_coordinates_is_named(build, path, extra):
    info = build.image(np.zeros((1, 1, 3), np.uint8)) | ({"texCoord": 2} if extra == "texture" else {})
    build.material(pbrMetallicRoughness={"baseColorTexture": info})
    if extra == "attribute":
        third = build.accessor(TRIANGLE[:, :2])
        build.json["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_2"] = third
    with pytest.warns(UserWarning, match=r"not honored: m.*: TEXCOORD_2"):
        load_meshes(build.gltf(path))


# ---- defects --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "uri", ["../t.png", "/t.png", "http://example.org/t.png", "sub/../../t.png", "%2e%2e/t.png"]
)
def test_images_outside_the_folder_are_left_out(build, path, uri):
    build.json |= {"images": [{"uri": uri}], "textures": [{"source": 0}]}
    build.material(pbrMetallicRoughness={"baseColorTexture": {"index": 0}}).gltf(path)
    with pytest.warns(UserWarning, match=r"baseColorTexture: texture .*; gray in its place"):
        (mesh,) = load(path).shapes
    assert mesh.material.bsdf.base_color.mean().tolist() == [0.5, 0.5, 0.5]


def test_a_missing_image_is_named_and_left_out(build, path):
    """What it would multiply counts alone, but a color is gray and emission is left out; `strict` refuses."""
    build.json |= {"images": [{"uri": "my%20t.png"}], "textures": [{"source": 0}]}
    info = {"index": 0}
    group = {"baseColorTexture": info, "baseColorFactor": [0.5, 0.25, 1, 1], "metallicRoughnessTexture": info}
    extensions = {"KHR_materials_clearcoat": {"clearcoatFactor": 0.5, "clearcoatTexture": info}}
    build.material(
        pbrMetallicRoughness=group | {"roughnessFactor": 0.75},
        normalTexture=info,
        emissiveFactor=[0, 1, 0],
        emissiveTexture=info,
        extensions=extensions,
    )
    build.gltf(path)
    message = r"a\.gltf: materials\[0\]\.normalTexture: texture 'my%20t\.png' is missing; left out"
    with pytest.warns(UserWarning, match=message) as record:
        (mesh,) = load(path).shapes
    assert len(record) == 1
    assert mesh.material.bsdf.base_color.mean().tolist() == [0.25, 0.125, 0.5]
    assert (mesh.material.bsdf.roughness, mesh.material.bsdf.clearcoat) == (0.75, 0.5)
    assert mesh.material.normal_map is None
    assert mesh.emission is None
    with pytest.raises(SceneError, match=message):
        load(path, strict=True)
    iio.imwrite(path.parent / "my t.png", np.zeros((2, 2, 3), np.uint8))
    (mesh,) = load(path, strict=True).shapes
    assert isinstance(mesh.material.bsdf.base_color, Texture)


def test_damaged_images_are_named(build, path):
    build.json |= {"images": [{"uri": "t.png"}], "textures": [{"source": 0}]}
    build.material(pbrMetallicRoughness={"baseColorTexture": {"index": 0}}).gltf(path)
    (path.parent / "t.png").write_bytes(b"\x89PNG\r\n\x1a\n" + bytes(30))
    with pytest.warns(UserWarning, match=r"a\.gltf: materials\[0\]\.\w+: texture 't\.png': t\.png: .*; gray"):
        (mesh,) = load(path).shapes
    assert mesh.material.bsdf.base_color.mean().tolist() == [0.5, 0.5, 0.5]


def test_how_many_pixels_the_images_have_is_limited(build, path):
    """A view of the buffer may serve any number of images."""
    info = build.image(np.zeros((4, 4, 3), np.uint8))
    build.json["images"] *= 5
    build.json["textures"] = [{"source": i} for i in range(5)]
    build.material(
        normalTexture=info, emissiveFactor=[1, 1, 1], emissiveTexture={"index": 1},
        pbrMetallicRoughness={"baseColorTexture": {"index": 2}, "metallicRoughnessTexture": {"index": 3}},
        extensions={"KHR_materials_clearcoat": {"clearcoatFactor": 1, "clearcoatTexture": {"index": 4}}},
    ).gltf(path)  # fmt: skip
    load(path, limits=LoadLimits(pixels=20))
    with pytest.raises(SceneError, match=r"images\[\d\] brings the images to 80 pixels in all"):
        load(path, limits=LoadLimits(pixels=19))
    with pytest.raises(SceneError, match=r"images\[\d\]: image has 4 × 4 pixels; the limit is 15"):
        load(path, limits=LoadLimits(pixels=15))


# ---- in memory equals the file --------------------------------------------------------------------


@pytest.mark.parametrize("dressed", [False, True], ids=["plain", "material"])
def test_vertex_colors_in_memory_equal_their_glb(tmp_path, dressed):
    plane = trimesh.Trimesh(TRIANGLE, [[0, 1, 2]], process=False)
    codes = np.random.default_rng(5).integers(0, 256, (3, 4), np.uint8)
    if dressed:
        material = trimesh.visual.material.PBRMaterial(baseColorFactor=[255, 0, 51, 255], metallicFactor=0.0)
        plane.visual = trimesh.visual.TextureVisuals(material=material)
        plane.visual.vertex_attributes["color"] = codes
    else:
        plane.visual.vertex_colors = codes
    plane.export(tmp_path / "a.glb")
    (mesh,) = load_meshes(tmp_path / "a.glb")
    assert mesh.colors == pytest.approx(codes / 255)
    held = trimesh.load_scene(tmp_path / "a.glb")
    for other in (held,) if dressed else (held, held.to_mesh()):  # which drops colors beside a material
        (again,) = from_trimesh(other).shapes
        assert np.array_equal(mesh.colors, again.colors)
        assert np.array_equal(base(mesh).times, base(again).times)


def base(mesh):
    """The base color of a mesh's material."""
    (key,) = vars(mesh.material.bsdf).keys() & {"base_color", "reflectance"}
    return getattr(mesh.material.bsdf, key)


def test_the_documentation_lists_the_extensions():
    page = (Path(__file__).parents[2] / "docs" / "formats.md").read_text("utf-8")
    told = page.partition("These extensions are read: ")[2].partition(". ")[0]
    names = {name.removeprefix("KHR_materials_") for name in KNOWN}
    assert names == set(re.findall(r"\w+", told)) - {"and", "of", "the", "extensions", "KHR_materials_"}
