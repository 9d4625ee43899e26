"""The images of a COLLADA document, for trimesh, which reads its materials."""

from __future__ import annotations

from io import BytesIO
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...codecs.encoding import to_codes
from ...core.errors import SceneError
from ..sources import GRAY, SceneFiles


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
