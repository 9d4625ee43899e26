"""How far a render has come, shown as a bar or told to a function; what else takes long, by its name."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import Any, Self, TypeAlias

Progress: TypeAlias = Callable[[float, float], object] | bool | None

DELAY = 2  # seconds before anything appears
TICK = 1  # seconds between updates while nothing is done


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
        self._told: float = 0  # when, in seconds
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
        self._told = elapsed
        if self._bar is not None:
            self._bar.set_postfix_str("", refresh=False)
            self._bar.update(self._done - before)
        elif self._wanted and elapsed > DELAY:
            self._bar = self._appear(elapsed)
        if self._callback:
            self._callback(self._done, self._total)

    def wait(self, surfaces: int, elapsed: float) -> None:
        """Take note that no samples have come, at a time in seconds, and how many surfaces a path has met.

        It may be called often: something is shown, or the user's function called, every `TICK` seconds.
        """
        if elapsed - self._told < TICK:
            return
        self.advance(0, elapsed)
        if self._bar is not None:
            self._bar.set_postfix_str(f"paths of {surfaces} surfaces under way")

    def _appear(self, elapsed: float) -> Any:
        from tqdm import tqdm  # here, so that starting up and short renders do not pay for it

        style: dict[str, Any] = {"unit_scale": True}
        if self._timed:
            style = {"bar_format": "{l_bar}{bar}| {n:.0f}/{total:.0f} s{postfix}"}
        bar = tqdm(total=self._total, initial=self._done, unit="sample", **style)
        bar.start_t -= elapsed
        return bar


@contextmanager
def phase(title: str, progress: Progress = None) -> Iterator[None]:
    """Show a line with a title and the time spent, if the block takes longer than `DELAY` seconds.

    A thread writes the line, so the block needs no calls in it. The thread has ended when the block has.

    Parameters
    ----------
    title
        What is being done, such as "loading bunny.obj".
    progress
        True or None shows the line. False shows none, and neither does a function: it counts samples.
    """
    if progress is not None and progress is not True:
        yield
        return
    ended = threading.Event()
    writer = threading.Thread(target=_show, args=(title, ended), daemon=True)
    with suppress(RuntimeError):  # where no further thread can be had there is no line
        writer.start()
    try:
        yield
    finally:
        ended.set()
        if writer.is_alive():
            writer.join()


def _show(title: str, ended: threading.Event) -> None:
    """Write the line of a phase until it has ended."""
    start = time.monotonic()
    if ended.wait(DELAY):
        return
    from tqdm import tqdm  # as above

    with tqdm(desc=title, bar_format="{desc}: {elapsed}") as line:
        line.start_t -= time.monotonic() - start
        while not ended.wait(TICK):
            line.refresh()
