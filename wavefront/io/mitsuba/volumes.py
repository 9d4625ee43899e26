"""Volumes of Mitsuba, and the media that vary over them."""

from __future__ import annotations

import os
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...arrays.vec import Doubles
from ...media import GridMedium
from ..volumes import parsed_grid
from .media import coefficient, phase_of
from .nodes import Job, Node, plugin


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
