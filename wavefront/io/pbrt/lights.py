"""Lights of pbrt."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...arrays.elementary import arctan2, sin_cos, sin_cos_turns
from ...arrays.vec import Doubles, Floats, luminance, spans
from ...codecs.encoding import codes_to_linear
from ...codecs.luminaires import Photometry
from ...core.errors import SceneError
from ...lights import DirectionalLight, Environment, Light, PointLight, Projector, SpotLight
from ...lights.environment import ConstantEnvironment
from ...lights.ies import Web, WebLight
from ...textures.image import Texture
from ..description.conversion import only_one
from ..description.entity import CONE, Entity, Limit
from ..description.views import angle_of, half_tangent
from ..losses import Losses
from .entities import converts, placement, spectrum

ROWS = 64  # of an environment that are looked up at once
MOST_ANGLES = 1024  # of the table of a point light, from pole to pole
SUBPIXELS = 2  # of its pixels, in both directions


def _factor(entity: Entity) -> float:
    """Return the scale of a light times the exposure of the film."""
    return entity.number("scale", 1.0) * float(entity.job.exposure)


def _strength(entity: Entity, name: str) -> Doubles:
    """Return a color times the scale of a light and the exposure of the film, (3,)."""
    color = np.broadcast_to(spectrum(entity, name, 1.0, "light"), 3)
    return np.asarray(color * _factor(entity))


def _measured(entity: Entity, name: str, unscaled: float) -> float:
    """Return the factor by which a light gets the power or illuminance that is asked for."""
    wanted = entity.number(name, -1.0)
    return wanted / unscaled if wanted > 0 and unscaled > 0 else 1.0


def _points(entity: Entity) -> tuple[Doubles, Doubles]:
    """Return "from" and "to" in the scene, (3,) each."""
    matrix = placement(entity)
    ends = [entity.vector(name, default) for name, default in (("from", (0.0, 0, 0)), ("to", (0.0, 0, 1)))]
    start, end = (matrix[:3, :3] @ point + matrix[:3, 3] for point in ends)
    return start, end


@converts("light", "point")
def _point(entity: Entity) -> PointLight:
    intensity = _strength(entity, "I") * _measured(entity, "power", 4 * np.pi)
    return PointLight(_points(entity)[0], intensity)


@converts("light", "goniometric")
def _goniometric(entity: Entity) -> PointLight | WebLight:
    """Return a point whose intensity by direction is that of an equal-area image; its pole is y."""
    matrix, strength = placement(entity), _strength(entity, "I")
    if not entity.text("filename", ""):
        return PointLight(matrix[:3, 3], strength * _measured(entity, "power", 4 * np.pi))
    factors = _square(entity).mean(2, keepdims=True)
    size = len(factors)
    count = min(size, MOST_ANGLES)
    polar, azimuth = (np.arange(n * count + 1, dtype=np.float64) * (180 / count) for n in (1, 2))
    (sin, cos), around = (sin_cos_turns(angle / 360) for angle in (polar, azimuth[:, None]))
    at = np.stack(np.broadcast_arrays(around[1] * sin, around[0] * sin, cos))
    table = _bilinear(_padded(factors), *sphere_to_square(at), size)[..., 0].astype(np.float64)
    web = Web(Photometry(azimuth, polar, table))
    axes = matrix[:3, [1, 0, 2]] / np.linalg.norm(matrix[:3, [1, 0, 2]], axis=0)
    power = 4 * np.pi * float(factors.mean())
    return WebLight(web, matrix[:3, 3], axes, strength * _measured(entity, "power", power))


@converts("light", "spot")
def _spot(entity: Entity) -> SpotLight:
    start, end = _points(entity)
    outer = entity.number("coneangle", 30.0, CONE)
    within = Limit(lambda x: 0 <= x <= outer, f"in [0, {outer:g}]")
    inner = outer - entity.number("conedeltaangle", 5.0, within)
    begin, last = (float(sin_cos(np.float64(np.radians(angle)))[1]) for angle in (inner, outer))
    solid = 2 * np.pi * ((1 - begin) + (begin - last) / 2)
    return SpotLight(
        start,
        _strength(entity, "I") * _measured(entity, "power", solid),
        target=end,
        angle=2 * outer,
        blend=1 - inner / outer,
        falloff="smoothstep",
    )


@converts("light", "projection")
def _projection(entity: Entity) -> Projector:
    slide, matrix = _pixels(entity), placement(entity)
    height, width = slide.shape[:2]
    if np.linalg.det(matrix[:3, :3]) > 0:  # pbrt's x is to the right in a space that is left-handed
        slide = slide[:, ::-1]
    half = half_tangent(entity.number("fov", 90.0)) * max(1, height / width)  # of the height
    power = float(luminance(slide.mean((0, 1)))) * 4 * half * half * width / height
    entity.lose("the fall of its light toward the edges of its picture")
    return Projector(
        matrix[:3, 3],
        Texture(np.ascontiguousarray(slide)),
        _factor(entity) * _measured(entity, "power", power),
        direction=matrix[:3, 2],
        fov=angle_of(half),
        up=matrix[:3, 1],
    )


@converts("light", "distant")
def _distant(entity: Entity) -> DirectionalLight:
    start, end = _points(entity)
    return DirectionalLight(end - start, _strength(entity, "L") * _measured(entity, "illuminance", 1.0))


@converts("light", "infinite")
def _infinite(entity: Entity) -> Environment:
    if not entity.text("filename", ""):
        return Environment(_strength(entity, "L") * _measured(entity, "illuminance", np.pi))
    if "L" in entity.values:
        raise SceneError("has L and filename; give one of them")
    pixels = _square(entity)
    size = len(pixels)
    # one lookup for each pixel, in the middle of it
    at = (np.arange(size) + 0.5) / size
    upward = np.maximum(square_to_sphere(*np.meshgrid(at, at))[2], 0)
    illuminance = float((luminance(pixels.transpose(2, 0, 1)) * upward).mean() * 2 * np.pi)
    factor = _factor(entity) * _measured(entity, "illuminance", illuminance)
    axes = placement(entity)[:3, :3]
    if not np.linalg.svd(axes, compute_uv=False)[2] > 1e-12 * np.abs(axes).max():
        raise SceneError(f"the transform of its directions is singular: {axes.tolist()}")
    to_light = np.asarray(np.linalg.inv(axes), np.float64)
    return Environment(_by_longitude(pixels, to_light) * np.float32(factor))


def summed(lights: list[Light], losses: Losses) -> list[Light]:
    """Return lights with one `Environment`: those of one color are added, of images the first one counts."""
    around = [light for light in lights if isinstance(light, Environment)]
    even = [light for light in around if isinstance(light.record(np.zeros(3)), ConstantEnvironment)]
    if len(even) > 1:
        total = Environment(np.sum([light.radiance[:, 0] for light in even], 0))
        lights = [total, *(light for light in lights if light not in even)]
    return only_one(lights, losses)


@converts("area light", "diffuse")
def _area(entity: Entity) -> tuple[Any, float, bool]:
    """Return the radiance, its luminance, and whether it leaves both sides."""
    sides = entity.flag("twosided")
    entity.number("power", -1.0)
    if not entity.text("filename", ""):
        radiance = _strength(entity, "L")
        return radiance, float(luminance(np.broadcast_to(spectrum(entity, "L", 1.0, "light"), 3))), sides
    pixels, factor = _pixels(entity), _factor(entity)
    return Texture(pixels, wrap="clamp", scale=factor), float(luminance(pixels.mean((0, 1)))), sides


def _pixels(entity: Entity) -> Floats:
    """Return the linear colors of an image, (H, W, 3)."""
    codes = entity.job.picture(entity, entity.text("filename", "")).codes
    pixels = codes_to_linear(codes) if codes.dtype.kind == "u" else codes.astype(np.float32)
    pixels = pixels[..., :3] if pixels.shape[2] >= 3 else np.repeat(pixels[..., :1], 3, 2)
    if not np.isfinite(pixels).all():
        raise SceneError("its image has values that are not finite")
    return np.maximum(pixels, 0)


def _square(entity: Entity) -> Floats:
    """Return the linear colors of an equal-area image, (n, n, 3)."""
    pixels = _pixels(entity)
    height, width = pixels.shape[:2]
    if width == 2 * height:
        entity.lose("its image, which is not square, is taken as one by longitude and latitude")
        return _equal_area(pixels)
    if width != height:
        raise SceneError(f"its image has {width} × {height} pixels; it must be square (equal-area)")
    return pixels


def _equal_area(pixels: Floats) -> Floats:
    """Return an equal-area image (n, n, 3) of one by longitude and latitude (n, 2n, 3), as in pbrt-v3."""
    size = len(pixels)
    at = (np.arange(size) + 0.5) / size
    x, y, z = square_to_sphere(*np.meshgrid(at, at))
    row = arctan2(np.sqrt(x * x + y * y), z) / np.pi * size
    column = arctan2(y, x) / (2 * np.pi) % 1 * (2 * size)
    row, column = (np.floor(position).astype(np.intp) for position in (row, column))
    return pixels[np.minimum(row, size - 1), np.minimum(column, 2 * size - 1)]


def square_to_sphere(x: Doubles, y: Doubles) -> Doubles:
    """Return the directions (3, ...) of points of a square, from 0 to 1, where equal areas are solid angles.

    Source: P. Clarberg 2008, "Fast Equal-Area Mapping of the (Hemi)Sphere Using SIMD".
    """
    u, v = 2 * x - 1, 2 * y - 1
    inside = 1 - np.abs(u) - np.abs(v)
    r = 1 - np.abs(inside)
    turn = np.where(r > 0, (np.abs(v) - np.abs(u)) / np.where(r > 0, r, 1) + 1, 1) / 8
    sin, cos = sin_cos_turns(turn)
    level = r * np.sqrt(2 - r * r)
    return np.stack(
        [np.copysign(cos, u) * level, np.copysign(sin, v) * level, np.copysign(1 - r * r, inside)]
    )


def sphere_to_square(d: Doubles) -> tuple[Doubles, Doubles]:
    """Return the points of that square for unit directions (3, ...)."""
    x, y, z = np.abs(d)
    r = np.sqrt(np.maximum(1 - z, 0))
    phi = arctan2(y, x) * (2 / np.pi)
    v = phi * r
    u = r - v
    below = d[2] < 0
    u, v = np.where(below, 1 - v, u), np.where(below, 1 - u, v)
    return (np.copysign(u, d[0]) + 1) / 2, (np.copysign(v, d[1]) + 1) / 2


def _by_longitude(pixels: Floats, to_light: Doubles) -> Floats:
    """Return an equal-area image (n, n, 3) by longitude and latitude (n, 2n, 3), as `Environment` has it."""
    size, padded = len(pixels), _padded(pixels)
    out = np.empty((size, 2 * size, 3), np.float32)
    turns = (np.arange(2 * size * SUBPIXELS) + 0.5) / (2 * size * SUBPIXELS) - 0.5
    across = sin_cos_turns(turns)
    for block in spans(size, ROWS):
        count = block.stop - block.start
        heights = (
            0.25 - (np.arange(count * SUBPIXELS) + 0.5) / (2 * size * SUBPIXELS) - block.start / (2 * size)
        )
        up, level = (wave[:, None] for wave in sin_cos_turns(heights))
        x, z = -across[0] * level, across[1] * level
        d = np.stack([row[0] * x + row[1] * up + row[2] * z for row in to_light])
        colors = _bilinear(padded, *sphere_to_square(d / np.sqrt(d[0] ** 2 + d[1] ** 2 + d[2] ** 2)), size)
        out[block] = colors.reshape(count, SUBPIXELS, 2 * size, SUBPIXELS, 3).mean((1, 3))
    return out


def _padded(pixels: Floats) -> Floats:
    """Return an equal-area image with one pixel more at each edge."""
    # pixels beyond an edge are those at it, turned about its middle
    rows = np.concatenate([pixels[:1, ::-1], pixels, pixels[-1:, ::-1]])
    return np.concatenate([rows[::-1, :1], rows, rows[::-1, -1:]], 1)


def _bilinear(padded: Floats, u: Doubles, v: Doubles, size: int) -> Floats:
    """Return the colors (..., 3) at points of a square, of its image with one pixel more at each edge."""
    x, y = u * size + 0.5, v * size + 0.5
    column, row = (np.clip(np.floor(position).astype(np.intp), 0, size) for position in (x, y))
    fx, fy = ((position - cell)[..., None].astype(np.float32) for position, cell in ((x, column), (y, row)))
    upper = padded[row, column] * (1 - fx) + padded[row, column + 1] * fx
    lower = padded[row + 1, column] * (1 - fx) + padded[row + 1, column + 1] * fx
    blended: Floats = upper * (1 - fy) + lower * fy
    return blended
