"""Measured light: irradiance, fluence and radiance at points, and the power that reaches shapes."""

from .daylight import DaylightCoefficients, daylight_coefficients
from .flux import measure_flux
from .measure import measure
from .measurement import Measurement
from .points import grid_points, load_points
from .weather import Weather, load_weather
from .year import Year

__all__ = [
    "DaylightCoefficients",
    "Measurement",
    "Weather",
    "Year",
    "daylight_coefficients",
    "grid_points",
    "load_points",
    "load_weather",
    "measure",
    "measure_flux",
]
