"""Projections of one's own: what they must return, and that they work as the others do."""

import numpy as np
import pytest
from significance import render

import wavefront as wf


class Cylindrical(wf.Projection):
    """Straight verticals, and angles around them."""

    def rays(self, x, y, size, lens):
        angle = (x - size[0] / 2) * (2 / size[1])
        return None, np.stack([np.sin(angle), 1 - y * (2 / size[1]), -np.cos(angle)])

    def project(self, points, size):
        x, y, z = points
        across = np.hypot(x, z)
        return np.stack([size[0] + size[1] * np.arctan2(x, -z), size[1] * (1 - y / across)]) / 2, across


VIEW = wf.Camera.look_at((1, 2, 5), (0, 0, 0), size=(64, 32))


def test_what_a_projection_needs_is_few_lines() -> None:
    """It works with AOVs, boxes, light tracing and checkpoints; positions are projected onto their pixels."""
    camera = VIEW.replace(projection=Cylindrical())
    scene = wf.Scene([wf.Sphere((0, 0, 0), 1)], [wf.PointLight((0, 3, 3), 50)], camera)
    image = render(scene, 2, aovs=("position", "depth", "boxes"), caustics=True, workers=1)
    row, column = np.nonzero(np.isfinite(image.depth))
    pixels, depth = camera.project(image.position[row, column])
    assert len(row) > 30
    assert np.abs(pixels - np.stack([column, row], 1) - 0.5).max() < 1e-3
    assert depth == pytest.approx(image.depth[row, column], rel=1e-5)
    assert image.rgb.max() > 0


def changed(**methods) -> wf.Camera:
    return VIEW.replace(projection=type("Own", (Cylindrical,), methods)())


def nowhere(self, x, y, size, lens):
    _, direction = Cylindrical.rays(self, x, y, size, lens)
    return None, np.where(x < 20, np.nan, direction)


def test_what_a_projection_does_not_see_is_black() -> None:
    camera = changed(rays=nowhere, sees_all=False)
    image = render(wf.Scene([wf.Sphere((0, 0, 0), 1)], [wf.Environment(1)], camera), 1)
    assert not image.rgb[:, :20].any()
    assert image.rgb[:, 21:].all()


BAD = {
    r"Own.rays returns directions of shape \(25,\); it must be \(3, 25\)": {
        "rays": lambda self, x, y, size, lens: (None, x)
    },
    r"Own.rays returns origins of shape \(25,\)": {
        "rays": lambda self, x, y, size, lens: (x, Cylindrical.rays(self, x, y, size, lens)[1])
    },
    r"Own.rays returns the direction \[nan, nan, nan\] for film point .* sees_all of the class False": {
        "rays": nowhere
    },
    r"Own.rays returns the direction \[0.0, 0.0, 0.0\] for film point": {
        "rays": lambda self, x, y, size, lens: (None, np.zeros((3, len(x)))),
        "sees_all": False,
    },
    r"Own.project returns shapes \(25,\) and \(25,\) for 25 points; they must be \(2, 25\) and \(25,\)": {
        "project": lambda self, points, size: (points[0], points[1])
    },
    r"Own.project takes a point on the ray of film point \(.*\) to \(.*\); it must be the inverse of rays": {
        "project": lambda self, points, size: (points[:2], points[2])
    },
}


@pytest.mark.parametrize("message", BAD)
def test_mistakes_of_a_class_are_named(message: str) -> None:
    with pytest.raises(wf.SceneError, match=message):
        changed(**BAD[message])


def test_only_projections_are_projections() -> None:
    with pytest.raises(wf.SceneError, match=r"Camera projection is 'fisheye'; it must be a wf\.Projection"):
        VIEW.replace(projection="fisheye")
    with pytest.raises(wf.SceneError, match="Camera fov is 30; a Cylindrical camera has none"):
        VIEW.replace(projection=Cylindrical()).replace(fov=30)
