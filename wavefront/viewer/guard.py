"""What a page may do: move its camera and set values, from pages of this server alone."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any
from urllib.parse import urlsplit

LOCAL = ("localhost", "127.0.0.1", "::1")
FORBIDDEN = 1008  # close code of a WebSocket: policy violation (RFC 6455, 7.4.1)


def may_connect(origin: str | None, host: str | None, own: str) -> bool:
    """Return whether a page may connect.

    Browsers let pages of any site open WebSockets to this machine, and say in the header Origin which site
    it is. It must be the server that is connected to. A server of this machine alone must also be called by a
    name of this machine, since other names can be made to lead here (DNS rebinding).

    Parameters
    ----------
    origin, host
        The headers of the request. Programs other than browsers send no Origin.
    own
        The host that the server listens at.
    """
    if origin is not None and urlsplit(origin).netloc != host:
        return False
    name = urlsplit(f"//{host}").hostname
    return own not in LOCAL or name in LOCAL


def guard(server: Any, own: str, let_in: Callable[[], object]) -> None:
    """Refuse pages of other sites, and all messages but cameras and values, of a `viser.ViserServer`.

    Viser itself also takes uploads, commands, and the request to open a tunnel to the internet.

    Parameters
    ----------
    server
        The server.
    own
        The host that it listens at.
    let_in
        Called before anything is sent to a page that may connect.
    """
    from viser._messages import GuiUpdateMessage

    sockets = server._websock_server

    async def check(connection: Any) -> None:
        socket = sockets._live_connections[connection.client_id]
        headers = socket.request.headers
        if not may_connect(headers.get("Origin"), headers.get("Host"), own):
            await socket.close(FORBIDDEN, "this page is of another site")
        else:
            let_in()

    async def update(client_id: Any, message: Any) -> None:
        if is_value(message.updates):
            await server.gui._handle_gui_updates(client_id, message)

    sockets._client_connect_cb.insert(0, check)  # before any message is sent
    for kind in list(sockets._incoming_handlers):
        sockets.unregister_handler(kind)
    sockets.register_handler(GuiUpdateMessage, update)


def is_value(updates: Any) -> bool:
    """Return whether an update sets the value of an element, and nothing else of it."""
    if not isinstance(updates, dict) or updates.keys() != {"value"}:
        return False
    return isinstance(updates["value"], bool | int | float | str)
