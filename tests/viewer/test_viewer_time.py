"""A scene that moves, in the viewer: its time is set, plays and is held."""

from __future__ import annotations

import time
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import wavefront as wf

pytest.importorskip("viser")
SETTINGS: Any = {
    "spp": 2,
    "size": (32, 32),
    "open_browser": False,
    "block": False,
    "workers": 1,
    "executor": "threads",
}


def scene() -> wf.Scene:
    places = np.tile(np.eye(4), (2, 1, 1))
    places[1, 0, 3] = 2
    return wf.Scene(
        [wf.Sphere((0, 0, 0), 1).transformed(wf.Keyframes([1, 1.5], places)), wf.Box((0, -2, 0), 1)]
    )


def due(viewer: wf.Viewer, at: float) -> bytes:
    return wf.render(scene().at(at), 2, camera=viewer.camera, progress=False, workers=1).rgb.tobytes()


def shown(viewer: wf.Viewer) -> bytes:
    return viewer.wait_for_picture(20).rgb.tobytes()


def waited(condition: Any) -> bool:
    end = time.monotonic() + 20
    while not condition() and time.monotonic() < end:
        time.sleep(0.02)
    return bool(condition())


def test_the_time_is_set() -> None:
    with wf.view(scene(), **SETTINGS) as viewer:
        assert viewer.time == 1
        assert shown(viewer) == due(viewer, 1)
        viewer.seek(1.25)
        assert shown(viewer) == due(viewer, 1.25)
        assert viewer.time == 1.25
        with pytest.raises(wf.SceneError, match="time is nan"):
            viewer.seek(np.nan)


def test_the_time_runs_on_and_is_held() -> None:
    with wf.view(scene(), **SETTINGS) as viewer:
        shown(viewer)
        viewer.play()
        seen = set()
        assert waited(lambda: seen.add(viewer.time) or len(seen) > 4)
        viewer.pause()
        held = viewer.time
        assert held is not None
        assert 1 <= held < 1.5
        assert shown(viewer) == due(viewer, held)
        assert viewer.time == held
        viewer.play()  # and it ends with the viewer


def test_the_page_plays_pauses_and_scrubs() -> None:
    with wf.view(scene(), **SETTINGS) as viewer:
        shown(viewer)
        page: Any = viewer._page
        client = object()

        def say(act: Any, value: Any) -> None:
            act(page._watch, SimpleNamespace(client=client, target=SimpleNamespace(value=value)))

        say(page._scrub, 1.25)
        assert waited(lambda: viewer.time == 1.25)
        assert waited(lambda: shown(viewer) == due(viewer, 1.25))
        say(page._play, True)
        assert waited(lambda: viewer.time != 1.25)
        say(page._play, False)
        assert waited(lambda: not viewer._moving().playing)
        with pytest.raises(wf.SceneError, match="time is 9"):
            say(page._scrub, 9)


def test_a_still_scene_has_no_time() -> None:
    with wf.view(wf.Box((0, 0, 0), 1), **SETTINGS) as viewer:
        assert viewer.time is None
        for act in (viewer.play, viewer.pause, lambda: viewer.seek(1)):
            with pytest.raises(wf.SceneError, match="nothing moves in the scene of the viewer"):
                act()
