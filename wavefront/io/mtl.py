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
import re
from collections.abc import Iterable

from ..core.errors import SceneError, passed_limit, printable
from ..core.files import decode_text
from .description.appearance import MaterialSpec
from .description.mtl.entry import Entry
from .description.mtl.keywords import LEFT_OUT
from .description.mtl.materials import spec
from .losses import Losses
from .sources import SceneFiles


def libraries(files: SceneFiles, lines: Iterable[str]) -> dict[str, MaterialSpec]:
    """Read the material files that lines of a file name; missing ones are noted."""
    materials: dict[str, MaterialSpec] = {}
    names = (name for line in lines for name in _names(files, line))
    for library in dict.fromkeys(names):
        try:
            file = files.find(library)
            exists = os.path.exists(file)  # also False for invalid names
        except SceneError as error:
            if passed_limit(error):
                raise
            files.losses.note(f"material file {library!r}: {files.brief(error)}", done=LEFT_OUT)
            continue
        if not exists:
            files.losses.note(f"material file {library!r}", value="missing", done=LEFT_OUT)
            continue
        materials.update(specs(parse(file, decode_text(files.read(file)), files.losses, files), files.losses))
    return materials


def _names(files: SceneFiles, line: str) -> list[str]:
    """Return the material files of a line: one, whose name may contain blanks or be quoted, or several."""
    line = line.strip('"')
    joined = os.path.join(os.path.dirname(files.name), line)
    names = re.split(r"(?<=\.mtl)\s+", line.strip(), flags=re.IGNORECASE)  # in linear time
    files_named = [name for name in names if name.lower().endswith(".mtl")]
    return files_named if len(files_named) > 1 and not os.path.exists(joined) else [line]


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
