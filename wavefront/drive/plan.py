"""How a view is rendered: with which integrator, by which workers, within which memory."""

from __future__ import annotations

from collections.abc import Sequence
from contextvars import Context
from dataclasses import replace
from functools import cache

from ..aovs.narrow_lobes import narrow_aovs
from ..arrays.soa import soa
from ..camera import Camera
from ..core.errors import SceneError
from ..core.memory import check_memory, megabytes, resident_memory
from ..core.plural import plural
from ..features.view import seen_by, seen_with
from ..film.aov_names import LUX, aov_of
from ..film.picture_sums import PictureSums, empty_sums
from ..film.sums import bytes_per_pixel
from ..guiding import GuideTable
from ..integrators import INTEGRATORS, WITH_MIS, li_reuse
from ..integrators.stage_list import StageList, list_stages
from ..sampling.filters import FILTERS
from ..sampling.sampler import SAMPLERS
from ..settings import Settings
from ..workers.executors import ExecutorLike, needs_pickling
from .choice import Choice, choose
from .hints import caustics_hint
from .jobs import SMALL_WAVE, default_wave_size
from .prepared_scene import PreparedScene
from .tracing import Tracer

PICTURE_BYTES = 108  # of a pixel of the picture, and of the arrays that it is made from
AOV_BYTES = 8  # of a pixel and channel of an AOV and its error
SPARE_BYTES = 16 << 20
LANE_BYTES = 1000  # of a lane of a wave, with its share of results that wait to be added
PROCESS_BYTES = 70 << 20  # of a worker process beside its wave: pages of its own, and memory that glibc keeps
THREAD_BYTES = 35 << 20  # of a worker thread beside its wave: its stack, and the buffer of OpenBLAS
GOOD_WAVE = 1 << 14  # lanes; there are fewer workers rather than smaller waves
LEAST_WAVE = 1 << 10  # lanes; with less memory than such a wave needs there is no render


def picture_memory(size: Sequence[int], layers: Sequence[str] = (), light_tracing: bool = False) -> int:
    """Return how many bytes the sums of samples, and the picture of them, need.

    Parameters
    ----------
    size
        (width, height)
    layers
        The sampled AOVs, those with a key by it, such as "light_groups.sun"; of up to 127 samples.
    light_tracing
        Whether there are paths from lights, too.
    """
    sums = _bytes_of_sums(tuple(layers), light_tracing)
    picture = PICTURE_BYTES + AOV_BYTES * sum(aov_of(name).channels for name in layers)
    return (sums + picture) * size[0] * size[1] + SPARE_BYTES


@cache
def _bytes_of_sums(layers: tuple[str, ...], light_tracing: bool) -> int:
    """Return how many bytes each pixel takes of the sums."""
    return bytes_per_pixel(lambda pixels: empty_sums((pixels, 1), layers, light_tracing))


@soa
class Budget:
    """The number of paths that are traced at once."""

    workers: int
    wave_size: int  # lanes of the largest wave


def make_budget(
    settings: Settings, size: tuple[int, int], executor: str | ExecutorLike, layers: Sequence[str] = ()
) -> Budget:
    """Return how many workers trace waves of how many lanes: as suits them, or as `max_memory` allows.

    Parameters
    ----------
    size, layers
        As for `picture_memory`, of a picture for which no memory is in use yet.

    Raises
    ------
    SceneError
        If the picture needs more memory than is available, or even one worker with a small wave needs more
        than `max_memory`.
    """
    values, workers, wave_size = settings.values, settings.worker_count, settings.values["wave_size"]
    picture = picture_memory(size, layers, values["caustics"])
    having = f" with {plural(len(layers), 'AOV')}" if layers else ""
    check_memory(f"a picture of {size[0]}x{size[1]} pixels{having}", picture)
    if values["max_memory"] is None:
        return Budget(workers, wave_size or default_wave_size(workers))
    max_memory, in_use = int(values["max_memory"]), resident_memory()
    fixed = THREAD_BYTES if executor == "threads" else PROCESS_BYTES
    worker = fixed + min(LEAST_WAVE, wave_size or LEAST_WAVE) * LANE_BYTES
    left = max_memory - in_use - picture
    if left < worker:
        raise SceneError(
            f"max_memory is {megabytes(max_memory)}; {megabytes(in_use + picture + worker)} are needed: "
            f"{megabytes(in_use)} are in use already, {megabytes(picture)} are for a picture of "
            f"{size[0]}x{size[1]} pixels, and {megabytes(worker)} for one worker"
        )
    good = min(GOOD_WAVE, wave_size or GOOD_WAVE)
    workers = max(1, min(workers, left // (fixed + good * LANE_BYTES)))
    largest = wave_size or SMALL_WAVE  # at any speed, so that the peak does not depend on it
    return Budget(workers, min(largest, (left // workers - fixed) // LANE_BYTES))


NO_CHOICE = Choice()


@soa
class Plan:
    """How the view of a session is rendered; other views may be rendered in the same way."""

    settings: Settings
    scene: PreparedScene
    tracer: Tracer
    executor: str | ExecutorLike
    budget: Budget
    inline: bool = False  # the picture is one wave, which the caller traces
    choice: Choice = NO_CHOICE  # until there is one

    def sums(self, size: Sequence[int]) -> PictureSums:
        """Return the sums of no samples for a picture of a size (width, height)."""
        return empty_sums(size, self.tracer.recorded_aovs, self.settings.values["caustics"])

    @property
    def stages(self) -> StageList:
        """The stages that run, and the features that act between them."""
        tracer, choice = self.tracer, self.choice
        view = seen_with(tracer.scene, tracer.table if choice.guided else None, choice.branches)
        integrator = li_reuse if choice.reuse else tracer.integrator
        return list_stages(integrator, view.program, mis=choice.reuse or integrator in WITH_MIS)


def with_choice(plan: Plan, camera: Camera) -> Plan:
    """Return a plan with a choice of how the paths that a camera sees go on."""
    tracer, view = plan.tracer, plan.scene.compiled.view(camera)
    # in a context of its own: the caller's `np.errstate` is not that of its paths
    choice = Context().run(choose, plan.settings, tracer.scene, view, tracer.make_sampler, tracer.table)
    hint = caustics_hint(plan.settings, plan.scene) if camera.sensor is None else None
    return replace(plan, choice=replace(choice, hint=hint or choice.hint))


def make_plan(settings: Settings, scene: PreparedScene, camera: Camera, table: GuideTable | None) -> Plan:
    """Return the plan of a camera's view, with the table that may guide its paths."""
    tracer = Tracer(
        seen_by(scene.compiled, camera, settings.shutter),
        SAMPLERS.find(settings.values["sampler"]),
        settings.values["seed"],
        FILTERS.find(settings.values["filter"]),
        INTEGRATORS.find(settings.values["integrator"]),
        settings.values["max_bounces"],
        (*settings.sampled_aovs, *_aovs_of_sensors(scene, camera)),
        table,
        settings.values["clamp"],
    )
    executor = settings.executor_for(camera.size)
    if settings.values["executor"] is None and needs_pickling(executor):
        from ..workers.remote import can_be_sent  # here, as forked workers do without

        executor = executor if can_be_sent(tracer) else "threads"
    budget = make_budget(settings, camera.size, executor, tracer.recorded_aovs)
    return Plan(settings, scene, tracer, executor, budget, fits_a_wave(settings, camera.size, budget))


def fits_a_wave(settings: Settings, size: tuple[int, int], budget: Budget) -> bool:
    """Return whether a picture is one small wave, so that neither threads nor processes make it faster."""
    values = settings.values
    if values["executor"] is not None or values["seconds"] is not None:
        return False
    paths = size[0] * size[1] * settings.max_spp * settings.most_branches
    return paths <= min(SMALL_WAVE, budget.wave_size)


def _aovs_of_sensors(scene: PreparedScene, camera: Camera) -> tuple[str, ...]:
    """Return the AOVs that sensors have, whether they are asked for or not."""
    return () if camera.sensor is None else (LUX, *narrow_aovs(scene.compiled))
