"""Which shape of the user's scene each row of the compiled tables belongs to."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..arrays.soa import soa
from ..arrays.state import Hits
from ..arrays.vec import Ints
from ..shapes import CurvedShape, Instance, Mesh

SINGLE_COLUMNS = 2  # of the `InstanceTable`, for shapes that are not instanced


@soa
class ShapeNumbers:
    """The positions of shapes in `Scene.shapes`, by rows of the scene's tables.

    The rows of a shape follow one another: they are a part.
    """

    first: Ints  # (parts,) first row of each part, ascending
    of_part: Ints  # (parts,) number of the shape; -1 for meshes of instances
    of_instance: Ints  # (p,) number of the instance of each column of the `InstanceTable`, -1 for none

    def of(self, hits: Hits) -> Ints:
        """Return the numbers of the shapes at hits, (n,); every ray must have hit a surface."""
        number = self.of_part.take(self.part(hits))
        if hits.instance is None:
            return number
        return np.where(hits.instance >= SINGLE_COLUMNS, self.of_instance.take(hits.instance), number)

    def face(self, hits: Hits) -> Ints:
        """Return the faces, (n,), or the primitives of curved shapes."""
        return hits.prim - self.first.take(self.part(hits))

    def part(self, hits: Hits) -> Ints:
        """Return the parts at hits, (n,)."""
        return np.searchsorted(self.first, hits.prim, "right") - 1


def number_shapes(
    meshes: Sequence[Mesh],
    curved: Sequence[CurvedShape],
    instances: Sequence[Instance],
    numbers: Ints,
    moving: int = 0,
) -> ShapeNumbers:
    """Return the numbers of the shapes of a compiled scene.

    Parameters
    ----------
    meshes
        Those that are in the scene once, and then those of instances.
    curved, instances
        The other shapes.
    numbers
        The positions in `Scene.shapes` of the meshes that are in the scene once, and of the other shapes.
    moving
        How many curved shapes, the last ones, have a column of the `InstanceTable` each.
    """
    shared = len(meshes) + len(curved) + len(instances) - len(numbers)
    once = len(meshes) - shared
    single = once + len(curved)
    sizes = [len(mesh.faces) for mesh in meshes] + [shape.count for shape in curved]
    return ShapeNumbers(
        first=np.cumsum([0, *sizes])[:-1],
        of_part=np.concatenate([numbers[:once], np.full(shared, -1), numbers[once:single]]),
        of_instance=np.concatenate(
            [np.full(SINGLE_COLUMNS, -1), numbers[single:], numbers[single - moving : single]]
        ),
    )
