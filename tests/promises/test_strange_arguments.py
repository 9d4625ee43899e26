"""Arguments that are almost right: each is a SceneError that names it, never an error of NumPy or Python."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import scenes
from inside import command_line

import wavefront as wf

VERTICES = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
FACES = np.array([[0, 1, 2]])
ITSELF: list = []
ITSELF.append(ITSELF)
HALF_MASKED = np.ma.masked_array(VERTICES, mask=VERTICES == 1)


class Fails:
    """An object that NumPy asks for an array in vain."""

    def __init__(self, error: Exception) -> None:
        self.error = error

    def __array__(self, *given: object, **named: object) -> np.ndarray:
        raise self.error


NUMBERS: dict[str, Callable[[Any], object]] = {
    "vertices": lambda value: wf.Mesh(value, FACES),
    "faces": lambda value: wf.Mesh(VERTICES, value),
    "normals": lambda value: wf.Mesh(VERTICES, FACES, normals=value),
    "colors": lambda value: wf.Mesh(VERTICES, FACES, colors=value),
    "centers": lambda value: wf.Spheres(value, 1),
    "radii": lambda value: wf.Spheres(VERTICES, value),
    "reflectance": wf.Diffuse,
    "Environment": wf.Environment,
    "Texture source": wf.Texture,
    "intensity": lambda value: wf.PointLight((0, 0, 0), value),
    "Camera origin": lambda value: wf.Camera.look_at(value, (0, 0, 0)),
    "up": lambda value: wf.render(scenes.everything(), 1, up=value),
    "R": lambda value: wf.Camera.from_intrinsics(np.eye(3), value, (0, 0, 0), size=(8, 8)),
    "transforms": lambda value: wf.Spheres(VERTICES, 1).placed(value),
    "rgb": wf.Image,
    "srgb": wf.srgb,
}


@pytest.mark.parametrize("name", NUMBERS)
@pytest.mark.parametrize(
    "value",
    [
        Fails(RuntimeError("no")),
        Fails(KeyError("no")),
        ITSELF,
        VERTICES + 1j,
        (VERTICES + 1j).tolist(),
        HALF_MASKED,
        [[10**400]],
    ],
    ids=["RuntimeError", "KeyError", "itself", "complex", "complex list", "masked", "huge"],
)
def test_arrays_that_are_none(name: str, value: object) -> None:
    """Complex numbers lost their imaginary part, and masked ones were taken as they are behind the mask."""
    with pytest.raises(wf.SceneError, match=name):
        NUMBERS[name](value)


def test_masks_of_nothing_are_no_matter() -> None:
    mesh = wf.Mesh(np.ma.masked_array(VERTICES), FACES)
    assert type(mesh.vertices) is np.ndarray


@pytest.mark.parametrize(
    ("attribute", "dtype"),
    [("vertices", np.float64), ("vertices", np.float32), ("normals", np.float64), ("colors", np.float64)],
)
def test_a_mesh_has_its_own_arrays(attribute: str, dtype: type) -> None:
    """What is done to the caller's afterwards does not change it."""
    given = VERTICES.astype(dtype)
    mesh = wf.Mesh(**({"vertices": VERTICES, "faces": FACES} | {attribute: given}))
    before = getattr(mesh, attribute).copy()
    given *= 0.5
    assert np.array_equal(getattr(mesh, attribute), before)


def test_spheres_have_their_own_arrays() -> None:
    centers, radii = VERTICES.copy(), np.ones(3)
    spheres = wf.Spheres(centers, radii)
    centers *= 5
    radii *= 5
    assert spheres.bounds.tolist() == [[-1, -1, -1], [2, 2, 1]]


@pytest.mark.parametrize("subject", [ITSELF, [wf.Sphere((0, 0, 0), 1), [ITSELF]]])
def test_lists_that_contain_themselves(subject: list) -> None:
    """They would never end."""
    with pytest.raises(wf.SceneError, match="contains itself"):
        wf.render(subject, 1)


def test_a_list_may_be_there_twice() -> None:
    """It does not contain itself."""
    balls = [wf.Sphere((0, 0, 0), 1)]
    assert wf.render([balls, balls, wf.Environment(1)], 1, size=(4, 4)).spp == 1


@pytest.mark.parametrize("load", [wf.load, wf.load_mesh, wf.Image.load])
@pytest.mark.parametrize("path", [None, 5, b"scene.obj"])
def test_paths_that_are_none(load: Callable, path: object) -> None:
    with pytest.raises(wf.SceneError, match=r"path is .*; it must be text or a path"):
        load(path)


@pytest.mark.parametrize("noise", [1e300, 1e200])
def test_noise_without_a_limit(noise: float) -> None:
    """Its square is beyond float64."""
    with pytest.warns(UserWarning, match="a relative error of"):
        image = wf.render(scenes.everything(), 64, noise=noise)
    assert image.metadata["noise"] <= noise


@pytest.mark.parametrize("size", [(True, True), (8, True), (np.True_, 8)])
def test_sizes_that_are_truth_values(size: Any) -> None:
    with pytest.raises(wf.SceneError, match=r"size is .*whole numbers"):
        wf.Camera.look_at((0, 0, 3), (0, 0, 0), size=size)


@pytest.mark.parametrize("rgb", [np.zeros((0, 4, 3)), np.zeros((4, 0, 3)), [], np.zeros((4, 4))])
def test_pictures_without_pixels(rgb: Any) -> None:
    """They failed late, or not at all."""
    with pytest.raises(wf.SceneError, match="image rgb must have shape"):
        wf.Image(rgb)


def test_a_comparison_is_a_line() -> None:
    gray = np.full((32, 32, 3), 0.5, np.float32)
    text = repr(wf.compare(1.1 * gray, gray))
    assert text.startswith("<Comparison: relative MSE 0.009")
    assert "dB" in text
    assert len(text) < 100


@pytest.mark.parametrize("name", ["position", "target", "fov"])
def test_a_camera_is_made_by_look_at(name: str) -> None:
    with pytest.raises(TypeError, match=rf"'{name}'; write wf.Camera.look_at\(origin, target"):
        wf.Camera(**{name: (0, 0, 3)})  # type: ignore[arg-type, call-arg]
    with pytest.raises(TypeError, match="did you mean 'origin'"):
        wf.Camera.look_at(position=(0, 0, 3))  # type: ignore[call-arg]


@pytest.mark.parametrize("command", ["render", "turntable", "dataset"])
def test_options_have_no_abbreviations(command: str, capsys: pytest.CaptureFixture) -> None:
    with pytest.raises(SystemExit):
        command_line.main([command, "scene.obj", "-o", "out", "--sp", "4"])
    assert "unrecognized arguments: --sp 4; did you mean --spp?" in capsys.readouterr().err
