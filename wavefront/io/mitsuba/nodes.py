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
from ..description.conversion import Conversion, Part
from ..description.placing import in_range
from ..losses import Losses
from ..xml_checks import MAX_DEPTH

COLORS = ("reflectance", "diffuse_reflectance", "base_color", "color", "albedo", "specular_reflectance")
PATHS = ("max_depth", "rr_depth", "hide_emitters")  # parameters of integrators
SIZE = ("width", "height", "crop_width", "crop_height", "crop_offset_x", "crop_offset_y", "rfilter")
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
    def kind(self) -> str:  # type: ignore[override]
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
        return self.or_default(default, lambda: str(one_of(name, self.text(name, default).lower(), choices)))

    def matrix(self, name: str = "to_world") -> Matrix:
        """Return a transform, (4, 4)."""
        return self.or_default(np.eye(4), lambda: self._matrix(name))

    def _matrix(self, name: str) -> Matrix:
        value = self.get(name, np.eye(4))
        matrix = finite_array(name, getattr(value, "matrix", value), (4, 4))
        if not np.array_equal(matrix[3], [0, 0, 0, 1]):
            if matrix[3, :3].any() or not matrix[3, 3] > 0:
                raise SceneError(f"{name} has the last row {matrix[3].tolist()}; it must be [0, 0, 0, 1]")
            self.lost.note(f"{name} has the last row", self.label, str(matrix[3].tolist()), "divided by it")
            matrix = matrix / matrix[3, 3]
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

    def stand_in(self, node: Node) -> tuple[Callable[[], Any], str]:
        """Return the bsdf that a damaged bsdf holds, or what the kind of a plugin has."""
        held = node.held("bsdf") if node.kind == "bsdf" else []
        if held and held[0] not in self.making:
            return lambda: self.convert(held[0]), "the bsdf in it in its place"
        return super().stand_in(node)

    def converted(self, node: Node) -> Any:
        """Return what becomes of a plugin."""
        entry = PLUGINS[node.plugin]
        if entry.convert is None:
            return self.replaced(node, entry.kind)
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
    version
        What is said of the version of its file.
    """

    def __init__(self, name: str, lost: Losses, version: str = "") -> None:
        self._name, self._lost, self._version = name, lost, version
        self._ids: dict[str, Mapping[str, Any]] = {}
        self._nodes: dict[int, Node] = {}
        self._seen: set[int] = set()
        self._kept: dict[int, tuple[Mapping[str, Any], Any]] = {}  # in place of plugins that are unknown

    def build(self, scene: Any) -> Node:
        """Return the node of a scene; plugins that are unknown or damaged are replaced or left out.

        Raises
        ------
        SceneError
            If it is no dictionary of a scene, or too large.
        """
        if not isinstance(scene, Mapping) or f"{scene.get('type')}" != "scene":
            raise SceneError(f'{self._name}: is {in_brief(scene)}; it must be a dictionary of type "scene"')
        self._register(scene, "", 0)
        return self._node(scene, self._name, "", ())

    def _register(self, source: Mapping[str, Any], key: str, depth: int) -> None:
        """Note the ids of all plugins; of those that are used twice, the first one counts."""
        if depth > MAX_DEPTH:
            raise LimitError(f"{self._name}: its plugins are nested deeper than {MAX_DEPTH}")
        if id(source) in self._seen:
            return
        self._seen.add(id(source))
        own = source.get("id", key if depth == 1 else "")
        named = isinstance(own, str) and own and f"{source.get('type')}" != "ref"
        if named and self._ids.setdefault(own, source) is not source:
            place = getattr(source, "place", "") or self._name
            self._lost.note(f"the id {own!r} is used twice", place, done="the first one counts")
        for name, value in source.items():
            if isinstance(value, Mapping):
                self._register(value, "" if _unnamed(name) else name, depth + 1)

    def _node(self, source: Mapping[str, Any], path: str, key: str, above: tuple[int, ...]) -> Node:
        place = getattr(source, "place", "") or path
        source = self._known(self._target(source, place), place)
        if id(source) in above:
            raise SceneError(f"{place}: {source.get('id', key)!r} contains itself")
        if id(source) in self._nodes:
            return self._nodes[id(source)]
        if len(above) > MAX_DEPTH:
            raise LimitError(f"{place}: plugins refer to each other over more than {MAX_DEPTH} levels")
        kind: str = source["type"]
        own = source.get("id", key)
        own = own if isinstance(own, str) else ""
        label = f"{place}: {kind}" if place != path else f"{path} ({kind})"
        label += f" {own!r}" if own and (place != path or "id" in source) else ""
        node = Node(kind, own, label, {}, self._lost)
        for name, value in source.items():
            if name in ("type", "id"):
                continue
            if not isinstance(value, Mapping):
                node.values[str(name)] = value
                continue
            with self._lost.part(label):
                inner = "" if _unnamed(name) else str(name)
                child = self._node(value, f"{path}, {name}", inner, (*above, id(source)))
                node.size += child.size
                node.values[str(name)] = child
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
            kind = source.get("type")
            if not isinstance(kind, str) or kind != "ref":
                return source
            name = source.get("id")
            if not isinstance(name, str) or name not in self._ids:
                hint = did_you_mean(name, self._ids) if isinstance(name, str) else ""
                raise SceneError(f"{place}: refers to the id {in_brief(name)}, which there is not{hint}")
            source = self._ids[name]
        raise SceneError(f"{place}: references lead to each other")

    def _known(self, source: Mapping[str, Any], place: str) -> Mapping[str, Any]:
        """Return a plugin; in place of one that is unknown, what is known of it.

        Raises
        ------
        SceneError
            If that is nothing.
        """
        kind, kept = source.get("type"), id(source)
        if isinstance(kind, str) and kind in PLUGINS:
            return source
        if kept not in self._kept:
            hint = did_you_mean(kind, PLUGINS) if isinstance(kind, str) else ""
            what = f"there is no plugin {in_brief(kind)}{self._version}{hint}"
            self._kept[kept] = {"type": "diffuse"}, source  # where it holds itself
            made = self._substitute(source)
            made = None if made is None else self._known(made, place)
            if made is None:
                del self._kept[kept]
                raise SceneError(f"{place}: {what}")
            self._lost.note(what, place, done=f"a {made['type']} in its place")
            self._kept[kept] = made, source
        return self._kept[kept][0]

    def _substitute(self, source: Mapping[str, Any]) -> Mapping[str, Any] | None:
        """Return a plugin that keeps what it can of an unknown one."""
        held: list[Mapping[str, Any]] = [
            self._ids.get(str(value.get("id")), value) if f"{value.get('type')}" == "ref" else value
            for value in source.values()
            if isinstance(value, Mapping)
        ]
        known = [_kind(each) for each in held]
        color = next((source[name] for name in COLORS if name in source), None)
        tag = getattr(source, "tag", "")
        if tag in ("", "integrator") and "integrator" in known:
            return held[known.index("integrator")]
        if tag == "integrator":
            return {"type": "path"} | {name: source[name] for name in PATHS if name in source}
        if tag in ("", "bsdf") and "bsdf" in known:
            return held[known.index("bsdf")]
        if tag == "bsdf" or (not tag and color is not None):
            return {"type": "diffuse"} | ({} if color is None else {"reflectance": color})
        return (
            {"type": "hdrfilm"} | {name: source[name] for name in SIZE if name in source}
            if tag == "film"
            else None
        )


def _kind(source: Mapping[str, Any]) -> str:
    """Return the kind of a plugin, of one that is unknown by its element."""
    kind = source.get("type")
    return PLUGINS[kind].kind if isinstance(kind, str) and kind in PLUGINS else getattr(source, "tag", "")


def _unnamed(name: Any) -> bool:
    return not isinstance(name, str) or name.startswith("_arg_")
