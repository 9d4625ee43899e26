"""Rendered pictures as data."""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .codecs.encoding import exposed, to_8bit
from .codecs.images import encode_png, read_linear, write_image
from .codecs.png_jpeg import Gamma
from .errors import SceneError
from .layers import LAYERS, is_radiance
from .samples import shared_samples


class Image:
    """A rendered picture.

    Attributes
    ----------
    rgb
        (H, W, 3) float32 linear radiance; row 0 is the top.
    spp
        Samples per pixel; the rounded mean where pixels differ.
    metadata
        Settings and results of the render: lighting (the preset that was added, or None), integrator,
        max_bounces, seed, sampler, filter, accelerator, workers, executor, seconds (wall time), spp (mean
        over pixels), samples, rays, bad_samples, interrupted, version (of this package), numpy, and noise
        (estimated relative error of the picture).
    counts
        (H, W) int64 samples of each pixel.
    variance
        (H, W, 3) float32 estimated variance of one sample; NaN where there are fewer than two.
    standard_error
        (H, W, 3) float32 estimated standard error of `rgb`, from the scatter of 2 to 8 batches of samples. It
        includes most of the gain of stratified sampling. NaN where there are fewer than two samples.
    layers
        The other layers by name, (H, W) or (H, W, channels): see `layers.LAYERS`. Each is an attribute as
        well: `image.depth` is `image.layers["depth"]`.
    errors
        Estimated standard error of each sampled layer, of its shape.
    names
        For "shape", "instance" and "material" the name of each id of the layers `shape_id`, `instance_id`
        and `material_id`.

    `counts`, `variance` and `standard_error` are None in an image that was not rendered.
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
        layers: Mapping[str, NDArray[Any]] | None = None,
        errors: Mapping[str, NDArray[np.float32]] | None = None,
        names: Mapping[str, Mapping[int, str]] | None = None,
    ) -> None:
        self.rgb = rgb
        self.spp = spp
        self.metadata = dict(metadata or {})
        self.counts = counts
        self.variance = variance
        self.standard_error = standard_error
        self.layers = dict(layers or {})
        self.errors = dict(errors or {})
        self.names = {kind: dict(table) for kind, table in (names or {}).items()}

    def __getattr__(self, name: str) -> NDArray[Any]:
        """Return a layer by its name."""
        if name in LAYERS:
            if name in self.__dict__.get("layers", ()):
                return self.layers[name]
            raise AttributeError(f"the image has no layer {name!r}; render it with aovs=({name!r},)")
        raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")

    def __repr__(self) -> str:
        """Return the size and the sample count."""
        height, width = self.rgb.shape[:2]
        return f"<Image {width}x{height}, {self.spp} spp>"

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> NDArray[Any]:
        """Return `rgb`."""
        return np.array(self.rgb, dtype=dtype, copy=copy)

    def __getitem__(self, key: Any) -> NDArray[np.float32]:
        """Return `rgb[key]`: image[y, x] is one pixel, (3,)."""
        return self.rgb[key]

    def __sub__(self, other: Image) -> Image:
        """Return the difference of two pictures of one size: `rgb` and its standard error, no layers.

        The error is that of independent pictures. It is None if one of them has none, or if they share
        samples, since their errors then depend on each other.

        Raises
        ------
        SceneError
            If the sizes differ.
        """
        if not isinstance(other, Image):
            return NotImplemented
        if self.shape != other.shape:
            sizes = " and ".join(f"{x.shape[1]}x{x.shape[0]}" for x in (self, other))
            raise SceneError(f"pictures of different sizes cannot be subtracted: {sizes}")
        error = None
        if (
            self.standard_error is not None
            and other.standard_error is not None
            and shared_samples(self.metadata, other.metadata) is None
        ):
            error = np.hypot(self.standard_error, other.standard_error)
        return Image(self.rgb - other.rgb, min(self.spp, other.spp), standard_error=error)

    def __mul__(self, factor: ArrayLike) -> Image:
        """Return the picture times a number or an rgb triple, with its errors and its layers.

        Layers of radiance are multiplied too: `direct`, `indirect` and light groups. The others stay.

        Raises
        ------
        SceneError
            If the factor is neither a finite number nor three of them.
        """
        if isinstance(factor, Image) or np.asarray(factor).dtype.kind not in "fiu":
            return NotImplemented
        scale = np.asarray(factor, np.float32)
        if scale.shape not in ((), (3,)) or not np.isfinite(scale).all():
            raise SceneError(f"a picture can be multiplied by a number or an rgb triple, not by {factor!r}")
        size = np.abs(scale)

        def scaled(arrays: Mapping[str, NDArray[Any]], by: NDArray[np.float32]) -> dict[str, NDArray[Any]]:
            return {name: array * by if is_radiance(name) else array for name, array in arrays.items()}

        return Image(
            self.rgb * scale,
            self.spp,
            self.metadata,
            counts=self.counts,
            variance=None if self.variance is None else self.variance * size**2,
            standard_error=None if self.standard_error is None else self.standard_error * size,
            layers=scaled(self.layers, scale),
            errors=scaled(self.errors, size),
            names=self.names,
        )

    __rmul__ = __mul__

    @property
    def shape(self) -> tuple[int, ...]:
        """(H, W, 3), of `rgb`."""
        return self.rgb.shape

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Image:
        """Read a picture by its extension, as linear values.

        png and jpg files are decoded by the gamma that they record, as files of `save` do, and by the sRGB
        curve if they record none. exr, hdr and npy are linear. Alpha is ignored; one channel becomes three.

        Parameters
        ----------
        path
            A png, jpg, exr, hdr or npy file.

        Raises
        ------
        SceneError
            If the file is missing, of another kind, corrupt, truncated, or too large. The message names it.
        """
        pixels = read_linear(path)
        if not 1 <= pixels.shape[2] <= 4:
            raise SceneError(f"{os.fspath(path)}: has {pixels.shape[2]} channels; a picture has 1 to 4")
        return cls(three_channels(pixels))

    def to_uint8(self, gamma: Gamma = 2.2, exposure: float = 0.0) -> NDArray[np.uint8]:
        """Return the picture as (H, W, 3) codes for display, the same that `save` writes into a png.

        Parameters
        ----------
        gamma
            Values are clipped to [0, 1] and raised to 1/gamma; "srgb" is the exact sRGB curve.
        exposure
            Stops (factors of 2) by which the picture is brightened first.

        Raises
        ------
        SceneError
            If gamma or exposure is out of range.
        """
        return to_8bit(exposed(self.rgb, exposure), gamma)

    def save(self, path: str | os.PathLike[str], gamma: Gamma = 2.2, exposure: float = 0.0) -> None:
        """Write the picture by its extension: png or jpg for display; exr, hdr and npy linear.

        The file holds its old content or all of the new content, never a part. It keeps its permissions, and
        symbolic links are followed.

        Parameters
        ----------
        path
            Where to write.
        gamma
            png and jpg hold value^(1/gamma), and record gamma; "srgb" is the exact sRGB curve.
        exposure
            Stops (factors of 2) by which the picture is brightened first, in every format.

        Raises
        ------
        SaveError
            If the file cannot be written: an unknown extension, a folder that is missing, no space. It
            is a SceneError and an OSError.
        SceneError
            If gamma or exposure is out of range.
        """
        write_image(path, self.rgb, gamma=gamma, exposure=exposure)

    def _repr_png_(self) -> bytes:
        """Show the picture in a notebook."""
        return encode_png(self.rgb)


def three_channels(pixels: NDArray[Any]) -> NDArray[Any]:
    """Return the colors (H, W, 3) of pixels (H, W, 1 to 4), without alpha."""
    return pixels[..., :3] if pixels.shape[2] > 2 else np.repeat(pixels[..., :1], 3, axis=2)
