"""Several shapes that are placed together."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any, Self

from numpy.typing import ArrayLike

from ..core.errors import SceneError, as_array, finite_array, in_brief
from ..core.plural import plural
from ..core.suggestions import suggests_keywords
from ..motion import Motion
from .base import Shape
from .instance import Instance, motions_of
from .mesh import Mesh
from .transform import Matrix


class Group(tuple[Shape, ...]):
    """Shapes that are placed together, such as the parts of a car.

    It stands wherever a list of shapes does, and beside shapes in the list of a scene. Its shapes stay shapes
    of their own, with their names, materials and ids.

    Parameters
    ----------
    shapes
        Shapes of any kind, `Instance` objects and other groups, whose shapes are taken.

    Raises
    ------
    SceneError
        If an element is something else.

    Examples
    --------
    >>> wheel = wf.Disk((0, 0, 0), (0, 0, 1), 1, name="wheel")
    >>> hub = wf.Sphere((0, 0, 0), 0.2, name="hub")
    >>> places = np.tile(np.eye(4), (4, 1, 1))
    >>> places[:, :3, 3] = [(0, 0, 0), (3, 0, 0), (0, 0, 2), (3, 0, 2)]
    >>> wheels = wf.Group([wheel, hub]).placed(places)
    >>> [shape.name for shape in wheels[:3]]
    ['wheel', 'hub', 'wheel']
    >>> scene = wf.Scene([wf.Plane((0, -1, 0), (0, 1, 0)), wheels])
    """

    def __new__(cls, shapes: Iterable[Shape | Group]) -> Self:
        """Return the group of all these shapes."""
        if isinstance(shapes, Shape) or not isinstance(shapes, Iterable):
            raise SceneError(f"Group shapes must be a list of shapes, got {in_brief(shapes)}")
        members: list[Shape] = []
        for number, shape in enumerate(shapes):
            if not isinstance(shape, Shape | Group):
                what = in_brief(shape)
                raise SceneError(f"Group shapes[{number}] is {what}; it must be a shape or a group")
            members += shape if isinstance(shape, Group) else [shape]
        return super().__new__(cls, members)

    @property
    def moves(self) -> bool:
        """Whether a shape moves or deforms."""
        return any(shape.moves for shape in self)

    def at(self, time: float) -> Self:
        """Return the group at a time, seconds; one that is still returns itself."""
        return type(self)(shape.at(time) for shape in self) if self.moves else self

    def __repr__(self) -> str:
        """Return the number of shapes."""
        return f"<Group of {plural(len(self), 'shape')}>"

    @suggests_keywords
    def placed(self, transforms: ArrayLike | Motion | Sequence[Motion], *, name: str | None = None) -> Self:
        """Return copies of all shapes, placed by affine transforms, copy by copy.

        Those of a mesh, or of an `Instance`, are instances, which share its arrays and its tree.

        Parameters
        ----------
        transforms
            (4, 4) or (n, 4, 4) matrices, as `transform` of `Instance`; a copy for each. Or one motion, such
            as `Keyframes`, or a list of them.
        name
            Name of all shapes of the copies; by default each keeps its own.

        Raises
        ------
        SceneError
            If a transform is malformed or singular, or stretches a shape that cannot be stretched.
        """
        motions = motions_of([transforms] if isinstance(transforms, Motion) else transforms)
        if motions is not None:
            moving = [[_renamed(shape.transformed(motion), name) for shape in self] for motion in motions]
            return type(self)(shape for copy in moving for shape in copy)
        raw_matrices: Any = transforms
        single = as_array("Group transforms", raw_matrices).ndim == 2
        matrices = finite_array("Group transforms", raw_matrices, (4, 4) if single else (None, 4, 4))
        columns = [_copies(shape, matrices.reshape(-1, 4, 4), name) for shape in self]
        return type(self)(shape for row in zip(*columns, strict=True) for shape in row)


def _renamed(shape: Shape, name: str | None) -> Shape:
    """Return a shape with another name, unless it keeps its own."""
    shape.name = shape.name if name is None else name
    return shape


def _copies(shape: Shape, matrices: Matrix, name: str | None) -> list[Shape]:
    """Return copies of a shape by matrices (n, 4, 4)."""
    if isinstance(shape, Mesh):
        return list(Instance.many(shape, matrices, name=name))
    if isinstance(shape, Instance) and shape.motion is None:
        material = shape.material if shape.has_material else None
        label = shape.name if name is None else name
        return list(Instance.many(shape.mesh, matrices @ shape.transform, material=material, name=label))
    return [_renamed(shape.transformed(matrix), name) for matrix in matrices]
