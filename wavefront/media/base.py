"""The contract of every medium.

A `BaseMedium` is an object of a material or a scene. For a render it gives a `MediumRecord`, which holds k
media of one kind, a column each. A record is asked two things about n rays, each within one of its media:
how far light gets (`sample`), and which part of it passes a given length (`transmittance`). Positions are
relative to the scene's center.

Both follow the radiative transfer equation along a ray of direction ω,

    dL/dt = −σt·L + σs·∫ p(ω, ω')·L(ω') dω' + ε

with extinction σt = σa + σs, the phase function p, and the emission ε per unit of length.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any, ClassVar, Self

import numpy as np

from ..arrays.soa import soa
from ..arrays.state import SoA
from ..arrays.vec import Doubles, Floats, Ints, f4
from ..core.parameter import Parametrized
from ..sampling.steps import StepNumbers
from .phase import PhaseFunction


@soa
class MediumRays(SoA):
    """Rays, each within one of the media of a record."""

    number: Ints  # (n,) column of its medium
    origin: Floats  # (3, n)
    direction: Floats  # (3, n) unit
    length: Floats  # (n,) how far it goes there, scene units, up to infinity
    steps: StepNumbers | None  # numbers without end; None unless a record of the scene `takes_steps`


@soa
class Flight(SoA):
    """How far rays get in their media."""

    t: Floats  # (n,) distance at which light is scattered, scene units; inf where it gets through
    weight: Floats  # (3, n) of the light from there, over the density of getting there
    light: Floats | None = None  # (3, n) emitted on the way, as it arrives at the origin; None for none


@soa
class GlowWeights(SoA):
    """Data to weigh emission that rays meet against light samples of it (multiple importance sampling)."""

    ratio: Floats  # (n,) chance of the light over the density of the ray's direction; 0 for no light sample
    before: (
        Floats  # (n,) distance from where the light would be sampled to the origin of the ray, scene units
    )


class BaseMedium(Parametrized, ABC):
    """A medium inside shapes, or around them: it absorbs, scatters and emits light."""

    phase: PhaseFunction
    # (3, 1) absorption, scattering and emission per scene unit, times the scale; of a grid where its density
    # is 1, without a grid of albedos
    sigma_a: Floats
    sigma_s: Floats
    glow: Floats
    scatters: bool  # anywhere, in any channel
    glows: bool  # likewise for emission

    @property
    def bounds(self) -> Doubles | None:
        """Corners of the box that it is in, (2, 3), scene units; here: None, as it may be anywhere."""
        return None

    @abstractmethod
    def record(self, center: Doubles) -> MediumRecord:
        """Return the medium as a record of one column, with positions relative to `center` (3,)."""

    @abstractmethod
    def scaled(self, factor: float) -> Self:
        """Return this medium where lengths were multiplied by `factor`: itself if nothing changes."""


class MediumRecord(SoA, ABC):
    """The k media of one kind in a scene."""

    __slots__ = ()
    takes_steps: ClassVar[bool] = False

    @abstractmethod
    def sample(
        self, rays: MediumRays, throughput: Floats, u: Floats, weights: GlowWeights | None = None
    ) -> Flight:
        """Choose with u (2, n) where light is scattered.

        `throughput` (3, n) is that of the paths: it tells which channels matter. The mean of `weight`, where
        light is scattered, is σs·transmittance·dt, and elsewhere the transmittance of the whole length.
        `weights` are for media whose emission is sampled; others ignore them.
        """

    @abstractmethod
    def transmittance(self, rays: MediumRays) -> Floats:
        """Return the part of the light that gets over the whole length, or an unbiased estimate, (3, n)."""


def channel_shares(throughput: Floats) -> Floats:
    """Return the probability (3, n) with which each channel decides about a distance.

    It is the channel's part of the throughput (3, n), so that weights never raise the sum of the channels.
    """
    total: Any = throughput[0] + throughput[1] + throughput[2]
    lit = (total > 0) & (total < np.inf)
    return np.where(lit, throughput / np.where(lit, total, f4(1)), f4(1 / 3))


def chosen_channel(values: Floats, shares: Floats, u: Floats) -> Floats:
    """Return the values (3, n) of a channel, chosen with u (n,) by shares (3, n): (n,)."""
    return np.where(u < shares[0], values[0], np.where(u < shares[0] + shares[1], values[1], values[2]))
