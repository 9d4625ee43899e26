"""Emitters of Mitsuba as lights."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta

import numpy as np

from ...arrays.elementary import sin_cos
from ...arrays.vec import Doubles
from ...colors.spectrum import Y_INTEGRAL
from ...core.errors import SceneError
from ...lights import DirectionalLight, Environment, Light, PointLight, Projector, Sky, SpotLight
from ...scene.sun_position import sun_position
from ...textures.base import BaseTexture
from ..description.entity import CONE, Entity
from .nodes import plugin, unsupported
from .textures import Use, color, picture, pixels
from .transforms import to_world
from .views import FIELD_OF_VIEW, vertical_fov

DATE = (("year", 2010, 9999), ("month", 7, 12), ("day", 10, 31))
CLOCK = (("hour", 15.0), ("minute", 0.0), ("second", 0.0))
PLACE, TIME = "latitude longitude timezone", "year month day hour minute second"
LEAST_ROWS = 3  # of an environment map; one with fewer repeats its last


# of an area light the radiance, which a shape emits
plugin("area", "emitter", "radiance")(lambda entity: color(entity, "radiance", 1.0, "light"))


@plugin("point", "emitter", "position to_world intensity")
def _point(entity: Entity) -> PointLight:
    position = entity.vector("position", to_world(entity)[:3, 3])
    return PointLight(position, _constant(entity, "intensity"))


@plugin("spot", "emitter", "to_world intensity texture cutoff_angle beam_width")
def _spot(entity: Entity) -> SpotLight:
    matrix = to_world(entity)
    cutoff = entity.number("cutoff_angle", 20.0, CONE)
    return SpotLight(
        matrix[:3, 3],
        _constant(entity, "intensity"),
        direction=matrix[:3, 2],
        angle=2 * cutoff,
        blend=float(np.clip(1 - entity.number("beam_width", cutoff * 0.75) / cutoff, 0, 1)),
        falloff="linear",
        picture=picture(entity, "texture") if "texture" in entity.values else None,
        up=-matrix[:3, 1],  # its first row is below
    )


@plugin("projector", "emitter", f"to_world irradiance scale {FIELD_OF_VIEW}")
def _projector(entity: Entity) -> Projector:
    matrix, slide = to_world(entity), picture(entity, "irradiance")
    aspect = slide.size[0] / slide.size[1]
    return Projector(
        matrix[:3, 3],
        slide,
        np.pi * entity.number("scale", 1.0),
        direction=matrix[:3, 2],
        fov=vertical_fov(entity, aspect),
        up=matrix[:3, 1],
    )


@plugin("directional", "emitter", "direction to_world irradiance")
def _directional(entity: Entity) -> DirectionalLight:
    return DirectionalLight(
        entity.vector("direction", to_world(entity)[:3, 2]), _constant(entity, "irradiance")
    )


plugin("constant", "emitter", "radiance")(lambda entity: Environment(_constant(entity, "radiance")))


@plugin("envmap", "emitter", "filename bitmap scale to_world", harmless="mis_compensation")
def _environment_map(entity: Entity) -> Environment:
    image, axes = pixels(entity), to_world(entity)[:3, :3]
    axes = axes / np.maximum(np.linalg.norm(axes, axis=0), 1e-300)
    if np.linalg.det(axes) < 0:  # mirrored: x becomes -x
        image, axes = image[:, ::-1], axes * (-1, 1, 1)
    row = np.arange(max(len(image), LEAST_ROWS))
    image = image[np.minimum(row, len(image) - 1)]
    return Environment(image, transform=axes, scale=entity.number("scale", 1.0), rows="poles")


@plugin(
    "sunsky",
    "emitter",
    f"turbidity albedo sky_scale sun_scale sun_aperture complex_sun to_world sun_direction {PLACE} {TIME}",
    note="needs the package mitsuba for its data, and pvlib for the sun at a time; its disk is even",
)
def _sun_and_sky(entity: Entity) -> list[Light]:
    """Return the sky, whose zenith is z, and the disk of the sun."""
    up, sun = to_world(entity)[:3, 2], _direction_of_sun(entity)
    albedo = _constant(entity, "albedo", 0.3, "albedo")
    of_sky, of_sun = entity.number("sky_scale", 1.0), entity.number("sun_scale", 1.0)
    if entity.flag("complex_sun"):
        entity.lose("complex_sun")

    def sky(factor: float, disk: bool) -> Sky:
        scale = factor / Y_INTEGRAL  # as Mitsuba does
        turbidity = entity.number("turbidity", 3.0)
        return Sky.hosek_wilkie(turbidity, albedo, sun, up, scale=scale, disk=disk, ground=0.0)

    lights: list[Light] = [sky(of_sky, disk=False)] if of_sky else []
    if of_sun:
        aperture = entity.number("sun_aperture", 0.5358)
        rim = float(sin_cos(np.float64(np.radians(aperture) / 2))[1])
        power = sky(of_sun, disk=True).direct_normal * (1 + rim) / 2  # the mean cosine on the disk
        lights.append(DirectionalLight(-sun, power, angle=aperture))
    return lights


def _direction_of_sun(entity: Entity) -> Doubles:
    """Return the direction to the sun (3,), given as such or by place and time."""
    stated = [name for name in (*PLACE.split(), *TIME.split()) if name in entity.values]
    if "sun_direction" in entity.values:
        if stated:
            raise SceneError(f"has sun_direction and {stated[0]}; give one of them")
        return entity.vector("sun_direction", None)
    year, month, day = (entity.whole(name, default, 1, most) for name, default, most in DATE)
    clock = {f"{name}s": entity.number(name, default) for name, default in CLOCK}
    try:
        begin = datetime(year, month, day, tzinfo=UTC) - timedelta(hours=entity.number("timezone", 9.0))
        time = begin + timedelta(**clock)
        east, north, height = sun_position(
            time, entity.number("latitude", 35.6894), entity.number("longitude", 139.6917), up="z"
        )
    except (ValueError, OverflowError, ImportError) as error:
        raise SceneError(f"the time of its sun: {error}") from error
    local = np.array([-north, -east, height])  # as Mitsuba has it: x points south, and y west
    return (to_world(entity)[:3, :3] * local).sum(1)


unsupported("emitter", "directionalarea timed_sunsky")


def _constant(entity: Entity, name: str, default: float = 1.0, use: Use = "light") -> Doubles:
    """Return light of a point or from far away, (3,), or an albedo, which cannot vary."""
    value = color(entity, name, default, use)
    if isinstance(value, BaseTexture):
        entity.lose(f"{name}, a texture; {default:g} in its place")
        value = default
    return np.asarray(np.broadcast_to(value, 3), np.float64)
