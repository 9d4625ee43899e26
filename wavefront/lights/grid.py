"""A grid over the scene, whose cells weight the lights for surfaces of each orientation."""

from __future__ import annotations

from copy import copy
from typing import Self

import numpy as np

from ..arrays.vec import Doubles, Floats, Ints, f4, spans
from .base import Emitters, Receiver
from .choice import Irradiance, LightSampler
from .tree import compact_order

MOST_CELLS = 2400
MOST_ENTRIES = 2**21  # cells times lights, and cells times orientations times groups of lights
AT_ONCE = 2**16  # entries per batch: they fit the cache
FEW = 4  # bits of the number of groups, for as many lights; more are gathered in groups
MOST_BITS = 5  # of the number of a light in its group
BY_POWER = 0.05  # part of the probability that is proportional to power, so that no light is left out
ORIENTATIONS = 27  # -1, 0 or 1 along each axis
ANY = ORIENTATIONS // 2  # orientation of surfaces that are lit from both sides, or unknown
SLANTED = f4(0.38)  # sin 22.5°: from here on a component counts
SPREAD = 0.93  # mean cosine between normals and the middle of their orientation
LEAST_SPREAD = 1e-3  # of directions, so that lights near the horizon get a share
FAR = 1e3  # scene radii: where lights at infinity count as placed


class SpatialLightSampler(LightSampler):
    """Probabilities by position and normal: each cell of a grid weights all lights by their irradiance there.

    Lights that are near, lights that face the cell, and lights above the horizon of the surface are chosen
    more often. A small part of the probability is proportional to power. Of more than a few lights, those
    near each other make a group: the normal chooses a group, and the cell alone a light of it.

    Parameters
    ----------
    low, high
        (3,) corners of the scene, scene units.
    irradiance
        Called with cell centers (3, c) and the cells' radius; returns the most
        irradiance of each light in each cell, (c, k).
    power
        (k,) estimated power of each light.
    """

    takes_receiver = True

    def __init__(self, low: Doubles, high: Doubles, irradiance: Irradiance, power: Doubles) -> None:
        depth = (len(power) - 1).bit_length()
        self.bits = int(np.clip(depth - FEW, 0, MOST_BITS))  # of the number of a light in its group
        self.group_bits = depth - self.bits
        slots, groups = 1 << depth, 1 << self.group_bits
        most = MOST_ENTRIES // max(slots, ORIENTATIONS * groups)
        self.low, self.shape, size = _grid(low, high, int(np.clip(most, 1, MOST_CELLS)))
        self.inverse_size = 1 / size
        self.orientation: Ints | int = ANY
        emitters = _placed(irradiance.emitters, float(np.linalg.norm(high - low)))
        slot = np.arange(len(power)) * slots // len(power)  # a tree's order, so that groups are compact
        order = compact_order(np.nan_to_num(emitters.middle), slot, depth)
        self.light, self.slot = np.zeros(slots, np.intp), np.empty(len(power), np.intp)
        self.light[slot], self.slot[order] = order, slot
        share = np.zeros(slots)
        share[slot] = power.take(order) / power.sum()
        where = _Groups(emitters, share.take(self.slot), self.slot >> self.bits, groups)
        centers = self.low[:, None] + (np.indices(self.shape).reshape(3, -1) + 0.5) * size[:, None]
        radius, count = float(np.linalg.norm(size)) / 2, centers.shape[1]
        of_group = np.empty((count, ORIENTATIONS, groups + 1), f4)
        of_light = np.empty((count if self.bits else 0, groups, (1 << self.bits) + 1), f4)
        for cells in spans(count, max(AT_ONCE // max(slots, ORIENTATIONS * groups), 1)):
            center = centers[:, cells]
            weight = np.zeros((center.shape[1], slots))
            weight[:, slot] = irradiance(center, radius).take(order, 1)
            in_groups = weight.reshape(-1, groups, 1 << self.bits)
            lit = in_groups.sum(2)[:, None] * where.cosines(center, radius)
            of_group[cells] = _upto(_mixed(lit, share.reshape(groups, -1).sum(1)))
            if self.bits:
                of_light[cells] = _upto(_mixed(weight, share).reshape(in_groups.shape))
        self.of_group, self.of_light = of_group.ravel(), of_light.ravel()

    def lighting(self, receiver: Receiver) -> Self:
        """Return the sampler for the normals of opaque surfaces."""
        bound = copy(self)
        x, y, z = ((row > SLANTED).astype(np.int8) - (row < -SLANTED) for row in receiver.normal)
        bound.orientation = ((9 * x + 3 * y + z) * receiver.opaque).astype(np.intp) + ANY
        return bound

    def sample(self, point: Floats, u: Floats) -> tuple[Ints, Floats]:
        """Choose a group by inverting the cumulative weights of each point's cell, and a light of it."""
        cell = self._cell(point)
        group, chance, u = _invert(self.of_group, cell * ORIENTATIONS + self.orientation, self.group_bits, u)
        if not self.bits:
            return self.light.take(group), chance
        row = (cell << self.group_bits) + group
        place, light_chance, _ = _invert(self.of_light, row, self.bits, u)
        return self.light.take((group << self.bits) + place), chance * light_chance

    def pmf(self, light: Ints, point: Floats) -> Floats:
        """Return the weight of each light in its point's cell."""
        cell, slot = self._cell(point), self.slot.take(light)
        group = slot >> self.bits
        chance = _width(self.of_group, cell * ORIENTATIONS + self.orientation, self.group_bits, group)
        if not self.bits:
            return chance
        row = (cell << self.group_bits) + group
        return chance * _width(self.of_light, row, self.bits, slot - (group << self.bits))

    def _cell(self, point: Floats) -> Ints:
        """Return the number of the cell of each point (n,); points outside belong to the nearest."""
        cell = np.zeros(point.shape[1], np.intp)
        for row, low, inverse, count in zip(point, self.low, self.inverse_size, self.shape, strict=True):
            along = np.clip((row - f4(low)) * f4(inverse), f4(0), f4(count - 1)).astype(np.intp)
            cell = cell * count + along
        return cell


class _Groups:
    """Where the lights of each of g groups are, weighted by power."""

    def __init__(self, emitters: Emitters, share: Doubles, group: Ints, groups: int) -> None:
        def total(values: Doubles) -> Doubles:
            return np.bincount(group, values * share, groups).astype(np.float64)

        placed = np.isfinite(emitters.extent2)
        everything, placed_share = total(np.ones(len(share))), total(placed)
        weight = np.where(placed_share > 0, placed_share, 1)
        middle, extent2 = np.where(placed, emitters.middle, 0), np.where(placed, emitters.extent2, 0)
        self.middle = np.stack([total(row) for row in middle]) / weight
        square = total((middle * middle).sum(0) + extent2) / weight
        self.extent2 = np.maximum(square - (self.middle * self.middle).sum(0), 0)
        self.placed = placed_share / np.where(everything > 0, everything, 1)  # part of the power

    def cosines(self, center: Doubles, radius: float) -> Doubles:
        """Return estimates (c, ORIENTATIONS, g) of cosines at cells (3, c); 1 where nothing is known.

        (h + √(h² + s))/2, with the mean cosine h and s from the spread of directions: h of one direction
        above the horizon, and ¼ for directions all over the sphere.
        """
        towards = self.middle[:, None] - center[:, :, None]
        square = (towards * towards).sum(0)
        towards *= SPREAD / np.sqrt(square + self.extent2 + radius**2)
        spread = np.maximum(1 - (towards * towards).sum(0), 0) / 4 + LEAST_SPREAD
        x, y, z = _orientations()
        h = x * towards[0, :, None] + y * towards[1, :, None] + z * towards[2, :, None]
        cosine = (h + np.sqrt(h * h + spread[:, None])) / 2
        # the nearest points of a cell get most light from a light in it, from any side
        far = np.square(square / radius**2)
        cosine = 1 + (cosine - 1) * (self.placed * far / (1 + far))[:, None]
        cosine[:, ANY] = 1
        return np.asarray(cosine)


def _orientations() -> Doubles:
    """Return the middles of orientations, unit vectors (3, ORIENTATIONS, 1); 0 for that of any."""
    steps = np.indices((3, 3, 3)).reshape(3, -1, 1).astype(np.float64) - 1
    return np.asarray(steps / np.sqrt(np.maximum((steps * steps).sum(0), 1)))


def _placed(emitters: Emitters, extent: float) -> Emitters:
    """Return lights at infinity as far away."""
    far = np.isinf(emitters.extent2)
    middle = np.where(far, -FAR * extent * emitters.facing, emitters.middle)
    return Emitters(middle, emitters.facing, np.where(far, 0, emitters.extent2))


def _mixed(weight: Doubles, share: Doubles) -> Doubles:
    """Turn weights (..., k) into probabilities, with the part of `share` (k,) in them, in place."""
    total = weight.sum(-1, keepdims=True)
    lit = total > 0
    weight *= np.divide(1 - BY_POWER, total, out=np.zeros_like(total), where=lit)
    weight += np.where(lit, BY_POWER, 1) * share
    return weight


def _upto(weight: Doubles) -> Floats:
    """Return where items (..., k) begin and end in [0, 1], (..., k + 1)."""
    cumulative = np.cumsum(weight, -1)
    upto = np.zeros((*weight.shape[:-1], weight.shape[-1] + 1), f4)
    np.divide(cumulative, cumulative[..., -1:], out=upto[..., 1:], casting="same_kind")
    return upto


def _width(upto: Floats, row: Ints, bits: int, item: Ints) -> Floats:
    """Return the width (n,) of an item (n,) of each row (n,)."""
    at = row * ((1 << bits) + 1) + item
    return upto.take(at + 1) - upto.take(at)


def _invert(upto: Floats, row: Ints, bits: int, u: Floats) -> tuple[Ints, Floats, Floats]:
    """Return the item (n,) of each row that u (n,) is in, its width, and where u is within it, in [0, 1).

    By bisection of all at once.
    """
    first = row * ((1 << bits) + 1)
    at = first
    for bit in reversed(range(bits)):
        at = at + ((u >= upto.take(at + (1 << bit))) * np.intp(1 << bit))
    begin = upto.take(at)
    width = upto.take(at + 1) - begin
    return at - first, width, np.minimum((u - begin) / width, f4(1 - 2.0**-24))


def _grid(low: Doubles, high: Doubles, cells: int) -> tuple[Doubles, tuple[int, int, int], Doubles]:
    """Return the corner, the counts and the cell size (3,) of a grid of nearly cubic cells."""
    extent = np.maximum(high - low, 1e-3 * max(float((high - low).max()), 1e-30))
    side = (extent.prod() / cells) ** (1 / 3)
    counts = np.clip(np.floor(extent / side + 1e-6), 1, cells).astype(int)  # the same at every scale
    while counts.prod() > cells:
        counts[np.argmax(counts)] -= 1
    return low, (int(counts[0]), int(counts[1]), int(counts[2])), extent / counts
