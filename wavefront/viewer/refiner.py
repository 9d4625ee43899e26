"""The loop of a viewer: a picture that refines, and begins anew whenever the view changes."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

from ..arrays.soa import soa
from ..camera import Camera
from ..drive import Session
from ..image import Image

FIRST_DIVISOR = 4  # of the width and height of the first picture of a view; more would leave little to see
TOO_LONG, SHORT = 0.06, 0.015  # seconds for the first picture of a view; the next one is smaller, or larger
LEAST_SIDE = 16  # pixels of the first picture of a view
PATIENCE = 2.0  # seconds that the first view waits in lower resolution for somebody to look at it


@soa
class ViewerFrame:
    """A picture of a view."""

    image: Image
    camera: Camera  # of the whole view
    final: bool  # no better one of this view follows


Show = Callable[[ViewerFrame], object]
Fail = Callable[[Exception], object]


class Refiner:
    """Refines the picture of a view that may change at any time.

    A change begins with one picture of lower resolution, which is small enough to come at once and is always
    finished, so that a view that moves all the time is seen to move. Then the picture refines in full
    resolution until the session has all its samples; a further change stops that at once.

    The last picture of a view is that of `render` with its camera, bit for bit.

    Until somebody looks the first view stays at its lower resolution, for a while: a browser that loads the
    page needs the processor.

    Parameters
    ----------
    session
        Renders the pictures. The refiner keeps its workers, and closes it.
    show
        Called with each picture, in the refiner's thread.
    fail
        Called with an error that ends the pictures of a view, in the same thread; another view may do.
    """

    def __init__(self, session: Session, show: Show, fail: Fail) -> None:
        self._session, self._show, self._fail = session, show, fail
        self._lock = threading.Condition()
        self._wanted: Camera | None = None
        self._changes = 0  # of the view, so far
        self._refines = False  # in full resolution; a change stops that
        self._closed = False
        self._next: Session | None = None  # in place of the one that is rendered
        self._looked_at = threading.Event()
        self._divisor = FIRST_DIVISOR
        self._thread = threading.Thread(target=self._loop, name="wavefront-viewer", daemon=True)

    def start(self) -> None:
        """Start the workers, before there are other threads, and wait for views, in a thread."""
        self._session.__enter__()
        self._session.start_workers()
        self._thread.start()

    def refine(self) -> None:
        """Let the pictures refine, as somebody looks. It can be called from any thread."""
        self._looked_at.set()

    def look(self, camera: Camera) -> None:
        """Show the view of a camera from now on. It can be called from any thread, and returns at once."""
        with self._lock:
            self._wanted = camera
            self._changed()

    def replace(self, session: Session, camera: Camera) -> None:
        """Render another session from now on, in place of the one before, which is closed."""
        with self._lock:
            if self._next is not None:
                self._next.close()
            self._next, self._wanted = session, camera
            self._changed()

    def close(self) -> None:
        """End the thread and the session."""
        with self._lock:
            self._closed = True
            self._changed()
        self.refine()
        if self._thread.is_alive():
            self._thread.join()
        self._session.close()
        if self._next is not None:
            self._next.close()

    def _changed(self) -> None:
        """Wake the loop, or stop the picture that refines; the lock is held."""
        self._changes += 1
        if self._refines or self._closed:
            self._session.drop()
        self._lock.notify()

    def _loop(self) -> None:
        done = 0
        while True:
            with self._lock:
                while not self._closed and self._changes == done:
                    self._lock.wait()
                if self._closed:
                    return
                assert self._wanted is not None
                camera, done = self._wanted, self._changes
                other, self._next = self._next, None
            try:
                if other is not None:
                    self._take(other)
                self._render(camera, done)
            except Exception as error:  # also of a user's own material: the loop goes on
                self._fail(error)

    def _take(self, session: Session) -> None:
        """Go on with another session."""
        before = self._session
        with self._lock:
            self._session = session
        before.close()
        session.__enter__()
        session.start_workers()

    def _render(self, camera: Camera, change: int) -> None:
        """Show pictures of a view until it is done or another one is wanted."""
        size = self._small(camera.resolution)
        if size != camera.resolution:
            self._show_first(camera, size)
        self._looked_at.wait(PATIENCE)
        self.refine()
        if not self._begin(camera, change):
            return
        try:
            image: Image | None = None
            for image in self._session:
                if self._superseded(change):
                    return
                self._show(ViewerFrame(image, camera, final=False))
            if image is not None and not self._superseded(change):
                self._show(ViewerFrame(image, camera, final=True))
        finally:
            with self._lock:
                self._refines = False

    def _show_first(self, camera: Camera, size: tuple[int, int]) -> None:
        """Show a picture of one sample per pixel in a lower resolution, and learn how long that takes."""
        begin = time.perf_counter()
        self._session.set_camera(camera, size)
        image = next(self._session, None)
        if image is None:
            return
        self._show(ViewerFrame(image, camera, final=False))
        seconds = time.perf_counter() - begin
        if seconds > TOO_LONG:
            self._divisor = min(FIRST_DIVISOR, 2 * self._divisor)
        elif seconds < SHORT:
            self._divisor = max(1, self._divisor // 2)

    def _begin(self, camera: Camera, change: int) -> bool:
        """Begin the picture in full resolution; return whether the view is still wanted."""
        if self._superseded(change):
            return False
        self._session.set_camera(camera)
        with self._lock:
            self._refines = self._changes == change
            return self._refines

    def _superseded(self, change: int) -> bool:
        with self._lock:
            return self._closed or self._changes != change

    def _small(self, size: tuple[int, int]) -> tuple[int, int]:
        """Return the size of the first picture of a view."""
        divisor = min(self._divisor, max(1, min(size) // LEAST_SIDE))
        return size[0] // divisor, size[1] // divisor
