"""Gradient noise, which places the dots of pbrt's texture.

Source: K. Perlin 2002, "Improving Noise", and the permutation of its reference implementation. pbrt takes the
gradients in another order.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ...arrays.vec import Floats, f4

PERMUTATION = np.frombuffer(
    bytes.fromhex(
        "97a0895b5a0f830dc95f6035c2e907e18c24671e458e086325f0150a17be0694f778ea4b001ac53e5efcdbcb75230b20"
        "39b12158ed953857ae147d88aba844af4aa547868b301ba64d929ee7536fe57a3cd385e6dc695c29372ef528f4668f36"
        "41193fa101d85049d14c84bbd05912a9c8c4878274bc9f56a4646dc6adba034034d9e2fa7c7b05ca2693767eff5255d4"
        "cfce3be32f103a11b6bd1c2adfb7aad577f898022c9aa346dd99659ba72bac09811627fd13626c6e4f71e0e8b2b97068"
        "daf661e4fb22f2c1eed2900cbfb3a2f1513391ebf90eef6b31c0d61fb5c76a9db854ccb07379322d7f0496fe8aeccd5d"
        "de72431d1848f38d80c34e42d73d9cb4"
    ),
    np.uint8,
).astype(np.intp)
MIDDLE = f4(0.5)  # z of a plane


def noise(x: Floats, y: Floats) -> Floats:
    """Return the noise (n,) at points of the plane z = 1/2."""
    column, row = np.floor(x), np.floor(y)
    dx, dy = x - column, y - row
    wx, wy = _eased(dx), _eased(dy)
    layers = []
    for k in (0, 1):
        corners = [
            _slope(column + f4(i), row + f4(j), k, dx - f4(i), dy - f4(j), MIDDLE - f4(k))
            for j in (0, 1)
            for i in (0, 1)
        ]
        low, high = (a + wx * (b - a) for a, b in (corners[:2], corners[2:]))
        layers.append(low + wy * (high - low))
    blended: Floats = layers[0] + MIDDLE * (layers[1] - layers[0])
    return blended


def _eased(t: Floats) -> Floats:
    eased: Floats = t * t * t * (t * (t * f4(6) - f4(15)) + f4(10))
    return eased


def _slope(x: Floats, y: Floats, z: int, dx: Floats, dy: Floats, dz: Any) -> Floats:
    """Return the product of a corner's gradient and the offset from the corner."""
    i, j = (index.astype(np.int64) & 255 for index in (x, y))
    which = PERMUTATION[(PERMUTATION[(PERMUTATION[i] + j) & 255] + z) & 255] & 15
    first = np.where((which < 8) | (which == 12) | (which == 13), dx, dy)
    second = np.where((which < 4) | (which == 12) | (which == 13), dy, dz)
    slope: Floats = np.where(which & 1, -first, first) + np.where(which & 2, -second, second)
    return slope
