"""Many cylinders or capsules as one shape: bonds, sticks, streamlines, wireframes."""

from __future__ import annotations

from copy import copy
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from ..arrays.elementary import sin_cos_turns
from ..arrays.frame import Frame
from ..arrays.vec import Doubles
from ..core.errors import SceneError, flag
from ..core.plural import plural
from ..core.suggestions import suggests_keywords
from ..materials import MaterialLike
from .arrays import PrimitiveArray
from .base import Checked
from .colored import mapped_colors
from .mesh import positions
from .over_time import over_time

HULL_SIDES = 16  # of the polygons about the ends of cylinders


class SegmentArray(PrimitiveArray):
    """Base class of `Cylinders` and `Capsules`, which have a radius about a segment each.

    Attributes
    ----------
    starts, ends
        (n, 3) the ends of the segments, scene units.
    caps
        Whether the surface is closed at the ends.
    """

    starts, ends = Checked(positions), Checked(positions)
    caps = True
    _points = "starts", "ends"

    def __init__(
        self,
        starts: ArrayLike,
        ends: ArrayLike,
        radii: ArrayLike,
        colors: ArrayLike | None,
        material: MaterialLike | None,
        name: str,
        times: ArrayLike | None,
    ) -> None:
        self.name = name
        first, self.deformation = over_time(name, times, {"starts": starts, "ends": ends})
        self.starts, self.ends = first["starts"], first["ends"]
        super().__init__(radii, colors, material, name)

    @property
    def count(self) -> int:
        """Number of primitives."""
        return len(self.starts)

    def check(self) -> None:
        """Check the arrays against each other; they may have been assigned one by one.

        Raises
        ------
        SceneError
            If there is no primitive, or an array does not have one row for each.
        """
        if len(self.starts) != len(self.ends):
            starts, ends = plural(len(self.starts), "start"), plural(len(self.ends), "end")
            raise SceneError(f"{self.name}: has {starts} and {ends}")
        super().check()

    def lengths_times(self, factor: float) -> Self:
        """Return the shape with all lengths multiplied by `factor`."""
        shape = copy(self)
        shape.starts, shape.ends = self.starts * factor, self.ends * factor
        shape.radii = self.radii * factor
        return shape

    @property
    def bounds(self) -> Doubles:
        """Lower and upper corner, (2, 3)."""
        reach = self._reach()
        low = np.minimum(self.starts, self.ends) - reach
        return np.stack([low.min(0), (np.maximum(self.starts, self.ends) + reach).max(0)])

    def hull(self) -> tuple[Doubles, Doubles]:
        """Return balls about both ends."""
        radii = np.broadcast_to(self.radii, self.count)
        return np.concatenate([self.starts, self.ends]), np.tile(radii, 2)

    def _reach(self) -> Doubles:
        """Return how far the surfaces reach beyond the ends of the segments, (n, 3) or (n, 1)."""
        return self.radii[:, None]


class Cylinders(SegmentArray):
    """Cylinders, given by arrays of the centers of their two ends.

    Parameters
    ----------
    starts, ends
        (n, 3) centers of both ends, scene units.
    radii
        (n,) or one number, scene units, above 0.
    colors
        (n, 3) RGB, or (n, 4) with opacity, one row per cylinder, as of `Spheres`.
    caps
        Whether the ends are closed. An open cylinder is a tube without thickness.
    material
        The material of all of them: a `Material` or a `Bsdf`. By default a `Diffuse` that shows the `colors`,
        or is gray. The outside is the front. Cylinders cannot emit light.
    name
        Used in messages.
    cmap, clim
        Then `colors` are numbers, one each, that a colormap of matplotlib shows, by its name, such as
        "viridis"; and the numbers at its ends, by default the least and the greatest.
    times
        (t,) seconds, rising, of starts or ends (t, n, 3) that are given for several times; between them they
        move straight on.

    Raises
    ------
    SceneError
        If an argument is malformed or out of range, lengths differ, there is no cylinder, or one has no
        length.

    Notes
    -----
    Texture coordinates: u turns once about the axis, and v rises from 0 at the start to 1 at the end.

    Examples
    --------
    >>> bonds = wf.Cylinders([(0, 0, 0), (1, 0, 0)], [(1, 0, 0), (1, 1, 0)], 0.1)
    >>> wf.render(bonds, spp=1, size=(16, 16), lighting="cloudy").shape
    (16, 16, 3)
    """

    @suggests_keywords
    def __init__(
        self,
        starts: ArrayLike,
        ends: ArrayLike,
        radii: ArrayLike,
        colors: ArrayLike | None = None,
        *,
        caps: bool = True,
        material: MaterialLike | None = None,
        name: str = "cylinders",
        cmap: Any = None,
        clim: ArrayLike | None = None,
        times: ArrayLike | None = None,
    ) -> None:
        self.caps = flag(f"{name}: caps", caps)
        super().__init__(starts, ends, radii, mapped_colors(name, colors, cmap, clim), material, name, times)

    def _reach(self) -> Doubles:
        """Return how far flat ends reach, (n, 3): the radius, times the sine of axis and coordinate axis."""
        span = self.ends - self.starts
        axis = span / np.linalg.norm(span, axis=1, keepdims=True)
        return self.radii[:, None] * np.sqrt(np.maximum(1 - axis**2, 0))

    def hull(self) -> tuple[Doubles, Doubles]:
        """Return the corners of polygons about the circles at both ends."""
        span = self.ends - self.starts
        frame = Frame.from_normal((span / np.linalg.norm(span, axis=1, keepdims=True)).T.astype(np.float32))
        sin, cos = sin_cos_turns(np.arange(HULL_SIDES) / HULL_SIDES)
        _, inner = sin_cos_turns(np.float64(0.5 / HULL_SIDES))
        x, y = ((axis.T * (self.radii / inner)[:, None])[:, None] for axis in (frame.x, frame.y))
        rim = x * sin[:, None] + y * cos[:, None]  # (n, sides, 3)
        points = np.concatenate([self.starts[:, None] + rim, self.ends[:, None] + rim]).reshape(-1, 3)
        return points, np.zeros(len(points))

    def check(self) -> None:
        """Check the arrays against each other; they may have been assigned one by one.

        Raises
        ------
        SceneError
            If there is no cylinder, an array does not have one row for each, or one has no length.
        """
        super().check()
        bad = np.flatnonzero((self.starts == self.ends).all(1))
        if len(bad):
            raise SceneError(
                f"{self.name}: starts[{bad[0]}] and ends[{bad[0]}] are both {self.starts[bad[0]].tolist()}; "
                "a cylinder must have a length"
            )


class Capsules(SegmentArray):
    """Capsules: cylinders with half spheres at both ends, given by arrays of the ends of their axes.

    Capsules that share an end join smoothly.

    Parameters
    ----------
    starts, ends
        (n, 3) ends of the axes, scene units; the surface is everywhere one radius away from the axis. If
        both are equal, the capsule is a sphere.
    radii
        (n,) or one number, scene units, above 0.
    colors
        (n, 3) RGB, or (n, 4) with opacity, one row per capsule, as of `Spheres`.
    material
        The material of all of them: a `Material` or a `Bsdf`. By default a `Diffuse` that shows the `colors`,
        or is gray. The outside is the front. Capsules cannot emit light.
    name
        Used in messages.
    cmap, clim
        Then `colors` are numbers, one each, that a colormap of matplotlib shows, by its name, such as
        "viridis"; and the numbers at its ends, by default the least and the greatest.
    times
        (t,) seconds, rising, of starts or ends (t, n, 3) that are given for several times; between them they
        move straight on.

    Raises
    ------
    SceneError
        If an argument is malformed or out of range, lengths differ, or there is no capsule.

    Notes
    -----
    Texture coordinates: u turns once about the axis, and v rises along the axis from 0 to 1, tip to tip.

    Examples
    --------
    >>> line = np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (2, 1, 1)])
    >>> tube = wf.Capsules(line[:-1], line[1:], 0.05)
    """

    @suggests_keywords
    def __init__(
        self,
        starts: ArrayLike,
        ends: ArrayLike,
        radii: ArrayLike,
        colors: ArrayLike | None = None,
        *,
        material: MaterialLike | None = None,
        name: str = "capsules",
        cmap: Any = None,
        clim: ArrayLike | None = None,
        times: ArrayLike | None = None,
    ) -> None:
        super().__init__(starts, ends, radii, mapped_colors(name, colors, cmap, clim), material, name, times)
