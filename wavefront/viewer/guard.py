"""The requests that a viewer answers: with its token, to its own address, and messages that it knows."""

from __future__ import annotations

import secrets
import socket
from contextlib import suppress
from functools import cache
from ipaddress import ip_address
from typing import Any, Literal
from urllib.parse import parse_qs, quote, urlsplit

from ..core.errors import SceneError

TOKEN_BYTES = 24  # of a token that is drawn: nobody can guess it
LARGEST_MESSAGE = 1 << 16  # bytes; cameras and values are much smaller


@cache  # so that a page that is open finds the next viewer at its address
def _drawn() -> str:
    """Return a token that is drawn once."""
    return secrets.token_hex(TOKEN_BYTES)


def token_of(token: str | bool) -> str:
    """Return the token that the address of a page has, "" for none.

    Parameters
    ----------
    token
        True draws one, the same as long as the program runs; False leaves it out; a text is taken.

    Raises
    ------
    SceneError
        If it is something else, or an empty text.
    """
    if isinstance(token, bool):
        return _drawn() if token else ""
    if not isinstance(token, str) or not token:
        raise SceneError(f"token is {token!r}; it must be a text that is not empty, True or False")
    return token


class Guard:
    """Refuses requests of those who do not know the token, and of pages of other sites.

    The token is in the address of the page, as that of Jupyter. No cookie holds it: browsers send cookies
    along with requests of any page.

    Parameters
    ----------
    host
        Where the server listens.
    token
        The `token=` that requests must have; "" for none.
    """

    def __init__(self, host: str, token: str) -> None:
        self._host, self._token = host, token
        self.query = f"?token={quote(token, safe='')}" if token else ""

    def refusal(self, path: str, headers: Any) -> str | None:
        """Return why a request is refused; None lets it in.

        Parameters
        ----------
        path
            The path and the query.
        headers
            A `Headers` of `websockets`.
        """
        hosts, origins = headers.get_all("Host"), headers.get_all("Origin")
        if len(hosts) != 1 or len(origins) > 1 or not is_own_address(hosts[0], self._host):
            return "this name is not the viewer's own: use its address, or the name that host= has"
        if origins and not _is_origin(origins[0], hosts[0]):
            return "this page is of another site"
        token = parse_qs(path.partition("?")[2]).get("token", [""])[0]
        if not secrets.compare_digest(token.encode(), self._token.encode()) and self._token:
            return "the token is missing or wrong: use the address that the viewer printed"
        return None


def is_own_address(host: str, served: str) -> bool:
    """Return whether a header Host names this machine.

    A page of another site can make its own name lead here (DNS rebinding); then its pages count as those of
    this server. It cannot do so with an address, nor with the names that are taken here.

    Parameters
    ----------
    host
        The header.
    served
        The host that the server listens at.
    """
    try:
        name = (urlsplit(f"//{host}").hostname or "").removesuffix(".")
    except ValueError:
        return False
    machine = socket.gethostname().lower()
    if name and name in ("localhost", served.lower(), machine, f"{machine}.local"):
        return True
    with suppress(ValueError):
        return bool(ip_address(name))
    return False


def _is_origin(origin: str, host: str) -> bool:
    """Return whether a header Origin is that of a page of this server."""
    with suppress(ValueError):
        return urlsplit(origin).netloc.lower() == host.lower()
    return False


def is_message(data: Any) -> bool:
    """Return whether a page may say this: a camera, a click, or the value of an element.

    Viser itself also takes uploads, commands, other properties of elements, and the request to open a tunnel
    to the internet, and prints a traceback for what is none of its messages.
    """
    from msgspec import DecodeError

    if not isinstance(data, bytes):
        return False
    try:
        _decoder().decode(data)
    except (DecodeError, RecursionError):
        return False
    return True


@cache
def _decoder() -> Any:
    """Return the decoder of the messages that a page may send; it refuses all others."""
    from msgspec import defstruct
    from msgspec.msgpack import Decoder

    strict: dict[str, Any] = {"tag_field": "type", "forbid_unknown_fields": True}
    triple = tuple[float, float, float]
    camera = defstruct(
        "Camera",
        [
            ("wxyz", tuple[float, float, float, float]),
            *((name, triple) for name in ("position", "look_at", "up_direction")),
            *((name, float) for name in ("fov", "near", "far", "image_height", "image_width")),
        ],
        tag="ViewerCameraMessage",
        **strict,
    )
    click = defstruct(
        "Click",
        [
            ("event_type", Literal["click"]),
            ("ray_origin", triple),
            ("ray_direction", triple),
            ("screen_pos", tuple[tuple[float, float]]),
            ("modifier", None),
        ],
        tag="ScenePointerMessage",
        **strict,
    )
    value = defstruct("Value", [("value", bool | int | float | str)], forbid_unknown_fields=True)
    update = defstruct("Update", [("uuid", str), ("updates", value)], tag="GuiUpdateMessage", **strict)
    return Decoder(camera | click | update)


def take_values(server: Any) -> None:
    """Let a `viser.ViserServer` ignore values that an element cannot have; it would print a traceback."""
    from viser._messages import GuiUpdateMessage

    async def update(client_id: Any, message: Any) -> None:
        with suppress(ValueError):
            await server.gui._handle_gui_updates(client_id, message)

    server._websock_server.unregister_handler(GuiUpdateMessage)
    server._websock_server.register_handler(GuiUpdateMessage, update)
