"""Loading files by trimesh: errors become SceneErrors; images are read only from the file's own folder."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from io import BytesIO
from typing import Any
from urllib.parse import unquote

import numpy as np

from ..codecs.images import decode_codes
from ..core.errors import SceneError
from ..core.interrupt import repeated_ctrl_c
from .sources import SceneFiles
from .trimesh_import import import_trimesh


class Images:
    """The images in a file's folder, for trimesh, which itself ignores missing and damaged images."""

    def __init__(self, files: SceneFiles) -> None:
        self.files = files
        self.missing: list[str] = []
        self.error: SceneError | None = None

    def get(self, reference: str) -> bytes:
        """Return the content of an image, after checking that it can be decoded."""
        try:
            file = self.files.find(reference)
            if not os.path.exists(file):
                file = self.files.find(unquote(reference))
            if os.path.exists(file):
                content = self.files.read(file)
                name = f"{self.files.name}: texture {reference!r}"
                decode_codes(content, name, self.files.budget)
                return content
        except SceneError as error:
            self.error = self.error or error
            raise
        self.missing.append(reference)
        raise FileNotFoundError(reference)

    def report(self) -> None:
        """Note missing images; raise the first error that trimesh ignored."""
        if self.error is not None:
            raise self.error
        for name in dict.fromkeys(self.missing):
            self.files.losses.note(f"texture {name!r}", value="missing", done="left out")


def by_trimesh(name: str, data: bytes, kind: str, images: Any = None, skip_materials: bool = False) -> Any:
    """Return the trimesh scene of a file, with nothing merged or dropped.

    Parameters
    ----------
    name
        File name, for messages.
    data
        The file.
    kind
        Its extension, without the dot.
    images
        The resolver by which trimesh reads other files.
    skip_materials
        The argument of that name of trimesh's loaders that have it.

    Raises
    ------
    SceneError
        For any error of trimesh but MemoryError.
    """
    trimesh = import_trimesh()
    options: dict[str, Any] = {"skip_materials": True} if skip_materials else {}
    with typed_errors(name, kind):
        if kind == "dae":
            return _unprocessed(trimesh.exchange.dae.load_collada(BytesIO(data), images))
        return trimesh.load_scene(BytesIO(data), file_type=kind, process=False, resolver=images, **options)


def geometries(name: str, kind: str, data: bytes) -> list[dict[str, Any]]:
    """Return the meshes that trimesh's loader reads; a trimesh object would round their colors to 8 bits.

    Raises
    ------
    SceneError
        For any error of the loader but MemoryError.
    """
    mesh_loaders = import_trimesh().exchange.load.mesh_loaders
    with typed_errors(name, kind):
        found = mesh_loaders[kind](BytesIO(data))
    return list(found["geometry"].values()) if "geometry" in found else [found]


@contextmanager
def typed_errors(name: str, kind: str) -> Iterator[None]:
    """Convert any error of a loader but MemoryError to a SceneError; silence NumPy's warnings."""
    try:
        with np.errstate(all="ignore"), repeated_ctrl_c():  # some of them swallow it
            yield
    except (MemoryError, SceneError):
        raise
    except Exception as error:
        raise SceneError(f"{name}: not a readable {kind} file: {error!r}") from error


def _unprocessed(loaded: dict[str, Any]) -> Any:
    """Build the scene that trimesh's loader of COLLADA describes; `load_scene` would merge its vertices."""
    trimesh = import_trimesh()
    scene = trimesh.Scene()
    scene.geometry.update(
        {key: trimesh.Trimesh(**mesh, process=False) for key, mesh in loaded["geometry"].items()}
    )
    for node in loaded["graph"]:
        scene.graph.update(**node)
    return scene
