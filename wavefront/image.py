"""An Image is a rendered picture as data."""

from __future__ import annotations

import os
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .io import png
from .io.images import to_8bit, write_image


class Image:
    """A rendered picture.

    Attributes
    ----------
    rgb
        (H, W, 3) float32 linear radiance; row 0 is the top.
    spp
        Samples per pixel; the rounded mean where pixels differ.
    metadata
        What was rendered and how: integrator, max_bounces, seed, sampler, filter, accelerator, workers,
        executor, seconds (wall time), spp (mean over pixels), samples, rays, bad_samples, interrupted,
        version (of this package), numpy, and noise (estimated relative error of the picture).
    counts
        (H, W) int64 samples of each pixel.
    variance
        (H, W, 3) float32 estimated variance of one sample; NaN where there are fewer than two.
    standard_error
        (H, W, 3) float32 estimated standard error of `rgb`, from the scatter of 2 to 8 batches of
        samples, so that the gain of stratified sampling shows in it, if not all of it; NaN where
        there are fewer than two samples.

    The last three are None in an image that was not rendered.
    """

    def __init__(
        self,
        rgb: NDArray[np.float32],
        spp: int = 0,
        metadata: dict[str, Any] | None = None,
        *,
        counts: NDArray[np.int64] | None = None,
        variance: NDArray[np.float32] | None = None,
        standard_error: NDArray[np.float32] | None = None,
    ) -> None:
        self.rgb = rgb
        self.spp = spp
        self.metadata = dict(metadata or {})
        self.counts = counts
        self.variance = variance
        self.standard_error = standard_error

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
            Stops (factors of 2) by which the picture is brightened first, in every format.

        Raises
        ------
        SceneError
            If the extension is unknown, the folder is missing, or gamma is out of range.
        """
        write_image(path, self.rgb, gamma=gamma, exposure=exposure)

    def _repr_png_(self) -> bytes:
        """Show the picture in a notebook."""
        return png.encode(to_8bit(self.rgb))
