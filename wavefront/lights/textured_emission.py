"""Meshes that do not shine evenly: by a texture, or because they are only partly there."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..materials.alpha import Opacity
from ..record import record
from ..shapes import Mesh
from ..shapes.attributes import Corners, corner_values
from ..state import SurfaceInteraction
from ..textures.base import BaseTexture
from ..vec import Floats, Ints, cross, f4, interpolate, normalize

MOST_SAMPLES = 1 << 18  # points of a mesh that are looked up, if possible
LEAST, MOST = 4, 32  # parts that an edge of a face is cut into


@record
class EmissionSource:
    """What one or more meshes send."""

    emission: Floats | BaseTexture  # (3, 1), or colors, W·sr⁻¹·m⁻²
    two_sided: bool

    def radiance(self, surface: SurfaceInteraction) -> Floats:
        """Return what points send towards wo where they are there, (3, n) or (3, 1)."""
        value = self.emission
        if isinstance(value, BaseTexture):
            value = np.maximum(value.at(surface), f4(0))
        return value if self.two_sided else value * ~surface.back_facing


@record
class TexturedEmission:
    """The lights that do not shine evenly."""

    triangle: Ints  # (lights,) triangle of such a light, -1 for all others
    source: Ints  # (lights,) its number in `sources`, -1 for all others
    sources: list[EmissionSource]

    def radiance(self, light: Ints, surface: SurfaceInteraction) -> Floats:
        """Return what points on lights (n,) send towards wo where they are there, (3, n)."""
        out = np.empty((3, len(light)), f4)
        source = self.source.take(light)
        for number, kind in enumerate(self.sources):
            lanes = np.flatnonzero(source == number)
            if lanes.size:
                out[:, lanes] = kind.radiance(surface.take(lanes))
        return out


def has_textured_emission(mesh: Mesh) -> bool:
    """Tell whether the points of a mesh that shines differ in what they send."""
    return isinstance(mesh.emission, BaseTexture) or mesh.material.opacity is not None


def mean_radiance(mesh: Mesh, triangles: NDArray[np.float64]) -> Floats:
    """Estimate what the faces of a mesh that shines send on average, (3, m).

    A face is cut into 16 to 1024 congruent triangles, and looked up in the middle of each.

    Parameters
    ----------
    mesh
        What shines.
    triangles
        (m, 3, 3) corners of its faces, relative to the scene's center.
    """
    assert mesh.emission is not None
    source, opacity = EmissionSource(mesh.emission, two_sided=True), mesh.material.opacity
    attributes = {name: corner_values(name, [mesh]) for name in _reads(source.emission, opacity)}
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
        value = source.radiance(surface)
        if opacity is not None:
            value = value * opacity.at(surface)
        each = np.broadcast_to(value, (3, len(surface))).reshape(3, -1, len(b1))
        mean[:, faces] = each.mean(2, dtype=np.float64)
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


def _points(triangles: NDArray[np.float64], b1: Floats, b2: Floats) -> SurfaceInteraction:
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
