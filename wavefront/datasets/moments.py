"""The views of a data set: cameras, and times of a scene that moves."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from ..arrays.soa import soa
from ..camera import Camera
from ..core.errors import SceneError, finite_array
from ..scene import Scene


@soa
class PlannedView:
    """A view that is to be rendered."""

    number: int
    camera: Camera
    frame: int = 0  # its place among the times of its camera
    frames: int = 1
    time: float | None = None  # s


@soa
class Moment:
    """The views of one scene, in which nothing moves."""

    scene: Scene
    views: list[PlannedView]
    about: dict[str, Any]  # settings that differ between moments


def checked_times(times: Iterable[float] | None, shutter: Any) -> list[float] | None:
    """Return the times of views, rising.

    Raises
    ------
    SceneError
        If they are malformed, or a setting `shutter` says other times.
    """
    if times is None:
        return None
    seconds = finite_array("times", list(times) if isinstance(times, Iterable) else times, (None,))
    if not len(seconds) or not (np.diff(seconds) > 0).all():
        raise SceneError(f"times is {seconds.tolist()}; they must rise, and there must be at least one")
    if shutter is not None:
        raise SceneError("shutter is of one time; views at several times have none")
    return [float(time) for time in seconds]


def moments(scene: Scene, cameras: Sequence[Camera], times: list[float] | None, flow: bool) -> list[Moment]:
    """Return the views of cameras at times, by time: views of one camera have consecutive numbers.

    Parameters
    ----------
    times
        Rising; None for the scene as it is.
    flow
        Whether views have AOVs of flow.
    """
    if times is None:
        return [Moment(scene, [PlannedView(at, camera) for at, camera in enumerate(cameras)], {})]
    out, frames = [], len(times)
    gaps = np.diff(times).tolist() or [0.0]
    around = [times[0] - gaps[0], *times, times[-1] + gaps[-1]]
    for frame, time in enumerate(times):
        views = [
            PlannedView(at * frames + frame, camera.at(time), frame, frames, time)
            for at, camera in enumerate(cameras)
        ]
        about = {"flow_times": (around[frame], around[frame + 2])} if flow else {}
        out.append(Moment(scene.at(time), views, about))
    return out
