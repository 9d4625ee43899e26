"""render(): plans the waves, runs them, returns an Image."""

from __future__ import annotations

import os
import time
import warnings
from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from tqdm import tqdm

from .accel import make_accelerator
from .accel.choose import CHOICES
from .camera import Camera
from .errors import SceneError
from .film import Film, Image
from .integrators import INTEGRATORS, Integrator
from .io.load import from_trimesh, load
from .lights import PointLight
from .parallel import run_ordered, worker_count
from .sampling.sampler import Sampler, make_sampler
from .scene import CompiledScene, Scene, compile_scene
from .shapes import Mesh, Sphere
from .stages.generate import generate
from .vec import Floats, Ints

WAVE_LANES = 65_536  # paths that go round the loop together
MAX_SPP = 2**32  # a sample's index is 32 bits of its address
MAX_BAD_SAMPLES = 1e-4  # part of all samples that may be lost to NaN before it is an error

Progress: TypeAlias = Callable[[int, int], object] | bool | None


def render(
    scene: Any,
    spp: int = 100,
    *,
    integrator: str = "full",
    max_bounces: int = 12,
    seed: int = 0,
    sampler: str = "sobol",
    accel: str = "auto",
    workers: int | None = None,
    wave_size: int = WAVE_LANES,
    progress: Progress = None,
) -> Image:
    """Render a picture.

    Parameters
    ----------
    scene
        A `Scene`, the path of a mesh file, a `trimesh.Trimesh` or `trimesh.Scene`, or a pair
        (vertices, faces).
    spp
        Samples per pixel, at least 1.
    integrator
        "full", "direct_mis", "direct_simple" or "naive".
    max_bounces
        Scattering events along a path: 0 shows only light seen directly, 1 direct light.
    seed
        The same seed gives the same picture, bit for bit.
    sampler
        "sobol" or "independent".
    accel
        Ray queries by "numpy", by "embree" (extra `wavefront[embree]`), or "auto".
    workers
        Threads; by default one per core.
    wave_size
        The most paths that are traced together by one worker; the picture does not depend on it.
    progress
        By default a bar appears when a render takes over two seconds. False shows none; a
        function is called with the numbers of samples done and in all.

    Returns
    -------
    Image
        After Ctrl-C, the picture so far, with a warning.

    Raises
    ------
    SceneError
        If an argument or the scene is malformed. It is a ValueError.
    """
    spp = _whole("spp", spp, 1, MAX_SPP)
    max_bounces = _whole("max_bounces", max_bounces, 0, 2**16)
    wave_size = _whole("wave_size", wave_size, 1, 2**24)
    estimate = INTEGRATORS[_one_of("integrator", integrator, INTEGRATORS)]
    accel = _one_of("accel", accel, CHOICES)
    make_sampler(sampler, seed)  # checks both before the scene is read
    threads = worker_count(workers)
    subject = as_scene(scene)
    camera = subject.camera or subject.framing_camera()
    draw = make_sampler(sampler, seed, camera.size[0])
    _warn_unseen_lights(subject, integrator)
    begin = time.perf_counter()
    compiled = compile_scene(subject, lambda geometry: make_accelerator(geometry, accel))

    def trace(piece: Piece) -> Wave:
        return trace_piece(compiled, camera, draw, estimate, max_bounces, piece)

    width, height = camera.size
    film = Film(width, height)
    bad, interrupted = BadSamples(), False
    with _bar(progress, width * height * spp) as advance:
        try:
            for piece, wave in run_ordered(trace, plan(width * height, spp, wave_size), threads):
                bad.note(piece, wave)
                film.add(piece.first_pixel, wave.radiance)
                advance(piece.lanes)
        except KeyboardInterrupt:
            interrupted = True
            done = film.count.sum() / (width * height * spp)
            warnings.warn(f"interrupted: the picture holds {done:.0%} of its samples", stacklevel=2)
    bad.report(int(film.count.sum()))
    metadata = {
        "integrator": integrator,
        "max_bounces": max_bounces,
        "seed": seed,
        "sampler": sampler,
        "accelerator": compiled.accelerator.name,
        "workers": threads,
        "seconds": time.perf_counter() - begin,
        "bad_samples": bad.count,
        "interrupted": interrupted,
        "version": version("wavefront"),
    }
    return film.image(int(film.count.max()), metadata)


@dataclass(frozen=True, slots=True)
class Piece:
    """A piece of work: a block of addresses, consecutive pixels × consecutive samples."""

    first_pixel: int
    pixels: int
    first_sample: int
    samples: int

    @property
    def lanes(self) -> int:
        """Number of paths."""
        return self.pixels * self.samples


@dataclass(slots=True)
class Wave:
    """What a piece of work came to."""

    radiance: Floats  # (3, samples, pixels)
    bad: Ints  # lanes whose radiance was not finite; it is 0 there


def plan(pixels: int, spp: int, wave_size: int) -> Iterator[Piece]:
    """Cut a render into pieces of at most `wave_size` paths; each pixel's samples come in order."""
    width = min(pixels, wave_size)
    depth = max(1, wave_size // width)
    for first_sample in range(0, spp, depth):
        for first_pixel in range(0, pixels, width):
            yield Piece(
                first_pixel, min(width, pixels - first_pixel), first_sample, min(depth, spp - first_sample)
            )


def trace_piece(
    scene: CompiledScene,
    camera: Camera,
    sampler: Sampler,
    estimate: Integrator,
    max_bounces: int,
    piece: Piece,
) -> Wave:
    """Take one wave of paths from the camera to its radiance."""
    pixels = np.arange(piece.first_pixel, piece.first_pixel + piece.pixels, dtype=np.uint32)
    samples = np.arange(piece.first_sample, piece.first_sample + piece.samples, dtype=np.uint32)
    paths = generate(scene, camera, sampler, np.tile(pixels, piece.samples), np.repeat(samples, piece.pixels))
    radiance = estimate(scene, paths, sampler, max_bounces)
    bad = np.flatnonzero(~np.isfinite(radiance).all(0))
    radiance[:, bad] = 0
    return Wave(radiance.reshape(3, piece.samples, piece.pixels), bad)


class BadSamples:
    """Counts samples that were not finite; none is dropped in silence."""

    def __init__(self) -> None:
        self.count = 0
        self.first = ""

    def note(self, piece: Piece, wave: Wave) -> None:
        """Count the bad lanes of a wave and remember the first of all."""
        if wave.bad.size and not self.count:
            sample, pixel = divmod(int(wave.bad[0]), piece.pixels)
            self.first = f"pixel {piece.first_pixel + pixel}, sample {piece.first_sample + sample}"
        self.count += wave.bad.size

    def report(self, samples: int) -> None:
        """Warn of bad samples.

        Raises
        ------
        SceneError
            If they are more than 1e-4 of all.
        """
        if not self.count:
            return
        message = f"{self.count} of {samples} samples were not finite and count as black; first: {self.first}"
        if self.count > MAX_BAD_SAMPLES * samples:
            raise SceneError(message)
        warnings.warn(message, stacklevel=3)


def as_scene(subject: Any) -> Scene:
    """Return what `render` was given as a `Scene`.

    Raises
    ------
    SceneError
        If it is nothing that can be rendered.
    """
    if isinstance(subject, Scene):
        return subject
    if isinstance(subject, Mesh | Sphere):
        return Scene([subject])
    if isinstance(subject, str | os.PathLike):
        return load(Path(subject))
    if isinstance(subject, tuple) and len(subject) == 2:
        return Scene([Mesh(*subject)])
    if type(subject).__module__.split(".")[0] == "trimesh":
        return from_trimesh(subject)
    raise SceneError(
        f"cannot render {type(subject).__name__}: give a wf.Scene, a path, a trimesh mesh or scene, "
        "or (vertices, faces)"
    )


def _one_of(name: str, value: Any, choices: Collection[str]) -> str:
    if not isinstance(value, str) or value not in choices:
        raise SceneError(f"{name} is {value!r}; it must be one of {', '.join(choices)}")
    return value


def _whole(name: str, value: Any, low: int, high: int) -> int:
    whole = isinstance(value, int | np.integer) and not isinstance(value, bool)
    if not whole or not low <= value <= high:
        raise SceneError(f"{name} is {value!r}; it must be a whole number from {low} to {high}")
    return int(value)


def _warn_unseen_lights(scene: Scene, integrator: str) -> None:
    if integrator == "naive" and any(isinstance(light, PointLight) for light in scene.lights):
        warnings.warn("the naive integrator cannot find point lights; they stay dark", stacklevel=3)


class _bar:
    """Shows progress, or calls the user's function with it."""

    def __init__(self, progress: Progress, total: int) -> None:
        self._callback = progress if callable(progress) else None
        shown = progress is None or progress is True
        self._bar = tqdm(total=total, unit="sample", unit_scale=True, delay=2, disable=not shown)
        self._total, self._done = total, 0

    def __enter__(self) -> Callable[[int], None]:
        return self._advance

    def __exit__(self, *error: object) -> None:
        self._bar.close()

    def _advance(self, samples: int) -> None:
        self._done += samples
        self._bar.update(samples)
        if self._callback:
            self._callback(self._done, self._total)
