"""The annotations of the shapes of a scene: their names, categories, models and poses."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from ..arrays.soa import soa
from ..arrays.vec import Doubles
from ..core.errors import SceneError
from ..core.suggestions import did_you_mean
from ..shapes import Instance, Shape

RIGID = 1e-6  # largest element of MᵀM − 1 of a matrix that neither scales nor shears


@soa
class AnnotatedObject:
    """One shape that is annotated."""

    shape: int  # number of the shape in the scene, as in the layer `shape_id`
    name: str
    category: int  # the same for shapes of one name, from 1 on
    model: int  # the same for instances of one mesh, from 1 on
    of_mesh: bool  # whether the model is the mesh of an instance, in its own coordinates
    pose: Doubles  # (4, 4) from the model to the world, a rotation and a translation


def annotated_objects(shapes: Sequence[Shape], names: Iterable[str] | None) -> dict[int, AnnotatedObject]:
    """Return the shapes that are annotated, by their numbers.

    An instance that is moved and rotated is a model of its own coordinates. Any other shape is a model in
    world coordinates.

    Parameters
    ----------
    shapes
        Those of the scene.
    names
        Of the shapes to annotate; None for all.

    Raises
    ------
    SceneError
        If there is no shape of a name.
    """
    known = dict.fromkeys(shape.name for shape in shapes)
    wanted = list(known) if names is None else [names] if isinstance(names, str) else list(names)
    for name in wanted:
        if name not in known:
            listed = ", ".join(map(repr, known))[:200]
            raise SceneError(
                f"objects has {name!r}; shapes of the scene are {listed}{did_you_mean(name, known)}"
            )
    categories = {name: number for number, name in enumerate(dict.fromkeys(wanted), 1)}
    models: dict[int, int] = {}
    objects = {}
    for number, shape in enumerate(shapes):
        if shape.name in categories:
            pose = _rigid_pose(shape)
            mesh = shape.mesh if isinstance(shape, Instance) and pose is not None else None
            model = models.setdefault(id(shape if mesh is None else mesh), len(models) + 1)
            placed = np.eye(4) if pose is None else pose
            objects[number] = AnnotatedObject(
                number, shape.name, categories[shape.name], model, mesh is not None, placed
            )
    return objects


def _rigid_pose(shape: Shape) -> Doubles | None:
    """Return the transform of an instance if it is a rotation and a translation."""
    if not isinstance(shape, Instance):
        return None
    turn = shape.transform[:3, :3]
    rigid = np.abs(turn.T @ turn - np.eye(3)).max() <= RIGID and np.linalg.det(turn) > 0
    return np.asarray(shape.transform, np.float64) if rigid else None
