"""The shutter of a camera: when it is open, and at which times paths come through it."""

from __future__ import annotations

from collections.abc import Callable
from numbers import Real
from typing import Any, TypeAlias

import numpy as np

from ..arrays.soa import soa
from ..arrays.vec import Doubles, Floats
from ..core.errors import SceneError, finite_array, in_brief
from ..core.registry import Registry

Curve: TypeAlias = Callable[[Floats], Floats]  # from numbers (n,) in [0, 1) to parts of the time, in [0, 1]


def box(u: Floats) -> Floats:
    """Let all times count alike: the shutter opens and closes at once."""
    return u


def triangle(u: Floats) -> Floats:
    """Let the middle count most: the shutter opens and closes steadily."""
    left = np.minimum(u, 1 - u)
    near = np.sqrt(left / 2)
    return np.where(u < 0.5, near, 1 - near)


SHUTTER_CURVES: Registry[Curve] = Registry(
    "shutter_curve", "a function of u (n,)", {"box": box, "triangle": triangle}
)


def check_shutter(name: str, value: Any) -> tuple[float, float] | None:
    """Check when a shutter is open: two times, the later one last, or None.

    Raises
    ------
    SceneError
        If it is something else.
    """
    if value is None:
        return None
    if isinstance(value, Real):
        raise SceneError(
            f"{name} is {in_brief(value)}; it must be (from, until), seconds of the scene; a part of "
            "the time of a frame is for render_frames"
        )
    begin, end = finite_array(name, value, (2,)).tolist()
    if not begin < end:
        raise SceneError(f"{name} is {in_brief(value)}; the shutter must be closed after it opens")
    return begin, end


@soa
class Shutter:
    """When the shutter is open, and how much light it lets through then."""

    begin: float  # when it opens, s of the scene
    end: float  # when it is closed
    curve: Curve = box

    def read_over(self, seconds: float) -> Shutter:
        """Return a shutter that is open while any row is exposed, of a sensor read over some seconds."""
        return Shutter(self.begin, self.end + abs(seconds), self.curve)

    @property
    def middle(self) -> float:
        """The middle of the time for which it is open."""
        return (self.begin + self.end) / 2

    def times(self, u: Floats) -> Doubles:
        """Return times (n,), s, distributed as light comes through, for u (n,) in [0, 1)."""
        part = np.asarray(self.curve(u.astype(np.float64)), np.float64)
        return self.begin + (self.end - self.begin) * part
