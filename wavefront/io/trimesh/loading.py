"""Loading files by trimesh: errors become SceneErrors; images are read only from the file's own folder."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from io import BytesIO
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...codecs.encoding import to_codes
from ...core.errors import SceneError
from ...core.interrupt import repeated_ctrl_c
from ..sources import GRAY, SceneFiles
from .library import import_trimesh


class Images:
    """The images in a file's folder, for trimesh, which itself ignores missing and damaged images."""

    def __init__(self, files: SceneFiles) -> None:
        self.files = files
        self.error: SceneError | None = None
        self._found: dict[str, bytes] = {}

    def get(self, reference: str) -> bytes:
        """Return an image as a png, which is gray where it is missing or damaged."""
        if reference not in self._found:
            try:
                picture = self.files.picture(reference, instead=GRAY)
            except SceneError as error:
                self.error = self.error or error
                raise
            assert picture is not None
            self._found[reference] = _as_png(picture.codes)
        return self._found[reference]

    def report(self) -> None:
        """Raise the first error that trimesh ignored."""
        if self.error is not None:
            raise self.error


def _as_png(codes: NDArray[Any]) -> bytes:
    """Return a png of 8 bits."""
    from PIL import Image  # imported here to keep `import wavefront` quick

    if codes.dtype == np.float32:
        codes = to_codes(codes, "srgb")
    elif codes.dtype == np.uint16:
        codes = (codes >> 8).astype(np.uint8)
    out = BytesIO()
    Image.fromarray(codes[..., 0] if codes.shape[2] == 1 else codes).save(out, "PNG", compress_level=1)
    return out.getvalue()


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
