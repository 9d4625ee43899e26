"""Colors in the primaries of a file.

Source: SMPTE RP 177-1993; the matrix of Bradford: K. Lam 1985, as in ICC.1:2022, annex E.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ..arrays.vec import Doubles

REC_709 = (0.64, 0.33, 0.3, 0.6, 0.15, 0.06, 0.3127, 0.329)  # of sRGB; x and y of red, green, blue and white
BRADFORD = np.array(  # CIE XYZ to the responses of cones
    [[0.8951, 0.2664, -0.1614], [-0.7502, 1.7135, 0.0367], [0.0389, -0.0685, 1.0296]]
)


def rgb_to_xyz(primaries: ArrayLike) -> Doubles:
    """Return the matrix (3, 3) from RGB to CIE XYZ, whose white has Y = 1.

    Parameters
    ----------
    primaries
        x and y of red, green, blue and white, 8 numbers.
    """
    x, y = np.asarray(primaries, np.float64).reshape(4, 2).T
    xyz = np.stack([x / y, np.ones(4), (1 - x - y) / y])
    scale = np.linalg.solve(xyz[:, :3], xyz[:, 3])
    return np.asarray(xyz[:, :3] * scale)


def to_srgb(primaries: ArrayLike) -> Doubles:
    """Return the matrix (3, 3) from linear RGB of some primaries to linear sRGB; white becomes white."""
    source, target = rgb_to_xyz(primaries), rgb_to_xyz(REC_709)
    cones = (BRADFORD @ target.sum(1)) / (BRADFORD @ source.sum(1))
    adapted = np.linalg.solve(BRADFORD, cones[:, None] * BRADFORD)
    return np.asarray(np.linalg.solve(target, adapted @ source))
