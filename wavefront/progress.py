"""How far a render has come, shown as a bar or told to a function."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Self, TypeAlias

Progress: TypeAlias = Callable[[float, float], object] | bool | None

DELAY = 2  # seconds before a bar appears


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
        self._wanted = progress is None or progress is True
        self._timed = seconds is not None
        self._total = samples if seconds is None else seconds
        self._done: float = 0
        self._bar: Any = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        if self._bar is not None:
            self._bar.close()

    def advance(self, samples: int, elapsed: float) -> None:
        """Take note of further samples, at a time in seconds."""
        before = self._done
        self._done = min(elapsed, self._total) if self._timed else before + samples
        if self._bar is not None:
            self._bar.update(self._done - before)
        elif self._wanted and elapsed > DELAY:
            self._bar = self._appear(elapsed)
        if self._callback:
            self._callback(self._done, self._total)

    def _appear(self, elapsed: float) -> Any:
        from tqdm import tqdm  # here, so that starting up and short renders do not pay for it

        style = {"bar_format": "{l_bar}{bar}| {n:.0f}/{total:.0f} s"} if self._timed else {"unit_scale": True}
        bar = tqdm(total=self._total, initial=self._done, unit="sample", **style)
        bar.start_t -= elapsed
        return bar
