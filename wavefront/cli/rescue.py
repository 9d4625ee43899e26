"""Saving a finished picture elsewhere when it cannot be saved at its path."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

from ..core.errors import SaveError

MAX_STEM = 40  # characters of the name that are kept
ALWAYS = ".npz"  # can hold any picture, with all that belongs to it


def save_elsewhere(save: Callable[[Path], None], path: str) -> Path | None:
    """Save a picture that could not be saved at `path` under another name.

    Parameters
    ----------
    save
        Saves the picture at a path, by its extension.
    path
        The path that failed.

    Returns
    -------
    Path
        The new path: in the folder of `path`, in the current folder or in the system's folder for temporary
        files, in the format of `path`, else as npz. No file is replaced. None if none of these can be
        written.
    """
    extension = Path(path).suffix.lower()
    for ending in dict.fromkeys((extension, ALWAYS)):
        for folder in _folders(path):
            place = _free_name(folder, Path(path).stem[:MAX_STEM], ending)
            try:
                save(place)
            except (SaveError, MemoryError):
                continue
            return place
    return None


def _folders(path: str) -> Iterator[Path]:
    for find in (lambda: os.path.dirname(os.path.realpath(path)), os.getcwd, tempfile.gettempdir):
        try:
            yield Path(find())
        except (OSError, ValueError):  # the folder does not exist any more, or the name is invalid
            continue


def _free_name(folder: Path, stem: str, ending: str) -> Path:
    """Return a path at which there is no file."""
    place, count = folder / f"{stem}-saved{ending}", 1
    while os.path.lexists(place):
        count += 1
        place = folder / f"{stem}-saved-{count}{ending}"
    return place
