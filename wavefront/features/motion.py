"""Motion while the shutter is open: every path has a time, and meets what moves where it is then."""

from __future__ import annotations

from collections.abc import Callable
from typing import Self

import numpy as np

from ..arrays.soa import soa
from ..arrays.state import Hits, Rays, SurfaceInteraction, Words
from ..arrays.vec import ALL, Doubles, Floats, Ints, Lanes, f4, normalize, put
from ..camera import Camera
from ..camera.poses import upright
from ..compile.program import Facts, Feature
from ..compile.scene import CompiledScene
from ..motion.shutter import Shutter
from ..motion.steps import Motions, applied, inverse_linear, moved_back, transposed_times, transposed_turned
from ..sampling.tiles import Tiles
from ..stages.interaction import Surfaces
from ..stages.intersect import ShadowRays
from ..stages.shade import LightRays, Shading
from .instances import InstancedSurfaces


class DeformingSurfaces(Surfaces):
    """Surfaces of meshes some of which deform."""

    __slots__ = ()

    def normals(self, point: Floats, error: Floats) -> tuple[Floats, Floats]:
        """Return unit normals (3, n), those of triangles that deform at the times of the rays."""
        ng, error = super().normals(point, error)
        table, prim = self.scene.motion, self.hits.prim
        assert table is not None
        for deforming, lanes in table.deformation_of(prim):
            ng[:, lanes] = deforming.face_normals(
                prim.take(lanes), times_of(self.scene, self.rays).take(lanes)
            )
        return ng, error

    def corner_values(self, name: str, corners: list[Floats]) -> list[Floats]:
        """Return an attribute at corners; vectors along what deforms are those at the times of the rays."""
        table, prim = self.scene.motion, self.hits.prim
        assert table is not None
        for deforming, lanes in table.deformation_of(prim):
            if name in deforming.vectors:
                time = times_of(self.scene, self.rays).take(lanes)
                then = deforming.vectors_at(name, prim.take(lanes), time)
                for values, of_corner in zip(corners, then, strict=True):
                    values[:, lanes] = of_corner
        return super().corner_values(name, corners)

    def corner_normals(self, corners: list[Floats]) -> list[Floats]:
        """Return normals of vertices, those of meshes that deform at the times of the rays."""
        table, prim = self.scene.motion, self.hits.prim
        assert table is not None
        for deforming, lanes in table.deformation_of(prim):
            if deforming.normals is not None:
                time = times_of(self.scene, self.rays).take(lanes)
                for values, then in zip(
                    corners, deforming.vertex_normals(prim.take(lanes), time), strict=True
                ):
                    values[:, lanes] = then
        return super().corner_normals(corners)


class Deformations(Feature):
    """Gives meshes that deform the normals that they have at a time."""

    surfaces = DeformingSurfaces

    @classmethod
    def of(cls, facts: Facts) -> Self | None:
        """Return the feature of a scene where a mesh deforms while the shutter is open."""
        motion = facts.compiled.motion
        return cls() if motion is not None and motion.deformations else None


class TimedSurfaces(Surfaces):
    """Surfaces that know when they are hit."""

    __slots__ = ()

    def interaction(self) -> SurfaceInteraction:
        """Return their geometry, with the times of the rays."""
        surface = super().interaction()
        surface.time = self.rays.time
        return surface


class MovingSurfaces(InstancedSurfaces):
    """Surfaces some of which are at other places at other times."""

    __slots__ = ("_matrix", "_moves")

    def __init__(self, scene: CompiledScene, rays: Rays, hits: Hits) -> None:
        super().__init__(scene, rays, hits)
        table = scene.motion
        assert table is not None
        assert table.motions is not None
        self.column = table.column_at(hits)
        mover = table.mover.take(self.column)
        self._moves = np.flatnonzero(mover >= 0)
        time = times_of(scene, rays).take(self._moves)
        self._matrix = table.motions.at(mover.take(self._moves), time)

    def placed_lanes(self) -> Lanes:
        """Return the lanes (k,) that may have transforms: where no instance stands still, those that move."""
        assert self.scene.motion is not None
        return self._moves if self.scene.motion.all_move else ALL

    def normal_matrices(self, lanes: Lanes) -> Floats:
        """Return the matrices (9, k) of normals to the scene, as it is then."""
        matrices = super().normal_matrices(lanes)
        put(matrices, self._moves, self._matrix.take(TRANSPOSED, 0) * self._scale())
        return matrices

    def normals_there(self, normals: Floats, lanes: Lanes) -> Floats:
        """Return normals (3, k) of some lanes in the scene, as it is then; not of unit length."""
        if lanes is self._moves:
            return (transposed_turned(self._matrix, normals) * self._scale()).astype(f4)
        return super().normals_there(normals, lanes)

    def _scale(self) -> Floats:
        """Return by what the normals (k,) of what moves are multiplied, so that they are not too long."""
        assert self.scene.motion is not None
        assert self.column is not None
        return self.scene.motion.scale.take(self.column.take(self._moves))

    def vector_matrices(self) -> Floats:
        """Return the matrices (9, n) of vectors to the scene, as it is then."""
        matrices = super().vector_matrices()
        put(matrices, self._moves, inverse_linear(self._matrix))
        return matrices

    @classmethod
    def moment(cls, rays: Rays) -> tuple[Doubles, ...]:
        """Return the times of rays."""
        return () if rays.time is None else (rays.time,)

    def normals(self, point: Floats, error: Floats) -> tuple[Floats, Floats]:
        """Return unit normals (3, n); curved shapes are where they are in the scene's tables."""
        lanes = self._curved()
        if not lanes.size:
            return super().normals(point, error)
        at, matrix = self._moves.take(lanes), self._matrix.take(lanes, 1)
        ways = self._ways(at)
        point[:, at] = applied(matrix, point.take(at, 1)) - ways
        ng, error = super().normals(point, error)
        point[:, at] = moved_back(matrix, point.take(at, 1) + ways)
        return ng, error

    def curved_normals(self, lanes: Ints, point: Floats, ng: Floats) -> Floats:
        """Return shading normals (3, k); curved shapes have them where they are in the scene's tables."""
        moves = self._curved()
        if not moves.size:
            return super().curved_normals(lanes, point, ng)
        at, matrix, own = self._moves.take(moves), self._matrix.take(moves, 1), ng.copy()
        own[:, at] = normalize(transposed_times(inverse_linear(matrix), ng.take(at, 1)))
        found, place = super().curved_normals(lanes, point, own), np.searchsorted(lanes, at)
        found[:, place] = normalize(transposed_turned(matrix, found.take(place, 1)))
        return found

    def own_points(self, point: Floats) -> Floats:
        """Return points (3, n), those of curved shapes where these are in the scene's tables."""
        lanes = self._curved()
        if not lanes.size:
            return point
        at, own = self._moves.take(lanes), point.copy()
        own[:, at] = applied(self._matrix.take(lanes, 1), point.take(at, 1)) - self._ways(at)
        return own

    def _ways(self, lanes: Ints) -> Doubles:
        """Return how far curved primitives (k,) are from where the scene's tables have them, (3, k)."""
        assert self.scene.motion is not None
        time = times_of(self.scene, self.rays).take(lanes)
        return self.scene.motion.ways(self.hits.prim.take(lanes), time)

    def _curved(self) -> Ints:
        """Return which of the lanes that move are on curved shapes, (k,)."""
        return np.flatnonzero(self.hits.prim.take(self._moves) >= self.scene.triangles)


TRANSPOSED = np.array([0, 4, 8, 1, 5, 9, 2, 6, 10])  # rows of matrices (12, n) to those of transposed (9, n)


def times_of(scene: CompiledScene, rays: Rays) -> Doubles:
    """Return the times (n,) of rays; without any, the middle of that for which the shutter is open."""
    assert scene.motion is not None
    if rays.time is not None:
        return rays.time
    return np.full(len(rays), scene.motion.shutter.middle)


class MovingShading(Shading):
    """Surfaces whose light comes at the times of paths."""

    __slots__ = ()

    def enter(self, rays: ShadowRays, of: LightRays) -> None:
        """Let shadow rays have the times of their paths."""
        super().enter(rays, of)
        if of.paths.time is not None:
            rays.time = of.paths.time.take(of.lanes)


class Motion(Feature):
    """Lets rays meet shapes that move where they are at their times."""

    surfaces = MovingSurfaces

    @classmethod
    def of(cls, facts: Facts) -> Self | None:
        """Return the feature of a scene where a shape moves while the shutter is open."""
        motion = facts.compiled.motion
        return cls() if motion is not None and motion.motions is not None else None


class Moments(Feature):
    """Tells surfaces and lights the times of rays."""

    surfaces = TimedSurfaces
    shading = MovingShading

    @classmethod
    def of(cls, facts: Facts) -> Self | None:
        """Return the feature of a scene where something moves while the shutter is open."""
        return None if facts.compiled.motion is None else cls()


@soa
class Exposure(Feature):
    """Gives each path a time at which the shutter is open, and the place of the camera then."""

    compared = False  # it follows from settings and the camera
    shutter: Shutter
    motions: Motions | None = None  # one, from the scene to where it is for a camera that stands still
    tiles: Tiles | None = None  # whose paths have one time, as they are shared; None where none are

    def expose(
        self, scene: CompiledScene, camera: Camera, rays: Rays, pixel: Words, draw: Callable[[Words], Floats]
    ) -> None:
        """Give rays their times, and begin them where a camera that moves is then."""
        address = pixel if self.tiles is None else self.tiles.place(pixel)[0].astype(pixel.dtype)
        rays.time = self.times(camera, pixel, draw(address))
        rays.origin, rays.direction = self.seen_from(rays.time, rays.origin, rays.direction)

    def times(self, camera: Camera, pixel: Words, u: Floats) -> Doubles:
        """Return the times (n,) of paths of pixels (n,) of the whole picture, s, for u (n,) in [0, 1)."""
        times = self.shutter.times(u)
        return times + camera.row_delay(pixel) if camera.rolling_shutter else times

    def to_camera(self, time: Doubles, point: Floats) -> Floats:
        """Return where points (3, n) are at times (n,) for a camera that stands still."""
        if self.motions is None:
            return point
        return applied(self.motions.at(np.zeros(time.size, np.intp), time), point).astype(f4)

    def seen_from(self, time: Doubles, origin: Floats, direction: Floats) -> tuple[Floats, Floats]:
        """Return the origins and directions (3, n) of rays of a camera that stands still, as it moves."""
        if self.motions is None:
            return origin, direction
        matrix = self.motions.at(np.zeros(time.size, np.intp), time)
        start = transposed_turned(matrix, origin - matrix[3::4]).astype(f4)
        return start, normalize(transposed_turned(matrix, direction)).astype(f4)


def motions_of_camera(camera: Camera, shutter: Shutter, center: Doubles, factor: float) -> Motions:
    """Return how a camera moves from where its origin and rotation have it.

    Parameters
    ----------
    center, factor
        (3,) of the scene, and by what its lengths are multiplied.
    """
    assert camera.motion is not None
    motion, back = camera.motion, np.linalg.inv(camera.to_matrix())

    def matrices(times: Doubles) -> Doubles:
        moved = upright(motion.at_times(times)) @ back
        moved[:, :3, 3] = moved[:, :3, 3] * factor + (moved[:, :3, :3] * center).sum(2) - center
        return moved

    return Motions.of([matrices], shutter.begin, shutter.end, np.ones(1), motion.keys, ["Camera"])
