"""The fuzz of OpenPBR: light that a layer of upright fibers scatters back, any number of times.

Source: T. Zeltner, B. Burley and M. J.-Y. Chiang 2022, "Practical Multiple-Scattering Sheen Using Linearly
Transformed Cosines". f·cosθi is the albedo E(wo) times the density of cosine-weighted directions that a
matrix transforms, by which they are sampled exactly. As in the paper, this is not reciprocal. Albedo and the
matrix are polynomials, which `benchmarks/fuzz_fit.py` fits to a simulation of the layer.
"""

from __future__ import annotations

import numpy as np

from ..arrays.elementary import exp
from ..arrays.vec import INV_PI, Floats, f4, normalize
from ..sampling.warp import cosine_hemisphere

# By fuzz_fit.py, a row for each power of the first number, and a column for each of the second: for the
# logarithm of the albedo, of the cosine and 1/(roughness + 0.1); for A/roughness and B/sinθ, of
# cos/(cos + roughness) and the roughness. The inverse matrix is (A 0 B; 0 A 0; 0 0 1), if wo has azimuth 0.
ALBEDO = (
    (-0.19067, -0.18329, 0.0619, -0.0049256),
    (2.7316, -5.0921, 2.0205, -0.43794),
    (-10.274, 20.084, -12.175, 1.8027),
    (9.5629, -17.516, 9.5007, -1.2566),
)
SCALE = ((0.12737, 0.57026, 0.061271), (0.1972, 4.9787, -4.6225), (1.6904, -8.1379, 5.7874))
SHIFT = ((-0.19575, -0.16407, 0.34935), (1.8147, -4.6342, 3.0325), (-2.4759, 8.0134, -6.0559))
LEAST_ROUGHNESS = f4(0.1)  # there, next to nothing is scattered back but at grazing angles


def fuzz_albedo(cos: Floats, roughness: Floats) -> Floats:
    """Part of the light from cosines (n,) that the fibers scatter back, (n,)."""
    least = np.maximum(roughness, LEAST_ROUGHNESS)
    return exp(_polynomial(cos, f4(1) / (least + f4(0.1)), ALBEDO))


def fuzz_lobe(wo: Floats, wi: Floats, roughness: Floats) -> tuple[Floats, Floats, Floats]:
    """Return the value of the fibers without color, their density, and the albedo from wo, (n,) each.

    The density is A²·z/(π·|M⁻¹wi|⁴).
    """
    a, b = _transformation(wo[2], roughness)
    x, y = a * wi[0] + b * wo[0] * wi[2], a * wi[1] + b * wo[1] * wi[2]
    size2 = x * x + y * y + wi[2] * wi[2]
    density = np.where(wi[2] > 0, a * a * INV_PI / (size2 * size2), f4(0))
    albedo = fuzz_albedo(wo[2], roughness)
    return albedo * density, density * wi[2], albedo


def fuzz_directions(wo: Floats, u: Floats, roughness: Floats) -> Floats:
    """Return directions (3, n) for u (2, n): cosine-weighted ones that the matrix transforms."""
    a, b = _transformation(wo[2], roughness)
    x, y, z = cosine_hemisphere(u)
    return normalize(np.stack([x - b * wo[0] * z, y - b * wo[1] * z, a * z]))


def _transformation(cos: Floats, roughness: Floats) -> tuple[Floats, Floats]:
    """Return A and B/sinθ of directions of cosines (n,), (n,) each."""
    least = np.maximum(roughness, LEAST_ROUGHNESS)
    near = cos / (cos + least)
    return _polynomial(near, least, SCALE) * least, _polynomial(near, least, SHIFT)


def _polynomial(x: Floats, y: Floats, table: tuple[tuple[float, ...], ...]) -> Floats:
    """Return the polynomial in x with coefficients that are polynomials in y, (n,)."""
    rows = []
    for row in table:
        total = f4(row[-1]) * y
        for c in row[-2:0:-1]:
            total = (total + f4(c)) * y
        rows.append(total + f4(row[0]))
    total = rows[-1]
    for other in rows[-2::-1]:
        total = total * x + other
    return total
