"""How a view is rendered: with which integrator, by which workers, within which memory."""

from __future__ import annotations

from ..camera import Camera
from ..choice import Choice, choose
from ..filters import FILTERS
from ..integrators import INTEGRATORS
from ..progress import phase
from ..record import record
from ..scheduling.blas import single_threaded_blas
from ..scheduling.budget import Budget
from ..scheduling.delivery import can_be_sent
from ..scheduling.executors import ExecutorLike, needs_pickling
from ..scheduling.tracing import Tracer
from ..settings import Settings
from .prepared_scene import PreparedScene


@record
class Plan:
    """How the view of a session is rendered; other views may be rendered in the same way."""

    settings: Settings
    scene: PreparedScene
    choice: Choice
    tracer: Tracer
    executor: str | ExecutorLike
    budget: Budget


def choose_paths(settings: Settings, scene: PreparedScene, camera: Camera) -> Choice:
    """Return how paths go on; what is to be learned or decided is, for the camera."""
    title = "learning where light comes from" if settings.guide else "trying what pays"
    with phase(title, settings.progress), single_threaded_blas:
        return choose(settings, scene.compiled, scene.compiled.view(camera))


def make_plan(settings: Settings, scene: PreparedScene, camera: Camera, choice: Choice) -> Plan:
    """Return how the view of a camera is rendered, given how paths go on."""
    tracer = Tracer(
        scene.compiled,
        settings.sampler_maker(),
        FILTERS.find(settings.filter),
        INTEGRATORS.find(settings.integrator),
        settings.max_bounces,
        settings.sampled_layers,
        choice.table,
        settings.clamp,
    )
    budget = settings.budget(camera.size, tracer.recorded_layers)
    executor = settings.executor_for(camera.size)
    if settings.executor is None and needs_pickling(executor) and not can_be_sent(tracer):
        executor = "threads"
    return Plan(settings, scene, choice, tracer, executor, budget)
