"""Plugins of a scene: their parameters, and the table of those that are converted."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np

from ...arrays.vec import Doubles
from ...core.errors import LimitError, SceneError, finite_array, in_brief, one_of
from ...core.suggestions import did_you_mean
from ...shapes.transform import Matrix
from ..conversion import Conversion, Part
from ..losses import Losses
from ..placing import in_range
from ..xml_checks import MAX_DEPTH

MOST_PARTS = 4096  # plugins that a plugin is made of, each counted as often as it is referred to


@dataclass(frozen=True)
class Plugin:
    """A plugin: how it is converted, and which of its parameters count."""

    kind: str  # "shape", "bsdf", ...
    convert: Callable[[Node, Job], Any] | None  # None: it is not supported
    reads: tuple[str, ...] = ()  # parameters that are read
    holds: tuple[str, ...] = ()  # kinds of plugins in it that are read, whatever their names
    harmless: tuple[str, ...] = ()  # parameters that do not change the picture
    note: str = ""  # what is different, for the documentation


PLUGINS: dict[str, Plugin] = {}
COMMON = {  # parameters of all plugins of a kind that do not change the picture
    "emitter": ("sampling_weight",),
    "shape": ("silhouette_sampling_weight",),
    "integrator": ("timeout", "block_size", "samples_per_pass"),
    "sensor": ("shutter_open", "shutter_close"),
}
C = TypeVar("C", bound=Callable[..., Any])


def plugin(
    names: str, kind: str, reads: str = "", holds: str = "", harmless: str = "", note: str = ""
) -> Callable[[C], C]:
    """Put a function that converts plugins into the table; each argument is a list of words."""

    def add(convert: C) -> C:
        ignored = (*harmless.split(), *COMMON.get(kind, ()))
        for name in names.split():
            PLUGINS[name] = Plugin(kind, convert, tuple(reads.split()), tuple(holds.split()), ignored, note)
        return convert

    return add


def unsupported(names: str, kind: str) -> None:
    """Put plugins into the table that Mitsuba has, and that are not supported."""
    PLUGINS.update({name: Plugin(kind, None) for name in names.split()})


@dataclass(eq=False)
class Node(Part):
    """A plugin of a scene with its parameters."""

    plugin: str
    id: str
    label: str  # where it is, and what, for messages
    values: dict[str, Any]
    lost: Losses  # of all plugins
    size: int = 1  # plugins in it

    @property
    def kind(self) -> str:
        """What it is: a shape, a bsdf, ..."""
        return PLUGINS[self.plugin].kind

    def lose(self, what: str) -> None:
        """Note something that is not honored."""
        self.lost.note(what, self.label)

    def get(self, name: str, default: Any = None) -> Any:
        """Return a parameter, which the table must say is read."""
        if name not in PLUGINS[self.plugin].reads:
            raise KeyError(f"{self.plugin} does not read {name}")
        return self.values.get(name, default)

    def one(self, name: str, default: Any, *types: str) -> Any:
        """Return a parameter; the format has no types."""
        return self.get(name, default)

    def choice(self, name: str, default: str, choices: tuple[str, ...]) -> str:
        """Return one of some strings, in small letters."""
        return str(one_of(name, self.text(name, default).lower(), choices))

    def matrix(self, name: str = "to_world") -> Matrix:
        """Return a transform, (4, 4)."""
        value = self.get(name, np.eye(4))
        matrix = finite_array(name, getattr(value, "matrix", value), (4, 4))
        if not np.array_equal(matrix[3], [0, 0, 0, 1]):
            raise SceneError(f"{name} has the last row {matrix[3].tolist()}; it must be [0, 0, 0, 1]")
        if not in_range(matrix[None])[0]:
            raise SceneError(f"{name} has an element of size {np.abs(matrix).max():g}, which is too large")
        return matrix

    def held(self, kind: str) -> list[Node]:
        """Return the plugins of a kind that it holds."""
        return [value for value in self.values.values() if isinstance(value, Node) and value.kind == kind]


@dataclass
class Job(Conversion[Node]):
    """The conversion of one scene."""

    eye: Doubles | None = None  # where the camera stands
    sees_media: bool = True  # whether the integrator does
    hides_lamps: bool = False  # whether it hides shapes that emit from the camera

    def check(self, node: Node) -> None:
        """Note the parameters of a plugin that are not read."""
        entry = PLUGINS[node.plugin]
        for name, value in node.values.items():
            if name not in entry.reads and name not in entry.harmless:
                if not isinstance(value, Node):
                    node.lose(name)
                elif value.kind not in entry.holds:
                    node.lose(f"{value.kind} {name!r}")

    def only(self, node: Node, kind: str) -> Node:
        """Return the first plugin of a kind that a plugin must hold."""
        held = node.held(kind)
        if not held:
            raise SceneError(f"{node.label} holds no {kind}")
        return held[0]

    def converted(self, node: Node) -> Any:
        """Return what becomes of a plugin."""
        entry = PLUGINS[node.plugin]
        if entry.convert is None:
            return self.instead(node, entry.kind)
        self.check(node)
        return entry.convert(node, self)


class Graph:
    """Builds nodes from a dictionary: those that are referred to several times once.

    Parameters
    ----------
    name
        What the dictionary is called in messages.
    lost
        As of `Node`.
    """

    def __init__(self, name: str, lost: Losses) -> None:
        self._name, self._lost = name, lost
        self._ids: dict[str, Mapping[str, Any]] = {}
        self._nodes: dict[int, Node] = {}
        self._seen: set[int] = set()

    def build(self, scene: Any) -> Node:
        """Return the node of a scene.

        Raises
        ------
        SceneError
            If it is no dictionary of a scene, names an unknown plugin, refers to nothing, or contains itself.
        """
        if not isinstance(scene, Mapping) or f"{scene.get('type')}" != "scene":
            raise SceneError(f'{self._name}: is {in_brief(scene)}; it must be a dictionary of type "scene"')
        self._register(scene, "", 0)
        return self._node(scene, self._name, "", ())

    def _register(self, source: Mapping[str, Any], key: str, depth: int) -> None:
        """Note the ids of all plugins."""
        if depth > MAX_DEPTH:
            raise SceneError(f"{self._name}: its plugins are nested deeper than {MAX_DEPTH}")
        if id(source) in self._seen:
            return
        self._seen.add(id(source))
        if not all(isinstance(name, str) for name in (*source, source.get("id", ""))):
            raise SceneError(
                f"{self._name}: names of parameters, and ids, must be strings: {in_brief(source)}"
            )
        if not isinstance(source.get("type"), str):
            raise SceneError(f"{self._name}: there is no plugin {in_brief(source.get('type'))}, of {key!r}")
        own = source.get("id", key if depth == 1 else "")
        if source.get("type") != "ref" and own and self._ids.setdefault(own, source) is not source:
            place = getattr(source, "place", "") or self._name
            raise SceneError(f"{place}: the id {own!r} is used twice")
        for name, value in source.items():
            if isinstance(value, Mapping):
                self._register(value, "" if name.startswith("_arg_") else name, depth + 1)

    def _node(self, source: Mapping[str, Any], path: str, key: str, above: tuple[int, ...]) -> Node:
        place = getattr(source, "place", "") or path
        source = self._target(source, place)
        if id(source) in above:
            raise SceneError(f"{place}: {source.get('id', key)!r} contains itself")
        if id(source) in self._nodes:
            return self._nodes[id(source)]
        if len(above) > MAX_DEPTH:
            raise SceneError(f"{place}: plugins refer to each other over more than {MAX_DEPTH} levels")
        kind: str = source["type"]
        if kind not in PLUGINS:
            raise SceneError(f"{place}: there is no plugin {in_brief(kind)}{did_you_mean(kind, PLUGINS)}")
        own = source.get("id", key)
        label = f"{place}: {kind}" if place != path else f"{path} ({kind})"
        label += f" {own!r}" if own and (place != path or "id" in source) else ""
        node = Node(kind, own, label, {}, self._lost)
        for name, value in source.items():
            if name in ("type", "id"):
                continue
            if isinstance(value, Mapping):
                inner = "" if name.startswith("_arg_") else name
                child = self._node(value, f"{path}, {name}", inner, (*above, id(source)))
                node.size += child.size
                value = child
            node.values[name] = value
        if node.size > MOST_PARTS and kind != "scene":
            raise LimitError(
                f"{label}: stands for {node.size} plugins, as they refer to each other; "
                f"the limit is {MOST_PARTS}"
            )
        self._nodes[id(source)] = node
        return node

    def _target(self, source: Mapping[str, Any], place: str) -> Mapping[str, Any]:
        """Return what a reference leads to; anything else as it is."""
        for _ in range(MAX_DEPTH):
            if source.get("type") != "ref":
                return source
            name = source.get("id")
            if not isinstance(name, str) or name not in self._ids:
                hint = did_you_mean(name, self._ids) if isinstance(name, str) else ""
                raise SceneError(f"{place}: refers to the id {in_brief(name)}, which there is not{hint}")
            source = self._ids[name]
        raise SceneError(f"{place}: references lead to each other")
