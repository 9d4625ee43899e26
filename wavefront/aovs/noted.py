"""Numbers that integrators of a user's own note about their paths, for the AOVs "noted.NAME"."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from ..arrays.state import Paths
from ..arrays.vec import Floats, add_to_slots, f4
from ..core.errors import SceneError
from ..film.aov_names import NOTED


class Noted:
    """Notes about n samples, (3, n) for each AOV.

    Parameters
    ----------
    names
        Of the AOVs.
    n
        Samples of the wave.
    """

    def __init__(self, names: Iterable[str], n: int) -> None:
        self.values = {name: np.zeros((3, n), f4) for name in names}
        self._seen: set[str] = set()

    def note(self, name: str, paths: Paths, values: Floats, share: float) -> None:
        """Add values (n,) or (3, n) of paths, each of which is the `share` of a sample."""
        sums = self.values.get(f"{NOTED}.{name}")
        if sums is None:  # not asked for
            return
        self._seen.add(f"{NOTED}.{name}")
        if np.shape(values) not in ((len(paths),), (3, len(paths))):
            raise SceneError(
                f"integrators.note: values of {name!r} have the shape {np.shape(values)}; they must have "
                f"(n,) or (3, n), with n = {len(paths)} paths"
            )
        add_to_slots(sums, paths.slot, np.broadcast_to(values, (3, len(paths))) * f4(share))

    def check(self, integrator: str) -> None:
        """Check that the integrator has noted the AOVs that are asked for."""
        for name in self.values.keys() - self._seen:
            raise SceneError(
                f"the integrator {integrator} cannot give the AOV {name!r}: it must call "
                f"wavefront.integrators.note(paths, {name.removeprefix(NOTED + '.')!r}, values)"
            )
