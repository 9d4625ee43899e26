"""Which shapes samples see first, for the AOV "coverage"."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..arrays.state import Hits, Paths
from ..arrays.vec import Ints, take
from ..compile.scene import CompiledScene


class Coverage:
    """Which of the names of a scene's shapes each sample of a wave sees first.

    Parameters
    ----------
    scene
        The scene.
    n
        Samples of the wave.
    """

    def __init__(self, scene: CompiledScene, n: int) -> None:
        self._names = tuple(dict.fromkeys(scene.shape_names))
        numbers = {name: number for number, name in enumerate(self._names)}
        self._of_shape = np.array([numbers[name] for name in scene.shape_names], np.intp)
        self._seen = np.full(n, -1, np.intp)

    def record(self, scene: CompiledScene, paths: Paths, hits: Hits) -> None:
        """Record the first surfaces of paths."""
        lanes = hits.found
        self._seen[take(paths.slot, lanes)] = self._of_shape.take(scene.shape_numbers.of(hits.take(lanes)))

    def counts(self, samples: int, dropped: Ints) -> Iterator[tuple[str, Ints]]:
        """Yield each AOV, and how many samples of each pixel (k,) see a shape of that name."""
        self._seen[dropped] = -1
        seen = self._seen.reshape(samples, -1)
        for number, name in enumerate(self._names):
            yield f"coverage.{name}", (seen == number).sum(0, dtype=np.int32)
