"""Photometric light: the watts of each light times its efficacy."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..arrays.vec import Floats, f4, luminance

BROADBAND = 179.0  # lm/W; watts of visible light alone have as many or more, those of a whole spectrum fewer


def lux_of(efficacies: Sequence[float], parts: Sequence[Floats]) -> Floats:
    """Return the photometric light of n samples: all of it, that of broadband lights, and the rest, (3, n).

    Parameters
    ----------
    efficacies
        lm/W, of each part of the light.
    parts
        The light of each part, (3, n) W by channel.

    Notes
    -----
    A spectrum that is even over visible light, and 0 elsewhere, has 179 lm/W: G. Ward Larson and
    R. Shakespeare, Rendering with Radiance, 1998. The sun and the sky have about 110: R. Perez et al.,
    Modeling Daylight Availability and Irradiance Components from Direct and Global Irradiance, Solar Energy
    44(5), 1990. Numbers that are photometric themselves have 1.
    """
    out = np.zeros((3, parts[0].shape[1]), f4)
    for efficacy, rgb in zip(efficacies, parts, strict=True):
        light = f4(efficacy) * luminance(rgb)
        out[0] += light
        out[1 if 1 < efficacy < BROADBAND else 2] += light
    return out
