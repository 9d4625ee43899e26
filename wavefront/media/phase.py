"""Phase functions: how a medium scatters light, as a density of directions on the sphere."""

from __future__ import annotations

from abc import ABC, abstractmethod
from functools import partial
from typing import Any

import numpy as np

from ..arrays.elementary import exp, log, sin_cos_turns
from ..arrays.vec import INV_FOUR_PI, TINY, Floats, f4
from ..core.errors import number
from ..core.parameter import Parameter, Parametrized, instance_of, parametrized

MOST_FORWARD = 0.99  # largest |g|: float32 resolves lobes up to there
LARGEST_BELOW_ONE = 1 - 2.0**-24


class PhaseFunction(Parametrized, ABC):
    """How a medium scatters light. It depends only on the angle by which light is deflected.

    A subclass defines `p` and `sample`. Both work with cosθ, the cosine of the angle between the directions
    in which light travels before and after: 1 is straight on, -1 is back.

    Examples
    --------
    >>> class Forward(wf.PhaseFunction):
    ...     def p(self, cos):
    ...         return np.where(cos > 0, np.float32(0.5 / np.pi), np.float32(0))
    ...     def sample(self, u):
    ...         return u
    >>> wf.testing.check_phase(Forward(), samples=20_000).checks["mean cosine"].passed
    True
    """

    @abstractmethod
    def p(self, cos: Floats) -> Floats:
        """Return the density (n,) of directions at cosθ (n,), 1/sr; over the sphere its integral is 1."""

    @abstractmethod
    def sample(self, u: Floats) -> Floats:
        """Return cosθ (n,) with the density 2π·p(cosθ), for u (n,) in [0, 1)."""

    @property
    def mean_cosine(self) -> float:
        """The mean of cosθ, g; here: by the midpoint rule."""
        cos = ((np.arange(1 << 16) + 0.5) / (1 << 15) - 1).astype(f4)
        return float((cos * self.p(cos)).mean(dtype=np.float64) * 4 * np.pi)


class Isotropic(PhaseFunction):
    """Scatters light into all directions alike.

    Examples
    --------
    >>> fog = wf.Medium(scattering=0.1, phase=wf.Isotropic())
    """

    mean_cosine = 0.0

    def p(self, cos: Floats) -> Floats:
        """Return 1/(4π), (n,)."""
        return np.full(cos.shape, INV_FOUR_PI)

    def sample(self, u: Floats) -> Floats:
        """Return 2u − 1, (n,)."""
        return f4(2) * u - f4(1)


def _mean_cosine(name: str, value: Any) -> float:
    limit = f"in [-{MOST_FORWARD:g}, {MOST_FORWARD:g}]"
    return number(name, value, lambda x: -MOST_FORWARD <= x <= MOST_FORWARD, limit)


@parametrized
class HenyeyGreenstein(PhaseFunction):
    """The phase function of Henyey and Greenstein: a lobe of any width, forward or backward.

    p = (1 − g²) / (4π (1 + g² − 2g cosθ)^(3/2))

    Source: L. Henyey and J. Greenstein, "Diffuse Radiation in the Galaxy", Astrophysical Journal 93, 1941.

    Parameters
    ----------
    g
        The mean cosine, in [-0.99, 0.99]: 0 is isotropic, positive scatters forward. Fog and milk have
        about 0.9.

    Raises
    ------
    SceneError
        If `g` is out of its range.

    Examples
    --------
    >>> fog = wf.Medium(scattering=0.1, phase=wf.HenyeyGreenstein(0.8))
    """

    g: Parameter[float] = Parameter(_mean_cosine, default=0.0)

    @property
    def mean_cosine(self) -> float:
        """The mean of cosθ: g."""
        return float(self.g)

    def p(self, cos: Floats) -> Floats:
        """Return the density (n,), 1/sr."""
        g = f4(self.g)
        base = (f4(1) - g) * (f4(1) - g) + f4(2) * g * (f4(1) - cos)  # 1 + g² − 2g·cosθ without cancellation
        return INV_FOUR_PI * (f4(1) - g) * (f4(1) + g) / (base * np.sqrt(base))

    def sample(self, u: Floats) -> Floats:
        """Return cosθ (n,): the inverse of the distribution, multiplied out so that no g is divided by."""
        g, x = f4(self.g), f4(2) * u - f4(1)
        lower = f4(1) + g * x
        upper = f4(2) * x + g * (f4(3) + x * x + f4(2) * g * x - g * g * (f4(1) - x * x))
        return np.clip(upper / (f4(2) * lower * lower), f4(-1), f4(1))


class Rayleigh(PhaseFunction):
    """Scattering by particles much smaller than the wavelength, such as the molecules of air.

    p = 3 (1 + cos²θ) / (16π)

    Source of `sample`: J. Frisvad, "Importance Sampling the Rayleigh Phase Function", JOSA A 28(12), 2011.

    Examples
    --------
    >>> air = wf.Medium(scattering=(0.006, 0.014, 0.033), phase=wf.Rayleigh())
    """

    mean_cosine = 0.0

    def p(self, cos: Floats) -> Floats:
        """Return the density (n,), 1/sr."""
        return f4(0.75) * INV_FOUR_PI * (f4(1) + cos * cos)

    def sample(self, u: Floats) -> Floats:
        """Return cosθ (n,): the real root of cos³θ + 3cosθ = 8u − 4."""
        z = f4(4) * u - f4(2)
        size = np.abs(z)
        root = exp(log(size + np.sqrt(size * size + f4(1))) / f4(3))
        return np.clip(np.copysign(root - f4(1) / root, z), f4(-1), f4(1))


as_phase = instance_of(PhaseFunction, "a phase function such as wf.HenyeyGreenstein(0.8)")


def phase_or_isotropic(name: str, value: Any) -> PhaseFunction:
    """Return a phase function; None is `Isotropic()`."""
    return Isotropic() if value is None else as_phase(name, value)


@parametrized
class PhaseMix(PhaseFunction):
    """A weighted mean of two phase functions, such as a forward and a backward lobe.

    Parameters
    ----------
    first, second
        Phase functions, which may be mixtures themselves.
    weight
        The part of the second one, in [0, 1].

    Raises
    ------
    SceneError
        If a parameter is of the wrong type or out of its range.

    Examples
    --------
    >>> cloud = wf.PhaseMix(wf.HenyeyGreenstein(0.85), wf.HenyeyGreenstein(-0.3), 0.2)
    >>> round(cloud.mean_cosine, 6)
    0.62
    """

    first: Parameter[PhaseFunction] = Parameter(as_phase)
    second: Parameter[PhaseFunction] = Parameter(as_phase)
    weight: Parameter[float] = Parameter(
        partial(number, holds=lambda x: 0 <= x <= 1, limit="in [0, 1]"), default=0.5
    )

    @property
    def mean_cosine(self) -> float:
        """The mean of cosθ."""
        return (1 - self.weight) * self.first.mean_cosine + self.weight * self.second.mean_cosine

    def p(self, cos: Floats) -> Floats:
        """Return the density (n,), 1/sr."""
        first = self.first.p(cos)
        return first + f4(self.weight) * (self.second.p(cos) - first)

    def sample(self, u: Floats) -> Floats:
        """Return cosθ (n,) of the second one where u is below the weight, else of the first."""
        weight, most = f4(self.weight), f4(LARGEST_BELOW_ONE)
        second = u < weight
        low = np.minimum(u / np.maximum(weight, f4(TINY)), most)
        high = np.minimum((u - weight) / np.maximum(f4(1) - weight, f4(TINY)), most)
        high = np.maximum(high, f4(0))
        return np.where(second, self.second.sample(low), self.first.sample(high))


def deflected(cos: Floats, u: Floats) -> Floats:
    """Return unit directions (3, n) at cosθ (n,) from +z, with the azimuth 2πu, u (n,)."""
    sin, along = sin_cos_turns(u)
    radius = np.sqrt((f4(1) - cos) * (f4(1) + cos))
    return np.stack([along * radius, sin * radius, cos])
