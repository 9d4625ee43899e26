"""The contract of every light.

A light record holds k lights of one kind, a column each (`SoA`). The methods work on n
lanes: on a record with one column that is shared by all lanes, or on one that `take` gathered to
a column per lane. Positions are relative to the scene's center. Every pdf is in solid angle.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import finite_array
from ..parameter import Parametrized
from ..record import record
from ..state import SoA
from ..vec import Floats, f4, positive

LEAST_SQUARE = f4(1e-35)  # added to squared distances before their root, so that nothing is divided by 0
EDGE_ON = f4(1e-14)  # taken off cosines that are divided by; smaller ones count as those of a dark side


@record
class LightSample(SoA):
    """Light arriving at a point from one sampled direction. A pdf of 0 means no sample."""

    wi: Floats  # (3, n) unit direction from the point to the light
    radiance: Floats  # (3, n) W·sr⁻¹·m⁻² (of a delta light: irradiance per unit cosine)
    pdf: Floats  # (n,) solid-angle density, 1/sr (of a delta light: 1)
    distance: Floats  # (n,) to the sampled point, scene units; inf for a light at infinity
    cos_light: Floats  # (n,) cosine between the ray and the light's normal; 1 where it has none


class Light(SoA, ABC):
    """k lights of one kind."""

    __slots__ = ()
    delta: ClassVar[bool] = False  # no BSDF sample can meet it: its samples take no MIS weight

    @abstractmethod
    def sample_li(self, point: Floats, u: Floats) -> LightSample:
        """Sample a direction from points (3, n) to the light with u (2, n)."""

    @abstractmethod
    def pdf_li(self, point: Floats, wi: Floats) -> Floats:
        """Density with which `sample_li` draws wi (3, n), (n,); 0 where the ray misses the light."""

    @abstractmethod
    def le(self, wi: Floats) -> Floats:
        """Radiance (3, n) carried against wi by rays that meet the light; 0 from a side that is dark."""

    @abstractmethod
    def power(self, scene_radius: float) -> NDArray[np.float64]:
        """Estimate the emitted power of each light, (k,), the mean of the channels, W."""

    def irradiance(
        self, center: NDArray[np.float64], radius: float, scene_radius: float
    ) -> NDArray[np.float64]:
        """Estimate what each light brings to balls of space, W/m²; it guides the choice of a light.

        Parameters
        ----------
        center
            (3, c) centers of the balls.
        radius
            Their radius, scene units.
        scene_radius
            Radius of the scene's bounding sphere.

        Returns
        -------
        (c, k) irradiance, the mean of the channels. Here: that of a light which shines on the whole
        scene alike.
        """
        irradiance = self.power(scene_radius) / (4 * np.pi * max(scene_radius, 1e-30) ** 2)
        return np.broadcast_to(irradiance, (center.shape[1], len(irradiance)))


def position(name: str, value: ArrayLike) -> NDArray[np.float64]:
    """Return where a light stands, (3,) scene units."""
    return finite_array(name, value, (3,))


class UserLight(Parametrized, ABC):
    """A light as a user makes it, beside the shapes of a scene."""

    def scaled(self, factor: float) -> UserLight:
        """Return the light for a scene whose lengths were multiplied by `factor`: itself if it has none."""
        return self

    @abstractmethod
    def record(self, center: NDArray[np.float64]) -> Light:
        """Return the light as a record of one column, relative to `center` (3,)."""


def area_pdf(d2: Floats, cos_light: Floats, area: Floats) -> Floats:
    """Solid-angle density d²/(A·cosθ) of points drawn uniformly from an area; 0 on a dark side; (n,).

    Parameters
    ----------
    d2
        (n,) squared distances of the points.
    cos_light
        (n,) cosines at the points, above 0 on a side that shines.
    area
        (n,) or (1,).
    """
    return positive(d2 / ((cos_light - EDGE_ON) * area))


def facing_area(
    center: NDArray[np.float64],
    radius: float,
    middle: Floats,
    normal: Floats,
    size: Floats,
    strength: NDArray[np.float64],
    sides: int,
) -> NDArray[np.float64]:
    """Irradiance at most that areas bring to balls of space, (c, k).

    Parameters
    ----------
    center, radius
        (3, c) and scalar: the balls.
    middle, normal, size, strength
        (3, k), (3, k), (k,), (k,): the areas' middle, front normal, width, and radiance times area.
    sides
        1 if they shine from the front only, else 2.
    """
    away = center[:, :, None] - middle[:, None, :]
    height = (away * normal[:, None, :]).sum(0)
    height = np.maximum((height if sides == 1 else np.abs(height)) + radius + size, 0)
    distance = np.sqrt(np.maximum((away**2).sum(0), np.maximum(size, radius) ** 2))
    return strength * np.minimum(height / distance, 1) / distance**2
