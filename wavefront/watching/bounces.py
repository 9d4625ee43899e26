"""The light of a picture by how often it has been scattered."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..arrays.vec import Floats
from ..core.errors import SceneError, collect_warnings, number
from ..core.suggestions import suggests_keywords
from ..drive.render import render

# for paths that agree in all pictures
ALONE: dict[str, Any] = {"branches": 1, "reuse": False, "guide": False, "denoise": False}


@suggests_keywords
def bounces(scene: Any, spp: int = 64, most: int = 4, **settings: Any) -> Floats:
    """Return the light that has been scattered 0, 1, 2, … times, each as a picture.

    The picture of k is the difference of those with `max_bounces` k and k − 1. Both have the same random
    numbers, so it has only its own noise.

    Parameters
    ----------
    scene, spp
        As for `render`.
    most
        The most scattering events.
    settings
        Those of `render`, but for `max_bounces` and those that let paths split, share or end by themselves.

    Returns
    -------
    ndarray
        (most + 1, H, W, 3) radiance. The sum is the picture with `max_bounces=most`.

    Raises
    ------
    SceneError
        If an argument is malformed.

    Examples
    --------
    >>> light = wf.bounces([wf.Sphere((0, 0, 0), 1), wf.Environment(1)], spp=4, most=1, size=(8, 8))
    >>> light.shape, float(light[0, 0, 0, 0]), float(light[0, 4, 4, 0])
    ((2, 8, 8, 3), 1.0, 0.0)
    """
    for name in ("max_bounces", "noise", "seconds", *ALONE):
        if name in settings:
            raise SceneError(f"bounces: {name} is given; the pictures that are compared must all have one")
    last = int(
        number("bounces: most", most, lambda x: x >= 0 and x == int(x), "a whole number of at least 0")
    )
    with collect_warnings():  # without a light in sight the first picture is black
        pictures = [render(scene, spp, max_bounces=0, **ALONE, **settings).rgb]
    pictures += [render(scene, spp, max_bounces=k, **ALONE, **settings).rgb for k in range(1, last + 1)]
    return np.diff(np.stack(pictures), axis=0, prepend=np.zeros((1, *pictures[0].shape), np.float32))
