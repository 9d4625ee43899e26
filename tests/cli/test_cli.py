"""The command line: what it writes, what it says, and what it refuses before any work."""

import os
import subprocess
import sys
from importlib.metadata import version

import imageio.v3 as iio
import numpy as np
import pytest
from inside import main, read_image, render_command
from luminaires import lm63

import wavefront as wf

SQUARE = """
mtllib square.mtl
v -1 0 -1
v -1 0 1
v 1 0 1
v 1 0 -1
usemtl red
f 1 2 3 4
v -0.5 2 -0.5
v 0.5 2 -0.5
v 0.5 2 0.5
v -0.5 2 0.5
usemtl light
f 5 6 7 8
"""
MATERIALS = "newmtl red\nKd 0.8 0.1 0.1\nnewmtl light\nKd 0 0 0\nKe 6 6 6\n"
TRIANGLE = b'{"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0, 1]}], "nodes": [{"mesh": 0}, \
{"camera": 0, "translation": [0, 0, 4]}], "cameras": [{"type": "perspective", "perspective": {"yfov": 0.7, \
"aspectRatio": 2.0, "znear": 0.1}}], "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}], \
"accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [-1, -1, 0], \
"max": [1, 1, 0]}], "bufferViews": [{"buffer": 0, "byteLength": 36}], "buffers": [{"byteLength": 36, \
"uri": "data.bin"}]}'


@pytest.fixture
def obj(tmp_path):
    (tmp_path / "square.mtl").write_text(MATERIALS)
    path = tmp_path / "square.obj"
    path.write_text(SQUARE)
    return str(path)


@pytest.fixture
def gltf(tmp_path):
    """A triangle and a camera four units in front of it."""
    corners = np.array([[-1, -1, 0], [1, -1, 0], [0, 1, 0]], "<f4")
    (tmp_path / "data.bin").write_bytes(corners.tobytes())
    path = tmp_path / "triangle.gltf"
    path.write_bytes(TRIANGLE)
    return str(path)


@pytest.fixture
def fast(tmp_path):
    """Options of a small render, and where it goes."""
    output = tmp_path / "picture.npy"
    return output, ["-o", str(output), "--spp", "2", "--size", "8x6", "--quiet"]


RENDER = "wavefront.cli.render_command.render_by_command"


@pytest.fixture
def no_render(fails):
    """Fail the test when a render begins."""
    fails(RENDER, pytest.fail.Exception("rendered before the mistake was reported"))


def error_of(capsys, arguments):
    """Run, expect status 2 and an empty stdout, and return the message."""
    try:
        status = main(arguments)
    except SystemExit as stop:  # argparse
        status = stop.code
    out, err = capsys.readouterr()
    assert status == 2
    assert out == ""
    assert "Traceback" not in err
    return err


def test_render_writes_the_picture_and_says_so(obj, fast, capsys):
    output, options = fast
    assert main(["render", obj, *options, "--origin", "0,1,4"]) == 0
    out, err = capsys.readouterr()
    picture = np.load(output)
    assert picture.shape == (6, 8, 3)
    assert picture.max() > 0
    assert "8x6, 2 spp" in out
    assert err == ""


def test_same_options_same_bytes(obj, fast):
    output, options = fast
    main(["render", obj, *options, "--workers", "1"])
    once = output.read_bytes()
    main(["render", obj, *options, "--workers", "2"])
    assert output.read_bytes() == once
    main(["render", obj, *options, "--seed", "7"])
    assert output.read_bytes() != once


def test_info_names_what_the_file_holds(obj, capsys):
    assert main(["info", obj]) == 0
    out = capsys.readouterr().out
    assert "2 shapes, 4 triangles" in out
    assert "(-1, 0, -1) to (1, 2, 1)" in out
    assert "red" in out
    assert out.count("emits") == 1


def test_info_of_a_luminaire(tmp_path, capsys):
    path = tmp_path / "lamp.ies"
    path.write_text(lm63([0, 90], [0, 45, 90], [[50, 50], [20, 20], [50, 50]]))
    assert main(["info", str(path)]) == 0
    said = f"{path}: luminaire of 219.9 lm, at most 50 cd, 9 × 2 angles\nlosses: none\n"
    assert capsys.readouterr().out == said
    path.write_text("TILT=NONE\n1 x")
    assert main(["info", str(path)]) == 2
    assert "lamp.ies line 2: number of lamps, lumens per lamp is 'x'" in capsys.readouterr().err


def test_version_and_help(capsys):
    for option, text in (("--version", version("wavefront")), ("--help", "render")):
        with pytest.raises(SystemExit) as stop:
            main([option])
        assert stop.value.code == 0
        assert text in capsys.readouterr().out


def test_a_scene_without_light_is_lit_without_a_warning(tmp_path, fast, capsys):
    path = str(tmp_path / "dark.obj")
    (tmp_path / "dark.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    output, options = fast
    assert main(["render", path, *options]) == 0
    assert capsys.readouterr().err == ""
    expected = wf.render(path, 2, size=np.load(output).shape[1::-1], progress=False)
    np.testing.assert_array_equal(np.load(output), expected.rgb)
    assert main(["info", path]) == 0
    out = capsys.readouterr().out
    assert "camera: none; render frames the scene, view='three_quarter'" in out
    assert "light: none; render adds lighting='studio' and a ground" in out
    assert "up: y (assumed; up='z' turns it)" in out


def test_lighting_and_ground_are_handed_on(tmp_path, fast, capsys):
    path = tmp_path / "dark.obj"
    path.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    output, options = fast
    scene = wf.load(path)
    for arguments, settings in (
        (["--lighting", "cloudy"], {"lighting": "cloudy"}),
        (["--lighting", "even", "--ground"], {"lighting": "even", "ground": True}),
        (["--no-ground"], {"ground": False}),
        (["--view", "iso", "--fov", "30"], {"view": "iso", "fov": 30}),
        (["--view", "-1,2,3"], {"view": (-1, 2, 3)}),
    ):
        assert main(["render", str(path), *options, *arguments]) == 0
        picture = np.load(output)
        settings["size"] = picture.shape[1::-1]
        np.testing.assert_array_equal(picture, wf.render(scene, 2, **settings).rgb)
    assert capsys.readouterr().err == ""
    with pytest.raises(SystemExit):
        main(["render", str(path), *options, "--lighting", "sunny"])
    assert "lighting is 'sunny'; it must be auto, None or one of studio," in capsys.readouterr().err


def test_camera_options_place_the_camera(obj, fast):
    output, options = fast
    main(["render", obj, *options, "--origin", "0,1,0", "--target", "0,0,0", "--up", "0,0,-1", "--fov", "20"])
    red, green, _ = np.load(output).mean((0, 1))
    assert red > 4 * green  # nothing but the red floor
    main(["render", obj, *options, "--origin", "0,1,0", "--target", "0,9,0", "--up=0,0,-1", "--fov", "20"])
    np.testing.assert_allclose(np.load(output), 6)  # nothing but the light


def test_negative_vectors_need_no_equals_sign(obj, fast):
    output, options = fast
    view = ["--target", "-0.5,0,-.5", "--up", "-1,0,0"]
    assert main(["render", obj, *options, "--origin", "-0.5,1,-.5", *view]) == 0
    spaced = output.read_bytes()
    joined = [f"{a}={b}" for a, b in (("--origin", "-0.5,1,-.5"), tuple(view[:2]), tuple(view[2:]))]
    assert main(["render", obj, *options, *joined]) == 0
    assert output.read_bytes() == spaced


def test_the_camera_of_the_file_is_used_and_resized(gltf, tmp_path, capsys):
    output = tmp_path / "picture.npy"
    assert main(["render", gltf, "-o", str(output), "--spp", "2", "--size", "12x6", "--quiet"]) == 0
    scene = wf.load(gltf)
    scene.camera = wf.Camera.look_at((0, 0, 4), (0, 0, 0), fov=np.degrees(0.7), size=(12, 6))
    expected = wf.render(scene, 2)
    np.testing.assert_allclose(np.load(output), expected.rgb, atol=1e-5)
    main(["info", gltf])
    assert "camera: in the file" in capsys.readouterr().out


@pytest.mark.parametrize("option", [["--fov", "20"], ["--up", "0,0,1"]])
def test_what_frames_a_scene_does_not_yield_to_the_camera_of_the_file(gltf, fast, capsys, no_render, option):
    found = error_of(capsys, ["render", gltf, *fast[1], *option])
    assert f"{option[0]} needs " in found
    assert f"{gltf} has a camera of its own" in found


@pytest.mark.parametrize("option", ["--view", "--direction"])
def test_a_view_frames_a_file_with_a_camera(gltf, fast, option):
    output, options = fast
    assert main(["render", gltf, *options, option, "0,0,1"]) == 0
    scene = wf.load(gltf)
    scene.camera = None
    picture = np.load(output)
    expected = wf.render(scene, 2, view="front", size=picture.shape[1::-1], progress=False)
    np.testing.assert_array_equal(picture, expected.rgb)


@pytest.mark.parametrize("up", ["0,0,1", "-Z"])
def test_up_and_direction_frame_a_scene(obj, fast, up):
    output, options = fast
    assert main(["render", obj, *options, "--up", up, "--direction", "-1,-2,1", "--lighting", "even"]) == 0
    scene = wf.load(obj)
    sign = -1 if up == "-Z" else 1
    scene.camera = scene.framing_camera(
        size=np.load(output).shape[1::-1], up=(0, 0, sign), direction=(-1, -2, 1)
    )
    spp = int(options[options.index("--spp") + 1])
    expected = wf.render(scene, spp, lighting="even", progress=False)  # from where its lamp does not shine
    np.testing.assert_array_equal(np.load(output), expected.rgb)


def test_gamma_and_exposure_reach_the_file(obj, tmp_path):
    def render(name, *options):
        path = tmp_path / name
        common = ["--spp", "4", "--size", "8x6", "--quiet", "--origin", "0,1,3"]
        assert main(["render", obj, "-o", str(path), *common, *options]) == 0
        return path

    linear = np.clip(np.load(render("a.npy")), 0, 1)
    for gamma in (1.0, 2.2):
        codes = iio.imread(render("a.png", "--gamma", str(gamma)))
        np.testing.assert_allclose(codes, 255 * linear ** (1 / gamma), atol=0.51)
    curve = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    np.testing.assert_allclose(iio.imread(render("a.png", "--gamma", "srgb")), 255 * curve, atol=0.51)
    brighter = read_image(render("b.npy", "--exposure", "1"))
    np.testing.assert_allclose(np.clip(brighter / 2, 0, 1), linear, rtol=1e-6)


def test_tone_white_balance_and_bits_reach_the_file(obj, tmp_path):
    common = ["--spp", "4", "--size", "8x6", "--quiet", "--origin", "0,1,3"]
    assert main(["render", obj, "-o", str(tmp_path / "a.npz"), *common]) == 0
    image = wf.Image.load(tmp_path / "a.npz")
    assert image.variance is not None
    for white, value in (("3200", 3200), ("0.5,.6,0.7", (0.5, 0.6, 0.7))):
        options = ["--tone", "agx", "--white-balance", white, "--bits", "16", "--exposure", "1"]
        assert main(["render", obj, "-o", str(tmp_path / "a.png"), *common, *options]) == 0
        image.save(tmp_path / "b.png", exposure=1, tone="agx", white_balance=value, bits=16)
        assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--target", "0,0,0"], "--target needs --origin"),
        (["--origin", "0,1,0", "--direction", "0,0,1"], "--view is for scenes that are framed"),
        (["--origin", "0,1,0", "--target", "0,1,0"], "must differ"),
        (["--origin", "0,1"], "is not X,Y,Z"),
        (["--origin", "nan,1,0"], "finite"),
        (["--origin", "0,1,3", "--fov", "0"], "not above 0 and below 180"),
        (["--fov", "180"], "not above 0 and below 180"),
        (["--up", "q"], "it must be a vector, or one of x, y, z"),
        (["--tone", "filmic"], "invalid choice: 'filmic'"),
        (["--white-balance", "100"], "white_balance is 100.0; it must be 1667 to 25000 kelvin"),
        (["--white-balance", "1,0,1"], "each component must be above 0"),
        (["--bits", "12"], "invalid choice: 12"),
        (["--tone", "agx", "-o", "a.exr"], r"a.exr: tone='agx' is for .png, .jpg, .jpeg"),
        (["--bits", "16", "-o", "a.npy"], "a.npy: bits=16 is for .png"),
        (["--size", "640"], "is not WIDTHxHEIGHT"),
        (["--size", "4x3x2"], "is not WIDTHxHEIGHT"),
        (["--size", "ax3"], "is not WIDTHxHEIGHT"),
        (["--gamma", "0"], "neither a number from 0.01 to 100"),
        (["--gamma", "linear"], "neither a number from 0.01 to 100"),
        (["--exposure", "nan"], "not a finite number"),
        (["--exposure", "1e4"], "exposure is 10000.0; it must be from -100 to 100"),
        (["-o", "x" * 300 + ".png"], "File name too long"),
        (["--integrator", "best"], "invalid choice: 'best'"),
        (["--sampler", "best"], "invalid choice: 'best'"),
        (["--spp", "many"], "invalid int value"),
        (["-o", "picture.bmp"], "picture.bmp"),
        (["-o", "picture"], "picture"),
        (["-o", "no/such/folder/picture.png"], "no/such/folder"),
        (["--size", "0x5"], "must be whole numbers from 1"),
    ],
)
def test_wrong_options_are_refused_before_rendering(obj, fast, capsys, no_render, options, message):
    assert message in error_of(capsys, ["render", obj, *fast[1], *options])


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--spp", "0"], "spp is 0"),
        (["--spp", "-3"], "spp is -3"),
        (["--max-bounces", "-1"], "max_bounces is -1"),
        (["--seed", "-1"], "seed is -1"),
        (["--workers", "0"], "workers is 0"),
        (["--accel", "gpu"], "gpu"),
    ],
)
def test_wrong_numbers_leave_no_picture(obj, fast, capsys, options, message):
    assert message in error_of(capsys, ["render", obj, *fast[1], *options])
    assert not fast[0].exists()


@pytest.mark.parametrize("command", ["render", "info"])
def test_wrong_files(tmp_path, capsys, no_render, command):
    assert "missing.obj" in error_of(capsys, [command, str(tmp_path / "missing.obj")])
    (tmp_path / "scene.blend").write_bytes(b"BLENDER")
    assert "scene.blend" in error_of(capsys, [command, str(tmp_path / "scene.blend")])
    (tmp_path / "bad.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n")
    assert "bad.obj" in error_of(capsys, [command, str(tmp_path / "bad.obj")])


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["rendr"], "; did you mean 'render'?; see wavefront --help"),
        (["render", "a.obj", "--sample-count", "4"], "; did you mean --spp?; see wavefront render --help"),
        (["render", "a.obj", "--ssp", "4"], "; did you mean --spp?"),
        ([__file__], f"; to render a file: wavefront render {__file__}; see wavefront --help"),
        (["render", "a.obj", "--most-bounces=3"], "; did you mean --max-bounces?"),
        (["turntable", "a.obj", "--frames", "4", "--tonemap", "aces"], "; did you mean --tone?"),
        (["render", "a.obj", "--sampler", "sobel"], "; did you mean 'sobol'?"),
        (["info", "a.obj", "b.obj"], "unrecognized arguments: b.obj; see wavefront info --help"),
    ],
)
def test_what_may_have_been_meant_is_said(capsys, words, message):
    assert message in error_of(capsys, words)


def test_no_command_is_an_error(capsys):
    assert "arguments are required: command; see wavefront --help" in error_of(capsys, [])


def test_ctrl_c_while_loading_gives_130(obj, fast, fails):
    calls = fails("wavefront.cli.render_command.read_scene", KeyboardInterrupt())
    assert main(["render", obj, *fast[1]]) == 130
    assert calls[0].args[-1] is False  # no progress, as --quiet asks


@pytest.mark.parametrize(
    ("error", "status", "message"),
    [(wf.Interrupted, 130, "wavefront: stopped"), (wf.RenderError, 2, "wavefront: error: stopped")],
)
@pytest.mark.parametrize("begun", [True, False])
def test_a_render_that_stops_is_saved(obj, fast, calls_of, capsys, error, status, message, begun):
    output, options = fast
    render = render_command.render_by_command

    def stopped(*args, **kwargs):
        raise error("stopped", render(*args, **kwargs) if begun else None)

    calls_of(RENDER, stopped)
    assert main(["render", obj, *options]) == status
    assert message in capsys.readouterr().err
    assert output.exists() == begun


def saved_instead(capsys):
    """Return the error, and where the picture went."""
    out, err = capsys.readouterr()
    assert out == ""
    error, note = err.strip().splitlines()
    assert error.startswith("wavefront: error: ")
    return error, note


@pytest.fixture
def broken_after_the_render(calls_of):
    """Return a function that lets something happen between the render and saving."""
    render = render_command.render_by_command

    def break_by(act):
        def render_then_act(*args, **kwargs):
            image = render(*args, **kwargs)
            act()
            return image

        calls_of(RENDER, render_then_act)

    return break_by


def test_a_picture_whose_folder_has_gone_is_saved_in_the_current_one(
    obj, tmp_path, capsys, monkeypatch, broken_after_the_render
):
    here, there = tmp_path / "here", tmp_path / "there"
    here.mkdir()
    there.mkdir()
    monkeypatch.chdir(here)
    broken_after_the_render(there.rmdir)
    for count in range(2):
        there.mkdir(exist_ok=True)
        options = ["-o", str(there / "p.png"), "--spp", "1", "--size", "8x6", "--quiet", "--origin", "0,1,4"]
        assert main(["render", obj, *options]) == 2
        error, note = saved_instead(capsys)
        assert "does not exist" in error
        name = here / ("p-saved-2.png" if count else "p-saved.png")
        assert note == f"wavefront: the picture was saved as {name}"
        assert iio.imread(name).shape == (6, 8, 3)


def test_a_picture_in_whose_place_is_something_else_is_saved_beside_it(
    obj, fast, capsys, broken_after_the_render
):
    output, options = fast
    broken_after_the_render(output.mkdir)
    assert main(["render", obj, *options]) == 2
    error, note = saved_instead(capsys)
    assert "is a folder" in error
    assert note == f"wavefront: the picture was saved as {output.with_name('picture-saved.npy')}"
    assert np.load(output.with_name("picture-saved.npy")).shape == (6, 8, 3)


def test_a_picture_that_its_format_cannot_hold_is_saved_in_another(obj, tmp_path, capsys, fails):
    fails("wavefront.codecs.png_jpeg.encode", OSError("encoder error -2"))
    options = ["-o", str(tmp_path / "p.jpg"), "--spp", "1", "--size", "8x6", "--quiet", "--origin", "0,1,4"]
    assert main(["render", obj, *options, "--tone", "agx"]) == 2
    error, note = saved_instead(capsys)
    assert "p.jpg: cannot be encoded: encoder error -2" in error
    assert note == f"wavefront: the picture was saved as {tmp_path / 'p-saved.npz'}"
    assert wf.Image.load(tmp_path / "p-saved.npz").variance is not None


def test_a_picture_that_can_be_saved_nowhere_is_said_to_be_lost(
    obj, fast, capsys, broken_after_the_render, full_disk
):
    broken_after_the_render(full_disk)
    assert main(["render", obj, *fast[1]]) == 2
    error, note = saved_instead(capsys)
    assert "No space left" in error
    assert note == "wavefront: the picture is lost"


@pytest.mark.skipif(sys.platform == "win32", reason="POSIX signals")
def test_sigterm_ends_the_program_and_leaves_nothing(gltf, fast):
    """While a scratch file that has a name is there."""
    output, options = fast
    code = (
        "import os, signal, sys\n"
        "from wavefront import cli\n"
        "from wavefront.core import files\n"
        "files.OPEN_FILES = '/no/such/folder'\n"
        "def end(handle):\n"
        f"    assert any(name.endswith('.tmp') for name in os.listdir({str(output.parent)!r}))\n"
        "    os.kill(os.getpid(), signal.SIGTERM)\n"
        "files.os.fsync = end\n"
        "sys.exit(cli.main(sys.argv[1:]))\n"
    )
    before = set(output.parent.iterdir())
    done = subprocess.run(
        [sys.executable, "-c", code, "render", gltf, *options], capture_output=True, text=True, timeout=60
    )
    assert (done.returncode, done.stderr) == (143, "")
    assert set(output.parent.iterdir()) == before


@pytest.mark.skipif(sys.platform != "linux", reason="names of any bytes")
def test_names_that_cannot_be_printed_are_no_error(gltf, tmp_path):
    output = os.fsencode(tmp_path) + b"/\xff\xe5.npy"
    command = [sys.executable, "-m", "wavefront", "render", gltf, "-o", output]
    environment = {**os.environ, "PYTHONIOENCODING": "ascii:strict"}
    options = ["--spp", "1", "--size", "8x6", "--quiet"]
    done = subprocess.run([*command, *options], capture_output=True, env=environment, timeout=60)
    assert (done.returncode, done.stderr) == (0, b"")
    assert os.path.exists(output)
