"""Which channels of an exr file are the picture.

Programs name layers by the text before the last point of a channel ("ViewLayer.Combined.R"), or put each
into a part of its own. Source: OpenEXR, "Technical Introduction" and "Luminance/Chroma Images".
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arrays.vec import Floats
from ..colors.primaries import REC_709, rgb_to_xyz
from ..core.errors import warn_caller

PICTURES = (
    "combined",
    "composite",
    "beauty",
    "rgba",
    "rgb",
    "color",
    "image",
    "c",
    "ci",
    "main",
)  # names of layers
WORDS = {"red": "R", "green": "G", "blue": "B", "alpha": "A"}
LAST_VIEW = "right"  # of two views
COLOR, CHROMA, GRAY = ("R", "G", "B"), ("Y", "RY", "BY"), ("Y",)


@dataclass(frozen=True)
class Layer:
    """Channels of one part of a file that belong together."""

    part: int
    name: str
    channels: Mapping[str, str]  # component, such as "R" -> name of the channel
    kind: tuple[str, ...]  # components that are shown; one of another name is gray

    def rank(self) -> tuple[int, ...]:
        """Return the key that sorts layers, the picture first."""
        words = self.name.lower().replace("_", ".").split(".")
        title_words = [word for word in words if word not in ("left", LAST_VIEW)]
        plain = all("." not in channel for channel in self.channels.values())
        known = 0 if title_words and title_words[-1] in PICTURES else 1 if plain and self.part == 0 else 2
        kind = 0 if self.kind in (COLOR, CHROMA) else 1 if self.kind == GRAY else 2
        return kind, known, LAST_VIEW in words, self.part, not plain

    def picture(self, values: Mapping[str, NDArray[Any]], primaries: Any = None) -> Floats:
        """Return the pixels (H, W, C) of channels by name."""
        shown = [values[self.channels[component]].astype(np.float32, copy=False) for component in self.kind]
        if self.kind == CHROMA:
            shown = _from_chroma(shown, REC_709 if primaries is None else primaries)
        if "A" in self.channels and self.kind != ("A",):
            shown.append(values[self.channels["A"]].astype(np.float32, copy=False))
        return np.stack(shown, axis=-1)


def chosen(parts: Sequence[tuple[str, list[str], Mapping[str, Any]]]) -> Layer:
    """Return the layer of a file that is its picture.

    A layer of red, green and blue comes first, or one of luminance and chroma; then one of luminance alone.
    Among these are first those that are called "Combined", "beauty", "rgba" and the like, then channels of
    the first part without the name of a layer. A warning names the layer that is shown where this is a guess.

    Parameters
    ----------
    parts
        Name, names of channels, and header of each part.
    """
    layers = [
        layer
        for k, (name, channels, _) in enumerate(parts)
        for layer in _layers(k, name, channels, len(parts))
    ]
    best = min(layers, key=Layer.rank)
    kind, known, *_ = best.rank()
    shown = ", ".join(best.channels[component] for component in best.kind)
    if kind == 2 and sum(len(layer.channels) for layer in layers) > 1:
        warn_caller(f"has no channels of colors; {shown!r} is shown as gray")
    elif known == 2 and (count := sum(layer.rank()[0] == kind for layer in layers)) > 1:
        warn_caller(f"has {count} layers, none called 'combined' or 'beauty'; {best.name!r} is shown")
    return best


def _layers(part: int, title: str, channels: list[str], parts: int) -> list[Layer]:
    """Return the layers of a part."""
    groups: dict[str, dict[str, str]] = {}
    for channel in sorted(channels):
        prefix, _, component = channel.rpartition(".")
        groups.setdefault(prefix, {})[WORDS.get(component.lower(), component.upper())] = channel
    out = []
    for prefix, group in groups.items():
        name = ".".join(word for word in (title if parts > 1 else "", prefix) if word)
        kind: tuple[str, ...] | None = GRAY if group.keys() - {"A"} == {"Y"} else None
        kind = next((kind for kind in (COLOR, CHROMA) if group.keys() >= set(kind)), kind)
        out.append(Layer(part, name, group, kind or (min(group, key=lambda component: component == "A"),)))
    return out


def _from_chroma(parts: list[Floats], primaries: Any) -> list[Floats]:
    """Return red, green and blue of luminance, (R − Y) / Y and (B − Y) / Y."""
    y, ry, by = parts
    weights = rgb_to_xyz(primaries)[1].astype(np.float32)
    red, blue = (ry + 1) * y, (by + 1) * y
    return [red, (y - weights[0] * red - weights[2] * blue) / weights[1], blue]
