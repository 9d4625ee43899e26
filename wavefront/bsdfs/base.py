"""The contract of every BSDF.

Directions are in the local shading frame: z is the shading normal on the side of `wo`, so
`wo[2] > 0` always; `wi[2] > 0` is reflection and `wi[2] < 0` transmission. The renderer turns
the frame, so no BSDF does. All arrays hold live columns only.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from copy import copy
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike

from ..arrays.soa import soa
from ..arrays.state import SurfaceInteraction
from ..arrays.vec import Bools, Floats, broadcast
from ..core.errors import SceneError
from ..core.html import preview_html
from ..core.parameter import Parametrized, instance_of
from ..sampling.warp import cosine_hemisphere, cosine_hemisphere_pdf
from ..textures.base import BaseTexture

# (16, 3), evenly spread (M. Roberts 2018, "The Unreasonable Effectiveness of Quasirandom Sequences", d = 3)
ALBEDO_NUMBERS = ((0.5 + np.arange(16)[:, None] * 1.2207440846057596 ** -np.arange(1.0, 4.0)) % 1).astype(
    np.float32
)


@soa
class BsdfSample:
    """One sampled direction per column. A zero weight means that there is no sample.

    Examples
    --------
    >>> wi = wf.warp.cosine_hemisphere(np.full((2, 5), 0.5, np.float32))
    >>> pdf = wf.warp.cosine_hemisphere_pdf(wi)
    >>> sample = wf.BsdfSample(wi, np.full((3, 5), 0.8, np.float32), pdf, np.zeros(5, bool))
    >>> sample.wi.shape
    (3, 5)
    """

    wi: Floats  # (3, n) sampled direction, local frame
    weight: Floats  # (3, n) f(wo, wi)·|cosθi| / pdf
    pdf: Floats  # (n,) solid-angle density; of a delta lobe, the probability that it was chosen
    specular: Bools  # (n,) the direction came from a delta lobe
    eta: Floats | None = None  # (n,) ior beyond / ior before where light crosses, 1 elsewhere


class Bsdf(Parametrized, ABC):
    """The scattering function (BSDF) of a surface. A `Material` has one, and all else about the surface.

    A subclass defines `f`. It may also define `sample_f` and `pdf`, which should follow `f` more closely than
    the cosine-weighted ones here. Parameters are attributes: constants of shape (3, 1) or (1,),
    or `BaseTexture` ones, which `bind` replaces by their values at the hit points.

    Examples
    --------
    >>> class Lambert(wf.Bsdf):
    ...     def f(self, wo, wi):
    ...         return np.where(wi[2] > 0, np.float32(0.5 / np.pi), np.float32(0)) * np.ones_like(wi)
    >>> ball = wf.Sphere((0, 0, 0), 1, material=Lambert())
    >>> wf.render([ball, wf.Environment(1)], spp=1, size=(8, 8)).shape
    (8, 8, 3)
    """

    transmissive: bool = False  # light can cross the surface
    dispersive: bool = False  # the indices of refraction of the channels differ
    invisible: bool = False  # light passes as if there were no surface
    catches_shadows: bool = False  # the camera sees only shadows on it
    dimensions: int = 2  # rows of u that sample_f reads
    indices: ClassVar[tuple[str, ...]] = ()  # parameters that are indices of refraction inside
    specular: bool = False  # every lobe is a delta: f and pdf are 0, light sampling is skipped
    back_facing: Bools | None = None  # (n,) wo is on the back, for some that are bound; unbound, on the front

    def _repr_html_(self) -> str:
        """Show a ball in a notebook."""
        return preview_html(self)

    def plot(self, wo: ArrayLike = (0.6, 0.0, 0.8), axes: Any = None) -> Any:
        """Draw f, f times the cosine, and the density with which directions are drawn, seen from a direction.

        The curves are polar, in the plane of `wo` and the normal, which points up. Directions below cross the
        surface. Of f it is the luminance. Delta lobes have no curve.

        Parameters
        ----------
        wo
            (3,) direction to the viewer, in the local frame, whose z is the normal.
        axes
            Polar axes of matplotlib; None for new ones, which are returned.

        Raises
        ------
        SceneError
            If `wo` is below the surface, or a parameter is a texture.
        ImportError
            If matplotlib is not installed.
        """
        from .plot import draw_lobes  # here, as it needs matplotlib

        return draw_lobes(self, wo, axes)

    @property
    def view_independent(self) -> bool:
        """True if no method uses wo, which is then not computed."""
        return False

    @property
    def encloses(self) -> bool:
        """True if light that crosses the surface is inside of something else: not if it is a sheet."""
        return self.transmissive and not getattr(self, "thin", False)

    @property
    def index_inside(self) -> Any:
        """Index of refraction inside the surface, an array or a texture; None if it has none."""
        return getattr(self, "ior", None)

    @property
    def lambertian(self) -> bool:
        """True if f is albedo/π and the pdf is cosθ/π above the surface; then both follow from cosines."""
        return False

    @property
    def black(self) -> bool:
        """True if the surface scatters nothing: paths end on it."""
        return False

    def bind(self, surface: SurfaceInteraction) -> Self:
        """Return this BSDF with its spatial parameters looked up at `surface` (n columns).

        Its `indices` are then relative to the index of refraction around the surface.
        """
        parameters = {
            name: value.at(surface) for name, value in vars(self).items() if isinstance(value, BaseTexture)
        }
        if surface.index_around is not None and self.encloses:
            for name in self.indices:
                parameters[name] = parameters.get(name, getattr(self, name)) / surface.index_around
        if not parameters:
            return self
        bound = copy(self)
        vars(bound).update(parameters)  # not by assignment, which would check them
        return bound

    def albedo(self, wo: Floats) -> Floats:
        """Fraction of the light from `wo` that is scattered, per channel: (3, n), or (3, 1) if all are equal.

        The change of radiance by refraction does not count. The AOVs `albedo` and `denoising_albedo` show the
        albedo. Here it is the mean weight of 16 samples.
        """
        total = np.zeros_like(wo)
        for u in ALBEDO_NUMBERS:
            numbers = np.broadcast_to(u[: self.dimensions, None], (self.dimensions, wo.shape[1]))
            sample = self.sample_f(wo, numbers)
            total += sample.weight if sample.eta is None else sample.weight * sample.eta**2
        return total / np.float32(len(ALBEDO_NUMBERS))

    @abstractmethod
    def f(self, wo: Floats, wi: Floats) -> Floats:
        """BSDF value without the cosine, (3, n), in 1/sr. Delta lobes contribute 0."""

    def pdf(self, wo: Floats, wi: Floats) -> Floats:
        """Solid-angle density with which `sample_f` draws `wi`, (n,). Delta lobes contribute 0."""
        return np.where(wo[2] > 0, cosine_hemisphere_pdf(wi), np.float32(0))

    def evaluate(self, wo: Floats, wi: Floats) -> tuple[Floats, Floats]:
        """Return `f` and `pdf` together; `JointBsdf` is for BSDFs where they share work."""
        return self.f(wo, wi), self.pdf(wo, wi)

    def sample_f(self, wo: Floats, u: Floats) -> BsdfSample:
        """Draw a direction per column from uniform numbers `u` (`dimensions`, n) in [0, 1)."""
        wi = cosine_hemisphere(u)
        pdf = self.pdf(wo, wi)
        return BsdfSample(wi, weigh(self.f(wo, wi), wi, pdf), pdf, broadcast(np.False_, len(pdf)))


class JointBsdf(Bsdf):
    """A BSDF whose value and density share work: a subclass gives `evaluate` in place of `f` and `pdf`."""

    def f(self, wo: Floats, wi: Floats) -> Floats:
        """Return the first part of `evaluate`, (3, n)."""
        return self.evaluate(wo, wi)[0]

    def pdf(self, wo: Floats, wi: Floats) -> Floats:
        """Return the second part of `evaluate`, (n,)."""
        return self.evaluate(wo, wi)[1]

    @abstractmethod
    def evaluate(self, wo: Floats, wi: Floats) -> tuple[Floats, Floats]:
        """Return `f` (3, n) and `pdf` (n,); 0 for delta lobes."""


def weigh(f: Floats, wi: Floats, pdf: Floats) -> Floats:
    """f·|cosθ|/pdf, and 0 (no sample) where the pdf is 0: (3, n)."""
    scale = np.abs(wi[2]) / np.where(pdf > 0, pdf, np.float32(1))
    return f * np.where(pdf > 0, scale, np.float32(0))


def evaluated(bsdf: Bsdf, wo: Floats, wi: Floats) -> tuple[Floats, Floats]:
    """Return f (3, n) and the pdf (n,) of a BSDF.

    Raises
    ------
    SceneError
        If the BSDF returns arrays of other shapes.
    """
    f, pdf = bsdf.evaluate(wo, wi)
    n = wi.shape[1]
    if np.shape(f) != (3, n) or np.shape(pdf) != (n,):
        _check_shapes(bsdf, n, {"f": (f, 3), "pdf": (pdf, None)})
    return f, pdf


def sampled(bsdf: Bsdf, wo: Floats, u: Floats) -> BsdfSample:
    """Return the samples of a BSDF for wo (3, n) with u (dimensions, n).

    Raises
    ------
    SceneError
        If the BSDF returns arrays of other shapes than `BsdfSample` has.
    """
    out = bsdf.sample_f(wo, u[: bsdf.dimensions])
    n = wo.shape[1]
    if np.shape(out.wi) != (3, n) or np.shape(out.weight) != (3, n) or np.shape(out.pdf) != (n,):
        arrays = {"wi": (out.wi, 3), "weight": (out.weight, 3), "pdf": (out.pdf, None)}
        _check_shapes(bsdf, n, {f"sample_f's {name}": value for name, value in arrays.items()})
    return out


def albedo_of(bsdf: Bsdf, wo: Floats) -> Floats:
    """Return the albedo of a BSDF (3, n), limited to [0, 1]; NaN where it is not finite.

    Raises
    ------
    SceneError
        If the BSDF returns an array of another shape.
    """
    albedo, n = bsdf.albedo(wo), wo.shape[1]
    if np.shape(albedo) not in ((3, n), (3, 1)):
        _check_shapes(bsdf, n, {"albedo": (albedo, 3)})
    limited = np.clip(albedo, np.float32(0), np.float32(1))
    if not np.isfinite(albedo).all():
        limited[~np.isfinite(albedo)] = np.nan
    return np.broadcast_to(limited, (3, n))


def _check_shapes(bsdf: Bsdf, n: int, arrays: dict[str, tuple[Any, int | None]]) -> None:
    for name, (array, rows) in arrays.items():
        wanted = (n,) if rows is None else (rows, n)
        if np.shape(array) != wanted:
            due = "(n,)" if rows is None else f"({rows}, n)"
            have = np.shape(array)
            raise SceneError(
                f"{type(bsdf).__name__}: {name} has the shape {have}; it must have {due} = {wanted}"
            )


is_bsdf = instance_of(Bsdf, "a Bsdf such as wf.Diffuse(0.5)")
