"""Import of trimesh, in which Ctrl-C is not lost.

trimesh catches BaseException about optional imports, so a KeyboardInterrupt that is raised there would
vanish, and leave a module half imported.
"""

from __future__ import annotations

from typing import Any

from ...core.interrupt import deferred_signals


def import_trimesh() -> Any:
    """Return the module trimesh. A Ctrl-C that comes while it is imported raises afterwards."""
    with deferred_signals(also_the_second=True):
        import trimesh
    return trimesh
