"""One declaration of the settings: signatures, documents and options follow it."""

from __future__ import annotations

import argparse
import inspect
import re
from pathlib import Path
from typing import Any

import pytest
from inside import AOVS, SETTINGS, Settings

import wavefront as wf
from wavefront import cli


def described(docstring: str) -> dict[str, str]:
    """Return the text of each parameter in a numpydoc docstring, without line breaks."""
    section = inspect.cleandoc(docstring).split("Parameters\n----------\n")[1]
    section = re.split(r"\n\n\w+\n---", section)[0]
    found = re.finditer(r"^(\w+)\n((?:    .*\n?)+)", section, re.MULTILINE)
    return {match[1]: " ".join(match[2].split()) for match in found}


TAKERS = [wf.render, wf.Session, wf.render_many, wf.write_dataset, wf.view]


@pytest.mark.parametrize("function", TAKERS, ids=lambda function: function.__name__)
def test_signatures_show_every_setting(function: Any) -> None:
    """Names in the same order, types and defaults; the parameters of the function itself come first."""
    parameters = inspect.signature(function).parameters
    assert [name for name in parameters if name in SETTINGS] == list(SETTINGS)
    for name, setting in SETTINGS.items():
        assert parameters[name].default == setting.default, name
        assert parameters[name].annotation == setting.type, name
    assert all(each.kind is not inspect.Parameter.VAR_KEYWORD for each in parameters.values())


@pytest.mark.parametrize("function", TAKERS, ids=lambda function: function.__name__)
def test_the_documentation_describes_every_setting(function: Any) -> None:
    """Word for word, but where the function has a parameter of its own for it."""
    texts = described(function.__doc__ or "")
    own = {"spp"} if function is wf.view else set()
    assert {name: texts[name] for name in SETTINGS if name not in own} == {
        name: setting.text for name, setting in SETTINGS.items() if name not in own
    }
    assert "{settings}" not in (function.__doc__ or "")


def test_no_setting_is_listed_anywhere_else() -> None:
    """The package has one place with the names of all settings, the declaration."""
    package = Path(wf.__file__).parent
    words = {path: set(re.findall(r"\w+", path.read_text("utf-8"))) for path in package.rglob("*.py")}
    rare = set(SETTINGS) - {"size", "up", "filter", "seed", "camera", "material", "samples"}  # common words
    lists = [path.stem for path, found in words.items() if len(rare & found) > 0.7 * len(rare)]
    assert lists == ["declaration"]


def options() -> dict[str, argparse.Action]:
    """Return the options of `wavefront render` by their names."""
    (commands,) = cli.parser()._subparsers._group_actions  # type: ignore[union-attr]
    return {each.dest: each for each in commands.choices["render"]._actions}  # type: ignore[call-overload]


def test_options_follow_the_declaration() -> None:
    found = options()
    for name, each in SETTINGS.items():
        if each.option is None:
            assert name not in found
            continue
        assert found[name].help == each.option
        default = found[name].default
        assert getattr(default, "value", default) == each.default
        assert found[name].choices is each.choices
        flag = each.flag or name
        negated = ["--no-" + flag] if name == "ground" else []
        assert found[name].option_strings == ["--" + flag.replace("_", "-"), *negated]


@pytest.mark.parametrize("name", [name for name, each in SETTINGS.items() if each.choices])
def test_choices_are_described(name: str) -> None:
    for choice in ("processes", "threads") if name == "executor" else SETTINGS[name].choices:
        assert f'"{choice}"' in SETTINGS[name].text


def test_checks_are_those_of_the_declaration() -> None:
    for call in (wf.render, wf.Session):
        with pytest.raises(wf.SceneError, match=r"max_bounces is -1; .* from 0 to 65536"):
            call("no such file", max_bounces=-1)
        with pytest.raises(wf.SceneError, match="branches=2 does not go with integrator='naive': only"):
            call("no such file", branches=2, integrator="naive")


def test_settings_are_kept_as_they_are_checked() -> None:
    assert Settings(size=(8.0, 6.0)).values["size"] == (8, 6)  # type: ignore[arg-type]
    assert Settings().max_spp == Settings().target_spp == 100
    assert Settings(noise=0.1).max_spp == 2**16
    assert Settings(noise=0.1).target_spp is None
    assert Settings(seconds=1).max_spp > 2**16


def test_only_what_is_given_is_checked(calls_of: Any) -> None:
    calls = calls_of("wavefront.settings.declaration.Setting.checked")
    Settings(seed=3, spp=None, filter="box")
    assert [call.args[1] for call in calls] == ["seed"]


def test_defaults_are_what_their_checks_would_return() -> None:
    for name, each in SETTINGS.items():
        assert each.checked(name, each.default) == each.default
    assert Settings().values == {name: each.default for name, each in SETTINGS.items()}
    with pytest.raises(wf.SceneError, match="seed is -1"):
        Settings(seed=-1)


def test_layers_are_chosen_by_name() -> None:
    """One name or several, each once, in the order of the table; "all" is all without keys."""
    assert Settings().values["aovs"] == ()
    assert Settings(aovs="depth").values["aovs"] == ("depth",)
    assert Settings(aovs=["coverage", "albedo", "depth", "albedo"]).values["aovs"] == (
        "depth",
        "albedo",
        "coverage",
    )
    assert Settings(aovs="all").values["aovs"] == tuple(AOVS)
    assert Settings(aovs=("all", "light_groups")).values["aovs"] == (*AOVS, "light_groups")


def test_unknown_layers_are_an_error_that_lists_what_there_is() -> None:
    with pytest.raises(
        wf.SceneError, match=r"aovs has 'dept'; there are position, depth, .*coverage, boxes, and"
    ) as e:
        wf.render("no such file", aovs=("normal", "dept"))
    assert "did you mean 'depth'" in str(e.value)
    with pytest.raises(wf.SceneError, match="aovs has 3; there are"):
        Settings(aovs=[3])  # type: ignore[list-item]
    with pytest.raises(wf.SceneError, match="aovs is 3; it must be the name of an AOV, or several names"):
        Settings(aovs=3)  # type: ignore[arg-type]


def test_the_option_of_layers_can_be_given_several_times() -> None:
    read = cli.parser().parse_args(["render", "scene.obj", "--aov", "depth", "--aov", "albedo"])
    assert read.aovs == ("depth", "albedo")
    assert cli.parser().parse_args(["render", "scene.obj"]).aovs == ()


def test_the_option_of_reuse_takes_yes_no_and_auto(capsys: pytest.CaptureFixture[str]) -> None:
    for text, value in (("yes", True), ("no", False), ("auto", "auto")):
        assert cli.parser().parse_args(["render", "scene.obj", "--reuse", text]).reuse == value
    with pytest.raises(SystemExit):
        cli.parser().parse_args(["render", "scene.obj", "--reuse", "maybe"])
    assert "'maybe' is not yes, no or auto" in capsys.readouterr().err
