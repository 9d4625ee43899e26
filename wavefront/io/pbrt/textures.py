"""Textures of pbrt, and the parameters that may be one."""

from __future__ import annotations

from copy import copy
from typing import Any

import numpy as np

from ...arrays.state import SurfaceInteraction
from ...arrays.vec import Doubles, Floats, dot, f4
from ...core.errors import SceneError
from ...textures.base import BaseTexture
from ...textures.image import UV_SETS, StoredImage, Texture
from ..description.computed import Computed, Value, computed, limits_of, product
from ..description.entity import Entity
from .entities import converts, placement, spectrum, unsupported
from .mappings import Mapped, MappedTexture, Mapping, mapping_of
from .noise import noise

WRAPS: dict[str, Any] = {"repeat": "repeat", "clamp": "clamp", "black": "clamp"}
FILTERS: dict[str, Any] = {"bilinear": "bilinear", "point": "nearest", "trilinear": "bilinear"}
FILTERS |= {"ewa": "bilinear", "EWA": "bilinear"}
DOT = 0.35  # radius of dots in cells of size 1


class Coordinate(BaseTexture, Mapped):
    """One of the two texture coordinates of a mapping."""

    scalar = True

    def __init__(self, mapping: Mapping, axis: int) -> None:
        self.mapping, self.axis, self.reads = mapping, axis, (UV_SETS[mapping.uv_set],)

    def at(self, surface: SurfaceInteraction) -> Floats:
        """Return the coordinates, (n,)."""
        uv: Floats = getattr(surface, self.reads[0])
        a, b, c = self.mapping.transform[self.axis].astype(f4)
        return a * uv[0] + b * uv[1] + c


class Facing(BaseTexture):
    """|cos| of the angle between the surface's normal and a direction."""

    reads, scalar = (), True

    def __init__(self, direction: Doubles) -> None:
        self.direction = direction.astype(f4).reshape(3, 1)

    def limits(self) -> tuple[float, ...]:
        """Return 0 and 1."""
        return 0.0, 1.0

    def at(self, surface: SurfaceInteraction) -> Floats:
        """Return the cosines, (n,)."""
        return np.minimum(np.abs(dot(surface.ng, self.direction)), f4(1))


def blend(a: Any, b: Any, amount: Any) -> Any:
    """Return a where the amount is 0, and b where it is 1."""
    return (f4(1) - amount) * a + amount * b


def square_root(alpha: Any) -> Any:
    """Return the roughness of a given α = roughness²."""
    return np.sqrt(np.clip(alpha, 0, 1))


def fourth_root(alpha: Any) -> Any:
    """Return the roughness where α is the root of the given value."""
    return square_root(square_root(alpha))


def color(entity: Entity, name: str, default: Any, use: str = "albedo") -> Value:
    """Return a parameter that is a number, a color or a texture."""
    if entity.types.get(name) == "texture":
        return _texture(entity, name, default, "spectrum texture")
    return spectrum(entity, name, default, use)


def scalar(entity: Entity, name: str, default: float) -> Value:
    """Return a parameter that is a number or a texture of numbers."""
    if entity.types.get(name) == "texture":
        return _texture(entity, name, default, "float texture")
    return entity.number(name, default)


def _texture(entity: Entity, name: str, default: Any, kind: str) -> Value:
    job = entity.job
    return entity.or_default(default, lambda: job.convert(job.refer(kind, entity.one(name, "", "texture"))))


def operand(entity: Entity, name: str, default: float) -> Value:
    """Return a parameter of a texture, of its own kind."""
    if entity.variant == "float":
        return scalar(entity, name, default)
    return color(entity, name, default, "unbounded")


converts("texture", "constant")(lambda entity: operand(entity, "value", 1.0))


@converts("texture", "scale")
def _scale(entity: Entity) -> Value:
    factor, value = scalar(entity, "scale", 1.0), operand(entity, "tex", 1.0)
    if isinstance(value, Texture) and np.ndim(factor) == 0 and not isinstance(factor, BaseTexture):
        return _scaled(value, float(factor))
    return computed(product, value, factor)


@converts("texture", "mix")
def _mix(entity: Entity) -> Value:
    first, second = (operand(entity, f"tex{i}", i - 1.0) for i in (1, 2))
    return _between(first, second, scalar(entity, "amount", 0.5))


@converts("texture", "checkerboard")
def _checkerboard(entity: Entity) -> Value:
    first, second = (operand(entity, f"tex{i}", 2.0 - i) for i in (1, 2))
    if entity.whole("dimension", 2, 2, 3) == 3:
        entity.lose("dimension 3; the mean in its place")
        return _between(first, second, 0.5)
    fields = np.array([[1.0, 0.0], [0.0, 1.0]], np.float32)  # the top row is v > 1/2
    mapping = mapping_of(entity)
    transform = mapping.transform * np.array([[0.5], [0.5], [1]])  # four fields in a unit square
    texture = MappedTexture(fields, filter="nearest", transform=transform, channel=0, uv_set=mapping.uv_set)
    texture.mapping = mapping
    return _between(first, second, texture)


@converts("texture", "imagemap", harmless="maxanisotropy")
def _imagemap(entity: Entity) -> Value:
    numbers = entity.variant == "float"
    return image(entity, "luminance" if numbers else None)


@converts("texture", "bilerp")
def _bilerp(entity: Entity) -> Value:
    """Return a texture of four values at the corners of the unit square, which goes on beyond it."""
    corners = [
        entity.number(name, value)
        if entity.variant == "float"
        else spectrum(entity, name, value, "unbounded")
        for name, value in (("v00", 0.0), ("v01", 1.0), ("v10", 0.0), ("v11", 1.0))
    ]
    return computed(bilinear, *corners, *_coordinates(entity), rising=False)


@converts("texture", "dots")
def _dots(entity: Entity) -> Value:
    inside, outside = operand(entity, "inside", 1.0), operand(entity, "outside", 0.0)
    inner = Computed(inside_dots, *_coordinates(entity), limits=(0.0, 1.0))
    return _between(outside, inside, inner)


@converts("texture", "directionmix")
def _direction_mix(entity: Entity) -> Value:
    first, second = (operand(entity, f"tex{i}", i - 1.0) for i in (1, 2))
    direction = placement(entity)[:3, :3] @ entity.vector("dir", (0.0, 1.0, 0.0))
    size = np.linalg.norm(direction)
    if not size > 0:
        raise SceneError("dir must not be zero")
    return _between(second, first, Facing(direction / size))


unsupported("texture", "fbm marble ptex windy wrinkled")


def bilinear(v00: Any, v01: Any, v10: Any, v11: Any, s: Any, t: Any) -> Any:
    """Return the value at (s, t) of those at (0, 0), (0, 1), (1, 0) and (1, 1)."""
    one = f4(1)
    return (one - s) * ((one - t) * v00 + t * v01) + s * ((one - t) * v10 + t * v11)


def inside_dots(s: Any, t: Any) -> Any:
    """Return 1 inside of dots of radius 0.35, and 0 elsewhere: one of two cells has a dot, by chance.

    Source: pbrt-v4, the texture "dots".
    """
    column, row = np.floor(s + f4(0.5)), np.floor(t + f4(0.5))
    shift = f4(0.5 - DOT)
    x = s - column - shift * noise(column + f4(1.5), row + f4(2.8))
    y = t - row - shift * noise(column + f4(4.5), row + f4(9.8))
    has_dot = noise(column + f4(0.5), row + f4(0.5)) > 0
    return (has_dot & (x * x + y * y < f4(DOT * DOT))).astype(f4)


def image(entity: Entity, channel: str | None) -> Texture:
    """Return an image texture."""
    file = entity.text("filename", "")
    codes, name = entity.job.picture(entity, file)
    encoding = entity.text("encoding", "sRGB" if file.lower().endswith(".png") else "linear")
    codes = _decoded(codes, encoding)
    wrap = entity.choice("wrap", "repeat", tuple(WRAPS))
    if wrap == "black":
        entity.lose("wrap 'black'; 'clamp' in its place")
    kind, mapping = entity.choice("filter", "bilinear", tuple(FILTERS)), mapping_of(entity)
    texture = MappedTexture(
        StoredImage(codes, name),
        srgb=encoding == "sRGB",
        wrap=WRAPS[wrap],
        filter=FILTERS[kind],
        transform=mapping.transform,
        channel=channel,  # type: ignore[arg-type]
        uv_set=mapping.uv_set,
        max_pixels=entity.job.files.limits.pixels,
    )
    texture.mapping = mapping
    scaled = _scaled(texture, entity.number("scale", 1.0))
    return _scaled(scaled, -1.0, 1.0) if entity.flag("invert") else scaled


def _decoded(codes: Any, encoding: str) -> Any:
    """Return linear values where the encoding of 8 or 16 bits is a power; others are as they are."""
    if not encoding.startswith("gamma"):
        if encoding not in ("sRGB", "linear"):
            raise SceneError(f"encoding is {encoding!r}; it must be sRGB, linear or gamma with a number")
        return codes
    if codes.dtype.kind != "u":
        return codes
    try:
        exponent = float(encoding.split()[1])
    except (IndexError, ValueError):
        exponent = 0.0
    if not 0 < exponent < 100:
        raise SceneError(f"encoding is {encoding!r}; gamma needs a number above 0")
    return (codes / np.float32(np.iinfo(codes.dtype).max)).astype(np.float32) ** np.float32(exponent)


def _scaled(texture: Texture, factor: float, offset: float = 0.0) -> Texture:
    """Return a texture times a factor, plus an offset."""
    other = copy(texture)
    other.scale, other.offset = texture.scale * f4(factor), texture.offset * f4(factor) + f4(offset)
    return other


def _between(first: Value, second: Value, amount: Value) -> Value:
    value = computed(blend, first, second, amount, rising=False)
    if isinstance(value, Computed):
        ends = [limits_of(side) for side in (first, second)]
        if all(ends):
            value._limits = (min(end[0] for end in ends), max(end[1] for end in ends))
    return value


def _coordinates(entity: Entity) -> tuple[Coordinate, Coordinate]:
    """Return both texture coordinates."""
    mapping = mapping_of(entity)
    return Coordinate(mapping, 0), Coordinate(mapping, 1)
