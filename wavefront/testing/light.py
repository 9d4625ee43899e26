"""Checks of a light."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..accel import make_accelerator
from ..arrays.state import Rays
from ..arrays.vec import Floats, f4
from ..compile.scene import CompiledScene
from ..features.compiling import compile_scene
from ..lights.base import LightRecord, LightSample, emitters_of
from ..scene import Scene
from ..stages.interaction import interaction
from ..stages.intersect import intersect
from .bsdf import check_array, chunk_sizes
from .charts import CHARTS
from .chi2 import check_density
from .report import PILOT, Report

ARRAYS = 100  # samples of which shapes and types are checked


def check_light(
    light: Any,
    *,
    points: ArrayLike | None = None,
    samples: int = 1_000_000,
    significance: float = 1e-3,
    seed: int = 0,
) -> Report:
    """Check that a light keeps the contract of `LightRecord`.

    Parameters
    ----------
    light
        A `Light`, or a `LightRecord`, of which every column (the first eight) is checked. Where radiance
        varies over its `shape`, points on the shape are found as in a render.
    points
        (m, 3) points that are lit, scene units; five points around the origin by default. They
        must not lie on the light itself.
    samples, significance, seed
        As for `check_bsdf`.

    Returns
    -------
    Report
        The worst value of each check; `print` it.

    Raises
    ------
    AssertionError
        With each failed check, its point, and the measured and expected values.
    SceneError
        If `emitters` returns something else than `Emitters` has.
    """
    record = light if isinstance(light, LightRecord) else light.record(np.zeros(3))
    compiled = None
    if light.shape is not None:
        compiled = compile_scene(Scene([light.shape], [light]), partial(make_accelerator, accel="numpy"))
        record = light.record(compiled.center)
    emitters_of(record)
    report = Report(f"check_light({type(light).__name__})")
    default = [[0, 0, 0], [2, 1, 3], [-3, 2, -1], [0.5, -4, 1], [20, 10, -30]]
    where = np.asarray(default if points is None else points, np.float64).reshape(-1, 3)
    center = np.zeros(3) if compiled is None else compiled.center
    columns = min(len(record), 8)
    alpha = 1 - (1 - significance) ** (1 / (columns * len(where)))
    for k in range(columns):
        column = record.take(np.array([k]))
        for number, point in enumerate(where):
            rng = np.random.default_rng([seed, k, number])
            name = f"light {k}, point (" + ", ".join(f"{x:.4g}" for x in point) + ")"
            at = (point - center).astype(f4).reshape(3, 1)
            _check_light_at(report, name, column, at, rng, samples, alpha, compiled)
    return report.raise_if_failed()


def _check_light_at(
    report: Report,
    where: str,
    light: LightRecord,
    point: Floats,
    rng: np.random.Generator,
    samples: int,
    alpha: float,
    compiled: CompiledScene | None,
) -> None:
    def radiance(w: Floats) -> Floats:
        if compiled is None or not np.any(light.varies):
            return light.le(w)
        rays = Rays(np.repeat(point, w.shape[1], 1), w, np.full(w.shape[1], -1, np.intp))
        hits = intersect(compiled, rays)
        lanes, out = hits.found, np.zeros_like(w)
        surface = interaction(compiled, rays.take(lanes), hits.take(lanes))
        out[:, lanes] = light.le(w.take(lanes, 1), surface)
        return out

    def draw(n: int) -> LightSample:
        return light.sample_li(np.repeat(point, n, 1), rng.random((2, n), f4))

    def density(w: Floats) -> Floats:
        return light.pdf_li(np.repeat(point, w.shape[1], 1), w)

    _check_arrays(report, where, draw(ARRAYS), density, radiance)
    points = []
    for size in chunk_sizes(samples):
        drawn = draw(size)
        _check_light_samples(report, where, light, drawn, density, radiance)
        points.append(drawn.wi[:, drawn.pdf > 0])
    if light.delta:
        return
    pilot = draw(PILOT)
    pilot_wi = pilot.wi[:, pilot.pdf > 0]
    joined = np.concatenate(points, axis=1)
    check_density(report, where, CHARTS["sphere"], pilot_wi, joined, samples, density, alpha)


def _check_arrays(
    report: Report,
    where: str,
    drawn: LightSample,
    density: Callable[[Floats], Floats],
    radiance: Callable[[Floats], Floats],
) -> None:
    """Check shapes and types; accelerators take no others than float32."""
    for name, rows in (("wi", 3), ("distance", 0), ("radiance", 3), ("pdf", 0)):
        array, shape = getattr(drawn, name), (3, ARRAYS) if rows else (ARRAYS,)
        check_array(report, where, f"sample_li().{name}", array, shape, f4)
    wi = np.ascontiguousarray(drawn.wi)
    check_array(report, where, "pdf_li()", density(wi), (ARRAYS,), f4)
    check_array(report, where, "le()", radiance(wi), (3, ARRAYS), f4)


def _check_light_samples(
    report: Report,
    where: str,
    light: LightRecord,
    drawn: LightSample,
    density: Callable[[Floats], Floats],
    radiance: Callable[[Floats], Floats],
) -> None:
    for name, values in (("wi", drawn.wi), ("radiance", drawn.radiance), ("pdf", drawn.pdf)):
        report.holds("finite", f"{where}, {name}", ~np.isfinite(values), "finite numbers")
    report.holds("not negative", f"{where}, radiance", drawn.radiance < 0, "at least 0")
    report.holds("not negative", f"{where}, pdf", drawn.pdf < 0, "at least 0")
    possible = drawn.pdf > 0
    if not possible.any():
        return
    wi = np.ascontiguousarray(drawn.wi[:, possible])
    size = np.sqrt((wi.astype(np.float64) ** 2).sum(0))
    report.at_most("unit length", where, float(np.abs(size - 1).max()), 1e-5)
    short = float(np.mean(~(drawn.distance[possible] > 0)))
    report.at_most("distance not above 0", where, short, 1e-3)
    pdf, le = density(wi), radiance(wi)
    if light.delta:
        report.holds("delta pdf", where, drawn.pdf[possible] != 1, "1")
        report.holds("delta pdf_li, le", where, (pdf != 0) | (le != 0).any(0), "0")
        return
    # Rays to samples on the edge of a light may miss it, so a few lanes may differ.
    ratio = np.abs(pdf - drawn.pdf[possible]) > 1e-3 * drawn.pdf[possible]
    report.at_most("sample pdf ≠ pdf_li", where, float(ratio.mean()), 1e-3)
    # Rounding of wi moves it within an image, where what is dark may lie beside what is bright.
    scale = np.maximum(le, max(float(le.mean()), 1e-20))
    differs = (np.abs(le - drawn.radiance[:, possible]) > 1e-4 * scale).any(0)
    report.at_most("radiance ≠ le", where, float(differs.mean()), 1e-3)
