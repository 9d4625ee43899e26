"""Emitters of Mitsuba as lights."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...arrays.vec import Doubles
from ...core.errors import SceneError
from ...lights import DirectionalLight, Environment, PointLight, SpotLight
from ...lights.image import environment_pixels
from ...textures.base import BaseTexture
from .nodes import Job, Node, plugin, unsupported
from .textures import color, pixels


@plugin("area", "emitter", "radiance")
def _area(node: Node, job: Job) -> Any:
    """Return the radiance, which a shape emits."""
    return color(node, "radiance", 1.0, job, emission=True)


@plugin("point", "emitter", "position to_world intensity")
def _point(node: Node, job: Job) -> PointLight:
    position = node.vector("position", node.matrix()[:3, 3])
    return PointLight(position, _constant(node, "intensity", job))


@plugin("spot", "emitter", "to_world intensity cutoff_angle beam_width")
def _spot(node: Node, job: Job) -> SpotLight:
    matrix = node.matrix()
    cutoff = node.number("cutoff_angle", 20.0)
    beam = node.number("beam_width", cutoff * 0.75)
    node.lose("beam_width; a smoother fall-off in its place")
    return SpotLight(
        matrix[:3, 3],
        _constant(node, "intensity", job),
        direction=matrix[:3, 2],
        angle=2 * cutoff,
        blend=float(np.clip(1 - beam / cutoff, 0, 1)),
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
    image = environment_pixels(pixels(node, job)) * np.float32(node.number("scale", 1.0))
    axes = node.matrix()[:3, :3]
    axes = axes / np.maximum(np.linalg.norm(axes, axis=0), 1e-300)
    if np.linalg.det(axes) < 0:  # mirrored: x becomes -x
        image, axes = image[:, ::-1], axes * (-1, 1, 1)
    return Environment(np.ascontiguousarray(image), transform=axes)


unsupported("directionalarea projector sunsky timed_sunsky", "emitter")


def _constant(node: Node, name: str, job: Job) -> Doubles:
    """Return light of a point or from far away, (3,), which cannot vary."""
    value = color(node, name, 1.0, job, emission=True)
    if isinstance(value, BaseTexture):
        raise SceneError(f"{name} is a texture; it must be a color")
    return np.asarray(np.broadcast_to(value, 3), np.float64)
