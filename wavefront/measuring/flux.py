"""measure_flux(): the power that arrives at shapes, or leaves them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Unpack

import numpy as np
from numpy.typing import NDArray

from ..arrays.frame import Frame
from ..arrays.state import Words
from ..arrays.vec import Doubles, Floats, column, f4
from ..camera import Sensors
from ..core.errors import SceneError, in_brief, one_of
from ..io.to_scene import as_scene
from ..sampling.warp import cosine_hemisphere, uniform_sphere, uniform_triangle
from ..scene import Scene
from ..settings import AUTO, RenderSettings, takes_settings
from ..shapes import Instance, Mesh, Shape, Sphere
from .measure import LIFT, measured, size_of
from .measurement import Measurement

KINDS = ("arriving", "leaving")
SIDES = {"front": 1.0, "back": -1.0}


class SurfaceSensors(Sensors):
    """Surfaces that measure light, a pixel each: every sample is at a point of its own.

    Parameters
    ----------
    triangles
        (t, 3, 3) corners, those of one surface after the other.
    counts
        (n,) triangles of each surface; 0 for a sphere.
    spheres
        (n, 4) center and radius of spheres; others have 0.
    kind
        "arriving" or "leaving".
    side
        1 for the front, -1 for the back.
    lift
        How far above the surface points are, scene units.
    """

    def __init__(
        self,
        triangles: Doubles,
        counts: NDArray[np.intp],
        spheres: Doubles,
        kind: str,
        side: float,
        lift: float,
    ) -> None:
        cross = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
        double = np.linalg.norm(cross, axis=1)
        owner = np.repeat(np.arange(counts.size), counts)
        total = np.bincount(owner, double, counts.size)
        self.areas = np.where(counts > 0, total / 2, 4 * np.pi * spheres[:, 3] ** 2)
        total = np.where(total > 0, total, 1)
        middles = [
            np.bincount(owner, triangles.mean(1)[:, k] * double, counts.size) / total for k in range(3)
        ]
        at = np.where(counts[:, None] > 0, np.stack(middles, 1), spheres[:, :3])
        super().__init__(at, (0, 0, side), "irradiance" if kind == "arriving" else "radiance", lift)
        self.triangles, self.spheres, self.side, self._kind = triangles, spheres, side, kind
        self.normals = (
            np.where(double[:, None] > 0, cross, (0, 0, 1)) / np.where(double > 0, double, 1)[:, None]
        )
        run, last = np.cumsum(double / total[owner]), np.cumsum(counts)
        before = np.concatenate([[0], run])[last - counts]
        self.ends = run - before[owner] + owner  # a surface's number, and the part of its area up to here
        self.ends[last[counts > 0] - 1] = np.flatnonzero(counts) + 1.0

    @property
    def uses_lens(self) -> bool:
        """Whether rays need a direction beside a point."""
        return self.sensor == "radiance"

    def layers(self) -> dict[str, NDArray[Any]]:
        """Return the middles, and as "scale" what makes power of the values of pixels, m²·sr or m²."""
        found = super().layers()
        scale = np.full(found["position"].shape[0] * found["position"].shape[1], np.nan)
        scale[: self.areas.size] = self.areas * (np.pi if self.sensor == "radiance" else 1)
        return {**found, "scale": scale.reshape(found["position"].shape[:2])}

    def metadata(self) -> dict[str, Any]:
        """Return what the metadata of the picture say of the sensors."""
        return {**super().metadata(), "sensor": f"{self._kind} flux"}

    def scaled(self, factor: float) -> SurfaceSensors:
        """Return the same sensors in a scene whose lengths were multiplied by `factor`; areas stay."""
        sensors = super().scaled(factor)
        sensors.triangles, sensors.spheres = self.triangles * factor, self.spheres * factor
        return sensors

    def pixel_rays(
        self, pixel: Words, at: Floats, center: NDArray[np.float64], lens: Floats | None = None
    ) -> tuple[Floats, Floats]:
        """Return points evenly over the surfaces, and directions to them."""
        index, u = np.minimum(pixel, len(self.points) - 1), np.broadcast_to(at, (2, len(pixel)))
        balls = self.spheres.take(index, 0).T
        normal = uniform_sphere(u)
        point = balls[:3] + balls[3] * normal
        flat = np.flatnonzero(balls[3] == 0)
        if flat.size:
            point[:, flat], normal[:, flat] = self._on_triangles(index.take(flat), u.take(flat, 1))
        normal *= f4(self.side)
        point = point - column(center).astype(np.float64) + self.lift * normal
        if lens is None:
            return point.astype(f4), -normal
        return point.astype(f4), -Frame.from_normal(normal).to_world(cosine_hemisphere(lens))

    def _on_triangles(self, index: Words, u: Floats) -> tuple[Doubles, Doubles]:
        """Return points and normals (3, n) on surfaces of triangles, for u (2, n)."""
        key = index + u[0].astype(np.float64)
        number = np.searchsorted(self.ends, key, side="right")
        start = np.maximum(np.concatenate([[0.0], self.ends])[number], index)
        within = (key - start) / (self.ends[number] - start)
        b = uniform_triangle(np.stack([np.clip(within, 0, 1 - 2.0**-24), u[1]]).astype(f4))
        a, e1, e2 = self.triangles.take(number, 0).transpose(1, 2, 0)
        return a + (e1 - a) * b[0] + (e2 - a) * b[1], self.normals.take(number, 0).T


@takes_settings
def measure_flux(
    scene: Any,
    shapes: Any,
    *,
    kind: str = "arriving",
    side: str = "front",
    faces: bool = False,
    spp: int | None = None,
    **settings: Unpack[RenderSettings],
) -> Measurement:
    """Measure the power that arrives at shapes, or leaves them, with its standard error.

    Parameters
    ----------
    scene
        As for `measure`.
    shapes
        A mesh, an instance or a `Sphere`, or several; or the names of such in the scene. What arrives can
        also be measured at a surface that is no part of the scene, and does not hide anything.
    kind
        "arriving", or "leaving": what the surface emits, reflects and transmits to the side.
    side
        "front", to which normals point, or "back".
    faces
        True measures at each face of one mesh.
    {settings}

    Returns
    -------
    Measurement
        Its `value` is in W; its points are the middles of the surfaces.

    Raises
    ------
    SceneError, Interrupted, RenderError
        As for `measure`.

    Examples
    --------
    >>> lamp = wf.Sphere((0, 0, 2), 0.5, emission=1)
    >>> floor = wf.Rectangle((-1, -1, 0), (2, 0, 0), (0, 2, 0))
    >>> left = wf.measure_flux([lamp, floor], lamp, kind="leaving", spp=16, max_bounces=0)
    >>> np.allclose(left.value, np.pi * 4 * np.pi * 0.5**2)
    True
    >>> bool(wf.measure_flux([lamp, floor], floor, spp=16).value[0, 0] < left.value[0, 0])
    True
    """
    subject = as_scene(
        scene, settings.get("material"), settings.get("progress"), settings.get("smooth", AUTO)
    )
    toward = SIDES[one_of("side", side, tuple(SIDES))]
    parts = _chosen(subject, shapes)
    triangles = [_triangles(each) for each in parts]
    counts = np.array([len(each) for each in triangles])
    if faces:
        if len(parts) != 1 or not counts[0]:
            raise SceneError("faces is True; that is for one shape, which is a mesh")
        counts = np.ones(counts[0], np.intp)
    spheres = np.zeros((counts.size, 4))
    for row, each in enumerate(parts):
        if isinstance(each, Sphere):
            spheres[row] = (*each.center, each.radius)
    corners = np.concatenate(triangles)
    lift = LIFT * size_of(subject, corners.reshape(-1, 3))
    one_of("kind", kind, KINDS)
    return measured(subject, SurfaceSensors(corners, counts, spheres, kind, toward, lift), spp, settings)


def _chosen(scene: Scene, shapes: Any) -> list[Shape]:
    """Return shapes that are given by themselves or by names."""
    several: Sequence[Any] = [shapes] if isinstance(shapes, str | Shape) else list(shapes)
    names = {shape.name for shape in scene.shapes}
    found: list[Shape] = []
    for each in several:
        if isinstance(each, str):
            one_of("shapes: name", each, tuple(names))
        found += [shape for shape in scene.shapes if shape.name == each] if isinstance(each, str) else [each]
    if not found:
        raise SceneError("shapes is empty; there must be at least one")
    for each in found:
        if not isinstance(each, Mesh | Instance | Sphere):
            raise SceneError(f"shapes has {in_brief(each)}; power is measured at meshes and spheres")
    return found


def _triangles(shape: Shape) -> Doubles:
    """Return the corners (t, 3, 3) of the faces of a mesh; none of a sphere."""
    mesh = shape.to_mesh() if isinstance(shape, Instance) else shape
    return mesh.vertices[mesh.faces] if isinstance(mesh, Mesh) else np.zeros((0, 3, 3))
