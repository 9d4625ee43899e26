"""A small picture of a material: a ball made of it."""

from __future__ import annotations

from weakref import WeakKeyDictionary

import numpy as np

from .bsdfs import Bsdf
from .camera import Camera
from .codecs import png_jpeg
from .core.errors import SceneError
from .core.fingerprint import fingerprint
from .drive.render import render
from .materials import Material
from .scene import Scene
from .shapes import Sphere

SIZE = 96  # pixels
SPP = 32
CAMERA = Camera.look_at((0.9, 0.9, 4.2), (0, -0.05, 0), fov=31, size=(SIZE, SIZE))

_BALLS: WeakKeyDictionary[Material | Bsdf, tuple[str, bytes | None]] = WeakKeyDictionary()


def ball_png(material: Material | Bsdf) -> bytes | None:
    """Return a png file of a ball made of a material, on a gray ground in the light of a studio.

    It is rendered once, and again when the material has changed. It is None if the material cannot be
    rendered on a sphere, as one that needs vertex colors.
    """
    try:
        now = fingerprint("material", material)
        before = _BALLS.get(material)
    except (SceneError, TypeError):  # it cannot be compared, or has no hash: it is rendered each time
        return _rendered(material)
    if before is None or before[0] != now:
        before = _BALLS[material] = now, _rendered(material)
    return before[1]


def _rendered(material: Material | Bsdf) -> bytes | None:
    scene = Scene([Sphere((0, 0, 0), 1, material=material)], camera=CAMERA)
    try:
        image = render(
            scene, SPP, lighting="studio", ground=True, max_bounces=8, executor="threads", progress=False
        )
    except SceneError:
        return None
    return png_jpeg.encode(np.ascontiguousarray(image.to_uint8()), ".png", 2.2)
