"""A mesh shows its vertex colors when it is given no material, in whatever form they come."""

import numpy as np
import pytest
import trimesh
from significance import render

import wavefront as wf

BALL = trimesh.creation.icosphere(1)
CODES = np.random.default_rng(0).integers(0, 256, (len(BALL.vertices), 4), np.uint8)
CODES[:, 3] = 255
CAMERA = wf.Camera.look_at((0, 0, 4), (0, 0, 0), size=(12, 12))


def picture(*shapes) -> bytes:
    return render(wf.Scene(shapes, wf.Environment(), CAMERA), 4).rgb.tobytes()


def mesh(**options) -> wf.Mesh:
    return wf.Mesh(BALL.vertices, BALL.faces, **options)


def test_colors_are_shown_without_a_material() -> None:
    linear = np.random.default_rng(1).random((len(BALL.vertices), 3))
    shown = picture(mesh(colors=linear, material=wf.Diffuse(wf.VertexColors())))
    assert picture(mesh(colors=linear)) == shown
    assert picture(mesh(colors=linear, material=wf.Diffuse(0.5))) == picture(mesh()) != shown
    later = mesh()
    later.colors = mesh(colors=linear).colors
    assert picture(later) == shown


@pytest.mark.parametrize("channels", [3, 4])
def test_bytes_are_those_of_trimesh(channels: int) -> None:
    """Decoded from sRGB, bit for bit as `from_trimesh` does; the opacity is not."""
    held = trimesh.Trimesh(BALL.vertices, BALL.faces, vertex_colors=CODES, process=False)
    (read,) = wf.from_trimesh(held, smooth=False).shapes
    made = mesh(colors=CODES[:, :channels])
    assert np.array_equal(made.colors, read.colors)
    assert picture(made) == picture(wf.Mesh(held.vertices, held.faces, colors=held.visual.vertex_colors))
    assert mesh(colors=CODES // 2).colors[0, 3] == 127 / 255


def test_two_bytes_are_decoded_alike() -> None:
    assert mesh(colors=CODES.astype(np.uint16) * 257).colors == pytest.approx(
        mesh(colors=CODES).colors, abs=1e-7
    )


def test_other_integers_are_numbers() -> None:
    """0 and 1 are colors; 255 is out of range, and the message says what is due."""
    assert mesh(colors=np.ones((len(BALL.vertices), 3), int)).colors.max() == 1
    with pytest.raises(wf.SceneError, match=r"colors\[0\]\[\d\] is .*; it must be in \[0, 1\], or uint8"):
        mesh(colors=CODES.astype(int))
