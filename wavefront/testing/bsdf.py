"""Checks of a BSDF."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arrays.state import SurfaceInteraction
from ..arrays.vec import Bools, Doubles, Floats, f4
from ..bsdfs.base import Bsdf, BsdfSample
from .charts import CHARTS, uniform_directions
from .chi2 import binomial_p, check_density
from .report import PAIRS, PILOT, Report


@dataclass(frozen=True, slots=True)
class _View:
    """A material seen along one direction from one side."""

    bsdf: Bsdf
    wo: Floats  # (3, 1)
    back_facing: bool

    def __str__(self) -> str:
        angle = math.degrees(math.acos(min(1.0, float(self.wo[2, 0]))))
        return f"wo {angle:.4g}° {'inside' if self.back_facing else 'outside'}"

    def at(self, n: int) -> tuple[Bsdf, Floats]:
        """Return the material bound on n lanes, and wo (3, n)."""
        wo = np.repeat(self.wo, n, 1)
        return self.bsdf.bind(_surface(wo, np.full(n, self.back_facing))), wo

    def sample(self, u: Floats) -> BsdfSample:
        """Return samples for u (dimensions, n)."""
        bound, wo = self.at(u.shape[1])
        return bound.sample_f(wo, u)

    def f(self, wi: Floats) -> Floats:
        """Return f at wi (3, n)."""
        bound, wo = self.at(wi.shape[1])
        return bound.f(wo, wi)

    def pdf(self, wi: Floats) -> Floats:
        """Return the pdf at wi (3, n)."""
        bound, wo = self.at(wi.shape[1])
        return bound.pdf(wo, wi)


@dataclass(slots=True)
class _Lobe:
    """A delta lobe, as found from samples."""

    wi: Doubles  # (3,)
    probability: float
    albedo: Doubles  # (3,) weight · probability
    eta: float
    count: int


def check_bsdf(
    bsdf: Bsdf,
    *,
    samples: int = 1_000_000,
    angles: Sequence[float] = (0.0, 30.0, 60.0, 80.0, 89.0),
    reciprocal: bool = True,
    albedo: tuple[float, float] = (0.0, 1.0),
    significance: float = 1e-3,
    seed: int = 0,
) -> Report:
    """Check that a BSDF fulfills the contract of `wavefront.bsdfs.Bsdf`.

    Parameters
    ----------
    bsdf
        The material. A transmissive one is seen from both sides.
    samples
        Number of samples per direction in the statistical checks.
    angles
        Angles between `wo` and the normal, degrees in [0, 90).
    reciprocal
        Whether f(wo, wi)·η² = f(wi, wo) is expected, with η = ior beyond / before (1 in reflection).
    albedo
        Least and largest part of the light that may leave again, per channel: (1, 1) for a
        material that absorbs nothing.
    significance
        Probability that a correct material fails any of the statistical checks.
    seed
        Of the random numbers.

    Returns
    -------
    Report
        The worst value of each check; `print` it.

    Raises
    ------
    AssertionError
        With each failed check, its direction, and the measured and expected values.
    """
    report = Report(f"check_bsdf({type(bsdf).__name__})")
    sides = (False, True) if bsdf.transmissive else (False,)
    tests = 4 * len(angles) * len(sides)
    alpha = 1 - (1 - significance) ** (1 / tests)
    for number, (back_facing, angle) in enumerate(product(sides, angles)):
        view = _View(bsdf, _direction(angle, 0.7 + number), back_facing)
        rng = np.random.default_rng([seed, number])
        _check_view(report, view, rng, samples, alpha, albedo)
        if reciprocal and all(check.passed for check in report.checks.values()):
            _check_reciprocity(report, view, rng)
    return report.raise_if_failed()


def _direction(angle: float, phi: float) -> Floats:
    """Return the unit vector (3, 1) at an angle (degrees) from +z and an azimuth (radians)."""
    theta = math.radians(angle)
    x, y = math.sin(theta) * math.cos(phi), math.sin(theta) * math.sin(phi)
    return np.array([[x], [y], [math.cos(theta)]], f4)


def _surface(wo: Floats, back_facing: Bools) -> SurfaceInteraction:
    """Return hit points (n lanes) at the origin with normals +z, seen along wo (3, n)."""
    n = wo.shape[1]
    normal = np.repeat(np.array([[0], [0], [1]], f4), n, 1)
    zero, uv = np.zeros(n, f4), np.repeat(np.array([[0.3], [0.6]], f4), n, 1)
    color = np.repeat(np.array([[0.8], [0.5], [0.3], [0.6]], f4), n, 1)
    index = np.zeros(n, np.intp)
    surface = SurfaceInteraction(
        np.zeros((3, n), f4), zero, normal, normal, wo, index, index, back_facing, uv, uv, color
    )
    frame = np.zeros((6, n), f4)  # the back is seen after a turn by 180° about the tangent
    frame[0], frame[4] = 1, np.where(back_facing, f4(-1), f4(1))
    surface.tangent_frame = surface.tangent_frame1 = frame
    return surface


def _check_view(
    report: Report,
    view: _View,
    rng: np.random.Generator,
    samples: int,
    alpha: float,
    albedo: tuple[float, float],
) -> None:
    where = str(view)
    dimensions = view.bsdf.dimensions
    _check_arrays(report, view, rng)
    if view.bsdf.view_independent:
        _check_view_independent(report, view, rng)
    if view.bsdf.lambertian:
        _check_lambertian(report, view, rng)
    pilot = view.sample(rng.random((dimensions, PILOT), f4))
    points, lobes = [], list[_Lobe]()
    total, squares = np.zeros(3), np.zeros(3)
    for size in chunk_sizes(samples):
        drawn = view.sample(rng.random((dimensions, size), f4))
        _check_samples(report, view, drawn)
        carried = drawn.weight.astype(np.float64)
        if drawn.eta is not None:
            carried *= drawn.eta.astype(np.float64) ** 2  # converts radiance to energy
        total += carried.sum(1)
        squares += (carried**2).sum(1)
        if not _merge_lobes(lobes, drawn):
            report.add("delta lobes", where, len(lobes), "at most 16 directions", math.inf)
            return
        points.append(drawn.wi[:, (drawn.pdf > 0) & ~drawn.specular])
    drawn_points = np.concatenate(points, axis=1)
    _check_support(report, view, rng, drawn_points)
    mean = total / samples
    noise = np.sqrt(np.maximum(squares / samples - mean**2, 0) / samples)
    slack = 1e-3 + 4.5 * noise
    high, low = int(np.argmax(mean - slack)), int(np.argmin(mean + slack))
    report.at_most("albedo", where, float(mean[high]), albedo[1] + float(slack[high]))
    if albedo[0] > 0:
        text = f"at least {albedo[0] - slack[low]:.6g}"
        report.add("albedo (least)", where, mean[low], text, float((albedo[0] - mean[low]) / slack[low]))
    for lobe in lobes:
        copies = max(1, round(lobe.count / (samples * lobe.probability)))  # equal lobes
        p = binomial_p(lobe.count, samples, min(1.0, copies * lobe.probability))
        report.significant("delta lobe (binomial)", f"{where}, wi_z {lobe.wi[2]:.4g}", p, alpha)
    singular = min(1.0, sum(lobe.probability for lobe in lobes))
    pilot_wi = pilot.wi[:, (pilot.pdf > 0) & ~pilot.specular]
    check_density(report, where, CHARTS["sphere"], pilot_wi, drawn_points, samples, view.pdf, alpha, singular)


def chunk_sizes(n: int) -> Iterator[int]:
    """Split n into sizes of at most 2¹⁸."""
    for start in range(0, n, 1 << 18):
        yield min(1 << 18, n - start)


def _check_arrays(report: Report, view: _View, rng: np.random.Generator) -> None:
    """Check shapes and types, and that no lane depends on other lanes."""
    where, n = str(view), 1000
    u = rng.random((view.bsdf.dimensions, n), f4)
    w = uniform_directions(rng, n)

    bound, wo = view.at(n)
    for name, array, shape in (("f()", bound.f(wo, w), (3, n)), ("pdf()", bound.pdf(wo, w), (n,))):
        check_array(report, where, name, array, shape, f4)

    def run(lanes: slice) -> list[NDArray[Any]]:
        drawn = view.sample(np.ascontiguousarray(u[:, lanes]))
        w_part = np.ascontiguousarray(w[:, lanes])
        bound, wo = view.at(w_part.shape[1])
        f, pdf = bound.evaluate(wo, w_part)
        return [drawn.wi, drawn.weight, drawn.pdf, drawn.specular, view.f(w_part), view.pdf(w_part), f, pdf]

    eta = view.sample(u).eta
    if eta is not None:
        check_array(report, where, "eta", eta, (n,), f4)
    names = ["wi", "weight", "pdf", "specular", "f()", "pdf()", "evaluate() f", "evaluate() pdf"]
    rows = [3, 3, 0, 0, 3, 0, 3, 0]
    whole = run(slice(0, n))
    parts = [run(s) for s in (slice(0, 1), slice(1, 18), slice(18, n))]
    for k, (name, row) in enumerate(zip(names, rows, strict=True)):
        shape = (row, n) if row else (n,)
        dtype = np.bool_ if name == "specular" else f4
        check_array(report, where, name, whole[k], shape, dtype)
        joined = np.concatenate([piece[k] for piece in parts], axis=-1)
        report.holds("lanes independent", f"{where}, {name}", joined != whole[k], "the same bits")
    for k, (plain, joint) in enumerate(((4, 6), (5, 7))):
        error = np.abs(whole[plain] - whole[joint]) / np.maximum(np.abs(whole[plain]), 1e-20)
        report.at_most("evaluate = f, pdf", f"{where}, {('f', 'pdf')[k]}", float(error.max()), 1e-5)


def check_array(
    report: Report, where: str, name: str, array: Any, shape: tuple[int, ...], dtype: type[np.generic]
) -> None:
    """Check the shape and type of one array; without these, nothing else can be checked."""
    have, wanted = f"{np.asarray(array).dtype} {np.shape(array)}", f"{np.dtype(dtype)} {shape}"
    if have != wanted:
        raise AssertionError(
            f"{report.subject}: shape and type of {name} at {where}: measured {have}, expected {wanted}"
        )
    report.holds("shape and type", f"{where}, {name}", np.array(False), wanted)


def _check_view_independent(report: Report, view: _View, rng: np.random.Generator) -> None:
    """Check that no method of a view-independent BSDF reads wo."""
    n = 1000
    bound, wo = view.at(n)
    w, u = uniform_directions(rng, n), rng.random((bound.dimensions, n), f4)
    here, above = (
        [*bound.evaluate(v, w), bound.sample_f(v, u).wi, bound.sample_f(v, u).weight]
        for v in (wo, np.repeat(_direction(0, 0), n, 1))
    )
    for name, seen, straight in zip(("f", "pdf", "wi", "weight"), here, above, strict=True):
        report.holds(
            "view_independent", f"{view}, {name}", seen != straight, "the same bits as from straight above"
        )


def _check_lambertian(report: Report, view: _View, rng: np.random.Generator) -> None:
    """Check that f and the pdf are those of a Lambertian surface."""
    bound, wo = view.at(1000)
    wi = uniform_directions(rng, 1000)
    f, pdf = bound.evaluate(wo, wi)
    albedo = bound.albedo(wo)
    for name, seen, due in (
        ("f", f, albedo * (wi[2] > 0) / np.pi),
        ("pdf", pdf, np.maximum(wi[2], 0) / np.pi),
    ):
        report.at_most("lambertian", f"{view}, {name}", float(np.abs(seen - due).max()), 1e-6)


def _check_samples(report: Report, view: _View, drawn: BsdfSample) -> None:
    """Check the properties of single samples."""
    where = str(view)
    for name, values in (("wi", drawn.wi), ("weight", drawn.weight), ("pdf", drawn.pdf)):
        report.holds("finite", f"{where}, {name}", ~np.isfinite(values), "finite numbers")
    report.holds("not negative", f"{where}, weight", drawn.weight < 0, "at least 0")
    report.holds("not negative", f"{where}, pdf", drawn.pdf < 0, "at least 0")
    possible = drawn.pdf > 0
    carries = possible & (drawn.weight > 0).any(0)
    report.holds("pdf 0 has no weight", where, ~possible & (drawn.weight > 0).any(0), "weight 0")
    size = np.sqrt((drawn.wi[:, possible].astype(np.float64) ** 2).sum(0))
    report.at_most("unit length", where, float(np.abs(size - 1).max(initial=0)), 1e-5)
    if not view.bsdf.transmissive:
        report.holds("no transmission", where, carries & (drawn.wi[2] < 0), "wi above the surface")
    elif drawn.eta is not None:
        above = possible & (drawn.wi[2] > 0) & (drawn.eta != 1)
        report.holds("eta", where, above | ~(drawn.eta > 0), "1 above, more than 0 below")
    if view.bsdf.specular:
        report.holds("specular samples", where, possible & ~drawn.specular, "all specular")
    report.holds("delta probability", where, drawn.specular & (drawn.pdf > 1 + 1e-6), "at most 1")
    lanes = np.flatnonzero(possible & ~drawn.specular)[: 1 << 16]
    if not len(lanes):
        return
    wi = np.ascontiguousarray(drawn.wi[:, lanes])
    f, pdf = view.f(wi).astype(np.float64), view.pdf(wi).astype(np.float64)
    weight, drawn_pdf = drawn.weight[:, lanes], drawn.pdf[lanes]
    error = np.abs(drawn_pdf / np.maximum(pdf, 1e-300) - 1)
    k = int(np.argmax(error))
    report.near(
        "sample pdf / pdf()", f"{where}, {_text(wi[:, k])}", drawn_pdf[k] / max(pdf[k], 1e-300), 1.0, 1e-5
    )
    exact = f * np.abs(wi[2].astype(np.float64)) / drawn_pdf
    scale = np.maximum(exact.max(0), 1e-20)
    error = np.abs(weight - exact) / scale
    c, k = divmod(int(np.argmax(error)), error.shape[1])
    expected = f"f·cos/pdf = {exact[c, k]:.7g}"
    report.add(
        "weight", f"{where}, {_text(wi[:, k])}", float(weight[c, k]), expected, float(error[c, k]) / 1e-5
    )


def _text(w: Floats) -> str:
    return "wi (" + ", ".join(f"{x:.4g}" for x in w) + ")"


def _check_support(report: Report, view: _View, rng: np.random.Generator, points: Floats) -> None:
    """Check that f is finite and not negative, and the pdf is positive where f is."""
    where = str(view)
    for w in (uniform_directions(rng, 1 << 16), points[:, : 1 << 16]):
        f, pdf = view.f(w), view.pdf(w)
        for name, values in (("f", f), ("pdf", pdf)):
            report.holds("finite", f"{where}, {name}()", ~np.isfinite(values), "finite numbers")
            report.holds("not negative", f"{where}, {name}()", values < 0, "at least 0")
        positive = (f > 0).any(0)
        missed = np.flatnonzero(positive & ~(pdf > 0))
        text = f"{where}, {_text(w[:, missed[0]])}" if len(missed) else where
        report.holds("pdf > 0 where f > 0", text, positive & ~(pdf > 0), "none missed")
        if not view.bsdf.transmissive:
            report.holds("no transmission", f"{where}, f()", positive & (w[2] < 0), "f 0 below")
        if view.bsdf.specular:
            report.holds("delta f and pdf", where, positive | (pdf > 0), "0 everywhere")


def _merge_lobes(lobes: list[_Lobe], drawn: BsdfSample, limit: int = 16) -> bool:
    """Count specular samples by lobe; return whether there are at most `limit` lobes."""
    eta = np.ones_like(drawn.pdf) if drawn.eta is None else drawn.eta
    left = np.flatnonzero(drawn.specular & (drawn.pdf > 0))
    while len(left):
        k = left[0]
        wi, p, weight = drawn.wi[:, k], float(drawn.pdf[k]), drawn.weight[:, k]
        same = np.abs(drawn.wi[:, left] - wi[:, None]).max(0) < 1e-5
        same &= np.abs(drawn.pdf[left] - p) <= 1e-5 * p
        same &= np.abs(drawn.weight[:, left] - weight[:, None]).max(0) <= 1e-5 * weight.max()
        new = _Lobe(wi.astype(np.float64), p, p * weight.astype(np.float64), float(eta[k]), int(same.sum()))
        known = [lobe for lobe in lobes if _alike(lobe, new)]
        if known:
            known[0].count += new.count
        elif len(lobes) == limit:
            return False
        else:
            lobes.append(new)
        left = left[~same]
    return True


def _alike(a: _Lobe, b: _Lobe) -> bool:
    close = np.abs(a.wi - b.wi).max() < 1e-5 and abs(a.probability - b.probability) <= 1e-5 * a.probability
    return bool(close and np.abs(a.albedo - b.albedo).max() <= 1e-5 * max(a.albedo.max(), 1e-30))


def _check_reciprocity(report: Report, view: _View, rng: np.random.Generator) -> None:
    """Check that exchanging wo and wi changes f only by the square of the relative index."""
    drawn = view.sample(rng.random((view.bsdf.dimensions, PAIRS), f4))
    eta = np.ones_like(drawn.pdf) if drawn.eta is None else drawn.eta
    lanes = np.flatnonzero((drawn.pdf > 0) & ~drawn.specular & (np.abs(drawn.wi[2]) > 1e-3))
    up = uniform_directions(rng, PAIRS)
    up[2] = np.maximum(np.abs(up[2]), 1e-3)
    up /= np.sqrt((up * up).sum(0))
    wi = np.concatenate([drawn.wi[:, lanes], up], axis=1)
    eta = np.concatenate([eta[lanes], np.ones(PAIRS, f4)])
    wo = np.repeat(view.wo, wi.shape[1], 1)
    across = wi[2] < 0
    bound = view.bsdf.bind(_surface(wo, np.full(wi.shape[1], view.back_facing)))
    forth = bound.f(wo, wi).astype(np.float64) * eta.astype(np.float64) ** 2
    wo2, wi2 = _swap(wo, wi)
    back = view.bsdf.bind(_surface(wo2, across ^ view.back_facing)).f(wo2, wi2).astype(np.float64)
    scale = np.maximum(np.maximum(forth, back).max(0), 1e-12)
    error = np.abs(forth - back).max(0) / scale
    # Near grazing angles some cosines have few digits in float32: one pair in a hundred may differ by more
    # than 0.3 %, none by more than 5 %.
    order = np.argsort(error)
    for name, k, limit in (
        ("reciprocity", order[int(0.99 * (len(order) - 1))], 3e-3),
        ("reciprocity (all)", order[-1], 0.05),
    ):
        report.at_most(name, f"{view}, {_text(wi[:, k])}", float(error[k]), limit)
    _check_delta_reciprocity(report, view, rng, drawn)


def _swap(wo: Floats, wi: Floats) -> tuple[Floats, Floats]:
    """Return wi and wo (3, n) exchanged, rotated by 180° about x where wi is below the surface."""
    turn = np.where(wi[2] < 0, f4(-1), f4(1)) * np.array([[1], [1], [1]], f4)
    turn[0] = 1
    return wi * turn, wo * turn


def _check_delta_reciprocity(
    report: Report, view: _View, rng: np.random.Generator, drawn: BsdfSample
) -> None:
    lobes = list[_Lobe]()
    _merge_lobes(lobes, drawn)
    for lobe in lobes:
        wo, wi = _swap(view.wo, lobe.wi.reshape(3, 1).astype(f4))
        across = lobe.wi[2] < 0
        other = _View(view.bsdf, wo, view.back_facing ^ bool(across))
        back = list[_Lobe]()
        _merge_lobes(back, other.sample(rng.random((view.bsdf.dimensions, 1 << 16), f4)))
        forth = sum((a.albedo * a.eta**2 for a in lobes if np.abs(a.wi - lobe.wi).max() < 1e-3), np.zeros(3))
        there = sum((a.albedo * a.eta**2 for a in back if np.abs(a.wi - wi[:, 0]).max() < 2e-3), np.zeros(3))
        error = float(np.abs(forth - there).max())
        report.at_most("delta reciprocity", f"{view}, wi_z {lobe.wi[2]:.4g}", error, 2e-3)
