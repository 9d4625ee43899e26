"""Colors as people write them, and as light adds up: linear RGB."""

from .color import is_color_name, named_rows, rgb, srgb
from .colormaps import warn_of_colormap
from .photometry import DAYLIGHT, EFFICACY, Photometric, exposure, from_photometric, to_photometric
from .temperature import blackbody
from .transfer import linear_to_srgb, srgb_to_linear

__all__ = [
    "DAYLIGHT",
    "EFFICACY",
    "Photometric",
    "blackbody",
    "exposure",
    "from_photometric",
    "is_color_name",
    "linear_to_srgb",
    "named_rows",
    "rgb",
    "srgb",
    "srgb_to_linear",
    "to_photometric",
    "warn_of_colormap",
]
