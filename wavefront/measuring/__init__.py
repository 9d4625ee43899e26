"""Measured light: irradiance, fluence and radiance at points, and the power that reaches shapes."""

from .flux import measure_flux
from .measure import measure
from .measurement import Measurement
from .points import grid_points, load_points

__all__ = ["Measurement", "grid_points", "load_points", "measure", "measure_flux"]
