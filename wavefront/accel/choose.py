"""Choose the accelerator by name."""

from __future__ import annotations

from ..errors import SceneError
from .base import Accelerator, Geometry
from .embree import EmbreeAccelerator, installed
from .stream import NumpyAccelerator

CHOICES = ("auto", "numpy", "embree")


def make_accelerator(geometry: Geometry, accel: str) -> Accelerator:
    """Build the accelerator named `accel`; "auto" takes Embree where it is installed.

    Raises
    ------
    SceneError
        If the name is unknown, or Embree is asked for and not installed.
    """
    if accel not in CHOICES:
        raise SceneError(f"accel is {accel!r}; it must be one of {', '.join(CHOICES)}")
    if accel == "embree" or (accel == "auto" and installed()):
        return EmbreeAccelerator(geometry)
    return NumpyAccelerator(geometry)
