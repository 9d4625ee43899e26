"""Media and phase functions of Mitsuba."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np

from ...arrays.vec import Doubles
from ...media import BaseMedium, HenyeyGreenstein, Isotropic, Medium, PhaseFunction, PhaseMix, Rayleigh
from ...textures.base import BaseTexture
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
        value = color(node, name, default, job)
    if value is None or isinstance(value, BaseTexture):
        node.lose(name)
        value = default
    return np.broadcast_to(np.asarray(value, np.float64), 3)


@plugin("constvolume", "volume", "value to_world", "texture")
def _constant_volume(node: Node, job: Job) -> Any:
    return color(node, "value", 1.0, job)


@plugin("isotropic", "phase")
def _isotropic(node: Node, job: Job) -> PhaseFunction:
    return Isotropic()


@plugin("rayleigh", "phase")
def _rayleigh(node: Node, job: Job) -> PhaseFunction:
    return Rayleigh()


@plugin("hg", "phase", "g")
def _henyey_greenstein(node: Node, job: Job) -> PhaseFunction:
    return HenyeyGreenstein(node.number("g", 0.8))


@plugin("blendphase", "phase", "weight", "phase")
def _blend(node: Node, job: Job) -> PhaseFunction:
    first, second = [job.convert(each) for each in (*node.held("phase"), *[job.only(node, "phase")] * 2)][:2]
    return PhaseMix(first, second, node.number("weight", 0.5))


unsupported("sggx tabphase", "phase")


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
