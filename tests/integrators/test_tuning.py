"""What is chosen where `branches`, `reuse` or `guide` is "auto", and that choices stay the same."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from inside import (
    BLOCKS,
    SAMPLES,
    RayCounter,
    Run,
    Settings,
    SobolSampler,
    choice,
    compile_scene,
    generate,
    li_full,
    li_twins,
    pixels_of_tiles,
    place_in_tiles,
    tuning,
    tuning_run,
)
from inside import INTEGRATORS_OUTLIERS as OUTLIERS
from scenes import cornell_box, everything, room

import wavefront as wf

SIZE = (192, 192)  # the smallest pictures that get a tuning run
SMALL = (56, 56)  # those with `small_pictures`


@pytest.fixture
def small_pictures(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let small pictures have a tuning run, too, of as many tiles as there are."""
    monkeypatch.setattr("wavefront.drive.choice.LEAST_PIXELS", SMALL[0] * SMALL[1])
    monkeypatch.setattr("wavefront.sampling.tiles.PIXELS_PER_TRIED", 100)


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


def test_branches_where_the_noise_is_in_light() -> None:
    """In direct light of many lights, or in indirect light; not where edges have it. The picture is that of
    the number that was chosen."""
    assert chosen(many_lights((320, 320)), reuse=False).branches > 1
    ball = wf.Sphere((0, 0, 0), 1, material=wf.Diffuse(0.3))
    sun = wf.DirectionalLight((1, -1, -1), 3)
    camera = wf.Camera.look_at((0, 0, 4), (0, 0, 0), fov=40, size=(320, 320))
    assert chosen(wf.Scene([ball], [sun], camera), reuse=False).branches == 1
    image = render(open_scene(SIZE), 1)
    found = image.metadata["branches"]
    assert found > 1
    assert image.metadata["reuse"] is False
    assert np.array_equal(image.rgb, render(open_scene(SIZE), 1, branches=found).rgb)


def test_paths_are_shared_where_that_pays() -> None:
    """In a matte room, by default; the picture is that of `reuse=True`."""
    image = render(cornell_box(SIZE), 1)
    assert (image.metadata["branches"], image.metadata["reuse"]) == (1, True)
    assert np.array_equal(image.rgb, render(cornell_box(SIZE), 1, reuse=True).rgb)


@pytest.mark.parametrize("size", [SIZE, (256, 256)])
@pytest.mark.slow
def test_no_seed_keeps_a_matte_room_from_sharing(size: tuple[int, int]) -> None:
    """The noise of a short trial may not decide: plain paths have ten times the variance."""
    assert [seed for seed in range(12) if not chosen(cornell_box(size), seed=seed).reuse] == []


def glossy(size: tuple[int, int]) -> wf.Scene:
    """The Cornell box with a ball of rough gold in it."""
    box = cornell_box(size)
    ball = wf.Sphere((0, -0.5, 0), 0.5, material=wf.Conductor.named("gold", roughness=0.3))
    return wf.Scene([*box.shapes[:6], ball], camera=box.camera)


@pytest.mark.parametrize(
    "gloss",
    [
        wf.Mix(wf.Diffuse((0.3, 0.25, 0.2)), wf.Conductor.named("gold", roughness=0.25), 0.15),
        wf.Principled((0.5, 0.4, 0.3), roughness=0.3),
    ],
    ids=["mix", "principled"],
)
@pytest.mark.first(1)
def test_paths_are_shared_beside_gloss_where_light_is_hard_to_find(gloss: wf.Bsdf) -> None:
    """Neither a glossy floor nor a small ball of glass keeps the matte walls of a room from it."""
    scene = lamp_at_the_ceiling((256, 256))
    scene.shapes[0].material = wf.Material(gloss)
    assert chosen(scene).reuse
    scene.shapes.append(wf.Sphere((0.4, -0.8, 0.3), 0.1, material=wf.Dielectric(1.5)))
    assert chosen(scene).reuse


@pytest.mark.parametrize("build", [glossy, room, everything, open_scene])
def test_paths_are_not_shared_where_glass_and_gloss_make_the_noise(
    build: Callable[[tuple[int, int]], wf.Scene],
) -> None:
    """Nor in the open."""
    assert not chosen(build(SIZE)).reuse


def test_a_plastic_ball_is_no_gold_ball() -> None:
    """Most of its light goes to all sides alike."""
    scene = glossy(SIZE)
    scene.shapes[-1].material = wf.Material(wf.Principled((0.7, 0.5, 0.4), roughness=0.3))
    assert chosen(scene).reuse


def chosen(scene: wf.Scene, **settings: Any) -> choice.Choice:
    """Return what is chosen for a scene."""
    compiled = compile_scene(scene, scene.accelerators.maker("numpy"), mis=True)
    assert scene.camera is not None
    options, view = Settings(**settings), compiled.view(scene.camera)
    table = choice.learn_guide(options, compiled, view) if options.values["guide"] else None
    return choice.choose(options, compiled, view, SobolSampler, table)


def pretend(
    monkeypatch: pytest.MonkeyPatch, variance: float = 0.1, bright: float = 0.1, **found: Any
) -> list[bool]:
    """Have tuning runs find a variance and more; return whether each was guided.

    `bright` is the part of the variance that few pixels have; parts of others are of all of it.
    """
    tried, run = [], tuning.tuning_run

    def pretended(*args: Any, table: Any = None, **options: Any) -> Run:
        tried.append(table is not None)
        values, few = np.full(100, variance), int(OUTLIERS * 100)
        values[:few] = bright / (1 - bright) * values[few:].sum() / few
        parts = {name: found.get(name, part) * values for name, part in (("common", 0.05), ("own", 0.0))}
        real = run(*args, **options)
        met = np.zeros_like(real.met)
        met[0] = found.get("met", 1.0) * 1000
        narrow, onward = int(found.get("narrow", 0) * 1000), found.get("onward", 0.75)
        return replace(
            real,
            variance=values,
            **parts,
            met=met,
            narrow=narrow,
            paths=1000,
            first=1 - onward,
            onward=onward,
        )

    monkeypatch.setattr(choice, "tuning_run", pretended)
    return tried


def with_glass(size: tuple[int, int]) -> wf.Scene:
    """The Cornell box with a grain of glass that hardly a path meets."""
    box = cornell_box(size)
    return wf.Scene(
        [*box.shapes, wf.Sphere((0, 0.9, 0), 1e-4, material=wf.Dielectric(1.5))], camera=box.camera
    )


@pytest.mark.parametrize(
    ("found", "reuse"),
    [
        ({}, True),
        ({"met": 0.4}, True),
        ({"met": 0.399}, False),
        ({"own": 0.249}, True),
        ({"own": 0.251}, False),
        ({"variance": 0.71, "own": 0.251}, False),
        ({"narrow": 0.02, "bright": 0.9}, True),
        ({"narrow": 0.021, "bright": 0.49}, True),
        ({"narrow": 0.021, "bright": 0.51}, False),
        ({"narrow": 0.021, "bright": 0.51, "variance": 0.71}, False),
    ],
    ids=str,
)
def test_paths_are_shared_if_they_can_be_and_make_the_noise(
    found: dict[str, float], reuse: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each condition decides, from its limit on."""
    pretend(monkeypatch, **found)
    assert chosen(cornell_box(SIZE)).reuse is reuse


@pytest.mark.parametrize(("variance", "reuse"), [(0.69, False), (0.71, True)])
def test_glass_keeps_paths_alone_unless_light_is_rare(
    variance: float, reuse: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also glass that the tuning run does not meet: what it lights may be most of the noise."""
    pretend(monkeypatch, variance)
    assert chosen(with_glass(SIZE)).reuse is reuse


@pytest.mark.parametrize(
    "settings",
    [
        {"reuse": False},
        {"clamp": 2},
        {"caustics": True},
        {"branches": 1},
        {"branches": 3},
        {"max_bounces": 1},
        {"integrator": "direct_mis"},
    ],
    ids=str,
)
@pytest.mark.first(1)
def test_paths_are_not_shared_with_some_settings(
    settings: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whatever a tuning run would say."""
    pretend(monkeypatch)
    for without in ({}, {"denoise": True}, {"noise": 0.1}, {"aovs": "light_groups"}):
        assert chosen(cornell_box(SIZE), **without).reuse
    assert not chosen(cornell_box(SIZE), **settings).reuse


@pytest.mark.parametrize(
    ("found", "branches"),
    [
        ({"common": 0.05, "onward": 0.5}, 4),
        ({"common": -0.1, "onward": 0.5}, 4),
        ({"common": 0.17, "onward": 0.5}, 4),
        ({"common": 0.18, "onward": 0.5}, 1),
        ({"common": 0, "onward": 0.93}, 4),
        ({"common": 0, "onward": 0.94}, 1),
        ({"common": 1, "onward": 0.5}, 1),
        ({"variance": 0.0}, 1),
        ({"bright": 0.59}, 4),
        ({"bright": 0.61}, 1),
        ({"variance": 0.69}, 4),
        ({"variance": 0.71}, 1),
    ],
    ids=str,
)
def test_branches_must_gain_enough_beyond_bright_spots(
    found: dict[str, float], branches: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Variance times rays decides, by 5 %; where few pixels have most of the noise there are none."""
    pretend(monkeypatch, **found)
    assert chosen(open_scene(SIZE), reuse=False).branches == branches


def test_fireflies_do_not_keep_branches_away() -> None:
    """Few pixels that are noisy count alike for any number: the means of one branch may miss all of them."""
    random = np.random.default_rng(0)
    variance = random.exponential(1, 576) + 100 * (random.random(576) < 0.015)
    run = run_of(variance, common=0.01 * variance)
    costs = [run.cost(branches, run) for branches in (1, 2, 4)]
    assert costs == pytest.approx([1, 0.505 * 3 / 2, 0.2575 * 5 / 2])
    assert run.share_of_outliers() > 0.5
    assert run_of(np.ones(576)).share_of_outliers() == pytest.approx(11 / 576)


def run_of(variance: Any, **parts: Any) -> Run:
    """Return a run that has found a variance (n,)."""
    some = {"common": variance, "own": variance, "first": 1.0, "onward": 1.0, **parts}
    return Run(scale=np.ones((3, 1)), variance=variance, met=np.zeros(1, np.intp), narrow=0, paths=1, **some)


def test_a_guide_goes_with_what_pays(monkeypatch: pytest.MonkeyPatch) -> None:
    """The run is of guided paths then; without a guide there is a hint where light is hard to find."""
    tried = pretend(monkeypatch, 2.0)
    monkeypatch.setattr(choice, "train", lambda *args: object())
    guided, plain = (chosen(cornell_box(SIZE), guide=guide) for guide in (True, False))
    assert (guided.reuse, guided.guided, guided.hint) == (True, True, None)
    assert (plain.reuse, plain.guided, plain.hint) == (True, False, choice.GUIDE_HINT)
    assert tried == [True, False]


@pytest.mark.parametrize(("dim", "hint"), [(False, None), (True, choice.GUIDE_HINT)])
def test_metadata_hint_at_a_guide(dim: bool, hint: str | None) -> None:
    """Where a lamp shines away from what is seen, not in the Cornell box."""
    scene = lamp_at_the_ceiling(SIZE) if dim else cornell_box(SIZE)
    assert render(scene, 1).metadata["hint"] == hint


@pytest.mark.parametrize(
    ("scene", "settings"),
    [
        (cornell_box((191, 192)), {}),
        (cornell_box(SIZE), {"max_bounces": 1}),
        (cornell_box(SIZE), {"integrator": "naive"}),
        (cornell_box(SIZE), {"branches": 2}),
        (cornell_box(SIZE), {"reuse": True}),
        (wf.Scene([wf.Sphere((0, 0, 0), 1)], camera=cornell_box(SIZE).camera), {}),
        (
            wf.Scene(
                [wf.Sphere((0, 0, 0), 1, material=wf.Mirror())], wf.Environment(1), cornell_box(SIZE).camera
            ),
            {},
        ),
    ],
    ids=["small", "direct light", "naive", "branches", "reuse", "dark", "mirror"],
)
def test_there_is_no_tuning_run_where_it_can_bring_nothing(
    scene: wf.Scene, settings: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Small pictures, direct light, other integrators, no light, no rough surface."""
    monkeypatch.setattr(choice, "tuning_run", lambda *run, **options: pytest.fail("a tuning run"))
    found = chosen(scene, **settings)
    assert (found.branches, found.reuse) == (settings.get("branches", 1), settings.get("reuse", False))


def test_a_window_is_a_part_of_the_same_picture() -> None:
    """The whole picture decides, so its bits stay."""
    scene = cornell_box((240, 160))
    window = scene.camera.cropped((28, 0, 56, 28))
    assert chosen(scene).reuse
    assert chosen(wf.Scene(scene.shapes, camera=window)).reuse
    whole, part = (render(scene, 1, camera=camera) for camera in (scene.camera, window))
    assert np.array_equal(part.rgb, whole.rgb[:28, 28:56])


def test_decisions_do_not_depend_on_workers_waves_samples_or_time(small_pictures: None) -> None:
    """Counted rays decide."""
    whole = render(cornell_box(SMALL), 2)
    same = [
        {"workers": 1, "wave_size": 5000, "seconds": 600},
        {"workers": 2, "executor": "processes"},
    ]
    for settings in same:
        image = render(cornell_box(SMALL), 2, **settings)
        assert image.metadata["reuse"] is True
        assert np.array_equal(image.rgb, whole.rgb)
    parts = [
        wf.render(cornell_box(SMALL), samples=part, workers=1, executor="threads")
        for part in (range(1), range(1, 2))
    ]
    assert np.array_equal(wf.Image.merge(*parts).rgb, whole.rgb)


def test_tiles_of_a_tuning_run_are_those_of_the_picture() -> None:
    """Each of them, once; so pixels share brightness as they share paths in the picture."""
    x, y = pixels_of_tiles(np.arange(3 * 2 * 49), 3)
    tile, member = place_in_tiles((y * 100 + x).ravel().astype(np.uint32), 100)
    assert np.unique(y * 100 + x).size == 3 * 2 * 28 * 28
    assert (x.max(), y.max()) == (83, 55)
    assert (tile.reshape(x.shape) == tile.reshape(x.shape)[:, :1]).all()
    assert np.unique(tile).size == len(x)
    assert (member.reshape(x.shape) == np.arange(16)).all()


def test_the_variance_is_that_between_blocks(monkeypatch: pytest.MonkeyPatch) -> None:
    """Relative to the squared mean, but for the noisiest pixels; what twins share is their covariance."""
    random = np.random.default_rng(0)

    def noise(scene: Any, paths: Any, *args: Any) -> Any:
        n = len(paths)
        both = random.normal(size=(3, n)) * 0.6
        found = 3 + 0.1 * np.concatenate([both + random.normal(size=(3, n)) * 0.8 for _ in range(2)], 1)
        found[:, 0] += 1000
        return found.astype(np.float32)

    monkeypatch.setattr(tuning, "li_twins", noise)
    scene = cornell_box((392, 392))
    compiled = compile_scene(scene, scene.accelerators.maker("numpy"), mis=True)
    run = tuning_run(compiled, compiled.view(scene.camera), SobolSampler(1, 392), 5)
    assert run.variance.size == 16 * tuning.MOST_TILES
    due = 0.01 / SAMPLES / (9 + tuning.FLOOR * 9)
    assert run.mean_variance() == pytest.approx(due, rel=0.1)
    assert run.variance.max() > 0.3
    assert run.mean_variance(4) == pytest.approx((0.36 + 0.64 / 4) * due, rel=0.1)
    other = replace(run, variance=4 * run.variance)
    assert other.cost(1, run) == pytest.approx(4)
    assert run.share_of_own() == 1  # no path has a second point


def within_glass() -> wf.Scene:
    """A camera in dark glass: what its first rays lose is not lost twice."""
    dark = wf.Material(wf.Dielectric(1.1), interior=wf.Medium(absorption=(1, 0.5, 0.2)))
    glass = wf.Sphere((0, 0, 0), 3, material=dark)
    camera = wf.Camera.look_at((0, 0, 2), (0, 0, 0), fov=60, size=(28, 28))
    return wf.Scene([glass, wf.Sphere((0, 0, 0), 1, emission=0.5)], wf.Environment(1), camera)


@pytest.mark.parametrize(
    "scene",
    [cornell_box((28, 28)), within_glass(), everything((28, 28))],
    ids=["box", "within glass", "everything"],
)
@pytest.mark.first(1)
def test_twins_share_first_surfaces_alone(scene: wf.Scene) -> None:
    """The first ones are the paths of a picture, and the others have its mean; noise of edges they share."""
    assert scene.camera is not None
    compiled = compile_scene(scene, scene.accelerators.maker("numpy"), mis=True)
    camera, sampler = compiled.view(scene.camera), SobolSampler(1, 28)
    sample = np.repeat(np.arange(64, dtype=np.uint32), 28 * 28)
    pixel = np.tile(np.arange(28 * 28, dtype=np.uint32), 64)
    one, other = np.split(
        li_twins(compiled, generate(compiled, camera, sampler, pixel, sample), sampler, 3), 2, 1
    )
    alone = li_full(compiled, generate(compiled, camera, sampler, pixel, sample), sampler, 3)
    assert np.array_equal(one, alone)
    assert not np.array_equal(one, other)
    difference = (one - other).astype(float).sum(0).reshape(64, -1).mean(1)
    assert abs(difference.mean()) < 4 * difference.std(ddof=1) / 8
    emitted = li_twins(compiled, generate(compiled, camera, sampler, pixel, sample), sampler, 0)
    assert emitted.any()
    assert np.array_equal(*np.split(emitted, 2, 1))


def test_a_run_tells_what_second_points_are() -> None:
    """Of both twins together; costs are the rays of one path."""
    scene = glossy((28, 28))
    assert scene.camera is not None
    compiled = compile_scene(scene, scene.accelerators.maker("numpy"), mis=True)
    camera, sampler = compiled.view(scene.camera), SobolSampler(1, 28)
    run = tuning_run(compiled, camera, sampler, 3, tiles=49)
    counter, n = RayCounter(compiled.accelerator), 28 * 28 * BLOCKS * SAMPLES
    sample = np.repeat(np.arange(BLOCKS * SAMPLES, dtype=np.uint32), 28 * 28)
    pixel = np.tile(np.arange(28 * 28, dtype=np.uint32), BLOCKS * SAMPLES)
    li_full(
        replace(compiled, accelerator=counter),
        generate(compiled, camera, sampler, pixel, sample),
        sampler,
        3,
    )
    assert (run.first, run.paths) == (n, 2 * n)
    assert run.first + run.onward == pytest.approx(
        counter.nearest + tuning.SHADOW_RAY * counter.shadow, rel=0.02
    )
    gold = compiled.materials.group_of == [type(b).__name__ for b in compiled.materials.groups].index(
        "Conductor"
    )
    assert 0.6 < run.met.sum() / run.paths < 0.8
    assert 0.7 * run.met[gold].sum() < run.narrow <= run.met[gold].sum()
    direct = tuning_run(compiled, camera, sampler, 1, tiles=49, like=run)
    assert np.array_equal(direct.variance, run.own)
    assert 0 < run.share_of_own() < choice.OWN_LIGHT
    assert np.array_equal(direct.scale, run.scale)


@pytest.mark.slow
def test_a_guide_is_used_where_it_pays() -> None:
    """Under an open sky it is not; the picture is that without or with it."""
    for scene, pays in ((open_scene(), False), (lamp_at_the_ceiling(), True)):
        image = render(scene, guide="auto")
        assert image.metadata["guided"] is pays
        assert image.metadata["guide"] == "auto"
        same = render(scene, guide=pays, branches=image.metadata["branches"])
        assert np.array_equal(image.rgb, same.rgb)


def test_renders_go_on_with_the_same_decision(tmp_path: Path, small_pictures: None) -> None:
    """A checkpoint knows what was decided, and goes on where the same is asked for."""
    path = tmp_path / "box.wfck"
    render(cornell_box(SMALL), 1, checkpoint=path)
    image = render(cornell_box(SMALL), 2, checkpoint=path)
    assert np.array_equal(image.rgb, render(cornell_box(SMALL), 2).rgb)
    with pytest.raises(wf.SceneError, match="reuse was True and is False"):
        render(cornell_box(SMALL), 2, reuse=False, checkpoint=path)
    assert np.array_equal(render(cornell_box(SMALL), 2, reuse=True, checkpoint=path).rgb, image.rgb)


def test_each_camera_has_a_tuning_run_of_its_own() -> None:
    """A session decides anew; its workers go on, as jobs say how their paths do."""
    box = wf.Scene(cornell_box(SIZE).shapes, wf.Environment(0.01), cornell_box(SIZE).camera)
    away_from_it = wf.Camera.look_at((0, 0, 30), (0, 0, 300), fov=40, size=SIZE)
    with wf.Session(box, 1, workers=1, executor="threads", lighting=None) as session:
        first = session.run()
        pool = session._pool
        session.set_camera(away_from_it)
        away = session.run()
        session.set_camera(None)
        assert np.array_equal(session.run().rgb, first.rgb)
        session.set_camera(box.camera)
        assert session._pool is pool
    assert (first.metadata["reuse"], away.metadata["reuse"]) == (True, False)
    assert np.array_equal(away.rgb, render(box, 1, camera=away_from_it).rgb)


def test_other_integrators_have_nothing_to_decide() -> None:
    """ "auto" is then one branch and no guide."""
    for integrator in ("naive", "direct_simple", "direct_mis"):
        image = render(cornell_box((8, 8)), integrator=integrator, branches="auto", guide="auto")
        assert (image.metadata["branches"], image.metadata["guided"]) == (1, False)
        assert np.array_equal(image.rgb, render(cornell_box((8, 8)), integrator=integrator).rgb)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"branches": "many"}, r"branches is 'many'; it must be a whole number from 1 to 64, or 'auto'"),
        ({"branches": 0}, r"branches is 0; it must be a whole number from 1 to 64, or 'auto'"),
        ({"guide": "yes"}, r"guide is 'yes'; it must be True or False, or 'auto'"),
        ({"reuse": "yes"}, r"reuse is 'yes'; it must be True or False, or 'auto'"),
    ],
)
def test_other_values_are_refused(settings: dict[str, Any], message: str) -> None:
    """Before any work."""
    with pytest.raises(wf.SceneError, match=message):
        wf.render("no such file", **settings)
