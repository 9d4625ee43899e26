"""An environment given by an image."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path
from typing import Any, ClassVar, Self

import numpy as np

from ..arrays.elementary import arctan2, sin_cos, sin_cos_turns
from ..arrays.soa import soa
from ..arrays.state import SurfaceInteraction
from ..arrays.vec import INV_PI, INV_TWO_PI, Doubles, Floats, Ints, f4, luminance, positive
from ..codecs.budget import Budget
from ..codecs.encoding import codes_to_linear
from ..codecs.images import COLOR_BYTES, read_codes
from ..core.errors import SceneError, as_array, called, warn_caller
from ..core.files import check_size
from ..core.plural import plural
from ..sampling.discrete import Distribution2D
from ..textures.image import Texture
from .base import LightSample, Receiver
from .infinite import InfiniteLight, at_infinity, through_scene, turned
from .octahedral import OctahedralEnvironment
from .product import NO_NORMAL, CosineProduct, bins_of

LEAST_VARIANCE = 0.1  # of radiance over its squared mean, all around, that is worth light samples
CHUNK = 1 << 14  # texels whose light is summed at a time, so that sums take no fresh memory


@soa
class ImageEnvironment(InfiniteLight):
    """Radiance from a latitude–longitude image, sampled texel by texel.

    A texel is chosen with a probability proportional to the luminance of its mean times its solid
    angle, and a direction within it uniformly in solid angle.
    """

    image: Texture  # top row up, the middle column towards +z, columns turning from +x to -x
    texels: Distribution2D  # over columns and rows; uniform within a texel
    density: Floats  # (H,) 1/(2π·H·Δcosθ) of each row: density over the unit square -> 1/sr
    top: Doubles  # (H,) cosθ of the upper edge of each row
    step: Doubles  # (H,) Δcosθ from the upper edge of each row to the lower
    mean: Floats  # (3, 1) radiance, averaged over all directions
    rotation: Floats | None  # (3, 3) to world from environment; None where they are the same
    poles: bool = False  # the first and the last row of the image lie at the poles
    share: float = 1.0  # of the light that light samples are to bring
    product: CosineProduct | None = None  # draws that share
    normals: Ints | None = None  # (n,) bins of normals to draw for; None for no normal in particular
    in_texels: bool = False  # light samples may take means over texels: it varies slowly
    made: InfiniteLight | None = None  # cached by `compensated`
    takes_receiver: ClassVar[bool] = True

    @classmethod
    def of(cls, pixels: Floats, filter: str, rotation: Doubles | None, poles: bool = False) -> Self:
        """Prepare an image (H, W, 3), finite and at least 0, top row first.

        Raises
        ------
        SceneError
            If every pixel is black, there is no such filter, or the one row would lie at both poles.
        """
        height = len(pixels)
        if poles and height == 1:
            raise SceneError('Environment image has 1 row; with rows="poles" it must have at least 2')
        image = Texture(pixels, wrap=("repeat", "clamp"), filter=filter)  # type: ignore[arg-type]
        bands = height - poles  # from pole to pole; half of one belongs to a row at a pole
        edges = np.clip(np.arange(height + 1) - 0.5 * poles, 0, bands)
        sin_middle, _ = sin_cos_turns((edges[:-1] + edges[1:]) / (4 * bands))
        sin_half, _ = sin_cos(np.pi * np.diff(edges) / (2 * bands))
        step = 2 * sin_middle * sin_half  # cos of one edge − cos of the next
        weights, mean = np.empty(pixels.shape[:2]), np.zeros(3)
        around = np.concatenate([[1] if poles else [0], np.arange(height), [-2] if poles else [-1]])
        at_a_time = max(1, CHUNK // pixels.shape[1])
        for start in range(0, height, at_a_time):
            rows = slice(start, start + at_a_time)
            nearest = filter == "nearest"
            texels = pixels[rows] if nearest else _spread(pixels[around[start : rows.stop + 2]])
            shares = texels * (step[rows] / (2 * pixels.shape[1]))[:, None, None]  # of the sphere
            mean += shares.sum((0, 1))
            weights[rows] = luminance(np.moveaxis(shares, -1, 0))
        if not weights.any():
            raise SceneError("Environment radiance is black in every pixel; Environment(0) is darkness")
        return cls(
            image=image,
            texels=Distribution2D(weights),
            density=(1 / (2 * np.pi * height * step)).astype(f4),
            top=sin_cos_turns(edges[:-1] / (2 * bands))[1],
            step=step,
            mean=mean.astype(f4).reshape(3, 1),
            rotation=None if rotation is None else rotation.astype(f4),
            poles=poles,
        )

    def compensated(self) -> Any:
        """Draw directions by how much brighter than the mean they are, and leave the rest to BSDF samples.

        An image that is nearly the same all around is left to BSDF samples. The tables are made once.
        """
        if self.made is None:
            self.made = self._compensated()
        return self.made

    def _compensated(self) -> Any:
        if self.in_texels:
            return OctahedralEnvironment.of(self, LEAST_VARIANCE) or replace(self, share=0.0)
        uniform = (0.5 * len(self.step) * self.step[:, None]).astype(f4)  # 1/(4π) per steradian
        more = self.texels.weights() - uniform  # density over the unit square
        if (more * more / uniform).mean(dtype=np.float64) < LEAST_VARIANCE:
            return replace(self, share=0.0)
        excess = positive(more)
        share = float(excess.mean(dtype=np.float64))
        return replace(self, product=CosineProduct(excess, self.rotation), share=share)

    def sample_li(self, point: Floats, u: Floats) -> LightSample:
        """Choose a texel, and a direction uniformly within it."""
        height = len(self.step)
        if self.product is None:
            x, y, over_square = self.texels.sample(u)
        else:
            x, y, over_square = self.product.sample(u, self._drawn_for(u.shape[1]))
        scaled = y * f4(height)
        row = np.minimum(scaled.astype(np.intp), height - 1)
        # float64: near the poles cosθ itself is far coarser in float32 than the rows
        cos = self.top.take(row) - (scaled - row) * self.step.take(row)
        sin = np.sqrt(np.maximum((1 - cos) * (1 + cos), 0)).astype(f4)
        sin_longitude, cos_longitude = sin_cos_turns(f4(0.5) - x)
        wi = np.empty((3, len(x)), f4)
        np.multiply(sin_longitude, sin, out=wi[0])
        wi[1] = cos
        np.multiply(cos_longitude, sin, out=wi[2])
        radiance = self._lookup(x, self._row(arctan2(sin, wi[1]) * INV_PI))
        if self.rotation is not None:
            wi = turned(self.rotation, wi)
        return at_infinity(wi, radiance, over_square * self.density.take(row))

    def pdf_li(self, point: Floats, wi: Floats) -> Floats:
        """Return the density of the texel in direction wi."""
        x, y = self._place(wi)
        row = np.minimum((y * f4(len(self.density))).astype(np.intp), len(self.density) - 1)
        if self.product is None:
            return self.texels.pdf(x, y) * self.density.take(row)
        return self.product.pdf(x, y, self._drawn_for(x.size)) * self.density.take(row)

    def lighting(self, receiver: Receiver) -> Self:
        """Return the light as it is sampled for the normals of opaque surfaces."""
        if self.product is None:
            return self
        return replace(self, normals=bins_of(receiver))

    def _drawn_for(self, n: int) -> Ints:
        return np.broadcast_to(NO_NORMAL if self.normals is None else self.normals, n)

    def le(self, wi: Floats, surface: SurfaceInteraction | None = None) -> Floats:
        """Return the radiance of the image in direction wi, (3, n)."""
        return self._lookup(*self._place(wi))

    def power(self, scene_radius: float) -> Doubles:
        """4π times the mean radiance, through the disk of the scene, πR²: the share of light samples."""
        return self.share * through_scene(4 * np.pi * self.mean.mean(0, dtype=np.float64), scene_radius)

    def _place(self, wi: Floats) -> tuple[Floats, Floats]:
        """Return where directions (3, n) lie in the image, from the left and the top, in [0, 1]."""
        local = wi if self.rotation is None else turned(self.rotation.T, wi)
        x = f4(0.5) - arctan2(local[0], local[2]) * INV_TWO_PI
        level = np.sqrt(local[0] * local[0] + local[2] * local[2])
        return x, self._row(arctan2(level, local[1]) * INV_PI)

    def _row(self, v: Floats) -> Floats:
        """Return where angles from the upper pole, over π, lie in the image, from the top, in [0, 1]."""
        if not self.poles:
            return v
        height = len(self.step)
        return (v * f4(height - 1) + f4(0.5)) / f4(height)

    def _lookup(self, x: Floats, y: Floats) -> Floats:
        return self.image.lookup(np.stack([x, f4(1) - y]))


def _spread(pixels: Floats) -> Doubles:
    """Mean of the bilinear lookup within each texel but those of the first and last row, (H + 2, W, 3).

    The neighbors of a texel count ⅛, itself ¾, both ways. Half a texel at a pole has the weights of a whole
    one between equal rows. The mean is positive wherever the lookup is.
    """
    texels = pixels.astype(np.float64)
    texels = 0.75 * texels + 0.125 * (np.roll(texels, 1, 1) + np.roll(texels, -1, 1))
    return 0.75 * texels[1:-1] + 0.125 * (texels[:-2] + texels[2:])


def environment_pixels(source: Any) -> Floats:
    """Return an environment's image as linear radiance, (H, W, 3) float32, finite and at least 0.

    Parameters
    ----------
    source
        A file, or an array (H, W) or (H, W, 1 to 4). 8- and 16-bit values count from 0 to 1 and
        are decoded from sRGB; others are linear. Alpha is not used.

    Raises
    ------
    SceneError
        If it is no image, or a pixel is not finite.
    """
    if isinstance(source, str | os.PathLike):
        budget, name = Budget(), f"Environment {Path(source).name!r}"
        codes = read_codes(source, budget)
        budget.charge(name, COLOR_BYTES * codes.shape[0] * codes.shape[1])
    else:
        codes, name = as_array("Environment radiance", source), "Environment radiance"
    if codes.ndim == 2:
        codes = codes[:, :, None]
    if codes.ndim != 3 or not 1 <= codes.shape[2] <= 4 or codes.dtype.kind not in "uif":
        raise SceneError(f"{name} is {codes.dtype} of shape {codes.shape}; it must be (H, W, 3)")
    with called(name, "image"):
        check_size(codes.shape[0], codes.shape[1])
    is_coded = codes.dtype in (np.uint8, np.uint16)
    with np.errstate(over="ignore"):  # an overflow is infinite, and is reported below
        pixels = codes_to_linear(codes) if is_coded else codes.astype(f4, copy=False)
    if codes.shape[2] in (2, 4):
        clear = int((pixels[..., -1] != 1).sum())
        if clear:
            subject = plural(clear, "pixel is", "pixels are")
            warn_caller(f"{name}: {subject} transparent; alpha is not used")
        pixels = pixels[..., :-1]
    pixels = np.array(np.broadcast_to(pixels, (*pixels.shape[:2], 3)))
    _check_finite(name, pixels)
    return pixels if is_coded else _without_negative(name, pixels)


def _check_finite(name: str, pixels: Floats) -> None:
    finite = np.isfinite(pixels)
    if not finite.all():
        bad = np.argwhere(~finite.all(2))
        row, column = bad[0]
        raise SceneError(
            f"{name}: {plural(len(bad), 'pixel is', 'pixels are')} not finite in float32, "
            f"first: row {row}, column {column}, {pixels[row, column].tolist()}"
        )


def _without_negative(name: str, pixels: Floats) -> Floats:
    if pixels.min(initial=0) < 0:
        bad = np.argwhere((pixels < 0).any(2))
        row, column = bad[0]
        warn_caller(
            f"{name}: {plural(len(bad), 'negative pixel counts', 'negative pixels count')} as 0, "
            f"first: row {row}, column {column}, {pixels[row, column].tolist()}"
        )
    return np.maximum(pixels, f4(0), out=pixels)
