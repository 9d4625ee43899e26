"""Textures, colors and numbers of Mitsuba's plugins.

Texture coordinates are Mitsuba's: v is 0 at the top row of an image, so that the transform of each texture
flips it.
"""

from __future__ import annotations

from copy import copy
from typing import Any, Literal, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from ...arrays.vec import Doubles, luminance
from ...colors import srgb_to_linear
from ...colors.spectrum import blackbody_spectrum, spectrum_rgb, uniform_emission
from ...core.errors import SceneError, as_array, finite_array, in_brief, number
from ...textures.base import BaseTexture
from ...textures.image import Texture
from ...textures.vertex_colors import VertexColors
from ..description.computed import FLIP, Computed, Value, texture_within
from ..description.entity import Entity
from ..spectra import pairs_of
from ..text_lines import numbers
from .nodes import plugin, unsupported
from .transforms import plain

MOST_VALUES = 10_000  # of a spectrum in a text
Use: TypeAlias = Literal["albedo", "light", "unbounded"]  # of a color: in [0, 1], emission, or neither


class Spectrum(NamedTuple):
    """Values by wavelength. Which color they are depends on their use."""

    pairs: Any  # a wavelength in nm and a value in each row; or a number, for all wavelengths

    def color(self, use: Use) -> Value:
        """Return a number or a color (3,)."""
        if isinstance(self.pairs, float):
            return uniform_emission(self.pairs) if use == "light" else self.pairs
        return spectrum_rgb(self.pairs, emission=use == "light", bounded=use == "albedo")


def root(alpha: Any) -> Any:
    """Return the roughness √α of numbers (1, n), or by the luminance of colors (3, n)."""
    return np.sqrt(alpha if len(alpha) == 1 else luminance(alpha)[None])


def color(entity: Entity, name: str, default: Any, use: Use = "albedo") -> Value:
    """Return a parameter that is a number, a color or a texture, clamped to the range of its use."""
    return entity.or_default(
        default, lambda: _within(entity, name, as_color(_parameter(entity, name, default), use), use)
    )


def _within(entity: Entity, name: str, value: Value, use: Use) -> Value:
    """Return a value clamped to the range of its use, which is noted."""
    if use == "unbounded":
        return value
    most = 1.0 if use == "albedo" else np.inf
    if not isinstance(value, BaseTexture):
        limited = entity.lost.within(name, value, 0.0, most, entity.label)
        return limited if np.ndim(value) else float(limited)
    return texture_within(entity.lost, name, value, most, entity.label)


def as_color(converted: Any, use: Use) -> Value:
    """Return the value of a texture; of a spectrum, its color."""
    return converted.color(use) if isinstance(converted, Spectrum) else converted


def _parameter(entity: Entity, name: str, default: Any) -> Any:
    """Return a parameter that is a number, a color, a texture, or a `Spectrum`."""
    value = entity.get(name, default)
    if not isinstance(value, Entity):
        return number(name, value)
    if value.kind != "texture":
        raise SceneError(f"{name} is a {value.kind}; it must be a texture")
    return entity.job.convert(value)


def scalar(entity: Entity, name: str, default: float, use: Use = "albedo") -> Value:
    """Return a parameter that is a number or a texture of numbers; a color counts by its luminance."""
    value = entity.get(name, default)
    if isinstance(value, Entity) and value.type in ("bitmap", "checkerboard"):
        return entity.or_default(default, lambda: _within(entity, name, _numbers(value), use))
    value = color(entity, name, default, use)
    return value if isinstance(value, BaseTexture | float | int) else float(luminance(value))


def _numbers(entity: Entity) -> Texture:
    """Return an image or a checkerboard as a texture of numbers."""
    if entity.type == "bitmap":
        return bitmap(entity, channel="luminance")
    entity.check()
    return _board(entity, channel=0)


def roughness(entity: Entity, name: str, default: float) -> Value:
    """Return the roughness √α of a parameter α."""
    alpha = scalar(entity, name, default)
    if isinstance(alpha, BaseTexture):
        limits = tuple(float(np.sqrt(max(limit, 0))) for limit in alpha.limits())
        return Computed(root, alpha, limits=limits, scalar=True)
    return float(np.sqrt(alpha))


def listed(entity: Entity, name: str) -> list[float]:
    """Return the numbers of a parameter, given as a text or as a list."""
    value = entity.get(name, "")
    if not isinstance(value, str):
        return list(finite_array(name, value, (None,)))
    return numbers("", name, value, range(1, MOST_VALUES))


@plugin("rgb", "texture", "value")
def _rgb(entity: Entity) -> Doubles:
    value = entity.get("value")
    return finite_array("rgb", np.broadcast_to(value, 3) if np.ndim(value) == 0 else value, (3,))


@plugin("spectrum", "texture", "value filename")
def _spectrum(entity: Entity) -> Spectrum:
    if "filename" in entity.values:
        return Spectrum(entity.job.spectrum(entity.text("filename")))
    return Spectrum(pairs_of("value", entity.get("value")))


@plugin("irregular", "texture", "wavelengths values")
def _irregular(entity: Entity) -> Spectrum:
    return Spectrum(_pairs(listed(entity, "wavelengths"), listed(entity, "values")))


@plugin("regular", "texture", "values wavelength_min wavelength_max")
def _regular(entity: Entity) -> Spectrum:
    values = listed(entity, "values")
    first, last = entity.number("wavelength_min", 360.0), entity.number("wavelength_max", 830.0)
    return Spectrum(_pairs(np.linspace(first, last, len(values)), values))


def _pairs(wavelengths: Any, values: list[float]) -> list[tuple[float, float]]:
    if len(wavelengths) != len(values):
        raise SceneError(f"has {len(wavelengths)} wavelengths and {len(values)} values")
    return list(zip(wavelengths, values, strict=True))


plugin("blackbody", "texture", "temperature")(
    lambda entity: Spectrum(blackbody_spectrum(entity.number("temperature", 5000.0)))
)
plugin("mesh_attribute", "texture", "name scale", note="one for each shape, of ply files, in [0, 1]")(
    lambda entity: VertexColors(entity.number("scale", 1.0))
)


@plugin("uniform rawconstant", "texture", "value", note="gray also as a light")
def _uniform(entity: Entity) -> Any:
    value = entity.get("value", 1.0)
    if isinstance(value, Entity) or np.ndim(value) == 0:
        return _parameter(entity, "value", 1.0)
    return entity.vector("value", None)


plugin("srgb", "texture", "color", harmless="unbounded")(lambda entity: _parameter(entity, "color", 1.0))


@plugin("d65", "texture", "color scale", "texture")
def _d65(entity: Entity) -> Any:
    """Return a color, or the texture in it; D65 itself is white."""
    inside = entity.children("texture")
    base = entity.job.convert(inside[0]) if inside else _parameter(entity, "color", 1.0)
    factor = entity.number("scale", 1.0)
    if isinstance(base, BaseTexture | Spectrum):
        if factor != 1:
            entity.lose("scale")
        return base
    return factor * np.asarray(base)


@plugin("bitmap", "texture", "filename bitmap data raw to_uv wrap_mode filter_type", harmless="accel format")
def bitmap(entity: Entity, channel: Any = None, plain: bool = False) -> Texture:
    """Return an image; `plain` for data that must be linear, such as heights."""
    entity.check()
    codes, raw = pixels(entity), entity.flag("raw")
    if plain and not raw and codes.dtype.kind == "u":
        codes, raw = srgb_to_linear((codes / np.iinfo(codes.dtype).max).astype(np.float32)), True
    return Texture(
        codes,
        srgb=not raw and not plain,
        wrap=entity.choice("wrap_mode", "repeat", ("repeat", "mirror", "clamp")),  # type: ignore[arg-type]
        filter=entity.choice("filter_type", "bilinear", ("bilinear", "nearest")),  # type: ignore[arg-type]
        transform=_to_uv(entity),
        channel=channel,
        max_pixels=entity.job.files.limits.pixels,
    )


def picture(entity: Entity, name: str) -> Texture:
    """Return an image that a light shows, with its first row at the top."""
    value = color(entity, name, 1.0, "light")
    if not isinstance(value, BaseTexture):
        return Texture(np.broadcast_to(value, (1, 1, 3)).astype(np.float32))
    if not isinstance(value, Texture):
        raise SceneError(f"{name} must be an image")
    return upside_down(value)


def upside_down(texture: Texture) -> Texture:
    """Return a texture for coordinates whose v is 1 at the top row."""
    other = copy(texture)
    matrix = np.eye(3) if texture.transform is None else texture.transform
    other.transform = None if np.array_equal(matrix, FLIP) else matrix @ FLIP
    return other


def pixels(entity: Entity) -> NDArray[Any]:
    """Return the pixels of an image as stored, (H, W, C)."""
    for name in ("data", "bitmap"):
        if name in entity.values:
            values = np.asarray(entity.get(name))
            if values.ndim not in (2, 3) or values.dtype.kind not in "uf":
                raise SceneError(f"{name} is {in_brief(entity.get(name))}; it must be an image")
            return values
    return entity.job.picture(entity, entity.text("filename")).codes


@plugin(
    "checkerboard", "texture", "color0 color1 to_uv", note="as a number the two change places, as in Mitsuba"
)
def _board(entity: Entity, channel: int | None = None) -> Texture:
    """Return four fields, of colors or of numbers; v from 0 to 1/2 is the upper row."""
    fields = []
    for name, default in (("color0", 0.4), ("color1", 0.2)):
        value = _field(entity, name, default)
        if isinstance(value, BaseTexture):
            entity.lose(f"the texture {name}")
            value = default
        fields.append(np.broadcast_to(value, 3))
    board = np.array([fields, fields[::-1]], np.float32)
    if channel is not None:  # `Checkerboard::eval_1` has color0 where `eval` has color1
        board = luminance(board[::-1].transpose(2, 0, 1))
    return Texture(board, filter="nearest", transform=_to_uv(entity), channel=channel)


def _field(entity: Entity, name: str, default: float) -> Value:
    """Return a color as it is; the reader of the texture clamps it."""
    return entity.or_default(default, lambda: as_color(_parameter(entity, name, default), "albedo"))


unsupported("texture", "volume")


def _to_uv(entity: Entity) -> Doubles:
    """Return the transform of texture coordinates, (3, 3)."""
    value = entity.get("to_uv", np.eye(4))
    matrix = as_array("to_uv", plain(value))
    if matrix.shape == (4, 4):
        matrix = matrix[np.ix_((0, 1, 3), (0, 1, 3))]
    return FLIP @ finite_array("to_uv", matrix, (3, 3))
