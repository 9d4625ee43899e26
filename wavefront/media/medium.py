"""Homogeneous media."""

from __future__ import annotations

from copy import copy
from functools import partial
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from ..arrays.elementary import exp, log
from ..arrays.soa import soa
from ..arrays.vec import FLOAT32_MAX, Doubles, Floats, f4, highest, take
from ..colors import rgb
from ..core.errors import SceneError, number
from ..core.parameter import Parameter, optional, parametrized
from ..textures.base import BaseTexture
from .base import BaseMedium, Flight, GlowWeights, MediumRays, MediumRecord, channel_shares, chosen_channel
from .phase import PhaseFunction, phase_or_isotropic

THIN = f4(0.05)  # optical depth below which 1 − exp(−x) is a series


def _coefficient(name: str, value: Any, high: float = np.inf) -> Any:
    """Return a coefficient per channel, (3, 1) float32, at least 0."""
    if isinstance(value, BaseTexture):
        raise SceneError(f"{name} must be a color, not a texture: it belongs to a volume, not to a surface")
    if isinstance(value, str):
        raise SceneError(f"{name} must be numeric, not the name of a color, got {value!r}")
    return rgb(name, value, high)


_albedo = optional(partial(rgb, high=1.0))


def _length(name: str, value: Any) -> Any:
    """Return a length per channel, (3, 1) float32 above 0."""
    lengths = _coefficient(name, value)
    if not lengths.all():
        raise SceneError(f"{name} is {value!r}; it must be more than 0")
    return lengths


def _scale(name: str, value: Any) -> float:
    return number(name, value, lambda x: 0 <= x < np.inf, "at least 0 and finite")


@parametrized
class Medium(BaseMedium):
    """A homogeneous medium, such as colored glass, fog or milk.

    All coefficients are per channel and per scene unit of path length: a number or three, at least 0.

    Parameters
    ----------
    absorption
        Absorption coefficient σa. Over a length t the radiance falls by exp(−σa · t) (Beer and Lambert).
    scattering
        Scattering coefficient σs: the inverse of the mean length between two scattering events.
    phase
        The `PhaseFunction`: into which directions light is scattered. None: `Isotropic()`.
    scale
        Multiplies absorption, scattering and emission: the density.
    emission
        Radiance that is emitted per unit of length, W·sr⁻¹·m⁻² per scene unit.
    albedo, mean_free_path
        In place of absorption and scattering: the part of the light that is scattered where light meets the
        medium, in [0, 1], a color; and the mean length up to there, 1/(σa + σs), more than 0.

    Raises
    ------
    SceneError
        If a parameter is out of its range, not finite, or a texture; or if only one of albedo and mean free
        path is given, or one of them besides absorption or scattering.

    Examples
    --------
    >>> tea = wf.Medium(absorption=(0.5, 1.5, 4.0))
    >>> cup = wf.Sphere((0, 0, 0), 1, material=wf.Material(wf.Dielectric(1.33), interior=tea))
    >>> fog = wf.Medium(scattering=0.05, phase=wf.HenyeyGreenstein(0.7))
    >>> milk = wf.Medium(albedo=(0.999, 0.998, 0.99), mean_free_path=0.02)
    """

    absorption: Parameter[ArrayLike] = Parameter(_coefficient, default=0.0)
    scattering: Parameter[ArrayLike] = Parameter(_coefficient, default=0.0)
    phase: Parameter[PhaseFunction | None] = Parameter(phase_or_isotropic, default=None, kw_only=True)
    scale: Parameter[float] = Parameter(_scale, default=1.0, kw_only=True)
    emission: Parameter[ArrayLike] = Parameter(_coefficient, default=0.0, kw_only=True)
    albedo: Parameter[ArrayLike | None] = Parameter(_albedo, default=None, kw_only=True)
    mean_free_path: Parameter[ArrayLike | None] = Parameter(optional(_length), default=None, kw_only=True)

    def derive(self) -> None:
        """Set the coefficients that are rendered."""
        absorbed, scattered = self.absorption.astype(np.float64), self.scattering.astype(np.float64)
        if (self.albedo is None) != (self.mean_free_path is None):
            raise SceneError("Medium albedo and mean_free_path belong together; one of them is missing")
        if self.albedo is not None:
            if absorbed.any() or scattered.any():
                raise SceneError(
                    "Medium albedo and mean_free_path stand in place of absorption and scattering"
                )
            extinction = 1 / self.mean_free_path.astype(np.float64)
            scattered = self.albedo * extinction
            absorbed = extinction - scattered
        self.sigma_a, self.sigma_s, self.glow = (
            # no float32 is so large that it would make a path of length 0 a NaN
            np.minimum(sigma * self.scale, FLOAT32_MAX).astype(f4)
            for sigma in (absorbed, scattered, self.emission.astype(np.float64))
        )
        self.scatters, self.glows = bool(self.sigma_s.any()), bool(self.glow.any())

    def record(self, center: Doubles) -> HomogeneousMedia:
        """Return the medium as a record; it is the same everywhere."""
        return HomogeneousMedia(self.sigma_a + self.sigma_s, self.sigma_s, self.glow)

    def scaled(self, factor: float) -> Self:
        """Return this medium where lengths were multiplied by `factor`: itself if nothing changes."""
        if factor == 1 or not (self.sigma_a.any() or self.scatters or self.glows):
            return self
        other = copy(self)
        other.scale = self.scale / factor
        return other


@soa
class HomogeneousMedia(MediumRecord):
    """k homogeneous media."""

    extinction: Floats  # (3, k) per scene unit
    scattering: Floats  # (3, k)
    glow: Floats  # (3, k)

    def sample(
        self, rays: MediumRays, throughput: Floats, u: Floats, weights: GlowWeights | None = None
    ) -> Flight:
        """Choose a channel with u[0] and a distance in it with u[1]; weigh by the densities of all channels.

        Sources: M. Pharr, W. Jakob and G. Humphreys, *Physically Based Rendering*, 3rd edition, §15.2.1 (the
        mean of the channels' densities); A. Wilkie et al., "Hero Wavelength Spectral Sampling", EGSR 2014.
        """
        extinction, scattering = (take(sigma, rays.number) for sigma in (self.extinction, self.scattering))
        shares = channel_shares(throughput)
        chosen = chosen_channel(extinction, shares, u[0])
        # where nothing is scattered, nothing is chosen either
        chosen *= highest(scattering) > 0
        scatters = chosen > 0
        t = np.where(scatters, -log(f4(1) - u[1]) / np.where(scatters, chosen, f4(1)), f4(np.inf))
        met = t < rays.length
        through = transmitted(extinction, np.where(met, t, rays.length))
        density = shares * through * np.where(met, extinction, f4(1))
        total = np.where(highest(scattering) > 0, density[0] + density[1] + density[2], f4(1))
        weight = through * np.where(met, scattering, f4(1)) / np.where(total > 0, total, f4(np.inf))
        light = self._emitted(rays, extinction) if self.glow.any() else None
        return Flight(np.where(met, t, f4(np.inf)), weight, light)

    def transmittance(self, rays: MediumRays) -> Floats:
        """Return exp(−σt·length), (3, n)."""
        return transmitted(take(self.extinction, rays.number), rays.length)

    def _emitted(self, rays: MediumRays, extinction: Floats) -> Floats:
        """Return ε(1 − exp(−σt·length))/σt, (3, n): the emission on the way to the end of the rays."""
        glow, length = take(self.glow, rays.number), rays.length
        clear = extinction == 0
        depth = np.where(clear, f4(0), extinction * np.where(clear, f4(0), length))
        thin, low = depth < THIN, np.minimum(depth, THIN)
        series = f4(1) - low * (f4(1 / 2) - low * (f4(1 / 6) - low * f4(1 / 24)))
        by_series = series * np.where(thin & (glow > 0), length, f4(0))
        thick = (f4(1) - exp(-depth)) / np.where(clear, f4(1), extinction)
        return glow * np.where(thin, by_series, thick)


def transmitted(extinction: Floats, length: Floats) -> Floats:
    """Return exp(−σt·length), (3, n); 1 where σt is 0, over any length."""
    return exp(-extinction * np.where(extinction > 0, length, f4(0)))
