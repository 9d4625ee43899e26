"""Media that fill the space inside shapes."""

from .base import BaseMedium, Flight, MediumRecord
from .grid import GridMedium
from .medium import Medium
from .phase import HenyeyGreenstein, Isotropic, PhaseFunction, PhaseMix, Rayleigh

__all__ = [
    "BaseMedium",
    "Flight",
    "GridMedium",
    "HenyeyGreenstein",
    "Isotropic",
    "Medium",
    "MediumRecord",
    "PhaseFunction",
    "PhaseMix",
    "Rayleigh",
]
