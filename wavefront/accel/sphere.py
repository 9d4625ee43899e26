"""Ray-sphere tests: a float32 filter by matrix products, and the exact roots in float64."""

from __future__ import annotations

import numpy as np

from ..vec import Bools, Doubles, Floats, Ints, f4
from .triangle import ROUNDOFF


def sphere_rows(centers: Doubles, radii: Doubles, center: Floats, radius: float) -> Floats:
    """Return the filter's rows for k spheres, (k, 11) float32.

    A line with unit direction d and moment m about `center` passes a sphere at c (relative to
    `center`) at a squared distance of |m - c × d|², so

        r² - |m|² + 2 c·(d × m) - |c|² + (c·d)²

    is not negative on a hit. It is linear in the eleven numbers of `line_features`. Rows are scaled so
    that the product of a hit is at least -1. `radius` is that of a ball about `center` around all spheres.
    """
    c = centers - np.asarray(center, np.float64)[:, None]
    x, y, z = c
    size2 = x * x + y * y + z * z
    one = np.ones_like(radii)
    rows = np.stack(
        [radii**2 - size2, -one, 2 * x, 2 * y, 2 * z, x * x, y * y, z * z, 2 * x * y, 2 * x * z, 2 * y * z], 1
    )
    error = 150 * ROUNDOFF * radius * radius
    return (rows / error).astype(f4)


def line_features(direction: Floats, moment: Floats) -> Floats:
    """Return the numbers (11, n) of lines that `sphere_rows` multiplies."""
    dx, dy, dz = direction
    mx, my, mz = moment
    out = np.empty((11, dx.size), f4)
    out[0] = 1 + 0 * dx  # NaN for invalid lines
    out[1] = mx * mx + my * my + mz * mz
    out[2] = dy * mz - dz * my
    out[3] = dz * mx - dx * mz
    out[4] = dx * my - dy * mx
    out[5], out[6], out[7] = dx * dx, dy * dy, dz * dz
    out[8], out[9], out[10] = dx * dy, dx * dz, dy * dz
    return out


def sphere_distance(
    center: Doubles, radius: Doubles, origin: Doubles, direction: Doubles, leaves: Bools
) -> Doubles:
    """Return the least t > 0 (k,) at which rays (3, k) hit spheres, inf on a miss.

    Haines et al., "Precision improvements for ray/sphere intersection", Ray Tracing Gems, chapter 7:
    the discriminant from the distance between line and center, and the smaller root from the product of
    the two. A ray that starts on its sphere (`leaves`) has one root at exactly 0; the other one is returned.
    """
    fx, fy, fz = origin - center
    dx, dy, dz = direction
    a = dx * dx + dy * dy + dz * dz
    b = -(fx * dx + fy * dy + fz * dz)
    nearest = b / a
    rx, ry, rz = fx + nearest * dx, fy + nearest * dy, fz + nearest * dz
    discriminant = radius * radius - (rx * rx + ry * ry + rz * rz)
    c = fx * fx + fy * fy + fz * fz - radius * radius
    q = b + np.copysign(np.sqrt(a * discriminant), b)  # NaN on a miss
    near, far = c / q, q / a
    first, second = np.minimum(near, far), np.maximum(near, far)
    t = np.where(first > 0, first, second)
    t = np.where(leaves, 2 * nearest, t)
    return np.where(t > 0, t, np.inf)


def spheres_of(centers: Doubles, radii: Doubles, prim: Ints) -> tuple[Doubles, Doubles]:
    """Gather centers (3, k) and radii (k,) of spheres `prim` (k,)."""
    return centers.take(prim, 1), radii.take(prim)
