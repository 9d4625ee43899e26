"""Emission that varies over a mesh: by a texture, or because alpha is below 1."""

from __future__ import annotations

from typing import Self

import numpy as np

from ..arrays.soa import soa
from ..arrays.state import SurfaceInteraction
from ..arrays.vec import Bools, Doubles, Floats, Ints, cross, f4, interpolate, normalize
from ..materials.alpha import Opacity
from ..shapes import Mesh
from ..shapes.attributes import Corners, corner_values
from ..textures.base import BaseTexture
from .base import LightSample
from .planar import TwoSided
from .triangle import TriangleLights

MOST_SAMPLES = 1 << 18  # points of a mesh that are looked up, if possible
LEAST, MOST = 4, 32  # parts that an edge of a face is cut into


@soa
class TexturedTriangleLights(TriangleLights):
    """k triangles that emit from their front side, some of them by a texture or less where alpha is below 1.

    Those are sampled by area as all triangles are; their radiance is looked up at the sampled point.
    """

    prim: Ints  # (k,) triangle of the scene, -1 for uniform emission
    source: Ints  # (k,) number of its emission, -1 for uniform emission
    emissions: tuple[Floats | BaseTexture, ...]  # (3, 1), or colors, W·sr⁻¹·m⁻²

    @classmethod
    def textured(
        cls,
        triangles: Doubles,
        radiance: Floats,
        prim: Ints,
        source: Ints,
        emissions: tuple[Floats | BaseTexture, ...],
    ) -> Self:
        """Build from vertices (k, 3, 3), relative to the scene's center, mean radiance (3, k) and fields."""
        even = TriangleLights.from_triangles(triangles, radiance)
        flat = even.corner, even.edge_u, even.edge_v, even.normal, even.area, even.radiance
        return cls(*flat, prim=prim, source=source, emissions=emissions, few=even.few)

    @property
    def varies(self) -> Bools:  # type: ignore[override]
        """A mask (k,) of the triangles whose emission is not uniform."""
        return self.source >= 0

    def sample_li(self, point: Floats, u: Floats) -> LightSample:
        """Pick a point as other triangles do, with its barycentric weights."""
        sample, b = self._sample_at(point, u)
        sample.prim = np.broadcast_to(self.prim, point.shape[1:])
        sample.b1, sample.b2 = b
        return sample

    def le(self, wi: Floats, surface: SurfaceInteraction | None = None) -> Floats:
        """Return the radiance of points on the triangles, (3, n), where they are opaque."""
        if surface is None:
            return TriangleLights.le(self, wi)
        return radiance_by_source(self.emissions, self.source, wi, surface, self.sides == 2)


@soa
class TwoSidedTexturedTriangleLights(TwoSided, TexturedTriangleLights):
    """k triangles that emit from both sides, some of them by a texture."""


def radiance_by_source(
    emissions: tuple[Floats | BaseTexture, ...],
    source: Ints,
    wi: Floats,
    surface: SurfaceInteraction,
    two_sided: bool,
) -> Floats:
    """Return the radiance (3, n) of points on lights that vary.

    Parameters
    ----------
    emissions, source
        The emissions, and their numbers (n,) or (1,).
    wi, surface
        (3, n) directions to the points, and the points.
    two_sided
        Whether back sides shine, too.
    """
    radiance = np.empty_like(wi)
    source = np.broadcast_to(source, wi.shape[1:])
    for number, emission in enumerate(emissions):
        lanes = np.flatnonzero(source == number)
        if lanes.size:
            at = surface if lanes.size == source.size else surface.take(lanes)
            value = emission_at(emission, at)
            radiance[:, lanes] = value if two_sided else value * ~at.back_facing
    return radiance


def emission_at(emission: Floats | BaseTexture, surface: SurfaceInteraction) -> Floats:
    """Return an emission, a constant (3, 1) or a texture, at points: (3, n) or (3, 1)."""
    return np.maximum(emission.at(surface), f4(0)) if isinstance(emission, BaseTexture) else emission


def has_textured_emission(mesh: Mesh) -> bool:
    """Return whether the emission of an emitting mesh varies over it."""
    return isinstance(mesh.emission, BaseTexture) or mesh.material.opacity is not None


def mean_radiance(mesh: Mesh, triangles: Doubles) -> Floats:
    """Estimate the mean radiance of each face of an emitting mesh, (3, m).

    The emission of a face is evaluated at the centers of 16 to 1024 congruent triangles.

    Parameters
    ----------
    mesh
        The emitting mesh.
    triangles
        (m, 3, 3) corners of its faces, relative to the scene's center.
    """
    assert mesh.emission is not None
    emission, opacity = mesh.emission, mesh.material.opacity
    attributes = {name: corner_values(name, [mesh]) for name in _reads(emission, opacity)}
    steps = int(np.clip(np.sqrt(MOST_SAMPLES / len(triangles)), LEAST, MOST))
    b1, b2 = _middles(steps)
    mean = np.empty((3, len(triangles)), f4)
    size = max(1, MOST_SAMPLES // len(b1))
    for start in range(0, len(triangles), size):
        faces = slice(start, start + size)
        surface = _points(triangles[faces], b1, b2)
        for name, corners in attributes.items():
            a, b, c = (corner[:, faces] for corner in corners)
            setattr(surface, name, _interpolated((a, b, c), b1, b2))
        value = emission_at(emission, surface)
        if opacity is not None:
            value = value * opacity.at(surface)
        samples = np.broadcast_to(value, (3, len(surface))).reshape(3, -1, len(b1))
        mean[:, faces] = samples.mean(2, dtype=np.float64)
    return mean


def _reads(emission: Floats | BaseTexture, opacity: Opacity | None) -> set[str]:
    """Return the names of the attributes that emission and opacity read."""
    values = (emission, None if opacity is None else opacity.alpha)
    return {name for value in values if isinstance(value, BaseTexture) for name in value.reads}


def _middles(steps: int) -> tuple[Floats, Floats]:
    """Barycentric weights (steps²,) each of the middles of the parts of a triangle."""
    i, j = np.indices((steps, steps)).reshape(2, -1)
    upward, downward = i + j < steps, i + j < steps - 1
    b1 = np.concatenate([i[upward] + 1 / 3, i[downward] + 2 / 3]) / steps
    b2 = np.concatenate([j[upward] + 1 / 3, j[downward] + 2 / 3]) / steps
    return b1.astype(f4), b2.astype(f4)


def _points(triangles: Doubles, b1: Floats, b2: Floats) -> SurfaceInteraction:
    """Return points with weights b1, b2 (k,) on triangles (m, 3, 3), seen head on: m·k columns."""
    a, b, c = np.ascontiguousarray(triangles.transpose(1, 2, 0), f4)
    normal = np.repeat(normalize(cross(b - a, c - a)), len(b1), 1)
    n = normal.shape[1]
    return SurfaceInteraction(
        point=_interpolated((a, b, c), b1, b2),
        error=np.zeros(n, f4),
        ng=normal,
        ns=normal,
        wo=normal,
        prim=np.repeat(np.arange(len(triangles)), len(b1)),
        material=np.zeros(n, np.intp),
        back_facing=np.zeros(n, np.bool_),
    )


def _interpolated(corners: Corners, b1: Floats, b2: Floats) -> Floats:
    """Values (width, m·k) at weights b1, b2 (k,) from those at the corners, 3 × (width, m)."""
    a, b, c = (corner[:, :, None] for corner in corners)
    return interpolate(a, b, c, b1, b2).reshape(len(a), -1)
