"""A scene in the middle of the time for which a shutter is open, and the motions of its parts."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from itertools import accumulate, compress
from operator import is_not
from typing import Any

import numpy as np

from ..accel.apart import are_many
from ..arrays.vec import Doubles
from ..core.errors import SceneError, warn_caller
from ..lights import Environment
from ..motion import Keyframes, Moving, Samples
from ..motion.quaternions import rotation_of
from ..motion.shutter import Shutter
from ..motion.steps import Matrices
from ..scene import Scene
from ..scene.scene import boxes_over_time
from ..shapes import Instance, Mesh, Shape, Sphere, Spheres
from ..shapes.instance import of_class, unshaded
from ..shapes.transform import is_even, points_by
from .materials import attributes_read
from .motion import Exposed, Mover

TIMES = 9  # samples of the time while the shutter is open
MOST_STEPS = 16  # linear steps that approximate a deformation at most
CARRIED = 64  # lines along which textured spheres go while the shutter is open
STRAIGHT = 2.0**-12  # tolerance of such steps, relative to the shape
FORMS = 33  # of an emitting mesh whose transform does not keep its shape
EVEN = 1e-5  # relative difference of scales along two axes that does not matter for light


def exposed_scene(scene: Scene, shutter: Shutter | None) -> Exposed:
    """Return a scene in the middle of the time for which a shutter is open, and the motions of its parts.

    Without a shutter it is the scene itself.

    Raises
    ------
    SceneError
        If something moves in a way that cannot be shown.
    """
    if shutter is None:
        return Exposed(scene, changed=scene.changed)
    scene = _sampled(scene, shutter)
    moving = {number: shape for number, shape in enumerate(scene.shapes) if _moves(shape, shutter)}
    lights = {number: light for number, light in enumerate(scene.lights) if _moves(light, shutter)}
    if not moving and not lights:
        moment = scene.at(shutter.middle)
        return Exposed(moment, changed=moment.changed)
    still, times = copy(scene), np.linspace(shutter.begin, shutter.end, TIMES).tolist()
    plain = [unshaded(shape) for shape in moving.values()]
    boxes = boxes_over_time(plain, times) if plain else []
    keys = np.concatenate([_inside(each.keys, shutter) for each in (*moving.values(), *scene.lights)])
    exposed, forms = Exposed(still, shutter, boxes=tuple(boxes), keys=np.unique(keys)), _Forms(shutter)
    shapes = [shape.at(shutter.middle) for shape in scene.shapes]
    for number, shape in moving.items():
        shapes[number], exposed.movers[number] = forms.mover(shape, shapes[number])
    still.shapes = shapes
    exposed.changed = np.array(list(map(is_not, shapes, scene.shapes)))
    still.lights = [light.at(shutter.middle) for light in scene.lights]
    for number, light in lights.items():
        exposed.lights[number] = _rigid(light, shutter)
    return exposed


def middle_of(exposed: Exposed, low: Doubles, high: Doubles, scale: float) -> tuple[Doubles, Doubles]:
    """Return the point (3,) that a scene is compiled around, and how far it reaches from there, (3,).

    It is the middle of its corners (3,). But where many triangles stand still it is their middle, unless they
    are a small part of the scene, so that what follows from their places is the same at all times.

    Parameters
    ----------
    scale
        Lengths of the scene have been multiplied by it for the corners.
    """
    middle, half = (low + high) / 2, (high - low) / 2
    if exposed.changed is None or not exposed.changed.any():
        return middle, half
    still = of_class(compress(exposed.scene.shapes, (~exposed.changed).tolist()), Mesh)
    if not are_many(sum(len(mesh.faces) for mesh in still)):
        return middle, half
    boxes = np.stack([mesh.bounds for mesh in still]) * scale
    first, last = boxes[:, 0].min(0), boxes[:, 1].max(0)
    if np.linalg.norm(last - first) < np.linalg.norm(half):
        return middle, half
    return (first + last) / 2, np.maximum(high - (first + last) / 2, (first + last) / 2 - low)


def _sampled(scene: Scene, shutter: Shutter) -> Scene:
    """Return a scene with motions of its own in place of a file that is read anew for each time.

    Meshes deform along lines between their forms at some times; balls and lights go and turn between their
    places then. Other changes are left out.
    """
    if scene.file_moments is None:
        return scene
    times = np.linspace(shutter.begin, shutter.end, TIMES)
    moments = [scene.at(time) for time in times.tolist()]
    sampled, middle = copy(scene), moments[TIMES // 2]
    sampled.file_moments, columns = None, [moment.shapes for moment in moments]
    if len({len(shapes) for shapes in columns}) > 1:
        warn_caller("shapes of the file come or go while the shutter is open; they are as in the middle")
        columns = [middle.shapes]
    sampled.shapes = [_over_time(list(shapes), times) for shapes in zip(*columns, strict=True)]
    sampled.lights, lights = middle.lights, [moment.lights for moment in moments]
    if len({len(row) for row in lights}) == 1:
        sampled.lights = [_light_over_time(list(row), times) for row in zip(*lights, strict=True)]
    return sampled


def _light_over_time(lights: list[Any], times: Doubles) -> Any:
    """Return a light that goes and turns as several do, of one kind, at each of some times.

    Of a light with an axis, as those of files are, any turn that takes the axis along will do.
    """
    middle = lights[len(lights) // 2]
    if all(light is middle for light in lights) or {type(light) for light in lights} != {type(middle)}:
        return middle
    ways = np.tile(np.eye(4), (len(times), 1, 1))
    if isinstance(middle, Environment):
        rotations = np.stack([light.rotation for light in lights])
        if (rotations != middle.rotation).any():
            ways[:, :3, :3] = rotations @ middle.rotation.T
    if hasattr(middle, "direction"):
        ways[:, :3, :3] = _turns(np.stack([light.direction for light in lights]))
    if hasattr(middle, "position"):
        places = np.stack([light.position for light in lights])
        ways[:, :3, 3] = places - (ways[:, :3, :3] * middle.position).sum(2)
    return middle if (ways == np.eye(4)).all() else middle.transformed(Keyframes(times, ways))


def _turns(axes: Doubles) -> Doubles:
    """Return rotations (n, 3, 3) from the middle one of unit axes (n, 3) to each, on the way through all."""
    quaternions = np.column_stack([np.cross(axes[:-1], axes[1:]), 1 + (axes[:-1] * axes[1:]).sum(1)])
    steps = rotation_of(quaternions)
    from_first = np.stack(list(accumulate(steps, lambda turn, step: step @ turn, initial=np.eye(3))))
    turns: Doubles = from_first @ from_first[len(axes) // 2].T
    return turns


def _over_time(shapes: list[Shape], times: Doubles) -> Shape:
    """Return a shape that is one of several at each of some times, all of one kind."""
    middle = shapes[len(shapes) // 2]
    if all(shape is middle for shape in shapes):
        return middle
    balls = [shape for shape in shapes if isinstance(shape, Sphere)]
    if len(balls) == len(shapes) and len({float(ball.radius) for ball in balls}) == 1:
        ways, places = np.tile(np.eye(4), (len(times), 1, 1)), np.stack([ball.center for ball in balls])
        ways[:, :3, 3] = places - places[len(balls) // 2]
        moving: Shape = middle.transformed(Keyframes(times, ways))
        return moving
    meshes: list[Any] = [shape.to_mesh() if isinstance(shape, Instance) else shape for shape in shapes]
    first = meshes[0]
    for mesh in meshes:
        same = isinstance(mesh, Mesh) and isinstance(first, Mesh) and np.array_equal(mesh.faces, first.faces)
        if not same or len(mesh.vertices) != len(first.vertices):
            warn_caller(f"{middle.name}: changes while the shutter is open; it is shown as in the middle")
            return middle
    return _of_forms(meshes, times)


def _of_forms(meshes: Sequence[Any], times: Doubles) -> Mesh:
    """Return a mesh that is each of some meshes with the same faces at a time, and between on lines."""
    arrays = {"vertices": np.stack([mesh.vertices for mesh in meshes])}
    if meshes[0].normals is not None:
        arrays["normals"] = np.stack([mesh.normals for mesh in meshes])
    mesh: Mesh = copy(meshes[0])
    mesh.deformation = Samples(times, arrays)
    return mesh


def _moves(element: Moving, shutter: Shutter) -> bool:
    """Return whether an element of a scene moves while a shutter is open, so that it is seen."""
    if isinstance(element, Environment) and element.is_even:
        return False
    start, end = element.time_span
    return element.moves and start < shutter.end and end > shutter.begin


class _Forms:
    """How shapes move, and the shapes to trace; meshes that several instances share stay shared."""

    def __init__(self, shutter: Shutter) -> None:
        self._shutter, self._meshes = shutter, dict[int, tuple[Mesh, Mesh]]()  # with the originals

    def mover(self, shape: Shape, then: Shape) -> tuple[Shape, Mover]:
        """Return the shape to trace, and its motion; `then` is the shape in the middle of the time."""
        if isinstance(shape, Mesh):
            return self._of_mesh(shape, then, shape, _matrices(shape))
        if isinstance(shape, Instance):
            assert isinstance(then, Instance)
            if then.emission is not None and not self._keeps_shape(shape):
                return self.mover(*self._as_forms(shape))
            return self._of_mesh(shape, then, shape.mesh, _matrices(shape, shape.transform))
        if isinstance(shape, Sphere) and shape.transform is None:
            return then, Mover(self._unturned(shape, then))
        if isinstance(shape, Spheres) and self._is_textured_and_rigid(shape):
            return then, self._of_carried_spheres(shape, then)
        if shape.deformation is None:
            return then, Mover(_matrices(shape))
        if not isinstance(shape, Spheres):
            raise SceneError(
                f"{shape.name}: a {type(shape).__name__} that deforms while the shutter is open; only meshes "
                "and wf.Spheres can"
            )
        return then, self._of_spheres(shape)

    def _of_mesh(self, shape: Shape, then: Any, mesh: Mesh, matrices: Matrices) -> tuple[Shape, Mover]:
        """Return the same of a mesh, or of an instance of one."""
        middle = self._still(mesh)
        if then.emission is not None:  # each emitting surface is a light of its own
            middle = copy(middle)
            middle.material, middle.emission = then.material, then.emission
        traced = Instance(middle, matrices(np.array([self._shutter.middle]))[0], name=shape.name)
        if then.material is not middle.material:
            traced.material = then.material
        if not mesh.moves:
            return traced, Mover(matrices)
        return traced, Mover(matrices, mesh, keys=_keys(mesh, "vertices", self._shutter))

    def _still(self, mesh: Mesh) -> Mesh:
        """Return a mesh in the middle of the time, the same object for the same mesh."""
        if id(mesh) not in self._meshes:
            self._meshes[id(mesh)] = mesh.at(self._shutter.middle), mesh
        return self._meshes[id(mesh)][0]

    def _keeps_shape(self, shape: Instance) -> bool:
        """Return whether the motion of an instance scales alike in all directions."""
        times = _moments(shape, self._shutter)
        return is_even(_matrices(shape, shape.transform)(times), EVEN)

    def _as_forms(self, shape: Instance) -> tuple[Mesh, Mesh]:
        """Return an instance as a mesh that deforms, and that in the middle of the time."""
        times = _moments(shape, self._shutter, FORMS)
        mesh = _of_forms([shape.at(time).to_mesh() for time in times.tolist()], times)
        return mesh, mesh.at(self._shutter.middle)

    def _is_textured_and_rigid(self, shape: Spheres) -> bool:
        """Return whether spheres have a texture, which does not turn with them, and one size over time."""
        if shape.deformation is not None or "uv" not in attributes_read([shape]):
            return False
        times = _moments(shape, self._shutter)
        volumes = np.linalg.det(_matrices(shape)(times)[:, :3, :3])
        return bool(np.ptp(volumes) <= EVEN * np.abs(volumes).max())

    def _unturned(self, sphere: Sphere, then: Any) -> Matrices:
        """Return the matrices of a sphere without a rotation of its own, whose texture does not turn."""
        carried, (center,) = _matrices(sphere), self._uncarried(sphere, then)

        def matrices(times: Doubles) -> Doubles:
            moved = carried(times)
            x, y, z = moved[:, :3, 0].T
            scale = np.sqrt(x * x + y * y + z * z)
            unturned = np.zeros_like(moved)
            unturned[:, :3, :3] = np.eye(3) * scale[:, None, None]
            unturned[:, :3, 3] = moved[:, :3, :3] @ center + moved[:, :3, 3] - scale[:, None] * center
            unturned[:, 3, 3] = 1
            return unturned

        return matrices

    def _of_carried_spheres(self, shape: Spheres, then: Any) -> Mover:
        """Return the motion of spheres that a motion carries, but does not turn."""
        matrices, places = _matrices(shape), self._uncarried(shape, then)
        keys = _moments(shape, self._shutter, CARRIED + 1)
        still = matrices(np.array([self._shutter.middle]))

        def centers(time: float) -> Doubles:
            return points_by(matrices(np.array([time])), places)

        return Mover(lambda times: np.repeat(still, len(times), 0), centers=centers, keys=keys)

    def _uncarried(self, shape: Sphere | Spheres, then: Any) -> Doubles:
        """Return centers (n, 3) as they are before the motion carries them."""
        back = np.linalg.inv(_matrices(shape)(np.array([self._shutter.middle]))).astype(np.float64)
        return points_by(back, then.centers)

    def _of_spheres(self, shape: Spheres) -> Mover:
        """Return the motion of spheres that have places of their own over time."""
        assert shape.deformation is not None
        matrices, deformation = _matrices(shape), shape.deformation
        carried = matrices(np.array([self._shutter.middle]))[0]

        def centers(time: float) -> Doubles:
            places = deformation.at(time)["centers"]
            return np.asarray(places @ carried[:3, :3].T + carried[:3, 3])

        return Mover(matrices, centers=centers, keys=_keys(shape, "centers", self._shutter))


def _matrices(shape: Moving, transform: Doubles | None = None) -> Matrices:
    """Return the matrices of an element to the scene, at times."""
    if shape.motion is not None:
        return shape.motion.at_times
    stays = np.eye(4) if transform is None else transform
    return lambda times: np.repeat(stays[None], len(times), 0)


def _keys(shape: Any, points: str, shutter: Shutter) -> Doubles:
    """Return times (n,) between which the `points` of a shape that deforms go along lines, or nearly so."""
    deformation = shape.deformation
    if isinstance(deformation, Samples):
        return deformation.times
    steps, bends = 1, _inside(deformation.keys, shutter)
    while True:
        times = np.union1d(np.linspace(shutter.begin, shutter.end, steps + 1), bends)
        tested = np.sort(np.concatenate([times, (times[1:] + times[:-1]) / 2]))
        forms = np.stack([deformation.at(time)[points] for time in tested.tolist()])
        off = np.abs(forms[1::2] - (forms[:-1:2] + forms[2::2]) / 2).max()
        if steps >= MOST_STEPS or off <= STRAIGHT * np.ptp(forms, axis=(0, 1)).max():
            return times
        steps *= 2


def _inside(keys: Doubles, shutter: Shutter) -> Doubles:
    """Return those of times (k,) at which a shutter is open, none twice."""
    return np.unique(keys[(keys > shutter.begin) & (keys < shutter.end)])


def _moments(element: Moving, shutter: Shutter, count: int = TIMES) -> Doubles:
    """Return times while a shutter is open: evenly spaced ones, and those where an element turns."""
    return np.union1d(np.linspace(shutter.begin, shutter.end, count), _inside(element.keys, shutter))


def _rigid(light: Any, shutter: Shutter) -> Matrices:
    """Return the matrices of a light.

    Raises
    ------
    SceneError
        If they stretch it while the shutter is open.
    """
    matrices, times = _matrices(light), _moments(light, shutter)
    back = np.linalg.inv(matrices(np.array([shutter.middle]))[0])
    scales = np.linalg.svd((matrices(times) @ back)[:, :3, :3], compute_uv=False)
    if np.abs(scales - 1).max() > EVEN:
        raise SceneError(
            f"{type(light).__name__}: its motion stretches by {scales.max():.6g} while the shutter is open; "
            "a light can only go and turn then"
        )
    return matrices
