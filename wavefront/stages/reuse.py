"""Re-use of paths among the pixels of a tile.

The path of each pixel goes on from its first surface, at x, to a second one, at y. If the light that leaves
y is the same in all directions, the other pixels of the tile may use it as well: each connects its x to the
y of all. With p_kj the density, per area, with which the sampling at x_k finds y_j, 0 where something is
between them, the balance heuristic gives pixel i

    Σ_j f_i(y_j) cos_i G_ij V_ij R_j / (branches · Σ_k p_kj)

where G = cos_y / distance² and R_j is the light that leaves y_j. Light that a pixel finds at points that
cannot be shared stays its own, and so does light by delta lobes. Whether a point can be shared does not
depend on which pixel finds it, so the sum of both is unbiased.

Sources: P. Bekaert, M. Sbert and J. Halton, "Accelerating Path Tracing by Re-Using Paths", Eurographics
Workshop on Rendering 2002; E. Veach and L. Guibas, "Optimally Combining Sampling Techniques", SIGGRAPH 1995.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Self

import numpy as np

from ..arrays.soa import soa
from ..arrays.state import Hits, Paths, SoA
from ..arrays.vec import (
    ALL,
    INV_PI,
    TINY,
    Bools,
    Doubles,
    Floats,
    Ints,
    dot,
    f4,
    highest,
    normalize,
    positive,
    spans,
    take,
)
from ..compile.media import stacks_leaving
from ..compile.scene import CompiledScene
from ..sampling.tiles import MEMBERS, WaveTiles
from .glossy_points import SECTIONS, GlossyPoints, glossy_materials
from .interaction import interaction, material_rows
from .intersect import ShadowRays, visible
from .shade import Guidance, Shading
from .transmittance import transmittance_along

SHARED_WAYS = 2  # in which a path goes on from its shared point: many pixels use its light
TILES_AT_ONCE = (1 << 15) // MEMBERS  # per batch: the connections of their first points fit the cache
GRAZING = f4(1 / 16)  # cosine to interpolated normals below which they may have been bent towards the viewer


@soa
class SharedPoints(SoA):
    """Second points y of paths, and the light that leaves them."""

    slot: Ints  # (k,) of their paths
    way: Ints  # (k,) which branch of its path each is
    point: Floats  # (3, k)
    error: Floats  # (k,) bound on the rounding error of `point`, scene units
    ng: Floats  # (3, k) unit geometric normal, on the side from which light leaves
    ns: Floats  # (3, k) unit shading normal
    throughput: Floats  # (3, k) of the paths that found them


def shared_points(
    scene: CompiledScene, paths: Paths, hits: Hits, branches: int
) -> tuple[Ints, SharedPoints, int]:
    """Return the lanes (k,) of paths whose second surfaces can be shared, and these points, first matte ones.

    They are points without normal maps, which no medium without a table separates from the first ones, and
    which were not found by a delta lobe. Interpolated normals that the viewer sees at a grazing angle depend
    on the viewer. The last value is how many points are matte; the others are of stages/glossy_points.py.
    """
    rows = material_rows(scene, hits, ALL)
    matte = shared_materials(scene).take(rows)
    shareable = matte | glossy_materials(scene).take(rows)
    lanes = np.flatnonzero(~paths.specular & shareable)
    surface = interaction(scene, paths.take(lanes), hits.take(lanes))
    good = np.ones(lanes.size, np.bool_)
    if scene.shading_normals:
        good &= dot(surface.ns, surface.wo) > GRAZING
    if scene.program.weaken:
        good &= ~surface.back_facing
    matte = matte.take(lanes)
    order = np.concatenate([np.flatnonzero(good & matte), np.flatnonzero(good & ~matte)])
    lanes, surface = lanes.take(order), surface.take(order)
    way = (take(paths.sample, lanes) % np.uint32(branches)).astype(np.intp)
    points = SharedPoints(
        take(paths.slot, lanes),
        way,
        surface.point,
        surface.error,
        surface.ng,
        surface.ns,
        take(paths.throughput, lanes),
    )
    return lanes, points, int(np.count_nonzero(good & matte))


def as_shared(paths: Paths, columns: int | None = None) -> Paths:
    """Return paths at shared points as paths that begin there, each with a slot of its own.

    Their throughput is 1 from here on, also in channels that the first surface does not reflect. Russian
    roulette goes by the throughput that they had.
    """
    n = len(paths)
    return replace(
        paths,
        slot=np.arange(n),
        throughput=np.ones((3, n), f4),
        roulette_scale=paths.roulette_scale * highest(paths.throughput),
        depth=None,
        met_rough=None,
        recorder=paths.recorder.of_shared(columns or n),
    )


def add_shared(
    scene: CompiledScene,
    sums: Sequence[tuple[Floats, Floats]],
    paths: Paths,
    shade: Shading,
    points: SharedPoints,
    tiles: WaveTiles,
    branches: int,
    glossy: GlossyPoints | None = None,
) -> None:
    """Add to all slots the light that their first points receive from the shared points of their tiles.

    Parameters
    ----------
    sums
        The radiance of each slot, (3, n), and that which leaves each of k shared points, (3, k), or arrives
        at `glossy` ones, in columns of three sections. After the first pair come those of parts of it.
    paths, shade
        The first surfaces of the wave's paths.
    """
    lit = shade.lit()
    if not lit.groups or not len(points):
        return
    slot = paths.slot[: len(lit.surface)]
    lane_in = tiles.grid(slot)
    lights = [light for _, light in sums]
    shining = highest(lights[0]) != 0  # NaN counts: it must reach the picture
    matte = len(points) if glossy is None else len(points) - glossy.pdf.size
    if glossy is not None:
        g = glossy.pdf.size
        shining[-SECTIONS * g : -2 * g] |= shining[-g:]
        shining = shining[: len(points)]
    number_in = [
        tiles.grid(points.slot, np.flatnonzero(shining & (points.way == way))) for way in range(branches)
    ]
    surface = lit.surface
    own_cosine = surface.unmapped is None and surface.folds is None and surface.lift is None
    plain = own_cosine and all(bsdf.lambertian for _, bsdf in lit.groups)
    albedo = lit.albedo() if plain else None
    received = [np.zeros((3, slot.size), f4) for _ in sums]
    for span in spans(tiles.count, TILES_AT_ONCE):
        first = FirstPoints.of(lit, albedo, lane_in[:, span], paths.media)
        if first is None:
            continue
        numbers = [numbers[:, span] for numbers in number_in]
        received_here, lost = _arriving(scene, first, points, lights, numbers, glossy)
        for number in filter(len, lost):  # they stay the path's own
            for L, light in sums:
                leaving = _leaving(scene, light, number, matte, glossy)
                L[:, points.slot.take(number)] += take(points.throughput, number) * leaving
        cells = np.flatnonzero(first.present)
        lanes = lane_in[:, span].reshape(-1).take(cells)
        for values, arriving in zip(received, received_here, strict=True):
            values[:, lanes] = arriving.reshape(3, -1).take(cells, 1)
    for (L, _), values in zip(sums, received, strict=True):
        L[:, slot] += paths.throughput[:, : slot.size] * values


def _leaving(
    scene: CompiledScene, light: Floats, number: Ints, k: int, glossy: GlossyPoints | None
) -> Floats:
    """Return the light that leaves points, the first k of them matte, towards their own paths."""
    leaving = take(light, number)
    shiny = np.flatnonzero(number >= k)
    if glossy is not None and shiny.size:
        at = number.take(shiny)
        shade = glossy.toward(at - k)
        f, pdf = glossy.of_next(at - k, shade)
        f /= np.where(pdf > 0, pdf, f4(1))
        arriving = glossy.of_samples(scene, at - k, shade) * take(light, at)
        leaving[:, shiny] = arriving + f * take(light, at + 2 * glossy.pdf.size)
    return leaving


def _arriving(
    scene: CompiledScene,
    first: FirstPoints,
    points: SharedPoints,
    lights: Sequence[Floats],
    number_in: list[Ints],
    glossy: GlossyPoints | None = None,
) -> tuple[list[Floats], list[Ints]]:
    """Return the light that first points of t tiles receive, (3, members, t), and the shared points left out.

    Parameters
    ----------
    lights
        Radiances (3, k) that leave the points; the first points receive each by itself.
    number_in
        For each branch, which of the points (members, t) each path has found; -1 for none. Those that
        rounding keeps from all first points are left out.
    """
    arriving = [np.zeros((3, *first.present.shape), f4) for _ in lights]
    lost = []
    for numbers in number_in:
        rows = [(member, number) for member, number in enumerate(numbers) if (number >= 0).any()]
        of_rows = [connect(scene, first, points.take(number), number >= 0, member) for member, number in rows]
        attenuate(scene, of_rows)
        for (_, number), connections in zip(rows, of_rows, strict=True):
            total = _sum(connections.pdf * connections.geometry)
            connected = total > 0
            share = connections.geometry / (np.where(connected, total, f4(1)) * f4(len(number_in)))
            weight = connections.f * share
            if glossy is not None:
                _add_glossy(
                    scene, first, points, lights, arriving, glossy, number, connections, weight, total
                )
                weight = weight * (number < len(points) - glossy.pdf.size)
            for values, light in zip(arriving, lights, strict=True):
                values += weight * take(light, number)[:, None]
            lost.append(number.compress((number >= 0) & ~connected))
    if first.albedo is not None:
        for values in arriving:
            values *= first.albedo
    return arriving, lost


def _add_glossy(
    scene: CompiledScene,
    first: FirstPoints,
    points: SharedPoints,
    lights: Sequence[Floats],
    arriving: list[Floats],
    glossy: GlossyPoints,
    number: Ints,
    connections: Connections,
    weight: Floats,
    total: Floats,
) -> None:
    """Add the light of the glossy ones among the shared points of t tiles to first points, as `_arriving`.

    Parameters
    ----------
    weight, total
        (1 or 3, members, t) and (t,) of light that leaves a point to all sides alike.
    """
    g, t = glossy.pdf.size, number.size
    matte = len(points) - g
    arrives = [highest(lights[0][:, start : start + g]) != 0 for start in (matte, matte + 2 * g)]
    cells = np.flatnonzero((connections.geometry > 0) & (number >= matte))
    at = number.take(cells % t) - matte
    wo = normalize(take(first.start.reshape(3, -1), cells) - take(points.point, at + matte))
    for by_samples, lit in zip((True, False), arrives, strict=True):
        chosen = np.flatnonzero(lit.take(at))
        if not chosen.size:
            continue
        cell, which = cells.take(chosen), at.take(chosen)
        shade = glossy.toward(which, take(wo, chosen))
        share = weight.reshape(-1, t * MEMBERS).take(cell, 1)
        if by_samples:
            f, column = glossy.of_samples(scene, which, shade), matte
        else:
            (f, pdf), column = glossy.of_next(which, shade), matte + 2 * g
            joint = np.zeros(t * MEMBERS, f4)
            joint[cell] = (connections.pdf * connections.geometry).reshape(-1).take(cell) * pdf
            density = _sum(joint.reshape(MEMBERS, t))
            share *= (total / np.where(density > 0, density, f4(np.inf))).take(cell % t)
        for values, light in zip(arriving, lights, strict=True):
            values.reshape(3, -1)[:, cell] += share * f * take(light, which + column)


@soa
class FirstPoints:
    """First points of t tiles as a grid, so that each shared point stands beside those of its tile.

    All that is not a grid has (members * t) columns.
    """

    present: Bools  # (members, t) which cells have a point; the others hold that of any other cell
    start: Floats  # (3, members, t) origins of rays that leave to the side from which the point was seen
    error: Floats  # (members, t) bound on the rounding error of the point, scene units
    prim: Ints  # primitive ids
    normal: Floats  # (3, ·) unit shading normals
    shade: Shading | None  # None if all are Lambertian, and then:
    albedo: Floats | None  # (3, members, t) by which f is multiplied in the end
    ng: Floats | None  # (3, ·) unit geometric normals, if they differ from the shading normals
    guidance: Guidance | None
    # (4, ·) stacks of the paths that come, and their changes at the surfaces, (k, ·)
    media: Any = None  # None in scenes without a table of media
    crossing: Any = None  # likewise
    time: Doubles | None = None  # (·,) of the paths; None where nothing moves while the shutter is open

    @classmethod
    def of(cls, lit: Shading, albedo: Floats | None, lane_in: Ints, media: Any = None) -> Self | None:
        """Return the points of a grid (members, t) of lanes, where -1 stands for none; None if all are -1.

        Parameters
        ----------
        lit
            The first surfaces of a wave, n lanes.
        albedo
            (3, n) if all are Lambertian.
        media
            (4, n or more) stacks of the paths that come.
        """
        present, shape = lane_in >= 0, lane_in.shape
        some = lane_in[present]
        if not some.size:
            return None
        lanes = np.where(present, lane_in, some[0]).reshape(-1)
        inside = None, None
        if media is not None:
            inside = take(media, lanes), take(lit.crossing, lanes)
        time = None if lit.surface.time is None else take(lit.surface.time, lanes)
        if albedo is None:
            at = lit.at(lanes)
            start, error = at.start.reshape(3, *shape), at.surface.error.reshape(shape)
            prim, ns = at.surface.prim, at.surface.ns
            return cls(present, start, error, prim, ns, at, None, None, at.guidance, *inside, time)
        surface, albedo = lit.surface, take(albedo, lanes).reshape(3, *shape)
        return cls(
            present & (highest(albedo) != 0),
            take(lit.start, lanes).reshape(3, *shape),
            take(surface.error, lanes).reshape(shape),
            take(surface.prim, lanes),
            take(surface.ns, lanes),
            None,
            albedo,
            None if surface.ns is surface.ng else take(surface.ng, lanes),
            lit.guidance_at(lanes),
            *inside,
            time,
        )

    def evaluate(self, wi: Floats) -> tuple[Floats, Floats]:
        """Return f times the cosine, (1 or 3, n), and the pdf (n,) of directions (3, n), one for each cell.

        f is without the albedo where that is given.
        """
        if self.shade is not None:
            local = self.shade.frame.to_local(wi)
            f, pdf = self.shade.evaluate(local)
            return f * self.shade.cosines(local, wi)[0], pdf
        pdf = positive(dot(self.normal, wi)) * INV_PI
        f = pdf if self.ng is None else pdf * (dot(self.ng, wi) > 0)
        return f[None], pdf

    def toward(self, point: Floats) -> Floats:
        """Return the origins (3, members, t) of rays to points (3, 1, t)."""
        if self.shade is None or not any(bsdf.transmissive for _, bsdf in self.shade.groups):
            return self.start
        surface, shape = self.shade.surface, self.start.shape
        cos = dot(surface.ng.reshape(shape), point - surface.point.reshape(shape))
        return self.shade.origins(cos.reshape(-1)).reshape(shape)

    def unmet(self, direction: Floats, lanes: Ints) -> Ints:
        """Return the primitives (k,) that rays from some cells along directions (3, k) do not meet."""
        prim = take(self.prim, lanes)
        return prim if self.shade is None else self.shade.unmet(prim, direction, lanes)

    def stacks(self, direction: Floats, lanes: Ints) -> Any:
        """Return the stacks (4, k) of rays that leave some cells along directions (3, k)."""
        if self.media is None:
            return None
        media = take(self.media, lanes)
        if self.shade is None:  # rays leave on the side from which the paths came
            return media
        cos = dot(take(self.shade.surface.ng, lanes), direction)
        return stacks_leaving(media, take(self.crossing, lanes), cos)


@soa
class Connections:
    """Connections of the first points of t tiles to one shared point each; all is 0 where there is none."""

    f: Floats  # (1 or 3, members, t) BSDF times cosine at the first point, 1/sr; see `FirstPoints.evaluate`
    pdf: Floats  # (members, t) density with which a path from the first point takes the direction, 1/sr
    geometry: Floats  # (members, t) cosine at the shared point / distance², 0 where something is between
    lanes: Ints  # (k,) cells of which that is not known yet
    rays: ShadowRays  # k that find it out


def connect(
    scene: CompiledScene, first: FirstPoints, target: SharedPoints, there: Bools, member: int
) -> Connections:
    """Connect first points to shared points, as if nothing were between them.

    Parameters
    ----------
    first
        Points of t tiles.
    target
        A point for each tile.
    there
        (t,) where there is one.
    member
        Whose paths have found these points, so that nothing is between.
    """
    shape, ng, point = first.present.shape, target.ng[:, None], target.point[:, None]
    start = first.toward(point)
    direction = point - start
    squared = dot(direction, direction)
    distinct = squared > TINY  # so that 1 / distance² is finite
    if not distinct.all():
        np.copyto(direction, first.normal.reshape(3, *shape), where=~distinct)
        np.copyto(squared, f4(1), where=~distinct)
    inverse = f4(1) / np.sqrt(squared)
    direction *= inverse
    cos_target = dot(-ng, direction)
    possible = first.present & there & distinct & (cos_target > 0)
    if scene.shading_normals:
        possible &= -dot(target.ns[:, None], direction) > GRAZING
    wi = direction.reshape(3, -1)
    f, pdf = first.evaluate(wi)
    if first.guidance is not None:
        pdf = first.guidance.mixed(ALL, wi, pdf)
    # paths without throughput end at their first point
    possible &= ((pdf > 0) & (f.max(0) != 0)).reshape(shape)
    geometry = cos_target * inverse
    geometry *= inverse
    geometry *= possible
    if not scene.program.dims_shadows:
        possible[member] = False
    lanes = np.flatnonzero(possible)
    error = first.error + target.error
    toward = take(wi, lanes)
    rays = ShadowRays(
        origin=take(start.reshape(3, -1), lanes),
        direction=toward,
        exclude_prim=first.unmet(toward, lanes),
        error=take(error.reshape(-1), lanes),
        distance=f4(1) / take(inverse.reshape(-1), lanes),
        cos_light=take(cos_target.reshape(-1), lanes),
        media=first.stacks(toward, lanes),
        time=None if first.time is None else take(first.time, lanes),
    )
    return Connections(f.reshape(-1, *shape), pdf.reshape(shape), geometry, lanes, rays)


def attenuate(scene: CompiledScene, of_rows: list[Connections]) -> None:
    """Multiply connections, in place, by the transmittance between their points: one query for all."""
    if not of_rows:
        return
    rays = ShadowRays.concatenate([connections.rays for connections in of_rows])
    ends = np.cumsum([connections.lanes.size for connections in of_rows])[:-1]
    if scene.media is not None:
        _absorb(of_rows, np.split(transmittance_along(scene, rays), ends, 1))
        return
    for connections, transmittance in zip(of_rows, np.split(_transmittance(scene, rays), ends), strict=True):
        connections.geometry.reshape(-1)[connections.lanes] *= transmittance


def _absorb(of_rows: list[Connections], parts: list[Floats]) -> None:
    """Weaken connections, in place, by the transmittance of media, (3, k) each.

    Paths get through media that only absorb, so densities do not fall: all that is not blocked counts for
    the weights.
    """
    for connections, transmittance in zip(of_rows, parts, strict=True):
        connections.geometry.reshape(-1)[connections.lanes] *= highest(transmittance) > 0
        connections.f = np.repeat(connections.f, 3, 0) if len(connections.f) == 1 else connections.f.copy()
        connections.f.reshape(3, -1)[:, connections.lanes] *= transmittance


def _transmittance(scene: CompiledScene, rays: ShadowRays) -> Floats:
    """Return the part (k,) of light that gets along rays."""
    if not scene.program.see_through:
        return visible(scene, rays).astype(f4)
    return transmittance_along(scene, rays)[0]


def _sum(values: Floats) -> Floats:
    """Return the sum (t,) of rows (members, t), in order, for the same bits in any wave."""
    total = np.zeros(values.shape[1], f4)
    for row in values:
        total += row
    return total


def can_reuse(scene: CompiledScene) -> bool:
    """Return whether any path of a scene can be shared.

    Where surfaces with alpha and media are mixed none is: transmittance differs between channels then.
    Nor is any where media scatter.
    """
    if scene.media is not None and not scene.media.only_absorbs:
        return False
    absorbs = scene.program.weaken or scene.program.dim
    mixed = absorbs and any(veil.dims_shadows for veil in scene.program.see_through)
    return not mixed and bool((shared_materials(scene) | glossy_materials(scene)).any())


def shared_materials(scene: CompiledScene) -> Bools:
    """Return which materials (materials,) can be those of shared points."""
    materials = scene.materials
    same = np.array([bsdf.view_independent for bsdf in materials.groups], np.bool_)
    return same.take(materials.group_of) & (materials.normal_map_of < 0)
