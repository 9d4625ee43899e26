"""Measures of the difference between two pictures."""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from .codecs.encoding import codes_to_linear
from .codecs.png_jpeg import EXTENSIONS
from .errors import SceneError
from .film import EPSILON
from .image import Image, three_channels
from .vec import Doubles

Picture: TypeAlias = Image | ArrayLike | str | os.PathLike[str]


@dataclass(frozen=True, slots=True)
class Comparison:
    """Difference of picture a from the reference b, over linear values of all pixels and channels.

    `print` shows it as a table.
    """

    relative_mse: float  # mean of (a − b)²/(b² + ε), ε = 0.01 · mean(b)²
    rmse: float  # root of the mean of (a − b)²
    psnr: float  # dB: 20 · log₁₀(largest value of b / rmse); inf for equal pictures
    mean_a: Doubles  # (3,) mean of each channel
    mean_b: Doubles  # (3,)
    flip: float | None  # mean FLIP error, 0 to 1; None where it could not be computed
    flip_absent: str  # the reason why it is None
    difference: Image = field(repr=False)  # |a − b|

    def __str__(self) -> str:
        """Return a table of all numbers."""
        rows = [
            ("relative MSE", f"{self.relative_mse:.6g} (relative error {self.relative_mse**0.5:.3%})"),
            ("RMSE", f"{self.rmse:.6g}"),
            ("PSNR", f"{self.psnr:.2f} dB"),
            ("mean of a", "  ".join(f"{x:.6g}" for x in self.mean_a)),
            ("mean of b", "  ".join(f"{x:.6g}" for x in self.mean_b)),
            ("FLIP", self.flip_absent if self.flip is None else f"{self.flip:.6g}"),
        ]
        return "\n".join(f"{name:<13} {value}" for name, value in rows)


def compare(a: Picture, b: Picture) -> Comparison:
    """Measure the difference of picture `a` from the reference `b`.

    Relative MSE divides by the reference, so dark parts count as much as bright ones; ε limits the weight of
    black pixels. Its root is the error that `render(noise=...)` limits. Source: F.
    Rousselle, C. Knaus and M. Zwicker, Adaptive Sampling and Reconstruction using Greedy Error
    Minimization, 2011, there with a fixed ε for pictures in [0, 1].

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
    """
    left, right = _pixels("a", a), _pixels("b", b)
    if left.shape != right.shape:
        sizes = " and ".join(f"{x.shape[1]}x{x.shape[0]}" for x in (left, right))
        raise SceneError(f"pictures of different sizes cannot be compared: {sizes}")
    squared = np.square(left - right)
    rmse = float(np.sqrt(squared.mean()))
    flip, reason = _flip(left, right, coded=_is_coded(a) and _is_coded(b))
    return Comparison(
        relative_mse=float((squared / (np.square(right) + (EPSILON * right.mean() ** 2 or 1.0))).mean()),
        rmse=rmse,
        psnr=_decibels(float(right.max()), rmse),
        mean_a=left.mean((0, 1)),
        mean_b=right.mean((0, 1)),
        flip=flip,
        flip_absent=reason,
        difference=Image(np.abs(left - right).astype(np.float32)),
    )


def _decibels(peak: float, rmse: float) -> float:
    if rmse == 0:
        return np.inf
    return 20 * float(np.log10(peak / rmse)) if peak > 0 else -np.inf


def _is_coded(picture: Picture) -> bool:
    """Return whether a picture is made of 8- or 16-bit codes."""
    if isinstance(picture, str | os.PathLike):
        return Path(picture).suffix.lower() in EXTENSIONS
    return getattr(picture, "dtype", None) in (np.uint8, np.uint16)


def _pixels(name: str, picture: Picture) -> Doubles:
    """Return linear values, (H, W, 3)."""
    values: Any = picture
    if isinstance(picture, str | os.PathLike):
        name, values = os.fspath(picture), Image.load(picture).rgb
    elif isinstance(picture, Image):
        values = picture.rgb
    try:
        pixels = np.asarray(values)
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
        raise SceneError(f"{name} has {len(bad)} values that are not finite, the first at x={x}, y={y}")
    return colors


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
