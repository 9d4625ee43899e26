"""A finished picture is not lost because it cannot be saved where it was meant to go."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

from .errors import SaveError

MAX_STEM = 40  # characters of a name that are kept
ALWAYS = ".npy"  # holds any picture


def save_elsewhere(save: Callable[[Path], None], path: str) -> Path | None:
    """Save a picture that could not be saved at `path` at a place of its own.

    Parameters
    ----------
    save
        Saves the picture at a path, by its extension.
    path
        Where it was meant to go.

    Returns
    -------
    Path
        Where it is: beside `path`, in the current folder or in the system's folder for temporary
        files, as png, jpg, exr, hdr or npy like `path`, else as npy. No file is replaced. None if
        nothing can be written anywhere.
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
        except (OSError, ValueError):  # the folder is gone, or the name is none
            continue


def _free_name(folder: Path, stem: str, ending: str) -> Path:
    """Return a name that no file has."""
    place, count = folder / f"{stem}-saved{ending}", 1
    while os.path.lexists(place):
        count += 1
        place = folder / f"{stem}-saved-{count}{ending}"
    return place
