"""Animations of glTF: how nodes and the weights of morph targets change in one of its clips.

Source: Khronos Group, glTF 2.0 specification, chapter 3.11.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ...arrays.vec import Doubles
from ...core.errors import SceneError, one_of, printable
from ...core.plural import plural
from ...motion.keyframes import Trs
from ...motion.track import CUBIC, LINEAR, STEP, Track
from ..description.numbers import floats, shown
from .document import Document

WAYS = {"STEP": STEP, "LINEAR": LINEAR, "CUBICSPLINE": CUBIC}
WIDTHS = {"translation": 3, "rotation": 4, "scale": 3}
REST = {"translation": [0.0, 0.0, 0.0], "rotation": [0.0, 0.0, 0.0, 1.0], "scale": [1.0, 1.0, 1.0]}
POINTER = "KHR_animation_pointer"


@dataclass
class Clip:
    """What one animation moves, by the numbers of nodes."""

    nodes: dict[int, dict[str, Track]] = field(default_factory=dict)  # translation, rotation and scale
    weights: dict[int, Track] = field(default_factory=dict)  # of morph targets

    def motion(self, index: int, node: dict[str, Any]) -> Trs | None:
        """Return the motion of a node in the space of its parent, None if it stays."""
        tracks = self.nodes.get(index)
        if tracks is None:
            return None
        start = min(track.start for track in tracks.values())
        parts = [tracks.get(name) or _constant(node, name, start) for name in WIDTHS]
        return Trs(*parts)


def names(document: Document) -> tuple[str, ...]:
    """Return the names of the animations of a file, numbers for those without one."""
    found = []
    for number, item in enumerate(document.items("animations")):
        name = item.get("name") if isinstance(item, dict) else None
        found.append(printable(str(name)) if name else str(number))
    return tuple(found)


def read_clip(document: Document, wanted: str | int | bool | None) -> Clip:
    """Return an animation, by its name or number; the first one for None, and none for False.

    Parts that are damaged are left out, which is noted.

    Raises
    ------
    SceneError
        If there is no such animation.
    """
    known = names(document)
    if wanted is False or (wanted is None and not known):
        return Clip()
    if not known:
        raise SceneError(f"{document.name}: animation is {wanted!r}; the file has none")
    number = chosen(document.name, known, wanted)
    clip, place = Clip(), f"animations[{number}]"
    with document.part(place):
        item = document.get("animations", number)
        samplers = _Samplers(document, item["samplers"], place)
        for at, channel in enumerate(item["channels"]):
            with document.part(f"{place}.channels[{at}]"):
                _add(document, clip, channel, samplers, f"{place}.channels[{at}]")
    return clip


def chosen(name: str, known: tuple[str, ...], wanted: str | int | bool | None) -> int:
    """Return the number of the animation that is wanted of the file `name`; None is the first.

    Raises
    ------
    SceneError
        If there is none of this name or number.
    """
    if wanted is None:
        return 0
    if isinstance(wanted, int) and not isinstance(wanted, bool):
        if not 0 <= wanted < len(known):
            raise SceneError(f"{name}: animation is {wanted}; it must be at least 0 and below {len(known)}")
        return wanted
    return known.index(one_of(f"{name}: animation", wanted, known))


def _add(document: Document, clip: Clip, channel: Any, samplers: _Samplers, place: str) -> None:
    """Add a channel to a clip."""
    target = channel["target"]
    path, index = target.get("path"), target.get("node")
    if path == "pointer" or POINTER in target.get("extensions", {}):
        document.lose(POINTER, place)
        return
    if index is None:  # by the specification it is ignored
        return
    node = document.get("nodes", index)
    if path == "weights":
        clip.weights[index] = samplers.weights(channel["sampler"], _targets(document, node))
    elif path in WIDTHS:
        clip.nodes.setdefault(index, {})[path] = samplers.track(channel["sampler"], path)
    else:
        raise ValueError(f"target.path is {shown(path)}; it must be one of {', '.join((*WIDTHS, 'weights'))}")


class _Samplers:
    """The samplers of an animation."""

    def __init__(self, document: Document, items: Any, place: str) -> None:
        self._document, self._items, self._place = document, items, place
        self._times: dict[Any, Doubles] = {}

    def track(self, number: Any, path: str) -> Track:
        """Return translations, rotations or scales over time."""
        return self._track(number, WIDTHS[path], path == "rotation")

    def weights(self, number: Any, targets: int) -> Track:
        """Return weights of morph targets over time."""
        return self._track(number, targets, False)

    def _track(self, number: Any, width: int, turns: bool) -> Track:
        if not isinstance(number, int) or not 0 <= number < len(self._items):
            raise SceneError(f"sampler {shown(number)} does not exist; there are {len(self._items)}")
        item, place = self._items[number], f"{self._place}.samplers[{number}]"
        keys, rising = self._keys(item["input"], place)
        way = self._way(item.get("interpolation", "LINEAR"), place)
        values = self._document.accessor(item["output"]).astype(np.float64)
        each = 3 if way == CUBIC else 1
        if values.size != len(keys) * each * width:
            raise SceneError(f"{place} has {values.size} numbers for {len(keys)} times of {each * width}")
        values = values.reshape((len(keys), 3, width) if way == CUBIC else (len(keys), width))
        if not np.isfinite(values).all():
            raise SceneError(f"{place} has values that are not finite")
        return Track(keys[rising], values[rising], way, turns)

    def _keys(self, index: Any, place: str) -> tuple[Doubles, Any]:
        """Return all times of a sampler, and a mask of those that are later than all before."""
        if index not in self._times:
            keys = self._document.accessor(index)
            if keys.shape[1] != 1 or not len(keys) or not np.isfinite(keys).all():
                raise SceneError(f"{place}.input must be finite numbers, one for each key")
            self._times[index] = keys[:, 0].astype(np.float64)
        keys = self._times[index]
        rising = np.diff(np.maximum.accumulate(keys), prepend=-np.inf) > 0
        if not rising.all():
            late = plural(int((~rising).sum()), "key")
            where = f"{place}.input"
            self._document.files.losses.note(f"{late} at times that do not rise", where, done="left out")
        return keys, rising

    def _way(self, name: Any, place: str) -> str:
        if name not in WAYS:
            self._document.files.losses.note(
                f"interpolation {shown(name)}", place, "unknown", "LINEAR in its place"
            )
        return WAYS.get(name, LINEAR)


def _targets(document: Document, node: dict[str, Any]) -> int:
    """Return the number of the morph targets of the mesh of a node."""
    mesh = document.get("meshes", node.get("mesh"))
    return max(len(part.get("targets", [])) for part in mesh["primitives"])


def _constant(node: dict[str, Any], name: str, time: float) -> Track:
    """Return translation, rotation or scale of a node as a track that stays."""
    value = floats(name, node.get(name, REST[name]), WIDTHS[name])
    return Track(np.array([time]), value[None], turns=name == "rotation")
