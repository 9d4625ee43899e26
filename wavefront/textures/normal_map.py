"""Normal maps and bump maps: images that perturb the shading normals of a surface."""

from __future__ import annotations

import os
from abc import ABC, abstractmethod
from copy import copy
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from ..arrays.state import SurfaceInteraction
from ..arrays.vec import Floats, Ints, cross, dot, f4, highest, normalize
from ..core.errors import SceneError, called, number
from ..core.suggestions import suggests_keywords
from .image import UV_SETS, Texture


class BaseNormalMap(ABC):
    """The interface of normal maps and bump maps, which the stage `perturb_normals` applies."""

    reads: tuple[str, ...]  # fields of `SurfaceInteraction` that `perturbed` needs
    # normals that face away from the view are mirrored at those without the map; False: all normals are
    # raised until the mirrored view is above the surface
    mirrors_hidden: bool = False
    # tilted normals shadow light that grazes the surface, as if they were those of microfacets
    shadows_grazing: bool = False
    # light that a material scatters to below the surface is mirrored at it; False: it is lost
    folds_light: bool = True

    def scaled(self, factor: float) -> BaseNormalMap:
        """Return the map for a scene scaled by `factor`: itself, unless it has lengths."""
        return self

    @abstractmethod
    def perturbed(self, surface: SurfaceInteraction, normal: Floats) -> tuple[Ints, Floats]:
        """Return the lanes whose normals change, (k,), and their new unit normals, (3, k).

        Parameters
        ----------
        surface
            n hit points.
        normal
            (3, n) unit shading normals there, on the front side of the surface.
        """


MIN_COS = f4(2**-60)  # least cosine between old and new normal: float32 can square the slope
TextureSource: TypeAlias = str | os.PathLike[str] | ArrayLike | Texture
# fields of `SurfaceInteraction`, by set of texture coordinates
DERIVATIVES = {"uv": "dpduv", "uv1": "dpduv1"}
TANGENT_FRAMES = {"uv": "tangent_frame", "uv1": "tangent_frame1"}
MAX_STRENGTH = 1e9  # of a normal map; a larger one would make every normal tangential
MAX_HEIGHT = float(np.finfo(f4).max)  # of a bump map, scene units


class NormalMap(BaseNormalMap):
    """A normal map: an image of normals, for `Material(normal_map=...)`.

    Red, green and blue from 0 to 1 are components from -1 to 1 along u, along v and along the
    shading normal, as in glTF: green points up in the image. The `tangents` of a mesh, if it has any,
    replace the directions of u and v. Where the image has (0.5, 0.5, 1) the normal does not change.

    Parameters
    ----------
    image
        A file, an array, or a `Texture` of three channels; not decoded from sRGB.
    strength
        Factor of the first two components.

    Raises
    ------
    SceneError
        If the texture gives numbers, is decoded from sRGB or has a singular transform, or the
        strength is not finite or of a size above 1e9.

    Examples
    --------
    >>> flat = np.full((4, 4, 3), (128, 128, 255), np.uint8)
    >>> material = wf.Material(wf.Diffuse(0.5), normal_map=wf.NormalMap(wf.Texture(flat, srgb=False)))
    """

    @suggests_keywords
    def __init__(self, image: TextureSource, strength: float = 1.0) -> None:
        with called("NormalMap image", "Texture source"):
            self.texture = image if isinstance(image, Texture) else Texture(image, srgb=False)
        self.strength = _limited("NormalMap strength", strength, MAX_STRENGTH)
        if self.texture.scalar or self.texture.channels < 3:
            raise SceneError(f"NormalMap: {self.texture!r} gives numbers; it must give three channels")
        _check_plain("NormalMap", self.texture)
        uv = UV_SETS[self.texture.uv_set]
        self.reads = (uv, TANGENT_FRAMES[uv])
        self._to_image = _inverse(self.texture)  # (2, 2) from the mesh's directions of u and v to the image's

    def __repr__(self) -> str:
        """Name the image."""
        return f"NormalMap({self.texture!r}, strength={self.strength:g})"

    def perturbed(self, surface: SurfaceInteraction, normal: Floats) -> tuple[Ints, Floats]:
        """Return the lanes whose normals the image changes, (k,), and their new normals, (3, k)."""
        along_u, along_v = _halves(surface, self.reads[1])
        x, y, z = self.texture.at(surface) * f4(2) - f4(1)
        x, y = x * self.strength, y * self.strength
        lanes = np.flatnonzero(((x != 0) | (y != 0)) & (dot(along_u, along_u) > 0))
        x, y, z, normal = x.take(lanes), y.take(lanes), z.take(lanes), normal.take(lanes, 1)
        along_u, along_v = along_u.take(lanes, 1), along_v.take(lanes, 1)
        if self._to_image is not None:
            m = self._to_image
            along_u, along_v = (
                along_u * m[0, 0] + along_v * m[1, 0],
                along_u * m[0, 1] + along_v * m[1, 1],
            )
        tangent = normalize(along_u - normal * dot(along_u, normal))
        bitangent = cross(normal, tangent)
        bitangent *= np.copysign(f4(1), dot(bitangent, along_v))  # u and v may be mirrored
        return lanes, normalize(tangent * x + bitangent * y + normal * z)


class BumpMap(BaseNormalMap):
    """A bump map: an image of heights, for `Material(normal_map=...)`.

    The normals become those of a surface that is displaced by these heights. The surface itself does not
    change. Source: J. Blinn 1978, "Simulation of Wrinkled Surfaces", in the form of M. Mikkelsen 2010, "Bump
    Mapping Unparametrized Surfaces on the GPU", eq. 4.

    Parameters
    ----------
    image
        A file, an array, or a `Texture` of one channel; not decoded from sRGB.
    height
        Displacement of texel 1 relative to texel 0, scene units; negative to invert the bumps.

    Raises
    ------
    SceneError
        If the texture gives colors or is decoded from sRGB, or the height is not finite or of a
        size beyond float32.

    Examples
    --------
    >>> heights = np.random.default_rng(1).random((64, 64))
    >>> bumps = wf.BumpMap(wf.Texture(heights, srgb=False, channel=0), height=0.01)
    >>> material = wf.Material(wf.Diffuse(0.5), normal_map=bumps)
    """

    @suggests_keywords
    def __init__(self, image: TextureSource, height: float = 1.0) -> None:
        with called("BumpMap image", "Texture source"):
            self.texture = (
                image if isinstance(image, Texture) else Texture(image, srgb=False, channel="luminance")
            )
        self.height = _limited("BumpMap height", height, MAX_HEIGHT)
        if not self.texture.scalar:
            raise SceneError(f"BumpMap: {self.texture!r} gives colors; choose one by channel=")
        _check_plain("BumpMap", self.texture)
        uv = UV_SETS[self.texture.uv_set]
        self.reads = (uv, DERIVATIVES[uv])

    def scaled(self, factor: float) -> BumpMap:
        """Return the map for a scene whose lengths were multiplied by `factor`."""
        other = copy(self)
        other.height = f4(self.height * factor)
        return other

    def __repr__(self) -> str:
        """Name the image."""
        return f"BumpMap({self.texture!r}, height={self.height:g})"

    def perturbed(self, surface: SurfaceInteraction, normal: Floats) -> tuple[Ints, Floats]:
        """Return the lanes whose normals the heights change, (k,), and their new normals, (3, k)."""
        along_u, along_v = _halves(surface, self.reads[1])
        uv: Floats = getattr(surface, self.reads[0])
        slope_u, slope_v = self.texture.gradient(uv) * self.height
        area = dot(normal, cross(along_u, along_v))
        surface_gradient = cross(along_v, normal) * slope_u + cross(normal, along_u) * slope_v
        regular = highest(np.abs(surface_gradient)) * MIN_COS < np.abs(area)
        lanes = np.flatnonzero(((slope_u != 0) | (slope_v != 0)) & regular)
        normal, surface_gradient = normal.take(lanes, 1), surface_gradient.take(lanes, 1)
        return lanes, normalize(normal - surface_gradient / area.take(lanes))


def _halves(surface: SurfaceInteraction, name: str) -> tuple[Floats, Floats]:
    """Return the two vectors (3, n) of a field: along u and along v."""
    both: Floats | None = getattr(surface, name)
    if both is None:
        raise SceneError("normal map: the surface has no tangents")
    return both[:3], both[3:]


def _limited(name: str, value: float, most: float) -> np.float32:
    return f4(number(name, value, lambda x: abs(x) <= most, f"finite, and at most {most:g}"))


def _check_plain(kind: str, texture: Texture) -> None:
    if texture.srgb:
        raise SceneError(f"{kind}: {texture!r} is decoded from sRGB; pass srgb=False")


def _inverse(texture: Texture) -> Floats | None:
    if texture.transform is None:
        return None
    linear = texture.transform[:2, :2]
    if np.linalg.det(linear) == 0:
        raise SceneError(f"NormalMap: the transform of {texture!r} is singular; it must be invertible")
    return np.linalg.inv(linear).astype(f4)
