"""The commands as a user runs them: exit codes, messages of one line, examples that work."""

import re
import shlex
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path
from types import SimpleNamespace

import imageio.v3 as iio
import numpy as np
import pytest
from inside import EXTRAS, doctor_command, joined
from scripts import write_mesh

import wavefront as wf
from wavefront import cli

ROOT = Path(__file__).parents[2]
DOCUMENT = (ROOT / "docs" / "command_line.md").read_text("utf-8")
TETRAHEDRON = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n"
FAST = ["--spp", "1", "--size", "16x12", "--lighting", "even", "--quiet"]
FOR_DEVELOPERS = {"all", "test", "dev", "docs", "bench"}


def program(*arguments: object, cwd: Path | None = None) -> subprocess.CompletedProcess[str]:
    """Run the program as a user does."""
    command = [sys.executable, "-m", "wavefront", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=120, cwd=cwd)


@pytest.fixture
def run(monkeypatch, capsys):
    """Run a command in this process, in the folder of the meshes."""

    def run_command(*arguments: object, cwd: Path | None = None) -> SimpleNamespace:
        if cwd is not None:
            monkeypatch.chdir(cwd)
        try:
            status = cli.main([str(each) for each in arguments])
        except SystemExit as stop:  # argparse
            status = stop.code
        out, err = capsys.readouterr()
        return SimpleNamespace(returncode=status, stdout=out, stderr=err)

    return run_command


def commands() -> dict[str, object]:
    (found,) = cli.parser()._subparsers._group_actions
    return found.choices


@pytest.fixture
def mesh(tmp_path: Path) -> Path:
    path = tmp_path / "mesh.obj"
    path.write_text(TETRAHEDRON)
    return path


@pytest.mark.parametrize("name", commands())
def test_help_has_examples_that_are_valid(name: str) -> None:
    examples = commands()[name].epilog.removeprefix("examples:\n").splitlines()
    assert examples
    for example in examples:
        program, *words = shlex.split(example.split(" > ")[0])
        assert (program, words[0]) == ("wavefront", name)
        cli.parser().parse_args(joined(words))
    assert f"| `{name}` |" in DOCUMENT


def test_help_and_the_document_name_the_exit_codes(run) -> None:
    done = run("--help")
    assert done.returncode == 0
    for code in ("0", "1", "2", "129", "130", "143"):
        assert re.search(rf"\b{code}\b", " ".join(done.stdout.split()).split("Exit status:")[1])
        assert f"\n| {code} |" in DOCUMENT


def check_error(status: int, out: str, err: str, message: str) -> None:
    assert (status, out) == (2, "")
    assert err.startswith("wavefront")
    assert message in err
    assert err.count("\n") == 1


def test_the_program_runs_and_fails_as_its_commands(tmp_path: Path) -> None:
    mesh = tmp_path / "mesh.ply"
    write_mesh(mesh, ((0, 0, 0), (1, 0, 0), (0, 1, 0)), ((0, 1, 2),))
    assert program("render", mesh, "-o", mesh.with_name("a.png"), *FAST).returncode == 0
    done = program("render", mesh, "--spp", "0", "--quiet", cwd=mesh.parent)
    check_error(done.returncode, done.stdout, done.stderr, "spp is 0")
    assert sorted(path.name for path in mesh.parent.iterdir()) == ["a.png", "mesh.ply"]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ([], "the following arguments are required: command; see wavefront --help"),
        (["rendr"], "invalid choice: 'rendr'"),
        (["render", "mesh.obj", "--bogus"], "unrecognized arguments: --bogus"),
        (["render", "no.obj"], "no.obj: there is no such file"),
        (["render", "mesh.obj", "-o", "no/out.png"], "no/out.png: the folder"),
        (["turntable", "mesh.obj", "--frames", "0", "--quiet"], "'0' is not a whole number from 1 on"),
        (["dataset", "mesh.obj", "-o", "set", "--object", "x", "--quiet"], "objects has 'x'"),
        (["dataset", "mesh.obj", "-o", "set", "--format", "kitti", "--quiet"], "give at least two times"),
        (["dataset", "mesh.obj", "-o", "set", "--times", "0,x", "--quiet"], "'0,x'"),
        (["merge", "mesh.obj", "-o", "out.npz"], "mesh.obj: extension is '.obj'"),
        (["resume", "mesh.obj"], "mesh.obj: "),
        (["compare", "a.png", "b.png"], "a.png: there is no such file"),
        (["doctor", "--seconds", "x"], "invalid float value: 'x'"),
        (["completion", "cmd"], "invalid choice: 'cmd'"),
    ],
)
def test_errors_are_one_line_and_give_2(mesh, run, arguments, message) -> None:
    done = run(*arguments, cwd=mesh.parent)
    check_error(done.returncode, done.stdout, done.stderr, message)
    assert [path.name for path in mesh.parent.iterdir()] == ["mesh.obj"]


@pytest.mark.parametrize(
    ("error", "status", "text"),
    [
        (wf.RenderError("two\nlines"), 2, "error: two lines"),
        (MemoryError(), 2, "error: out of memory"),
        (wf.Interrupted("stopped by Ctrl-C"), 130, "stopped by Ctrl-C"),
    ],
)
def test_how_renders_fail_in_any_command(mesh, fails, capsys, error, status, text) -> None:
    fails("wavefront.cli.view_commands.save_animation", error)
    assert cli.main(["turntable", str(mesh), "-o", str(mesh.with_suffix(".gif")), *FAST]) == status
    assert capsys.readouterr().err == f"wavefront: {text}\n"


def test_several_scenes_are_rendered_into_a_folder(mesh: Path, run) -> None:
    other = shutil.copy(mesh, mesh.with_name("other.obj"))
    done = run("render", mesh.name, "other.obj", "-o", "out/", *FAST, cwd=mesh.parent)
    assert (done.returncode, done.stderr) == (0, "")
    assert [line.split(":")[0] for line in done.stdout.splitlines()] == ["out/mesh.png", "out/other.png"]
    assert cli.main(["render", str(other), "-o", str(mesh.with_name("alone.png")), *FAST]) == 0
    pictures = [mesh.parent / name for name in ("out/mesh.png", "out/other.png", "alone.png")]
    assert len({path.read_bytes() for path in pictures}) == 1


def test_a_path_may_have_a_place_for_the_name(mesh: Path) -> None:
    output = str(mesh.parent / "layers" / "{}_view.exr")
    assert cli.main(["render", str(mesh), "-o", output, "--aov", "depth", *FAST]) == 0
    assert "depth" in wf.Image.load(mesh.parent / "layers" / "mesh_view.exr").layers


def test_a_scene_that_fails_does_not_stop_the_others(mesh: Path, capsys) -> None:
    scenes = [str(mesh.with_name("missing.obj")), str(mesh)]
    assert cli.main(["render", *scenes, "-o", str(mesh.parent / "out") + "/", *FAST]) == 2
    out, err = capsys.readouterr()
    assert (out.count("\n"), err.count("\n")) == (1, 1)
    assert "missing.obj: there is no such file" in err
    assert [path.name for path in (mesh.parent / "out").iterdir()] == ["mesh.png"]


@pytest.mark.parametrize(
    ("scenes", "options", "message"),
    [
        (("a.obj", "b.obj"), ["-o", "out.png"], "out.png: is one path for the pictures of 2 scenes"),
        (("a.obj", "b.png"), [], "b.png: is a picture in the place of a scene; -o b.png writes one"),
        (("a.obj", "x/a.ply"), ["-o", "."], "a.png: is the picture of a.obj and of x/a.ply"),
        (("a.obj", "b.obj"), ["-o", ".", "--checkpoint", "a.wfck"], "--checkpoint is for one scene"),
        (("a.obj", "b.obj"), ["-o", "{}.bmp"], "a.bmp: extension is '.bmp'"),
    ],
)
def test_where_several_pictures_cannot_go(scenes, options, message, tmp_path, monkeypatch, capsys) -> None:
    monkeypatch.chdir(tmp_path)
    assert cli.main(["render", *scenes, *options]) == 2
    assert message in capsys.readouterr().err


def test_a_scene_is_shown_with_the_options_of_a_render(mesh: Path, calls_of, monkeypatch, capsys) -> None:
    shown = calls_of("wavefront.cli.render_command.view", lambda scene, **settings: None)
    monkeypatch.chdir(mesh.parent)
    words = ["render", mesh.name, "--show", "--origin", "3,3,3", "--seed", "7", *FAST]
    assert cli.main(words) == 0
    (call,) = shown
    camera, settings = call.named["camera"], call.named
    assert camera.origin.tolist() == [3, 3, 3]
    assert camera.size == (16, 12)
    assert (settings["seed"], settings["lighting"], settings["block"]) == (7, "even", True)
    assert [path.name for path in mesh.parent.iterdir()] == ["mesh.obj"]
    assert cli.main(["render", "other.obj", *words[1:]]) == 2
    monkeypatch.undo()
    assert cli.main([*words[:1], str(mesh), *words[2:], "--checkpoint", str(mesh.with_name("a.wfck"))]) == 2
    assert "--show is for one scene" in (err := capsys.readouterr().err)
    assert "checkpoint" in err


def test_info_names_sizes_textures_and_warnings(mesh: Path, run, capsys) -> None:
    iio.imwrite(mesh.with_name("wood.png"), np.full((3, 5, 3), 128, np.uint8))
    mesh.with_name("mesh.mtl").write_text("newmtl wood\nmap_Kd wood.png\n")
    uv = "vt 0 0\nvt 1 0\nvt 0 1\n"
    mesh.write_text(f"mtllib mesh.mtl\n{uv}usemtl wood\n{TETRAHEDRON}f 1/1 2/2 3/3\nf 1 1 2\n")
    done = run("info", mesh.name, "--quiet", cwd=mesh.parent)
    assert (done.returncode, done.stderr) == (0, "")
    lines = done.stdout.splitlines()
    assert lines[0] == "mesh.obj: 1 shape, 5 triangles, 0 lights"
    assert lines[1].startswith(f"size: file {mesh.stat().st_size} bytes, meshes ")
    assert lines[2] == "bounds: (0, 0, 0) to (1, 1, 1), (1, 1, 1) across"
    assert "5 × 3>, 3 channels, sRGB" in lines[lines.index("textures:") + 1]
    assert "wood" in lines[lines.index("materials:") + 1]
    (count,) = (line for line in lines if line.startswith("losses"))
    messages = lines[lines.index(count) + 1 :]
    assert count == f"losses: {len(messages)}"
    assert messages == ["  'wood': 1 face of zero area, first: line 15; left out"]
    mesh.write_text(TETRAHEDRON)
    assert cli.main(["info", str(mesh), "--quiet"]) == 0
    assert capsys.readouterr().out.splitlines()[-1] == "losses: none"


def test_compare_shows_p_values(mesh: Path, run) -> None:
    for seed in ("1", "2"):
        options = [*FAST, "--spp", "8", "--seed", seed, "-o", str(mesh.with_name(f"{seed}.npz"))]
        assert cli.main(["render", str(mesh), *options]) == 0
    done = run("compare", "1.npz", "2.npz", "-o", "d.exr", cwd=mesh.parent)
    assert (done.returncode, done.stderr) == (0, "")
    found = dict(line.split(None, 1) for line in done.stdout.splitlines())
    for name in ("p_value", "p_pixels", "p_blocks", "p_mean"):
        assert 0 <= float(found[name]) <= 1
    assert mesh.with_name("d.exr").exists()


def test_dataset_writes_views_and_goes_on(mesh: Path, run) -> None:
    words = ["dataset", mesh.name, "-o", "set", "--views", "2", "--format", "coco", "--format", "bop", *FAST]
    done = run(*words, cwd=mesh.parent)
    assert (done.returncode, done.stderr, done.stdout) == (0, "", "set: 2 views\n")
    assert (mesh.parent / "set" / "annotations.json").exists()
    assert (mesh.parent / "set" / "train" / "000000" / "scene_gt.json").exists()
    assert run(*words).stdout == "set: 2 views, 2 of them there before\n"


@pytest.mark.parametrize("shell", ["bash", "zsh"])
def test_completion_prints_a_script(shell: str, run, tmp_path: Path) -> None:
    done = run("completion", shell)
    assert (done.returncode, done.stderr) == (0, "")
    assert "turntable" in done.stdout
    assert "--max-bounces" in done.stdout
    if shell == "bash" and shutil.which("bash"):
        script = tmp_path / "script"
        script.write_text(done.stdout)
        typed = (
            f'source {script}; COMP_WORDS=(wavefront tur); COMP_CWORD=1; _shtab_wavefront; echo "$COMPREPLY"'
        )
        found = subprocess.run(["bash", "-c", typed], capture_output=True, text=True, timeout=60)
        assert found.stdout == "turntable\n"


def test_completion_says_what_it_needs(missing, capsys) -> None:
    missing("shtab")
    assert cli.main(["completion", "bash"]) == 2
    assert "pip install shtab" in capsys.readouterr().err


def test_doctor_says_what_is_there_and_tests_it(run, calls_of) -> None:
    measure = doctor_command.measure_speeds
    calls = calls_of("wavefront.cli.doctor_command.measure_speeds", lambda seconds, _: measure(0.1, 1))
    done = run("doctor", "--seconds", "5")
    assert calls[0].args[0] == 3.0
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.startswith(f"wavefront {wf.__version__}, Python {sys.version.split()[0]}")
    for text in (f"numpy {np.__version__}", "cores: ", "BLAS: ", "NumPy uses ", "--guide: ", *EXTRAS):
        assert text in done.stdout
    assert done.stdout.count("  passed  ") >= 3
    assert "FAILED" not in done.stdout
    assert re.search(r"speed, numpy: \d+\.\d\d million rays per second", done.stdout)


def test_the_room_is_as_described() -> None:
    scene = doctor_command.timed_room()
    (mesh,) = (shape for shape in scene.shapes if shape.name == "mesh")
    assert f" {len(mesh.faces)} triangles" in doctor_command.ROOM
    width, height = scene.camera.size
    assert f" {width}x{height} pixels" in doctor_command.ROOM
    assert sum(shape.emission is not None for shape in scene.shapes) == 1


def test_doctor_gives_1_when_a_test_fails(monkeypatch, calls_of, capsys) -> None:
    gray = wf.Diffuse(0.99)
    monkeypatch.setattr(doctor_command, "Diffuse", lambda reflectance: gray)
    assert not doctor_command.check_furnace().passed
    calls_of("wavefront.cli.doctor_command.measure_speeds", lambda seconds, workers: [])
    calls_of("wavefront.cli.doctor_command.check_workers", lambda: doctor_command.CheckResult("", True, ""))
    assert cli.main(["doctor"]) == 1
    assert "  FAILED  furnace: a white sphere" in capsys.readouterr().out


def test_doctor_knows_all_extras(monkeypatch, capsys) -> None:
    """Their packages are those of the project; one that is missing is named with what it brings."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    extras = project["optional-dependencies"]
    assert EXTRAS.keys() == extras.keys() - FOR_DEVELOPERS
    for name, extra in EXTRAS.items():
        assert list(extra.packages) == [re.split("[<>=]", each)[0] for each in extras[name]]
    assert list(doctor_command.REQUIRED) == [re.split("[<>=]", each)[0] for each in project["dependencies"]]
    monkeypatch.setattr(doctor_command, "_version", lambda package: None)
    assert cli.main(["doctor", "--seconds", "0"]) == 0
    assert "plot: Image.plot; not installed: pip install matplotlib" in (capsys.readouterr().out)
