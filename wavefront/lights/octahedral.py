"""An image environment of which light samples know the means over texels, by one look-up and no angles."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, ClassVar, Self

import numpy as np

from ..arrays.soa import soa
from ..arrays.state import SurfaceInteraction
from ..arrays.vec import Doubles, Floats, Ints, f4, luminance, positive, take
from .base import LightSample, Receiver
from .infinite import InfiniteLight, at_infinity
from .product import NO_NORMAL, TexelProduct, bins_of

if TYPE_CHECKING:
    from .image import ImageEnvironment

SIDE = 176  # texels; one covers about 1° by 1°
CELLS = 22, 22  # parts that a normal weighs as wholes
SAMPLES = 2  # squared: places within a texel whose mean is taken
SHARP = f4(100)  # 1/sr; rays of a greater density belong to lobes that show single texels


@soa
class OctahedralEnvironment(InfiniteLight):
    """Directions on an octahedron that is unfolded to a square, (x, y, z)/(|x| + |y| + |z|) seen along z.

    Texels are constant for light samples, and for rays that these could replace. Cameras and mirrors, and
    lobes as sharp as texels, see the image itself.

    Source: Z. Cigolle et al., A Survey of Efficient Representations for Independent Unit Vectors, JCGT 2014.
    """

    image: ImageEnvironment
    means: Floats  # (3, texels) radiance
    product: TexelProduct
    share: float  # of the light that light samples are to bring
    normals: Ints | None = None  # (n,) bins of normals to draw for; None for no normal in particular
    takes_receiver: ClassVar[bool] = True

    @classmethod
    def of(cls, image: ImageEnvironment, least_variance: float) -> Self | None:
        """Return the texels of an image for light samples; None where it varies too little for them."""
        means, even = _means(image)
        weights = luminance(means.astype(np.float64)) * even
        weights /= weights.mean()
        more = weights - even
        if (more * more / even).mean() < least_variance:
            return None
        excess, directions = positive(more), _directions(1)[0].reshape(3, SIDE, SIDE)
        product = TexelProduct(excess.reshape(SIDE, SIDE).astype(f4), None, directions, CELLS)
        return cls(image, means, product, float(excess.mean()))

    def sample_li(self, point: Floats, u: Floats) -> LightSample:
        """Choose a texel, and a place within it."""
        texel, x, y, over_square = self.product.sample_texels(u, self._drawn_for(u.shape[1]))
        wi = np.empty((3, len(x)), f4)
        length = _unfolded(x, y, wi)
        return at_infinity(wi, take(self.means, texel), over_square * (f4(0.25) * length * length * length))

    def pdf_li(self, point: Floats, wi: Floats) -> Floats:
        """Return the density of the texel in direction wi."""
        texel, size = _texels(wi)
        return self.product.pdf_of_texels(texel, self._drawn_for(texel.size)) / (f4(4) * size * size * size)

    def lighting(self, receiver: Receiver) -> Self:
        """Return the light as it is sampled for the normals of opaque surfaces."""
        return replace(self, normals=bins_of(receiver))

    def le(self, wi: Floats, surface: SurfaceInteraction | None = None) -> Floats:
        """Return the radiance of the image in direction wi, (3, n)."""
        return self.image.le(wi)

    def le_of_texels(self, wi: Floats, pdf: Floats) -> Floats:
        """Return the radiance against rays that light samples could replace, of a density (n,)."""
        radiance = take(self.means, _texels(wi)[0])
        sharp = np.flatnonzero(~(pdf < SHARP))
        if sharp.size:
            radiance[:, sharp] = self.image.le(take(wi, sharp))
        return radiance

    def power(self, scene_radius: float) -> Doubles:
        """Return that of the image, times the share."""
        return self.share * self.image.power(scene_radius)

    def _drawn_for(self, n: int) -> Ints:
        return np.broadcast_to(NO_NORMAL if self.normals is None else self.normals, n)


def _unfolded(x: Floats, y: Floats, wi: Floats) -> Floats:
    """Set wi (3, n) to the directions of places x, y (n,) of the square, in [0, 1].

    Return the lengths (n,) of the points of the octahedron: their cube over 4 is the area of a steradian.
    """
    one = wi.dtype.type(1)
    s, t = x + x - one, y + y - one
    z = one - np.abs(s) - np.abs(t)
    below = np.maximum(-z, 0)  # |s| of the lower half is 1 − |t|, so less by this, and |t| likewise
    s -= np.copysign(below, s)
    t -= np.copysign(below, t)
    length = np.sqrt(s * s + t * t + z * z)
    for row, coordinate in zip(wi, (s, t, z), strict=True):
        np.divide(coordinate, length, out=row)
    return length


def _texels(wi: Floats) -> tuple[Ints, Floats]:
    """Return the texels (n,) in directions wi (3, n), and the sums of the sizes of their components (n,)."""
    x, y = np.abs(wi[0]), np.abs(wi[1])
    size = x + y + np.abs(wi[2])
    below = np.flatnonzero(wi[2] < 0)
    half = f4(SIDE / 2) / size
    x *= half
    y *= half
    x[below], y[below] = f4(SIDE / 2) - y.take(below), f4(SIDE / 2) - x.take(below)
    column, row = (_places(distance, sign) for distance, sign in ((x, wi[0]), (y, wi[1])))
    row *= SIDE
    row += column
    return row, size


def _places(distance: Floats, sign: Floats) -> Ints:
    """Return the rows or columns (n,) of texels at distances (n,) from the middle, to the sides of `sign`."""
    place = np.copysign(distance, sign)
    place += f4(SIDE / 2)
    index = place.astype(np.intp)
    return np.minimum(index, SIDE - 1, out=index)


def _directions(samples: int) -> tuple[Doubles, Doubles]:
    """Return unit directions (3, k) on a grid of SIDE·`samples` squared, and lengths as `_unfolded` does."""
    middle = (np.arange(SIDE * samples) + 0.5) / (SIDE * samples)
    y, x = (grid.ravel() for grid in np.meshgrid(middle, middle, indexing="ij"))
    wi = np.empty((3, x.size))
    return wi, _unfolded(x, y, wi).astype(np.float64)


def _means(image: ImageEnvironment) -> tuple[Floats, Doubles]:
    """Return the mean radiance of an image over texels (3, k), and their solid angles over the mean, (k,)."""
    wi, length = _directions(SAMPLES)
    angle = 1 / (length * length * length)
    shape = SIDE, SAMPLES, SIDE, SAMPLES
    whole = angle.reshape(shape).sum((1, 3))
    light = (image.le(wi.astype(f4)) * angle).reshape(3, *shape).sum((2, 4)) / whole
    return np.ascontiguousarray(light.reshape(3, -1), f4), (whole / whole.mean()).ravel()
