"""Media, phase functions and volumes of Mitsuba."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...arrays.vec import Doubles
from ...core.errors import SceneError
from ...media import (
    BaseMedium,
    GridMedium,
    HenyeyGreenstein,
    Isotropic,
    Medium,
    PhaseFunction,
    PhaseMix,
    Rayleigh,
)
from ...textures.base import BaseTexture
from ..description.entity import Entity
from ..volumes import parsed_grid
from .nodes import plugin, unsupported
from .textures import color
from .transforms import plain, to_world


@plugin(
    "homogeneous",
    "medium",
    "sigma_t albedo scale",
    "phase texture volume",
    "sample_emitters has_spectral_extinction",
)
def _homogeneous(entity: Entity) -> Medium:
    extinction, albedo = coefficient(entity, "sigma_t", 1.0), coefficient(entity, "albedo", 0.75)
    scattering = extinction * albedo
    phase = phase_of(entity)
    return Medium(extinction - scattering, scattering, phase=phase, scale=entity.number("scale", 1.0))


def phase_of(entity: Entity) -> PhaseFunction:
    """Return the phase function that a medium holds; isotropic without one."""
    phases: list[PhaseFunction] = [entity.job.convert(child) for child in entity.children("phase")]
    return phases[0] if phases else Isotropic()


def coefficient(entity: Entity, name: str, default: float) -> Doubles:
    """Return a coefficient of each channel, (3,), given as a number, a color or a constant volume."""
    value = entity.get(name, default)
    if isinstance(value, Entity) and value.kind == "volume":
        value = None if value.type == "gridvolume" else entity.job.convert(value)
    else:
        value = color(entity, name, default, "unbounded")
        if not isinstance(value, BaseTexture):
            value = entity.lost.within(name, value, 0.0, 1.0 if name == "albedo" else np.inf, entity.label)
    if value is None or isinstance(value, BaseTexture):
        entity.lose(name)
        value = default
    return np.broadcast_to(np.asarray(value, np.float64), 3)


plugin("constvolume", "volume", "value to_world", "texture")(
    lambda entity: color(entity, "value", 1.0, "unbounded")
)
plugin("isotropic", "phase")(lambda entity: Isotropic())
plugin("rayleigh", "phase")(lambda entity: Rayleigh())
plugin("hg", "phase", "g")(lambda entity: HenyeyGreenstein(entity.number("g", 0.8)))


@plugin("blendphase", "phase", "weight", "phase")
def _blend(entity: Entity) -> PhaseFunction:
    first, second = [
        entity.job.convert(child) for child in (*entity.children("phase"), *[entity.only("phase")] * 2)
    ][:2]
    return PhaseMix(first, second, entity.number("weight", 0.5))


unsupported("phase", "sggx tabphase")


class Volume(NamedTuple):
    """A grid of numbers, and where it is."""

    values: NDArray[Any]  # (z, y, x, c)
    matrix: Doubles  # (4, 4) from the unit cube


@plugin(
    "gridvolume", "volume", "filename to_world use_grid_bbox filter_type wrap_mode", "", "raw accel max_value"
)
def _grid_volume(entity: Entity) -> Volume:
    path, matrix = entity.job.find(entity.text("filename")), to_world(entity)
    values, box = parsed_grid(os.fspath(path), entity.job.files.read(path), entity.job.files.budget)
    if entity.flag("use_grid_bbox"):
        matrix = matrix @ box
    if entity.choice("filter_type", "trilinear", ("trilinear", "nearest")) == "nearest":
        entity.lose("filter_type 'nearest'")
    if entity.choice("wrap_mode", "clamp", ("clamp", "repeat", "mirror")) != "clamp":
        entity.lose("wrap_mode")
    return Volume(values.reshape(*values.shape[:3], -1), matrix)


@plugin(
    "heterogeneous",
    "medium",
    "sigma_t albedo scale",
    "phase texture volume",
    "sample_emitters has_spectral_extinction majorant_grid_res majorant_resolution_factor",
)
def _heterogeneous(entity: Entity) -> GridMedium:
    extinction, albedo = _volume(entity, "sigma_t", 1.0), _volume(entity, "albedo", 0.75)
    scattered = np.clip(albedo.values, 0, 1)
    density, color = extinction.values, np.ones(3)
    if density.size <= 3:
        density, color = np.ones((1, 1, 1)), np.broadcast_to(density.ravel(), 3)
    elif density.shape[3] == 1:
        density = density[..., 0]
    more: dict[str, Any] = {"phase": phase_of(entity), "scale": entity.number("scale", 1.0)}
    if scattered.size <= 3:
        scattered = np.broadcast_to(scattered.ravel(), 3)
        return GridMedium(density, extinction.matrix, color * (1 - scattered), color * scattered, **more)
    if not np.allclose(albedo.matrix, extinction.matrix):
        entity.lose("the place of albedo")
    scattered = np.broadcast_to(scattered, (*scattered.shape[:3], 3))
    density = density[..., None] * color if np.ptp(color) else density * color[0]
    return GridMedium(density, extinction.matrix, albedo=scattered, **more)


def _volume(entity: Entity, name: str, default: float) -> Volume:
    """Return a parameter that is a volume, or a number or a color, which are a volume of one voxel."""
    value = entity.get(name, default)
    if isinstance(value, Entity) and value.type == "gridvolume":
        volume: Volume | None = entity.job.convert(value)
        if volume is None:
            raise SceneError(f"{name} is no volume that can be read")
        return volume
    matrix = to_world(value) if isinstance(value, Entity) and value.kind == "volume" else np.eye(4)
    return Volume(coefficient(entity, name, default).reshape(1, 1, 1, 3), matrix)


def interior_of(entity: Entity, hollow: bool) -> BaseMedium | None:
    """Return the medium inside of a shape; None for none.

    A shape that has a medium outside alone is a hole in it, if it is `hollow`: if light passes its surface.
    """
    if not entity.job.sees_media:
        return None
    inside, outside = (_medium(entity, name) for name in ("interior", "exterior"))
    if inside is None:
        return entity.job.once("hole", lambda: Medium(0.0)) if hollow and outside is not None else None
    return _medium_of(inside)


def _medium(entity: Entity, name: str) -> Entity | None:
    value = entity.values.get(name)
    return value if isinstance(value, Entity) and value.kind == "medium" else None


def _medium_of(entity: Entity) -> BaseMedium | None:
    """Return the medium of a plugin; equal plugins share one."""
    medium: BaseMedium | None = entity.job.once(
        ("medium", _content(entity)), lambda: entity.job.convert(entity)
    )
    return medium


def _content(value: Any) -> Any:
    """Return a key of a plugin's type and parameters, without names and places."""
    if isinstance(value, Entity):
        named = value.values.items()
        parameters = [
            (child.kind if isinstance(child, Entity) and name.startswith("_arg") else name, child)
            for name, child in named
        ]
        return value.type, tuple(sorted((name, repr(_content(child))) for name, child in parameters))
    value = plain(value)
    return repr(value.tolist() if isinstance(value, np.ndarray) else value)


def medium_around(entity: Entity, sensor: Entity | None) -> BaseMedium | None:
    """Return the medium of a scene: that around its sensor, unless this is inside of a shape.

    In a scene without a sensor it is the first one outside of a shape that is inside of none.
    """
    if not entity.job.sees_media:
        return None
    shapes = list(_shapes(entity.children("shape")))
    filled = [(shape, medium) for shape in shapes if (medium := _medium(shape, "interior")) is not None]
    inside = [_content(medium) for _, medium in filled]
    outside = {repr(_content(outer)): outer for shape in shapes if (outer := _medium(shape, "exterior"))}
    separate = [outer for outer in outside.values() if _content(outer) not in inside]
    if sensor is None:
        around, what = (separate[0] if separate else None), "another medium around all shapes"
    else:
        around, what = (
            next(iter(sensor.children("medium")), None),
            "the medium outside, where the sensor is not",
        )
    content = None if around is None else _content(around)
    for outer in separate:
        if _content(outer) != content:
            outer.lose(what)
    if around is None or any(_content(medium) == content and _holds(shape) for shape, medium in filled):
        return None
    return _medium_of(around)


def _holds(shape: Entity) -> bool:
    """Return whether the camera is inside of a shape, as far as its bounds say."""
    if shape.job.eye is None or shape.type in ("shapegroup", "merge"):
        return False
    eye = shape.job.eye
    boxes = [body.bounds for body in shape.job.convert(shape)]
    return any(bool(((eye > low) & (eye < high)).all()) for low, high in boxes)


def _shapes(nodes: Iterable[Entity]) -> Iterator[Entity]:
    """Yield shapes, and those in groups."""
    for entity in nodes:
        yield entity
        yield from _shapes(entity.children("shape"))
