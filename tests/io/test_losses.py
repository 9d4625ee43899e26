"""What of a file is lost: one list, and one warning of it, whoever notes it."""

from __future__ import annotations

import copy
import pickle
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from inside import Losses, warn_caller

import wavefront as wf

OBJ = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"


def noted(losses: Losses, *parts: Any, error: str = "") -> Losses:
    """Note parts in a load, which may then fail."""
    with losses:
        for part in parts:
            losses.note(*part) if isinstance(part, tuple) else losses.note(part)
        if error:
            raise wf.SceneError(error)
    return losses


def test_all_is_named_once() -> None:
    cones = [("shape 'cone'", f"in/a.pbrt line {line}", "", "left out") for line in (3, 3, 9)]
    others = [("scale", "light (spot)"), ("Kd", "in/b.mtl line 2", "1.5", "clamped")]
    with pytest.warns(UserWarning, match="3 things") as found:
        losses = noted(Losses("in/a.pbrt"), *cones, *others)
    (warning,) = found
    assert str(warning.message).splitlines() == [
        "in/a.pbrt: 3 things not as in the file:",
        "  line 3: shape 'cone'; left out (1 more)",
        "  not honored: light (spot): scale",
        "  b.mtl line 2: Kd is 1.5; clamped",
    ]
    assert warning.filename == __file__
    assert [each.place for each in losses.found] == [
        "in/a.pbrt line 3",
        "in/a.pbrt line 9",
        "in/a.pbrt: light (spot)",
        "in/a.pbrt: in/b.mtl line 2",
    ]
    assert noted(Losses("nothing")).found == ()


def test_strict_names_all_of_it() -> None:
    with pytest.raises(wf.SceneError, match=r"^a\.obj: 2 things.*\n  not honored: l\n.*p$"):
        noted(Losses("a.obj", strict=True), "l", "p")


def test_the_list_is_cut_after_ten() -> None:
    with pytest.warns(UserWarning, match="13 things") as found:
        losses = noted(Losses("a.obj"), *(f"l{number}" for number in range(13)))
    lines = str(found[0].message).splitlines()
    assert (len(lines), lines[10], lines[11]) == (12, "  not honored: l9", "  and 3 more")
    assert len(losses.found) == 13


def test_whoever_warns_within_a_load_is_on_its_list() -> None:
    def load() -> Losses:
        with Losses("a.obj") as outer:
            warn_caller("a.obj: the image is torn")
            noted(Losses("b.ply"), "x of vertex")
        return outer

    with pytest.warns(UserWarning, match="2 things") as found:
        outer = load()
    assert len(found) == 1
    assert [each.part for each in outer.found] == ["the image is torn", "b.ply: not honored: x of vertex"]


def test_an_error_says_why_nothing_is_shown() -> None:
    losses = Losses("a.obj")
    assert str(losses.nothing("has no faces")) == "a.obj: has no faces"
    losses.note("1 face of zero area", done="left out")
    assert str(losses.nothing("has no faces")) == "a.obj: has no faces: 1 face of zero area; left out"
    losses.note("l", "line 3")
    lines = str(losses.nothing("has no faces")).splitlines()
    assert lines == ["a.obj: has no faces:", "  1 face of zero area; left out", "  not honored: line 3: l"]
    with pytest.raises(wf.SceneError, match="no end"):
        noted(losses, error="a.obj: has no end")  # without a warning


def test_an_error_costs_a_part_but_where_a_limit_is_passed() -> None:
    losses = Losses("a.glb")
    with losses.part("meshes[1]", "a cube in its place"):
        raise wf.SceneError("a.glb: meshes[1]: has no name")
    assert losses.found == (wf.Loss("a.glb: meshes[1]", "has no name", done="a cube in its place"),)

    def passing() -> None:
        with losses.part("meshes[2]"):
            try:
                wf.LoadLimits(meshes=1).check_meshes("a.glb", 2)
            except wf.SceneError as error:
                raise wf.SceneError("a.glb: meshes[2]: is too large") from error

    with pytest.raises(wf.SceneError, match="too large"):
        passing()
    assert len(losses.found) == 1


@pytest.mark.parametrize(
    ("value", "low", "high", "shown"),
    [
        (1.00016, 0, 1, "is 1.00016; clamped to 1"),
        (-1e-9, 0, 1, "is -1e-09; clamped to 0"),
        (float(np.float32(np.pi / 2)), 0, np.pi / 2, "is 1.5707963705062866; clamped to 1.5707963267948966"),
        ([0.5, 1.0000001, 1], 0, 1, "is 0.5 1.0000001 1; clamped to 0.5 1 1"),
        ([3, -1], 0, np.inf, "is 3 -1; clamped to 3 0"),
    ],
)
def test_numbers_are_clamped_and_shown_with_the_digits_that_matter(value, low, high, shown) -> None:
    losses = Losses("a.glb")
    kept = losses.within("factor", value, low, high)
    assert (kept == np.clip(value, low, high)).all()
    assert [each.said("a.glb") for each in losses.found] == [f"factor {shown}"]
    losses.within("factor", kept, low, high)
    assert len(losses.found) == 1


def test_a_scene_keeps_what_its_file_lost(tmp_path: Path) -> None:
    path = tmp_path / "a.obj"
    path.write_text("mtllib m.mtl\n" + OBJ + "usemtl m\nf 1 2 2\nl 1 2\n")
    (tmp_path / "m.mtl").write_text("newmtl m\nKd 1.5 0 0\nmap_Kd no.png\n")
    with pytest.warns(UserWarning, match="4 things") as found:
        scene = wf.load(path)
    assert len(found) == 1
    assert [(each.part.partition(",")[0], each.value) for each in scene.losses] == [
        ("l", ""),
        ("texture 'no.png'", "missing"),
        ("Kd", "1.5 0 0"),
        ("1 face of zero area", ""),
    ]
    assert all(each.place.startswith(str(path)) for each in scene.losses)
    scene.add(wf.Sphere((0, 0, 0), 1))
    for other in (copy.copy(scene), copy.deepcopy(scene), pickle.loads(pickle.dumps(scene))):
        assert other.losses == scene.losses
    assert wf.Scene(scene.shapes).losses == ()
    with pytest.raises(
        wf.SceneError, match=r"4 things(.*\n.*)*no\.png' is missing(.*\n.*)*1 face of zero area"
    ):
        wf.load(path, strict=True)


@pytest.mark.parametrize("read", [wf.load, wf.load_mesh])
def test_each_way_to_read_says_it_once(tmp_path: Path, read) -> None:
    path = tmp_path / "a.stl"
    facets = [(0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 1, 0), (0, 0, 0, 0, 0, 0, 1, 0, 0, 1, 0, 0)]
    path.write_bytes(
        b"COLOR=".ljust(80) + struct.pack("<I", 2) + b"".join(struct.pack("<12fH", *f, 0) for f in facets)
    )
    with pytest.warns(
        UserWarning, match=r"2 things not as in the file:\n.*COLOR= in the header\n.*1 face of"
    ) as found:
        read(path)
    assert len(found) == 1
    assert found[0].filename == __file__
