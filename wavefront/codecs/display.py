"""From linear radiance to codes of a display: exposure, white balance, tone curve, gamma, alpha."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arrays.vec import Floats
from ..core.errors import one_of
from .encoding import check_exposure, check_gamma, exposed, to_codes
from .image_data import ImageData
from .png_jpeg import Gamma
from .tone import AUTO, CHOSEN_STOPS, CHOSEN_TONE, TONES, transformed
from .white_balance import WhiteBalance, white_balance_matrix


@dataclass(frozen=True, slots=True)
class Display:
    """How a picture is shown.

    Raises
    ------
    SceneError
        If a value is out of range, or the tone is unknown.
    """

    gamma: Gamma = 2.2  # values are raised to 1/gamma; "srgb" is the exact sRGB curve
    exposure: float = 0.0  # stops by which the picture is brightened first
    tone: str = AUTO  # a name of `TONES`, or "auto": that of the picture's metadata
    white_balance: WhiteBalance | None = None  # kelvin, or the linear RGB of something gray

    def __post_init__(self) -> None:
        """Check all values."""
        check_gamma(self.gamma)
        check_exposure(self.exposure)
        if self.tone != AUTO:
            one_of("tone", self.tone, TONES)
        if self.white_balance is not None:
            white_balance_matrix(self.white_balance)

    def adjusted(self, picture: ImageData) -> ImageData:
        """Return the picture in the exposure and white balance, still linear.

        Of a picture that they change, only rgb and alpha are left: the other layers and the errors belong to
        the values before.
        """
        if self.exposure == 0 and self.white_balance is None:
            return picture
        rgb = exposed(picture.rgb, self.exposure)
        if self.white_balance is not None:
            matrix = white_balance_matrix(self.white_balance)
            rgb = transformed(matrix, rgb.astype(np.float64)).astype(np.float32)
        return picture.with_rgb(rgb)

    def codes(self, picture: ImageData, bits: int = 8) -> NDArray[Any]:
        """Return the codes (H, W, 3) of an adjusted picture; with a transparent background, (H, W, 4).

        In memory colors are premultiplied by alpha; codes are not. The division comes before the tone curve
        and the gamma. Alpha itself is linear.
        """
        alpha = picture.alpha
        color = picture.rgb if alpha is None else _unassociated(picture.rgb, alpha)
        shown = self._toned(color, picture.metadata.get("tone") == CHOSEN_TONE)
        codes = to_codes(shown, self.gamma, bits)
        if alpha is None:
            return codes
        return np.concatenate([codes, to_codes(alpha[..., None], 1, bits)], axis=-1)

    def _toned(self, color: Floats, chosen: bool) -> NDArray[Any]:
        """Return colors after the tone curve; `chosen` if the light of the picture was chosen for one."""
        tone = self.tone if self.tone != AUTO else CHOSEN_TONE if chosen else "none"
        curve = TONES[tone]
        if curve is None:
            return color
        stops = CHOSEN_STOPS if chosen and tone == CHOSEN_TONE else 0.0
        return curve(color.astype(np.float64) * 2.0**stops)


def _unassociated(rgb: Floats, alpha: Floats) -> Floats:
    """Return premultiplied colors (H, W, 3) divided by alpha (H, W) where it is above 0."""
    covered = alpha > 0
    return np.asarray(rgb / np.where(covered, alpha, np.float32(1))[..., None])
