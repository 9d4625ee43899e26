"""Normal maps and bump maps: see stages/normal_mapping.py for their effect on normals and scattering."""

from __future__ import annotations

from dataclasses import replace
from typing import Self

import numpy as np

from ..arrays.soa import soa
from ..arrays.state import Paths, Rays, SurfaceInteraction
from ..arrays.vec import Floats, dot, take
from ..bsdfs import BsdfSample
from ..compile.program import Facts, Feature
from ..compile.scene import CompiledScene
from ..sampling.sampler import Sampler
from ..stages.normal_mapping import folded_onto, mirrored_at_surface, perturb_normals, unshadowed
from ..stages.shade import Shading


class MappedShading(Shading):
    """Surfaces whose normals may be tilted by maps: light is folded and shadowed there."""

    __slots__ = ()

    def evaluate(self, wi: Floats) -> tuple[Floats, Floats]:
        """Return f (3, n) and the pdf (n,) of directions, and of those that are folded onto them."""
        f, pdf = super().evaluate(wi)
        if self.surface.folds is None:
            return f, pdf
        lanes, other = folded_onto(self.surface, self.frame, wi)
        if lanes.size:
            f, pdf = f.copy(), pdf.copy()
            more, pdf_more = self.at(lanes).evaluate_unfolded(other)
            f[:, lanes] += more * (other[2] / wi[2].take(lanes))
            pdf[lanes] += pdf_more
        return f, pdf

    def cosines(self, local: Floats, world: Floats) -> tuple[Floats, Floats]:
        """Return the cosines, the first weakened by the shadowing of tilted normals."""
        cos, cos_g = super().cosines(local, world)
        if self.surface.unmapped is not None:
            cos = cos * unshadowed(self.surface, world)
        return cos, cos_g

    def aim(
        self, paths: Paths, sample: BsdfSample, sampler: Sampler, bounce: int
    ) -> tuple[BsdfSample, Floats, Floats]:
        """Fold directions that lead to below the surface, where a map folds."""
        sample, direction, scale = super().aim(paths, sample, sampler, bounce)
        if self.surface.folds is not None:
            sample, direction = _folded(self, sample, direction)
        return sample, direction, scale

    def leave(self, paths: Paths, left: Paths, cos_g: Floats, bounce: int) -> None:
        """Shadow light that grazes tilted normals, where a map does."""
        super().leave(paths, left, cos_g, bounce)
        if self.surface.unmapped is not None:
            left.throughput *= unshadowed(self.surface, left.direction)


@soa
class NormalMaps(Feature):
    """Tilts shading normals by the maps of materials."""

    shading = MappedShading

    @classmethod
    def of(cls, facts: Facts) -> Self | None:
        """Return the feature of a scene where a material has a map."""
        return cls() if facts.compiled.materials.normal_maps else None

    def tilt(self, scene: CompiledScene, rays: Rays, surface: SurfaceInteraction) -> None:
        """Tilt the normals."""
        perturb_normals(scene, surface)


def _folded(shade: Shading, sample: BsdfSample, direction: Floats) -> tuple[BsdfSample, Floats]:
    """Return samples and world directions (3, n), those folded that lead to the wrong side of `ng`."""
    surface = shade.surface
    assert surface.folds is not None
    wi, weight, pdf = sample.wi.copy(), sample.weight.copy(), sample.pdf.copy()
    wrong = surface.folds & (wi[2] * dot(surface.ng, direction) < 0)
    lanes = np.flatnonzero(wrong)
    direction[:, lanes] = mirrored_at_surface(surface.ng.take(lanes, 1), direction.take(lanes, 1))
    wi[:, lanes] = shade.frame.take(lanes).to_local(direction.take(lanes, 1))
    twice, image = folded_onto(surface, shade.frame, wi)
    valid = np.flatnonzero(~take(sample.specular, twice) & (pdf.take(twice) > 0))
    if valid.size:
        twice = twice.take(valid)
        # the direction that could have been drawn, too
        other = np.where(wrong.take(twice), wi.take(twice, 1), image.take(valid, 1))
        f, more = shade.at(twice).evaluate_unfolded(other)
        one, both = pdf.take(twice), pdf.take(twice) + more
        weight[:, twice] = (weight.take(twice, 1) * one + f * np.abs(other[2])) / both
        pdf[twice] = both
    return replace(sample, wi=wi, weight=weight, pdf=pdf), direction
