"""OFF, read by trimesh after a check of its text: trimesh ignores short lines, and colors."""

from __future__ import annotations

from typing import Any

from ..core.errors import SceneError
from ..core.files import decode_text
from ..core.plural import plural
from .losses import Losses
from .trimesh_loading import by_trimesh

HEADERS = {"OFF": [], "COFF": ["colors of vertices"], "NOFF": ["normals"], "STOFF": ["texture coordinates"]}


def parse(losses: Losses, data: bytes, materials: bool) -> Any:
    """Return the trimesh scene of an OFF file.

    Raises
    ------
    SceneError
        If a line is malformed. The message names the file and the line.
    """
    name = losses.name
    lines = [line.partition("#")[0].split() for line in decode_text(data).split("\n")]
    rows = [(number, words) for number, words in enumerate(lines, 1) if words]
    first = rows[0][1][0].upper() if rows else ""
    header = first.rstrip("0123456789")  # some files have the counts at once after it: OFF8 6 12
    if header not in HEADERS:
        raise SceneError(f"{name}: begins with {first[:20]!r}; it must be one of {', '.join(HEADERS)}")
    rows[0] = (rows[0][0], [word for word in (first[len(header) :], *rows[0][1][1:]) if word])
    if not rows[0][1]:
        del rows[0]
    (vertices, faces), rows = _counts(name, rows), rows[1:]
    if len(rows) < vertices + faces:
        claimed = f"{plural(vertices, 'vertex', 'vertices')} and {plural(faces, 'face')}"
        raise SceneError(f"{name}: claims {claimed}; {plural(len(rows), 'line is', 'lines are')} there")
    for number, words in rows[:vertices]:
        if len(words) < 3 or not all(map(_is_number, words[:3])):
            raise SceneError(f"{name} line {number}: vertex is {' '.join(words)!r}; it must be 3 numbers")
    for number, words in rows[vertices : vertices + faces]:
        _check_face(name, number, words, vertices)
    lost = list(HEADERS[header])
    if any(len(words) > int(words[0]) + 1 for _, words in rows[vertices : vertices + faces]):
        lost.append("colors of faces")
    for each in lost if materials else ():
        losses.note(each)
    # only the counts and the rows that they cover: trimesh would also read the lines after them
    text = [f"OFF\n{vertices} {faces} 0", *(" ".join(words) for _, words in rows[: vertices + faces])]
    return by_trimesh(name, "\n".join(text).encode(), "off")


def _counts(name: str, rows: list[tuple[int, list[str]]]) -> tuple[int, int]:
    number, words = rows[0] if rows else (1, [])
    if len(words) < 2 or not all(map(_is_whole, words[:2])):
        raise SceneError(f"{name} line {number}: counts are {' '.join(words)!r}; they must be whole numbers")
    return int(words[0]), int(words[1])


def _check_face(name: str, number: int, words: list[str], vertices: int) -> None:
    where, text = f"{name} line {number}: face", " ".join(words[:9])
    count = int(words[0]) if _is_whole(words[0]) else 0
    if count < 3 or len(words) <= count:
        raise SceneError(f"{where} is {text!r}; it must be a count of at least 3 and as many indices")
    for word in words[1 : count + 1]:
        if not (_is_whole(word) and int(word) < vertices):
            raise SceneError(f"{where} uses vertex {word}; it must be in [0, {vertices - 1}]")


def _is_whole(word: str) -> bool:
    """Return whether a word is a whole number of at least 0 that an int64 holds."""
    return word.isdecimal() and word.isascii() and len(word) < 18


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return word.isascii() and "_" not in word
