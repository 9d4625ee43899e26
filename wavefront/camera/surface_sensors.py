"""Surfaces that measure light: sensors every sample of which is at a point of its own."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from ..arrays.frame import Frame
from ..arrays.state import Words
from ..arrays.vec import Doubles, Floats, Ints, column, f4
from ..sampling.warp import cosine_hemisphere, uniform_sphere, uniform_triangle
from .sensors import Sensors


class SurfaceSensors(Sensors):
    """Surfaces that measure light, a pixel each: every sample is at a point of its own.

    Parameters
    ----------
    triangles
        (t, 3, 3) corners, those of one surface after the other.
    counts
        (n,) triangles of each surface; 0 for a sphere.
    spheres
        (n, 4) center and radius of spheres; others have 0.
    kind
        "irradiance", W·m⁻², or "arriving" or "leaving", W.
    side
        1 for the front, -1 for the back.
    """

    def __init__(
        self,
        triangles: Doubles,
        counts: Ints,
        spheres: Doubles,
        kind: str,
        side: float = 1.0,
    ) -> None:
        cross = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
        double = np.linalg.norm(cross, axis=1)
        owner = np.repeat(np.arange(counts.size), counts)
        total = np.bincount(owner, double, counts.size)
        self.areas = np.where(counts > 0, total / 2, 4 * np.pi * spheres[:, 3] ** 2)
        total = np.where(total > 0, total, 1)
        middles = [
            np.bincount(owner, triangles.mean(1)[:, k] * double, counts.size) / total for k in range(3)
        ]
        at = np.where(counts[:, None] > 0, np.stack(middles, 1), spheres[:, :3])
        super().__init__(at, (0, 0, side), "radiance" if kind == "leaving" else "irradiance")
        self.lies_on_surfaces, self.may_share = True, False
        self.triangles, self.spheres, self.side, self._kind = triangles, spheres, side, kind
        self.normals = (
            np.where(double[:, None] > 0, cross, (0, 0, 1)) / np.where(double > 0, double, 1)[:, None]
        )
        run, last = np.cumsum(double / total[owner]), np.cumsum(counts)
        before = np.concatenate([[0], run])[last - counts]
        self.ends = run - before[owner] + owner  # a surface's number, and the part of its area up to here
        self.ends[last[counts > 0] - 1] = np.flatnonzero(counts) + 1.0

    @property
    def uses_lens(self) -> bool:
        """Whether rays need a direction beside a point."""
        return self.sensor == "radiance"

    @property
    def extent(self) -> Doubles:
        """(k, 3) points whose box contains the surfaces, scene units."""
        return self.triangles.reshape(-1, 3)

    def layers(self) -> dict[str, NDArray[Any]]:
        """Return the middles, and as "scale" the factors from the values of pixels to power, m²·sr or m²."""
        layers = super().layers()
        if self._kind == "irradiance":
            return layers
        scale = np.full(layers["position"].shape[0] * layers["position"].shape[1], np.nan)
        scale[: self.areas.size] = self.areas * (np.pi if self.sensor == "radiance" else 1)
        return {**layers, "scale": scale.reshape(layers["position"].shape[:2])}

    def metadata(self) -> Mapping[str, Any]:
        """Return the entries of the picture's metadata about the sensors."""
        metadata = super().metadata()
        return metadata if self._kind == "irradiance" else {**metadata, "sensor": f"{self._kind} flux"}

    def scaled(self, factor: float) -> Self:
        """Return the same sensors in a scene whose lengths were multiplied by `factor`; areas stay."""
        sensors = super().scaled(factor)
        sensors.triangles, sensors.spheres = self.triangles * factor, self.spheres * factor
        return sensors

    def pixel_rays(
        self, pixel: Words, at: Floats, center: Doubles, lens: Floats | None = None
    ) -> tuple[Floats, Floats]:
        """Return points evenly over the surfaces, and directions to them."""
        index, u = np.minimum(pixel, len(self.points) - 1), np.broadcast_to(at, (2, len(pixel)))
        balls = self.spheres.take(index, 0).T
        normal = uniform_sphere(u)
        point = balls[:3] + balls[3] * normal
        flat = np.flatnonzero(balls[3] == 0)
        if flat.size:
            point[:, flat], normal[:, flat] = self._on_triangles(index.take(flat), u.take(flat, 1))
        normal *= f4(self.side)
        point = point - column(center).astype(np.float64) + self.lift * normal
        if lens is None:
            return point.astype(f4), -normal
        return point.astype(f4), -Frame.from_normal(normal).to_world(cosine_hemisphere(lens))

    def _on_triangles(self, index: Words, u: Floats) -> tuple[Doubles, Doubles]:
        """Return points and normals (3, n) on surfaces of triangles, for u (2, n)."""
        key = index + u[0].astype(np.float64)
        number = np.searchsorted(self.ends, key, side="right")
        start = np.maximum(np.concatenate([[0.0], self.ends])[number], index)
        within = (key - start) / (self.ends[number] - start)
        b = uniform_triangle(np.stack([np.clip(within, 0, 1 - 2.0**-24), u[1]]).astype(f4))
        a, e1, e2 = self.triangles.take(number, 0).transpose(1, 2, 0)
        return a + (e1 - a) * b[0] + (e2 - a) * b[1], self.normals.take(number, 0).T
