"""Every value of a glTF file may be anything: it loads, or the error names the file and the element."""

import copy
import json
import random
import warnings

import numpy as np
import pytest
from gltf_builder import TRIANGLE, Builder
from inside import SceneError, load

VALUES = (
    None, True, -1, 0, 1, 3, 1.5, 1e39, -1e39, 1e200, 1e308, 1e-320, float("nan"), float("inf"), 2**31,
    10**18, 10**400, "x", "", "VEC3", [], [[]], {}, [1] * 16, {"a": 1},
)  # fmt: skip


def everything(path):
    """Write a file with everything that is read, and return its JSON."""
    build = Builder()
    move = {"offset": [0, 0], "scale": [1, 1], "rotation": 0.1, "texCoord": 0}
    info = build.image(np.zeros((2, 2, 4), np.uint8))
    info |= {"texCoord": 0, "extensions": {"KHR_texture_transform": move}}
    build.json["samplers"] = [{"wrapS": 10497, "wrapT": 33071, "magFilter": 9729, "minFilter": 9987}]
    build.json["textures"][0]["sampler"] = 0
    build.json["materials"] = [
        {
            "name": "m",
            "pbrMetallicRoughness": {
                "baseColorFactor": [1, 0.5, 0.2, 0.9],
                "baseColorTexture": info,
                "metallicFactor": 0.5,
                "roughnessFactor": 0.4,
                "metallicRoughnessTexture": info,
            },
            "normalTexture": info | {"scale": 0.5},
            "emissiveFactor": [1, 0, 0],
            "emissiveTexture": info,
            "alphaMode": "MASK",
            "alphaCutoff": 0.4,
            "doubleSided": True,
            "extensions": {
                "KHR_materials_ior": {"ior": 1.4},
                "KHR_materials_transmission": {"transmissionFactor": 0.5, "transmissionTexture": info},
                "KHR_materials_volume": {
                    "thicknessFactor": 1,
                    "attenuationColor": [0.5, 1, 1],
                    "attenuationDistance": 2,
                },
                "KHR_materials_clearcoat": {"clearcoatFactor": 0.5, "clearcoatRoughnessFactor": 0.1},
                "KHR_materials_sheen": {"sheenColorFactor": [0.1, 0.2, 0.3], "sheenRoughnessFactor": 0.4},
                "KHR_materials_specular": {"specularFactor": 0.5, "specularColorFactor": [1, 1, 0.5]},
                "KHR_materials_emissive_strength": {"emissiveStrength": 2},
            },
        },
        {
            "alphaMode": "BLEND",
            "extensions": {
                "KHR_materials_pbrSpecularGlossiness": {
                    "diffuseFactor": [1, 1, 1, 0.5],
                    "diffuseTexture": info,
                    "specularFactor": [0.1, 0.2, 0.3],
                    "glossinessFactor": 0.3,
                    "specularGlossinessTexture": info,
                }
            },
        },
    ]
    build.json["extensionsUsed"] = ["KHR_lights_punctual"]
    build.json["extensionsRequired"] = ["KHR_texture_transform"]
    attributes = {
        "POSITION": TRIANGLE,
        "NORMAL": np.tile(np.float32([[0, 0, 1]]), (3, 1)),
        "TANGENT": np.tile(np.float32([[1, 0, 0, 1]]), (3, 1)),
        "TEXCOORD_0": TRIANGLE[:, :2],
        "TEXCOORD_1": TRIANGLE[:, :2],
        "COLOR_0": np.full((3, 4), 0.5, np.float32),
        "JOINTS_0": np.array([[0, 1, 0, 0]] * 3, np.uint8),
        "WEIGHTS_0": np.array([[0.75, 0.25, 0, 0]] * 3, np.float32),
    }
    build.mesh(attributes, np.array([0, 1, 2], np.uint16), material=0)
    part = build.json["meshes"][0]["primitives"][0]
    part["targets"] = [{"POSITION": build.accessor(TRIANGLE), "NORMAL": build.accessor(TRIANGLE)}]
    build.json["meshes"][0]["weights"] = [0.5]
    inverse = build.accessor(np.array([np.eye(4).ravel()] * 2, np.float32))
    build.json["skins"] = [{"joints": [3, 4], "inverseBindMatrices": inverse}]
    build.json["accessors"][0]["sparse"] = {
        "count": 1,
        "indices": {"bufferView": build.view(np.array([2], np.uint16).tobytes()), "componentType": 5123},
        "values": {"bufferView": build.view(np.float32([[0, 2, 0]]).tobytes())},
    }
    build.mesh({"POSITION": 0}, np.array([0, 1, 2, 2], np.uint8), material=1, mode=5)
    shift = build.accessor(np.float32([[0, 0, 1], [0, 0, 2]]))
    build.json["cameras"] = [
        {"type": "perspective", "perspective": {"yfov": 0.5, "aspectRatio": 1.5, "znear": 0.1}},
        {"type": "orthographic", "orthographic": {"xmag": 1, "ymag": 2, "znear": 0, "zfar": 9}},
    ]
    lights = [
        {"type": "point", "color": [1, 1, 1], "intensity": 3, "range": 5},
        {"type": "spot", "spot": {"innerConeAngle": 0.1, "outerConeAngle": 0.5}},
        {"type": "directional", "intensity": 1},
    ]
    build.json["extensions"] = {"KHR_lights_punctual": {"lights": lights}}
    light = [{"KHR_lights_punctual": {"light": i}} for i in range(3)]
    instancing = {"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": shift}}}
    build.json["nodes"] = [
        {"children": [1, 2, 3, 4, 5], "matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 3, 1]},
        {"mesh": 0, "translation": [1, 0, 0], "rotation": [0, 0, 0.6, 0.8], "scale": [1, 2, 1], "name": "a"},
        {"mesh": 1, "extensions": instancing},
        {"camera": 1, "extensions": light[0]},
        {"camera": 0, "extensions": light[1]},
        {"mesh": 0, "extensions": light[2], "skin": 0},
    ]
    return json.loads(build.gltf(path).read_text())


def places(value, at=()):
    """Yield the keys that lead to every value."""
    if at:
        yield at
    for key in value if isinstance(value, dict) else range(len(value)) if isinstance(value, list) else ():
        yield from places(value[key], (*at, key))


def changed(document, at, value):
    """Return a copy with another value at a place."""
    document = copy.deepcopy(document)
    parent = document
    for key in at[:-1]:
        parent = parent[key]
    parent[at[-1]] = value
    return document


@pytest.mark.parametrize("share", [0.008, pytest.param(1, marks=pytest.mark.slow)])
def test_wrong_values(share, tmp_path):
    path = tmp_path / "a.gltf"
    document = everything(path)
    rng = random.Random(0)
    loaded, refused = 0, []
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warnings.simplefilter("ignore", UserWarning)  # repairs are announced
        load(path)
        for at in places(document):
            for value in VALUES:
                if rng.random() > share:
                    continue
                path.write_text(json.dumps(changed(document, at, value)))
                try:
                    load(path)
                    loaded += 1
                except SceneError as error:
                    refused.append((at, value, str(error)))
                except Exception as error:
                    raise AssertionError(f"{at} = {value!r}: {error!r}") from error
    assert loaded > 0
    assert len(refused) > loaded / 50
    for at, value, message in refused:
        rest = message.removeprefix(f"{path}: ")
        assert rest != message, f"{at} = {value!r}: {message}"
        assert "the file is malformed" not in rest, f"{at} = {value!r}: {message}"
        assert max(map(len, rest.split("\n"))) < 300
