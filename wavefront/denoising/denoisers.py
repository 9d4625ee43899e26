"""The denoisers by name."""

from __future__ import annotations

from collections.abc import Callable
from importlib.util import find_spec
from typing import TypeAlias

import numpy as np

from ..arrays.vec import Bools, Floats
from ..core.registry import Registry
from .noisy import NoisyPicture
from .nonlocal_means import nonlocal_means
from .open_image_denoise import open_image_denoise

MOST_SCALING = 0.05  # of a picture, to keep its mean

Denoiser: TypeAlias = Callable[[NoisyPicture], Floats]  # returns (H, W, 3)


DENOISERS: Registry[Denoiser] = Registry(
    "denoiser",
    "a function of a NoisyPicture that returns (H, W, 3)",
    {"oidn": open_image_denoise, "nonlocal_means": nonlocal_means},
)


def is_quick() -> bool:
    """Return whether a picture is denoised within tenths of a second: by Open Image Denoise."""
    return find_spec("pyoidn") is not None


def denoise(picture: NoisyPicture, denoiser: str = "auto") -> tuple[Floats, str]:
    """Return the picture without its noise, (H, W, 3), and the name of the denoiser.

    Pixels without error keep their colors, bit for bit. The others are scaled so that the mean stays, by 5 %
    at most: a few very bright pixels, which denoisers remove, may hold more of the mean, and the picture must
    not become brighter for them.

    Parameters
    ----------
    picture
        The picture to denoise.
    denoiser
        A name of `DENOISERS`, or "auto": "oidn" where pyoidn is installed, else "nonlocal_means".

    Raises
    ------
    SceneError
        If there is no such denoiser, or it is not installed.
    """
    if denoiser == "auto":
        denoiser = "oidn" if is_quick() else "nonlocal_means"
    rgb = DENOISERS.find(denoiser)(picture)
    clean = picture.clean[..., None]
    return np.where(clean, picture.rgb, rgb * _scaling(picture.rgb, rgb, ~clean)), denoiser


def _scaling(before: Floats, after: Floats, where: Bools) -> np.float32:
    """Return the factor that gives pixels `where` (H, W, 1) of `after` their mean in `before`."""
    total, wanted = (pixels.sum(where=where, dtype=np.float64) for pixels in (after, before))
    return np.float32(np.clip(wanted / total, 1 - MOST_SCALING, 1 + MOST_SCALING) if total > 0 else 1)
