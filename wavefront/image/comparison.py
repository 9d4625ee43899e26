"""Measures of the difference between two pictures."""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from ..arrays.vec import Doubles, Ints
from ..codecs.encoding import codes_to_linear
from ..codecs.images import three_channels
from ..codecs.png_jpeg import EXTENSIONS
from ..core.errors import SceneError, as_array
from ..core.plural import plural
from ..core.suggestions import Answers, suggests_keywords
from ..film.film import EPSILON, batch_size
from ..film.samples import shared_samples
from ..sampling.tiles import MEMBERS
from ..statistics.significance import Estimate, Significance, estimate, significance
from .image import Image

UNLIKELY = 0.01  # p-value below which noise hardly explains a difference

Picture: TypeAlias = Image | ArrayLike | str | os.PathLike[str]


@dataclass(frozen=True, slots=True)
class Comparison(Answers):
    """The difference of picture a from the reference b, over the linear values of all pixels and channels.

    `print` shows it as a table.

    Examples
    --------
    >>> gray = np.full((32, 32, 3), 0.5, np.float32)
    >>> comparison = wf.compare(1.1 * gray, gray)
    >>> isinstance(comparison, wf.Comparison)
    True
    >>> round(comparison.rmse, 6)
    0.05
    """

    relative_mse: float  # mean of (a − b)²/(b² + ε), ε = 0.01 · mean(b)²
    rmse: float  # root of the mean of (a − b)²
    psnr: float  # dB: 20 · log₁₀(largest value of b / rmse); inf for equal pictures
    mean_a: Doubles  # (3,) mean of each channel
    mean_b: Doubles  # (3,)
    flip: float | None  # mean FLIP error, 0 to 1; None where it could not be computed
    flip_absent: str  # the reason why it is None
    p_pixels: float | None  # p-value of the pixels: the chance that noise alone makes one differ as much
    p_blocks: float | None  # p-value of blocks of 8 × 8 and 32 × 32 pixels
    p_mean: float | None  # p-value of the mean of the picture
    p_value: float | None  # p-value of all three
    p_absent: str  # the reason why they are None
    shared: str  # which samples the pictures share, and what that means for the p-values; "" for none
    difference: Image = field(repr=False)  # |a − b|

    def __repr__(self) -> str:
        """Return the numbers that tell most, on one line."""
        flip = "" if self.flip is None else f", FLIP {self.flip:.4g}"
        p_value = "" if self.p_value is None else f", p_value {self.p_value:.3g}"
        return f"<Comparison: relative MSE {self.relative_mse:.4g}, PSNR {self.psnr:.2f} dB{flip}{p_value}>"

    def __str__(self) -> str:
        """Return a table of all numbers."""
        rows = [
            ("relative MSE", f"{self.relative_mse:.6g} (relative error {self.relative_mse**0.5:.3%})"),
            ("RMSE", f"{self.rmse:.6g}"),
            ("PSNR", f"{self.psnr:.2f} dB"),
            ("mean of a", "  ".join(f"{x:.6g}" for x in self.mean_a)),
            ("mean of b", "  ".join(f"{x:.6g}" for x in self.mean_b)),
            ("FLIP", self.flip_absent if self.flip is None else f"{self.flip:.6g}"),
            *self._p_rows(),
        ]
        return "\n".join(f"{name:<13} {value}" for name, value in rows)

    def _p_rows(self) -> list[tuple[str, str]]:
        names = ("p_value", "p_pixels", "p_blocks", "p_mean")
        if self.p_value is None:
            return [("p_value", self.p_absent)]
        rows = [(name, f"{getattr(self, name):.3g}") for name in names]
        may = "may well explain" if self.p_value >= UNLIKELY else "hardly explains"
        return [
            *rows,
            *([("samples", self.shared)] if self.shared else []),
            ("noise alone", f"{may} the difference (p_value {self.p_value:.3g}, limit {UNLIKELY})"),
        ]


@suggests_keywords
def compare(a: Picture, b: Picture) -> Comparison:
    """Measure the difference of picture `a` from the reference `b`.

    The relative MSE divides by the reference, so dark parts count as much as bright ones; ε limits the weight
    of black pixels. Its root is the error that `render(noise=...)` limits. Source: F. Rousselle, C. Knaus and
    M. Zwicker, Adaptive Sampling and Reconstruction using Greedy Error Minimization, 2011, there with a fixed
    ε for pictures in [0, 1].

    The p-values say whether two noisy pictures are the same up to noise. Each is the probability that two
    pictures that differ by noise alone differ as much as these two do, in the least likely pixel, block or
    channel of the mean. It is corrected for their number: for any size of picture, one in a hundred is below
    0.01. They need two rendered pictures with standard errors and at least two samples per pixel. Otherwise
    they are None, and `p_absent` says why. Those of equal pictures are 1. Pictures of the same seed and
    sampler may share samples: `shared` says which. Their errors depend on each other, and are taken to add up
    at worst, so that such a test finds less than one of pictures with different seeds. Of pictures with
    `reuse=True`, whose pixels share noise, those of blocks take the errors of their tiles from batches of
    samples, and that of the mean takes tiles as samples; where a file does not keep them (exr), they take the
    worst case, and find less. Those of denoised pictures are of the samples, before denoising;
    the other measures are of what is shown. Sources are in `wavefront/statistics/significance.py`.

    FLIP needs `pip install flip-evaluator`. For two pictures of 8 bits it is LDR-FLIP, else
    HDR-FLIP (P. Andersson et al., FLIP, 2020, and Visualizing Errors in Rendered High Dynamic Range
    Images, 2021).

    Parameters
    ----------
    a, b
        Images, paths that `Image.load` reads, or arrays (H, W), (H, W, 3) or (H, W, 4). Arrays of uint8 and
        uint16 are sRGB codes that stand for 0 to 1, all others are linear values. Alpha is ignored.

    Raises
    ------
    SceneError
        If a file cannot be read, the sizes differ, or a value is not finite.

    Examples
    --------
    >>> gray = np.full((32, 32, 3), 0.5, np.float32)
    >>> round(wf.compare(1.1 * gray, gray).rmse, 4)
    0.05
    """
    coded = _is_coded(a) and _is_coded(b)
    names = _named("a", a), _named("b", b)
    a, b = _loaded(a), _loaded(b)
    left, right = _pixels(names[0], a), _pixels(names[1], b)
    if left.shape != right.shape:
        sizes = " and ".join(f"{x.shape[1]}x{x.shape[0]}" for x in (left, right))
        raise SceneError(f"pictures of different sizes cannot be compared: {sizes}")
    squared = np.square(left - right)
    rmse = float(np.sqrt(squared.mean()))
    flip, flip_absent = _flip(left, right, coded)
    p, p_absent, shared = _tested_samples(names, a, b, left, right)
    return Comparison(
        relative_mse=float((squared / (np.square(right) + (EPSILON * right.mean() ** 2 or 1.0))).mean()),
        rmse=rmse,
        psnr=_decibels(float(right.max()), rmse),
        mean_a=left.mean((0, 1)),
        mean_b=right.mean((0, 1)),
        flip=flip,
        flip_absent=flip_absent,
        p_pixels=None if p is None else p.pixels,
        p_blocks=None if p is None else p.blocks,
        p_mean=None if p is None else p.mean,
        p_value=None if p is None else p.all_levels,
        p_absent=p_absent,
        shared=shared,
        difference=Image(np.abs(left - right).astype(np.float32)),
    )


def _decibels(peak: float, rmse: float) -> float:
    if rmse == 0:
        return np.inf
    return 20 * float(np.log10(peak / rmse)) if peak > 0 else -np.inf


def _named(name: str, picture: Picture) -> str:
    """Return the name of a picture for messages: its path if it has one."""
    return os.fspath(picture) if isinstance(picture, str | os.PathLike) else name


def _loaded(picture: Picture) -> Image | ArrayLike:
    """Return a picture, read if it is a path."""
    return Image.load(picture) if isinstance(picture, str | os.PathLike) else picture


def _is_coded(picture: Picture) -> bool:
    """Return whether a picture is made of 8- or 16-bit codes."""
    if isinstance(picture, str | os.PathLike):
        return Path(picture).suffix.lower() in EXTENSIONS
    return getattr(picture, "dtype", None) in (np.uint8, np.uint16)


def _pixels(name: str, picture: Image | ArrayLike) -> Doubles:
    """Return linear values, (H, W, 3)."""
    values: Any = picture.rgb if isinstance(picture, Image) else picture
    try:
        pixels = as_array("picture", values)
        pixels = pixels if _is_coded(pixels) else pixels.astype(np.float64)
    except (TypeError, ValueError) as error:
        raise SceneError(f"{name} is not a picture: {type(picture).__name__}") from error
    pixels = pixels[..., None] if pixels.ndim == 2 else pixels
    if pixels.ndim != 3 or not pixels.size or pixels.shape[2] not in (1, 2, 3, 4):
        raise SceneError(f"{name} has shape {pixels.shape}; a picture is (H, W) or (H, W, 1 to 4)")
    linear = codes_to_linear(pixels) if _is_coded(pixels) else pixels
    colors: Doubles = three_channels(linear).astype(np.float64)
    bad = np.argwhere(~np.isfinite(colors))
    if len(bad):
        y, x, _ = bad[0]
        amount = plural(len(bad), "value that is", "values that are")
        raise SceneError(f"{name} has {amount} not finite, the first at x={x}, y={y}")
    return colors


def _untestable(name: str, picture: Image | ArrayLike) -> str:
    """Return the reason why no p-value can be computed with a picture, or nothing."""
    if not isinstance(picture, Image) or picture.standard_error is None or picture.counts is None:
        return f"not computed: {name} has no standard error and number of samples of each pixel"
    if picture.counts.min() < 2 or not np.isfinite(picture.standard_error).all():
        return f"not computed: {name} has pixels with fewer than two samples"
    return ""


def _tested_samples(
    names: tuple[str, str], a: Image | ArrayLike, b: Image | ArrayLike, left: Doubles, right: Doubles
) -> tuple[Significance | None, str, str]:
    """Return the same as `_tested`, of the samples of pictures that were denoised."""
    before = [picture.noisy if isinstance(picture, Image) else None for picture in (a, b)]
    if before[0] is None and before[1] is None:
        return _tested(a, b, left, right)
    a, b = (noisy or original for noisy, original in zip(before, (a, b), strict=True))
    if not all(np.isfinite(noisy.rgb).all() for noisy in before if noisy is not None):
        return None, "not computed: samples are not finite", ""
    p, absent, shared = _tested(a, b, _pixels(names[0], a), _pixels(names[1], b))
    said = "p-values are of the samples, before denoising"
    return p, absent, f"{shared}; {said}" if shared else said


def _tested(
    a: Image | ArrayLike, b: Image | ArrayLike, left: Doubles, right: Doubles
) -> tuple[Significance | None, str, str]:
    """Return the p-values of pictures, of linear values (H, W, 3), why there are none, and `shared`."""
    if np.array_equal(left, right):
        return Significance(1.0, 1.0, 1.0), "", _shared(a, b)[0]
    absent = _untestable("a", a) or _untestable("b", b)
    if absent:
        return None, absent, ""
    shared, factor = _shared(a, b)
    estimates = _estimate(a, left, factor), _estimate(b, right, factor)
    return significance(*estimates, independent=not shared), "", shared


def _shared(a: Image | ArrayLike, b: Image | ArrayLike) -> tuple[str, float]:
    """Return a note on the samples that two pictures share, and the factor of variances for that.

    The variance of a difference is at most (σa + σb)² ≤ 2·(σa² + σb²), whatever the errors have in common.
    """
    if not (isinstance(a, Image) and isinstance(b, Image)):
        return "", 1.0
    shared = shared_samples(a.metadata, b.metadata)
    if shared is None:
        return "", 1.0
    return (
        f"the pictures share samples {shared[0]} to {shared[1] - 1} of seed {a.metadata['seed']}: p-values "
        "are cautious, and find less than those of another seed",
        2.0,
    )


def _estimate(picture: Image | ArrayLike, mean: Doubles, factor: float) -> Estimate:
    """Return the estimate of the mean of a testable picture, of linear values (H, W, 3), with its error.

    Variances are multiplied by `factor`.
    """
    assert isinstance(picture, Image)
    assert picture.counts is not None
    assert picture.standard_error is not None
    squared_error = factor * np.square(picture.standard_error, dtype=np.float64)
    variance = None if picture.variance is None else factor * picture.variance.astype(np.float64)
    sharing = MEMBERS if picture.metadata.get("reuse") else 1
    batches = _batches(picture.counts)
    return estimate(mean, squared_error, variance, batches, picture.counts, picture.scatter, sharing)


def _batches(counts: Ints) -> Ints:
    """Return the number of batches behind the error of each pixel, by its number of samples."""
    distinct, which = np.unique(counts, return_inverse=True)
    return np.array([count // batch_size(count) for count in distinct.tolist()])[which].reshape(counts.shape)


def _flip(left: Doubles, right: Doubles, coded: bool) -> tuple[float | None, str]:
    """Return the mean FLIP error, or None and the reason."""
    try:
        from flip_evaluator import evaluate
    except ImportError:
        return None, "not computed: pip install flip-evaluator"
    if right.max() <= 0:
        return None, "not computed: the reference is black"
    test, reference = (np.maximum(x, 0).astype(np.float32) for x in (left, right))
    kind = "LDR" if coded else "HDR"
    # both pictures are linear values, not sRGB codes
    mean = evaluate(reference, test, kind, inputsRGB=False, applyMagma=False)[1]
    return (float(mean), "") if np.isfinite(mean) else (None, "not computed: no exposure suits the pictures")
