"""A scene that is changed while a page shows it."""

import time

import numpy as np
import pytest
from inside import scene_state
from inside import viewer as module

import wavefront as wf

pytest.importorskip("viser")
SETTINGS = {
    "spp": 2,
    "size": (32, 32),
    "open_browser": False,
    "block": False,
    "workers": 1,
    "executor": "threads",
}


def shown(viewer: wf.Viewer) -> bytes:
    return viewer.wait_for_picture(20).rgb.tobytes()


def due(scene: wf.Scene, viewer: wf.Viewer) -> bytes:
    return wf.render(scene, 2, camera=viewer.camera, progress=False).rgb.tobytes()


def test_a_changed_material_is_shown_when_asked_for(monkeypatch) -> None:
    monkeypatch.setattr(module, "WATCH", 1000)
    scene = wf.Scene(wf.Sphere((0, 0, 0), 1, material="red"))
    with wf.view(scene, **SETTINGS) as viewer:
        before = shown(viewer)
        scene.shapes[0].material = "blue"
        viewer.update()
        after = shown(viewer)
        assert before != after == due(scene, viewer)
        scene.shapes = []
        with pytest.raises(wf.SceneError, match="no shapes"):
            viewer.update()
        assert viewer.image.rgb.tobytes() == after
    with pytest.raises(wf.RenderError, match="closed"):
        viewer.update()


def test_changed_objects_are_shown_by_themselves(monkeypatch) -> None:
    monkeypatch.setattr(module, "WATCH", 0.05)
    scene = wf.Scene(
        [wf.Sphere((0, 0, 0), 1, material="red"), wf.Rectangle((-1, -1, -1), (2, 0, 0), (0, 2, 0))]
    )
    with wf.view(scene, **SETTINGS) as viewer:
        before = shown(viewer)
        scene.shapes[0].material.bsdf.reflectance = (0, 1, 0)
        end = time.monotonic() + 20
        while viewer.image.rgb.tobytes() != due(scene, viewer) and time.monotonic() < end:
            time.sleep(0.05)
        assert before != shown(viewer) == due(scene, viewer)


CHANGES = {
    "radius": lambda scene: setattr(scene.shapes[0], "radius", 2),
    "material": lambda scene: setattr(scene.shapes[0], "material", "gold"),
    "parameter": lambda scene: setattr(scene.shapes[0].material.bsdf, "roughness", 0.1),
    "emission": lambda scene: setattr(scene.shapes[0].material, "emission", 2),
    "vertices": lambda scene: setattr(scene.shapes[1], "vertices", scene.shapes[1].vertices * 2),
    "light": lambda scene: setattr(scene.lights[0], "intensity", 3),
    "one light more": lambda scene: scene.add(wf.Environment(1)),
    "one shape less": lambda scene: scene.shapes.pop(),
    "medium": lambda scene: setattr(scene, "medium", wf.Medium(0.1)),
}


@pytest.mark.parametrize("change", CHANGES)
def test_what_a_scene_is_made_of(change: str) -> None:
    """A render changes nothing of it; an assignment does."""
    ball = wf.Sphere((0, 0, 0), 1, material=wf.Material(wf.Principled(0.5), emission=1))
    mesh = wf.Mesh(np.random.default_rng(1).random((60, 3)), np.arange(60).reshape(20, 3))
    scene = wf.Scene([ball, mesh], wf.PointLight((0, 0, 5), 1))
    wf.render(scene, 1, size=8, progress=False)
    before = scene_state(scene)
    wf.render(scene, 1, size=8, progress=False)
    assert scene_state(scene) == before
    CHANGES[change](scene)
    assert scene_state(scene) != before


def test_the_token_of_the_address_is_kept() -> None:
    """Of later viewers, for pages that are open."""
    ball = wf.Sphere((0, 0, 0), 1)
    urls = []
    for _ in range(2):
        with wf.view(ball, **SETTINGS) as viewer:
            urls.append(viewer.url.partition("token=")[2])
    assert urls[0] == urls[1] != ""
