"""A file whose own light leaves it black is lit by a studio, and a picture that is mostly black is told."""

from pathlib import Path

import numpy as np
import pytest
from significance import render

import wavefront as wf

SIZE = (24, 24)
MTL = "newmtl shell\nKd .5 .5 .5\nnewmtl lamp\nKd 0 0 0\nKe {0} {0} {0}\n"


def helmet(folder: Path, radiance: float, lamp: float = 0.02) -> str:
    """A large box, and before it a small quad that emits."""
    box = wf.Box((0, 0, 0), 1)
    lines = ["mtllib a.mtl", *(f"v {x} {y} {z}" for x, y, z in box.vertices)]
    lines += [f"v {x * lamp} {y * lamp} 0.6" for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    lines += ["usemtl shell", *("f {} {} {}".format(*(face + 1)) for face in box.faces)]
    first = len(box.vertices) + 1
    lines += ["usemtl lamp", f"f {first} {first + 1} {first + 2} {first + 3}"]
    (folder / "a.obj").write_text("\n".join(lines) + "\n")
    (folder / "a.mtl").write_text(MTL.format(radiance))
    return str(folder / "a.obj")


def test_a_small_lamp_alone_gets_a_studio(tmp_path) -> None:
    """And that is said; the lamp is still there."""
    path = helmet(tmp_path, 1)
    with pytest.warns(UserWarning, match=r"the lights of the file give .* % of the light of a studio"):
        image = wf.render(path, 4, size=SIZE, progress=False)
    assert image.metadata["lighting"] == "studio"
    assert np.median(image.rgb) > 0.05
    scene = wf.load(path)
    assert wf.Session(scene, 1, size=(8, 8), lighting=None, progress=False).run().metadata["lighting"] is None
    assert len(scene.lights) == 0


def test_a_lamp_that_lights_is_left_alone(tmp_path) -> None:
    """With the same bits as the same scene made in Python."""
    scene = wf.load(helmet(tmp_path, 40, 0.5))
    view = {"view": "front", "ground": False, "size": SIZE}
    image = wf.render(scene, 4, progress=False, **view)
    assert image.metadata["lighting"] is None
    made = wf.Scene(scene.shapes)
    assert wf.render(made, 4, progress=False, **view).rgb.tobytes() == image.rgb.tobytes()


def test_scenes_made_in_python_are_left_alone(tmp_path, monkeypatch) -> None:
    """Those with shapes or lights of a file, too, and no trial is rendered."""
    scene = wf.load(helmet(tmp_path, 1))
    monkeypatch.setattr("wavefront.drive.prepared_scene._median", None)
    lamp = wf.PointLight((0, 0, 5), 1e-9)
    for made in (wf.Scene(scene.shapes), [wf.Box((0, 0, 0), 1), lamp], scene.add(lamp)):
        assert render(made, 1, size=(8, 8)).metadata["lighting"] is None


def test_light_at_infinity_is_left_alone(tmp_path) -> None:
    scene = wf.load(helmet(tmp_path, 1))
    scene.lights = [wf.Environment(1e-6)]
    scene.lights_of_file = [id(scene.lights[0])]
    assert render(scene, 1, size=(8, 8)).metadata["lighting"] is None


def test_scenes_of_renderers_are_left_alone(tmp_path) -> None:
    """They show no other light than theirs in Mitsuba and pbrt, either."""
    (tmp_path / "a.xml").write_text(
        '<scene version="3.0.0"><shape type="sphere"/><emitter type="point"><point name="position" x="0" '
        'y="0" z="9"/><rgb name="intensity" value="1e-6"/></emitter></scene>'
    )
    assert not wf.load(tmp_path / "a.xml").has_lights_of_file


def spot(cutoff: float) -> list:
    lamp = wf.SpotLight((0, 0, 5), 300, target=(0, 0, 0), angle=cutoff)
    return [wf.Rectangle((-1, -1, 0), (2, 0, 0), (0, 2, 0)), lamp]


def test_a_picture_that_is_mostly_black_is_told() -> None:
    """By the median of what the camera sees, whatever is bright in it."""
    camera = wf.Camera.look_at((0, 0, 6), (0, 0, 0), fov=30, size=(32, 32))
    with pytest.warns(UserWarning, match="almost black: so is more than half of what the camera sees"):
        image = wf.render(spot(4), 16, camera=camera, progress=False)
    assert image.rgb.max() > 1
    wf.render(spot(30), 16, camera=camera, progress=False)


def test_black_around_a_lit_shape_is_not_told() -> None:
    camera = wf.Camera.look_at((0, 0, 20), (0, 0, 0), fov=30, size=(32, 32))
    image = wf.render(spot(60), 16, camera=camera, progress=False)
    assert np.median(image.rgb) == 0
