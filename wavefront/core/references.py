"""Names of files inside other files: which of them are followed."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from typing import TypeAlias
from urllib.parse import unquote

from .errors import SceneError

ARCHIVES = (".npz", ".zip", ".gz", ".tar", ".7z", ".bz2", ".xz", ".zst")
GZIPPED = (".ply.gz", ".pbrt.gz")  # the files of pbrt that may be packed
SCHEMES = ("http:", "https:", "file:", "ftp:")
MOST_PARTS = 8  # of a path, that are looked for in other folders


def followed(
    source: str | os.PathLike[str], reference: str, places: Sequence[Path], roots: Sequence[Path]
) -> list[Path]:
    """Return the places of a file that `source` refers to: in those folders that are allowed.

    A file from elsewhere must not make the program read arbitrary files. So the target of each reference must
    be inside one of the `roots`, also after symbolic links are followed.

    Parameters
    ----------
    source
        The file that has the reference, for messages.
    reference
        The name in it.
    places
        Folders where it is looked for.
    roots
        Folders, resolved, inside of which files may be read.

    Raises
    ------
    SceneError
        If the name is a URI, absolute, or that of an archive, or leads out of all roots.
    """
    name = reference.replace("\\", "/")
    refers = f"{os.fspath(source)}: refers to {reference!r}"
    if "://" in name or name.lower().startswith(SCHEMES):
        raise SceneError(f"{refers}; only files in its folder and the search paths are read")
    if name.lower().endswith(ARCHIVES) and not name.lower().endswith(GZIPPED):
        raise SceneError(f"{refers}; archives are not read")
    if name.startswith("/") or name[1:2] == ":":
        raise SceneError(f"{refers}; an absolute path is not followed")
    try:
        allowed = [
            place / name
            for place in places
            if any((place / name).resolve().is_relative_to(root) for root in roots)
        ]
    except (OSError, RuntimeError, ValueError) as error:
        raise SceneError(f"{refers}: {error}") from error
    if not allowed:
        raise SceneError(f"{refers}, which is outside its folder and the search paths")
    return allowed


Listed: TypeAlias = dict[Path, dict[str, str]]  # names in folders, by the same names without their case


def elsewhere(
    source: str | os.PathLike[str],
    reference: str,
    places: Sequence[Path],
    roots: Sequence[Path],
    listed: Listed,
) -> Path | None:
    """Return a file that a path of another machine may mean: its last parts, in one of some folders.

    `D:/someone/textures/wood.png` means `textures/wood.png`, or else `wood.png`. Where there is no file of
    this name, one whose name differs in case alone is taken.

    Parameters
    ----------
    source, reference, places, roots
        As of `followed`, whose rules hold for the file.
    listed
        The folders that were looked through before; those that are now are added.

    Returns
    -------
    Path or None
        The file, if there is one.
    """
    for exact in (True, False):
        for name in _names(reference):
            for place in places:
                file_name = name if exact else _in_any_case(place, name, roots, listed)
                if file_name is not None and os.path.isfile(place / file_name):
                    with suppress(SceneError):
                        return followed(source, file_name, [place], roots)[0]
    return None


def _names(reference: str) -> Iterator[str]:
    """Yield the last parts of a path, the longest first, as they are and as those of a URI."""
    path = reference.replace("\\", "/").strip("\"' ")
    if "://" in path or path.lower().startswith(SCHEMES):
        path = re.split("[?#]", path)[0]
    for text in dict.fromkeys((path, unquote(path))):
        bare = re.sub("^[A-Za-z][A-Za-z0-9+.-]*:", "", text)  # a scheme or a drive
        segments = [segment for segment in bare.split("/") if segment not in ("", ".", "..")]
        for start in range(max(0, len(segments) - MOST_PARTS), len(segments)):
            yield "/".join(segments[start:])


def _in_any_case(folder: Path, name: str, roots: Sequence[Path], listed: Listed) -> str | None:
    """Return a name as files in a folder have it, whose case may differ."""
    matched, here = [], folder
    for segment in name.split("/"):
        if here not in listed:
            inside = any(here.resolve().is_relative_to(root) for root in roots)
            listed[here] = {file.casefold(): file for file in _names_in(here)} if inside else {}
        alike = listed[here].get(segment.casefold())
        if alike is None:
            return None
        matched.append(alike)
        here = here / alike
    return "/".join(matched)


def _names_in(folder: Path) -> list[str]:
    try:
        return sorted(os.listdir(folder), reverse=True)  # of several alike the first one counts
    except OSError:
        return []
