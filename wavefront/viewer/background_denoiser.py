"""Denoising beside the loop of a viewer: in a thread, and where it takes long in a process that can end."""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
import threading
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from ..core.errors import RenderError
from ..denoising import is_quick
from ..image import Image
from .priority import NICENESS
from .refiner import ViewerFrame

COMMAND = "from wavefront.viewer.background_denoiser import denoise_input; denoise_input()"


class BackgroundDenoiser:
    """Denoises the newest picture that is wanted, one at a time.

    A picture of the same view waits until the one before is done. One of another view ends it.

    Parameters
    ----------
    done
        Called with each picture and the denoised one, in the denoiser's thread.
    fail
        Called with an error, in the same thread; the next picture may do.
    """

    def __init__(
        self, done: Callable[[ViewerFrame, Image], object], fail: Callable[[Exception], object]
    ) -> None:
        self._done, self._fail = done, fail
        self._lock = threading.Condition()
        self._wanted: ViewerFrame | None = None
        self._current: ViewerFrame | None = None
        self._process: subprocess.Popen[bytes] | None = None
        self._closed = False
        self._thread = threading.Thread(target=self._loop, name="wavefront-denoiser", daemon=True)
        self._thread.start()

    def want(self, frame: ViewerFrame | None) -> None:
        """Denoise a picture next; None denoises none. It returns at once."""
        with self._lock:
            self._wanted = frame
            if self._current is not None and (frame is None or frame.camera is not self._current.camera):
                self._end_process()
            self._lock.notify()

    def close(self) -> None:
        """End the thread and its process."""
        with self._lock:
            self._closed = True
            self._end_process()
            self._lock.notify()
        self._thread.join()

    def _end_process(self) -> None:
        if self._process is not None:
            self._process.kill()

    def _loop(self) -> None:
        last: ViewerFrame | None = None
        while True:
            with self._lock:
                while not self._closed and (self._wanted is None or self._wanted is last):
                    self._lock.wait()
                if self._closed:
                    return
                self._current = last = self._wanted
            assert last is not None
            try:
                image = last.image.denoise() if is_quick() else self._denoised_elsewhere(last.image)
                if image is not None:
                    self._done(last, image)
            except Exception as error:  # of a library: the pictures go on as they are
                self._fail(error)
            with self._lock:
                self._current = None

    def _denoised_elsewhere(self, image: Image) -> Image | None:
        """Return a picture denoised by a process; None where that was ended."""
        package = str(Path(__file__).parents[2])
        path = os.pathsep.join(filter(None, (package, os.environ.get("PYTHONPATH"))))
        with self._lock:
            if self._closed:
                return None
            self._process = process = subprocess.Popen(
                [sys.executable, "-P", "-c", COMMAND],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                env={**os.environ, "PYTHONPATH": path},
            )
        output, errors = process.communicate(pickle.dumps(image))
        with self._lock:
            self._process = None
        if process.returncode < 0:  # it was ended
            return None
        if process.returncode:
            raise RenderError(errors.decode(errors="replace").strip().rpartition("\n")[2])
        return pickle.loads(output)


def denoise_input() -> None:
    """Denoise the picture that comes by standard input, and write it to standard output."""
    with suppress(OSError, AttributeError):
        os.nice(NICENESS)
    pickle.dump(pickle.load(sys.stdin.buffer).denoise(), sys.stdout.buffer)
