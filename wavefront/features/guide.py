"""Path guiding: tables, learned in a training pass, choose some directions. See stages/guidance.py."""

from __future__ import annotations

from ..arrays.soa import soa
from ..arrays.state import Paths
from ..arrays.vec import Floats, Lanes, take
from ..bsdfs import BsdfSample
from ..compile.program import Feature
from ..compile.scene import CompiledScene
from ..guiding import GuideTable
from ..sampling.sampler import Sampler
from ..stages.guidance import guide, mix_with_guide
from ..stages.shade import Shading


class GuidedShading(Shading):
    """Surfaces at which a table chooses some of the directions."""

    __slots__ = ()

    def prepare(self, scene: CompiledScene) -> None:
        """Look up the tables of the surfaces."""
        super().prepare(scene)
        feature = scene.program.find(Guide)
        assert feature is not None
        guide(self, feature.table)

    def density(self, lanes: Lanes, world: Floats, pdf: Floats) -> Floats:
        """Return the densities (k,) of directions, those of BSDFs and tables."""
        pdf = super().density(lanes, world, pdf)
        return pdf if self.guidance is None else self.guidance.mixed(lanes, take(world, lanes), pdf)

    def aim(
        self, paths: Paths, sample: BsdfSample, sampler: Sampler, bounce: int
    ) -> tuple[BsdfSample, Floats, Floats]:
        """Replace some directions by those of the tables."""
        sample, direction, scale = super().aim(paths, sample, sampler, bounce)
        if self.guidance is None:
            return sample, direction, scale
        sample, direction, gain = mix_with_guide(self, paths, sample, direction, sampler, bounce)
        return sample, direction, scale * gain


@soa
class Guide(Feature):
    """Lets a table choose some of the directions. A view has it, not a scene."""

    shading = GuidedShading
    table: GuideTable
