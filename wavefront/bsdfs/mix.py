"""A surface that is one material here and another there."""

from __future__ import annotations

from copy import copy
from typing import Any, Self

import numpy as np

from ..errors import SceneError
from ..parameter import Parameter
from ..state import SurfaceInteraction
from ..suggestions import suggests_keywords
from ..textures.parameter import Scalar, scalar
from ..vec import Floats, f4
from .base import Bsdf, BsdfSample, weigh

BELOW_1 = np.nextafter(f4(1), f4(0))


def _component(name: str, value: Any) -> Bsdf:
    """Return a material that can be a part of another."""
    if not isinstance(value, Bsdf):
        raise SceneError(f"{name} must be a material, got {value!r}")
    if value.opacity is not None:
        raise SceneError(f"{name} has an alpha; give it to the Mix, by with_alpha")
    if value.normal_map is not None:
        raise SceneError(f"{name} has a relief; give it to the Mix, by with_normal_map")
    if value.emission is not None:
        raise SceneError(f"{name} has an emission; give it to the shape")
    return value


class Mix(Bsdf):
    """A blend of two materials: (1 − weight)·first + weight·second.

    Parameters
    ----------
    first, second
        The materials; either may itself be a `Mix`.
    weight
        Part of the second, in [0, 1]: a number or a texture.

    The matter inside belongs to no point of the surface: its `absorption` is that of the part that
    lets light through. Where both do, they must absorb alike.

    Raises
    ------
    SceneError
        If the weight is outside [0, 1], something else than a material is given, a material has
        an alpha, a relief or an emission of its own, or both let light through but absorb differently.
    """

    dimensions = 3

    first = Parameter(_component)
    second = Parameter(_component)
    weight = Parameter(scalar)

    @suggests_keywords
    def __init__(self, first: Bsdf, second: Bsdf, weight: Scalar = 0.5) -> None:
        self.first, self.second = first, second
        self.weight = weight
        self.derive()

    def derive(self) -> None:
        """See what both materials come to."""
        self.transmissive = self.first.transmissive or self.second.transmissive
        self.specular = self.first.specular and self.second.specular
        self.absorption = _inside(self.first, self.second)

    def bind(self, surface: SurfaceInteraction) -> Self:
        """Look up the weight, and the parameters of both materials."""
        bound = copy(super().bind(surface))
        vars(bound).update(first=self.first.bind(surface), second=self.second.bind(surface))
        return bound

    def f(self, wo: Floats, wi: Floats) -> Floats:
        """Return the blended value, (3, n)."""
        return self._blend(self.first.f(wo, wi), self.second.f(wo, wi))

    def pdf(self, wo: Floats, wi: Floats) -> Floats:
        """Return the blended density, (n,)."""
        return self._blend(self.first.pdf(wo, wi), self.second.pdf(wo, wi))

    def evaluate(self, wo: Floats, wi: Floats) -> tuple[Floats, Floats]:
        """Return `f` and `pdf` of both materials, blended."""
        f1, pdf1 = self.first.evaluate(wo, wi)
        f2, pdf2 = self.second.evaluate(wo, wi)
        return self._blend(f1, f2), self._blend(pdf1, pdf2)

    def sample_f(self, wo: Floats, u: Floats) -> BsdfSample:
        """Choose a material by u[2], use the rest of u[2] again, and weigh by both.

        A sample of a delta lobe keeps its weight: the other material has no value there.
        """
        chance = np.broadcast_to(self.weight, wo[2].shape)
        second = u[2] < chance
        low = np.where(second, f4(0), chance)
        size = np.where(second, chance, f4(1) - chance)
        again = u.copy()
        again[2] = np.minimum((u[2] - low) / np.where(size > 0, size, f4(1)), BELOW_1)
        one, two = self.first.sample_f(wo, again), self.second.sample_f(wo, again)
        wi = np.where(second, two.wi, one.wi)
        specular = np.where(second, two.specular, one.specular)
        chosen = np.where(second, two.pdf, one.pdf)
        f, density = self.evaluate(wo, wi)
        pdf = np.where(specular, chosen * size, np.where(chosen > 0, density, f4(0)))
        weight = np.where(specular, np.where(second, two.weight, one.weight), weigh(f, wi, pdf))
        eta = _eta(one, two, second) if self.transmissive else None
        return BsdfSample(wi, weight, pdf, specular, eta)

    def _blend(self, first: Floats, second: Floats) -> Floats:
        return first + (second - first) * self.weight


def _inside(first: Bsdf, second: Bsdf) -> Any:
    """Return the absorption of the matter behind a mixture."""
    clear = [part.absorption for part in (first, second) if part.transmissive]
    if len(clear) == 2 and not np.array_equal(*clear):
        a, b = (np.ravel(value).tolist() for value in clear)
        raise SceneError(
            f"Mix first has the absorption {a}, second {b}; where both let light through, "
            "they must absorb alike"
        )
    return clear[0] if clear else Bsdf.absorption


def _eta(one: BsdfSample, two: BsdfSample, second: np.ndarray) -> Floats:
    """Relative index of the chosen samples, (n,)."""
    ones = np.ones_like(one.pdf)
    return np.where(second, ones if two.eta is None else two.eta, ones if one.eta is None else one.eta)
