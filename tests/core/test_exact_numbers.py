"""Numbers in messages have the digits that tell them from their limits."""

from __future__ import annotations

import numpy as np
import pytest
from inside import exact

import wavefront as wf


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (1.0, "1"),
        (1.00000012, "1.00000012"),
        (np.float32(1.0000001), "1.0000001"),
        (np.float32(0.1), "0.1"),
        (0.1 + 0.2, "0.30000000000000004"),
        (-1e-9, "-1e-09"),
        (1234567, "1234567"),
        (float("nan"), "nan"),
        (float("-inf"), "-inf"),
    ],
)
def test_a_number_has_the_digits_that_matter(value: float, text: str) -> None:
    assert exact(value) == text


def test_messages_do_not_contradict_themselves() -> None:
    with pytest.raises(wf.SceneError, match=r"is 1\.0000001; it must be in \[0, 1\]"):
        wf.Diffuse(1.0000001)
    with pytest.raises(wf.SceneError, match=r"is 1\.00016; it must be in \[0, 1\]"):
        wf.srgb((1.00016, 0, 0))
