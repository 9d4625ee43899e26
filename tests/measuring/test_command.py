"""The command `wavefront measure`."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from inside import main

import wavefront as wf

OBJ = "v -1 -1 0\nv 1 -1 0\nv 0 1 0\nf 1 2 3\n"
GRID = "-1,-1,0:2,0,0:0,2,0:3x2"
SETTINGS = ["--lighting", "studio", "--spp", "8", "--quiet", "--workers", "1"]


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    (tmp_path / "scene.obj").write_text(OBJ)
    (tmp_path / "points.csv").write_text("x,y,z,nx,ny,nz\n0,0,1,0,0,-1\n1,1,1,0,0,1\n")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_a_grid_becomes_a_table(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["measure", "scene.obj", "--grid", GRID, *SETTINGS]) == 0
    said = capsys.readouterr().out
    assert said.startswith("out.csv: irradiance at 6 points, estimated error ")
    table = np.genfromtxt("out.csv", delimiter=",", names=True)
    points, normals = wf.grid_points((-1, -1, 0), (2, 0, 0), (0, 2, 0), (3, 2))
    found = wf.measure("scene.obj", points, normals, spp=8, lighting="studio", progress=False)
    assert (table["g"].astype(np.float32) == found.value[:, 1]).all()
    assert (table["lux"].astype(np.float32) == found.lux).all()
    assert (table["lux_error"].astype(np.float32) == found.lux_error).all()
    assert f"{found.lux.max():.3g} lux" in said or f"{found.lux.max():.0f} lux" in said
    assert (np.stack([table[axis] for axis in "xyz"], 1) == points).all()


@pytest.mark.parametrize(
    ("options", "kind", "normals"),
    [
        ([], "irradiance", [(0, 0, -1), (0, 0, 1)]),
        (["--normal", "-1,0,0"], "irradiance", (-1, 0, 0)),
        (["--kind", "fluence"], "fluence", None),
        (["--kind", "radiance"], "radiance", [(0, 0, -1), (0, 0, 1)]),
    ],
)
def test_points_of_a_file(options: list[str], kind: str, normals: object) -> None:
    assert main(["measure", "scene.obj", "--points", "points.csv", "-o", "out.npz", *options, *SETTINGS]) == 0
    found = wf.Measurement.load("out.npz")
    points = [(0, 0, 1), (1, 1, 1)]
    settings = {"kind": kind, "spp": 8, "lighting": "studio", "progress": False}
    assert found.value.tobytes() == wf.measure("scene.obj", points, normals, **settings).value.tobytes()


def test_a_checkpoint_goes_on_from_another_folder(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    command = ["measure", "scene.obj", "--points", "points.csv", *SETTINGS]
    assert main([*command, "--checkpoint", "a.wfck"]) == 0
    expected = (folder / "out.csv").read_bytes()
    (folder / "out.csv").unlink()
    monkeypatch.chdir("/")
    assert main(["resume", str(folder / "a.wfck")]) == 0
    assert (folder / "out.csv").read_bytes() == expected


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--points", "points.csv", "--size", "4x4"], "size is (4, 4); sensors are at the points"),
        (["--points", "none.csv"], "none.csv: there is no such file"),
        (["--grid", "0,0,0:1,0,0:2x2"], "'0,0,0:1,0,0:2x2' is not CORNER:EDGE:EDGE:NxM"),
        (["--points", "points.csv", "-o", "out.png"], "out.png: a measurement is saved as npz or csv"),
        ([], "scene.obj: has no sensor that measures light; give points by --grid or --points"),
    ],
)
def test_wrong_options_are_named(
    options: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    try:
        status = main(["measure", "scene.obj", *options])
    except SystemExit as error:
        status = error.code
    assert status == 2
    assert message in capsys.readouterr().err
    assert {each.name for each in Path().iterdir()} == {"scene.obj", "points.csv"}
