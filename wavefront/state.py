"""The records that travel round the loop: structures of arrays, one column per path.

Each field is declared once, with its shape and unit; `take`, `concatenate` and `len` are derived.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields
from functools import cache
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from .frame import Frame
from .record import record
from .vec import Bools, Floats, Ints, Lanes, take

Words = NDArray[np.uint32]


@cache
def _names(kind: type) -> tuple[str, ...]:
    return tuple(field.name for field in fields(kind))


class SoA:
    """Base of dataclasses whose fields are arrays with one column (last axis) per element.

    A field that is no array is shared by all elements; one that is None is absent.
    """

    __slots__ = ()

    def _values(self) -> list[tuple[str, Any]]:
        kind: Any = type(self)
        return [(name, getattr(self, name)) for name in _names(kind)]

    def __len__(self) -> int:
        """Return the number of columns."""
        kind: Any = type(self)
        values = (getattr(self, name) for name in _names(kind))
        return int(next(value.shape[-1] for value in values if isinstance(value, np.ndarray)))

    def shared(self) -> list[Any]:
        """Return the values that all elements share; records are only joined where these are the same."""
        return [value for _, value in self._values() if not isinstance(value, np.ndarray)]

    def take(self, index: Lanes) -> Self:
        """Gather columns `index` (m,) of every field into a new record; of a slice, views."""
        out = object.__new__(type(self))
        for name, value in self._values():
            setattr(out, name, take(value, index) if isinstance(value, np.ndarray) else value)
        return out

    def put(self, index: Ints, other: Self) -> None:
        """Write the columns of another record over columns `index` (m,) of this one, in place."""
        for (_, value), (_, new) in zip(self._values(), other._values(), strict=True):
            if isinstance(value, np.ndarray):
                value[..., index] = new

    @classmethod
    def concatenate(cls, records: Sequence[Self]) -> Self:
        """Join the columns of several records of one type."""
        out = object.__new__(cls)
        kind: Any = cls
        for name in _names(kind):
            setattr(out, name, _joined([getattr(record, name) for record in records]))
        return out


def _joined(values: Sequence[Any]) -> Any:
    """Join the columns of arrays; what is `broadcast` and the same in all of them stays one value."""
    arrays = [value for value in values if isinstance(value, np.ndarray)]
    if not arrays:
        return values[0]
    first, shape = arrays[0], arrays[0].shape[:-1]
    if all(a.strides[-1] == 0 and np.array_equal(a[..., :1], first[..., :1]) for a in arrays):
        return np.broadcast_to(first[..., :1], (*shape, sum(a.shape[-1] for a in arrays)))
    return np.concatenate(arrays, axis=-1)


@record
class Rays(SoA):
    """What an accelerator is asked."""

    origin: Floats  # (3, n) start of the ray, scene units
    direction: Floats  # (3, n) unit direction
    exclude_prim: Ints  # (n,) primitive that the ray starts on, -1 for none


@record
class Paths(Rays):
    """Live paths: the ray that each follows, and what it has gathered on the way."""

    slot: Ints  # (n,) column of the radiance buffer that this path owns
    pixel: Words  # (n,) row-major pixel index: first part of the random-number address
    sample: Words  # (n,) sample index within the pixel: second part of the address
    throughput: Floats  # (3, n) product of BSDF weights since the camera
    pdf: Floats  # (n,) density of the last BSDF sample, 1/sr; unused where specular
    specular: Bools  # (n,) no light sample could have found the last direction: delta lobe, camera
    eta_scale: Floats  # (n,) square of the relative refractive index crossed so far
    prev_vertex: Floats | None = None  # (3, n) where the paths last scattered; None where that is `origin`


@record
class Hits(SoA):
    """What each ray met first."""

    t: Floats  # (n,) distance along the ray, scene units; inf on a miss
    prim: Ints  # (n,) row of the scene's tables, -1 on a miss; without instances it is the primitive's id
    b1: Floats | None  # (n,) barycentric weight of the second vertex; None where nothing is interpolated
    b2: Floats | None  # (n,) barycentric weight of the third vertex
    instance: Ints | None = None  # (n,) column of the scene's `InstanceTable`; None when it has none

    @property
    def found(self) -> Ints:
        """Indices of the lanes that hit something."""
        return np.flatnonzero(self.prim >= 0)


@record
class SurfaceInteraction(SoA):
    """Geometry at hit points. Normals face the side that the ray came from."""

    point: Floats  # (3, n) hit point, scene units
    error: Floats  # (n,) bound on the rounding error of `point`, scene units
    ng: Floats  # (3, n) unit geometric normal, on the side of wo
    ns: Floats  # (3, n) unit shading normal, on the side of wo
    wo: Floats  # (3, n) unit direction towards the ray's origin, world frame
    prim: Ints  # (n,) primitive id
    material: Ints  # (n,) row of the scene's material table
    back_facing: Bools  # (n,) the ray came from the back side of the surface
    # what varies over a shape, if a material of the scene reads it; shapes/attributes.py fills it in
    uv: Floats | None = None  # (2, n) texture coordinates
    uv1: Floats | None = None  # (2, n) the second set of texture coordinates
    color: Floats | None = None  # (4, n) linear RGB and opacity, given per vertex
    tangents: Floats | None = None  # (6, n) how the point moves with u and with v, scene units
    tangents1: Floats | None = None  # (6, n) the same for uv1
    tangent_frame: Floats | None = None  # (6, n) along what red and green of a normal map lean, of any length
    tangent_frame1: Floats | None = None  # (6, n) the same for maps that uv1 places

    def frame(self) -> Frame:
        """Return the shading frames, z = ns."""
        return Frame.from_normal(self.ns)


@record
class Contribution(SoA):
    """Light that arrives at the camera along some paths: emission that they met, or direct light.

    Everything that is added to a picture is a contribution, so its parts by light, or by how they were
    found, are sums over contributions.
    """

    lanes: Ints  # (k,) columns of the paths
    radiance: Floats  # (3, k) that reaches the last vertex of each path, W·sr⁻¹·m⁻²
    light: Ints  # (k,) number of the light, as in the scene's `LightTable`
