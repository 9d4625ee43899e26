"""The keywords of MTL: the kind and the range of their values, and the values without an effect."""

from __future__ import annotations

from enum import Enum
from typing import Any, NamedTuple

import numpy as np

from ....colors.spectrum import TO_RGB
from ....textures.parameter import MAX_INDEX
from ...text_lines import NUMBER
from ..parameters import Parameter

LEFT_OUT = "left out"


class Kind(Enum):
    """The kind of value of a keyword."""

    NUMBER = "a number"
    COLOR = "a color"
    PICTURE = "an image of colors"
    CHANNEL = "an image of numbers, of which one channel counts"
    DATA = "an image of other data"
    UNREAD = "what is not read"


class Keyword(NamedTuple):
    """A keyword: the kind and the range of its value."""

    kind: Kind
    high: float = 1.0  # the greatest value of a color or a part; the least one is 0
    neutral: float | None = None  # the value without an effect
    idle: bool = False  # it may be without an effect, whatever its value
    multiplied: bool = False  # its image may have a multiplier, -bm


# numbers and images that are parameters of `Principled`
PBR = (
    Parameter("roughness", "pr", 1.0, "map_pr"),
    Parameter("metallic", "pm", 1.0, "map_pm", neutral=0.0),
    Parameter("sheen", "ps", 1.0, "map_ps", neutral=0.0),
    Parameter("clearcoat", "pc", 1.0, "map_pc", neutral=0.0),
    Parameter("clearcoat_roughness", "pcr", 1.0, "map_pcr", neutral=0.0),
    Parameter("anisotropy", "aniso", 1.0, "map_aniso", neutral=0.0),
)
KEYWORDS = {
    "ka": Keyword(Kind.UNREAD, neutral=0.0),
    "kd": Keyword(Kind.COLOR, neutral=0.0),
    "ks": Keyword(Kind.COLOR, neutral=0.0),
    "ke": Keyword(Kind.COLOR, high=np.inf),
    "tf": Keyword(Kind.COLOR, neutral=1.0),
    "d": Keyword(Kind.NUMBER, neutral=1.0),
    "tr": Keyword(Kind.NUMBER, neutral=0.0),
    "ns": Keyword(Kind.NUMBER, idle=True),  # without a gloss
    "ni": Keyword(Kind.NUMBER, idle=True),  # without glass
    "illum": Keyword(Kind.NUMBER),
    "sharpness": Keyword(Kind.UNREAD, neutral=60.0),
    "map_kd": Keyword(Kind.PICTURE),
    "map_ks": Keyword(Kind.PICTURE),
    "map_ke": Keyword(Kind.PICTURE),
    "map_d": Keyword(Kind.CHANNEL),
    "norm": Keyword(Kind.DATA, multiplied=True),
    "map_bump": Keyword(Kind.CHANNEL, multiplied=True),
    "bump": Keyword(Kind.CHANNEL, multiplied=True),
    **{row.theirs: Keyword(Kind.NUMBER, row.high) for row in PBR},
    **{row.image: Keyword(Kind.CHANNEL) for row in PBR},
}
UNKNOWN = Keyword(Kind.UNREAD)
BUMPS = [key for key, keyword in KEYWORDS.items() if keyword.multiplied]  # the first one counts
# number of words of an image's options; options not listed here take up to three numbers
OPTIONS = {"-blendu": 1, "-blendv": 1, "-boost": 1, "-cc": 1, "-clamp": 1, "-imfchan": 1, "-mm": 2}
OPTIONS |= {"-texres": 1, "-type": 1, "-bm": 1}
READ = frozenset(("-s", "-o", "-mm", "-clamp"))
CHANNELS: dict[str, Any] = {"r": 0, "g": 1, "b": 2, "m": 3, "l": "luminance"}


def keyword_of(key: str) -> Keyword:
    """Return the declaration of a keyword in lower case."""
    return KEYWORDS.get(key, UNKNOWN)


def is_image(key: str) -> bool:
    """Return whether an image stands after a keyword."""
    return keyword_of(key).kind in (Kind.PICTURE, Kind.CHANNEL, Kind.DATA)


def options_read(key: str) -> frozenset[str]:
    """Return the options that count of the image of a keyword."""
    keyword = keyword_of(key)
    channel = ("-imfchan",) if keyword.kind is Kind.CHANNEL else ()
    return READ.union(channel, ("-bm",) if keyword.multiplied else ())


def mended(key: str, rest: str) -> tuple[str | None, str]:
    """Return the numbers of a line as text, None if it is left out, and a note, "" if there is none.

    Parameters
    ----------
    key
        The keyword, one of numbers or a color.
    rest
        What follows it: numbers, and before them `xyz` of a color or `-halo` of a `d`.
    """
    words, done = rest.partition("#")[0].split(), ""
    if key == "d" and words[:1] == ["-halo"]:
        words, done = words[1:], "the same opacity from all sides in its place"
    is_color = keyword_of(key).kind is Kind.COLOR
    is_xyz = is_color and words[:1] == ["xyz"]
    words = words[is_xyz:]
    values = [float(word) for word in words if NUMBER.fullmatch(word)]
    most = 3 if is_color else 1
    if len(values) < max(len(words), 1) or not np.isfinite(values).all() or len(values) == most - 1:
        return None, LEFT_OUT
    if key == "ni" and not 1 / MAX_INDEX <= values[0] <= MAX_INDEX:
        return None, f"{LEFT_OUT}, as an index must be above 0, from {1 / MAX_INDEX:g} to {MAX_INDEX:g}"
    if len(values) > most:
        values, done = values[:most], f"{'the first three' if most == 3 else 'the first'} in its place"
    if key in ("d", "tr") and not 0 <= values[0] <= 1:
        values, done = [min(max(values[0], 0.0), 1.0)], "clamped, as it must be in [0, 1]"
    if is_xyz:
        values = (TO_RGB @ np.broadcast_to(values, 3)).tolist()
    return " ".join(map(repr, values)), done
