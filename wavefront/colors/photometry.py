"""Light as people see it: lumen, candela, lux and cd/m² from watts, and back; the exposure of a camera.

RGB triples are radiometric: watts by channel. Their photometric counterpart is
K·(0.2126 R + 0.7152 G + 0.0722 B), the luminance of linear Rec. 709 RGB (ITU-R BT.709) times an efficacy K.
With K = 683 lm/W a watt of white counts as one at 555 nm (SI Brochure 2019, K_cd). Radiance's K is 179 lm/W,
for a spectrum that is even over visible light (G. Ward Larson and R. Shakespeare, Rendering with Radiance,
1998). What is given and read in photometric units does not depend on K.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..core.errors import SceneError, as_array, in_brief, number
from ..core.suggestions import suggests_keywords
from .color import rgb

EFFICACY = 683.0  # lm/W
DAYLIGHT = 110.0  # lm/W of sun and sky, about: of all their watts, visible or not
WEIGHTS = (0.2126, 0.7152, 0.0722)  # of linear RGB in luminance, ITU-R BT.709
WHITE = 1.2  # cd/m² that are white in a picture at EV100 = 0: 78 / (100 · 0.65)


class Photometric(np.ndarray[Any, Any]):
    """Linear RGB that was given as a photometric quantity, from `from_photometric`.

    It is an array like others, and knows how many lm/W were taken for white. A `Sky`, whose watts are else
    those of the whole spectrum, reads that.
    """

    efficacy: float

    def __array_finalize__(self, source: Any) -> None:
        """Take the efficacy over from the array that this one was made of."""
        self.efficacy = getattr(source, "efficacy", EFFICACY)

    def __reduce__(self) -> Any:
        """Keep the efficacy in pickles."""
        return photometric, (np.asarray(self), self.efficacy)


def photometric(values: NDArray[Any], efficacy: float) -> Photometric:
    """Return RGB (...) that were given with an efficacy, lm/W."""
    photometric_view = values.view(Photometric)
    photometric_view.efficacy = efficacy
    return photometric_view


@suggests_keywords
def to_photometric(radiometric: Any, *, efficacy: float = EFFICACY) -> NDArray[np.floating]:
    """Return the luminance of radiance, the illuminance of irradiance, or the lumens of watts.

    An array is taken for watts of one kind of light, that of `efficacy`: of lights that were given in lumens,
    lux or candela, by `from_photometric`, `with_flux` or `IESLight`. Watts of a whole spectrum, such as
    those of weather files and of a `Sky.perez` made from them, have about 110 lm/W. Where a scene has lights
    of both, no factor is right for their sum: a `Measurement` keeps them apart, and gives its `lux` here.

    Parameters
    ----------
    radiometric
        (..., 3) linear RGB, or one number for gray: radiance gives cd/m², irradiance lux, intensity
        candela, power lumen. Or a `Measurement`, for its `lux`.
    efficacy
        lm/W of white: 683, or 179 as in Radiance. A measurement has those of its lights.

    Returns
    -------
    ndarray
        (...) efficacy · (0.2126 R + 0.7152 G + 0.0722 B).

    Raises
    ------
    SceneError
        If there are not three channels, the efficacy is not above 0, or one is given for a measurement.

    Examples
    --------
    >>> float(wf.to_photometric((1, 1, 1)))
    683.0
    """
    if hasattr(radiometric, "lux"):
        if efficacy != EFFICACY:
            raise SceneError(f"efficacy is {efficacy!r}; a measurement has the efficacies of its lights")
        return np.asarray(radiometric.lux)
    values = as_array("radiometric", radiometric)
    values = np.broadcast_to(values, 3) if values.ndim == 0 else values
    if values.ndim < 1 or values.shape[-1] != 3:
        raise SceneError(f"radiometric must have shape (..., 3), got {values.shape}")
    if values.dtype.kind not in "fiub":
        raise SceneError(f"radiometric must be numeric, got {in_brief(radiometric)}")
    values = values if values.dtype.kind == "f" else values.astype(np.float64)
    weights = np.multiply(WEIGHTS, _efficacy(efficacy)).astype(values.dtype)
    return np.asarray(values[..., 0] * weights[0] + values[..., 1] * weights[1] + values[..., 2] * weights[2])


@suggests_keywords
def from_photometric(value: float, color: ArrayLike = 1.0, *, efficacy: float = EFFICACY) -> Photometric:
    """Return linear RGB (3,) of a color whose photometric quantity is `value`.

    Parameters
    ----------
    value
        Candela for an `intensity`, lux for an `irradiance`, cd/m² for an `emission` or an `Environment`.
    color
        Linear RGB or the name of a color; its own size does not count.
    efficacy
        lm/W of white: 683, or 179 as in Radiance.

    Raises
    ------
    SceneError
        If the value is negative, the color black, or the efficacy not above 0.

    Examples
    --------
    >>> spot = wf.SpotLight((0, 3, 0), wf.from_photometric(900), target=(0, 0, 0))  # 900 cd
    >>> sun = wf.DirectionalLight((-1, -2, -1), wf.from_photometric(80_000, "lightyellow"))  # lux
    >>> screen = wf.Rectangle((0, 0, 0), (0.5, 0, 0), (0, 0.3, 0), emission=wf.from_photometric(300))  # cd/m²
    """
    value = number("photometric value", value, lambda x: x >= 0, "at least 0")
    channels = rgb("photometric color", color, dtype=np.float64)[:, 0]
    seen = float(to_photometric(channels, efficacy=efficacy))
    if seen <= 0:
        raise SceneError("photometric color is black; it must have a luminance")
    return photometric(channels * (value / seen), float(efficacy))


@suggests_keywords
def exposure(
    ev100: float | None = None,
    *,
    f_number: float | None = None,
    shutter: float | None = None,
    iso: float = 100.0,
    efficacy: float = EFFICACY,
) -> float:
    """Return the `exposure` in stops, for `Image.save` and `show`, of a camera.

    A luminance of 1.2·2^EV100 cd/m² becomes 1, the brightest value of a display.

    Parameters
    ----------
    ev100
        Exposure value at ISO 100, about 15 in sunlight and 7 in a lit room; or what makes it:
    f_number, shutter, iso
        Relative aperture, seconds, and speed: EV100 = log₂(f_number²/shutter · 100/iso).
    efficacy
        lm/W of white with which the lights were given.

    Raises
    ------
    SceneError
        If neither or both are given, or a number is not above 0.

    Notes
    -----
    Sources: ISO 12232, the speed by saturation, H = 78/S; S. Lagarde and C. de Rousiers, Moving Frostbite to
    Physically Based Rendering, 2014, §5.1, with q = 0.65.

    Examples
    --------
    >>> image = wf.render([wf.Sphere((0, 0, 0), 1), wf.Environment(wf.from_photometric(5000))], size=(8, 8))
    >>> image.save("day.png", exposure=wf.exposure(f_number=8, shutter=1 / 125))
    """
    speed = number("exposure iso", iso, lambda x: x > 0, "above 0")
    if (ev100 is None) == (f_number is None and shutter is None):
        raise SceneError("exposure needs ev100, or f_number and shutter, and not both")
    if ev100 is None:
        optics = {"f_number": f_number, "shutter": shutter}
        n, t = (number(f"exposure {k}", v, lambda x: x > 0, "above 0") for k, v in optics.items())
        ev100 = math.log2(n * n / t * 100 / speed)
    return math.log2(_efficacy(efficacy) / WHITE) - number("exposure ev100", ev100)


def _efficacy(value: float) -> float:
    return number("efficacy", value, lambda x: x > 0, "above 0 lm/W")
