"""Emitters of Mitsuba as lights."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...arrays.vec import Doubles
from ...core.errors import SceneError
from ...lights import DirectionalLight, Environment, PointLight, Projector, SpotLight
from ...textures.base import BaseTexture
from .nodes import Job, Node, plugin, unsupported
from .textures import color, picture, pixels
from .views import FIELD_OF_VIEW, vertical_fov

LEAST_ROWS = 3  # of an environment map; one with fewer repeats its last


@plugin("area", "emitter", "radiance")
def _area(node: Node, job: Job) -> Any:
    """Return the radiance, which a shape emits."""
    return color(node, "radiance", 1.0, job, emission=True)


@plugin("point", "emitter", "position to_world intensity")
def _point(node: Node, job: Job) -> PointLight:
    position = node.vector("position", node.matrix()[:3, 3])
    return PointLight(position, _constant(node, "intensity", job))


@plugin("spot", "emitter", "to_world intensity texture cutoff_angle beam_width")
def _spot(node: Node, job: Job) -> SpotLight:
    matrix = node.matrix()
    cutoff = node.number("cutoff_angle", 20.0)
    return SpotLight(
        matrix[:3, 3],
        _constant(node, "intensity", job),
        direction=matrix[:3, 2],
        angle=2 * cutoff,
        blend=float(np.clip(1 - node.number("beam_width", cutoff * 0.75) / cutoff, 0, 1)),
        falloff="linear",
        picture=picture(node, "texture", job) if "texture" in node.values else None,
        up=-matrix[:3, 1],  # its first row is below
    )


@plugin("projector", "emitter", f"to_world irradiance scale {FIELD_OF_VIEW}")
def _projector(node: Node, job: Job) -> Projector:
    matrix, slide = node.matrix(), picture(node, "irradiance", job)
    aspect = slide.size[0] / slide.size[1]
    return Projector(
        matrix[:3, 3],
        slide,
        np.pi * node.number("scale", 1.0),
        direction=matrix[:3, 2],
        fov=vertical_fov(node, aspect),
        up=matrix[:3, 1],
    )


@plugin("directional", "emitter", "direction to_world irradiance")
def _directional(node: Node, job: Job) -> DirectionalLight:
    return DirectionalLight(
        node.vector("direction", node.matrix()[:3, 2]), _constant(node, "irradiance", job)
    )


@plugin("constant", "emitter", "radiance")
def _environment(node: Node, job: Job) -> Environment:
    return Environment(_constant(node, "radiance", job))


@plugin("envmap", "emitter", "filename bitmap scale to_world", harmless="mis_compensation")
def _environment_map(node: Node, job: Job) -> Environment:
    image, axes = pixels(node, job), node.matrix()[:3, :3]
    axes = axes / np.maximum(np.linalg.norm(axes, axis=0), 1e-300)
    if np.linalg.det(axes) < 0:  # mirrored: x becomes -x
        image, axes = image[:, ::-1], axes * (-1, 1, 1)
    row = np.arange(max(len(image), LEAST_ROWS))
    image = image[np.minimum(row, len(image) - 1)]
    return Environment(image, transform=axes, scale=node.number("scale", 1.0), rows="poles")


unsupported("directionalarea sunsky timed_sunsky", "emitter")


def _constant(node: Node, name: str, job: Job) -> Doubles:
    """Return light of a point or from far away, (3,), which cannot vary."""
    value = color(node, name, 1.0, job, emission=True)
    if isinstance(value, BaseTexture):
        raise SceneError(f"{name} is a texture; it must be a color")
    return np.asarray(np.broadcast_to(value, 3), np.float64)
