"""Choose the accelerator by name."""

from __future__ import annotations

from ..errors import one_of
from .base import Accelerator, Geometry
from .embree import EmbreeAccelerator, installed
from .numpy_accel import NumpyAccelerator

CHOICES = ("auto", "numpy", "embree")
COPIES = 1 << 18  # triangles of instances, in all, up to which Embree is faster with one mesh of them


def make_accelerator(geometry: Geometry, accel: str) -> Accelerator:
    """Build the accelerator named `accel`; "auto" takes Embree where it is installed.

    Raises
    ------
    SceneError
        If the name is unknown, or Embree is asked for and not installed.
    """
    one_of("accel", accel, CHOICES)
    return EmbreeAccelerator(geometry) if engine(accel) == "embree" else NumpyAccelerator(geometry)


def most_copies(accel: str) -> int:
    """Return up to how many triangles in all it is faster to build each instance as a mesh of its own."""
    return COPIES if engine(accel) == "embree" else 0


def engine(accel: str) -> str:
    """Return what `accel` stands for: "embree" or "numpy"."""
    return "embree" if accel == "embree" or (accel == "auto" and installed()) else "numpy"
