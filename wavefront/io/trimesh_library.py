"""trimesh as a library: its import, in which Ctrl-C is not lost, and its loaders of meshes.

trimesh catches BaseException about optional imports, so a KeyboardInterrupt that is raised there would
vanish, and leave a module half imported.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from io import BytesIO
from typing import Any

import numpy as np

from ..core.errors import SceneError
from ..core.interrupt import deferred_signals, repeated_ctrl_c


def import_trimesh() -> Any:
    """Return the module trimesh. A Ctrl-C that comes while it is imported raises afterwards."""
    with deferred_signals(also_the_second=True):
        import trimesh
    return trimesh


def geometries(name: str, kind: str, data: bytes) -> list[dict[str, Any]]:
    """Return the meshes that trimesh's loader reads; a trimesh object would round their colors to 8 bits.

    Raises
    ------
    SceneError
        For any error of the loader but MemoryError.
    """
    mesh_loaders = import_trimesh().exchange.load.mesh_loaders
    with typed_errors(name, kind):
        loaded = mesh_loaders[kind](BytesIO(data))
    return list(loaded["geometry"].values()) if "geometry" in loaded else [loaded]


@contextmanager
def typed_errors(name: str, kind: str) -> Iterator[None]:
    """Convert any error of a loader but MemoryError to a SceneError; silence NumPy's warnings."""
    try:
        with np.errstate(all="ignore"), repeated_ctrl_c():  # some of them swallow it
            yield
    except (MemoryError, SceneError):
        raise
    except Exception as error:
        raise SceneError(f"{name}: not a readable {kind} file: {error!r}") from error
