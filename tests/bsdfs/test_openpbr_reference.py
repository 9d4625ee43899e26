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
    "gloss": (0.028, 0.028, 0.0014),
    "gloss, weight 0.3": (0.039, 0.039, 0.0013),
    "gloss over diffuse": (0.0049, 0.0096, 0.0014),
    "metal": (0.0043, 0.058, 0.065),
    "metal, rough 0.8": (0.027, 0.14, 0.13),
    "metal, anisotropic": (0.0053, 0.059, 0.069),
    "clear": (0.0015, 0.039, 0.049),
    "clear, tinted": (0.0091, 0.033, 0.048),
    "sheet": (0.066, 0.27, 0.16),
    "sheet, tinted": (0.11, 0.25, 0.16),
    "film on metal": (0.008, 0.055, 0.061),
    "film on tinted metal": (0.0055, 0.059, 0.061),
    "film on gloss": (0.03, 0.03, 0.0014),
    "coat": (0.025, 0.025, 0.0014),
    "coat over diffuse": (0.061, 0.061, 0.062),
    "coat, undarkened": (0.068, 0.068, 0.066),
    "coat, colored": (0.059, 0.059, 0.062),
    "fuzz": (0.0038, 0.029, 0.028),
    "fuzz, rough 0.2": (0.063, 0.12, 0.51),
    "fuzz, rough 0.8": (0.0056, 0.023, 0.014),
    "fuzz over diffuse": (0.0017, 0.013, 0.0085),
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
