"""Materials that were measured."""

from __future__ import annotations

import math
import os
from abc import ABC, abstractmethod
from functools import partial
from typing import Any, Self

import numpy as np

from ..arrays.elementary import arcsin, arctan2, sin_cos, sin_cos_turns
from ..arrays.vec import INV_TWO_PI, TINY, Floats, broadcast, dot, f4, normalize
from ..codecs.measured import MERL_SHAPE, MOST_BYTES, AdaptiveTables, parsed_measurement
from ..core.errors import SceneError
from ..core.files import path_name, read_bytes
from ..core.parameter import Parameter
from ..sampling.bilinear import ALONE, Bilinear, BilinearDensity, Mix, between, product
from ..textures.base import BaseTexture
from ..textures.parameter import Scalar, scalar
from .base import BsdfSample, JointBsdf, weigh
from .microfacet import reflect
from .rough import Tangent

LEAST_STRETCH = f4(1e-6)
HALF_PI, TWO_OVER_PI, TWO_PI_SQUARED = f4(math.pi / 2), f4(2 / math.pi), f4(2 * math.pi**2)
UP = np.array([[0], [0], [1]], f4)
ANGLES, AZIMUTHS, TILTS = 33, 65, 91  # nodes of the densities of MERL's materials
SPREAD = 0.05  # part of their samples that have no regard for the values


class Measured(JointBsdf):
    """A measured material, from a file of the RGL database (.bsdf) or of the MERL database (.binary).

    Values of MERL are reciprocal; those of RGL are so up to the measurement. Measured materials may reflect
    more light than they get, at grazing angles. They scatter on both sides.

    Sources: J. Dupuy and W. Jakob 2018, "An Adaptive Parameterization for Efficient Material Acquisition and
    Rendering", also for sampling; W. Matusik et al. 2003, "A Data-Driven Reflectance Model".

    Parameters
    ----------
    path
        The file; its kind is told by its first bytes. Spectra become colors under D65, and those out of
        gamut are clipped.
    rotation
        Degrees by which an anisotropic material is turned from the direction of growing u of the texture
        coordinates towards v: a number or a texture.

    Raises
    ------
    SceneError
        If the file is missing, larger than 1 GiB, or damaged. The message names the field.

    Examples
    --------
    >>> # a table in MERL's form: by the angles of the half vector, and of light from it and about it
    >>> gloss = 5000 * np.exp(-np.linspace(0, 5, 90)[:, None, None] ** 2)
    >>> table = 300 + np.broadcast_to(gloss, (3, 90, 90, 180))
    >>> file = np.array([90, 90, 180], "<i4").tobytes() + table.tobytes()
    >>> varnish = wf.Measured.from_bytes("varnish.binary", file)  # or wf.Measured("varnish.binary")
    """

    rotation: Parameter[Scalar] = Parameter(partial(scalar, holds=np.isfinite, limit="finite"))

    def __init__(self, path: str | os.PathLike[str], *, rotation: Scalar = 0.0) -> None:
        self._fill(path_name(path), read_bytes(path, MOST_BYTES), rotation)

    @classmethod
    def from_bytes(cls, name: str, data: bytes) -> Self:
        """Return the material of a file's content; the name is that of messages."""
        made = cls.__new__(cls)
        made._fill(name, data, 0.0)
        return made

    def _fill(self, name: str, data: bytes, rotation: Scalar) -> None:
        tables = parsed_measurement(name, data)
        self.path = name
        try:
            self.data = _Adaptive(tables) if isinstance(tables, AdaptiveTables) else _Merl(tables)
        except SceneError as error:
            raise SceneError(f"{name}: {error}") from error
        self.rotation = rotation
        self.derive()

    def derive(self) -> None:
        """Set the tangent of an anisotropic material."""
        self.tangent: Any = Tangent(self.rotation) if self.data.mirrors else None

    def evaluate(self, wo: Floats, wi: Floats) -> tuple[Floats, Floats]:
        """Return f (3, n) and the pdf (n,), 0 below the surface."""
        lit = (wo[2] > 0) & (wi[2] > 0)
        axes = self._axes(wo)
        f, pdf = self.data.evaluate(*(_turned(np.where(lit, w, UP), axes) for w in (wo, wi)))
        return np.where(lit, f, f4(0)), np.where(lit, pdf, f4(0))

    def sample_f(self, wo: Floats, u: Floats) -> BsdfSample:
        """Return reflections at normals that are sampled by the tables."""
        axes = self._axes(wo)
        cos, sin, flip_x, flip_y = axes
        seen = _turned(wo, axes)
        x, y, z = reflect(seen, self.data.normals(seen, u))
        x, y = x * flip_x, y * flip_y
        wi = normalize(np.stack([x * cos - y * sin, y * cos + x * sin, z]))
        f, pdf = self.evaluate(wo, wi)
        return BsdfSample(wi, weigh(f, wi, pdf), pdf, broadcast(np.False_, len(pdf)))

    def _axes(self, wo: Floats) -> tuple[Floats, ...]:
        """Return cosine and sine of the azimuth of the tables' x axis, and the signs of axes, each (n,).

        Isotropic tables are for views along x. Others may leave out half or three quarters of the views.
        """
        if not self.data.mirrors:
            size = np.sqrt(wo[0] * wo[0] + wo[1] * wo[1])
            scale = f4(1) / np.where(size > 0, size, f4(1))
            one = np.ones_like(size)
            return np.where(size > 0, wo[0] * scale, one), wo[1] * scale, one, one
        one = np.ones_like(wo[0])
        unbound = self.tangent is None or isinstance(self.tangent, BaseTexture)
        cos, sin = (one, one * f4(0)) if unbound else self.tangent
        x, y = wo[0] * cos + wo[1] * sin, wo[1] * cos - wo[0] * sin
        flip_y = np.where(np.signbit(y), one, -one) if self.data.mirrors > 1 else one
        flip_x = np.where(x > 0, -one, one) if self.data.mirrors == 4 else flip_y
        return cos, sin, flip_x, flip_y


def _turned(w: Floats, axes: tuple[Floats, ...]) -> Floats:
    """Return directions (3, n) along the axes of the tables."""
    cos, sin, flip_x, flip_y = axes
    return np.stack([(w[0] * cos + w[1] * sin) * flip_x, (w[1] * cos - w[0] * sin) * flip_y, w[2]])


def _elevation(a: Floats, b: Floats) -> Floats:
    """Return the angles (n,) between unit vectors at most 90° apart, accurate for small ones."""
    off = a - b
    return f4(2) * arcsin(np.minimum(f4(0.5) * np.sqrt(dot(off, off)), f4(1)))


def _coordinates(w: Floats, theta: Floats) -> Floats:
    """Return the points of the square (2, n) of directions: by the root of the angle, and by the azimuth."""
    return np.stack([np.sqrt(theta * TWO_OVER_PI), arctan2(w[1], w[0]) * INV_TWO_PI + f4(0.5)])


def _normals_at(p: Floats) -> Floats:
    """Return the directions (3, n) at points of the square (2, n)."""
    sin, cos = sin_cos(p[0] * p[0] * HALF_PI)
    up, along = sin_cos_turns(p[1] - f4(0.5))
    return np.stack([along * sin, up * sin, cos])


def _stretch(p: Floats, m: Floats) -> Floats:
    """Return solid angle of normals per area of the square (n,)."""
    return TWO_PI_SQUARED * p[0] * np.sqrt(m[0] * m[0] + m[1] * m[1])


class _Tables(ABC):
    """Values and densities by the normals that mirror wo to wi."""

    mirrors = 0  # of tables by azimuth, the parts of the circle of which they have one; 0: isotropic
    density: BilinearDensity  # of normals
    before: BilinearDensity | None = None  # of the numbers from which normals are sampled

    @abstractmethod
    def mix(self, wo: Floats) -> Mix:
        """Return the slices for views wo (3, n)."""

    @abstractmethod
    def value(self, wo: Floats, wi: Floats, m: Floats, at: Floats, number: Floats, mix: Mix) -> Floats:
        """Return f (3, n), where `number` (2, n) is sampled to the point `at` of the normals m."""

    def normals(self, wo: Floats, u: Floats) -> Floats:
        """Return normals (3, n) for u (2, n)."""
        mix = self.mix(wo)
        return _normals_at(self.density.sample(u if self.before is None else self.before.sample(u, mix), mix))

    def evaluate(self, wo: Floats, wi: Floats) -> tuple[Floats, Floats]:
        """Return f (3, n) and the density of wi (n,), all above the surface."""
        m, mix = normalize(wo + wi), self.mix(wo)
        at = _coordinates(m, _elevation(m, UP))
        number, pdf = self.density.inverse(at, mix)
        if self.before is not None:
            pdf = pdf * self.before.values.at(number, mix)
        pdf = pdf / (np.maximum(_stretch(at, m), LEAST_STRETCH) * f4(4) * np.maximum(dot(wo, m), TINY))
        return self.value(wo, wi, m, at, number, mix), pdf


class _Adaptive(_Tables):
    """The tables of the RGL database."""

    def __init__(self, tables: AdaptiveTables) -> None:
        self.phi, self.theta = tables.phi, tables.theta
        if len(self.phi) > 1:
            self.mirrors = max(round(2 * math.pi / float(self.phi[-1] - self.phi[0])), 1)
        self.density, self.before = BilinearDensity(tables.vndf), BilinearDensity(tables.luminance)
        self.rgb, self.by_normals = Bilinear(tables.rgb), tables.by_normals
        self.ndf, self.sigma = Bilinear(tables.ndf), Bilinear(tables.sigma)

    def mix(self, wo: Floats) -> Mix:
        theta = between(self.theta, _elevation(wo, UP))
        return (
            product(between(self.phi, arctan2(wo[1], wo[0])), theta, len(self.theta))
            if self.mirrors
            else theta
        )

    def value(self, wo: Floats, wi: Floats, m: Floats, at: Floats, number: Floats, mix: Mix) -> Floats:
        scale = f4(1) / wi[2]
        if self.by_normals:
            sigma = self.sigma.at(_coordinates(wo, _elevation(wo, UP)))
            scale = scale * np.where(sigma > 0, self.ndf.at(at) / (f4(4) * np.maximum(sigma, TINY)), f4(0))
        return self.rgb.at(number, mix) * scale


class _Merl(_Tables):
    """A table of the MERL database, linear between the centers of its cells."""

    def __init__(self, values: Floats) -> None:
        # φd has the period π, so that a column of the other end stands at either end
        self.nodes = np.arange(MERL_SHAPE[0], dtype=f4) + f4(0.5)
        self.values = Bilinear(np.concatenate([values[..., -1:], values, values[..., :1]], -1))
        self.theta = np.linspace(0, math.pi / 2 * 0.999, ANGLES).astype(f4)
        p = np.stack(np.meshgrid(np.linspace(0, 1, TILTS), np.linspace(0, 1, AZIMUTHS))).astype(f4)
        at = p.reshape(2, -1)
        m, tables = _normals_at(at), []
        for angle in self.theta:
            sin, cos = sin_cos(angle)
            wo = np.stack([broadcast(component, m.shape[1]) for component in (sin, f4(0), cos)])
            wi = reflect(wo, m)
            wi[2] = np.maximum(wi[2], f4(0))
            lit = wi[2] * dot(wo, m) > 0
            light = _stretch(at, m) * dot(wo, m) * wi[2] * self.value(wo, wi, m, at, at, ALONE).mean(0)
            tables.append(np.where(lit, light, f4(0)))
        even = _stretch(at, m)
        rows = np.stack(tables).astype(np.float64)
        rows += even * (SPREAD * np.maximum(rows.mean(1, keepdims=True), TINY) / even.mean())
        self.density = BilinearDensity(rows.reshape(ANGLES, AZIMUTHS, TILTS))

    def mix(self, wo: Floats) -> Mix:
        return between(self.theta, _elevation(wo, UP))

    def value(self, wo: Floats, wi: Floats, m: Floats, at: Floats, number: Floats, mix: Mix) -> Floats:
        """Return f by the angles of m from the normal, and of wi from m and about it."""
        size = np.sqrt(m[0] * m[0] + m[1] * m[1])
        scale = f4(1) / np.where(size > 0, size, f4(1))
        x, y = np.where(size > 0, m[0] * scale, f4(1)), m[1] * scale
        along = wi[0] * (x * m[2]) + wi[1] * (y * m[2]) - wi[2] * size
        turn = (
            arctan2(wi[1] * x - wi[0] * y, along) * f4(2) * INV_TWO_PI
        )  # in half turns, of which each is alike
        _, tilts, azimuths = MERL_SHAPE
        across = (turn - np.floor(turn)) * f4(azimuths) + f4(0.5)
        up = _elevation(wi, m) * (TWO_OVER_PI * f4(tilts)) - f4(0.5)
        slices = between(self.nodes, at[0] * f4(MERL_SHAPE[0]))
        return self.values.at(np.stack([across / f4(azimuths + 1), up / f4(tilts - 1)]), slices)
