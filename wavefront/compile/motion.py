"""Shapes and lights that move while a shutter is open, and their places at the time of a path.

The arrays of a compiled scene hold it as it is in the middle of that time. Moving shapes are instances in
them: each ray meets these by the matrix of its own time. A mesh that deforms has its corners at several
times, as an instance that follows its middle.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import field
from itertools import pairwise
from typing import Any

import numpy as np

from ..accel import Accelerator, CurvedPrimitives, Geometry, InstanceAccelerator, Placements
from ..accel.deforming import DeformingAccelerator, SweptSpheres, joined_steps
from ..accel.moving import MovingInstances
from ..accel.sphere import SpherePrimitives
from ..arrays.soa import soa
from ..arrays.state import Hits
from ..arrays.vec import Bools, Doubles, Floats, Ints, f4, spans
from ..motion.shutter import Shutter
from ..motion.steps import Matrices, Motions, growth_of, inverse_linear, step_at
from ..scene import Scene
from ..shapes import Instance, Mesh
from ..shapes.attributes import Corners, corner_values
from .geometry import compute_corner_normals, compute_face_normals

BOX_ROOM = 2.0**-17  # margin of boxes of moving shapes, relative to their size
BOX_TIMES = 9  # of each step of a motion, at which its box is found
BOXES_AT_ONCE = 1 << 12  # steps
IDENTITY = np.eye(4)


@soa
class Mover:
    """How an instance moves."""

    matrices: Matrices  # from times (n,), s, to matrices (n, 4, 4) to the scene
    mesh: Mesh | None = None  # one that deforms; None where it is rigid
    # of spheres that move by themselves: their centers (k, 3) at a time, as carried to the middle of the time
    centers: Callable[[float], Doubles] | None = None
    keys: Doubles = field(default_factory=lambda: np.zeros(0))  # (n,) times at which they turn, s


@soa
class Exposed:
    """A scene in the middle of the time for which a shutter is open, and the motions of its parts."""

    scene: Scene
    shutter: Shutter | None = None  # None where nothing moves
    movers: dict[int, Mover] = field(default_factory=dict)  # by the number of the shape
    lights: dict[int, Matrices] = field(default_factory=dict)  # matrices, likewise
    boxes: tuple[Doubles, ...] = ()  # (2, 3) each, the corners of all that moves at some times
    # (k,) s, times at which something may go another way
    keys: Doubles = field(default_factory=lambda: np.zeros(0))
    changed: Bools | None = None  # (n,) which shapes are other ones at other times; None where none are

    @property
    def bounds(self) -> Doubles:
        """Lower and upper corner (2, 3) of all places of the shapes."""
        low, high = zip(self.scene.bounds, *self.boxes, strict=True)
        return np.stack([np.min(low, 0), np.max(high, 0)])


@soa
class DeformingRows:
    """A mesh that deforms: its triangles at some times, in the coordinates in which it is traced."""

    first: int  # row of its first triangle in the scene's tables
    times: Doubles  # (steps + 1,) s
    corners: list[Floats]  # for each of those times (m, 3, 3)
    normals: list[Corners] | None  # of vertices, 3 × (3, m); None where they have none
    vectors: dict[str, list[Corners]]  # attributes that are vectors along the surface, likewise

    @property
    def end(self) -> int:
        """One past the row of its last triangle."""
        return self.first + len(self.corners[0])

    def accelerator(self, weights: bool) -> DeformingAccelerator:
        """Return the accelerator, with barycentric weights if these are needed."""
        return DeformingAccelerator(*joined_steps(self.times, self.corners), weights)

    @property
    def box(self) -> tuple[Doubles, Doubles]:
        """The corners (3,) of the box of all places."""
        points = [form.reshape(-1, 3).astype(np.float64) for form in self.corners]
        return np.min([form.min(0) for form in points], 0), np.max([form.max(0) for form in points], 0)

    def face_normals(self, row: Ints, time: Doubles) -> Floats:
        """Return the unit normals (3, n) of triangles, by their rows (n,), at times (n,)."""
        return compute_face_normals(self.corners_at(row, time))

    def corners_at(self, row: Ints, time: Doubles) -> Doubles:
        """Return the corners (n, 3, 3) of triangles, by their rows (n,), at times (n,)."""
        step, fraction = step_at(self.times, time)
        corners = np.empty((row.size, 3, 3))
        for number in range(len(self.corners) - 1):
            lanes = np.flatnonzero(step == number)
            at = row.take(lanes) - self.first
            before, after = (self.corners[number + side].take(at, 0).astype(np.float64) for side in (0, 1))
            corners[lanes] = before + (after - before) * fraction.take(lanes)[:, None, None]
        return corners

    def vertex_normals(self, row: Ints, time: Doubles) -> list[Floats]:
        """Return the normals of vertices, 3 × (3, n), of triangles at times; not of unit length."""
        assert self.normals is not None
        return self._between(self.normals, row, time)

    def vectors_at(self, name: str, row: Ints, time: Doubles) -> list[Floats]:
        """Return vectors along the surface at the corners, 3 × (c, n), of triangles at times."""
        return self._between(self.vectors[name], row, time)

    def _between(self, forms: list[Corners], row: Ints, time: Doubles) -> list[Floats]:
        """Return values at corners, 3 × (c, n), at times (n,), given those at the times of forms."""
        step, fraction = step_at(self.times, time)
        found = [np.empty((len(values), row.size), f4) for values in forms[0]]
        for number in range(len(forms) - 1):
            lanes = np.flatnonzero(step == number)
            at, share = row.take(lanes) - self.first, fraction.take(lanes).astype(f4)
            for corner, values in enumerate(found):
                before, after = (forms[number + side][corner].take(at, 1) for side in (0, 1))
                values[:, lanes] = before + (after - before) * share
        return found


@soa
class CurvedRows:
    """A curved shape that moves."""

    first: int  # row of its first primitive in the scene's tables
    kind: CurvedPrimitives  # in the middle of the time
    times: Doubles  # (steps + 1,) s
    centers: Floats | None = None  # (steps + 1, 3, k) of spheres that move by themselves; else None

    def swept(self) -> list[SweptSpheres]:
        """Return the spheres, step by step."""
        assert self.centers is not None
        assert isinstance(self.kind, SpherePrimitives)
        return [SweptSpheres(first, last, self.kind.radii) for first, last in pairwise(self.centers)]

    def ways(self, row: Ints, time: Doubles) -> Doubles:
        """Return the ways (3, n) of spheres, by rows (n,), from their places in `kind` to times (n,)."""
        assert self.centers is not None
        assert isinstance(self.kind, SpherePrimitives)
        (step, fraction), at = step_at(self.times, time), row - self.first
        rows, count = self.centers.transpose(1, 0, 2).reshape(3, -1).astype(np.float64), len(self.kind)
        before, after = rows.take(step * count + at, 1), rows.take((step + 1) * count + at, 1)
        return np.asarray(before + (after - before) * fraction - self.kind.centers.take(at, 1))


@soa
class MotionTable:
    """The places of moving shapes at a time."""

    shutter: Shutter
    motions: Motions | None  # of shapes; None where only lights move
    mover: Ints  # (p,) the motion of each column of the `InstanceTable`, -1 for none
    scale: Floats  # (p,) by which normals are multiplied, so that their lengths are at most 1
    column_of_row: Ints  # (rows,) column of the `InstanceTable` of moving shapes, by table row; else 0
    deformations: tuple[DeformingRows, ...]
    curved: tuple[CurvedRows, ...]
    lights: Motions | None = None  # of those in `motion_of_light`
    motion_of_light: dict[int, int] = field(default_factory=dict)  # by their numbers in the scene
    all_move: bool = False  # whether no instance stands still

    def matrices(self, column: Ints, time: Doubles) -> Doubles:
        """Return the matrices (12, n), from the scene, of moving shapes in columns (n,) at times (n,)."""
        assert self.motions is not None
        return self.motions.at(self.mover.take(column), time)

    def growth(self, column: Ints) -> Doubles:
        """Return by what areas of shapes in columns (n,) grow in the middle of the time; 1 if they stay."""
        grown, moves = np.ones(column.size), np.flatnonzero(self.mover.take(column) >= 0)
        times = np.full(moves.size, self.shutter.middle)
        grown[moves] = growth_of(inverse_linear(self.matrices(column.take(moves), times)))
        return grown

    def ways(self, row: Ints, time: Doubles) -> Doubles:
        """Return how far curved primitives (n,), by rows, are from where the tables have them, (3, n)."""
        ways = np.zeros((3, row.size))
        for each in self.curved:
            if each.centers is not None:
                some = np.flatnonzero((row >= each.first) & (row < each.first + len(each.kind)))
                ways[:, some] = each.ways(row.take(some), time.take(some))
        return ways

    def is_rigid(self, row: Ints) -> Bools:
        """Return which rows (n,) of the scene's tables are of no mesh that deforms."""
        rigid = np.ones(row.size, np.bool_)
        for _, lanes in self.deformation_of(row):
            rigid[lanes] = False
        return rigid

    def column_at(self, hits: Hits) -> Ints:
        """Return the columns (n,) of the `InstanceTable` at hits; without `instance`, of moving shapes."""
        return self.column_of_row.take(hits.prim) if hits.instance is None else hits.instance

    def deformation_of(self, row: Ints) -> list[tuple[DeformingRows, Ints]]:
        """Return the meshes that deform among rows (n,) of the scene's tables, and the lanes of each."""
        pairs = [(mesh, np.flatnonzero((row >= mesh.first) & (row < mesh.end))) for mesh in self.deformations]
        return [(mesh, lanes) for mesh, lanes in pairs if lanes.size]


def deforming_rows(
    mesh: Mesh,
    still: Mesh,
    keys: Doubles,
    first: int,
    shutter: Shutter,
    drift: Doubles,
    ratio: float,
    vectors: Sequence[str] = (),
) -> DeformingRows:
    """Return the triangles of a mesh that deforms while a shutter is open.

    Parameters
    ----------
    mesh, still
        The mesh, and its form in the middle of the time.
    keys
        (n,) s, times between which its vertices go along lines.
    first
        Row of its first triangle in the scene's tables.
    drift
        (3,) way of the middle of its vertices over the whole time, which is taken off.
    ratio
        By which the lengths of `mesh` are multiplied.
    vectors
        Attributes along the surface that materials read.
    """
    times = _times_of(keys, shutter)
    middle = still.bounds.mean(0)
    meshes = [mesh.at(time).lengths_times(ratio) for time in times.tolist()]
    fractions = (times - shutter.middle) / (shutter.end - shutter.begin)
    corners = [
        (form.vertices - middle - drift * fraction).take(mesh.faces, 0).astype(f4)
        for form, fraction in zip(meshes, fractions, strict=True)
    ]
    normals = None
    if still.normals is not None:
        flat = [compute_face_normals(triangles) for triangles in corners]
        normals = [
            compute_corner_normals([form], face) or (face,) * 3
            for form, face in zip(meshes, flat, strict=True)
        ]
    along = {name: [corner_values(name, [form]) for form in meshes] for name in vectors}
    return DeformingRows(first, times, corners, normals, along)


def _times_of(keys: Doubles, shutter: Shutter) -> Doubles:
    """Return keys (n,) s while a shutter is open, and when it opens and closes."""
    inside = keys[(keys > shutter.begin) & (keys < shutter.end)]
    return np.concatenate([[shutter.begin], inside, [shutter.end]])


def motion_table(
    exposed: Exposed,
    instances: Sequence[Instance],
    kinds: Sequence[CurvedPrimitives],
    numbers: Ints,
    shared: Sequence[Mesh],
    center: Doubles,
    factor: float,
    placements: Placements | None,
    first_row: int,
    rows_in_all: int,
    vectors: Sequence[str] = (),
) -> MotionTable:
    """Return where instances are at a time, and give `placements` boxes that hold all of these places.

    Parameters
    ----------
    instances, kinds
        Instances of meshes, in the middle of the time, and the primitives of curved shapes that move.
    numbers
        Those of shapes among those of the scene: the last ones are of `kinds`, and then of `instances`.
    shared
        The distinct meshes of the instances.
    center
        (3,) of the scene.
    factor
        By which the lengths of the scene are multiplied.
    placements
        Of the instances, and then of the curved shapes, in the middle of the time.
    first_row, rows_in_all
        Row of the first triangle of `shared` in the scene's tables, and their number of rows. The rows of
        `kinds` are the last ones.
    vectors
        Attributes along surfaces that materials read.
    """
    assert exposed.shutter is not None
    columns = _MotionColumns(np.zeros(rows_in_all, np.intp), vectors)
    shutter, k = exposed.shutter, numbers.size - len(instances)
    row_of = _first_rows(shared, first_row)
    for instance, number in zip(instances, numbers[k:].tolist(), strict=True):
        if number in exposed.movers:
            unit = _unit_of(instance, exposed.scene.shapes[number])
            moving, row = exposed.movers[number], row_of[id(instance.mesh)]
            columns.add_mesh(moving, instance.mesh, row, shutter, center, factor, unit)
        else:
            columns.add_still()
    row = rows_in_all - sum(map(len, kinds))
    for kind, number in zip(kinds, numbers[k - len(kinds) : k].tolist(), strict=True):
        columns.add_curved(exposed.movers[number], kind, row, shutter, center, factor)
        row += len(kind)
    if placements is None or not columns.matrices:
        return MotionTable(shutter, None, np.full(2, -1), np.ones(2), columns.column_of_row, (), ())
    low, high = (np.stack(corners) for corners in zip(*columns.boxes, strict=True))
    reach = np.linalg.norm(np.maximum(np.abs(low), np.abs(high)), axis=1)
    order = [*numbers[k:].tolist(), *numbers[k - len(kinds) : k].tolist()]
    names = [exposed.scene.shapes[number].name for number in order if number in exposed.movers]
    motions = Motions.of(columns.matrices, shutter.begin, shutter.end, reach, exposed.keys, names)
    mover = np.array(columns.mover)
    moves = np.flatnonzero(mover >= 0)
    placements.low[:, moves], placements.high[:, moves] = _swept_boxes(motions, low, high)
    longest = np.linalg.norm(placements.to_local.T.reshape(-1, 3, 4)[:, :, :3], 2, (1, 2))
    return MotionTable(
        shutter,
        motions,
        np.append([-1, -1], mover),
        np.append([1, 1], 1 / longest),
        columns.column_of_row,
        tuple(columns.deforming.values()),
        tuple(columns.curved),
        all_move=moves.size == mover.size,
    )


class _MotionColumns:
    """The columns of a `MotionTable` while it is built, in the order of the instances."""

    def __init__(self, column_of_row: Ints, vectors: Sequence[str]) -> None:
        self.column_of_row, self.mover, self.vectors = column_of_row, list[int](), vectors
        self.matrices, self.boxes = list[Matrices](), list[tuple[Doubles, Doubles]]()
        self.deforming, self.curved = dict[int, DeformingRows](), list[CurvedRows]()

    def add_still(self) -> None:
        """Add an instance that does not move."""
        self.mover.append(-1)

    def add_mesh(
        self,
        moving: Mover,
        mesh: Mesh,
        row: int,
        shutter: Shutter,
        center: Doubles,
        factor: float,
        unit: float,
    ) -> None:
        """Add an instance of a mesh, whose first triangle has a row in the scene's tables."""
        drift, box = np.zeros(3), _half_box(mesh)
        if moving.mesh is not None:
            ratio = factor / unit
            drift = _drift(moving.mesh, shutter) * ratio
            if id(mesh) not in self.deforming:
                self.deforming[id(mesh)] = deforming_rows(
                    moving.mesh, mesh, moving.keys, row, shutter, drift, ratio, self.vectors
                )
            box = self.deforming[id(mesh)].box
        traced = _traced(moving.matrices, mesh.bounds.mean(0), drift, shutter, center, factor, unit)
        self._add(traced, box, row, len(mesh.faces))

    def add_curved(
        self,
        moving: Mover,
        kind: CurvedPrimitives,
        row: int,
        shutter: Shutter,
        center: Doubles,
        factor: float,
    ) -> None:
        """Add a curved shape, whose first primitive has a row in the scene's tables."""
        rows = CurvedRows(row, kind, np.array([shutter.begin, shutter.end]))
        bounds = [kind.bounds]
        if moving.centers is not None:
            rows.times = _times_of(moving.keys, shutter)
            places = [moving.centers(time) * factor - center for time in rows.times.tolist()]
            rows.centers = np.stack(places).transpose(0, 2, 1).astype(f4)
            bounds = [swept.bounds for swept in rows.swept()]
        self.curved.append(rows)
        low, high = (np.concatenate([pair[side] for pair in bounds], 1).astype(np.float64) for side in (0, 1))
        box = low.min(1), high.max(1)
        self._add(_about(moving.matrices, shutter, center, factor), box, row, len(kind))

    def _add(self, traced: Matrices, box: tuple[Doubles, Doubles], row: int, count: int) -> None:
        self.mover.append(len(self.matrices))
        self.matrices.append(traced)
        self.boxes.append(box)
        self.column_of_row[row : row + count] = len(self.mover) + 1


def _first_rows(shared: Sequence[Mesh], first_row: int) -> dict[int, int]:
    """Return the rows of the first triangles of meshes in the scene's tables, by their identities."""
    sizes = [len(mesh.faces) for mesh in shared]
    begins = first_row + np.cumsum([0, *sizes])[:-1]
    return {id(mesh): begin for mesh, begin in zip(shared, begins.tolist(), strict=True)}


def _unit_of(scaled: Instance, original: Any) -> float:
    """Return the factor by which the linear part of the transform of an instance was multiplied."""
    return float(np.linalg.norm(scaled.transform[:3, :3]) / np.linalg.norm(original.transform[:3, :3]))


def _drift(mesh: Mesh, shutter: Shutter) -> Doubles:
    """Return the way (3,) of the middle of a mesh that deforms, while a shutter is open."""
    begin, end = (mesh.unshaded().at(time).vertices.mean(0) for time in (shutter.begin, shutter.end))
    return np.asarray(end - begin)


def _traced(
    moving: Matrices,
    middle: Doubles,
    drift: Doubles,
    shutter: Shutter,
    center: Doubles,
    factor: float,
    unit: float,
) -> Matrices:
    """Return the matrices of an instance from the coordinates in which its mesh is traced."""

    def matrices(times: Doubles) -> Doubles:
        placed = moving(times).copy()
        placed[:, :3, :3] *= unit
        placed[:, :3, 3] = placed[:, :3, 3] * factor - center
        parts = (times - shutter.middle) / (shutter.end - shutter.begin)
        shift = middle + drift * parts[:, None]
        placed[:, :3, 3] += (placed[:, :3, :3] * shift[:, None]).sum(2)
        return placed

    return matrices


def _half_box(mesh: Mesh) -> tuple[Doubles, Doubles]:
    """Return the corners (3,) of the box of a mesh, in the coordinates in which it is traced."""
    half = np.ptp(mesh.bounds, axis=0) / 2
    return -half, half


def _swept_boxes(motions: Motions, low: Doubles, high: Doubles) -> tuple[Floats, Floats]:
    """Return the corners (3, m) of boxes around moving shapes at all times, from their own boxes (m, 3)."""
    rows, own_middle, own_half = np.arange(len(low) * motions.steps), (low + high).T / 2, (high - low).T / 2
    lows, highs = [], []
    for some in spans(rows.size, BOXES_AT_ONCE):
        number, step = np.divmod(rows[some], motions.steps)
        times = motions.times_in(step, BOX_TIMES)
        matrix = motions.at(np.repeat(number, BOX_TIMES), times.ravel())
        to_scene = inverse_linear(matrix).reshape(3, 3, number.size, BOX_TIMES)
        shift = own_middle.take(number, 1)[:, :, None] - matrix[3::4].reshape(3, number.size, BOX_TIMES)
        middle = (to_scene * shift).sum(1)
        reach = (np.abs(to_scene) * own_half.take(number, 1)[:, :, None]).sum(1)
        lows.append(-_highest(reach - middle))
        highs.append(_highest(reach + middle))
    lowest, highest = (np.concatenate(each, 1).reshape(3, len(low), -1) for each in (lows, highs))
    box = np.stack([lowest.min(2), highest.max(2)])
    room = BOX_ROOM * (np.abs(box).max((0, 1)) + np.ptp(box, axis=0).max(0))
    return (box[0] - room).astype(f4), (box[1] + room).astype(f4)


def _highest(values: Doubles) -> Doubles:
    """Return bounds (3, k) of what has some values (3, k, times) at evenly spaced times, and between them."""
    return np.asarray(values.max(2) + np.abs(np.diff(values, 2, 2)).max(2) / 4)


def with_places(bounds: Doubles, placements: Placements) -> Doubles:
    """Return corners (2, 3) of a box that holds another one, and all places of instances."""
    low, high = placements.low.min(1), placements.high.max(1)
    return np.stack([np.minimum(bounds[0], low), np.maximum(bounds[1], high)])


def place_accelerators(
    single: Accelerator,
    triangles: Sequence[Floats],
    placements: Placements,
    table: MotionTable | None,
    first_row: int,
    weights: bool,
    make_accelerator: Callable[[Geometry], Accelerator],
) -> InstanceAccelerator:
    """Return the accelerator of a scene with instances, some of which may move.

    Parameters
    ----------
    single
        Of all that is not instanced.
    triangles
        (m, 3, 3) of each distinct mesh.
    first_row
        Row of the first of these in the scene's tables.
    """
    if table is None or table.motions is None:
        built = [make_accelerator(Geometry(corners, (), weights)) for corners in triangles]
        return InstanceAccelerator(single, built, placements)
    deforming = {deformation.first: deformation for deformation in table.deformations}
    row, meshes = first_row, list[Any]()
    for corners in triangles:
        if row in deforming:
            meshes.append(deforming[row].accelerator(weights))
        else:
            meshes.append(make_accelerator(Geometry(corners, (), weights)))
        row += len(corners)
    nothing = np.zeros((0, 3, 3), f4)
    for curved in table.curved:
        if curved.centers is None:
            meshes.append(make_accelerator(Geometry(nothing, (curved.kind,), weights)))
        else:
            meshes.append(DeformingAccelerator(curved.times, curved.swept(), weights))
    return MovingInstances(single, meshes, placements, table.motions, table.mover[2:])


def curved_that_move(numbers: Ints, curved: int, instances: int, exposed: Exposed) -> int:
    """Return the number of curved shapes that move; `numbers` are of meshes, curved shapes and instances."""
    k = numbers.size - instances
    return sum(number in exposed.movers for number in numbers[k - curved : k].tolist())


def light_motions(
    exposed: Exposed, center: Doubles, factor: float, reach: float
) -> tuple[Motions | None, dict[int, int]]:
    """Return the motions of lights from their places in the middle of the time, and their rows by number.

    Parameters
    ----------
    center, factor
        As for `motion_table`.
    reach
        Radius of the scene, times `factor`.
    """
    if not exposed.lights or exposed.shutter is None:
        return None, {}
    shutter = exposed.shutter
    matrices = [_about(moving, shutter, center, factor) for moving in exposed.lights.values()]
    reaches = np.full(len(matrices), reach)
    names = [type(exposed.scene.lights[number]).__name__ for number in exposed.lights]
    motions = Motions.of(matrices, shutter.begin, shutter.end, reaches, exposed.keys, names)
    return motions, {number: row for row, number in enumerate(exposed.lights)}


def _about(moving: Matrices, shutter: Shutter, center: Doubles, factor: float) -> Matrices:
    """Return the matrices of a motion from where things are in the middle of the time."""
    back = np.linalg.inv(moving(np.array([shutter.middle]))[0])

    def matrices(times: Doubles) -> Doubles:
        moved: Doubles = moving(times) @ back
        moved[:, :3, 3] = moved[:, :3, 3] * factor + (moved[:, :3, :3] * center).sum(2) - center
        return moved

    return matrices
