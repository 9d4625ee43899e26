"""Whether the light of a file lights its scene: a lamp or a display alone may leave all else black."""

from __future__ import annotations

from copy import copy
from typing import Any

import numpy as np

from ..arrays.vec import luminance
from ..camera import Camera
from ..core.errors import collect_warnings, warn_caller
from ..lights import Environment, Sky
from ..scene import Scene
from ..scene.lighting import DEFAULT, lighted
from ..settings import Settings

SIDE, SPP = 64, 4  # of the pictures that are compared
LITTLE = 0.02  # of the light of the preset


def needs_preset(scene: Scene, settings: Settings, camera: Camera) -> bool:
    """Return whether the own light of a scene that was read from a file leaves it black, and say so.

    Two small pictures are compared, of its own light and of the default preset alone, always with the same
    seed. What counts is the median of what the camera sees. Scenes that are made in Python, those with an
    `Environment` or a `Sky`, and those in a medium are left as they are.
    """
    if not scene.has_lights_of_file or scene.medium is not None or camera.sensor is not None:
        return False
    if not scene.emits or any(isinstance(light, Environment | Sky) for light in scene.lights):
        return False
    own, usual = (_median(each, settings, camera) for each in (scene, _unlit(scene, settings, camera)))
    if not usual or not own < LITTLE * usual:
        return False
    part = f"{100 * own / usual:.2g} % of the light of a studio"
    warn_caller(f"the lights of the file give {part}, so lighting={DEFAULT!r} is added; None leaves it out")
    return True


def _unlit(scene: Scene, settings: Settings, camera: Camera) -> Scene:
    """Return a scene in the light of the preset alone."""
    dark = copy(scene)
    dark.lights = []
    return lighted(dark, DEFAULT, up=scene.vertical(settings.values["up"]), camera=camera)


def _median(scene: Scene, settings: Settings, camera: Camera) -> float:
    """Return the median luminance of the pixels that show shapes; 0 where there are none."""
    from .session import Session  # here, as a session asks for this

    values = dict[str, Any](settings.values)
    given = {name: values[name] for name in ("max_bounces", "accel")}
    bare = copy(scene)
    bare.settings = {}
    with (
        collect_warnings(),
        Session(
            bare,
            SPP,
            camera=camera.replace(size=SIDE),
            lighting=None,
            ground=False,
            aovs=("alpha",),
            workers=1,
            executor="threads",
            branches=1,
            reuse=False,
            progress=False,
            **given,
        ) as session,
    ):
        image = session.run()
    shown = image.layers["alpha"] > 0.5
    return float(np.median(luminance(image.rgb[shown].T))) if shown.any() else 0.0
