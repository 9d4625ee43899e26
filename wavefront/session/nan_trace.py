"""Where a sample that is not finite comes from: its path is traced once more, and each step is looked at."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache

import numpy as np

from ..aovs.path_recorder import MetSurfaces, PathRecorder
from ..arrays.state import Contribution, Paths, Words
from ..arrays.vec import Bools, Floats, Ints
from ..camera import Camera
from ..compile.scene import CompiledScene
from ..integrators.light_tracing import trace_light
from ..integrators.registry import integrator_for
from ..scene import Scene
from ..scheduling.jobs import CameraJob
from ..scheduling.tracing import Tracer
from ..stages.generate import generate
from ..stages.shade import Shading
from .diagnosis import shape_name


def first_nan(user_scene: Scene, tracer: Tracer, view: CameraJob, pixels: Words, sample: int) -> str:
    """Return the bounce and the material where a path first gets a value that is not finite.

    Bounce 0 is at the first surface that the camera sees. The text is empty if no step of the integrators of
    this package gives such a value.

    Parameters
    ----------
    user_scene
        Whose shapes have names.
    tracer, view
        How the sample was traced.
    pixels
        (n,) the pixel, and those that share their paths with it.
    sample
        Its number.
    """
    camera = view.camera
    sampler = tracer.sampler(camera.resolution[0])
    samples = np.full(pixels.size, sample, np.uint32)
    paths = generate(tracer.scene, camera, sampler, pixels, samples, tracer.filter)
    recorder = paths.recorder = NanRecorder(user_scene, tracer.layers)
    table = tracer.table if view.guided else None
    integrator = integrator_for(tracer.integrator, view.branches, view.tiles, table)
    with np.errstate(all="ignore"):
        integrator(tracer.scene, paths, sampler, tracer.max_bounces + camera.scatterings)
        return recorder.place or _nan_of_light(tracer, camera, pixels, samples)


def _nan_of_light(tracer: Tracer, camera: Camera, pixels: Words, samples: Words) -> str:
    """Return where a path from a light brings a value that is not finite; "" where none does."""
    if tracer.scene.specular_surfaces is None:
        return ""
    sampler = tracer.sampler(camera.resolution[0])
    for scatterings in range(2, tracer.max_bounces + 1):
        splats = trace_light(tracer.scene, camera, sampler, pixels, samples, scatterings)
        if not np.isfinite(splats.radiance).all():
            return f"bounce {scatterings - 1} of the path from the light"
    return ""


class NanRecorder(PathRecorder):
    """Notes the first value along some paths that is not finite.

    Attributes
    ----------
    place
        Where it comes from; empty for none.
    """

    def __init__(self, user_scene: Scene, layers: tuple[str, ...]) -> None:
        self.place = ""
        self._user_scene, self._layers = user_scene, layers
        self._bounce = 0
        self._bad_emission = False
        self._at: tuple[CompiledScene, Shading] | None = None  # the surfaces that are shaded

    def of_shared(self, count: int) -> NanRecorder:
        """Go on at the second surfaces, from which paths begin anew."""
        self._bounce = 1
        return self

    def record_hits(self, scene: CompiledScene, met: MetSurfaces) -> None:
        """Keep the bounce, which that of light met before it is, too."""
        self._bounce = met.bounce
        if self._bad_emission:
            self._note(f"bounce {met.bounce}, emission that the path meets")

    def record_surfaces(self, scene: CompiledScene, paths: Paths, shade: Shading) -> None:
        """Check what absorption has left of the paths, and the AOVs that the surfaces give."""
        self._at = scene, shade
        self._check(_bad(paths.throughput), "absorption in front of")
        if not self.place:
            for name, layer in self._surface_aovs(shade):
                self._check(np.asarray(np.isnan(layer).any(0)), f"AOV {name!r} at")

    def record_scattering(self, paths: Paths, shade: Shading, left: Paths) -> None:
        """Check the BSDF samples."""
        self._check(_bad(left.throughput), "BSDF sample of")

    def record_light(
        self, picture: Floats, paths: Paths, contribution: Contribution, slot: Ints, arriving: Floats
    ) -> None:
        """Check the light."""
        bad = _bad(arriving)
        if not contribution.sampled:
            self._bad_emission |= bool(bad.any())
            return
        lanes = np.zeros(len(paths), np.bool_)
        lanes[contribution.lanes] = bad
        self._check(lanes, "light sample at")

    def _surface_aovs(self, shade: Shading) -> Iterator[tuple[str, Floats]]:
        """Yield the AOVs that surfaces give paths which meet them, by name."""
        albedo = cache(shade.albedo)
        for name in self._layers:
            if (name == "albedo" and self._bounce == 0) or name == "denoising_albedo":
                yield name, albedo()
            if name == "denoising_normal":
                yield name, shade.surface.ns

    def _check(self, bad: Bools, what: str) -> None:
        """Note a fault where a lane (n,) of the surfaces is bad: the first one names the material."""
        if self.place or self._at is None or not bad.any():
            return
        scene, surface = self._at[0], self._at[1].surface
        lane = int(bad.argmax())
        materials, row = scene.materials, int(surface.material[lane])
        kind = type(materials.groups[int(materials.group_of[row])]).__name__
        place = shape_name(self._user_scene, surface.prim[lane : lane + 1])
        self._note(f"bounce {self._bounce}, {what} material {kind} of {place}")

    def _note(self, place: str) -> None:
        self.place = self.place or place


def _bad(values: Floats) -> Bools:
    """Return which columns (n,) of values (3, n) are not finite."""
    return np.asarray(~np.isfinite(values).all(0))
