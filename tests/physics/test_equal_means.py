"""Guided and re-used renders, and those with caustics, have the mean of plain ones, within three errors.

The errors are 0.1 % at most. Printed are all means: `pytest -s -m slow tests/physics/test_equal_means.py`.

So have renders with default settings, which are large enough for the tuning run that chooses branches and
re-use (`drive/choice.py`): each reference scene again, of at least 192 × 192 pixels.
"""

import sys
from collections.abc import Callable
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scenes
from inside import choice
from scenes import Case
from significance import ROUNDING, Mean, assert_mean, measure, repeat

import wavefront as wf

sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks"))
from hard_scenes import HARD_SCENES

MAX_ERROR = 0.001
SPP = 4096
RUNS = 16  # pictures that share no noise, where pixels do
SIZE = 64
TUNED = 192  # the least side of pictures of which a tuning run chooses how paths go on
PICTURES = {
    **{name: partial(build, SIZE) for name, build in HARD_SCENES.items()},
    **{
        build.__name__: partial(build, (SIZE, SIZE))
        for build in (scenes.cornell_box, scenes.room, scenes.everything)
    },
    "everything but points": lambda: without_points(scenes.everything((SIZE, SIZE))),
    "glass ball": scenes.glass_ball,
    "glass box": scenes.glass_box,
}


def without_points(scene: wf.Scene) -> wf.Scene:
    """Leave out lights whose caustics only light paths find."""
    scene.lights = [light for light in scene.lights if not light.delta]
    return scene


PLAIN = {"branches": 1, "guide": False, "reuse": False, "caustics": False}
TECHNIQUES = {
    "guided": {**PLAIN, "guide": True},
    "guided, four branches": {**PLAIN, "guide": True, "branches": 4},
    "re-used": {**PLAIN, "reuse": True},
    "caustics": {**PLAIN, "caustics": True},
    "caustics, re-used": {**PLAIN, "caustics": True, "reuse": True},
}
CASES = [*scenes.DIRECT_CASES, *scenes.TRIANGLE_CASES, *scenes.INDIRECT_CASES, *scenes.SPECULAR_CASES]
techniques = pytest.mark.parametrize("options", TECHNIQUES.values(), ids=list(TECHNIQUES))


def mean_of_picture(name: str, spp: int, **options: Any) -> Mean:
    """Render a scene whose pixels know nothing of each other, each with a distribution of its own.

    The channels count as one, as their noise is nearly the same.
    """
    image = wf.render(PICTURES[name](), spp, progress=False, **options)
    error = np.sqrt(np.square(image.standard_error, dtype=float).mean(2).sum()) / image.rgb[..., 0].size
    return Mean(float(image.rgb.mean(dtype=float)), float(error), image.rgb[..., 0].size)


def mean_of_runs(scene: wf.Scene, spp: int, **options: Any) -> Mean:
    """Render pictures of several seeds, which are the batches, since pixels depend on each other."""
    return Mean.of(repeat(scene, max(1, spp // RUNS), runs=RUNS, first_seed=1, **options).mean((1, 2, 3)))


@cache
def plain(name: str) -> Mean:
    """Return the mean of a scene by plain paths."""
    return mean_of_picture(name, SPP, **PLAIN)


@pytest.mark.slow
@techniques
@pytest.mark.parametrize("name", PICTURES)
def test_pictures(name: str, options: dict[str, Any]) -> None:
    spp = SPP // options["branches"] * (2 if options["caustics"] else 1)  # paths from lights vary more
    if options["reuse"] or options["caustics"]:
        found = mean_of_runs(PICTURES[name](), spp, accel="auto", workers=None, **options)
    else:
        found = mean_of_picture(name, spp, seed=1, **options)
    exact = plain(name)
    print(f"{name}: {found} and plain {exact}")
    assert max(exact.error / exact.value, found.error / found.value) <= MAX_ERROR
    if options["caustics"] and name == "everything":
        assert found.value > 1.005 * exact.value  # it has points beside glass and a mirror
        return
    off = abs(found.value - exact.value) - ROUNDING * exact.value
    assert off <= 3 * np.hypot(found.error, exact.error)


@pytest.mark.slow
@techniques
@pytest.mark.parametrize("case", [case for case in CASES if "full" in case.integrators], ids=str)
def test_every_case(case: Case, options: dict[str, Any], close_tiles: None) -> None:
    spp = 4 * case.spp
    unseen = 10 / (64 * spp * case.expected)  # see test_reference.py
    chosen = {"max_bounces": 4, **case.options, **options}
    runs = options["reuse"] or options["caustics"]
    measured = (mean_of_runs if runs else measure)(case.build(), spp, **chosen)
    print(f"{case}: {measured}, must be {case.expected:.6g}")
    assert_mean(measured, case.expected, MAX_ERROR, sigmas=3, rounding=ROUNDING + unseen)


# --- What a tuning run chooses ------------------------------------------------------------------------

# small pictures of a probe get no such warning
all_one_color = pytest.mark.filterwarnings("ignore:the picture is")


def tuned(scene: wf.Scene) -> wf.Scene:
    """Give a scene a picture that is large enough for a tuning run."""
    camera = scene.camera
    scene.camera = wf.Camera(camera.origin, camera.rotation, camera.projection, (TUNED, TUNED))
    return scene


def mean_by_default(build: Callable[[], wf.Scene], spp: int, runs: int, **options: Any) -> tuple[Mean, str]:
    """Render with default settings and several seeds, and return the mean and what was chosen."""
    means, chosen = [], set()
    for seed in range(1, runs + 1):
        image = wf.render(tuned(build()), spp, seed=seed, progress=False, **options)
        means.append(float(image.rgb.mean(dtype=float)))
        chosen.add("shared" if image.metadata["reuse"] else f"branches {image.metadata['branches']}")
    return Mean.of(np.array(means)), ", ".join(sorted(chosen))


def is_tuned(case: Case) -> bool:
    """Whether a tuning run can choose anything for a case."""
    return "full" in case.integrators and int(case.options.get("max_bounces", 4)) > 1  # type: ignore[call-overload]


TUNED_CASES = [case for case in CASES if is_tuned(case)]


@all_one_color
@pytest.mark.slow
@pytest.mark.parametrize("case", TUNED_CASES, ids=str)
def test_every_case_by_default(case: Case) -> None:
    """The probe of each scene measures its known light, whatever a tuning run chooses."""
    spp = 8
    found, chosen = mean_by_default(case.build, spp, RUNS, **{"max_bounces": 4, **case.options})
    print(f"{case}: {found} ({chosen}), must be {case.expected:.6g}")
    unseen = 10 / (TUNED**2 * RUNS * spp * case.expected)  # see test_reference.py
    assert_mean(found, case.expected, 3 * MAX_ERROR, rounding=ROUNDING + unseen)


@pytest.mark.slow
@pytest.mark.parametrize("name", PICTURES)
def test_pictures_by_default(name: str) -> None:
    found, chosen = mean_by_default(PICTURES[name], 16, RUNS)
    exact = plain(name)
    print(f"{name}: {found} ({chosen}) and plain {exact}")
    assert max(exact.error / exact.value, found.error / found.value) <= 3 * MAX_ERROR
    off = abs(found.value - exact.value) - ROUNDING * exact.value
    assert off <= 3.5 * np.hypot(found.error, exact.error)  # with 16 runs, 1 % by Student's t


@all_one_color
@pytest.mark.parametrize(
    ("name", "due"),
    [
        pytest.param("furnace of 0.5, 8 bounces", "shared", marks=pytest.mark.slow),
        pytest.param("point light in a sphere", "shared", marks=pytest.mark.slow),
        ("half-hidden rectangle", "branches 1, branches 4"),
        pytest.param("point light, offset 1.5", "branches 1", marks=pytest.mark.slow),
    ],
)
def test_the_tuning_run_keeps_means(name: str, due: str, monkeypatch: pytest.MonkeyPatch) -> None:
    runs, run = [], choice.tuning_run
    monkeypatch.setattr(choice, "tuning_run", lambda *a, **k: runs.append(1) or run(*a, **k))
    (case,) = (case for case in CASES if case.name == name)
    options = {"max_bounces": 4, **case.options, "workers": 1, "accel": "numpy"}
    found, chosen = mean_by_default(case.build, 1, 6, **options)
    assert len(runs) >= 6
    assert chosen == due
    assert_mean(found, case.expected, 0.003)
