"""The data that stages pass on: structures of arrays with one column per path.

Each field is declared once, with its shape and unit; `take`, `concatenate` and `len` are derived.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import field, fields
from enum import IntEnum
from functools import cache
from html import escape
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from .frame import Frame
from .path_recorder import NOBODY, PathRecorder
from .soa import soa
from .vec import Bools, Bytes, Doubles, Floats, Ints, Lanes, take

Words = NDArray[np.uint32]


class BounceDepth(IntEnum):
    """How deep a path is, counted by its scattering that is not specular."""

    CAMERA = 0  # none so far: light that it meets is seen directly
    DIRECT = 1  # the last scattering, and none before: light that it meets is direct
    INDIRECT = 2  # one that is not the last, or several


UNITS = {
    **dict.fromkeys(("origin", "prev_vertex", "point", "error", "t"), "scene units"),
    **dict.fromkeys(("glow", "radiance"), "W/(sr m²)"),
    "pdf": "1/sr",
    "time": "s",
}
FIRST = 3  # columns that are shown


def _first(values: Any) -> str:
    """Return the first columns of an array as text."""
    columns = [np.array2string(column, precision=4) for column in np.moveaxis(values[..., :FIRST], -1, 0)]
    return ", ".join([*columns, *(["…"] if values.shape[-1] > FIRST else [])])


@cache
def _names(kind: type) -> tuple[str, ...]:
    return tuple(field.name for field in fields(kind))


class SoA:
    """Structure of arrays: base of dataclasses of arrays with one column (last axis) per element.

    A field that is neither an array nor such a structure is shared by all elements. One that is None is
    absent.
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

    def __repr__(self) -> str:
        """Return a table of the fields: shape, type, unit, and the first columns."""
        rows = self._rows()
        widths = [max((len(row[column]) for row in rows), default=0) for column in range(4)]
        lines = [
            "  ".join(
                [*(cell.ljust(width) for cell, width in zip(row, widths, strict=False)), row[4]]
            ).rstrip()
            for row in rows
        ]
        return "\n  ".join([f"{type(self).__name__}: {len(self)} columns", *lines])

    def _repr_html_(self) -> str:
        return f"<pre>{escape(repr(self))}</pre>"

    def _rows(self) -> list[tuple[str, str, str, str, str]]:
        arrays = [(name, value) for name, value in self._values() if isinstance(value, np.ndarray)]
        return [
            (name, str(value.shape), str(value.dtype), UNITS.get(name, ""), _first(value))
            for name, value in arrays
        ]

    def shared(self) -> list[Any]:
        """Return the values that all elements share; records are only joined where these are the same."""
        return [value for _, value in self._values() if not isinstance(value, np.ndarray | SoA)]

    def take(self, index: Lanes) -> Self:
        """Return columns `index` (m,) of every field as a new record; views for a slice."""
        out = object.__new__(type(self))
        for name, value in self._values():
            if isinstance(value, np.ndarray):
                value = take(value, index)
            elif isinstance(value, SoA):
                value = value.take(index)
            setattr(out, name, value)
        return out

    def put(self, index: Ints, other: Self) -> None:
        """Write the columns of another record to columns `index` (m,) of this one."""
        for (_, value), (_, new) in zip(self._values(), other._values(), strict=True):
            if isinstance(value, np.ndarray):
                value[..., index] = new
            elif isinstance(value, SoA):
                value.put(index, new)

    @classmethod
    def concatenate(cls, records: Sequence[Self]) -> Self:
        """Return a record of the columns of several records of one type."""
        out = object.__new__(cls)
        kind: Any = cls
        for name in _names(kind):
            setattr(out, name, _joined([getattr(record, name) for record in records]))
        return out


def _joined(values: Sequence[Any]) -> Any:
    """Concatenate arrays along the last axis; equal arrays from `broadcast` give one such array."""
    if isinstance(values[0], SoA):
        return type(values[0]).concatenate(values)
    arrays = [value for value in values if isinstance(value, np.ndarray)]
    if not arrays:
        return values[0]
    first, shape = arrays[0], arrays[0].shape[:-1]
    if all(a.strides[-1] == 0 and np.array_equal(a[..., :1], first[..., :1]) for a in arrays):
        return np.broadcast_to(first[..., :1], (*shape, sum(a.shape[-1] for a in arrays)))
    return np.concatenate(arrays, axis=-1)


@soa
class Rays(SoA):
    """Rays for an accelerator."""

    origin: Floats  # (3, n) start of the ray, scene units
    direction: Floats  # (3, n) unit direction
    exclude_prim: Ints  # (n,) primitive that the ray starts on, -1 for none
    # (4, n) stack of the media around the rays; None in scenes without a `MediaTable`
    media: Any = field(default=None, kw_only=True)
    # (n,) time of the scene, s, float64; None in scenes where nothing moves while the shutter is open
    time: Doubles | None = field(default=None, kw_only=True)


@soa
class Paths(Rays):
    """Paths: the current ray, throughput and random-number address of each.

    Examples
    --------
    >>> step = next(wf.trace([wf.Sphere((0, 0, 0), 1), wf.Environment(1)], size=(4, 4)))
    >>> step.paths.direction.shape, step.paths.throughput[:, 0]
    ((3, 16), array([1., 1., 1.], dtype=float32))
    """

    slot: Ints  # (n,) column of the radiance buffer
    pixel: Words  # (n,) row-major pixel index: first part of the random-number address
    sample: Words  # (n,) sample index within the pixel: second part of the address
    throughput: Floats  # (3, n) product of BSDF weights since the camera
    pdf: Floats  # (n,) density of the last BSDF sample, 1/sr; unused where specular
    specular: Bools  # (n,) the last direction is of a delta lobe or the camera: light sampling cannot find it
    roulette_scale: Floats  # (n,) throughput times this decides about roulette: see `stages.compact.roulette`
    glow: Floats | None = None  # (3, n) light that media have sent since the last event; None where none does
    prev_vertex: Floats | None = None  # (3, n) where the paths last scattered; None where that is `origin`
    # `Receiver` of the light samples there; None where no light of the scene takes it
    left_receiver: Any = None
    # (n,) paths from lights reach the first surface of the path, as no shadow catcher was passed before,
    # and it was left by a lobe that is not a delta lobe; None without light tracing
    light_traced: Bools | None = None
    # BSDF of the sensors at which the paths start (stages/sensors.py); None elsewhere
    sensor: Any = None
    # for layers (aovs/recorder.py); None unless they are asked for
    depth: Bytes | None = None  # (n,) a `BounceDepth`
    met_rough: Bools | None = None  # (n,) the path has met a surface that is not specular
    recorder: PathRecorder = NOBODY  # of the wave

    @property
    def last_vertex(self) -> Floats:
        """Where the paths started or last scattered, (3, n), before the surfaces that they have passed."""
        return self.origin if self.prev_vertex is None else self.prev_vertex


@soa
class Hits(SoA):
    """The nearest hit of each ray.

    Examples
    --------
    >>> steps = list(wf.trace([wf.Sphere((0, 0, 0), 1), wf.Environment(1)], size=(4, 4)))
    >>> steps[1].stage, steps[1].hits.t.shape
    ('intersect', (16,))
    """

    t: Floats  # (n,) distance along the ray, scene units; inf on a miss
    prim: Ints  # (n,) row of the scene's tables, -1 on a miss; the primitive id in scenes without instances
    b1: Floats | None  # (n,) barycentric weight of the second vertex; None if the scene interpolates nothing
    b2: Floats | None  # (n,) barycentric weight of the third vertex
    instance: Ints | None = None  # (n,) column of the scene's `InstanceTable`; None when it has none

    @property
    def found(self) -> Ints:
        """Lanes that hit a surface."""
        return np.flatnonzero(self.prim >= 0)

    @property
    def met(self) -> Ints:
        """Lanes that hit a surface, or are scattered before by a medium, where `prim` is below -1."""
        return np.flatnonzero(self.prim != -1)


@soa
class SurfaceInteraction(SoA):
    """The surface geometry at hit points. Normals are on the side that the ray came from.

    Examples
    --------
    >>> steps = list(wf.trace([wf.Sphere((0, 0, 0), 1), wf.Environment(1)], size=(4, 4)))
    >>> steps[3].stage, bool(np.allclose(steps[3].surface.ns, steps[3].surface.point, atol=1e-5))
    ('shade', True)
    """

    point: Floats  # (3, n) hit point, scene units
    error: Floats  # (n,) bound on the rounding error of `point`, scene units
    ng: Floats  # (3, n) unit geometric normal, on the side of wo
    ns: Floats  # (3, n) unit shading normal, on the side of wo
    wo: Floats  # (3, n) unit direction towards the ray's origin, world frame
    prim: Ints  # (n,) primitive id
    material: Ints  # (n,) row of the scene's material table
    back_facing: Bools  # (n,) the ray came from the back side of the surface
    # attributes (shapes/attributes.py), None unless a material of the scene reads them
    uv: Floats | None = None  # (2, n) texture coordinates
    uv1: Floats | None = None  # (2, n) the second set of texture coordinates
    color: Floats | None = None  # (4, n) linear RGB and opacity, given per vertex
    dpduv: Floats | None = None  # (6, n) dpdu and dpdv, the derivatives of the point by u and v, scene units
    dpduv1: Floats | None = None  # (6, n) the same for uv1
    tangent_frame: Floats | None = None  # (6, n) tangent and bitangent of normal maps, of any length
    tangent_frame1: Floats | None = None  # (6, n) the same for uv1
    throughput: Floats | None = None  # (3, n) of the paths; None unless a material is dispersive
    unmapped: Floats | None = None  # (3, n) ns without a normal map; None unless one shadows grazing light
    folds: Bools | None = (
        None  # (n,) scattering is folded at the surface (stages/normal_mapping.py), or nowhere
    )
    # (3, n) from the points to the round surface that normals of vertices stand for; None where none do
    lift: Floats | None = None
    index_around: Floats | None = None  # (n,) of refraction, outside of the surfaces; None where it is 1
    time: Doubles | None = None  # (n,) of the rays that have hit them, s; None where they have none

    def frame(self) -> Frame:
        """Return the shading frames, z = ns."""
        return Frame.from_normal(self.ns)


@soa
class Contribution(SoA):
    """Light that arrives at the camera along some paths: emission that they met, or direct light.

    Everything that is added to a picture is a contribution, so its parts by light, or by how they were
    found, are sums over contributions.
    """

    lanes: Ints  # (k,) columns of the paths
    radiance: Floats  # (3, k) that reaches the last vertex of each path, W·sr⁻¹·m⁻²
    light: Ints  # (k,) number of the light, as in the scene's `LightTable`
    sampled: bool = False  # found by light samples; else the paths' rays met the lights
    wi: Floats | None = None  # (3, k) directions of light samples; None unless a recorder asks for them
