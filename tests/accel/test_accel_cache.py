"""What a scene keeps from one render to the next: used again while nothing has moved, and only then."""

import copy
import gc
import pickle
import weakref
from collections.abc import Callable

import numpy as np
import pytest
import trimesh
from inside import make_accelerator
from significance import render

import wavefront as wf


def scene() -> wf.Scene:
    """A box and a ball under a sky."""
    box = trimesh.creation.box(extents=(1, 1, 1))
    shapes = [
        wf.Mesh(box.vertices, box.faces),
        wf.Sphere((1.2, 0, 0), 0.5),
        wf.Rectangle((0, 1, 0), (1, 0, 0), (0, 0, 1)),
    ]
    camera = wf.Camera.look_at((0, 2, 5), (0, 0, 0), fov=40, size=(8, 6))
    return wf.Scene(shapes, [wf.Environment()], camera)


KEEP = "wavefront.accel.cache.make_accelerator"


@pytest.fixture
def built(calls_of) -> list[str]:
    """The accelerators that were built so far."""
    names: list[str] = []

    def noted(geometry, accel):
        names.append(accel)
        return make_accelerator(geometry, accel)

    calls_of(KEEP, noted)
    return names


def look(subject: wf.Scene, accel: str = "numpy") -> np.ndarray:
    """A small picture."""
    return render(subject, 2, accel=accel, max_bounces=2).rgb


def lift_vertex(subject: wf.Scene) -> None:
    subject.shapes[0].vertices[0, 1] += 1e-3


def turn_face(subject: wf.Scene) -> None:
    subject.shapes[0].faces[0] = np.roll(subject.shapes[0].faces[0], 1)


def grow(subject: wf.Scene) -> None:
    subject.shapes[1].radius *= 1.001


def take_away(subject: wf.Scene) -> None:
    del subject.shapes[1]


def swap(subject: wf.Scene) -> None:
    subject.shapes[0], subject.shapes[2] = subject.shapes[2], subject.shapes[0]


def add_texture_coordinates(subject: wf.Scene) -> None:
    subject.shapes[0].material = wf.Diffuse(wf.Texture(np.random.default_rng(0).random((4, 4, 3))))
    subject.shapes[0].uvs = subject.shapes[0].vertices[:, :2] + 0.5


def repaint(subject: wf.Scene) -> None:
    subject.shapes[0].material = wf.Mirror(0.5)


def shine(subject: wf.Scene) -> None:
    subject.lights.append(wf.PointLight((0, 3, 3), 5))


@pytest.mark.parametrize(
    "change",
    [lift_vertex, turn_face, grow, take_away, swap, add_texture_coordinates],
    ids=lambda f: f.__name__,
)
def test_what_has_moved_is_built_again(change: Callable[[wf.Scene], None], built: list[str]) -> None:
    """The picture after a change is that of a scene which was so from the beginning."""
    used, fresh = scene(), scene()
    look(used)
    for subject in (used, fresh):
        change(subject)
    assert (look(used) == look(fresh)).all()
    assert len(built) == 3


@pytest.mark.parametrize("change", [repaint, shine], ids=lambda f: f.__name__)
def test_what_has_not_moved_is_built_once(change: Callable[[wf.Scene], None], built: list[str]) -> None:
    used, fresh = scene(), scene()
    first = look(used)
    assert (look(used) == first).all()
    for subject in (used, fresh):
        change(subject)
        subject.camera = wf.Camera.look_at((1, 2, 5), (0, 0, 0), fov=40, size=(8, 6))
    assert (look(used) == look(fresh)).all()
    assert len(built) == 2


def test_instances_are_kept_too(built: list[str]) -> None:
    """The shared mesh has an accelerator of its own, which is not built again either."""
    ball = trimesh.creation.icosphere(subdivisions=1)
    mesh = wf.Mesh(ball.vertices, ball.faces)
    places = [np.eye(4), np.eye(4)]
    places[1][0, 3] = 3

    def subject() -> wf.Scene:
        return wf.Scene([wf.Instance(mesh, place) for place in places], [wf.Environment()], scene().camera)

    used = subject()
    look(used)
    count = len(built)
    assert count == 2
    look(used)
    assert len(built) == count


def test_old_ones_are_gone_before_new_ones_are_built(calls_of) -> None:
    subject = scene()
    look(subject)
    _, ((_, accelerator),) = subject.accelerators._kept["numpy"]
    old = weakref.ref(accelerator)
    del accelerator
    alive = []

    def noted(geometry, accel):
        gc.collect()
        alive.append(old() is not None)
        return make_accelerator(geometry, accel)

    calls_of(KEEP, noted)
    lift_vertex(subject)
    look(subject)
    assert alive == [False]


def test_copies_and_pickles_of_a_rendered_scene_look_the_same(built: list[str]) -> None:
    """They hold nothing of what was built, Embree's memory least of all."""
    subject = scene()
    first = look(subject, "auto")
    for twin in (copy.deepcopy(subject), pickle.loads(pickle.dumps(subject))):
        assert twin.accelerators._kept == {}
        assert (look(twin, "auto") == first).all()
    assert len(built) == 3
