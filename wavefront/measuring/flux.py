"""measure_flux(): the power that arrives at shapes, or leaves them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Unpack

import numpy as np

from ..arrays.vec import Doubles
from ..camera import SurfaceSensors
from ..core.errors import SceneError, in_brief, one_of
from ..io.to_scene import as_scene
from ..scene import Scene
from ..settings import AUTO, RenderSettings, takes_settings
from ..shapes import Instance, Mesh, Shape, Sphere
from .measure import measured
from .measurement import Measurement

KINDS = ("arriving", "leaving")
SIDES = {"front": 1.0, "back": -1.0}


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
    measured_shapes = _chosen(subject, shapes)
    triangles = [_triangles(shape) for shape in measured_shapes]
    counts = np.array([len(corners) for corners in triangles])
    if faces:
        if len(measured_shapes) != 1 or not counts[0]:
            raise SceneError("faces is True; that is for one shape, which is a mesh")
        counts = np.ones(counts[0], np.intp)
    spheres = np.zeros((counts.size, 4))
    for row, shape in enumerate(measured_shapes):
        if isinstance(shape, Sphere):
            spheres[row] = (*shape.center, shape.radius)
    one_of("kind", kind, KINDS)
    surfaces = SurfaceSensors(np.concatenate(triangles), counts, spheres, kind, toward)
    return measured(subject, surfaces.above(subject.bounds), spp, settings)


def _chosen(scene: Scene, shapes: Any) -> list[Shape]:
    """Return shapes that are given by themselves or by names."""
    elements: Sequence[Any] = [shapes] if isinstance(shapes, str | Shape) else list(shapes)
    names = {shape.name for shape in scene.shapes}
    chosen: list[Shape] = []
    for element in elements:
        if isinstance(element, str):
            one_of("shapes: name", element, tuple(names))
            chosen += [shape for shape in scene.shapes if shape.name == element]
        else:
            chosen.append(element)
    if not chosen:
        raise SceneError("shapes is empty; there must be at least one")
    for shape in chosen:
        if not isinstance(shape, Mesh | Instance | Sphere):
            raise SceneError(f"shapes has {in_brief(shape)}; power is measured at meshes and spheres")
    return chosen


def _triangles(shape: Shape) -> Doubles:
    """Return the corners (t, 3, 3) of the faces of a mesh; none of a sphere."""
    mesh = shape.to_mesh() if isinstance(shape, Instance) else shape
    return mesh.vertices[mesh.faces] if isinstance(mesh, Mesh) else np.zeros((0, 3, 3))
