"""How much light the samples of a sensor could have found by narrow lobes, and may have missed.

Where a path leaves a rough surface and then, by a delta lobe or a very narrow one, meets a lamp, no light
sample could have found that light. Such paths may be so rare that no sample of a sensor has met one, and then
neither the mean nor its scatter tell of them. It is known only how often paths have left such lobes, and with
which throughput p: as much light as p times the radiance of the brightest emitter may have been missed.

Only sensors in scenes with such lobes and such emitters have the record: `narrow_aovs`.
"""

from __future__ import annotations

import numpy as np

from ..arrays.state import Paths
from ..arrays.vec import Floats, Ints, broadcast, f4, highest, take
from ..compile.brightest import brightest_emitter
from ..compile.scene import CompiledScene
from ..film.aov_names import NARROW

DENSE = f4(10)  # 1/sr: lobes of which samples have a higher density are narrow


def narrow_aovs(scene: CompiledScene) -> tuple[str, ...]:
    """Return the AOV of this record if sensors in a scene need it."""
    if all(bsdf.lambertian for bsdf in scene.materials.groups):
        return ()
    return (NARROW,) if brightest_emitter(scene).any() else ()


class NarrowLobes:
    """The greatest throughput of each sample after a narrow lobe, behind a rough surface.

    Parameters
    ----------
    n
        Slots of the paths, which begin at rough surfaces: sensors, or points that are shared.

    Attributes
    ----------
    throughput
        (3, n) 0 where there is no such lobe.
    """

    def __init__(self, n: int) -> None:
        self.throughput = np.zeros((3, n), f4)
        self._rough = broadcast(np.True_, n)

    def begin(self, paths: Paths) -> None:
        """Note whether paths begin with a narrow lobe: those of a camera do, those of sensors do not."""
        if paths.sensor is None:
            self._rough = np.zeros(self._rough.size, np.bool_)

    def record(self, paths: Paths) -> None:
        """Record how paths have left their last surfaces, when they meet the next ones."""
        narrow = paths.specular | (paths.pdf > DENSE)
        lanes = np.flatnonzero(narrow & take(self._rough, paths.slot))
        if lanes.size:
            slot, throughput = take(paths.slot, lanes), take(paths.throughput, lanes)
            for row, values in zip(self.throughput, throughput, strict=True):
                np.maximum.at(row, slot, values)
        if self._rough.strides[0]:
            self._rough[paths.slot[~narrow]] = True

    def result(self, samples: int, dropped: Ints) -> Floats:
        """Return the highest channel of each sample, (samples, k); 0 of `dropped` ones."""
        peaks = highest(self.throughput)
        peaks[dropped] = 0
        return np.where(np.isfinite(peaks), peaks, f4(0)).reshape(samples, -1)
