"""Rectangle lights: their contract, near and far, and which pairs of triangles make one."""

import numpy as np
import pytest
from inside import (
    RectangleLights,
    TriangleLights,
    TwoSidedRectangleLights,
    compile_scene,
    f4,
    first_of_pairs,
    make_accelerator,
)

import wavefront as wf

WHITE = np.ones((3, 1), f4)


def corners(mesh: wf.Mesh) -> np.ndarray:
    """Triangles of a mesh, (m, 3, 3)."""
    return mesh.vertices[mesh.faces]


def pairs(triangles: np.ndarray) -> list[int]:
    """First triangles of rectangles among those of one mesh."""
    return first_of_pairs(triangles, np.zeros(len(triangles), np.intp)).tolist()


@pytest.mark.parametrize(
    "point",
    [[0.2, 0, 0.1], [0, 0.99, 0], [3, -2, 1], [0.4, 0.9, 5]],
    ids=["below", "close", "far", "grazing"],
)
@pytest.mark.first(3)
def test_rectangles_keep_their_contract(point: list[float]) -> None:
    """Distribution, pdf, radiance and distance: by solid angle nearby and by area from afar."""
    light = RectangleLights.from_pairs(corners(wf.Rectangle((-1, 1, -1), (2, 0, 0), (0, 0, 2)))[:1], WHITE)
    wf.testing.check_light(light, points=[point], samples=50_000)


def test_nothing_is_sampled_behind_a_rectangle() -> None:
    light = RectangleLights.from_pairs(corners(wf.Rectangle((-1, 1, -1), (2, 0, 0), (0, 0, 2)))[:1], WHITE)
    point = np.array([[0.0, 0.0], [1.1, 30.0], [0.0, 0.0]], f4)
    assert not light.sample_li(point, np.full((2, 2), 0.5, f4)).pdf.any()


def test_pairs_are_found() -> None:
    """Two rectangles in a row, and a triangle between them, are told apart."""
    one, two = (
        corners(wf.Rectangle((0, 0, 0), (1, 0, 0), (0, 2, 0))),
        corners(wf.Rectangle((5, 0, 0), (0, 1, 1), (0, 1, -1))),
    )
    lone = np.array([[[9.0, 0, 0], [9, 1, 0], [9, 0, 1]]])
    assert pairs(np.concatenate([one, lone, two])) == [0, 3]


@pytest.mark.parametrize("edge_v", [(0.001, 1, 0), (-0.5, 1, 0)], ids=["barely skewed", "skewed"])
def test_parallelograms_are_not_rectangles(edge_v: tuple[float, float, float]) -> None:
    assert pairs(corners(wf.Rectangle((0, 0, 0), (1, 0, 0), edge_v))) == []


def test_overlapping_pairs_are_taken_once() -> None:
    """In a fan of three triangles each triangle belongs to one rectangle at most."""
    fan = np.array(
        [
            [[0, 0, 0], [1, 0, 0], [1, 1, 0]],
            [[0, 0, 0], [1, 1, 0], [0, 1, 0]],
            [[0, 0, 0], [0, 1, 0], [-1, 1, 0]],
        ],
        float,
    )
    assert pairs(fan) == [0]


def test_a_lit_floor_is_exact_under_a_parallelogram_too() -> None:
    """The irradiance of a light as rectangle and as two triangles is the same."""
    camera = wf.Camera.look_at((0.3, 0.5, 0), (0, 0, 0), up=(0, 0, 1), fov=1e-4, size=(1, 1))
    floor = wf.Rectangle((-10, 0, 10), (20, 0, 0), (0, 0, -20))
    whole = wf.Rectangle((-1, 1, -1), (2, 0, 0), (0, 0, 2), emission=1, material=wf.Diffuse(0))
    halves = [wf.Mesh(whole.vertices, [face], emission=1, material=wf.Diffuse(0)) for face in whole.faces]
    for lights in ([whole], halves):
        image = wf.render(wf.Scene([floor, *lights], camera=camera), 1 << 14, max_bounces=1)
        np.testing.assert_allclose(image.rgb, 1.740840 * 0.159155, rtol=2e-3)


def test_triangles_of_two_meshes_make_no_rectangle() -> None:
    triangles = corners(wf.Rectangle((0, 0, 0), (1, 0, 0), (0, 1, 0)))
    assert first_of_pairs(triangles, np.array([0, 1])).size == 0
    halves = [wf.Mesh(part, [(0, 1, 2)], emission=1.0) for part in triangles]
    lights = compile_scene(wf.Scene(halves), lambda geometry: make_accelerator(geometry, "numpy")).lights
    assert [(type(kind), len(kind)) for kind in lights.kinds] == [(TriangleLights, 2)]


def test_meshes_that_shine_alike_become_one_record() -> None:
    panels = [
        wf.Rectangle((3 * k, 0, 0), (1, 0, 0), (0, 1, 0), emission=k + 1.0, two_sided=k == 1)
        for k in range(3)
    ]
    lights = compile_scene(wf.Scene(panels), lambda geometry: make_accelerator(geometry, "numpy")).lights
    found = {type(kind): kind.radiance[0].tolist() for kind in lights.kinds}
    assert found == {RectangleLights: [1.0, 3.0], TwoSidedRectangleLights: [2.0]}
