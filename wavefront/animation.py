"""Images as numbered files, or as one animation."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator
from importlib.util import find_spec
from io import BytesIO
from pathlib import Path
from typing import BinaryIO, TypeAlias

import numpy as np
from numpy.typing import NDArray

from .codecs.display import Display
from .codecs.images import check_writable
from .codecs.tone import AUTO
from .codecs.white_balance import WhiteBalance
from .core.errors import Interrupted, RenderError, SaveError, SceneError, number
from .core.files import check_target, extension_of, path_name, write_bytes
from .core.plural import plural
from .core.suggestions import suggests_keywords
from .image import Image

Codes: TypeAlias = NDArray[np.uint8]  # (H, W, 3)
ANIMATIONS = (".gif", ".png", ".mp4")


@suggests_keywords
def save_animation(
    path: str | os.PathLike[str],
    images: Iterable[Image],
    *,
    fps: float = 24,
    gamma: float | str = 2.2,
    exposure: float = 0.0,
    tone: str = AUTO,
    white_balance: WhiteBalance | None = None,
) -> int:
    """Save images as an animation, or as numbered files.

    Parameters
    ----------
    path
        Ends in .gif, .png (animated) or .mp4, which needs `pip install av`. With a number in
        braces, such as "frame_{:03d}.png", each image is saved by itself, in any format of `Image.save`,
        from 0 on, when it is there.
    images
        Of one size; from `render_many`, for example.
    fps
        Images per second.
    gamma, exposure, tone, white_balance
        As for `Image.save`.

    Returns
    -------
    int
        The number of images.

    Raises
    ------
    SceneError
        If there is no image, sizes differ, or an argument is out of range.
    SaveError
        If the file cannot be written.
    Interrupted, RenderError
        If the render of an image ends so. Those before it are saved.

    Examples
    --------
    >>> images = [wf.Image(np.full((8, 8, 3), value, np.float32)) for value in (0.0, 0.5, 1.0)]
    >>> wf.save_animation("flash.gif", images, fps=8)
    3
    """
    name = path_name(path, SaveError)
    display = Display(gamma, exposure, tone, white_balance)
    fps = number("fps", fps, lambda x: x > 0, "above 0")
    check_animation(name)
    until_error = _UntilError(images)
    if "{" in name:
        count = _save_numbered(name, until_error, display)
    else:
        encode = _mp4 if Path(name).suffix.lower() == ".mp4" else _pictures
        count = _save_one(name, encode, _frames(name, until_error, display), fps)
    if until_error.error is not None:
        raise _cut_short(until_error.error, name, count) from until_error.error
    return count


class _UntilError:
    """Images one after the other, until the render of one fails or is stopped; the first must be there."""

    def __init__(self, images: Iterable[Image]) -> None:
        self.images = images
        self.error: KeyboardInterrupt | RenderError | None = None

    def __iter__(self) -> Iterator[Image]:
        first = True
        try:
            for image in self.images:
                first = False
                yield image
        except (KeyboardInterrupt, RenderError) as error:
            if first:
                raise
            self.error = error


def _cut_short(error: KeyboardInterrupt | RenderError, name: str, count: int) -> Interrupted | RenderError:
    """Return the error of an image, which also says that those before it are saved."""
    kind = RenderError if isinstance(error, RenderError) else Interrupted
    text = f"{str(error) or 'interrupted'}; {name} has the {plural(count, 'picture')} before it"
    return kind(text, getattr(error, "image", None))


def check_animation(path: str | os.PathLike[str]) -> None:
    """Check that an animation can be written to `path`, before a long render.

    Raises
    ------
    SaveError
        If the extension is unknown, the folder is missing or not writable, or a package is not installed.
    """
    name = path_name(path, SaveError)
    if "{" in name:
        check_writable(numbered(name, 0))
        return
    kind = extension_of(name, ANIMATIONS, SaveError)
    if kind not in ANIMATIONS:
        raise SaveError(f"{name}: extension is {kind!r}; it must be one of {', '.join(ANIMATIONS)}")
    if kind == ".mp4" and find_spec("av") is None:
        raise SaveError(f"{name}: mp4 needs pip install av")
    check_target(name)


def numbered(pattern: str, number: int) -> str:
    """Return the name of a numbered file.

    Raises
    ------
    SaveError
        If the pattern does not make names that differ.
    """
    try:
        name, other = pattern.format(number), pattern.format(number + 1)
    except (ValueError, IndexError, KeyError) as error:
        raise SaveError(f"{pattern}: no pattern for numbers, such as frame_{{:03d}}.png: {error}") from error
    if name == other:
        raise SaveError(f"{pattern}: has no place for a number, such as frame_{{:03d}}.png")
    return name


def _save_numbered(pattern: str, images: Iterable[Image], display: Display) -> int:
    count = 0
    for image in images:
        image.save(
            numbered(pattern, count), display.gamma, display.exposure, display.tone, display.white_balance
        )
        count += 1
    if not count:
        raise SceneError(f"{pattern}: there are no images to save")
    return count


def _frames(name: str, images: Iterable[Image], display: Display) -> Iterator[Codes]:
    """Yield the codes (H, W, 3) of all images; a transparent background becomes black."""
    size = None
    for image in images:
        codes = image.to_uint8(display.gamma, display.exposure, display.tone, display.white_balance)
        height, width = codes.shape[:2]
        if size not in (None, (width, height)):
            sizes = "{}x{} and ".format(*size) + f"{width}x{height}"
            raise SceneError(f"{name}: images of an animation must have one size, got {sizes}")
        size = width, height
        yield codes[..., :3]


Encode: TypeAlias = Callable[[BinaryIO, str, Iterator[Codes], float], int]  # the number of frames


def _save_one(name: str, encode: Encode, frames: Iterator[Codes], fps: float) -> int:
    """Write frames as one file, and return their number."""
    buffer = BytesIO()
    count = encode(buffer, Path(name).suffix.lower(), frames, fps)
    if not count:
        raise SceneError(f"{name}: there are no images to save")
    write_bytes(name, buffer.getvalue())
    return count


def _mp4(file: BinaryIO, extension: str, frames: Iterator[Codes], fps: float) -> int:
    """Write a video frame by frame: in memory there is one at a time."""
    import imageio.v3 as iio

    count = 0
    with iio.imopen(file, "w", extension=extension, plugin="pyav") as video:
        for count, codes in enumerate(frames, 1):
            if count == 1:
                video.init_video_stream("libx264", fps=fps)
            height, width = codes.shape[:2]
            video.write_frame(codes[: height // 2 * 2, : width // 2 * 2])  # the codec halves colors
    return count


def _pictures(file: BinaryIO, extension: str, frames: Iterator[Codes], fps: float) -> int:
    """Write an animated picture; it is encoded when all frames are there."""
    import imageio.v3 as iio

    codes = list(frames)
    if codes:
        iio.imwrite(file, codes, extension=extension, plugin="pillow", duration=1000 / fps, loop=0)
    return len(codes)
