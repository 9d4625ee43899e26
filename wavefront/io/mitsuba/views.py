"""Sensors, films, samplers and integrators of Mitsuba: a camera, and settings of a render."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ...camera import Camera, Sensors, SurfaceSensors
from ...camera.projection import Orthographic, Perspective, Projection
from ...core.errors import SceneError, number
from ...sampling.filters import GaussianFilter
from ...shapes import Instance, Mesh, Shape, Sphere
from ..description.entity import BELOW_180, Entity, Limit
from ..description.views import FILTERS, angle_of, filter_setting, half_tangent
from ..text_lines import numbers
from .nodes import plugin, unsupported
from .transforms import to_world

Settings = dict[str, Any]
Crop = tuple[int, int, int, int] | None
MOST_CHECKED = 1 << 16  # points of a shape that are compared with the planes of a sensor
USUAL = {"filter": GaussianFilter(2.0, windowed=True)}  # where a film has no filter
DEFAULT_FILM = ((768, 576), None, USUAL)
USUAL_FOV = 39.6  # degrees, of 36 mm at 50 mm
ENDLESS = 2**16  # bounces, where there is no limit
CLIPPED = "to_world near_clip far_clip"
NO_CLIPPING = "near_clip and far_clip do not cut; named where they would"
FIELD_OF_VIEW = "fov fov_axis focal_length"
# integrators that see no media
SURFACES = ("path", "direct", "ptracer", "prb", "prb_basic", "direct_projective", "prb_projective")
METER = "measures at one place, whatever the size of its film"
FILM = "width height crop_width crop_height crop_offset_x crop_offset_y"
PIXELS = ("rgb", "rgba", "xyz", "xyza", "luminance", "luminance_alpha")
UNSEEN = "file_format component_format sample_border compensate high_quality_edges banner"  # in the picture
HELD = "film sampler medium"
LENS = f"{FIELD_OF_VIEW} principal_point_offset_x principal_point_offset_y"


@plugin("perspective", "sensor", f"{CLIPPED} {LENS}", HELD, "focus_distance", NO_CLIPPING)
@plugin("thinlens", "sensor", f"{CLIPPED} aperture_radius focus_distance {LENS}", HELD, note=NO_CLIPPING)
@plugin("orthographic", "sensor", CLIPPED, HELD, "focus_distance", NO_CLIPPING)
def _sensor(entity: Entity) -> tuple[Camera, Settings]:
    size, crop, settings = _picture(entity)
    matrix = to_world(entity)
    axes, origin, aspect = matrix[:3, :3], matrix[:3, 3], size[0] / size[1]
    scale = np.linalg.norm(axes, axis=0)
    if not scale.all():
        raise SceneError(f"to_world is singular: {matrix.tolist()}")
    lens: Projection
    if entity.type == "orthographic":
        lens = Orthographic(2 * scale[0] / aspect)
        origin = origin + axes[:, 2] * entity.number("near_clip", 1e-2)
        if abs(scale[1] / scale[0] - 1) > 1e-5:
            entity.lose("pixels that are not square")
    else:
        lens = _lens(entity, aspect)
    axes = axes / scale * (-1, 1, -1)  # Mitsuba's x points left, and z ahead
    if np.linalg.det(axes) < 0:
        entity.lose("the reflection in to_world")
        axes = axes * (-1, 1, 1)
    return Camera(origin, axes, lens, size, crop), settings


def _picture(entity: Entity) -> tuple[tuple[int, int], Crop, Settings]:
    """Return the size, the crop and the settings of the picture of a sensor."""
    film = entity.children("film")
    size, crop, settings = entity.job.convert(film[0]) if film else DEFAULT_FILM
    for sampler in entity.children("sampler"):
        settings = settings | entity.job.convert(sampler)
    return size, crop, settings


def _meter_settings(entity: Entity) -> Settings:
    """Return the settings of a sensor that is no camera: only the light of the scene counts."""
    return _picture(entity)[2] | {"filter": "box", "lighting": None}


@plugin("radiancemeter", "sensor", "to_world origin direction", HELD, note=METER)
def _radiance_meter(entity: Entity) -> tuple[Camera, Settings]:
    origin, direction = to_world(entity)[:3, [3, 2]].T
    if "to_world" not in entity.values and {"origin", "direction"} & entity.values.keys():
        origin, direction = entity.vector("origin", None), entity.vector("direction", None)
    return Sensors(origin[None], direction, "radiance"), _meter_settings(entity)


@plugin("irradiancemeter", "sensor", "", "film sampler", note=f"of a mesh or sphere; {METER}")
def _irradiance_meter(entity: Entity) -> tuple[None, Settings]:
    """Return its settings; where it is, its shape says."""
    return None, _meter_settings(entity)


def meter_on(shapes: Sequence[Shape]) -> SurfaceSensors | None:
    """Return the sensors of the irradiance on a converted shape; None where it has no faces."""
    (shape,) = shapes or (None,)
    ball, corners = np.zeros((1, 4)), np.zeros((0, 3, 3))
    if isinstance(shape, Sphere):
        ball[0] = (*shape.center, shape.radius)
    elif isinstance(shape, Mesh):
        corners = shape.vertices[shape.faces]
    else:
        return None
    return SurfaceSensors(corners, np.array([len(corners)]), ball, "irradiance")


@plugin("specfilm", "film", FILM, "rfilter", UNSEEN)
@plugin("hdrfilm", "film", f"{FILM} pixel_format", "rfilter", UNSEEN, "luminance and xyz become rgb")
def _film(entity: Entity) -> tuple[tuple[int, int], Crop, Settings]:
    width, height = entity.whole("width", 768, 1), entity.whole("height", 576, 1)
    left, top = entity.whole("crop_offset_x", 0), entity.whole("crop_offset_y", 0)
    right, bottom = left + entity.whole("crop_width", width, 1), top + entity.whole("crop_height", height, 1)
    if not (left < width and top < height and right <= width and bottom <= height):
        entity.lose(
            f"the crop {[left, top, right, bottom]}, where it is outside of its {width} × {height} pixels"
        )
        left, top = (left, top) if left < width and top < height else (0, 0)
        right, bottom = min(right, width), min(bottom, height)
    whole = (left, top, right, bottom) == (0, 0, width, height)
    filters = entity.children("rfilter")
    settings = dict(entity.job.convert(filters[0]) if filters else USUAL)
    pixels = "rgb" if entity.type == "specfilm" else entity.choice("pixel_format", "rgb", PIXELS)
    if not pixels.startswith("rgb"):
        entity.lose(f"pixel_format {pixels!r}; its colors are rgb")
    if pixels.endswith("a"):
        settings["background"] = "transparent"
    return (width, height), None if whole else (left, top, right, bottom), settings


@plugin("box", "rfilter", "radius")
@plugin("tent", "rfilter", "radius")
def _filter(entity: Entity) -> Settings:
    radius = entity.number("radius", FILTERS[entity.type].radius)
    return {"filter": filter_setting(entity.type, radius)}


@plugin("gaussian", "rfilter", "stddev radius", note="ends at four times stddev")
def _gaussian(entity: Entity) -> Settings:
    stddev = entity.number("stddev", 0.5)
    return {"filter": GaussianFilter(entity.number("radius", 4 * stddev), stddev, windowed=True)}


@plugin(
    "independent stratified multijitter orthogonal ldsampler",
    "sampler",
    "sample_count",
    harmless="seed jitter strength",
    note="its sample_count counts, its pattern does not",
)
def _sampler(entity: Entity) -> Settings:
    return {"spp": entity.whole("sample_count", 4, 1)} if "sample_count" in entity.values else {}


@plugin(
    "prb_basic direct_projective prb_projective prbvolpath",
    "integrator",
    "max_depth rr_depth hide_emitters",
    "",
    "sppc sppi guiding guiding_mc_size guiding_rounds",
    "path tracing in its place",
)
@plugin("path volpath volpathmis ptracer prb", "integrator", "max_depth rr_depth hide_emitters")
@plugin("direct", "integrator", "hide_emitters", harmless="shading_samples emitter_samples bsdf_samples")
@plugin("moment aov", "integrator", "", "integrator", "aovs hide_emitters", "that in it counts")
def _integrator(entity: Entity) -> Settings:
    if entity.type in ("moment", "aov"):
        return dict(entity.job.convert(entity.only("integrator")))
    settings: Settings = {"max_bounces": 1}
    if entity.type != "direct":
        depth = entity.number("max_depth", -1, Limit(lambda x: x == int(x) >= -1, "at least 0, or -1"))
        settings["max_bounces"] = min(int(depth) - 1, ENDLESS) if depth > 0 else ENDLESS
        settings["roulette"] = entity.whole("rr_depth", 5, 1)
        if depth == 0:
            entity.lose("max_depth 0")
            settings["max_bounces"] = 0
    if entity.flag("hide_emitters"):
        settings["background"] = "transparent"
    return settings


def sees_media(integrator: Entity) -> bool:
    """Return whether an integrator sees media: those that follow paths from surface to surface do not."""
    return integrator.type not in SURFACES and all(map(sees_media, integrator.children("integrator")))


unsupported("integrator", "depth stokes emission_reparam volprim_rf_basic")
unsupported("rfilter", "catmullrom lanczos mitchell")
unsupported("sensor", "batch distant flat_sensor")


def check_clipping(entity: Entity, camera: Camera, shapes: Sequence[Shape]) -> None:
    """Note if a point of a shape in the picture is not between the planes of a sensor."""
    near, far = entity.number("near_clip", 1e-2), entity.number("far_clip", 1e4)
    if entity.type == "orthographic":
        near, far = 0.0, far - near
    width, height = camera.resolution
    for shape in shapes:
        if isinstance(shape, Instance):
            continue
        points = shape.vertices if isinstance(shape, Mesh) else shape.hull()[0]
        pixels, depth = camera.project(points[:MOST_CHECKED])
        x, y = pixels.T
        seen = (x > 0) & (x < width) & (y > 0) & (y < height)
        for name, beyond in (("near_clip", (depth < near) & (depth > 0)), ("far_clip", depth > far)):
            if (seen & beyond).any():
                entity.lose(name)


def _lens(entity: Entity, aspect: float) -> Perspective:
    """Return the lens of a perspective camera."""
    shift = (entity.number("principal_point_offset_x", 0.0), -entity.number("principal_point_offset_y", 0.0))
    aperture, focus = 0.0, None
    if entity.type == "thinlens":
        aperture = 2 * entity.number("aperture_radius", 0.0)
        focus = entity.number("focus_distance", entity.number("far_clip", 1e4))
    return Perspective(
        vertical_fov(entity, aspect), shift=shift, aperture=aperture, focus=focus if aperture else None
    )


def vertical_fov(entity: Entity, aspect: float) -> float:
    """Return the vertical field of view in degrees, of a picture `aspect` times as wide as high."""
    return angle_of(half_tangent(_field_of_view(entity, aspect)) / aspect)


def _field_of_view(entity: Entity, aspect: float) -> float:
    """Return the horizontal field of view in degrees, of a picture `aspect` times as wide as high."""
    if "fov" in entity.values:
        if "focal_length" in entity.values:
            entity.lose("has fov and focal_length; give one of them; fov counts")
        angle = entity.number("fov", USUAL_FOV, BELOW_180)
        axis = entity.choice("fov_axis", "x", ("x", "y", "diagonal", "smaller", "larger"))
    else:
        (length,) = numbers("", "focal_length", entity.text("focal_length", "50mm").removesuffix("mm"), (1,))
        number("focal_length", length, lambda x: x > 0, "above 0 mm")
        angle, axis = angle_of(np.sqrt(36.0**2 + 24.0**2) / (2 * length)), "diagonal"
    if axis in ("smaller", "larger"):
        axis = "y" if (axis == "smaller") == (aspect > 1) else "x"
    if axis == "x":
        return angle
    if axis == "y":
        return angle_of(half_tangent(angle) * aspect)
    return angle_of(half_tangent(angle) / np.sqrt(1 + 1 / aspect**2))
