"""Values of attributes of prims, and of the matrices that place them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ...shapes.transform import Matrix

EVEN = 1.001  # ratio of the scales along two axes that is taken for rounding


def value_of(prim: Any, time: Any, name: str, default: Any = None) -> Any:
    """Return an attribute of a prim at a time, or a default where it has no value."""
    attribute = prim.GetAttribute(name)
    value = attribute.Get(time) if attribute else None
    return default if value is None else value


def is_even(matrix: Matrix) -> bool:
    """Return whether a matrix scales lengths alike in all directions."""
    scales = np.linalg.svd(matrix[:3, :3], compute_uv=False)
    return bool(scales[0] <= EVEN * scales[2])


def check_even(matrix: Matrix, lose: Callable[[str], None]) -> None:
    """Note a matrix that scales lengths along one axis more than along another."""
    if not is_even(matrix):
        lose("its stretch along one axis")


def mean_scale(matrix: Matrix) -> float:
    """Return the mean factor of lengths of a matrix."""
    return float(abs(np.linalg.det(matrix[:3, :3])) ** (1 / 3))
