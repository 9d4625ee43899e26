"""From the view of a page to a camera, and back."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import ceil, log10, sqrt
from typing import Any

import numpy as np

from ..arrays.vec import Doubles
from ..camera import Camera, Fisheye
from ..camera.projection import Orthographic, Panorama, Perspective, Projection
from ..core.errors import SceneError, finite_array, number

Triple = tuple[float, float, float]

FOV = 5.0, 120.0  # degrees, least and greatest
FOV_DIGITS = 4  # behind the point
OTHER_FOV = 40.0  # degrees, in place of cameras that are not perspective
NEAREST, FARTHEST = 0.01, 10.0  # focus, in radii of the scene
WIDEST = 0.2  # aperture, in radii of the scene
DIGITS = 6  # of a coordinate, counted from the size of the scene: they keep the code of a camera short
MOST_FAR = 1e6  # radii from the middle of a scene that a camera may be
LARGEST_PAGE = 16_384  # pixels
UPRIGHT = 1e-3  # sine of the least roll of a camera that counts


@dataclass(frozen=True)
class Surroundings:
    """The place and the size of a scene: pages see it in the middle, with the radius 1."""

    center: Triple
    radius: float  # scene units

    @classmethod
    def of(cls, bounds: Doubles) -> Surroundings:
        """Return those of a scene with bounds (2, 3)."""
        low, high = bounds
        x, y, z = ((low + high) / 2).tolist()
        return cls((x, y, z), float(np.linalg.norm(high - low)) / 2 or 1.0)

    def to_page(self, point: Triple | Doubles) -> Doubles:
        """Return a point (3,) of the scene on the page."""
        return (np.array(point) - self.center) / self.radius

    def from_page(self, name: str, point: Any) -> Triple:
        """Return a point (3,) of the page in the scene.

        Raises
        ------
        SceneError
            If it is not three finite numbers, or is too far away.
        """
        at = finite_array(name, point, (3,))
        if np.abs(at).max() > MOST_FAR:
            raise SceneError(f"{name} is {at.tolist()}; it must be within {MOST_FAR:g} radii of the scene")
        return self.rounded(at * self.radius + self.center)

    def rounded(self, values: Any) -> Triple:
        """Return three numbers with few digits, as coordinates for people."""
        return _rounded(values, self.digits)

    @property
    def digits(self) -> int:
        """How many digits behind the point coordinates have."""
        return DIGITS - ceil(log10(self.radius))


@dataclass(frozen=True)
class Viewpoint:
    """A camera as a page knows it: its origin, its target, and its lens."""

    surroundings: Surroundings
    origin: Triple
    target: Triple
    up: Triple
    fov: float  # degrees, vertical
    aperture: float  # scene units
    focus: float  # scene units
    size: tuple[int, int]  # pixels
    pixels: int  # of a picture, at most
    other: Projection | None = None  # of a camera that is not perspective

    @classmethod
    def of(cls, camera: Camera, bounds: Doubles, up: Doubles) -> Viewpoint:
        """Return that of a camera.

        The target is the point of the view axis that is nearest to the middle of the scene. Orthographic
        cameras and panoramas are replaced by perspective ones, of which lenses are taken without distortion
        and shift. Other projections, such as a fisheye, stay.

        Parameters
        ----------
        camera
            The camera.
        bounds
            (2, 3) of the scene.
        up
            (3,) up axis of the scene: the page turns around it, unless the camera is rolled.
        """
        around = Surroundings.of(bounds)
        ahead = -camera.rotation[:, 2]
        distance = float((np.array(around.center) - camera.origin) @ ahead)
        distance = distance if distance > NEAREST * around.radius else around.radius
        seen = camera.projection
        lens = seen if isinstance(seen, Perspective) else Perspective(OTHER_FOV)
        upright = abs(camera.rotation[:, 0] @ up) < UPRIGHT and abs(ahead @ up) < 1 - UPRIGHT
        return cls(
            around,
            around.rounded(camera.origin),
            around.rounded(camera.origin + ahead * distance),
            _rounded(up if upright else camera.rotation[:, 1], DIGITS),
            round(float(np.clip(lens.fov, *FOV)), FOV_DIGITS),
            lens.aperture,
            lens.focus if lens.aperture > 0 else float(f"{distance:.3g}"),  # where the page's slider begins
            camera.resolution,
            camera.resolution[0] * camera.resolution[1],
            None if isinstance(seen, Perspective | Orthographic | Panorama) else seen,
        )

    def moved(self, origin: Any, target: Any, up: Any) -> Viewpoint:
        """Return the viewpoint with the camera at another place; arguments (3,) in units of the page.

        Raises
        ------
        SceneError
            If there is no such camera.
        """
        around = self.surroundings
        direction = finite_array("up", up, (3,))
        length = float(np.linalg.norm(direction))
        if not 1e-6 < length < 1e6:
            raise SceneError(f"up is {direction.tolist()}; it must have a length")
        return self._checked(
            origin=around.from_page("origin", origin),
            target=around.from_page("target", target),
            up=_rounded(direction / length, DIGITS),
        )

    def resized(self, width: Any, height: Any) -> Viewpoint:
        """Return the viewpoint for a page of a size in pixels: of its aspect, at most the pixels allowed.

        Raises
        ------
        SceneError
            If a side is not from 1 to 16384.
        """
        sides = within("page width", width, 1, LARGEST_PAGE), within("page height", height, 1, LARGEST_PAGE)
        scale = min(1.0, sqrt(self.pixels / (sides[0] * sides[1])))
        return self._checked(size=(max(1, round(sides[0] * scale)), max(1, round(sides[1] * scale))))

    def with_lens(self, **values: Any) -> Viewpoint:
        """Return the viewpoint with another `fov`, `aperture` or `focus`, in the ranges of the page.

        Raises
        ------
        SceneError
            If one is out of range.
        """
        checked = {}
        for name, value in values.items():
            checked[name] = within(name, value, *self.ranges[name])
        return self._checked(**checked)

    @property
    def ranges(self) -> dict[str, tuple[float, float]]:
        """Least and greatest value of each parameter of the lens; the camera's own are within them."""
        radius = self.surroundings.radius
        return {
            "fov": FOV,
            "aperture": (0.0, max(float(f"{WIDEST * radius:.1g}"), self.aperture)),
            "focus": (
                min(float(f"{NEAREST * radius:.1g}"), self.focus),
                max(float(f"{FARTHEST * radius:.1g}"), self.focus),
            ),
        }

    @property
    def camera(self) -> Camera:
        """The camera."""
        camera = Camera.look_at(
            self.origin,
            self.target,
            self.up,
            self.fov,
            size=self.size,
            aperture=self.aperture,
            focus=self.focus,
        )
        return camera if self.other is None else camera.replace(projection=self.other)

    @property
    def controls(self) -> tuple[str, ...]:
        """The parts of the lens that the page may change."""
        return ("fov", "focus", "aperture") if self.other is None else ()

    @property
    def code(self) -> str:
        """The line of Python that makes the camera."""
        if self.other is not None:
            return (
                f"wf.Camera.look_at({self.origin}, {self.target}, up={self.up}, size={self.size})"
                f".replace(projection={'wf.' * isinstance(self.other, Fisheye)}{self.other!r})"
            )
        lens = f", aperture={self.aperture!r}, focus={self.focus!r}" if self.aperture > 0 else ""
        return (
            f"wf.Camera.look_at({self.origin}, {self.target}, up={self.up}, fov={self.fov!r}, "
            f"size={self.size}{lens})"
        )

    def _checked(self, **values: Any) -> Viewpoint:
        """Return the viewpoint with other values, if these are valid for a camera."""
        other = replace(self, **values)
        other.camera  # noqa: B018
        return other


def within(name: str, value: Any, low: float, high: float) -> float:
    """Return a number in a closed range.

    Raises
    ------
    SceneError
        If it is none.
    """
    return number(name, value, lambda x: low <= x <= high, f"from {low:g} to {high:g}")


def _rounded(values: Any, digits: int) -> Triple:
    x, y, z = (round(float(value), digits) + 0.0 for value in values)  # + 0.0 makes -0.0 zero
    return x, y, z
