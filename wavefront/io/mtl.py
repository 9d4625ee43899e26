"""MTL text -> materials and emission, by material name.

How an MTL material is read:

- `Ke` is emission. `Kd` is the reflectance of a matte surface.
- `illum` 4, 6, 7 and 9 are glass with the index `Ni` (1.5 when absent), tinted by `Tf`.
- `illum` 3, 5 and 8 are mirrors of reflectance `Ks`, if `Ks` is not black.
- Opacity is `d`; without a `d` it is 1 - `Tr`, except that `Tr 1` alone means opaque: that is how
  MeshLab writes it, and a material that cannot be seen has no other use. A surface that is less
  than opaque and has an index `Ni` other than 1 is glass.

Whatever else a file asks for is named in one warning per file.
"""

from __future__ import annotations

import os
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ..bsdfs.base import Bsdf
from ..bsdfs.dielectric import Dielectric
from ..bsdfs.diffuse import Diffuse
from ..bsdfs.mirror import Mirror
from ..errors import SceneError
from .repair import warn

GLASS = (4, 6, 7, 9)
MIRROR = (3, 5, 8)
GLASS_IOR = 1.5
MATTE = 0.5  # reflectance where a file gives none
# values that change nothing
NEUTRAL = {"ka": 0.0, "kd": 0.0, "ks": 0.0, "tf": 1.0, "d": 1.0, "tr": 0.0, "sharpness": 60.0}

Colour = NDArray[np.float64]


@dataclass
class Look:
    """What a surface looks like."""

    material: Bsdf
    emission: Colour | None  # (3,) radiance


@dataclass
class Entry:
    """One material as written: keyword in lower case -> (keyword, line number, the rest of the line)."""

    file: str
    name: str
    lines: dict[str, tuple[str, int, str]] = field(default_factory=dict)
    read: set[str] = field(default_factory=set)  # keywords that the look honours
    strict: bool = False

    def where(self, key: str) -> str:
        """Name file, line and keyword for a message."""
        keyword, number, _ = self.lines[key]
        return f"{self.file} line {number}: {keyword}"

    def numbers(self, key: str) -> list[float] | None:
        """Return the finite numbers of a line, None if there is no such line."""
        if key not in self.lines:
            return None
        rest = self.lines[key][2]
        try:
            values = [float(word) for word in rest.split()]
        except ValueError:
            raise SceneError(f"{self.where(key)} is {rest!r}; it must be numbers") from None
        if not values or not np.isfinite(values).all():
            raise SceneError(f"{self.where(key)} is {rest!r}; it must be finite numbers")
        self.read.add(key)
        return values

    def number(self, key: str, default: float) -> float:
        """Return the first number of a line."""
        values = self.numbers(key)
        return default if values is None else values[0]

    def colour(self, key: str, default: float, high: float = 1.0) -> Colour:
        """Return a colour (3,), clamped to [0, `high`] with a warning."""
        values = self.numbers(key)
        if values is None:
            return np.full(3, default)
        if len(values) not in (1, 3):
            raise SceneError(f"{self.where(key)} has {len(values)} numbers; a colour has 1 or 3")
        colour = np.broadcast_to(np.array(values), 3)
        limited = np.clip(colour, 0, high)
        if (limited != colour).any():
            limit = f"in [0, {high:g}]" if np.isfinite(high) else "at least 0"
            warn(
                f"{self.where(key)} is {self.lines[key][2]}; it must be {limit} and was clamped", self.strict
            )
        return limited

    def unread(self) -> list[str]:
        """Return the keywords, as written, that ask for something the look does not give."""
        return [keyword for key, (keyword, _, _) in self.lines.items() if not self._idle(key)]

    def _idle(self, key: str) -> bool:
        if key in self.read:
            return True
        if key in ("ns", "ni"):  # they shape the highlight, and warning of Ks covers it
            return True
        if key == "illum":
            return True
        return key in NEUTRAL and set(self.lines[key][2].split()) <= _spellings(NEUTRAL[key])


def _spellings(value: float) -> set[str]:
    return {f"{value:.{digits}f}" for digits in range(10)} | {f"{value:g}"}


def parse(path: str | os.PathLike[str], text: str, strict: bool = False) -> dict[str, Entry]:
    """Split MTL text into materials; a name may hold spaces.

    Raises
    ------
    SceneError
        If a property stands before the first `newmtl`.
    """
    file, entries = os.fspath(path), {}
    current: Entry | None = None
    for number, line in enumerate(text.split("\n"), 1):
        keyword, rest = _split(line)
        key = keyword.lower()
        if not keyword:
            continue
        if key == "newmtl":
            current = entries[rest] = Entry(file, rest, strict=strict)
        elif current is None:
            raise SceneError(f"{file} line {number}: {keyword} stands before the first newmtl")
        else:
            current.lines[key] = (keyword, number, rest)
    return entries


def _split(line: str) -> tuple[str, str]:
    words = line.split(None, 1)
    if not words or words[0].startswith("#"):
        return "", ""
    return words[0], words[1].strip() if len(words) > 1 else ""


def looks(entries: dict[str, Entry], strict: bool = False) -> dict[str, Look]:
    """Turn entries into looks; what is not honoured is named in one warning.

    Raises
    ------
    SceneError
        If a value is malformed, or `strict` and one is out of range or not honoured.
    """
    out: dict[str, Look] = {}
    unread: dict[str, str] = {}
    for name, entry in entries.items():
        out[name] = look(entry)
        for keyword in entry.unread():
            unread.setdefault(keyword, name)
    if unread:
        file = next(iter(entries.values())).file
        listed = ", ".join(f"{keyword} (material {name!r})" for keyword, name in unread.items())
        warn(f"{file}: not honoured: {listed}", strict)
    return out


def look(entry: Entry) -> Look:
    """Turn one entry into a look; what is used is marked in `entry.read`."""
    emission = entry.colour("ke", 0.0, high=np.inf)
    return Look(_material(entry), emission if emission.any() else None)


def _material(entry: Entry) -> Bsdf:
    illum = int(entry.number("illum", 2))
    ior = entry.number("ni", 1.0)
    if illum in GLASS or (opacity(entry) < 1 and ior != 1):
        return _glass(entry)
    if illum in MIRROR and "ks" in entry.lines and entry.colour("ks", 0.0).any():
        return Mirror(entry.colour("ks", 0.0))
    return Diffuse(entry.colour("kd", MATTE))


def _glass(entry: Entry) -> Bsdf:
    opacity(entry)
    ior = entry.number("ni", GLASS_IOR)
    if ior <= 0:
        raise SceneError(f"{entry.where('ni')} is {ior:g}; an index must be above 0")
    entry.read.update(("d", "tr", "kd"))  # glass has no matte part: files give it a Kd all the same
    return Dielectric(ior, transmittance=entry.colour("tf", 1.0))


def opacity(entry: Entry) -> float:
    """Return the opacity in [0, 1] from `d` and `Tr`, by the rule at the top of this file."""
    if "d" in entry.lines:
        value = entry.number("d", 1.0)
        entry.read.add("tr")
    else:
        clear = entry.number("tr", 0.0)
        value = 1.0 if clear == 1 else 1.0 - clear
    if value == 1:
        entry.read.update(("d", "tr"))
    else:  # only what the material then makes of it counts as read
        entry.read.difference_update(("d", "tr"))
    return min(max(value, 0.0), 1.0)
