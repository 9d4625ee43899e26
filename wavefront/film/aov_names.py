"""The AOVs of a picture besides `rgb`: their names, kinds and meanings.

A geometric layer comes from one ray through the center of each pixel and the center of the lens. It is not
filtered and has no error; where the ray meets nothing it is NaN, or -1 in ids. A sampled AOV is a
filtered mean over the samples of the pixel, as `rgb` is, and has a standard error.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from ..arrays.soa import soa
from ..core.errors import SceneError
from ..core.suggestions import did_you_mean


@soa
class Aov:
    """One layer."""

    channels: int
    sampled: bool
    text: str  # its content and unit


def _geometric(channels: int, text: str) -> Aov:
    return Aov(channels, False, text)


def _sampled(channels: int, text: str) -> Aov:
    return Aov(channels, True, text)


AOVS: dict[str, Aov] = {
    "position": _geometric(3, "point that the ray meets, scene units"),
    "depth": _geometric(1, "distance along the camera's axis, scene units"),
    "distance": _geometric(1, "distance along the ray, scene units"),
    "normal": _geometric(3, "unit shading normal, world, on the side of the camera"),
    "normal_geometric": _geometric(3, "unit geometric normal, world, on the side of the camera"),
    "uv": _geometric(2, "texture coordinates"),
    "shape_id": _geometric(1, "number of the shape in the scene, int32"),
    "instance_id": _geometric(1, "number of the instance in the scene, int32"),
    "material_id": _geometric(1, "number of the material in the scene, int32"),
    "alpha": _sampled(1, "part of the pixel that surfaces cover, and that media take of the background"),
    "albedo": _sampled(3, "reflectance of the surfaces that the camera sees"),
    "direct": _sampled(3, "radiance that the integrator direct_mis estimates, emission included"),
    "indirect": _sampled(3, "the rest of the radiance"),
    "denoising_albedo": _sampled(3, "albedo of the first surfaces that are not specular"),
    "denoising_normal": _sampled(3, "shading normal there, world"),
}

FLOW_AOVS: dict[str, Aov] = {  # of scenes that move, to the times of the setting `flow_times`
    "flow": _geometric(2, "pixels to the right and down to where the next picture shows the same point"),
    "flow_back": _geometric(2, "the same of the picture before"),
    "flow_occluded": _geometric(1, "1 where the next picture does not show that point, else 0, int32"),
    "flow_back_occluded": _geometric(1, "the same of the picture before, int32"),
}
MASKS = "flow_occluded", "flow_back_occluded"  # of integers, which are -1 where nothing is hit
KEYED_AOVS: dict[str, Aov] = {  # one AOV for each key, named "light_groups.KEY" and "coverage.KEY"
    "light_groups": _sampled(3, "radiance by the group of the light that it comes from"),
    "coverage": _sampled(1, "part of the pixel that each shape covers, by the name of the shape"),
}
# numbers that integrators of a user's own note (integrators.note), one AOV for each name: "noted.NAME"
NOTED = "noted"
NOTED_AOVS: dict[str, Aov] = {NOTED: _sampled(3, "numbers that an integrator of your own notes")}
CLAMPED = "clamped"
GIVEN_AOVS: dict[str, Aov] = {  # AOVs that a setting gives, beside those that are asked for
    CLAMPED: _sampled(3, "radiance that the setting `clamp` removed"),
}
LUX = "lux"
MEASURED_AOVS: dict[str, Aov] = {  # AOVs that measurements have, whose errors come from batches of samples
    LUX: _sampled(3, "photometric light: all, that of broadband lights, that of lights of visible watts"),
}
# suffixes of the name of such an AOV for its error, and the variance of a sample (Image.measured)
STANDARD_ERROR, VARIANCE = "_error", "_variance"
NARROW = "narrow_lobes"
# in the metadata of sensors: radiance of the brightest emitter, and how many lux that is at most
BRIGHTEST, BRIGHTEST_LUX = "brightest", "brightest_lux"
SENSOR_AOVS: dict[str, Aov] = {  # AOVs of sensors, which nobody asks for
    NARROW: _sampled(
        1, "Σp²/Σp of the samples' greatest throughputs p after narrow lobes (docs/measuring.md)"
    ),
}
BOXES = "boxes"  # of objects: no array, but `Image.boxes`
ALL_AOVS = "all"  # stands for all of `AOVS`, and for nothing else

DEFAULT_GROUP = "default"  # of lights and emitting materials


def group_name(name: str, value: Any) -> str:
    """Return the name of a group of lights.

    Raises
    ------
    SceneError
        If the value, called `name`, is no text or an empty one.
    """
    if not isinstance(value, str) or not value:
        raise SceneError(f"{name} is {value!r}; it must be a name, such as 'sun'")
    return value


def sampled_names(chosen: Iterable[str]) -> tuple[str, ...]:
    """Return the names of the sampled AOVs among those that were chosen."""
    return tuple(name for name in chosen if name != BOXES and aov_of(name).sampled)


def geometric_names(chosen: Iterable[str]) -> tuple[str, ...]:
    """Return the names of the geometric AOVs among those that were chosen."""
    return tuple(name for name in chosen if name != BOXES and not aov_of(name).sampled)


def flow_names(chosen: Iterable[str]) -> tuple[str, ...]:
    """Return the names of the AOVs of optical flow among those that were chosen."""
    return tuple(name for name in chosen if name in FLOW_AOVS)


def aov_of(name: str) -> Aov:
    """Return an AOV by its name, that of an AOV with a key such as "light_groups.sun"."""
    known = {**AOVS, **FLOW_AOVS, **KEYED_AOVS, **NOTED_AOVS, **GIVEN_AOVS, **MEASURED_AOVS, **SENSOR_AOVS}
    return known[name.partition(".")[0]]


def is_noted(name: str) -> bool:
    """Return whether an AOV holds numbers that an integrator of a user's own notes."""
    kind, _, key = name.partition(".")
    return kind == NOTED and bool(key)


def chosen_aovs(name: str, value: Any) -> tuple[str, ...]:
    """Return the names of the AOVs that were asked for, each once, in the order of the tables.

    Parameters
    ----------
    name
        Name of the value, for errors.
    value
        A name, or several: of `AOVS`, of `FLOW_AOVS`, of `KEYED_AOVS`, "noted.NAME", "boxes" or "all".

    Raises
    ------
    SceneError
        If one is unknown. The message lists all of them.
    """
    known = (*AOVS, *FLOW_AOVS, *KEYED_AOVS, BOXES)
    chosen = [value] if isinstance(value, str) else list(value) if isinstance(value, Iterable) else None
    if chosen is None:
        raise SceneError(f"{name} is {value!r}; it must be the name of an AOV, or several names")
    for aov in chosen:
        if not isinstance(aov, str) or (aov not in (*known, ALL_AOVS) and not is_noted(aov)):
            raise SceneError(
                f"{name} has {aov!r}; there are {', '.join(known)}, and {ALL_AOVS!r} for all but "
                f"{', '.join((*FLOW_AOVS, *KEYED_AOVS, BOXES))}{did_you_mean(aov, known)}"
            )
    wanted = {*chosen, *(AOVS if ALL_AOVS in chosen else ())}
    noted = (aov for aov in dict.fromkeys(chosen) if is_noted(aov))
    return (*(aov for aov in known if aov in wanted), *noted)


GUIDES = "denoising_albedo", "denoising_normal"  # the AOVs that guide denoisers
BEFORE_DENOISING = "before_denoising"  # in the metadata of the samples of pictures that are denoised
NOISY = "noisy"  # the AOV that holds `rgb` as it was before denoising
# beginnings of the names of AOVs that hold radiance
RADIANCE = (NOISY, "direct", "indirect", "light_groups.", CLAMPED)


def is_radiance(name: str) -> bool:
    """Return whether an AOV holds radiance, as `rgb` does."""
    return name.startswith(RADIANCE)


_AXES = dict.fromkeys(("position", "normal", "normal_geometric", "denoising_normal"), "XYZ")
_KNOWN = {**_AXES, "uv": "UV", "flow": "XY", "flow_back": "XY", "depth": "Z", "distance": "Z", "alpha": "A"}
_BY_COUNT = {1: "X", 2: "XY", 3: "RGB"}


def components(name: str, count: int) -> list[str]:
    """Return the letters of the `count` components of an array of a picture: X, Y, Z or R, G, B and so on."""
    known = _KNOWN.get(name, "")
    return list(known) if len(known) == count else list(_BY_COUNT.get(count, map(str, range(count))))
