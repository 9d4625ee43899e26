"""Which files a scene file may read, and how large they may be."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

import wavefront as wf
from wavefront.codecs.images import write_image
from wavefront.io import obj
from wavefront.io.load import load_meshes
from wavefront.io.sources import SceneFiles

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
    """Without one it is missing."""
    with pytest.warns(UserWarning, match=r"texture 't\.png' is missing"):
        wf.load(scene)
    shared = scene.parents[1] / "shared"
    for paths in (shared, str(shared), [shared], (str(scene.parent), shared)):
        assert is_textured(wf.load(scene, search_paths=paths).shapes[0])
    mesh = wf.load_mesh(scene, search_paths=shared)
    assert is_textured(mesh)


def test_the_scene_s_own_folder_comes_first(scene: Path) -> None:
    """And then the search paths, in their order."""
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
    """Its own folder counts first for it."""
    shared = scene.parents[1] / "shared"
    scene.with_name("s.mtl").rename(shared / "s.mtl")
    (mesh,) = load_meshes(scene, search_paths=shared, strict=True)
    assert is_textured(mesh)


def test_a_library_below_may_refer_to_images_of_the_scene(scene: Path) -> None:
    """The root is the folder of the scene file."""
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
    """The error names the file that refers, and the reference."""
    for paths in ((), (scene.parents[1] / "third",)):
        for each in paths:
            each.mkdir()
        with pytest.raises(wf.SceneError, match=message):
            SceneFiles(scene, paths).find(name)


def test_symbolic_links_are_followed_within_the_folders_only(scene: Path) -> None:
    """A link to a search path is fine."""
    shared = scene.parents[1] / "shared"
    os.symlink(shared / "t.png", scene.with_name("t.png"))
    with pytest.raises(
        wf.SceneError, match=r"s\.mtl line 2: map_Kd: .*s\.mtl: refers to 't\.png', which is outside"
    ):
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
        with pytest.raises(
            wf.SceneError, match=r"has 80 triangles; the limit is 79 \(LoadLimits\.triangles\)"
        ):
            wf.load(path, limits=wf.LoadLimits(triangles=79))
        with pytest.raises(wf.SceneError, match="has 80 triangles"):
            wf.load_mesh(path, limits=wf.LoadLimits(triangles=79))


@pytest.mark.parametrize("extension", ["png", "jpg", "exr", "hdr", "npy"])
def test_textures_of_the_users_own_take_a_limit(tmp_path: Path, extension: str) -> None:
    """In every format."""
    path = tmp_path / f"t.{extension}"
    write_image(path, np.full((9, 11, 3), 0.5))
    assert wf.Texture(path, max_pixels=99).size == (11, 9)
    with pytest.raises(wf.SceneError, match=r"image has 11 × 9 pixels; the limit is 98"):
        wf.Texture(path, max_pixels=98)


@pytest.mark.parametrize("name", ["file_bytes", "pixels", "triangles", "instances", "unpacked_bytes"])
@pytest.mark.parametrize("value", [0, -1, 1.5, "9", True, None, float("inf")])
def test_limits_are_whole_numbers(name: str, value: Any) -> None:
    """Of at least 1."""
    with pytest.raises(
        wf.SceneError, match=f"LoadLimits {name} is .*; it must be a whole number of at least 1"
    ):
        wf.LoadLimits(**{name: value})


def test_limits_are_limits(scene: Path) -> None:
    """And nothing else."""
    with pytest.raises(wf.SceneError, match=r"limits is 5; it must be a wf\.LoadLimits"):
        wf.load(scene, limits=5)  # type: ignore[arg-type]


def test_many_materials_are_few_meshes_for_trimesh(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its time grows with the square of their number. Each material gets its own faces, whatever their form."""
    rng = np.random.default_rng(7)
    points, texels = rng.random((300, 3)).round(6), rng.random((300, 2)).round(6)
    text = ["v {} {} {}".format(*point) for point in points] + ["vt {} {}".format(*texel) for texel in texels]
    expected: dict[str, tuple[list[int], bool]] = {}
    for number in range(400):
        width, textured = 3 + number % 2, number % 3 == 0
        corners = rng.choice(300, width, replace=False)
        # an index that counts back, in some
        words = [str(i - 300 if number % 5 == 0 else i + 1) for i in corners]
        text += [f"usemtl m{number}", "f " + " ".join(f"{w}/{w}" if textured else w for w in words)]
        order = corners[[0, 1, 2]] if width == 3 else corners[[0, 1, 2, 2, 3, 0]]
        expected[f"m{number}"] = (order.tolist(), textured)
    seen = []
    whole = obj.geometries
    monkeypatch.setattr(obj, "geometries", lambda *args: seen.append(whole(*args)) or seen[-1])
    raws = obj.parse("a.obj", "\n".join(text)).raws
    assert len(seen[0]) == 4
    assert [raw.name for raw in raws] == list(expected)
    for raw in raws:
        order, textured = expected[raw.name]
        assert len(raw.vertices) == len(set(order))
        assert np.array_equal(raw.vertices[raw.faces].reshape(-1, 3), points[order])
        assert (raw.uvs is not None) == textured
        if textured:
            assert np.array_equal(raw.uvs[raw.faces].reshape(-1, 2), texels[order])
