"""Equal-area maps between the unit square and the domains of warps."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..arrays.vec import Doubles, Floats, f4


@dataclass(frozen=True, slots=True)
class Chart:
    """An equal-area map between the unit square and a domain."""

    to_square: Callable[[Floats], Doubles]  # points (d, n) -> (2, n)
    to_points: Callable[[Doubles], Floats]  # (2, n) -> points (d, n)
    area: float  # of the domain
    seams: tuple[float, ...] = (0.0, 1.0)  # rows never cross these first coordinates


def _turn(x: Doubles, y: Doubles) -> Doubles:
    """Return the angle of (x, y) divided by 2π, in [0, 1)."""
    turn = np.arctan2(y, x) / (2 * np.pi)
    turn[turn < 0] += 1
    return np.minimum(turn, np.nextafter(1.0, 0.0))


def _sphere_to_square(w: Floats) -> Doubles:
    x, y, z = w.astype(np.float64)
    r2 = x * x + y * y
    # Near the poles 1 − cosθ is more accurate from x and y than from z.
    cos = np.where(r2 < 0.5, np.copysign(np.sqrt(np.maximum(1 - r2, 0)), z), z)
    return np.stack([np.clip((cos + 1) / 2, 0, 1), _turn(x, y)])


def _square_to_sphere(p: Doubles) -> Floats:
    cos = 2 * p[0] - 1
    sin = 2 * np.sqrt(p[0] * (1 - p[0]))
    phi = 2 * np.pi * p[1]
    return np.stack([sin * np.cos(phi), sin * np.sin(phi), cos]).astype(f4)


def _disk_to_square(p: Floats) -> Doubles:
    x, y = p.astype(np.float64)
    return np.stack([np.clip(x * x + y * y, 0, 1), _turn(x, y)])


def _square_to_disk(p: Doubles) -> Floats:
    radius, phi = np.sqrt(p[0]), 2 * np.pi * p[1]
    return np.stack([radius * np.cos(phi), radius * np.sin(phi)]).astype(f4)


def _triangle_to_square(b: Floats) -> Doubles:
    total = b[0].astype(np.float64) + b[1]
    return np.stack([np.clip(total**2, 0, 1), b[0] / np.maximum(total, 1e-30)])


def _square_to_triangle(p: Doubles) -> Floats:
    total = np.sqrt(p[0])
    return np.stack([total * p[1], total * (1 - p[1])]).astype(f4)


CHARTS = {
    "sphere": Chart(_sphere_to_square, _square_to_sphere, 4 * np.pi, (0.0, 0.5, 1.0)),
    "disk": Chart(_disk_to_square, _square_to_disk, np.pi),
    "triangle": Chart(_triangle_to_square, _square_to_triangle, 0.5),
    "square": Chart(lambda p: p.astype(np.float64), lambda p: p.astype(f4), 1.0),
}


def uniform_directions(rng: np.random.Generator, n: int) -> Floats:
    """Return n unit vectors (3, n), uniform over the sphere."""
    return _square_to_sphere(rng.random((2, n)))
