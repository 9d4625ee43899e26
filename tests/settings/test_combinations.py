"""Which settings go together: the table, its page, and renders of every pair."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from itertools import combinations
from pathlib import Path
from typing import Any

import pytest
from inside import (
    EXCLUSIONS,
    MEDIA,
    MOVING_IN_TURN,
    ROLLING,
    SETTING_OF,
    SETTINGS,
    Exclusion,
    choice,
    table,
    tiles,
)
from scenes import cornell_box

import wavefront as wf

CAMERA = wf.Camera.look_at((3, 2, 4), (0, 0, 0), fov=45, size=(8, 8))
ANOTHER = "another integrator"
VALUES: dict[str, Any] = {  # of each setting, one that is not its default
    "spp": 2,
    "camera": CAMERA,
    "size": (9, 8),
    "view": "front",
    "fov": 50.0,
    "material": "gold",
    "scalars": "x",
    "cmap": "plasma",
    "clim": (0, 1),
    "smooth": False,
    "up": "z",
    "lighting": "softbox",
    "ground": True,
    "background": "white",
    ANOTHER: "direct_mis",
    "features": wf.Feature(),
    "max_bounces": 3,
    "roulette": False,
    "seed": 5,
    "samples": range(2, 4),
    "sampler": "bluenoise",
    "accel": "numpy",
    "workers": 2,
    "executor": "threads",
    "noise": 0.9,
    "quality": "reference",
    "seconds": 0.05,
    "shutter": (0.0, 1.0),
    "shutter_curve": "triangle",
    "filter": "tent",
    "light_sampler": "power",
    "branches": 2,
    "guide": True,
    "reuse": True,
    "clamp": 1.0,
    "caustics": True,
    "wave_size": 20,
    "checkpoint": "render.wfck",
    "checkpoint_interval": 10.0,
    "max_memory": "8GB",
    "strict": True,
    "flow_times": (0.0, 1.0),
    "aovs": "depth",
    "light groups": "light_groups",
    "denoise": True,
    "progress": lambda done, total: None,
}
USUAL = {"size": (8, 8), "max_bounces": 4, "lighting": "cloudy", "workers": 1, "progress": False}
OF_SETTINGS = [
    each for each in EXCLUSIONS if each.other not in (MEDIA, MOVING_IN_TURN, ROLLING)
]  # tests/media has those of scenes
NAMED = {name for each in EXCLUSIONS for name in (each.one, each.other)}
QUICK = [name for name in VALUES if name in NAMED and name not in ("guide", "material")]


def given(*names: str) -> dict[str, Any]:
    """Return settings with a value for each of these names of the table."""
    return {SETTING_OF.get(name, name): VALUES[name] for name in names}


def named(each: Exclusion) -> str:
    """Return the two names, which pytest shows."""
    return f"{each.one} with {each.other}"


def glass_on_a_floor() -> wf.Scene:
    """Glass that casts a caustic, and a lamp; without a camera."""
    lamp = wf.Rectangle((-1, 3, -1), (2, 0, 0), (0, 0, 2), emission=5)
    ball = wf.Sphere((0, 0.5, 0), 0.5, material=wf.Dielectric(1.5))
    return wf.Scene([wf.Rectangle((-2, 0, -2), (0, 0, 4), (4, 0, 0)), lamp, ball])


def pairs(names: Sequence[str]) -> Iterator[tuple[str, str]]:
    """Yield every pair of these settings that the table does not refuse."""
    refused = [{each.one, each.other} for each in EXCLUSIONS if each.refused]
    names = [name for name in names if name not in ("scalars", "cmap", "clim")]  # of one bare mesh
    for one, other in combinations(names, 2):
        if {one, other} not in refused and SETTING_OF.get(one, one) != SETTING_OF.get(other, other):
            yield one, other


def test_every_setting_has_a_value_here() -> None:
    """So that a new one is tried with all others."""
    assert {SETTING_OF.get(name, name) for name in VALUES} == set(SETTINGS)
    assert all(value != SETTINGS[SETTING_OF.get(name, name)].default for name, value in VALUES.items())


def test_the_page_has_the_table() -> None:
    """Word for word."""
    page = (Path(__file__).parents[2] / "docs" / "choices.md").read_text("utf-8")
    section = page.split("## Settings that do not go together\n")[1].split("\n## ")[0]
    assert "\n".join(line for line in section.split("\n") if line.startswith("|")) == table()


def test_help_says_what_a_setting_does_not_go_with() -> None:
    """At the end of its text, from the table."""
    assert SETTINGS["samples"].text.endswith(". Not with `spp`, `noise` or `seconds`.")
    assert " ".join((wf.render.__doc__ or "").split()).count(" Not with `camera`. ") == 2


def test_help_has_each_pair_of_the_table() -> None:
    """In the texts of both."""
    for each in EXCLUSIONS:
        for one, other in ((each.one, each.other), (each.other, each.one)):
            if one in SETTINGS and (each.refused or one == each.one):
                sentence = "Not with " if each.refused else '"auto" leaves it out with '
                assert other in SETTINGS[one].text.partition(sentence)[2].partition(".")[0].replace("`", "")


@pytest.mark.parametrize("each", [each for each in OF_SETTINGS if each.refused], ids=named)
def test_pairs_of_the_table_are_refused(each: Exclusion) -> None:
    """Before any work, with both values and the reason of the table, whichever is given first."""
    for names in ((each.one, each.other), (each.other, each.one)):
        with pytest.raises(wf.SceneError) as caught:
            wf.render("no such file", **given(*names))
        one, other = (re.escape(f"{SETTING_OF.get(name, name)}=") for name in (each.one, each.other))
        message = f"{one}.* does not go with {other}.*: {re.escape(each.why)}"
        assert re.fullmatch(message, str(caught.value))


@pytest.mark.filterwarnings("ignore:noise=")  # of one sample is unknown
@pytest.mark.parametrize("each", [each for each in OF_SETTINGS if each.one == "reuse"], ids=named)
def test_auto_leaves_re_use_out(each: Exclusion, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where something else of the table is asked for, whatever a tuning run would say."""
    monkeypatch.setattr(choice, "LEAST_PIXELS", 1)
    monkeypatch.setattr(tiles, "PIXELS_PER_TRIED", 100)
    monkeypatch.setattr(choice, "_sharing_pays", lambda *found: True)
    image = wf.render(cornell_box((28, 28)), 1, progress=False)
    assert image.metadata["reuse"] is True
    image = wf.render(cornell_box((28, 28)), 1, progress=False, **given(each.other))
    assert image.metadata["reuse"] is False


@pytest.mark.filterwarnings("ignore::UserWarning")  # noise and time end few samples
@pytest.mark.parametrize(
    "names",
    [QUICK, pytest.param(list(VALUES), marks=pytest.mark.slow)],
    ids=["quick", "slow"],
)
def test_every_other_pair_renders(
    names: Sequence[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, short_training: None
) -> None:
    """Half of the pairs that the table has but for guides, which take longer; or of all: a minute."""
    monkeypatch.chdir(tmp_path)
    scene = glass_on_a_floor()
    for number, pair in enumerate(list(pairs(names))[:: 2 if names is QUICK else 1]):
        settings = {**USUAL, **given(*pair)}
        if "samples" not in settings:
            settings.setdefault("spp", 1)
        if "checkpoint" in settings:
            settings["checkpoint"] = f"{number}.wfck"
        assert wf.render(scene, **settings).rgb.max() > 0, pair
