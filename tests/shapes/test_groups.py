"""Groups: shapes of all kinds that are placed together."""

from __future__ import annotations

import pickle
from typing import Any

import numpy as np
import pytest
import trimesh

import wavefront as wf

RED = wf.Diffuse((0.8, 0.2, 0.1))


def at(x: float, y: float = 0, z: float = 0, scale: Any = 1.0) -> np.ndarray:
    matrix = np.diag([*np.broadcast_to(scale, 3), 1.0])
    matrix[:3, 3] = x, y, z
    return matrix


def parts() -> list[wf.Shape]:
    """Return a mesh, an instance of another one with a material, a sphere and two cylinders."""
    box = wf.Box((0, 0, 0), 1, name="box")
    roof = wf.Box((0, 0, 0), 0.5, name="roof")
    return [
        box,
        wf.Instance(roof, at(0, 1), material=RED, name="red roof"),
        wf.Sphere((0, 2, 0), 0.5, name="ball"),
        wf.Cylinders([(0, 0, 0), (1, 0, 0)], [(0, 1, 0), (1, 1, 0)], 0.25, name="bars"),
    ]


def test_a_group_places_shapes_of_all_kinds() -> None:
    copies = wf.Group(parts()).placed([at(0), at(10, scale=2)])
    assert [type(shape) for shape in copies] == [wf.Instance, wf.Instance, wf.Sphere, wf.Cylinders] * 2
    assert [shape.name for shape in copies] == ["box", "red roof", "ball", "bars"] * 2
    first, second = copies[:4], copies[4:]
    for one, other in zip(first, second, strict=True):
        np.testing.assert_allclose(other.bounds, one.bounds * 2 + (10, 0, 0), atol=1e-12)
        assert other.material is one.material or isinstance(one, wf.Sphere | wf.Cylinders)
    assert first[0].mesh is second[0].mesh  # type: ignore[attr-defined]
    assert first[1].material.bsdf is RED
    assert second[1].mesh is first[1].mesh  # type: ignore[attr-defined]


def test_a_group_is_what_its_placed_shapes_are(shared_instances: None) -> None:
    """Rays meet the same surfaces, and layers have the ids of all shapes."""
    matrix = at(0.5, -1, 0, 0.75)
    one_by_one = [shape.transformed(matrix) for shape in parts()]
    group = wf.Group(parts()).placed(matrix)
    camera = wf.Camera.look_at((1, 1, 8), (0.5, 0, 0), fov=40, size=(24, 24))
    pictures = [
        wf.render(
            wf.Scene(shapes, camera=camera), 2, ground=False, aovs=("shape_id", "position"), progress=False
        )
        for shapes in (one_by_one, [group], group)
    ]
    for picture in pictures[1:]:
        assert (picture.shape_id == pictures[0].shape_id).all()
        np.testing.assert_allclose(picture.position, pictures[0].position, atol=1e-5)
    assert set(np.unique(pictures[0].shape_id)) == {-1, 0, 1, 2, 3}


def test_groups_of_groups_and_names() -> None:
    pair = wf.Group([wf.Sphere((0, 0, 0), 1), wf.Box((2, 0, 0), 1)])
    rows = wf.Group([pair, pair.placed(at(0, 5))])
    assert len(rows) == 4
    assert repr(rows) == "<Group of 4 shapes>"
    twice = rows.placed([at(0, 0, 0), at(0, 0, 9)], name="piece")
    assert {shape.name for shape in twice} == {"piece"}
    assert [shape.name for shape in pair] == ["sphere", "box"]
    np.testing.assert_allclose(twice[7].bounds.mean(0), [2, 5, 9])
    assert twice[1].mesh is twice[7].mesh  # type: ignore[attr-defined]


def test_groups_stand_where_shapes_do() -> None:
    group, floor = wf.Group(parts()), wf.Plane((0, -1, 0), (0, 1, 0))
    scene = wf.Scene([floor, group])
    scene.add(group.placed(at(5)))
    assert len(scene.shapes) == 9
    assert len(wf.Scene(group).shapes) == 4
    assert wf.render([floor, group, wf.Environment(1)], spp=1, size=(8, 8), progress=False).shape == (8, 8, 3)
    assert [shape.name for shape in pickle.loads(pickle.dumps(group))] == [shape.name for shape in group]


def test_wrong_groups_are_named() -> None:
    with pytest.raises(wf.SceneError, match=r"Group shapes\[1\] is 3; it must be a shape or a group"):
        wf.Group([wf.Sphere((0, 0, 0), 1), 3])  # type: ignore[list-item]
    with pytest.raises(wf.SceneError, match="Group shapes must be a list of shapes"):
        wf.Group(wf.Sphere((0, 0, 0), 1))  # type: ignore[arg-type]
    with pytest.raises(wf.SceneError, match="ball: transform stretches by 1 along one axis and 2"):
        wf.Group(parts()).placed(at(0, scale=(1, 2, 1)))
    with pytest.raises(wf.SceneError, match="Group transforms must have shape"):
        wf.Group(parts()).placed(np.eye(3))
    with pytest.raises(wf.SceneError, match=r"mesh must be a wf.Mesh, got .*; wf.Group\(...\).placed"):
        wf.Instance(parts(), np.eye(4))  # type: ignore[arg-type]
    mesh = trimesh.creation.box()
    with pytest.raises(wf.SceneError, match="must be a shape or a group"):
        wf.Group([mesh])
