"""The options that several commands share: settings of a render, and of display."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from typing import Any

from ..codecs.display import Display
from ..codecs.tone import TONES
from ..core.progress import Progress
from ..io.to_scene import as_scene
from ..materials import Material, MaterialLike
from ..scene import Scene
from ..settings import AUTO, SETTINGS
from ..settings.declaration import Setting
from . import arguments

TYPES: dict[str, Callable[[str], Any]] = {"int": int, "float": float, "str": str}
PARSERS: dict[str, Callable[[str], Any]] = {
    "size": arguments.size,
    "lighting": arguments.lighting,
    "material": arguments.material,
    "background": arguments.background,
    "up": arguments.up,
    "samples": arguments.samples,
    "branches": arguments.branches,
    "reuse": arguments.reuse,
    "roulette": arguments.roulette_after,
    "view": arguments.named_view,
    "fov": arguments.fov,
    "smooth": arguments.smooth,
}
METAVARS = {
    "view": "NAME|X,Y,Z",
    "fov": "DEGREES",
    "smooth": "WHICH",
    "lighting": "PRESET",
    "material": "NAME",
    "background": "COLOR",
    "up": "X,Y,Z",
    "samples": "FIRST:END",
    "roulette": "EVENTS",
}
# settings that the command line uses itself, for its own camera and where it reads a scene
OWN_OPTIONS = ("size", "view", "fov", "material", "smooth")
RENDER_OPTIONS = [name for name, each in SETTINGS.items() if each.option and name not in OWN_OPTIONS]


def add_settings(command: argparse.ArgumentParser) -> None:
    """Add an option for each setting that has one."""
    for name, each in SETTINGS.items():
        if each.option:
            _add_setting(command, name, each)
    command.add_argument(
        "--color",
        type=arguments.color_value,
        help="of the --material, or of a matte one: a name such as orange, #rrggbb, or linear R,G,B",
    )


def read_scene(path: str, options: argparse.Namespace, progress: Progress) -> Scene:
    """Read a scene file, with the material that the options ask for in place of its own."""
    material: MaterialLike | None = options.material
    if options.color is not None:
        name = "matte" if options.material is None else options.material
        material = Material.named(name, options.color)
    return as_scene(path, material, progress, options.smooth)


def setting_values(options: argparse.Namespace) -> dict[str, Any]:
    """Return the settings that were given, but for those that the command line uses itself."""
    return {name: getattr(options, name) for name in RENDER_OPTIONS}


def add_display(command: argparse.ArgumentParser) -> None:
    """Add the options of display."""
    command.add_argument(
        "--gamma", type=arguments.gamma, default=2.2, help='for png and jpg: a number or "srgb"'
    )
    command.add_argument(
        "--exposure", type=arguments.exposure, default=0.0, help="stops, applied when saving"
    )
    command.add_argument("--tone", choices=TONES, default="none", help="tone curve, for png and jpg")
    command.add_argument(
        "--white-balance",
        type=arguments.white_balance,
        metavar="KELVIN|R,G,B",
        help="color temperature of the light, or a gray color of the picture, that becomes neutral",
    )


def display_of(options: argparse.Namespace) -> Display:
    """Return how pictures are shown."""
    return Display(options.gamma, options.exposure, options.tone, options.white_balance)


def _add_setting(command: argparse.ArgumentParser, name: str, setting: Setting) -> None:
    """Add the option of a setting that has one."""
    how: dict[str, Any] = {"help": setting.option, "default": setting.default}
    flag = setting.flag or name
    if setting.type == "bool | str" and setting.default == AUTO and name not in PARSERS:
        command.add_argument(f"--{flag}", f"--no-{flag}", action=arguments.Flag, **how)
        return
    if setting.type.startswith("bool") and name not in PARSERS:
        how["action"] = "store_true"
    elif setting.flag:
        how.update(action=arguments.Several, dest=name, metavar="NAME")
    else:
        how["type"] = PARSERS.get(name) or TYPES[setting.type.split(" ")[0]]
        how["choices"] = setting.choices
        how["metavar"] = METAVARS.get(name)
    command.add_argument("--" + flag.replace("_", "-"), **how)
