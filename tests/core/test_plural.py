"""Counts with their nouns."""

import pytest
from inside import plural


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        ((0, "face"), "0 faces"),
        ((1, "face"), "1 face"),
        ((2, "face"), "2 faces"),
        ((1, "vertex", "vertices"), "1 vertex"),
        ((3, "vertex", "vertices"), "3 vertices"),
        ((1.0, "sample", "", ".4g"), "1 sample"),
        ((12.3456, "sample", "", ".4g"), "12.35 samples"),
    ],
)
def test_one_takes_no_plural(arguments, text):
    assert plural(*arguments) == text
