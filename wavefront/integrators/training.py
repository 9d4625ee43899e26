"""The training pass of path guiding: paths under a seed of their own, from which the tables are learned.

The tables depend on the scene, the camera, the seed and the number of bounces alone. The random numbers
of the picture are others, so it stays unbiased, and it does not depend on workers or waves.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..arrays.path_recorder import PathRecorder
from ..arrays.soa import soa
from ..arrays.state import Contribution, Paths, SoA, Words
from ..arrays.vec import Floats, Ints, highest, take
from ..camera import Camera
from ..compile.scene import CompiledScene
from ..features.view import seen_with
from ..guiding import GuideCells, GuideTable
from ..guiding.octahedral import bins_of
from ..guiding.training import LEVELS, SIDE, Records, build_table, learn_shares
from ..sampling.sampler import Sampler
from ..stages.generate import generate
from ..stages.shade import Shading
from .ladder import li_full

PATHS = 1 << 18
ROUNDS = (1 / 7, 2 / 7, 4 / 7)  # parts of the paths; each round is guided by those before it
WAVE = 1 << 16
GOLDEN = np.uint64(0x9E3779B1)  # 2³² divided by the golden ratio spreads few paths over many pixels


@soa
class Vertices(SoA):
    """Vertices where paths scattered, with the directions in which they left."""

    slot: Ints  # (k,)
    point: Floats  # (3, k) relative to the scene's center
    normal: Floats  # (3, k) unit shading normal
    direction: Floats  # (3, k) unit direction
    cos: Floats  # (k,) cosine between the two
    pdf: Floats  # (k,) density of the direction, 1/sr
    pdf_bsdf: Floats  # (k,) that of the BSDF alone
    before: Floats  # (k,) sum of the channels of the throughput before
    after: Floats  # (k,) and after
    radiance_before: Floats  # (k,) sum of the channels of the radiance before this vertex


def train(scene: CompiledScene, camera: Camera, sampler: Sampler, max_bounces: int) -> GuideTable | None:
    """Trace the training pass and return the table; None if its paths met nothing that can be guided.

    Parameters
    ----------
    camera
        In the unit of the compiled scene.
    sampler
        Of the training pass: its seed must not be that of the picture.
    """
    rounds: list[Records] = []
    table: GuideTable | None = None
    cells: GuideCells | None = None
    done = 0
    for fraction in ROUNDS:
        count = int(PATHS * fraction)
        traced = [
            _trace(scene, camera, sampler, max_bounces, table, first, min(WAVE, done + count - first))
            for first in range(done, done + count, WAVE)
        ]
        done += count
        vertices = Vertices.concatenate([wave for wave, _ in traced])
        light = np.concatenate([light_of_wave for _, light_of_wave in traced])
        if not len(vertices):
            return table
        cells = cells or GuideCells.around(vertices.point, LEVELS)
        rounds.append(_records(vertices, light, cells))
        table = build_table(Records.concatenate(rounds), cells)
    assert table is not None
    learn_shares(rounds, table)
    return table


def _trace(
    scene: CompiledScene,
    camera: Camera,
    sampler: Sampler,
    max_bounces: int,
    table: GuideTable | None,
    first: int,
    count: int,
) -> tuple[Vertices, Floats]:
    """Trace a wave; return its vertices, and the light that their paths find afterwards, (k,)."""
    pixel, sample = _addresses(camera, first, count)
    scene = seen_with(scene, table)
    paths = generate(scene, camera, sampler, pixel, sample)
    recorder = paths.recorder = VertexRecorder()
    L = li_full(scene, paths, sampler, max_bounces + camera.scatterings)
    joined = Vertices.concatenate(recorder.vertices) if recorder.vertices else _none()
    light = L.sum(0).take(joined.slot) - joined.radiance_before
    good = np.flatnonzero((joined.pdf > 0) & (joined.after > 0) & np.isfinite(light))
    return joined.take(good), light.take(good).clip(0, np.inf)


class VertexRecorder(PathRecorder):
    """Keeps the vertices of the paths that carry it."""

    def __init__(self) -> None:
        self.vertices: list[Vertices] = []
        self._picture: Floats | None = None  # the light that was found so far, (3, slots)

    def record_light(
        self, picture: Floats, paths: Paths, contribution: Contribution, slot: Ints, arriving: Floats
    ) -> None:
        """Keep the picture, to which all light is added."""
        self._picture = picture

    def record_scattering(self, paths: Paths, shade: Shading, left: Paths) -> None:
        """Keep the vertices that paths leave."""
        assert self._picture is not None  # each step adds its light before its paths go on
        self.vertices.append(_vertices(self._picture, paths, left, shade))


def _vertices(L: Floats, paths: Paths, left: Paths, shade: Shading) -> Vertices:
    """Return the vertices of paths whose directions were not drawn from delta lobes."""
    lit = shade.lit()
    n = len(lit.surface) if lit.groups else 0
    lanes = np.flatnonzero(~left.specular[:n] & (highest(left.throughput)[:n] > 0))
    local = shade.frame.to_local(left.direction)
    pdf_bsdf = lit.evaluate(local[:, :n])[1] if n else local[2, :0]
    slot = take(left.slot, lanes)
    return Vertices(
        slot=slot,
        point=take(shade.surface.point, lanes),
        normal=take(shade.surface.ns, lanes),
        direction=take(left.direction, lanes),
        cos=np.abs(local[2].take(lanes)),
        pdf=take(left.pdf, lanes),
        pdf_bsdf=pdf_bsdf.take(lanes),
        before=take(paths.throughput, lanes).sum(0),
        after=take(left.throughput, lanes).sum(0),
        radiance_before=take(L, slot).sum(0),
    )


def _records(vertices: Vertices, light: Floats, cells: GuideCells) -> Records:
    """Return the records of vertices whose paths found so much light (k,) afterwards."""
    return Records(
        cell=cells.of(vertices.point, vertices.normal),
        bins=bins_of(vertices.direction, SIDE)[0],
        incident=light / vertices.after * vertices.cos,
        scattered=light / vertices.before * vertices.pdf,
        pdf=vertices.pdf,
        pdf_bsdf=vertices.pdf_bsdf,
    )


def _addresses(camera: Camera, first: int, count: int) -> tuple[Words, Words]:
    """Return pixels and samples (count,): all pixels in turn, or few that are spread over the picture."""
    pixels = np.uint64(camera.size[0] * camera.size[1])
    number = np.arange(first, first + count, dtype=np.uint64)
    pixel = number % pixels if pixels <= PATHS else spread(number, int(pixels))
    return pixel.astype(np.uint32), (number // pixels).astype(np.uint32)


def spread(number: NDArray[np.uint64], places: int) -> NDArray[np.uint64]:
    """Return places (k,) for numbers (k,), so that consecutive numbers are spread over all of them."""
    return number * GOLDEN % np.uint64(places)


def _none() -> Vertices:
    """Return no vertices."""
    three, one = np.zeros((3, 0), np.float32), np.zeros(0, np.float32)
    return Vertices(np.zeros(0, np.intp), three, three, three, one, one, one, one, one, one)
