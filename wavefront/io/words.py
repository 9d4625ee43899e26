"""Sorting the lines of a text by their first word, without a loop over lines, and checking their numbers."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..errors import SceneError

NUMERIC = b"0123456789+-.eEnaifNAIFtyTY"  # the characters of numbers, including nan and infinity
KEYWORD = 9  # bytes of a first word that are compared; one more than the longest keyword


@dataclass
class Rows:
    """Some lines of a text, each without its keyword."""

    keyword: str
    numbers: NDArray[np.intp]  # (n,) line of the file, from 1
    widths: NDArray[np.intp]  # (n,) number of words after the keyword
    texts: list[str]  # n, each empty or with a blank before every word

    def resized(self, width: int, fill: str) -> list[str]:
        """Return the texts with `width` words each: cut off, or padded with `fill`."""
        if (self.widths == width).all():
            return self.texts
        words = (text.split()[:width] for text in self.texts)
        return [" " + " ".join(row + [fill] * (width - len(row))) for row in words]

    def first_but(self, holds: Callable[[str], object]) -> tuple[int, str] | None:
        """Return the first word for which `holds` raises a ValueError or OverflowError, and its line."""
        for number, text in zip(self.numbers, self.texts, strict=True):
            for word in text.split():
                try:
                    holds(word)
                except (ValueError, OverflowError):
                    return int(number), word
        return None

    def not_a_number(self) -> tuple[int, str] | None:
        """Return the first word that is not a number, and its line."""
        try:
            _check_floats("".join(self.texts))
        except ValueError:
            return self.first_but(_check_floats)
        return None

    def check_numbers(self, name: str, least: int) -> None:
        """Check that every line has at least `least` numbers; the SceneError names the file and the line."""
        if (self.widths < least).any():
            i = int((self.widths < least).argmax())
            raise SceneError(
                f"{name} line {self.numbers[i]}: {self.keyword} has {self.widths[i]} numbers "
                f"({self.texts[i].strip()!r}); it must have at least {least}"
            )
        found = self.not_a_number()
        if found:
            raise SceneError(
                f"{name} line {found[0]}: {self.keyword} holds {found[1]!r}, which is not a number"
            )


def _check_floats(text: str) -> None:
    for _ in map(float, text.split()):
        pass
    if text.encode().translate(None, NUMERIC + b" "):  # digits of other scripts, underscores
        raise ValueError


def sort_lines(lines: list[str], *keywords: str) -> tuple[list[Rows], NDArray[np.intp]]:
    """Return the lines that begin with each keyword, and the indices of those with another first word."""
    codes = np.frombuffer("\n".join([*lines, " " * KEYWORD]).encode(), np.uint8)
    blank = (codes == ord(" ")) | (codes == ord("\n"))
    edges = np.flatnonzero(np.diff(blank, prepend=True))
    starts, ends = edges[0::2], edges[1::2]
    line = np.searchsorted(np.flatnonzero(codes == ord("\n")), starts)
    first = np.flatnonzero(np.diff(line, prepend=-1))
    heads = codes[starts[first, None] + np.arange(KEYWORD)]
    heads[np.arange(KEYWORD) >= (ends - starts)[first, None]] = 0
    words = heads.view(f"S{KEYWORD}").ravel()
    at, widths = line[first], np.diff(first, append=len(starts)) - 1
    rows = []
    for keyword in keywords:
        chosen = words == keyword.encode()
        texts = [lines[i][len(keyword) :] for i in at[chosen]]
        rows.append(Rows(keyword, at[chosen] + 1, widths[chosen], texts))
    return rows, at[~np.isin(words, [keyword.encode() for keyword in keywords])]
