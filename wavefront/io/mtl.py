"""MTL text -> materials and emission, by material name.

How an MTL material is read:

- `Ke` is emission. `Kd` is the reflectance of a matte surface, multiplied by `map_Kd`; a black `Kd`
  beside a `map_Kd` counts as white, since some exporters write that.
- `illum` 4, 6, 7 and 9 are glass with the index `Ni` (1.5 when absent), tinted by `Tf`, rough by `Pr`. But
  some programs write one of these for all materials: without a `Tf` or an `Ni` other than 1, a surface that
  has a `d 1`, a `map_Kd`, or a `Kd` that is not black and no less opacity, is none.
- `illum` 3, 5 and 8 are mirrors of reflectance `Ks`, if `Ks` is not black and there is no `Pr` or `Pm`.
- `illum` 0 and 1 mean no highlight, and so does an `Ns` of 0, which MeshLab writes beside `Ks 1 1 1`: such a
  surface is matte, whatever its `Ks`.
- All others, and surfaces without an `illum`, have a glossy coat over the matte part if `Ks` or a `map_Ks`
  is not black, by the rules of Blender's importer (obj_import_mtl.cc, set_bsdf_socket_values). The
  reflectance of the coat along the normal is 0.08 · `Ks`, its roughness 1 - √(`Ns` / 1000). Without an `Ns`
  the roughness is 1, where Blender has 0 if `illum` is 2. Below a reflectance of 0.02 the coat is also
  weaker at grazing angles, as in S. Lagarde and C. de Rousiers 2014, "Moving Frostbite to PBR". `map_Ks`
  counts by its luminance.
- `Pr Pm Ps Pc Pcr` and their maps, `norm` and `map_d` (the PBR extension) are parameters of `Principled`;
  `aniso` and its map are named in a warning. `Pr` replaces `Ns`. Beside `Pr` or `Pm`, a surface without a
  highlight keeps the default one of reflectance 0.04.
- Opacity is `d`; without a `d` it is 1 - `Tr`, except that `Tr 1` alone means opaque: that is how
  MeshLab writes it, and an invisible material would be useless. A surface that is less
  than opaque and has an index `Ni` other than 1 is glass.
- `norm` is a normal map. `bump`, or `map_Bump`, contains heights: 1 stands for `-bm` (1 when absent) scene
  units. But an image that looks like a normal map is one, because Blender writes normal maps so, and `-bm` is
  then its strength.
- `Ns` affects only the gloss, and `Ni` only glass.
- A line that is damaged is left out, which is noted. `Kd xyz` and the like are CIE XYZ.
- An image that is missing or damaged is noted. `map_Kd` is gray then, and other maps are left out; so is the
  emission of a `map_Ke`.
- `map_d` counts by the alpha of its image, and by its luminance where it has none.
- Images are sRGB where they are colors, data elsewhere. The options -s -o -clamp -mm -imfchan -bm are read.

All other properties of a file are named in one warning.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..arrays.vec import Doubles
from ..bsdfs import Dielectric, Diffuse, Mirror
from ..core.errors import SceneError, exact, passed_limit, printable
from ..materials import Material
from ..textures.image import Texture
from ..textures.normal_map import BaseNormalMap, BumpMap, NormalMap
from .description.appearance import MaterialSpec, build_material
from .losses import Losses
from .mtl_checks import COLORS, LEFT_OUT, NUMBERS, mended
from .sources import GRAY, SceneFiles
from .text_lines import NUMBER

# values of `illum`
GLASS = (4, 6, 7, 9)
MIRROR = (3, 5, 8)
NO_HIGHLIGHT = (0, 1)
LARGEST_ILLUM = 9

GLASS_IOR = 1.5
MATTE = 0.5  # default reflectance
KS_F0 = 0.08  # the reflectance of `Ks 1`
LEAST_F0 = 0.02  # of dielectrics; a lower reflectance is weaker at all angles
LARGEST_NS = 1000.0
# values without an effect
NEUTRAL = {"ka": 0.0, "kd": 0.0, "ks": 0.0, "tf": 1.0, "d": 1.0, "tr": 0.0, "sharpness": 60.0}

# keyword of a number, keyword of its map, and its name in Principled
PBR = (
    ("pr", "map_pr", "roughness"),
    ("pm", "map_pm", "metallic"),
    ("ps", "map_ps", "sheen"),
    ("pc", "map_pc", "clearcoat"),
    ("pcr", "map_pcr", "clearcoat_roughness"),
    ("aniso", "map_aniso", "anisotropy"),
)
# number of words of a map's options; options not listed here take up to three numbers
OPTIONS = {"-blendu": 1, "-blendv": 1, "-boost": 1, "-cc": 1, "-clamp": 1, "-imfchan": 1, "-mm": 2}
OPTIONS |= {"-texres": 1, "-type": 1, "-bm": 1}
READ = frozenset(("-s", "-o", "-mm", "-clamp", "-imfchan"))
BUMP_MAPS = ("norm", "map_bump", "bump")  # keywords whose maps have a multiplier, -bm
WHOLE = ("map_kd", "map_ke", "map_ks", "norm")  # keywords whose maps are not one channel of an image
MAPS = {*WHOLE, *BUMP_MAPS, "map_d", *(image for _, image, _ in PBR)}  # keywords whose images are read
CHANNELS: dict[str, Any] = {"r": 0, "g": 1, "b": 2, "m": 3, "l": "luminance"}


@dataclass
class Entry:
    """One material as written: keyword in lower case -> (keyword, line number, the rest of the line)."""

    file: str
    name: str
    lines: dict[str, tuple[str, int, str]] = field(default_factory=dict)
    read: set[str] = field(default_factory=set)  # keywords that the material uses
    idle_options: set[str] = field(default_factory=set)  # options of maps that are not honored
    images: dict[str, Any] = field(default_factory=dict)  # of maps: arrays, or a `StoredImage`
    files: SceneFiles | None = None  # None where all maps were read already
    losses: Losses = field(default_factory=lambda: Losses(""))

    def where(self, key: str) -> str:
        """Return file, line (if there is one) and keyword for a message."""
        keyword, number, _ = self.lines[key]
        return f"{self.file} line {number}: {keyword}" if number else f"{self.file}: {keyword}"

    def note(self, key: str, value: str, done: str) -> None:
        """Note the value of a line that is changed or left out."""
        place, _, keyword = self.where(key).rpartition(": ")
        self.losses.note(keyword, place, value, done)

    def has(self, *keys: str) -> bool:
        """Return whether any of the keywords occurs."""
        return any(key in self.lines for key in keys)

    def leave_out(self, key: str, error: SceneError) -> None:
        """Leave out a line that cannot be read, which is noted."""
        if passed_limit(error):
            raise error
        self.losses.note(str(error).removeprefix(f"{self.where(key)}: "), self.where(key), done=LEFT_OUT)
        del self.lines[key]

    def mend(self) -> None:
        """Replace or leave out lines that are damaged, and read the images of maps."""
        for key, (keyword, number, rest) in list(self.lines.items()):
            if key in COLORS or key in NUMBERS:
                better, done = mended(key, rest)
                if done:
                    self.note(key, repr(rest), done)
                if better is None:
                    del self.lines[key]
                else:
                    self.lines[key] = keyword, number, better if done or "xyz" in rest else rest
            elif key in MAPS and key not in self.images and not _map(self, key)[1]:
                self.note(key, "without a file", LEFT_OUT)
                del self.lines[key]
            elif key in MAPS:
                self.read_image(key)

    def numbers(self, key: str) -> list[float] | None:
        """Return the numbers of a line, None if there is no such line."""
        if key not in self.lines:
            return None
        self.read.add(key)
        return [float(word) for word in self.lines[key][2].partition("#")[0].split()]

    def number(self, key: str, default: float) -> float:
        """Return the first number of a line."""
        values = self.numbers(key)
        return default if values is None else values[0]

    def color(self, key: str, default: float, high: float = 1.0) -> Doubles:
        """Return a color (3,), clamped to [0, `high`] with a warning."""
        values = self.numbers(key)
        if values is None:
            return np.full(3, default)
        color = np.broadcast_to(np.array(values), 3)
        limited = np.clip(color, 0, high)
        if (limited != color).any():
            limit = f"in [0, {high:g}]" if np.isfinite(high) else "at least 0"
            self.note(key, self.lines[key][2], f"clamped, as it must be {limit}")
        return limited

    def texture(self, key: str, scale: Any = 1.0, kind: str = "color") -> Texture | None:
        """Return the texture of a map of the kind "color", "scalar" or "data", None if there is none."""
        if key not in self.lines:
            return None
        options, _ = _map(self, key)
        self.read.add(key)
        base, gain = self._option(key, options, "-mm", [0.0, 1.0])
        transform = self._placing(key, options)
        channel = self._channel(key, options) if kind == "scalar" else None
        try:
            return Texture(
                self.images[key],
                srgb=kind == "color",
                wrap="clamp" if options.get("-clamp") == ["on"] else "repeat",
                transform=transform,
                channel=channel,
                scale=np.asarray(scale) * gain,
                offset=np.asarray(scale) * base,
            )
        except SceneError as error:
            self.leave_out(key, error)
            return None

    def read_image(self, key: str) -> None:
        """Read the image of a map, unless that was done; without one the map is left out, or gray."""
        name = _map(self, key)[1]
        if not name or key in self.images:
            return
        files = self.files or SceneFiles(self.file, losses=self.losses)
        instead = GRAY if key == "map_kd" else None
        try:
            image = files.picture(name, self.file, self.where(key), instead)
        except SceneError as error:
            raise SceneError(f"{self.where(key)}: {error}") from error
        if image is not None:
            self.images[key] = image
            return
        del self.lines[key]
        if key == "map_ke":
            self.lines.pop("ke", None)

    def multiplier(self, key: str) -> float:
        """Return the option -bm of a map."""
        options, _ = _map(self, key)
        return self._option(key, options, "-bm", [1.0])[0]

    def _option(
        self, key: str, options: dict[str, list[str]], name: str, default: list[float]
    ) -> list[float]:
        """Return the numbers of an option of a map; those that are not written are the last of `default`."""
        words = options.get(name, [])
        found = [float(word) for word in words if NUMBER.fullmatch(word)]
        if len(found) < len(words) or not np.isfinite(found).all():
            self.note(key, f"with {name} {' '.join(words)}", "without that option")
            found = []
        return found + default[len(found) :]

    def _placing(self, key: str, options: dict[str, list[str]]) -> Doubles | None:
        """Return the transform (3, 3) of texture coordinates by -s and -o, None without them."""
        if "-s" not in options and "-o" not in options:
            return None
        scale, offset = (
            self._option(key, options, name, [default] * 3) for name, default in (("-s", 1.0), ("-o", 0.0))
        )
        return np.array([[scale[0], 0, offset[0]], [0, scale[1], offset[1]], [0, 0, 1]])

    def _channel(self, key: str, options: dict[str, list[str]]) -> Any:
        """Return the channel of the image by -imfchan: a number, or "luminance".

        By default it is alpha for `map_d`, where there is one, and "luminance".
        """
        has_alpha = key == "map_d" and self.images[key].codes.shape[2] in (2, 4)
        word = options.get("-imfchan", ["m" if has_alpha else "l"])[0]
        if word not in CHANNELS:
            self.note(key, f"with -imfchan {word}", "without that option")
            word = "m" if has_alpha else "l"
        return CHANNELS[word]

    def unread(self) -> list[str]:
        """Return the keywords, as written, that the material does not support."""
        return [keyword for key, (keyword, _, _) in self.lines.items() if not self._idle(key)]

    def _idle(self, key: str) -> bool:
        if key in self.read:
            return True
        if key in ("ns", "ni"):  # without a gloss or glass they have no effect
            return True
        return key in NEUTRAL and set(self.lines[key][2].split()) <= _spellings(NEUTRAL[key])


def _spellings(value: float) -> set[str]:
    return {f"{value:.{digits}f}" for digits in range(10)} | {f"{value:g}"}


def parse(
    path: str | os.PathLike[str], text: str, losses: Losses, files: SceneFiles | None = None
) -> dict[str, Entry]:
    """Split MTL text into materials; a name may contain spaces. Their maps are among `files`."""
    file, entries = os.fspath(path), {}
    current: Entry | None = None
    for number, line in enumerate(text.split("\n"), 1):
        keyword, rest = _split(line)
        key = keyword.lower()
        if not keyword:
            continue
        if key == "newmtl":
            current = entries[rest] = Entry(file, rest, losses=losses, files=files)
        elif current is None:
            losses.note(keyword, f"{file} line {number}", "before the first newmtl", LEFT_OUT)
        else:
            current.lines[key] = (keyword, number, rest)
    return entries


def _split(line: str) -> tuple[str, str]:
    words = line.split(None, 1)
    if not words or words[0].startswith("#"):
        return "", ""
    return words[0], words[1].strip() if len(words) > 1 else ""


def specs(entries: dict[str, Entry], losses: Losses) -> dict[str, MaterialSpec]:
    """Convert entries to materials; unsupported properties are noted."""
    out: dict[str, MaterialSpec] = {}
    unread: dict[str, str] = {}
    for name, entry in entries.items():
        out[name] = spec(entry)
        out[name].material.name = printable(name)
        for keyword in (*entry.unread(), *sorted(entry.idle_options), *out[name].lost):
            unread.setdefault(keyword, name)
    file = next((entry.file for entry in entries.values()), "")
    for keyword, name in unread.items():
        losses.note(keyword, f"{file}, material {name!r}")
    return out


def spec(entry: Entry) -> MaterialSpec:
    """Convert one entry to a material; the keywords that it uses are added to `entry.read`."""
    entry.mend()
    factor = entry.color("ke", 0.0, high=np.inf)
    if "map_ke" in entry.lines and not factor.any():
        factor = np.ones(3)
    texture = entry.texture("map_ke", factor)
    radiance = texture if texture is not None else factor if factor.any() else None
    material, lost = _material(entry)
    material.normal_map = _normal_or_bump_map(entry)
    return MaterialSpec(material, radiance, lost=lost)


def _material(entry: Entry) -> tuple[Material, list[str]]:
    illum = int(entry.number("illum", 2))
    if not 0 <= illum <= LARGEST_ILLUM:
        entry.read.discard("illum")
    ior = entry.number("ni", 1.0)
    extended = entry.has(*(key for keys in PBR for key in keys[:2]))
    if _is_glass(entry, illum, ior):
        return Material(_glass(entry)), []
    if illum in MIRROR and not extended and "ks" in entry.lines and entry.color("ks", 0.0).any():
        return Material(Mirror(entry.color("ks", 0.0)), alpha=_alpha(entry)), []
    physical = entry.has("pr", "map_pr", "pm", "map_pm")
    wanted = _gloss(entry, illum, physical) | _wanted(entry)
    material, lost = build_material(wanted)
    if type(material.bsdf) is not Diffuse and not physical and "roughness" not in wanted:
        # a default gloss would be an invention if the file has none
        material, lost = build_material({**wanted, "roughness": 1.0, "specular": 0.0})
    return material, lost


def _is_glass(entry: Entry, illum: int, ior: float) -> bool:
    if alpha_of_entry(entry) < 1 and ior != 1 and "map_d" not in entry.lines:
        return True
    if illum not in GLASS or "tf" in entry.lines or ior != 1 or alpha_of_entry(entry) < 1:
        return illum in GLASS
    kd = entry.color("kd", 0.0)
    return not ("map_kd" in entry.lines or "d" in entry.lines or kd.any())


def _gloss(entry: Entry, illum: int, physical: bool) -> dict[str, Any]:
    """Return the parameters of `Principled` for the gloss of `Ks` and `Ns`, if there is one."""
    color = _highlight(entry, illum)
    gloss: dict[str, Any] = {}
    if color.any():
        gloss = _specular(entry, float(color.max()))
        if np.ptp(color):
            gloss["specular_color"] = color / color.max()
    if color.any() or (physical and "ns" in entry.lines):
        gloss["roughness"] = 1 - float(np.sqrt(_exponent(entry) / LARGEST_NS))
    return gloss


def _highlight(entry: Entry, illum: int) -> Doubles:
    """Return `Ks`, black where there is no highlight."""
    if illum in NO_HIGHLIGHT or entry.number("ns", LARGEST_NS) == 0:
        entry.read.update(("ks", "map_ks", "map_ns"))
        return np.zeros(3)
    color = entry.color("ks", 0.0)
    return np.ones(3) if "map_ks" in entry.lines and not color.any() else color


def _exponent(entry: Entry) -> float:
    """Return `Ns`, clamped to [0, `LARGEST_NS`]: larger values do not sharpen the highlight."""
    value = entry.number("ns", 0.0)
    if value < 0:
        entry.note("ns", exact(value), "clamped, as it must be at least 0")
    return min(max(value, 0.0), LARGEST_NS)


def _specular(entry: Entry, strength: float) -> dict[str, Any]:
    """Return the index and the strength of a gloss whose largest reflectance is `KS_F0` · `strength`."""
    f0 = KS_F0 * strength
    weight = min(f0 / LEAST_F0, 1.0)
    root = float(np.sqrt(f0 / weight))
    texture = entry.texture("map_ks", weight)
    return {"ior": (1 + root) / (1 - root), "specular": weight if texture is None else texture}


def _wanted(entry: Entry) -> dict[str, Any]:
    """Return the parameters of `Principled` in a file."""
    wanted: dict[str, Any] = {"base_color": _base(entry)}
    for key, image, name in PBR:
        factor = _part(entry, key, 1.0)
        texture = entry.texture(image, factor, "scalar")
        if texture is not None or (key in entry.lines and (factor or name == "roughness")):
            wanted[name] = factor if texture is None else texture
    wanted["alpha"] = _alpha(entry)
    return wanted


def _alpha(entry: Entry) -> Any:
    """Return the opacity: a number or a texture."""
    factor = alpha_of_entry(entry)
    entry.read.update(("d", "tr"))
    texture = entry.texture("map_d", factor, "scalar")
    return factor if texture is None else texture


def _normal_or_bump_map(entry: Entry) -> BaseNormalMap | None:
    """Return the normal map or bump map. If there are both, only `norm` is read."""
    for key in ("norm", "map_bump", "bump"):
        if key in entry.lines:
            is_normal = key == "norm" or _looks_like_normals(entry, key)
            made = _made(entry, key, _normal_map if is_normal else _bump_map)
            if made is not None:
                return made
    return None


def _made(entry: Entry, key: str, make: Callable[[Entry, str], BaseNormalMap | None]) -> BaseNormalMap | None:
    try:
        return make(entry, key)
    except SceneError as error:
        entry.leave_out(key, error)
        return None


def _normal_map(entry: Entry, key: str) -> NormalMap | None:
    texture = entry.texture(key, kind="data")
    return None if texture is None else NormalMap(texture, entry.multiplier(key))


def _bump_map(entry: Entry, key: str) -> BumpMap | None:
    texture = entry.texture(key, kind="scalar")
    return None if texture is None else BumpMap(texture, entry.multiplier(key))


def _looks_like_normals(entry: Entry, key: str) -> bool:
    """Return whether the mean of an image is about (0.5, 0.5, 1), as in normal maps."""
    if "-imfchan" in _map(entry, key)[0]:
        return False
    texture = entry.texture(key, kind="data")
    if texture is None or texture.channels < 3:
        return False
    red, green, blue = texture.mean()
    return abs(red - 0.5) < 0.1 and abs(green - 0.5) < 0.1 and blue > 0.75


def _base(entry: Entry) -> Any:
    color = entry.color("kd", 1.0 if "map_kd" in entry.lines else MATTE)
    texture = entry.texture("map_kd", color if color.any() else 1.0)
    if texture is None:
        return entry.color("kd", MATTE)
    return texture


def _glass(entry: Entry) -> Dielectric:
    alpha_of_entry(entry)
    ior = entry.number("ni", GLASS_IOR)
    entry.read.update(("d", "tr", "kd"))  # glass has no matte part, but files give it a Kd
    return Dielectric(ior, _part(entry, "pr", 0.0), transmittance=entry.color("tf", 1.0))


def _part(entry: Entry, key: str, default: float) -> float:
    """Return a number in [0, 1], clamped with a warning."""
    value = entry.number(key, default)
    if not 0 <= value <= 1:
        entry.note(key, exact(value), "clamped, as it must be in [0, 1]")
    return min(max(value, 0.0), 1.0)


def _map(entry: Entry, key: str) -> tuple[dict[str, list[str]], str]:
    """Split the rest of a map line into its options and the file name, which may contain spaces."""
    rest = entry.lines[key][2]
    options: dict[str, list[str]] = {}
    while rest.startswith("-"):
        option, _, rest = rest.partition(" ")
        words, count = rest.split(), OPTIONS.get(option)
        if count is None:
            count = 0
            while count < 3 and count < len(words) and NUMBER.fullmatch(words[count]):
                count += 1
        options[option] = words[:count]
        rest = (rest.split(None, count) + [""] * (count + 1))[count].strip()
    read = READ | {"-bm"} if key in BUMP_MAPS else READ
    read = read - {"-imfchan"} if key in WHOLE else read
    for option in options.keys() - read:
        entry.idle_options.add(f"{option} of {entry.lines[key][0]}")
    return options, rest


def alpha_of_entry(entry: Entry) -> float:
    """Return the opacity in [0, 1] from `d` and `Tr`, by the rule at the top of this file."""
    if "d" in entry.lines:
        value = entry.number("d", 1.0)
        entry.read.add("tr")
    else:
        clear = entry.number("tr", 0.0)
        value = 1.0 if clear == 1 else 1.0 - clear
    if value == 1:
        entry.read.update(("d", "tr"))
    else:  # only keywords that the material then uses count as read
        entry.read.difference_update(("d", "tr"))
    return value
