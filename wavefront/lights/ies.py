"""Luminaires: points whose intensity by direction is that of a measured file."""

from __future__ import annotations

import os
from functools import lru_cache
from itertools import pairwise
from typing import ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike

from ..arrays.elementary import arccos, arcsin, arctan2, sin_cos
from ..arrays.soa import soa
from ..arrays.vec import FLOAT32_MAX, Bools, Doubles, Floats, Ints, dot, f4
from ..codecs.luminaires import Photometry, luminaire_texts, parsed_luminaire
from ..colors import EFFICACY, from_photometric, to_photometric
from ..core.errors import SceneError, number
from ..core.files import path_name
from ..core.parameter import Parameter
from ..core.suggestions import suggests_keywords
from ..film.aov_names import DEFAULT_GROUP, group_name
from .base import DeltaLight, Emitters, LightSample, position
from .directional import unit
from .point import LightAtPoint, intensity_of, toward
from .spot import aim, sides_of

NEAR = f4(1e-3)  # degrees beyond the last angle that rounding may give
BANDS = 180  # of polar angles, in which the brightest direction is known


class Web:
    """Luminous intensity between the measured directions: linear in both angles."""

    def __init__(self, photometry: Photometry) -> None:
        azimuth, polar, candela = photometry.azimuth, photometry.polar, photometry.candela
        self.horizontal, self.tilt, self.most = photometry.horizontal, photometry.tilt, float(candela.max())
        self.first = f4((azimuth[0] + 180) % 360 - 180)
        self._azimuth, self._polar = (azimuth - azimuth[0]).astype(f4), polar.astype(f4)
        self._candela = candela.astype(f4).ravel()
        # over a cell in polar angle ∫ I sin = [-I cos] + I' [sin], over one in azimuth the trapezoid rule
        theta, phi = np.radians(polar), np.radians(azimuth)
        sin, cos = sin_cos(theta)
        slope = np.diff(candela) / np.diff(theta)
        rows = (slope * np.diff(sin) - np.diff(candela * cos)).sum(1)
        self.flux = float((0.5 * (rows[1:] + rows[:-1]) * np.diff(phi)).sum())
        self.brightest = _brightest(polar, candela.max(0))

    def candela(self, along: Floats, zero: Floats, quarter: Floats) -> Floats:
        """Return the intensity (n,) in directions, by their components along the three axes."""
        azimuth = np.degrees(arctan2(quarter, zero)) - self.first
        azimuth = azimuth + np.where(azimuth < 0, f4(360), f4(0))
        polar = np.degrees(arctan2(np.sqrt(zero * zero + quarter * quarter), along))
        column, x, within_x = _place(self._azimuth, azimuth)
        row, y, within_y = _place(self._polar, polar)
        at = column * len(self._polar) + row
        near, far = (
            self._candela.take(corner) * (f4(1) - y) + self._candela.take(corner + 1) * y
            for corner in (at, at + len(self._polar))
        )
        return np.where(within_x & within_y, near * (f4(1) - x) + far * x, f4(0))


def _place(angles: Floats, at: Floats) -> tuple[Ints, Floats, Bools]:
    """Return the cell (n,) between angles of each number, the place in it, and whether it is in any."""
    cell = np.clip(np.searchsorted(angles, at, "right") - 1, 0, len(angles) - 2)
    low, high = angles.take(cell), angles.take(cell + 1)
    inside = (at >= angles[0] - NEAR) & (at <= angles[-1] + NEAR)
    return cell, np.clip((at - low) / (high - low), f4(0), f4(1)), inside


def _brightest(polar: Doubles, profile: Doubles) -> Doubles:
    """Return the most of a profile (n,) from one band of angles up to another one, (BANDS, BANDS)."""
    edges = np.arange(BANDS + 1) * (180 / BANDS)
    nodes = np.union1d(edges, polar)
    values = np.interp(nodes, polar, profile, left=0, right=0)
    starts = np.searchsorted(nodes, edges)
    bands = np.array([values[a : b + 1].max() for a, b in pairwise(starts)])
    upto = np.triu(np.broadcast_to(bands, (BANDS, BANDS)))
    return np.asarray(np.maximum.accumulate(upto, axis=1))


@soa
class IESLights(DeltaLight):
    """k luminaires of one file."""

    position: Floats  # (3, k) scene units
    along: Floats  # (3, k) unit axis of the polar angles
    zero: Floats  # (3, k) unit direction of azimuth 0°
    quarter: Floats  # (3, k) of azimuth 90°
    intensity: Floats  # (3, k) W/sr for each candela of the file
    web: Web

    def sample_li(self, point: Floats, u: Floats) -> LightSample:
        """Return the direction to the light; radiance is I/d² with the intensity I in that direction."""
        wi, distance, d2, apart = toward(self.position, point)
        candela = self.web.candela(*(-dot(axis, wi) for axis in (self.along, self.zero, self.quarter)))
        pdf = np.where(apart & (candela > 0), f4(1), f4(0))
        return LightSample(wi, self.intensity * (candela / d2), pdf, distance, np.ones_like(distance))

    def power(self, scene_radius: float) -> Doubles:
        """Return the integral of the intensity over all directions."""
        return self.intensity.mean(0, dtype=np.float64) * self.web.flux

    def irradiance(self, center: Doubles, radius: float, scene_radius: float) -> Doubles:
        """I/d² at most, with the brightest direction between the polar angles of the ball; (c, k)."""
        away = center[:, :, None] - self.position[:, None, :]
        distance = np.sqrt((away**2).sum(0))
        far = np.maximum(distance, 1e-30)
        polar = arccos(np.clip((away * self.along[:, None, :]).sum(0) / far, -1, 1))
        spread = np.where(distance > radius, arcsin(np.minimum(radius / far, 1)), np.pi)
        first, last = (
            np.clip(np.floor((polar + side) * (BANDS / np.pi)), 0, BANDS - 1).astype(np.intp)
            for side in (-spread, spread)
        )
        most = self.web.brightest[first, last] / np.maximum(distance, radius) ** 2
        return np.asarray(self.intensity.mean(0, dtype=np.float64) * most)

    def emitters(self) -> Emitters:
        """Return the positions."""
        middle = self.position.astype(np.float64)
        return Emitters(middle, np.zeros_like(middle), np.zeros(len(self)))


@lru_cache(maxsize=32)
def _web(name: str, text: str, tilt: str) -> Web:
    """Return the web of a file; the luminaires of one file share it, and are sampled together."""
    return Web(parsed_luminaire(name, text, tilt))


class WebLight(LightAtPoint):
    """A point whose intensity by direction is that of a web.

    Parameters
    ----------
    web
        The intensity, over `intensity`.
    position
        (3,) scene units.
    axes
        (3, 3) unit vectors as columns: the axis of the polar angles, the directions of azimuth 0° and 90°.
    intensity
        W/sr for 1 of the web, one number or three.
    group
        Name of the light group.
    """

    hint = "direct the light"
    _directions: ClassVar[tuple[str, ...]] = ("_axes",)
    position: Parameter[ArrayLike] = Parameter(position)
    intensity: Parameter[ArrayLike] = Parameter(intensity_of)
    group: Parameter[str] = Parameter(group_name)

    def __init__(
        self, web: Web, position: ArrayLike, axes: Doubles, intensity: ArrayLike, group: str = DEFAULT_GROUP
    ) -> None:
        self._web, self.position, self.intensity, self.group = web, position, intensity, group
        self._axes = axes

    @property
    def _handed(self) -> bool:
        return True

    def _transformed(self, matrix: Doubles) -> Self:
        light = super()._transformed(matrix)
        if "_axes" in self._directions:
            light._axes = light._axes / np.linalg.norm(light._axes, axis=0)
        return light

    @property
    def axes(self) -> Doubles:
        """The axis of the polar angles, and the directions of azimuth 0° and 90°, as columns (3, 3)."""
        return self._axes

    def record(self, center: Doubles) -> IESLights:
        """Return the light as a record of one column, relative to `center` (3,)."""
        where = (self.position - center).astype(f4).reshape(3, 1)
        along, zero, quarter = self.axes.astype(f4).T.reshape(3, 3, 1)
        return IESLights(where, along, zero, quarter, self.intensity.astype(f4), self._web)


class IESLight(WebLight):
    """A luminaire: a point whose luminous intensity by direction is that of a file.

    Parameters
    ----------
    file
        A file of IES LM-63 (`.ies`, 1986 to 2019: types A, B and C) or of EULUMDAT (`.ldt`).
    position
        (3,) scene units, which count as meters: I candela give I·cosθ/d² lux at distance d.
    target, direction
        (3,) a point straight below the luminaire as it was measured, or the direction there; by default
        (0, -1, 0).
    c0
        (3,) direction of the plane C = 0° (or H = 0°), made perpendicular to the former. Seen from above,
        C = 90° is counterclockwise of it. In files of type A, H grows clockwise, which is the convention of
        Blender's Cycles; other programs may mirror such files.
    lumens
        Luminous flux in place of that of the file. As an attribute: the flux with all factors, lm.
    dimming
        Factor of the light, at least 0.
    color
        Linear RGB or the name of a color; its brightness does not count.
    tilt
        Degrees from upright, for files with a table of TILT. It does not turn the luminaire.
    efficacy
        lm/W of white, as in `from_photometric`; `Measurement.lux` takes it, too.
    group
        Name of the light group, for `aovs="light_groups"`.

    Raises
    ------
    SceneError
        If the file is malformed (the message names its line), or an argument is out of range.

    Notes
    -----
    Intensity is linear in both angles between those of the file, and 0 beyond them. The luminaire is a point:
    closer than about five times its size, a real one differs.

    Examples
    --------
    >>> from pathlib import Path
    >>> table = "0 30 60 90  0  1000 900 400 0"  # angles γ, the angle C, and candelas
    >>> text = f"IESNA:LM-63-2002\\nTILT=NONE\\n1 -1 1 4 1 1 2 0 0 0\\n1 1 20\\n{table}"
    >>> _ = Path("lamp.ies").write_text(text)
    >>> lamp = wf.IESLight("lamp.ies", (0, 3, 0), color="moccasin")
    >>> round(lamp.lumens)
    2844
    """

    hint = "direct the IESLight"
    _directions = "direction", "c0"
    direction: Parameter[ArrayLike] = Parameter(unit)
    c0: Parameter[ArrayLike] = Parameter(unit)

    @suggests_keywords
    def __init__(
        self,
        file: str | os.PathLike[str],
        position: ArrayLike,
        *,
        target: ArrayLike | None = None,
        direction: ArrayLike | None = None,
        c0: ArrayLike = (1, 0, 0),
        lumens: float | None = None,
        dimming: float = 1.0,
        color: ArrayLike = 1.0,
        tilt: float = 0.0,
        efficacy: float = EFFICACY,
        group: str = DEFAULT_GROUP,
    ) -> None:
        self.file = path_name(file)
        self._web = _web(*luminaire_texts(file))
        self.position = position
        if target is None and direction is None:
            direction = (0, -1, 0)
        self.direction = aim("IESLight", self.position, target, direction)
        self.c0 = c0
        factor = number("IESLight dimming", dimming, lambda x: x >= 0, "at least 0")
        upright = number("IESLight tilt", tilt, lambda x: 0 <= x <= 180, "from 0 to 180 degrees")
        if lumens is not None:
            lumens = number("IESLight lumens", lumens, lambda x: x >= 0, "at least 0")
            if not self._web.flux:
                raise SceneError(f"{self.file}: is dark, so that no lumens can be given")
            factor *= lumens / self._web.flux
        elif self._web.tilt is not None:
            factor *= float(np.interp(upright, *self._web.tilt))
        self.intensity = factor * from_photometric(1, color, efficacy=efficacy)
        most = self.intensity.max() * self._web.most
        if most > FLOAT32_MAX:
            raise SceneError(f"{self.file}: has up to {most:.3g} W/sr; it must be at most {FLOAT32_MAX:.3g}")
        self.efficacy = efficacy
        self.group = group

    @property
    def lumens(self) -> float:
        """Luminous flux, lm."""
        return self._web.flux * float(to_photometric(self.intensity[:, 0], efficacy=self.efficacy))

    @property
    def axes(self) -> Doubles:
        """The axis of the polar angles, and the directions of azimuth 0° and 90°, as columns (3, 3)."""
        right, x = (side.reshape(3).astype(np.float64) for side in sides_of(self.direction, self.c0))
        down = self.direction
        return np.stack([-x, down, -right] if self._web.horizontal else [down, x, -right], 1)
