"""Counts with their nouns, for messages."""

from __future__ import annotations


def plural(count: float, noun: str, several: str = "", form: str = "") -> str:
    """Return a count with its noun: 1 face, 2 faces.

    `several` is for nouns that do not take an s, and `form` is the format of the count, such as ".4g".
    """
    return f"{count:{form}} {noun if count == 1 else several or noun + 's'}"
