"""The contract of light samplers, which choose one light for each point."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable
from typing import Protocol, TypeAlias

from ..arrays.vec import Doubles, Floats, Ints
from .base import Emitters, Receiver


class LightSampler(Protocol):
    """Base class of light samplers, which choose a light for each point.

    Examples
    --------
    >>> class First(wf.LightSampler):
    ...     def __init__(self, power, half_size, irradiance):
    ...         pass
    ...     def sample(self, point, u):
    ...         return np.zeros(len(u), np.intp), np.ones(len(u), np.float32)
    ...     def pmf(self, light, point):
    ...         return (light == 0).astype(np.float32)
    >>> scene = [wf.Sphere((0, 0, 0), 1), wf.PointLight((0, 3, 3), 20)]
    >>> wf.render(scene, spp=1, size=(8, 8), light_sampler=First).shape
    (8, 8, 3)
    """

    takes_receiver: bool = False  # whether `lighting` is another sampler

    @abstractmethod
    def sample(self, point: Floats, u: Floats) -> tuple[Ints, Floats]:
        """Return a light (n,) for each point (3, n) from u (n,), and its probability (n,)."""

    @abstractmethod
    def pmf(self, light: Ints, point: Floats) -> Floats:
        """Probability (n,) that `light` (n,) is chosen at points (3, n)."""

    def lighting(self, receiver: Receiver) -> LightSampler:
        """Return the sampler for n surfaces that are lit; here: as it is.

        Its `sample` and `pmf` may choose by the normal of each surface. A sampler that does so says it by
        `takes_receiver`.
        """
        return self


class Irradiance(Protocol):
    """The irradiance by each light in parts of the scene, and the places of lights."""

    @property
    def emitters(self) -> Emitters:
        """Where the lights are; NaN for those that are nowhere."""

    def __call__(self, center: Doubles, radius: float, /) -> Doubles:
        """Return a bound on the irradiance (c, k) by each light within `radius` of points `center` (3, c)."""


# Called with the power (k,) of each light, all above 0; half of the scene's extent (3,), whose middle is the
# origin; and the lights' irradiance. All lengths are scene units.
LightSamplerMaker: TypeAlias = Callable[[Doubles, Doubles, Irradiance], LightSampler]
