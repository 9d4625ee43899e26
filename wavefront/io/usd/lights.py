"""Lights of USD: those at points and at infinity, and shapes that emit light."""

from __future__ import annotations

import math
from copy import copy
from typing import Any

import numpy as np

from ...arrays.vec import Doubles, luminance
from ...bsdfs import Diffuse
from ...colors.spectrum import blackbody
from ...lights import DirectionalLight, Environment, Light, PointLight, SpotLight
from ...materials import Material
from ...scene.loss import NOT_HONORED
from ...shapes import Disk, Rectangle, Shape, Sphere
from ...shapes.transform import Matrix
from ...textures import Texture
from ...textures.base import BaseTexture
from ..description.placing import moved_raw
from ..repair import RawMesh, build
from ..sources import GRAY
from ..surfaces import revolved, slope
from .gprims import along
from .materials import Materials
from .values import check_even, mean_scale, value_of

# what inputs are of a light without the schema that has them; of its own schema, usd-core knows the defaults
ABSENT = {"shaping:cone:angle": 90.0, "shaping:cone:softness": 0.0, "texture:format": "automatic"}
# inputs that are not read, by the values with which they change nothing
UNREAD = {"diffuse": 1.0, "specular": 1.0, "shaping:focus": 0.0, "shaping:ies:file": None}
KELVIN = 1e3, 1e6  # color temperatures; lower ones are clamped by usd-core, too
LEAST = 1e-3  # meters, in place of a size of 0
TINTED = "materialGlowTintsLight"  # what the emission of a material does to the light of its mesh
BLACK = Material(Diffuse(0.0))


class Lamp:
    """A light of a stage.

    Parameters
    ----------
    materials
        Of the stage; they read images.
    prim, matrix
        The light, and the matrix that places it in the scene.
    unit
        Meters per unit of the stage, by which the matrix multiplies lengths.
    """

    def __init__(self, materials: Materials, prim: Any, matrix: Matrix, unit: float) -> None:
        self.materials, self.prim, self.matrix, self.unit = materials, prim, matrix, unit
        self.name, self.center = str(prim.GetName()), matrix[:3, 3]
        self.scale = np.linalg.norm(matrix[:3, :3], axis=0)  # of lengths along each axis
        with np.errstate(all="ignore"):
            self.axes = matrix[:3, :3] / self.scale

    def light(self) -> Light | Shape | None:
        """Return the light, or a shape that emits it."""
        self.plain_inputs()
        make, *sizes = LAMPS[str(self.prim.GetTypeName())]
        for name in sizes:
            if self.of(name) == 0 and not self.of("normalize"):
                self.lose(f"inputs:{name} is 0 and gives no light", "left out")
                return None
        made: Light | Shape | None = make(self)
        return made

    def plain_inputs(self) -> None:
        """Note inputs that are not honored."""
        for name, usual in UNREAD.items():
            if value_of(self.prim, self.materials.time, f"inputs:{name}", usual) != usual:
                self.lose(f"inputs:{name}")

    def lose(self, what: str, done: str = NOT_HONORED) -> None:
        """Note what is not honored."""
        self.materials.lose(self.prim, what, done)

    def of(self, name: str) -> Any:
        """Return an input."""
        return value_of(self.prim, self.materials.time, f"inputs:{name}", ABSENT.get(name))

    def flag(self, name: str) -> bool:
        """Return an attribute that is no input."""
        return bool(value_of(self.prim, self.materials.time, name, False))

    def length(self, name: str, axis: int | None = None) -> float:
        """Return a length along an axis of the light, or in all directions, in the scene's units."""
        scale = mean_scale(self.matrix) if axis is None else self.scale[axis]
        return float(self.of(name)) * float(scale)

    def size(self, name: str, axis: int | None = None) -> float:
        """Return such a length; a small one in place of 0, through which the power of `normalize` passes."""
        length = self.length(name, axis)
        if length == 0:
            self.lose(f"inputs:{name} is 0", f"{LEAST:g} meters in its place")
        return length or LEAST

    def strength(self, area: float = 1.0) -> Doubles:
        """Return the radiance (3,), which `normalize` divides by the area, in the scene's units."""
        return self.color() / (area / self.unit**2 if self.of("normalize") else 1.0)

    def color(self) -> Doubles:
        """Return the radiance (3,) without `normalize`."""
        color = np.asarray(self.of("color"), float) * float(self.of("intensity"))
        color = color * 2.0 ** float(self.of("exposure"))
        if self.of("enableColorTemperature"):
            warm, place = float(self.of("colorTemperature")), str(self.prim.GetPath())
            kelvin = self.materials.files.losses.within("inputs:colorTemperature", warm, *KELVIN, place)
            white = blackbody(float(kelvin))
            color = color * (white / luminance(white))
        return color

    @property
    def cone(self) -> float:
        """The angle from the axis in which it shines, degrees."""
        return float(self.of("shaping:cone:angle"))

    def plain(self, cone: bool = True, image: bool = True) -> None:
        """Note a cone or an image that is not honored."""
        if cone and self.cone < 90:
            self.lose("inputs:shaping:cone:angle")
        if image and self.of("texture:file") is not None:
            self.lose("inputs:texture:file")


def _distant(lamp: Lamp) -> Light:
    angle = float(lamp.of("angle"))
    spread = math.pi * math.sin(math.radians(angle) / 2) ** 2
    factor = 1.0 if lamp.of("normalize") or not spread else spread
    return DirectionalLight(-lamp.axes[:, 2], lamp.strength(lamp.unit**2) * factor, angle=angle)


def _dome(lamp: Lamp) -> Light:
    file, bright = lamp.of("texture:file"), lamp.strength(lamp.unit**2)
    if lamp.of("texture:format") not in ("automatic", "latlong"):
        lamp.lose("inputs:texture:format; 'latlong' in its place")
    if file is None:
        return Environment(bright)
    image = lamp.materials.pixels(lamp.prim, file) or GRAY
    return Environment(image.codes, transform=lamp.axes, scale=bright)


def _ball(lamp: Lamp) -> Light | Shape:
    check_even(lamp.matrix, lamp.lose)
    lamp.plain(cone=False)
    radius = lamp.length("radius")
    point = radius == 0 or lamp.flag("treatAsPoint")
    if not point and lamp.cone >= 90:
        glow = lamp.strength(4 * math.pi * radius**2)
        return Sphere(lamp.center, radius, emission=glow, name=lamp.name)
    if not point:
        lamp.lose("its radius; a SpotLight in its place")
    # the radiance times π radius²; `normalize` divides it by the area, of which that is a fourth
    intensity = lamp.color() * (lamp.unit**2 / 4 if lamp.of("normalize") else math.pi * radius**2)
    if lamp.cone >= 90:
        return PointLight(lamp.center, intensity)
    softness = min(max(float(lamp.of("shaping:cone:softness")), 0.0), 1.0)
    axis = -lamp.axes[:, 2]
    return SpotLight(lamp.center, intensity, direction=axis, angle=2 * lamp.cone, blend=softness)


def _disk(lamp: Lamp) -> Shape:
    check_even(lamp.matrix, lamp.lose)
    lamp.plain()
    radius = lamp.size("radius")
    glow = lamp.strength(math.pi * radius**2)
    return Disk(lamp.center, -lamp.axes[:, 2], radius, emission=glow, name=lamp.name)


def _rectangle(lamp: Lamp) -> Shape:
    lamp.plain(image=False)
    width, height = lamp.size("width", 0), lamp.size("height", 1)
    glow: Any = lamp.strength(width * height)
    file = lamp.of("texture:file")
    image = None if file is None else lamp.materials.pixels(lamp.prim, file)
    if image is not None:
        glow = Texture(image, wrap="clamp", scale=glow)
    x, y = lamp.axes[:, 0] * width, lamp.axes[:, 1] * height
    return Rectangle(lamp.center + x / 2 - y / 2, -x, y, emission=glow, name=lamp.name)


def _cylinder(lamp: Lamp) -> Shape | None:
    """Return the side of a cylinder about x; its ends do not shine."""
    lamp.plain()
    if lamp.flag("treatAsLine"):
        lamp.lose("treatAsLine")
    along_x, across = float(lamp.scale[0]), math.sqrt(lamp.scale[1] * lamp.scale[2])
    half = lamp.size("length", 0) / along_x / 2
    radius = float(lamp.of("radius")) or lamp.size("radius") / across
    side = along("X", revolved(lamp.name, [slope((radius, radius), (-half, half))]))
    side.emission = lamp.strength(4 * math.pi * radius * across * half * along_x)
    return build("", moved_raw(side, lamp.matrix), lamp.materials.files.losses)


def is_light(prim: Any) -> bool:
    """Return whether a mesh or a solid is a light, as by `MeshLightAPI`."""
    from pxr import UsdLux

    return bool(prim.HasAPI(UsdLux.LightAPI))


def light_up(lamp: Lamp, raws: list[RawMesh]) -> None:
    """Make the meshes of a prim emit the light that it is, as `light:materialSyncMode` says.

    Source: OpenUSD, UsdLux, LightAPI and MeshLightAPI.
    """
    lamp.plain_inputs()
    lamp.plain()
    corners = np.concatenate([moved_raw(raw, lamp.matrix).vertices[raw.faces] for raw in raws])
    sides = corners[:, 1:] - corners[:, :1]
    glow = lamp.strength(float(np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1).sum() / 2))
    mode = str(value_of(lamp.prim, lamp.materials.time, "light:materialSyncMode", TINTED))
    for raw in raws:
        if mode == "noMaterialResponse":
            raw.material, raw.emission = BLACK, None
        elif mode != TINTED and raw.emission is not None:
            lamp.lose(f"light:materialSyncMode {mode!r}", "the light in place of the material's own")
            raw.emission = None
        raw.emission = _tinted(raw.emission, glow, lamp)


def _tinted(own: Any, glow: Doubles, lamp: Lamp) -> Any:
    """Return the light of a mesh whose material may have light of its own, which it colors."""
    if own is None:
        return glow
    if isinstance(own, Texture):
        tinted = copy(own)
        tinted.scale = own.scale * glow
        return tinted
    if isinstance(own, BaseTexture):
        lamp.lose("the colors of its emission")
        return glow
    return np.asarray(own, float) * glow


LAMPS: dict[str, tuple[Any, ...]] = {  # what makes each type, and the inputs that are its size
    "SphereLight": (_ball, "radius"),
    "DiskLight": (_disk, "radius"),
    "RectLight": (_rectangle, "width", "height"),
    "CylinderLight": (_cylinder, "length", "radius"),
    "DistantLight": (_distant,),
    "DomeLight": (_dome,),
}
