"""Reading and writing of image files.

They are written by extension. They are read by their first bytes where these say what they are, as files may
have a wrong extension or none. Values in the package are linear. `write_image` encodes them for display, and
`read_picture` decodes them. The other readers do not decode: a texture may hold colors or data, which only
the caller knows.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from io import BytesIO
from pathlib import Path
from typing import Any, TypeAlias, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arrays.vec import Floats
from ..core.errors import SaveError, SceneError, as_array, collect_warnings, warn_caller
from ..core.files import check_regular, check_target, extension_of, path_name, read_bytes, write_bytes
from ..core.plural import plural
from ..core.registry import Registry
from . import exr, npz, pnm, raster
from . import hdr as rgbe
from . import png_jpeg as coded
from .budget import Budget, in_memory
from .display import Display
from .encoding import codes_to_linear
from .image_data import TRANSPARENT, ImageData
from .tone import AUTO

T = TypeVar("T")
SIGNATURE_BYTES = 16
COLOR_BYTES = 24  # of memory for each pixel of codes that become linear colors

# called with a file and its budget; returns uint8 or uint16 codes, or linear float32, (H, W, C)
Decoder: TypeAlias = Callable[[bytes, Budget], NDArray[Any]]
# called with an adjusted picture, how it is shown, and the bits of a code; returns the file
Encoder: TypeAlias = Callable[[ImageData, Display, int], bytes]


def check_writable(path: str | os.PathLike[str]) -> None:
    """Check that an image can be written to `path`, before a long render.

    Raises
    ------
    SaveError
        If the extension is unknown, the folder is missing or not writable, or something other than a
        regular file is there.
    """
    _find(IMAGE_WRITERS, path, SaveError)
    check_target(path)


def check_display(path: str | os.PathLike[str], display: Display, bits: int = 8) -> None:
    """Check that the format of `path` can hold a tone curve and this number of bits.

    Raises
    ------
    SaveError
        If the format is for linear values and there is a tone curve, or it has no codes of 16 bits.
    """
    extension = Path(path).suffix.lower()
    if display.tone not in (AUTO, "none") and extension not in coded.EXTENSIONS:
        names = ", ".join(coded.EXTENSIONS)
        raise SaveError(f"{path}: tone={display.tone!r} is for {names}; {extension} holds linear values")
    if bits not in (8, 16):
        raise SaveError(f"{path}: bits is {bits!r}; it must be 8 or 16")
    if bits == 16 and extension != ".png":
        raise SaveError(f"{path}: bits=16 is for .png; {extension} has another precision")


def write_image(
    path: str | os.PathLike[str],
    picture: ImageData | ArrayLike,
    display: Display | None = None,
    bits: int = 8,
) -> None:
    """Write a picture in the format of the extension of `path`.

    Parameters
    ----------
    path
        Ends in .png, .jpg, .jpeg (encoded for display), .exr, .npz (all arrays), .hdr or .npy (rgb, linear).
    picture
        The picture, or its linear values (H, W, 3).
    display
        How the picture is shown; by default with gamma 2.2 and nothing else. Exposure and white balance
        apply to every format, tone and gamma to png and jpg.
    bits
        8, or 16 for png.

    Raises
    ------
    SaveError
        If the file cannot be written. The old file stays intact.
    SceneError
        If the pixels are malformed.
    """
    encode = _find(IMAGE_WRITERS, path, SaveError)
    shown = Display() if display is None else display
    check_display(path, shown, bits)
    data = (
        picture
        if isinstance(picture, ImageData)
        else ImageData(as_array("picture", picture).astype(np.float32, copy=False))
    )
    adjusted = shown.adjusted(_checked(path, data))
    if Path(path).suffix.lower() in FINITE:
        adjusted = _finite(path, adjusted)
    write_bytes(path, _encoded(path, lambda: encode(adjusted, shown, bits)))


def read_image(path: str | os.PathLike[str]) -> Floats:
    """Return the pixels of an image file, (H, W, C) float32, top row first.

    8- and 16-bit values are scaled to [0, 1] and not decoded from sRGB. exr, hdr, npy and npz values are
    returned unchanged.

    Raises
    ------
    SceneError
        With the name of the file, if it is missing, of another format, damaged, truncated, or larger than
        `files.MAX_PIXELS`, or takes more memory than a `Budget` of its size.
    """
    codes = read_codes(path)
    if codes.dtype == np.float32:
        return codes
    return codes.astype(np.float32) / np.float32(np.iinfo(codes.dtype).max)


def read_codes(path: str | os.PathLike[str], budget: Budget | None = None) -> NDArray[Any]:
    """Return the pixels of an image file as stored, uint8, uint16 or float32, (H, W, C)."""
    budget = budget or Budget()
    _check_kind(path)
    data = read_bytes(path)
    budget.add_file(len(data))
    with in_memory(path):
        return decode_codes(data, os.fspath(path), budget)


def read_picture(path: str | os.PathLike[str]) -> ImageData:
    """Return all that an image file holds, as linear values.

    png and jpg are decoded by the gamma in the file (gAMA or sRGB of a png, Exif of a jpg), or by the
    sRGB curve if it has none; other codes of 8 and 16 bits by that. The last of two or four channels is
    alpha. Colors of codes are multiplied by it; formats of floats hold them so.

    Raises
    ------
    SceneError
        As `read_image`.
    """
    with in_memory(path):
        return _picture(path)


def _picture(path: str | os.PathLike[str]) -> ImageData:
    _check_kind(path)
    data, name, extension = read_bytes(path), os.fspath(path), Path(path).suffix.lower()
    whole = ALL_OF_IT.get(extension)
    budget = Budget.of(data)
    picture = None if whole is None else _decode(name, whole, data, extension[1:], budget)
    if picture is not None:
        return picture
    pixels = decode_codes(data, name, budget)
    if not 1 <= pixels.shape[2] <= 4:
        raise SceneError(f"{name}: has {pixels.shape[2]} channels; a picture has 1 to 4")
    is_coded = pixels.dtype != np.float32
    height, width = pixels.shape[:2]
    budget.charge(f"{name}: colors of {width} × {height} pixels", COLOR_BYTES * height * width)
    values = codes_to_linear(pixels, coded.gamma_of(data)) if is_coded else pixels
    rgb = np.ascontiguousarray(three_channels(values))
    if values.shape[2] in (1, 3):
        return ImageData(rgb)
    alpha = np.ascontiguousarray(values[..., -1])
    colors = rgb * alpha[..., None] if is_coded else rgb
    return ImageData(colors, {"alpha": alpha}, {"metadata": {"background": TRANSPARENT}})


def three_channels(pixels: NDArray[Any]) -> NDArray[Any]:
    """Return the colors (H, W, 3) of pixels (H, W, 1 to 4), without alpha."""
    return pixels[..., :3] if pixels.shape[2] > 2 else np.repeat(pixels[..., :1], 3, axis=2)


def decode_codes(data: bytes, name: str, budget: Budget) -> NDArray[Any]:
    """Return the stored values (H, W, C) of a picture in memory, uint8, uint16 or float32.

    Of one or two channels the first is gray, of three or four the first three are red, green and blue; the
    last of two or four is alpha.

    Parameters
    ----------
    data
        The file. Its first bytes say what it is; where they do not, the extension of `name` does.
    name
        Of the file, or of its place in another one, for messages.
    budget
        The memory that it may take.

    Raises
    ------
    SceneError
        With the name, if it is of another format, damaged, truncated or too large.
    """
    extension = Path(name).suffix.lower()
    decode = IMAGE_READERS.get(extension, raster.decode)
    if decode in BUILT_IN:
        decode = next((other for starts, other in SIGNED if data.startswith(starts)), decode)
    kind = extension[1:] if extension in IMAGE_READERS else "png"
    return _decode(name, decode, data, kind, budget)


def _check_kind(path: str | os.PathLike[str]) -> None:
    """Refuse a file of an unknown extension, unless its first bytes say what it is."""
    name = path_name(path)
    if Path(name).suffix.lower() not in IMAGE_READERS and os.path.exists(name):
        check_regular(name)
        with open(name, "rb") as file:
            start = file.read(SIGNATURE_BYTES)
        if any(start.startswith(starts) for starts, _ in SIGNED):
            return
    _find(IMAGE_READERS, path)


def _decode(name: str, decode: Callable[[bytes, Budget], T], data: bytes, kind: str, budget: Budget) -> T:
    """Return the result of `decode`; its errors and warnings name the file."""
    try:
        with collect_warnings() as said:
            decoded = decode(data, budget)
    except MemoryError:  # `in_memory` says more
        raise
    except SceneError as error:
        raise SceneError(f"{name}: {error}") from error
    # decoders raise exceptions of any type on damaged data
    except Exception as error:
        reason = error.__cause__ or error  # imageio hides the cause behind its own error
        raise SceneError(f"{name}: not a readable {kind} image: {reason}") from error
    for message in said:
        warn_caller(f"{name}: {message}")
    return decoded


def _find(table: Registry[T], path: str | os.PathLike[str], error: type[SceneError] = SceneError) -> T:
    """Return the entry of a table for the extension of a path."""
    kind = extension_of(path, table, error)
    try:
        return table.find(kind, f"{os.fspath(path)}: extension")
    except SceneError as unknown:
        raise error(str(unknown)) from None


def _encoded(path: str | os.PathLike[str], encode: Callable[[], bytes]) -> bytes:
    """Return the result of `encode`; convert its exceptions to SaveError."""
    try:
        return encode()
    except Exception as error:
        raise SaveError(f"{os.fspath(path)}: cannot be encoded: {error or type(error).__name__}") from error


def _checked(path: str | os.PathLike[str], picture: ImageData) -> ImageData:
    shape = picture.rgb.shape
    if len(shape) != 3 or shape[2] != 3 or not picture.rgb.size:
        raise SceneError(f"an image must have shape (height, width, 3), got {shape}")
    for name in picture.arrays:
        if not name or not name.isprintable():
            raise SaveError(
                f"{path}: an array is called {name!r}; a name must have printable characters only"
            )
    return picture


def _finite(path: str | os.PathLike[str], picture: ImageData) -> ImageData:
    """Replace NaN and infinities, with a warning, for a format that cannot hold them."""
    bad = int(np.count_nonzero(~np.isfinite(picture.rgb).all(axis=2)))
    if not bad:
        return picture
    amount = plural(bad, "pixel is", "pixels are")
    warn_caller(f"{os.fspath(path)}: {amount} not finite; NaN is written as 0")
    return picture.with_rgb(np.nan_to_num(picture.rgb, nan=0.0))


def _encode_npy(pixels: Floats) -> bytes:
    buffer = BytesIO()
    np.save(buffer, pixels, allow_pickle=False)
    return buffer.getvalue()


def _decode_npy(data: bytes, budget: Budget) -> Floats:
    pixels = npz.read_array(data, budget)
    if pixels.ndim not in (2, 3) or pixels.dtype.kind not in "fiub":
        raise SceneError(f"array is {pixels.dtype} of shape {pixels.shape}; an image is (H, W) or (H, W, C)")
    budget.check_size(pixels.shape[0], pixels.shape[1])
    return np.atleast_3d(pixels).astype(np.float32)


def _decode_npz(data: bytes, budget: Budget) -> Floats:
    return npz.decode(data, budget).rgb


def _encode_png(picture: ImageData, display: Display, bits: int) -> bytes:
    return coded.encode(display.codes(picture, bits), ".png", display.gamma)


def _encode_jpg(picture: ImageData, display: Display, bits: int) -> bytes:
    """Return a jpg; it has no alpha, so a transparent background is black."""
    return coded.encode(display.codes(ImageData(picture.rgb)), ".jpg", display.gamma)


def _colors(encode: Callable[[Floats], bytes]) -> Encoder:
    """Return an encoder that keeps linear colors, and nothing else of the picture."""
    return lambda picture, display, bits: encode(picture.rgb)


def _whole(encode: Callable[[ImageData], bytes]) -> Encoder:
    """Return an encoder that keeps all of the picture."""
    return lambda picture, display, bits: encode(picture)


def _checked_pixels(decode: Callable[[bytes], Any]) -> Decoder:
    """Return a decoder that checks what `decode`, a user's own function, returns."""

    def checked(data: bytes, budget: Budget) -> NDArray[Any]:
        pixels = np.asarray(decode(data))
        if pixels.ndim != 3 or not 1 <= pixels.shape[2] <= 4 or not pixels.size:
            raise SceneError(f"the reader returned the shape {pixels.shape}; an image is (H, W, 1 to 4)")
        budget.check_size(pixels.shape[0], pixels.shape[1])
        return pixels if pixels.dtype in (np.uint8, np.uint16) else pixels.astype(np.float32)

    return checked


READ_ONLY = (".bmp", ".gif", ".tif", ".tiff", ".webp")
NETPBM = (".pbm", ".pgm", ".ppm", ".pnm", ".pam", ".pfm")
# the first bytes of files, and their readers
SIGNED: tuple[tuple[bytes | tuple[bytes, ...], Decoder], ...] = (
    (tuple(raster.FORMATS), raster.decode),
    (pnm.SIGNATURES, pnm.decode),
    (exr.SIGNATURE, exr.decode),
    (rgbe.SIGNATURES, rgbe.decode),
    (b"\x93NUMPY", _decode_npy),
    (b"PK\3\4", _decode_npz),
)
BUILT_IN = {raster.decode_tga, *(decode for _, decode in SIGNED)}
IMAGE_READERS: Registry[Decoder] = Registry(
    "extension",
    "a function of bytes that returns pixels (H, W, C)",
    {
        **dict.fromkeys((*coded.EXTENSIONS, *READ_ONLY), raster.decode),
        ".tga": raster.decode_tga,
        **dict.fromkeys(NETPBM, pnm.decode),
        ".exr": exr.decode,
        ".hdr": rgbe.decode,
        ".npy": _decode_npy,
        ".npz": _decode_npz,
    },
    adapt=_checked_pixels,
    group="read_image",
)
IMAGE_WRITERS: Registry[Encoder] = Registry(
    "extension",
    "a function of linear pixels (H, W, 3) that returns bytes",
    {
        **dict.fromkeys(coded.EXTENSIONS, _encode_jpg),
        ".png": _encode_png,
        ".exr": _whole(exr.encode),
        ".hdr": _colors(rgbe.encode),
        ".npy": _colors(_encode_npy),
        ".npz": _whole(npz.encode),
    },
    adapt=_colors,
    group="write_image",
)
ALL_OF_IT: dict[str, Callable[[bytes, Budget], ImageData | None]] = {  # formats that hold all of a picture
    ".exr": exr.decode_all,
    ".npz": npz.decode,
}
FINITE = (*coded.EXTENSIONS, ".hdr")  # formats that hold neither NaN nor infinities
