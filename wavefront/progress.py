"""How far a render has come, shown as a bar or told to a function."""

from __future__ import annotations

from collections.abc import Callable
from typing import Self, TypeAlias

from tqdm import tqdm

Progress: TypeAlias = Callable[[float, float], object] | bool | None


class Bar:
    """Shows progress, or calls the user's function with it.

    Parameters
    ----------
    progress
        True or None shows a bar, False none; a function is called with what is done and the total.
    samples
        The most samples there will be.
    seconds
        The time there is, which is then what counts.
    """

    def __init__(self, progress: Progress, samples: int, seconds: float | None) -> None:
        self._callback = progress if callable(progress) else None
        self._timed = seconds is not None
        self._total = samples if seconds is None else seconds
        self._done: float = 0
        style = {"bar_format": "{l_bar}{bar}| {n:.0f}/{total:.0f} s"} if self._timed else {"unit_scale": True}
        shown = progress is None or progress is True
        self._bar = tqdm(total=self._total, unit="sample", delay=2, disable=not shown, **style)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self._bar.close()

    def advance(self, samples: int, elapsed: float) -> None:
        """Take note of further samples, at a time in seconds."""
        done = min(elapsed, self._total) if self._timed else self._done + samples
        self._bar.update(done - self._done)
        self._done = done
        if self._callback:
            self._callback(done, self._total)
