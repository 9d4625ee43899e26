"""Outlines: lines along the edges that layers show."""

import numpy as np
import pytest
from inside import Image

import wavefront as wf

f4 = np.float32


def picture(ids: np.ndarray, normal: object = (0, 0, 1), depth: object = 5.0, **layers: np.ndarray) -> Image:
    """A white picture with these layers."""
    shape = ids.shape
    normals = np.where((ids < 0)[..., None], np.nan, np.broadcast_to(normal, (*shape, 3))).astype(f4)
    depths = np.where(ids < 0, np.nan, np.broadcast_to(depth, shape)).astype(f4)
    layers |= {"shape_id": ids.astype(np.int32), "normal": normals, "depth": depths}
    return Image(np.ones((*shape, 3), f4), 7, standard_error=np.ones((*shape, 3), f4), layers=layers)


def ink(image: Image, **options: float) -> np.ndarray:
    """How much of each pixel the lines cover, (H, W)."""
    return 1 - image.outlined(**options).rgb[..., 0]


def test_a_straight_edge_gets_a_line_of_the_width() -> None:
    ids = np.zeros((21, 40), int)
    ids[:, 20:] = 1
    for width in (1, 2, 3, 6):
        across = ink(picture(ids), width=width)[10]
        assert across.sum() == pytest.approx(width, abs=1e-4)
        np.testing.assert_allclose(across, across[::-1], atol=1e-6)
        assert across[19:21].min() > 0.3
        assert not across[: 18 - width].any()
    rows = ink(picture(np.ascontiguousarray(ids.T)), width=3)
    np.testing.assert_array_equal(rows, ink(picture(ids), width=3).T)


@pytest.mark.parametrize("angle", [10, 30, 45, 70])
def test_slanting_lines_are_as_wide(angle: float) -> None:
    y, x = np.mgrid[:120, :120] - 60
    turn = np.radians(angle)
    ids = (x * np.cos(turn) + y * np.sin(turn) > 0).astype(int)
    covered = ink(picture(ids), width=3)[30:90, 30:90].sum()
    long = 60 / max(abs(np.cos(turn)), abs(np.sin(turn)))
    assert covered / long == pytest.approx(3, rel=0.2)


def test_creases_are_edges_and_curves_are_not() -> None:
    ids = np.zeros((20, 60), int)
    turn = np.radians(np.where(np.arange(60) < 30, 0, 60))[None].repeat(20, 0)
    sharp = np.stack([np.sin(turn), 0 * turn, np.cos(turn)], -1)
    assert ink(picture(ids, sharp))[10, 29:31].min() > 0.7
    assert not ink(picture(ids, sharp), crease=61).any()
    turn = np.linspace(-1.5, 1.5, 60)[None].repeat(20, 0)
    assert not ink(picture(ids, np.stack([np.sin(turn), 0 * turn, np.cos(turn)], -1))).any()


def test_jumps_of_depth_are_edges_and_slopes_are_not() -> None:
    ids = np.zeros((20, 60), int)
    column = np.arange(60)
    step = np.where(column < 30, 5.0, 5.2)
    assert ink(picture(ids, depth=step))[10, 29:31].min() > 0.7
    assert not ink(picture(ids, depth=step), jump=0.05).any()
    for slope in (
        1 / np.linspace(0.01, 1, 60),
        np.linspace(5, 6, 60),
    ):  # a plane in perspective, and from afar
        assert not ink(picture(ids, depth=slope)).any()
    both = np.where(column < 30, 5 + 0.03 * column, 6 + 0.03 * column)
    assert ink(picture(ids, depth=both))[10, 29:31].min() > 0.7


def test_nothing_is_drawn_where_nothing_is() -> None:
    assert not ink(picture(np.full((9, 9), -1))).any()
    assert not ink(picture(np.zeros((9, 9), int))).any()
    for shape in ((1, 9), (9, 1), (1, 1), (2, 2)):
        assert not ink(picture(np.zeros(shape, int)), width=5).any()


def test_a_disk_before_nothing_gets_a_ring_that_covers_a_transparent_background() -> None:
    y, x = np.mgrid[:80, :80] - 39.5
    inside = np.hypot(x, y) < 25
    image = picture(np.where(inside, 3, -1), alpha=inside.astype(f4))
    lined = image.outlined((1, 0, 0), 4)
    covered = 1 - lined.rgb[..., 1]
    assert covered.sum() == pytest.approx(2 * np.pi * 25 * 4, rel=0.2)
    np.testing.assert_allclose(lined.rgb[..., 0], 1)
    np.testing.assert_allclose(lined.layers["alpha"], np.where(inside, 1, covered), atol=1e-6)
    np.testing.assert_allclose(lined.standard_error[..., 1], 1 - covered, atol=1e-6)
    assert lined.spp == 7
    assert image.rgb.min() == 1  # the picture itself is as it was
    assert (image.layers["alpha"] == inside).all()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"width": 0}, "outlines: width is 0; it must be above 0"),
        ({"crease": 200}, "outlines: crease is 200; it must be above 0 and at most 180"),
        ({"jump": -1}, "outlines: jump is -1; it must be above 0"),
        ({"color": -1}, "outlines: color is -1; it must be at least 0"),
    ],
)
def test_arguments_are_checked(options: dict, message: str) -> None:
    with pytest.raises(wf.SceneError, match=message):
        picture(np.zeros((3, 3), int)).outlined(**options)


def test_a_missing_layer_is_named() -> None:
    with pytest.raises(wf.SceneError, match=r"no layer 'shape_id'; render it with aovs=\('shape_id', "):
        Image(np.ones((3, 3, 3), f4)).outlined()


def test_a_rendered_picture_of_two_balls_is_outlined() -> None:
    balls = wf.Spheres([(-0.4, 0, 0), (0.4, 0, -1)], 0.6, material=wf.Diffuse(1.0))
    camera = wf.Camera.look_at((0, 0, 6), (0, 0, 0), fov=20, size=(64, 64))
    scene = wf.Scene(balls, [wf.Environment(1)], camera)
    image = wf.render(scene, 4, aovs=("shape_id", "normal", "depth"))
    dark = image.outlined(width=2).rgb[..., 0] < 0.5 * image.rgb[..., 0]
    assert 200 < dark.sum() < 600
    assert dark[32, 28:40].any()  # where one ball ends in front of the other, which is of the same shape
    assert not dark[28:36, 14:24].any()
