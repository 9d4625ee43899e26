"""Materials beside Mitsuba 3, where it is installed."""

import importlib.util
import sys
import warnings
from pathlib import Path

import pytest

SCRIPT = Path(__file__).parents[2] / "benchmarks" / "bsdf_vs_mitsuba.py"


def test_values_and_densities_agree_with_mitsuba(monkeypatch):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        pytest.importorskip("mitsuba")
    spec = importlib.util.spec_from_file_location("bsdf_vs_mitsuba", SCRIPT)
    script = importlib.util.module_from_spec(spec)
    monkeypatch.setitem(sys.modules, spec.name, script)  # its dataclasses look themselves up there
    spec.loader.exec_module(script)
    rows = script.compare(2000)
    far = [f"{r.material} {r.quantity}: {r.difference:.1e}" for r in rows if r.difference > r.limit]
    assert not far
    assert len(rows) > 30
