"""Where the pictures of several scenes go."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

from ..core.errors import SaveError
from ..core.files import make_folder

PLACE = "{}"  # in a path, stands for the name of the scene's file without extension


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
        If there are several scenes and one path, two pictures would have one name, or the folder cannot be
        made.
    """
    is_folder = output.endswith(("/", os.sep)) or os.path.isdir(output)
    if not is_folder and PLACE not in output:
        if len(scenes) > 1:
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
