"""One declaration of the settings: signatures, documents and options follow it."""

from __future__ import annotations

import argparse
import inspect
import re
from dataclasses import fields
from typing import Any

import pytest

import wavefront as wf
from wavefront import cli
from wavefront.film.aov_names import LAYERS
from wavefront.settings import Settings

DECLARED = {each.name: each for each in fields(Settings) if each.metadata}


def described(docstring: str) -> dict[str, str]:
    """Return the text of each parameter in a numpydoc docstring, without line breaks."""
    section = inspect.cleandoc(docstring).split("Parameters\n----------\n")[1].split("\n\nReturns\n")[0]
    found = re.finditer(r"^(\w+)\n((?:    .*\n?)+)", section, re.MULTILINE)
    return {match[1]: " ".join(match[2].split()) for match in found}


@pytest.mark.parametrize("function", [wf.render, wf.Session.__init__], ids=["render", "Session"])
def test_signatures_follow_the_declaration(function: Any) -> None:
    """Names in the same order, types and defaults."""
    parameters = dict(inspect.signature(function).parameters)
    del parameters["scene"]
    parameters.pop("self", None)
    assert list(parameters) == list(DECLARED)
    for name, parameter in parameters.items():
        assert parameter.default == DECLARED[name].default, name
        assert parameter.annotation == DECLARED[name].type, name


def test_the_documentation_of_render_follows_the_declaration() -> None:
    """Word for word."""
    texts = described(wf.render.__doc__ or "")
    del texts["scene"]
    assert texts == {name: each.metadata["text"] for name, each in DECLARED.items()}


def options() -> dict[str, argparse.Action]:
    """Return the options of `wavefront render` by their names."""
    (commands,) = cli.parser()._subparsers._group_actions  # type: ignore[union-attr]
    return {each.dest: each for each in commands.choices["render"]._actions}  # type: ignore[call-overload]


def test_options_follow_the_declaration() -> None:
    """Help, defaults and choices; those without an option have none."""
    found = options()
    for name, each in DECLARED.items():
        if each.metadata["option"] is None:
            assert name not in found
            continue
        assert found[name].help == each.metadata["option"]
        assert found[name].default == each.default
        assert found[name].choices is each.metadata["choices"]
        flag = each.metadata["flag"] or name
        negated = ["--no-" + flag] if name == "ground" else []
        assert found[name].option_strings == ["--" + flag.replace("_", "-"), *negated]


@pytest.mark.parametrize("name", [name for name, each in DECLARED.items() if each.metadata["choices"]])
def test_choices_are_described(name: str) -> None:
    """Each built-in name stands in the text."""
    for choice in ("processes", "threads") if name == "executor" else DECLARED[name].metadata["choices"]:
        assert f'"{choice}"' in DECLARED[name].metadata["text"]


def test_checks_are_those_of_the_declaration() -> None:
    """Sessions and renders make the same checks, before any work."""
    for call in (wf.render, wf.Session):
        with pytest.raises(wf.SceneError, match=r"max_bounces is -1; .* from 0 to 65536"):
            call("no such file", max_bounces=-1)
        with pytest.raises(wf.SceneError, match="branches is 2; with integrator='naive' it must be 1"):
            call("no such file", branches=2, integrator="naive")


def test_settings_are_kept_as_they_are_checked() -> None:
    """Sizes and counts as ints, and what follows from several of them."""
    assert Settings(size=(8.0, 6.0)).size == (8, 6)  # type: ignore[arg-type]
    assert Settings().max_spp == Settings().target_spp == 100
    assert Settings(noise=0.1).max_spp == 2**16
    assert Settings(noise=0.1).target_spp is None
    assert Settings(seconds=1).max_spp > 2**16


def test_layers_are_chosen_by_name() -> None:
    """One name or several, each once, in the order of the table; "all" is all without keys."""
    assert Settings().aovs == ()
    assert Settings(aovs="depth").aovs == ("depth",)
    assert Settings(aovs=["coverage", "albedo", "depth", "albedo"]).aovs == ("depth", "albedo", "coverage")
    assert Settings(aovs="all").aovs == tuple(LAYERS)
    assert Settings(aovs=("all", "light_groups")).aovs == (*LAYERS, "light_groups")


def test_unknown_layers_are_an_error_that_lists_what_there_is() -> None:
    """With a suggestion."""
    with pytest.raises(
        wf.SceneError, match=r"aovs has 'dept'; there are position, depth, .*coverage, boxes, and"
    ) as e:
        wf.render("no such file", aovs=("normal", "dept"))
    assert "did you mean 'depth'" in str(e.value)
    with pytest.raises(wf.SceneError, match="aovs has 3; there are"):
        Settings(aovs=[3])  # type: ignore[list-item]
    with pytest.raises(wf.SceneError, match="aovs is 3; it must be the name of a layer, or several names"):
        Settings(aovs=3)  # type: ignore[arg-type]


def test_the_option_of_layers_can_be_given_several_times() -> None:
    """Each time with one name."""
    read = cli.parser().parse_args(["render", "scene.obj", "--aov", "depth", "--aov", "albedo"])
    assert read.aovs == ("depth", "albedo")
    assert cli.parser().parse_args(["render", "scene.obj"]).aovs == ()


def test_the_option_of_reuse_takes_yes_no_and_auto(capsys: pytest.CaptureFixture[str]) -> None:
    """Anything else is an error that names them."""
    for text, value in (("yes", True), ("no", False), ("auto", "auto")):
        assert cli.parser().parse_args(["render", "scene.obj", "--reuse", text]).reuse == value
    with pytest.raises(SystemExit):
        cli.parser().parse_args(["render", "scene.obj", "--reuse", "maybe"])
    assert "'maybe' is not yes, no or auto" in capsys.readouterr().err
