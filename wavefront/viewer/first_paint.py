"""The first page of a browser: that of viser, with a picture that is there before its scripts run."""

from __future__ import annotations

import asyncio
import gzip
import logging
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cached_property
from http import HTTPStatus
from pathlib import Path
from typing import Any

from .guard import LARGEST_MESSAGE, Guard, is_message

PICTURE = "/first.jpg"
WAIT = 10.0  # seconds that a page waits for the first picture
# The canvas of viser is clear at first, then black, then it would be faded in: the first picture stays until
# there is another one, or somebody acts. As the canvas has nothing but a picture, it needs neither smooth
# edges nor alpha.
HEAD = """<head>
    <style>
      html, body { height: 100%; margin: 0; background-color: #141414 }
      body { background: #141414 url(FIRST) center / auto 100% no-repeat }
      canvas[data-engine] { opacity: 1 !important }
      html:not(.drawn) canvas[data-engine] { opacity: 0 !important }
      html:not(.drawn) #root div:has(canvas) { background: none !important }
    </style>
    <script>
      (() => {
        const post = Worker.prototype.postMessage;  // the worker connects, with the token
        Worker.prototype.postMessage = function (data, ...rest) {
          if (data?.type === "set_server") data.server += "/" + location.search;
          return post.call(this, data, ...rest);
        };
        const context = HTMLCanvasElement.prototype.getContext;
        HTMLCanvasElement.prototype.getContext = function (kind, options) {
          const plain = kind.startsWith("webgl") ? { antialias: false, alpha: false } : {};
          return context.call(this, kind, { ...options, ...plain });
        };
        const side = 64, small = document.createElement("canvas");
        small.width = small.height = side;
        const pixels = small.getContext("2d", { willReadFrequently: true });
        pixels.imageSmoothingQuality = "high";
        const isColor = (code, k) => k % 4 < 3 && code;
        const fold = () => {  // the panel of a phone, which hides half of the picture, by its handle
          const handle = [...document.querySelectorAll("#root div")].find(
            div => div.style.cursor === "pointer" && div.textContent.trim() === "wavefront");
          const filled = handle && handle.parentElement.textContent.includes("save picture");
          if (!filled) return;
          clearInterval(folding);
          if (matchMedia("(max-width: 36em)").matches) handle.click();
        };
        const folding = setInterval(fold, 200);
        setTimeout(() => clearInterval(folding), 30000);  // where the panel is another one
        let end = Infinity;  // a picture may be black
        const look = () => {
          const canvas = document.querySelector("canvas[data-engine]");
          if (!canvas) return;
          end = Math.min(end, performance.now() + 5000);
          pixels.drawImage(canvas, 0, 0, side, side);
          const colored = pixels.getImageData(0, 0, side, side).data.filter(isColor).length;
          if (colored > side * side / 8 || performance.now() > end) show();  // more than the axes of viser
        };
        const timer = setInterval(look, 100);
        const show = () => {
          clearInterval(timer);
          document.documentElement.classList.add("drawn");
        };
        for (const act of ["pointerdown", "wheel", "keydown"]) addEventListener(act, show, { once: true });
      })();
    </script>"""


class FirstPaint:
    """Answers the requests of a page that loads: with the page, and with the newest picture.

    The scripts of viser take a second or so until they show their first picture. Until then the page has this
    one behind its canvas.

    Parameters
    ----------
    guard
        Says which requests are refused.
    picture
        Returns the newest picture as a jpg; None if there is none yet.
    let_in
        Called before anything is sent to a page that opens a WebSocket.
    """

    def __init__(
        self, guard: Guard, picture: Callable[[], bytes | None], let_in: Callable[[], object]
    ) -> None:
        self._guard, self._picture, self._let_in = guard, picture, let_in

    async def answer(self, request: Any) -> Any:
        """Return the response to a request of `websockets`; None leaves it to viser."""
        headers, path = request.headers, request.path.partition("?")[0]
        why = self._guard.refusal(request.path, headers)
        if why is not None:
            return _refused(HTTPStatus.FORBIDDEN, why)
        if headers.get("Upgrade", "").lower() == "websocket":
            if _protocol() not in headers.get("Sec-WebSocket-Protocol", ""):
                return _refused(HTTPStatus.BAD_REQUEST, "this page is of another version: load it again")
            self._let_in()
            return None
        if path == PICTURE:
            jpg = await self._first()
            return None if jpg is None else _response("image/jpeg", jpg)
        if path != "/":
            return None
        if "gzip" not in headers.get("Accept-Encoding", ""):
            return _response("text/html; charset=utf-8", self._page)
        return _response("text/html; charset=utf-8", self._gzipped, ("Content-Encoding", "gzip"))

    async def _first(self) -> bytes | None:
        """Return the newest picture; wait for it for a while."""
        end = time.monotonic() + WAIT
        while (jpg := self._picture()) is None and time.monotonic() < end:
            await asyncio.sleep(0.01)
        return jpg

    @cached_property
    def _page(self) -> bytes:
        """The page of viser with our head."""
        import viser

        page = (Path(viser.__file__).parent / "client" / "build" / "index.html").read_text("utf-8")
        head = HEAD.replace("FIRST", PICTURE + self._guard.query)
        page = page.replace("<head>", head, 1).replace("<title>Viser</title>", "<title>wavefront</title>", 1)
        return page.encode()

    @cached_property
    def _gzipped(self) -> bytes:
        return gzip.compress(self._page, 1)  # its script is compressed, so more effort gains nothing


@contextmanager
def asked_first(first_paint: FirstPaint) -> Iterator[None]:
    """Let servers of viser that start meanwhile ask `first_paint` first, and hear only its messages.

    The server of `websockets` takes all that is needed as parameters: a function that answers requests, a
    class of connections, a limit and a logger. Viser calls it with its own ones, and has no parameters for
    others, so `serve` is replaced while viser starts. Servers that others start meanwhile are left as they
    are. Nothing is logged: an error would be a traceback for each request that is none.
    """
    from websockets.asyncio import server

    serve = server.serve
    silent = logging.Logger("wavefront.viewer")
    silent.addHandler(logging.NullHandler())

    class PageConnection(server.ServerConnection):
        """Leaves out messages that a page may not send."""

        async def recv(self, *arguments: Any, **options: Any) -> Any:
            while not is_message(data := await super().recv(*arguments, **options)):
                pass
            return data

    def serve_asking(
        *arguments: Any, process_request: Callable[..., Any] | None = None, **options: Any
    ) -> Any:
        if getattr(process_request, "__module__", "").partition(".")[0] != "viser":
            return serve(*arguments, process_request=process_request, **options)

        async def answer(connection: Any, request: Any) -> Any:
            assert process_request is not None
            try:
                return await first_paint.answer(request) or process_request(connection, request)
            except (OSError, ValueError):  # a path that the file system does not take, such as a long one
                return _refused(HTTPStatus.NOT_FOUND, "there is no such file")

        ours: dict[str, Any] = {
            "process_request": answer,
            "create_connection": PageConnection,
            "max_size": LARGEST_MESSAGE,
            "logger": silent,
        }
        return serve(*arguments, **(options | ours))

    server.serve = serve_asking  # type: ignore[assignment, misc]
    try:
        yield
    finally:
        server.serve = serve  # type: ignore[misc]


def _protocol() -> str:
    """Return the subprotocol of the pages of viser."""
    import viser

    return f"viser-v{viser.__version__}"


def _refused(status: HTTPStatus, why: str) -> Any:
    return _response("text/plain; charset=utf-8", f"wavefront: {why}\n".encode(), status=status)


def _response(kind: str, body: bytes, *headers: tuple[str, str], status: HTTPStatus = HTTPStatus.OK) -> Any:
    from websockets.datastructures import Headers
    from websockets.http11 import Response

    fixed = {
        "Content-Type": kind,
        "Content-Length": str(len(body)),
        "Cache-Control": "no-store",
        "Cross-Origin-Resource-Policy": "same-origin",  # pages of other sites cannot show it
        "Referrer-Policy": "no-referrer",  # nor learn the token
    }
    return Response(status, status.phrase, Headers([*fixed.items(), *headers]), body)
