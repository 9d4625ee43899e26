"""Options that several commands share, and their arguments as values.

A function that reads an argument raises SceneError, as checks do, or ArgumentTypeError where it is called in
other checks.
"""

from __future__ import annotations

import argparse
import os
from collections.abc import Callable, Collection, Sequence
from typing import Any

import numpy as np

from ..camera import image_size, upward
from ..codecs.display import Display
from ..codecs.encoding import check_exposure, check_gamma
from ..codecs.image_data import TRANSPARENT
from ..codecs.tone import TONE_NAMES
from ..colors import rgb
from ..core.errors import SceneError
from ..core.progress import Progress
from ..io.to_scene import as_scene
from ..materials import Material, MaterialLike
from ..scene import Scene
from ..settings import AUTO, SETTINGS
from ..settings.checks import check_preset, check_view
from ..settings.declaration import Setting
from ..shapes.smoothing import check_smooth

VECTORS = ("--origin", "--target", "--up", "--direction", "--view", "--grid", "--normal")


class Default:
    """The default of a setting, as against the same value that was given: a scene's own counts before it."""

    def __init__(self, value: Any) -> None:
        self.value = value

    def __str__(self) -> str:
        """Return the value as the help shows it."""
        return str(self.value)


class Several(argparse.Action):
    """An option that can be given several times: its values become a tuple, after those of the default."""

    def __call__(
        self, parser: argparse.ArgumentParser, namespace: argparse.Namespace, values: Any, option: Any = None
    ) -> None:
        """Add a value."""
        setattr(namespace, self.dest, (*getattr(namespace, self.dest), values))


def joined(arguments: Sequence[str]) -> list[str]:
    """Join a vector to its option, since argparse takes "-1,2,3" for an option of its own."""
    joined: list[str] = []
    for argument in arguments:
        negative = argument[:1] == "-" and ("," in argument or argument.lower() in ("-x", "-y", "-z"))
        if joined and joined[-1] in VECTORS and negative:
            joined[-1] += "=" + argument
        else:
            joined.append(argument)
    return joined


def size(text: str) -> tuple[int, int]:
    """Return WIDTHxHEIGHT as two ints."""
    return image_size(_parts(text.lower(), "x", int, 2, f"{text!r} is not WIDTHxHEIGHT, such as 640x480"))


def count(text: str) -> int:
    """Return a number of pictures."""
    wrong = f"{text!r} is not a whole number from 1 on"
    (number,) = _parts(text, None, int, 1, wrong)
    if number < 1:
        raise SceneError(wrong)
    return int(number)


def samples(text: str) -> range:
    """Return FIRST:END as a range."""
    first, end = _parts(text, ":", int, 2, f"{text!r} is not FIRST:END, such as 64:128")
    if not 0 <= first < end:
        raise SceneError(f"{text!r} has no samples; it is FIRST:END, such as 64:128")
    return range(first, end)


def shutter(text: str) -> tuple[float, float]:
    """Return OPEN:CLOSE as two times."""
    begin, end = _parts(text, ":", float, 2, f"{text!r} is not OPEN:CLOSE, such as 0.48:0.52")
    return begin, end


def times(text: str) -> list[float]:
    """Return T,T,... as numbers."""
    return [_finite(word) for word in text.split(",")]


def flow_times(text: str) -> tuple[float, float]:
    """Return BEFORE:AFTER as two times."""
    before, after = _parts(text, ":", float, 2, f"{text!r} is not BEFORE:AFTER, such as 0.46:0.54")
    return before, after


def fov(text: str) -> float:
    """Return an angle between 0 and 180 degrees."""
    fov = _finite(text)
    if not 0 < fov < 180:
        raise SceneError(f"{text!r} is not above 0 and below 180 degrees")
    return fov


def lighting(text: str) -> str | None:
    """Return the name of a preset; None for "none"."""
    return check_preset("lighting", None if text == "none" else text)


def vector(text: str) -> tuple[float, float, float]:
    """Return X,Y,Z as three floats."""
    return _parts(text, ",", float, 3, f"{text!r} is not X,Y,Z, such as 0,1.5,4")


def up(text: str) -> str | tuple[float, float, float]:
    """Return X,Y,Z, or the name of an axis, as three floats; "auto" as it is."""
    if text == AUTO:
        return text
    x, y, z = vector(text) if "," in text else upward("--up", text).tolist()
    return x, y, z


def named_view(text: str) -> str | tuple[float, float, float]:
    """Return the name of a view, or X,Y,Z as three floats."""
    view: str | tuple[float, float, float] = check_view("view", vector(text) if "," in text else text)
    return view


def smooth(text: str) -> bool | float | str:
    """Return whether normals are smooth, a crease angle in degrees, or "auto"."""
    try:
        return SWITCH[text] if text in SWITCH else check_smooth("smooth", float(text))
    except ValueError:
        raise SceneError(f"{text!r} is not yes, no, auto, or a crease angle from 0 to 180 degrees") from None


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
        raise SceneError(f"{error}, or R,G,B") from None
    return text


def material(text: str) -> str:
    """Return the name of a material."""
    Material.named(text)
    return text


def gamma(text: str) -> float | str:
    """Return a gamma or "srgb"."""
    try:
        return text if text == "srgb" else check_gamma(_finite(text))
    except ValueError:
        raise SceneError(f'{text!r} is neither a number from 0.01 to 100 nor "srgb"') from None


def exposure(text: str) -> float:
    """Return stops."""
    return check_exposure(_finite(text))


def white_balance(text: str) -> float | tuple[float, float, float]:
    """Return kelvin, or R,G,B as three floats."""
    white = vector(text) if "," in text else _finite(text)
    Display(white_balance=white)
    return white


def branches(text: str) -> int | str:
    """Return a number of branches, or "auto"."""
    return text if text == AUTO else int(text)


def reuse(text: str) -> bool | str:
    """Return whether pixels share paths, or "auto"."""
    if text not in SWITCH:
        raise SceneError(f"{text!r} is not yes, no or auto")
    return SWITCH[text]


def roulette_after(text: str) -> int | bool:
    """Return a number of scattering events, or False for "no"."""
    return False if text == "no" else int(text)


def _finite(text: str) -> float:
    number = float(text)
    if not np.isfinite(number):
        raise argparse.ArgumentTypeError(f"{text!r} is not a finite number")
    return number


def _parts(text: str, by: str | None, kind: Callable[[str], Any], count: int, wrong: str) -> Any:
    """Return the numbers of a text, which there must be `count` of, as a tuple."""
    try:
        values = tuple(kind(word) for word in text.split(by))
    except ValueError:
        values = ()
    if len(values) != count:
        raise SceneError(wrong)
    return values


SWITCH: dict[str, bool | str] = {"yes": True, "no": False, "auto": AUTO}
TYPES: dict[str, Callable[[str], Any]] = {"int": int, "float": float, "str": str}
# how the argument of a setting is read, and its name in the help, where the type does not say it
READERS: dict[str, tuple[Callable[[str], Any], str | None]] = {
    "size": (size, None),
    "view": (named_view, "NAME|X,Y,Z"),
    "fov": (fov, "DEGREES"),
    "material": (material, "NAME"),
    "smooth": (smooth, "WHICH"),
    "up": (up, "X,Y,Z"),
    "lighting": (lighting, "PRESET"),
    "background": (background, "COLOR"),
    "roulette": (roulette_after, "EVENTS"),
    "samples": (samples, "FIRST:END"),
    "shutter": (shutter, "OPEN:CLOSE"),
    "flow_times": (flow_times, "BEFORE:AFTER"),
    "branches": (branches, None),
    "reuse": (reuse, None),
}
# settings that the command line uses itself, for its own camera and where it reads a scene
OWN_OPTIONS = ("size", "view", "fov", "material", "smooth")
RENDER_OPTIONS = [name for name, setting in SETTINGS.items() if setting.option and name not in OWN_OPTIONS]
DISPLAY_OPTIONS = ("gamma", "exposure", "tone", "white_balance")


def add_settings(command: argparse.ArgumentParser, own: Collection[str] = ()) -> None:
    """Add the options of reading a scene, and of settings, but for the command's own."""
    add_reading(command)
    for name, setting in SETTINGS.items():
        if setting.option and name not in own:
            _add_setting(command, name, setting)
    command.add_argument(
        "--color",
        type=color_value,
        help="of the --material, or of a matte one: a name such as orange, #rrggbb, or linear R,G,B",
    )


def add_reading(command: argparse.ArgumentParser) -> None:
    """Add the options of reading a scene file."""
    command.add_argument(
        "-D",
        "--define",
        action=Several,
        type=definition,
        default=(),
        metavar="NAME=VALUE",
        help="parameter of a Mitsuba scene, $NAME; can be given several times",
    )
    command.add_argument(
        "--search-path",
        action=Several,
        default=(),
        metavar="FOLDER",
        help="folder, beside its own, whose files the scene may refer to; can be given several times",
    )
    command.add_argument("--time", type=_finite, metavar="SECONDS", help="moment of a file that moves")
    command.add_argument("--animation", metavar="NAME", help="which of its animations, by name or number")


def reading(options: argparse.Namespace) -> dict[str, Any]:
    """Return the options of reading a scene file, as arguments of `load`."""
    folders = [os.path.join(getattr(options, "folder", None) or "", folder) for folder in options.search_path]
    moving = {"time": getattr(options, "time", None), "animation": _name_or_number(options)}
    return {"parameters": dict(options.define), "search_paths": folders, **moving}


def _name_or_number(options: argparse.Namespace) -> str | int | None:
    """Return the name or the number of the animation; digits are a number."""
    wanted = getattr(options, "animation", None)
    return int(wanted) if wanted is not None and wanted.isdecimal() else wanted


def definition(text: str) -> tuple[str, str]:
    """Return the name and the value of NAME=VALUE."""
    name, equals, value = text.partition("=")
    if not name or not equals:
        raise SceneError(f"{text!r} is not NAME=VALUE, such as spp=64")
    return name, value


def read_scene(path: str, options: argparse.Namespace, progress: Progress) -> Scene:
    """Read a scene file, with the material that the options ask for in place of its own."""
    material: MaterialLike | None = options.material
    if options.color is not None:
        name = "matte" if options.material is None else options.material
        material = Material.named(name, options.color)
    return as_scene(path, material, progress, options.smooth, reading=reading(options))


def setting_values(options: argparse.Namespace) -> dict[str, Any]:
    """Return the settings that were given, but for those that the command line uses itself."""
    values = {name: getattr(options, name) for name in RENDER_OPTIONS}
    return {name: value for name, value in values.items() if not isinstance(value, Default)}


def framing(options: argparse.Namespace) -> dict[str, Any]:
    """Return the settings of the camera that frames a scene."""
    return {"size": options.size, "view": options.view, "fov": options.fov}


def add_display(command: argparse.ArgumentParser) -> None:
    """Add the options of display."""
    command.add_argument("--gamma", type=gamma, default=2.2, help='for png and jpg: a number or "srgb"')
    command.add_argument("--exposure", type=exposure, default=0.0, help="stops, applied when saving")
    command.add_argument("--tone", choices=TONE_NAMES, default="auto", help="tone curve, for png and jpg")
    command.add_argument(
        "--white-balance",
        type=white_balance,
        metavar="KELVIN|R,G,B",
        help="color temperature of the light, or a gray color of the picture, that becomes neutral",
    )


def display_values(options: argparse.Namespace) -> dict[str, Any]:
    """Return how pictures are shown: the settings of `Display`, by name."""
    return {name: getattr(options, name) for name in DISPLAY_OPTIONS}


def _add_setting(command: argparse.ArgumentParser, name: str, setting: Setting) -> None:
    """Add the option of a setting that has one."""
    keeps_default = name in (*OWN_OPTIONS, "up") or setting.default in (None, ())
    how: dict[str, Any] = {
        "help": setting.option,
        "default": setting.default if keeps_default else Default(setting.default),
    }
    flag = setting.flag or name
    if name in READERS:
        how["type"], how["metavar"] = READERS[name]
    elif setting.type == "bool | str" and setting.default == AUTO:
        how["action"] = argparse.BooleanOptionalAction
    elif setting.type.startswith("bool"):
        how["action"] = "store_true"
    elif setting.flag:
        how.update(action=Several, dest=name, metavar="NAME")
    else:
        how.update(type=TYPES[setting.type.split(" ")[0]], choices=setting.choices)
    command.add_argument("--" + flag.replace("_", "-"), **how)
