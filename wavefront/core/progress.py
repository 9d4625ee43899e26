"""Progress of a render, shown as a bar or passed to a function, and a line for other work that takes long."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import Any, Self, TypeAlias

Progress: TypeAlias = Callable[[float, float], object] | bool | None

DELAY = 2  # seconds before anything appears
TICK = 1  # seconds between updates while nothing is done


class Bar:
    """Shows the progress of a render, or passes it to the user's function.

    Parameters
    ----------
    progress
        True or None shows a bar, False shows none; a function is called with the progress and the total.
    samples
        Number of samples at most.
    seconds
        Time limit; if given, progress counts seconds in place of samples.
    end
        How the render ends if the number of samples is not known before. A bar shows it in place of a total.
    unit
        The unit that is counted, if not samples.
    """

    def __init__(
        self,
        progress: Progress,
        samples: int,
        seconds: float | None,
        end: str | None = None,
        unit: str = "sample",
    ) -> None:
        self._callback = progress if callable(progress) else None
        self._wanted = progress is None or progress is True
        self._timed, self._end, self._unit = seconds is not None, end, unit
        self._total = samples if seconds is None else seconds
        self._done: float = 0
        self._told: float = 0  # time of the last report, in seconds
        self._bar: Any = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        if self._bar is not None:
            self._bar.close()

    def advance(self, samples: int, elapsed: float) -> None:
        """Record further samples, `elapsed` seconds after the start."""
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
        """Record that no samples have arrived, and how many surfaces the longest path has met.

        It may be called often: the bar is updated, or the user's function called, every `TICK` seconds.
        """
        if elapsed - self._told < TICK:
            return
        self.advance(0, elapsed)
        if self._bar is not None:
            self._bar.set_postfix_str(f"paths of {surfaces} surfaces under way")

    def _appear(self, elapsed: float) -> Any:
        from tqdm import tqdm  # imported here, to keep start-up and short renders quick

        style: dict[str, Any] = {"unit_scale": self._unit == "sample"}
        if self._timed:
            style = {"bar_format": "{l_bar}{bar}| {n:.0f}/{total:.0f} s{postfix}"}
        if self._end is not None:
            style["bar_format"] = "{n_fmt} samples [{elapsed}, {rate_fmt}{postfix}] " + f"ends {self._end}"
        bar = tqdm(total=self._total, initial=self._done, unit=self._unit, file=_Screen(), **style)
        if not bar.disable:  # by the environment variable TQDM_DISABLE
            bar.start_t -= elapsed
        return bar


class _Screen:
    """The standard error, if any: text that it cannot show is lost, without an error.

    It is None in programs without a console, and may be closed, full, or a pipe that nobody reads.
    """

    def __init__(self) -> None:
        self._file: Any = sys.stderr

    def __getattr__(self, name: str) -> Any:
        """Return everything else of the file."""
        return getattr(self._file, name)

    def write(self, text: str) -> None:
        """Write if that is possible."""
        with suppress(Exception):
            self._file.write(text)

    def flush(self) -> None:
        """Show the written text if that is possible."""
        with suppress(Exception):
            self._file.flush()


@contextmanager
def phase(title: str, progress: Progress = None) -> Iterator[None]:
    """Show a line with a title and the time spent, if the block takes longer than `DELAY` seconds.

    A thread writes the line, so the block needs no calls. The thread ends with the block.

    Parameters
    ----------
    title
        The work, such as "loading bunny.obj".
    progress
        True or None shows the line. False shows none, and neither does a function, which counts samples.
    """
    if progress is not None and progress is not True:
        yield
        return
    ended = threading.Event()
    writer = threading.Thread(target=_show, args=(title, ended), daemon=True)
    try:
        with suppress(RuntimeError):  # without a thread there is no line
            writer.start()
        yield
    finally:
        ended.set()
        if writer.is_alive():
            writer.join()


def _show(title: str, ended: threading.Event) -> None:
    """Write the line of a phase until `ended` is set."""
    start = time.monotonic()
    if ended.wait(DELAY):
        return
    from tqdm import tqdm  # as above

    with tqdm(desc=title, bar_format="{desc}: {elapsed}", file=_Screen()) as line:
        if not line.disable:
            line.start_t -= time.monotonic() - start
        while not ended.wait(TICK):
            line.refresh()
