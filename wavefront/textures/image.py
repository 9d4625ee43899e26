"""Image textures: colors or numbers that are looked up by texture coordinates."""

from __future__ import annotations

import math
import os
from pathlib import Path
from typing import Any, Literal, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arrays.state import SurfaceInteraction
from ..arrays.vec import Bools, Doubles, Floats, Ints, f4, luminance
from ..codecs.budget import Budget
from ..codecs.images import read_codes
from ..colors import srgb_to_linear
from ..core.errors import SceneError, as_array, called, finite_array, flag, in_brief, one_of
from ..core.files import MAX_PIXELS, check_size
from ..core.plural import plural
from ..core.suggestions import suggests_keywords
from .base import BaseTexture

Wrap: TypeAlias = Literal["repeat", "mirror", "clamp"]
Channel: TypeAlias = int | Literal["luminance"]
UV_SETS = ("uv", "uv1")  # fields of `SurfaceInteraction`

ONE = -1  # in place of a stored channel: alpha of a picture that has none
CHUNK = 1 << 20  # texels that are read at a time
ROUNDING = 2.0**-8  # of places in texels, at most


class Texture(BaseTexture):
    """An image texture, for any material parameter that is a color or a number.

    The top row of the image lies at v = 1, its left column at u = 0. The value is
    `offset` + `scale` · texel.

    Parameters
    ----------
    source
        A file (png, jpg, bmp, gif, tga, tif, webp, ppm, pfm, exr, hdr, npy), or an array (H, W), (H, W, C),
        top row first: uint8 and uint16 are scaled to [0, 1], floats are used unchanged. An array is shared,
        not copied.
    srgb
        Decode 8- and 16-bit colors from sRGB. False for data such as roughness. Alpha is never
        decoded, and float images are linear already.
    wrap
        How the image continues outside [0, 1]: "repeat", "mirror" or "clamp"; or two of them, for u and v.
    filter
        "bilinear" between texel centers, or "nearest".
    transform
        (3, 3) matrix applied to (u, v, 1) first.
    channel
        Which channel to use as a number, from 0, or "luminance". None gives a color: the first
        three channels, or the first where there are one or two. Files of pictures have red, green, blue and
        alpha, 0 to 3, whatever they store: gray counts as all three colors, and alpha that is missing as 1.
    scale, offset
        One number, or three for a color.
    uv_set
        Which texture coordinates of the mesh to use: 0 for its `uvs`, 1 for its `uvs1`.
    max_pixels
        A file with more pixels is refused before it is decoded.

    Raises
    ------
    SceneError
        If the file cannot be read, or an argument is malformed.

    Examples
    --------
    >>> checks = wf.Texture([[0.1, 0.8], [0.8, 0.1]], filter="nearest")
    >>> roughness = wf.Texture(np.linspace(0, 1, 64).reshape(8, 8), srgb=False, channel=0)
    >>> material = wf.Principled(checks, roughness=roughness)
    """

    @suggests_keywords
    def __init__(
        self,
        source: str | os.PathLike[str] | ArrayLike | StoredImage,
        srgb: bool = True,
        *,
        wrap: Wrap | tuple[Wrap, Wrap] = "repeat",
        filter: Literal["bilinear", "nearest"] = "bilinear",
        transform: ArrayLike | None = None,
        channel: Channel | None = None,
        scale: ArrayLike = 1.0,
        offset: ArrayLike = 0.0,
        uv_set: Literal[0, 1] = 0,
        max_pixels: int = MAX_PIXELS,
    ) -> None:
        codes, self.name, is_picture = _codes(source, _most(max_pixels))
        srgb, channel = flag("srgb", srgb), _channel(channel)
        self.size = (codes.shape[1], codes.shape[0])  # (width, height)
        self.channels = self._stride = codes.shape[2]  # of the image
        self.has_alpha = self.channels in (2, 4)
        self._texels = codes.reshape(-1)  # not as float32: 8-bit images take a quarter of the memory
        if is_picture and channel in (0, 1, 2, 3):
            channel = _stored(channel, self._stride)
        self._channels = (ONE,) if channel == ONE else _pick(self.name, channel, self._stride)
        self._tables = [_table(codes.dtype, srgb and not _is_alpha(c, self._stride)) for c in self._channels]
        self.srgb = srgb and codes.dtype.kind == "u"
        self._gray = channel == "luminance"
        self.scalar = channel is not None
        self.wrap = _pair(wrap)
        self.filter = one_of("filter", filter, ("bilinear", "nearest"))
        self.transform = None if transform is None else finite_array("transform", transform, (3, 3))
        self.scale = _factor("scale", scale, self.scalar)
        self.offset = _factor("offset", offset, self.scalar)
        self.uv_set = one_of("uv_set", uv_set, (0, 1))
        self.reads = (UV_SETS[self.uv_set],)

    def __repr__(self) -> str:
        """Name the image and its size."""
        return f"<Texture {self.name!r}: {self.size[0]} × {self.size[1]}>"

    def at(self, surface: SurfaceInteraction) -> Floats:
        """Return the values at hit points: (3, n), or (n,) when one channel was chosen."""
        uv: Floats | None = getattr(surface, UV_SETS[self.uv_set])
        if uv is None:
            raise SceneError(f"texture {self.name!r}: the surface has no texture coordinates")
        return self.lookup(uv)

    def lookup(self, uv: Floats) -> Floats:
        """Return the values at texture coordinates (2, n): (3, n), or (n,) for one channel."""
        x, y = self._texel_space(uv)
        rows = self._nearest(x, y) if self.filter == "nearest" else self._bilinear(x, y)
        return self._shaped(rows)

    def gradient(self, uv: Floats) -> Floats:
        """Return the derivatives of one channel by u and v, (2, n), at texture coordinates (2, n).

        They are differences of bilinear lookups half a texel to either side, which are continuous.
        """
        x, y = self._texel_space(uv)
        half = f4(0.5)
        across = self._shaped(self._bilinear(x + half, y)) - self._shaped(self._bilinear(x - half, y))
        up = self._shaped(self._bilinear(x, y - half)) - self._shaped(self._bilinear(x, y + half))
        u, v = uv if self.transform is None else _transformed(self.transform, uv)
        across *= _unwrapped_slope(u, self.wrap[0]) * f4(self.size[0])
        up *= _unwrapped_slope(v, self.wrap[1]) * f4(self.size[1])
        if self.transform is None:
            return np.stack([across, up])
        m = self.transform.astype(f4)
        return np.stack([across * m[0, 0] + up * m[1, 0], across * m[0, 1] + up * m[1, 1]])

    def _texel_space(self, uv: Floats) -> tuple[Floats, Floats]:
        """Return texture coordinates (2, n) in texels from the left and from the top."""
        u, v = uv if self.transform is None else _transformed(self.transform, uv)
        x = _unwrapped(u, self.wrap[0]) * f4(self.size[0])
        y = (f4(1) - _unwrapped(v, self.wrap[1])) * f4(self.size[1])
        return x, y

    def mean(self) -> Floats:
        """Return the average over the image: (3,), or () for one channel."""
        width, height = self.size
        everywhere = np.arange(width * height, dtype=np.intp)
        means = [self._decoded(everywhere, k).mean(dtype=np.float64) for k in range(len(self._channels))]
        return self._shaped([np.array([mean], f4) for mean in means])[..., 0]

    def limits(self) -> tuple[float, float]:
        """Return the least and the greatest value of the image, scaled."""
        ends = np.stack([self.offset, self.scale + self.offset]).astype(float)
        if self._texels.dtype.kind == "u" and ends.min() >= 0 and ends.max() <= 1:
            return float(ends.min()), float(ends.max())  # integer texels are in [0, 1]
        width, height = self.size
        low, high = np.inf, -np.inf
        for start in range(0, width * height, CHUNK):
            texels = np.arange(start, min(start + CHUNK, width * height), dtype=np.intp)
            values = self._shaped([self._decoded(texels, k) for k in range(len(self._channels))])
            low, high = min(low, float(values.min())), max(high, float(values.max()))
        return low, high

    def is_one_within(self, low: Doubles, high: Doubles) -> Bools:
        """Return whether one channel is 1 at all coordinates from `low` to `high` (2, m), a mask (m,).

        It is False where that is not known: of large images, or coordinates that are transformed or wrapped.
        """
        width, height = self.size
        changed = self.transform is not None or (self.scale != 1).any() or (self.offset != 0).any()
        if not self.scalar or changed or width * height > CHUNK:
            return np.zeros(low.shape[1], np.bool_)
        values = self._shaped(
            [self._decoded(np.arange(width * height), k) for k in range(len(self._channels))]
        )
        others = np.zeros(
            (height + 1, width + 1), np.intp
        )  # texels above and left of each corner that are not 1
        np.cumsum(np.cumsum(values.reshape(height, width) != 1, 0), 1, out=others[1:, 1:])
        known = (low.min(0) >= 0) & (high.max(0) <= 1)
        ends = []
        for size, wrap, start, stop in (
            (width, self.wrap[0], low[0], high[0]),
            (height, self.wrap[1], 1 - high[1], 1 - low[1]),
        ):
            before = np.floor(np.where(known, start, 0) * size - (0.5 + ROUNDING)).astype(np.intp)
            after = np.floor(np.where(known, stop, 0) * size - (0.5 - ROUNDING)).astype(np.intp) + 2
            known &= (wrap != "repeat") | ((before >= 0) & (after <= size))
            ends.append((np.clip(before, 0, size), np.clip(after, 0, size)))
        (left, right), (top, bottom) = ends
        count = others[bottom, right] - others[top, right] - others[bottom, left] + others[top, left]
        return known & (count == 0)

    def _shaped(self, rows: list[Floats]) -> Floats:
        """Return channel values (n,) as (3, n) or (n,), scaled and offset."""
        if self._gray and len(rows) == 3:
            rows = [luminance(rows)]
        if self.scalar:
            return self.scale[0, 0] * rows[0] + self.offset[0, 0]
        out = np.empty((3, len(rows[0])), f4)
        for k in range(3):
            np.multiply(rows[k % len(rows)], self.scale[k, 0], out=out[k])
            out[k] += self.offset[k, 0]
        return out

    def _nearest(self, x: Floats, y: Floats) -> list[Floats]:
        width, height = self.size
        column, row = np.floor(x).astype(np.intp), np.floor(y).astype(np.intp)
        texel = np.clip(row, 0, height - 1) * width + np.clip(column, 0, width - 1)
        return [self._decoded(texel, k) for k in range(len(self._channels))]

    def _bilinear(self, x: Floats, y: Floats) -> list[Floats]:
        left, right, fx = _neighbors(x, self.size[0], self.wrap[0])
        top, bottom, fy = _neighbors(y, self.size[1], self.wrap[1])
        for columns in (left, right):
            columns *= self._stride
        for rows in (top, bottom):
            rows *= self._stride * self.size[0]
        corners = top + left, top + right, bottom + left, bottom + right
        out = []
        for k in range(len(self._channels)):
            a, b, c, d = (self._values(first, k) for first in corners)
            out.append(_mix(_mix(a, b, fx), _mix(c, d, fx), fy))
        return out

    def _decoded(self, texel: Ints, k: int) -> Floats:
        """Return the linear values of the k-th chosen channel of texels (n,)."""
        return self._values(texel * self._stride, k)

    def _values(self, first: Ints, k: int) -> Floats:
        """Return the same of texels given by where their first channel is stored."""
        if self._channels[k] == ONE:
            return np.ones(first.shape, f4)
        # "wrap" is twice as fast as the default, which checks each index
        codes = self._texels[self._channels[k] :].take(first, mode="wrap")
        table = self._tables[k]
        return codes if table is None else table.take(codes, mode="wrap")


class StoredImage(NamedTuple):
    """A file of a picture that has been read: gray or RGB, with alpha or without."""

    codes: NDArray[Any]  # (H, W, C) as stored
    name: str


def checked(image: StoredImage) -> StoredImage:
    """Return an image that a `Texture` can show.

    Raises
    ------
    SceneError
        If it has another shape or type, or values that are not finite.
    """
    return StoredImage(_checked(image.codes, image.name), image.name)


def _codes(source: Any, max_pixels: int) -> tuple[NDArray[Any], str, bool]:
    """Return texels (H, W, C) as uint8 or float32, a name for messages, and whether they are of a picture."""
    is_picture = isinstance(source, StoredImage)
    if isinstance(source, StoredImage):
        codes, name = source
    elif isinstance(source, str | os.PathLike):
        codes, name = read_codes(source, Budget(max_pixels)), Path(source).name
        is_picture = not name.endswith(".npy")
    else:
        codes, name = as_array("Texture source", source), "array"
        return _checked(codes, "Texture source"), name, False
    return _checked(codes, f"texture {name!r}"), name, is_picture


def _checked(codes: NDArray[Any], what: str) -> NDArray[Any]:
    """Return texels (H, W, C) as uint8, uint16 or float32."""
    if codes.ndim == 2:
        codes = codes[:, :, None]
    if codes.ndim != 3 or not 1 <= codes.shape[2] <= 4 or codes.dtype.kind not in "uifb":
        raise SceneError(f"{what} is {codes.dtype} of shape {codes.shape}; it must be (H, W, 1 to 4)")
    with called(what, "image"):
        check_size(codes.shape[0], codes.shape[1], math.inf)  # an array may have any size
    if codes.dtype in (np.uint8, np.uint16):
        return np.ascontiguousarray(codes)
    if codes.dtype.kind in "ui":
        raise SceneError(f"{what} is {codes.dtype}; it must be uint8, uint16 or float")
    codes = np.ascontiguousarray(codes, np.float32)
    bad = np.argwhere(~np.isfinite(codes))
    if len(bad):
        row, column, _ = bad[0]
        raise SceneError(
            f"{what} has {plural(len(bad), 'value that is', 'values that are')} not finite, "
            f"first: row {row}, column {column}"
        )
    return codes


def _most(pixels: Any) -> int:
    whole = isinstance(pixels, int | np.integer) and not isinstance(pixels, bool)
    if not whole or pixels < 1:
        raise SceneError(f"max_pixels is {in_brief(pixels)}; it must be a whole number of at least 1")
    return int(pixels)


def _channel(channel: Any) -> Channel | None:
    """Return a channel as it was given, if it is of a type that channels have."""
    if not (channel is None or isinstance(channel, int | str)):
        raise SceneError(f"channel is {in_brief(channel)}; it must be a whole number, 'luminance' or None")
    return channel  # type: ignore[return-value]  # `_pick` knows the names


def _stored(channel: int, count: int) -> int:
    """Return the stored channel of one of red, green, blue and alpha; `ONE` for alpha that is not stored."""
    if channel == 3:
        return count - 1 if count in (2, 4) else ONE
    return channel if count > 2 else 0


def _pick(name: str, channel: Channel | None, count: int) -> tuple[int, ...]:
    """Return the indices of the channels that the texture reads."""
    if channel is None or channel == "luminance":
        return (0, 1, 2) if count >= 3 else (0,)
    if not isinstance(channel, int) or not 0 <= channel < count:
        raise SceneError(
            f"channel is {channel!r}; texture {name!r} has the channels 0 to {count - 1}, and 'luminance'"
        )
    return (channel,)


def _is_alpha(channel: int, count: int) -> bool:
    return count in (2, 4) and channel == count - 1


def _table(kind: np.dtype[Any], srgb: bool) -> Floats | None:
    """Return the linear value of every integer code, None for float images."""
    if kind == np.float32:
        return None
    steps = int(np.iinfo(kind).max)
    values = np.arange(steps + 1, dtype=f4) / f4(steps)
    return srgb_to_linear(values) if srgb else values


def _factor(name: str, value: ArrayLike, scalar: bool) -> Floats:
    """Return one number or three as a (3, 1) column."""
    single = as_array(name, value).ndim == 0
    if scalar and not single:
        raise SceneError(f"{name} is {value!r}; with a channel it must be one number")
    array = finite_array(name, value, () if single else (3,))
    if np.abs(array).max() > np.finfo(f4).max:
        raise SceneError(f"{name} is {value!r}; its size must be at most {np.finfo(f4).max:.3g}")
    return np.broadcast_to(array.astype(f4).reshape(-1, 1), (3, 1)).copy()


def _pair(wrap: Any) -> tuple[str, str]:
    both = wrap if isinstance(wrap, list | tuple) else (wrap, wrap)
    if len(both) != 2:
        raise SceneError(f"wrap is {in_brief(wrap)}; it must be one mode, or one for u and one for v")
    u, v = (one_of("wrap", mode, ("repeat", "mirror", "clamp")) for mode in both)
    return u, v


def _transformed(matrix: Doubles, uv: Floats) -> tuple[Floats, Floats]:
    m = matrix.astype(f4)
    return m[0, 0] * uv[0] + m[0, 1] * uv[1] + m[0, 2], m[1, 0] * uv[0] + m[1, 1] * uv[1] + m[1, 2]


def _unwrapped(t: Floats, wrap: str) -> Floats:
    """Return a coordinate mapped into [0, 1]."""
    if wrap == "clamp":
        return np.clip(t, f4(0), f4(1))
    if wrap == "repeat":
        return t - np.floor(t)
    return f4(1) - np.abs(f4(1) - (t - f4(2) * np.floor(t * f4(0.5))))


def _unwrapped_slope(t: Floats, wrap: str) -> Floats:
    """Return the derivative of `_unwrapped`."""
    if wrap == "clamp":
        return ((t >= 0) & (t <= 1)).astype(f4)
    if wrap == "repeat":
        return np.ones_like(t)
    return np.where(t - f4(2) * np.floor(t * f4(0.5)) < f4(1), f4(1), f4(-1))


def _neighbors(x: Floats, size: int, wrap: str) -> tuple[Ints, Ints, Floats]:
    """Return the texels before and after x (n,), in texels, and the weight of the second one."""
    x = x - f4(0.5)
    low = np.floor(x)
    before = low.astype(np.intp)
    after = before + 1
    if wrap == "repeat" and not size & (size - 1):  # a power of two: ten times as fast
        before, after = before & (size - 1), after & (size - 1)
    elif wrap == "repeat":
        before, after = before % size, after % size
    else:  # the edge texel continues, also where the image is mirrored
        before, after = np.clip(before, 0, size - 1), np.clip(after, 0, size - 1)
    return before, after, x - low


def _mix(a: Floats, b: Floats, t: Floats) -> Floats:
    return a + t * (b - a)
