"""The stages that run in a render, and the features that act between them, as a list to read."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from inspect import getdoc
from types import FunctionType
from typing import Any

from ..compile.program import Feature, Program, acts
from ..stages.accumulate import accumulate
from ..stages.bounce import bounce_sample
from ..stages.compact import compact, roulette
from ..stages.generate import generate
from ..stages.interaction import interaction
from ..stages.intersect import intersect
from ..stages.shade import direct, emitted, mis_weighted, shading

# Stages in the order in which they run, and the points of features after each.
ORDER: tuple[tuple[Callable[..., Any], tuple[str, ...]], ...] = (
    (generate, ("expose", "begin")),
    (intersect, ("surfaces", "passable", "walk", "fly")),
    (emitted, ("meet",)),
    (mis_weighted, ()),
    (accumulate, ()),
    (compact, ()),
    (interaction, ("tilt", "weaken")),
    (shading, ("shading",)),
    (direct, ("dim",)),
    (bounce_sample, ("ways",)),
    (roulette, ()),
)
ROOM = __name__.partition(".")[0] + "."


@dataclass(frozen=True)
class ListedStage:
    """A stage, or a feature that acts after it at a point."""

    name: str
    file: str  # within the package, or the module of a user
    sentence: str  # its summary
    point: str = ""  # of a feature
    camera_only: bool = False


@dataclass(frozen=True)
class StageList:
    """The result of `wf.program`: print it, or go through its `stages`."""

    integrator: str
    stages: tuple[ListedStage, ...]

    def __iter__(self) -> Iterator[ListedStage]:
        """Go through the stages and features."""
        return iter(self.stages)

    def __str__(self) -> str:
        """Return a line for each, those of features indented."""
        rows = [("", f"integrator {self.integrator}", "")]
        for stage in self.stages:
            only = " (Camera rays only.)" if stage.camera_only else ""
            name = f"  + {stage.name}.{stage.point}" if stage.point else stage.name
            rows.append((name, stage.sentence + only, stage.file))
        wide, long = max(len(row[0]) for row in rows), max(len(row[2]) for row in rows)
        return "\n".join(f"{name:{wide}}  {file:{long}}  {text}".rstrip() for name, text, file in rows[1:])


def list_stages(integrator: Callable[..., Any], program: Program, mis: bool = True) -> StageList:
    """Return the stages that an integrator runs, with the features of a program.

    Parameters
    ----------
    integrator
        One of this package or of a user: its code and that of the functions that it calls are looked at.
    program
        Of the scene and view.
    mis
        Whether light that paths meet is weighted against light samples.
    """
    used = _called(integrator, set()) | {generate}
    rows: list[ListedStage] = []
    for stage, points in ORDER:
        if stage in used and (mis or stage is not mis_weighted):
            rows.append(ListedStage(stage.__name__, _file(stage), _sentence(stage)))
            rows += [_row(feature, point) for point in points for feature in _acting(program.features, point)]
    return StageList(getattr(integrator, "__name__", repr(integrator)), tuple(rows))


def _row(feature: Feature, point: str) -> ListedStage:
    kind = type(feature)
    return ListedStage(kind.__name__, _file(kind), _sentence(kind), point, feature.camera_only)


def _acting(features: Sequence[Feature], point: str) -> list[Feature]:
    """Return the features that act at a point, or that have an attribute of its name."""
    if callable(getattr(Feature, point)):
        return [feature for feature in features if acts(feature, point)]
    return [feature for feature in features if getattr(feature, point) != getattr(Feature, point)]


def _called(function: Any, seen: set[Any]) -> set[Any]:
    """Return a function and all that it calls, directly or not."""
    if not isinstance(function, FunctionType) or function in seen:
        return seen
    seen.add(function)
    for name in function.__code__.co_names:
        called = function.__globals__.get(name)
        if isinstance(called, FunctionType) and called.__module__.startswith(ROOM):
            _called(called, seen)
    return seen


def _file(thing: Any) -> str:
    """Return the file of a function or class, within the package; the name of another module."""
    module: str = thing.__module__
    return module.removeprefix(ROOM).replace(".", "/") + ".py" if module.startswith(ROOM) else module


def _sentence(thing: Any) -> str:
    return (getdoc(thing) or "").split("\n\n")[0].replace("\n", " ")
