"""Tables of what something holds: paths to attributes, such as `shapes[0].material`, and their values."""

import re
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np


class Near(NamedTuple):
    """Numbers within a relative error."""

    value: Any
    rel: float = 1e-6


def at(thing: Any, path: str) -> Any:
    """Return what a path leads to; "" is the thing itself."""
    for name, index in re.findall(r"([a-z_]\w*)|\[(\d+)\]", path):
        thing = getattr(thing, name) if name else thing[int(index)]
    return thing


def check(thing: Any, due: Mapping[str, Any]) -> None:
    """Compare what paths lead to: with a type, numbers (one for all, or each), or anything else as it is."""
    for path, expected in due.items():
        found = at(thing, path)
        if isinstance(expected, type):
            assert type(found) is expected, path
        elif isinstance(expected, Near):
            np.testing.assert_allclose(
                np.ravel(found), _row(expected.value), expected.rel, 1e-12, err_msg=path
            )
        elif not isinstance(expected, bool) and np.asarray(expected).dtype.kind in "if":
            np.testing.assert_array_equal(np.ravel(found), _row(expected), err_msg=path)
        else:
            assert found == expected, path


def _row(numbers: Any) -> Any:
    return np.ravel(numbers) if np.ndim(numbers) else numbers
