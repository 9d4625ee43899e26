"""Maps from the unit square to shapes, in threes: sample, pdf, inverse."""

from __future__ import annotations

import numpy as np

from ..vec import Floats, f4

TWO_PI = f4(2 * np.pi)
INV_PI = f4(1 / np.pi)
INV_TWO_PI = f4(0.5 / np.pi)
INV_FOUR_PI = f4(0.25 / np.pi)
HALF_PI = f4(np.pi / 2)
QUARTER_PI = f4(np.pi / 4)


def cosine_hemisphere(u: Floats) -> Floats:
    """Directions (3, n) around +z with density cosθ/π, from u (2, n).

    Source: P. Dutré, Global Illumination Compendium, eq. 35:
    x = cos(2πr₁)√(1−r₂), y = sin(2πr₁)√(1−r₂), z = √r₂.
    """
    phi = TWO_PI * u[0]
    radius = np.sqrt(f4(1) - u[1])
    out = np.empty((3, u.shape[1]), f4)
    np.multiply(np.cos(phi), radius, out=out[0])
    np.multiply(np.sin(phi), radius, out=out[1])
    np.sqrt(u[1], out=out[2])
    return out


def cosine_hemisphere_pdf(w: Floats) -> Floats:
    """Density of `cosine_hemisphere` at unit directions w (3, n), 1/sr."""
    return np.maximum(w[2], f4(0)) * INV_PI


def cosine_hemisphere_inverse(w: Floats) -> Floats:
    """Return the u (2, n) that `cosine_hemisphere` maps to w (3, n)."""
    return _stack(_turn(w), w[2] * w[2])


def uniform_hemisphere(u: Floats) -> Floats:
    """Directions (3, n) around +z with density 1/(2π), from u (2, n) (ibid., eq. 34)."""
    return _around_z(u[0], f4(1) - u[1], u[1])


def uniform_hemisphere_pdf(w: Floats) -> Floats:
    """Density of `uniform_hemisphere` at unit directions w (3, n), 1/sr."""
    return np.where(w[2] >= 0, INV_TWO_PI, f4(0))


def uniform_hemisphere_inverse(w: Floats) -> Floats:
    """Return the u (2, n) that `uniform_hemisphere` maps to w (3, n)."""
    return _stack(_turn(w), f4(1) - w[2])


def uniform_sphere(u: Floats) -> Floats:
    """Directions (3, n) with density 1/(4π), from u (2, n) (ibid., eq. 33)."""
    return _around_z(u[0], f4(1) - f4(2) * u[1], f4(2) * u[1])


def uniform_sphere_pdf(w: Floats) -> Floats:
    """Density of `uniform_sphere` at unit directions w (3, n), 1/sr."""
    return np.full(w.shape[1], INV_FOUR_PI)


def uniform_sphere_inverse(w: Floats) -> Floats:
    """Return the u (2, n) that `uniform_sphere` maps to w (3, n)."""
    return _stack(_turn(w), (f4(1) - w[2]) * f4(0.5))


def uniform_cone(u: Floats, one_minus_cos: Floats) -> Floats:
    """Directions (3, n) within a cone around +z, uniform in solid angle, from u (2, n).

    Parameters
    ----------
    one_minus_cos
        (n,) or scalar: 1 − cosθmax, which keeps its digits where the cone is tiny.
    """
    depth = u[1] * one_minus_cos
    return _around_z(u[0], f4(1) - depth, depth)


def uniform_cone_pdf(one_minus_cos: Floats) -> Floats:
    """Density of `uniform_cone` within the cone, 1/sr: 1/(2π(1 − cosθmax)); 0 for an empty cone."""
    size = np.asarray(one_minus_cos, f4)
    return np.where(size > 0, INV_TWO_PI / np.where(size > 0, size, f4(1)), f4(0))


def uniform_cone_inverse(w: Floats, one_minus_cos: Floats) -> Floats:
    """Return the u (2, n) that `uniform_cone` maps to w (3, n)."""
    sin2 = w[0] * w[0] + w[1] * w[1]
    # 1 − cosθ = sin²θ/(1 + cosθ) keeps its digits near the axis, where 1 − w[2] loses them.
    depth = np.where(w[2] > 0, sin2 / (f4(1) + np.maximum(w[2], f4(0))), f4(1) - w[2])
    return _stack(_turn(w), depth / one_minus_cos)


def uniform_disk(u: Floats) -> Floats:
    """Points (2, n) of the unit disk with density 1/π, from u (2, n), by concentric squares.

    Source: P. Shirley and K. Chiu, A Low Distortion Map Between Disk and Square, 1997.
    """
    a = f4(2) * u[0] - f4(1)
    b = f4(2) * u[1] - f4(1)
    wide = np.abs(a) > np.abs(b)
    radius = np.where(wide, a, b)
    ratio = np.where(wide, b, a) / np.where(radius == 0, f4(1), radius)
    phi = np.where(wide, ratio * QUARTER_PI, HALF_PI - ratio * QUARTER_PI)
    return _stack(radius * np.cos(phi), radius * np.sin(phi))


def uniform_disk_pdf(p: Floats) -> Floats:
    """Density of `uniform_disk` at points p (2, n), per unit area."""
    return np.where(p[0] * p[0] + p[1] * p[1] <= 1, INV_PI, f4(0))


def uniform_disk_inverse(p: Floats) -> Floats:
    """Return the u (2, n) that `uniform_disk` maps to p (2, n)."""
    wide = np.abs(p[0]) > np.abs(p[1])
    major = np.where(wide, p[0], p[1])
    minor = np.where(wide, p[1], p[0])
    radius = np.copysign(np.sqrt(p[0] * p[0] + p[1] * p[1]), major)
    other = np.arctan(minor / np.where(major == 0, f4(1), major)) * (radius / QUARTER_PI)
    a = np.where(wide, radius, other)
    b = np.where(wide, other, radius)
    return _stack((a + f4(1)) * f4(0.5), (b + f4(1)) * f4(0.5))


def uniform_triangle(u: Floats) -> Floats:
    """Barycentric weights b1, b2 (2, n) of the second and third vertex, uniform, from u (2, n).

    The low-distortion map: it bends the square onto the triangle without collapsing an edge to a
    point, so stratified points stay further apart than by the square-root map, and it is cheaper.

    Source: E. Heitz, A Low-Distortion Map Between Triangle and Square, 2019.
    """
    above = u[1] > u[0]
    smaller = np.where(above, u[0], u[1]) * f4(0.5)
    larger = np.where(above, u[1], u[0]) - smaller
    return _stack(np.where(above, smaller, larger), np.where(above, larger, smaller))


def uniform_triangle_pdf(b: Floats) -> Floats:
    """Density of `uniform_triangle` at b (2, n), per unit of barycentric area: 2 within."""
    inside = (b[0] >= 0) & (b[1] >= 0) & (b[0] + b[1] <= 1)
    return np.where(inside, f4(2), f4(0))


def uniform_triangle_inverse(b: Floats) -> Floats:
    """Return the u (2, n) that `uniform_triangle` maps to b (2, n)."""
    total = b[0] + b[1]
    above = b[1] > b[0]
    return _stack(np.where(above, f4(2) * b[0], total), np.where(above, total, f4(2) * b[1]))


def _stack(a: Floats, b: Floats) -> Floats:
    """Two rows (n,) as one contiguous (2, n) array."""
    out = np.empty((2, len(a)), f4)
    out[0] = a
    out[1] = b
    return out


def _turn(w: Floats) -> Floats:
    """Azimuth of w (3, n) as a fraction of a turn, (n,) in [0, 1)."""
    turn = np.arctan2(w[1], w[0]) * INV_TWO_PI
    turn += turn < 0
    return np.where(turn < 1, turn, f4(0))


def _around_z(turn: Floats, z: Floats, depth: Floats) -> Floats:
    """Unit vectors (3, n) at azimuth 2π·turn and height z = 1 − depth, all (n,)."""
    phi = TWO_PI * turn
    radius = np.sqrt(np.maximum(depth * (f4(1) + z), f4(0)))  # 1 − z² without cancellation
    out = np.empty((3, len(phi)), f4)
    np.multiply(np.cos(phi), radius, out=out[0])
    np.multiply(np.sin(phi), radius, out=out[1])
    out[2] = z
    return out
