"""Every public name has an example in its docstring, and all examples run."""

import doctest
import inspect
import re
from pathlib import Path

import numpy as np
import pytest

import wavefront as wf

API = (Path(__file__).parents[2] / "docs" / "api.md").read_text("utf-8")
NEEDS = {"sun_position": "pvlib"}  # what an example runs with, which may not be installed


def docstrings(name):
    """Yield (qualified name, docstring) of a public name and of the methods of a class."""
    thing = getattr(wf, name)
    yield name, inspect.getdoc(thing) or ""
    if inspect.isclass(thing):
        for attribute, member in list(vars(thing).items()):  # copies add to a class
            if not attribute.startswith("_"):
                yield f"{name}.{attribute}", inspect.getdoc(member) or ""


@pytest.mark.usefixtures("tables_restored")
@pytest.mark.parametrize("name", wf.__all__)
def test_the_examples_run(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    if name in NEEDS:
        pytest.importorskip(NEEDS[name])
    runner, parser = doctest.DocTestRunner(optionflags=doctest.ELLIPSIS), doctest.DocTestParser()
    report = []
    for qualified, text in docstrings(name):
        runner.run(parser.get_doctest(text, {"np": np, "wf": wf}, qualified, None, 0), out=report.append)
    assert runner.failures == 0, "".join(report)
    assert "\nExamples\n--------\n>>> " in inspect.getdoc(getattr(wf, name))


def test_the_reference_lists_every_public_name_once():
    listed = re.findall(r"^   (\w+)$", API, re.MULTILINE)
    assert sorted(listed) == list(wf.__all__)
