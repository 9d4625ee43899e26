"""All lights of a scene in one table, and the choice of one of them per vertex."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np
from numpy.typing import ArrayLike

from ..arrays.state import SurfaceInteraction
from ..arrays.vec import ALL, Doubles, Floats, Ints, Lanes, f4, put, take
from ..sampling.mis import power_heuristic
from .base import Emitters, LightRecord, LightSample, Receiver, emitters_of, lit_for, sampled_li
from .choice import LightSampler, LightSamplerMaker
from .infinite import InfiniteLight
from .octahedral import OctahedralEnvironment
from .samplers import LIGHT_SAMPLERS, SingleLightSampler, SubsetLightSampler


class IrradianceOf:
    """The irradiance by lights of several kinds in parts of a scene (`scene_radius`), and their places."""

    def __init__(self, kinds: Sequence[LightRecord], scene_radius: float) -> None:
        self.kinds, self.scene_radius = kinds, scene_radius

    def __call__(self, center: Doubles, radius: float, /) -> Doubles:
        """Return a bound on the irradiance (c, k) by each light within `radius` of points `center` (3, c)."""
        return np.concatenate([kind.irradiance(center, radius, self.scene_radius) for kind in self.kinds], 1)

    @property
    def emitters(self) -> Emitters:
        """Where the lights are; NaN for those that are nowhere."""
        return Emitters.concatenate([emitters_of(kind) for kind in self.kinds])


class LightTable:
    """Lights of several kinds, numbered through: kind by kind, column by column.

    One light is chosen per point; the probability of the choice is part of every pdf returned here.

    Parameters
    ----------
    kinds
        One record per kind of light; a record holds all lights of that kind.
    half_size
        Half of the scene's extent along each axis (3,), or along all; scene units. The scene's
        middle is the origin.
    choice
        A name in `LIGHT_SAMPLERS`, or a function as in that table. Where there is only one light, it is
        not called.

    Raises
    ------
    SceneError
        If the choice is unknown.
    """

    def __init__(
        self, kinds: Sequence[LightRecord], half_size: ArrayLike, choice: str | LightSamplerMaker = "spatial"
    ) -> None:
        self.kinds = tuple(kinds)
        self.starts = np.cumsum([0, *(len(kind) for kind in kinds)])
        self.kind_of = np.repeat(np.arange(len(kinds)), [len(kind) for kind in kinds])
        varies = np.concatenate([np.zeros(0), *(np.broadcast_to(kind.varies, len(kind)) for kind in kinds)])
        # (lights,) those with `le` by surface; None if there are none
        self.varies = varies.astype(np.bool_) if varies.any() else None
        self.reads = {name for kind in kinds for name in kind.reads}  # attributes of surfaces, for `le`
        last = self.kinds[-1] if self.kinds else None  # lights at infinity come last
        self.texels = last if isinstance(last, OctahedralEnvironment) else None
        self.turning = last if isinstance(last, InfiniteLight) and last.turns else None
        self.takes_receiver = any(kind.takes_receiver for kind in kinds)
        self.delta_of = np.array([kind.delta for kind in kinds], np.bool_)[self.kind_of]
        extent = np.broadcast_to(np.asarray(half_size, float), 3)
        power = np.concatenate([np.zeros(0), *(kind.power(float(np.linalg.norm(extent))) for kind in kinds)])
        self.chosen_from = power != 0  # (lights,) which take part in the choice
        self.choice = self._make_choice(power, extent, choice)
        self.takes_receiver |= getattr(self.choice, "takes_receiver", False)

    def __len__(self) -> int:
        """Return the number of lights."""
        return int(self.starts[-1])

    def _make_choice(
        self, power: Doubles, half_size: Doubles, choice: str | LightSamplerMaker
    ) -> LightSampler | None:
        """Return the light sampler; None when nothing shines. Lights without a power take no part."""
        make = LIGHT_SAMPLERS.find(choice)
        if not power.any():
            return None
        if not power.all():
            shining = [np.flatnonzero(kind_power) for kind_power in np.split(power, self.starts[1:-1])]
            kinds = [kind.take(lanes) for kind, lanes in zip(self.kinds, shining, strict=True) if lanes.size]
            chosen = LightTable(kinds, half_size, make).choice
            return None if chosen is None else SubsetLightSampler(chosen, np.flatnonzero(power), power.size)
        if power.size == 1:
            return SingleLightSampler()
        return make(power, half_size, IrradianceOf(self.kinds, float(np.linalg.norm(half_size))))

    def sample_li(
        self, point: Floats, u_choice: Floats, u: Floats, receiver: Receiver | None = None
    ) -> tuple[LightSample, Ints]:
        """Choose a light for each point (3, n) with u_choice (n,) and sample it with u (2, n).

        `receiver` has the surfaces that the light shines on; None where they are not known.

        Returns
        -------
        sample
            The light arriving; its pdf includes the probability of the choice.
        light
            (n,) numbers of the chosen lights.
        """
        light, chance = self._choice_for(receiver).sample(point, u_choice)
        sample = self._sample_each(light, point, u, receiver)
        sample.pdf = sample.pdf * chance
        return sample, light

    def pdf_li(self, light: Ints, point: Floats, wi: Floats, receiver: Receiver | None = None) -> Floats:
        """Density with which `sample_li` draws wi (3, n) towards the lights numbered `light` (n,)."""
        if self.choice is None:
            return np.zeros(len(light), f4)
        pdf = np.empty(len(light), f4)
        for kind, rows in self._by_kind(light):
            pdf[rows] = lit_for(kind, receiver, rows).pdf_li(take(point, rows), take(wi, rows))
        return pdf * self._choice_for(receiver).pmf(light, point)

    def pmf(self, light: Ints, point: Floats, receiver: Receiver | None = None) -> Floats:
        """Return the probability (n,) with which lights (n,) are chosen at points (3, n)."""
        return self._choice_for(receiver).pmf(light, point)

    def _choice_for(self, receiver: Receiver | None) -> LightSampler:
        """Return the light sampler, for surfaces if they are known."""
        assert self.choice is not None
        if receiver is None or not getattr(self.choice, "takes_receiver", False):
            return self.choice
        return self.choice.lighting(receiver)

    def mis_weight(self, light: Ints, pdf: Floats, pdf_bsdf: Floats) -> Floats:
        """Weight of samples of lights numbered `light` (n,) against BSDF sampling: 1 for delta lights."""
        weight = power_heuristic(pdf, pdf_bsdf)
        if self.delta_of.any():
            weight[np.flatnonzero(self.delta_of.take(light))] = 1
        return weight

    def le(
        self,
        light: Ints,
        wi: Floats,
        surface_at: Callable[[Ints], SurfaceInteraction] | None = None,
        pdf: Floats | None = None,
        time: Doubles | None = None,
    ) -> Floats:
        """Return the radiance (3, n) of the lights numbered `light` (n,) against wi (3, n).

        `surface_at` is called with the lanes (k,) whose lights vary, if there are any, and returns the
        surfaces there. `pdf` (n,) is the density of rays that light samples could replace, inf of others.
        `time` (n,) is that of the rays, for lights at infinity that turn.
        """
        texels, turning = self.texels, self.turning
        if pdf is not None and texels is not None:
            return self._le_by_rays(
                light, wi, surface_at, lambda far: texels.le_of_texels(take(wi, far), take(pdf, far))
            )
        if time is not None and turning is not None:
            return self._le_by_rays(
                light, wi, surface_at, lambda far: turning.le_at(take(wi, far), take(time, far))
            )
        if self.varies is None:
            return self._le(light, wi, None)
        varies = self.varies.take(light)
        radiance = np.empty_like(wi)
        even = np.flatnonzero(~varies)
        if even.size:
            put(radiance, even, self._le(light.take(even), take(wi, even), None))
        lanes = np.flatnonzero(varies)
        if lanes.size:
            assert surface_at is not None
            put(radiance, lanes, self._le(light.take(lanes), take(wi, lanes), surface_at(lanes)))
        return radiance

    def _le_by_rays(
        self,
        light: Ints,
        wi: Floats,
        surface_at: Callable[[Ints], SurfaceInteraction] | None,
        far_light: Callable[[Lanes], Floats],
    ) -> Floats:
        """Return the same, where that of the last light, on some lanes, depends on more of the rays."""
        if len(self) == 1:
            return far_light(ALL)
        far = light == len(self) - 1
        lanes, others = np.flatnonzero(far), np.flatnonzero(~far)
        radiance = np.empty_like(wi)
        put(radiance, lanes, far_light(lanes))
        radiance_others = self.le(
            light.take(others), take(wi, others), surface_at and (lambda at: surface_at(others.take(at)))
        )
        put(radiance, others, radiance_others)
        return radiance

    def _le(self, light: Ints, wi: Floats, surface: SurfaceInteraction | None) -> Floats:
        if len(self.kinds) == 1:
            return _radiance(self._gathered(0, light), wi, surface)
        radiance = np.empty_like(wi)
        for kind, rows in self._by_kind(light):
            put(
                radiance,
                rows,
                _radiance(kind, take(wi, rows), None if surface is None else surface.take(rows)),
            )
        return radiance

    def _sample_each(self, light: Ints, point: Floats, u: Floats, receiver: Receiver | None) -> LightSample:
        n = len(light)
        out = LightSample(np.empty((3, n), f4), np.empty((3, n), f4), *np.empty((3, n), f4))
        where: tuple[Ints, Floats, Floats] | None = None
        for kind, rows in self._by_kind(light):
            if isinstance(rows, slice):
                return sampled_li(lit_for(kind, receiver, rows), point, u)
            sample = sampled_li(lit_for(kind, receiver, rows), take(point, rows), take(u, rows))
            put(out.wi, rows, sample.wi)
            put(out.radiance, rows, sample.radiance)
            out.pdf[rows], out.distance[rows] = sample.pdf, sample.distance
            out.cos_light[rows] = sample.cos_light
            if sample.prim is not None:
                where = where or (np.full(n, -1, np.intp), np.zeros(n, f4), np.zeros(n, f4))
                where[0][rows], where[1][rows], where[2][rows] = sample.prim, sample.b1, sample.b2
        if where is not None:
            out.prim, out.b1, out.b2 = where
        return out

    def _gathered(self, number: int, light: Ints) -> LightRecord:
        """Return the lights, all of one kind, with a column per lane."""
        kind = self.kinds[number]
        return kind if len(kind) == 1 else kind.take(light - self.starts[number])

    def _by_kind(self, light: Ints) -> Iterator[tuple[LightRecord, Lanes]]:
        """Yield, per kind that occurs, its lights gathered to a column per lane, and those lanes."""
        if len(self.kinds) == 1:
            yield self._gathered(0, light), ALL
            return
        kind_of = self.kind_of.take(light)
        if light.size and (kind_of == kind_of[0]).all():
            yield self._gathered(kind_of[0], light), ALL
            return
        for number in range(len(self.kinds)):
            rows = np.flatnonzero(kind_of == number)
            if rows.size:
                yield self._gathered(number, light.take(rows)), rows


def _radiance(kind: LightRecord, wi: Floats, surface: SurfaceInteraction | None) -> Floats:
    """Return the radiance of lights; those of uniform emission need not take a surface."""
    return kind.le(wi) if surface is None else kind.le(wi, surface)
