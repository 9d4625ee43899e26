"""Names of files inside other files: which of them are followed."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

from .errors import SceneError

ARCHIVES = (".npz", ".zip", ".gz", ".tar", ".7z", ".bz2", ".xz", ".zst")
GZIPPED = (".ply.gz", ".pbrt.gz")  # the files of pbrt that may be packed
SCHEMES = ("http:", "https:", "file:", "ftp:")


def followed(
    source: str | os.PathLike[str], reference: str, places: Sequence[Path], roots: Sequence[Path]
) -> list[Path]:
    """Return where a file that `source` refers to may be: in folders, whichever of them are allowed.

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
