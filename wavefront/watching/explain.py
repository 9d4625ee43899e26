"""Why a pixel is bright."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..arrays.vec import luminance
from ..core.errors import SceneError
from ..core.suggestions import suggests_keywords
from ..image import Image
from .path import PathVertices
from .trace import Pixel, Wave

SETTINGS = (
    "seed",
    "sampler",
    "integrator",
    "max_bounces",
    "light_sampler",
    "filter",
    "roulette",
    "shutter",
    "shutter_curve",
)
# paths that are not alone, or light that is cut
CHANGED = {"branches": 1, "reuse": False, "guided": False, "caustics": False, "clamp": None}


@suggests_keywords
def explain(scene: Any, image: Image, pixel: Pixel, most: int = 3) -> list[PathVertices]:
    """Return the paths with the most light of a pixel, the brightest first.

    The samples of the pixel are traced again, by their addresses, so a firefly is found exactly.

    Parameters
    ----------
    scene
        The scene that was rendered.
    image
        A picture of it, from `render` with `branches=1` and `reuse=False`, not denoised.
    pixel
        (x, y) from the upper left corner.
    most
        How many paths are returned at most.

    Raises
    ------
    SceneError
        If the picture has paths that share or split, is not of this scene, or there is no such pixel.

    Examples
    --------
    >>> lamp = wf.Sphere((0, 3, 0), 0.1, emission=1000)
    >>> glass = wf.Sphere((0, 1, 0), 1, material=wf.Dielectric(1.5))
    >>> floor = wf.Rectangle((-4, 0, 4), (8, 0, 0), (0, 0, -8), material=wf.Diffuse(0.5))
    >>> camera = wf.Camera.look_at((0, 4, 6), (0, 0, 0), size=(8, 8))
    >>> scene = wf.Scene([lamp, glass, floor], camera=camera)
    >>> image = wf.render(scene, spp=16, branches=1, reuse=False)
    >>> brightest = wf.explain(scene, image, (4, 5))[0]
    >>> brightest.pixel
    (4, 5)
    """
    for name, value in CHANGED.items():
        if image.metadata.get(name, value) != value:
            raise SceneError(
                f"explain: the picture was rendered with {name}={image.metadata[name]!r}; its paths can "
                "be told apart where branches=1, reuse=False, guide=False, caustics=False and clamp=None"
            )
    settings = {name: image.metadata[name] for name in SETTINGS if image.metadata.get(name) is not None}
    wave = Wave(scene, size=(image.rgb.shape[1], image.rgb.shape[0]), **settings)
    number = wave.numbers([pixel])
    count = int(image.counts[pixel[1], pixel[0]])
    light = wave.traced(wave.scene, number.repeat(count), np.arange(count, dtype=np.uint32))
    mean = light.mean(1, dtype=np.float64)
    if not np.allclose(mean, image.rgb[pixel[1], pixel[0]], rtol=1e-3, atol=1e-6):
        raise SceneError(
            f"explain: the samples of pixel {pixel} have the mean {mean}, and the picture has "
            f"{image.rgb[pixel[1], pixel[0]]}: it is not of this scene, or was rendered with other settings"
        )
    brightest = np.argsort(-luminance(light), kind="stable")[:most]
    return [wave.path(pixel, int(sample)) for sample in brightest]
