"""The recorder of a wave: takes the data for the sampled AOVs of its samples from the stages.

A recorder travels with the paths (`Paths.recorder`), so integrators need not know which AOVs are asked for,
and integrators of a user's own give the same AOVs if they are made of the same stages.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..arrays.path_recorder import NOBODY, PathRecorder
from ..arrays.soa import soa
from ..arrays.state import BounceDepth, Contribution, Hits, Paths
from ..arrays.vec import Bools, Floats, Ints, add_to_slots, broadcast, f4, put, take
from ..colors import EFFICACY
from ..compile.program import Leg
from ..compile.scene import CompiledScene
from ..core.errors import SceneError
from ..film.aov_names import AOVS, CLAMPED, KEYED_AOVS, LUX, NARROW, is_noted
from ..film.aov_samples import BOUNDED, AovSamples, FixedPointSamples, fixed_point
from ..stages.compact import compact
from ..stages.interaction import interaction
from ..stages.shade import Shading, shading
from .clamp import Clamp
from .coverage import Coverage
from .direct_light import DirectLight, depth_after
from .light_by_group import LightByGroup
from .lux import lux_of
from .narrow_lobes import NarrowLobes
from .noted import Noted

FEATURES = ("denoising_albedo", "denoising_normal")
OF_LIGHT = ("direct", "indirect", "light_groups", CLAMPED)
BY_LIGHT = ("light_groups", LUX)  # AOVs for which light is divided by its sources


@soa
class AwaitedSurfaces:
    """Surfaces that paths have met, and that nobody has shaded yet."""

    scene: CompiledScene
    paths: Paths
    hits: Hits
    first: bool  # of their paths


class SampleRecorder(PathRecorder):
    """Records the sampled AOVs of one wave.

    Parameters
    ----------
    wanted
        The AOVs that are asked for.
    scene
        The scene to render.
    n
        Samples of the wave: slots of its paths.
    clamp
        The most indirect light that a path may find at once, as radiance, the mean of its channels.
    """

    def __init__(
        self, wanted: Sequence[str], scene: CompiledScene, n: int, clamp: float | None = None
    ) -> None:
        self._wanted, self._scene = tuple(wanted), scene
        self._values = {name: np.zeros((AOVS[name].channels, n), f4) for name in BOUNDED if name in wanted}
        self._coverage = Coverage(scene, n) if "coverage" in wanted else None
        self._narrow = NarrowLobes(n) if NARROW in wanted else None
        self._direct = DirectLight(n) if "direct" in wanted or "indirect" in wanted else None
        self._clamp = Clamp(clamp, n) if clamp is not None and CLAMPED in wanted else None
        self._light: dict[str, Floats] = {}
        if self._direct is not None:
            self._light["direct"] = self._direct.light
        if self._clamp is not None:
            self._light[CLAMPED] = self._clamp.light
        self._groups = LightByGroup(scene.light_groups, n) if "light_groups" in wanted else None
        if self._groups is not None:
            self._light.update((f"light_groups.{name}", light) for name, light in self._groups.items())
        self._noted = Noted([name for name in wanted if is_noted(name)], n)
        self._light.update(self._noted.values)
        several = LUX in wanted and len(scene.light_efficacies.names) > 1  # else it follows from the radiance
        self._efficacies = LightByGroup(scene.light_efficacies, n) if several else None
        self._divided = [by_group for by_group in (self._groups, self._efficacies) if by_group is not None]
        self.needs_directions = any(by_group.groups.need_directions for by_group in self._divided)
        self._awaited: AwaitedSurfaces | None = None
        self._begun = False
        self._all_rough = True  # no first surface is specular
        self._picture: Floats | None = None  # to which all light has been added
        self._share = 1.0  # part of a sample that each path is
        self._shared: SampleRecorder | None = None  # of the paths from shared points

    def prepare(self, paths: Paths) -> None:
        """Attach the recorder to paths that start at the camera, if it needs them."""
        if self._wanted == (LUX,) and not self._divided:
            return
        paths.recorder = self
        if self._narrow is not None:
            self._narrow.begin(paths)
        if self._direct is not None or self._clamp is not None:
            paths.depth = broadcast(np.uint8(BounceDepth.CAMERA), len(paths))
        if any(name in self._values for name in FEATURES):
            paths.met_rough = np.zeros(len(paths), np.bool_)

    def branched(self, ways: int) -> None:
        """Note that each path goes on in several ways."""
        self._share /= ways

    def of_shared(self, count: int) -> PathRecorder:
        """Return a recorder that divides the light of `count` shared points among the groups of lights."""
        wanted = [name for name in BY_LIGHT if name in self._wanted and self._divided]
        wanted += [NARROW] if self._narrow is not None else []
        if not wanted:
            return NOBODY
        self._shared = SampleRecorder(wanted, self._scene, count)
        return self._shared

    def parts_of_shared(self) -> list[tuple[Floats, Floats]]:
        """Return the light of each group, of the samples and of the shared points; and narrow lobes alike."""
        if self._shared is None:
            return []
        divided = zip(self._divided, self._shared._divided, strict=True)
        parts = [pair for one, shared in divided for pair in zip(one.light, shared.light, strict=True)]
        if self._narrow is not None and self._shared._narrow is not None:
            parts.append((self._narrow.throughput, self._shared._narrow.throughput))
        return parts

    # --- Surfaces -------------------------------------------------------------------------------------

    def record_hits(self, leg: Leg) -> None:
        """Record the next hits of paths; see `PathRecorder`."""
        self._shade_awaited()
        (scene, paths, hits), first, self._begun = (leg.scene, leg.paths, leg.hits), not self._begun, True
        if self._narrow is not None:
            self._narrow.record(paths)
        if first and "alpha" in self._values:
            self._values["alpha"][:, paths.slot] = _opacity(paths, hits)
        if first and self._coverage is not None:
            self._coverage.record(scene, paths, hits)
        if not self._needs_surfaces(paths, first):
            return
        ends = hits.prim != -1
        ends[leg.lanes] = False
        if ends.any():
            self._awaited = AwaitedSurfaces(
                scene, *compact(scene, paths, hits, np.flatnonzero(ends)), first=first
            )
            self._shade_awaited()
        if len(leg.kept_paths):
            self._awaited = AwaitedSurfaces(scene, leg.kept_paths, leg.kept_hits, first)

    def record_surfaces(self, scene: CompiledScene, paths: Paths, shade: Shading) -> None:
        """Record the surfaces that paths have met, which are ready to shade."""
        awaited, self._awaited = self._awaited, None
        if awaited is None:
            return
        albedo = None
        if awaited.first and "albedo" in self._values:
            albedo = shade.albedo()
            put(self._values["albedo"], paths.slot, albedo)
        if paths.met_rough is None:
            return
        lanes = np.flatnonzero(~paths.met_rough)
        if not lanes.size:
            return
        if lanes.size < len(paths):  # so these are not the first surfaces
            shade = shading(scene, shade.surface.take(lanes))
        self._record_features(paths, lanes, shade, shade.albedo() if albedo is None else albedo)

    def _needs_surfaces(self, paths: Paths, first: bool) -> bool:
        """Return whether an AOV needs the next surfaces of the paths."""
        if first and "albedo" in self._values:
            return True
        return paths.met_rough is not None and not paths.met_rough.all()

    def _shade_awaited(self) -> None:
        """Record surfaces that no integrator has shaded."""
        if self._awaited is None:
            return
        scene, paths, hits = self._awaited.scene, self._awaited.paths, self._awaited.hits
        surface = interaction(scene, paths, hits)
        for tilt in scene.program.tilt:
            tilt(scene, paths, surface)
        self.record_surfaces(scene, paths, shading(scene, surface))

    def _record_features(self, paths: Paths, lanes: Ints, shade: Shading, albedo: Floats) -> None:
        """Record the features for a denoiser for lanes (k,), those of `shade`, that meet a rough surface."""
        assert paths.met_rough is not None
        end = len(shade.lit().surface)
        rough = slice(0, end)  # groups that are specular come last
        self._all_rough &= end == lanes.size
        slot = take(paths.slot, lanes[rough])
        for name, values in zip(FEATURES, (albedo, shade.surface.ns), strict=True):
            if name in self._values:
                if self._share == 1:  # a slot has one path
                    put(self._values[name], slot, values[:, rough])
                else:
                    add_to_slots(self._values[name], slot, values[:, rough] * f4(self._share))
        if end == len(paths):
            paths.met_rough = broadcast(np.True_, end)
        else:
            paths.met_rough[lanes[rough]] = True

    def record_scattering(self, paths: Paths, shade: Shading, left: Paths) -> None:
        """Keep how deep paths are."""
        if paths.depth is not None:
            left.depth = depth_after(paths.depth, left.specular)

    # --- Light ----------------------------------------------------------------------------------------

    def clamped(self, paths: Paths, contribution: Contribution, slot: Ints, arriving: Floats) -> Floats:
        """Return light `arriving` (3, k) at slots (k,) as it is to be added."""
        if self._clamp is None or paths.depth is None:
            return arriving
        return self._clamp.clamped(paths, contribution, slot, arriving, self._share)

    def record_light(
        self, picture: Floats, paths: Paths, contribution: Contribution, slot: Ints, arriving: Floats
    ) -> None:
        """Record light `arriving` (3, k) that has been added to slots (k,) of the `picture` (3, n)."""
        if self._picture is None:
            self._picture = picture
        if self._picture is not picture:
            self._picture = np.empty(0, f4)  # no integrator returns this
        if self._direct is not None and paths.depth is not None:
            self._direct.record(paths, contribution, slot, arriving)
        for by_group in self._divided:
            by_group.record(paths, contribution, slot, arriving)

    def note(self, name: str, paths: Paths, values: Floats) -> None:
        """Record numbers of a user's own; see `integrators.note`."""
        self._noted.note(name, paths, values, self._share)

    def record_background(self, slot: Ints, color: Floats) -> None:
        """Record light (3, k) of a background that has been added to slots (k,)."""
        if self._direct is not None:
            self._direct.record_background(slot, color)

    # --- The result -----------------------------------------------------------------------------------

    def finish(self, integrator: object, radiance: Floats) -> Bools:
        """Record the rest, and return a mask (n,) of the slots whose AOVs are all finite.

        Parameters
        ----------
        integrator
            The integrator that has traced the paths.
        radiance
            (3, n) that it returned.

        Raises
        ------
        SceneError
            If the integrator does not use the stages that record the AOVs.
        """
        self._check(integrator, radiance)
        self._shade_awaited()
        if LUX in self._wanted:
            parts = [radiance] if self._efficacies is None else list(self._efficacies.light)
            self._light[LUX] = lux_of(self._scene.light_efficacies.names or (EFFICACY,), parts)
        finite: Bools = np.ones(radiance.shape[1], np.bool_)
        for values in (*self._values.values(), *self._light.values()):
            for row in values:
                finite &= np.isfinite(row)
        return finite

    def result(self, samples: int, dropped: Ints) -> AovSamples:
        """Return the AOVs, after `finish`.

        Parameters
        ----------
        samples
            Of each pixel.
        dropped
            Slots of samples that are dropped, because they were not finite; they count as 0.
        """
        light = {name: values.reshape(3, samples, -1) for name, values in self._light.items()}
        for values in self._light.values():
            values[:, dropped] = 0
        counts: dict[str, Ints] = {}
        if self._coverage is not None:
            counts.update(self._coverage.counts(samples, dropped))
        narrow = None if self._narrow is None else self._narrow.result(samples, dropped)
        return AovSamples(counts, self._bounded(samples, dropped), light, narrow)

    def _bounded(self, samples: int, dropped: Ints) -> dict[str, FixedPointSamples]:
        """Return the AOVs with values in [-1, 1]."""
        bounded: dict[str, FixedPointSamples] = {}
        for name, values in self._values.items():
            if name == "denoising_albedo" and self._all_rough and "albedo" in bounded:
                bounded[name] = bounded["albedo"]  # the same values: sent once
            else:
                bounded[name] = fixed_point(values, samples, dropped)
        return bounded

    def _check(self, integrator: object, radiance: Floats) -> None:
        label = getattr(integrator, "__name__", repr(integrator))
        self._noted.check(label)
        for name in self._wanted:
            needs_light = name in OF_LIGHT or (name == LUX and self._efficacies is not None)
            if needs_light and self._picture is not radiance:
                raise SceneError(
                    f"the integrator {label} cannot give the AOV {name!r}: all light must be added by "
                    "wavefront.integrators.accumulate to the array that it returns"
                )
            if name not in (*OF_LIGHT, LUX, NARROW) and not is_noted(name) and not self._begun:
                raise SceneError(
                    f"the integrator {label} cannot give the AOV {name!r}: its paths must find their "
                    "surfaces by wavefront.integrators.intersect_and_compact"
                )


def recorded_aovs(wanted: Sequence[str], scene: CompiledScene) -> tuple[str, ...]:
    """Return the names of the AOVs that recorders return; keyed ones have a name for each key."""
    names: list[str] = []
    for name in wanted:
        keys = scene.light_groups.names if name == "light_groups" else dict.fromkeys(scene.shape_names)
        names += [f"{name}.{key}" for key in keys] if name in KEYED_AOVS else [name]
    return tuple(names)


def _opacity(paths: Paths, hits: Hits) -> Floats:
    """Return the opacity (n,) of camera paths over a background: 1 on a hit, else that of media.

    Media leave the part by which the throughput of its channels weighs a gray background. It is at most
    2, as the weights of paths where media scatter have a mean of 1 over the channels.
    """
    red, green, blue = paths.throughput
    left = np.minimum((red + green + blue) / f4(3), f4(2))
    return np.where(hits.prim == -1, f4(1) - left, f4(1))
