"""Checks of settings: of each, and which go together, by a table for checks, messages and documentation."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np

from ..camera import upward
from ..codecs.image_data import TRANSPARENT
from ..colors import rgb
from ..compile.scene import ROULETTE_AFTER
from ..core.errors import SceneError, finite_array, flag, in_brief, number, one_of, warn_caller
from ..core.files import check_target
from ..core.progress import Progress
from ..core.registry import Registry
from ..film.aov_names import flow_names
from ..integrators import INTEGRATORS, li_full
from ..sampling.filters import FILTERS, box
from ..scene.lighting import SHADOW, check_lighting
from ..scene.scene import view_direction

AUTO = "auto"
QUALITIES = (AUTO, "reference")

# called with the name and the value of a setting; returns the value as it is kept
SettingCheck: TypeAlias = Callable[[str, Any], Any]


def one_of_table(choices: Registry[Any]) -> SettingCheck:
    """Return a check that something is a name in a table, or an object of its kind."""

    def check(name: str, value: Any) -> Any:
        choices.find(value, name)
        return value

    return check


def optional(check: SettingCheck) -> SettingCheck:
    """Return a check that lets None pass."""
    return lambda name, value: None if value is None else check(name, value)


def whole_number(low: int, high: int) -> SettingCheck:
    """Return a check for integers from `low` to `high`."""

    def check(name: str, value: Any) -> int:
        whole = isinstance(value, int | np.integer) and not isinstance(value, bool)
        if not whole or not low <= value <= high:
            raise SceneError(f"{name} is {in_brief(value)}; it must be a whole number from {low} to {high}")
        return int(value)

    return check


def auto_or(check: SettingCheck) -> SettingCheck:
    """Return a check that lets "auto" pass."""

    def check_other(name: str, value: Any) -> Any:
        try:
            return value if isinstance(value, str) and value == AUTO else check(name, value)
        except SceneError as error:
            raise SceneError(f"{error}, or {AUTO!r}") from None

    return check_other


def check_ground(name: str, value: Any) -> bool | str:
    """Check that something is True, False or "shadow"."""
    if isinstance(value, str) and value == SHADOW:
        return value
    try:
        return flag(name, value)
    except SceneError as error:
        raise SceneError(f"{error}, or {SHADOW!r}") from None


def above_zero(name: str, value: Any) -> float:
    """Check that a number is positive and finite."""
    return number(name, value, lambda x: x > 0, "above 0")


def check_noise(name: str, value: Any) -> float:
    """Check that a relative error is positive, and warn if it is no less than the picture."""
    error = above_zero(name, value)
    if error >= 1:
        warn_caller(
            f"{name} is {error:g}, a relative error of {100 * error:g} %; {error:g} % is {error / 100:g}"
        )
    return error


def check_quality(name: str, value: Any) -> str:
    """Check that something says when a picture ends."""
    return one_of(name, value, QUALITIES)


def check_progress(name: str, value: Any) -> Progress:
    """Check that something is True, False, None or can be called."""
    if not (value is None or isinstance(value, bool) or callable(value)):
        raise SceneError(f"{name} is {in_brief(value)}; it must be True, False, None or a function")
    return value


def check_samples(name: str, value: Any) -> range | None:
    """Check that something is a range of consecutive numbers from 0 on, or None; n means range(n)."""
    if isinstance(value, int | np.integer) and not isinstance(value, bool) and value > 0:
        return range(int(value))
    if value is None:
        return None
    if not isinstance(value, range) or value.step != 1 or not value or value.start < 0:
        raise SceneError(
            f"{name} is {in_brief(value)}; it must be a range of consecutive samples, "
            "such as range(64, 128); spp is their number"
        )
    return value


def check_background(name: str, value: Any) -> Any:
    """Check a background: "transparent", or a color, which becomes (3, 1)."""
    if value is None or (isinstance(value, str) and value == TRANSPARENT):
        return value
    try:
        return rgb(name, value)
    except SceneError as error:
        raise SceneError(f"{error}, or {TRANSPARENT!r}" if isinstance(value, str) else f"{error}") from None


def check_roulette(name: str, value: Any) -> int | bool:
    """Check that something is False, or how many scattering events roulette spares."""
    if isinstance(value, bool | np.bool_):
        if value:
            raise SceneError(
                f"{name} is True; it must be False or a whole number, by default {ROULETTE_AFTER}"
            )
        return False
    try:
        return int(whole_number(0, 2**16)(name, value))
    except SceneError as error:
        raise SceneError(f"{error}, or False") from None


def check_flow_times(name: str, value: Any) -> tuple[float, float] | None:
    """Check that something is two times, or None."""
    if value is None:
        return None
    before, after = finite_array(name, value, (2,)).tolist()
    return before, after


def check_view(name: str, value: Any) -> Any:
    """Check the name of a view, or a direction."""
    view_direction(name, value)
    return value


def check_up(name: str, value: Any) -> Any:
    """Check an up axis: a vector, the name of an axis, or "auto"."""
    return value if isinstance(value, str) and value == AUTO else upward(name, value)


def check_checkpoint(name: str, value: Any) -> str | None:
    """Check that a checkpoint can be written to a path, or that there is none."""
    if value is None:
        return None
    if not isinstance(value, str | os.PathLike):
        raise SceneError(f"{name} is {value!r}; it must be a path, such as 'out.wfck'")
    return str(check_target(value))


def check_preset(name: str, value: Any) -> str | None:
    """Check the name of a preset."""
    check_lighting(value)
    return value


def refuse(settings: Mapping[str, Any], reasons: Mapping[str, str]) -> None:
    """Check that settings are not among those that were given, and say why they must not be.

    Raises
    ------
    SceneError
        If one is.
    """
    for name, why in reasons.items():
        if settings.get(name) is not None:
            raise SceneError(f"{name} is {in_brief(settings[name])}; {why}")


@dataclass(frozen=True)
class Exclusion:
    """Two settings that do not go together."""

    one: str
    other: str
    why: str
    refused: bool = True  # False: only "auto" leaves `one` out where `other` is asked for


ONE_PATH = "light of shared paths comes from many paths at once"
ANY_PIXEL = "paths from lights reach any pixel"
ONLY_FULL = "only the paths of integrator='full' go on from surface to surface with light samples"
MEDIA = "media that scatter"  # or emit, or vary: known of a scene once it is compiled
MOVING_IN_TURN = "a rolling shutter where shapes or lights move"  # likewise
ROLLING = "a camera with a rolling shutter"  # likewise
GIVEN = "samples are given by their numbers"
EXCLUSIONS = (
    Exclusion("reuse", "clamp", f"a clamp limits what one path finds, and {ONE_PATH}"),
    Exclusion("reuse", "caustics", "the tuning run does not see the noise of paths from lights", False),
    Exclusion("reuse", "branches", "paths that go on in several ways gain less from being shared", False),
    Exclusion("caustics", "filter", f"{ANY_PIXEL}, and filters draw points but cannot be evaluated at those"),
    Exclusion("caustics", "light groups", f"{ANY_PIXEL}, and AOVs are sums of the pixel's own paths"),
    Exclusion("caustics", "features", "paths from lights do not meet these"),
    Exclusion("reuse", "features", f"these may change what one path finds, and {ONE_PATH}"),
    Exclusion("guide", "another integrator", ONLY_FULL),
    Exclusion("reuse", "another integrator", ONLY_FULL),
    Exclusion("caustics", "another integrator", ONLY_FULL),
    Exclusion("branches", "another integrator", ONLY_FULL),
    Exclusion("reuse", MEDIA, "points within media are not shared"),
    Exclusion("caustics", MEDIA, "paths from lights do not follow them"),
    Exclusion("reuse", MOVING_IN_TURN, "pixels that share paths must see the scene at one time"),
    Exclusion("caustics", ROLLING, "a path from a light has a time before it is known which row it reaches"),
    Exclusion("view", "camera", "a view is framed by a camera of its own"),
    Exclusion("fov", "camera", "a camera has a field of view of its own"),
    Exclusion("scalars", "material", "both say what the surface looks like"),
    Exclusion("samples", "spp", GIVEN),
    Exclusion("samples", "noise", f"{GIVEN}, and noise decides how many there are"),
    Exclusion("samples", "seconds", f"{GIVEN}, and the time decides how many there are"),
)

# When a setting is asked for, given all settings; others are asked for where they are not None.
ASKED: dict[str, Callable[[Mapping[str, Any]], bool]] = {
    "reuse": lambda values: values["reuse"] is True,
    "guide": lambda values: values["guide"] is True,
    "caustics": lambda values: values["caustics"],
    "branches": lambda values: values["branches"] not in (1, AUTO),
    "features": lambda values: bool(values["features"]),
    MEDIA: lambda values: bool(values.get(MEDIA)),
    MOVING_IN_TURN: lambda values: bool(values.get(MOVING_IN_TURN)),
    ROLLING: lambda values: bool(values.get(ROLLING)),
    "filter": lambda values: FILTERS.find(values["filter"]) is not box,
    "light groups": lambda values: "light_groups" in values["aovs"],
    "another integrator": lambda values: INTEGRATORS.find(values["integrator"]) is not li_full,
}
SETTING_OF = {"light groups": "aovs", "another integrator": "integrator"}
SHOWN: dict[str, Callable[[Any], object]] = {
    "aovs": lambda value: "light_groups",
    "filter": FILTERS.label,
    "integrator": INTEGRATORS.label,
}


def asked_for(values: Mapping[str, Any], name: str) -> bool:
    """Return whether something of the table is asked for."""
    return ASKED[name](values) if name in ASKED else values[name] is not None


def check_combinations(values: Mapping[str, Any]) -> None:
    """Check that settings, each of which is valid by itself, go together.

    Raises
    ------
    SceneError
        If two of them exclude each other. The message has both, and why.
    """
    flows = flow_names(values["aovs"])
    if flows and values["flow_times"] is None:
        raise SceneError(
            f"aovs has {flows[0]!r}; it needs flow_times=(before, after), times of other pictures, seconds"
        )
    for rule in EXCLUSIONS:
        if rule.refused and asked_for(values, rule.one) and asked_for(values, rule.other):
            pair = " does not go with ".join(_in_words(values, name) for name in (rule.one, rule.other))
            raise SceneError(f"{pair}: {rule.why}")


def left_out(values: Mapping[str, Any], name: str) -> bool:
    """Return whether "auto" must leave a setting out, because of other settings."""
    return any(rule.one == name and asked_for(values, rule.other) for rule in _both_ways())


def _both_ways() -> Iterator[Exclusion]:
    """Yield the exclusions, those that are refused also with their sides exchanged."""
    for rule in EXCLUSIONS:
        yield rule
        if rule.refused:
            yield Exclusion(rule.other, rule.one, rule.why)


def _in_words(values: Mapping[str, Any], name: str) -> str:
    if name in (MEDIA, MOVING_IN_TURN, ROLLING):
        return name
    setting = SETTING_OF.get(name, name)
    return f"{setting}={in_brief(SHOWN.get(setting, lambda value: value)(values[setting]))}"


def exclusions_of(name: str) -> str:
    """Return the sentences about the settings that do not go with one, for its documentation; "" if none."""
    refused = [rule.other for rule in _both_ways() if rule.refused and rule.one == name]
    unchosen = [rule.other for rule in EXCLUSIONS if not rule.refused and rule.one == name]
    return "".join(
        f" {sentence} {_listed(others)}."
        for sentence, others in (("Not with", refused), ('"auto" leaves it out with', unchosen))
        if others
    )


def _listed(names: Sequence[str]) -> str:
    """Return names of the table as a list in words."""
    words = [name if " " in name else f"`{name}`" for name in names]
    return " or ".join([*filter(None, [", ".join(words[:-1])]), words[-1]])


def table() -> str:
    """Return the table as Markdown: docs/choices.md has it."""
    rows = []
    for rule in EXCLUSIONS:
        what = "refused" if rule.refused else 'left out by "auto"'
        rows.append(f"| {rule.one} | {rule.other} | {what} | {rule.why} |")
    return "\n".join(["| | with | | why |", "|---|---|---|---|", *rows])
