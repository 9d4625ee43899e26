"""What may help is said where it is seen: in the metadata, and at the end of a render that takes long."""

from contextlib import redirect_stderr
from typing import Any

import numpy as np
import pytest
import trimesh
from inside import hints, installed

import wavefront as wf

FLOOR = wf.Rectangle((-3, 0, 3), (6, 0, 0), (0, 0, -6))
GLASS = wf.Sphere((0, 0.7, 0), 0.6, material=wf.Dielectric(1.5))
MATTE = wf.Sphere((0, 0.7, 0), 0.6)
LAMP = wf.Sphere((0.8, 3.5, 0), 0.1, emission=100)
PANEL = wf.Rectangle((-1, 3.5, -1), (2, 0, 0), (0, 0, 2), emission=2)
SKY = wf.Environment(1)
CAMERA = wf.Camera.look_at((0, 2.5, 5), (0, 0.5, 0), fov=40, size=(8, 6))


def render(things: Any, **settings: Any) -> wf.Image:
    return wf.render(things, 1, camera=CAMERA, workers=1, **settings)


def told(capsys: pytest.CaptureFixture) -> list[str]:
    """Return the hints that were written since the last call."""
    return [line for line in capsys.readouterr().err.splitlines() if line.startswith("hint: ")]


@pytest.mark.parametrize(
    ("things", "settings", "rare"),
    [
        ([FLOOR, GLASS, LAMP], {}, True),
        ([FLOOR, GLASS, LAMP, wf.Environment(0.01)], {}, True),
        (
            [
                FLOOR,
                wf.Instance(wf.Rectangle((-1, 1, 0), (2, 0, 0), (0, 1, 0), material=wf.Mirror()), np.eye(4)),
                LAMP,
            ],
            {},
            True,
        ),
        ([FLOOR, GLASS, PANEL], {}, False),
        ([FLOOR, GLASS, LAMP, wf.Environment(30)], {}, False),  # the lamp hardly counts
        ([FLOOR, GLASS, SKY], {}, False),
        ([FLOOR, MATTE, LAMP], {}, False),
        ([FLOOR, GLASS, LAMP], {"caustics": True}, False),
        ([FLOOR, GLASS, LAMP], {"integrator": "direct_mis"}, False),
        ([FLOOR, GLASS, LAMP], {"max_bounces": 1}, False),
        ([FLOOR, GLASS], {"lighting": None}, False),
    ],
)
@pytest.mark.filterwarnings("ignore:the picture is black")
def test_small_lamps_by_glass_get_a_hint(things: list[Any], settings: dict[str, Any], rare: bool) -> None:
    hint = render(things, progress=False, **settings).metadata["hint"]
    assert hint == (hints.RARE_CAUSTICS if rare else None)


@pytest.mark.parametrize("factor", [1e-12, 1e12])
def test_the_size_of_the_scene_does_not_matter(factor: float) -> None:
    ball = wf.Sphere((0, 0.7 * factor, 0), 0.6 * factor, material=wf.Dielectric(1.5))
    for radius, hint in ((0.1, hints.RARE_CAUSTICS), (1.5, None)):
        lamp = wf.Sphere((0, 3.5 * factor, 0), radius * factor, emission=2)
        scene = wf.Scene([ball, lamp], camera=wf.Camera.look_at((0, 0, 9 * factor), (0, 0, 0), size=(4, 4)))
        assert wf.render(scene, 1, progress=False).metadata["hint"] == hint


@pytest.mark.usefixtures("long_ago")
def test_a_long_render_ends_with_the_hint(capsys: pytest.CaptureFixture) -> None:
    render([FLOOR, GLASS, LAMP])
    assert told(capsys) == [f"hint: {hints.RARE_CAUSTICS}"]
    with wf.Session([FLOOR, GLASS, LAMP], 2, camera=CAMERA, workers=1) as session:
        for _ in session:
            pass
        assert len(told(capsys)) == 1
        session.set_camera(CAMERA)
        session.run()
    assert told(capsys) == []


def test_short_renders_say_nothing(capsys: pytest.CaptureFixture) -> None:
    assert hints.LONG == 10
    render([FLOOR, GLASS, LAMP])
    assert told(capsys) == []


@pytest.mark.usefixtures("long_ago")
@pytest.mark.parametrize("progress", [False, lambda done, total: None])
def test_quiet_renders_say_nothing(progress: Any, capsys: pytest.CaptureFixture) -> None:
    assert render([FLOOR, GLASS, LAMP], progress=progress).metadata["hint"] == hints.RARE_CAUSTICS
    assert capsys.readouterr().err == ""


@pytest.mark.usefixtures("long_ago")
@pytest.mark.parametrize("stream", [None, "closed"])
def test_hints_never_end_a_render(stream: str | None, tmp_path: Any) -> None:
    file = (tmp_path / "stderr").open("w")
    file.close()
    with redirect_stderr(file if stream else None):
        assert render([FLOOR, GLASS, LAMP]).spp == 1


@pytest.mark.usefixtures("long_ago")
@pytest.mark.parametrize(
    ("subdivisions", "there", "settings", "said"),
    [
        (3, False, {}, True),
        (2, False, {}, False),
        pytest.param(3, True, {}, False, marks=pytest.mark.skipif(not installed(), reason="no embreex")),
        (3, False, {"accel": "numpy"}, False),
    ],
)
def test_a_missing_embree_is_told(subdivisions, there, settings, said, missing, capsys):
    """Where there are so many triangles that it matters, and the choice was left to the package."""
    if not there:
        missing("embreex")
    ball = trimesh.creation.icosphere(subdivisions)
    render([ball, SKY], **settings)
    hint = "`pip install embreex` meshes of 1,280 triangles render about 2 times as fast"
    assert told(capsys) == ([f"hint: Embree is not installed: with {hint}"] if said else [])


def test_larger_meshes_gain_more_by_embree() -> None:
    """As measured: 2.2 to 3.2 times, 3.2 to 4.8 and 6.8 to 12.3."""
    assert [round(hints.embree_gain(n), 1) for n in (1280, 20480, 327680)] == [2.1, 3.8, 6.7]


@pytest.mark.usefixtures("long_ago")
@pytest.mark.parametrize("denoise", [True, False])
def test_a_missing_denoiser_is_told(denoise, missing, capsys):
    missing("pyoidn")
    render([FLOOR, MATTE, SKY], denoise=denoise)
    assert told(capsys) == ([f"hint: {hints.NO_DENOISER}"] if denoise else [])


@pytest.mark.usefixtures("long_ago")
@pytest.mark.parametrize("integrator", ["direct_mis", "naive"])
def test_errors_that_rest_on_few_samples_are_told(integrator, capsys):
    """The lamp is small: paths that do not aim at it hardly meet it."""
    wf.render([FLOOR, wf.Sphere((1, 5, 0), 0.3, emission=9)], 16, camera=CAMERA, integrator=integrator)
    assert (f"hint: {hints.RARE_PATHS}" in told(capsys)) is (integrator == "naive")
