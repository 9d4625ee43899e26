"""Where pictures go: those of several scenes, parts of pictures, and one that cannot be saved at its path."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from ..codecs.images import IMAGE_WRITERS
from ..core.errors import Interrupted, RenderError, SaveError
from ..core.files import make_folder
from ..image import Image
from .messages import ERROR, INTERRUPTED, print_error, print_note

PLACE = "{}"  # in a path, stands for the name of the scene's file without extension
MAX_STEM = 40  # characters of the name of such a picture that are kept
ALWAYS = ".npz"  # can hold any picture, with all that belongs to it


def whole_or_part(render: Callable[[], Image]) -> tuple[Image | None, int]:
    """Return a picture, or its state when its render was stopped or failed, and the exit status."""
    try:
        return render(), 0
    except Interrupted as stop:
        print_note(stop)
        return stop.image, INTERRUPTED
    except RenderError as error:
        print_error(error)
        return error.image, ERROR


def output_paths(scenes: Sequence[str], output: str) -> list[str]:
    """Return the path of the picture of each scene, and make their folder.

    Parameters
    ----------
    scenes
        Their files.
    output
        The path of one picture; or, for any number, a folder, which gets a png named as each file, or a path
        with "{}" in the place of that name.

    Raises
    ------
    SaveError
        If there are several scenes and one path, a scene is a picture, two pictures would have one name, or
        the folder cannot be made.
    """
    is_folder = output.endswith(("/", os.sep)) or os.path.isdir(output)
    if not is_folder and PLACE not in output:
        if len(scenes) > 1:
            last = scenes[-1]
            if Path(last).suffix.lower() in IMAGE_WRITERS:
                raise SaveError(f"{last}: is a picture in the place of a scene; -o {last} writes one")
            raise SaveError(
                f"{output}: is one path for the pictures of {len(scenes)} scenes; "
                f"-o must be a folder such as out/, or a path such as out/{PLACE}.exr"
            )
        return [output]
    pattern = output if PLACE in output else os.path.join(output, f"{PLACE}.png")
    paths = [pattern.replace(PLACE, Path(scene).stem) for scene in scenes]
    for at, path in enumerate(paths):
        if path in paths[:at]:
            raise SaveError(f"{path}: is the picture of {scenes[paths.index(path)]} and of {scenes[at]}")
        make_folder(os.path.dirname(path) or ".")
    return paths


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
