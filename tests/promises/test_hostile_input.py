"""Bad input, row by row: what must never happen, and what happens instead.

Each test holds one row of the table below. Files are loaded in a process of its own, with 3 GB of memory
and 25 s for each: a typed error that names the file, or the right mesh; never a hang, a kill, a bare
IndexError or a silent change. Other test modules hold the same rows in more detail; they are in brackets.

| input | test |
|---|---|
| NaN or infinite vertex, or beyond float32 | vertices (test_load.py) |
| OBJ face index 0 or too large | indices (test_load.py) |
| short lines, truncated file | short lines (test_load.py) |
| zero-area face | zero area, test_faces_without_area_are_in_no_table_of_lights |
| empty mesh, empty scene | empty, test_an_empty_scene |
| duplicate or coplanar faces | test_ties_go_to_the_lowest_primitive (test_coplanar.py) |
| scene × 1e6, × 1e-6, 1e5 sizes away | test_size_and_place_change_rounding_only (test_scale.py) |
| camera inside geometry or glass | test_a_camera_inside |
| size 0, spp 0, NaN in arguments | test_bad_arguments_are_named_before_any_work (test_render.py) |
| albedo, IOR, roughness out of range | test_bsdfs.py, test_an_ior_of_1_or_less |
| light of zero area | test_a_light_without_area |
| missing texture | missing texture (test_load_mtl.py, test_load_gltf.py) |
| corrupt, truncated or huge texture | textures (test_images.py) |
| paths out of the folder, FIFO, device, URI | outside (test_load_limits.py) |
| counts beyond the file | counts (test_load.py) |
| archives | archives (test_load_formats.py) |
| encodings, file names | encodings (test_load.py) |
"""

from __future__ import annotations

import gzip
import io
import json
import os
import struct
import subprocess
import sys
import tempfile
import warnings
import zipfile
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from gltf_builder import Builder
from inside import ACCELERATORS
from significance import render

import wavefront as wf

MEMORY, SECONDS = 3 << 30, 25
POINTS = "v 0 0 0\nv 1 0 0\nv 0 1 0\n"
FACE = POINTS + "f 1 2 3\n"
TEXTURED = "mtllib s.mtl\n" + POINTS + "vt 0 0\nvt 1 0\nvt 0 1\nusemtl m\nf 1/1 2/2 3/3\n"
OK = ""  # what is expected of a file that loads; otherwise a pattern of the error

Write = Callable[[Path], Path]


def text(content: str, name: str = "a.obj", encoding: str = "utf-8") -> Write:
    """Write one file."""
    return binary(content.encode(encoding), name)


def binary(content: bytes, name: str) -> Write:
    """Write one file."""

    def write(folder: Path) -> Path:
        (folder / name).write_bytes(content)
        return folder / name

    return write


def textured(make: Callable[[Path], object], name: str = "t.png") -> Write:
    """Write an OBJ file with a material and its texture, which `make` is called for."""

    def write(folder: Path) -> Path:
        (folder / "a.obj").write_text(TEXTURED)
        (folder / "s.mtl").write_text(f"newmtl m\nmap_Kd {name}\n")
        make(folder / Path(name).name)
        return folder / "a.obj"

    return write


def gltf(change: Callable[[dict[str, Any]], object]) -> Write:
    """Write a triangle as glTF, after a change to its JSON."""

    def write(folder: Path) -> Path:
        path = folder / "a.gltf"
        Builder().mesh().gltf(path)
        document = json.loads(path.read_text())
        change(document)
        path.write_text(json.dumps(document))
        return path

    return write


def png(width: int, height: int, data: bytes) -> bytes:
    """Return a png of RGB values with any header."""

    def chunk(kind: bytes, content: bytes) -> bytes:
        return (
            struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))
        )

    header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    return (
        b"\x89PNG\r\n\x1a\n"
        + chunk(b"IHDR", header)
        + chunk(b"IDAT", zlib.compress(data))
        + chunk(b"IEND", b"")
    )


def outside(target: str) -> Callable[[Path], object]:
    """Link the texture to something that is not in the folder."""
    return lambda path: os.symlink(target, path)


def npy(shape: tuple[int, ...]) -> bytes:
    """Return the header of an array of this shape, and next to no data."""
    buffer = io.BytesIO()
    np.lib.format.write_array_header_1_0(buffer, {"descr": "<f4", "fortran_order": False, "shape": shape})
    return buffer.getvalue() + bytes(16)


def archive() -> bytes:
    """Return a zip file that holds a mesh."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as file:
        file.writestr("a.obj", FACE)
    return buffer.getvalue()


PLY = "ply\nformat {} 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\n"
PLY += "element face {}\nproperty list uchar int vertex_indices\nend_header\n"
PLY_BODY = np.float32([0, 0, 0, 1, 0, 0, 0, 1, 0]).tobytes() + b"\3" + np.int32([0, 1, 2]).tobytes()
STL_FACET = np.float32([0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0]).tobytes() + b"\0\0"
SOUND_PNG = png(2, 2, bytes(14))
LATIN = "# caf\xe9\n" + FACE

CASES: dict[str, dict[str, tuple[Write, str]]] = {
    "vertices": {
        f"{value} in {kind}": (write, "vertex that is not finite|finite|has no faces")
        for value in ("nan", "inf", "-inf", "1e39", "1e400")
        for kind, write in {
            "obj": text(FACE.replace("v 1 0 0", f"v {value} 0 0")),
            "ply": text(PLY.format("ascii", 3, 1) + f"0 0 0\n{value} 0 0\n0 1 0\n3 0 1 2\n", "a.ply"),
            "off": text(f"OFF\n3 1 0\n0 0 0\n{value} 0 0\n0 1 0\n3 0 1 2\n", "a.off"),
            "stl": text(
                f"solid\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex {value} 0 0\nvertex 0 1 0\n"
                "endloop\nendfacet\nendsolid\n",
                "a.stl",
            ),
        }.items()
    },
    "indices": {
        "0": (text(POINTS + "f 0 1 2\n"), r"line 4: f is '0 1 2'; left out, as there is no v 0"),
        "too large": (text(POINTS + "f 1 2 4\n"), r"line 4: f is .*; left out, as there is no v 4"),
        "too small": (text(POINTS + "f 1 2 -4\n"), r"line 4: f is .*; left out, as there is no v -4"),
        "huge": (
            text(POINTS + "f 1 2 9999999999999999999\n"),
            r"line 4: f is .*; left out, as there is no v 9999999999999999999",
        ),
        "ply": (
            binary(PLY.format("binary_little_endian", 3, 1).encode() + PLY_BODY[:-4] + b"\3\0\0\0", "a.ply"),
            r"a\.ply: has no faces: 1 row of face with a vertex beyond the 3",
        ),
        "gltf": (gltf(lambda json: json["accessors"][0].update(count=2)), r"a\.gltf: .*(index|indices|3)"),
        "off": (
            text("OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 3\n", "a.off"),
            r"a\.off: has no faces: 1 row of face with a vertex beyond the 3",
        ),
    },
    "short lines": {
        "v": (text(FACE.replace("v 1 0 0", "v 1 0")), r"a\.obj: line 2: v is '1 0'; 0 in place of the rest"),
        "f": (text(POINTS + "f 1 2\n"), r"a\.obj: has no faces: line 4: f is '1 2'; left out"),
        "no faces": (text("vn 0 0 1\n"), r"a\.obj: has no faces"),
        "ply": (
            text(PLY.format("ascii", 3, 1) + "0 0 0\n1 0\n0 1 0\n3 0 1 2\n", "a.ply"),
            "1 row of vertex with too few or malformed words, first: line 11",
        ),
        "truncated ply": (
            text(PLY.format("ascii", 3, 1) + "0 0 0\n1 0 0\n", "a.ply"),
            "the last 1 row of vertex; missing",
        ),
        "truncated stl": (
            text("solid\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\n", "a.stl"),
            "facet is 1 vertex; left out",
        ),
        "truncated binary stl": (
            binary(bytes(80) + struct.pack("<I", 2) + STL_FACET, "a.stl"),
            "the number of facets is 2, but the file has 134 bytes; 1 read",
        ),
        "truncated glb": (binary(b"glTF" + struct.pack("<II", 2, 500) + bytes(40), "a.glb"), r"a\.glb"),
        "truncated gltf": (text('{"asset": {"version": "2.0"}, "meshes": [', "a.gltf"), r"a\.gltf: .*JSON"),
    },
    "zero area": {
        "a line": (text(FACE.replace("v 0 1 0", "v 2 0 0")), "of zero area|has no faces"),
        "a point": (text(POINTS + "f 1 1 1\n"), "of zero area|has no faces"),
        "beside a sound one": (text(FACE + "f 1 1 2\n"), "1 face of zero area|zero area"),
    },
    "empty": {
        "file": (binary(b"", "a.obj"), r"a\.obj: is empty"),
        "ply": (binary(b"", "a.ply"), r"a\.ply: is empty"),
        "stl": (binary(bytes(84), "a.stl"), r"a\.stl.*no faces|a\.stl"),
        "gltf": (text('{"asset": {"version": "2.0"}}', "a.gltf"), r"a\.gltf: .*no faces"),
        "off": (text("OFF\n0 0 0\n", "a.off"), r"a\.off"),
    },
    "missing texture": {
        "mtl": (textured(lambda path: None), r"s\.mtl line 2: map_Kd: texture 't\.png' is missing"),
        "library": (text("mtllib no.mtl\n" + FACE), r"material file 'no\.mtl' is missing"),
    },
    "textures": {
        "corrupt": (
            textured(lambda path: path.write_bytes(b"not a picture")),
            r"t\.png: not a readable image",
        ),
        "truncated": (
            textured(lambda path: path.write_bytes(SOUND_PNG[:45])),
            r"t\.png: (ends early|not a readable)",
        ),
        "empty": (textured(lambda path: path.write_bytes(b"")), r"t\.png"),
        "bomb": (
            textured(lambda path: path.write_bytes(png(30000, 30000, bytes(10**6)))),
            r"t\.png: image has 30000 × 30000 pixels; the limit is 134217728",
        ),
        "claims more than it has": (
            textured(lambda path: path.write_bytes(png(10000, 10000, bytes(10**4)))),
            r"t\.png: ends early: 10000 × 10000 pixels take \d+ bytes; 10000 are there",
        ),
        "hdr bomb": (
            textured(
                lambda path: path.write_bytes(b"#?RADIANCE\n\n-Y 11000 +X 11000\n" + bytes(99)), "t.hdr"
            ),
            r"t\.hdr: (ends early|holds)",
        ),
        "npy bomb": (textured(lambda path: path.write_bytes(npy((30000, 30000, 3))), "t.npy"), r"t\.npy"),
        "npy of petabytes": (
            textured(lambda path: path.write_bytes(npy((10**8, 10**7))), "t.npy"),
            r"t\.npy",
        ),
    },
    "outside": {
        "..": (text("mtllib ../s.mtl\n" + FACE), r"refers to '\.\./s\.mtl', which is outside its folder"),
        "absolute": (text("mtllib /etc/passwd\n" + FACE), "an absolute path is not followed"),
        "symlink": (textured(outside("/etc/passwd")), "which is outside its folder"),
        "device": (textured(outside("/dev/zero")), "which is outside its folder"),
        "fifo": (textured(lambda path: os.mkfifo(path)), r"t\.png: is a device or pipe"),
        "folder": (textured(lambda path: path.mkdir()), r"t\.png: is a folder"),
        "scene is a fifo": (
            lambda folder: (os.mkfifo(folder / "a.obj"), folder / "a.obj")[1],
            "device or pipe",
        ),
        "scene is a device": (
            lambda folder: (os.symlink("/dev/zero", folder / "a.obj"), folder / "a.obj")[1],
            "device or pipe",
        ),
        "http": (
            text("mtllib http://127.0.0.1/s.mtl\n" + FACE),
            "only files in its folder and the search paths are read",
        ),
        "gltf": (
            gltf(lambda json: json["buffers"][0].update(uri="../a.bin")),
            r"a\.gltf: .*refers to '\.\./a\.bin', which is outside",
        ),
        "gltf, coded": (
            gltf(lambda json: json["buffers"][0].update(uri="%2e%2e/a.bin")),
            "outside its folder",
        ),
        "gltf, http": (
            gltf(lambda json: json["buffers"][0].update(uri="https://a.b/c")),
            "only files in its folder",
        ),
    },
    "counts": {
        "ply": (
            binary(PLY.format("binary_little_endian", 3, 2 * 10**9).encode() + PLY_BODY, "a.ply"),
            "the last 1999999999 rows of face; missing, as the file ends before",
        ),
        "ply vertices": (
            binary(PLY.format("binary_little_endian", 10**15, 1).encode() + PLY_BODY, "a.ply"),
            r"a\.ply: has no faces:\s+the last \d+ rows of vertex; missing",
        ),
        "ply list": (
            binary(
                PLY.format("binary_little_endian", 3, 1).encode() + PLY_BODY[:36] + b"\xff" + PLY_BODY[37:],
                "a.ply",
            ),
            r"a\.ply",
        ),
        "stl": (
            binary(bytes(80) + struct.pack("<I", 2**32 - 1) + STL_FACET, "a.stl"),
            "the number of facets is 4294967295, but the file has 134 bytes; 1 read",
        ),
        "off": (text("OFF\n3 2000000000 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n", "a.off"), r"a\.off"),
        "gltf": (gltf(lambda json: json["accessors"][0].update(count=10**9)), r"a\.gltf: accessors\[0\]"),
        "gltf buffer": (
            gltf(lambda json: json["buffers"][0].update(byteLength=10**12)),
            r"a\.gltf: buffers\[0\]",
        ),
        "glb": (
            binary(b"glTF" + struct.pack("<IIII", 2, 2**32 - 1, 2**32 - 1, 0x4E4F534A), "a.glb"),
            r"a\.glb",
        ),
    },
    "archives": {
        **{
            f"zip as {extension}": (binary(archive(), f"a.{extension}"), "is an archive; unpack it first")
            for extension in ("obj", "ply", "stl", "glb", "gltf", "off", "dae")
        },
        "gzip": (binary(gzip.compress(FACE.encode()), "a.obj"), "is an archive; unpack it first"),
        "zip": (binary(archive(), "a.zip"), r"a\.zip: extension is '\.zip'"),
        "npz as a texture": (
            textured(lambda path: path.write_bytes(archive()), "t.npz"),
            "archives are not read",
        ),
    },
    "encodings": {
        "utf-8": (text(LATIN), OK),
        "latin-1": (text(LATIN, encoding="latin-1"), OK),
        "utf-16": (text(LATIN, encoding="utf-16"), OK),
        "byte order mark": (text(LATIN, encoding="utf-8-sig"), OK),
        "line ends": (text(FACE.replace("\n", "\r\n")), OK),
        "name": (text(FACE, "caf\xe9 \u6f22.obj"), OK),
        "name that is not utf-8": (text(FACE, os.fsdecode(b"a\xff\xfe.obj")), OK),
        "null bytes": (text(FACE + "\0\0\0"), OK),
    },
}


def outcome(write: Write, folder: Path) -> list[str]:
    """Load a file with `strict` and without; return the errors, or "" where it is the right triangle."""
    folder.mkdir()
    path, found = write(folder), []
    for strict in (True, False):
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("error")
                warnings.simplefilter("ignore", UserWarning)  # repairs are announced
                scene = wf.load(path, strict=strict)
            (shape,) = scene.shapes
            right = shape.vertices[shape.faces].tolist() == [[[0, 0, 0], [1, 0, 0], [0, 1, 0]]]
            found.append("" if right else f"the mesh is {shape.vertices.tolist()}, {shape.faces.tolist()}")
        except wf.SceneError as error:
            found.append(str(error))
    return found


def main() -> None:
    """Load the files of all cases, and print the outcomes as JSON."""
    import resource
    import signal

    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    found: dict[str, list[str]] = {}
    with tempfile.TemporaryDirectory() as name:
        for row, cases in CASES.items():
            for number, (case, (write, _)) in enumerate(cases.items()):
                signal.alarm(SECONDS)
                found[f"{row}: {case}"] = outcome(write, Path(name, f"{row}{number}"))
    print(json.dumps(found))


@pytest.fixture(scope="module")
def outcomes() -> dict[str, list[str]]:
    """The outcomes of all cases, in a process of their own."""
    done = subprocess.run([sys.executable, __file__], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[-3000:]
    found: dict[str, list[str]] = json.loads(done.stdout)
    print(f"{len(found)} hostile files, each loaded twice")
    return found


# rows where a file may load without `strict`, though not where a limit of `LoadLimits` is passed
REPAIRED = (
    "vertices",
    "zero area",
    "missing texture",
    "textures",
    "outside",
    "archives",
    "short lines",
    "counts",
)
LIMITS = ("bomb",)


@pytest.mark.skipif(sys.platform != "linux", reason="memory limits as Linux has them")
@pytest.mark.parametrize("row", CASES)
def test_files(row: str, outcomes: dict[str, list[str]]) -> None:
    import re

    for case, (_, expected) in CASES[row].items():
        strict, lenient = outcomes[f"{row}: {case}"]
        if expected == OK:
            assert (strict, lenient) == ("", ""), case
            continue
        assert re.search(expected, strict), f"{case}: {strict}"
        repaired = lenient == "" and row in REPAIRED and case not in LIMITS
        assert repaired or re.search(expected, lenient), f"{case}: {lenient}"


def test_repairs_are_counted(tmp_path: Path) -> None:
    path = text(FACE + "f 1 1 2\nv nan 0 0\nf 1 2 4\n")(tmp_path)
    with pytest.warns(UserWarning, match="face") as found:
        (shape,) = wf.load(path).shapes
    assert isinstance(shape, wf.Mesh)
    assert len(shape.faces) == 1
    messages = " ".join(str(each.message) for each in found)
    assert "1 face of zero area" in messages
    assert "1 face with a vertex that is not finite" in messages


def test_faces_without_area_are_in_no_table_of_lights(tmp_path: Path) -> None:
    """An emitting mesh of a file has a light for each face with an area."""
    (tmp_path / "s.mtl").write_text("newmtl m\nKe 5 5 5\n")
    path = text("mtllib s.mtl\nusemtl m\n" + FACE + "f 1 1 2\nf 1 2 2\n")(tmp_path)
    with pytest.warns(UserWarning, match="2 faces of zero area"):
        scene = wf.load(path)
    camera = wf.Camera.look_at((0.3, 0.3, 2), (0.3, 0.3, 0), size=(8, 8))
    image = render(scene, 4, camera=camera)
    assert image.metadata["bad_samples"] == 0
    assert image.rgb.max() == pytest.approx(5)


@pytest.mark.parametrize("make", [lambda: wf.Scene([]), lambda: wf.Mesh(np.zeros((0, 3)), [])])
def test_an_empty_scene(make: Callable[[], Any]) -> None:
    with pytest.raises(wf.SceneError, match=r"no shapes|no faces|must have shape|nothing|empty"):
        render(make(), 1)


@pytest.mark.parametrize("accel", ["numpy", "embree", "brute_force"])
def test_ties_go_to_the_lowest_primitive(accel: str) -> None:
    if accel not in ACCELERATORS:
        pytest.skip(f"no accelerator {accel!r}")
    if accel == "embree":
        pytest.importorskip("embreex")
    corners = np.array([[-2, -2, 0], [2, -2, 0], [2, 2, 0], [-2, 2, 0]])
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    camera = wf.Camera.look_at((0.1, 0.2, 3), (0, 0, 0), fov=30, size=(16, 16))
    colors = (0.2, 0.9, 0.5)
    meshes = [
        wf.Mesh(corners, faces[::order, turn], emission=color, two_sided=True)
        for color, turn, order in zip(colors, ([0, 1, 2], [1, 2, 0], [2, 1, 0]), (1, -1, 1), strict=True)
    ]
    for order in ((0, 1, 2), (2, 1, 0), (1, 0, 2)):
        scene = wf.Scene([meshes[i] for i in order], camera=camera)
        image = render(scene, 4, accel=accel, max_bounces=0)
        assert np.unique(image.rgb).tolist() == [np.float32(colors[order[0]])]
    twice = wf.Mesh(corners, np.concatenate([faces] * 3), emission=0.4)
    assert np.unique(render(wf.Scene(twice, camera=camera), 4, accel=accel).rgb).tolist() == [np.float32(0.4)]


def room(size: float = 1.0, offset: float = 0.0) -> wf.Scene:
    """A floor, a glossy ball and a light, of any size and at any distance from the origin."""
    at = np.array([offset, -offset, offset]) * size
    floor = wf.Rectangle(at + np.array([-2, -1, -2]) * size, (0, 0, 4 * size), (4 * size, 0, 0))
    ball = wf.Sphere(at, size, material=wf.Principled(0.7, 0.3, 0.4))
    lamp = wf.Rectangle(
        at + np.array([-1, 3, -1]) * size,
        (2 * size, 0, 0),
        (0, 0, 2 * size),
        emission=4,
        material=wf.Diffuse(0),
    )
    camera = wf.Camera.look_at(at + np.array([0, 1.5, 6]) * size, at, fov=40, size=(16, 16))
    return wf.Scene([floor, ball, lamp], camera=camera)


@pytest.mark.parametrize(
    ("size", "offset"), [(1e6, 0), (1e-6, 0), (1, 1e5), (1e6, 1e5), (1e-6, 1e5), (1, -3e5)]
)
def test_size_and_place_change_rounding_only(size: float, offset: float) -> None:
    """A few paths in 16 384 may go elsewhere."""
    unit, image = (render(scene, 64, max_bounces=4).rgb for scene in (room(), room(size, offset)))
    off = np.abs(image - unit) / (unit + 0.01)
    assert np.median(off) < 1e-4
    assert image.mean() == pytest.approx(unit.mean(), rel=0.005)


@pytest.mark.parametrize(
    "material",
    [
        wf.Diffuse(0.5),
        wf.Dielectric(1.5),
        wf.Mirror(0.9),
        wf.ThinDielectric(1.5),
        wf.Principled(0.5, 0.3, 0.2),
    ],
    ids=lambda material: type(material).__name__,
)
@pytest.mark.parametrize("where", ["middle", "surface"])
def test_a_camera_inside(material: wf.Bsdf, where: str) -> None:
    """A finite picture, from within a ball and a box, and from their surfaces."""
    box = [[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
    sides = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    faces = [[q[0], q[1], q[2]] for q in sides] + [[q[0], q[2], q[3]] for q in sides]
    eye = (0, 0, 0) if where == "middle" else (0, 0, 1)
    camera = wf.Camera.look_at(eye, (0.3, 0.2, -1), size=(16, 16))
    for shape in (wf.Sphere((0, 0, 0), 1, material=material), wf.Mesh(box, faces, material=material)):
        with warnings.catch_warnings():
            warnings.filterwarnings(
                "ignore", "the picture is", UserWarning
            )  # black, inside of what is opaque
            image = render(wf.Scene(shape, [wf.Environment(1.0), wf.PointLight((0, 3, 0), 5)], camera), 16)
        assert np.isfinite(image.rgb).all()
        assert image.metadata["bad_samples"] == 0


def test_an_ior_of_1_or_less() -> None:
    """1 renders straight through, less than 1 is valid."""
    camera = wf.Camera.look_at((0, 0, 4), (0, 0, 0), size=(16, 16))
    behind = wf.Rectangle((-9, -9, -3), (18, 0, 0), (0, 18, 0), emission=0.6, material=wf.Diffuse(0))
    clear = render(
        wf.Scene([behind, wf.Sphere((0, 0, 0), 1, material=wf.Dielectric(1.0))], camera=camera), 16
    )
    assert clear.rgb == pytest.approx(0.6, rel=1e-5)
    less = render(wf.Scene([behind, wf.Sphere((0, 0, 0), 1, material=wf.Dielectric(0.7))], camera=camera), 16)
    assert np.isfinite(less.rgb).all()
    assert less.rgb.max() > 0.1


@pytest.mark.parametrize(
    "make",
    [
        lambda: wf.Rectangle((0, 0, 0), (1, 0, 0), (2, 0, 0), emission=1),
        lambda: wf.Sphere((0, 0, 0), 0, emission=1),
    ],
)
def test_a_light_without_area(make: Callable[[], Any]) -> None:
    """It cannot shine."""
    with pytest.raises(wf.SceneError, match=r"area|radius|parallel"):
        render(wf.Scene(make(), camera=wf.Camera.look_at((0, 0, 4), (0, 0, 0), size=(8, 8))), 1)


if __name__ == "__main__":
    main()
