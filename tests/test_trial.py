"""`branches="auto"` and `guide="auto"`: what the trial decides, and that decisions stay the same."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scenes import cornell_box

import wavefront as wf
from wavefront.trial import Trial


def many_lights(size: tuple[int, int] = (32, 32)) -> wf.Scene:
    """The Cornell box with a thousand small lights in it: direct light is noisy."""
    scene = cornell_box(size)
    places = np.random.default_rng(0).uniform(-0.9, 0.9, (1000, 3))
    scene.lights = [wf.PointLights(places, 0.02)]
    return scene


def open_scene(size: tuple[int, int] = (32, 32)) -> wf.Scene:
    """A ball on a floor under a sky: nothing to guide."""
    return wf.Scene(
        [wf.Sphere((0, 0, 0), 1), wf.Rectangle((-4, -1, -4), (0, 0, 8), (8, 0, 0))],
        wf.Environment(1),
        wf.Camera.look_at((0, 1, 5), (0, 0, 0), fov=40, size=size),
    )


def lamp_at_the_ceiling(size: tuple[int, int] = (32, 32)) -> wf.Scene:
    """A room lit by a lamp that shines onto its ceiling."""
    white, wall = wf.Diffuse(0.7), wf.Rectangle
    return wf.Scene(
        [
            wall((-1, -1, -1), (0, 0, 2), (2, 0, 0), material=white),
            wall((-1, 1, -1), (2, 0, 0), (0, 0, 2), material=white),
            wall((-1, -1, -1), (2, 0, 0), (0, 2, 0), material=white),
            wall((-1, -1, -1), (0, 2, 0), (0, 0, 2), material=white),
            wall((1, -1, -1), (0, 0, 2), (0, 2, 0), material=white),
            wall((-0.2, 0.8, -0.2), (0, 0, 0.4), (0.4, 0, 0), emission=20),
            wall((-0.25, 0.79, -0.25), (0.5, 0, 0), (0, 0, 0.5), material=wf.Diffuse(0.0)),
        ],
        camera=wf.Camera.look_at((0, 0, 3.5), (0, 0, 0), fov=38, size=size),
    )


def render(scene: wf.Scene, spp: int = 2, **settings: Any) -> wf.Image:
    """Render a scene with one thread."""
    return wf.render(scene, spp, **{"workers": 1, "executor": "threads", **settings})


@pytest.mark.parametrize(("scene", "some"), [(cornell_box((32, 32)), True), (many_lights(), False)])
def test_branches_where_the_noise_is_in_indirect_light(scene: wf.Scene, some: bool) -> None:
    """The picture is that of the number that was chosen."""
    image = render(scene, branches="auto")
    assert (image.metadata["branches"] > 1) == some
    assert np.array_equal(image.rgb, render(scene, branches=image.metadata["branches"]).rgb)


def test_decisions_do_not_depend_on_workers_waves_or_time() -> None:
    """Counted rays decide."""
    images = [
        wf.render(cornell_box((16, 16)), 3, branches="auto", **settings)
        for settings in (
            {"workers": 1, "executor": "threads"},
            {"workers": 2, "executor": "threads", "wave_size": 100},
            {"workers": 1, "seconds": 60, "executor": "threads"},
        )
    ]
    for image in images[1:]:
        assert image.metadata["branches"] == images[0].metadata["branches"]
        assert np.array_equal(image.rgb, images[0].rgb)


def test_a_guide_is_used_where_it_pays() -> None:
    """Under an open sky it is not; the picture is that without or with it."""
    for scene, pays in ((open_scene(), False), (lamp_at_the_ceiling(), True)):
        image = render(scene, guide="auto")
        assert image.metadata["guided"] is pays
        assert image.metadata["guide"] == "auto"
        assert np.array_equal(image.rgb, render(scene, guide=pays).rgb)


def test_renders_go_on_with_the_same_decision(tmp_path: Path) -> None:
    """And a checkpoint knows that they were decided."""
    path = tmp_path / "box.wfck"
    render(cornell_box((16, 16)), 2, branches="auto", checkpoint=path)
    image = render(cornell_box((16, 16)), 5, branches="auto", checkpoint=path)
    assert np.array_equal(image.rgb, render(cornell_box((16, 16)), 5, branches="auto").rgb)
    with pytest.raises(wf.SceneError, match="branches was 'auto' and is 2"):
        render(cornell_box((16, 16)), 5, branches=2, checkpoint=path)


def test_each_camera_has_a_trial_of_its_own() -> None:
    """A session decides anew."""
    box = cornell_box((15, 15))
    away_from_it = wf.Camera.look_at((0, 0, 30), (0, 0, 300), fov=40, size=(15, 15))
    with wf.Session(box, 2, branches="auto", workers=1, executor="threads", lighting=None) as session:
        first = session.run()
        session.set_camera(away_from_it)
        away = session.run()
        session.set_camera(None)
        assert np.array_equal(session.run().rgb, first.rgb)
    alone = render(box, 2, branches="auto", camera=away_from_it)
    assert first.metadata["branches"] > away.metadata["branches"] == alone.metadata["branches"]
    assert np.array_equal(away.rgb, alone.rgb)


def test_other_integrators_have_nothing_to_decide() -> None:
    """ "auto" is then one branch and no guide."""
    for integrator in ("naive", "direct_simple", "direct_mis"):
        image = render(cornell_box((8, 8)), integrator=integrator, branches="auto", guide="auto")
        assert (image.metadata["branches"], image.metadata["guided"]) == (1, False)
        assert np.array_equal(image.rgb, render(cornell_box((8, 8)), integrator=integrator).rgb)


def test_the_cost_is_variance_times_rays() -> None:
    """The best number is near the one of the splitting formula, √(V2/V1 · c1/c2)."""
    trial = Trial(shared=1.0, separate=9.0, before=100, after=100.0, ray_cost=1.0)
    assert trial.cost(1) == 10 * 200
    assert trial.cost(3) == 4 * 400
    assert trial.best_ways() == 3  # √9
    assert Trial(1.0, 0.9, 100, 100.0, 1.0).best_ways() == 1
    assert Trial(1.0, 1.2, 110, 100.0, 1.0).best_ways() == 1  # the gain is too small
    assert Trial(0.0, 0.0, 100, 0.0, 1.0).best_ways() == 1


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"branches": "many"}, r"branches is 'many'; it must be a whole number from 1 to 64, or 'auto'"),
        ({"branches": 0}, r"branches is 0; it must be a whole number from 1 to 64, or 'auto'"),
        ({"guide": "yes"}, r"guide is 'yes'; it must be True or False, or 'auto'"),
    ],
)
def test_other_values_are_refused(settings: dict[str, Any], message: str) -> None:
    """Before any work."""
    with pytest.raises(wf.SceneError, match=message):
        wf.render("no such file", **settings)
