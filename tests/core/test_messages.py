"""Messages are short and printable, whatever the files and arguments hold that they quote."""

from __future__ import annotations

import contextlib
import io
import pickle
from pathlib import Path

import numpy as np
import pytest
from inside import plain, warn_caller, write_image

import wavefront as wf

LONG = "x" * 1_000_000
ESCAPE = "\x1b[31m\x07\x9b\u202e"


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("a.obj", f"v 0 0 {LONG}\n"),
        ("a.obj", f"mtllib ../{LONG}\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"),
        ("a.obj", f"v 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl {LONG}\nf 1 2 4\n"),
        ("a.off", f"OFF\n3 1 0\n0 0 {LONG}\n1 0 0\n0 1 0\n3 0 1 2\n"),
        ("a.ply", f"ply\nformat ascii 1.0\nelement {LONG}\nend_header\n"),
        ("a.stl", f"solid\nvertex 0 0 {LONG}\nendsolid\n"),
        ("a.gltf", '{"asset": {"version": "2.0"}, "nodes": [{"mesh": "' + LONG + '"}]}'),
    ],
)
def test_errors_of_files_are_short(tmp_path: Path, name: str, text: str) -> None:
    """A megabyte in a line; the message, an error or a warning, has both of its ends."""
    (tmp_path / name).write_text(text)
    with pytest.raises((wf.SceneError, UserWarning), match=rf"{name}") as error:
        wf.load(tmp_path / name)
    assert len(str(error.value)) <= 2100


def test_errors_of_arguments_and_warnings_are_short() -> None:
    for call in (
        lambda: wf.Camera.look_at((0, 0, 1), (0, 0, 0), up=LONG),
        lambda: wf.render([wf.Sphere((0, 0, 0), 1)], integrator=LONG),
        lambda: wf.load(LONG[:100_000] + ".obj"),
    ):
        with pytest.raises(wf.SceneError) as error:
            call()
        assert len(str(error.value)) <= 2100
    with pytest.warns(UserWarning, match="x") as found:
        warn_caller(f"begin {LONG} end")
    message = str(found[0].message)
    assert len(message) < 2100
    assert message.startswith("begin x")
    assert message.endswith("x end")


def test_errors_of_every_type_are_printable() -> None:
    """They keep their types, and can be sent between processes."""
    for kind in (wf.SceneError, wf.SaveError, wf.RenderError, wf.Interrupted):
        error = kind(f"a{ESCAPE}\nb")
        assert str(error) == "a\\x1b[31m\\x07\\x9b\\u202e\nb"
        again = pickle.loads(pickle.dumps(error))
        assert type(again) is kind
        assert str(again) == str(error)
    assert plain("π × ½ “é” 漢") == "π × ½ “é” 漢"


def test_names_of_files_are_printable(tmp_path: Path) -> None:
    """Of shapes, materials and files: an escape sequence could steer the terminal."""
    (tmp_path / "s.mtl").write_text(f"newmtl m{ESCAPE}\nKd 1 0 0\n")
    path = tmp_path / f"a{ESCAPE}.obj"
    path.write_text(f"mtllib s.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl m{ESCAPE}\nf 1 2 3\n")
    (shape,) = wf.load(path).shapes
    expected = "m\\x1b[31m\\x07\\x9b\\u202e"
    assert (shape.name, shape.material.name) == (expected, expected)
    path.write_text("v 0 0 0\nf 1 2 3\n")
    with pytest.raises(wf.SceneError, match=r"a\\x1b\[31m.*\.obj: has no faces: line 2: ") as error:
        wf.load(path)
    assert str(error.value).isprintable()


def test_names_of_gltf_are_printable(tmp_path: Path) -> None:
    import trimesh

    box = trimesh.creation.box()
    scene = trimesh.Scene()
    scene.add_geometry(box, node_name=f"n{ESCAPE}", geom_name=f"g{ESCAPE}")
    scene.export(tmp_path / "a.glb")
    (shape,) = wf.load(tmp_path / "a.glb").shapes
    assert shape.name.isprintable()
    assert "\\x1b" in shape.name


def test_a_damaged_exr_prints_nothing(tmp_path: Path) -> None:
    """OpenEXR prints a warning in place of raising an error."""
    path = tmp_path / "a.exr"
    write_image(path, np.tile(np.linspace(0, 1, 64)[:, None, None], (1, 64, 3)))
    data = bytearray(path.read_bytes())
    for place in range(len(data) - 80, len(data) - 20):
        data[place] ^= 0x55
    path.write_bytes(data)
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed), pytest.raises(wf.SceneError, match=r"a\.exr: part 0"):
        wf.Image.load(path)
    assert printed.getvalue() == ""
