"""Spheres whose emission varies over them, by a texture."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..arrays.elementary import sin_cos_turns
from ..arrays.soa import soa
from ..arrays.state import SurfaceInteraction
from ..arrays.vec import Bools, Floats, Ints, f4, spans
from ..shapes.attributes import sphere_uv
from ..textures.base import BaseTexture
from .base import LightSample
from .sphere import SphereLights
from .textured_emission import MOST_SAMPLES, emission_at, radiance_by_source

LEAST_DIRECTIONS, MOST_DIRECTIONS = 64, 4096  # in which a texture is looked up for its mean
GOLDEN = (5**0.5 - 1) / 2  # of a turn, between two directions


@soa
class TexturedSphereLights(SphereLights):
    """k spheres, some of which emit by a texture; it is looked up at the sampled point."""

    prim: Ints  # (k,) primitive of the scene, -1 for uniform emission
    source: Ints  # (k,) number of its emission, -1 for uniform emission
    emissions: tuple[Floats | BaseTexture, ...]  # colors, W·sr⁻¹·m⁻²

    @property
    def varies(self) -> Bools:  # type: ignore[override]
        """A mask (k,) of the spheres whose emission is not uniform."""
        return self.source >= 0

    def sample_li(self, point: Floats, u: Floats) -> LightSample:
        """Draw a direction in the cone of the sphere, and say which sphere it meets."""
        sample = SphereLights.sample_li(self, point, u)
        sample.prim = np.broadcast_to(self.prim, point.shape[1:])
        sample.b1 = sample.b2 = np.zeros(point.shape[1], f4)
        return sample

    def le(self, wi: Floats, surface: SurfaceInteraction | None = None) -> Floats:
        """Return the radiance of points on the spheres, (3, n)."""
        if surface is None:
            return SphereLights.le(self, wi)
        return radiance_by_source(self.emissions, self.source, wi, surface, two_sided=True)


def mean_sphere_radiance(shape: Any) -> Floats:
    """Estimate the mean radiance of each sphere of a shape with a textured emission, (3, k).

    The emission is looked up in evenly spread directions: a Fibonacci lattice.
    """
    emission, count = shape.emission, shape.count
    n = int(np.clip(MOST_SAMPLES // count, LEAST_DIRECTIONS, MOST_DIRECTIONS))
    y = 1 - (2 * np.arange(n) + 1) / n
    sin, cos = sin_cos_turns(np.arange(n) * GOLDEN)
    ring = np.sqrt(1 - y * y)
    normal = np.stack([sin * ring, y, cos * ring]).astype(f4)
    if "color" not in emission.reads:  # all spheres look alike
        count = 1
    colors = np.ones((4, count), f4) if shape.colors is None else shape.colors[:count].T.astype(f4)
    mean = np.empty((3, count), f4)
    for span in spans(count, max(1, MOST_SAMPLES // n)):
        k = colors[:, span].shape[1]
        value = emission_at(emission, _seen(np.tile(normal, k), np.repeat(colors[:, span], n, 1)))
        mean[:, span] = np.broadcast_to(value, (3, k * n)).reshape(3, k, n).mean(2, dtype=np.float64)
    return np.broadcast_to(mean, (3, shape.count))


def _seen(normal: Floats, color: Floats) -> SurfaceInteraction:
    """Return points on spheres, with outward normals (3, n) and colors (4, n), seen head on."""
    n = normal.shape[1]
    surface = SurfaceInteraction(
        point=normal,
        error=np.zeros(n, f4),
        ng=normal,
        ns=normal,
        wo=normal,
        prim=np.zeros(n, np.intp),
        material=np.zeros(n, np.intp),
        back_facing=np.zeros(n, np.bool_),
    )
    surface.uv = surface.uv1 = sphere_uv(normal)
    surface.color = color
    return surface
