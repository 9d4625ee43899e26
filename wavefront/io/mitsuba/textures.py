"""Textures, colors and numbers of Mitsuba's plugins.

Texture coordinates are Mitsuba's: v is 0 at the top row of an image, so that the transform of each texture
flips it.
"""

from __future__ import annotations

from copy import copy
from typing import Any, Literal, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from ...arrays.state import SurfaceInteraction
from ...arrays.vec import Doubles, Floats, luminance
from ...colors import srgb_to_linear
from ...colors.spectrum import blackbody_spectrum, spectrum_rgb, uniform_emission
from ...core.errors import SceneError, as_array, finite_array, in_brief, number
from ...textures.base import BaseTexture
from ...textures.image import Texture
from ...textures.vertex_colors import VertexColors
from ..description.computed import texture_within
from ..spectra import pairs_of
from ..text_lines import numbers
from .nodes import Job, Node, plugin, unsupported

MOST_VALUES = 10_000  # of a spectrum in a text
FLIP = np.array([[1.0, 0, 0], [0, -1, 1], [0, 0, 1]])  # of v
Value = Any  # a number, a color (3,) or a texture
Use: TypeAlias = Literal["albedo", "light", "unbounded"]  # of a color: in [0, 1], emission, or neither


class Spectrum(NamedTuple):
    """Values by wavelength. Which color they are depends on their use."""

    pairs: Any  # a wavelength in nm and a value in each row; or a number, for all wavelengths

    def color(self, use: Use) -> Value:
        """Return a number or a color (3,)."""
        if isinstance(self.pairs, float):
            return uniform_emission(self.pairs) if use == "light" else self.pairs
        return spectrum_rgb(self.pairs, emission=use == "light", bounded=use == "albedo")


class SquareRoot(BaseTexture):
    """The roughness of a texture of α."""

    scalar = True

    def __init__(self, alpha: BaseTexture) -> None:
        self.alpha, self.reads = alpha, alpha.reads

    def limits(self) -> tuple[float, ...]:
        """Return the roots of the limits."""
        return tuple(float(np.sqrt(max(each, 0))) for each in self.alpha.limits())

    def at(self, surface: SurfaceInteraction) -> Floats:
        """Return the roots, (n,)."""
        values = self.alpha.at(surface)
        return np.sqrt(values if values.ndim == 1 else luminance(values))


def color(node: Node, name: str, default: Any, job: Job, use: Use = "albedo") -> Value:
    """Return a parameter that is a number, a color or a texture, clamped to the range of its use."""
    return node.or_default(
        default, lambda: _within(node, name, as_color(_given(node, name, default, job), use), use)
    )


def _within(node: Node, name: str, value: Value, use: Use) -> Value:
    """Return a value clamped to the range of its use, which is noted."""
    if use == "unbounded":
        return value
    most = 1.0 if use == "albedo" else np.inf
    if not isinstance(value, BaseTexture):
        limited = node.lost.within(name, value, 0.0, most, node.label)
        return limited if np.ndim(value) else float(limited)
    return texture_within(node.lost, name, value, most, node.label)


def as_color(made: Any, use: Use) -> Value:
    """Return what became of a texture, spectra as colors."""
    return made.color(use) if isinstance(made, Spectrum) else made


def _given(node: Node, name: str, default: Any, job: Job) -> Any:
    """Return a parameter that is a number, a color, a texture, or a `Spectrum`."""
    value = node.get(name, default)
    if not isinstance(value, Node):
        return number(name, value)
    if value.kind != "texture":
        raise SceneError(f"{name} is a {value.kind}; it must be a texture")
    return job.convert(value)


def scalar(node: Node, name: str, default: float, job: Job, use: Use = "albedo") -> Value:
    """Return a parameter that is a number or a texture of numbers; a color counts by its luminance."""
    value = node.get(name, default)
    if isinstance(value, Node) and value.plugin in ("bitmap", "checkerboard"):
        return node.or_default(default, lambda: _within(node, name, _numbers(value, job), use))
    value = color(node, name, default, job, use)
    return value if isinstance(value, BaseTexture | float | int) else float(luminance(value))


def _numbers(node: Node, job: Job) -> Texture:
    """Return an image or a checkerboard as a texture of numbers."""
    if node.plugin == "bitmap":
        return bitmap(node, job, channel="luminance")
    job.check(node)
    return _board(node, job, channel=0)


def roughness(node: Node, name: str, default: float, job: Job) -> Value:
    """Return the roughness √α of a parameter α."""
    alpha = scalar(node, name, default, job)
    if isinstance(alpha, BaseTexture):
        return SquareRoot(alpha)
    return float(np.sqrt(alpha))


def listed(node: Node, name: str) -> list[float]:
    """Return the numbers of a parameter, given as a text or as a list."""
    value = node.get(name, "")
    if not isinstance(value, str):
        return list(finite_array(name, value, (None,)))
    return numbers("", name, value, range(1, MOST_VALUES))


@plugin("rgb", "texture", "value")
def _rgb(node: Node, job: Job) -> Doubles:
    value = node.get("value")
    return finite_array("rgb", np.broadcast_to(value, 3) if np.ndim(value) == 0 else value, (3,))


@plugin("spectrum", "texture", "value filename")
def _spectrum(node: Node, job: Job) -> Spectrum:
    if "filename" in node.values:
        return Spectrum(job.spectrum(node.text("filename")))
    return Spectrum(pairs_of("value", node.get("value")))


@plugin("irregular", "texture", "wavelengths values")
def _irregular(node: Node, job: Job) -> Spectrum:
    return Spectrum(_pairs(listed(node, "wavelengths"), listed(node, "values")))


@plugin("regular", "texture", "values wavelength_min wavelength_max")
def _regular(node: Node, job: Job) -> Spectrum:
    values = listed(node, "values")
    first, last = node.number("wavelength_min", 360.0), node.number("wavelength_max", 830.0)
    return Spectrum(_pairs(np.linspace(first, last, len(values)), values))


def _pairs(wavelengths: Any, values: list[float]) -> list[tuple[float, float]]:
    if len(wavelengths) != len(values):
        raise SceneError(f"has {len(wavelengths)} wavelengths and {len(values)} values")
    return list(zip(wavelengths, values, strict=True))


plugin("blackbody", "texture", "temperature")(
    lambda node, job: Spectrum(blackbody_spectrum(node.number("temperature", 5000.0)))
)
plugin("mesh_attribute", "texture", "name scale", note="one for each shape, of ply files, in [0, 1]")(
    lambda node, job: VertexColors(node.number("scale", 1.0))
)


@plugin("uniform rawconstant", "texture", "value", note="gray also as a light")
def _uniform(node: Node, job: Job) -> Any:
    value = node.get("value", 1.0)
    if isinstance(value, Node) or np.ndim(value) == 0:
        return _given(node, "value", 1.0, job)
    return node.vector("value", None)


plugin("srgb", "texture", "color", harmless="unbounded")(lambda node, job: _given(node, "color", 1.0, job))


@plugin("d65", "texture", "color scale", "texture")
def _d65(node: Node, job: Job) -> Any:
    """Return a color, or the texture in it; D65 itself is white."""
    inside = node.held("texture")
    base = job.convert(inside[0]) if inside else _given(node, "color", 1.0, job)
    factor = node.number("scale", 1.0)
    if isinstance(base, BaseTexture | Spectrum):
        if factor != 1:
            node.lose("scale")
        return base
    return factor * np.asarray(base)


@plugin("bitmap", "texture", "filename bitmap data raw to_uv wrap_mode filter_type", harmless="accel format")
def bitmap(node: Node, job: Job, channel: Any = None, plain: bool = False) -> Texture:
    """Return an image; `plain` for data that must be linear, such as heights."""
    job.check(node)
    codes, raw = pixels(node, job), node.flag("raw")
    if plain and not raw and codes.dtype.kind == "u":
        codes, raw = srgb_to_linear((codes / np.iinfo(codes.dtype).max).astype(np.float32)), True
    return Texture(
        codes,
        srgb=not raw and not plain,
        wrap=node.choice("wrap_mode", "repeat", ("repeat", "mirror", "clamp")),  # type: ignore[arg-type]
        filter=node.choice("filter_type", "bilinear", ("bilinear", "nearest")),  # type: ignore[arg-type]
        transform=_to_uv(node),
        channel=channel,
        max_pixels=job.files.limits.pixels,
    )


def picture(node: Node, name: str, job: Job) -> Texture:
    """Return an image that a light shows, with its first row at the top."""
    value = color(node, name, 1.0, job, "light")
    if not isinstance(value, BaseTexture):
        return Texture(np.broadcast_to(value, (1, 1, 3)).astype(np.float32))
    if not isinstance(value, Texture):
        raise SceneError(f"{name} must be an image")
    return upside_down(value)


def upside_down(texture: Texture) -> Texture:
    """Return a texture for coordinates whose v is 1 at the top row."""
    other = copy(texture)
    given = np.eye(3) if texture.transform is None else texture.transform
    other.transform = None if np.array_equal(given, FLIP) else given @ FLIP
    return other


def pixels(node: Node, job: Job) -> NDArray[Any]:
    """Return the pixels of an image as stored, (H, W, C)."""
    for name in ("data", "bitmap"):
        if name in node.values:
            values = np.asarray(node.get(name))
            if values.ndim not in (2, 3) or values.dtype.kind not in "uf":
                raise SceneError(f"{name} is {in_brief(node.get(name))}; it must be an image")
            return values
    return job.picture(node, node.text("filename")).codes


@plugin(
    "checkerboard", "texture", "color0 color1 to_uv", note="as a number the two change places, as in Mitsuba"
)
def _board(node: Node, job: Job, channel: int | None = None) -> Texture:
    """Return four fields, of colors or of numbers; v from 0 to 1/2 is the upper row."""
    fields = []
    for name, default in (("color0", 0.4), ("color1", 0.2)):
        value = _field(node, name, default, job)
        if isinstance(value, BaseTexture):
            node.lose(f"the texture {name}")
            value = default
        fields.append(np.broadcast_to(value, 3))
    board = np.array([fields, fields[::-1]], np.float32)
    if channel is not None:  # `Checkerboard::eval_1` has color0 where `eval` has color1
        board = luminance(board[::-1].transpose(2, 0, 1))
    return Texture(board, filter="nearest", transform=_to_uv(node), channel=channel)


def _field(node: Node, name: str, default: float, job: Job) -> Value:
    """Return a color as it is: what reads the texture knows its range."""
    return node.or_default(default, lambda: as_color(_given(node, name, default, job), "albedo"))


unsupported("volume", "texture")


def _to_uv(node: Node) -> Doubles:
    """Return the transform of texture coordinates, (3, 3)."""
    value = node.get("to_uv", np.eye(4))
    matrix = as_array("to_uv", getattr(value, "matrix", value))
    if matrix.shape == (4, 4):
        matrix = matrix[np.ix_((0, 1, 3), (0, 1, 3))]
    return FLIP @ finite_array("to_uv", matrix, (3, 3))
