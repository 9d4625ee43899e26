"""The steps that integrators are made of, beside the stages: they add light to the radiance of a wave."""

from __future__ import annotations

from collections.abc import Callable

from ..arrays.state import Contribution, Hits, Paths
from ..arrays.vec import Floats, Ints, f4
from ..compile.program import Leg
from ..compile.scene import CompiledScene
from ..sampling.sampler import Sampler
from ..stages.accumulate import accumulate
from ..stages.bounce import branch, copies
from ..stages.compact import compact, roulette, scattering_lanes, select
from ..stages.interaction import interaction
from ..stages.intersect import intersect
from ..stages.sensors import at_sensors, sensor_shading
from ..stages.shade import Shading, direct, emitted, mis_weighted, shading


def intersect_and_compact(
    scene: CompiledScene,
    paths: Paths,
    sampler: Sampler,
    bounce: int,
    L: Floats,
    mis: bool,
    keep: Callable[[CompiledScene, Paths, Hits, Contribution], Ints] = scattering_lanes,
) -> tuple[Paths, Hits]:
    """Follow paths to their next surfaces, add the light that they meet to L, and keep some of them.

    With `mis` the light is weighted against light sampling. `keep` returns the lanes of the paths that
    scatter; the others end here.
    """
    if paths.sensor is not None:
        return paths, at_sensors(paths)
    acts = scene.program.leg(bounce)
    leg = Leg(scene, sampler, bounce, L, mis, paths.exclude_prim, paths, intersect(scene, paths))
    for fly in acts.fly:
        fly(leg)
    leg.emission = emitted(scene, leg.paths, leg.hits)
    leg.lanes = keep(scene, leg.paths, leg.hits, leg.emission)
    for meet in acts.meet:
        meet(leg)
    accumulate(L, leg.paths, mis_weighted(scene, leg.paths, leg.emission) if mis else leg.emission)
    leg.kept_paths, leg.kept_hits = compact(scene, leg.paths, leg.hits, leg.lanes)
    paths.recorder.record_hits(leg)
    return leg.kept_paths, leg.kept_hits


def prepare_shading(scene: CompiledScene, paths: Paths, hits: Hits) -> Shading:
    """Apply absorption along the paths, and prepare their surfaces for shading."""
    if paths.sensor is not None:
        return sensor_shading(scene, paths)
    surface = interaction(scene, paths, hits)
    for tilt in scene.program.tilt:
        tilt(scene, paths, surface)
    for weaken in scene.program.weaken:
        weaken(paths.throughput, hits, surface)
    shade = shading(scene, surface)
    paths.recorder.record_surfaces(scene, paths, shade)
    return shade


def note(paths: Paths, name: str, values: Floats) -> None:
    """Note numbers about paths for the AOV "noted.NAME" of a picture, in an integrator of one's own.

    They are added to the samples of the paths, whose mean each pixel shows; the branches of a path count by
    their mean. Where that AOV is not asked for, nothing is done. Where it is, `note` must
    be called in each wave, if only with the paths of the camera.

    Parameters
    ----------
    paths
        n paths.
    values
        (n,) or (3, n).

    Raises
    ------
    SceneError
        If the values have another shape.

    Examples
    --------
    >>> from wavefront import integrators
    >>> def lengths(scene, paths, sampler, max_bounces):
    ...     L = np.zeros((3, len(paths)), np.float32)
    ...     paths, hits = integrators.intersect_and_compact(scene, paths, sampler, 0, L, mis=False)
    ...     integrators.note(paths, "length", hits.t)
    ...     return L
    >>> scene = [wf.Sphere((0, 0, 0), 1), wf.Environment(1)]
    >>> image = wf.render(scene, spp=1, size=(8, 8), integrator=lengths, aovs="noted.length")
    >>> image.layers["noted.length"].shape
    (8, 8, 3)
    """
    paths.recorder.note(name, paths, values)


def scatter(
    scene: CompiledScene, L: Floats, paths: Paths, hits: Hits, sampler: Sampler, bounce: int
) -> Paths:
    """Add direct light to L, and return the paths that go on in new directions, in one or several ways."""
    shade, ways = prepare_shading(scene, paths, hits), scene.program.ways(bounce)
    for way in copies(paths, ways):
        contribution = direct(scene, way, shade, sampler, bounce, mis=True)
        contribution.radiance *= f4(1 / ways)
        accumulate(L, way, contribution)
    paths = branch(paths, shade, sampler, bounce, ways)
    return select(paths, roulette(scene, paths, sampler, bounce))
