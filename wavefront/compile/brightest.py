"""The radiance of the brightest emitter of a scene."""

from __future__ import annotations

import numpy as np

from ..arrays.elementary import sin_cos_turns
from ..arrays.vec import Doubles, Floats, f4
from ..lights import EnvironmentSum, InfiniteLight, LightRecord
from ..lights.base import emitters_of, sampled_li
from ..lights.glow import GlowLights
from ..textures.base import BaseTexture
from .scene import CompiledScene

SIDE = 64  # strata along each side of the numbers that choose directions
GOLDEN = (5**0.5 - 1) / 2  # of a turn, between two directions


def brightest_emitter(scene: CompiledScene) -> Doubles:
    """Return the greatest radiance of all that rays can meet, (3,) each channel; 0 where they meet no light.

    An environment is looked up in directions that it samples, so that a part with a thousandth of its light
    is not missed, and in directions all around.
    """
    radiances = [np.zeros(3), *(_brightest(kind) for kind in scene.lights.kinds if not kind.delta)]
    return np.max(radiances, axis=0)


def _brightest(kind: LightRecord) -> Doubles:
    """Return the greatest radiance of lights of one kind, (3,)."""
    if isinstance(kind, EnvironmentSum) and kind.turns:  # as if the brightest of all met
        return np.sum([_brightest(light) for light in kind.parts], axis=0)
    if isinstance(kind, InfiniteLight):
        toward = np.concatenate([kind.sample_li(_origins(SIDE**2), _strata()).wi, _around()], 1)
        return _most(kind.le(toward))
    if isinstance(kind, GlowLights):  # its mean emission, along its extent
        return np.full(3, kind.cells.power / (4 * np.pi * max(kind.cells.extent, 1e-30) ** 2))
    emissions = getattr(kind, "emissions", ())
    known = [getattr(kind, "radiance", None), *(_constant(emission) for emission in emissions)]
    values = [_most(radiance) for radiance in known if radiance is not None]
    return np.max(values, axis=0) if values else _sampled(kind)


def _constant(emission: Floats | BaseTexture) -> Floats | None:
    """Return the greatest values (3, 1) of an emission; None where they are not known."""
    if not isinstance(emission, BaseTexture):
        return emission
    limits = emission.limits()
    return np.full((3, 1), max(limits), f4) if limits else None


def _sampled(kind: LightRecord) -> Doubles:
    """Return the greatest radiance of samples of lights, (3,), from points around each."""
    where, around, most = emitters_of(kind), _around(), np.zeros(3)
    u = _strata()
    for column in range(len(kind)):
        middle, extent = where.middle[:, [column]], float(where.extent2[column]) ** 0.5
        size = extent if np.isfinite(extent) and extent > 0 else 1.0
        point = np.where(np.isfinite(middle), middle, 0) + 2 * size * around
        most = np.maximum(
            most, _most(sampled_li(kind.take(np.array([column])), point.astype(f4), u).radiance)
        )
    return most


def _most(radiance: Floats) -> Doubles:
    return np.asarray(radiance.max(1, initial=0), np.float64)


def _origins(n: int) -> Floats:
    return np.zeros((3, n), f4)


def _strata() -> Floats:
    """Return the middles (2, SIDE²) of the cells of a square."""
    return ((np.indices((SIDE, SIDE)).reshape(2, -1) + 0.5) / SIDE).astype(f4)


def _around() -> Floats:
    """Return SIDE² directions that are evenly spread, a Fibonacci lattice: (3, SIDE²)."""
    number = np.arange(SIDE**2)
    y = 1 - (2 * number + 1) / number.size
    sin, cos = sin_cos_turns(number * GOLDEN)
    ring = np.sqrt(1 - y * y)
    return np.stack([sin * ring, y, cos * ring]).astype(f4)
