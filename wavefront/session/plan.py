"""How a view is rendered: with which integrator, by which workers, within which memory."""

from __future__ import annotations

from ..camera import Camera
from ..compile.scene import CompiledScene
from ..filters import FILTERS
from ..guiding import GuideTable
from ..integrators import Integrator
from ..pilot import train
from ..progress import phase
from ..record import record
from ..scheduling.blas import single_threaded_blas
from ..scheduling.budget import Budget
from ..scheduling.delivery import can_be_sent
from ..scheduling.executors import ExecutorLike, needs_pickling
from ..scheduling.tracing import Tracer
from ..settings import AUTO, Settings
from ..trial import Trial, is_worth_it, run_trial
from .prepared_scene import PreparedScene


@record
class Estimator:
    """What estimates the light of a path, and what was decided for it."""

    integrator: Integrator
    branches: int
    guided: bool  # by a table that was learned


@record
class Plan:
    """How the view of a session is rendered; other views may be rendered in the same way."""

    settings: Settings
    scene: PreparedScene
    estimator: Estimator
    tracer: Tracer
    executor: str | ExecutorLike
    budget: Budget


def make_plan(settings: Settings, scene: PreparedScene, camera: Camera) -> Plan:
    """Return how the view of a camera is rendered; what is to be learned or decided before is."""
    estimator = choose_estimator(settings, scene.compiled, camera)
    tracer = Tracer(
        scene.compiled,
        settings.sampler_maker(),
        FILTERS.find(settings.filter),
        estimator.integrator,
        settings.max_bounces,
        settings.sampled_layers,
        settings.clamp,
    )
    budget = settings.budget(camera.size, tracer.recorded_layers)
    executor = settings.executor_for(camera.size)
    if settings.executor is None and needs_pickling(executor) and not can_be_sent(tracer):
        executor = "threads"
    return Plan(settings, scene, estimator, tracer, executor, budget)


def choose_estimator(settings: Settings, compiled: CompiledScene, camera: Camera) -> Estimator:
    """Return the integrator; what is to be learned or decided is, for the camera."""
    branches = 1 if settings.branches == AUTO else int(settings.branches)
    if not settings.decides:
        return Estimator(settings.estimator(None, branches), branches, guided=False)
    with phase("learning where light comes from", settings.progress), single_threaded_blas:
        view, width = compiled.view(camera), camera.film[0]
        table = None
        if settings.guide:
            table = train(compiled, view, settings.pilot_sampler(width), settings.max_bounces)
        branches, table = _decide(settings, compiled, view, width, table)
    return Estimator(settings.estimator(table, branches), branches, guided=table is not None)


def _decide(
    settings: Settings, compiled: CompiledScene, view: Camera, width: int, table: GuideTable | None
) -> tuple[int, GuideTable | None]:
    """Return the number of branches and the table to use: what is "auto" is decided by trials.

    Parameters
    ----------
    settings, compiled
        As for `choose_estimator`.
    view
        The camera in the unit of the compiled scene.
    width
        Of the picture, in pixels.
    table
        What was learned, if anything was.
    """
    fixed = None if settings.branches == AUTO else int(settings.branches)
    may_guide = settings.guide == AUTO and table is not None
    if fixed is not None and not may_guide:
        return fixed, table
    samplers = settings.pilot_sampler(width, 1), settings.pilot_sampler(width, 2)

    def trial(guided_by: GuideTable | None) -> Trial:
        return run_trial(compiled, view, samplers, settings.max_bounces, guided_by)

    found = trial(table)
    if may_guide:
        plain = trial(None)
        if not is_worth_it(found, plain, fixed):
            found, table = plain, None
    return found.best_ways() if fixed is None else fixed, table
