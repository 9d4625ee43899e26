"""The analytical cases of CIE 171:2006, with significance tests on the errors that measure() reports."""

from __future__ import annotations

from dataclasses import replace

import cie171
import numpy as np
import pytest
from cie171 import CASES, TABLES, TYPES, Daylight, Found
from significance import ALPHA

import wavefront as wf

PRINTED = cie171.printed()
LARGEST = 0.007  # relative, of what is printed beside the report's sums; nearly a unit of its last digit


def check(found: Found, error: float) -> None:
    """Neither the largest difference nor the mean of all is significant, at a small error."""
    assert found.error.sum() < error * found.exact.sum()
    assert found.chance > ALPHA, f"{found.sigmas.round(1)} standard errors"
    if found.error.any():
        assert found.chance_of_all > ALPHA, f"{found.sigmas.round(1)} standard errors"


@pytest.mark.parametrize("name", CASES)
def test_cases_without_skies(name: str) -> None:
    check(CASES[name](1024), 0.1)


@pytest.mark.parametrize(("name", "type"), [*zip(TABLES, TYPES[2:], strict=True)])
@pytest.mark.first(5)
def test_tables_under_one_sky(name: str, type: int) -> None:
    check(TABLES[name].run(2048, (type,)), 0.1)


@pytest.mark.slow
@pytest.mark.parametrize("name", [*CASES, *TABLES])
def test_to_a_small_error(name: str) -> None:
    """And a difference of three per cent would be seen."""
    found = CASES[name](1 << 17) if name in CASES else TABLES[name].run(1 << 14)
    check(found, 0.02)
    with pytest.raises(AssertionError, match="standard errors"):
        check(replace(found, value=found.value * 1.03), 0.02)


@pytest.mark.parametrize("name", TABLES)
def test_what_is_printed_is_what_the_closed_forms_say(name: str) -> None:
    """But for the values that are known to be wrong: each of these differs by more."""
    table, wrong = PRINTED[name]
    due = TABLES[name].values(TYPES, printed=True)
    off = np.abs(table - due) / np.maximum(due, 1.25)
    assert off[~wrong].max() < LARGEST
    assert not wrong.any() or off[wrong].min() > 1.5 * LARGEST


def test_the_correct_tables_of_the_first_cases_are_those_printed() -> None:
    for name in ("5.2", "5.3", "5.6", "5.7", "5.8"):
        found = CASES[name](8)
        known = np.isfinite(found.published)
        np.testing.assert_allclose(found.published[known], found.exact[known], rtol=0.003, atol=0.005)


def test_polarization_of_a_pane_is_left_out_by_renderers() -> None:
    """Clear glass lets through more, by 4 % at 80°, than faces would that depolarize light between them."""
    cos = np.cos(np.radians([0, 40, 60, 80]))
    exact, each = (cie171.transmittance(cos, 0, polarized) for polarized in (True, False))
    np.testing.assert_allclose(exact, [0.918318, 0.909457, 0.843471, 0.456043], rtol=2e-6)
    np.testing.assert_allclose(each / exact, [1, 0.99793, 0.98485, 0.96014], atol=1e-5)


def test_a_closed_room_is_dark() -> None:
    """No light but that of the opening: closed, nothing arrives."""
    case = Daylight("1x1")
    closed = wf.Scene(cie171.walls("closed"), case.scene(12).lights)
    value, _, _ = cie171.measured(closed, *case.points(), 64)
    assert not value.any()
