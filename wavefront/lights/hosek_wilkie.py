"""The sky of Hošek and Wilkie: its data, which come with the package `mitsuba`, and its radiance."""

from __future__ import annotations

import struct
from functools import lru_cache
from importlib.machinery import PathFinder
from pathlib import Path

import numpy as np

from ..arrays.elementary import arcsin, exp, log, sin_cos
from ..arrays.vec import Doubles, Floats, f4
from ..core.errors import SceneError
from .sky_functions import SkyFunction

FILE = "data/sunsky/sunsky_datasets.bin"  # in the folder of the package
DIAMETER = 0.5358  # degrees, of the sun in the data
SEGMENTS = 45  # of the sun's height, each with a cubic polynomial
# of the integral of the sun's color over the wavelengths, to radiance of which 683 lm/W are visible
SPECTRUM = 467.069280386


def hosek_wilkie_sky(turbidity: float, albedo: Floats, cos_sun: float) -> tuple[SkyFunction, Floats, Doubles]:
    """Return the function, its scale (3, 1), and the irradiance (3,) that faces the sun.

    Parameters
    ----------
    turbidity
        1 to 10.
    albedo
        (3, 1) of the ground.
    cos_sun
        Cosine of the sun's angle from the zenith.

    Raises
    ------
    SceneError
        If there are no data.
    """
    data = tensors(_path())
    elevation = float(arcsin(np.float64(cos_sun)))
    x = _cube_root(2 * elevation / np.pi)
    bezier = [choose * _power(1 - x, 5 - k) * _power(x, k) for k, choose in enumerate((1, 5, 10, 10, 5, 1))]
    parameters = np.empty((3, 9))
    scale = np.empty((3, 1))
    for channel, bright in enumerate(albedo.ravel().tolist()):
        for out, name in ((parameters, "sky_params_rgb"), (scale, "sky_rad_rgb")):
            points = _between(data[name][:, :, :, channel], turbidity - 1, bright)  # (6, ...)
            out[channel] = sum(weight * point for weight, point in zip(bezier, points, strict=True))
    # the data have √cos Z last but one, and H last
    order = [0, 1, 2, 3, 4, 5, 6, 8, 7]
    function = SkyFunction(parameters.T[order].reshape(9, 3, 1).astype(f4), offset=0.01)
    return function, scale.astype(f4), _sun(data["sun_rad_rgb"], turbidity, elevation)


def _sun(data: Doubles, turbidity: float, elevation: float) -> Doubles:
    """Return the irradiance (3,) that faces the sun: the mean radiance of its disk times the solid angle."""
    segment = min(int(_cube_root(2 * elevation / np.pi) * SEGMENTS), SEGMENTS - 1)
    x = elevation - 0.5 * np.pi * _power(segment / SEGMENTS, 3)
    low = min(int(turbidity - 1), len(data) - 2)
    fraction = turbidity - 1 - low
    polynomials = (1 - fraction) * data[low, segment] + fraction * data[low + 1, segment]  # (3, 4, 6)
    limb = np.array([2 / (j + 2) for j in range(6)])  # means of powers of the cosine over the disk
    radiance = sum(_power(x, k) * (polynomials[:, k] * limb).sum(1) for k in range(polynomials.shape[1]))
    sine = float(sin_cos(np.float64(np.radians(DIAMETER) / 2))[0])
    return np.asarray(SPECTRUM * np.pi * sine * sine * radiance)


def _between(table: Doubles, turbidity: float, albedo: float) -> Doubles:
    """Return the value of a table (10, 2, ...) between its entries."""
    low = min(int(turbidity), len(table) - 2)
    fraction = turbidity - low
    row = (1 - fraction) * table[low] + fraction * table[low + 1]
    return np.asarray((1 - albedo) * row[0] + albedo * row[1])


def _power(x: float, k: int) -> float:
    out = 1.0
    for _ in range(k):
        out *= x
    return out


def _cube_root(x: float) -> float:
    """Return ∛x of x above 0: Newton's steps from a float32 value."""
    y = float(exp(log(np.array(x, f4)) * f4(1 / 3)))
    for _ in range(3):
        y -= (y - x / (y * y)) / 3
    return y


def _path() -> Path:
    spec = PathFinder.find_spec("mitsuba")  # also where it is imported, which hides its place
    places = [] if spec is None else spec.submodule_search_locations or []
    for folder in places:
        if (Path(folder) / FILE).is_file():
            return Path(folder) / FILE
    raise SceneError(
        "Sky.hosek_wilkie needs the data of the model, which the package mitsuba (3.7 or later) brings: "
        "pip install mitsuba"
    )


@lru_cache(maxsize=1)
def tensors(path: Path) -> dict[str, Doubles]:
    """Return the float64 arrays of a file, by name.

    Raises
    ------
    SceneError
        If it is no such file.
    """
    raw = path.read_bytes()
    try:
        magic, _, count = struct.unpack_from("<12s2sI", raw)
        if magic != b"tensor_file\0":
            raise ValueError("it does not begin with tensor_file")
        at, arrays = 18, {}
        for _ in range(count):
            (length,) = struct.unpack_from("<H", raw, at)
            name = raw[at + 2 : at + 2 + length].decode()
            at += 2 + length
            dimensions, kind, start = struct.unpack_from("<HBQ", raw, at)
            shape = struct.unpack_from(f"<{dimensions}Q", raw, at + 11)
            at += 11 + 8 * dimensions
            if kind == 11:  # float64
                arrays[name] = np.frombuffer(raw, "<f8", int(np.prod(shape)), start).reshape(shape)
        return arrays
    except (struct.error, ValueError, UnicodeDecodeError) as error:
        raise SceneError(f"{path} does not hold the data of the sky: {error}") from error
