"""Parts of pictures, and pictures of another size."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..arrays.vec import Doubles
from ..camera import ImageSize, image_size
from ..core.errors import SceneError, in_brief
from ..statistics import Scatter

if TYPE_CHECKING:
    from .image import Image


def cropped(image: Image, window: Any) -> Image:
    """Return a part of a picture: see `Image.crop`."""
    height, width = image.rgb.shape[:2]
    try:
        sides = [int(side) for side in window]
        whole = len(sides) == 4 and all(side == bound for side, bound in zip(sides, window, strict=True))
    except (TypeError, ValueError, OverflowError):
        whole, sides = False, []
    if not whole or not (0 <= sides[0] < sides[2] <= width and 0 <= sides[1] < sides[3] <= height):
        limit = f"four whole numbers (x0, y0, x1, y1) within {width}x{height}"
        raise SceneError(f"crop is {in_brief(window)}; it must be {limit}, and not empty")
    pixels = np.s_[sides[1] : sides[3], sides[0] : sides[2]]

    def of(values: Any) -> Any:
        return None if values is None else values[pixels].copy()

    metadata = dict(image.metadata)
    if "window" in metadata:
        x, y = metadata["window"][:2]
        metadata["window"] = [x + sides[0], y + sides[1], x + sides[2], y + sides[3]]
    return image.with_parts(
        rgb=of(image.rgb),
        metadata=metadata,
        **{name: of(getattr(image, name)) for name in ("counts", "variance", "standard_error", "halves")},
        **{
            name: {key: of(values) for key, values in getattr(image, name).items()}
            for name in ("layers", "errors", "measured")
        },
        sums=None,
        scatter=[Scatter(of(scatter.deviations), of(scatter.tile)) for scatter in image.scatter],
    )


def resized(image: Image, size: ImageSize) -> Image:
    """Return a picture in another size: see `Image.resize`."""
    width, height = image_size(size)
    rows = _means(np.asarray(image.rgb, np.float64), height)
    pixels = _means(rows.transpose(1, 0, 2), width).transpose(1, 0, 2)
    metadata = {name: value for name, value in image.metadata.items() if name not in ("window", "film")}
    return type(image)(pixels.astype(np.float32), image.spp, metadata)


def _means(values: Doubles, count: int) -> Doubles:
    """Return the means (count, ...) over equal parts of the first axis of values (n, ...)."""
    whole = np.concatenate([np.zeros((1, *values.shape[1:])), np.cumsum(values, 0)])
    place = np.arange(count + 1) * len(values) / count
    below = np.minimum(place.astype(np.intp), len(values) - 1)
    fraction = (place - below).reshape(-1, *[1] * (values.ndim - 1))
    sums = whole[below] + fraction * values[below]
    means: Doubles = np.diff(sums, axis=0) * (count / len(values))
    return means
