"""Finite numbers of JSON and the like, which may hold anything."""

from __future__ import annotations

from collections.abc import Callable
from itertools import chain
from typing import Any

import numpy as np

from ...core.errors import SceneError
from ...core.plural import plural
from ...shapes.transform import Matrix

LARGEST = float(np.finfo(np.float64).max)
SHOWN = 80  # characters of a value in a message


def floats(where: str, value: Any, count: int) -> Matrix:
    """Return `count` finite numbers of the JSON, or raise a SceneError that names them."""
    return table([value], count, lambda row: where)[0]


def table(rows: list[Any], width: int, where: Callable[[int], str]) -> Matrix:
    """Return rows of finite numbers of the JSON as (n, width).

    Raises
    ------
    SceneError
        If a row is something else. The message names the first such row by `where`.
    """
    sound = set(map(type, rows)) <= {list} and set(map(len, rows)) <= {width}
    if sound and set(map(type, chain.from_iterable(rows))) <= {int, float}:
        try:
            array = np.array(rows, np.float64).reshape(-1, width)
        except OverflowError:  # a whole number beyond float64
            array = np.full((1, 1), np.inf)
        if np.isfinite(array).all():
            return array
    row = next(i for i, value in enumerate(rows) if not is_row(value, width))
    raise SceneError(f"{where(row)} is {shown(rows[row])}; it must be {plural(width, 'finite number')}")


def is_row(value: Any, width: int) -> bool:
    """Return whether a value of the JSON is a list of `width` finite numbers."""
    return (
        isinstance(value, list)
        and len(value) == width
        and all(type(x) in (int, float) and -LARGEST <= x <= LARGEST for x in value)
    )


def shown(value: Any) -> str:
    """Return a value of the JSON for a message, shortened if it is long."""
    text = str(value) if isinstance(value, Exception) else repr(value)
    return text if len(text) <= SHOWN else text[: SHOWN - 3] + "..."
