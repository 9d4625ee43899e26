"""Benchmarks explain themselves without their inputs, and refuse repeats that have no variance."""

import runpy
import sys
from pathlib import Path

import pytest

FOLDER = Path(__file__).parents[2] / "benchmarks"


def run(monkeypatch, name: str, *arguments: str) -> int:
    """Run a script as its user does; return its exit status."""
    monkeypatch.setattr(sys, "argv", [name, *arguments])
    monkeypatch.setattr(sys, "path", [str(FOLDER), str(FOLDER.parent / "examples"), *sys.path])
    with pytest.raises(SystemExit) as ended:
        runpy.run_path(str(FOLDER / name), run_name="__main__")
    return ended.value.code


@pytest.mark.parametrize(
    "name", ["openpbr_vs_reference.py", "fuzz_fit.py", "bsdf_vs_mitsuba.py", "many_lights.py"]
)
def test_help_needs_no_inputs(name: str, monkeypatch, missing, capsys) -> None:
    missing("scipy", "mitsuba")
    assert run(monkeypatch, name, "--help") == 0
    assert "usage: " in capsys.readouterr().out


@pytest.mark.parametrize(
    ("name", "option"),
    [("many_lights.py", "--repeat"), ("naive_vs_full.py", "--repeats"), ("adaptive_bias.py", "--seeds")],
)
def test_one_repeat_has_no_variance(name: str, option: str, monkeypatch, capsys) -> None:
    assert run(monkeypatch, name, option, "1") == 2
    assert "1 has no variance; it must be 2 or more" in capsys.readouterr().err
