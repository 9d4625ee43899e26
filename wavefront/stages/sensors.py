"""Sensors: paths that start at points which gather light, as a surface does that was just met.

A sensor is the first vertex of its paths, with a BSDF for which the radiance that leaves it is what it
measures. So light samples, MIS, guiding and branches hold for it as for any surface.

Source: M. Pharr, W. Jakob and G. Humphreys, Physically Based Rendering, 4th ed. 2023, section 4.1.1
(irradiance and fluence as integrals of radiance).
"""

from __future__ import annotations

import numpy as np

from ..arrays.state import Hits, Paths, SurfaceInteraction
from ..arrays.vec import INV_FOUR_PI, TINY, Floats, Lanes, broadcast, column, f4, highest
from ..bsdfs import Bsdf, BsdfSample
from ..camera import Camera
from ..compile.scene import CompiledScene
from ..sampling.warp import cosine_hemisphere, cosine_hemisphere_pdf, uniform_sphere
from .interaction import POINT_ERROR, origin_above
from .shade import Shading, receiver_of

UP = column((0, 0, 1))


class CosineReceiver(Bsdf):
    """Gathers ∫ L cosθ dω over the hemisphere of the normal: irradiance."""

    view_independent = True
    total = f4(np.pi)  # the integral of the weight of a direction

    def f(self, wo: Floats, wi: Floats) -> Floats:
        """Return 1 above the plane of the sensor, (3, n)."""
        return np.broadcast_to((wi[2] > 0).astype(f4), wi.shape)

    def sample_f(self, wo: Floats, u: Floats) -> BsdfSample:
        """Draw cosine-weighted directions."""
        wi = cosine_hemisphere(u)
        weight = np.broadcast_to(self.total * (wi[2] > 0), wi.shape)
        return BsdfSample(wi, weight, cosine_hemisphere_pdf(wi), broadcast(np.False_, wi.shape[1]))


class SphereReceiver(Bsdf):
    """Gathers ∫ L dω over all directions: fluence. `f` undoes the cosine that surfaces have."""

    view_independent = True
    transmissive = True
    total = f4(4 * np.pi)

    def f(self, wo: Floats, wi: Floats) -> Floats:
        """Return 1/|cosθ|, (3, n)."""
        return np.broadcast_to(f4(1) / np.maximum(np.abs(wi[2]), TINY), wi.shape)

    def pdf(self, wo: Floats, wi: Floats) -> Floats:
        """Return 1/(4π), (n,)."""
        return broadcast(INV_FOUR_PI, wi.shape[1])

    def sample_f(self, wo: Floats, u: Floats) -> BsdfSample:
        """Draw directions that are evenly spread over the sphere."""
        wi = uniform_sphere(u)
        n = wi.shape[1]
        weight = np.broadcast_to(self.total, wi.shape)
        return BsdfSample(wi, weight, broadcast(INV_FOUR_PI, n), broadcast(np.False_, n))


RECEIVERS: dict[str, CosineReceiver | SphereReceiver] = {
    "irradiance": CosineReceiver(),
    "fluence": SphereReceiver(),
}


def receiver_of_camera(camera: Camera) -> CosineReceiver | SphereReceiver | None:
    """Return what the pixels of a camera gather light with; None where they show what rays meet."""
    return RECEIVERS[camera.sensor] if camera.scatterings and camera.sensor is not None else None


def at_sensors(paths: Paths) -> Hits:
    """Return the first "hits" of paths that start at sensors."""
    n = len(paths)
    return Hits(broadcast(f4(0), n), paths.exclude_prim, None, None)


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
    )
    groups: list[tuple[Lanes, Bsdf]] = [(slice(0, n), paths.receiver)]
    receiver = receiver_of(surface, groups) if scene.lights.takes_receiver else None
    up = np.broadcast_to(UP, normal.shape)
    return Shading(surface, surface.frame(), up, origin_above(surface), groups, receiver=receiver)
