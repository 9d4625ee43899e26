"""Why a picture is black, white or not finite: its scene and its paths are looked at once more."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache, cached_property

import numpy as np

from ..arrays.path_recorder import PathRecorder
from ..arrays.state import Contribution, Hits, Paths, Rays, SurfaceInteraction, Words
from ..arrays.vec import Bools, Floats, Ints, dot, f4
from ..camera import Camera
from ..compile.instances import sort_shapes
from ..compile.program import Leg
from ..compile.scene import CompiledScene
from ..core.errors import warn_caller
from ..features.view import seen_with
from ..image import Image
from ..integrators.light_tracing import trace_light
from ..integrators.registry import integrator_for
from ..lights import LightSample
from ..scene import Scene
from ..shapes import Instance, Shape
from ..stages.generate import generate
from ..stages.interaction import interaction, origin_above
from ..stages.intersect import intersect, shadow_rays, visible
from ..stages.passing import covering_hits
from ..stages.shade import Shading
from .final_checks import DIM, dim_blocks
from .jobs import CameraJob
from .prepared_scene import PreparedScene
from .tracing import Tracer

GRID = 16  # rays across the picture and down
SAMPLES = 16  # light samples at each visible point


def warn_of_black_or_white(
    image: Image, scene: PreparedScene, view: Camera, integrator: str, max_bounces: int
) -> None:
    """Warn of a picture that is black or white all over, with the likely cause.

    `view` is the camera in the units of the compiled scene.
    """
    brightest, darkest = float(image.rgb.max()), float(image.rgb.min())
    probe = VisibilityProbe(scene, view, integrator, max_bounces)
    if brightest >= DIM and darkest <= 1:
        if probe.mostly_dim(dim_blocks(image)):
            warn_caller(
                "the picture is almost black: so is more than half of what the camera sees; "
                "lighting='studio' adds light, and save(..., exposure=...) shows dark parts"
            )
    elif darkest > 1:
        warn_caller(f"the picture is white: {probe.why_white(darkest)}")
    elif brightest > 0:
        stops = int(np.ceil(np.log2(0.5 / brightest)))
        warn_caller(
            f"the picture is almost black: its brightest pixel is {brightest:.2g}, and 1 is white; "
            f"save(..., exposure={stops}) shows it, or lights {2**stops} times as bright"
        )
    elif not probe.lights_are_off:
        warn_caller(f"the picture is black: {probe.why_black()}")


class VisibilityProbe:
    """The part of a scene that a camera sees, by a grid of rays."""

    def __init__(self, scene: PreparedScene, view: Camera, integrator: str, max_bounces: int) -> None:
        self._scene, self._compiled, self._view = scene.lighted, scene.compiled, view
        self._integrator, self._max_bounces = integrator, max_bounces

    def mostly_dim(self, blocks: Bools) -> bool:
        """Return whether most of the blocks (n, n) of a picture that show shapes are dim."""
        met = self._met[1].found  # of a grid of rays, row by row
        side = len(blocks)
        row, column = np.divmod(met, GRID)
        dim = blocks[row * side // GRID, column * side // GRID]
        return bool(len(dim)) and bool(dim.mean() > 0.5)

    @property
    def lights_are_off(self) -> bool:
        """True if there are lights, and all have zero radiance."""
        lights = self._compiled.lights
        if not len(lights) or lights.choice is not None:
            return False
        environment = self._compiled.light_of[-1]
        if environment < 0:
            return True
        around = np.concatenate([np.eye(3, dtype=f4), -np.eye(3, dtype=f4)], 1)
        return not lights.le(np.full(6, environment), around).any()

    def why_black(self) -> str:
        """Return the likely cause of a black picture."""
        if not len(self._compiled.lights):
            return "nothing in the scene emits light; lighting='studio' lights it"
        if not len(self._seen):
            return f"the camera sees no shape; {self._where_the_scene_is()}"
        if self._max_bounces == 0:
            return "max_bounces=0 shows lights alone, and the camera sees none from its bright side"
        materials = self._compiled.materials
        groups = np.unique(materials.group_of.take(self._seen.material))
        if all(materials.groups[group].black for group in groups):
            return "the materials of all that the camera sees reflect nothing"
        cause = self._why_no_light_arrives()
        if cause is None and self._is_enclosed:
            cause = (
                f"the camera is inside {shape_name(self._scene, self._around.prim)}, where no light gets in"
            )
        return cause or self._why_it_is_not_found()

    def why_white(self, darkest: float) -> str:
        """Return the likely cause of a white picture."""
        fix = f"save(..., exposure={-int(np.ceil(np.log2(darkest)))}) shows what is below"
        emits = self._compiled.emissive.take(self._met[1].prim)
        if not len(self._seen):
            return f"the camera sees no shape, only light from all around that is above 1; {fix}"
        if emits.all():
            name = shape_name(self._scene, self._seen.prim)
            return f"the camera sees nothing but {name}, which emits light; {fix}"
        return f"its darkest pixel is {darkest:.3g}, and 1 is white; {fix}"

    # --- Visible surfaces -----------------------------------------------------------------------------

    @cached_property
    def _rays(self) -> Rays:
        x0, y0, x1, y1 = self._view.window
        step = (np.arange(GRID) + 0.5) / GRID
        x, y = np.meshgrid(x0 + (x1 - x0) * step, y0 + (y1 - y0) * step)
        origin, direction = self._view.rays(
            x.ravel().astype(f4), y.ravel().astype(f4), self._compiled.center, None
        )
        return Rays(origin, direction, np.full(GRID * GRID, -1, np.intp))

    @cached_property
    def _met(self) -> tuple[Rays, Hits]:
        return covering_hits(self._compiled, self._rays)

    @cached_property
    def _seen(self) -> SurfaceInteraction:
        return self._surface(*self._met)

    @cached_property
    def _around(self) -> SurfaceInteraction:
        """The surfaces around the camera, in all directions."""
        n = GRID * GRID
        height = 1 - (2 * np.arange(n) + 1) / n
        turn = np.arange(n) * np.pi * (3 - np.sqrt(5))  # steps by the golden angle distribute points evenly
        level = np.sqrt(1 - height**2)
        direction = np.stack([level * np.cos(turn), height, level * np.sin(turn)]).astype(f4)
        rays = Rays(self._rays.origin[:, :1].repeat(n, 1), direction, np.full(n, -1, np.intp))
        return self._surface(rays, intersect(self._compiled, rays))

    @property
    def _is_enclosed(self) -> bool:
        return bool(self._around.back_facing.all()) and len(self._around) == GRID * GRID

    def _surface(self, rays: Rays, hits: Hits) -> SurfaceInteraction:
        lanes = hits.found
        return interaction(self._compiled, rays.take(lanes), hits.take(lanes))

    def _where_the_scene_is(self) -> str:
        backward = self._view.rotation[:, 2]
        middle = self._compiled.center - self._view.origin
        if float(middle @ backward) > 0:
            return "the middle of the scene is behind it: look the other way"
        return "it looks past the scene"

    # --- Light at surfaces ----------------------------------------------------------------------------

    def _why_no_light_arrives(self) -> str | None:
        """Return why light samples reach no visible point; None if some do, or there are no light samples."""
        if self._compiled.lights.choice is None:
            return None
        shining = facing = False
        blockers: list[Ints] = []
        for light, lanes in self._light_samples():
            shining |= bool(lanes.any())
            lanes &= (dot(self._seen.ng, light.wi) > 0) | self._transmissive(self._seen.material)
            facing |= bool(lanes.any())
            rays = shadow_rays(self._seen, origin_above(self._seen), light, np.flatnonzero(lanes))
            if visible(self._compiled, rays).any():
                return None
            hits = intersect(self._compiled, rays)
            blockers.append(hits.prim.take(hits.found))
        if not shining:
            hints = (light.hint for light in self._scene.lights if light.hint is not None)
            how = next(hints, "reverse their faces, or give them two_sided=True")
            return f"the lights point away from all that the camera sees; {how}"
        if not facing:
            return "the camera sees only the sides of surfaces that are turned away from the lights"
        return self._why_it_is_blocked(np.concatenate(blockers))

    def _light_samples(self) -> Iterator[tuple[LightSample, Bools]]:
        """Yield light samples at the visible points, and a mask of those with radiance."""
        random = np.random.default_rng(0)
        n = len(self._seen)
        for _ in range(SAMPLES):
            u = random.random((3, n), f4)
            light, _ = self._compiled.lights.sample_li(origin_above(self._seen), u[0], u[1:])
            yield light, (light.pdf > 0) & (light.radiance > 0).any(0)

    def _transmissive(self, rows: Ints) -> Bools:
        materials = self._compiled.materials
        clear = np.array([bsdf.transmissive for bsdf in materials.groups], np.bool_)
        return clear.take(materials.group_of.take(rows))

    def _why_it_is_blocked(self, prims: Ints) -> str:
        name = shape_name(self._scene, prims)
        through = self._transmissive(self._compiled.material_of.take(prims))
        if not through.any():
            if self._is_enclosed:
                return f"the camera is inside {name}, where no light gets in"
            return f"all that the camera sees is in the shadow of {name}"
        if self._compiled.lights.delta_of.all():
            return (
                f"{name} lets light through, but bends it, and no path meets a light without size there; "
                "caustics=True traces paths from it, or give it a size: a small wf.Sphere with an emission"
            )
        if self._integrator != "full":
            return (
                f"light comes through {name} alone, which integrator={self._integrator!r} does not follow; "
                "integrator='full' does"
            )
        return f"light comes through {name} alone, and too few samples find it"

    def _why_it_is_not_found(self) -> str:
        """Return why light that exists does not reach the camera."""
        if self._integrator == "naive" and self._compiled.lights.delta_of.all():
            return "the naive integrator meets lights by chance, and lights without size never"
        if self._integrator in ("direct_simple", "direct_mis"):
            return (
                f"integrator={self._integrator!r} shows direct light only, and none reaches what the camera "
                "sees; integrator='full' shows all light"
            )
        return "no light reaches what the camera sees"


def shape_name(scene: Scene, prims: Ints) -> str:
    """Return the name of the shape that most of the primitives (n,) belong to."""
    if any(isinstance(shape, Instance) for shape in scene.shapes):
        return "a shape"
    meshes, curved, _, _ = sort_shapes(list(scene.shapes), 0)
    counts = [len(mesh.faces) for mesh in meshes] + [shape.count for shape in curved]
    shapes: list[Shape] = [*meshes, *curved]
    numbers = np.searchsorted(np.cumsum(counts), prims, "right")
    return repr(shapes[int(np.bincount(numbers).argmax())].name)


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
    scene = seen_with(tracer.scene, tracer.table if view.guided else None, view.branches, view.tiles)
    paths = generate(scene, camera, sampler, pixels, samples, tracer.filter)
    recorder = paths.recorder = NanRecorder(user_scene, tracer.layers)
    integrator = integrator_for(tracer.integrator, view.tiles)
    with np.errstate(all="ignore"):
        integrator(scene, paths, sampler, tracer.max_bounces + camera.scatterings)
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

    def record_hits(self, leg: Leg) -> None:
        """Keep the bounce, which that of light met before it is, too."""
        self._bounce = leg.bounce
        if self._bad_emission:
            self._note(f"bounce {leg.bounce}, emission that the path meets")

    def record_surfaces(self, scene: CompiledScene, paths: Paths, shade: Shading) -> None:
        """Check the throughput of paths after absorption, and the AOVs of surfaces."""
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
