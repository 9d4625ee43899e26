"""Checks that prove a material, a light or a warp correct: one call for your own class.

>>> import wavefront as wf
>>> print(wf.testing.check_bsdf(MyMaterial(0.5)))          # doctest: +SKIP

All rest on one harness. Samples are counted in 20×40 cells and compared by a χ² test with the
integrals of the pdf over those cells. χ² is blind to some errors, so the properties that it
cannot see are tested beside it. Every check is deterministic for a given seed.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .bsdfs.base import Bsdf, BsdfSample
from .lights.base import Light, LightSample
from .state import Surface
from .vec import Bools, Floats, Ints, f4

__all__ = ["Check", "Report", "check_bsdf", "check_light", "check_warp"]

Doubles = NDArray[np.float64]
ROWS, COLUMNS = 20, 40
PILOT = 20_000
PAIRS = 4096


# --- Reports -------------------------------------------------------------------------------------


@dataclass(slots=True)
class Check:
    """The worst result of one check over all directions or points."""

    name: str
    where: str  # the direction or point of the worst result
    measured: float
    expected: str
    badness: float  # distance from the expected value in units of the tolerance; at most 1 passes

    @property
    def passed(self) -> bool:
        """Whether the result is within its tolerance (NaN is not)."""
        return self.badness <= 1

    def __str__(self) -> str:
        """One line: verdict, name, worst value, what was expected, where."""
        verdict = "ok  " if self.passed else "FAIL"
        return f"{verdict} {self.name:<22} {self.measured:>12.6g}   {self.expected:<28} {self.where}"


@dataclass(slots=True)
class Report:
    """What was checked, and how close each check was."""

    subject: str
    checks: dict[str, Check] = field(default_factory=dict)

    def add(self, name: str, where: str, measured: float, expected: str, badness: float) -> None:
        """Keep this result if it is the worst so far under its name."""
        known = self.checks.get(name)
        if known is None or not badness <= known.badness:
            self.checks[name] = Check(name, where, float(measured), expected, float(badness))

    def near(self, name: str, where: str, measured: float, expected: float, tolerance: float) -> None:
        """Check that |measured − expected| ≤ tolerance."""
        text = f"{expected:.6g} ± {tolerance:.2g}"
        self.add(name, where, measured, text, abs(measured - expected) / tolerance)

    def at_most(self, name: str, where: str, measured: float, limit: float) -> None:
        """Check that measured ≤ limit."""
        ratio = measured / limit if limit > 0 else (0.0 if measured <= 0 else math.inf)
        self.add(name, where, measured, f"at most {limit:.6g}", ratio)

    def significant(self, name: str, where: str, p: float, alpha: float) -> None:
        """Check that a p-value is not below alpha."""
        badness = math.log(max(p, 1e-300)) / math.log(alpha)
        self.add(name, where, p, f"p at least {alpha:.2g}", badness)

    def holds(self, name: str, where: str, bad: Bools, expected: str) -> None:
        """Check that no lane is bad; the value is how many are."""
        count = int(np.count_nonzero(bad))
        self.add(name, where, count, expected, math.inf if count else 0.0)

    def raise_if_failed(self) -> Report:
        """Raise AssertionError naming every failed check, else return the report."""
        failed = [c for c in self.checks.values() if not c.passed]
        if failed:
            lines = [
                f"{self.subject}: {c.name} at {c.where}: measured {c.measured:.7g}, expected {c.expected}"
                for c in failed
            ]
            raise AssertionError("\n".join([*lines, "", str(self)]))
        return self

    def __str__(self) -> str:
        """One line per check."""
        return "\n".join([self.subject, *(f"  {c}" for c in self.checks.values())])


# --- Charts: the unit square laid over a domain, with a constant area ratio -------------------------


@dataclass(frozen=True, slots=True)
class Chart:
    """An equal-area map between the unit square and a domain."""

    to_square: Callable[[Floats], Doubles]  # points (d, n) -> (2, n)
    to_points: Callable[[Doubles], Floats]  # (2, n) -> points (d, n)
    area: float  # of the domain
    seams: tuple[float, ...] = (0.0, 1.0)  # rows never cross these first coordinates


def _turn(x: Doubles, y: Doubles) -> Doubles:
    """Return the angle of (x, y) as a fraction of a turn in [0, 1)."""
    turn = np.arctan2(y, x) / (2 * np.pi)
    turn[turn < 0] += 1
    return np.minimum(turn, np.nextafter(1.0, 0.0))


def _sphere_to_square(w: Floats) -> Doubles:
    x, y, z = w.astype(np.float64)
    r2 = x * x + y * y
    # Near the poles 1 − cosθ is known from x and y far better than from z.
    cos = np.where(r2 < 0.5, np.copysign(np.sqrt(np.maximum(1 - r2, 0)), z), z)
    return np.stack([np.clip((cos + 1) / 2, 0, 1), _turn(x, y)])


def _square_to_sphere(p: Doubles) -> Floats:
    cos = 2 * p[0] - 1
    sin = 2 * np.sqrt(p[0] * (1 - p[0]))
    phi = 2 * np.pi * p[1]
    return np.stack([sin * np.cos(phi), sin * np.sin(phi), cos]).astype(f4)


def _disk_to_square(p: Floats) -> Doubles:
    x, y = p.astype(np.float64)
    return np.stack([np.clip(x * x + y * y, 0, 1), _turn(x, y)])


def _square_to_disk(p: Doubles) -> Floats:
    radius, phi = np.sqrt(p[0]), 2 * np.pi * p[1]
    return np.stack([radius * np.cos(phi), radius * np.sin(phi)]).astype(f4)


def _triangle_to_square(b: Floats) -> Doubles:
    total = b[0].astype(np.float64) + b[1]
    return np.stack([np.clip(total**2, 0, 1), b[0] / np.maximum(total, 1e-30)])


def _square_to_triangle(p: Doubles) -> Floats:
    total = np.sqrt(p[0])
    return np.stack([total * p[1], total * (1 - p[1])]).astype(f4)


CHARTS = {
    "sphere": Chart(_sphere_to_square, _square_to_sphere, 4 * np.pi, (0.0, 0.5, 1.0)),
    "disk": Chart(_disk_to_square, _square_to_disk, np.pi),
    "triangle": Chart(_triangle_to_square, _square_to_triangle, 0.5),
    "square": Chart(lambda p: p.astype(np.float64), lambda p: p.astype(f4), 1.0),
}


# --- Cells and their expected counts ----------------------------------------------------------------


@dataclass(slots=True)
class Cells:
    """A grid on the unit square: rows of the first coordinate, each with its own columns."""

    rows: Doubles  # (ROWS + 1,) edges
    columns: Doubles  # (ROWS, COLUMNS + 1) edges within each row

    @classmethod
    def around(cls, pilot: Doubles, seams: Sequence[float]) -> Cells:
        """Lay cells by the quantiles of half a uniform density and half the pilot (2, m).

        Smooth densities get nearly uniform cells; of a sharp lobe every part gets its share.
        """
        per_band = ROWS // (len(seams) - 1)
        bands = [
            _quantiles(pilot[0][(pilot[0] >= a) & (pilot[0] < b)], a, b, per_band)[:-1]
            for a, b in pairwise(seams)
        ]
        rows = np.append(np.concatenate(bands), seams[-1])
        where = np.clip(np.searchsorted(rows, pilot[0], "right") - 1, 0, ROWS - 1)
        columns = [_quantiles(pilot[1][where == r], 0.0, 1.0, COLUMNS) for r in range(ROWS)]
        return cls(rows, np.stack(columns))

    def find(self, p: Doubles) -> Ints:
        """Return the cell of each point (2, n), (n,)."""
        row = np.clip(np.searchsorted(self.rows, p[0], "right") - 1, 0, ROWS - 1)
        edges = (np.arange(ROWS)[:, None] + self.columns[:, :-1]).ravel()
        return np.searchsorted(edges, row + np.minimum(p[1], np.nextafter(1.0, 0.0)), "right") - 1

    def rectangles(self) -> Doubles:
        """Return the corners (a0, a1, b0, b1) of all cells, (4, ROWS·COLUMNS)."""
        a0 = np.repeat(self.rows[:-1], COLUMNS)
        a1 = np.repeat(self.rows[1:], COLUMNS)
        return np.stack([a0, a1, self.columns[:, :-1].ravel(), self.columns[:, 1:].ravel()])


def _quantiles(x: Doubles, low: float, high: float, parts: int) -> Doubles:
    """Split [low, high] by the quantiles of half a uniform density and half the values x."""
    x = np.unique(np.clip(x, low, high))
    x = np.concatenate([[low], x[(x > low) & (x < high)], [high]])
    cdf = 0.5 * (x - low) / (high - low) + 0.5 * np.linspace(0, 1, len(x))
    return np.interp(np.linspace(0, 1, parts + 1), cdf, x)


# Five points near those of Gauss and Lobatto, the outer ones just within the ends: boxes of which
# an edge cuts off only a corner are noticed, and no point lies on the horizon. Weights: exact for
# polynomials of degree 5.
NODES = np.array([0.003, 0.175, 0.5, 0.825, 0.997])
WEIGHTS = np.linalg.solve(NODES ** np.arange(5)[:, None], 1 / np.arange(1, 6))


@dataclass(slots=True)
class _Integrator:
    """Adaptive integrals of a density over boxes of the unit square.

    Samples guide it: where one finds a density far above all nodes of its box, the nodes have
    missed something sharp, and the box is split. Their number plays no part in the integral.
    """

    density: Callable[[Floats], Floats]
    chart: Chart
    guide: Doubles  # (2, g) samples on the unit square
    height: Doubles  # (g,) the density there

    def cells(self, cells: Cells, tolerance: float = 1e-5) -> tuple[Doubles, float]:
        """Return the integral over each cell, (ROWS·COLUMNS,), and the error left in their sum."""
        boxes, owner = self._around_samples(cells.rectangles(), cells.find(self.guide))
        home = self._locate(boxes, owner, cells.find(self.guide))
        total = np.zeros(ROWS * COLUMNS)
        coarse, _, across, _ = self._quadrature(boxes)
        unresolved = 0.0
        for level in range(60):
            halves = _halves(boxes, across)
            parts, peak, turned, edges = self._quadrature(halves)
            parts, peak = parts.reshape(2, -1), peak.reshape(2, -1).max(0)
            fine = parts.sum(0)
            error, edge = np.abs(fine - coarse), edges.reshape(2, -1).sum(0)
            keep = _least(error, tolerance / 5) | (error <= 2e-5 * fine)
            area = np.maximum((boxes[1] - boxes[0]) * (boxes[3] - boxes[2]) * self.chart.area, 1e-300)
            highest = self._highest(home, len(fine))
            missed = highest > 3 * peak
            # Two coarse integrals agree by chance on a lobe that fills a small part of a box.
            split = missed | (highest > 9 * fine / area) | ~keep | ~_least(edge, tolerance)
            if level == 59 or np.count_nonzero(split) > 30_000:
                unresolved, split = float((error + edge)[split].sum()), np.zeros_like(split)
            np.add.at(total, owner[~split], fine[~split])
            if not split.any():
                break
            home = self._descend(home, boxes, across, split)
            both = np.tile(split, 2)
            turned = np.where(np.tile(missed, 2), level % 2 == 0, turned)  # their values tell nothing
            boxes, across = halves[:, both], turned[both]
            coarse = parts[:, split].ravel()
            owner = np.tile(owner[split], 2)
        return total, unresolved

    def _quadrature(self, boxes: Doubles) -> tuple[Doubles, Doubles, Bools, Doubles]:
        """Integrate over boxes (4, m) by 5×5 points.

        Returns the integrals, the largest values, whether the density varies more along the first
        coordinate than along the second, and an error for boxes that the density's edge goes
        through, which two coarse integrals may well agree on; each (m,).
        """
        a0, a1, b0, b1 = boxes
        out, peak = np.empty(boxes.shape[1]), np.empty(boxes.shape[1])
        across, edge = np.empty(boxes.shape[1], np.bool_), np.zeros(boxes.shape[1])
        for start in range(0, len(out), 4096):
            part = slice(start, start + 4096)
            a = a0[part, None] + (a1 - a0)[part, None] * NODES
            b = b0[part, None] + (b1 - b0)[part, None] * NODES
            p = np.stack([np.repeat(a, 5, 1).ravel(), np.tile(b, 5).ravel()])
            values = self.density(self.chart.to_points(p)).astype(np.float64).reshape(-1, 5, 5)
            area = ((a1 - a0) * (b1 - b0))[part] * self.chart.area
            out[part] = ((values @ WEIGHTS) @ WEIGHTS) * area
            peak[part] = values.max((1, 2))
            along_a, along_b = (np.abs(np.diff(values, axis=k)).sum((1, 2)) for k in (1, 2))
            across[part] = along_a >= along_b
            edge[part] = np.where((values == 0).any((1, 2)), 0.02 * peak[part] * area, 0)
        return out, peak, across, edge

    def _highest(self, home: Ints, boxes: int) -> Doubles:
        """Return the largest density among the samples of each box, (boxes,)."""
        highest = np.zeros(boxes)
        inside = home >= 0
        np.maximum.at(highest, home[inside], self.height[inside])
        return highest

    def _descend(self, home: Ints, boxes: Doubles, across: Bools, split: Bools) -> Ints:
        """Follow the samples into the halves of the split boxes; −1 in boxes that are done."""
        inside = (home >= 0) & split[home]
        rank = np.cumsum(split) - 1
        box = home[inside]
        a0, a1, b0, b1 = boxes[:, box]
        upper_a = self.guide[0, inside] >= (a0 + a1) / 2
        upper_b = self.guide[1, inside] >= (b0 + b1) / 2
        below = np.full_like(home, -1)
        below[inside] = np.where(across[box], upper_a, upper_b) * np.count_nonzero(split) + rank[box]
        return below

    def _around_samples(self, boxes: Doubles, cell: Ints) -> tuple[Doubles, Ints]:
        """Cut cells of which the samples fill only a part, so that no nodes miss that part.

        Returns boxes (4, m), and the cell that each belongs to, (m,).
        """
        low, high = np.full((2, boxes.shape[1]), np.inf), np.full((2, boxes.shape[1]), -np.inf)
        for k in range(2):
            np.minimum.at(low[k], cell, self.guide[k])
            np.maximum.at(high[k], cell, self.guide[k])
        margin = np.maximum(high - low, 0) / 4
        low, high = np.maximum(low - margin, boxes[::2]), np.minimum(high + margin, boxes[1::2])
        whole = boxes[1::2] - boxes[::2]
        cut = np.flatnonzero((high > low).all(0) & ((high - low).prod(0) < 0.7 * whole.prod(0)))
        edges = [np.stack([boxes[2 * k], low[k], high[k], boxes[2 * k + 1]])[:, cut] for k in range(2)]
        pieces = [
            np.stack([edges[0][i], edges[0][i + 1], edges[1][j], edges[1][j + 1]])
            for i in range(3)
            for j in range(3)
        ]
        rest = np.delete(np.arange(boxes.shape[1]), cut)
        return np.concatenate([boxes[:, rest], *pieces], axis=1), np.concatenate([rest, np.tile(cut, 9)])

    def _locate(self, boxes: Doubles, owner: Ints, cell: Ints) -> Ints:
        """Return the box of each sample: of its cell's boxes the one that its samples fill."""
        middle = np.empty(ROWS * COLUMNS, np.intp)
        count = np.bincount(owner, minlength=ROWS * COLUMNS)
        first = np.flatnonzero(count[owner] == 1)
        middle[owner[first]] = first
        cut = np.count_nonzero(count == 9)
        start = len(first) + 4 * cut  # the fifth of nine pieces
        middle[owner[start : start + cut]] = np.arange(start, start + cut)
        return middle[cell]


def _least(error: Doubles, tolerance: float) -> Bools:
    """Mark the least errors, as many as add up to less than the tolerance."""
    order = np.argsort(error)
    keep = np.empty(len(error), np.bool_)
    keep[order] = np.cumsum(error[order]) < tolerance
    return keep


def _halves(boxes: Doubles, across: Bools) -> Doubles:
    """Halve each box (4, m) along its first coordinate where `across` is true, else its second: (4, 2m)."""
    a0, a1, b0, b1 = boxes
    a, b = (a0 + a1) / 2, (b0 + b1) / 2
    first = np.stack([a0, np.where(across, a, a1), b0, np.where(across, b1, b)])
    second = np.stack([np.where(across, a, a0), a1, np.where(across, b0, b), b1])
    return np.concatenate([first, second], axis=1)


# --- Statistics ---------------------------------------------------------------------------------------


def gamma_q(a: float, x: float) -> float:
    """Regularised upper incomplete gamma function Q(a, x).

    Source: NIST DLMF 8.11.4 (series, for x < a + 1) and 8.9.2 (continued fraction, by Lentz's rule).
    """
    if x <= 0:
        return 1.0
    scale = math.exp(a * math.log(x) - x - math.lgamma(a))
    if x < a + 1:
        term = total = 1 / a
        n = a
        while term > total * 1e-16:
            n += 1
            term *= x / n
            total += term
        return 1 - scale * total
    b = x + 1 - a
    c, d = 1e300, 1 / b
    fraction = d
    for i in range(1, 10_000):
        step = -i * (i - a)
        b += 2
        d = 1 / (step * d + b)
        c = b + step / c
        fraction *= c * d
        if abs(c * d - 1) < 1e-15:
            break
    return scale * fraction


def chi_square(observed: Ints, expected: Doubles) -> tuple[float, int, float]:
    """χ² statistic, degrees of freedom and p-value; cells below 5 expected are pooled.

    The cells must cover every outcome, so that both sums are the number of samples. If even the
    pool expects less than 5, its count is compared with the Poisson distribution instead; there
    10⁻⁵ of all samples are allowed for, as rounding puts some just beyond the edge of a density.
    """
    rare = expected < 5
    pool, pooled = float(expected[rare].sum()), int(observed[rare].sum())
    stray = 1.0
    observed, expected = observed[~rare], expected[~rare]
    if pool >= 5:
        observed, expected = np.append(observed, pooled), np.append(expected, pool)
    elif pooled:
        allowed = pool + 1e-5 * (float(expected.sum()) + pool)
        stray = 1 - gamma_q(pooled, max(allowed, 1e-300))  # P(X ≥ pooled)
    statistic = float(((observed - expected) ** 2 / expected).sum())
    freedom = len(expected) - 1
    p = gamma_q(freedom / 2, statistic / 2) if freedom > 0 else 1.0
    return statistic, max(freedom, 0), p if stray == 1 else min(1.0, 2 * min(p, stray))


def _chi_square_p(observed: Ints, expected: Doubles, missing: int, lost: float) -> float:
    """p-value of χ² over all cells, over rows and over columns: sums show a slope that cells hide."""
    counts, means = observed.reshape(ROWS, COLUMNS), expected.reshape(ROWS, COLUMNS)
    views = [(counts.ravel(), means.ravel()), (counts.sum(1), means.sum(1)), (counts.sum(0), means.sum(0))]
    p = [chi_square(np.append(o, missing), np.append(e, lost))[2] for o, e in views]
    return min(1.0, 3 * min(p))


def binomial_p(count: int, trials: int, probability: float) -> float:
    """Two-sided exact binomial p-value: twice the smaller tail, at most 1."""
    if not 0 < probability < 1:
        return float(count == (trials if probability >= 1 else 0))
    k = np.arange(1, trials + 1)
    log_choose = np.concatenate([[0.0], np.cumsum(np.log((trials + 1 - k) / k))])
    k = np.arange(trials + 1)
    pmf = np.exp(log_choose + k * math.log(probability) + (trials - k) * math.log1p(-probability))
    return min(1.0, 2 * min(float(pmf[: count + 1].sum()), float(pmf[count:].sum())))


def _compare(
    report: Report,
    where: str,
    chart: Chart,
    pilot: Floats,
    points: Floats,
    total: int,
    density: Callable[[Floats], Floats],
    alpha: float,
    singular: float = 0.0,
) -> None:
    """χ² of sampled points (d, m ≤ total) against a density, and the density's integral.

    `total − m` of the samples gave no point, or one of a delta lobe; the probability of the
    latter is `singular`.
    """
    cells = Cells.around(chart.to_square(pilot), chart.seams)
    on_square = chart.to_square(points)
    guide = points[:, : 1 << 17]
    height = density(guide).astype(np.float64)
    integrator = _Integrator(density, chart, on_square[:, : 1 << 17], height)
    expected, unresolved = integrator.cells(cells)
    observed = np.bincount(cells.find(on_square), minlength=ROWS * COLUMNS)
    integral = float(expected.sum())
    missing = total - points.shape[1]
    fraction = points.shape[1] / total
    noise = math.sqrt(fraction * (1 - fraction) / total)
    report.near("integral of pdf", where, integral, fraction, 1e-4 + 4.5 * noise + unresolved)
    if singular > 0:
        report.at_most("sum of probabilities", where, singular + integral, 1 + 1e-4 + unresolved)
    lost = max(1 - integral, 0.0) * total
    report.significant("chi-square", where, _chi_square_p(observed, expected * total, missing, lost), alpha)


# --- Materials ----------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class _View:
    """A material seen along one direction from one side."""

    bsdf: Bsdf
    wo: Floats  # (3, 1)
    inside: bool

    def __str__(self) -> str:
        angle = math.degrees(math.acos(min(1.0, float(self.wo[2, 0]))))
        return f"wo {angle:.4g}° {'inside' if self.inside else 'outside'}"

    def at(self, n: int) -> tuple[Bsdf, Floats]:
        """Return the material bound on n lanes, and wo (3, n)."""
        wo = np.repeat(self.wo, n, 1)
        return self.bsdf.bind(_surface(wo, np.full(n, self.inside))), wo

    def sample(self, u: Floats) -> BsdfSample:
        """Sample with u (dimensions, n)."""
        bound, wo = self.at(u.shape[1])
        return bound.sample_f(wo, u)

    def f(self, wi: Floats) -> Floats:
        """Evaluate f at wi (3, n)."""
        bound, wo = self.at(wi.shape[1])
        return bound.f(wo, wi)

    def pdf(self, wi: Floats) -> Floats:
        """Evaluate the pdf at wi (3, n)."""
        bound, wo = self.at(wi.shape[1])
        return bound.pdf(wo, wi)


@dataclass(slots=True)
class _Lobe:
    """A delta lobe as the samples show it."""

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
    """Prove that a material keeps the contract of `wavefront.bsdfs.Bsdf`.

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
        Naming each failed check, the direction, the value measured and the one expected.
    """
    report = Report(f"check_bsdf({type(bsdf).__name__})")
    sides = (False, True) if bsdf.transmissive else (False,)
    tests = 4 * len(angles) * len(sides)
    alpha = 1 - (1 - significance) ** (1 / tests)
    for number, (inside, angle) in enumerate((s, a) for s in sides for a in angles):
        view = _View(bsdf, _direction(angle, 0.7 + number), inside)
        rng = np.random.default_rng([seed, number])
        _check_view(report, view, rng, samples, alpha, albedo)
        if reciprocal and not any(not c.passed for c in report.checks.values()):
            _check_reciprocity(report, view, rng)
    return report.raise_if_failed()


def _direction(angle: float, phi: float) -> Floats:
    """Return the unit vector (3, 1) at an angle (degrees) from +z and an azimuth (radians)."""
    theta = math.radians(angle)
    x, y = math.sin(theta) * math.cos(phi), math.sin(theta) * math.sin(phi)
    return np.array([[x], [y], [math.cos(theta)]], f4)


def _surface(wo: Floats, inside: Bools) -> Surface:
    """Return hit points (n lanes) at the origin with normals +z, seen along wo (3, n)."""
    n = wo.shape[1]
    normal = np.repeat(np.array([[0], [0], [1]], f4), n, 1)
    zero, uv = np.zeros(n, f4), np.repeat(np.array([[0.3], [0.6]], f4), n, 1)
    color = np.repeat(np.array([[0.8], [0.5], [0.3], [0.6]], f4), n, 1)
    index = np.zeros(n, np.intp)
    return Surface(np.zeros((3, n), f4), zero, normal, normal, wo, index, index, inside, uv, uv, color)


def _uniform_sphere(rng: np.random.Generator, n: int) -> Floats:
    return _square_to_sphere(rng.random((2, n)))


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
    if view.bsdf.matte:
        _check_matte(report, view, rng)
    pilot = view.sample(rng.random((dimensions, PILOT), f4))
    points, lobes = [], list[_Lobe]()
    total, squares = np.zeros(3), np.zeros(3)
    for size in _chunks(samples):
        drawn = view.sample(rng.random((dimensions, size), f4))
        _check_samples(report, view, drawn)
        carried = drawn.weight.astype(np.float64)
        if drawn.eta is not None:
            carried *= drawn.eta.astype(np.float64) ** 2  # radiance back to energy
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
        copies = max(1, round(lobe.count / (samples * lobe.probability)))  # lobes that look the same
        p = binomial_p(lobe.count, samples, min(1.0, copies * lobe.probability))
        report.significant("delta lobe (binomial)", f"{where}, wi_z {lobe.wi[2]:.4g}", p, alpha)
    singular = min(1.0, sum(lobe.probability for lobe in lobes))
    kept = pilot.wi[:, (pilot.pdf > 0) & ~pilot.specular]
    _compare(report, where, CHARTS["sphere"], kept, drawn_points, samples, view.pdf, alpha, singular)


def _chunks(n: int) -> Iterator[int]:
    """Split n into sizes of at most 2¹⁸."""
    for start in range(0, n, 1 << 18):
        yield min(1 << 18, n - start)


def _check_arrays(report: Report, view: _View, rng: np.random.Generator) -> None:
    """Shapes, types, and that no lane depends on the lanes beside it."""
    where, n = str(view), 1000
    u = rng.random((view.bsdf.dimensions, n), f4)
    w = _uniform_sphere(rng, n)

    def run(lanes: slice) -> list[NDArray[Any]]:
        drawn = view.sample(np.ascontiguousarray(u[:, lanes]))
        w_part = np.ascontiguousarray(w[:, lanes])
        bound, wo = view.at(w_part.shape[1])
        f, pdf = bound.evaluate(wo, w_part)
        return [drawn.wi, drawn.weight, drawn.pdf, drawn.specular, view.f(w_part), view.pdf(w_part), f, pdf]

    names = ["wi", "weight", "pdf", "specular", "f()", "pdf()", "evaluate() f", "evaluate() pdf"]
    rows = [3, 3, 0, 0, 3, 0, 3, 0]
    whole = run(slice(0, n))
    parts = [run(s) for s in (slice(0, 1), slice(1, 18), slice(18, n))]
    for k, (name, row) in enumerate(zip(names, rows, strict=True)):
        shape = (row, n) if row else (n,)
        dtype = np.bool_ if name == "specular" else f4
        what = f"{where}, {name} {whole[k].dtype} {whole[k].shape}"
        wrong = whole[k].shape != shape or whole[k].dtype != dtype
        report.holds("shape and type", what, np.array(wrong), f"{np.dtype(dtype)} {shape}")
        if wrong:
            report.raise_if_failed()
        joined = np.concatenate([part[k] for part in parts], axis=-1)
        report.holds("lanes independent", f"{where}, {name}", joined != whole[k], "the same bits")
    for k, (plain, joint) in enumerate(((4, 6), (5, 7))):
        error = np.abs(whole[plain] - whole[joint]) / np.maximum(np.abs(whole[plain]), 1e-20)
        report.at_most("evaluate = f, pdf", f"{where}, {('f', 'pdf')[k]}", float(error.max()), 1e-5)


def _check_matte(report: Report, view: _View, rng: np.random.Generator) -> None:
    """No method of a matte material reads wo."""
    n = 1000
    bound, wo = view.at(n)
    w, u = _uniform_sphere(rng, n), rng.random((bound.dimensions, n), f4)
    here, above = (
        [*bound.evaluate(v, w), bound.sample_f(v, u).wi, bound.sample_f(v, u).weight]
        for v in (wo, np.repeat(_direction(0, 0), n, 1))
    )
    for name, seen, straight in zip(("f", "pdf", "wi", "weight"), here, above, strict=True):
        report.holds("matte", f"{view}, {name}", seen != straight, "the same bits as from straight above")


def _check_samples(report: Report, view: _View, drawn: BsdfSample) -> None:
    """Properties of single samples."""
    where = str(view)
    for name, values in (("wi", drawn.wi), ("weight", drawn.weight), ("pdf", drawn.pdf)):
        report.holds("finite", f"{where}, {name}", ~np.isfinite(values), "finite numbers")
    report.holds("not negative", f"{where}, weight", drawn.weight < 0, "at least 0")
    report.holds("not negative", f"{where}, pdf", drawn.pdf < 0, "at least 0")
    some = drawn.pdf > 0
    carries = some & (drawn.weight > 0).any(0)
    report.holds("pdf 0 has no weight", where, ~some & (drawn.weight > 0).any(0), "weight 0")
    size = np.sqrt((drawn.wi[:, some].astype(np.float64) ** 2).sum(0))
    report.at_most("unit length", where, float(np.abs(size - 1).max(initial=0)), 1e-5)
    if not view.bsdf.transmissive:
        report.holds("no transmission", where, carries & (drawn.wi[2] < 0), "wi above the surface")
    elif drawn.eta is not None:
        above = some & (drawn.wi[2] > 0) & (drawn.eta != 1)
        report.holds("eta", where, above | ~(drawn.eta > 0), "1 above, more than 0 below")
    if view.bsdf.specular:
        report.holds("specular samples", where, some & ~drawn.specular, "all specular")
    report.holds("delta probability", where, drawn.specular & (drawn.pdf > 1 + 1e-6), "at most 1")
    lanes = np.flatnonzero(some & ~drawn.specular)[: 1 << 16]
    if not len(lanes):
        return
    wi = np.ascontiguousarray(drawn.wi[:, lanes])
    f, pdf = view.f(wi).astype(np.float64), view.pdf(wi).astype(np.float64)
    weight, kept = drawn.weight[:, lanes], drawn.pdf[lanes]
    error = np.abs(kept / np.maximum(pdf, 1e-300) - 1)
    k = int(np.argmax(error))
    report.near("sample pdf / pdf()", f"{where}, {_text(wi[:, k])}", kept[k] / max(pdf[k], 1e-300), 1.0, 1e-5)
    exact = f * np.abs(wi[2].astype(np.float64)) / kept
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
    """f is finite and not negative, and wherever it is positive so is the pdf."""
    where = str(view)
    for w in (_uniform_sphere(rng, 1 << 16), points[:, : 1 << 16]):
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
    """Count specular samples by lobe; False if there are more than `limit` different ones."""
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
    """Swapping both directions changes f by the square of the relative index only."""
    drawn = view.sample(rng.random((view.bsdf.dimensions, PAIRS), f4))
    eta = np.ones_like(drawn.pdf) if drawn.eta is None else drawn.eta
    kept = np.flatnonzero((drawn.pdf > 0) & ~drawn.specular & (np.abs(drawn.wi[2]) > 1e-3))
    up = _uniform_sphere(rng, PAIRS)
    up[2] = np.maximum(np.abs(up[2]), 1e-3)
    up /= np.sqrt((up * up).sum(0))
    wi = np.concatenate([drawn.wi[:, kept], up], axis=1)
    eta = np.concatenate([eta[kept], np.ones(PAIRS, f4)])
    wo = np.repeat(view.wo, wi.shape[1], 1)
    across = wi[2] < 0
    bound = view.bsdf.bind(_surface(wo, np.full(wi.shape[1], view.inside)))
    forth = bound.f(wo, wi).astype(np.float64) * eta.astype(np.float64) ** 2
    wo2, wi2 = _swap(wo, wi)
    back = view.bsdf.bind(_surface(wo2, across ^ view.inside)).f(wo2, wi2).astype(np.float64)
    scale = np.maximum(np.maximum(forth, back).max(0), 1e-12)
    error = np.abs(forth - back).max(0) / scale
    # Near grazing angles float32 leaves few digits of some cosines: one pair in a hundred may differ
    # by more than 0.3 %, none by more than 5 %.
    order = np.argsort(error)
    for name, k, limit in (
        ("reciprocity", order[int(0.99 * (len(order) - 1))], 3e-3),
        ("reciprocity (all)", order[-1], 0.05),
    ):
        report.at_most(name, f"{view}, {_text(wi[:, k])}", float(error[k]), limit)
    _check_delta_reciprocity(report, view, rng, drawn)


def _swap(wo: Floats, wi: Floats) -> tuple[Floats, Floats]:
    """Exchange wo and wi (3, n), seen from wi's side: turned about x where that is below."""
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
        other = _View(view.bsdf, wo, view.inside ^ bool(across))
        back = list[_Lobe]()
        _merge_lobes(back, other.sample(rng.random((view.bsdf.dimensions, 1 << 16), f4)))
        forth = sum((a.albedo * a.eta**2 for a in lobes if np.abs(a.wi - lobe.wi).max() < 1e-3), np.zeros(3))
        there = sum((a.albedo * a.eta**2 for a in back if np.abs(a.wi - wi[:, 0]).max() < 2e-3), np.zeros(3))
        error = float(np.abs(forth - there).max())
        report.at_most("delta reciprocity", f"{view}, wi_z {lobe.wi[2]:.4g}", error, 2e-3)


# --- Lights -------------------------------------------------------------------------------------------


def check_light(
    light: Any,
    *,
    points: ArrayLike | None = None,
    samples: int = 1_000_000,
    significance: float = 1e-3,
    seed: int = 0,
) -> Report:
    """Prove that a light keeps the contract of `wavefront.lights.Light`.

    Parameters
    ----------
    light
        A light record, of which every column (the first eight) is checked, or an object with a
        `record(centre)` that gives one.
    points
        (m, 3) points that are lit, scene units; five points around the origin by default. They
        must not lie on the light itself.
    samples, significance, seed
        As for `check_bsdf`.

    Raises
    ------
    AssertionError
        Naming each failed check, the point, the value measured and the one expected.
    """
    record: Light = light if isinstance(light, Light) else light.record(np.zeros(3))
    report = Report(f"check_light({type(light).__name__})")
    default = [[0, 0, 0], [2, 1, 3], [-3, 2, -1], [0.5, -4, 1], [20, 10, -30]]
    where = np.asarray(default if points is None else points, f4).reshape(-1, 3)
    columns = min(len(record), 8)
    alpha = 1 - (1 - significance) ** (1 / (columns * len(where)))
    for k in range(columns):
        one = record.take(np.array([k]))
        for number, point in enumerate(where):
            rng = np.random.default_rng([seed, k, number])
            name = f"light {k}, point (" + ", ".join(f"{x:.4g}" for x in point) + ")"
            _check_light_at(report, name, one, point.reshape(3, 1), rng, samples, alpha)
    return report.raise_if_failed()


def _check_light_at(
    report: Report,
    where: str,
    light: Light,
    point: Floats,
    rng: np.random.Generator,
    samples: int,
    alpha: float,
) -> None:
    def draw(n: int) -> LightSample:
        return light.sample_li(np.repeat(point, n, 1), rng.random((2, n), f4))

    def density(w: Floats) -> Floats:
        return light.pdf_li(np.repeat(point, w.shape[1], 1), w)

    points = []
    for size in _chunks(samples):
        drawn = draw(size)
        _check_light_samples(report, where, light, drawn, density)
        points.append(drawn.wi[:, drawn.pdf > 0])
    if light.delta:
        return
    pilot = draw(PILOT)
    kept = pilot.wi[:, pilot.pdf > 0]
    joined = np.concatenate(points, axis=1)
    _compare(report, where, CHARTS["sphere"], kept, joined, samples, density, alpha)


def _check_light_samples(
    report: Report, where: str, light: Light, drawn: LightSample, density: Callable[[Floats], Floats]
) -> None:
    for name, values in (("wi", drawn.wi), ("radiance", drawn.radiance), ("pdf", drawn.pdf)):
        report.holds("finite", f"{where}, {name}", ~np.isfinite(values), "finite numbers")
    report.holds("not negative", f"{where}, radiance", drawn.radiance < 0, "at least 0")
    report.holds("not negative", f"{where}, pdf", drawn.pdf < 0, "at least 0")
    some = drawn.pdf > 0
    if not some.any():
        return
    wi = np.ascontiguousarray(drawn.wi[:, some])
    size = np.sqrt((wi.astype(np.float64) ** 2).sum(0))
    report.at_most("unit length", where, float(np.abs(size - 1).max()), 1e-5)
    short = float(np.mean(~(drawn.distance[some] > 0)))
    report.at_most("distance not above 0", where, short, 1e-3)
    pdf, le = density(wi), light.le(wi)
    if light.delta:
        report.holds("delta pdf", where, drawn.pdf[some] != 1, "1")
        report.holds("delta pdf_li, le", where, (pdf != 0) | (le != 0).any(0), "0")
        return
    # A sample on the very edge may just miss the light again, so a few lanes may differ.
    ratio = np.abs(pdf - drawn.pdf[some]) > 1e-3 * drawn.pdf[some]
    report.at_most("sample pdf ≠ pdf_li", where, float(ratio.mean()), 1e-3)
    differs = (np.abs(le - drawn.radiance[:, some]) > 1e-4 * np.maximum(le, 1e-20)).any(0)
    report.at_most("radiance ≠ le", where, float(differs.mean()), 1e-3)


# --- Warps --------------------------------------------------------------------------------------------


def check_warp(
    sample: Callable[[Floats], Floats],
    pdf: Callable[[Floats], Floats],
    inverse: Callable[[Floats], Floats] | None = None,
    *,
    domain: str = "sphere",
    samples: int = 1_000_000,
    significance: float = 1e-3,
    seed: int = 0,
    tolerance: float = 1e-4,
) -> Report:
    """Prove that a warp's sample, pdf and inverse belong together.

    Parameters
    ----------
    sample
        Maps u (2, n) to points of the domain.
    pdf
        Density at points of the domain with respect to solid angle or area.
    inverse
        Maps points back to u (2, n).
    domain
        "sphere" (unit vectors (3, n)), "disk", "triangle" (b1, b2) or "square" ((2, n) each).
    samples, significance, seed
        As for `check_bsdf`.
    tolerance
        Largest distance that a point may have after inverse and sample.

    Raises
    ------
    AssertionError
        Naming each failed check, the value measured and the one expected.
    """
    report = Report(f"check_warp({getattr(sample, '__name__', 'sample')})")
    rng = np.random.default_rng(seed)
    points = np.concatenate([sample(rng.random((2, size), f4)) for size in _chunks(samples)], axis=1)
    report.holds("finite", domain, ~np.isfinite(points), "finite numbers")
    density = pdf(points[:, : 1 << 16])
    edge = float(np.mean(~(density > 0)))  # rounding may put a few on the very border
    report.at_most("pdf 0 at samples", domain, edge, 1e-3)
    chart = CHARTS[domain]
    if domain == "sphere":
        size = np.sqrt((points.astype(np.float64) ** 2).sum(0))
        report.at_most("unit length", domain, float(np.abs(size - 1).max()), 1e-5)
    if inverse is not None:
        again = sample(inverse(points[:, : 1 << 16]))
        error = np.abs(again - points[:, : 1 << 16]).max(0)
        report.at_most("round trip", domain, float(error.max()), tolerance)
    pilot = sample(rng.random((2, PILOT), f4))
    _compare(report, domain, chart, pilot, points, samples, pdf, significance)
    return report.raise_if_failed()
