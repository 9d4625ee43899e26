"""Textures of pbrt, and the parameters that may be one."""

from __future__ import annotations

from collections.abc import Callable
from copy import copy
from typing import Any

import numpy as np

from ...arrays.state import SurfaceInteraction
from ...arrays.vec import Doubles, Floats, f4
from ...core.errors import SceneError
from ...textures.base import BaseTexture
from ...textures.image import Texture
from .entities import Entity, Job, converts, unsupported

Value = Any  # a number, a color (3,) or a texture


class Computed(BaseTexture):
    """A function of textures and constants, such as their product."""

    def __init__(self, function: Callable[..., Any], *parts: Any, limits: tuple[float, ...] = ()) -> None:
        self.function, self._limits = function, limits
        self.parts = [
            part if isinstance(part, BaseTexture) else np.asarray(part, f4).reshape(-1, 1)  # (1, 1) or (3, 1)
            for part in parts
        ]
        textures = [part for part in parts if isinstance(part, BaseTexture)]
        self.reads = tuple(dict.fromkeys(field for each in textures for field in each.reads))
        self.scalar = all(
            part.scalar if isinstance(part, BaseTexture) else np.ndim(part) == 0 for part in parts
        )

    def __repr__(self) -> str:
        """Name the function."""
        return f"<{self.function.__name__} of textures>"

    def limits(self) -> tuple[float, ...]:
        """Return the limits, where they are known."""
        return self._limits

    def at(self, surface: SurfaceInteraction) -> Floats:
        """Return the values of the function, (n,) or (3, n)."""
        assert surface.uv is not None
        found = (part.at(surface) if isinstance(part, BaseTexture) else part for part in self.parts)
        values = self.function(*(np.atleast_2d(each) for each in found))
        values = np.broadcast_to(values, (len(values), surface.uv.shape[1])).astype(f4)
        return values[0] if self.scalar else np.broadcast_to(values, (3, values.shape[1]))


def product(a: Any, b: Any) -> Any:
    """Return a·b."""
    return a * b


def clipped_product(a: Any, b: Any) -> Any:
    """Return a·b in [0, 1]."""
    return np.clip(a * b, 0, 1)


def blend(a: Any, b: Any, amount: Any) -> Any:
    """Return a where the amount is 0, and b where it is 1."""
    return (f4(1) - amount) * a + amount * b


def square_root(alpha: Any) -> Any:
    """Return the roughness of a given α = roughness²."""
    return np.sqrt(np.clip(alpha, 0, 1))


def fourth_root(alpha: Any) -> Any:
    """Return the roughness where α is the root of the given value."""
    return square_root(square_root(alpha))


def limits_of(value: Value) -> tuple[float, ...]:
    """Return the least and the greatest value; () where they are not known."""
    if isinstance(value, BaseTexture):
        return value.limits()
    return float(np.min(value)), float(np.max(value))


def computed(function: Callable[..., Any], *parts: Value, rising: bool = True) -> Value:
    """Return a function of numbers, colors and textures, that rises with all of them where `rising`."""
    if not any(isinstance(part, BaseTexture) for part in parts):
        return function(*parts)
    limits = [limits_of(part) for part in parts]
    known = rising and all(limits)
    ends = tuple(float(function(*end)) for end in zip(*limits, strict=True)) if known else ()
    return Computed(function, *parts, limits=ends)


def clipped(value: Value, factor: float = 1.0) -> Value:
    """Return a value times a factor, clamped to [0, 1]."""
    limits = limits_of(value)
    if factor == 1 and limits and limits[0] >= 0 and limits[1] <= 1:
        return value
    return computed(clipped_product, value, factor)


def color(entity: Entity, name: str, default: Any, job: Job, use: str = "albedo") -> Value:
    """Return a parameter that is a number, a color or a texture."""
    given = entity.values.get(name)
    if given is not None and given.type == "texture":
        return job.convert(job.refer("spectrum texture", entity.get(name, ("texture",))[0]))
    return entity.spectrum(name, default, job, use)


def scalar(entity: Entity, name: str, default: float, job: Job) -> Value:
    """Return a parameter that is a number or a texture of numbers."""
    given = entity.values.get(name)
    if given is not None and given.type == "texture":
        return job.convert(job.refer("float texture", entity.get(name, ("texture",))[0]))
    return entity.number(name, default)


def part(entity: Entity, name: str, default: float, job: Job) -> Value:
    """Return a parameter of a texture, of its own kind."""
    if entity.kind == "float texture":
        return scalar(entity, name, default, job)
    return color(entity, name, default, job, "unbounded")


converts("texture", "constant")(lambda entity, job: part(entity, "value", 1.0, job))


@converts("texture", "scale")
def _scale(entity: Entity, job: Job) -> Value:
    factor, value = scalar(entity, "scale", 1.0, job), part(entity, "tex", 1.0, job)
    if isinstance(value, Texture) and np.ndim(factor) == 0 and not isinstance(factor, BaseTexture):
        return _scaled(value, float(factor))
    return computed(product, value, factor)


@converts("texture", "mix")
def _mix(entity: Entity, job: Job) -> Value:
    one, two = (part(entity, f"tex{i}", i - 1.0, job) for i in (1, 2))
    return _between(one, two, scalar(entity, "amount", 0.5, job))


@converts("texture", "checkerboard")
def _checkerboard(entity: Entity, job: Job) -> Value:
    one, two = (part(entity, f"tex{i}", 2.0 - i, job) for i in (1, 2))
    if entity.whole("dimension", 2, 2, 3) == 3:
        entity.lose("dimension 3; the mean in its place")
        return _between(one, two, 0.5)
    transform = _mapping(entity) * np.array([[0.5], [0.5], [1]])  # four fields in a unit square
    fields = np.array([[1.0, 0.0], [0.0, 1.0]], np.float32)  # the top row is v > 1/2
    return _between(one, two, Texture(fields, filter="nearest", transform=transform, channel=0))


@converts("texture", "imagemap")
def _imagemap(entity: Entity, job: Job) -> Value:
    entity.harmless("maxanisotropy")
    numbers = entity.kind == "float texture"
    return image(entity, job, "luminance" if numbers else None)


unsupported("texture", "bilerp directionmix dots fbm marble ptex windy wrinkled")


def image(entity: Entity, job: Job, channel: str | None) -> Texture:
    """Return an image texture."""
    path = job.find(entity.text("filename", ""))
    codes = job.files.image(path)
    encoding = entity.text("encoding", "sRGB" if path.suffix.lower() == ".png" else "linear")
    if codes.dtype.kind == "u" and encoding.startswith("gamma"):
        exponent = _exponent(encoding)
        codes = (codes / np.float32(np.iinfo(codes.dtype).max)).astype(np.float32) ** np.float32(exponent)
    elif encoding not in ("sRGB", "linear") and not encoding.startswith("gamma"):
        raise SceneError(f"encoding is {encoding!r}; it must be sRGB, linear or gamma with a number")
    wrap = entity.choice("wrap", "repeat", ("repeat", "clamp", "black"))
    if wrap == "black":
        entity.lose("wrap 'black'; 'clamp' in its place")
    kind = entity.choice("filter", "bilinear", ("bilinear", "point", "trilinear", "ewa", "EWA"))
    texture = Texture(
        codes,
        srgb=encoding == "sRGB",
        wrap="clamp" if wrap == "black" else wrap,  # type: ignore[arg-type]
        filter="nearest" if kind == "point" else "bilinear",
        transform=_mapping(entity),
        channel=channel,  # type: ignore[arg-type]
        max_pixels=job.files.limits.pixels,
    )
    scaled = _scaled(texture, entity.number("scale", 1.0))
    return _scaled(scaled, -1.0, 1.0) if entity.flag("invert") else scaled


def _exponent(encoding: str) -> float:
    try:
        value = float(encoding.split()[1])
    except (IndexError, ValueError):
        value = 0.0
    if not 0 < value < 100:
        raise SceneError(f"encoding is {encoding!r}; gamma needs a number above 0")
    return value


def _scaled(texture: Texture, factor: float, offset: float = 0.0) -> Texture:
    """Return a texture times a factor, plus an offset."""
    other = copy(texture)
    other.scale, other.offset = texture.scale * f4(factor), texture.offset * f4(factor) + f4(offset)
    return other


def _between(one: Value, two: Value, amount: Value) -> Value:
    value = computed(blend, one, two, amount, rising=False)
    if isinstance(value, Computed):
        ends = [limits_of(each) for each in (one, two)]
        if all(ends):
            value._limits = (min(end[0] for end in ends), max(end[1] for end in ends))
    return value


def _mapping(entity: Entity) -> Doubles:
    """Return the transform of texture coordinates, (3, 3)."""
    kind = entity.choice("mapping", "uv", ("uv", "spherical", "cylindrical", "planar"))
    if kind != "uv":
        entity.lose(f"mapping {kind!r}; 'uv' in its place")
        entity.harmless("v1 v2")
    numbers = [entity.number(name, default) for name, default in _UV]
    scale_u, scale_v, shift_u, shift_v = numbers
    return np.array([[scale_u, 0, shift_u], [0, scale_v, shift_v], [0, 0, 1]])


_UV = (("uscale", 1.0), ("vscale", 1.0), ("udelta", 0.0), ("vdelta", 0.0))
