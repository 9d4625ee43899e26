"""The loop of a render, stage by stage."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ..arrays.path_recorder import NOBODY, PathRecorder
from ..arrays.state import Contribution, Paths, Words
from ..arrays.vec import Floats, Ints
from ..camera import ImageSize
from ..compile.program import Feature, Leg, Program, acts
from ..compile.scene import CompiledScene
from ..core.errors import SceneError, in_brief, number
from ..core.suggestions import suggests_keywords
from ..drive import Session
from ..features.view import seen_with
from ..stages.shade import Shading
from .in_turns import in_turns
from .path import PathVertices, VertexRecorder
from .step import Step

Pixel = tuple[int, int]
Give = Callable[[Step], None]


@suggests_keywords
def trace(
    scene: Any,
    size: ImageSize | None = None,
    sample: int = 0,
    seed: int = 0,
    pixels: Sequence[Pixel] | None = None,
    max_bounces: int | None = None,
    integrator: Any = "full",
    shutter: tuple[float, float] | None = None,
) -> Trace:
    """Go through the loop of a render stage by stage, with one sample of each pixel.

    It is the loop of `render` itself, in this process. The light of the last step is the picture of
    ``render(scene, spp=1, branches=1, reuse=False)``, bit for bit.

    Parameters
    ----------
    scene, size, seed, max_bounces, integrator, shutter
        As for `render`; with a shutter, `step.paths.time` has the time of each path.
    sample
        Which sample of each pixel.
    pixels
        (x, y) of those to trace, from the upper left corner; None for all.

    Returns
    -------
    Trace
        Yields a `Step` after each stage; its `path` shows all that happened to one path.

    Raises
    ------
    SceneError
        If an argument or the scene is malformed.

    Examples
    --------
    >>> scene = [wf.Sphere((0, 0, 0), 1), wf.Environment(1)]
    >>> for step in wf.trace(scene, size=(8, 8), max_bounces=1):
    ...     print(step)
    <Step 'generate', bounce 0: 64 paths>
    <Step 'intersect', bounce 0: 64 paths>
    <Step 'compact', bounce 0: 35 paths>
    <Step 'shade', bounce 0: 35 paths>
    <Step 'direct', bounce 0: 35 paths>
    <Step 'bounce-sample', bounce 0: 35 paths>
    <Step 'intersect', bounce 1: 35 paths>
    <Step 'compact', bounce 1: 0 paths>
    <Step 'end', bounce 1: 0 paths>
    """
    options: dict[str, Any] = {} if max_bounces is None else {"max_bounces": max_bounces}
    options |= {} if shutter is None else {"shutter": shutter}
    wave = Wave(scene, size=size, seed=seed, integrator=integrator, **options)
    at = number("trace: sample", sample, lambda x: 0 <= x < 1 << 32 and x == int(x), "an integer in [0, 2³²)")
    return Trace(wave, wave.numbers(pixels), int(at))


class Trace:
    """The steps of a wave of paths, from `trace`. It is an iterator of `Step`.

    Examples
    --------
    >>> steps = wf.trace([wf.Sphere((0, 0, 0), 1), wf.Environment(1)], size=(8, 8))
    >>> path = steps.path((4, 4))
    >>> path.radiance.shape
    (3,)
    """

    def __init__(self, wave: Wave, numbers: Ints, sample: int) -> None:
        self._wave, self._sample = wave, sample
        self._steps: Generator[Step, None, None] = in_turns(lambda give: wave.show(numbers, sample, give))

    def __iter__(self) -> Iterator[Step]:
        """Go on where the last loop was left."""
        return self

    def __next__(self) -> Step:
        """Run the loop up to the end of its next stage."""
        return next(self._steps)

    def close(self) -> None:
        """End the loop. A trace without references ends by itself."""
        self._steps.close()

    def path(self, pixel: Pixel) -> PathVertices:
        """Return all that happens to the path of a pixel (x, y), from the camera to its end.

        Raises
        ------
        SceneError
            If there is no such pixel.
        """
        return self._wave.path(pixel, self._sample)


class Wave:
    """A scene that is ready to be traced, one wave at a time."""

    def __init__(self, scene: Any, size: ImageSize | None, **settings: Any) -> None:
        with Session(
            scene, 1, size=size, branches=1, reuse=False, workers=1, progress=False, **settings
        ) as session:
            self.tracer, self.camera, self.shapes = session.tracer, session.camera, session.shapes
        self.camera = self.tracer.scene.view(self.camera)

    def numbers(self, pixels: Sequence[Pixel] | None) -> Ints:
        """Return the row-major numbers of pixels (x, y)."""
        width, height = self.camera.size
        if pixels is None:
            return np.arange(width * height)
        at = np.asarray(pixels)
        if at.ndim != 2 or at.shape[1] != 2 or at.dtype.kind not in "iu":
            raise SceneError(f"trace: pixels must be pairs (x, y) of integers, got {in_brief(pixels)}")
        outside = (at < 0).any(1) | (at >= (width, height)).any(1)
        if outside.any():
            x, y = at[outside][0]
            raise SceneError(f"trace: pixel ({x}, {y}) is outside of the picture of {width}x{height} pixels")
        return at[:, 1] * width + at[:, 0]

    def show(self, numbers: Ints, sample: int, give: Give) -> None:
        """Trace a sample of pixels, and give a step after each stage."""
        onlooker = Onlooker(self.scene, give, numbers.size)
        scene = replace(self.scene, program=watched(self.scene.program, onlooker))
        light = self.traced(scene, numbers, np.full(numbers.size, sample, np.uint32), onlooker)
        onlooker.end(light)

    def path(self, pixel: Pixel, sample: int) -> PathVertices:
        """Return the vertices of one path."""
        recorder, scene = VertexRecorder(self.scene, self.shapes), self.scene
        scene = replace(scene, program=Program([AfterHits("", recorder), *scene.program.features]))
        light = self.traced(scene, self.numbers([pixel]), np.full(1, sample, np.uint32), recorder)
        return recorder.vertices(pixel, sample, light[:, 0])

    @property
    def scene(self) -> CompiledScene:
        """The scene as paths from the camera meet it."""
        return seen_with(self.tracer.scene)

    def traced(
        self, scene: CompiledScene, numbers: Ints, samples: Words, recorder: PathRecorder = NOBODY
    ) -> Floats:
        """Return the light (3, n) of samples (n,) of pixels (n,), with a recorder that looks on."""
        sampler, pixels = self.tracer.sampler(self.camera.resolution[0]), numbers.astype(np.uint32)
        return self.tracer.radiance(scene, self.camera, sampler, pixels, samples, recorder)


class Onlooker(PathRecorder):
    """Gives a step after each stage that the paths which carry it go through."""

    def __init__(self, scene: CompiledScene, give: Give, slots: int) -> None:
        self._scene, self._give, self._bounce = scene, give, 0
        self._light = np.zeros((3, slots), np.float32)

    def prepare(self, paths: Paths) -> None:
        """Show paths that start at the camera."""
        super().prepare(paths)
        self._paths = paths
        self._give(Step("generate", 0, self._scene, self._light, paths))

    def stage(self, name: str, leg: Leg) -> None:
        """Show a leg after something has acted on it."""
        self._bounce, self._light = leg.bounce, leg.L
        self._give(Step(name, leg.bounce, leg.scene, leg.L, leg.paths, leg.hits))

    def record_hits(self, leg: Leg) -> None:
        """Show the paths that go on."""
        self._light, self._paths = leg.L, leg.kept_paths
        paths = replace(leg.kept_paths, throughput=leg.kept_paths.throughput.copy())  # weakened in place
        self._give(Step("compact", leg.bounce, leg.scene, leg.L, paths, leg.kept_hits))

    def record_surfaces(self, scene: CompiledScene, paths: Paths, shade: Shading) -> None:
        """Show surfaces that are ready to be shaded."""
        self._surface = shade.surface
        self._give(Step("shade", self._bounce, scene, self._light, paths, None, shade.surface))

    def record_light(
        self, picture: Floats, paths: Paths, contribution: Contribution, slot: Ints, arriving: Floats
    ) -> None:
        """Show the picture after light samples."""
        if contribution.sampled:
            step = Step("direct", self._bounce, self._scene, picture, paths, None, self._surface)
            self._give(step)

    def record_scattering(self, paths: Paths, shade: Shading, left: Paths) -> None:
        """Show paths in their new directions."""
        self._paths = left
        step = Step("bounce-sample", self._bounce, self._scene, self._light, left, None, shade.surface)
        self._give(step)

    def end(self, light: Floats) -> None:
        """Show the picture."""
        self._give(Step("end", self._bounce, self._scene, light, self._paths))


def watched(program: Program, onlooker: Onlooker) -> Program:
    """Return a program with an onlooker after the intersection, and after each feature that acts on legs."""
    features: list[Feature] = [AfterHits("intersect", onlooker)]
    for feature in program.features:
        features.append(feature)
        name = type(feature).__name__
        if acts(feature, "fly"):
            features.append(AfterHits(name, onlooker, feature.camera_only))
        if acts(feature, "meet"):
            features.append(AfterLight(name, onlooker, feature.camera_only))
    return Program(features)


class Watch(Feature):
    """Shows a leg."""

    def __init__(self, name: str, onlooker: Onlooker | VertexRecorder, camera_only: bool = False) -> None:
        self.name, self.onlooker = name, onlooker
        self.camera_only = camera_only  # type: ignore[misc]


class AfterHits(Watch):
    """Shows a leg before light is added."""

    def fly(self, leg: Leg) -> None:
        """Show it."""
        self.onlooker.stage(self.name, leg)


class AfterLight(Watch):
    """Shows a leg when its light is known."""

    def meet(self, leg: Leg) -> None:
        """Show it."""
        self.onlooker.stage(self.name, leg)
