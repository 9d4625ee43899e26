"""How a view is rendered: with which integrator, by which workers, within which memory."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import nullcontext
from dataclasses import replace

from ..aovs.narrow_lobes import narrow_aovs
from ..arrays.soa import soa
from ..camera import Camera
from ..core.progress import phase
from ..film.aov_names import LUX
from ..guiding import GuideTable
from ..integrators import INTEGRATORS
from ..integrators.tuning import JobsRunner
from ..sampling.filters import FILTERS
from ..scheduling.blas import single_threaded_blas
from ..scheduling.budget import Budget, make_budget
from ..scheduling.executors import ExecutorLike, needs_pickling
from ..scheduling.payload import can_be_sent
from ..scheduling.scheduler import SMALL_WAVE
from ..scheduling.tracing import Tracer
from ..settings import Settings
from .choice import Choice, choose, learn_guide
from .hints import caustics_hint
from .prepared_scene import PreparedScene

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


def trained_guide(settings: Settings, scene: PreparedScene, camera: Camera) -> GuideTable | None:
    """Return the table that may guide the paths that a camera sees; None if none is asked for."""
    if not settings.values["guide"] or not settings.is_full:
        return None
    with phase("learning where light comes from", settings.values["progress"]), single_threaded_blas:
        return learn_guide(settings, scene.compiled.seen_by(camera), scene.compiled.view(camera))


def with_choice(plan: Plan, camera: Camera, run: JobsRunner) -> Plan:
    """Return a plan with a choice of how the paths that a camera sees go on; `run` does trials' jobs."""
    compiled, has_guide = plan.scene.compiled, plan.tracer.table is not None
    view, workers = compiled.view(camera), plan.budget.workers
    title = nullcontext() if plan.inline else phase("trying what pays", plan.settings.values["progress"])
    with title, nullcontext() if plan.inline else single_threaded_blas:
        choice = choose(plan.settings, compiled, view, has_guide, run, workers)
    hint = caustics_hint(plan.settings, plan.scene) if camera.sensor is None else None
    hint = hint or choice.hint
    return replace(plan, choice=replace(choice, hint=hint))


def make_plan(settings: Settings, scene: PreparedScene, camera: Camera, table: GuideTable | None) -> Plan:
    """Return how the view of a camera is rendered, given what may guide its paths."""
    tracer = Tracer(
        scene.compiled.seen_by(camera),
        settings.sampler_maker(),
        settings.values["seed"],
        FILTERS.find(settings.values["filter"]),
        INTEGRATORS.find(settings.values["integrator"]),
        settings.values["max_bounces"],
        (*settings.sampled_aovs, *_aovs_of_sensors(scene, camera)),
        table,
        settings.values["clamp"],
    )
    executor = settings.executor_for(camera.size)
    if settings.values["executor"] is None and needs_pickling(executor) and not can_be_sent(tracer):
        executor = "threads"
    budget = budget_of(settings, camera.size, executor, tracer.recorded_aovs)
    return Plan(settings, scene, tracer, executor, budget, fits_a_wave(settings, camera.size, budget))


def budget_of(
    settings: Settings, size: tuple[int, int], executor: str | ExecutorLike, layers: Sequence[str] = ()
) -> Budget:
    """Return the workers, and the largest wave, for a picture of a size (width, height) with layers."""
    values, most = settings.values, settings.values["max_memory"]
    return make_budget(
        None if most is None else int(most),
        size,
        settings.worker_count,
        values["wave_size"],
        executor != "threads",
        layers,
        values["caustics"],
    )


def fits_a_wave(settings: Settings, size: tuple[int, int], budget: Budget) -> bool:
    """Return whether a picture is one small wave, so that neither threads nor processes make it faster."""
    values = settings.values
    if values["executor"] is not None or values["seconds"] is not None or values["guide"]:
        return False
    paths = size[0] * size[1] * settings.max_spp * settings.most_branches
    return paths <= min(SMALL_WAVE, budget.wave_size)


def _aovs_of_sensors(scene: PreparedScene, camera: Camera) -> tuple[str, ...]:
    """Return the AOVs that sensors have, whether they are asked for or not."""
    return () if camera.sensor is None else (LUX, *narrow_aovs(scene.compiled))
