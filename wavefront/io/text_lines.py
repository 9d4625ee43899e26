"""Numbers of a text; checks of its lines, where those that differ only in their digits are checked once."""

from __future__ import annotations

import re
from collections.abc import Callable, Collection
from typing import TypeVar

import numpy as np

from ..core.errors import SceneError, in_brief

Result = TypeVar("Result")

DIGITS = bytes.maketrans(b"123456789", b"0" * 9)
NUMBER = re.compile(r"[-+]?((\d+(\.\d*)?|\.\d+)(e[-+]?\d+)?|inf|infinity|nan)", re.ASCII | re.IGNORECASE)


def words(line: str) -> list[str]:
    """Return the words of a line, which blanks separate; other white space is part of a word."""
    return [word for word in line.split(" ") if word]


def check_lines(lines: list[str], check: Callable[[int, str], Result]) -> list[Result]:
    """Return the result of `check` for each line.

    Parameters
    ----------
    lines
        A text, split at its line ends.
    check
        Function of the number of a line, from 1, and the line. Lines that differ only in their digits get
        the result for the first of them, so it may not depend on the values of numbers.
    """
    forms = "\n".join(lines).encode().translate(DIGITS).split(b"\n")
    first = dict(zip(reversed(forms), range(len(forms), 0, -1), strict=True))
    numbers = sorted(first.items(), key=lambda item: item[1])
    results = {form: check(number, lines[number - 1]) for form, number in numbers}
    return [results[form] for form in forms]


def numbers(place: str, name: str, text: str, counts: Collection[int]) -> list[float]:
    """Return the numbers of a text, of which there must be one of some counts."""
    try:
        values = [float(word) for word in re.split(r"[\s,]+", text.strip(" \t\r\n,"))]
    except ValueError:
        values = []
    if len(values) not in counts or not np.isfinite(values).all():
        counts = () if isinstance(counts, range) else counts
        wanted = (
            " or ".join("a number" if count == 1 else f"{count} numbers" for count in counts)
            or "a list of numbers"
        )
        raise SceneError(f"{place}: {name} is {in_brief(text)}; it must be {wanted}")
    return values
