"""Work space that is used again, so that large temporaries do not come from fresh memory each time."""

from __future__ import annotations

import math
import threading
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..vec import f4

_memory = threading.local()


def scratch(name: str, shape: tuple[int, ...], dtype: type = f4) -> NDArray[Any]:
    """Return this thread's buffer `name`, uninitialised; its last use ends here."""
    size = math.prod(shape)
    held = getattr(_memory, name, None)
    if held is None or held.size < size:
        held = np.empty(size, dtype)
        setattr(_memory, name, held)
    return held[:size].reshape(shape)
