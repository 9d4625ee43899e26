"""Elementary functions, and pictures, have the same bits on machines of all kinds."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from inside import elementary, installed
from numpy._core._multiarray_umath import __cpu_dispatch__, __cpu_features__

import wavefront

TESTS = Path(__file__).parents[1]
PACKAGE = Path(wavefront.__file__).parent
FUNCTIONS = r"np\.(exp2?|expm1|log2?|log1p|log10|sin|cos|tan|arc\w+|sinh|cosh|tanh|power|cbrt|hypot)\("
# What reaches no picture: projection of points, a tone curve (its codes are rounded), advice, errors of
# differences, metrics, inverses of warps, a self-test, examples,
# curves of a plot.
ALLOWED = {
    "bsdfs/measured.py": 1,
    "bsdfs/plot.py": 2,
    "camera/distortion.py": 3,
    "camera/projection.py": 4,
    "cli/doctor_command.py": 5,
    "codecs/tone.py": 1,
    "colors/maps.py": 2,  # which entry of a table of 256 colors a number of data gets
    "io/materialx.py": 1,
    "image/comparison.py": 1,
    "image/image.py": 1,
    "sampling/warp.py": 4,
    "drive/diagnosis.py": 4,
    "motion/motion.py": 3,
    "shapes/height_field.py": 1,
    "statistics/limits.py": 1,
    "statistics/significance.py": 3,
    "statistics/student_t.py": 11,
}


def numbers(kind: type, low: float, high: float) -> np.ndarray:
    return np.random.default_rng(1).uniform(low, high, 100_000).astype(kind)


KINDS = pytest.mark.parametrize(("kind", "ulp"), [(np.float32, 2.0**-23), (np.float64, 2.0**-52)])


@KINDS
def test_sine_and_cosine_of_turns(kind: type, ulp: float) -> None:
    turns = np.append(numbers(kind, -3, 3), np.arange(-8, 9).astype(kind) / 4).astype(kind)
    exact = 2 * np.pi * turns.astype(np.longdouble)
    for value, reference in zip(elementary.sin_cos_turns(turns), (np.sin(exact), np.cos(exact)), strict=True):
        assert value.dtype == kind
        assert np.abs(value - reference).max() < 3 * ulp + 2e-15


@KINDS
def test_sine_and_cosine(kind: type, ulp: float) -> None:
    x = numbers(kind, -np.pi / 2, np.pi / 2)
    sine, cosine = elementary.sin_cos(x)
    assert np.abs(cosine - np.cos(x.astype(np.longdouble))).max() < 2 * ulp
    small = x * kind(1e-6)
    for value, angle in ((sine, x), (elementary.sin_cos(small)[0], small)):
        reference = np.sin(angle.astype(np.longdouble))
        assert (np.abs(value - reference) <= 2 * ulp * np.abs(reference)).all()


@KINDS
def test_arctangent(kind: type, ulp: float) -> None:
    y, x = numbers(kind, -1, 1), numbers(kind, -1, 1)[::-1]
    reference = np.arctan2(y.astype(np.longdouble), x)
    value = elementary.arctan2(y, x)
    assert value.dtype == kind
    assert (np.abs(value - reference) <= 3 * ulp * np.abs(reference)).all()
    signs = np.array([[0.0, 0, -0.0, -0.0, 1, -1, 0, 2], [0, -0.0, 0, -1, 0, 0, 3, 2]], kind)
    assert np.allclose(elementary.arctan2(*signs), np.arctan2(*signs), rtol=2 * ulp, atol=0)


@KINDS
@pytest.mark.parametrize("name", ["arccos", "arcsin"])
def test_inverse_cosine_and_sine(kind: type, ulp: float, name: str) -> None:
    x = np.append(numbers(kind, -1, 1), np.array([-1, 0, 1], kind))
    value = getattr(elementary, name)(x)
    assert np.abs(value - getattr(np, name)(x.astype(np.longdouble))).max() < 4 * ulp


def test_exponential_and_logarithm() -> None:
    x = numbers(np.float32, -86, 88)
    exact = np.exp(x.astype(np.float64))
    assert np.abs(elementary.exp(x) / exact - 1).max() < 3e-7
    ends = np.array([-np.inf, -1e30, -88, 0, np.nan], np.float32)
    assert np.array_equal(elementary.exp(ends), np.array([0, 0, 0, 1, np.nan]), equal_nan=True)
    x = exact.astype(np.float32)
    assert np.abs(elementary.log(x) - np.log(x.astype(np.float64))).max() < 8e-6
    x = numbers(np.float32, 0.5, 2)
    exact = np.log(x.astype(np.float64))
    assert (np.abs(elementary.log(x) - exact) <= 3e-7 * np.abs(exact)).all()


def test_the_package_takes_elementary_functions_from_here() -> None:
    found = {}
    for path in sorted(PACKAGE.rglob("*.py")):
        name = path.relative_to(PACKAGE).as_posix()
        count = len(re.findall(FUNCTIONS, path.read_text(encoding="utf-8")))
        if count and not name.startswith("testing/"):
            found[name] = count
    assert found == ALLOWED


def machine(*without: str) -> dict[str, str]:
    """Environment in which NumPy runs as on a processor without some groups of instructions."""
    present = {name for name in __cpu_dispatch__ if __cpu_features__.get(name)}
    return {"NPY_DISABLE_CPU_FEATURES": " ".join(sorted(present.intersection(without)))}


AVX512 = (
    "X86_V4",
    "AVX512_SKX",
    "AVX512_CLX",
    "AVX512_CNL",
    "AVX512_ICL",
    "AVX512_SPR",
    "AVX512F",
    "AVX512CD",
)
AVX = (*AVX512, "X86_V3", "AVX2", "FMA3", "F16C", "AVX")
MACHINES: dict[str, Callable[[], dict[str, str]]] = {
    "AVX2, and another BLAS kernel": lambda: {**machine(*AVX512), "OPENBLAS_CORETYPE": "Nehalem"},
    "SSE, and no FMA in the C library": lambda: {
        **machine(*AVX),
        "GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX2,-FMA,-AVX2_Usable,-FMA_Usable",
    },
}


def pictures(environment: dict[str, str], *accelerators: str) -> Any:
    command = [sys.executable, str(TESTS / "hashes_of_pictures.py"), *accelerators]
    environment = {**os.environ, "PYTHONPATH": str(PACKAGE.parent), **environment}
    run = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    return json.loads(run.stdout)


@pytest.mark.parametrize("name", MACHINES)
@pytest.mark.parametrize(
    "accel", ["numpy", pytest.param("embree", marks=pytest.mark.skipif(not installed(), reason="none"))]
)
@pytest.mark.first(1)
def test_pictures_have_the_same_bits_on_every_machine(name: str, accel: str) -> None:
    if __cpu_features__.get("ASIMD"):
        pytest.skip("the groups of instructions are those of x86")
    here, there = (pictures(environment, accel) for environment in ({}, MACHINES[name]()))
    if "SSE" in name:
        assert there.pop("numpy's own sine") != here["numpy's own sine"]  # or else this tests nothing
    assert {key: value for key, value in here.items() if key in there} == there
