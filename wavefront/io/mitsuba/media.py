"""Media, phase functions and volumes of Mitsuba."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...arrays.vec import Doubles
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
    found = [job.convert(each) for each in node.held("phase")]
    return found[0] if found else Isotropic()


def coefficient(node: Node, name: str, default: float, job: Job) -> Doubles:
    """Return a coefficient of each channel, (3,), given as a number, a color or a constant volume."""
    value = node.get(name, default)
    if isinstance(value, Node) and value.kind == "volume":
        value = None if value.plugin == "gridvolume" else job.convert(value)
    else:
        value = color(node, name, default, job, "unbounded")
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
        found: Volume = job.convert(value)
        return found
    matrix = value.matrix() if isinstance(value, Node) and value.kind == "volume" else np.eye(4)
    return Volume(coefficient(node, name, default, job).reshape(1, 1, 1, 3), matrix)


def interior_of(node: Node, job: Job) -> BaseMedium | None:
    """Return the medium inside of a shape; None for none."""
    inside = node.values.get("interior") if job.sees_media else None
    return job.convert(inside) if isinstance(inside, Node) and inside.kind == "medium" else None


def medium_around(node: Node, job: Job) -> BaseMedium | None:
    """Return the medium of a scene that is inside of no shape: outside of one, or around a sensor."""
    shapes = list(_shapes(node.held("shape")))
    inside = {id(each.values.get("interior")) for each in shapes}
    outside = [each.values.get("exterior") for each in shapes]
    outside += [medium for sensor in node.held("sensor") for medium in sensor.held("medium")]
    nodes = [each for each in outside if isinstance(each, Node) and each.kind == "medium"]
    if not job.sees_media:
        return None
    around = list(dict.fromkeys(each for each in nodes if id(each) not in inside))
    for another in around[1:]:
        another.lose("another medium around all shapes")
    return job.convert(around[0]) if around else None


def _shapes(nodes: Iterable[Node]) -> Iterator[Node]:
    """Yield shapes, and those in groups."""
    for node in nodes:
        yield node
        yield from _shapes(node.held("shape"))
