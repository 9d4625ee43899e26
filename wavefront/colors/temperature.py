"""The color of a temperature."""

from __future__ import annotations

from ..arrays.vec import Doubles
from ..core.suggestions import suggests_keywords
from .photometry import EFFICACY, to_photometric
from .spectrum import blackbody as radiance


@suggests_keywords
def blackbody(temperature: float) -> Doubles:
    """Return the linear color (3,) of a black body, such as a lamp's filament or the sun, of luminance 1.

    Parameters
    ----------
    temperature
        Kelvin, from 100 to 1e6: candles have about 1900, bulbs 2700, the sun 5800.

    Raises
    ------
    SceneError
        If it is out of range.

    Examples
    --------
    >>> bulb = wf.PointLight((0, 2, 0), wf.from_photometric(60, wf.blackbody(2700)))  # 60 candela
    """
    color = radiance(temperature)
    return color / (float(to_photometric(color)) / EFFICACY)
