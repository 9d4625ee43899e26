"""Which settings go together: one table, from which checks, messages and documentation come."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ..core.errors import SceneError, in_brief
from ..integrators import INTEGRATORS, li_full
from ..sampling.filters import FILTERS, box
from .checks import AUTO


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
GIVEN = "samples are given by their numbers"
EXCLUSIONS = (
    Exclusion("reuse", "clamp", f"a clamp limits what one path finds, and {ONE_PATH}"),
    Exclusion("reuse", "caustics", "the tuning run does not see the noise of paths from lights", False),
    Exclusion("reuse", "branches", "paths that go on in several ways gain less from being shared", False),
    Exclusion("caustics", "filter", f"{ANY_PIXEL}, and filters draw points but cannot be evaluated at those"),
    Exclusion("caustics", "light groups", f"{ANY_PIXEL}, and AOVs are sums of the pixel's own paths"),
    Exclusion("guide", "another integrator", ONLY_FULL),
    Exclusion("reuse", "another integrator", ONLY_FULL),
    Exclusion("caustics", "another integrator", ONLY_FULL),
    Exclusion("branches", "another integrator", ONLY_FULL),
    Exclusion("reuse", MEDIA, "points within media are not shared"),
    Exclusion("caustics", MEDIA, "paths from lights do not follow them"),
    Exclusion("view", "camera", "a view is framed by a camera of its own"),
    Exclusion("fov", "camera", "a camera has a field of view of its own"),
    Exclusion("scalars", "material", "both say what the surface looks like"),
    Exclusion("samples", "spp", GIVEN),
    Exclusion("samples", "noise", f"{GIVEN}, and noise decides how many there are"),
    Exclusion("samples", "seconds", f"{GIVEN}, and the time decides how many there are"),
)

# When something is asked for, given all settings; what is not here is asked for where it is not None.
ASKED: dict[str, Callable[[Mapping[str, Any]], bool]] = {
    "reuse": lambda values: values["reuse"] is True,
    "guide": lambda values: values["guide"] is True,
    "caustics": lambda values: values["caustics"],
    "branches": lambda values: values["branches"] not in (1, AUTO),
    MEDIA: lambda values: bool(values.get(MEDIA)),
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
    for each in EXCLUSIONS:
        if each.refused and asked_for(values, each.one) and asked_for(values, each.other):
            pair = " does not go with ".join(_in_words(values, name) for name in (each.one, each.other))
            raise SceneError(f"{pair}: {each.why}")


def left_out(values: Mapping[str, Any], name: str) -> bool:
    """Return whether "auto" must leave a setting out, because of what is asked for."""
    return any(each.one == name and asked_for(values, each.other) for each in _both_ways())


def _both_ways() -> Iterator[Exclusion]:
    """Yield the exclusions, those that are refused also with their sides exchanged."""
    for each in EXCLUSIONS:
        yield each
        if each.refused:
            yield Exclusion(each.other, each.one, each.why)


def _in_words(values: Mapping[str, Any], name: str) -> str:
    if name == MEDIA:
        return name
    setting = SETTING_OF.get(name, name)
    return f"{setting}={in_brief(SHOWN.get(setting, lambda value: value)(values[setting]))}"


def told(name: str) -> str:
    """Return what the documentation of a setting says of those that do not go with it; nothing is ""."""
    refused = [each.other for each in _both_ways() if each.refused and each.one == name]
    unchosen = [each.other for each in EXCLUSIONS if not each.refused and each.one == name]
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
    for each in EXCLUSIONS:
        what = "refused" if each.refused else 'left out by "auto"'
        rows.append(f"| {each.one} | {each.other} | {what} | {each.why} |")
    return "\n".join(["| | with | | why |", "|---|---|---|---|", *rows])
