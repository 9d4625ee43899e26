"""Tables from the light that paths found: directions from which much came get a high density.

Sources: H. W. Jensen, "Importance Driven Path Tracing using the Photon Map", Rendering Techniques 1995, for
histograms of incident light; T. Müller, M. Gross and J. Novák, "Practical Path Guiding", Computer Graphics
Forum 36(4), 2017, for learning in rounds and the mixture with the BSDF.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..arrays.soa import soa
from ..arrays.state import SoA
from ..arrays.vec import Doubles, Floats, Ints
from .cells import GuideCells
from .guide_table import GuideTable
from .octahedral import neighbors, solid_angles

SIDE = 32  # bins along each side of the square of directions
LEVELS = 6  # the finest grid has 64³ cells
ENOUGH = 1024  # records that a cell needs for a density of its own
PRIOR = 100.0  # records that the density of the larger cell counts for
SPREAD = 0.5  # part of a bin's density that comes from the eight bins around it
CLAMP_LEVEL = 3  # of the grid whose cells' means limit single records
CLAMP = 1000.0  # times such a mean is the most that a record counts
FIRST_SHARE = 0.5  # of the table, before it is learned
SHARES = (0.0, 0.15, 0.3, 0.45, 0.6, 0.75)  # that are compared
SHARE_PRIOR = 200.0  # records that the comparison over all cells counts for


@soa
class Records(SoA):
    """The light that paths found, a column for each direction that one took."""

    cell: Ints  # (m,) where it left the surface
    bins: Ints  # (m,) bin of the direction
    incident: Floats  # (m,) light that arrived from there, times the cosine, sum of the channels
    scattered: Floats  # (m,) its contribution, relative to the throughput before: times f in place of 1
    pdf: Floats  # (m,) density with which the direction was drawn, 1/sr
    pdf_bsdf: Floats  # (m,) that of the BSDF alone


def build_table(records: Records, cells: GuideCells) -> GuideTable:
    """Return the table of the mean incident light, times the cosine, in each cell.

    From the largest cell to the smallest ones, each that has `ENOUGH` records gets a density of its
    own, to which that of the larger cell adds as `PRIOR` records would.
    """
    weight = _limited(records, cells)
    row_of = np.zeros((6, 1, 1, 1), np.intp)
    densities = solid_angles(SIDE)[None] / (4 * np.pi)
    for level in range(cells.levels + 1):
        if level:
            row_of = row_of.repeat(2, 1).repeat(2, 2).repeat(2, 3)
        cell = cells.coarser(records.cell, level)
        counts = np.bincount(cell, minlength=row_of.size)
        rich = np.flatnonzero(counts >= ENOUGH)
        if rich.size:
            flat = row_of.reshape(-1)
            histograms = _spread(_histograms(cell, rich, records.bins, weight, row_of.size))
            parents = densities[flat[rich]]
            densities = np.concatenate([densities, _blended(histograms, parents, counts[rich])])
            flat[rich] = len(densities) - rich.size + np.arange(rich.size)
    used, row_of = np.unique(row_of.reshape(-1), return_inverse=True)
    return GuideTable.of_bins(cells, row_of, densities[used], np.full(used.size, FIRST_SHARE))


def learn_shares(rounds: Sequence[Records], table: GuideTable) -> None:
    """Choose the share of each row of the table that makes the variance of single directions least.

    Shares are judged on records that the densities were not made from: a table of all rounds but the
    last is judged by the last, and each row of `table` takes the mean over its cells.
    """
    older, latest = build_table(Records.concatenate(rounds[:-1]), table.cells), rounds[-1]
    shares = _best_shares(older, latest)[older.row_of]
    cells_of_row = np.bincount(table.row_of)
    table.share[:] = np.bincount(table.row_of, shares) / cells_of_row


def _best_shares(table: GuideTable, records: Records) -> Doubles:
    """Return the best of `SHARES` for each row, (rows,)."""
    rows = len(table.share)
    row = table.row_of.take(records.cell).astype(np.intp)
    pdf = table.density.take(row * SIDE**2 + records.bins) / (SIDE**2 * solid_angles(SIDE)[records.bins])
    squared = records.scattered.astype(np.float64) ** 2 / records.pdf
    moments = np.stack(
        [
            np.bincount(
                row, squared / np.maximum(records.pdf_bsdf + a * (pdf - records.pdf_bsdf), 1e-20), rows
            )
            for a in SHARES
        ]
    )
    usual = SHARES.index(0.45)
    overall = moments.sum(1) / max(moments[usual].sum(), 1e-30)
    relative = moments / np.maximum(moments[usual], 1e-30)
    hits = np.bincount(row, minlength=rows)
    blended = (relative * hits + overall[:, None] * SHARE_PRIOR) / (hits + SHARE_PRIOR)
    return np.asarray(SHARES)[blended.argmin(0)]


def _limited(records: Records, cells: GuideCells) -> Doubles:
    """Return incident light over density, (m,), where no record is far above its surroundings."""
    value = records.incident.astype(np.float64) / records.pdf
    coarse = cells.coarser(records.cell, min(CLAMP_LEVEL, cells.levels))
    mean = np.bincount(coarse, value) / np.maximum(np.bincount(coarse), 1)
    return np.minimum(value, CLAMP * mean[coarse])


def _histograms(cell: Ints, chosen: Ints, bins: Ints, weight: Doubles, cells: int) -> Doubles:
    """Return the sums of weights by bin in some cells (k,), (k, side²)."""
    number = np.full(cells, -1)
    number[chosen] = np.arange(chosen.size)
    lane = number[cell]
    inside = np.flatnonzero(lane >= 0)
    flat = lane[inside] * SIDE**2 + bins[inside]
    sums = np.bincount(flat, weight[inside], chosen.size * SIDE**2)
    return np.asarray(sums, np.float64).reshape(-1, SIDE**2)


def _spread(contents: Doubles) -> Doubles:
    """Return contents (k, side²), blurred: each bin shares its density with the bins around it."""
    area = solid_angles(SIDE)
    density = contents / area
    around = sum(density[:, near] for near in neighbors(SIDE)) / 8
    return np.asarray((1 - SPREAD) * contents + SPREAD * area * around)


def _blended(contents: Doubles, parents: Doubles, counts: Ints) -> Doubles:
    """Return probabilities (k, side²) of contents, blended with those of the larger cells."""
    total = contents.sum(1, keepdims=True)
    probabilities = np.where(total > 0, contents / np.where(total > 0, total, 1), parents)
    return np.asarray((counts[:, None] * probabilities + PRIOR * parents) / (counts[:, None] + PRIOR))
