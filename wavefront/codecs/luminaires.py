"""Luminous intensity of luminaires by direction, from files of IES LM-63 (1986 to 2019) and EULUMDAT.

A file has planes of vertical angles. In types A and C they turn about the vertical, in type B about the
horizontal at H = 0°, V = 90°. V counts from straight down, in type A from the horizontal; H of type C runs
counterclockwise seen from above, that of A and B clockwise (LM-63-2002, §3).

Sources: ANSI/IESNA LM-63-2002; ANSI/IES LM-63-19; A. Stockmar, EULUMDAT/2, 1998 (as DIAL and AGi32 list its
lines). Where the standards differ or are silent, as ies2rad of Radiance and Cycles read them.
"""

from __future__ import annotations

import math
import os
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..arrays.vec import Doubles
from ..core.errors import SceneError, exact, warn_caller
from ..core.files import decode_text, extension_of, path_name, read_bytes
from ..core.plural import plural
from ..core.references import followed

MOST_BYTES = 2**25
MOST = 1e9  # the largest number that makes sense
EXTENSIONS = ".ies", ".ldt"
TILT = re.compile(r"^[ \t]*TILT[ \t]*=[ \t]*(.*?)[ \t]*$", re.IGNORECASE | re.MULTILINE)
WITHOUT_LAMP_FACTOR = "LM-63-1995", "LM-63-2002", "LM-63-2019"  # its place holds other things there
NEAR = 1e-3  # degrees that count as none
LEAST_STEP = 0.01  # degrees
WIDEST_GAP = 1.5  # steps between the last plane and the first, of a file that leaves out that at 360°


@dataclass(frozen=True, eq=False)
class Photometry:
    """Luminous intensity by azimuth about an axis and by the angle from it, in degrees."""

    azimuth: Doubles  # (m,) increasing, over 360° at most; dark elsewhere
    polar: Doubles  # (n,) increasing, in [0, 180]; dark elsewhere
    candela: Doubles  # (m, n)
    # Where the axis and azimuths 0° and 90° are: down, along C0 and along C90; or of type B, which is
    # horizontal, against C0, down and along C90
    horizontal: bool = False
    tilt: tuple[Doubles, Doubles] | None = None  # degrees from upright, and the part of the light there


class _Numbers:
    """The numbers of some lines of a text, one after the other, with the lines they are in."""

    def __init__(self, name: str, lines: list[str], start: int, comma: str) -> None:
        self.name, self.last = name, len(lines)
        self.found = [
            (line, word)
            for line, text in enumerate(lines[start:], start + 1)
            for word in text.replace(",", comma).split()
        ]
        self.at = 0

    def take(self, what: str, count: int, low: float = 0.0, high: float = MOST) -> Doubles:
        """Return the next numbers (count,), each in [low, high]."""
        words = self.found[self.at : self.at + count]
        self.at += count
        if len(words) < count:
            got = f"{len(words)} of {plural(count, 'number')}"
            raise SceneError(f"{self.name} line {self.last}: ends within {what}, with {got}")
        values = np.array([_number(word) for _, word in words], np.float64)
        bad = np.flatnonzero(~((values >= low) & (values <= high)))
        if bad.size:
            line, word = words[bad[0]]
            limit = f"a number from {low:g} to {high:g}"
            raise SceneError(f"{self.name} line {line}: {what} is {word[:40]!r}; it must be {limit}")
        return values

    def count(self, what: str, least: int, most: int = int(MOST)) -> int:
        """Return the next number, which is whole."""
        value = float(self.take(what, 1, least, most)[0])
        if not value.is_integer():
            line = self.found[self.at - 1][0]
            raise SceneError(f"{self.name} line {line}: {what} is {exact(value)}; it must be whole")
        return int(value)

    def angles(self, what: str, count: int, low: float, high: float) -> Doubles:
        """Return the next numbers (count,), which increase."""
        values = self.take(what, count, low, high)
        bad = np.flatnonzero(~(np.diff(values) >= LEAST_STEP))
        if bad.size:
            line, word = self.found[self.at - count + int(bad[0]) + 1]
            step = f"{what} is {word} after {values[bad[0]]:g}"
            raise SceneError(f"{self.name} line {line}: {step}; it must increase by {LEAST_STEP:g}")
        return values


def _number(word: str) -> float:
    try:
        return math.nan if "_" in word else float(word)
    except ValueError:
        return math.nan


def luminaire_texts(path: str | os.PathLike[str]) -> tuple[str, str, str]:
    """Return the name and the text of an ies or ldt file, and the text of the file that its TILT= names.

    Raises
    ------
    SceneError
        If a file is missing or too large, or of another kind, or the second one is outside the first one's
        folder.
    """
    name = path_name(path)
    if extension_of(path, EXTENSIONS) not in EXTENSIONS:
        raise SceneError(f"{name}: has another extension than {' and '.join(EXTENSIONS)}")
    text = decode_text(read_bytes(path, MOST_BYTES))
    tilt = TILT.search(text) if name.lower().endswith(".ies") else None
    if tilt is None or tilt[1].upper() in ("NONE", "INCLUDE", ""):
        return name, text, ""
    folder = Path(name).resolve().parent
    (tilt_path,) = followed(name, tilt[1], [folder], [folder])
    try:
        return name, text, decode_text(read_bytes(tilt_path, MOST_BYTES))
    except SceneError as error:
        raise SceneError(f"{name}: TILT={tilt[1]}: {error}") from error


def parsed_luminaire(name: str, text: str, tilt: str) -> Photometry:
    """Return the luminous intensity of a luminaire from the texts of `luminaire_texts`.

    Raises
    ------
    SceneError
        If the text is malformed. The message names file and line.
    """
    lines = text.split("\n")
    return _lm63(name, lines, tilt.split("\n")) if name.lower().endswith(".ies") else _eulumdat(name, lines)


def _lm63(name: str, lines: list[str], tilt_lines: list[str]) -> Photometry:
    matches = ((at, TILT.match(line)) for at, line in enumerate(lines))
    start, tilting = next(((at, match[1]) for at, match in matches if match), (0, ""))
    if not tilting:
        raise SceneError(f"{name}: has no line TILT=...; it is no file of LM-63")
    numbers = _Numbers(name, lines, start + 1, " ")
    tilt = None
    if tilting.upper() != "NONE":
        included = tilting.upper() == "INCLUDE"
        tilt = _tilt(numbers if included else _Numbers(str(Path(name).parent / tilting), tilt_lines, 0, " "))
    numbers.take("number of lamps, lumens per lamp", 2, -1)
    factor = float(numbers.take("candela multiplier", 1)[0])
    rows = numbers.count("number of vertical angles", 2)
    planes = numbers.count("number of horizontal angles", 1)
    kind = "CBA"[numbers.count("photometric type", 1, 3) - 1]
    numbers.take("units and size", 4, -MOST)
    ballast, lamp = numbers.take("ballast factors", 2)
    numbers.take("input watts", 1, -MOST)
    factor *= ballast * (1 if lines[0].strip().endswith(WITHOUT_LAMP_FACTOR) else lamp)
    low, high = (0, 180) if kind == "C" else (-90, 90)
    vertical = numbers.angles("vertical angle", rows, low, high)
    horizontal = numbers.angles("horizontal angle", planes, -180, 360)
    candela = numbers.take("candela value", rows * planes).reshape(planes, rows) * factor
    if kind == "C":
        return Photometry(*_around(name, horizontal, vertical, candela), tilt=tilt)
    if planes < 2:
        raise SceneError(f"{name}: has one horizontal angle; type {kind} must have two at least")
    if vertical[0] == 0:  # as Cycles
        vertical, candela = np.r_[-vertical[:0:-1], vertical], np.c_[candela[:, :0:-1], candela]
    if horizontal[0] == 0:
        horizontal, candela = np.r_[-horizontal[:0:-1], horizontal], np.r_[candela[:0:-1], candela]
    if horizontal[-1] - horizontal[0] > 360:
        raise SceneError(f"{name}: horizontal angles span more than 360°")
    return Photometry(-horizontal[::-1], vertical + 90, candela[::-1], kind == "B", tilt)


def _tilt(numbers: _Numbers) -> tuple[Doubles, Doubles]:
    numbers.count("lamp-to-luminaire geometry", 1, 3)
    count = numbers.count("number of tilt angles", 1)
    return numbers.angles("tilt angle", count, 0, 180), numbers.take("tilt factor", count)


def _eulumdat(name: str, lines: list[str]) -> Photometry:
    def line(at: int) -> _Numbers:
        return _Numbers(name, lines[:at], at - 1, ".")

    symmetry = line(3).count("symmetry", 0, 4)
    planes, step = line(4).count("number of C-planes", 1), (1, 1, 2, 4, 4)[symmetry]
    if planes % step:
        limit = f"a multiple of {step} with symmetry {symmetry}"
        raise SceneError(f"{name} line 4: number of C-planes is {planes}; it must be {limit}")
    rows = line(6).count("number of angles in a plane", 2)
    factor = float(line(24).take("conversion factor", 1)[0])
    sets = line(26).count("number of sets of lamps", 1, 1000)
    lumens = float(line(29).take("luminous flux", 1)[0])
    if sets > 1:
        warn_caller(f"{name}: has {sets} sets of lamps; the first is lit, with {lumens:g} lm")
    numbers = _Numbers(name, lines, 26 + 6 * sets, ".")
    numbers.take("direct ratio", 10, -MOST)
    azimuth = numbers.angles("C-plane", planes, 0, 360)
    polar = numbers.angles("angle γ", rows, 0, 180)
    quarter = planes // 4
    azimuth = {
        0: azimuth,
        1: azimuth[:1],
        2: azimuth[: planes // 2 + 1],
        3: np.r_[azimuth[3 * quarter :], azimuth[: quarter + 1] + 360],
        4: azimuth[: quarter + 1],
    }[symmetry]
    candela = numbers.take("luminous intensity", len(azimuth) * rows).reshape(-1, rows)
    return Photometry(*_around(name, azimuth, polar, candela * (factor * lumens / 1000)))


def _around(
    name: str, azimuth: Doubles, polar: Doubles, candela: Doubles
) -> tuple[Doubles, Doubles, Doubles]:
    """Return a web all around, from one plane, a quarter, a half, or planes up to 360° or just before."""
    if len(azimuth) == 1:
        return np.array([0.0, 360.0]), polar, np.repeat(candela, 2, 0)
    for half in (90, 180):  # mirrored about the last plane
        if abs(azimuth[-1] - azimuth[0] - half) < NEAR:
            azimuth = np.r_[azimuth, 2 * azimuth[-1] - azimuth[-2::-1]]
            candela = np.r_[candela, candela[-2::-1]]
    gap = 360 - (azimuth[-1] - azimuth[0])
    if gap > NEAR:
        if gap > WIDEST_GAP * np.diff(azimuth).max():
            span = f"from {azimuth[0]:g} to {azimuth[-1]:g}"
            raise SceneError(
                f"{name}: horizontal angles are {span}; they must span 0, 90, 180 or 360 degrees"
            )
        azimuth, candela = np.r_[azimuth, azimuth[0] + 360], np.r_[candela, candela[:1]]
    elif gap < -NEAR:
        raise SceneError(f"{name}: horizontal angles span more than 360 degrees")
    return azimuth, polar, candela
