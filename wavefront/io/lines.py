"""A check of every line of a text that looks only once at lines that differ in nothing but their digits."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import TypeVar

Result = TypeVar("Result")

DIGITS = bytes.maketrans(b"123456789", b"0" * 9)
NUMBER = re.compile(r"[-+]?((\d+\.?\d*|\.\d+)(e[-+]?\d+)?|inf|infinity|nan)", re.ASCII | re.IGNORECASE)


def words(line: str) -> list[str]:
    """Return the words of a line; as in C, no blank but those of ASCII separates them."""
    return re.findall(r"\S+", line, re.ASCII)


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
    results: dict[bytes, Result] = {}
    for number, (form, line) in enumerate(zip(forms, lines, strict=True), 1):
        if form not in results:
            results[form] = check(number, line)
    return [results[form] for form in forms]
