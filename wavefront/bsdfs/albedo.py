"""Tables of how much light a layer reflects from each direction, made when first needed."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache

import numpy as np

from ..arrays.vec import Bools, Floats, Ints, dot, f4
from .fresnel import fresnel_dielectric
from .microfacet import Facets, alpha_of, reflect

SIZE = 32  # rows of roughness in [0, 1], and columns of the square root of the cosine in [0, 1]
SIDE = 32  # a direction's integral takes SIDE² samples
ROOTS = 0.6 * np.linspace(0, 1, 13) ** 2  # of the reflectance along the normal, in tables of dielectrics


def lookup(table: Floats, roughness: Floats, cos: Floats) -> Floats:
    """Bilinear value of a table (SIZE, SIZE) at roughness and cosine (n,), (n,)."""
    return interpolate(table[None], (roughness, np.sqrt(np.clip(cos, f4(0), f4(1)))))


def interpolate(table: Floats, place: Sequence[Floats | None], side: Bools | Ints | int = 0) -> Floats:
    """Multilinear value of a table (sides, ...) at a place in [0, 1] for each further axis, (n,).

    For axes of one entry the place does not count.
    """
    stride, steps = table[0].size, []
    start = side * stride
    for size, x in zip(table.shape[1:], place, strict=True):
        stride //= size
        if size == 1:
            continue
        assert x is not None
        x = np.clip(x, f4(0), f4(1)) * f4(size - 1)
        i = np.minimum(x.astype(np.intp), size - 2)
        start = start + i * stride
        steps.append((stride, x - i.astype(f4)))
    return _blended(table.ravel(), start, steps)


def _blended(flat: Floats, start: Ints, steps: Sequence[tuple[int, Floats]]) -> Floats:
    """Interpolate between entries from `start` on by each of the strides and parts."""
    if not steps:
        return flat.take(start)
    (stride, x), *rest = steps
    return _blended(flat, start, rest) * (f4(1) - x) + _blended(flat, start + stride, rest) * x


def cosine_mean(table: Floats) -> Floats:
    """Mean over the hemisphere, ∫ 2μ·table dμ, of each row (SIZE, SIZE), as a table of equal columns."""
    root = np.linspace(0, 1, 16 * (SIZE - 1) + 1)  # 16 midpoints in each linear piece
    middle = (root[:-1] + root[1:]) / 2
    hats = np.stack([np.interp(middle, np.linspace(0, 1, SIZE), row) for row in np.eye(SIZE)])
    weight = (hats * 4 * middle * middle * middle).mean(1)  # 2μ dμ = 4x³ dx
    return np.repeat((table * weight).sum(1).astype(f4)[:, None], SIZE, 1)


def tabulate(row: Callable[[Floats, Floats, Floats], tuple[Floats, ...]]) -> tuple[Floats, ...]:
    """Average the results of `row` for wo (3, m), roughness (1,) and u (2, m) over u: tables (SIZE, SIZE)."""
    mu = np.maximum(np.linspace(0, 1, SIZE) ** 2, 1e-4)
    wo = np.stack([np.sqrt(1 - mu * mu), 0 * mu, mu]).astype(f4).repeat(SIDE * SIDE, 1)
    u = (np.indices((SIDE, SIDE)).reshape(2, -1) + 0.5) / SIDE
    u = np.tile(u.astype(f4), SIZE)
    roughness = np.linspace(0, 1, SIZE, dtype=f4)
    rows = [row(wo, roughness[k : k + 1], u) for k in range(SIZE)]
    means = [[v.reshape(SIZE, -1).mean(1, dtype=np.float64) for v in values] for values in rows]
    return tuple(np.array(table, f4) for table in zip(*means, strict=True))


def dielectric_albedo(ior: Floats, roughness: Floats, cos: Floats | None) -> Floats:
    """Albedo of GGX with Fresnel's equations, (n,); its mean over cosines where `cos` is None.

    The index is at least 1. Above 4 the albedo is that of 4.
    """
    root = np.sqrt((ior - f4(1)) / (ior + f4(1)) / f4(ROOTS[-1])) * f4(len(ROOTS) - 1)
    root = np.minimum(root, f4(len(ROOTS) - 1.001))
    level = root.astype(np.intp)
    x = f4(0) if cos is None else np.sqrt(np.clip(cos, f4(0), f4(1)))
    tables = _dielectric_tables()[int(cos is None)]
    low, high = (interpolate(tables, (roughness, np.asarray(x, f4)), level + k) for k in (0, 1))
    return low + (high - low) * (root - level.astype(f4))


@cache
def _dielectric_tables() -> tuple[Floats, Floats]:
    """Albedos (ROOTS, SIZE, SIZE) of `dielectric_albedo`, and their cosine-weighted means."""
    indices = [np.full(1, (1 + root) / (1 - root), f4) for root in ROOTS]

    def row(wo: Floats, roughness: Floats, u: Floats) -> tuple[Floats, ...]:
        m, shown = _reflected(wo, roughness, u)
        return tuple(shown * fresnel_dielectric(np.minimum(dot(wo, m), f4(1)), eta)[0] for eta in indices)

    tables = tabulate(row)
    return np.stack(tables), np.stack([cosine_mean(table) for table in tables])


def _reflected(wo: Floats, roughness: Floats, u: Floats) -> tuple[Floats, Floats]:
    """Return microfacets (3, m) that wo sees, and G2/G1 of their reflections, (m,)."""
    facets = Facets(alpha_of(roughness))
    m = facets.visible_normals(wo, u)
    wi = reflect(wo, m)
    zi = np.maximum(wi[2], f4(0))
    so, si = facets.stretched(wo), facets.stretched(wi)
    return m, zi * (wo[2] + so) / (wo[2] * si + zi * so)


@cache
def facet_cosines() -> Floats:
    """Mean cosine between wo and the facets of GGX that reflect it."""

    def row(wo: Floats, roughness: Floats, u: Floats) -> tuple[Floats, Floats]:
        m, shown = _reflected(wo, roughness, u)
        return shown * np.minimum(dot(wo, m), f4(1)), shown

    cosines, weights = tabulate(row)
    return cosines / weights


@cache
def gloss_tables() -> tuple[Floats, Floats, Floats, Floats]:
    """Albedo of GGX with Schlick's Fresnel, as F0·A + F90·B: A, B, and their cosine-weighted means."""

    def row(wo: Floats, roughness: Floats, u: Floats) -> tuple[Floats, Floats]:
        m, shown = _reflected(wo, roughness, u)
        away = f4(1) - np.minimum(dot(wo, m), f4(1))
        weight = away * away * away * away * away
        return shown * (f4(1) - weight), shown * weight

    a, b = tabulate(row)
    return a, b, cosine_mean(a), cosine_mean(b)
