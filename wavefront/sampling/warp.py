"""Warps of the unit square: for each a map `name`, its density `name_pdf` and `name_inverse`.

Examples
--------
>>> u = np.random.default_rng(1).random((2, 1000), np.float32)
>>> directions = wf.warp.cosine_hemisphere(u)
>>> bool((directions[2] >= 0).all())
True
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arrays.elementary import exp, log, sin_cos, sin_cos_turns
from ..arrays.vec import BELOW_ONE, INV_FOUR_PI, INV_PI, INV_TWO_PI, TINY, Doubles, Floats, f4, positive

HALF_PI = f4(np.pi / 2)
QUARTER_PI = f4(np.pi / 4)
CELLS = 4096  # of a density that is tabulated


def cosine_hemisphere(u: Floats) -> Floats:
    """Return directions (3, n) around +z with density cosθ/π, for u (2, n).

    Source: P. Dutré, Global Illumination Compendium, eq. 35:
    x = cos(2πr₁)√(1−r₂), y = sin(2πr₁)√(1−r₂), z = √r₂.
    """
    sin, cos = sin_cos_turns(u[0])
    radius = np.sqrt(f4(1) - u[1])
    out = np.empty((3, u.shape[1]), f4)
    np.multiply(cos, radius, out=out[0])
    np.multiply(sin, radius, out=out[1])
    np.sqrt(u[1], out=out[2])
    return out


def cosine_hemisphere_pdf(w: Floats) -> Floats:
    """Return the density of `cosine_hemisphere` at unit directions w (3, n), 1/sr."""
    return positive(w[2]) * INV_PI


def cosine_hemisphere_inverse(w: Floats) -> Floats:
    """Return the u (2, n) that `cosine_hemisphere` maps to w (3, n)."""
    return _stack(_turn(w), w[2] * w[2])


def uniform_hemisphere(u: Floats) -> Floats:
    """Return directions (3, n) around +z with density 1/(2π), for u (2, n) (ibid., eq. 34)."""
    return _around_z(u[0], f4(1) - u[1], u[1])


def uniform_hemisphere_pdf(w: Floats) -> Floats:
    """Return the density of `uniform_hemisphere` at unit directions w (3, n), 1/sr."""
    return np.where(w[2] >= 0, INV_TWO_PI, f4(0))


def uniform_hemisphere_inverse(w: Floats) -> Floats:
    """Return the u (2, n) that `uniform_hemisphere` maps to w (3, n)."""
    return _stack(_turn(w), f4(1) - w[2])


def uniform_sphere(u: Floats) -> Floats:
    """Return directions (3, n) with density 1/(4π), for u (2, n) (ibid., eq. 33)."""
    return _around_z(u[0], f4(1) - f4(2) * u[1], f4(2) * u[1])


def uniform_sphere_pdf(w: Floats) -> Floats:
    """Return the density of `uniform_sphere` at unit directions w (3, n), 1/sr."""
    return np.full(w.shape[1], INV_FOUR_PI)


def uniform_sphere_inverse(w: Floats) -> Floats:
    """Return the u (2, n) that `uniform_sphere` maps to w (3, n)."""
    return _stack(_turn(w), (f4(1) - w[2]) * f4(0.5))


def uniform_cone(u: Floats, one_minus_cos: Floats) -> Floats:
    """Return directions (3, n) within a cone around +z, uniform in solid angle, for u (2, n).

    Parameters
    ----------
    one_minus_cos
        (n,) or scalar: 1 − cosθmax, which is accurate for narrow cones.
    """
    depth = u[1] * one_minus_cos
    return _around_z(u[0], f4(1) - depth, depth)


def uniform_cone_pdf(one_minus_cos: Floats) -> Floats:
    """Return the density of `uniform_cone`, 1/sr: 1/(2π(1 − cosθmax)); 0 for an empty cone."""
    size = np.asarray(one_minus_cos, f4)
    return np.where(size > 0, INV_TWO_PI / np.where(size > 0, size, f4(1)), f4(0))


def uniform_cone_inverse(w: Floats, one_minus_cos: Floats) -> Floats:
    """Return the u (2, n) that `uniform_cone` maps to w (3, n)."""
    sin2 = w[0] * w[0] + w[1] * w[1]
    # 1 − cosθ = sin²θ/(1 + cosθ) is accurate near the axis, unlike 1 − w[2].
    depth = np.where(w[2] > 0, sin2 / (f4(1) + np.maximum(w[2], f4(0))), f4(1) - w[2])
    return _stack(_turn(w), depth / one_minus_cos)


def uniform_disk(u: Floats) -> Floats:
    """Return points (2, n) of the unit disk with density 1/π, for u (2, n), by concentric squares.

    Source: P. Shirley and K. Chiu, A Low Distortion Map Between Disk and Square, 1997.
    """
    a, b = f4(2) * u - f4(1)
    size_a, size_b = np.abs(a), np.abs(b)
    radius = np.maximum(size_a, size_b)
    # The angle in the first octant is mirrored at the diagonal by arithmetic, because np.where with random
    # masks is several times slower.
    octant = np.minimum(size_a, size_b) * QUARTER_PI / np.maximum(radius, TINY)
    steep = (size_b >= size_a).astype(f4)
    phi = steep * HALF_PI + (f4(1) - f4(2) * steep) * octant
    out = np.empty_like(u)
    sin, cos = sin_cos(phi)
    np.copysign(radius * cos, a, out=out[0])
    np.copysign(radius * sin, b, out=out[1])
    return out


def uniform_disk_pdf(p: Floats) -> Floats:
    """Return the density of `uniform_disk` at points p (2, n), per unit area."""
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
    """Return barycentric weights b1, b2 (2, n) of the second and third vertex, uniform, for u (2, n).

    The low-distortion map does not collapse an edge of the square to a point, so stratified points stay
    further apart than with the square-root map; it is also faster.

    Source: E. Heitz, A Low-Distortion Map Between Triangle and Square, 2019.
    """
    half = f4(0.5) * np.minimum(u[0], u[1])
    return u - half  # one formula for both halves of the square, without a branch


def uniform_triangle_pdf(b: Floats) -> Floats:
    """Return the density of `uniform_triangle` at b (2, n), per unit of barycentric area: 2 inside."""
    inside = (b[0] >= 0) & (b[1] >= 0) & (b[0] + b[1] <= 1)
    return np.where(inside, f4(2), f4(0))


def uniform_triangle_inverse(b: Floats) -> Floats:
    """Return the u (2, n) that `uniform_triangle` maps to b (2, n)."""
    total = b[0] + b[1]
    above = b[1] > b[0]
    return _stack(np.where(above, f4(2) * b[0], total), np.where(above, total, f4(2) * b[1]))


def linear(u: Floats, slope: Floats) -> Floats:
    """Return points (2, n) of the unit square with the density ∏(1 + sᵢ(2xᵢ − 1)), for u (2, n).

    Parameters
    ----------
    slope
        (2, n), between -1 and 1.
    """
    return linear_with_density(u, slope)[0]


def linear_with_density(u: Floats, slope: Floats) -> tuple[Floats, Floats]:
    """Return `linear` and its density (n,) at once: the density is the root in the inversion."""
    start = f4(1) - slope
    root = slope * u
    root *= f4(4)
    root += start * start
    np.sqrt(root, out=root)
    x = u + u
    x /= root + start
    return np.minimum(x, f4(1), out=x), root[0] * root[1]


def linear_pdf(p: Floats, slope: Floats) -> Floats:
    """Return the density (n,) of `linear` at points p (2, n) of the square."""
    factors = p + p
    factors -= f4(1)
    factors *= slope
    factors += f4(1)
    return factors[0] * factors[1]


def linear_inverse(p: Floats, slope: Floats) -> Floats:
    """Return the u (2, n) that `linear` maps to points p (2, n)."""
    return p * ((f4(1) - slope) + slope * p)


def _stack(a: Floats, b: Floats) -> Floats:
    """Return two rows (n,) as one contiguous array (2, n)."""
    out = np.empty((2, len(a)), f4)
    out[0] = a
    out[1] = b
    return out


def _turn(w: Floats) -> Floats:
    """Return the azimuth of w (3, n) divided by 2π, (n,) in [0, 1)."""
    turn = np.arctan2(w[1], w[0]) * INV_TWO_PI
    turn += turn < 0
    return np.where(turn < 1, turn, f4(0))


def _around_z(turn: Floats, z: Floats, depth: Floats) -> Floats:
    """Return unit vectors (3, n) of azimuth 2π·turn (n,) and z = 1 − depth (n,)."""
    sin, cos = sin_cos_turns(turn)
    radius = np.sqrt(np.maximum(depth * (f4(1) + z), f4(0)))  # 1 − z² without cancellation
    out = np.empty((3, len(turn)), f4)
    np.multiply(cos, radius, out=out[0])
    np.multiply(sin, radius, out=out[1])
    out[2] = z
    return out


def tent(u: Floats, radius: float = 1.0) -> Floats:
    """Return offsets (n,) in (−radius, radius) with a density that falls linearly to 0, for u (n,)."""
    left = u < f4(0.5)
    side = np.where(left, u, f4(1) - u)  # 1 − u is exact for u in [0.5, 1)
    reach = f4(1) - np.sqrt(f4(2) * side)
    return np.where(left, -reach, reach) * f4(radius)


def tent_pdf(x: Floats, radius: float = 1.0) -> Floats:
    """Return the density of `tent` at x (n,), per unit length: ``(1 − |x|/radius)/radius``."""
    return np.maximum(f4(1) - np.abs(x) / f4(radius), f4(0)) / f4(radius)


def tent_inverse(x: Floats, radius: float = 1.0) -> Floats:
    """Return the u (n,) that `tent` maps to x (n,)."""
    rest = f4(1) - np.abs(x) / f4(radius)
    side = f4(0.5) * rest * rest
    return np.where(x < 0, side, f4(1) - side)


def gaussian(u: Floats, sigma: float = 0.5, radius: float = 1.5) -> Floats:
    """Return offsets (n,) of a normal distribution truncated at ±radius, for u (n,)."""
    inside = math.erf(radius / (sigma * math.sqrt(2)))
    span = f4(min(inside, float(BELOW_ONE)))  # the inverse of ±1 is infinite
    x = _erfinv((f4(2) * u - f4(1)) * span) * f4(sigma * math.sqrt(2))
    return np.clip(x, f4(-radius), f4(radius))


def gaussian_pdf(x: Floats, sigma: float = 0.5, radius: float = 1.5) -> Floats:
    """Return the density of `gaussian` at x (n,), per unit length; 0 beyond the radius."""
    inside = math.erf(radius / (sigma * math.sqrt(2)))
    scale = f4(1 / (inside * sigma * math.sqrt(2 * math.pi)))
    t = x * f4(1 / sigma)
    return np.where(np.abs(x) <= f4(radius), np.exp(f4(-0.5) * t * t) * scale, f4(0))


def gaussian_inverse(x: Floats, sigma: float = 0.5, radius: float = 1.5) -> Floats:
    """Return the u (n,) that `gaussian` maps to x (n,)."""
    inside = math.erf(radius / (sigma * math.sqrt(2)))
    return f4(0.5) + f4(0.5 / inside) * _erf(x * f4(1 / (sigma * math.sqrt(2))))


def windowed_gaussian(u: Floats, sigma: float = 0.5, radius: float = 2.0) -> Floats:
    """Return offsets (n,) of a normal distribution less its density at ±radius, where it ends, for u (n,).

    The density is constant in each of `CELLS` cells.
    """
    edges, below = _window(sigma, radius)
    return np.interp(u, below, edges).astype(f4)


def windowed_gaussian_pdf(x: Floats, sigma: float = 0.5, radius: float = 2.0) -> Floats:
    """Return the density of `windowed_gaussian` at x (n,), per unit length; 0 beyond the radius."""
    edges, below = _window(sigma, radius)
    cell = np.clip(np.searchsorted(edges, x, "right") - 1, 0, CELLS - 1)
    density = np.diff(below) * (CELLS / (2 * radius))
    return np.where(np.abs(x) <= f4(radius), density.take(cell), 0).astype(f4)


def windowed_gaussian_inverse(x: Floats, sigma: float = 0.5, radius: float = 2.0) -> Floats:
    """Return the u (n,) that `windowed_gaussian` maps to x (n,)."""
    edges, below = _window(sigma, radius)
    return np.interp(x, edges, below).astype(f4)


def _window(sigma: float, radius: float) -> tuple[Doubles, Doubles]:
    """Return the edges of cells from -radius to radius, and the integral of `windowed_gaussian` to them."""
    edges = np.linspace(-radius, radius, CELLS + 1)
    at = np.append((edges[1:] + edges[:-1]) / 2, radius) / sigma
    height = exp((-0.5 * at * at).astype(f4)).astype(np.float64)
    below = np.append(0, np.cumsum(np.maximum(height[:-1] - height[-1], 0)))
    return edges, below / below[-1]


def _erfinv(y: Floats) -> Floats:
    """Return the inverse error function of y (n,) in (−1, 1), with a relative error of about 3e-7.

    Source: M. Giles, Approximating the erfinv Function, GPU Computing Gems 2, 2011, table 2.
    """
    w = -log((f4(1) - y) * (f4(1) + y))
    near = _polynomial(w - f4(2.5), _ERFINV_NEAR)
    if w.max(initial=0) < 5:
        return near * y
    far = _polynomial(np.sqrt(np.maximum(w, f4(5))) - f4(3), _ERFINV_FAR)
    return np.where(w < 5, near, far) * y


def _erf(x: Floats) -> Floats:
    """Return the error function of x (n,), with an absolute error of 2e-7.

    Source: W. Press et al., Numerical Recipes, 2nd edition, section 6.2, function erfcc.
    """
    z = np.abs(x.astype(np.float64))
    t = 1 / (1 + 0.5 * z)
    tail = t * np.exp(-z * z + _polynomial(t, _ERFC))
    return (np.copysign(1 - tail, x)).astype(f4)


def _polynomial(x: NDArray[Any], coefficients: tuple[float, ...]) -> NDArray[Any]:
    """Return a polynomial of x (n,), coefficients of the highest power first, in the precision of x."""
    total = np.full_like(x, coefficients[0])
    for coefficient in coefficients[1:]:
        total *= x
        total += x.dtype.type(coefficient)
    return total


# fmt: off
_ERFINV_NEAR = (
    2.81022636e-08, 3.43273939e-07, -3.5233877e-06, -4.39150654e-06, 0.00021858087,
    -0.00125372503, -0.00417768164, 0.246640727, 1.50140941,
)
_ERFINV_FAR = (
    -0.000200214257, 0.000100950558, 0.00134934322, -0.00367342844, 0.00573950773,
    -0.0076224613, 0.00943887047, 1.00167406, 2.83297682,
)
_ERFC = (
    0.17087277, -0.82215223, 1.48851587, -1.13520398, 0.27886807,
    -0.18628806, 0.09678418, 0.37409196, 1.00002368, -1.26551223,
)
