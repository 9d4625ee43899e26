"""Lights of USD: those at points and at infinity, and shapes that emit light."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ...arrays.vec import Doubles, luminance
from ...colors.spectrum import blackbody
from ...lights import DirectionalLight, Environment, Light, PointLight, SpotLight
from ...shapes import Disk, Rectangle, Shape, Sphere
from ...shapes.transform import Matrix
from ...textures import Texture
from ..placing import moved_raw
from ..repair import build
from ..sources import GRAY
from ..surfaces import revolved, slope
from .gprims import along
from .materials import Materials
from .values import check_even, mean_scale, value_of

PLAIN: dict[str, Any] = {"inputs:diffuse": 1.0, "inputs:specular": 1.0, "inputs:shaping:focus": 0.0}
PLAIN |= {"inputs:shaping:ies:file": None}  # by their values where they change nothing


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
        for name, usual in PLAIN.items():
            if value_of(self.prim, self.materials.time, name, usual) != usual:
                self.lose(name)
        made: Light | Shape | None = LAMPS[str(self.prim.GetTypeName())](self)
        return made

    def lose(self, what: str) -> None:
        """Note what is not honored."""
        self.materials.lose(self.prim, what)

    def of(self, name: str, default: Any) -> Any:
        """Return an input."""
        return value_of(self.prim, self.materials.time, f"inputs:{name}", default)

    def flag(self, name: str) -> bool:
        """Return an attribute that is no input."""
        return bool(value_of(self.prim, self.materials.time, name, False))

    def length(self, name: str, default: float, axis: int | None = None) -> float:
        """Return a length along an axis of the light, or in all directions, in the scene's units."""
        scale = mean_scale(self.matrix) if axis is None else self.scale[axis]
        return float(self.of(name, default)) * float(scale)

    def strength(self, area: float = 1.0) -> Doubles:
        """Return the radiance (3,), which `normalize` divides by the area, in the scene's units."""
        color = np.asarray(self.of("color", (1, 1, 1)), float) * float(self.of("intensity", 1.0))
        color = color * 2.0 ** float(self.of("exposure", 0.0))
        if self.of("enableColorTemperature", False):
            white = blackbody(float(self.of("colorTemperature", 6500.0)))
            color = color * (white / luminance(white))
        return color / (area / self.unit**2) if self.of("normalize", False) else color

    @property
    def cone(self) -> float:
        """The angle from the axis in which it shines, degrees."""
        return float(self.of("shaping:cone:angle", 90.0))

    def plain(self, cone: bool = True, image: bool = True) -> None:
        """Note a cone or an image that is not honored."""
        if cone and self.cone < 90:
            self.lose("inputs:shaping:cone:angle")
        if image and self.of("texture:file", None) is not None:
            self.lose("inputs:texture:file")


def _distant(lamp: Lamp) -> Light:
    angle = float(lamp.of("angle", 0.53))
    spread = math.pi * math.sin(math.radians(angle) / 2) ** 2
    factor = 1.0 if lamp.of("normalize", False) or not spread else spread
    return DirectionalLight(-lamp.axes[:, 2], lamp.strength(lamp.unit**2) * factor, angle=angle)


def _dome(lamp: Lamp) -> Light:
    file, bright = lamp.of("texture:file", None), lamp.strength(lamp.unit**2)
    if lamp.of("texture:format", "automatic") not in ("automatic", "latlong"):
        lamp.lose("inputs:texture:format; 'latlong' in its place")
    if file is None:
        return Environment(bright)
    image = lamp.materials.pixels(lamp.prim, file) or GRAY
    return Environment(image.codes, transform=lamp.axes, scale=bright)


def _ball(lamp: Lamp) -> Light | Shape:
    check_even(lamp.matrix, lamp.lose)
    lamp.plain(cone=False)
    radius, point = lamp.length("radius", 0.5), lamp.flag("treatAsPoint")
    glow = lamp.strength(4 * math.pi * radius**2)
    if not point and lamp.cone >= 90:
        return Sphere(lamp.center, radius, emission=glow, name=lamp.name)
    if not point:
        lamp.lose("its radius; a SpotLight in its place")
    intensity = glow * (math.pi * radius**2)
    if lamp.cone >= 90:
        return PointLight(lamp.center, intensity)
    softness = min(max(float(lamp.of("shaping:cone:softness", 0.0)), 0.0), 1.0)
    axis = -lamp.axes[:, 2]
    return SpotLight(lamp.center, intensity, direction=axis, angle=2 * lamp.cone, blend=softness)


def _disk(lamp: Lamp) -> Shape:
    check_even(lamp.matrix, lamp.lose)
    lamp.plain()
    radius = lamp.length("radius", 0.5)
    glow = lamp.strength(math.pi * radius**2)
    return Disk(lamp.center, -lamp.axes[:, 2], radius, emission=glow, name=lamp.name)


def _rectangle(lamp: Lamp) -> Shape:
    lamp.plain(image=False)
    width, height = lamp.length("width", 1.0, 0), lamp.length("height", 1.0, 1)
    glow: Any = lamp.strength(width * height)
    file = lamp.of("texture:file", None)
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
    half, radius = float(lamp.of("length", 1.0)) / 2, float(lamp.of("radius", 0.5))
    side = along("X", revolved(lamp.name, [slope((radius, radius), (-half, half))]))
    along_x, y, z = lamp.scale.tolist()
    side.emission = lamp.strength(4 * math.pi * radius * math.sqrt(y * z) * half * along_x)
    return build("", moved_raw(side, lamp.matrix), lamp.materials.files.losses)


LAMPS = {
    "SphereLight": _ball,
    "DiskLight": _disk,
    "RectLight": _rectangle,
    "CylinderLight": _cylinder,
    "DistantLight": _distant,
    "DomeLight": _dome,
}
