"""What a browser sees first: the page of viser, with a picture that is there before its scripts run."""

from __future__ import annotations

import asyncio
import gzip
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from http import HTTPStatus
from pathlib import Path
from typing import Any

from .guard import may_connect

PICTURE = "/first.jpg"
WAIT = 10.0  # seconds that a page waits for the first picture
# The canvas of viser is clear at first, then black, then it would be faded in: the first picture stays until
# there is another one, or somebody acts. As the canvas has nothing but a picture, it needs neither smooth
# edges nor alpha.
HEAD = """<head>
    <style>
      html, body { height: 100%; margin: 0; background-color: #141414 }
      body { background: #141414 url(/first.jpg) center / auto 100% no-repeat }
      canvas[data-engine] { opacity: 1 !important }
      html:not(.drawn) canvas[data-engine] { opacity: 0 !important }
      html:not(.drawn) #root div:has(canvas) { background: none !important }
    </style>
    <script>
      (() => {
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


class Front:
    """Answers the requests of a page that loads: with the page, and with the newest picture.

    The scripts of viser take a second or so until they show their first picture. Until then the page has this
    one behind its canvas.

    Parameters
    ----------
    host
        Where the server listens.
    picture
        Returns the newest picture as a jpg; None if there is none yet.
    """

    def __init__(self, host: str, picture: Callable[[], bytes | None]) -> None:
        self._host, self._picture = host, picture

    async def answer(self, request: Any) -> Any:
        """Return the response to a request of `websockets`; None leaves it to viser."""
        headers, path = request.headers, request.path.partition("?")[0]
        if headers.get("Upgrade") == "websocket" or path not in ("/", PICTURE):
            return None
        if path == PICTURE:
            if not may_connect(headers.get("Origin"), headers.get("Host"), self._host):
                return None
            jpg = await self._first()
            return None if jpg is None else _response("image/jpeg", jpg)
        if "gzip" not in headers.get("Accept-Encoding", ""):
            return _response("text/html; charset=utf-8", _page())
        return _response("text/html; charset=utf-8", _page_gzipped(), ("Content-Encoding", "gzip"))

    async def _first(self) -> bytes | None:
        """Return the newest picture; wait for it for a while."""
        end = time.monotonic() + WAIT
        while (jpg := self._picture()) is None and time.monotonic() < end:
            await asyncio.sleep(0.01)
        return jpg


@contextmanager
def asked_first(front: Front) -> Iterator[None]:
    """Let servers of viser that are started meanwhile ask `front` before they answer a request.

    `websockets.asyncio.server.serve` takes a function for that, and viser calls it with its own one. Viser
    has no parameter for another, so `serve` is replaced while viser starts. Servers that others start
    meanwhile are left as they are.
    """
    from websockets.asyncio import server

    serve = server.serve

    def serve_asking(
        *arguments: Any, process_request: Callable[..., Any] | None = None, **options: Any
    ) -> Any:
        async def answer(connection: Any, request: Any) -> Any:
            assert process_request is not None
            return await front.answer(request) or process_request(connection, request)

        by_viser = getattr(process_request, "__module__", "").partition(".")[0] == "viser"
        return serve(*arguments, process_request=answer if by_viser else process_request, **options)

    server.serve = serve_asking  # type: ignore[assignment, misc]
    try:
        yield
    finally:
        server.serve = serve  # type: ignore[misc]


@cache
def _page() -> bytes:
    """Return the page of viser with our head."""
    import viser

    page = (Path(viser.__file__).parent / "client" / "build" / "index.html").read_text("utf-8")
    page = page.replace("<head>", HEAD, 1).replace("<title>Viser</title>", "<title>wavefront</title>", 1)
    return page.encode()


@cache
def _page_gzipped() -> bytes:
    return gzip.compress(_page(), 1)  # its script is compressed, so more effort gains nothing


def _response(kind: str, body: bytes, *headers: tuple[str, str]) -> Any:
    from websockets.datastructures import Headers
    from websockets.http11 import Response

    fixed = {
        "Content-Type": kind,
        "Content-Length": str(len(body)),
        "Cache-Control": "no-store",
        "Cross-Origin-Resource-Policy": "same-origin",  # pages of other sites cannot show it
    }
    return Response(HTTPStatus.OK, "OK", Headers([*fixed.items(), *headers]), body)
