"""Rendered pictures as data."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from html import escape
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arrays.vec import Bools, Doubles, Floats
from ..camera import Camera, ImageSize
from ..codecs import png_jpeg
from ..codecs.display import Display
from ..codecs.flow import write_flow
from ..codecs.image_data import ERROR, ImageData
from ..codecs.images import read_picture, write_image
from ..codecs.png_jpeg import Gamma
from ..codecs.tone import AUTO
from ..codecs.white_balance import WhiteBalance
from ..colors import EFFICACY, rgb, to_photometric
from ..core.errors import SceneError, as_array, flag, in_brief, iterable, mapping, number, one_of, shape_of
from ..core.html import picture_html
from ..core.suggestions import Answers, did_you_mean, suggests_keywords
from ..film.aov_names import (
    AOVS,
    BEFORE_DENOISING,
    BOXES,
    CLAMPED,
    FLOW_AOVS,
    GIVEN_AOVS,
    MASKS,
    NOISY,
    STANDARD_ERROR,
    VARIANCE,
    is_radiance,
)
from ..film.checkpoint import contents_of, is_checkpoint, read_checkpoint
from ..film.film import Film, batch_size, chunks
from ..film.light_sums import LightSums
from ..film.picture_sums import PictureSums, merged_metadata, merged_sums, restored_sums
from ..film.samples import shared_samples
from ..statistics import (
    PixelErrors,
    RegionMean,
    Scatter,
    film_scatter,
    region_mean,
    restored_scatter,
    scatter_arrays,
    scatter_of_difference,
)
from ..statistics.scatter import PREFIX as SCATTER
from .framing import cropped, resized
from .outlines import outline_coverage

MEASURED = "measured."  # before the names of such arrays in files
# arrays (H, W, ...) besides rgb, layers and errors
FIELDS = ("counts", "variance", "standard_error", "halves")
PARTS = ("rgb", "spp", "metadata", *FIELDS, "layers", "errors", "names", "sums", "scatter", "measured")


class Image(Answers):
    """A rendered picture.

    Attributes
    ----------
    rgb
        (H, W, 3) float32 linear radiance; row 0 is the top.
    spp
        Samples per pixel; the rounded mean where pixels have different numbers.
    metadata
        Settings and results of the render: lighting (the preset that was added, or None), ground (whether one
        was added, or "shadow"), background ("transparent", a color, or None for the environment), integrator,
        max_bounces, seed, sampler, sample_ranges (the half-open ranges [first, end] of the samples that some
        pixel has), film (width and height of the whole picture), window (the part [x0, y0, x1, y1] of it that
        this one is), filter, branches, guide, guided, reuse and hint (what was chosen, and what else may pay:
        docs/choices.md), accelerator, workers, executor, seconds (wall time), spp (mean over pixels),
        samples, rays, bad_samples, interrupted, version (of this package), numpy, noise (estimated relative
        error of the picture before denoising), rare (the part of the squared error that comes from few
        samples, see docs/convergence.md; None below sixteen samples), clamp and clamped (the part of the
        light that it removed), caustics, boxes if they were asked for, quality, quick (whether the picture
        ended as soon as it was clean), end (how it ended by itself and how to have it otherwise, or None),
        of a denoised picture denoiser, and of its samples before_denoising.
    counts
        (H, W) int64 samples of each pixel, without those that were not finite.
    variance
        (H, W, 3) float32 estimated variance of one sample; NaN where there are fewer than two.
    standard_error
        (H, W, 3) float32 estimated standard error of `rgb`, from the scatter of 2 to 8 batches of samples. It
        includes most of the gain of stratified sampling. NaN where there are fewer than two samples. It is
        the error of each pixel alone. Pixels that share paths (`metadata["reuse"]`) are correlated, so that
        the error of a mean over pixels is larger than the errors of pixels suggest: `mean` gives the error of
        a region.
    halves
        (H, W, 3) float32 half the difference of the means of two halves of the samples, of which `mean` and
        `wf.compare` make the errors of means over many pixels; NaN where there are fewer than two samples.
    layers
        The AOVs by name, (H, W) or (H, W, channels): see docs/layers.md. Each is an attribute as well:
        `image.depth` is `image.layers["depth"]`.
    errors
        Estimated standard error of each sampled AOV, of the same shape.
    names
        For "shape", "instance" and "material" the name of each id of the layers `shape_id`, `instance_id`
        and `material_id`.
    sums
        The sums of the samples, for `merge`. Only pictures of `render(samples=...)`, of checkpoints and of
        npz files of these have them.
    scatter
        What `mean` and `wf.compare` need where pixels share paths; otherwise empty. npz files have it, exr
        files do not.

    measured
        Of measurements: the error of the layer "lux", and the variance of a sample of it.

    `counts`, `variance`, `standard_error` and `halves` are None in an image that was not rendered,
    `standard_error` also in one that was denoised, and `halves` in files of earlier versions.

    Raises
    ------
    SceneError
        If `rgb` has no pixels, or is not an array of three axes.

    Examples
    --------
    >>> image = wf.render([wf.Sphere((0, 0, 0), 1), wf.Environment(1)], spp=4, size=(32, 24), aovs="depth")
    >>> image.save("ball.exr")
    >>> wf.Image.load("ball.exr").depth.shape
    (24, 32)
    >>> image.to_uint8(tone="agx").dtype
    dtype('uint8')
    """

    def __init__(
        self,
        rgb: NDArray[np.float32],
        spp: int = 0,
        metadata: dict[str, Any] | None = None,
        *,
        counts: NDArray[np.int64] | None = None,
        variance: NDArray[np.float32] | None = None,
        standard_error: NDArray[np.float32] | None = None,
        halves: NDArray[np.float32] | None = None,
        layers: Mapping[str, NDArray[Any]] | None = None,
        errors: Mapping[str, NDArray[np.float32]] | None = None,
        names: Mapping[str, Mapping[int, str]] | None = None,
        sums: PictureSums | None = None,
        scatter: Sequence[Scatter] = (),
        measured: Mapping[str, NDArray[np.float32]] | None = None,
    ) -> None:
        self.rgb = _checked_pixels(rgb)
        if not isinstance(spp, int | np.integer) or isinstance(spp, bool) or spp < 0:
            raise SceneError(f"Image spp is {in_brief(spp)}; it must be a whole number of at least 0")
        self.spp = spp
        self.metadata = mapping("Image metadata", metadata)
        self.counts = self._plane("counts", counts)
        self.variance = self._plane("variance", variance)
        self.standard_error = self._plane("standard_error", standard_error)
        self.halves = self._plane("halves", halves)
        self.layers = self._planes("layers", layers)
        self.errors = self._planes("errors", errors)
        tables = mapping("Image names", names)
        self.names = {kind: mapping(f"Image names[{kind!r}]", table) for kind, table in tables.items()}
        if not (sums is None or isinstance(sums, PictureSums)):
            raise SceneError(f"Image sums is {in_brief(sums)}; it must be that of another picture, or None")
        self.sums = sums
        self.scatter = tuple(iterable("Image scatter", scatter, "the scatter of another picture"))
        if not all(isinstance(element, Scatter) for element in self.scatter):
            raise SceneError(f"Image scatter is {in_brief(scatter)}; it must be that of another picture")
        self.measured = self._planes("measured", measured)

    def _plane(self, name: str, values: Any) -> Any:
        """Return values of pixels as they were given, if they are an array (H, W, ...), or None."""
        size = self.rgb.shape[:2]
        if values is not None and shape_of(values)[:2] != size:
            height, width = size
            raise SceneError(
                f"Image {name} must have shape ({height}, {width}, ...), as rgb has, got {in_brief(values)}"
            )
        return values

    def _planes(self, name: str, values: Any) -> dict[str, Any]:
        """Return arrays (H, W, ...) by name."""
        arrays = mapping(f"Image {name}", values)
        return {key: self._plane(f"{name}[{key!r}]", array) for key, array in arrays.items()}

    @property
    def light_groups(self) -> dict[str, NDArray[np.float32]]:
        """The radiance (H, W, 3) of each group of lights, by its name; empty if it was not asked for."""
        return self._keyed("light_groups")

    @property
    def coverage(self) -> dict[str, NDArray[np.float32]]:
        """The fraction (H, W) of each pixel that shapes cover, by name; empty without `aovs="coverage"`."""
        return self._keyed("coverage")

    def _keyed(self, kind: str) -> dict[str, NDArray[np.float32]]:
        prefix = kind + "."
        return {
            name.removeprefix(prefix): layer for name, layer in self.layers.items() if name.startswith(prefix)
        }

    @property
    def luminance(self) -> NDArray[np.float32]:
        """The luminance (H, W), cd/m²: 683 · (0.2126 R + 0.7152 G + 0.0722 B), see `to_photometric`."""
        return to_photometric(self.rgb).astype(np.float32, copy=False)

    def __getattr__(self, name: str) -> NDArray[Any]:
        """Return a layer by its name."""
        if name in AOVS or name in FLOW_AOVS or name in GIVEN_AOVS:
            if name in self.__dict__.get("layers", ()):
                return self.layers[name]
            setting = "clamp=" if name == CLAMPED else f"aovs=({name!r},)"
            raise AttributeError(f"the image has no layer {name!r}; render it with {setting}")
        known = (
            () if name.startswith("_") else (*AOVS, *FLOW_AOVS, *GIVEN_AOVS, *vars(self), *dir(type(self)))
        )
        hint = did_you_mean(name, [other for other in known if not other.startswith("_")], ("image",))
        raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}{hint}")

    @property
    def boxes(self) -> list[dict[str, Any]]:
        """Boxes of objects, from `aovs="boxes"`: see docs/layers.md. They are part of the metadata."""
        if BOXES not in self.metadata:
            raise AttributeError(f"the image has no boxes; render it with aovs=({BOXES!r},)")
        boxes: list[dict[str, Any]] = self.metadata[BOXES]
        return boxes

    @suggests_keywords
    def mask(self, which: int | str, kind: str = "shape") -> Bools:
        """Return a mask (H, W): the pixels whose center ray meets an object, by its id or name.

        Parameters
        ----------
        which
            An id, or a name. If several objects have this name, their pixels are joined.
        kind
            "shape", "instance" or "material".

        Raises
        ------
        SceneError
            If there is no such id or name, or the AOV `shape_id`, `instance_id` or `material_id` is missing.
        """
        names = self.names.get(one_of("kind", kind, ("shape", "instance", "material")))
        ids = self.layers.get(f"{kind}_id")
        if names is None or ids is None:
            raise SceneError(f"mask: the image has no layer '{kind}_id'; render it with aovs=('{kind}_id',)")
        chosen = [which] if which in names else [at for at, name in names.items() if name == which]
        if not chosen:
            raise SceneError(
                f"mask: there is no {kind} {which!r}; names are {', '.join(map(repr, names.values()))[:200]}"
            )
        return np.isin(ids, chosen)

    @suggests_keywords
    def mean(self, region: Any = None, kind: str = "shape") -> RegionMean:
        """Return the mean of a region and its standard error, also where pixels share paths.

        The error comes from the difference of two halves of the samples, summed over the pixels, and where
        they are few also from the scatter of batches of samples; what stratified samples gain beyond half of
        them is extrapolated. Pixels that share paths are correlated within tiles, so there the differences
        of the sums over tiles count. Other pixels are independent. Of a denoised picture it is the mean of
        the samples, and says so: `before_denoising`.

        Parameters
        ----------
        region
            A mask (H, W) of booleans; slices or numbers as for `image[region]`, such as
            (slice(8, 16), slice(20)); an id or a name as for `mask`; None for the whole picture.
        kind
            "shape", "instance" or "material", for an id or a name.

        Returns
        -------
        RegionMean
            With `value` (3,), `standard_error` (3,), which is None if it is not known, and `interval`.

        Raises
        ------
        SceneError
            If the region is malformed or empty, or there is no such id.

        Examples
        --------
        >>> scene = [wf.Sphere((0, 0, 0), 1, name="ball"), wf.PointLight((3, 3, 3), 90)]
        >>> image = wf.render(scene, spp=16, size=(24, 24), aovs="shape_id")
        >>> ball = image.mean("ball")
        >>> ball.value.shape, ball.standard_error.shape
        ((3,), (3,))
        >>> ball.pixels == image.mean(image.shape_id == 0).pixels
        True
        """
        noisy = self.noisy
        if noisy is not None:
            return replace(noisy.mean(region, kind), before_denoising=True)
        errors = PixelErrors(self.standard_error, self.freedom(), self.scatter, self._alone(), self.halves)
        where = self._region(region, kind)
        return region_mean(self.rgb, where, errors, self._most(where), self._error_absent())

    def _alone(self) -> Doubles | None:
        """Return the variance (H, W, 3) of `rgb` as of independent samples; None if it is not known."""
        if self.variance is None or self.counts is None:
            return None
        return self.variance / np.maximum(self.counts, 1)[..., None].astype(np.float64)

    def _most(self, region: Bools) -> int:
        """Return the most samples of a pixel of a region."""
        return self.spp if self.counts is None else int(self.counts[region].max())

    def _region(self, region: Any, kind: str) -> Bools:
        """Return the pixels (H, W) of a region, as `mean` takes it."""
        shape = self.rgb.shape[:2]
        if region is None:
            return np.ones(shape, np.bool_)
        if isinstance(region, str) or (isinstance(region, int | np.integer) and not isinstance(region, bool)):
            mask = self.mask(int(region) if isinstance(region, np.integer) else region, kind)
        elif isinstance(region, tuple | slice):
            mask = np.zeros(shape, np.bool_)
            try:
                mask[region] = True
            except (IndexError, TypeError) as error:
                where = f"{shape[0]} rows and {shape[1]} columns"
                raise SceneError(f"mean: the region {region!r} is no part of {where}: {error}") from None
        else:
            mask = np.asarray(region)
            if mask.dtype != np.bool_ or mask.shape != shape:
                raise SceneError(
                    f"mean: the region is {mask.dtype} of shape {mask.shape}; it must be a mask of booleans "
                    f"of shape {shape}, slices, an id or a name"
                )
        if not mask.any():
            raise SceneError("mean: the region has no pixel")
        return mask

    def freedom(self) -> Doubles:
        """Return the degrees of freedom (H, W) with which the standard error of each pixel is known."""
        shape = self.rgb.shape[:2]
        counts = np.full(shape, self.spp) if self.counts is None else self.counts
        distinct, which = np.unique(counts, return_inverse=True)
        batches = [count // batch_size(count) if count > 1 else 2 for count in distinct.tolist()]
        return np.maximum(np.array(batches)[which].reshape(shape) - 1.0, 1)

    def _error_absent(self) -> str:
        """Return the reason why the errors of means over pixels are not known, or nothing."""
        if NOISY in self.layers:
            return "the picture was denoised; image.noisy has an error"
        if self.standard_error is None or not np.isfinite(self.standard_error).all():
            return "the picture has no standard error of each pixel"
        if self.metadata.get("reuse") and not self.scatter:
            return (
                "its pixels share paths, and how batches of samples scatter is not known; npz files and "
                "checkpoints keep it"
            )
        return ""

    def motion(self, camera: Camera) -> NDArray[np.float32]:
        """Return the optical flow to a picture of the same scene by another camera, (H, W, 2) in pixels.

        The point in the middle of pixel [y, x] is at (x + dx, y + dy) in the picture of the other camera, in
        columns and rows. It may be hidden there, or outside of the picture. NaN where this picture shows
        nothing, or where the point is behind the other camera.

        Parameters
        ----------
        camera
            The other camera. This picture must have the AOV `position`.

        Raises
        ------
        SceneError
            If the layer is missing.
        """
        position = self.layers.get("position")
        if position is None:
            raise SceneError("motion: the image has no layer 'position'; render it with aovs=('position',)")
        height, width = position.shape[:2]
        flow = np.full((height, width, 2), np.nan, np.float32)
        row, column = np.nonzero(np.isfinite(position).all(2))
        pixels, _ = camera.project(position[row, column])
        here = np.stack([column, row], 1) + 0.5
        flow[row, column] = pixels - camera.window[:2] - here
        return flow

    def __repr__(self) -> str:
        """Return the size and the sample count."""
        height, width = self.rgb.shape[:2]
        return f"<Image {width}x{height}, {self.spp} spp>"

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> NDArray[Any]:
        """Return `rgb`."""
        return np.array(self.rgb, dtype=dtype, copy=copy)

    def __array_function__(
        self, function: Callable[..., Any], types: Any, args: Sequence[Any], kwargs: Mapping[str, Any]
    ) -> Any:
        """Call a function of NumPy, such as `np.mean`, with `rgb` in place of pictures."""
        return function(*_as_arrays(args), **{name: _as_arrays(value) for name, value in kwargs.items()})

    def __getitem__(self, key: Any) -> NDArray[np.float32]:
        """Return `rgb[key]`: image[y, x] is one pixel, (3,); for a text the layer of this name."""
        if isinstance(key, str):
            layer: NDArray[np.float32] = self.layers[key] if key in self.layers else getattr(self, key)
            return layer
        return self.rgb[key]

    def __sub__(self, other: Image) -> Image:
        """Return the difference of two pictures of one size: `rgb` and its standard error, no layers.

        The error is that of independent pictures. The variance of one sample is known where both have
        equally many of each pixel. The error is None if one of them has none, or if they share
        samples, since their errors then depend on each other. Where the pixels of one of them share paths
        those of the difference do as well: `metadata["reuse"]` says so, and `mean` knows it.

        Raises
        ------
        SceneError
            If the sizes differ.
        """
        if not isinstance(other, Image):
            return NotImplemented
        if self.shape != other.shape:
            sizes = " and ".join(f"{x.shape[1]}x{x.shape[0]}" for x in (self, other))
            raise SceneError(f"pictures of different sizes cannot be subtracted: {sizes}")
        error = halves = counts = variance = None
        if (
            self.standard_error is not None
            and other.standard_error is not None
            and shared_samples(self.metadata, other.metadata) is None
        ):
            error = np.hypot(self.standard_error, other.standard_error)
            if self.halves is not None and other.halves is not None:
                halves = self.halves - other.halves
            if _same_counts(self, other) and self.variance is not None and other.variance is not None:
                counts, variance = self.counts, self.variance + other.variance
        sharing = [picture for picture in (self, other) if picture.metadata.get("reuse")]
        scatter: tuple[Scatter, ...] = ()
        if error is not None and all(picture.scatter for picture in sharing):
            scatters = [(x.scatter, x.standard_error) for x in sharing if x.standard_error is not None]
            scatter = scatter_of_difference(scatters, error)
        metadata = {"reuse": bool(sharing)}
        spp = min(self.spp, other.spp)
        return Image(
            self.rgb - other.rgb,
            spp,
            metadata,
            counts=counts,
            variance=variance,
            standard_error=error,
            halves=halves,
            scatter=scatter,
        )

    def __mul__(self, factor: ArrayLike) -> Image:
        """Return the picture times a number or an rgb triple, with its errors and its layers.

        Layers of radiance are multiplied too: `direct`, `indirect` and light groups. The others stay.

        Raises
        ------
        SceneError
            If the factor is neither a finite number nor three of them.
        """
        if isinstance(factor, Image) or np.asarray(factor).dtype.kind not in "fiu":
            return NotImplemented
        scale = np.asarray(factor, np.float32)
        if scale.shape not in ((), (3,)) or not np.isfinite(scale).all():
            raise SceneError(f"a picture can be multiplied by a number or an rgb triple, not by {factor!r}")
        size = np.abs(scale)

        def scaled(arrays: Mapping[str, NDArray[Any]], by: NDArray[np.float32]) -> dict[str, NDArray[Any]]:
            return {name: array * by if is_radiance(name) else array for name, array in arrays.items()}

        return self.with_parts(
            rgb=self.rgb * scale,
            variance=None if self.variance is None else self.variance * size**2,
            standard_error=None if self.standard_error is None else self.standard_error * size,
            halves=None if self.halves is None else self.halves * scale,
            layers=scaled(self.layers, scale),
            errors=scaled(self.errors, size),
            sums=None,
        )

    __rmul__ = __mul__

    def crop(self, window: tuple[int, int, int, int]) -> Image:
        """Return a part of the picture, with all that is known of its pixels but the sums for `merge`.

        Parameters
        ----------
        window
            (x0, y0, x1, y1) in pixels from the left and the top; column x1 and row y1 are no part of it.

        Raises
        ------
        SceneError
            If it is malformed, empty, or leaves the picture.

        Examples
        --------
        >>> image = wf.render([wf.Sphere((0, 0, 0), 1), wf.Environment(1)], 2, size=(32, 24))
        >>> image.crop((4, 2, 20, 12)).shape
        (10, 16, 3)
        """
        return cropped(self, window)

    def resize(self, size: ImageSize) -> Image:
        """Return the colors in another size: each pixel is the mean of the area that it covers.

        Values of single pixels, such as errors and AOVs, are left out.

        Parameters
        ----------
        size
            (width, height) in pixels, or one number for both.

        Raises
        ------
        SceneError
            If it is malformed.

        Examples
        --------
        >>> wf.Image(np.ones((24, 32, 3), np.float32)).resize((8, 6)).shape
        (6, 8, 3)
        """
        return resized(self, size)

    @suggests_keywords
    def denoise(self, denoiser: str = "auto") -> Image:
        """Return the picture without most of its noise.

        Only `rgb` is denoised; AOVs stay as they are, and `noisy` is the picture before. The AOVs
        `denoising_albedo` and `denoising_normal`, which `render(denoise=True)` adds, guide the denoiser
        along edges and textures. Pixels that are not finite are filled. The standard error of the result is
        not known. A picture that was denoised is denoised anew from the noisy one.

        Parameters
        ----------
        denoiser
            "oidn": Intel Open Image Denoise, by pyoidn (`pip install pyoidn`). "nonlocal_means": a filter of
            this package, slower, which needs no other package. "auto": "oidn" if it is
            installed. `metadata["denoiser"]` says which it was.

        Raises
        ------
        SceneError
            If there is no such denoiser, or it is not installed.
        """
        from ..denoising import denoise, noisy_picture

        source = self.noisy or self
        metadata = {name: value for name, value in source.metadata.items() if name != BEFORE_DENOISING}
        picture = noisy_picture(source.rgb, source.standard_error, source.layers, source.errors, source.spp)
        rgb, used = denoise(picture, denoiser)
        error = {} if source.standard_error is None else {NOISY: source.standard_error}
        return source.with_parts(
            rgb=rgb,
            metadata={**metadata, "denoiser": used},
            standard_error=None,
            layers={**source.layers, NOISY: source.rgb},
            errors={**source.errors, **error},
        )

    @property
    def noisy(self) -> Image | None:
        """The samples before denoising, with their error; None if this picture was not denoised.

        The promise of equal bits is one for this picture, and p-values, means of regions, `merge` and
        checkpoints are of it. Its metadata has "before_denoising".
        """
        if NOISY not in self.layers:
            return None
        return self.with_parts(
            rgb=self.layers[NOISY],
            metadata=_of_samples(self.metadata),
            standard_error=self.errors.get(NOISY),
            layers={name: layer for name, layer in self.layers.items() if name != NOISY},
            errors={name: error for name, error in self.errors.items() if name != NOISY},
        )

    def with_parts(self, **parts: Any) -> Image:
        """Return the picture with other parts."""
        return Image(**{name: vars(self)[name] for name in PARTS} | parts)

    def merge(self, other: Image) -> Image:
        """Merge two pictures of one scene that have different samples.

        The result is the picture of one render of all these samples, bit for bit, and so are sampled AOVs.
        `variance` and `standard_error` may differ from those of one render in how their sums are rounded;
        where the samples of a part do not fill whole batches (of `film.batch_size`), the error is estimated
        from batches of other lengths. AOVs that are not sampled are those of this picture. In the metadata,
        counts and seconds are added, and `sample_ranges` are joined; the rest is that of this picture. If a
        picture was denoised, its samples are merged, and the metadata has "before_denoising".

        Parameters
        ----------
        other
            A picture of other samples: of `render(samples=...)`, or of a checkpoint.

        Raises
        ------
        SceneError
            If one of the pictures was not rendered with `samples=` (or read from a checkpoint), its
            pixels have different numbers of samples, scenes or settings differ, or samples are in both.
        """
        if not isinstance(other, Image):
            raise SceneError(f"a picture is merged with another one, got {type(other).__name__}")
        source = self.noisy or self
        sums = merged_sums(self.sums, other.sums)
        metadata = merged_metadata(source.metadata, other.metadata)
        metadata = metadata if other.noisy is None else _of_samples(metadata)
        image = film_image(sums, metadata, keep_sums=True)
        image.layers = {**source.layers, **image.layers}
        image.names = self.names
        return image

    @property
    def shape(self) -> tuple[int, ...]:
        """(H, W, 3), of `rgb`."""
        return self.rgb.shape

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Image:
        """Read a picture as linear values; its first bytes say what it is, or else its extension.

        exr and npz files of `save` give the same image again: rgb, layers, errors, names and metadata, bit
        for bit. png and jpg files are decoded by the gamma that they record, as files of `save` do, and by
        the sRGB curve if they record none; so are all others of 8 and 16 bits. exr, hdr, pfm, npy, npz and
        tif of floats are linear. The last of two or four channels becomes the layer "alpha", and colors of 8
        and 16 bits are multiplied by it. One channel of color becomes three. Of an exr with layers the
        picture itself is read. A checkpoint gives the picture so far.

        Parameters
        ----------
        path
            A png, jpg, bmp, gif, tga, tif, webp, ppm, pfm, exr, hdr, npy or npz file, or a checkpoint with
            any extension.

        Raises
        ------
        SceneError
            If the file is missing, of another kind, corrupt, truncated, or too large. The message names it.
        """
        if is_checkpoint(path):
            checkpoint = read_checkpoint(path)
            with contents_of(path):
                return film_image(checkpoint.sums, checkpoint.metadata, keep_sums=True)
        picture = read_picture(path)
        errors = {name.removeprefix(ERROR): a for name, a in picture.arrays.items() if name.startswith(ERROR)}
        measured = {
            name.removeprefix(MEASURED): a for name, a in picture.arrays.items() if name.startswith(MEASURED)
        }
        layers = {
            name: a
            for name, a in picture.arrays.items()
            if name not in FIELDS and not name.startswith((ERROR, MEASURED))
        }
        scatter = {name: array for name, array in picture.sums.items() if name.startswith(SCATTER)}
        sums = {name: array for name, array in picture.sums.items() if name not in scatter}
        return cls(
            picture.rgb,
            picture.info.get("spp", 0),
            dict(picture.metadata),
            counts=picture.arrays.get("counts"),
            variance=picture.arrays.get("variance"),
            standard_error=picture.arrays.get("standard_error"),
            halves=picture.arrays.get("halves"),
            layers=layers,
            errors=errors,
            names=picture.info.get("names"),
            sums=restored_sums(os.fspath(path), picture.rgb.shape, picture.info.get("identity"), sums),
            scatter=restored_scatter(os.fspath(path), picture.rgb.shape, scatter),
            measured=measured,
        )

    @suggests_keywords
    def outlined(
        self, color: ArrayLike = 0.0, width: float = 2.0, *, crease: float = 40.0, jump: float = 0.01
    ) -> Image:
        """Return the picture with lines along outlines of objects and along sharp edges.

        The picture must have the AOVs `shape_id`, `normal` and `depth`: render it with
        aovs=("shape_id", "normal", "depth"). AOVs stay as they are, except that the lines cover a
        transparent background.

        Parameters
        ----------
        color
            Linear RGB of the lines, or one number.
        width
            Of the lines, pixels, above 0 and at most 100.
        crease
            Degrees, above 0 and at most 180: a line is drawn where the normal turns by more than this from
            one pixel to the next.
        jump
            Above 0: a line is drawn where the depth changes by more than this fraction of itself from one
            pixel to the next, and not as uniformly as on a slanted surface.

        Raises
        ------
        SceneError
            If a layer is missing, or an argument is out of range.
        """
        wanted = "shape_id", "normal", "depth"
        missing = [name for name in wanted if name not in self.layers]
        if missing:
            raise SceneError(f"outlines: the image has no layer {missing[0]!r}; render it with aovs={wanted}")
        ink = rgb("outlines: color", color)[:, 0]
        width = number("outlines: width", width, lambda x: 0 < x <= 100, "above 0 and at most 100")
        crease = number("outlines: crease", crease, lambda x: 0 < x <= 180, "above 0 and at most 180")
        jump = number("outlines: jump", jump, lambda x: x > 0, "above 0")
        ids, normal, depth = (self.layers[name] for name in wanted)
        covered = outline_coverage(ids, normal, depth, width, crease, jump)
        left: NDArray[np.float32] = 1 - covered[..., None]
        layers = dict(self.layers)
        if "alpha" in layers:
            layers["alpha"] = layers["alpha"] * (1 - covered) + covered
        return self.with_parts(
            rgb=np.asarray(self.rgb * left + ink * covered[..., None], np.float32),
            variance=None if self.variance is None else self.variance * left**2,
            standard_error=None if self.standard_error is None else self.standard_error * left,
            halves=None if self.halves is None else self.halves * left,
            layers=layers,
            sums=None,
        )

    @suggests_keywords
    def to_uint8(
        self,
        gamma: Gamma = 2.2,
        exposure: float = 0.0,
        tone: str = AUTO,
        white_balance: WhiteBalance | None = None,
    ) -> NDArray[np.uint8]:
        """Return the picture as 8-bit codes for display, the same that `save` writes into a png.

        Parameters
        ----------
        gamma
            Values are clipped to [0, 1] and raised to 1/gamma; "srgb" is the exact sRGB curve.
        exposure
            Stops (factors of 2) by which the picture is brightened first.
        tone
            The curve that maps radiance above 1 into the range of a display: "none", "reinhard", "aces" or
            "agx", "agx_punchy" (`codecs/tone.py` names their sources). "auto" is "agx_punchy" where `render`
            chose the light, else "none". It shows that light 1.5 stops brighter, as its white is far above 1.
        white_balance
            Color temperature of the light, 1667 to 25000 K, or the linear RGB of a gray object in the
            picture. This color is made neutral after the exposure. 6504 K changes nothing.

        Returns
        -------
        NDArray[np.uint8]
            (H, W, 3); with a transparent background (H, W, 4), colors not multiplied by alpha.

        Raises
        ------
        SceneError
            If a value is out of range.
        """
        return self._codes(Display(gamma, exposure, tone, white_balance), bits=8)

    @suggests_keywords
    def to_uint16(
        self,
        gamma: Gamma = 2.2,
        exposure: float = 0.0,
        tone: str = AUTO,
        white_balance: WhiteBalance | None = None,
    ) -> NDArray[np.uint16]:
        """Return the picture as codes of 16 bits; parameters and shape are those of `to_uint8`."""
        return self._codes(Display(gamma, exposure, tone, white_balance), bits=16)

    @suggests_keywords
    def to_pil(
        self,
        gamma: Gamma = 2.2,
        exposure: float = 0.0,
        tone: str = AUTO,
        white_balance: WhiteBalance | None = None,
    ) -> Any:
        """Return the picture as a `PIL.Image.Image`, RGB or RGBA; the parameters are those of `to_uint8`."""
        from PIL.Image import fromarray

        return fromarray(self.to_uint8(gamma, exposure, tone, white_balance))

    @suggests_keywords
    def show(
        self,
        gamma: Gamma = 2.2,
        exposure: float = 0.0,
        tone: str = AUTO,
        white_balance: WhiteBalance | None = None,
    ) -> None:
        """Show the picture: in a notebook below the cell, else in the system's viewer.

        The parameters are those of `to_uint8`.
        """
        picture = self.to_pil(gamma, exposure, tone, white_balance)
        if "IPython" in sys.modules and sys.modules["IPython"].get_ipython() is not None:
            from IPython.display import display

            display(picture)
        else:
            picture.show()

    @suggests_keywords
    def save(
        self,
        path: str | os.PathLike[str],
        gamma: Gamma = 2.2,
        exposure: float = 0.0,
        tone: str = AUTO,
        white_balance: WhiteBalance | None = None,
        *,
        bits: int = 8,
    ) -> None:
        """Write the picture by its extension: png or jpg for display; exr, hdr, npy and npz linear.

        exr and npz hold everything: AOVs, errors, counts, names and metadata; npz also the sums for `merge`.
        Where exposure or white balance change rgb, they hold only rgb and the alpha of a transparent
        background, since the rest belongs to the picture before. A transparent background gives a png an
        alpha channel; hdr, npy and jpg have none, so it is black there. `docs/formats.md` has the names of
        all channels.

        The file holds its old content or all of the new content, never a part. It keeps its permissions, and
        symbolic links are followed.

        Parameters
        ----------
        path
            Where to write.
        gamma
            png and jpg hold value^(1/gamma), and record gamma; "srgb" is the exact sRGB curve.
        exposure
            Stops (factors of 2) by which the picture is brightened first, in every format.
        tone
            A tone curve for png and jpg, as in `to_uint8`.
        white_balance
            The color that becomes neutral, in every format, as in `to_uint8`.
        bits
            Bits of each channel of a png, 8 or 16.

        Raises
        ------
        SaveError
            If the file cannot be written: an unknown extension, a folder that is missing, no space, or a
            tone or bits that the format cannot hold. It is a SceneError and an OSError.
        SceneError
            If gamma, exposure, tone or white balance is out of range.
        """
        write_image(path, self._data(), Display(gamma, exposure, tone, white_balance), bits)

    @suggests_keywords
    def save_flow(self, path: str | os.PathLike[str], name: str = "flow", *, hidden: bool = True) -> None:
        """Write optical flow as Middlebury's .flo or KITTI's .png, as OpenCV and torchvision read them.

        A png has steps of 1/64 pixel, and no flow of 512 pixels or more.

        Parameters
        ----------
        path
            Where to write.
        name
            "flow", to the picture after this one, or "flow_back", to the one before.
        hidden
            Whether points that the other picture does not show have a flow, too. Without it the AOV
            "flow_occluded" or "flow_back_occluded" is needed.

        Raises
        ------
        SaveError
            If the file cannot be written, or has another extension.
        SceneError
            If a layer is missing, or an argument is something else.

        Examples
        --------
        >>> spheres = wf.Spheres([[(0, 0, 0)], [(1, 0, 0)]], 0.5, times=[0, 1])
        >>> image = wf.render(spheres, 1, size=32, aovs=("flow", "flow_occluded"), flow_times=(0, 0.1))
        >>> image.save_flow("000000_10.png", hidden=False)
        """
        known = tuple(aov for aov in FLOW_AOVS if aov not in MASKS)
        layer = self.layers.get(one_of("name", name, known))
        mask = self.layers.get(f"{name}_occluded")
        if layer is None or (mask is None and not flag("hidden", hidden)):
            missing = name if layer is None else f"{name}_occluded"
            raise SceneError(f"the image has no layer {missing!r}; render it with aovs=({missing!r},)")
        valid = np.isfinite(layer).all(2)
        write_flow(path, layer, valid if hidden or mask is None else valid & (mask == 0))

    @suggests_keywords
    def plot(self, name: str = "rgb", axes: Any = None, *, cmap: Any = "viridis") -> Any:
        """Plot the picture or an AOV with matplotlib.

        AOVs of one number per pixel are shown in false color with a color bar, ids in distinct colors with
        a legend of their names, colors as `to_uint8` shows them, normals and positions as colors.

        Parameters
        ----------
        name
            "rgb", "luminance" (cd/m²), an AOV, or "counts", "variance" or "standard_error".
        axes
            Axes of matplotlib to draw into; by default those of a new figure.
        cmap
            The colormap of AOVs of one number: the name of one of matplotlib, or a colormap.

        Returns
        -------
        Any
            The axes.

        Raises
        ------
        SceneError
            If there is no such layer.
        ImportError
            If matplotlib is not installed. The message says how to install it.
        """
        from . import plot

        arrays = {**self._data().named(), "luminance": self.luminance}
        if (name in AOVS or name in FLOW_AOVS) and name not in arrays:
            raise SceneError(f"plot: the image has no layer {name!r}; render it with aovs=({name!r},)")
        values = arrays[one_of("layer", name, arrays)]
        table = self.names.get(name.removesuffix("_id"), {}) if name.endswith("_id") else None
        return plot.draw(name, self.to_uint8()[..., :3] if name == "rgb" else values, table, axes, cmap)

    @suggests_keywords
    def false_color(
        self,
        limits: tuple[float, float] | None = None,
        *,
        log: bool = True,
        efficacy: float = EFFICACY,
        axes: Any = None,
        cmap: Any = "viridis",
    ) -> Any:
        """Plot the luminance in false color, with a scale in cd/m², with matplotlib; return the axes.

        Parameters
        ----------
        limits
            cd/m² at both ends of the scale; by default the brightest pixel, and a thousandth of it (or 0).
        log
            Whether the scale is logarithmic; otherwise it is linear.
        efficacy
            lm/W of white, as in `to_photometric`.
        axes
            Axes of matplotlib to draw into; by default those of a new figure.
        cmap
            As for `plot`.

        Raises
        ------
        SceneError
            If the limits do not increase, or begin at 0 or less on a logarithmic scale.
        ImportError
            If matplotlib is not installed. The message says how to install it.

        Examples
        --------
        >>> sky = wf.Environment(wf.from_photometric(2000))  # cd/m²
        >>> image = wf.render([wf.Sphere((0, 0, 0), 1), sky], size=(8, 8))
        >>> image.false_color((10, 5000)).figure.savefig("luminance.png")
        """
        from . import plot

        values = to_photometric(self.rgb, efficacy=efficacy)
        if limits is None:
            most = float(np.nanmax(values)) or 1.0
            limits = (most / 1000 if log else 0.0, most)
        low, high = (number("false_color limit", value) for value in limits)
        if not low < high or (log and low <= 0):
            least = " and be above 0" if log else ""
            raise SceneError(f"false_color limits are {low:g} and {high:g}; they must increase{least}")
        return plot.draw_scale("luminance", "cd/m²", values, (low, high), log, axes, cmap)

    def _data(self) -> ImageData:
        """Return all of the image as files hold it."""
        arrays = {name: getattr(self, name) for name in FIELDS if getattr(self, name) is not None}
        arrays |= self.layers | {ERROR + name: values for name, values in self.errors.items()}
        arrays |= {MEASURED + name: values for name, values in self.measured.items()}
        info: dict[str, Any] = {"spp": self.spp, "metadata": self.metadata, "names": self.names}
        scatter = scatter_arrays(self.scatter)
        if self.sums is None:
            return ImageData(self.rgb, arrays, info, scatter)
        return ImageData(
            self.rgb, arrays, {**info, "identity": self.sums.identity}, {**self.sums.arrays(), **scatter}
        )

    def _codes(self, display: Display, bits: int) -> NDArray[Any]:
        return display.codes(display.adjusted(self._data()), bits)

    def _repr_png_(self) -> bytes:
        """Show the picture in a notebook."""
        return png_jpeg.encode(self.to_uint8(), ".png", 2.2)

    def _repr_html_(self) -> str:
        """Show the picture in a notebook, with its size, samples, error, time and layers."""
        height, width = self.rgb.shape[:2]
        facts = [f"{width} × {height}", f"{self.spp} spp"]
        noise = self.metadata.get("noise", np.nan)
        if np.isfinite(noise):
            facts.append(f"error {noise:.2%}{' before denoising' if 'denoiser' in self.metadata else ''}")
        if "seconds" in self.metadata:
            facts.append(f"{self.metadata['seconds']:.1f} s")
        if self.layers:
            facts.append(f"layers: {', '.join(self.layers)}")
        caption = escape(" · ".join(facts))
        return f"<div>{picture_html(self._repr_png_())}<div><small>{caption}</small></div></div>"


def film_image(sums: PictureSums, metadata: Mapping[str, Any], keep_sums: bool) -> Image:
    """Return the picture on a film and its layers; a pixel without samples is black.

    Its noise joins the metadata. With `keep_sums` the picture refers to the sums, which must not change then.
    """
    image = _film_rgb(sums.film, metadata)
    image.sums = sums if keep_sums else None
    _add_aovs(image, sums)
    return image


def _of_samples(metadata: Mapping[str, Any]) -> dict[str, Any]:
    """Return the metadata of the samples of a picture that was denoised."""
    others = {name: value for name, value in metadata.items() if name != "denoiser"}
    return {**others, BEFORE_DENOISING: True}


def _checked_pixels(rgb: Any) -> NDArray[Any]:
    """Return the pixels of a picture as they are, but as an array.

    Raises
    ------
    SceneError
        If there are none.
    """
    pixels = as_array("image rgb", rgb)
    if pixels.ndim != 3 or not pixels.size:
        raise SceneError(f"image rgb must have shape (H, W, 3), with at least one pixel, got {pixels.shape}")
    return pixels


def last_film_image(sums: PictureSums, metadata: Mapping[str, Any]) -> Image:
    """Return the picture as `film_image` does; the film then lacks the sums of its errors."""
    image = _film_rgb(sums.film, metadata)
    sums.film.release_errors()
    _add_aovs(image, sums)
    return image


def _film_rgb(film: Film, metadata: Mapping[str, Any]) -> Image:
    """Return the picture on a film, without layers."""
    width, height = film.size
    shape = height, width, 3
    estimates = film.estimates()
    error = estimates.standard_error.reshape(shape)
    noise = estimates.worst if "sensor" in metadata else estimates.noise  # that `noise` limits
    scatter: tuple[Scatter, ...] = ()
    if metadata.get("reuse") and {"film", "window"} <= metadata.keys() and "sensor" not in metadata:
        whole, window = metadata["film"], metadata["window"]
        scatter = film_scatter(film, error, (int(whole[0]), int(whole[1])), (int(window[0]), int(window[1])))
    return Image(
        estimates.mean.reshape(shape),
        round(float(film.count.mean())),
        {**metadata, "noise": noise, "rare": estimates.rare},
        counts=film.used().reshape(height, width).copy(),
        variance=estimates.variance.reshape(shape),
        standard_error=error,
        halves=estimates.halves.reshape(shape),
        scatter=scatter,
    )


def _same_counts(a: Image, b: Image) -> bool:
    """Return whether two pictures have equally many samples of each pixel."""
    return a.counts is not None and b.counts is not None and np.array_equal(a.counts, b.counts)


def _as_arrays(value: Any) -> Any:
    """Return a value with `rgb` in place of the pictures in it."""
    if isinstance(value, Image):
        return value.rgb
    if isinstance(value, tuple | list):
        return type(value)(map(_as_arrays, value))
    return value


def _add_aovs(image: Image, sums: PictureSums) -> None:
    """Add the sampled layers to a picture."""
    if sums.layers is None:
        return
    width, height = sums.film.size
    for name in sums.layers.names:
        estimate = sums.layers.estimate(name, sums.film.sums, sums.film.used())
        image.layers[name] = _of_shape(estimate.mean, width, height)
        if estimate.standard_error is None:
            continue
        error = _of_shape(estimate.standard_error, width, height)
        if estimate.variance is None:
            image.errors[name] = error
        else:
            image.measured[name + STANDARD_ERROR] = error
            image.measured[name + VARIANCE] = _of_shape(estimate.variance, width, height)
    if sums.film.light is not None and "indirect" in image.layers:
        _add_light_tracing(image, sums.film.light)
    if CLAMPED in image.layers:
        image.metadata[CLAMPED] = _removed_part(image.rgb, image.layers[CLAMPED])


def _add_light_tracing(image: Image, light: LightSums) -> None:
    """Add the light of paths from lights, all of it indirect, to that layer of a picture."""
    layer, error = (values.reshape(-1, 3) for values in (image.layers["indirect"], image.errors["indirect"]))
    for pixels in chunks(len(layer)):
        layer[pixels] += light.mean(pixels).T
        error[pixels] = np.sqrt(np.square(error[pixels], dtype=np.float64) + light.squared_error(pixels).T)


def _removed_part(rgb: Floats, removed: Floats) -> float:
    """Return the fraction of the light that was `removed` (H, W, 3) from a picture (H, W, 3) by a clamp."""
    left, lost = (float(values.mean(dtype=np.float64)) for values in (rgb, removed))
    return lost / (left + lost) if lost else 0.0


def _of_shape(values: Floats, width: int, height: int) -> Floats:
    """Return a layer (pixels, c) as (height, width, c), or (height, width) if it has one channel."""
    return values.reshape((height, width, -1) if values.shape[1] > 1 else (height, width))
