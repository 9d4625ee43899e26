"""Worker processes: copies of this one, with one pipe to each for pieces and one back for results.

The parent needs no further threads: while it waits for the next result in order, it takes those of
others, and gives each worker that is done the next piece. A worker ends when nobody holds the other
end of its pipe of pieces, so none outlives its parent.
"""

from __future__ import annotations

import os
import pickle
import select
import signal
import sys
import threading
import traceback
import warnings
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from itertools import islice
from typing import Any, BinaryIO, Generic, TypeVar

import numpy as np

from .errors import SceneError

Piece = TypeVar("Piece")
Result = TypeVar("Result")

RETRIES = 2  # times that a lost process is replaced
LARGEST_BLOCK = 31 << 20  # bytes; larger ones do not move glibc's limits


@dataclass(slots=True, eq=False)
class Task:
    """A piece under way."""

    piece: Any
    done: bool = False
    result: Any = None
    error: BaseException | None = None  # what came in place of a result


@dataclass(slots=True, eq=False)
class Process:
    """A worker as its parent sees it."""

    pid: int
    pieces: BinaryIO
    results: BinaryIO
    task: Task | None = None  # what it is doing

    def hang_up(self) -> None:
        """Close the pipes."""
        for pipe in (self.pieces, self.results):
            with suppress(OSError):  # there may be a piece in it that a dead worker did not read
                pipe.close()

    def end(self) -> None:
        """End it, whatever it is doing."""
        self.hang_up()
        with suppress(ChildProcessError):  # somebody else has waited for it
            if os.waitpid(self.pid, os.WNOHANG) == (0, 0):
                os.kill(self.pid, signal.SIGKILL)
                os.waitpid(self.pid, 0)


class Processes(Generic[Piece, Result]):
    """Worker processes that do one kind of work.

    Parameters
    ----------
    work
        Turns a piece into its result. A worker has a copy of all that it refers to, as it was when
        the worker was forked: at one of the first pieces. Pieces and results are pickled.
    count
        Number of workers.
    """

    def __init__(self, work: Callable[[Piece], Result], count: int) -> None:
        self._work, self._count = work, count
        self._crew: dict[int, Process] = {}  # by file descriptor of results
        self._poll = select.poll()
        self._retries = RETRIES

    def run(self, pieces: Iterable[Piece]) -> Iterator[tuple[Piece, Result]]:
        """Yield each piece with its result, in the order of the pieces.

        Raises
        ------
        SceneError
            If workers die again and again.
        """
        source = iter(pieces)
        line: deque[Task] = deque()
        while (task := self._next(source, line)) is not None:
            yield task.piece, task.result

    def close(self) -> None:
        """End all workers, whatever they are doing."""
        for process in self._crew.values():
            process.end()
        self._crew.clear()
        self._poll = select.poll()

    def _next(self, source: Iterator[Piece], line: deque[Task]) -> Task | None:
        """Keep workers busy until the first of the tasks in line is done; return it, None for no more."""
        try:
            while True:
                self._collect(wait=not line[0].done if line else self._free() == 0)
                self._hand_out(source, line)
                if not line:
                    return None
                if line[0].done:
                    break
            task = line.popleft()
            if task.error is not None:
                raise task.error
            return task
        except BaseException:  # among them Ctrl-C, perhaps in the middle of a message
            self.close()
            raise

    def _hand_out(self, source: Iterator[Piece], line: deque[Task]) -> None:
        """Give pieces to workers that have none; hire workers as long as there are pieces for them."""
        for piece in islice(source, min(self._free(), 2 * self._count + 1 - len(line))):
            line.append(Task(piece))
            idle = (process for process in self._crew.values() if process.task is None)
            self._give(next(idle, None) or self._hire(), line[-1])

    def _free(self) -> int:
        """Workers without a piece, hired or not."""
        return self._count - sum(process.task is not None for process in self._crew.values())

    def _give(self, process: Process, task: Task) -> None:
        process.task = task
        with suppress(BrokenPipeError):  # it died; `_collect` will see that
            pickle.dump(task.piece, process.pieces, pickle.HIGHEST_PROTOCOL)
            process.pieces.flush()

    def _collect(self, wait: bool) -> None:
        """Take the results there are; with `wait`, at least one."""
        for number, _ in self._poll.poll(None if wait else 0):
            process = self._crew[number]
            task, process.task = process.task, None
            try:
                answer = pickle.load(process.results)
            except (EOFError, OSError, pickle.UnpicklingError):
                self._replace(number, task)
                continue
            assert task is not None
            task.done, (task.result, task.error) = True, answer

    def _replace(self, number: int, task: Task | None) -> None:
        """Have what a worker left undone when it died done by a new one."""
        process = self._crew.pop(number)
        self._poll.unregister(number)
        process.end()
        if task is None:
            return
        if not self._retries:
            raise SceneError(
                f"worker processes died {RETRIES + 1} times, at last with {task.piece} under way; were they "
                "killed for lack of memory? Use fewer workers or a smaller wave_size"
            )
        self._retries -= 1
        self._give(self._hire(), task)

    def _hire(self) -> Process:
        """Fork a worker."""
        pieces, our_pieces = os.pipe()
        our_results, results = os.pipe()
        with _forking():
            pid = os.fork()
            if pid == 0:
                try:
                    os.close(our_pieces)
                    os.close(our_results)
                    for sibling in self._crew.values():
                        sibling.hang_up()
                    _live(self._work, os.fdopen(pieces, "rb"), os.fdopen(results, "wb"))
                finally:
                    os._exit(1)  # nothing that the parent has begun is the worker's to end
            os.close(pieces)
            os.close(results)
            process = Process(pid, os.fdopen(our_pieces, "wb"), os.fdopen(our_results, "rb"))
            self._crew[our_results] = process
            self._poll.register(our_results, select.POLLIN)
        return process


@contextmanager
def _forking() -> Iterator[None]:
    """Let children be deaf to Ctrl-C, which the parent answers, and begin with nothing to print.

    Forking beside other threads is what Python warns of: a lock that one of them holds stays held in
    the child. Ours take none but their own, those that Python and the C library renew, and that of
    the standard streams.
    """
    _flush()
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", ".*fork.*", DeprecationWarning)
            yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _live(work: Callable[[Any], Any], pieces: BinaryIO, results: BinaryIO) -> None:
    """Be a worker process: answer pieces as long as some come."""
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    _prepare_heap()
    threading.Thread(target=_end_with_parent, args=(pieces,), daemon=True).start()
    with suppress(EOFError, BrokenPipeError):
        while True:
            answer = _answer(work, pickle.load(pieces))
            _flush()
            results.write(answer)
            results.flush()


def _prepare_heap() -> None:
    """Have glibc keep what is freed, in large pages; with another C library, do nothing of use.

    All memory of a young process is new, and the system hands it out page by page: 11 600 page faults
    in the first wave. After glibc has freed a block, it takes smaller ones from its heap, and keeps
    twice as much there before it gives any back; and NumPy asks for large pages under large arrays.
    """
    np.empty(LARGEST_BLOCK, np.uint8)
    nearly_twice = [np.empty(9 * LARGEST_BLOCK // 10, np.uint8) for _ in range(2)]
    del nearly_twice


def _end_with_parent(pieces: BinaryIO) -> None:
    """Wait until nobody holds the other end."""
    poll = select.poll()
    poll.register(pieces, 0)  # for hanging up alone
    poll.poll()
    os._exit(1)


def _answer(work: Callable[[Any], Any], piece: Any) -> bytes:
    """Return (result, None), or (None, what was raised), pickled."""
    try:
        return pickle.dumps((work(piece), None), pickle.HIGHEST_PROTOCOL)
    except BaseException as error:
        error.add_note("In a worker process:\n" + traceback.format_exc())
        return _pickled_error(error)


def _pickled_error(error: BaseException) -> bytes:
    """Pickle (None, error); what pickle cannot take apart and put together is described."""
    try:
        data = pickle.dumps((None, error))
        pickle.loads(data)
    except Exception:
        return pickle.dumps((None, RuntimeError(f"{type(error).__name__}: {error}")))
    return data


def _flush() -> None:
    for stream in (sys.stdout, sys.stderr):
        with suppress(AttributeError, ValueError, OSError):  # there is none, it is closed, nobody reads it
            stream.flush()
