"""The analytical cases of CIE 171:2006, measured: the table of docs/record/cie171.md.

python benchmarks/cie171.py [case ...] [--spp 32768] [--skies 16]

A case is one of the names in the first column, or the beginning of one: "5.9". Samples are per point and sky.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterable
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))
from cie171 import CASES, TABLES, TYPES, Found, printed

PRINTED = printed()


def found(name: str, spp: int, types: Iterable[int]) -> Found:
    """Measure a case, with what is printed of it and what of that is known to be wrong."""
    if name in CASES:
        return CASES[name](spp)
    measured = TABLES[name].run(spp, types)
    rows = [each - 1 for each in types]
    measured.published, measured.wrong = (table[rows] for table in PRINTED[name])
    return measured


def row(name: str, case: Found) -> str:
    """Return a line of the table, differences in %."""
    lit = case.exact > 0
    off = (case.value[lit] / case.exact[lit] - 1) * 100
    sigmas = np.abs(case.sigmas).max()
    mean = (case.value.sum() / case.exact.sum() - 1) * 100
    error = np.sqrt((case.error**2).sum()) / case.exact.sum() * 100
    cells = [name, case.value.size, f"{np.abs(off).max():.2g}", f"{sigmas:.1f}", f"{case.chance:.2g}"]
    cells.append(f"{mean:+.4f} ± {error:.4f}")
    if case.published is None:
        cells += ["", ""]
    else:
        wrong = np.zeros(case.value.shape, bool) if case.wrong is None else case.wrong
        right = lit & ~wrong & np.isfinite(case.published)
        cells += [f"{np.abs(case.published[right] / case.exact[right] - 1).max() * 100:.2g}", wrong.sum()]
    return "| " + " | ".join(str(cell) for cell in cells) + " |"


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("cases", nargs="*", default=[""])
    parser.add_argument("--spp", type=int, default=1 << 15)
    parser.add_argument("--skies", type=int, default=len(TYPES), help="the first skies of 16")
    options = parser.parse_args()
    print(
        "| case | values | largest difference, % | the same or another, σ | by chance | mean of all, % | "
        "printed, largest difference, % | printed wrong |"
    )
    print("|---|---|---|---|---|---|---|---|")
    for name in (*CASES, *TABLES):
        if name.startswith(tuple(options.cases)):
            print(row(name, found(name, options.spp, TYPES[: options.skies])), flush=True)
