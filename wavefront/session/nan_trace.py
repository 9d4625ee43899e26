"""Where a sample that is not finite comes from: its path is traced once more, step by step."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache

import numpy as np

from ..arrays.record import record
from ..arrays.state import Paths, SurfaceInteraction, Words
from ..arrays.vec import Bools, Floats, f4
from ..camera import Camera
from ..compile.scene import CompiledScene
from ..integrators import accumulate, intersect_and_compact, prepare_shading
from ..integrators.light_tracing import trace_light
from ..sampling.filters import Filter
from ..sampling.sampler import Sampler
from ..scene import Scene
from ..stages.bounce import branch, copies
from ..stages.compact import roulette, select
from ..stages.generate import generate
from ..stages.shade import Shading, direct
from .diagnosis import shape_name


@record
class PathChecker:
    """Traces single paths as the integrators do, and checks what each step adds."""

    user_scene: Scene
    scene: CompiledScene
    camera: Camera  # in the unit of the compiled scene
    sampler: Sampler
    filter: Filter
    max_bounces: int
    branches: int
    copies: int  # in which a path goes on from its second surface where pixels share what it finds
    light_samples: bool  # at surfaces
    mis: bool  # light samples are weighted against BSDF samples
    layers: tuple[str, ...] = ()  # sampled ones that are asked for

    def first_fault(self, pixel: int, sample: int) -> str:
        """Return the bounce and the material where a path gets a value that is not finite.

        Bounce 0 is at the first surface that the camera sees. The text is empty if no step of the integrators
        of this package gives such a value.
        """
        address = np.array([pixel], np.uint32), np.array([sample], np.uint32)
        with np.errstate(all="ignore"):
            for of_second in sorted({1, self.copies}):
                paths = generate(self.scene, self.camera, self.sampler, *address, self.filter)
                fault = self._first_fault(paths, of_second)
                if fault:
                    return fault
            return self._light_path_fault(*address)

    def _light_path_fault(self, pixel: Words, sample: Words) -> str:
        """Return where a light path brings a value that is not finite; "" where none does."""
        if self.scene.casters is None:
            return ""
        for scatterings in range(2, self.max_bounces + 1):
            splats = trace_light(self.scene, self.camera, self.sampler, pixel, sample, scatterings)
            if not np.isfinite(splats.radiance).all():
                return f"bounce {scatterings - 1} of the path from the light"
        return ""

    def _first_fault(self, paths: Paths, of_second: int) -> str:
        for bounce in range(self.max_bounces + 1):
            radiance = np.zeros((3, 1), f4)
            paths, hits = intersect_and_compact(
                self.scene, paths, self.sampler, bounce, radiance, mis=self.mis
            )
            if not np.isfinite(radiance).all():
                return f"bounce {bounce}, emission that the path meets"
            if bounce == self.max_bounces or not len(paths):
                break
            shade = prepare_shading(self.scene, paths, hits)
            if _bad(paths).any():
                return self._at(bounce, shade.surface, _bad(paths), "absorption in front of")
            for name, layer in self._surface_layers(shade, bounce):
                bad = np.asarray(np.isnan(layer).any(0))
                if bad.any():
                    return self._at(bounce, shade.surface, bad, f"layer {name!r} at")
            if self.light_samples:
                lit = direct(self.scene, paths, shade, self.sampler, bounce, mis=self.mis)
                accumulate(radiance, paths, lit)
                bad = np.zeros(len(paths), np.bool_)
                bad[lit.lanes] = ~np.isfinite(lit.radiance).all(0)
                if not np.isfinite(radiance).all():
                    return self._at(bounce, shade.surface, bad, "light sample at")
            ways = self.branches if bounce == 0 else 1
            paths = branch(paths, shade, self.sampler, bounce, ways)
            if _bad(paths).any():
                of_surface: Bools = np.logical_or.reduce(_bad(paths).reshape(ways, -1), 0)
                return self._at(bounce, shade.surface, of_surface, "BSDF sample of")
            paths = select(paths, roulette(self.scene, paths, self.sampler, bounce, self.branches))
            if bounce == 0 and of_second > 1:
                paths = Paths.concatenate(copies(paths, of_second))
        return ""

    def _surface_layers(self, shade: Shading, bounce: int) -> Iterator[tuple[str, Floats]]:
        """Yield the layers that a surface gives a path which meets it, by name."""
        albedo = cache(shade.albedo)
        for name in self.layers:
            if (name == "albedo" and bounce == 0) or name == "denoising_albedo":
                yield name, albedo()
            if name == "denoising_normal":
                yield name, shade.surface.ns

    def _at(self, bounce: int, surface: SurfaceInteraction, bad: Bools, what: str) -> str:
        """Name the material of the first bad lane; of the first of all where only their sum is bad."""
        lane = int(bad.argmax())
        row, materials = int(surface.material[lane]), self.scene.materials
        kind = type(materials.groups[int(materials.group_of[row])]).__name__
        place = shape_name(self.user_scene, surface.prim[lane : lane + 1])
        return f"bounce {bounce}, {what} material {kind} of {place}"


def _bad(paths: Paths) -> Bools:
    return np.asarray(~np.isfinite(paths.throughput).all(0))
