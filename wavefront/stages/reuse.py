"""Re-use of paths among the pixels of a tile.

The path of each pixel goes on from its first surface, at x, to a second one, at y. If the light that leaves
y is the same in all directions, the other pixels of the tile may use it as well: each connects its x to the
y of all. With p_kj the density, per area, with which the sampling at x_k finds y_j, 0 where something is
between them, the balance heuristic gives pixel i

    Σ_j f_i(y_j) cos_i G_ij V_ij R_j / (branches · Σ_k p_kj)

where G = cos_y / distance² and R_j is the light that leaves y_j. What a pixel finds at points that cannot be
shared stays its own, and so does what it finds by delta lobes. Whether a point can be shared does not
depend on which pixel finds it, so the sum of both is unbiased.

Sources: P. Bekaert, M. Sbert and J. Halton, "Accelerating Path Tracing by Re-Using Paths", Eurographics
Workshop on Rendering 2002; E. Veach and L. Guibas, "Optimally Combining Sampling Techniques", SIGGRAPH 1995.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..compile.scene import CompiledScene
from ..pixel_tiles import MEMBERS, WaveTiles
from ..record import record
from ..state import Hits, Paths, SoA
from ..vec import ALL, Bools, Floats, Ints, dot, f4, highest, take
from .interaction import interaction, material_rows, offset_origin
from .intersect import ShadowRays, visible
from .shade import Shading, evaluate
from .transmittance import transmittance_along

GRAZING = f4(1 / 16)  # cosine to interpolated normals below which they may have been bent towards the viewer


@record
class SharedPoints(SoA):
    """Second points y of paths, and the light that leaves them."""

    slot: Ints  # (k,) of their paths
    way: Ints  # (k,) which branch of its path each is
    point: Floats  # (3, k)
    error: Floats  # (k,) bound on the rounding error of `point`, scene units
    ng: Floats  # (3, k) unit geometric normal, on the side from which light leaves
    ns: Floats  # (3, k) unit shading normal
    throughput: Floats  # (3, k) of the paths that found them


def shared_points(scene: CompiledScene, paths: Paths, hits: Hits, branches: int) -> tuple[Ints, SharedPoints]:
    """Return the lanes (k,) of paths whose second surfaces can be shared, and these points.

    They are points of view-independent materials without normal maps, which no medium separates from the
    first ones, and which were not found by a delta lobe. Interpolated normals that the viewer sees at a
    grazing angle depend on the viewer.
    """
    shareable = _can_be_shared(scene).take(material_rows(scene, hits, ALL))
    lanes = np.flatnonzero(~paths.specular & shareable)
    surface = interaction(scene, paths.take(lanes), hits.take(lanes))
    good = np.ones(lanes.size, np.bool_)
    if scene.corner_normals is not None:
        good &= dot(surface.ns, surface.wo) > GRAZING
    if scene.absorption is not None:
        good &= ~surface.back_facing
    some = np.flatnonzero(good)
    lanes, surface = lanes.take(some), surface.take(some)
    way = (take(paths.sample, lanes) % np.uint32(branches)).astype(np.intp)
    return lanes, SharedPoints(
        take(paths.slot, lanes),
        way,
        surface.point,
        surface.error,
        surface.ng,
        surface.ns,
        take(paths.throughput, lanes),
    )


def as_shared(paths: Paths) -> Paths:
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
        scattered=None,
        met_rough=None,
        recorder=None,
    )


def add_shared(
    scene: CompiledScene,
    L: Floats,
    paths: Paths,
    shade: Shading,
    points: SharedPoints,
    light: Floats,
    tiles: WaveTiles,
    branches: int,
) -> None:
    """Add to the slots of L what their first points receive from the shared points of their tiles.

    Parameters
    ----------
    paths, shade
        The first surfaces of the wave's paths.
    points, light
        k shared points, and the radiance (3, k) that leaves them.
    """
    lit = shade.lit()
    if not lit.groups or not len(points):
        return
    n = len(lit.surface)
    slot = paths.slot[:n]
    tile, member = tiles.tile.take(slot), tiles.member.take(slot)
    cell = member * tiles.count + tile
    numbers = np.full((branches, MEMBERS, tiles.count), -1, np.intp)
    numbers[points.way, tiles.member.take(points.slot), tiles.tile.take(points.slot)] = np.arange(len(points))
    shines = highest(light) != 0  # NaN counts: it must reach the picture
    received = np.zeros((3, n), f4)
    for of_way in numbers:
        for other, of_tile in enumerate(of_way):
            number = of_tile.take(tile)
            there = number >= 0
            there &= shines.take(number)
            if not there.any():
                continue
            target, own = points.take(number), there & (member == other)
            connection = connect(scene, lit, target, there, own)
            total = _sums(connection.density, cell, tiles.count).take(tile)
            found = total > 0
            part = connection.geometry / (np.where(found, total, f4(1)) * f4(branches))
            received += connection.f * part * take(light, number)
            lost = np.flatnonzero(own & ~found)  # by rounding: they stay the path's own
            L[:, slot.take(lost)] += take(target.throughput, lost) * take(light, number.take(lost))
    L[:, slot] += paths.throughput[:, :n] * received


@record
class Connections:
    """Connections of first points to one shared point each; all is 0 where there is none."""

    f: Floats  # (3, n) BSDF times cosine at the first point, 1/sr
    geometry: Floats  # (n,) cosine at the shared point / distance², 0 where something is between
    density: Floats  # (n,) per area with which a path from the first point finds the shared one


def connect(
    scene: CompiledScene, shade: Shading, target: SharedPoints, there: Bools, own: Bools
) -> Connections:
    """Connect first points to shared points.

    Parameters
    ----------
    shade
        n first points.
    target
        A point for each.
    there
        (n,) where there is one.
    own
        (n,) where the path of the first point has found it, so that nothing is between them.
    """
    surface = shade.surface
    start = shade.start
    if any(bsdf.transmissive for _, bsdf in shade.groups):
        start = offset_origin(surface, dot(surface.ng, target.point - surface.point))
    way = target.point - start
    squared = dot(way, way)
    there = there & (squared > 0)
    inverse = f4(1) / np.sqrt(np.where(there, squared, f4(1)))
    direction = np.where(there, way * inverse, shade.frame.z)
    cos_target = -dot(target.ng, direction)
    there &= cos_target > 0
    if scene.corner_normals is not None:
        there &= -dot(target.ns, direction) > GRAZING
    local = shade.frame.to_local(direction)
    f, pdf = evaluate(shade, local)
    if shade.guidance is not None:
        pdf = shade.guidance.mixed(ALL, direction, pdf)
    cos, _ = shade.cosines(local, direction)
    f = f * cos
    # paths without throughput end at their first point
    there &= (pdf > 0) & (highest(f) != 0)
    geometry = np.where(there, cos_target * inverse * inverse, f4(0))
    ask = there if scene.opacities is not None else there & ~own
    lanes = np.flatnonzero(ask)
    rays = ShadowRays(
        origin=take(start, lanes),
        direction=take(direction, lanes),
        exclude_prim=take(surface.prim, lanes),
        error=take(surface.error, lanes) + take(target.error, lanes),
        distance=f4(1) / inverse.take(lanes),
        cos_light=cos_target.take(lanes),
    )
    geometry[lanes] *= _transmittance(scene, rays)
    return Connections(f, geometry, pdf * geometry)


def _transmittance(scene: CompiledScene, rays: ShadowRays) -> Floats:
    """Return the part (k,) of light that gets along rays."""
    if scene.opacities is None:
        return visible(scene, rays).astype(f4)
    return transmittance_along(scene, rays)[0]


def _sums(values: Floats, cell: Ints, count: int) -> Floats:
    """Return the sum (count,) over each tile of values (n,), given the place of each in (members, tiles)."""
    rows = np.zeros(MEMBERS * count, f4)
    rows[cell] = values
    total = np.zeros(count, f4)
    for row in rows.reshape(MEMBERS, count):  # in order, for the same bits in any wave
        total += row
    return total


def can_reuse(scene: CompiledScene) -> bool:
    """Return whether any path of a scene can be shared.

    Where surfaces with alpha and media are mixed none is: what gets through differs between channels then.
    """
    mixed = scene.opacities is not None and scene.absorption is not None
    return not mixed and bool(_can_be_shared(scene).any())


def shares_all(scene: CompiledScene) -> bool:
    """Return whether all paths of a scene can be shared: whether all of its materials are matte."""
    return can_reuse(scene) and bool(_can_be_shared(scene).all())


def _can_be_shared(scene: CompiledScene) -> Bools:
    """Return which materials (materials,) can be those of shared points."""
    materials = scene.materials
    same = np.array([bsdf.view_independent for bsdf in materials.groups], np.bool_)
    return same.take(materials.group_of) & (materials.normal_map_of < 0)
