"""Where the light ends on smooth meshes: not at the edges of their triangles.

Triangles with normals of vertices stand for a round surface above them. Where light grazes it, the flat
triangle shadows itself, and its neighbors shadow it, so the edge of the shadow has steps. Rays here leave
from the round surface, and directions below the plane of a triangle count if they are above its shading
normal. They may meet the triangle itself, so that no light gets through it.

Source: J. Hanika 2021, "Hacking the Shadow Terminator", Ray Tracing Gems II, chapter 4.
"""

from __future__ import annotations

from typing import Self

import numpy as np

from ..arrays.soa import soa
from ..arrays.state import Hits, SurfaceInteraction
from ..arrays.vec import Bools, Floats, Ints, Lanes, dot, f4, normalize, take
from ..compile.program import Facts, Feature
from ..compile.scene import CompiledScene
from ..stages.interaction import Surfaces, at_corners
from ..stages.shade import Shading
from .motion import times_of

# of normals at vertices with that of the triangle: those of a box lean by 55°, and a round surface for them
# would bulge through shapes beside it
LEAST_COSINE = f4(0.7071)


class RoundSurfaces(Surfaces):
    """Surfaces that know how far the round surface is above them."""

    __slots__ = ()

    def interaction(self) -> SurfaceInteraction:
        """Return their geometry, with `lift`."""
        surface = super().interaction()
        feature = self.scene.program.find(ShadowTerminator)
        assert feature is not None
        surface.lift = self._lift(feature, surface)
        return surface

    def _lift(self, feature: ShadowTerminator, surface: SurfaceInteraction) -> Floats:
        """Return the way (3, n) to the round surface on the side of wo, 0 where there is none."""
        scene, hits = self.scene, self.hits
        lift = np.zeros_like(surface.point)
        lanes = np.flatnonzero((hits.prim >= 0) & (hits.prim < scene.triangles))
        lanes = lanes[~feature.transmissive.take(surface.material.take(lanes))]
        prim = hits.prim.take(lanes)
        lanes = lanes[feature.curved.take(prim)]
        if not lanes.size:
            return lift
        met = hits.take(lanes)
        assert met.b1 is not None
        assert met.b2 is not None
        weights = (f4(1) - met.b1 - met.b2, met.b1, met.b2)
        side = np.where(surface.back_facing.take(lanes), f4(-1), f4(1))
        k, normals = self._heights(feature, lanes, met)
        total = np.zeros((3, lanes.size), f4)
        for corner, normal in enumerate(normals):
            one, other = (weights[vertex] for vertex in range(3) if vertex != corner)
            below = side * (one * k[2 * corner] + other * k[2 * corner + 1])  # of the plane at the vertex
            total += normal * (weights[corner] * side * np.maximum(-below, f4(0)))
        lift[:, lanes] = total
        return self.vectors(lift)

    def _heights(self, feature: ShadowTerminator, lanes: Ints, met: Hits) -> tuple[Floats, list[Floats]]:
        """Return the heights (6, k) and the normals at corners, 3 × (3, k), of hits on lanes (k,).

        Those of meshes that deform are of the times of the rays.
        """
        scene = self.scene
        assert scene.corner_normals is not None
        heights, normals = (
            feature.heights.take(met.prim, 1),
            at_corners(scene.corner_normals, met, scene.triangles),
        )
        for deforming, at in () if scene.motion is None else scene.motion.deformation_of(met.prim):
            if deforming.normals is not None:
                row, time = met.prim.take(at), times_of(scene, self.rays).take(lanes.take(at))
                then = [normalize(normal) for normal in deforming.vertex_normals(row, time)]
                corners = deforming.corners_at(row, time).astype(f4)
                heights[:, at] = heights_of(corners, tuple(then), deforming.face_normals(row, time))
                for values, normal in zip(normals, then, strict=True):
                    values[:, at] = normal
        return heights, normals


class RoundShading(Shading):
    """Surfaces that rays leave from above their triangles."""

    __slots__ = ()

    def prepare(self, scene: CompiledScene) -> None:
        """Lift where rays start."""
        super().prepare(scene)
        if self.surface.lift is not None:
            self.start = self.start + self.surface.lift

    def origins(self, cos_g: Floats) -> Floats:
        """Return the origins of rays: above the round surface, if any, as no light crosses it."""
        origins = super().origins(cos_g)
        if self.surface.lift is None or origins is self.start:
            return origins
        return np.where((cos_g < 0) & ~self._round(), origins, self.start)

    def cosines(self, local: Floats, world: Floats) -> tuple[Floats, Floats]:
        """Return the cosines; below the plane of a triangle with a round surface those above that count."""
        cos, cos_g = super().cosines(local, world)
        if self.surface.lift is None:
            return cos, cos_g
        turned = np.flatnonzero((local[2] > 0) & (cos_g <= 0) & self._round())
        if turned.size:
            cos, cos_g = cos.copy(), cos_g.copy()
            cos[turned], cos_g[turned] = local[2].take(turned), -cos_g.take(turned)
        return cos, cos_g

    def unmet(self, prim: Ints, direction: Floats, lanes: Lanes) -> Ints:
        """Return the primitives that rays ignore: none where they start above their triangles and dive."""
        prim = super().unmet(prim, direction, lanes)
        if self.surface.lift is None:
            return prim
        dives = take(self._round(), lanes) & (dot(take(self.surface.ng, lanes), direction) < 0)
        dives &= dot(take(self.surface.ns, lanes), direction) > 0
        return np.where(dives, np.intp(-1), prim) if dives.any() else prim

    def _round(self) -> Bools:
        assert self.surface.lift is not None
        return np.asarray(self.surface.lift.any(0))


@soa
class ShadowTerminator(Feature):
    """Has rays leave smooth meshes from the round surface that their normals stand for."""

    from_lights = False  # these hit the triangles themselves, from the side that the light is on
    surfaces = RoundSurfaces
    shading = RoundShading

    # (6, m) for each corner of a triangle, how high the other two are above the plane at its normal
    heights: Floats
    curved: Bools  # (m,) triangles with a vertex that the round surface leaves
    transmissive: Bools  # (materials,) those that light crosses: it bends at the triangles themselves

    @classmethod
    def of(cls, facts: Facts) -> Self | None:
        """Return the feature of a scene with opaque triangles whose normals differ from theirs."""
        corners = facts.compiled.corner_normals
        if corners is None:
            return None
        heights = heights_of(facts.corners, corners, facts.compiled.normals)
        transmissive = np.array([material.bsdf.transmissive for material in facts.materials], np.bool_)
        curved, motion = np.asarray(heights.any(0)), facts.compiled.motion
        for deforming in () if motion is None else motion.deformations:
            curved[deforming.first : deforming.end] |= deforming.normals is not None
        return cls(heights, curved, transmissive) if curved.any() and not transmissive.all() else None


def heights_of(corners: Floats, normals: tuple[Floats, ...], ng: Floats) -> Floats:
    """Return for each corner of triangles (m, 3, 3) how high the others are above its plane, (6, m).

    They are 0 where a normal leans so far that no round surface is meant.
    """
    heights = np.zeros((6, len(corners)), f4)
    upright = np.logical_and.reduce([dot(normal, ng) > LEAST_COSINE for normal in normals])
    bent = np.flatnonzero(upright & np.logical_or.reduce([(normal != ng).any(0) for normal in normals]))
    points = corners[bent].transpose(1, 2, 0)
    for corner, normal in enumerate(normals):
        others = [vertex for vertex in range(3) if vertex != corner]
        for row, other in enumerate(others):
            away = points[other] - points[corner]
            heights[2 * corner + row, bent] = (away * normal.take(bent, 1)).sum(0)
    return heights
