"""The mutation check: what kills a mutant, and what says nothing about the tests."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.skipif(not hasattr(os, "fork"), reason="mutants are forked")

RUN = """
import importlib, os, sys, time
from pathlib import Path
import mutants
mutants.ROOT = Path.cwd()
sys.path.insert(0, os.getcwd())
importlib.import_module("formulas")
data = Path("formulas.py").read_bytes()
for old, new in {changes!r}:
    at = data.index(old.encode())
    mutant = mutants.Mutant("formulas.py", 1, ((at, at + len(old), new),), "one")
    child = mutants.Child(mutant, ["test_it.py"], 60)
    while (result := child.result()) is None:
        time.sleep(0.01)
    print(result[0], result[2])
"""
FORMULAS = """LIMIT = 3
SIZE = 8 // LIMIT
def double(x):
    return 2 * x
"""
TEST = """from formulas import SIZE, double
CASES = [1, 2, 3][:SIZE]
if len(CASES) != 2:
    raise ValueError("no cases")
def test_double():
    assert double(2) == 4
"""


@pytest.mark.slow
def test_only_a_test_that_fails_kills_a_mutant(tmp_path: Path) -> None:
    """A mutant that cannot be imported, or that leaves no tests to run, is invalid."""
    (tmp_path / "formulas.py").write_text(FORMULAS)
    (tmp_path / "test_it.py").write_text(TEST)
    changes = [("2 * x", "x * 2"), ("2 * x", "3 * x"), ("= 3", "= 0"), ("= 3", "= 8")]
    done = subprocess.run(
        [sys.executable, "-c", RUN.format(changes=changes)], cwd=tmp_path, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    assert [line.split()[0] for line in done.stdout.splitlines()] == [
        "survived",
        "killed",
        "invalid",
        "invalid",
    ]
