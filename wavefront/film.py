"""The film adds samples up to pixels; an Image is the result as data."""

from __future__ import annotations

import os
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .io.images import to_8bit, write_image
from .vec import Floats


class Film:
    """Sums of samples per pixel.

    The samples of a pixel are added one after the other in the order of their index, in float64,
    so the picture does not depend on how a render was cut into pieces.
    """

    def __init__(self, width: int, height: int) -> None:
        self.size = width, height
        self.total = np.zeros((3, width * height))
        self.count = np.zeros(width * height, np.int64)

    def add(self, first_pixel: int, radiance: Floats) -> None:
        """Add samples of consecutive pixels.

        Parameters
        ----------
        first_pixel
            Row-major index.
        radiance
            (3, samples, pixels): the next samples of each pixel.
        """
        _, samples, pixels = radiance.shape
        span = slice(first_pixel, first_pixel + pixels)
        terms = np.concatenate([self.total[:, None, span], radiance], axis=1, dtype=np.float64)
        # cumsum adds strictly in order, where sum would pair terms up by the array's layout
        self.total[:, span] = np.cumsum(terms, axis=1)[:, -1]
        self.count[span] += samples

    def image(self, spp: int, metadata: dict[str, Any]) -> Image:
        """Divide by the number of samples; a pixel without any is black."""
        width, height = self.size
        mean = self.total / np.maximum(self.count, 1)
        return Image(mean.T.reshape(height, width, 3).astype(np.float32), spp, metadata)


class Image:
    """A rendered picture.

    Attributes
    ----------
    rgb
        (H, W, 3) float32 linear radiance; row 0 is the top.
    spp
        Samples per pixel.
    metadata
        What was rendered and how: integrator, seed, accelerator, seconds, ...
    """

    def __init__(self, rgb: NDArray[np.float32], spp: int, metadata: dict[str, Any] | None = None) -> None:
        self.rgb = rgb
        self.spp = spp
        self.metadata = dict(metadata or {})

    def __repr__(self) -> str:
        """Give the size and the sample count."""
        height, width = self.rgb.shape[:2]
        return f"<Image {width}x{height}, {self.spp} spp>"

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> NDArray[Any]:
        """Return `rgb`."""
        return np.array(self.rgb, dtype=dtype, copy=copy)

    def save(self, path: str | os.PathLike[str], gamma: float | str = 2.2, exposure: float = 0.0) -> None:
        """Write the picture by its extension: png or jpg for display; exr, hdr and npy linear.

        Parameters
        ----------
        path
            Where to write.
        gamma
            png and jpg hold value^(1/gamma); "srgb" is the exact sRGB curve.
        exposure
            Stops (factors of 2) applied before encoding png and jpg.

        Raises
        ------
        SceneError
            If the extension is unknown, the folder is missing, or gamma is out of range.
        """
        write_image(path, self.rgb, gamma=gamma, exposure=exposure)

    def _repr_png_(self) -> bytes:
        """Show the picture in a notebook."""
        import imageio.v3 as iio  # here, so that starting up does not pay for it

        return bytes(iio.imwrite("<bytes>", to_8bit(self.rgb), extension=".png", plugin="pillow"))
