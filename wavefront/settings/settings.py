"""The settings of a render, checked, and the values that follow from them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Unpack

import numpy as np

from ..arrays.vec import Floats, f4
from ..core.errors import SceneError, one_of
from ..film.aov_names import CLAMPED, GUIDES, chosen_aovs, sampled_names
from ..film.exact_sum import MAX_TERMS
from ..integrators import INTEGRATORS, li_full
from ..integrators.tuning import BRANCHES
from ..motion.shutter import SHUTTER_CURVES, Shutter
from ..sampling.sampler import make_sampler
from ..stages.reuse import SHARED_WAYS
from ..workers.executors import ExecutorLike, choose_executor, worker_count
from .checks import AUTO, check_combinations, whole_number
from .declaration import SETTINGS, AllSettings

DEFAULT_SPP = 100
LITTLE_NOISE = 0.02  # at which a picture ends by itself
CLEAN = 0.05  # likewise, where it is denoised then: mean error of lit pixels
MAX_BRANCH_SAMPLES = 2**32  # a sample's index is 32 bits of its address, and each branch has one
TRAINING = 0x5EED_0F_9417D  # the seed of a training pass is that of the picture XOR this
# The end of a picture where no setting states it: in metadata, by the bar and by `wavefront info`
CLEAN_END = (
    f"once it is clean, at a mean error of {CLEAN:.0%} of lit pixels or {DEFAULT_SPP} samples per pixel, "
    f'and denoised; quality="reference" takes {DEFAULT_SPP} and does not denoise'
)
NOISE_END = (
    f"at an error of {LITTLE_NOISE:.0%} or {DEFAULT_SPP} samples per pixel; "
    f'quality="reference" takes {DEFAULT_SPP}'
)
MAX_SPP_FOR_NOISE = 2**16  # where only `noise` was given


class Settings:
    """The settings of a render, checked, and what follows from them.

    Parameters
    ----------
    **given
        Those that were given.

    Attributes
    ----------
    values
        All settings by name, checked.
    max_spp
        The most samples that a pixel may get.
    worker_count
        How many waves are traced at once.
    quick
        Whether the picture ends as soon as it is clean once it is denoised.
    by_itself
        Whether it ends by itself, so or at little noise.

    Raises
    ------
    SceneError
        If one is malformed, or two of them exclude each other.
    """

    quick = by_itself = False

    def __init__(self, **given: Unpack[AllSettings]) -> None:
        self._given: dict[str, Any] = {**given}
        values: Any = {name: setting.default for name, setting in SETTINGS.items()}
        for name, setting in SETTINGS.items():
            if name in given and self._given[name] is not setting.default:
                values[name] = setting.checked(name, self._given[name])
        self.values: AllSettings = values
        if self.values["denoise"]:
            self.values["aovs"] = chosen_aovs("aovs", (*self.values["aovs"], *GUIDES))
        check_combinations(self.values)
        self.max_spp = self._most_samples()
        self.worker_count = worker_count(self.values["workers"], self.values["executor"])
        if not given.keys().isdisjoint(("sampler", "seed")):
            make_sampler(self.values["sampler"], self.values["seed"])
        if self.values["executor"] is not None:
            self.executor_for((0, 0))

    def after(self, first: Mapping[str, Any]) -> Settings:
        """Return these settings after those of a scene, which count where there are none.

        Raises
        ------
        SceneError
            If one of the scene is unknown or malformed, or excludes another.
        """
        for name in first:
            one_of("a setting of the scene", name, SETTINGS)
        chosen = {
            name: value
            for name, value in self._given.items()
            if value is not None or SETTINGS[name].default is not None
        }
        skipped = ("spp",) if chosen.keys() & {"noise", "seconds", "samples"} else ()
        earlier = {name: value for name, value in first.items() if name not in skipped}
        return Settings(**{**earlier, **chosen}) if earlier else self

    def ending(self, chosen_light: bool) -> Settings:
        """Return these settings with an end of the picture, where none of them says it.

        Parameters
        ----------
        chosen_light
            Whether the light of the scene was chosen automatically.
        """
        limits = (self.values[name] for name in ("spp", "noise", "seconds", "samples"))
        if self.values["quality"] != AUTO or any(limit is not None for limit in limits):
            return self
        quick = chosen_light and self.values["denoise"] is not False
        end: AllSettings = {"denoise": True, "noise": CLEAN} if quick else {"noise": LITTLE_NOISE}
        ended = Settings(**{**self._given, **end, "spp": DEFAULT_SPP})
        ended.quick, ended.by_itself = quick, True
        return ended

    @property
    def end(self) -> str | None:
        """How the picture ends by itself, and how to have it otherwise; None where that was asked for."""
        return (CLEAN_END if self.quick else NOISE_END) if self.by_itself else None

    def labels(self) -> dict[str, Any]:
        """Return the settings that renders of the same samples have in common; functions by their names."""
        values: Any = self.values
        return {
            name: _as_in_files(values[name])
            if setting.choices is None
            else setting.choices.label(values[name])
            for name, setting in SETTINGS.items()
            if setting.identity
        }

    @property
    def first_sample(self) -> int:
        """Index of the first sample of every pixel."""
        samples = self.values["samples"]
        return samples.start if isinstance(samples, range) else 0

    @property
    def background_color(self) -> Floats | None:
        """Color of camera rays that miss, (3, 1), black where it is transparent; None: the environment."""
        if self.values["background"] is None:
            return None
        return (
            np.zeros((3, 1), f4)
            if isinstance(self.values["background"], str)
            else np.asarray(self.values["background"], f4)
        )

    @property
    def roulette_after(self) -> float:
        """Scattering events before Russian roulette may end paths; infinite where it may not."""
        roulette = self.values["roulette"]
        return np.inf if roulette is False else roulette

    @property
    def shutter(self) -> Shutter | None:
        """When the shutter is open, and how much light it lets through then; None for one moment."""
        open_, curve = self.values["shutter"], self.values["shutter_curve"]
        return None if open_ is None else Shutter(*open_, SHUTTER_CURVES.find(curve))

    @property
    def sampled_aovs(self) -> tuple[str, ...]:
        """The sampled layers that are asked for; a background gives alpha, a clamp what it removes."""
        wanted = (
            self.values["aovs"]
            if self.values["background"] is None
            else chosen_aovs("aovs", [*self.values["aovs"], "alpha"])
        )
        return (*sampled_names(wanted), *(() if self.values["clamp"] is None else (CLAMPED,)))

    @property
    def target_spp(self) -> int | None:
        """Samples that every pixel gets; None where noise or time decides."""
        return self.max_spp if self.values["noise"] is None and self.values["seconds"] is None else None

    @property
    def is_full(self) -> bool:
        """Whether the integrator is the one whose paths can branch, be guided and be shared."""
        return INTEGRATORS.find(self.values["integrator"]) is li_full

    @property
    def most_branches(self) -> int:
        """The most branches that a path may have."""
        return BRANCHES if isinstance(self.values["branches"], str) else self.values["branches"]

    def training_seed(self, number: int = 0) -> int:
        """Return the seed of the training of a guide, or of a tuning run, whose numbers are their own."""
        return (int(self.values["seed"]) ^ TRAINING) + number

    def executor_for(self, size: tuple[int, int]) -> str | ExecutorLike:
        """Return the executor for a picture of a size (width, height)."""
        branches = self.values["branches"] if isinstance(self.values["branches"], int) else 1
        paths = size[0] * size[1] * self.max_spp * branches
        return choose_executor(self.values["executor"], self.worker_count, paths)

    def _most_samples(self) -> int:
        ways = self.most_branches * (SHARED_WAYS if self.values["reuse"] is True else 1)
        most = min(MAX_TERMS, MAX_BRANCH_SAMPLES // ways)
        samples = self.values["samples"]
        if isinstance(samples, range):
            return self._chosen_samples(samples, most)
        if self.values["spp"] is not None:
            if type(self.values["spp"]) is int and self.values["spp"] == 0:
                direct = 'light that is reflected once at most is integrator="direct_mis"'
                raise SceneError(f"spp is 0; it must be a whole number from 1 to {most}; {direct}")
            return int(whole_number(1, most)("spp", self.values["spp"]))
        if self.values["seconds"] is not None:
            return most
        return DEFAULT_SPP if self.values["noise"] is None else MAX_SPP_FOR_NOISE

    def _chosen_samples(self, samples: range, most: int) -> int:
        if samples.stop > most:
            raise SceneError(f"samples is {samples!r}; it must end at {most} at most")
        return len(samples)


def _as_in_files(value: Any) -> Any:
    """Return a value as it is read from a file: a tuple as a list."""
    return list(value) if isinstance(value, tuple) else value
