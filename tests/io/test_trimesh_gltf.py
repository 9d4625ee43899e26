"""What trimesh makes of glTF geometry, as docs/formats.md says: the reason why it is read here.

A failure after an update of trimesh means that it does better, and the document needs another look.
"""

import warnings

import numpy as np
import pytest
import trimesh
from gltf_builder import TRIANGLE, Builder

from wavefront.core.errors import SceneError
from wavefront.io.load import load, load_meshes

QUAD = np.float32([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]])


@pytest.fixture
def build():
    return Builder()


@pytest.fixture
def held(tmp_path):
    """Load what a builder holds by trimesh."""

    def read(build):
        path = build.gltf(tmp_path / "a.gltf")
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return trimesh.load_scene(path, process=False)

    return read


def only(scene):
    (mesh,) = scene.geometry.values()
    return mesh


@pytest.mark.parametrize("view", [True, False])
def test_sparse_accessors_lose_their_replacements(build, held, tmp_path, view):
    build.accessor(TRIANGLE)
    at, new = (
        build.view(np.array([1, 2], np.uint16).tobytes()),
        build.view(np.float32(TRIANGLE[1:] * 5).tobytes()),
    )
    item = build.json["accessors"][0]
    item["sparse"] = {
        "count": 2,
        "indices": {"bufferView": at, "componentType": 5123},
        "values": {"bufferView": new},
    }
    if not view:
        del item["bufferView"]
    mesh = only(held(build.mesh({"POSITION": 0})))
    assert np.array_equal(mesh.vertices, TRIANGLE if view else TRIANGLE * 0)
    (ours,) = load_meshes(tmp_path / "a.gltf")
    assert np.array_equal(ours.vertices, TRIANGLE * 5)


def test_normalized_integers_stay_integers(build, held, tmp_path):
    build.json["materials"] = [{}]
    positions = build.accessor(np.int16(TRIANGLE * 32767), normalized=True)
    normals = build.accessor(np.int8([[0, 0, 127]] * 3), normalized=True)
    uvs = build.accessor(np.uint16([[0, 0], [65535, 0], [0, 13107]]), normalized=True)
    attributes = {"POSITION": positions, "NORMAL": normals, "TEXCOORD_0": uvs}
    mesh = only(held(build.mesh(attributes, material=0)))
    assert mesh.vertices.max() == 32767
    assert mesh._cache.cache["vertex_normals"].max() == 127
    assert mesh.visual.uv[2].tolist() == [0, 52430]
    (ours,) = load_meshes(tmp_path / "a.gltf")
    assert np.array_equal(ours.vertices, TRIANGLE)
    assert ours.uvs[2] == pytest.approx([0, 0.8])


def test_tangents_and_second_coordinates_are_dropped(build, held, tmp_path):
    attributes = {
        "POSITION": TRIANGLE,
        "NORMAL": np.tile(np.float32([[0, 0, 1]]), (3, 1)),
        "TANGENT": np.tile(np.float32([[1, 0, 0, 1]]), (3, 1)),
        "TEXCOORD_0": TRIANGLE[:, :2],
        "TEXCOORD_1": TRIANGLE[:, :2],
    }
    mesh = only(held(build.mesh(attributes)))
    assert not mesh.vertex_attributes
    (ours,) = load_meshes(tmp_path / "a.gltf")
    assert ours.tangents is not None
    assert ours.uvs1 is not None


@pytest.mark.parametrize(
    ("colors", "codes"),
    [(np.float32([[0.123456, 0, 1]] * 3), [31, 0, 255]), (np.uint16([[300, 0, 65535]] * 3), [44, 0, 255])],
)
def test_vertex_colors_are_rounded(build, held, tmp_path, colors, codes):
    colors = build.accessor(colors, normalized=colors.dtype != np.float32)
    mesh = only(held(build.mesh({"POSITION": TRIANGLE, "COLOR_0": colors})))
    assert mesh.visual.vertex_colors[0, :3].tolist() == codes
    (ours,) = load_meshes(tmp_path / "a.gltf")
    assert ours.colors[0, 0] == pytest.approx(0.123456 if codes[0] == 31 else 300 / 65535, rel=1e-6)


def test_fans_are_dropped_and_strips_do_not_begin_anew(build, held):
    assert not held(build.mesh({"POSITION": QUAD}, np.arange(4, dtype=np.uint16), mode=6)).geometry
    again = Builder()
    indices = np.array([0, 1, 2, 65535, 1, 2, 3], np.uint16)
    assert 65535 in only(held(again.mesh({"POSITION": QUAD}, indices, mode=5))).faces


def test_instances_are_dropped(build, held, tmp_path):
    shift = build.accessor(np.float32([[0, 0, 1], [0, 0, 2]]))
    extension = {"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": shift}}}
    build.json["nodes"][0]["extensions"] = extension
    build.json["extensionsRequired"] = build.json["extensionsUsed"] = list(extension)
    assert len(held(build.mesh()).graph.nodes_geometry) == 1
    assert len(load(tmp_path / "a.gltf").shapes) == 2


def beyond(build):
    build.mesh(indices=np.array([0, 1, 9], np.uint16))


def draco(build):
    build.mesh().json["extensionsRequired"] = ["KHR_draco_mesh_compression"]


def circle(build):
    build.mesh().json["nodes"] = [{"mesh": 0, "children": [0]}]


@pytest.mark.parametrize("break_it", [beyond, draco, circle])
def test_what_is_wrong_is_read(build, held, tmp_path, break_it):
    break_it(build)
    assert len(only(held(build)).faces) == 1
    with pytest.raises(SceneError, match=r"a\.gltf: "):
        load(tmp_path / "a.gltf")


@pytest.mark.parametrize(("key", "value", "error"), [("count", 400, ValueError), ("type", "VEC9", KeyError)])
def test_errors_name_no_element(build, held, tmp_path, key, value, error):
    build.mesh().json["accessors"][0][key] = value
    with pytest.raises(error) as found:
        held(build)
    assert "accessors" not in str(found.value)
    with pytest.raises(SceneError, match=r"a\.gltf: accessors\[0\]"):
        load(tmp_path / "a.gltf")


def test_lights_and_most_cameras_are_dropped(build, held, tmp_path):
    build.json["nodes"] = [{"mesh": 0}, {"translation": [0, 0, 5], "children": [2]}, {"camera": 0}]
    build.json["nodes"][0]["extensions"] = {"KHR_lights_punctual": {"light": 0}}
    build.json["scenes"][0]["nodes"] = [0, 1]
    build.json["extensions"] = {"KHR_lights_punctual": {"lights": [{"type": "point"}]}}
    perspective = {"yfov": 0.5, "aspectRatio": 1.5, "znear": 1}
    build.json["cameras"] = [{"type": "perspective", "perspective": perspective}]
    scene = held(build.mesh())
    assert getattr(scene, "_lights", None) is None
    assert scene.camera_transform[:3, 3].tolist() == [0, 0, 0]
    ours = load(tmp_path / "a.gltf")
    assert len(ours.lights) == 1
    assert ours.camera.origin.tolist() == [0, 0, 5]
    box = {"xmag": 1, "ymag": 1, "znear": 1, "zfar": 2}
    build.json["cameras"] = [{"type": "orthographic", "orthographic": box}]
    assert not held(build).has_camera


def test_factors_are_rounded_and_extensions_dropped(build, held):
    strength = {"KHR_materials_emissive_strength": {"emissiveStrength": 10}}
    info = build.image(np.uint8([[[128, 128, 255]]])) | {"scale": 0.5}
    factor = {"baseColorFactor": [0.8, 0, 0, 1]}
    build.material(
        pbrMetallicRoughness=factor, emissiveFactor=[1, 1, 1], normalTexture=info, extensions=strength
    )
    material = only(held(build)).visual.material
    assert material.baseColorFactor[0] == 204
    assert material._data.keys() == {"baseColorFactor", "emissiveFactor", "normalTexture", "doubleSided"}
