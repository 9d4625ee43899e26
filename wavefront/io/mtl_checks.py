"""Lines of MTL with numbers: what stands for one that is damaged, or written in another way."""

from __future__ import annotations

import numpy as np

from ..colors.spectrum import TO_RGB
from ..textures.parameter import MAX_INDEX
from .text_lines import NUMBER

COLORS = ("kd", "ks", "ke", "tf")
NUMBERS = ("ns", "ni", "d", "tr", "illum", "pr", "pm", "ps", "pc", "pcr", "aniso")
LEFT_OUT = "left out"


def mended(key: str, rest: str) -> tuple[str | None, str]:
    """Return the numbers of a line as text, None if it is left out, and what is noted of it, if anything.

    Parameters
    ----------
    key
        The keyword, one of `COLORS` or `NUMBERS`.
    rest
        What follows it: numbers, and before them `xyz` of a color or `-halo` of a `d`.
    """
    words, done = rest.partition("#")[0].split(), ""
    if key == "d" and words[:1] == ["-halo"]:
        words, done = words[1:], "the same opacity from all sides in its place"
    is_xyz = key in COLORS and words[:1] == ["xyz"]
    words = words[is_xyz:]
    values = [float(word) for word in words if NUMBER.fullmatch(word)]
    most = 3 if key in COLORS else 1
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
