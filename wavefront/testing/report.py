"""Reports of the checks of BSDFs, lights and warps, which take one call for a class of your own.

>>> import wavefront as wf
>>> print(wf.testing.check_bsdf(MyMaterial(0.5)))          # doctest: +SKIP

All checks have one method: samples are counted in 20×40 cells, and compared by a χ² test with the integrals
of the pdf over these cells. Properties that a χ² test does not detect are tested separately. Every check is
deterministic for a given seed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from ..arrays.vec import Bools

PILOT = 20_000
PAIRS = 4096


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
        """Return one line: verdict, name, worst value, expected value, position."""
        verdict = "ok  " if self.passed else "FAIL"
        return f"{verdict} {self.name:<22} {self.measured:>12.6g}   {self.expected:<28} {self.where}"


@dataclass(slots=True)
class Report:
    """The results of checks."""

    subject: str
    checks: dict[str, Check] = field(default_factory=dict)

    def add(self, name: str, where: str, measured: float, expected: str, badness: float) -> None:
        """Record a result if it is the worst one of its check so far."""
        known = self.checks.get(name)
        if known is None or not badness <= known.badness:
            self.checks[name] = Check(name, where, float(measured), expected, float(badness))

    def near(self, name: str, where: str, measured: float, expected: float, tolerance: float) -> None:
        """Check that ``|measured − expected| ≤ tolerance``."""
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
        """Check that no lane is bad; the measured value is the number of bad lanes."""
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
        """Return one line per check."""
        return "\n".join([self.subject, *(f"  {c}" for c in self.checks.values())])
