"""Measured reflectance: the files of the RGL database (.bsdf) and of the MERL database (.binary).

Sources: J. Dupuy and W. Jakob 2018, "An Adaptive Parameterization for Efficient Material Acquisition and
Rendering" (tensor files, as mitsuba.tensor_io writes them); W. Matusik et al. 2003, "A Data-Driven
Reflectance Model".
"""

from __future__ import annotations

import math
import struct
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arrays.vec import Doubles, Floats, f4
from ..colors.spectrum import reflectance_weights
from ..core.errors import SceneError

MOST_BYTES = 2**30
MAGIC = b"tensor_file\0"
BEGIN = struct.Struct("<12sBBI")
NUMBER_TYPES = {1: "u1", 10: "f4"}  # those that are used
MERL_SHAPE = (90, 90, 180)  # θh, θd, φd
MERL_SCALE = np.array([1 / 1500, 1.15 / 1500, 1.66 / 1500])  # of red, green and blue


@dataclass(frozen=True, eq=False)
class AdaptiveTables:
    """The tables of an RGL file, by p azimuths and t angles of one direction, in radians."""

    phi: Floats  # (p,) rising
    theta: Floats  # (t,) rising
    ndf: Floats  # (1, h, w) by half vector
    sigma: Floats  # (1, h, w)
    vndf: Floats  # (p·t, h, w)
    luminance: Floats  # (p·t, k, k)
    rgb: Floats  # (3, p·t, k, k)
    by_normals: bool  # the value is in proportion to ndf/sigma


def parsed_measurement(name: str, data: bytes) -> AdaptiveTables | Floats:
    """Return the tables of an RGL file, or the values of a MERL file, (3, θh, θd, φd).

    Raises
    ------
    SceneError
        If it is neither, or damaged. The message names the file, and the field or the place in it.
    """
    if data[: len(MAGIC)] == MAGIC:
        return _adaptive(name, _Tensors(name, data))
    if data[:12] == struct.pack("<3i", *MERL_SHAPE):
        wanted = 12 + 3 * 8 * math.prod(MERL_SHAPE)
        if len(data) != wanted:
            raise SceneError(f"{name}: has {len(data)} bytes; a MERL file must have {wanted}")
        values = np.frombuffer(data, "<f8", offset=12).reshape(3, *MERL_SHAPE)
        bad = np.flatnonzero(~(np.abs(values.ravel()) < 1e9))
        if bad.size:
            value = values.ravel()[bad[0]]
            raise SceneError(f"{name} byte {12 + 8 * bad[0]}: value is {value}; it must be below 1e9")
        return (np.maximum(values, 0) * MERL_SCALE[:, None, None, None]).astype(
            f4
        )  # -1 where nothing is known
    raise SceneError(f"{name}: begins neither like a file of the RGL database nor like one of MERL")


class _Tensors:
    """The fields of a tensor file."""

    def __init__(self, name: str, data: bytes) -> None:
        self.name, self._data, self._at = name, data, 0
        _, major, minor, count = self._unpack(BEGIN)
        if (major, minor) != (1, 0):
            raise SceneError(f"{name} byte 12: version is {major}.{minor}; it must be 1.0")
        self._fields: dict[str, tuple[int, int, int, tuple[int, ...]]] = {}
        for _ in range(count):
            place = self._at
            (size,) = self._unpack(struct.Struct("<H"))
            (label,) = self._unpack(struct.Struct(f"{size}s"))
            dimensions, kind, start = self._unpack(struct.Struct("<HBQ"))
            shape = self._unpack(struct.Struct(f"<{dimensions}Q"))
            self._fields[label.decode("latin-1")] = place, kind, start, shape

    def _unpack(self, form: struct.Struct) -> tuple[Any, ...]:
        begin, self._at = self._at, self._at + form.size
        if self._at > len(self._data):
            raise SceneError(f"{self.name} byte {len(self._data)}: ends within the list of fields")
        return form.unpack_from(self._data, begin)

    def __contains__(self, field: str) -> bool:
        """Return whether there is a field."""
        return field in self._fields

    def take(self, field: str, shape: tuple[int | None, ...], code: str = "f4") -> NDArray[Any]:
        """Return the array of a field of a shape, in which None is any length (at least 1, in tables 2)."""
        if field not in self._fields:
            raise SceneError(f"{self.name}: has no field {field!r}")
        place, kind, start, have = self._fields[field]
        where = f"{self.name} byte {place}: field {field!r}"
        least = 2 if len(shape) > 1 else 1
        if len(have) != len(shape) or any(
            size < least if want is None else size != want for size, want in zip(have, shape, strict=True)
        ):
            due = ", ".join(f"≥ {least}" if want is None else str(want) for want in shape)
            raise SceneError(f"{where} has shape {have}; it must be ({due})")
        if NUMBER_TYPES.get(kind) != code:
            raise SceneError(f"{where} has type {NUMBER_TYPES.get(kind, kind)}; it must be {code}")
        bytes_needed = math.prod(have) * int(code[1])
        if start + bytes_needed > len(self._data):
            left = max(len(self._data) - start, 0)
            raise SceneError(f"{where} needs {bytes_needed} bytes at byte {start}; {left} are there")
        array = np.frombuffer(self._data, f"<{code}", math.prod(have), start)
        bad = np.flatnonzero(~np.isfinite(array)) if code == "f4" else np.zeros(0)
        if bad.size:
            raise SceneError(f"{where} has {array[bad[0]]} at byte {start + 4 * bad[0]}; it must be finite")
        return array.reshape(have)


def _adaptive(name: str, tensors: _Tensors) -> AdaptiveTables:
    phi, theta = (_rising(name, axis, tensors.take(axis, (None,))) for axis in ("phi_i", "theta_i"))
    p, t = len(phi), len(theta)
    luminance = tensors.take("luminance", (p, t, None, None))
    k = luminance.shape[2]
    if luminance.shape[3] != k:
        raise SceneError(f"{name}: field 'luminance' has shape {luminance.shape}; it must be square")
    if "wavelengths" in tensors:
        waves = _rising(name, "wavelengths", tensors.take("wavelengths", (None,)))
        spectra = tensors.take("spectra", (p, t, len(waves), k, k))
        rgb = _as_rgb(spectra, reflectance_weights(waves.astype(np.float64)))
    else:
        rgb = np.moveaxis(tensors.take("rgb", (p, t, 3, k, k)), 2, 0)
    vndf = tensors.take("vndf", (p, t, None, None))
    alike = slice(None, 1 if p <= 2 else None)  # isotropic files have one azimuth, or one twice
    ndf, sigma = (tensors.take(field, (None, None))[None] for field in ("ndf", "sigma"))
    vndf, luminance = (
        np.maximum(table[alike], 0).reshape(-1, *table.shape[2:]) for table in (vndf, luminance)
    )
    rgb = np.maximum(rgb[:, alike], 0).reshape(3, -1, k, k)
    by_normals = bool(tensors.take("jacobian", (1,), "u1")[0])
    return AdaptiveTables(phi[alike], theta, ndf, sigma, vndf, luminance, rgb, by_normals)


def _rising(name: str, field: str, values: Floats) -> Floats:
    if not (np.diff(values) > 0).all():
        raise SceneError(f"{name}: field {field!r} does not rise from value to value")
    return values.astype(f4)


def _as_rgb(spectra: Floats, weights: Doubles) -> Floats:
    """Return the colors (3, p, t, k, k) of spectra (p, t, wavelengths, k, k)."""
    total = np.zeros((3, *spectra.shape[:2], *spectra.shape[3:]), f4)
    for at in range(spectra.shape[2]):
        total += weights[:, at].astype(f4)[:, None, None, None, None] * spectra[:, :, at]
    return total
