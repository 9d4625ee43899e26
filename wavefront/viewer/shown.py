"""The layers that a viewer offers, as codes of a display."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arrays.vec import Floats
from ..codecs.tone import AUTO
from ..film.aov_names import GUIDES
from ..image import Image
from ..image.plot import aov_colors, id_colors

BACKDROP = 0.85  # gray behind transparent pixels

CHOICES = {  # the choices of the page, and the layers that each needs
    "rgb": (),
    "albedo": ("albedo",),
    "normal": ("normal",),
    "depth": ("depth",),
    "ids": ("shape_id",),
    "denoised": GUIDES,
}
RADIANCE = ("rgb", "denoised")
VIEWER_AOVS = tuple(name for names in CHOICES.values() for name in names)


def shown_codes(image: Image, choice: str, exposure: float, tone: str = AUTO) -> NDArray[np.uint8]:
    """Return the pixels of a layer of a picture as a page shows them, (H, W, 3).

    Parameters
    ----------
    image
        A picture with all `VIEWER_AOVS`; to be shown as "denoised" it must have been denoised.
    choice
        A key of `CHOICES`.
    exposure, tone
        Stops and tone curve, of radiance.
    """
    if choice in RADIANCE:
        return _opaque(image.to_uint8(exposure=exposure, tone=tone))
    (name,) = CHOICES[choice]
    values = image.layers[name]
    if choice == "depth":
        colors: NDArray[Any] = np.repeat(_near_is_bright(values)[..., None], 3, axis=2)
    else:
        colors = id_colors(values) if choice == "ids" else aov_colors(name, values)
    return colors if colors.dtype == np.uint8 else np.rint(colors * 255).astype(np.uint8)


def _opaque(codes: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return codes (H, W, 3 or 4) before a gray backdrop, (H, W, 3)."""
    if codes.shape[2] == 3:
        return codes
    alpha = codes[..., 3:] / np.float32(255)
    return np.rint(codes[..., :3] * alpha + 255 * BACKDROP * (1 - alpha)).astype(np.uint8)


def _near_is_bright(depth: Floats) -> Floats:
    """Return depths (H, W) in [0, 1], from the farthest to the nearest; the backdrop where there are none."""
    known = depth[np.isfinite(depth)]
    if not known.size:
        return np.full(depth.shape, BACKDROP, np.float32)
    near, far = known.min(), known.max()
    bright = (far - depth) / (far - near if far > near else 1)
    return np.where(np.isfinite(depth), bright, np.float32(BACKDROP))
