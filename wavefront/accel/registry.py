"""The table of accelerators."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

from ..core.registry import Registry
from .base import Accelerator, Geometry
from .embree import EmbreeAccelerator, installed
from .numpy_accel import NumpyAccelerator

AcceleratorMaker: TypeAlias = Callable[[Geometry], Accelerator]

COPIES = 1 << 18  # triangles of instances, in all, up to which Embree is faster with one mesh of them


def automatic(geometry: Geometry) -> Accelerator:
    """Build an Embree accelerator where Embree is installed, else one in NumPy, and for no triangles too."""
    return engine("auto")(geometry) if len(geometry.triangles) else NumpyAccelerator(geometry)


ACCELERATORS: Registry[AcceleratorMaker] = Registry(
    "accel",
    "a class of accelerators",
    {"auto": automatic, "numpy": NumpyAccelerator, "embree": EmbreeAccelerator},
)


def make_accelerator(geometry: Geometry, accel: str | AcceleratorMaker) -> Accelerator:
    """Build an accelerator, given by name or by its class; "auto" takes Embree where it is installed.

    Raises
    ------
    SceneError
        If the name is unknown, or Embree is asked for and not installed.
    """
    return ACCELERATORS.find(accel)(geometry)


def most_copies(accel: str | AcceleratorMaker) -> int:
    """Return up to how many triangles in all it is faster to build each instance as a mesh of its own."""
    return COPIES if engine(accel) is EmbreeAccelerator else 0


def engine(accel: str | AcceleratorMaker) -> AcceleratorMaker:
    """Return the class of accelerators that `accel` stands for."""
    if accel == "auto":
        return EmbreeAccelerator if installed() else NumpyAccelerator
    return ACCELERATORS.find(accel)
