"""Media whose density varies over a grid."""

from __future__ import annotations

from copy import copy
from dataclasses import replace
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from ..arrays.elementary import exp
from ..arrays.soa import soa
from ..arrays.vec import FLOAT32_MAX, TINY, Bools, Doubles, Floats, Ints, dot, f4, highest, take
from ..colors.spectrum import blackbody_colors
from ..core.errors import SceneError, as_array, finite_array, number, shape_of
from ..core.parameter import Parameter, optional, parametrized
from .base import BaseMedium, Flight, GlowWeights, MediumRays, MediumRecord, channel_shares
from .marching import March, optical_depth
from .medium import _albedo, _coefficient, _scale
from .phase import PhaseFunction, phase_or_isotropic
from .voxels import Voxels, bounds_in_cells

MOST_CELLS = 64  # of majorants along an axis
EVENT_COST = 3.0  # time of an event over that of a cell
GLOW_EVENTS = 4.0  # least mean number of events over the box where anything glows
AIMED_CELLS = 32  # along the longest axis, by which points of a medium that glows are chosen
RAY_POINTS = 2.0  # light samples that a ray through a medium that glows counts for
FAINT = f4(0.1)  # transmittance below which shadow rays are ended at random


def _grid(name: str, value: Any, channels: tuple[int, ...] = (), high: float = FLOAT32_MAX) -> Floats:
    """Return a grid (z, y, x, ...) of float32 numbers in [0, `high`]."""
    grid = as_array(name, value)
    wanted = "(z, y, x" + "".join(f", {size}" for size in channels) + ")"
    if grid.ndim != 3 + len(channels) or grid.shape[3:] != channels or not grid.size:
        raise SceneError(f"{name} must be a grid of shape {wanted}, got {grid.shape}")
    if grid.dtype.kind not in "fiub":
        raise SceneError(f"{name} must be numeric, got an array of {grid.dtype}")
    low, most = grid.min(), grid.max()  # NaN where any is
    if not (low >= 0 and most <= high):
        bad = np.argwhere(~((grid >= 0) & (grid <= high)))[0]
        where = "".join(f"[{i}]" for i in bad)
        limit = f"in [0, {high:g}]" if high < FLOAT32_MAX else "at least 0 and finite"
        raise SceneError(f"{name}{where} is {grid[tuple(bad)]}; it must be {limit}")
    return np.ascontiguousarray(grid, f4)


def _colors_or(convert: Any, high: float = FLOAT32_MAX) -> Any:
    """Return the check of a parameter that is a color, or a grid (z, y, x, 3) of colors."""

    def check(name: str, value: Any) -> Any:
        if len(shape_of(value)) == 4:
            return _grid(name, value, (3,), high)
        return convert(name, value)

    return check


def grid_transform(name: str, value: Any) -> Doubles:
    """Return the matrix (4, 4) from the unit cube."""
    if shape_of(value) == (2, 3):
        low, high = finite_array(name, value, (2, 3))
        if not (low < high).all():
            raise SceneError(f"{name} has the corners {low.tolist()} and {high.tolist()}; the first is lower")
        matrix = np.diag([*(high - low), 1.0])
        matrix[:3, 3] = low
        return matrix
    matrix = finite_array(name, value, (4, 4))
    if not np.array_equal(matrix[3], (0, 0, 0, 1)) or abs(np.linalg.det(matrix[:3, :3])) == 0:
        raise SceneError(f"{name} must be an affine matrix that can be inverted, or two corners (2, 3)")
    return matrix


def _cells(name: str, value: Any) -> int:
    limit = f"a whole number from 1 to {MOST_CELLS}"
    return int(number(name, value, lambda x: x == int(x) and 1 <= x <= MOST_CELLS, limit))


@parametrized
class GridMedium(BaseMedium):
    """A medium whose density varies over a grid, such as a cloud, smoke or fire.

    Between the centers of voxels the density is interpolated linearly; up to half a voxel from the sides of
    the box it is constant, and outside of the box it is 0. All coefficients are per scene unit where the
    density is 1. The box does not move with the shape that has the medium inside.

    Parameters
    ----------
    density
        (z, y, x), at least 0; or (z, y, x, 3) for a density of each channel.
    transform
        Where the grid is, in the world: a matrix (4, 4) from the unit cube [0, 1]³, in which x is the last
        axis of the grid; or the lower and the upper corner of the box, (2, 3).
    absorption, scattering
        As for `Medium`.
    albedo
        In place of absorption and scattering: the extinction is 1, and this part of it scatters. A color, or
        a grid (z, y, x, 3) of any resolution.
    phase, scale
        As for `Medium`.
    emission
        Radiance that is emitted per unit of length, as for `Medium`: a color where the density is 1, or a
        grid (z, y, x, 3) of any resolution, whatever the density. With a temperature: a factor, by default 1.
    temperature
        (z, y, x) kelvin, in the resolution of the density: absorption emits as a black body.
    majorant_cells
        Cells along the longest axis of the coarse grid that bounds the density; it changes the speed and
        the noise, and not the mean. None: chosen by the density.

    Raises
    ------
    SceneError
        If a parameter is malformed, out of its range or not finite, or if albedo is given besides absorption
        or scattering.

    Examples
    --------
    >>> z, y, x = np.indices((16, 16, 16)) / 7.5 - 1
    >>> puff = wf.GridMedium(np.maximum(0, 1 - x**2 - y**2 - z**2), [(-1, 0, -1), (1, 2, 1)],
    ...                      albedo=0.99, scale=8)
    >>> scene = wf.Scene([wf.GridBox(puff)], wf.DirectionalLight((-1, -2, -1), 3))
    """

    density: Parameter[ArrayLike] = Parameter(_colors_or(_grid))
    transform: Parameter[ArrayLike] = Parameter(grid_transform, default=((0, 0, 0), (1, 1, 1)))
    absorption: Parameter[ArrayLike] = Parameter(_coefficient, default=0.0)
    scattering: Parameter[ArrayLike] = Parameter(_coefficient, default=0.0)
    albedo: Parameter[ArrayLike | None] = Parameter(_colors_or(_albedo, 1.0), default=None, kw_only=True)
    phase: Parameter[PhaseFunction | None] = Parameter(phase_or_isotropic, default=None, kw_only=True)
    scale: Parameter[float] = Parameter(_scale, default=1.0, kw_only=True)
    emission: Parameter[ArrayLike | None] = Parameter(
        _colors_or(optional(_coefficient)), default=None, kw_only=True
    )
    temperature: Parameter[ArrayLike | None] = Parameter(optional(_grid), default=None, kw_only=True)
    majorant_cells: Parameter[int | None] = Parameter(optional(_cells), default=None, kw_only=True)

    def derive(self) -> None:
        """Set the coefficients that are rendered."""
        absorbed, scattered = self.absorption.astype(np.float64), self.scattering.astype(np.float64)
        if self.albedo is not None:
            if absorbed.any() or scattered.any():
                raise SceneError("GridMedium albedo stands in place of absorption and scattering")
            scattered = np.ones((3, 1)) if self.albedo.ndim == 4 else self.albedo.astype(np.float64)
            absorbed = 1 - scattered
        glow, grid = np.zeros((3, 1)), None
        if self.temperature is not None:
            grid = self._incandescence(absorbed)
        elif self.emission is not None and self.emission.ndim == 4:
            grid = self.emission * f4(self.scale)
        elif self.emission is not None:
            glow = self.emission.astype(np.float64)
        most = FLOAT32_MAX / max(1.0, float(self.density.max()))
        self.sigma_a, self.sigma_s, self.glow = (
            np.minimum(sigma * self.scale, most).astype(f4) for sigma in (absorbed, scattered, glow)
        )
        # (z, y, x, 3) emission beside `glow`
        self.glow_grid: Floats | None = grid if grid is not None and grid.any() else None
        dense = bool(self.density.any())
        self.scatters = dense and bool(self.sigma_s.any())
        self.glows = (dense and bool(self.glow.any())) or self.glow_grid is not None

    def _incandescence(self, absorbed: Doubles) -> Floats:
        """Return the emission (z, y, x, 3) of black bodies: absorption times their radiance."""
        density = self.density if self.density.ndim == 4 else self.density[..., None]
        if self.temperature.shape != density.shape[:3]:
            raise SceneError(
                f"GridMedium temperature has shape {self.temperature.shape}; "
                f"it must be that of the density, {density.shape[:3]}"
            )
        factor = 1.0 if self.emission is None else self.emission
        if np.ndim(factor) == 4:
            raise SceneError("GridMedium emission must be a color where there is a temperature")
        absorption = absorbed[:, 0] * np.ravel(np.broadcast_to(factor, (3, 1))) * self.scale
        if self.albedo is not None and self.albedo.ndim == 4:
            raise SceneError("GridMedium albedo must be a color where there is a temperature")
        radiance = blackbody_colors(self.temperature) * absorption * density
        return np.minimum(radiance, FLOAT32_MAX).astype(f4)

    @property
    def bounds(self) -> Doubles:
        """Corners of the axis-aligned box around the grid, (2, 3), scene units."""
        corners = np.indices((2, 2, 2)).reshape(3, 8).T @ self.transform[:3, :3].T + self.transform[:3, 3]
        return np.stack([corners.min(0), corners.max(0)])

    def record(self, center: Doubles) -> GridMedia:
        """Return the medium as a record of one column, with positions relative to `center` (3,)."""
        inverse = np.linalg.inv(self.transform)
        offset = inverse[:3, :3] @ center + inverse[:3, 3]
        extinction = self.sigma_a + self.sigma_s
        albedo = self.albedo if self.albedo is not None and self.albedo.ndim == 4 else np.ones((1, 1, 1, 3))
        glow = np.zeros((1, 1, 1, 3)) if self.glow_grid is None else self.glow_grid
        low, high = self._majorants(extinction)
        aim, rate = self._aim(glow)
        return GridMedia(
            density=Voxels.of(self.density),
            albedo=Voxels.of(albedo.astype(f4)),
            glow=Voxels.of(glow.astype(f4)),
            bounds=Voxels.of(np.stack([low, high], -1).astype(f4)),
            to_unit=np.vstack([inverse[:3, :3].reshape(9, 1), offset[:, None]]).astype(f4),
            extinction=extinction,
            scattering=self.sigma_s,
            shine=self.glow,
            aim=Voxels.of(aim),
            points_on_ray=np.array([rate], f4),
            scatters=np.array([self.scatters]),
            glows=np.array([self.glows]),
        )

    def scaled(self, factor: float) -> Self:
        """Return this medium where lengths were multiplied by `factor`: itself if nothing changes."""
        if factor == 1:
            return self
        other = copy(self)
        other.transform = np.diag([factor, factor, factor, 1.0]) @ self.transform
        other.scale = self.scale / factor
        return other

    def _majorants(self, extinction: Floats) -> tuple[Doubles, Doubles]:
        """Return the least and the greatest extinction (d, h, w) in the cells of a coarse grid.

        The least is for the strongest channel, in proportion to the others; 0 where channels differ.
        """
        edge = float(np.sqrt((self.transform[:3, :3] ** 2).sum(0)).mean())
        gray = self.density.ndim == 3
        field = self.density if gray else (self.density * extinction[:, 0]).max(-1)
        unit = float(extinction.max()) if gray else 1.0
        sizes, best = np.array(field.shape), None
        longest = int(sizes.max())
        tried = [1, 4, 8, 16, 32, MOST_CELLS] if self.majorant_cells is None else [self.majorant_cells]
        for count in tried:
            if best is not None and count > longest:
                break
            cells = tuple(int(n) for n in np.clip(np.rint(sizes * count / longest), 1, sizes))
            assert len(cells) == 3
            low, high = (bounds_in_cells(field, cells, ufunc) * unit for ufunc in (np.minimum, np.maximum))
            if self.glows:
                shines: Any = 1.0
                if not self.glow.any() and self.glow_grid is not None:
                    shines = bounds_in_cells(self.glow_grid.max(-1), cells, np.maximum) > 0
                high = np.maximum(high, GLOW_EVENTS / edge * shines)
            cost = sum(cells) / 3 + EVENT_COST * edge * float(high.mean())
            if best is None or cost < best[0]:
                best = cost, low, high
        assert best is not None
        # bounds hold after rounding too
        return best[1] * (gray * (1 - 1e-6)), np.minimum(best[2] * (1 + 1e-6), FLOAT32_MAX)

    def _aim(self, glow: Floats) -> tuple[Floats, float]:
        """Return the density (d, h, w) of points that are chosen for light samples, and points per length.

        It is in proportion to the emission in the cells of a coarse grid; per volume, over points per length.
        """
        if not self.glows:
            return np.zeros((1, 1, 1), f4), 1.0
        density = self.density if self.density.ndim == 4 else self.density[..., None]
        sizes = np.maximum(density.shape[:3], glow.shape[:3])
        cells = tuple(int(n) for n in np.clip(np.rint(sizes * AIMED_CELLS / sizes.max()), 1, sizes))
        assert len(cells) == 3
        total = np.zeros(cells)
        for field in ((density * self.glow[:, 0].astype(np.float64)).mean(-1), glow.mean(-1)):
            sums = [bounds_in_cells(values, cells, np.add) for values in (field, np.ones(field.shape))]
            total += sums[0] / sums[1]
        share = total / total.sum()
        volume = abs(np.linalg.det(self.transform[:3, :3])) / share.size
        rate = RAY_POINTS / float((volume / (share**2).sum()) ** (1 / 3))
        return (share / (volume * rate)).astype(f4), rate


@soa
class GridMedia(MediumRecord):
    """k media whose density varies over grids."""

    takes_steps = True

    density: Voxels
    albedo: Voxels  # multiplies `scattering`
    glow: Voxels  # emission, per scene unit
    bounds: Voxels  # the least and the greatest extinction of any channel in coarse cells, per scene unit
    to_unit: Floats  # (12, k) matrix, row by row, and offset, from the scene to the unit cube
    extinction: Floats  # (3, k) where the density is 1, per scene unit
    scattering: Floats  # (3, k)
    shine: Floats  # (3, k) emission
    aim: Voxels  # density of light samples in coarse cells, per volume, over `points_on_ray`
    points_on_ray: Floats  # (k,) per scene unit, light samples that a ray through a glowing medium counts for
    scatters: Bools  # (k,)
    glows: Bools  # (k,)

    def sample(
        self, rays: MediumRays, throughput: Floats, u: Floats, weights: GlowWeights | None = None
    ) -> Flight:
        """Follow the rays from event to event of a rate that bounds the extinction (delta tracking).

        Light meets the medium at an event with a probability that is the mean of those of the channels, by
        the throughput that each of them has there; else nothing happens. Weights account for the difference.

        Source: P. Kutz, R. Habel, Y. K. Li and J. Novák, "Spectral and Decomposition Tracking for Rendering
        Heterogeneous Volumes", ACM Transactions on Graphics 36(4), 2017, §4.
        """
        distance, weight = np.full(len(rays), np.inf, f4), np.ones_like(rays.direction)
        light = np.zeros_like(rays.direction) if self.glows.any() else None
        plain = np.flatnonzero(~(self.scatters | self.glows).take(rays.number))
        if plain.size:
            weight[:, plain] = self.transmittance(rays.take(plain))
            rays = replace(rays, length=rays.length.copy())
            rays.length[plain] = 0
        march = self._march(rays, optical_depth(u[0]))
        step = 0
        while len(march):
            rate = self.bounds.values[1].take(march.cell, mode="wrap")
            lanes, inside = march.advance(rate)
            row, column, rate = march.row.take(lanes), march.number.take(lanes), rate.take(lanes)
            point, chance = march.points(lanes), march.draw(lanes, step)
            beta = take(weight, row)
            density = self.density.at(column, point)
            if light is not None:
                glow = self.emission(column, point, density) / rate
                if weights is not None:
                    away = weights.before.take(row) + march.entry.take(lanes) + march.t.take(lanes)
                    rival = weights.ratio.take(row) * self.aim.cell_at(column, point) * (away * away)
                    glow = glow / (f4(1) + rival * rival)  # the power heuristic
                light[:, row] += beta * glow
            met = np.minimum(take(self.extinction, column) * density / rate, f4(1))
            scatters = self.scatters.take(column)
            ends = dot(channel_shares(take(throughput, row) * beta), met) * scatters
            real = chance < ends
            scattered = take(self.scattering, column) * self.albedo.at(column, point) * (density / rate)
            beta *= np.where(real, scattered / np.maximum(ends, TINY), (f4(1) - met) / (f4(1) - ends * ~real))
            beta = np.where(scatters, beta, survivors(beta, chance))
            weight[:, row] = beta
            hit = lanes.compress(real)
            distance[row.compress(real)] = march.entry.take(hit) + march.t.take(hit)
            inside[lanes] = ~real & (highest(beta) > 0)
            march, step = march if inside.all() else march.take(np.flatnonzero(inside)), step + 1
        return Flight(distance, weight, light)

    def transmittance(self, rays: MediumRays) -> Floats:
        """Return an unbiased estimate of exp(−∫σt dt), (3, n), by residual ratio tracking.

        Source: J. Novák, A. Selle and W. Jarosz, "Residual Ratio Tracking for Estimating Attenuation in
        Participating Media", ACM Transactions on Graphics 33(6), 2014; with the least extinction of each
        cell as the control.
        """
        assert rays.steps is not None
        estimate, control = np.ones_like(rays.direction), np.zeros_like(rays.length)
        strongest = np.maximum(highest(self.extinction), TINY)
        first = optical_depth(rays.steps.draw(0))
        march = self._march(replace(rays, steps=rays.steps.again()), first)
        step = 0
        while len(march):
            low, high = take(self.bounds.values, march.cell)
            rate = high - low
            lanes, inside = march.advance(rate, low)
            row, column = march.row.take(lanes), march.number.take(lanes)
            most = strongest.take(column)
            chance = march.draw(lanes, step)
            rest = self.density.at(column, march.points(lanes)) * most - low.take(lanes)
            rest = np.minimum(np.maximum(rest / rate.take(lanes), f4(0)), f4(1))
            left = take(estimate, row) * (f4(1) - rest * (take(self.extinction, column) / most))
            left = survivors(left, chance)
            estimate[:, row] = left
            inside[lanes] = highest(left) > 0
            if not inside.all():
                gone = np.flatnonzero(~inside)
                control[march.row.take(gone)] = march.control.take(gone)
                march = march.take(np.flatnonzero(inside))
            step += 1
        return estimate * exp(-control * take(self.extinction / strongest, rays.number))

    def emission(self, number: Ints, point: Floats, density: Floats) -> Floats:
        """Return the emission per scene unit, (3, n), at points (3, n) of the unit cube."""
        return take(self.shine, number) * density + self.glow.at(number, point)

    def _march(self, rays: MediumRays, left: Floats) -> March:
        """Return the rays that meet boxes, with the optical depths (n,) up to their first events."""
        matrix = take(self.to_unit, rays.number)
        at, along = (
            np.stack([dot(row, vectors) for row in (matrix[0:3], matrix[3:6], matrix[6:9])])
            for vectors in (rays.origin, rays.direction)
        )
        inside = replace(rays, origin=at + matrix[9:], direction=along)
        return March.of(inside, self.bounds.size, self.bounds.first, left)


def survivors(weight: Floats, u: Floats) -> Floats:
    """Return weights (3, n), of which faint ones become 0 or more with u (n,): their means stay."""
    chance = np.minimum(highest(weight) / FAINT, f4(1))
    return np.where(u < chance, weight / np.maximum(chance, TINY), f4(0))
