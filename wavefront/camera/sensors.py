"""Sensors at points: a camera each of whose pixels is a place of its own."""

from __future__ import annotations

from collections.abc import Mapping
from copy import copy
from typing import Any, NoReturn, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arrays.state import Words
from ..arrays.vec import Doubles, Floats, f4
from ..core.errors import SceneError, as_array, finite_array, one_of
from ..sampling.tiles import PointTiles, nearby_ranks
from .base import MAX_SIDE, Camera, ImageSize
from .projection import Orthographic

KINDS = ("irradiance", "fluence", "radiance")
LIFT = 2.0**-22  # of the size of scene and points together: above the rounding of both to float32


class Sensors(Camera):
    """Points that measure light, a pixel each: those of a picture of `rows` rows, the last ones unused.

    Parameters
    ----------
    points
        (n, 3) scene units.
    directions
        (n, 3) or (3,) of any length: normals of sensors of irradiance, where those of radiance look to; None
        for fluence.
    kind
        "irradiance", W·m⁻², "fluence", W·m⁻², or "radiance", W·sr⁻¹·m⁻².

    Raises
    ------
    SceneError
        If there is no point, an array is malformed, or a direction is zero or missing.
    """

    def __init__(self, points: ArrayLike, directions: ArrayLike | None, kind: str = "irradiance") -> None:
        self.sensor = one_of("kind", kind, KINDS)
        self.points = finite_array("points", points, (None, 3))
        count = len(self.points)
        if not count:
            raise SceneError("points is empty; there must be at least one point")
        self.directions = self._unit_directions(directions)
        self.scatterings = int(kind != "radiance")
        self.lies_on_surfaces = kind == "irradiance"
        self.may_share = True  # paths, with other sensors
        self.lift = 0.0  # how far they are above their points, along their normals, scene units
        rows = -(-count // MAX_SIDE)
        middle = (self.points.min(0) + self.points.max(0)) / 2
        super().__init__(middle, np.eye(3), Orthographic(1), (-(-count // rows), rows))
        every = np.minimum(np.arange(self.size[0] * self.size[1]), count - 1)
        self._rank = nearby_ranks(self.points[every], self.directions[every])

    def _unit_directions(self, directions: ArrayLike | None) -> Doubles:
        """Return unit directions (n, 3)."""
        name = "directions" if self.sensor == "radiance" else "normals"
        shape = self.points.shape
        if self.sensor == "fluence":
            if directions is not None:
                raise SceneError("normals are given; fluence counts all directions alike and has none")
            return np.broadcast_to((0.0, 0.0, 1.0), shape)
        if directions is None:
            raise SceneError(f"{self.sensor} needs {name}: (n, 3), or (3,) for all points")
        vectors = finite_array(name, directions, (3,) if as_array(name, directions).ndim == 1 else shape)
        length = np.linalg.norm(vectors, axis=-1, keepdims=True)
        bad = np.flatnonzero(~(length > 0))
        if bad.size:
            raise SceneError(f"{name}[{bad[0]}] is zero; it must have a direction")
        return np.broadcast_to(vectors / length, shape)

    def __repr__(self) -> str:
        """Return the kind of light that is measured, and the number of points."""
        return f"<Sensors: {self.sensor} at {len(self.points)} points>"

    @property
    def tiles(self) -> PointTiles:
        """The tiles of sensors that may share paths."""
        return PointTiles(self._rank)

    @property
    def extent(self) -> Doubles:
        """(k, 3) points whose box contains the sensors, scene units."""
        return self.points

    def above(self, bounds: Doubles) -> Self:
        """Return the same sensors above surfaces that they may lie on; `bounds` (2, 3) are the scene's."""
        sensors = copy(self)
        size = np.linalg.norm(np.ptp(np.concatenate([self.extent, bounds]), axis=0))
        sensors.lift = LIFT * float(size) if self.lies_on_surfaces else 0.0
        return sensors

    @property
    def places(self) -> Doubles:
        """(n, 3) where paths start, scene units."""
        return self.points + self.lift * self.directions

    def layers(self) -> dict[str, NDArray[Any]]:
        """Return the points and directions as layers (rows, columns, 3) of the picture; NaN where none is."""
        width, rows = self.resolution
        spare = np.full((width * rows - len(self.points), 3), np.nan)
        both = {"position": self.points, "normal": self.directions}
        return {name: np.concatenate([table, spare]).reshape(rows, width, 3) for name, table in both.items()}

    def metadata(self) -> Mapping[str, Any]:
        """Return the entries of the picture's metadata about the sensors."""
        return {"sensor": self.sensor, "points": len(self.points)}

    def scaled(self, factor: float) -> Self:
        """Return the same sensors in a scene whose lengths were multiplied by `factor`."""
        sensors = copy(self)
        sensors.origin, sensors.points = self.origin * factor, self.points * factor
        sensors.lift = self.lift * factor
        return sensors

    def resized(self, size: ImageSize) -> NoReturn:
        """Refuse another size: there is a pixel for each point."""
        raise SceneError(f"size is {size!r}; sensors have a pixel for each point")

    def cropped(self, crop: tuple[int, int, int, int]) -> Self:
        """Return the same sensors: there is no picture of which a window could be a part."""
        return self

    def pixel_rays(
        self, pixel: Words, at: Floats, center: Doubles, lens: Floats | None = None
    ) -> tuple[Floats, Floats]:
        """Return the points, and the directions to them from above: those of radiance as they look."""
        index = np.minimum(pixel, len(self.points) - 1)
        point, direction = self.points.take(index, 0) - center, self.directions.take(index, 0)
        if self.sensor == "radiance":
            return point.T.astype(f4), direction.T.astype(f4)
        above = point + self.lift * direction if self.lift else point
        return above.T.astype(f4), -direction.T.astype(f4)
