"""The contract of every material.

Directions are in the local shading frame: z is the shading normal on the side of `wo`, so
`wo[2] > 0` always; `wi[2] > 0` is reflection and `wi[2] < 0` transmission. The renderer turns
the frame, so no material does. All arrays hold live columns only.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from copy import copy
from typing import Any, Self

import numpy as np

from ..errors import SceneError
from ..materials.alpha import Opacity, opacity
from ..materials.emission import Emission
from ..parameter import Parametrized, brief
from ..record import record
from ..sampling.warp import cosine_hemisphere, cosine_hemisphere_pdf
from ..state import SurfaceInteraction
from ..textures.base import BaseTexture
from ..textures.normal_map import BaseNormalMap
from ..textures.parameter import Scalar
from ..vec import Bools, Floats, broadcast


@record
class BsdfSample:
    """One sampled direction per column. A zero weight means that there is no sample."""

    wi: Floats  # (3, n) sampled direction, local frame
    weight: Floats  # (3, n) f(wo, wi)·|cosθi| / pdf
    pdf: Floats  # (n,) solid-angle density; of a delta lobe, the probability that it was chosen
    specular: Bools  # (n,) the direction came from a delta lobe
    eta: Floats | None = None  # (n,) ior beyond / ior before where light crosses, 1 elsewhere


class Bsdf(Parametrized, ABC):
    """A material: how a surface scatters light.

    A subclass gives `f`; it may give a `sample_f` and its `pdf` that follow `f` more closely than
    the cosine-weighted ones here. Parameters are attributes: constants of shape (3, 1) or (1,),
    or `BaseTexture` ones, which `bind` replaces by their values at the hit points.
    """

    transmissive: bool = False  # light can cross the surface
    dimensions: int = 2  # rows of u that sample_f reads
    specular: bool = False  # every lobe is a delta: f and pdf are 0, light sampling is skipped
    opacity: Opacity | None = None  # how much of the surface is there; None: all. The renderer sees to it
    absorption: Any = np.zeros((3, 1), np.float32)  # of the inside, per scene unit. The path sees to it
    emission: Emission | None = None  # what the surface sends itself. The shape that has it sees to it
    normal_map: BaseNormalMap | None = (
        None  # tilts the shading normals. The renderer sees to it, no material does
    )

    def __repr__(self) -> str:
        """Name the parameters, the alpha and the relief."""
        text = super().__repr__()
        if self.opacity is not None:
            cutoff = "" if self.opacity.cutoff is None else f", {self.opacity.cutoff:g}"
            text += f".with_alpha({brief(self.opacity.alpha)}{cutoff})"
        return text if self.normal_map is None else f"{text}.with_normal_map({self.normal_map!r})"

    @property
    def view_independent(self) -> bool:
        """Whether it looks alike from everywhere: no method reads wo, which is then not made ready."""
        return False

    @property
    def black(self) -> bool:
        """Whether it scatters nothing at all: paths end on lamps of it."""
        return False

    def with_alpha(self, alpha: Scalar, cutoff: float | None = None) -> Self:
        """Return this material for a surface that is only partly there.

        Parameters
        ----------
        alpha
            Part of the light that meets the surface, in [0, 1]: a number, or a `Texture` of one
            channel. The rest goes straight on as if there were nothing, and so do shadow rays.
        cutoff
            If given, the surface is all there where alpha is at least this, and nothing elsewhere.

        Raises
        ------
        SceneError
                If an argument is out of its range.
        """
        partly = copy(self)
        partly.opacity = opacity(type(self).__name__, alpha, cutoff)
        return partly

    def with_normal_map(self, normal_map: BaseNormalMap) -> Self:
        """Return this material with a `NormalMap` or `BumpMap`.

        Raises
        ------
        SceneError
            If it is something else.
        """
        if not isinstance(normal_map, BaseNormalMap):
            raise SceneError(f"relief must be a NormalMap or a BumpMap, got {normal_map!r}")
        carved = copy(self)
        carved.normal_map = normal_map
        return carved

    def scaled(self, factor: float) -> Self:
        """Return this material where lengths were multiplied by `factor`: itself if it has none."""
        normal_map = None if self.normal_map is None else self.normal_map.scaled(factor)
        absorbs = not isinstance(self.absorption, BaseTexture) and bool(np.any(self.absorption))
        if factor == 1 or not (absorbs or normal_map is not self.normal_map):
            return self
        other = copy(self)
        other.normal_map = normal_map
        if absorbs:  # no float32 is so large that it would make a light path of length 0 a NaN
            per_unit = np.asarray(self.absorption, np.float64) / factor
            other.absorption = np.minimum(per_unit, np.finfo(np.float32).max).astype(np.float32)
        return other

    def bind(self, surface: SurfaceInteraction) -> Self:
        """Return this material with its spatial parameters looked up at `surface` (n columns)."""
        varying = {name: value for name, value in vars(self).items() if isinstance(value, BaseTexture)}
        if not varying:
            return self
        bound = copy(self)
        for name, value in varying.items():
            vars(bound)[name] = value.at(surface)  # not by assignment, which would check it
        return bound

    @abstractmethod
    def f(self, wo: Floats, wi: Floats) -> Floats:
        """BSDF value without the cosine, (3, n), in 1/sr. Delta lobes contribute 0."""

    def pdf(self, wo: Floats, wi: Floats) -> Floats:
        """Solid-angle density with which `sample_f` draws `wi`, (n,). Delta lobes contribute 0."""
        return np.where(wo[2] > 0, cosine_hemisphere_pdf(wi), np.float32(0))

    def evaluate(self, wo: Floats, wi: Floats) -> tuple[Floats, Floats]:
        """Return `f` and `pdf` together, for materials where they share work."""
        return self.f(wo, wi), self.pdf(wo, wi)

    def sample_f(self, wo: Floats, u: Floats) -> BsdfSample:
        """Draw a direction per column from uniform numbers `u` (`dimensions`, n) in [0, 1)."""
        wi = cosine_hemisphere(u)
        pdf = self.pdf(wo, wi)
        return BsdfSample(wi, weigh(self.f(wo, wi), wi, pdf), pdf, broadcast(np.False_, len(pdf)))


def weigh(f: Floats, wi: Floats, pdf: Floats) -> Floats:
    """f·|cosθ|/pdf, and 0 (no sample) where the pdf is 0: (3, n)."""
    scale = np.abs(wi[2]) / np.where(pdf > 0, pdf, np.float32(1))
    return f * np.where(pdf > 0, scale, np.float32(0))


def evaluated(bsdf: Bsdf, wo: Floats, wi: Floats) -> tuple[Floats, Floats]:
    """Return f (3, n) and the pdf (n,) of a material.

    Raises
    ------
    SceneError
        If the material returns arrays of other shapes.
    """
    f, pdf = bsdf.evaluate(wo, wi)
    n = wi.shape[1]
    if np.shape(f) != (3, n) or np.shape(pdf) != (n,):
        _check_shapes(bsdf, n, {"f": (f, 3), "pdf": (pdf, None)})
    return f, pdf


def sampled(bsdf: Bsdf, wo: Floats, u: Floats) -> BsdfSample:
    """Return what a material samples for wo (3, n) with u (dimensions, n).

    Raises
    ------
    SceneError
        If the material returns arrays of other shapes than `BsdfSample` has.
    """
    out = bsdf.sample_f(wo, u[: bsdf.dimensions])
    n = wo.shape[1]
    if np.shape(out.wi) != (3, n) or np.shape(out.weight) != (3, n) or np.shape(out.pdf) != (n,):
        found = {"wi": (out.wi, 3), "weight": (out.weight, 3), "pdf": (out.pdf, None)}
        _check_shapes(bsdf, n, {f"sample_f's {name}": value for name, value in found.items()})
    return out


def _check_shapes(bsdf: Bsdf, n: int, found: dict[str, tuple[Any, int | None]]) -> None:
    for name, (array, rows) in found.items():
        wanted = (n,) if rows is None else (rows, n)
        if np.shape(array) != wanted:
            due = "(n,)" if rows is None else f"({rows}, n)"
            have = np.shape(array)
            raise SceneError(
                f"{type(bsdf).__name__}: {name} has the shape {have}; it must have {due} = {wanted}"
            )
