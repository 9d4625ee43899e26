"""Sensors: paths that start at points which gather light, as a surface does that was just met.

A sensor is the first vertex of its paths, with a BSDF for which the radiance that leaves it is the measured
quantity. So light samples, MIS, guiding and branches hold for it as for any surface.

Source: M. Pharr, W. Jakob and G. Humphreys, Physically Based Rendering, 4th ed. 2023, section 4.1.1
(irradiance and fluence as integrals of radiance).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

import numpy as np

from ..arrays.state import Hits, Paths, SurfaceInteraction
from ..arrays.vec import Floats, Ints, Lanes, broadcast, column, f4, highest, take
from ..bsdfs import Bsdf, BsdfSample
from ..camera import Camera
from ..compile.scene import CompiledScene
from ..sampling.warp import cosine_hemisphere, cosine_hemisphere_pdf, uniform_sphere, uniform_sphere_pdf
from .interaction import POINT_ERROR, origin_above
from .shade import Shading, shading_kind

Warp: TypeAlias = Callable[[Floats], Floats]
UP = column((0, 0, 1))


class SensorBsdf(Bsdf):
    """Gathers light of the directions that a warp draws, by weights that are all the same.

    Parameters
    ----------
    warp, density
        From `sampling.warp`: its density is that of the light that counts.
    total
        The integral of the weights of all directions.
    sphere
        Whether all directions count alike: then there is no cosine, as within media.
    """

    view_independent = True

    @property
    def lambertian(self) -> bool:
        """Whether the light counts by its cosine, as that which a matte surface of albedo π reflects."""
        return not self.transmissive

    def __init__(self, warp: Warp, density: Warp, total: float, sphere: bool) -> None:
        self.warp, self.density, self.total, self.transmissive = warp, density, f4(total), sphere

    def f(self, wo: Floats, wi: Floats) -> Floats:
        """Return 1 where light counts, (3, n)."""
        return np.broadcast_to((self.density(wi) > 0).astype(f4), wi.shape)

    def pdf(self, wo: Floats, wi: Floats) -> Floats:
        """Return the density of directions, (n,)."""
        return self.density(wi)

    def sample_f(self, wo: Floats, u: Floats) -> BsdfSample:
        """Draw directions by the warp."""
        wi = self.warp(u)
        pdf = self.density(wi)
        weight = np.broadcast_to(self.total * (pdf > 0), wi.shape)
        return BsdfSample(wi, weight, pdf, broadcast(np.False_, wi.shape[1]))


SENSORS = {
    "irradiance": SensorBsdf(cosine_hemisphere, cosine_hemisphere_pdf, np.pi, sphere=False),  # ∫ L cosθ dω
    "fluence": SensorBsdf(uniform_sphere, uniform_sphere_pdf, 4 * np.pi, sphere=True),  # ∫ L dω
}


def sensor_of_camera(camera: Camera) -> SensorBsdf | None:
    """Return the sensor of the pixels of a camera; None where they show what rays meet."""
    return SENSORS[camera.sensor] if camera.scatterings and camera.sensor is not None else None


def at_sensors(paths: Paths) -> Hits:
    """Return the first "hits" of paths that start at sensors."""
    n = len(paths)
    return Hits(broadcast(f4(0), n), paths.exclude_prim, None, None)


class SensorShading(Shading):
    """Sensors, ready to be shaded: no material of the scene is theirs."""

    __slots__ = ()

    def at(self, lanes: Ints) -> SensorShading:
        """Return the sensors of some lanes (k,), as `Shading.at`."""
        surface = self.surface.take(lanes)
        surface.ns = surface.ng
        groups: list[tuple[Lanes, Bsdf]] = [(slice(0, lanes.size), self.groups[0][1])]
        volume = None if self.volume is None else np.arange(lanes.size)
        up, start = np.broadcast_to(UP, (3, lanes.size)), take(self.start, lanes)
        return type(self)(
            surface, self.frame.take(lanes), up, start, groups, self.guidance_at(lanes), volume=volume
        )

    def cosines(self, local: Floats, world: Floats) -> tuple[Floats, Floats]:
        """Return the cosines of directions, 1 where all directions count alike."""
        if self.volume is None:
            return super().cosines(local, world)
        return np.ones_like(local[2]), np.ones_like(local[2])

    def albedo(self) -> Floats:
        """Return the factor (3, n) of cosine over π."""
        sensor = self.groups[0][1]
        assert isinstance(sensor, SensorBsdf)
        return np.broadcast_to(sensor.total, self.wo.shape)


def sensor_shading(scene: CompiledScene, paths: Paths) -> Shading:
    """Return the sensors at which paths start, ready to be shaded; their normals are −direction."""
    n, normal = len(paths), -paths.direction
    surface = SurfaceInteraction(
        point=paths.origin,
        error=POINT_ERROR * highest(np.abs(paths.origin)),
        ng=normal,
        ns=normal,
        wo=normal,
        prim=paths.exclude_prim,
        material=np.zeros(n, np.intp),
        back_facing=broadcast(np.False_, n),
        time=paths.time,
    )
    groups: list[tuple[Lanes, Bsdf]] = [(slice(0, n), paths.sensor)]
    up, kind = np.broadcast_to(UP, normal.shape), shading_kind(SensorShading, scene.program.shading)
    shade = kind(surface, surface.frame(), up, origin_above(surface), groups)
    shade.prepare(scene)
    shade.volume = np.arange(n) if paths.sensor.transmissive else None
    shade.crossing = None  # sensors are no boundary of media
    return shade
