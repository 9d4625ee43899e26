"""Arguments of the command line as values."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from typing import Any

import numpy as np

from ..camera import image_size, upward
from ..codecs.display import Display
from ..codecs.encoding import check_exposure, check_gamma
from ..codecs.image_data import TRANSPARENT
from ..colors import rgb
from ..core.errors import SceneError
from ..materials import Material
from ..scene.lighting import check_lighting
from ..scene.scene import view_direction
from ..shapes.smoothing import check_smooth

VECTOR_OPTIONS = ("--origin", "--target", "--up", "--direction", "--view")


class Several(argparse.Action):
    """An option that can be given several times: its values become a tuple, after those of the default."""

    def __call__(
        self, parser: argparse.ArgumentParser, namespace: argparse.Namespace, values: Any, option: Any = None
    ) -> None:
        """Add a value."""
        setattr(namespace, self.dest, (*getattr(namespace, self.dest), values))


class Flag(argparse.Action):
    """An option that says yes, beside one that says no; without both the default stays."""

    def __init__(self, option_strings: Sequence[str], dest: str, **how: Any) -> None:
        super().__init__(option_strings, dest, nargs=0, **how)

    def __call__(
        self, parser: argparse.ArgumentParser, namespace: argparse.Namespace, values: Any, option: Any = None
    ) -> None:
        """Set it."""
        setattr(namespace, self.dest, not str(option).startswith("--no-"))


def joined(arguments: Sequence[str]) -> list[str]:
    """Join a vector to its option, since argparse takes "-1,2,3" for an option of its own."""
    joined: list[str] = []
    for argument in arguments:
        negative = argument[:1] == "-" and ("," in argument or argument.lower() in ("-x", "-y", "-z"))
        if joined and joined[-1] in VECTOR_OPTIONS and negative:
            joined[-1] += "=" + argument
        else:
            joined.append(argument)
    return joined


def size(text: str) -> tuple[int, int]:
    """Return WIDTHxHEIGHT as two ints."""
    try:
        width, height = (int(part) for part in text.lower().split("x"))
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is not WIDTHxHEIGHT, such as 640x480") from None
    try:
        return image_size((width, height))
    except SceneError as error:
        raise argparse.ArgumentTypeError(str(error)) from None


def count(text: str) -> int:
    """Return a number of pictures."""
    try:
        number = int(text)
    except ValueError:
        number = 0
    if number < 1:
        raise argparse.ArgumentTypeError(f"{text!r} is not a whole number from 1 on")
    return number


def samples(text: str) -> range:
    """Return FIRST:END as a range."""
    try:
        first, end = (int(part) for part in text.split(":"))
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is not FIRST:END, such as 64:128") from None
    if not 0 <= first < end:
        raise argparse.ArgumentTypeError(f"{text!r} has no samples; it is FIRST:END, such as 64:128")
    return range(first, end)


def fov(text: str) -> float:
    """Return an angle between 0 and 180 degrees."""
    fov = _finite(text)
    if not 0 < fov < 180:
        raise argparse.ArgumentTypeError(f"{text!r} is not above 0 and below 180 degrees")
    return fov


def lighting(text: str) -> str | None:
    """Return the name of a preset; None for "none"."""
    lighting = None if text == "none" else text
    try:
        check_lighting(lighting)
    except SceneError as error:
        raise argparse.ArgumentTypeError(str(error)) from None
    return lighting


def vector(text: str) -> tuple[float, float, float]:
    """Return X,Y,Z as three floats."""
    try:
        x, y, z = (float(part) for part in text.split(","))
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is not X,Y,Z, such as 0,1.5,4") from None
    return x, y, z


def up(text: str) -> str | tuple[float, float, float]:
    """Return X,Y,Z, or the name of an axis, as three floats; "auto" as it is."""
    if text == "auto":
        return text
    if "," in text:
        return vector(text)
    try:
        x, y, z = upward("--up", text).tolist()
    except SceneError as error:
        raise argparse.ArgumentTypeError(str(error)) from None
    return x, y, z


def named_view(text: str) -> str | tuple[float, float, float]:
    """Return the name of a view, or X,Y,Z as three floats."""
    found = vector(text) if "," in text else text
    try:
        view_direction("view", found)
    except SceneError as error:
        raise argparse.ArgumentTypeError(str(error)) from None
    return found


def smooth(text: str) -> bool | float | str:
    """Return whether normals are smooth, a crease angle in degrees, or "auto"."""
    values: dict[str, bool | float | str] = {"yes": True, "no": False, "auto": "auto"}
    try:
        return values[text] if text in values else check_smooth("smooth", float(text))
    except ValueError:
        raise argparse.ArgumentTypeError(
            f"{text!r} is not yes, no, auto, or a crease angle from 0 to 180 degrees"
        ) from None


def background(text: str) -> str | tuple[float, float, float]:
    """Return "transparent", or a color."""
    return text if text == TRANSPARENT else color_value(text)


def color_value(text: str) -> str | tuple[float, float, float]:
    """Return the name of a color as it is, or R,G,B as three floats."""
    if "," in text:
        return vector(text)
    try:
        rgb("the color", text)
    except SceneError as error:
        raise argparse.ArgumentTypeError(f"{error}, or R,G,B") from None
    return text


def material(text: str) -> str:
    """Return the name of a material."""
    try:
        Material.named(text)
    except SceneError as error:
        raise argparse.ArgumentTypeError(str(error)) from None
    return text


def gamma(text: str) -> float | str:
    """Return a gamma or "srgb"."""
    if text == "srgb":
        return text
    try:
        return check_gamma(_finite(text))
    except ValueError:
        raise argparse.ArgumentTypeError(
            f'{text!r} is neither a number from 0.01 to 100 nor "srgb"'
        ) from None


def exposure(text: str) -> float:
    """Return stops."""
    try:
        return check_exposure(_finite(text))
    except SceneError as error:
        raise argparse.ArgumentTypeError(str(error)) from None


def white_balance(text: str) -> float | tuple[float, float, float]:
    """Return kelvin, or R,G,B as three floats."""
    try:
        white = vector(text) if "," in text else _finite(text)
        Display(white_balance=white)
    except SceneError as error:
        raise argparse.ArgumentTypeError(str(error)) from None
    return white


def _finite(text: str) -> float:
    number = float(text)
    if not np.isfinite(number):
        raise argparse.ArgumentTypeError(f"{text!r} is not a finite number")
    return number


def branches(text: str) -> int | str:
    """Return a number of branches, or "auto"."""
    return text if text == "auto" else int(text)


def reuse(text: str) -> bool | str:
    """Return whether pixels share paths, or "auto"."""
    values: dict[str, bool | str] = {"yes": True, "no": False, "auto": "auto"}
    if text not in values:
        raise argparse.ArgumentTypeError(f"{text!r} is not yes, no or auto")
    return values[text]


def roulette_after(text: str) -> int | bool:
    """Return a number of scattering events, or False for "no"."""
    return False if text == "no" else int(text)
