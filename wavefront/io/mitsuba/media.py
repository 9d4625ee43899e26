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
from ..volumes import parsed_grid
from .nodes import Job, Node, plugin, unsupported
from .textures import color


@plugin(
    "homogeneous",
    "medium",
    "sigma_t albedo scale",
    "phase texture volume",
    "sample_emitters has_spectral_extinction",
)
def _homogeneous(node: Node, job: Job) -> Medium:
    extinction, albedo = coefficient(node, "sigma_t", 1.0, job), coefficient(node, "albedo", 0.75, job)
    scattering = extinction * albedo
    phase = phase_of(node, job)
    return Medium(extinction - scattering, scattering, phase=phase, scale=node.number("scale", 1.0))


def phase_of(node: Node, job: Job) -> PhaseFunction:
    """Return the phase function that a medium holds; isotropic without one."""
    found: list[PhaseFunction] = [job.convert(each) for each in node.held("phase")]
    return found[0] if found else Isotropic()


def coefficient(node: Node, name: str, default: float, job: Job) -> Doubles:
    """Return a coefficient of each channel, (3,), given as a number, a color or a constant volume."""
    value = node.get(name, default)
    if isinstance(value, Node) and value.kind == "volume":
        value = None if value.plugin == "gridvolume" else job.convert(value)
    else:
        value = color(node, name, default, job, "unbounded")
        if not isinstance(value, BaseTexture):
            value = node.lost.within(name, value, 0.0, 1.0 if name == "albedo" else np.inf, node.label)
    if value is None or isinstance(value, BaseTexture):
        node.lose(name)
        value = default
    return np.broadcast_to(np.asarray(value, np.float64), 3)


plugin("constvolume", "volume", "value to_world", "texture")(
    lambda node, job: color(node, "value", 1.0, job, "unbounded")
)
plugin("isotropic", "phase")(lambda node, job: Isotropic())
plugin("rayleigh", "phase")(lambda node, job: Rayleigh())
plugin("hg", "phase", "g")(lambda node, job: HenyeyGreenstein(node.number("g", 0.8)))


@plugin("blendphase", "phase", "weight", "phase")
def _blend(node: Node, job: Job) -> PhaseFunction:
    first, second = [job.convert(each) for each in (*node.held("phase"), *[job.only(node, "phase")] * 2)][:2]
    return PhaseMix(first, second, node.number("weight", 0.5))


unsupported("sggx tabphase", "phase")


class Volume(NamedTuple):
    """A grid of numbers, and where it is."""

    values: NDArray[Any]  # (z, y, x, c)
    matrix: Doubles  # (4, 4) from the unit cube


@plugin(
    "gridvolume", "volume", "filename to_world use_grid_bbox filter_type wrap_mode", "", "raw accel max_value"
)
def _grid_volume(node: Node, job: Job) -> Volume:
    path, matrix = job.find(node.text("filename")), node.matrix()
    values, box = parsed_grid(os.fspath(path), job.files.read(path), job.files.budget)
    if node.flag("use_grid_bbox"):
        matrix = matrix @ box
    if node.choice("filter_type", "trilinear", ("trilinear", "nearest")) == "nearest":
        node.lose("filter_type 'nearest'")
    if node.choice("wrap_mode", "clamp", ("clamp", "repeat", "mirror")) != "clamp":
        node.lose("wrap_mode")
    return Volume(values.reshape(*values.shape[:3], -1), matrix)


@plugin(
    "heterogeneous",
    "medium",
    "sigma_t albedo scale",
    "phase texture volume",
    "sample_emitters has_spectral_extinction majorant_grid_res majorant_resolution_factor",
)
def _heterogeneous(node: Node, job: Job) -> GridMedium:
    extinction, albedo = _volume(node, "sigma_t", 1.0, job), _volume(node, "albedo", 0.75, job)
    part = np.clip(albedo.values, 0, 1)
    density, color = extinction.values, np.ones(3)
    if density.size <= 3:
        density, color = np.ones((1, 1, 1)), np.broadcast_to(density.ravel(), 3)
    elif density.shape[3] == 1:
        density = density[..., 0]
    more: dict[str, Any] = {"phase": phase_of(node, job), "scale": node.number("scale", 1.0)}
    if part.size <= 3:
        part = np.broadcast_to(part.ravel(), 3)
        return GridMedium(density, extinction.matrix, color * (1 - part), color * part, **more)
    if not np.allclose(albedo.matrix, extinction.matrix):
        node.lose("the place of albedo")
    part = np.broadcast_to(part, (*part.shape[:3], 3))
    density = density[..., None] * color if np.ptp(color) else density * color[0]
    return GridMedium(density, extinction.matrix, albedo=part, **more)


def _volume(node: Node, name: str, default: float, job: Job) -> Volume:
    """Return a parameter that is a volume, or a number or a color, which are a volume of one voxel."""
    value = node.get(name, default)
    if isinstance(value, Node) and value.plugin == "gridvolume":
        found: Volume | None = job.convert(value)
        if found is None:
            raise SceneError(f"{name} is no volume that can be read")
        return found
    matrix = value.matrix() if isinstance(value, Node) and value.kind == "volume" else np.eye(4)
    return Volume(coefficient(node, name, default, job).reshape(1, 1, 1, 3), matrix)


def interior_of(node: Node, job: Job, hollow: bool) -> BaseMedium | None:
    """Return the medium inside of a shape; None for none.

    A shape that has a medium outside alone is a hole in it, if it is `hollow`: if light passes its surface.
    """
    if not job.sees_media:
        return None
    inside, outside = (_medium(node, name) for name in ("interior", "exterior"))
    if inside is None:
        return job.once("hole", lambda: Medium(0.0)) if hollow and outside is not None else None
    return _made(inside, job)


def _medium(node: Node, name: str) -> Node | None:
    value = node.values.get(name)
    return value if isinstance(value, Node) and value.kind == "medium" else None


def _made(node: Node, job: Job) -> BaseMedium | None:
    """Return a medium; equal ones are one."""
    made: BaseMedium | None = job.once(("medium", _content(node)), lambda: job.convert(node))
    return made


def _content(value: Any) -> Any:
    """Return what tells plugins with other parameters apart: neither names nor places."""
    if isinstance(value, Node):
        named = value.values.items()
        parts = [
            (each.kind if isinstance(each, Node) and name.startswith("_arg") else name, each)
            for name, each in named
        ]
        return value.plugin, tuple(sorted((name, repr(_content(each))) for name, each in parts))
    value = getattr(value, "matrix", value)
    return repr(value.tolist() if isinstance(value, np.ndarray) else value)


def medium_around(node: Node, sensor: Node | None, job: Job) -> BaseMedium | None:
    """Return the medium of a scene: that around its sensor, unless this is inside of a shape.

    In a scene without a sensor it is the first one outside of a shape that is inside of none.
    """
    if not job.sees_media:
        return None
    shapes = list(_shapes(node.held("shape")))
    filled = [(each, medium) for each in shapes if (medium := _medium(each, "interior")) is not None]
    inside = [_content(medium) for _, medium in filled]
    outside = {repr(_content(each)): each for shape in shapes if (each := _medium(shape, "exterior"))}
    apart = [each for each in outside.values() if _content(each) not in inside]
    if sensor is None:
        around, what = (apart[0] if apart else None), "another medium around all shapes"
    else:
        around, what = next(iter(sensor.held("medium")), None), "the medium outside, where the sensor is not"
    own = None if around is None else _content(around)
    for each in apart:
        if _content(each) != own:
            each.lose(what)
    if around is None or any(_content(medium) == own and _holds(shape, job) for shape, medium in filled):
        return None
    return _made(around, job)


def _holds(shape: Node, job: Job) -> bool:
    """Return whether the camera is inside of a shape, as far as its bounds say."""
    if job.eye is None or shape.plugin in ("shapegroup", "merge"):
        return False
    boxes = [each.bounds for each in job.convert(shape)]
    return any(bool(((job.eye > low) & (job.eye < high)).all()) for low, high in boxes)


def _shapes(nodes: Iterable[Node]) -> Iterator[Node]:
    """Yield shapes, and those in groups."""
    for node in nodes:
        yield node
        yield from _shapes(node.held("shape"))
