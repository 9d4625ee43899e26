"""A render in a notebook: its picture refines below the cell."""

from __future__ import annotations

import sys
import threading
import time
from contextlib import suppress
from typing import Any

from ..core.errors import Interrupted, RenderError
from ..core.progress import Progress
from ..image import Image
from . import Session

DELAY = 0.3  # seconds before a picture appears; of shorter renders there is only the result
INTERVAL = 0.5  # seconds from one picture to the next, at least
SHARE = 0.1  # of the time that showing pictures may take
MOST_CLEANED = 1 << 20  # pixels of a picture that is denoised to be shown, within a second or two


def shows_pictures(progress: Progress) -> bool:
    """Return whether a render is to show its picture while it goes on.

    It does in a kernel of Jupyter, whose frontends can replace a picture, unless `progress` is False or a
    function.
    """
    if progress is not None and progress is not True:
        return False
    in_main_thread = threading.current_thread() is threading.main_thread()
    return in_main_thread and in_kernel()


def in_kernel() -> bool:
    """Return whether this program runs in a kernel of Jupyter."""
    return any(kind.__name__ == "ZMQInteractiveShell" for kind in type(_shell()).__mro__)


def run_shown(session: Session) -> Image:
    """Render a session to the end, as `Session.run` does, and show the picture while it refines."""
    shown = LivePicture()
    try:
        for image in session:
            shown.refine(image)
    except (Interrupted, RenderError) as error:
        shown.end(error.image)
        raise
    shown.end(image)
    session.tell_hints(image)
    return image


class LivePicture:
    """A picture below the cell that is replaced by better ones; the first ones are denoised.

    A picture that cannot be shown is left out: the render goes on.

    When the cell ends with the last picture, as its result or with the error that holds it, Jupyter shows it
    once more. Then this one disappears.
    """

    def __init__(self) -> None:
        self._handle: Any = None
        self._last: Image | None = None
        self._next = time.perf_counter() + DELAY

    def refine(self, image: Image) -> None:
        """Show a picture, unless another one has been shown a moment ago."""
        begin = time.perf_counter()
        if begin < self._next:
            return
        self._put(_cleaned(image))
        end = time.perf_counter()
        self._next = end + max(INTERVAL, (end - begin) / SHARE)

    def end(self, image: Image | None) -> None:
        """Show the last picture, if there was one before."""
        if self._handle is None or image is None:
            return
        if image is not self._last:
            self._put(image)
        with suppress(Exception):
            _shell().events.register("post_run_cell", self._cell_ended)

    def _put(self, image: Image) -> None:
        from IPython.display import display  # it is there: this program runs in its kernel

        self._last = image
        with suppress(Exception):
            if self._handle is None:
                self._handle = display(image, display_id=True)
            else:
                self._handle.update(image)

    def _cell_ended(self, result: Any) -> None:
        """Remove the picture if the cell shows it as its result or with its error."""
        from IPython.display import HTML

        _shell().events.unregister("post_run_cell", self._cell_ended)
        shown = result.result, getattr(result.error_in_exec, "image", None)
        if any(image is self._last for image in shown):
            self._handle.update(HTML(""))


def _cleaned(image: Image) -> Image:
    """Return a picture of few samples denoised, where that is quick; others as they are."""
    from ..denoising import FEW, is_quick

    with suppress(Exception):  # of a library
        small = image.rgb.size <= 3 * MOST_CLEANED
        return image.denoise() if small and image.spp < FEW and is_quick() else image
    return image


def _shell() -> Any:
    """Return the shell of IPython; None in other programs."""
    ipython = sys.modules.get("IPython")
    return None if ipython is None else ipython.get_ipython()
