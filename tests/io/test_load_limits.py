"""Which files a scene file may read, and how large they may be."""

from __future__ import annotations

import json
import os
import struct
import tracemalloc
import zlib
from collections.abc import Callable
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from inside import Losses, SceneFiles, load_meshes, obj, write_image

import wavefront as wf

OBJ = "mtllib {library}\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nusemtl m\nf 1/1 2/2 3/3\n"


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    """A scene folder, and a folder of textures and materials beside it."""
    home, other = tmp_path / "scene", tmp_path / "shared"
    home.mkdir()
    other.mkdir()
    write_image(other / "t.png", np.full((4, 4, 3), 0.5))
    (home / "a.obj").write_text(OBJ.format(library="s.mtl"))
    (home / "s.mtl").write_text("newmtl m\nmap_Kd t.png\n")
    return home / "a.obj"


def is_textured(shape: Any) -> bool:
    """Return whether a parameter of a shape's material is a texture."""
    return any(isinstance(value, wf.Texture) for value in vars(shape.material.bsdf).values())


def test_a_texture_is_found_in_a_search_path(scene: Path) -> None:
    with pytest.warns(UserWarning, match=r"texture 't\.png' is missing"):
        wf.load(scene)
    shared = scene.parents[1] / "shared"
    for paths in (shared, str(shared), [shared], (str(scene.parent), shared)):
        assert is_textured(wf.load(scene, search_paths=paths).shapes[0])
    mesh = wf.load_mesh(scene, search_paths=shared)
    assert is_textured(mesh)


def test_the_scene_s_own_folder_comes_first(scene: Path) -> None:
    shared, third = scene.parents[1] / "shared", scene.parents[1] / "third"
    third.mkdir()
    (third / "t.png").write_bytes(b"x")
    (third / "own.png").write_bytes(b"x")
    files = SceneFiles(scene, (shared, third))
    assert files.find("t.png") == shared / "t.png"
    assert files.find("own.png") == third / "own.png"
    (scene.parent / "t.png").write_bytes(b"x")
    assert files.find("t.png") == scene.parent / "t.png"
    assert files.find("no.png") == scene.parent / "no.png"


def test_a_library_in_a_search_path_may_refer_to_images_beside_it(scene: Path) -> None:
    shared = scene.parents[1] / "shared"
    scene.with_name("s.mtl").rename(shared / "s.mtl")
    (mesh,) = load_meshes(scene, search_paths=shared, strict=True)
    assert is_textured(mesh)


def test_a_library_below_may_refer_to_images_of_the_scene(scene: Path) -> None:
    folder = scene.with_name("materials")
    folder.mkdir()
    scene.with_name("s.mtl").unlink()
    (scene.parents[1] / "shared" / "t.png").rename(scene.with_name("t.png"))
    (folder / "s.mtl").write_text("newmtl m\nmap_Kd ../t.png\n")
    scene.write_text(OBJ.format(library="materials/s.mtl"))
    (mesh,) = load_meshes(scene, strict=True)
    assert is_textured(mesh)


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("../shared/t.png", "outside its folder"),
        ("../../../../etc/passwd", "outside its folder"),
        ("..\\shared\\t.png", "outside its folder"),
        ("/etc/passwd", "an absolute path is not followed"),
        ("C:/t.png", "an absolute path is not followed"),
        ("C:\\t.png", "an absolute path is not followed"),
        ("http://example.org/t.png", "only files in its folder and the search paths are read"),
        ("HTTPS:t.png", "only files in its folder and the search paths are read"),
        ("file:///etc/passwd", "only files in its folder and the search paths are read"),
        ("ftp://example.org/t.png", "only files in its folder and the search paths are read"),
        ("t.npz", "archives are not read"),
        ("t.ZIP", "archives are not read"),
        ("a\0b.png", "embedded null|refers to"),
    ],
)
def test_references_that_are_not_followed(scene: Path, name: str, message: str) -> None:
    for paths in ((), (scene.parents[1] / "third",)):
        for each in paths:
            each.mkdir()
        with pytest.raises(wf.SceneError, match=message):
            SceneFiles(scene, paths).find(name)


def test_symbolic_links_are_followed_within_the_folders_only(scene: Path) -> None:
    """A link to a search path is fine."""
    shared = scene.parents[1] / "shared"
    os.symlink(shared / "t.png", scene.with_name("t.png"))
    message = r"s\.mtl line 2: map_Kd: texture 't\.png': s\.mtl: refers to 't\.png', which is outside"
    with pytest.warns(UserWarning, match=message):
        wf.load(scene)
    wf.load(scene, search_paths=shared, strict=True)


@pytest.mark.parametrize("name", ["missing", "scene/a.obj"])
def test_search_paths_must_be_folders(scene: Path, name: str) -> None:
    """They are checked before the file is read."""
    with pytest.raises(wf.SceneError, match=r"search_paths: .* is not a folder"):
        wf.load("no such file.obj", search_paths=[scene.parents[1] / name])


def test_each_limit_can_be_lowered_and_raised(scene: Path, tmp_path: Path) -> None:
    """The file and its images: what one pixel or byte less refuses, the limit itself lets through."""
    shared = scene.parents[1] / "shared"
    wf.load(scene, search_paths=shared, limits=wf.LoadLimits(pixels=16))
    with pytest.raises(wf.SceneError, match=r"map_Kd: .*t\.png: image has 4 × 4 pixels; the limit is 15"):
        wf.load(scene, search_paths=shared, limits=wf.LoadLimits(pixels=15))
    size = max(file.stat().st_size for file in (scene, scene.with_name("s.mtl"), shared / "t.png"))
    wf.load(scene, search_paths=shared, limits=wf.LoadLimits(file_bytes=size))
    with pytest.raises(wf.SceneError, match=rf"has {size} bytes; the limit is {size - 1}"):
        wf.load(scene, search_paths=shared, limits=wf.LoadLimits(file_bytes=size - 1))
    ball = trimesh.creation.icosphere(1)
    for extension in ("obj", "ply", "stl", "glb", "off"):
        path = tmp_path / f"ball.{extension}"
        ball.export(path)
        assert wf.load(path, limits=wf.LoadLimits(triangles=80)).shapes
        with pytest.raises(wf.SceneError, match=r"has 80 triangles"):
            wf.load(path, limits=wf.LoadLimits(triangles=79))
        with pytest.raises(wf.SceneError, match="has 80 triangles"):
            wf.load_mesh(path, limits=wf.LoadLimits(triangles=79))


@pytest.mark.parametrize("extension", ["png", "jpg", "exr", "hdr", "npy"])
def test_textures_of_the_users_own_take_a_limit(tmp_path: Path, extension: str) -> None:
    path = tmp_path / f"t.{extension}"
    write_image(path, np.full((9, 11, 3), 0.5))
    assert wf.Texture(path, max_pixels=99).size == (11, 9)
    with pytest.raises(wf.SceneError, match=r"image has 11 × 9 pixels; the limit is 98"):
        wf.Texture(path, max_pixels=98)


@pytest.mark.parametrize("name", [field.name for field in fields(wf.LoadLimits)])
@pytest.mark.parametrize("value", [0, 1.5, "9", True])
def test_limits_are_whole_numbers(name: str, value: Any) -> None:
    with pytest.raises(wf.SceneError, match=f"LoadLimits {name} is .*"):
        wf.LoadLimits(**{name: value})


def test_limits_are_limits(scene: Path) -> None:
    with pytest.raises(wf.SceneError, match=r"limits is 5; it must be a wf\.LoadLimits"):
        wf.load(scene, limits=5)  # type: ignore[arg-type]


def test_many_materials_are_few_meshes_for_trimesh(calls_of: Callable[..., Any]) -> None:
    """Its time grows with the square of their number. Each material gets its own faces."""
    rng = np.random.default_rng(7)
    turns = np.arange(300) * np.pi / 150
    points = np.stack([np.cos(turns), np.sin(turns), 0 * turns], 1).round(6)
    texels = rng.random((300, 2)).round(6)
    text = ["v {} {} {}".format(*point) for point in points] + ["vt {} {}".format(*texel) for texel in texels]
    expected: dict[str, tuple[list[int], bool]] = {}
    for number in range(400):
        width, textured = 3 + number % 2, number % 3 == 0
        corners = np.sort(rng.choice(300, width, replace=False))  # convex
        # an index that counts back, in some
        words = [str(i - 300 if number % 5 == 0 else i + 1) for i in corners]
        text += [f"usemtl m{number}", "f " + " ".join(f"{w}/{w}" if textured else w for w in words)]
        order = corners[[0, 1, 2]] if width == 3 else corners[[0, 1, 2, 2, 3, 0]]
        expected[f"m{number}"] = (order.tolist(), textured)
    seen = calls_of("wavefront.io.obj.geometries")
    raws = obj.parse(Losses("a.obj"), "\n".join(text)).raws
    assert len(seen[0].result) == 4
    assert [raw.name for raw in raws] == list(expected)
    for raw in raws:
        order, textured = expected[raw.name]
        assert len(raw.vertices) == len(set(order))
        assert np.array_equal(raw.vertices[raw.faces].reshape(-1, 3), points[order])
        assert (raw.uvs is not None) == textured
        if textured:
            assert np.array_equal(raw.uvs[raw.faces].reshape(-1, 2), texels[order])


def png(width: int, height: int, bits: int, color: int) -> bytes:
    """Return a png whose pixels are all 0, deflated as far as possible."""

    def chunk(kind: bytes, content: bytes) -> bytes:
        check = zlib.crc32(kind + content)
        return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", check)

    deflate = zlib.compressobj(9)
    row = bytes(1 + (width * bits * (3 if color == 2 else 1) + 7) // 8)
    rows = b"".join(deflate.compress(row) for _ in range(height)) + deflate.flush()
    header = struct.pack(">IIBBBBB", width, height, bits, color, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", rows) + chunk(b"IEND", b"")


def test_memory_of_accessors_is_checked_before_it_is_taken(tmp_path: Path) -> None:
    """Two hundred bytes of glTF can claim gigabytes of zeros."""
    count = 89_478_483
    position = {"componentType": 5126, "count": count, "type": "VEC3"}
    document = {
        "asset": {"version": "2.0"},
        "accessors": [position],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
        "nodes": [{"mesh": 0}],
    }
    path = tmp_path / "zeros.gltf"
    path.write_text(json.dumps(document))
    message = (
        r"zeros\.gltf: accessors\[0\] takes 5368708980 bytes of memory; the limit is 21\d+ .*memory_bytes"
    )
    tracemalloc.start()
    with pytest.raises(wf.SceneError, match=message):
        wf.load(path)
    assert tracemalloc.get_traced_memory()[1] < 2**24
    tracemalloc.stop()
    position["count"] = 30_000
    path.write_text(json.dumps(document))
    budget = 30_000 * 3 * 20 - 128 * path.stat().st_size
    with pytest.raises(wf.SceneError, match=rf"the limit is {30_000 * 60 - 1} "):
        wf.load(path, limits=wf.LoadLimits(memory_bytes=budget - 1))
    with pytest.raises(wf.SceneError, match=r"has no faces: .* of zero area"):
        wf.load(path, limits=wf.LoadLimits(memory_bytes=budget))


def test_memory_of_pictures_is_checked_before_it_is_taken(tmp_path: Path) -> None:
    """16 kB of png have 2^27 pixels. As codes they are a texture; as colors they are refused."""
    path = tmp_path / "zeros.png"
    path.write_bytes(png(16384, 8192, 1, 0))
    assert path.stat().st_size < 20_000
    message = r"zeros\.png.* bytes of memory, which makes \d+ in all; the limit is 21\d+ "
    for load in (wf.Image.load, wf.Environment):
        with pytest.raises(wf.SceneError, match=message):
            load(path)


def test_images_of_a_scene_share_its_budget_and_are_read_once(
    scene: Path, calls_of: Callable[..., Any]
) -> None:
    names = [scene.with_name(f"{letter}.png") for letter in "tu"]
    for name in names:
        name.write_bytes(png(256, 256, 8, 2))
    library = scene.with_name("s.mtl")
    library.write_text("".join(f"newmtl m{i}\nmap_Kd {'tu'[i // 4]}.png\n" for i in range(8)))
    faces = "".join(f"usemtl m{i}\nf 1/1 2/2 3/3\n" for i in range(8))
    scene.write_text(OBJ.format(library="s.mtl").partition("usemtl")[0] + faces)
    allowed = 128 * sum(file.stat().st_size for file in (scene, library, *names))
    need = 2 * 256 * 256 * 3 * 2
    assert need > allowed
    message = rf"map_Kd: .*u\.png: .* takes 393216 bytes of memory, which makes {need} in all"
    with pytest.raises(wf.SceneError, match=message):
        wf.load(scene, limits=wf.LoadLimits(memory_bytes=need - allowed - 1))
    read = calls_of("wavefront.io.sources.read_codes")
    assert len(wf.load(scene, limits=wf.LoadLimits(memory_bytes=need - allowed)).shapes) == 8
    assert [call.args[0] for call in read] == names


def test_the_number_of_meshes_is_limited(tmp_path: Path) -> None:
    path = tmp_path / "a.obj"
    library = "".join(f"newmtl m{i}\n" for i in range(5))
    (tmp_path / "s.mtl").write_text(library)
    faces = "".join(f"usemtl m{i}\nf 1 2 3\n" for i in range(5))
    path.write_text("mtllib s.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\n" + faces)
    trimesh.Scene([trimesh.creation.box() for _ in range(5)]).export(tmp_path / "a.glb")
    for each in (path, tmp_path / "a.glb"):
        assert len(wf.load(each, limits=wf.LoadLimits(meshes=5)).shapes) == 5
        with pytest.raises(wf.SceneError, match=r"has 5 meshes; the limit is 4 \(LoadLimits\.meshes\)"):
            wf.load(each, limits=wf.LoadLimits(meshes=4))


def test_where_memory_runs_out_the_file_and_its_size_are_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: Any, **__: Any) -> None:
        raise MemoryError("Unable to allocate 9 GiB")

    path = tmp_path / "a.png"
    write_image(path, np.full((4, 4, 3), 0.5))
    mesh = tmp_path / "a.obj"
    mesh.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    size = f"a.png: has {path.stat().st_size} bytes, and what it holds does not fit in memory: Unable"
    for where, call, named in (
        ("wavefront.codecs.images.codes_to_linear", lambda: wf.Image.load(path), size),
        ("wavefront.codecs.raster._png", lambda: wf.Image.load(path), size),
        ("wavefront.lights.environment.ImageEnvironment.of", lambda: wf.Environment(path), size),
        ("wavefront.io.description.contents.place_shapes", lambda: wf.load(mesh), "a.obj: has 32 bytes"),
        ("wavefront.io.obj.geometries", lambda: wf.load(mesh), "a.obj: has 32 bytes"),
    ):
        with monkeypatch.context() as patch:
            patch.setattr(where, full)
            with pytest.raises(wf.SceneError, match=named):
                call()
