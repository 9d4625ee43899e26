"""`pytest.approx` for large arrays, which it compares number by number."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike


def assert_near(found: ArrayLike, due: ArrayLike, rel: float = 1e-6, abs: float = 1e-12) -> None:
    """Assert that arrays of one shape agree within the larger of a relative and an absolute tolerance."""
    found, due = np.asarray(found), np.asarray(due)
    assert found.shape == due.shape
    within = np.maximum(rel * np.abs(due.astype(float)), abs)
    wrong = ~((found == due) | (np.abs(found.astype(float) - due) <= within))
    assert not wrong.any(), f"{wrong.sum()} of {wrong.size}: {found[wrong][:9]}, expected {due[wrong][:9]}"
