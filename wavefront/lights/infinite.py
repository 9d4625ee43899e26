"""Lights at infinity, which rays meet where they leave the scene, and the sum of several."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import ClassVar, Self

import numpy as np

from ..arrays.soa import soa
from ..arrays.state import SurfaceInteraction
from ..arrays.vec import ALL, Doubles, Floats, Lanes, column, f4
from ..sampling.discrete import Discrete
from .base import FarLight, LightRecord, LightSample, Receiver, lit_for


class InfiniteLight(FarLight, LightRecord):
    """Base class of lights that rays meet where they leave the scene. All lanes share one.

    Examples
    --------
    >>> isinstance(wf.Environment(1).record(np.zeros(3)), wf.InfiniteLight)
    True
    """

    __slots__ = ()
    turns: ClassVar[bool] = False  # whether `le_at` depends on the time

    def record(self, center: Doubles) -> Self:
        """Return the light: it is the same from everywhere."""
        return self

    def __len__(self) -> int:
        """Return 1."""
        return 1

    def take(self, index: Lanes) -> Self:
        """Return the one light: every lane has the same."""
        return self

    @classmethod
    def concatenate(cls, records: Sequence[Self]) -> Self:
        """Return the one light; several are joined by `EnvironmentSum`."""
        (record,) = records
        return record

    def compensated(self) -> Self:
        """Return the light as it is best sampled where BSDF samples find it too; here: as it is.

        Source: O. Karlík, M. Šik, P. Vévoda, T. Skřivan and J. Křivánek, MIS Compensation: Optimizing
        Sampling Techniques in Multiple Importance Sampling, SIGGRAPH Asia 2019.
        """
        return self

    def le_at(self, wi: Floats, time: Doubles | None) -> Floats:
        """Return the radiance (3, n) in directions wi (3, n) at times (n,), s; here that of all times."""
        return self.le(wi)


@soa
class EnvironmentSum(InfiniteLight):
    """The sum of several lights at infinity, sampled one at a time by their power.

    Its pdf is the mixture's, so that each sample is weighted against all ways to draw it
    (E. Veach, thesis 1997, §9.2.2: the one-sample model with the balance heuristic).
    """

    parts: tuple[InfiniteLight, ...]
    choice: Discrete
    receiver: Receiver | None = None  # the surfaces for which the parts are sampled
    takes_receiver: ClassVar[bool] = True

    @property
    def turns(self) -> bool:  # type: ignore[override]
        """Whether one of the parts does."""
        return any(light.turns for light in self.parts)

    @classmethod
    def of(cls, parts: Sequence[InfiniteLight]) -> InfiniteLight:
        """Join lights at infinity; one alone stays as it is."""
        if len(parts) == 1:
            return parts[0]
        return cls(tuple(parts), _by_power(parts))

    def compensated(self) -> Self:
        """Join the compensated parts."""
        parts = tuple(light.compensated() for light in self.parts)
        return replace(self, parts=parts, choice=_by_power(parts))

    def sample_li(self, point: Floats, u: Floats) -> LightSample:
        """Choose a part with u[0], and sample it with the rest of u."""
        index, _, rest = self.choice.sample(u[0])
        stretched = np.stack([rest, u[1]])
        wi = np.empty((3, u.shape[1]), f4)
        for k, light in enumerate(self.parts):
            lanes = np.flatnonzero(index == k)
            if lanes.size:
                lit = lit_for(light, self.receiver, lanes)
                wi[:, lanes] = lit.sample_li(point.take(lanes, 1), stretched.take(lanes, 1)).wi
        time = None if self.receiver is None else self.receiver.time
        return at_infinity(wi, self.le_at(wi, time), self.pdf_li(point, wi))

    def pdf_li(self, point: Floats, wi: Floats) -> Floats:
        """Return the sum of the parts' densities, each times the chance of the part."""
        chances = self.choice.pmf(np.arange(len(self.parts)))
        pdf = np.zeros(wi.shape[1], f4)
        for light, chance in zip(self.parts, chances, strict=True):
            pdf += chance * lit_for(light, self.receiver, ALL).pdf_li(point, wi)
        return pdf

    def lighting(self, receiver: Receiver) -> Self:
        """Return the sum of the parts as they are sampled there."""
        return replace(self, receiver=receiver)

    def le(self, wi: Floats, surface: SurfaceInteraction | None = None) -> Floats:
        """Return the sum of the parts' radiances, (3, n)."""
        return self.le_at(wi, None)

    def le_at(self, wi: Floats, time: Doubles | None) -> Floats:
        """Return the sum of the parts' radiances, (3, n), at times (n,)."""
        radiance = np.zeros_like(wi)
        for light in self.parts:
            radiance += light.le_at(wi, time)
        return radiance

    def power(self, scene_radius: float) -> Doubles:
        """Return the sum of the parts' powers."""
        return np.sum([light.power(scene_radius) for light in self.parts], axis=0)

    def irradiance(self, center: Doubles, radius: float, scene_radius: float) -> Doubles:
        """Return the sum of the parts' irradiances, (c, 1)."""
        return np.sum([light.irradiance(center, radius, scene_radius) for light in self.parts], axis=0)


def _by_power(parts: Sequence[InfiniteLight]) -> Discrete:
    power = np.concatenate([light.power(1.0) for light in parts])
    return Discrete(power if power.any() else np.ones_like(power))


def at_infinity(wi: Floats, radiance: Floats, pdf: Floats) -> LightSample:
    """Return a sample of light that comes from infinitely far away along wi (3, n)."""
    n = wi.shape[1]
    return LightSample(wi, radiance, pdf, np.full(n, np.inf, f4), np.ones(n, f4))


def through_scene(irradiance: Doubles, scene_radius: float) -> Doubles:
    """Power of light with this `irradiance` (k,) through the disk that the scene covers, (k,)."""
    return np.pi * scene_radius**2 * irradiance


def facing_irradiance(light: LightRecord, center: Doubles) -> Doubles:
    """Return the irradiance (c, k) at c places of surfaces that face lights from one direction."""
    irradiance = light.power(1.0) / np.pi
    return np.broadcast_to(irradiance, (center.shape[1], len(irradiance)))


def turned(axes: Floats, v: Floats) -> Floats:
    """Return the axes, columns of (3, 3), weighted by the components of v (3, n): (3, n)."""
    return column(axes[:, 0]) * v[0] + column(axes[:, 1]) * v[1] + column(axes[:, 2]) * v[2]
