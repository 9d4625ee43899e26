"""Arrays of shapes that are given for several times."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..arrays.vec import FLOAT32_MAX
from ..core.errors import SceneError, finite_array, shape_of
from ..core.plural import plural
from ..motion import Samples
from ..motion.keyframes import rising


def over_time(
    name: str, times: ArrayLike | None, arrays: Mapping[str, Any]
) -> tuple[dict[str, Any], Samples | None]:
    """Return the arrays of a shape at its start, and how they change.

    Parameters
    ----------
    name
        Of the shape, for messages.
    times
        (t,) seconds, rising; None for a shape that keeps its form.
    arrays
        (t, n, 3), or arrays that stay the same, by the names of attributes.

    Raises
    ------
    SceneError
        If times and arrays do not go together, or are malformed.
    """
    moving = [key for key, value in arrays.items() if len(shape_of(value)) == 3]
    if times is None:
        if moving:
            shape = shape_of(arrays[moving[0]])
            raise SceneError(f"{name}: {moving[0]} has the shape {shape}; a form for each time needs times=")
        return dict(arrays), None
    keys = rising(f"{name}: times", times)
    if not moving:
        raise SceneError(f"{name}: times are given; then {next(iter(arrays))} must have shape (t, n, 3)")
    changing = {}
    for key in moving:
        changing[key] = finite_array(f"{name}: {key}", arrays[key], (None, None, 3))
        if len(changing[key]) != len(keys):
            forms = plural(len(changing[key]), "form")
            raise SceneError(f"{name}: {key} has {forms} and times {len(keys)}; there must be one for each")
        bad = np.argwhere(np.abs(changing[key]) > FLOAT32_MAX)
        if len(bad):
            at = "".join(f"[{i}]" for i in bad[0])
            value = changing[key][tuple(bad[0])]
            raise SceneError(f"{name}: {key}{at} is {value:g}; its size must be at most {FLOAT32_MAX:.3g}")
    return {**arrays, **{key: value[0] for key, value in changing.items()}}, Samples(keys, changing)
