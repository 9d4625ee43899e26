"""The picture of one view while it is rendered: its samples, AOVs, metadata and checkpoint."""

from __future__ import annotations

import math
import os
import time
from collections.abc import Callable, Mapping
from copy import deepcopy
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..aovs.boxes import object_boxes
from ..aovs.geometric import IDS, geometric_aovs
from ..aovs.lux import lux_of
from ..arrays.vec import Bytes
from ..camera import Camera
from ..colors import EFFICACY
from ..compile.brightest import brightest_emitter
from ..core.errors import RenderError, SaveError, SceneError, warn_caller
from ..core.fingerprint import fingerprint
from ..film.aov_names import (
    BEFORE_DENOISING,
    BOXES,
    BRIGHTEST,
    BRIGHTEST_LUX,
    NARROW,
    flow_names,
    geometric_names,
)
from ..film.checkpoint import Checkpoint, check_identity, contents_of, other_versions, read_checkpoint
from ..film.film import Film
from ..film.identity import CODE, SCENE
from ..film.light_sums import LightSums
from ..film.picture_sums import PictureSums
from ..image import Image
from ..image.image import film_image, last_film_image
from ..integrators.light_tracing import Splats
from ..settings import SETTINGS, Settings
from ..version import VERSION
from ..workers.executors import EXECUTORS, waves_per_job
from .jobs import CameraJob, Job, JobResult, Pass, Scheduler, WaveResult
from .plan import PICTURE_BYTES, SPARE_BYTES, Plan
from .tracing import MonitoredAccelerator, WaveMonitor

MAX_BAD_SAMPLES = 1e-4  # part of all samples that may be lost to NaN before it is an error
OTHERWISE = '; quality="reference" goes on with one of 100 samples that was begun by an earlier version'
WRITING_SHARE = 0.05  # of the time that writing may take, on a slow disk; the interval is then longer


class Picture:
    """The picture of one view while it is rendered; where there is a checkpoint, it goes on from that.

    Parameters
    ----------
    plan
        How it is rendered.
    camera
        The camera of the picture.
    sums
        Those of no samples; `make_budget` checks before that there is memory for them.
    begin
        When it was asked for, by `time.perf_counter`.

    Attributes
    ----------
    plan, camera, sums
        As given.
    bad
        Samples that were not finite.
    rays
        Queries of the accelerator.
    scheduler
        Sizes the jobs and keeps the time.
    view
        The data that all jobs share.
    step
        The pass under way; None before the first one.
    file
        Where its checkpoint is kept; None if that was not asked for.
    """

    def __init__(self, plan: Plan, camera: Camera, sums: PictureSums, begin: float) -> None:
        settings, choice, (width, height) = plan.settings, plan.choice, camera.size
        self.plan, self.camera, self.sums = plan, camera, sums
        self.bad, self.rays = BadSamples(), 0
        # for the picture so far when memory has run out
        self._reserve: Bytes | None = np.empty(PICTURE_BYTES * width * height + SPARE_BYTES, np.uint8)
        self._geometric = camera.layers()  # None: not made yet
        self._boxes: list[dict[str, Any]] | None = None
        self.step: Pass | None = None
        self.file: CheckpointFile | None = None
        if settings.values["samples"] is not None or settings.values["checkpoint"] is not None:
            sums.identity = self.identity()
        self.scheduler = Scheduler(
            begin - self._seconds_before(),
            settings.values["seconds"],
            plan.budget.wave_size,
            plan.budget.workers,
            choice.branches,
            waves_per_job(plan.executor),
        )
        self.view = CameraJob(
            plan.scene.compiled.view(camera),
            self.scheduler.deadline,
            settings.first_sample,
            choice.branches,
            choice.reuse,
            choice.guided,
        )

    def _seconds_before(self) -> float:
        """Go on from the checkpoint, if there is one; return the seconds that were spent before."""
        settings = self.plan.settings
        if settings.values["checkpoint"] is None:
            return 0.0
        self.file = CheckpointFile(settings.values["checkpoint"], settings.values["checkpoint_interval"])
        earlier = self.file.resume(self.sums, settings)
        if earlier is None:
            return 0.0
        with contents_of(self.file.path):
            self._count_earlier(earlier.state)
        if earlier.pixels is not None:
            self.step = Pass(earlier.pixels, earlier.state["first"], settings.max_spp)
        return float(earlier.state["seconds"])

    # --- Samples --------------------------------------------------------------------------------------

    @property
    def film(self) -> Film:
        """The film."""
        return self.sums.film

    @property
    def samples(self) -> int:
        """Number of samples on the film."""
        return int(self.film.count.sum())

    def add(self, job: Job, result: JobResult) -> None:
        """Add the result of a job, the next of its pixels."""
        for wave, of_wave in zip(job.waves(), result, strict=True):
            self._add_wave(wave, of_wave)

    def _add_wave(self, wave: Job, result: WaveResult) -> None:
        self.film.add(wave.pixels, result.radiance, result.bad)
        if self.film.light is not None and result.splats is not None:
            self._add_splats(self.film.light, wave, result.splats)
        if self.sums.layers is not None:
            assert result.layers is not None
            self.sums.layers.add(
                wave.pixels, result.layers, result.radiance, most=wave.end, dropped=result.bad
            )
        self.bad.count_in(wave, result)
        self.rays += result.rays

    def _add_splats(self, sums: LightSums, wave: Job, splats: Splats) -> None:
        """Add the light of paths from lights of a wave, sample by sample."""
        first, number = wave.view.first_sample + wave.first_sample, splats.path // wave.pixels.size
        for sample in range(wave.samples):
            splats_of_sample = splats.take(np.flatnonzero(number == sample))
            sums.add(first + sample, wave.pixels.size, splats_of_sample.pixel, splats_of_sample.radiance)

    def counts(self) -> dict[str, Any]:
        """Return numbers of samples and rays, for the metadata of the picture."""
        return {
            "spp": self.samples / self.film.count.size,
            "samples": self.samples,
            "rays": self.rays,
            "bad_samples": self.bad.count,
        }

    def release_reserve(self) -> None:
        """Free the memory that is kept for the last picture."""
        self._reserve = None

    # --- Images ---------------------------------------------------------------------------------------

    def image(self, cut_short: bool = False) -> Image:
        """Return the picture so far.

        Parameters
        ----------
        cut_short
            Whether the render ends before its time.
        """
        image = film_image(self.sums, {**self.metadata(cut_short), **self.counts()}, keep_sums=False)
        self._add_aovs(image, {name: layer.copy() for name, layer in self.geometric_aovs().items()})
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
        keep_sums = self.plan.settings.values["samples"] is not None
        metadata = {**self.metadata(cut_short), **self.counts()}
        if free_sums and not keep_sums:
            image = last_film_image(self.sums, metadata)
        else:
            image = film_image(self.sums, metadata, keep_sums)
        self._add_aovs(image, self.geometric_aovs())
        return image

    def metadata(self, cut_short: bool) -> dict[str, Any]:
        """Return the settings and results of the picture so far."""
        plan, settings = self.plan, self.plan.settings
        first = settings.first_sample
        most = int(self.film.count.max())
        return {
            "lighting": plan.scene.preset,
            "tone": plan.scene.tone,
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
            "seconds": self.scheduler.elapsed,
            "interrupted": cut_short,
            "version": VERSION,
            "numpy": np.__version__,
            **({} if self.camera.sensor is None else self._brightest()),
        }

    def _brightest(self) -> dict[str, list[float]]:
        """Return the light of the brightest emitter, (3,) each; zeros where sensors need no such record."""
        compiled, recorded = self.plan.scene.compiled, NARROW in self.plan.tracer.layers
        most = brightest_emitter(compiled) if recorded else np.zeros(3)
        efficacies = compiled.light_efficacies.names or (EFFICACY,)
        lux = lux_of([max(efficacies)], [most[:, None].astype(np.float32)])[0, 0]
        return {BRIGHTEST: most.tolist(), BRIGHTEST_LUX: [float(lux)] * 3}

    # --- AOVs that no sample is needed for --------------------------------------------------------------

    def geometric_aovs(self, monitor: WaveMonitor | None = None) -> dict[str, NDArray[Any]]:
        """Return the geometric AOVs that are asked for; the first time, trace them and the boxes.

        Raises
        ------
        Stopped
            If a monitor ends that.
        """
        if self._geometric is None:
            compiled, aovs = self.plan.tracer.scene, self.plan.settings.values["aovs"]
            if monitor is not None:
                stoppable = MonitoredAccelerator(compiled.accelerator, monitor, math.inf)
                compiled = replace(compiled, accelerator=stoppable)
            view = compiled, self.camera, self.plan.scene.shapes
            if BOXES in aovs:
                self._boxes = object_boxes(*view)
            names = geometric_names(aovs)
            flow = self.plan.scene.flow(self.camera, self.plan.settings) if flow_names(aovs) else None
            self._geometric = geometric_aovs(*view, names, flow) if names else {}
        return self._geometric

    def _add_aovs(self, image: Image, geometric: dict[str, NDArray[Any]]) -> None:
        """Give a picture its geometric AOVs and boxes."""
        for name, layer in geometric.items():
            image.layers[name] = layer
            if name in IDS:
                image.names[IDS[name]] = self.plan.scene.shapes.names(IDS[name])
        if self._boxes is not None:
            image.metadata[BOXES] = deepcopy(self._boxes)

    # --- Going on -------------------------------------------------------------------------------------

    def identity(self) -> dict[str, Any]:
        """Return the properties that another render must share so that its samples are the same.

        These are settings that the picture depends on, how paths go on, and fingerprints. Of an accelerator
        it is the name: two may differ in the last bit of a distance.

        Raises
        ------
        SceneError
            If a part of the scene cannot be compared.
        """
        plan, settings = self.plan, self.plan.settings
        scene, values = plan.scene.fingerprint(), dict[str, Any](settings.values)
        codes = {
            CODE + name: fingerprint(f"the {name}", declaration.choices.find(values[name]))
            for name, declaration in SETTINGS.items()
            if declaration.identity and declaration.choices is not None
        }
        return {
            "size": list(self.camera.size),
            "branches": plan.choice.branches,
            "reuse": plan.choice.reuse,
            **settings.labels(),
            "accelerator": plan.scene.compiled.accelerator.name,
            "aovs": list(plan.tracer.recorded_aovs),
            **codes,
            "camera": fingerprint("the camera", plan.scene.compiled.view(self.camera)),
            **({} if plan.scene.scene.moment is None else {"time": plan.scene.scene.moment}),
            SCENE: scene,
        }

    def checkpoint(self, command: dict[str, Any] | None) -> Checkpoint:
        """Return the render so far, with the command that goes on with it."""
        values = self.plan.settings.values
        step = self.step if values["noise"] is not None else None
        state = {
            "rays": self.rays,
            "bad": self.bad.count,
            "first_bad": list(self.bad.first),
            "seconds": self.scheduler.spent,
            "first": 0 if step is None else step.first,
        }
        metadata = {**self.metadata(cut_short=True), **self.counts()}
        if values["denoise"]:
            metadata[BEFORE_DENOISING] = True
        pixels = None if step is None else step.pixels
        return Checkpoint(self.sums, metadata, state, pixels, command)

    def keep(self, command: dict[str, Any] | None) -> SaveError | MemoryError | None:
        """Write the checkpoint, where one is kept; return why it cannot be written, if it cannot."""
        return None if self.file is None else self.file.write(partial(self.checkpoint, command))

    def keep_if_due(self, command: dict[str, Any] | None) -> None:
        """Write the checkpoint, where one is kept and the last write is long ago; warn once if it fails."""
        if self.file is not None:
            self.file.write_if_due(partial(self.checkpoint, command))

    def _count_earlier(self, state: Mapping[str, Any]) -> None:
        """Take over the counts of a checkpoint, beside its sums."""
        self.rays, self.bad.count = state["rays"], state["bad"]
        self.bad.first = state["first_bad"][0], state["first_bad"][1]


def _background_label(background: Any) -> Any:
    """Return the background as metadata have it."""
    return np.ravel(background).tolist() if isinstance(background, np.ndarray) else background


class BadSamples:
    """Counts samples that were not finite; none is dropped in silence."""

    def __init__(self) -> None:
        self.count = 0
        self.first = 0, 0  # pixel and sample, if there is any

    def count_in(self, job: Job, result: WaveResult) -> None:
        """Count the bad lanes of a wave, which is a job of its own, and remember the first of all."""
        if result.bad.size and not self.count:
            sample, pixel = divmod(int(result.bad[0]), job.pixels.size)
            sample += job.view.first_sample + job.first_sample
            self.first = int(job.pixels[pixel]), sample
        self.count += result.bad.size

    def report(self, image: Image, cause_of: Callable[[int, int], str]) -> None:
        """Warn of bad samples in a picture; `cause_of` a pixel and a sample returns where the value is from.

        Raises
        ------
        RenderError
            If they are more than 1e-4 of all. It has the picture, where they are left out.
        """
        if not self.count:
            return
        samples = image.metadata["samples"]
        pixel, sample = self.first
        cause = cause_of(pixel, sample)
        first = f"pixel {pixel}, sample {sample}" + (f", {cause}" if cause else "")
        message = f"{self.count} of {samples} samples were not finite and were dropped; first: {first}"
        if self.count > MAX_BAD_SAMPLES * samples:
            raise RenderError(message, image)
        warn_caller(message)


class CheckpointFile:
    """The checkpoint of a render: read when the render begins, and written every so often.

    Parameters
    ----------
    path
        The file.
    interval
        Seconds between two writes.
    """

    def __init__(self, path: str | os.PathLike[str], interval: float) -> None:
        self.path = path
        self._interval, self._last, self._warned = interval, time.perf_counter(), False
        self._samples = 0  # in the file, if this render has written it or gone on from it

    def resume(self, sums: PictureSums, settings: Settings) -> Checkpoint | None:
        """Put the samples of the file into the sums of none, if there is a file.

        Raises
        ------
        SceneError
            If the file is damaged, of another render, or has more samples than are asked for.
        """
        if not os.path.lexists(self.path):
            return None

        def checked(header: Any) -> PictureSums:
            otherwise = OTHERWISE if settings.by_itself else ""
            check_identity(self.path, header["identity"], sums.identity, otherwise)
            first = header["metadata"]["sample_ranges"][0][0]
            if first != settings.first_sample:
                raise SceneError(
                    f"{os.fspath(self.path)}: begins at sample {first}, not at {settings.first_sample}"
                )
            versions = other_versions(header)
            if versions:
                warn_caller(f"{os.fspath(self.path)} is of {versions}: bits of the picture may differ")
            return sums

        checkpoint = read_checkpoint(self.path, checked)
        most = int(sums.film.count.max())
        if most > settings.max_spp:
            raise SceneError(
                f"{os.fspath(self.path)}: has {most} samples per pixel, more than the "
                f"{settings.max_spp} asked for"
            )
        self._samples = int(sums.film.count.sum())
        return checkpoint

    def write_if_due(self, make: Callable[[], Checkpoint]) -> None:
        """Write the file if the last write is long ago; warn once if that is not possible."""
        begin = time.perf_counter()
        if begin - self._last < self._interval:
            return
        error = self.write(make)
        spent = time.perf_counter() - begin
        self._last = begin + max(spent, spent / WRITING_SHARE - self._interval)
        if error is not None and not self._warned:
            self._warned = True
            warn_caller(f"the checkpoint was not written, and will be tried again: {error}")

    def write(self, make: Callable[[], Checkpoint]) -> SaveError | MemoryError | None:
        """Write the file if there are new samples; return why it cannot be written, if it cannot."""
        try:
            checkpoint = make()
            samples = int(checkpoint.sums.film.count.sum())
            if samples != self._samples:
                checkpoint.write(self.path)
                self._samples = samples
        except (SaveError, MemoryError) as error:
            return error
        return None
