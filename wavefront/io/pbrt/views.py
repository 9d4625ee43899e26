"""Cameras, films, filters, samplers and integrators of pbrt: a camera, and settings of a render."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ...arrays.vec import Doubles
from ...camera import Camera
from ...camera.projection import Orthographic, Panorama, Perspective
from ...core.errors import SceneError, exact
from ...sampling.filters import GaussianFilter
from ...shapes.transform import Matrix
from ..description.entity import ABOVE_0, BELOW_180, Entity
from ..description.views import angle_of, filter_setting, half_tangent
from .entities import converts, placement, unsupported

Settings = dict[str, Any]
TALL = 1e-3  # relative difference of a pixel's sides that is taken for rounding


def mirror_of(camera: Entity) -> Matrix:
    """Return the matrix that takes the world to the space of the scene.

    In pbrt's camera space x is to the right, y up and z ahead, which is left-handed. So a camera that is only
    turned and moved sees a mirrored world, unless `Scale -1 1 1` is above it; then nothing is mirrored. Of a
    spherical camera it is the other way round, whose picture turns to the left from its left edge on.
    """
    mirrored = (np.linalg.det(camera.matrix[:3, :3]) > 0) != (camera.type == "spherical")
    return np.diag([-1.0 if mirrored else 1.0, 1, 1, 1])


@converts(
    "camera",
    "spherical",
    harmless="shutteropen shutterclose lensradius focaldistance frameaspectratio screenwindow",
)
def _spherical(entity: Entity) -> Camera:
    """Return a camera that sees all directions: its left edge shows x, and a quarter of its width z."""
    if entity.choice("mapping", "equalarea", ("equalarea", "equirectangular")) == "equalarea":
        entity.lose("mapping 'equalarea'; 'equirectangular' in its place")
    size, crop = entity.job.film
    matrix = placement(entity)
    x, y, z = (matrix[:3, i] / np.linalg.norm(matrix[:3, i]) for i in range(3))
    return Camera(matrix[:3, 3], np.stack([-z, y, x], 1), Panorama(), size, crop)


class View(NamedTuple):
    """Where a camera stands, and the part of its screen that the film shows."""

    origin: Doubles
    axes: Doubles  # (3, 3)
    scale: Doubles  # (3,) of lengths along these
    window: tuple[float, ...]  # left, right, lower and upper edge
    pixel: float  # the width of a pixel over its height
    film: Any  # size and crop


def _view(entity: Entity) -> View:
    (width, height), _ = film = entity.job.film
    x0, x1, y0, y1 = window = _window(entity, width / height)
    matrix = placement(entity)
    scale = np.linalg.norm(matrix[:3, :3], axis=0)
    if np.ptp(scale) > TALL * scale.max():
        entity.lose("a transform that scales unevenly")
    pixel = (x1 - x0) / width / ((y1 - y0) / height)
    return View(matrix[:3, 3], matrix[:3, :3] / scale * (1, 1, -1), scale, window, pixel, film)


@converts("camera", "orthographic", harmless="shutteropen shutterclose focaldistance")
def _orthographic(entity: Entity) -> Camera:
    origin, axes, scale, (x0, x1, y0, y1), pixel, film = _view(entity)
    radius = entity.number("lensradius", 0.0)
    origin = origin + axes[:, 0] * (x0 + x1) / 2 * scale[0] + axes[:, 1] * (y0 + y1) / 2 * scale[1]
    if abs(pixel - 1) > TALL:
        entity.lose("pixels that are not square")
    if radius:
        entity.lose("lensradius")
    return Camera(origin, axes, Orthographic((y1 - y0) * scale[1]), *film)


@converts("camera", "perspective realistic", harmless="shutteropen shutterclose")
def _perspective(entity: Entity) -> Camera:
    origin, axes, scale, (x0, x1, y0, y1), pixel, film = _view(entity)
    radius = entity.number("lensradius", 0.0)
    if entity.type != "perspective":
        entity.lose("a perspective camera in its place")
    half = half_tangent(entity.number("fov", 90.0, BELOW_180)) * (y1 - y0) / 2
    distance = entity.number("focaldistance", 1e6)
    lens = Perspective(
        angle_of(half),
        shift=((x0 + x1) / 2 / (x1 - x0), (y0 + y1) / 2 / (y1 - y0)),
        pixel_aspect=pixel,
        aperture=2 * radius * scale[0],
        focus=distance * scale[2] if radius else None,
    )
    return Camera(origin, axes, lens, *film)


def _window(entity: Entity, aspect: float) -> tuple[float, ...]:
    """Return the left, right, lower and upper edge of the screen: 1 is at half the angle of view."""
    aspect = entity.number("frameaspectratio", aspect, ABOVE_0)
    edges = entity.get("screenwindow", None, "float")
    if edges is None:
        wide, high = max(aspect, 1.0), max(1 / aspect, 1.0)
        return -wide, wide, -high, high
    if len(edges) != 4 or not (edges[0] < edges[1] and edges[2] < edges[3]):
        raise SceneError(f"screenwindow is {edges.tolist()}; it must be four numbers, min and max of x and y")
    return tuple(edges.tolist())


def exposure_of(film: Entity | None, camera: Entity | None) -> float:
    """Return the factor by which a film multiplies radiance."""
    time = 1.0
    if camera is not None:
        time = camera.number("shutterclose", 1.0) - camera.number("shutteropen", 0.0)
        if not time > 0:
            camera.lose(f"is open for {exact(time)}; it must be above 0; 1 in its place")
            time = 1.0
    return time * (1.0 if film is None else film.number("iso", 100.0, ABOVE_0) / 100)


@converts(
    "film",
    "rgb gbuffer spectral",
    harmless="filename savefp16 diagonal coordinatesystem nbuckets lambdamin lambdamax iso",
)
def _film(entity: Entity) -> tuple[tuple[int, int], tuple[int, ...] | None]:
    """Return the size and the crop."""
    size = (entity.whole("xresolution", 1280, 1, 2**16), entity.whole("yresolution", 720, 1, 2**16))
    if entity.text("sensor", "cie1931") != "cie1931":
        entity.lose("sensor; 'cie1931' in its place")
    bounds, window = (entity.get(name, None, kind) for name, kind in _CROPS)
    if window is not None:
        if len(window) != 4:
            entity.lose(f"cropwindow has {len(window)} numbers; it must have 4; left out")
            return size, None
        x, y = (np.ceil(np.clip(np.sort(window[i : i + 2]), 0, 1) * size[i // 2]) for i in (0, 2))
        bounds = np.concatenate([x, y])
    if bounds is None:
        return size, None
    left, right, top, bottom = (int(bound) for bound in np.resize(bounds, 4))
    crop = (max(left, 0), max(top, 0), min(right, size[0]), min(bottom, size[1]))
    if len(bounds) != 4 or crop[0] >= crop[2] or crop[1] >= crop[3]:
        entity.lose(f"its pixels end before they begin: {bounds.tolist()}; all of them in their place")
        return size, None
    return size, None if crop == (0, 0, *size) else crop


_CROPS = (("pixelbounds", "integer"), ("cropwindow", "float"))
RADII = {"box": 0.5, "triangle": 2.0, "gaussian": 1.5}  # of filters, pixels, if they are not given


@converts("filter", "box triangle gaussian")
def _filter(entity: Entity) -> Settings:
    radius, up = (entity.number(name, RADII[entity.type]) for name in ("xradius", "yradius"))
    if up != radius:
        entity.lose(f"yradius; {radius:g} in its place")
    if entity.type == "gaussian":
        return {"filter": GaussianFilter(radius, entity.number("sigma", 0.5), windowed=True)}
    return {"filter": filter_setting("tent" if entity.type == "triangle" else entity.type, radius)}


unsupported("filter", "mitchell sinc")


@converts(
    "sampler",
    "halton independent paddedsobol pmj02bn sobol stratified zsobol",
    harmless="randomization seed jitter",
)
def _sampler(entity: Entity) -> Settings:
    if entity.type == "stratified":
        return {"spp": entity.whole("xsamples", 4, 1, 2**15) * entity.whole("ysamples", 4, 1, 2**15)}
    return {"spp": entity.whole("pixelsamples", 16, 1)}


@converts(
    "integrator",
    "path simplepath volpath simplevolpath bdpt mlt sppm lightpath",
    harmless="lightsampler samplelights samplebsdf visualizestrategies visualizeweights",
)
def _integrator(entity: Entity) -> Settings:
    if entity.type in ("bdpt", "mlt", "sppm", "lightpath"):
        entity.lose("path tracing in its place")
        entity.unread &= {"maxdepth"}
    if entity.flag("regularize"):
        entity.lose("regularize")
    return {"max_bounces": entity.whole("maxdepth", 5, 0, 2**16)}


unsupported("integrator", "ambientocclusion function randomwalk")
