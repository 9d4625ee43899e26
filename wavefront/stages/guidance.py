"""Path guiding: directions drawn from a mixture of tables and BSDFs.

Each lane draws from its table with a probability, else from the BSDF, and counts with the density of the
mixture (one-sample MIS with the balance heuristic), so the estimate stays unbiased whatever the tables hold.

Sources: E. Veach and L. Guibas, "Optimally Combining Sampling Techniques", SIGGRAPH 1995, section 5.3;
T. Müller, M. Gross and J. Novák, "Practical Path Guiding", Computer Graphics Forum 36(4), 2017.
"""

from __future__ import annotations

import numpy as np

from ..arrays.state import Paths
from ..arrays.vec import Floats, Ints, f4, take
from ..bsdfs import BsdfSample
from ..guiding import GuideTable
from ..sampling.sampler import Dimension, Sampler
from .shade import Guidance, Shading

LEAST_PDF_RATIO = f4(1e-3)  # least density of the BSDF, relative to that of the mixture, for roulette


def guide(shade: Shading, table: GuideTable) -> None:
    """Let the table choose directions at the surfaces where it may.

    Surfaces that only have delta lobes cannot be guided, and transmissive ones are not: their light comes
    from two sides.
    """
    lit = shade.lit()
    if not lit.groups:
        return
    row = table.rows(lit.surface.point, lit.surface.ns)
    share = table.share.take(row)
    for lanes, bsdf in lit.groups:
        if bsdf.transmissive:
            share[lanes] = 0
    shade.guidance = Guidance(table, row, share)


def mix_with_guide(
    shade: Shading, paths: Paths, sample: BsdfSample, direction: Floats, sampler: Sampler, bounce: int
) -> tuple[BsdfSample, Floats, Floats]:
    """Replace some directions by such of the tables, and weigh all by the density of the mixture.

    Parameters
    ----------
    sample, direction
        BSDF samples of all lanes, and their directions (3, n) in the world frame.

    Returns
    -------
    sample, direction
        Those of the mixture.
    gain
        (n,) density of the mixture over that of the BSDF: throughput times this is that without
        a guide. Russian roulette goes by that, since a direction that is drawn often because much
        light comes from there gives a small throughput, and yet is worth following.
    """
    assert shade.guidance is not None
    table, row, share = shade.guidance.table, shade.guidance.row, shade.guidance.share
    n = row.size
    u = sampler.draw_1d(paths.pixel[:n], paths.sample[:n], bounce, Dimension.GUIDE)
    chosen = np.flatnonzero(u < share)
    direction = direction.copy()
    direction[:, chosen] = _from_table(table, row, chosen, paths, sampler, bounce)
    wi, specular, valid = sample.wi.copy(), np.array(sample.specular), sample.pdf > 0
    wi[:, chosen] = shade.frame.take(chosen).to_local(take(direction, chosen))
    specular[chosen], valid[chosen] = False, True
    f, pdf_bsdf = shade.lit().evaluate(wi[:, :n])
    pdf = shade.guidance.mixed(slice(0, n), direction[:, :n], pdf_bsdf)
    weight, density, gain = sample.weight.copy(), sample.pdf.copy(), np.ones(len(paths), f4)
    good = valid[:n] & (pdf > 0)
    divisor = np.where(good, pdf, f4(1))
    cos = np.abs(wi[2, :n])
    if shade.volume is not None:
        cos[shade.volume] = 1
    scale = np.where(good, cos / divisor, f4(0))
    # delta lobes are drawn by the BSDF alone
    delta = specular[:n]
    weight[:, :n] = np.where(delta, weight[:, :n] / (f4(1) - share), f * scale)
    density[:n] = np.where(delta, density[:n] * (f4(1) - share), np.where(good, pdf, f4(0)))
    gain[:n] = np.where(delta | ~good, f4(1), divisor / np.maximum(pdf_bsdf, LEAST_PDF_RATIO * divisor))
    return BsdfSample(wi, weight, density, specular, sample.eta), direction, gain


def _from_table(
    table: GuideTable, row: Ints, lanes: Ints, paths: Paths, sampler: Sampler, bounce: int
) -> Floats:
    """Return directions (3, k) for some lanes."""
    address = take(paths.pixel, lanes), take(paths.sample, lanes), bounce
    return table.sample(row.take(lanes), sampler.draw_2d(*address, Dimension.GUIDE_DIRECTION))
