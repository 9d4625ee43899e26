"""Many spheres as one shape."""

from __future__ import annotations

from copy import copy
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from ..arrays.vec import Doubles
from ..core.suggestions import suggests_keywords
from ..materials import MaterialLike
from ..textures.parameter import Color
from .arrays import PrimitiveArray
from .base import Checked
from .colored import mapped_colors
from .mesh import positions
from .over_time import over_time
from .sphere_emission import SphereEmission


class Spheres(SphereEmission, PrimitiveArray):
    """Spheres, given by arrays: atoms, particles, points.

    Parameters
    ----------
    centers
        (n, 3) scene units; or (t, n, 3) for several times.
    radii
        (n,) or one number, scene units, above 0.
    colors
        (n, 3) RGB, or (n, 4) with opacity, one row per sphere. Floats are linear, in [0, 1]; uint8 and uint16
        are decoded from sRGB. A given material shows them by a parameter `VertexColors`.
    material
        The material of all of them: a `Material` or a `Bsdf`. By default a `Diffuse` that shows the `colors`,
        or is gray. The outside is the front.
    emission
        Radiance W·sr⁻¹·m⁻² of all spheres: a color, at least 0, or a texture, such as `VertexColors()` for
        the `colors`; it leaves the surfaces on both sides. By default that of the material, if it has one.
    name
        Used in messages.
    cmap, clim
        Then `colors` are numbers, one each, that a colormap of matplotlib shows, by its name, such as
        "viridis"; and the numbers at its ends, by default the least and the greatest.
    times
        (t,) seconds, rising, of centers that are given for several times; between them they move straight on.

    Raises
    ------
    SceneError
        If an argument is malformed or out of range, lengths differ, or there is no sphere.

    Examples
    --------
    >>> centers = np.random.default_rng(1).random((1000, 3))
    >>> particles = wf.Spheres(centers, 0.02, colors=centers)
    >>> wf.render(particles, spp=1, size=(16, 16), lighting="cloudy").shape
    (16, 16, 3)
    """

    centers = Checked(positions)
    _points = ("centers",)

    @suggests_keywords
    def __init__(
        self,
        centers: ArrayLike,
        radii: ArrayLike,
        colors: ArrayLike | None = None,
        *,
        material: MaterialLike | None = None,
        emission: Color | None = None,
        name: str = "spheres",
        cmap: Any = None,
        clim: ArrayLike | None = None,
        times: ArrayLike | None = None,
    ) -> None:
        self.name = name
        start, self.deformation = over_time(name, times, {"centers": centers})
        self.centers = start["centers"]
        super().__init__(radii, mapped_colors(name, colors, cmap, clim), material, name)
        self.emission = emission

    @property
    def count(self) -> int:
        """Number of spheres."""
        return len(self.centers)

    def lengths_times(self, factor: float) -> Self:
        """Return the shape with all lengths multiplied by `factor`."""
        spheres = copy(self)
        spheres.centers, spheres.radii = self.centers * factor, self.radii * factor
        return spheres

    @property
    def bounds(self) -> Doubles:
        """Lower and upper corner, (2, 3)."""
        radii = self.radii[:, None]
        return np.stack([(self.centers - radii).min(0), (self.centers + radii).max(0)])

    def hull(self) -> tuple[Doubles, Doubles]:
        """Return centers and radii."""
        return self.centers, np.broadcast_to(self.radii, self.count)
