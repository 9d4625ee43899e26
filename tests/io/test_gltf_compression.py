"""glTF: meshes that Draco or meshoptimizer compressed, where the libraries are installed, and where not."""

from __future__ import annotations

import json
import sys
from base64 import b64encode
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from gltf_builder import Builder
from inside import SceneError, claimed

import wavefront as wf

GRID = np.array([[x, y, x * y / 4] for y in range(4) for x in range(4)], np.float32)
FACES = np.array(
    [[a, a + 1, a + 5] for a in (0, 1, 2, 4, 5, 6)] + [[a, a + 5, a + 4] for a in (0, 1, 2, 4, 5, 6)],
    np.uint32,
)
COLORS = (GRID[:, :3] * 60 + 15).astype(np.uint8)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "a.gltf"


def triangles(mesh: Any, values: Any) -> Any:
    """The values at the corners of the triangles, in an order that does not depend on how they are listed."""
    found = np.round(np.asarray(values, float)[np.asarray(mesh.faces)], 3)
    return sorted(tuple(sorted(map(tuple, each.tolist()))) for each in found)


def draco(plain: bool = False) -> Any:
    """The grid, compressed; `plain` gives it without compression, too."""
    library = pytest.importorskip("DracoPy")
    data = library.encode(
        GRID,
        FACES,
        tex_coord=GRID[:, :2].astype(float) / 3,
        generic_attributes={7: COLORS},
        quantization_bits=20,
    )
    numbers = {each["attribute_type"]: each["unique_id"] for each in library.decode(data).attributes}
    build = Builder()
    build.mesh(
        {"POSITION": GRID, "TEXCOORD_0": GRID[:, :2] / np.float32(3), "COLOR_0": COLORS}, FACES.ravel()
    )
    (part,) = build.json["meshes"][0]["primitives"]
    build.json["accessors"][part["attributes"]["COLOR_0"]]["normalized"] = True
    if not plain:
        for each in build.json["accessors"]:
            del each["bufferView"]
    attributes = {"POSITION": numbers[0], "TEXCOORD_0": numbers[3], "COLOR_0": 7}
    packed = {"bufferView": build.view(data), "attributes": attributes}
    part["extensions"] = {"KHR_draco_mesh_compression": packed}
    build.json["extensionsUsed"] = build.json["extensionsRequired"] = ["KHR_draco_mesh_compression"]
    return build


def test_draco(path: Path) -> None:
    (mesh,) = wf.load(draco().gltf(path), strict=True).shapes
    assert isinstance(mesh, wf.Mesh)
    due = wf.Mesh(GRID, FACES)
    assert triangles(mesh, mesh.vertices) == triangles(due, GRID)
    assert triangles(mesh, mesh.uvs) == triangles(due, np.column_stack([GRID[:, 0] / 3, 1 - GRID[:, 1] / 3]))
    assert mesh.colors is not None
    assert triangles(mesh, mesh.colors[:, :3]) == triangles(due, COLORS / 255)


def test_a_mesh_without_compression_needs_no_library(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    build = draco(plain=True).gltf(path)
    monkeypatch.setattr("wavefront.io.gltf.meshes.find_spec", lambda name: None)
    monkeypatch.setitem(sys.modules, "DracoPy", None)
    (mesh,) = wf.load(build, strict=True).shapes
    np.testing.assert_array_equal(mesh.vertices, GRID)  # type: ignore[attr-defined]


def test_without_the_library_the_error_says_how_to_get_it(
    path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    build = draco()
    monkeypatch.setitem(sys.modules, "DracoPy", None)
    message = (
        r"KHR_draco_mesh_compression needs a library: pip install dracopy, or wavefront\[gltf\]; left out"
    )
    with pytest.raises(SceneError, match=message):
        wf.load(build.gltf(path))
    build.mesh()
    build.json["nodes"].append({"mesh": 1})
    build.json["scenes"][0]["nodes"] = [0, 1]
    with pytest.warns(UserWarning, match=message):
        assert len(wf.load(build.gltf(path)).shapes) == 1


@pytest.mark.parametrize("damage", ["cut", "header", "claim", "attribute"])
def test_damaged_draco_costs_its_mesh(path: Path, damage: str) -> None:
    build = draco()
    (part,) = build.json["meshes"][0]["primitives"]
    packed = part["extensions"]["KHR_draco_mesh_compression"]
    view = build.json["bufferViews"][packed["bufferView"]]
    if damage == "cut":
        view["byteLength"] -= 40
    elif damage == "header":
        view["byteOffset"] += 4
        view["byteLength"] -= 4
    elif damage == "attribute":
        packed["attributes"]["POSITION"] = 99
    else:  # 2³⁵ faces in a few bytes
        at = view["byteOffset"]
        build.binary = build.binary[: at + 12] + b"\xff\xff\xff\xff\x7f" * 2 + build.binary[at + 22 :]
    with pytest.raises(
        SceneError, match="LoadLimits.memory_bytes" if damage == "claim" else "KHR_draco.*left out"
    ):
        wf.load(build.gltf(path))


def test_the_header_of_draco_is_read_past_its_metadata() -> None:
    library = pytest.importorskip("DracoPy")
    given = {"preserve_order": True, "create_metadata": True, "generic_attributes": {"heat": GRID}}
    assert claimed(library.encode(GRID, FACES, **given)) == (len(FACES), len(GRID))
    for data in (b"", b"DRACO" + bytes(20), b"DRACO\x02\x02\x01\x00\x00\x00" + b"\xff" * 3):
        with pytest.raises(SceneError, match="KHR_draco_mesh_compression"):
            claimed(data)


def packed_view(build: Any, data: bytes, count: int, stride: int, mode: str, kind: str = "NONE") -> int:
    """Add a buffer view that is compressed, and has no other bytes."""
    inner = build.json["bufferViews"][build.view(data)]
    extension = {
        "buffer": 0, "byteOffset": inner["byteOffset"], "byteLength": inner["byteLength"],
        "byteStride": stride, "count": count, "mode": mode, "filter": kind,
    }  # fmt: skip
    view = {"buffer": 1, "byteLength": count * stride, "extensions": {"EXT_meshopt_compression": extension}}
    build.json["bufferViews"].append(view)
    return len(build.json["bufferViews"]) - 1


def meshopt(path: Path) -> Path:
    """The grid with normals, by three modes and the filter of normals."""
    library = pytest.importorskip("meshopt")
    build = Builder()
    normals = np.zeros((len(GRID), 4), np.float32)
    normals[:, 2] = 1
    places = packed_view(build, library.encode_gltf_buffer(GRID, "ATTRIBUTES"), len(GRID), 12, "ATTRIBUTES")
    coded = library.encode_gltf_buffer(library.encode_filter_oct(normals, 4, 8), "ATTRIBUTES")
    octahedral = packed_view(build, coded, len(GRID), 4, "ATTRIBUTES", "OCTAHEDRAL")
    corners = packed_view(
        build, library.encode_gltf_buffer(FACES.ravel(), "TRIANGLES"), FACES.size, 4, "TRIANGLES"
    )
    build.mesh({"POSITION": GRID, "NORMAL": GRID}, FACES.ravel())
    for number, (view, kind) in enumerate(((places, 5126), (octahedral, 5120), (corners, 5125))):
        build.json["accessors"][number] |= {"bufferView": view, "componentType": kind}
    build.json["accessors"][1]["normalized"] = True
    build.json["extensionsUsed"] = ["EXT_meshopt_compression"]
    text = json.loads(build.gltf(path).read_text())
    text["buffers"].append(
        {"byteLength": 1000, "extensions": {"EXT_meshopt_compression": {"fallback": True}}}
    )
    path.write_text(json.dumps(text))
    return path


def test_meshopt(path: Path) -> None:
    (mesh,) = wf.load(meshopt(path), strict=True).shapes
    assert isinstance(mesh, wf.Mesh)
    assert triangles(mesh, mesh.vertices) == triangles(wf.Mesh(GRID, FACES), GRID)
    np.testing.assert_allclose(mesh.normals, np.tile([0, 0, 1], (len(GRID), 1)), atol=0.01)


def test_without_meshopt_the_error_says_how_to_get_it(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    meshopt(path)
    monkeypatch.setitem(sys.modules, "meshopt", None)
    monkeypatch.setattr("wavefront.io.gltf.document.find_spec", lambda name: None)
    message = r"EXT_meshopt_compression needs a library: pip install meshopt, or wavefront\[gltf\]; left out"
    with pytest.raises(SceneError, match=message):
        wf.load(path)
    text = json.loads(path.read_text())
    for view, values in zip(
        text["bufferViews"][1::2], (GRID, np.tile(np.int8([0, 0, 127, 0]), (16, 1)), FACES), strict=False
    ):
        text["buffers"].append(
            {"byteLength": values.nbytes, "uri": "data:;base64," + b64encode(values.tobytes()).decode()}
        )
        view["buffer"] = len(text["buffers"]) - 1
    path.write_text(json.dumps(text))
    (mesh,) = wf.load(path, strict=True).shapes  # from the bytes that are there uncompressed
    np.testing.assert_array_equal(mesh.vertices, GRID)  # type: ignore[attr-defined]


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("mode", "LINES", "has the mode 'LINES'"),
        ("filter", "SQUARE", "the filter 'SQUARE', which there is not"),
        ("byteLength", 9, "EXT_meshopt_compression: "),
        ("byteStride", 7, "EXT_meshopt_compression: a row must be 4 to 256 bytes"),
        ("count", 2**40, r"LoadLimits\.memory_bytes"),
        ("count", -1, r"count is -1; it must be a whole number"),
    ],
)
def test_damaged_meshopt_costs_its_mesh(path: Path, key: str, value: Any, message: str) -> None:
    meshopt(path)
    text = json.loads(path.read_text())
    text["bufferViews"][1]["extensions"]["EXT_meshopt_compression"][key] = value
    path.write_text(json.dumps(text))
    with pytest.raises(SceneError, match=message):
        wf.load(path)
