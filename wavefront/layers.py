"""The layers of a picture besides `rgb`: their names, kinds and meanings.

A geometric layer comes from one ray through the center of each pixel and the center of the lens. It is not
filtered and has no error; where the ray meets nothing it is NaN, or -1 in ids. A sampled layer is a
filtered mean over the samples of the pixel, as `rgb` is, and has a standard error.
"""

from __future__ import annotations

from .record import record


@record
class Layer:
    """One layer."""

    channels: int
    sampled: bool
    text: str  # what it holds, and its unit


def _geometric(channels: int, text: str) -> Layer:
    return Layer(channels, False, text)


def _sampled(channels: int, text: str) -> Layer:
    return Layer(channels, True, text)


LAYERS: dict[str, Layer] = {
    "position": _geometric(3, "point that the ray meets, scene units"),
    "depth": _geometric(1, "distance along the camera's axis, scene units"),
    "distance": _geometric(1, "distance along the ray, scene units"),
    "normal": _geometric(3, "unit shading normal, world, on the side of the camera"),
    "normal_geometric": _geometric(3, "unit geometric normal, world, on the side of the camera"),
    "uv": _geometric(2, "texture coordinates"),
    "shape_id": _geometric(1, "number of the shape in the scene, int32"),
    "instance_id": _geometric(1, "number of the instance in the scene, int32"),
    "material_id": _geometric(1, "number of the material in the scene, int32"),
    "alpha": _sampled(1, "part of the pixel that surfaces cover"),
    "albedo": _sampled(3, "reflectance of the surfaces that the camera sees"),
    "direct": _sampled(3, "radiance that the integrator direct_mis estimates, emission included"),
    "indirect": _sampled(3, "the rest of the radiance"),
    "denoising_albedo": _sampled(3, "albedo of the first surfaces that are not specular"),
    "denoising_normal": _sampled(3, "shading normal there, world"),
}
