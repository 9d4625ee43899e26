"""Guided renders have the mean of plain ones, within three standard errors of at most 0.1 %."""

import sys
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scenes
from scenes import Case
from significance import ROUNDING, Mean, assert_mean, measure

import wavefront as wf

sys.path.insert(0, str(Path(__file__).parents[1] / "benchmarks"))
from hard_scenes import HARD_SCENES

pytestmark = pytest.mark.slow
MAX_ERROR = 0.001
PLAIN_SPP = 4096
GUIDED = {"guided": {"guide": True}, "guided, four branches": {"guide": True, "branches": 4}}
ALL_CASES = [*scenes.DIRECT_CASES, *scenes.TRIANGLE_CASES, *scenes.INDIRECT_CASES, *scenes.SPECULAR_CASES]
guided = pytest.mark.parametrize("options", GUIDED.values(), ids=list(GUIDED))


def mean_of_picture(name: str, spp: int, **options: Any) -> Mean:
    """Render a hard scene of 64 × 64 pixels, each a batch of its own distribution."""
    image = wf.render(HARD_SCENES[name](64), spp, progress=False, **options)
    error = np.sqrt(np.square(image.standard_error, dtype=float).mean(2).sum()) / image.rgb[..., 0].size
    return Mean(float(image.rgb.mean(dtype=float)), float(error), image.rgb[..., 0].size)


@cache
def plain(name: str) -> Mean:
    """Return the mean of a hard scene without a guide."""
    return mean_of_picture(name, PLAIN_SPP)


@guided
@pytest.mark.parametrize("name", HARD_SCENES)
def test_hard_scenes(name: str, options: dict[str, Any]) -> None:
    """The standard error of the mean counts the channels as one: their noise is nearly the same."""
    spp = PLAIN_SPP // options.get("branches", 1)
    exact, found = plain(name), mean_of_picture(name, spp, seed=1, **options)
    assert max(exact.error / exact.value, found.error / found.value) <= MAX_ERROR
    assert abs(found.value - exact.value) <= 3 * np.hypot(found.error, exact.error)


@guided
@pytest.mark.parametrize("case", [case for case in ALL_CASES if "full" in case.integrators], ids=str)
def test_scenes_of_known_light(case: Case, options: dict[str, Any]) -> None:
    """The probe of each scene measures what it measures without a guide."""
    unseen = 10 / (64 * case.spp * case.expected)  # see test_reference.py
    measured = measure(case.build(), 4 * case.spp, **{"max_bounces": 4, **case.options, **options})
    assert_mean(measured, case.expected, MAX_ERROR, sigmas=3, rounding=ROUNDING + unseen)
