"""Second points of paths whose light depends on the viewer, and that pixels of a tile share all the same.

Such a point y keeps the light that arrives there: by a light sample, and along the direction w in which
the path goes on. The BSDF at y is evaluated anew for each pixel. A light sample does not depend on the pixel,
and is weighted against the BSDF samples of each as in a path of its own, so emission that a path meets next
stays its own. The other light L_j that arrives along w counts by the balance heuristic over the pixels that
could have found both y and w, with q_k the density of w as x_k sees y, and all else as in stages/reuse.py:

    Σ_j f_i(y_j) cos_i G_ij V_ij f_y(x_i, w_j) cos_w L_j / (branches · Σ_k p_kj q_kj)

Source: D. Lin et al., "Generalized Resampled Importance Sampling", SIGGRAPH 2022, section 7.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Self

import numpy as np

from ..arrays.soa import soa
from ..arrays.state import Contribution, Paths
from ..arrays.vec import ALL, Bools, Floats, Ints, f4, take
from ..bsdfs import Bsdf
from ..compile.scene import CompiledScene
from ..sampling.sampler import Sampler
from .shade import Shading, direct

SECTIONS = 3  # columns for each point: light of samples, its own light, light along next directions


class AllOfIt(Bsdf):
    """Scatters 1 to all directions above the surface, and samples none: for light that arrives."""

    def f(self, wo: Floats, wi: Floats) -> Floats:
        """Return 1 above the surface, (3, n)."""
        return np.broadcast_to((wi[2] > 0).astype(f4), wi.shape)

    def pdf(self, wo: Floats, wi: Floats) -> Floats:
        """Return 0, (n,)."""
        return np.zeros(wi.shape[1], f4)


@soa
class GlossyPoints:
    """g glossy points, which follow matte ones among the shared points."""

    shade: Shading  # as the paths that found them see them
    sampled: Floats  # (3, g) world directions of light samples
    pdf: Floats  # (g,) and their densities; any where none has found light
    light: Ints  # (g,) and the numbers of their lights
    next: Floats  # (3, g) world directions in which the paths go on; any where they end

    @classmethod
    def of(
        cls,
        scene: CompiledScene,
        paths: Paths,
        shade: Shading,
        sampler: Sampler,
        onward: Floats,
    ) -> tuple[Self, Contribution]:
        """Return the points that paths have met, and the light that arrives there by samples.

        The paths go on in the world directions `onward` (3, g).
        """
        white = replace(shade, groups=[(slice(0, len(paths)), AllOfIt())])
        arriving = direct(scene, paths, white, sampler, 1, mis=False, directed=True)
        sampled, pdf, light = shade.surface.ns.copy(), np.ones(len(paths), f4), np.zeros(len(paths), np.intp)
        if arriving.wi is not None:
            sampled[:, arriving.lanes], light[arriving.lanes] = arriving.wi, arriving.light
            receiver = None if shade.receiver is None else shade.receiver.take(arriving.lanes)
            start = take(shade.start, arriving.lanes)
            pdf[arriving.lanes] = scene.lights.pdf_li(arriving.light, start, arriving.wi, receiver)
        return cls(shade, sampled, pdf, light, onward), arriving

    def toward(self, which: Ints, wo: Floats | None = None) -> Shading:
        """Return the surfaces of some points (k,) as seen from directions (3, k) or as at first."""
        shade = self.shade.at(which)
        return shade if wo is None else replace(shade, wo=shade.frame.to_local(wo))

    def of_samples(self, scene: CompiledScene, which: Ints, shade: Shading) -> Floats:
        """Return the BSDF of `shade` for light samples of points (k,), with their MIS weight: (3, k)."""
        f, pdf = _evaluated(shade, take(self.sampled, which))
        light, pdf_light = take(self.light, which), take(self.pdf, which)
        return f * scene.lights.mis_weight(light, pdf_light, pdf)

    def of_next(self, which: Ints, shade: Shading) -> tuple[Floats, Floats]:
        """Return the BSDF of `shade` times the cosine of next directions, (3, k), and their density (k,)."""
        world = take(self.next, which)
        f, pdf = _evaluated(shade, world)
        return f * shade.cosines(shade.frame.to_local(world), world)[0], pdf


def _evaluated(shade: Shading, world: Floats) -> tuple[Floats, Floats]:
    """Return f (3, k), without the cosine, and the density (k,) of world directions (3, k)."""
    f, pdf = shade.evaluate(shade.frame.to_local(world))
    return f, shade.density(ALL, world, pdf)


def glossy_materials(scene: CompiledScene) -> Bools:
    """Return which materials (materials,) can be those of glossy points."""
    materials = scene.materials
    rough = np.array(
        [
            not (bsdf.view_independent or bsdf.specular or bsdf.transmissive or bsdf.catches_shadows)
            for bsdf in materials.groups
        ],
        np.bool_,
    )
    return rough.take(materials.group_of) & (materials.normal_map_of < 0)
