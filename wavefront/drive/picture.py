"""The picture of one view while it is rendered: its sums, AOVs, metadata and checkpoint."""

from __future__ import annotations

import math
from collections.abc import Callable, Generator
from copy import deepcopy
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..aovs.boxes import object_boxes
from ..aovs.geometric import IDS, geometric_aovs
from ..aovs.lux import lux_of
from ..camera import Camera
from ..colors import EFFICACY
from ..compile.brightest import brightest_emitter
from ..compile.scene import CompiledScene
from ..film.aov_names import BEFORE_DENOISING, BOXES, BRIGHTEST, BRIGHTEST_LUX, NARROW, geometric_names
from ..film.checkpoint import Checkpoint
from ..image import Image
from ..version import VERSION
from ..workers.executors import EXECUTORS, waves_per_job
from .accumulator import Accumulator
from .adaptive import Pass
from .inline import AnyPool
from .jobs import CameraJob
from .plan import Plan
from .resuming import CheckpointFile, render_identity
from .tracing import MonitoredAccelerator, WaveMonitor
from .work import PassSplitter, RenderLoop, Scheduler


class CameraRender:
    """The render of one camera: its loop, its picture so far, its AOVs and its checkpoint.

    Parameters
    ----------
    plan
        How it is rendered.
    camera
        What sees the scene.
    accumulator
        Sums for the picture and its AOVs.
    begin
        When it was asked for, by `time.perf_counter`.

    Attributes
    ----------
    camera, accumulator
        As given.
    loop
        Renders it.
    file
        Where its checkpoint is kept; None if that was not asked for.
    """

    def __init__(self, plan: Plan, camera: Camera, accumulator: Accumulator, begin: float) -> None:
        settings, choice, view = plan.settings, plan.choice, plan.scene.compiled.view(camera)
        self.camera, self.accumulator = camera, accumulator
        self._plan, self._view = plan, view
        self._geometric = camera.layers()  # None: not made yet
        self._boxes: list[dict[str, Any]] | None = None
        self._sweeps: Generator[bool] | None = None
        self.file: CheckpointFile | None = None
        if settings.values["samples"] is not None or settings.values["checkpoint"] is not None:
            accumulator.sums.identity = self.identity()
        begun = None
        if settings.values["checkpoint"] is not None:
            self.file = CheckpointFile(settings.values["checkpoint"], settings.values["checkpoint_interval"])
            earlier = self.file.resume(accumulator, settings)
            if earlier is not None:
                begin -= earlier.state["seconds"]
                if earlier.pixels is not None:
                    begun = Pass(earlier.pixels, earlier.state["first"], settings.max_spp)
        scheduler = Scheduler(
            begin,
            settings.values["seconds"],
            plan.budget.wave_size,
            plan.budget.workers,
            choice.branches,
            waves_per_job(plan.executor),
        )
        self.loop = RenderLoop(
            CameraJob(
                view, scheduler.deadline, settings.first_sample, choice.branches, choice.reuse, choice.guided
            ),
            accumulator,
            scheduler,
            spp=settings.max_spp,
            noise=settings.values["noise"],
            seconds=settings.values["seconds"],
            progress=settings.values["progress"],
            begun=begun,
            quick=settings.quick,
            end=settings.end,
        )

    def sweeps(
        self,
        pool: AnyPool,
        monitor: WaveMonitor,
        wave_done: Callable[[], object],
        split: PassSplitter,
    ) -> Generator[bool]:
        """Return the sweeps of the loop that was begun, or begin it.

        The geometric AOVs are made while workers trace the first jobs, and stopped as these are.
        """
        compiled = self._plan.scene.compiled
        stoppable = MonitoredAccelerator(compiled.accelerator, monitor, math.inf)

        def done() -> None:
            self._geometric_aovs(replace(compiled, accelerator=stoppable))
            wave_done()

        if self._sweeps is None:
            self._sweeps = self.loop.sweeps(pool, monitor.surfaces, done, split)
        return self._sweeps

    def discard_sweeps(self) -> None:
        """End the loop."""
        if self._sweeps is not None:
            self._sweeps.close()

    def image(self, cut_short: bool = False) -> Image:
        """Return the picture so far.

        Parameters
        ----------
        cut_short
            Whether the render ends before its time.
        """
        image = self.accumulator.image(self.metadata(cut_short))
        layers = self._geometric_aovs(self._plan.scene.compiled)
        self._add_aovs(image, {name: layer.copy() for name, layer in layers.items()})
        return image

    def last_image(self, cut_short: bool, free_sums: bool) -> Image:
        """Return the last picture; it can be merged with others if `samples` were given.

        Parameters
        ----------
        cut_short
            As for `image`.
        free_sums
            Whether sums that are not merged may be freed while the picture is made from them, as nothing
            else needs them.
        """
        keep_sums, metadata = self._plan.settings.values["samples"] is not None, self.metadata(cut_short)
        if free_sums and not keep_sums:
            image = self.accumulator.last_image(metadata)
        else:
            image = self.accumulator.image(metadata, keep_sums)
        self._add_aovs(image, self._geometric_aovs(self._plan.scene.compiled))
        return image

    def identity(self) -> dict[str, Any]:
        """Return what another render must have in common with this one so that its samples are the same.

        Raises
        ------
        SceneError
            If a part of the scene cannot be compared.
        """
        plan = self._plan
        return render_identity(
            plan.settings,
            plan.choice,
            plan.scene.fingerprint(),
            plan.scene.compiled.accelerator.name,
            self._view,
            plan.tracer.recorded_aovs,
        )

    def checkpoint(self, command: dict[str, Any] | None) -> Checkpoint:
        """Return the render so far, with the command that goes on with it."""
        loop, accumulator = self.loop, self.accumulator
        step = loop.step if self._plan.settings.values["noise"] is not None else None
        state = {
            **accumulator.state(),
            "seconds": loop.scheduler.spent,
            "first": 0 if step is None else step.first,
        }
        metadata = {**self.metadata(cut_short=True), **accumulator.counts()}
        if self._plan.settings.values["denoise"]:
            metadata[BEFORE_DENOISING] = True
        pixels = None if step is None else step.pixels
        return Checkpoint(accumulator.sums, metadata, state, pixels, command)

    def metadata(self, cut_short: bool) -> dict[str, Any]:
        """Return the settings and results of the picture so far."""
        plan, settings = self._plan, self._plan.settings
        first = settings.first_sample
        most = int(self.accumulator.film.count.max())
        return {
            "lighting": plan.scene.preset,
            "ground": plan.scene.ground,
            "background": _background_label(settings.values["background"]),
            **settings.labels(),
            "sample_ranges": [[first, first + most]],
            **self.camera.metadata(),
            "film": list(self.camera.resolution),
            "window": list(self.camera.window),
            "branches": plan.choice.branches,
            "guided": plan.choice.guided,
            "reuse": plan.choice.reuse,
            "hint": plan.choice.hint,
            "accelerator": plan.scene.compiled.accelerator.name,
            "quality": settings.values["quality"],
            "quick": settings.quick,
            "end": settings.end,
            "workers": plan.budget.workers,
            "executor": EXECUTORS.label(plan.executor),
            "seconds": self.loop.scheduler.elapsed,
            "interrupted": cut_short,
            "version": VERSION,
            "numpy": np.__version__,
            **({} if self.camera.sensor is None else self._brightest()),
        }

    def _brightest(self) -> dict[str, list[float]]:
        """Return what the brightest emitter sends, (3,) each; zeros where sensors need no such record."""
        compiled, recorded = self._plan.scene.compiled, NARROW in self._plan.tracer.layers
        most = brightest_emitter(compiled) if recorded else np.zeros(3)
        efficacies = compiled.light_efficacies.names or (EFFICACY,)
        lux = lux_of([max(efficacies)], [most[:, None].astype(np.float32)])[0, 0]
        return {BRIGHTEST: most.tolist(), BRIGHTEST_LUX: [float(lux)] * 3}

    def _geometric_aovs(self, compiled: CompiledScene) -> dict[str, NDArray[Any]]:
        """Return the geometric AOVs that are asked for; the first time, trace them and the boxes."""
        if self._geometric is None:
            aovs, given = self._plan.settings.values["aovs"], (compiled, self.camera, self._plan.scene.shapes)
            if BOXES in aovs:
                self._boxes = object_boxes(*given)
            names = geometric_names(aovs)
            self._geometric = geometric_aovs(*given, names) if names else {}
        return self._geometric

    def _add_aovs(self, image: Image, geometric: dict[str, NDArray[Any]]) -> None:
        """Give a picture its geometric AOVs and boxes."""
        for name, layer in geometric.items():
            image.layers[name] = layer
            if name in IDS:
                image.names[IDS[name]] = self._plan.scene.shapes.names(IDS[name])
        if self._boxes is not None:
            image.metadata[BOXES] = deepcopy(self._boxes)


def _background_label(background: Any) -> Any:
    """Return the background as metadata have it."""
    return np.ravel(background).tolist() if isinstance(background, np.ndarray) else background
