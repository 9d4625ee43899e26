"""A process of its own for usd-core, which has no limits: it may crash, hang, or take all memory.

It is started with the first file, reads one file after the other, and ends when it was idle for a while. A
file that is beyond a limit ends it; the next one gets another process.
"""

from __future__ import annotations

import atexit
import os
import pickle
import queue
import signal
import struct
import subprocess
import sys
import tempfile
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO, Any

from ...codecs.budget import Budget
from ...core.errors import LimitError
from ...core.interrupt import SIGNALS

if sys.platform == "linux":
    import resource
else:
    resource = None

COMMAND = "from wavefront.io.usd.child import serve; serve()"
IDLE = 60.0  # seconds without a request after which the process ends
GRACE = 10  # seconds beyond its limit after which a process ends whose parent does not end it
RESERVED = 2**28  # bytes of memory that usd-core may take for any file
FRAME = struct.Struct("<Q")  # the length of the message that follows
# each thread of usd-core reserves addresses, which count as memory
QUIET = {"PXR_WORK_THREAD_LIMIT": "4", "MALLOC_ARENA_MAX": "2", "OPENBLAS_NUM_THREADS": "1"}


class Child:
    """A process that calls functions for this one."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._process: subprocess.Popen[bytes] | None = None
        self._owner = 0
        self._errors: IO[bytes] | None = None

    def call(self, name: str, seconds: float, function: Callable[..., Any], *arguments: Any) -> Any:
        """Return the value of a function that the child process calls, or raise its error.

        Raises
        ------
        LimitError
            If it takes longer than `seconds`, or the process ends; `name` is at its beginning.
        """
        request = pickle.dumps((os.getcwd(), int(seconds) + GRACE, function, arguments))
        with self._lock:
            for _ in range(2):  # the process may have been about to end
                reply, late = self._asked(request, seconds)
                if reply is not None or late or self._code() != 0:
                    break
            if reply is None:
                raise LimitError(f"{name}: {self._why(seconds, late)}")
        done, value = pickle.loads(reply)
        if not done:
            raise value
        return value

    def _asked(self, request: bytes, seconds: float) -> tuple[bytes | None, bool]:
        """Return the reply, None where the process ended, and whether it took too long."""
        process, late = self._running(), threading.Event()
        assert process.stdin is not None
        assert process.stdout is not None

        def end() -> None:
            late.set()
            process.kill()

        timer = threading.Timer(seconds, end)
        timer.daemon = True
        timer.start()
        try:
            with suppress(OSError):
                process.stdin.write(FRAME.pack(len(request)) + request)
                process.stdin.flush()
            return _framed(process.stdout), late.is_set()
        except BaseException:  # such as Ctrl-C: the reply would be taken for that to the next request
            process.kill()
            raise
        finally:
            timer.cancel()

    def _running(self) -> subprocess.Popen[bytes]:
        """Return the process; a new one if it has ended, or is that of the process which forked this one."""
        if self._process is None or self._owner != os.getpid() or self._process.poll() is not None:
            self.close()
            paths = [path for path in sys.path if os.path.isabs(path)]
            self._errors, self._owner = tempfile.TemporaryFile(), os.getpid()  # noqa: SIM115
            self._process = subprocess.Popen(
                [sys.executable, "-P", "-c", COMMAND],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=self._errors,
                env={**QUIET, **os.environ, "PYTHONPATH": os.pathsep.join(paths)},
            )
        return self._process

    def close(self) -> None:
        """End the process, if there is one."""
        process, self._process = self._process, None
        if process is None:
            return
        if self._owner == os.getpid():
            process.kill()
            process.wait()
        for pipe in (process.stdin, process.stdout, self._errors):
            if pipe is not None:
                with suppress(OSError):
                    pipe.close()

    def _code(self) -> int:
        """Return the exit status of a process that has ended."""
        assert self._process is not None
        return self._process.wait()

    def _why(self, seconds: float, late: bool) -> str:
        """Return why there is no reply."""
        code = self._code()
        if late:
            return f"takes more than {seconds:g} seconds to read; the limit is LoadLimits.seconds"
        assert self._errors is not None
        self._errors.seek(0)
        said = self._errors.read().decode(errors="replace")
        if "bad_alloc" in said or "MemoryError" in said:
            return "takes more memory than the limit LoadLimits.memory_bytes"
        ended = f"by signal {-code}" if code < 0 else f"with status {code}"
        return f"ends usd-core {ended}: it is damaged, or takes more memory than LoadLimits.memory_bytes"


CHILD = Child()
atexit.register(CHILD.close)


def _framed(stream: IO[bytes]) -> bytes | None:
    """Return the next message of a stream, None at the end."""
    with suppress(OSError):
        head = stream.read(FRAME.size)
        if len(head) == FRAME.size:
            (size,) = FRAME.unpack(head)
            body = stream.read(size)
            return body if len(body) == size else None
    return None


def serve() -> None:
    """Answer requests that come by standard input until it ends, or is idle."""
    for number in SIGNALS:
        signal.signal(number, signal.SIG_DFL if number == signal.SIGTERM else signal.SIG_IGN)
    replies = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # lines of usd-core are no reply
    requests: queue.SimpleQueue[bytes] = queue.SimpleQueue()
    threading.Thread(target=_listen, args=(requests,), daemon=True).start()
    with suppress(queue.Empty, OSError):
        while True:
            reply = _answered(requests.get(timeout=IDLE))
            replies.write(FRAME.pack(len(reply)) + reply)
            replies.flush()
    os._exit(0)


def _listen(requests: queue.SimpleQueue[bytes]) -> None:
    """Take requests, and end this process at once where the other one ends."""
    while (request := _framed(sys.stdin.buffer)) is not None:
        requests.put(request)
    os._exit(0)


@contextmanager
def limited_memory(budget: Budget) -> Iterator[None]:
    """Limit the memory of this process to its present one and a budget, where the system can (Linux)."""
    if resource is None:
        yield
        return
    before = resource.getrlimit(resource.RLIMIT_AS)
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    most = pages * resource.getpagesize() + RESERVED + budget.most
    allowed = [limit for limit in before if limit != resource.RLIM_INFINITY]
    resource.setrlimit(resource.RLIMIT_AS, (min([most, *allowed]), before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_AS, before)


def allow_memory(size: int) -> None:
    """Raise the limit of memory by so many bytes."""
    if resource is not None:
        most, hard = resource.getrlimit(resource.RLIMIT_AS)
        if most != resource.RLIM_INFINITY:
            higher = most + size
            resource.setrlimit(
                resource.RLIMIT_AS, (higher if hard == resource.RLIM_INFINITY else min(higher, hard), hard)
            )


def _answered(request: bytes) -> bytes:
    """Return whether a function succeeds, and its result or error."""
    folder, seconds, function, arguments = pickle.loads(request)
    if hasattr(signal, "alarm"):
        signal.alarm(seconds)
    try:
        os.chdir(folder)
        return pickle.dumps((True, function(*arguments)))
    except MemoryError:
        return pickle.dumps((False, MemoryError("usd-core needs more than LoadLimits.memory_bytes")))
    except Exception as error:
        return pickle.dumps((False, error.with_traceback(None)))
    finally:
        if hasattr(signal, "alarm"):
            signal.alarm(0)
