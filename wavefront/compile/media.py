"""The media of a scene: the media around each path, and how phase functions become materials."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arrays.soa import soa
from ..arrays.state import SurfaceInteraction
from ..arrays.vec import Bools, Doubles, Floats, Ints, f4
from ..bsdfs import Bsdf, BsdfSample
from ..core.errors import SceneError, warn_caller
from ..lights import GlowLights, LightRecord
from ..materials import Material
from ..media import BaseMedium, MediumRecord, PhaseFunction
from ..media.grid import GridMedia
from ..media.phase import deflected
from ..shapes import Shape
from ..textures.base import BaseTexture
from .touching import TouchingFaces

DEPTH = 4  # media that a path remembers, the last one that it entered first
NEAR = 1e-6  # part of a box that may overlap another one by rounding
LOWEST = np.iinfo(np.intp).min  # priority of the medium around all shapes
ENTRY = np.int16  # small: every path carries four


class PhaseBsdf(Bsdf):
    """A phase function as a BSDF, in a frame whose z axis is `wo`. There is no surface, and so no cosine."""

    transmissive = True
    view_independent = True

    def __init__(self, phase: PhaseFunction) -> None:
        self.phase = phase

    def f(self, wo: Floats, wi: Floats) -> Floats:
        """Return the phase function, (3, n)."""
        return np.broadcast_to(self.pdf(wo, wi), wi.shape)

    def pdf(self, wo: Floats, wi: Floats) -> Floats:
        """Return the phase function, (n,): it is its own density."""
        return self.phase.p(-wi[2])

    def evaluate(self, wo: Floats, wi: Floats) -> tuple[Floats, Floats]:
        """Return both."""
        pdf = self.pdf(wo, wi)
        return np.broadcast_to(pdf, wi.shape), pdf

    def sample_f(self, wo: Floats, u: Floats) -> BsdfSample:
        """Draw directions from the phase function, of weight 1."""
        wi = -deflected(self.phase.sample(u[0]), u[1])
        n = wi.shape[1]
        return BsdfSample(wi, np.ones((3, n), f4), self.pdf(wo, wi), np.zeros(n, np.bool_))

    def albedo(self, wo: Floats) -> Floats:
        """Return 1, (3, n)."""
        return np.ones_like(wo)


@soa
class MediaTable:
    """The media of a scene, and the entries of the stacks by which paths remember the shapes around them.

    Each material that encloses anything has an entry: a number from 1 on. Entry 0 is the medium around
    all shapes. A stack (4, n) has the entries of the shapes around each path, the last one that it entered
    first, and then 0. The entry of the highest priority counts; of equal ones it is the first.

    Source: C. Schmidt and B. Budge, "Simple Nested Dielectrics in Ray Traced Images", Journal of Graphics
    Tools 7(2), 2002.
    """

    entry_of: NDArray[Any]  # (materials,) and (phase functions,) after them; 0 for those that enclose nothing
    priority: Ints  # (entries,)
    nested: Bools  # (entries,) whether the index of refraction of the medium around counts
    index: Floats  # (entries,) of refraction; 1 where `nested` is False
    medium_of: Ints  # (entries,) number of the medium, -1 for none
    records: tuple[MediumRecord, ...]  # one for each kind
    record_of: Ints  # (media,) which record has it
    column_of: Ints  # (media,) and in which column
    event_of: Ints  # (media,) in place of a primitive where a path is scattered: -2 − its phase function
    scatters: Bools  # (media,)
    glows: bool  # any does
    light_of: Ints  # (media,) number of the light that samples its emission, -1 for none
    bounds: Doubles  # (2, 3) corners of all that encloses anything, relative to the scene's center
    touching: TouchingFaces | None = None  # None where no shapes that enclose anything lie on each other
    meet: bool = False  # whether something that encloses anything moves, and may come to lie on another

    @property
    def takes_steps(self) -> bool:
        """Whether a record needs numbers without end."""
        return any(record.takes_steps for record in self.records)

    @property
    def only_absorbs(self) -> bool:
        """Whether no random numbers are needed: nothing scatters or glows, or takes steps."""
        return not (self.scatters.any() or self.glows or self.takes_steps)

    def highest(self, stack: NDArray[Any]) -> NDArray[Any]:
        """Return the entries (n,) of the highest priority in stacks (k, n)."""
        best = stack[0]
        for entry in stack[1:]:
            if not entry.any():  # nor has any row after it
                break
            best = np.where(self.priority.take(entry) > self.priority.take(best), entry, best)
        return best

    def medium_in(self, stack: NDArray[Any]) -> Ints:
        """Return the medium (n,) inside of stacks (4, n), -1 for none."""
        return self.medium_of.take(self.highest(stack))

    def crossing(self, material: Ints, back_facing: Bools) -> NDArray[Any]:
        """Return the change of stacks at surfaces (n,): the entry that is pushed, negative if removed."""
        entry = self.entry_of.take(material)
        return np.where(back_facing, -entry, entry)

    def hidden(self, stack: NDArray[Any], material: Ints) -> Bools:
        """Return whether surfaces (n,) are within something of a higher priority, which hides them."""
        entry = self.entry_of.take(material)
        around = self.highest(without(stack, entry))
        return (entry > 0) & (self.priority.take(around) > self.priority.take(entry))

    def index_around(self, stack: NDArray[Any], surface: SurfaceInteraction) -> Floats | None:
        """Return the index of refraction outside of surfaces (n,); 1 where it does not count."""
        if not self.nested.any():
            return None
        entry = self.entry_of.take(surface.material)
        around = self.highest(np.where(surface.back_facing, without(stack, entry), stack))
        return np.where(self.nested.take(entry), self.index.take(around), f4(1))

    def holding(self, light: Ints, lights: int) -> Ints:
        """Return the media (n,) whose emission lights (n,) sample, of `lights` in all; -1 for none."""
        medium = np.full(lights + 1, -1)
        medium[self.light_of] = np.arange(len(self.light_of))
        medium[-1] = -1
        return medium.take(light)

    def by_record(self, medium: Ints) -> Iterator[tuple[MediumRecord, Ints, Ints]]:
        """Yield each record that occurs among media (n,), the lanes (k,) that it has, and their columns."""
        record_of = self.record_of.take(medium)
        for number, record in enumerate(self.records):
            lanes = np.flatnonzero(record_of == number)
            if lanes.size:
                yield record, lanes, self.column_of.take(medium.take(lanes))


def crossed(stack: NDArray[Any], crossing: NDArray[Any]) -> NDArray[Any]:
    """Return stacks (4, n) after `MediaTable.crossing` (n,), or after several, (k, n)."""
    if crossing.ndim == 2:
        for entries in crossing:
            stack = crossed(stack, entries)
        return stack
    lanes = np.flatnonzero(crossing)
    if not lanes.size:
        return stack
    if lanes.size < crossing.size:
        out = stack.copy()
        out[:, lanes] = crossed(stack.take(lanes, 1), crossing.take(lanes))
        return out
    enters = crossing > 0
    if (enters & (stack[-1] != 0)).any():
        warn_caller(f"paths are inside of more than {DEPTH} shapes; they forget the outermost")
    out = without(stack, np.where(crossing < 0, -crossing, ENTRY(-1)))
    shifted = np.concatenate([crossing[None], stack[:-1]])
    return np.where(enters, shifted, out)


def stacks_leaving(stack: NDArray[Any], crossing: NDArray[Any], cos: Floats) -> NDArray[Any]:
    """Return the stacks (4, n) of rays that leave surfaces.

    Parameters
    ----------
    stack
        (4, n) of the rays that have come.
    crossing
        (k, n) changes of the stacks at the surfaces.
    cos
        (n,) cosine between the rays and the normal on the side from which the others came: they cross the
        surfaces where it is below 0.
    """
    return crossed(stack, np.where(cos < 0, crossing, ENTRY(0)))


def without(stack: NDArray[Any], entry: NDArray[Any]) -> NDArray[Any]:
    """Return stacks (4, n) without the last of these entries (n,) that was put there."""
    out, gone = np.empty_like(stack), np.zeros(entry.size, np.bool_)
    for row, values in enumerate(stack):
        gone |= values == entry
        below = stack[row + 1] if row + 1 < len(stack) else np.zeros_like(values)
        out[row] = np.where(gone, below, values)
    return out


def media_of(
    materials: Sequence[Material], around: BaseMedium | None, alone: Callable[[], bool]
) -> list[BaseMedium]:
    """Return the distinct media that need a `MediaTable`; none where absorption behind surfaces is all.

    Parameters
    ----------
    materials
        Those of the scene.
    around
        The medium of the scene.
    alone
        Says whether each absorber is alone (compile/absorption.py); asked where nothing else needs a table.
    """
    inside = [material.interior for material in materials if material.interior is not None]
    needed = around is not None or any(material.priority is not None for material in materials)
    varied = any(medium.scatters or medium.glows or medium.bounds is not None for medium in inside)
    if not needed and not varied and alone():
        return []
    return list({id(medium): medium for medium in [*inside, *([] if around is None else [around])]}.values())


def phase_materials(media: Sequence[BaseMedium]) -> list[Material]:
    """Return a material for each distinct phase function."""
    distinct = {id(medium.phase): medium.phase for medium in media if medium.scatters}
    return [Material(PhaseBsdf(phase)) for phase in distinct.values()]


def media_table(
    around: BaseMedium | None,
    shapes: Sequence[Shape],
    materials: Sequence[Material],
    media: Sequence[BaseMedium],
    center: Doubles,
) -> MediaTable | None:
    """Return the table of the media of a scene; None if it needs none.

    Parameters
    ----------
    around
        The medium of the scene.
    shapes, materials
        Those of the scene.
    media
        The result of `media_of`.
    center
        (3,) of the scene.
    """
    priorities = [material.priority for material in materials]
    if not media and all(priority is None for priority in priorities):
        return None
    _check_apart(shapes)
    phases = list(dict.fromkeys(id(medium.phase) for medium in media if medium.scatters))
    entry_of, holders = np.zeros(len(materials) + len(phases), ENTRY), list[Material]()
    for row, material in enumerate(materials):
        if material.encloses:
            holders.append(material)
            entry_of[row] = len(holders)
    if len(holders) > np.iinfo(ENTRY).max:
        raise SceneError(
            f"{len(holders)} materials enclose something in a scene with media; "
            f"there may be {np.iinfo(ENTRY).max}"
        )
    number = {id(medium): place for place, medium in enumerate(media)}
    inside = [around, *(material.interior for material in holders)]
    nested = np.array([False, *(material.priority is not None for material in holders)])
    kinds = list(dict.fromkeys(type(medium) for medium in media))
    records: list[MediumRecord] = []
    record_of, column_of = np.zeros(len(media), np.intp), np.zeros(len(media), np.intp)
    for place, kind in enumerate(kinds):
        indices = [index for index, medium in enumerate(media) if type(medium) is kind]
        kind_records = [media[index].record(center) for index in indices]
        records.append(type(kind_records[0]).concatenate(kind_records))
        record_of[indices], column_of[indices] = place, np.arange(len(indices))
    boxes = [shape.bounds for shape in shapes if shape.material.encloses]
    return MediaTable(
        entry_of=entry_of,
        priority=np.array([LOWEST, *(material.priority or 0 for material in holders)], np.intp),
        nested=nested,
        index=np.array([1, *map(_index, holders)], f4),
        medium_of=np.array([-1 if medium is None else number[id(medium)] for medium in inside], np.intp),
        records=tuple(records),
        record_of=record_of,
        column_of=column_of,
        event_of=np.array([-2 - phases.index(id(m.phase)) if m.scatters else 0 for m in media], np.intp),
        scatters=np.array([medium.scatters for medium in media], np.bool_),
        glows=any(medium.glows for medium in media),
        light_of=np.full(len(media), -1),
        bounds=np.stack([np.min(boxes, 0)[0], np.max(boxes, 0)[1]]) - center
        if boxes
        else np.array([[np.inf] * 3, [-np.inf] * 3]),
    )


def glow_lights(media: MediaTable | None) -> tuple[list[LightRecord], Ints]:
    """Return the lights of media on grids that glow, and the numbers (k,) of the media."""
    if media is None:
        return [], np.zeros(0, np.intp)
    lights, numbers = list[LightRecord](), []
    for number, (which, column) in enumerate(zip(media.record_of, media.column_of, strict=True)):
        record = media.records[which]
        if isinstance(record, GridMedia) and record.glows[column]:
            lights.append(GlowLights.of(record, int(column)))
            numbers.append(number)
    return lights, np.array(numbers, np.intp)


def _check_apart(shapes: Sequence[Shape]) -> None:
    """Refuse shapes of one priority whose media are different grids in boxes that overlap."""
    placed = []
    for shape in shapes:
        medium = shape.material.interior
        if medium is not None and medium.bounds is not None:
            (low, high), (first, last) = shape.bounds, medium.bounds
            placed.append((shape, medium, np.maximum(low, first), np.minimum(high, last)))
    low, high = (np.array([placement[side] for placement in placed]).reshape(-1, 3) for side in (2, 3))
    for number, (shape, medium, *_) in enumerate(placed):
        shared = np.minimum(high, high[number]) - np.maximum(low, low[number])
        for other in np.flatnonzero((shared > NEAR * (high[number] - low[number])).all(1)):
            one, two = shape, placed[other][0]
            if medium is not placed[other][1] and (one.material.priority or 0) == (
                two.material.priority or 0
            ):
                raise SceneError(
                    f"{one.name} and {two.name}: the grids of their media overlap; "
                    "give one of the materials a higher priority"
                )


def _index(material: Material) -> float:
    """Return the index of refraction inside a material that has a priority, 1 for others."""
    index = material.bsdf.index_inside
    if material.priority is None or index is None or material.bsdf.invisible:
        return 1.0
    if isinstance(index, BaseTexture) or np.size(index) != 1:
        name = type(material.bsdf).__name__
        raise SceneError(
            f"Material priority is {material.priority}; the ior of its {name} must be one number"
        )
    return float(np.ravel(index)[0])
