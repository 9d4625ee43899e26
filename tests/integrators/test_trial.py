"""What is chosen where `branches`, `reuse` or `guide` is "auto", and that choices stay the same."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scenes import cornell_box, everything, room

import wavefront as wf
from wavefront.accel.counter import RayCounter
from wavefront.drive import choice
from wavefront.features.compiling import compile_scene
from wavefront.integrators import li_full
from wavefront.integrators import tuning as trial
from wavefront.integrators.tuning import Run, Trial, TrialJob, TrialPart, li_twins
from wavefront.sampling.sampler import IndependentSampler, SobolSampler
from wavefront.sampling.tiles import pixels_of_tiles, place_in_tiles
from wavefront.settings import Settings
from wavefront.stages.generate import generate

SIZE = (192, 192)  # the smallest pictures that get a trial


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


@pytest.mark.parametrize(
    ("build", "by"),
    [
        (glossy, "light"),
        *((build, by) for build in (room, everything, open_scene) for by in ("light", "trial")),
    ],
)
def test_paths_are_not_shared_where_glass_and_gloss_make_the_noise(
    build: Callable[[tuple[int, int]], wf.Scene], by: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Little light that is hard to find says so, and so would the trial."""
    if by == "trial":
        monkeypatch.setattr(choice, "RARE_LIGHT", 0)
    assert not chosen(build((240, 240))).reuse


Setting = tuple[bool, bool]  # reuse, guided
PLAIN, SHARED = (False, False), (True, False)


def pretend(
    monkeypatch: pytest.MonkeyPatch,
    variance: dict[Setting, float],
    others: float = 100,
    common: float = 1,
    onward: float = 1,
) -> list[Setting]:
    """Have the runs of trials find some variances, at equal costs; return what is tried.

    `common` is the part of them that branches share, and `onward` that of the rays which they do not.
    """
    tried: list[Setting] = []
    render = Trial._render

    def found(self: Trial, *setting: Any) -> Run:
        tried.append(setting)
        values = np.full(32, variance.get(setting, others))
        run = render(self, *setting)
        return replace(run, variance=values, common=common * values, first=1 - onward, onward=onward)

    monkeypatch.setattr(Trial, "_render", found)
    return tried


def chosen(scene: wf.Scene, **settings: Any) -> choice.Choice:
    """Return what is chosen for a scene."""
    compiled = compile_scene(scene, scene.accelerators.maker("numpy"), mis=True)
    assert scene.camera is not None
    options, view = Settings(**settings), compiled.view(scene.camera)
    table = choice.learn_guide(options, compiled, view) if options.values["guide"] else None

    def run(jobs: list[TrialJob]) -> list[TrialPart]:
        return [job.trace(compiled, SobolSampler, table) for job in jobs]

    return choice.choose(options, compiled, view, table is not None, run)


@pytest.mark.parametrize(
    ("build", "radius", "variance", "tries"),
    [
        (cornell_box, 0, 0.1, True),
        (glossy, 0, 0.1, True),
        (glossy, 0.5, 0.1, False),
        (glossy, 0.1, 2, True),
        (glossy, 0.5, 2, True),
    ],
    ids=["matte", "glossy", "glass", "seldom met, and light is rare", "often met, and light is rare"],
)
def test_sharing_is_tried_where_nothing_stays_alone_or_light_is_rare(
    build: Callable[[tuple[int, int]], wf.Scene],
    radius: float,
    variance: float,
    tries: bool,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Elsewhere rare caustics may be most of the noise, and a trial may miss them."""
    tried = pretend(monkeypatch, {PLAIN: variance, SHARED: variance / 10})
    scene = build(SIZE)
    if radius:
        scene.shapes[-1] = wf.Sphere((0, -0.5, 0), radius, material=wf.Dielectric(1.5))
    assert chosen(scene).reuse is tries
    assert (SHARED in tried) is tries


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
    """Whatever a trial would say."""
    tried = pretend(monkeypatch, {SHARED: 0.1})
    for without in ({}, {"denoise": True}, {"noise": 0.1}, {"aovs": "light_groups"}):
        assert chosen(cornell_box(SIZE), **without).reuse
    tried.clear()
    assert not chosen(cornell_box(SIZE), **settings).reuse
    assert SHARED not in tried


@pytest.mark.parametrize(
    ("variance", "common", "onward", "branches"),
    [
        (1, 1, 0.5, 1),
        (1, 0, 0.5, 4),
        (1, -0.1, 0.5, 4),
        (1, 0.2, 0.5, 2),
        (1, 0.05, 0.8, 2),
        (1, 0.05, 0.95, 1),
        (1, 0, 1, 1),
        (0, 0, 0.5, 1),
    ],
)
def test_branches_must_gain_enough(
    variance: float, common: float, onward: float, branches: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Variance times rays decides; what gains less than counted rays tell the time is left."""
    pretend(monkeypatch, {PLAIN: variance}, common=common, onward=onward)
    assert chosen(open_scene(SIZE), reuse=False).branches == branches


@pytest.mark.parametrize(("shared", "reuse"), [(0.5, True), (0.6, False)])
def test_sharing_must_be_better_than_branches(
    shared: float, reuse: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where both pay the better one is taken; four branches have a cost of 0.625 here."""
    tried = pretend(monkeypatch, {PLAIN: 0.1, SHARED: 0.1 * shared}, common=0, onward=0.5)
    found = chosen(cornell_box(SIZE))
    assert (found.reuse, found.branches) == (reuse, 1 if reuse else 4)
    assert tried == [PLAIN, SHARED]


def test_fireflies_do_not_keep_branches_away() -> None:
    """Few pixels that are noisy count alike for any number: the means of one branch may miss all of them."""
    random = np.random.default_rng(0)
    variance = random.exponential(1, 576) + 100 * (random.random(576) < 0.05)
    run = Run(variance, 0.01 * variance, 1.0, 1.0, np.zeros(1, np.intp), 576)
    costs = [run.cost(run, choice.OUTLIERS, branches) for branches in (1, 2, 4)]
    assert costs == pytest.approx([1, 0.505 * 3 / 2, 0.2575 * 5 / 2])


@pytest.mark.parametrize(("build", "reuse"), [(cornell_box, True), (glossy, False)], ids=["matte", "glossy"])
@pytest.mark.parametrize(("noisy", "may_pay"), [(6, True), (4800, False)], ids=["few pixels", "all pixels"])
def test_sharing_is_taken_in_matte_rooms_where_few_pixels_would_decide(
    build: Callable[[tuple[int, int]], wf.Scene],
    reuse: bool,
    noisy: int,
    may_pay: bool,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A cost of 0.95 with a large error: others of these pixels would tell something else."""
    pretend(monkeypatch, {PLAIN: 0.1, SHARED: 0.095})
    found = Trial._render

    def noisy_in_few(self: Trial, *setting: Any) -> Run:
        run, variance = found(self, *setting), np.zeros(4800)
        variance[:: 4800 // noisy] = run.variance[0]
        variance = np.roll(variance, 500 * setting[0])
        return replace(run, variance=variance, common=variance)

    monkeypatch.setattr(Trial, "_render", noisy_in_few)
    monkeypatch.setattr(choice, "OUTLIERS_OF_SHARED", 0)
    assert chosen(build(SIZE)).reuse is (reuse and may_pay)


@pytest.mark.parametrize(
    ("variance", "shared", "reuse"), [(0.1, 0.55, True), (0.1, 0.65, False), (2, 0.65, True)]
)
def test_sharing_beside_gloss_must_gain_more_unless_light_is_rare(
    variance: float, shared: float, reuse: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A short trial misses what sharp lobes find; where all light is rare they are not most of the noise."""
    pretend(monkeypatch, {PLAIN: variance, SHARED: shared * variance})
    assert chosen(glossy(SIZE)).reuse is reuse


def test_sharing_is_not_tried_where_most_paths_leave(monkeypatch: pytest.MonkeyPatch) -> None:
    """A trial of it takes longer than one of branches."""
    tried = pretend(monkeypatch, {PLAIN: 2, SHARED: 0.1})
    assert not chosen(open_scene(SIZE)).reuse
    assert SHARED not in tried


def test_a_guide_goes_with_what_pays(monkeypatch: pytest.MonkeyPatch) -> None:
    """The trial is of guided paths then; without a guide there is a hint where light is hard to find."""
    tried = pretend(monkeypatch, {(True, each): 0.1 for each in (False, True)})
    monkeypatch.setattr(choice, "train", lambda *args: object())
    monkeypatch.setattr(trial, "integrator_for", lambda integrator, *setting: integrator)
    monkeypatch.setattr(trial, "li_twins", lambda *wave, table: li_twins(*wave))
    guided, plain = (chosen(cornell_box(SIZE), guide=guide) for guide in (True, False))
    assert (guided.reuse, guided.guided, guided.hint) == (True, True, None)
    assert (plain.reuse, plain.guided, plain.hint) == (True, False, choice.GUIDE_HINT)
    assert [guided for _, guided in tried] == [True, True, False, False]


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
def test_there_is_no_trial_where_it_can_bring_nothing(
    scene: wf.Scene, settings: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Small pictures, direct light, other integrators, no light, no rough surface."""
    monkeypatch.setattr(Trial, "run", None)
    found = chosen(scene, **settings)
    assert (found.branches, found.reuse) == (settings.get("branches", 1), settings.get("reuse", False))


def test_workers_of_this_machine_do_the_trial(monkeypatch: pytest.MonkeyPatch) -> None:
    """At least two of them have something to do."""
    threads, both_have_one = set(), threading.Barrier(2)
    trace = TrialJob.trace

    def noted(self: TrialJob, *args: Any) -> TrialPart:
        if threading.current_thread().name not in threads:
            threads.add(threading.current_thread().name)
            both_have_one.wait(60)
        return trace(self, *args)

    monkeypatch.setattr(TrialJob, "trace", noted)
    assert wf.render(cornell_box(SIZE), 1, workers=2, executor="threads").metadata["reuse"]
    assert len(threads) == 2
    assert threading.current_thread().name not in threads


def test_a_session_may_be_stopped_during_the_trial_of_a_view() -> None:
    """By another thread: the view has a choice and no picture, and the next one has its picture."""
    scene = cornell_box(SIZE)
    with wf.Session(scene, 1, workers=2, executor="threads", progress=False) as session:
        run = session._pool.run

        def stopped(*args: Any) -> Any:
            session.drop()
            return run(*args)

        session._pool.run = stopped
        session.set_camera(scene.camera)
        assert session._plan.choice.reuse
        session._pool.run = run
        assert next(session, None) is None
        session.set_camera(scene.camera)
        image = session.run()
    assert np.array_equal(image.rgb, render(scene, 1).rgb)


def test_a_window_is_a_part_of_the_same_picture() -> None:
    """The whole picture decides, so its bits stay."""
    scene = cornell_box((240, 160))
    window = scene.camera.cropped((28, 0, 56, 28))
    assert chosen(scene).reuse
    assert chosen(wf.Scene(scene.shapes, camera=window)).reuse
    whole, part = (render(scene, 1, camera=camera) for camera in (scene.camera, window))
    assert np.array_equal(part.rgb, whole.rgb[:28, 28:56])


def test_decisions_do_not_depend_on_workers_waves_samples_or_time() -> None:
    """Counted rays decide."""
    whole = render(cornell_box(SIZE), 2)
    same = [
        {"workers": 2, "wave_size": 5000},
        {"workers": 1, "seconds": 600},
        {"workers": 2, "executor": "processes"},
    ]
    for settings in same:
        image = render(cornell_box(SIZE), 2, **settings)
        assert image.metadata["reuse"] is True
        assert np.array_equal(image.rgb, whole.rgb)
    parts = [
        wf.render(cornell_box(SIZE), samples=part, workers=1, executor="threads")
        for part in (range(1), range(1, 2))
    ]
    assert np.array_equal(wf.Image.merge(*parts).rgb, whole.rgb)


@pytest.mark.parametrize("accel", ["numpy", "embree"])
def test_trials_do_not_depend_on_how_they_are_cut_into_waves(
    accel: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Means and counts are the same for any number of tiles that are traced together."""
    if accel == "embree":
        pytest.importorskip("embreex")
    scene = cornell_box(SIZE)
    compiled = compile_scene(scene, scene.accelerators.maker(accel), mis=True)
    found = []
    for tiles in (1, 3, 64):
        monkeypatch.setattr(trial, "TILES_AT_ONCE", tiles)
        run = partial(map, lambda job: job.trace(compiled, IndependentSampler, None))
        trials = Trial(compiled.view(scene.camera), 1, 5, run, tiles=7)
        found.append([trials.run(*setting) for setting in (PLAIN, SHARED)])
    for others in found[1:]:
        for one, other in zip(found[0], others, strict=True):
            assert (one.first, one.onward, one.met.tolist()) == (
                other.first,
                other.onward,
                other.met.tolist(),
            )
            assert np.array_equal(one.variance, other.variance)
            assert np.array_equal(one.common, other.common)


def test_tiles_of_a_trial_are_those_of_the_picture() -> None:
    """Each of them, once; so pixels share in the trial as they do in the picture."""
    x, y = pixels_of_tiles(np.arange(3 * 2 * 49), 3)
    tile, member = place_in_tiles((y * 100 + x).ravel().astype(np.uint32), 100)
    assert np.unique(y * 100 + x).size == 3 * 2 * 28 * 28
    assert (x.max(), y.max()) == (83, 55)
    assert (tile.reshape(x.shape) == tile.reshape(x.shape)[:, :1]).all()
    assert np.unique(tile).size == len(x)
    assert (member.reshape(x.shape) == np.arange(16)).all()


def test_the_variance_is_that_between_blocks() -> None:
    """Relative to the squared mean, but for the noisiest pixels; what twins share is their covariance."""
    random, values = np.random.default_rng(0), np.array([0.1, 0.2])

    def noise(jobs: list[TrialJob]) -> list[TrialPart]:
        found = []
        for job in jobs:
            shape = (1 if job.reuse else 2, 3, trial.BLOCKS, job.pixels.size)
            both = random.normal(size=shape[1:]) * 0.6 + random.normal(size=shape) * 0.8
            found.append(3 + both * values[int(job.reuse)])
        found[0][:, :, 0, 0] += 1000
        return [TrialPart(each, 2.0, 6.0, np.zeros(1, np.intp)) for each in found]

    trials = Trial(cornell_box((392, 392)).camera, 1, 5, noise)
    runs = [trials.run(*setting) for setting in (PLAIN, SHARED)]
    scale = 9 + trial.FLOOR * 9
    for run, deviation in zip(runs, values, strict=True):
        assert run.mean_variance(0.01) == pytest.approx(deviation**2 / scale, rel=0.1)
        assert run.mean_variance(0) > 0.3
    four = 0.36 + 0.64 / 4
    assert runs[0].mean_variance(0.01, 4) == pytest.approx(four * values[0] ** 2 / scale, rel=0.1)
    assert runs[1].cost(runs[0], 0.01) == pytest.approx(4, rel=0.1)
    assert runs[0].cost(runs[0], 0.01, 4, 1) == pytest.approx(four * (2 + 4 * 6) / 8, rel=0.1)


def within_glass() -> wf.Scene:
    """A camera in dark glass: what its first rays lose is not lost twice."""
    dark = wf.Material(wf.Dielectric(1.1), interior=wf.Medium(absorption=(1, 0.5, 0.2)))
    glass = wf.Sphere((0, 0, 0), 3, material=dark)
    camera = wf.Camera.look_at((0, 0, 2), (0, 0, 0), fov=60, size=(28, 28))
    return wf.Scene([glass, wf.Sphere((0, 0, 0), 1, emission=0.5)], wf.Environment(1), camera)


@pytest.mark.parametrize(
    "scene",
    [cornell_box((28, 28)), everything((28, 28)), within_glass()],
    ids=["box", "everything", "within glass"],
)
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


def test_costs_are_the_rays_of_one_path() -> None:
    """Of both twins together, so each has half of those after their first surface."""
    scene = cornell_box((28, 28))
    assert scene.camera is not None
    compiled = compile_scene(scene, scene.accelerators.maker("numpy"), mis=True)
    camera, counter = compiled.view(scene.camera), RayCounter(compiled.accelerator)
    pixels = np.arange(28 * 28, dtype=np.uint32)
    part = TrialJob(camera, 1, pixels, 5, False, False).trace(compiled, SobolSampler, None)
    sample, sampler = np.repeat(np.arange(16, dtype=np.uint32), pixels.size), SobolSampler(1, 28)
    counted = replace(compiled, accelerator=counter)
    li_full(counted, generate(counted, camera, sampler, np.tile(pixels, 16), sample), sampler, 5)
    rays = counter.nearest + trial.SHADOW_RAY * counter.shadow
    assert part.first == sample.size
    assert part.first + part.onward == pytest.approx(rays, rel=0.02)


def test_the_error_of_a_cost() -> None:
    """That of a quotient of means, as over many runs."""
    random = np.random.default_rng(0)

    def run(mean: float) -> Run:
        variance = random.exponential(mean, 576)
        return Run(variance, variance, 0.0, 2.0, np.zeros(1, np.intp), 1)

    pairs = [(run(2), run(1)) for _ in range(300)]
    costs, errors = ([getattr(a, name)(b, 0) for a, b in pairs] for name in ("cost", "cost_error"))
    assert np.std(costs) == pytest.approx(2 * (2 / 576) ** 0.5, rel=0.15)
    assert np.sqrt(np.mean(np.square(errors))) == pytest.approx(np.std(costs), rel=0.15)
    nothing = replace(pairs[0][1], variance=np.zeros(576), common=np.zeros(576))
    assert pairs[0][0].cost_error(nothing, 0) == 0


@pytest.mark.slow
def test_a_guide_is_used_where_it_pays() -> None:
    """Under an open sky it is not; the picture is that without or with it."""
    for scene, pays in ((open_scene(), False), (lamp_at_the_ceiling(), True)):
        image = render(scene, guide="auto")
        assert image.metadata["guided"] is pays
        assert image.metadata["guide"] == "auto"
        same = render(scene, guide=pays, branches=image.metadata["branches"])
        assert np.array_equal(image.rgb, same.rgb)


def test_renders_go_on_with_the_same_decision(tmp_path: Path) -> None:
    """A checkpoint knows what was decided, and goes on where the same is asked for."""
    path = tmp_path / "box.wfck"
    render(cornell_box(SIZE), 1, checkpoint=path)
    image = render(cornell_box(SIZE), 2, checkpoint=path)
    assert np.array_equal(image.rgb, render(cornell_box(SIZE), 2).rgb)
    with pytest.raises(wf.SceneError, match="reuse was True and is False"):
        render(cornell_box(SIZE), 2, reuse=False, checkpoint=path)
    assert np.array_equal(render(cornell_box(SIZE), 2, reuse=True, checkpoint=path).rgb, image.rgb)


def test_each_camera_has_a_trial_of_its_own() -> None:
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
