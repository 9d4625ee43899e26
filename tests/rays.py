"""Rays, geometry for accelerators, and an intersection test to compare with."""

from __future__ import annotations

import numpy as np
import trimesh
from inside import Accelerator, Geometry, SpherePrimitives

f4 = np.float32

PLACES = [
    (1, 0),
    (1e6, 0),
    (1e-6, 0),
    (1, 1e5),
    (1e-6, 0.1),
    (1e6, 1e11),
]  # scale of a mesh, and its distance from the origin


def geometry(triangles: object = (), centers: object = (), radii: object = ()) -> Geometry:
    spheres = SpherePrimitives(
        np.ascontiguousarray(np.asarray(centers, f4).reshape(-1, 3).T), np.asarray(radii, f4).reshape(-1)
    )
    return Geometry(np.asarray(triangles, f4).reshape(-1, 3, 3), (spheres,))


def sphere_mesh(subdivisions: int) -> np.ndarray:
    return np.asarray(trimesh.creation.icosphere(subdivisions=subdivisions).triangles)


def random_rays(n: int, seed: int, reach: float = 1.5) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    origin = rng.uniform(-reach, reach, (3, n))
    direction = rng.uniform(-1, 1, (3, n)) - origin
    return origin.astype(f4), (direction / np.linalg.norm(direction, axis=0)).astype(f4)


def nothing(n: int) -> np.ndarray:
    return np.full(n, -1)


def brute_force(triangles: np.ndarray, origin: np.ndarray, direction: np.ndarray) -> tuple:
    """Möller-Trumbore in float64: t (m, n), and the least barycentric weight (m, n)."""
    a, b, c = (triangles[:, i, :, None].astype(float) for i in range(3))
    o, d = origin[None].astype(float), direction[None].astype(float)
    e1, e2 = b - a, c - a
    p = np.cross(d, e2, axis=1)
    s = o - a
    q = np.cross(s, e1, axis=1)
    with np.errstate(all="ignore"):
        scale = 1 / (e1 * p).sum(1)
        u, v, t = (s * p).sum(1) * scale, (d * q).sum(1) * scale, (e2 * q).sum(1) * scale
    return t, np.minimum(np.minimum(u, v), 1 - u - v)


def same_bits(a: object, b: object) -> bool:
    return all(getattr(a, k).tobytes() == getattr(b, k).tobytes() for k in ("t", "prim", "b1", "b2"))


def aimed_rays(triangles: np.ndarray, n: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Rays from inside a mesh around its center: a third each at vertices, edges and anywhere."""
    rng = np.random.default_rng(seed)
    low, high = triangles.min((0, 1)), triangles.max((0, 1))
    center, size = (low + high) / 2.0, (high - low).max()
    origin = (center + rng.uniform(-0.2, 0.2, (n, 3)) * size).astype(f4)
    face, corner = rng.integers(0, len(triangles), n), rng.integers(0, 3, n)
    along = np.select([np.arange(n) % 3 == 0, np.arange(n) % 3 == 1], [0.0, 0.5], rng.random(n))[:, None]
    target = triangles[face, corner] * (1 - along) + triangles[face, (corner + 1) % 3] * along
    return np.ascontiguousarray(origin.T), np.ascontiguousarray((target - origin).T, f4)


def check_batches(accelerator: Accelerator, size: int) -> None:
    """The same bits, `size` rays at a time."""
    n = min(9000, 100 * size)
    origin, direction = random_rays(n, 6)
    origin[:, ::5] = 0  # through vertices too
    exclude_prim = np.random.default_rng(7).integers(-1, 37, n)
    distance = np.full(n, 0.7, f4)
    whole = accelerator.closest(origin, direction, exclude_prim)
    blocked = accelerator.occluded(origin, direction, distance, exclude_prim)
    cuts = [slice(at, at + size) for at in range(0, n, size)]
    parts = [accelerator.closest(origin[:, p], direction[:, p], exclude_prim[p]) for p in cuts]
    for name in ("t", "prim", "b1", "b2"):
        found = np.concatenate([getattr(part, name) for part in parts])
        np.testing.assert_array_equal(found, getattr(whole, name))
    found = [accelerator.occluded(origin[:, p], direction[:, p], distance[p], exclude_prim[p]) for p in cuts]
    np.testing.assert_array_equal(np.concatenate(found), blocked)
