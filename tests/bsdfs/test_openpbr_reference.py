"""OpenPBR beside Adobe's reference, where it and g++ are."""

import importlib.util
import os
import shutil
import sys
from pathlib import Path

import pytest

SCRIPT = Path(__file__).parents[2] / "benchmarks" / "openpbr_vs_reference.py"
FOLDERS = os.environ.get("OPENPBR_REFERENCE", "").split(os.pathsep)
# relative difference of the albedo, and the mean and the median difference of f·cosθ: about what there is
LIMITS = {
    "diffuse": (0.001, 0.001, 0.001),
    "diffuse, rough": (0.001, 0.0012, 0.0012),
    "gloss": (0.031, 0.031, 0.0014),
    "gloss, weight 0.3": (0.044, 0.043, 0.0013),
    "gloss over diffuse": (0.0051, 0.0099, 0.0014),
    "metal": (0.0054, 0.059, 0.35),
    "metal, rough 0.8": (0.028, 0.14, 0.14),
    "metal, anisotropic": (0.0051, 0.058, 0.69),
    "clear": (0.0017, 0.04, 0.14),
    "sheet": (0.062, 0.27, 0.24),
    "film on metal": (0.0092, 0.056, 0.34),
    "film on tinted metal": (0.0068, 0.06, 0.37),
    "film on gloss": (0.033, 0.033, 0.0014),
    "coat": (0.028, 0.028, 0.0014),
    "coat over diffuse": (0.061, 0.061, 0.067),
    "coat, undarkened": (0.069, 0.069, 0.071),
    "coat, colored": (0.06, 0.06, 0.067),
    "fuzz": (0.0038, 0.029, 0.027),
    "fuzz, rough 0.2": (0.067, 0.12, 0.46),
    "fuzz, rough 0.8": (0.0055, 0.023, 0.014),
    "fuzz over diffuse": (0.0017, 0.013, 0.0098),
}


@pytest.mark.slow
@pytest.mark.skipif(len(FOLDERS) != 2 or shutil.which("g++") is None, reason="no reference, or no g++")
def test_openpbr_agrees_with_the_reference(monkeypatch, tmp_path):
    spec = importlib.util.spec_from_file_location("openpbr_vs_reference", SCRIPT)
    script = importlib.util.module_from_spec(spec)
    monkeypatch.setitem(sys.modules, spec.name, script)
    spec.loader.exec_module(script)
    assert set(script.LOBES) == set(LIMITS)
    programs = script.built(*FOLDERS, str(tmp_path))
    far = []
    for name, limits in LIMITS.items():
        row = script.compared(name, programs)
        found = abs(row.albedo / row.reference - 1), row.difference, row.median
        far += [f"{name}: {found}"] if any(x > limit for x, limit in zip(found, limits, strict=True)) else []
    assert not far
