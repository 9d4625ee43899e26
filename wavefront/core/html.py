"""Pieces of HTML that notebooks show for pictures, scenes and materials."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Callable, Sequence
from html import escape
from typing import Any

MOST_ROWS = 20  # of a table

Preview = Callable[[Any], bytes | None]
_PREVIEWS: list[Preview] = []


def register_preview(draw: Preview) -> None:
    """Let notebooks show materials by a picture.

    Parameters
    ----------
    draw
        Called with a material; returns a png file, or None where there is no picture of it.
    """
    _PREVIEWS[:] = [draw]


def preview_html(thing: Any) -> str:
    """Return a material as HTML: its picture, if it has one, and its text."""
    png = next((png for draw in _PREVIEWS if (png := draw(thing)) is not None), None)
    picture = "" if png is None else picture_html(png)
    return f"<div>{picture}<div><code>{escape(repr(thing))}</code></div></div>"


def picture_html(png: bytes) -> str:
    """Return a png file as HTML that holds it."""
    data = b64encode(png).decode("ascii")
    return f'<img src="data:image/png;base64,{data}" style="max-width:100%">'


def table_html(title: str, rows: Sequence[Sequence[Any]]) -> str:
    """Return a table with a title; "" without rows. Of many rows the first are shown, and how many more."""
    if not rows:
        return ""
    lines = [_row(row) for row in rows[:MOST_ROWS]]
    if len(rows) > MOST_ROWS:
        lines.append(_row([f"and {len(rows) - MOST_ROWS} more"]))
    caption = f'<caption style="text-align:left">{escape(title)}</caption>'
    return f"<table>{caption}{''.join(lines)}</table>"


def _row(cells: Sequence[Any]) -> str:
    columns = "".join(f'<td style="text-align:left">{escape(str(cell))}</td>' for cell in cells)
    return f"<tr>{columns}</tr>"
