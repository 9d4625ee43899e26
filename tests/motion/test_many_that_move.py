"""Many instances that move while the shutter is open."""

from typing import Any

import numpy as np
import pytest
import trimesh
from inside import Shutter, exposed_scene
from scipy.spatial import ConvexHull

import wavefront as wf

BALL = trimesh.creation.icosphere(1, 0.2)
MESH = wf.Mesh(BALL.vertices, BALL.faces)


def slides(count: int) -> list[wf.Keyframes]:
    places = np.random.default_rng(1).uniform(-3, 3, (count, 2, 3))
    return [wf.Keyframes([0, 1], pair) for pair in places]


def test_their_boxes_are_computed_together(calls_of: Any) -> None:
    """Each alone is asked for its place in the middle, and not for the eight other times too."""
    scene = wf.Scene(wf.Instance.many(MESH, slides(30)))
    calls = calls_of("wavefront.shapes.instance.Instance.at")
    exposed = exposed_scene(scene, Shutter(0.0, 1.0))
    assert len(calls) == 30
    low = np.min([scene.at(time).bounds[0] for time in np.linspace(0, 1, 9)], 0)
    assert np.array_equal(np.min([box[0] for box in exposed.boxes], 0), low)


class Through(wf.Motion):
    """Shrinks to nothing after a quarter of the time, and grows again."""

    start, end = 0.0, 1.0

    def at_times(self, times: np.ndarray) -> np.ndarray:
        out = np.tile(np.eye(4), (len(times), 1, 1))
        out[:, :3, :3] *= np.abs(1 - 4 * np.clip(times, 0, 1))[:, None, None] / 3
        return out


def test_what_has_no_size_at_a_time_is_seen_at_others() -> None:
    scene = wf.Scene([wf.Instance(MESH, Through())], [wf.Environment(1)])
    camera = wf.Camera.orthographic((0, 0, 5), (0, 0, 0), height=0.5, size=(16, 16))
    image = wf.render(scene, 64, camera=camera, shutter=(0, 1), aovs="alpha", progress=False)
    outline = ConvexHull(BALL.vertices[:, :2]).volume / 0.5**2  # of the picture, where it is largest
    assert float(image.alpha.mean()) == pytest.approx(outline * 7 / 27, rel=0.02)
