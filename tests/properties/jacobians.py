"""The density of a sampled point by numerical differentiation of the map from random numbers to points.

A map w(u) of uniform numbers has the density 1/|∂w/∂u|. So `density × |∂w/∂u| = 1` at every u, which is a
statement without chance: it can stand in a test with `@given`. The formulas run in float64 (`doubles`), as
differences of float32 numbers are too coarse.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from types import ModuleType
from typing import Any

import numpy as np
from hypothesis import assume, settings
from hypothesis import strategies as st
from inside import Receiver, gloss_tables
from inside import _albedo_table as sheen_table
from inside import _dielectric_tables as dielectric_tables

Doubles = np.ndarray
ROOMS = (
    "wavefront.sampling.",
    "wavefront.bsdfs.",
    "wavefront.lights.",
    "wavefront.guiding.",
    "wavefront.media.",
)
ALONE = ("wavefront.arrays.vec", "wavefront.arrays.frame", "wavefront.sampling.filters")
# functions that read the bits of float32 numbers, and what they compute
OF_BITS = {"log": np.log, "exp": np.exp, "signs": lambda x: np.copysign(1.0, x)}
ROUNDING = 2e-6  # constants such as 1/π, and tables, are float32
KINK = 0.02  # by which one-sided derivatives may differ where the map is smooth
LARGEST_BOUND = 0.02  # of the error of a derivative, relative

# parts of the examples of the profile: what one costs differs
some = settings(max_examples=settings.default.max_examples * 3 // 20)
few = settings(max_examples=settings.default.max_examples // 16)
fewest = settings(max_examples=settings.default.max_examples // 50)

# float32 numbers, away from 0 and 1, so that differences have room on both sides
inner = st.floats(2.0**-13, 1 - 2.0**-13, width=32)
points_of_the_square = st.tuples(inner, inner)
numbers = st.floats(-2, 2, width=32)
places = st.tuples(numbers, numbers, numbers)


@st.composite
def receivers(draw: st.DrawFn) -> Receiver:
    """One surface that is lit, of any normal; light may cross it."""
    normal = np.array(draw(places), np.float32)
    size = np.sqrt(normal @ normal)
    assume(size > 0.1)
    return Receiver((normal / size).reshape(3, 1), np.array([draw(st.booleans())]))


surfaces = st.none() | receivers()  # None: not known


@contextmanager
def doubles() -> Iterator[None]:
    """Let the formulas of samplers, materials and lights run in float64: `f4` means float64 in them."""
    for table in (dielectric_tables, gloss_tables, sheen_table):
        table()  # it is cached, and stays float32
    narrow = of_float32(len(sys.modules))
    for module, attribute, _, wide in narrow:
        setattr(module, attribute, wide)
    try:
        yield
    finally:
        for module, attribute, have, _ in narrow:
            setattr(module, attribute, have)


@cache
def of_float32(modules: int) -> list[tuple[ModuleType, str, Any, Any]]:
    """List what stands for float32 in the modules that are there: module, name, value, and the wide one."""
    found = []
    for name, module in list(sys.modules.items()):
        if module is None or not (name.startswith(ROOMS) or name in ALONE):
            continue
        if name == "wavefront.sampling.sampler":
            continue
        for attribute, wide in {"f4": np.float64, **OF_BITS}.items():
            have = vars(module).get(attribute)
            own = getattr(have, "__module__", None) in ("wavefront.arrays.elementary", "wavefront.arrays.vec")
            if have is np.float32 or (own and attribute in OF_BITS):
                found.append((module, attribute, have, wide))
    return found


def columns(*values: float) -> Doubles:
    """Numbers as a column (k, 1) of float64."""
    return np.array(values, np.float64).reshape(-1, 1)


def jacobian(sample: Callable[[Doubles], Doubles], u: tuple[float, ...]) -> tuple[float, float]:
    """Return |∂w/∂u| at u, and a bound on its relative error; it rejects the example at a kink of the map.

    Central differences of steps h and h/2, extrapolated (Richardson). The bound is the rounding error and
    three times their difference, which also holds for jumps of the size of rounding errors.

    Parameters
    ----------
    sample
        Maps u (1 or 2, n) to points (k, n): numbers, points of a plane, or unit vectors.
    u
        One or two numbers.
    """
    at = columns(*u)
    step = np.minimum(1e-3 * np.minimum(at, 1 - at), 1e-4)
    dimensions = len(u)
    offsets = [np.zeros_like(at)]
    for axis in range(dimensions):
        unit = np.zeros_like(at)
        unit[axis] = step[axis]
        offsets += [unit, -unit, unit / 2, -unit / 2]
    offsets.append(step)  # along the diagonal: a kink may be alike along both axes
    moved = np.concatenate([at + offset for offset in offsets], axis=1)
    w = np.asarray(sample(moved))
    w = w.reshape(-1, moved.shape[1])
    assert w.dtype == np.float64, "the map must run in float64"
    slopes, error = [], 0.0
    for axis in range(dimensions):
        h = step[axis, 0]
        plus, minus, near_plus, near_minus = w[:, 1 + 4 * axis : 5 + 4 * axis].T
        coarse, fine = (plus - minus) / (2 * h), (near_plus - near_minus) / h
        forward, backward = (plus - w[:, 0]) / h, (w[:, 0] - minus) / h
        size = np.linalg.norm(fine)
        assume(size > 0)
        assume(np.linalg.norm(forward - backward) < KINK * size)
        slopes.append((4 * fine - coarse) / 3)
        error += float(3 * np.linalg.norm(fine - coarse) + 4e-16 * np.abs(w).max() / h) / size
    along = sum(slope * h for slope, h in zip(slopes, step[:, 0], strict=True))
    longest = max(np.linalg.norm(slope) * h for slope, h in zip(slopes, step[:, 0], strict=True))
    assume(np.linalg.norm(w[:, -1] - w[:, 0] - along) < KINK * longest)
    area = _area(slopes)
    assume(area > 0)
    flat = np.prod([np.linalg.norm(slope) for slope in slopes]) / area  # of nearly parallel slopes
    assume(error * flat < LARGEST_BOUND)
    return area, error * flat


def _area(slopes: list[Doubles]) -> float:
    if len(slopes) == 1:
        return float(np.linalg.norm(slopes[0]))
    a, b = slopes
    if len(a) == 2:
        return abs(float(a[0] * b[1] - a[1] * b[0]))
    return float(np.linalg.norm(np.cross(a, b)))


def assert_density(sample, u, density, rounding=ROUNDING):
    """Assert density × |∂w/∂u| = 1 at u."""
    area, bound = jacobian(sample, u)
    assert abs(float(density) * area - 1) <= bound + rounding, (density, 1 / area, bound)


def width_of_choice(choose: Callable[[Doubles], Doubles], u: float) -> float:
    """Return the length of the interval of numbers around u for which a choice (n,) is the same.

    It is the probability of what is chosen at u, by bisection; the intervals must be whole, as those of
    inverted cumulative sums are.
    """
    chosen = int(choose(np.array([u]))[0])

    def end(inside: float, outside: float) -> float:
        if int(choose(np.array([outside]))[0]) == chosen:
            return outside
        for _ in range(45):
            middle = (inside + outside) / 2
            if int(choose(np.array([middle]))[0]) == chosen:
                inside = middle
            else:
                outside = middle
        return inside

    return end(u, 1 - 1e-12) - end(u, 0.0)
