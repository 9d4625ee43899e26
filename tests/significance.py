"""Significance tests: is a mean the exact one, and do two images have the same mean?

Every test asks two things. The difference must not be significant, at a level that lets the
whole suite raise a false alarm less than once in a hundred choices of seeds; and the standard
error must be below a stated bound, so that no test passes by being noisy. Seeds are fixed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import stats

import wavefront as wf

ALPHA = 1e-4  # probability that a correct estimator fails one test
ROUNDING = 1e-5  # relative; what float32 may do to a mean that has no noise
SIDE = 8  # 8 × 8 pixels are 64 batches

Doubles = NDArray[np.float64]


@dataclass(frozen=True)
class Mean:
    """The mean of independent batches."""

    value: float
    error: float  # standard error
    batches: int

    @classmethod
    def of(cls, batches: Doubles) -> Mean:
        """Summarize the means of batches (k,)."""
        return cls(float(batches.mean()), float(batches.std(ddof=1) / np.sqrt(batches.size)), batches.size)

    def __str__(self) -> str:
        return f"{self.value:.6g} ± {self.error:.2g}"


def render(scene: wf.Scene, spp: int | None = None, **options) -> wf.Image:
    """Render on one thread with the accelerator that is always there."""
    return wf.render(scene, spp, **{"workers": 1, "progress": False, "accel": "numpy", **options})


def measure(scene: wf.Scene, spp: int, **options) -> Mean:
    """Render a camera whose pixels all see one thing: each is an independent batch."""
    image = render(scene, spp, **options)
    return Mean.of(image.rgb.reshape(-1, 3).mean(1, dtype=np.float64))


def assert_mean(
    mean: Mean, expected: float, max_error: float, sigmas: float | None = None, rounding: float = ROUNDING
) -> None:
    """Student's t test of a mean against its exact value.

    `max_error` bounds the standard error, relative to the value. `sigmas` replaces the critical
    value that belongs to ALPHA. `rounding` is what float32 may do, relative.
    """
    assert mean.error <= max_error * expected, f"too noisy: {mean}, must be within {max_error:.2%}"
    critical = sigmas or float(stats.t.ppf(1 - ALPHA / 2, mean.batches - 1))
    off = abs(mean.value - expected)
    assert off <= critical * mean.error + rounding * expected, (
        f"expected {expected:.6g}, got {mean}: {off / max(mean.error, 1e-30):.1f} standard errors, "
        f"{mean.value / expected - 1:+.3%}"
    )


def repeat(scene: wf.Scene, spp: int, runs: int = 16, first_seed: int = 0, **options) -> Doubles:
    """Render with several seeds: (runs, H, W, 3)."""
    images = [render(scene, spp, seed=first_seed + k, **options).rgb for k in range(runs)]
    return np.stack(images).astype(np.float64)


def blocks(runs: Doubles, side: int = 8) -> Doubles:
    """Average runs (k, H, W, 3) over blocks of side × side pixels: (k, H / side, W / side, 3)."""
    k, h, w, c = runs.shape
    return runs.reshape(k, h // side, side, w // side, side, c).mean((2, 4))


def smallest_p(a: Doubles, b: Doubles | float) -> float:
    """Welch's t test of every cell of (k, ...) against (m, ...) or exact values, Šidák-corrected.

    Differences below rounding never count.
    """
    mean_a, var_a = a.mean(0), a.var(0, ddof=1) / len(a)
    if isinstance(b, np.ndarray):
        mean_b, var_b, runs_b = b.mean(0), b.var(0, ddof=1) / len(b), len(b)
    else:
        mean_b, var_b, runs_b = np.full_like(mean_a, b), np.zeros_like(mean_a), 2
    var = var_a + var_b
    off = np.maximum(np.abs(mean_a - mean_b) - ROUNDING * np.abs(mean_b), 0)
    freedom = var**2 / np.maximum(var_a**2 / (len(a) - 1) + var_b**2 / (runs_b - 1), 1e-300)
    t = off / np.sqrt(np.maximum(var, 1e-300))
    p = np.where(off > 0, 2 * stats.t.sf(t, np.maximum(freedom, 1)), 1.0)
    return float(-np.expm1(p.size * np.log1p(-min(float(p.min()), 0.5))))


def assert_same_images(a: Doubles, b: Doubles | float, max_error: float) -> None:
    """Compare the means of runs (k, H, W, 3) at global, block and pixel level.

    `max_error` bounds the relative standard error of the global mean of both.
    """
    for runs in (a, b):
        if isinstance(runs, np.ndarray):
            mean = Mean.of(runs.mean((1, 2, 3)))
            assert mean.error <= max_error * mean.value, f"too noisy: {mean}, must be within {max_error:.2%}"
    other = isinstance(b, np.ndarray)
    levels = {
        "global": (a.mean((1, 2)), b.mean((1, 2)) if other else b),
        "block": (blocks(a), blocks(b) if other else b),
        "pixel": (a, b),
    }
    for name, (left, right) in levels.items():
        p = smallest_p(left, right)
        right_mean = np.mean(right)
        assert p > ALPHA, f"{name} means differ: p = {p:.1e}, overall {left.mean():.6g} and {right_mean:.6g}"


def channels(scene: wf.Scene, spp: int, **options) -> list[Mean]:
    """The means of the channels of a probe."""
    image = render(scene, spp, **options).rgb.reshape(-1, 3).astype(np.float64)
    return [Mean.of(each) for each in image.T]
