"""A tree over many lights, which are chosen by an estimate of their irradiance at the point itself.

Each child of a node stands for all lights below it, by their power, mean position and direction, and the
spread of both. A light is chosen from the root down: at each level one of up to 16 children, by its estimated
irradiance. So the choice among a million lights takes five steps.

Source: A. Conty Estevez and C. Kulla, "Importance Sampling of Many Lights with Adaptive Tree Splitting",
Proceedings of the ACM on Computer Graphics and Interactive Techniques 1(2), 2018; without the splitting, with
wide nodes in place of binary ones, and with a smooth estimate in place of a bound of the cosine.
"""

from __future__ import annotations

from copy import copy
from typing import Self

import numpy as np

from ..arrays.vec import Doubles, Floats, Ints, f4, spans
from .base import Emitters, Receiver
from .choice import LightSampler

BITS = 4  # of the number of a child: a node has 16 children; the root may have fewer
AT_ONCE = 1 << 12  # points per batch: their nodes fit the cache
FIELDS = 9  # of a child: position (3), squared extent, power, mean direction (3), spread of directions
LEAST_SPREAD = 1e-3  # so that no light is left out for its direction
LEAST_EXTENT = 1e-3  # of a light, in scene radii: at this distance it seems no brighter than further away
LEAST_POWER = 1e-12  # of that of the brightest light


class LightTreeSampler(LightSampler):
    """Probabilities by an estimate of the irradiance at each point.

    Parameters
    ----------
    emitters
        Where the k lights are.
    power
        (k,) their power, all above 0.
    scene_radius
        Of a ball about the origin, scene units.

    Notes
    -----
    Numbers u have 24 bits: of very many lights that are all improbable at a point, some are never drawn.
    """

    takes_receiver = True
    receiver: Receiver | None = None

    def __init__(self, emitters: Emitters, power: Doubles, scene_radius: float) -> None:
        lights = len(power)
        depth = max(1, (lights - 1).bit_length())
        slots = 1 << depth
        self.bits = [depth % BITS or BITS, *[BITS] * (-(-depth // BITS) - 1)]  # of the slot, by level
        slot = np.arange(lights) * slots // lights  # the lights are spread evenly over a full tree
        order = compact_order(emitters.middle / max(scene_radius, 1e-30), slot, depth)
        self.light = np.zeros(slots, np.intp)  # of each slot
        self.light[slot] = order
        self.slot = np.empty(lights, np.intp)  # of each light
        self.slot[order] = slot
        self.scale = 1 / max(scene_radius, 1e-30)
        share = np.maximum(power.take(order) / power.max(), LEAST_POWER)
        position = emitters.middle.take(order, 1) * self.scale
        extent2 = np.maximum(emitters.extent2.take(order) * self.scale**2, LEAST_EXTENT**2)
        sums = np.zeros((8, slots))  # of power, and of power times position, its square, and direction
        sums[0, slot] = share
        sums[1:4, slot] = position * share
        sums[4, slot] = ((position * position).sum(0) + extent2) * share
        sums[5:, slot] = emitters.facing.take(order, 1) * share
        self.nodes: list[Floats] = []
        for bits in reversed(self.bits):
            self.nodes.insert(0, _packed(sums, 1 << bits))
            sums = sums.reshape(len(sums), -1, 1 << bits).sum(2)

    def lighting(self, receiver: Receiver) -> Self:
        """Return the sampler by the irradiance of surfaces."""
        bound = copy(self)
        bound.receiver = receiver
        return bound

    def sample(self, point: Floats, u: Floats) -> tuple[Ints, Floats]:
        """Choose a child at each level by inverting its cumulative weights."""
        n = len(u)
        light, chance = np.empty(n, np.intp), np.empty(n, f4)
        for span in spans(n, AT_ONCE):
            light[span], chance[span] = self._sample(point[:, span], u[span], self._receiver(span))
        return self.light.take(light), chance

    def pmf(self, light: Ints, point: Floats) -> Floats:
        """Return the product of the chances of all children on the way to each light."""
        n = len(light)
        slot, chance = self.slot.take(light), np.empty(n, f4)
        for span in spans(n, AT_ONCE):
            chance[span] = self._pmf(slot[span], point[:, span], self._receiver(span))
        return chance

    def _receiver(self, span: slice) -> Receiver | None:
        return None if self.receiver is None else self.receiver.take(span)

    def _sample(self, point: Floats, u: Floats, receiver: Receiver | None) -> tuple[Ints, Floats]:
        n = len(u)
        node, chance = np.zeros(n, np.intp), np.ones(n, f4)
        for bits, nodes in zip(self.bits, self.nodes, strict=True):
            upto = self._upto(nodes, node, point, receiver)
            total = upto[-1]
            at = np.minimum(u * total, total * f4(1 - 2.0**-22))  # below the total: its child has a width
            child = (upto[:-1] <= at).sum(0)
            begin, end = _interval(upto, child)
            u = (at - begin) / (end - begin)
            chance *= (end - begin) / total
            node = (node << bits) + child
        return node, chance

    def _pmf(self, slot: Ints, point: Floats, receiver: Receiver | None) -> Floats:
        chance = np.ones(len(slot), f4)
        left = sum(self.bits)
        for bits, nodes in zip(self.bits, self.nodes, strict=True):
            node = slot >> left
            left -= bits
            child = (slot >> left) & ((1 << bits) - 1)
            upto = self._upto(nodes, node, point, receiver)
            begin, end = _interval(upto, child)
            chance *= (end - begin) / upto[-1]
        return chance

    def _upto(self, nodes: Floats, node: Ints, point: Floats, receiver: Receiver | None) -> Floats:
        """Return the cumulative estimates of the children of nodes (n,), (children, n)."""
        if len(nodes) == 1:
            fields = nodes.reshape(FIELDS, -1, 1)
        else:
            fields = np.ascontiguousarray(nodes.take(node, 0).T).reshape(FIELDS, -1, node.size)
        x, y, z, extent2, power, dx, dy, dz, spread = fields
        away_x, away_y, away_z = (row * f4(self.scale) - at for row, at in zip(point, (x, y, z), strict=True))
        distance2 = away_x * away_x
        distance2 += away_y * away_y
        distance2 += away_z * away_z
        along = away_x * dx
        along += away_y * dy
        along += away_z * dz
        distance2 += extent2
        # h + √(h² + s) for the mean cosine h, with s from the spread of directions and from the extent seen
        # from the point: twice the cosine of one direction, and 1/2 for directions all over the sphere.
        value = along * along
        value += spread * distance2
        value += extent2
        np.sqrt(value, out=value)
        value += along
        distance = np.sqrt(distance2)
        if receiver is not None:
            nx, ny, nz = receiver.normal
            above = away_x * -nx
            above -= away_y * ny
            above -= away_z * nz
            above /= distance
            # likewise for the cosine at the surface, with s from the extent alone
            above += np.sqrt(above * above + (f4(0.25) * extent2 / distance2 + f4(LEAST_SPREAD)))
            value *= np.where(receiver.opaque, above, f4(1))
        distance *= distance2
        value /= distance
        value *= power
        for row in range(1, len(value)):
            value[row] += value[row - 1]
        return value


def _interval(upto: Floats, child: Ints) -> tuple[Floats, Floats]:
    """Return where the intervals of children (n,) begin and end in cumulative weights (children, n)."""
    n = child.size
    lane, flat = np.arange(n), upto.reshape(-1)
    before = flat.take(np.maximum(child - 1, 0) * n + lane)
    return np.where(child > 0, before, f4(0)), flat.take(child * n + lane)


def _packed(sums: Doubles, width: int) -> Floats:
    """Return the fields of the children of each node, (nodes, FIELDS * width); 0 where there is none."""
    fields = np.zeros((FIELDS, sums.shape[1]), f4)
    used = np.flatnonzero(sums[0])
    power, mean = sums[0].take(used), sums[1:8].take(used, 1) / sums[0].take(used)
    position, square, direction = mean[:3], mean[3], mean[4:]
    fields[:3, used] = position
    fields[3] = 1
    fields[3, used] = np.maximum(square - (position * position).sum(0), 0)
    fields[4, used] = power
    fields[5:8, used] = direction
    fields[8, used] = LEAST_SPREAD + 0.25 * np.maximum(1 - (direction * direction).sum(0), 0)
    return np.ascontiguousarray(fields.reshape(FIELDS, -1, width).swapaxes(0, 1)).reshape(-1, FIELDS * width)


def compact_order(middle: Doubles, slot: Ints, depth: int) -> Ints:
    """Return the lights in the order of their slots, rising, so that those of a subtree are near each other.

    Each segment of a level is sorted along its longest axis, and so split in the middle. A word holds the
    segment, the place along the axis and the number before sorting: words sort with vector instructions.
    """
    count = slot.size
    order, number = np.arange(count), np.arange(count, dtype=np.uint64)
    rows = np.ascontiguousarray(middle, f4)
    steps = (1 << min(20, 63 - 2 * depth)) - 1  # along the axis
    shift = np.uint64(depth)
    for level in range(depth - BITS):  # the order of the children of the last nodes does not matter
        segment = slot >> (depth - level)
        begin = np.flatnonzero(np.diff(segment, prepend=-1))
        size = np.diff(begin, append=count)
        low = np.minimum.reduceat(rows, begin, 1)
        extent = np.maximum.reduceat(rows, begin, 1) - low
        axis, segments = extent.argmax(0), np.arange(begin.size)
        along = rows.reshape(-1).take(np.repeat(axis * count, size) + np.arange(count))
        along -= np.repeat(low[axis, segments], size)
        along *= np.repeat(f4(steps) / np.maximum(extent[axis, segments], f4(1e-30)), size)
        word = (segment * (steps + 1) + along.astype(np.intp)).astype(np.uint64) << shift
        word |= number
        word.sort()
        word &= np.uint64((1 << depth) - 1)
        moved = word.astype(np.intp)
        order, rows = order.take(moved), np.stack([row.take(moved) for row in rows])
    return order
