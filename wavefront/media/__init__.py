"""Media: what fills the space inside shapes."""

from .medium import Medium
from .phase import HenyeyGreenstein, Isotropic, PhaseFunction, PhaseMix, Rayleigh

__all__ = ["HenyeyGreenstein", "Isotropic", "Medium", "PhaseFunction", "PhaseMix", "Rayleigh"]
