"""Light that arrives from all around."""

from __future__ import annotations

import os
from contextlib import nullcontext
from copy import copy
from dataclasses import replace
from typing import Literal, Self

import numpy as np
from numpy.typing import ArrayLike

from ..arrays.soa import soa
from ..arrays.state import SurfaceInteraction
from ..arrays.vec import INV_FOUR_PI, Doubles, Floats, f4
from ..codecs.budget import in_memory
from ..colors import is_color_name, rgb
from ..core.errors import as_array, called, one_of, rotation_matrix
from ..core.parameter import Parameter, Parametrized
from ..core.suggestions import suggests_keywords
from ..film.aov_names import DEFAULT_GROUP, group_name
from ..motion import Motion
from ..sampling.warp import uniform_sphere
from .base import FarLight, LightSample
from .image import ImageEnvironment, environment_pixels
from .infinite import InfiniteLight, at_infinity, through_scene


@soa
class ConstantEnvironment(InfiniteLight):
    """The same radiance from every direction."""

    radiance: Floats  # (3, 1) W·sr⁻¹·m⁻²
    share: float = 1.0  # of the light that light samples are to bring

    def compensated(self) -> Self:
        """Leave all of it to BSDF samples, which beat directions drawn uniformly."""
        return replace(self, share=0.0)

    def sample_li(self, point: Floats, u: Floats) -> LightSample:
        """Draw a direction uniformly on the sphere."""
        wi = uniform_sphere(u)
        radiance = np.broadcast_to(self.radiance, wi.shape)
        return at_infinity(wi, radiance, np.full(wi.shape[1], INV_FOUR_PI, f4))

    def pdf_li(self, point: Floats, wi: Floats) -> Floats:
        """Return 1/4π."""
        return np.full(wi.shape[1], INV_FOUR_PI, f4)

    def le(self, wi: Floats, surface: SurfaceInteraction | None = None) -> Floats:
        """Return the radiance, (3, n)."""
        return np.broadcast_to(self.radiance, wi.shape)

    def power(self, scene_radius: float) -> Doubles:
        """4π·L through the disk of the scene, πR²: the share of light samples."""
        return self.share * through_scene(4 * np.pi * self.radiance.mean(0, dtype=np.float64), scene_radius)


class Environment(Parametrized, FarLight):
    """An environment: light from infinitely far away, seen wherever a ray leaves the scene.

    Parameters
    ----------
    radiance
        W·sr⁻¹·m⁻²: a color (a number, three, or a name such as "white"), which is the same from all
        directions; or an image, a file (exr, hdr, png or another) or an array (H, W, 3), top row first.
        Pictures of 8 and 16 bits are decoded from sRGB and count from 0 to 1; all others are linear. Alpha is
        not used.
    transform
        (3, 3) rotation from the environment's space to world space; or a motion, such as `Keyframes`, whose
        matrices turn it. Their translations have no effect.
    scale
        A color, at least 0, that multiplies this radiance.
    filter
        "bilinear" between the centers of the image's pixels, or "nearest".
    rows
        Where the rows of an image lie: "centers", H bands of the same height from pole to pole; or "poles",
        the first row at the upper pole and the last at the lower, as Mitsuba 3 has it.
    group
        Name of the light group, for `aovs="light_groups"`.
    backdrop
        The background that the camera sees in place of the light, given as `radiance` is; None: the light.
        Mirrors and glass always show the light.

    Attributes
    ----------
    radiance
        (3, 1) W·sr⁻¹·m⁻²; of an image, the mean over all directions.
    backdrop
        The background that the camera sees, an `Environment`; None if that is the light itself.
    rotation
        (3, 3) to world space from the environment's own; of one that turns, at its start.

    Notes
    -----
    An image shows all directions by longitude and latitude, seen from inside: its top row is +y,
    its middle is +z, its left half is +x and its right half -x. That is how OpenEXR defines such
    an image, and how `Camera.panorama` and, but for `rows`, Mitsuba 3 lay it out.
    In Blender the middle is +x, with z up; for a scene that it exported with y up, the same view takes the
    transform [[0, 0, 1], [0, 1, 0], [-1, 0, 0]].

    Directions are sampled by the luminance of the image. With the tables for that an image takes 26 bytes of
    memory for each pixel, and 1.3 MB. A backdrop takes 16 bytes for each pixel.

    Raises
    ------
    SceneError
        If the radiance is malformed or not finite, an image is all black or its one row would lie at both
        poles, or the transform is not a rotation.

    Examples
    --------
    >>> even = wf.Environment(1)
    >>> rows = np.linspace(1, 0, 32)[:, None, None]
    >>> sky = wf.Environment(rows * np.ones((32, 64, 3)) * (0.4, 0.6, 1.0))
    """

    group: Parameter[str] = Parameter(group_name)

    @suggests_keywords
    def __init__(
        self,
        radiance: ArrayLike | str | os.PathLike[str] = 1.0,
        *,
        transform: ArrayLike | Motion | None = None,
        scale: ArrayLike | str = 1.0,
        filter: Literal["bilinear", "nearest"] = "bilinear",
        rows: Literal["centers", "poles"] = "centers",
        group: str = DEFAULT_GROUP,
        backdrop: ArrayLike | str | os.PathLike[str] | None = None,
    ) -> None:
        motion, transform = (transform, None) if isinstance(transform, Motion) else (None, transform)
        self.backdrop: Environment | None = None
        if backdrop is not None:
            with called("Environment backdrop", "Environment radiance"):
                self.backdrop = Environment(backdrop, transform=transform, filter=filter, rows=rows)
        self._filter = one_of("filter", filter, ("bilinear", "nearest"))
        self._poles = one_of("rows", rows, ("centers", "poles")) == "poles"
        self._transform = None if transform is None else rotation_matrix("Environment transform", transform)
        self._scale = rgb("Environment scale", scale)
        self._image: ImageEnvironment | None = None
        self._radiance: Floats
        self.radiance = radiance
        self._scale = np.ones((3, 1), f4)  # a radiance that is assigned later is not scaled
        self.group = group
        if motion is not None:
            vars(self).update(vars(copy(self).transformed(motion)))

    @property
    def radiance(self) -> Floats:
        """W·sr⁻¹·m⁻², (3, 1); of an image, the mean over all directions."""
        return self._radiance

    @radiance.setter
    def radiance(self, radiance: ArrayLike | str | os.PathLike[str]) -> None:
        if isinstance(radiance, str) and is_color_name(radiance):
            self._radiance, self._image = rgb("Environment radiance", radiance) * self._scale, None
        elif isinstance(radiance, str | os.PathLike) or (
            as_array("Environment radiance", radiance).ndim > 1
            and np.shape(radiance) != (3, 1)  # a color as it is kept
        ):
            with in_memory(radiance) if isinstance(radiance, str | os.PathLike) else nullcontext():
                pixels = environment_pixels(radiance)
                if (self._scale != 1).any():
                    pixels = pixels * self._scale.ravel()
                image = ImageEnvironment.of(pixels, self._filter, self._transform, self._poles)
            self._radiance, self._image = image.mean, image
        else:
            self._radiance, self._image = rgb("Environment radiance", radiance) * self._scale, None

    @property
    def rotation(self) -> Doubles:
        """(3, 3) to world space from the environment's own; of one that turns, at its start."""
        return np.eye(3) if self._transform is None else self._transform

    @property
    def is_even(self) -> bool:
        """Whether light and backdrop are each the same from everywhere, so that no turn of them is seen."""
        return self._image is None and (self.backdrop is None or self.backdrop.is_even)

    def sample_in_texels(self) -> None:
        """Let light samples take means over texels of the image, which must vary slowly (octahedral.py)."""
        assert self._image is not None
        self._image = replace(self._image, in_texels=True)

    def record(self, center: Doubles) -> InfiniteLight:
        """Return the light as a record of one column."""
        return ConstantEnvironment(self.radiance) if self._image is None else self._image

    def _transformed(self, matrix: Doubles) -> Self:
        """Return a copy that is turned by an affine matrix (4, 4)."""
        turn = rotation_matrix("Environment transform", matrix[:3, :3])
        return self._turned_to(turn if self._transform is None else turn @ self._transform)

    def _placed_as(self, other: Self) -> Self:
        """Return a copy that is turned as another environment."""
        return self._turned_to(other._transform)

    def _turned_to(self, rotation: Doubles | None) -> Self:
        """Return a copy with a rotation (3, 3) to world space; images and tables by texel are shared."""
        light = copy(self)
        light._transform = rotation
        if self._image is not None:
            to_world = None if rotation is None else rotation.astype(f4)
            light._image = replace(self._image, rotation=to_world, made=None)
        if self.backdrop is not None:
            light.backdrop = self.backdrop._turned_to(rotation)
        return light
