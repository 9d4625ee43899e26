"""Lights that move while a shutter is open: each is sampled in its place at the time of the path.

The time is that of the `Receiver`. A density in solid angle is that of the light as it is
then, so it stays exact.
"""

from __future__ import annotations

from dataclasses import field, replace
from typing import Any, ClassVar, Self

import numpy as np

from ..arrays.soa import soa
from ..arrays.state import SoA, SurfaceInteraction
from ..arrays.vec import Doubles, Floats, Ints, cross, distinct, f4, length, normalize
from ..motion.steps import Motions, applied, moved_back, step_at, transposed_turned, turned
from .base import Emitters, LightRecord, LightSample, Receiver
from .planar import PlanarLights

TIMES = 9  # samples of the time while the shutter is open, for the choice of a light


@soa
class MovingLights(LightRecord):
    """k lights of one kind whose motions keep their shapes.

    They are asked in their own coordinates, where they are still.
    """

    lights: Any  # a `LightRecord` of k, in coordinates of their own
    number: Ints  # (k,) of their motions
    motions: Motions
    kind: type  # of `lights`
    # (12, n) from the scene to the lights when points are lit; None where the times are not known
    matrix: Doubles | None = field(default=None, kw_only=True)

    takes_receiver: ClassVar[bool] = True
    varies: ClassVar[bool] = True  # which side of a surface shines depends on the time

    @property
    def delta(self) -> bool:  # type: ignore[override]
        """Whether they are delta lights."""
        return bool(self.kind.delta)  # type: ignore[attr-defined]

    @property
    def reads(self) -> tuple[str, ...]:  # type: ignore[override]
        """Attributes of surfaces that `le` reads."""
        return tuple(self.lights.reads)

    def shared(self) -> list[Any]:
        """Return the values that all lights share."""
        values: list[Any] = SoA.shared(self)
        return [*values, *self.lights.shared()]

    def lighting(self, receiver: Receiver) -> Self:
        """Return the lights at the times of surfaces, and as they are sampled for these."""
        assert receiver.time is not None
        matrix = self._matrix(receiver.time, receiver.time.size)
        lit = replace(self, matrix=matrix)
        if self.lights.takes_receiver:
            normal = normalize(turned(matrix, receiver.normal)).astype(f4)
            lit.lights = self.lights.lighting(Receiver(normal, receiver.opaque, time=receiver.time))
        return lit

    def sample_li(self, point: Floats, u: Floats) -> LightSample:
        """Sample the lights as they see the points (3, n)."""
        matrix = self._matrix(None, point.shape[1])
        sample = self.lights.sample_li(applied(matrix, point).astype(f4), u)
        return replace(
            sample,
            wi=normalize(transposed_turned(matrix, sample.wi)).astype(f4),
            distance=(sample.distance / _scale(matrix)).astype(f4),
        )

    def pdf_li(self, point: Floats, wi: Floats) -> Floats:
        """Return the density of `sample_li`, (n,)."""
        matrix = self._matrix(None, point.shape[1])
        toward = normalize(turned(matrix, wi)).astype(f4)
        density: Floats = self.lights.pdf_li(applied(matrix, point).astype(f4), toward)
        return density

    def le(self, wi: Floats, surface: SurfaceInteraction | None = None) -> Floats:
        """Return the radiance, (3, n), at the times of the surfaces."""
        matrix = self._matrix(None if surface is None else surface.time, wi.shape[1])
        toward = normalize(turned(matrix, wi)).astype(f4)
        textured = None if surface is None or not np.any(self.lights.varies) else surface
        radiance: Floats = self.lights.le(toward, textured)
        return radiance

    def power(self, scene_radius: float) -> Doubles:
        """Return that of the lights."""
        scale = _scale(self.motions.at(self.number, np.full(len(self), self.motions.middle)))
        return np.asarray(self.lights.power(scene_radius) / scale**2)

    def irradiance(self, center: Doubles, radius: float, scene_radius: float) -> Doubles:
        """Return the greatest irradiance at some times while the shutter is open, (c, k)."""
        most, cells = np.zeros((center.shape[1], len(self))), center.shape[1]
        for number in distinct(self.number):
            columns = np.flatnonzero(self.number == number)
            light = self.lights.take(columns)
            for time in self.motions.times(TIMES):
                matrix = self.motions.at(np.full(cells, number), np.full(cells, time))
                near = radius * float(_scale(matrix[:, :1])[0])
                irradiance = light.irradiance(applied(matrix, center), near, scene_radius)
                most[:, columns] = np.maximum(most[:, columns], irradiance)
        return most

    def emitters(self) -> Emitters | None:
        """Return where the lights are in the middle of the time; they shine to all sides."""
        emitters: Emitters | None = self.lights.emitters()
        if emitters is None:
            return None
        matrix = self.motions.at(self.number, np.full(len(self), self.motions.middle))
        middle = moved_back(matrix, emitters.middle)
        return Emitters(middle, np.zeros_like(middle), emitters.extent2 / _scale(matrix) ** 2)

    def _matrix(self, time: Doubles | None, n: int) -> Doubles:
        """Return the matrices (12, n) from the scene to the lights, those that are known or at times (n,)."""
        if time is None and self.matrix is not None:
            return self.matrix
        when = np.full(n, self.motions.middle) if time is None else time
        return self.motions.at(np.broadcast_to(self.number, when.shape), when)


def _scale(matrix: Doubles) -> Doubles:
    """Return the factors (n,) of lengths of matrices (12, n) that keep shapes."""
    linear = np.concatenate([matrix[i : i + 3] for i in (0, 4, 8)])
    return np.asarray(np.sqrt((linear * linear).sum(0) / 3))


@soa
class DeformingLights(LightRecord):
    """k emitting triangles whose corners move, linearly between some times."""

    lights: Any  # `TriangleLights` of k, of any kind, which are these in the middle of the time
    corners: Floats  # (9 * (steps + 1), k) at those times: for each of them, for each corner, xyz
    times: tuple[float, ...]  # (steps + 1) s
    kind: type  # of `lights`
    time: Doubles | None = field(default=None, kw_only=True)  # (n,) of the points that are lit
    receiver: Receiver | None = field(default=None, kw_only=True)

    takes_receiver: ClassVar[bool] = True
    varies: ClassVar[bool] = True

    @property
    def reads(self) -> tuple[str, ...]:  # type: ignore[override]
        """Attributes of surfaces that `le` reads."""
        return tuple(self.lights.reads)

    def lighting(self, receiver: Receiver) -> Self:
        """Return the lights at the times of surfaces, and as they are sampled for these."""
        return replace(self, time=receiver.time, receiver=receiver)

    def sample_li(self, point: Floats, u: Floats) -> LightSample:
        """Sample the triangles as they are then."""
        sample: LightSample = self._at(self.time, point.shape[1]).sample_li(point, u)
        return sample

    def pdf_li(self, point: Floats, wi: Floats) -> Floats:
        """Return the density of `sample_li`, (n,)."""
        density: Floats = self._at(self.time, point.shape[1]).pdf_li(point, wi)
        return density

    def le(self, wi: Floats, surface: SurfaceInteraction | None = None) -> Floats:
        """Return the radiance, (3, n), at the times of the surfaces."""
        textured = None if surface is None or not np.any(self.lights.varies) else surface
        light = self._at(None if surface is None else surface.time, wi.shape[1])
        radiance: Floats = light.le(wi, textured)
        return radiance

    def power(self, scene_radius: float) -> Doubles:
        """Return the most that the triangles have at one of the times."""
        return np.max([light.power(scene_radius) for light in self._stills()], 0)

    def irradiance(self, center: Doubles, radius: float, scene_radius: float) -> Doubles:
        """Return the greatest irradiance at some times while the shutter is open, (c, k)."""
        return np.max([still.irradiance(center, radius, scene_radius) for still in self._stills()], 0)

    def emitters(self) -> Emitters:
        """Return where the lights are in the middle of the time; they shine to all sides."""
        emitters: Emitters = self.lights.emitters()
        return Emitters(emitters.middle, np.zeros_like(emitters.middle), emitters.extent2)

    def _stills(self) -> list[PlanarLights]:
        """Return the lights as they are at some times."""
        return [
            self._at(np.full(len(self), time), len(self))
            for time in np.linspace(self.times[0], self.times[-1], TIMES)
        ]

    def _at(self, time: Doubles | None, n: int) -> PlanarLights:
        """Return the lights, one for each of times (n,), where these are then."""
        when = np.full(n, (self.times[0] + self.times[-1]) / 2) if time is None else time
        lane = np.arange(n) if len(self) == n else np.zeros(n, np.intp)
        step, fraction = step_at(np.array(self.times), when)
        place = 9 * len(self) * step + lane
        rows = self.corners.reshape(-1)
        corners = []
        for row in range(9):
            before = rows.take(place + row * len(self)).astype(np.float64)
            after = rows.take(place + (row + 9) * len(self))
            corners.append(before + (after - before) * fraction)
        a, b, c = np.stack(corners).reshape(3, 3, -1)
        u, v = b - a, c - a
        normal = cross(u, v)
        size = length(normal)
        light: PlanarLights = self.lights.take(lane)
        light.corner, light.edge_u, light.edge_v = a.astype(f4), u.astype(f4), v.astype(f4)
        light.normal = (normal / np.where(size > 0, size, 1)).astype(f4)
        light.area = (light.parallelograms * size).astype(f4)
        light.receiver = self.receiver if light.few else None
        return light
