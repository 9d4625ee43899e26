"""Emission at hits, and direct light from one sampled light."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np

from ..arrays.frame import Frame
from ..arrays.soa import soa
from ..arrays.state import Contribution, Hits, Paths, SurfaceInteraction
from ..arrays.vec import ALL, Floats, Ints, Lanes, broadcast, column, dot, f4, highest, take
from ..bsdfs import Bsdf, BsdfSample, albedo_of, evaluated
from ..compile.materials import MaterialTable
from ..compile.program import Passage
from ..compile.scene import CompiledScene
from ..guiding import GuideTable
from ..lights import LightSample, Receiver
from ..sampling.mis import power_heuristic
from ..sampling.sampler import Dimension, Sampler
from .interaction import interaction, offset_origin, origin_above
from .intersect import ShadowRays, shadow_rays, visible
from .transmittance import opacities_at, transmittance_along

UP = column((0, 0, 1))


@soa
class Guidance:
    """The table that guides the lanes which light samples reach, and its part in each direction."""

    table: GuideTable
    row: Ints  # (n,) row of the table
    share: Floats  # (n,) probability with which a direction is drawn from the table; 0 where it never is

    def mixed(self, lanes: Lanes, direction: Floats, pdf: Floats) -> Floats:
        """Return the densities (k,) of directions (3, k) of some lanes, given those of the BSDF."""
        share = take(self.share, lanes)
        return pdf + share * (self.table.pdf(take(self.row, lanes), direction) - pdf)


@soa
class LightRays:
    """Which shadow rays leave some lanes of surfaces, for lights."""

    scene: CompiledScene
    paths: Paths  # at the surfaces, n or more: those that light samples reach come first
    lanes: Ints  # (k,) where the rays start
    light: Ints  # (k,) numbers of the lights that they lead to
    cos_g: Floats  # (n,) cosines of directions to lights with `ng`
    sampler: Sampler
    bounce: int


@soa
class Shading:
    """Surfaces prepared for shading: local frames, and the lanes of each group of materials."""

    surface: SurfaceInteraction
    frame: Frame
    wo: Floats  # (3, n) local frame; +z if all BSDFs are view-independent
    start: Floats  # (3, n) origins of rays that leave to the side of wo, scene units
    # lanes of each group that occurs, and its BSDF bound to them: slices in order, but not those of `at`
    groups: list[tuple[Lanes, Bsdf]]
    guidance: Guidance | None = None  # of the lanes of `lit`; None where BSDFs alone choose directions
    receiver: Receiver | None = None  # for which lights are sampled; None where no light takes it
    volume: Ints | None = None  # lanes within media, where there is no cosine; None in scenes without media
    crossing: Any = None  # (k, n) changes of stacks at the surfaces; likewise
    materials: MaterialTable | None = None  # of the scene

    def lit(self) -> Shading:
        """Return the lanes that need light sampling; the groups after them have only delta lobes."""
        groups = [(lanes, bsdf) for lanes, bsdf in self.groups if not bsdf.specular]
        if len(groups) == len(self.groups):
            return self
        last = groups[-1][0] if groups else slice(0)
        assert isinstance(last, slice)  # `compact` has ordered the lanes
        first = slice(last.stop)
        parts = self.surface.take(first), self.frame.take(first), self.wo[:, first], self.start[:, first]
        receiver = None if self.receiver is None else self.receiver.take(first)
        crossing = None if self.crossing is None else self.crossing[:, first]
        return type(self)(*parts, groups, self.guidance, receiver, self.volume, crossing, self.materials)

    def at(self, lanes: Ints) -> Shading:
        """Return the surfaces of some lanes (k,) of `lit`, in any order; a lane may occur again."""
        surface = self.surface.take(lanes)
        if self.surface.ns is self.surface.ng:
            surface.ns = surface.ng
        parts = surface, self.frame.take(lanes), take(self.wo, lanes), take(self.start, lanes)
        receiver = None if self.receiver is None else self.receiver.take(lanes)
        assert self.materials is not None
        groups = list(_groups_anywhere(self.materials, surface))
        return type(self)(*parts, groups, self.guidance_at(lanes), receiver, materials=self.materials)

    def guidance_at(self, lanes: Ints) -> Guidance | None:
        """Return the guidance of some lanes (k,) of `lit`; None without a guide."""
        if self.guidance is None:
            return None
        return replace(
            self.guidance, row=self.guidance.row.take(lanes), share=self.guidance.share.take(lanes)
        )

    def albedo(self) -> Floats:
        """Return the albedo of the surfaces, (3, n)."""
        albedo = np.empty_like(self.surface.ns)
        for lanes, bsdf in self.groups:
            albedo[:, lanes] = albedo_of(bsdf, take(self.wo, lanes))
        return albedo

    def cosines(self, local: Floats, world: Floats) -> tuple[Floats, Floats]:
        """Return |cosθ| (n,) of directions, known in both frames, and their cosine against `ng`, (n,).

        Where the two normals disagree on the side of a direction the first is 0, so that no light leaks
        through. Within media both are 1.
        """
        if self.surface.ns is self.surface.ng:
            cos, cos_g = np.abs(local[2]), local[2]
        else:
            cos_g = dot(self.surface.ng, world)
            cos = np.abs(local[2]) * (local[2] * cos_g > 0)
        return cos, cos_g

    def evaluate(self, wi: Floats) -> tuple[Floats, Floats]:
        """Return f (3, n), without the cosine, and the pdf (n,) of local directions wi (3, n)."""
        return self.evaluate_unfolded(wi)

    def evaluate_unfolded(self, wi: Floats) -> tuple[Floats, Floats]:
        """Return f (3, n) and the pdf (n,) as they are before directions are folded."""
        if len(self.groups) == 1:
            return evaluated(self.groups[0][1], self.wo, wi)
        n = wi.shape[1]
        f, pdf = np.empty((3, n), f4), np.empty(n, f4)
        for lanes, bsdf in self.groups:
            part_f, part_pdf = evaluated(bsdf, take(self.wo, lanes), take(wi, lanes))
            f[:, lanes], pdf[lanes] = part_f, part_pdf
        return f, pdf

    # --- Points for features --------------------------------------------------------------------------

    def origins(self, cos_g: Floats) -> Floats:
        """Return where rays (3, n) start that leave with cosines (n,) against `ng`."""
        return offset_origin(self.surface, cos_g) if (cos_g < 0).any() else self.start

    def prepare(self, scene: CompiledScene) -> None:
        """Get ready to be shaded."""

    def unmet(self, prim: Ints, direction: Floats, lanes: Lanes) -> Ints:
        """Return the primitives (k,) that rays along (3, k) do not meet: `prim`, which they leave, or -1."""
        return prim

    def density(self, lanes: Lanes, world: Floats, pdf: Floats) -> Floats:
        """Return the densities (k,) with which paths take world directions, given those of the BSDFs.

        `world` (3, n) are directions of all lanes of `lit`, of which `lanes` (k,) are looked at.
        """
        return pdf

    def enter(self, rays: ShadowRays, of: LightRays) -> None:
        """Give shadow rays (k) the columns that they need."""

    def aim(
        self, paths: Paths, sample: BsdfSample, sampler: Sampler, bounce: int
    ) -> tuple[BsdfSample, Floats, Floats]:
        """Return samples of the BSDFs, their world directions (3, n), and the paths' `roulette_scale`."""
        scale = paths.roulette_scale
        return sample, self.frame.to_world(sample.wi), scale if sample.eta is None else scale * sample.eta**2

    def leave(self, paths: Paths, left: Paths, cos_g: Floats, bounce: int) -> None:
        """Change the columns of paths that have `left` with cosines (n,) against `ng`."""


@cache
def shading_kind(base: type[Shading], parts: tuple[type[Shading], ...]) -> type[Shading]:
    """Return a kind of shading that is all of these, `base` innermost."""
    return type(base.__name__, (*parts, base), {"__slots__": ()}) if parts else base


def emitted(scene: CompiledScene, paths: Paths, hits: Hits) -> Contribution:
    """Return the light that the paths' rays meet: emitting surfaces, and the environment on a miss."""
    lanes = np.flatnonzero(scene.emissive.take(hits.prim))  # a miss, -1, takes the last entry
    light = scene.light_of.take(hits.prim.take(lanes))

    def surface_at(some: Ints) -> SurfaceInteraction:
        shining = lanes.take(some)
        return interaction(scene, paths.take(shining), hits.take(shining))

    pdf = None
    if scene.lights.texels is not None:
        pdf = np.where(take(paths.specular, lanes), f4(np.inf), take(paths.pdf, lanes))
    time = None if paths.time is None else paths.time.take(lanes)
    radiance = scene.lights.le(light, paths.direction.take(lanes, 1), surface_at, pdf, time)
    return Contribution(lanes, radiance, light)


def mis_weighted(scene: CompiledScene, paths: Paths, emission: Contribution) -> Contribution:
    """Return emission with its MIS weight; 1 where light sampling could not have found it."""
    sampled = np.flatnonzero(
        ~take(paths.specular, emission.lanes) & scene.lights.chosen_from.take(emission.light)
    )
    if not sampled.size:
        return emission
    lanes = emission.lanes.take(sampled)
    start = take(paths.last_vertex, lanes)
    receiver = None if paths.left_receiver is None else paths.left_receiver.take(lanes)
    light = emission.light.take(sampled)
    pdf = scene.lights.pdf_li(light, start, take(paths.direction, lanes), receiver)
    weight = np.ones(len(emission.lanes), f4)
    weight[sampled] = power_heuristic(take(paths.pdf, lanes), pdf)
    return Contribution(emission.lanes, emission.radiance * weight, emission.light)


def shading(scene: CompiledScene, surface: SurfaceInteraction) -> Shading:
    """Return local frames and groups of surfaces; `compact` has ordered the lanes by group."""
    frame = surface.frame()
    groups = list(_groups(scene.materials, surface))
    if all(bsdf.view_independent for _, bsdf in groups):
        wo = np.broadcast_to(UP, surface.wo.shape)
    else:
        wo = frame.to_local(surface.wo)
    shade = shading_kind(Shading, scene.program.shading)(
        surface, frame, wo, origin_above(surface), groups, materials=scene.materials
    )
    shade.prepare(scene)
    return shade


def receiver_of(surface: SurfaceInteraction, groups: list[tuple[Lanes, Bsdf]]) -> Receiver:
    """Return the receiver of lights at surfaces."""
    opaque = broadcast(True, len(surface))
    if any(bsdf.transmissive for _, bsdf in groups):
        opaque = opaque.copy()
        for lanes, bsdf in groups:
            opaque[lanes] = not bsdf.transmissive
    return Receiver(surface.ns, opaque, time=surface.time)


def _groups(materials: MaterialTable, surface: SurfaceInteraction) -> Iterator[tuple[Lanes, Bsdf]]:
    """Yield the lanes of each group that occurs, which follow each other, and its BSDF bound to them."""
    if len(materials.groups) == 1:
        yield slice(0, len(surface)), materials.groups[0].bind(surface)
        return
    group_of = materials.group_of.take(surface.material)
    starts = np.searchsorted(group_of, np.arange(len(materials.groups) + 1))
    for number in np.flatnonzero(np.diff(starts)):
        lanes = slice(int(starts[number]), int(starts[number + 1]))
        yield lanes, materials.groups[number].bind(surface.take(lanes))


def _groups_anywhere(materials: MaterialTable, surface: SurfaceInteraction) -> Iterator[tuple[Lanes, Bsdf]]:
    """Yield the lanes of each group that occurs, in any order, and its BSDF bound to them."""
    group_of = materials.group_of.take(surface.material)
    for number, group in enumerate(materials.groups):
        lanes = np.flatnonzero(group_of == number)
        if lanes.size == len(surface):
            yield ALL, group.bind(surface)
        elif lanes.size:
            yield lanes, group.bind(surface.take(lanes))


def direct(
    scene: CompiledScene,
    paths: Paths,
    shade: Shading,
    sampler: Sampler,
    bounce: int,
    mis: bool,
    directed: bool = False,
) -> Contribution:
    """Return direct light: from one sampled light to each point, and on along wo.

    With `mis` it is weighted by the power heuristic against BSDF sampling. Surfaces that have
    only delta lobes get none. With `directed` it has its directions, whether a recorder needs them or not.
    """
    shade = shade.lit()
    if scene.lights.choice is None or not shade.groups:
        nothing = np.zeros(0, np.intp)
        return Contribution(nothing, np.zeros((3, 0), f4), nothing, sampled=True)
    n = len(shade.surface)
    address = paths.pixel[:n], paths.sample[:n], bounce
    # with one light, the choice needs no random number
    alone = np.count_nonzero(scene.lights.chosen_from) == 1
    u_choice = broadcast(f4(0), n) if alone else sampler.draw_1d(*address, Dimension.LIGHT)
    u_point = sampler.draw_2d(*address, Dimension.LIGHT_POINT)
    # from where a reflected ray would start, so that mis_weighted finds the same densities
    light, number = scene.lights.sample_li(shade.start, u_choice, u_point, shade.receiver)
    wi = shade.frame.to_local(light.wi)
    cos, cos_g = shade.cosines(wi, light.wi)
    f, pdf = shade.evaluate(wi)
    lit = (light.pdf > 0) & (highest(f) * cos != 0)  # NaN stays, so that it reaches the picture
    lanes = np.flatnonzero(lit)
    origin = shade.origins(cos_g) if (lit & (cos_g < 0)).any() else shade.start
    rays = shadow_rays(shade.surface, origin, light, lanes)
    number = take(number, lanes)
    rays.exclude_prim = shade.unmet(rays.exclude_prim, rays.direction, lanes)
    shade.enter(rays, LightRays(scene, paths, lanes, number, cos_g, sampler, bounce))
    radiance = radiance_at_samples(scene, rays, light, lanes, number)
    if scene.program.dims_shadows:
        radiance = radiance * transmittance_along(scene, rays)
    else:
        seen = np.flatnonzero(visible(scene, rays))
        lanes, radiance, number = lanes.take(seen), take(radiance, seen), take(number, seen)
    pdf_light, pdf = take(light.pdf, lanes), take(pdf, lanes)
    scale = cos.take(lanes) / pdf_light
    if mis:
        pdf = shade.density(lanes, light.wi, pdf)
        scale *= scene.lights.mis_weight(number, pdf_light, pdf)
    arriving = f.take(lanes, 1) * radiance * scale
    directed = directed or paths.recorder.needs_directions
    toward = take(light.wi, lanes) if directed else None
    return Contribution(lanes, arriving, number, sampled=True, wi=toward)


def radiance_at_samples(
    scene: CompiledScene, rays: ShadowRays, light: LightSample, lanes: Ints, number: Ints
) -> Floats:
    """Return the radiance (3, k) of some light samples, looked up on the surface of lights that vary there.

    A surface with an alpha sends as much less: paths meet it less often.

    Parameters
    ----------
    rays, number
        k rays to the sampled points, and the numbers (k,) of the lights.
    light, lanes
        n samples, and which of them (k,) these are.
    """
    radiance = take(light.radiance, lanes)
    if light.prim is None:
        return radiance
    prim = light.prim.take(lanes)
    on_surface = np.flatnonzero(prim >= 0)
    if not on_surface.size:
        return radiance
    at, rays = lanes.take(on_surface), rays.take(on_surface)
    assert light.b1 is not None
    assert light.b2 is not None
    surface = interaction(
        scene, rays, Hits(rays.distance, prim.take(on_surface), light.b1.take(at), light.b2.take(at))
    )
    sent = scene.lights.le(number.take(on_surface), rays.direction, surface.take)
    radiance = radiance.copy()
    if scene.program.see_through:
        unhidden = replace(rays, media=None)  # media around it hide no surface from samples on it
        sent = sent * opacities_at(Passage(scene, unhidden, surface, None, 0), scene.program.see_through)
    radiance[:, on_surface] = sent
    return radiance
