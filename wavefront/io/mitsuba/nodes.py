"""Plugins of a scene, and the table of those that are converted."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from ...arrays.vec import Doubles
from ...core.errors import LimitError, SceneError, in_brief
from ...core.suggestions import did_you_mean
from ..description.conversion import Conversion
from ..description.entity import C, Entity, Table
from ..xml_checks import MAX_DEPTH

COLORS = ("reflectance", "diffuse_reflectance", "base_color", "color", "albedo", "specular_reflectance")
PATHS = ("max_depth", "rr_depth", "hide_emitters")  # parameters of integrators
SIZE = ("width", "height", "crop_width", "crop_height", "crop_offset_x", "crop_offset_y", "rfilter")
MOST_PARTS = 4096  # plugins that a plugin is made of, each counted as often as it is referred to


TABLE = Table(
    "Mitsuba",
    harmless={
        "emitter": "sampling_weight",
        "shape": "silhouette_sampling_weight",
        "integrator": "timeout block_size samples_per_pass",
        "sensor": "shutter_open shutter_close",
    },
)
unsupported = TABLE.unsupported


def plugin(
    names: str, kind: str, reads: str = "", holds: str = "", harmless: str = "", note: str = ""
) -> Callable[[C], C]:
    """Put a function that converts plugins into the table, with the names of their parameters."""
    return TABLE.converts(kind, names, reads, holds, harmless, note)


@dataclass
class Job(Conversion):
    """The conversion of one scene."""

    table = TABLE
    eye: Doubles | None = None  # where the camera stands
    sees_media: bool = True  # whether the integrator does
    hides_lamps: bool = False  # whether it hides shapes that emit from the camera

    def stand_in(self, entity: Entity) -> tuple[Callable[[], Any], str]:
        """Return the bsdf that a damaged bsdf holds, or the replacement of the plugin's kind."""
        bsdfs = entity.children("bsdf") if entity.kind == "bsdf" else []
        if bsdfs and bsdfs[0] not in self.making:
            return lambda: self.convert(bsdfs[0]), "the bsdf in it in its place"
        return super().stand_in(entity)


class Graph:
    """Builds nodes from a dictionary: one for each plugin, however many references it has.

    Parameters
    ----------
    name
        Name of the dictionary, for messages.
    job
        The conversion of its plugins.
    version
        Words on the version of its file, for messages.
    """

    def __init__(self, name: str, job: Job, version: str = "") -> None:
        self._name, self._job, self._version = name, job, version
        self._lost = job.files.losses
        self._ids: dict[str, Mapping[str, Any]] = {}
        self._nodes: dict[int, Entity] = {}
        self._seen: set[int] = set()
        self._kept: dict[int, tuple[Mapping[str, Any], Any]] = {}  # in place of plugins that are unknown

    def build(self, scene: Any) -> Entity:
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
        identity = source.get("id", key if depth == 1 else "")
        named = isinstance(identity, str) and identity and f"{source.get('type')}" != "ref"
        if named and self._ids.setdefault(identity, source) is not source:
            place = getattr(source, "place", "") or self._name
            self._lost.note(f"the id {identity!r} is used twice", place, done="the first one counts")
        for name, value in source.items():
            if isinstance(value, Mapping):
                self._register(value, "" if _unnamed(name) else name, depth + 1)

    def _node(self, source: Mapping[str, Any], path: str, key: str, above: tuple[int, ...]) -> Entity:
        place = getattr(source, "place", "") or path
        source = self._known(self._target(source, place), place)
        if id(source) in above:
            raise SceneError(f"{place}: {source.get('id', key)!r} contains itself")
        if id(source) in self._nodes:
            return self._nodes[id(source)]
        if len(above) > MAX_DEPTH:
            raise LimitError(f"{place}: plugins refer to each other over more than {MAX_DEPTH} levels")
        node = self._nodes[id(source)] = self._entity(source, place, path, key, (*above, id(source)))
        return node

    def _entity(
        self, source: Mapping[str, Any], place: str, path: str, key: str, above: tuple[int, ...]
    ) -> Entity:
        """Return a plugin that is no reference, with all that it holds."""
        kind: str = source["type"]  # as it is called in messages
        identity = source.get("id", key)
        identity = identity if isinstance(identity, str) else ""
        label = f"{place}: {kind}" if place != path else f"{path} ({kind})"
        label += f" {identity!r}" if identity and (place != path or "id" in source) else ""
        node = Entity(TABLE.kinds[kind], kind, identity, label, {}, self._job)
        for name, value in source.items():
            if name in ("type", "id"):
                continue
            if not isinstance(value, Mapping):
                node.values[str(name)] = value
                continue
            with self._lost.part(label):
                child = self._node(value, f"{path}, {name}", "" if _unnamed(name) else str(name), above)
                node.size += child.size
                node.values[str(name)] = child
        if node.size > MOST_PARTS and kind != "scene":
            raise LimitError(
                f"{label}: stands for {node.size} plugins, as they refer to each other; "
                f"the limit is {MOST_PARTS}"
            )
        node.unread.update(node.values)
        return node

    def _target(self, source: Mapping[str, Any], place: str) -> Mapping[str, Any]:
        """Return the plugin that a reference leads to; any other plugin as it is."""
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
        """Return a plugin; in place of an unknown one its substitute.

        Raises
        ------
        SceneError
            If it has none.
        """
        kind, key = source.get("type"), id(source)
        if isinstance(kind, str) and kind in TABLE.kinds:
            return source
        if key not in self._kept:
            hint = did_you_mean(kind, TABLE.kinds) if isinstance(kind, str) else ""
            what = f"there is no plugin {in_brief(kind)}{self._version}{hint}"
            self._kept[key] = {"type": "diffuse"}, source  # where it holds itself
            substitute = self._substitute(source)
            substitute = None if substitute is None else self._known(substitute, place)
            if substitute is None:
                del self._kept[key]
                raise SceneError(f"{place}: {what}")
            self._lost.note(what, place, done=f"a {substitute['type']} in its place")
            self._kept[key] = substitute, source
        return self._kept[key][0]

    def _substitute(self, source: Mapping[str, Any]) -> Mapping[str, Any] | None:
        """Return the known plugin that is nearest to an unknown one; None without one."""
        children: list[Mapping[str, Any]] = [
            self._ids.get(str(value.get("id")), value) if f"{value.get('type')}" == "ref" else value
            for value in source.values()
            if isinstance(value, Mapping)
        ]
        known = [_kind(child) for child in children]
        color = next((source[name] for name in COLORS if name in source), None)
        tag = getattr(source, "tag", "")
        if tag in ("", "integrator") and "integrator" in known:
            return children[known.index("integrator")]
        if tag == "integrator":
            return {"type": "path"} | {name: source[name] for name in PATHS if name in source}
        if tag in ("", "bsdf") and "bsdf" in known:
            return children[known.index("bsdf")]
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
    return TABLE.kinds[kind] if isinstance(kind, str) and kind in TABLE.kinds else getattr(source, "tag", "")


def _unnamed(name: Any) -> bool:
    return not isinstance(name, str) or name.startswith("_arg_")
