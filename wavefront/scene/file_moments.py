"""Scenes of files that are read anew for each time, as those of USD, whose attributes all may change."""

from __future__ import annotations

from collections.abc import Callable
from copy import copy
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..camera import Camera
from ..core.errors import SceneError
from ..core.fingerprint import fingerprint
from ..lights import Light
from ..motion import Keyframes
from ..shapes import Shape

KEYS = 9  # of the motion of a camera
FEW = 5  # times that say how far a scene reaches

if TYPE_CHECKING:
    from .scene import Scene


class OfFile(NamedTuple):
    """The elements of a file at one time."""

    shapes: list[Shape]
    lights: list[Light]
    camera: Camera | None


class FileMoments:
    """The elements of a scene that come from its file, and how the file is read at other times.

    Parameters
    ----------
    read
        Returns the scene of a time, seconds.
    span
        From when to when the file moves, seconds.
    scene
        As it was read for its start.
    """

    def __init__(self, read: Callable[[float], Scene], span: tuple[float, float], scene: Scene) -> None:
        self._read, self.span = read, span
        self._shapes, self._lights, self._camera = list(scene.shapes), list(scene.lights), scene.camera
        elements: list[Any] = [*self._shapes, *self._lights]
        self._known = {key: element for element in elements if (key := _made_of(element)) is not None}
        self._samples: list[Scene] = []
        # by time: a blurred picture asks twice for each of its times
        self._read_last: dict[float, OfFile] = {}

    def __getstate__(self) -> dict[str, Any]:
        """Leave out what can be read again."""
        return {**vars(self), "_samples": [], "_read_last": {}}

    def samples(self, scene: Scene) -> list[Scene]:
        """Return the scene at a few times, read once, from which its bounds follow."""
        if not self._samples:
            self._samples = [scene.at(time) for time in np.linspace(*self.span, FEW)]
        return self._samples

    def at(self, scene: Scene, time: float) -> tuple[list[Shape], list[Light], Camera | None]:
        """Return shapes, lights and camera of a time: those of the file, and those added to the scene.

        Elements that have not changed are the objects of the scene itself, with their textures and tables.
        """
        mine = {id(element) for element in (*self._shapes, *self._lights)}  # not kept: a copy has other ids
        found = self._at(time)
        shapes = [shape if id(shape) in mine else copy(shape) for shape in found.shapes]
        lights = [light if id(light) in mine else copy(light) for light in found.lights]
        shapes += [shape.at(time) for shape in scene.shapes if id(shape) not in mine]
        lights += [light.at(time) for light in scene.lights if id(light) not in mine]
        is_of_file = scene.camera is self._camera
        return shapes, lights, found.camera if is_of_file else scene.camera and scene.camera.at(time)

    def _at(self, time: float) -> OfFile:
        """Return what is in the file at a time; what was read for the last few times is not read again."""
        found = self._read_last.pop(time, None)
        if found is None:
            fresh = self._read(time)
            shapes = [self._known.get(_made_of(shape) or "", shape) for shape in fresh.shapes]
            lights = [self._known.get(_made_of(light) or "", light) for light in fresh.lights]
            found = OfFile(shapes, lights, fresh.camera)
        self._read_last[time] = found
        if len(self._read_last) > KEYS:
            del self._read_last[next(iter(self._read_last))]  # the oldest one
        return found

    def camera_between(self, scene: Scene, begin: float, end: float) -> Camera | None:
        """Return the camera of a scene as it moves between two times, s: that of the file by its places then.

        A camera that was not read from the file is returned as it is.
        """
        if self._camera is None or scene.camera is not self._camera:
            return scene.camera
        times = np.linspace(begin, end, KEYS)
        cameras = [camera for time in times.tolist() if (camera := scene.at(time).camera) is not None]
        places = np.array([camera.to_matrix() for camera in cameras])
        if len(cameras) < KEYS or (places == self._camera.to_matrix()).all():
            return scene.camera
        middle = KEYS // 2
        ways = Keyframes(times, places @ np.linalg.inv(places[middle]))
        moving: Camera = cameras[middle].transformed(ways)
        return moving


def _made_of(element: Shape | Light) -> str | None:
    """Return a fingerprint of a shape or a light; None where it has none."""
    try:
        return fingerprint("a part of a file", element)
    except SceneError:
        return None
