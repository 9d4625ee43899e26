"""The viewer draws the path of a pixel that is clicked."""

from types import SimpleNamespace

import numpy as np
import pytest
from inside import COLORS, LIGHT, PATH, is_message, segments_of

import wavefront as wf

viser = pytest.importorskip("viser")
msgspec = pytest.importorskip("msgspec")

FLOOR = wf.Rectangle((-4, 0, 4), (8, 0, 0), (0, 0, -8), material=wf.Diffuse(0.6), name="floor")
LAMP = wf.Rectangle((-1, 3, -1), (2, 0, 0), (0, 0, 2), emission=9)
CAMERA = wf.Camera.look_at((0, 2, 6), (0, 1, 0), size=(64, 48))
SCENE = wf.Scene([FLOOR, LAMP, wf.Sphere((0, 1, 0), 1, material=wf.Diffuse(0.8), name="ball")], camera=CAMERA)


@pytest.fixture
def page():
    """The page of a viewer, whose elements and drawings can be looked at."""
    with wf.view(SCENE, 1, port=0, max_bounces=3, open_browser=False, block=False) as viewer:
        yield viewer._page


def click(page, x, y):
    """Do what viser does for a click at a part of the page."""
    (entry,) = page._server.scene._scene_pointer_cb
    entry.callback(SimpleNamespace(screen_pos=(x, y)))


def test_a_click_shows_the_path_that_trace_has(page):
    box = page.path.box
    click(page, 0.5, 0.5)
    drawn = page._server.scene._handle_from_node_name
    assert PATH not in drawn  # the box is not ticked
    box.value = True
    click(page, 0.5, 17.5 / 48)
    view = page.viewpoint
    path = wf.trace(wf.Scene(SCENE.shapes, camera=view.camera), max_bounces=3).path((32, 17))
    between, toward = segments_of(path, view.surroundings.radius)
    assert between
    assert toward
    for name, segments in ((PATH, between), (LIGHT, toward)):
        expected = np.array([[view.surroundings.to_page(end) for end in pair] for pair in segments])
        np.testing.assert_allclose(drawn[name].points, expected, rtol=1e-5, atol=1e-6)
    assert "ball" in page.path.table.content
    click(page, 0.0, 0.0)  # nothing is there
    assert PATH not in drawn
    click(page, 1.0, 1.0)  # at the edge of the last pixel
    assert "floor" in page.path.table.content
    box.value = False
    for callback in box._impl.update_cb:
        callback(SimpleNamespace(target=box))
    assert not drawn.keys() & COLORS.keys()
    assert page.path.table.content == ""


def test_segments_go_from_surface_to_surface_and_out_of_the_scene():
    ball = wf.Scene([wf.Sphere((0, 0, 0), 1)], [wf.Environment(1)], CAMERA)
    path = wf.trace(ball).path((32, 30))
    between, toward = segments_of(path, 2.0)
    assert path[-1].point is None
    start, end = between[-1]
    np.testing.assert_allclose((end - start) / 2, -path[-1].wo, atol=1e-6)
    assert len(between) == len(path) - 1
    assert len(toward) == len([vertex for vertex in path if vertex.sampled is not None])
    assert segments_of(wf.trace(ball).path((0, 0)), 2.0) == ([], [])


CLICK = {
    "type": "ScenePointerMessage",
    "event_type": "click",
    "ray_origin": (0, 0, 1),
    "ray_direction": (0, 0, -1),
    "screen_pos": ((0.5, 0.5),),
    "modifier": None,
}


@pytest.mark.parametrize(
    ("change", "taken"),
    [
        ({}, True),
        ({"event_type": "rect-select"}, False),
        ({"screen_pos": ()}, False),
        ({"screen_pos": (("a", 1),)}, False),
        ({"ray_origin": None}, False),
        ({"more": 1}, False),
    ],
)
def test_only_clicks_are_taken(change, taken):
    assert is_message(msgspec.msgpack.encode({**CLICK, **change})) == taken
