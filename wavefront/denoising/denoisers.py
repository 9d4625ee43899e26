"""The denoisers by name."""

from __future__ import annotations

from collections.abc import Callable
from importlib.util import find_spec
from typing import TypeAlias

import numpy as np

from ..arrays.vec import Floats
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

    It is scaled so that its mean stays, by 5 % at most: a few very bright pixels, which denoisers remove,
    may hold more of the mean, and the picture must not become brighter for them.

    Parameters
    ----------
    picture
        What to denoise.
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
    return rgb * _scaling(picture.rgb, rgb), denoiser


def _scaling(before: Floats, after: Floats) -> np.float32:
    """Return the factor by which `after` is multiplied to have the mean of `before`."""
    mean, wanted = after.mean(dtype=np.float64), before.mean(dtype=np.float64)
    return np.float32(np.clip(wanted / mean, 1 - MOST_SCALING, 1 + MOST_SCALING) if mean > 0 else 1)
