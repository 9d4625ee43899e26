"""Sessions: the picture while it grows, other views with the same workers, and nothing left at the end."""

from __future__ import annotations

import multiprocessing
import os
import signal
import sys
import threading
import time
from typing import Any

import numpy as np
import pytest
import scenes
from inside import SharedInt, inline, plan, pool, warn_caller
from inside import session as module
from scripts import children, end_of, eventually, runs, script, wait_for

import wavefront as wf

LINUX = sys.platform.startswith("linux")
needs_fork = pytest.mark.skipif(not LINUX, reason="needs fork")
EXECUTORS = ["threads", pytest.param("processes", marks=needs_fork)]
QUIET = {"progress": False}


def everything() -> wf.Scene:
    return scenes.everything()


def same(a: wf.Image, b: wf.Image) -> bool:
    """Return True if all parts of two pictures have the same bits."""
    parts = ("rgb", "counts", "variance", "standard_error")
    return all(getattr(a, part).tobytes() == getattr(b, part).tobytes() for part in parts)


# --- The picture while it grows -------------------------------------------------------------------


@pytest.mark.parametrize("executor", EXECUTORS)
@pytest.mark.first(1)
def test_a_picture_after_every_pass(executor: str) -> None:
    """Doubling, with samples, error and time; the last one is that of render."""
    options = {"workers": 2, "executor": executor, "wave_size": 700, **QUIET}
    with wf.Session(everything(), 24, **options) as session:
        images = list(session)
        assert list(session) == []
    assert [image.spp for image in images if image.spp in (1, 2, 4, 8, 16, 24)] == [1, 2, 4, 8, 16, 24]
    seconds = [image.metadata["seconds"] for image in images]
    assert seconds == sorted(seconds)
    assert np.isnan(images[0].metadata["noise"])
    assert all(image.metadata["noise"] > 0 for image in images[1:])
    assert [image.metadata["samples"] for image in images] == [int(image.counts.sum()) for image in images]
    plain = wf.render(everything(), 24, **options)
    assert same(images[-1], plain)
    assert images[-1].metadata.keys() == plain.metadata.keys()
    assert not images[-1].metadata["interrupted"]


def test_each_picture_is_that_of_a_shorter_render() -> None:
    """And it does not change when the render goes on."""
    with wf.Session(everything(), 8, workers=1, **QUIET) as session:
        images = list(session)
    for image in images:
        assert same(image, wf.render(everything(), image.spp, workers=1, **QUIET))


def test_long_passes_show_pictures_in_between(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "SNAPSHOT_INTERVAL", 0.0)
    with wf.Session(everything(), 16, workers=1, wave_size=200, **QUIET) as session:
        images = list(session)
    assert len(images) > 5  # at 1, 2, 4, 8 and 16
    assert [image.spp for image in images] == sorted({image.spp for image in images})
    assert all((image.counts == image.spp).all() for image in images)


def test_noise_gives_a_picture_at_each_decision() -> None:
    options = {"noise": 0.02, "workers": 1, **QUIET}
    with wf.Session(everything(), 128, **options) as session, pytest.warns(UserWarning, match="not reached"):
        images = list(session)
    assert [image.counts.max() for image in images[:6]] == [1, 2, 4, 8, 16, 32]
    with pytest.warns(UserWarning, match="not reached"):
        assert same(images[-1], wf.render(everything(), 128, **options))


@pytest.mark.usefixtures("no_estimates")
def test_time_ends_a_session() -> None:
    with wf.Session(everything(), seconds=0.3, workers=1, **QUIET) as session:
        images = list(session)
    assert images[-1].counts.min() >= 1
    assert images[-1].metadata["seconds"] >= 0.3


def test_run_goes_on_where_a_loop_was_left() -> None:
    plain = wf.render(everything(), 16, **QUIET)
    for finish in (lambda session: session.run(), lambda session: list(session)[-1]):
        with wf.Session(everything(), 16, **QUIET) as session:
            assert next(session).spp == 1
            for image in session:
                if image.spp == 4:
                    break
            assert same(finish(session), plain)
            with pytest.raises(wf.RenderError, match="the render is over"):
                session.run()


# --- Another view ---------------------------------------------------------------------------------


def view(x: float, size: tuple[int, int] = (20, 15)) -> wf.Camera:
    return wf.Camera.look_at((x, 0.5, 3.9), (0, 0, 0), size=size)


@pytest.fixture
def patient(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let sessions wait for workers that were stopped, and so keep them, however late these hear of it."""
    monkeypatch.setattr(pool, "CANCEL_TIMEOUT", 60.0)


@pytest.mark.usefixtures("patient")
@pytest.mark.parametrize("executor", EXECUTORS)
@pytest.mark.parametrize("sampler", ["sobol", "bluenoise"])
@pytest.mark.first(1)
def test_another_camera_compiles_nothing_and_starts_no_worker(executor, sampler, calls_of):
    """Its picture is that of a render, also in another size, and when the first one was not finished."""
    options = {"sampler": sampler, "workers": 2, "executor": executor, "wave_size": 300, **QUIET}
    plain = [wf.render(everything(), 6, camera=view(x, size), **options) for x, size in VIEWS]
    compiled = calls_of("wavefront.drive.prepared_scene.compile_scene")
    ending = worker_threads()  # of the renders before, whose pools close in threads of their own
    with wf.Session(everything(), 6, camera=view(0), **options) as session:
        next(session)
        workers = {each.pid for each in multiprocessing.active_children()}
        threads = worker_threads()
        for (x, size), expected in zip(VIEWS, plain, strict=True):
            session.set_camera(view(x), size)
            assert same(session.run(), expected)
        assert {each.pid for each in multiprocessing.active_children()} == workers
        assert threads - ending <= worker_threads()  # a pool of threads starts the second when it is needed
        assert len(worker_threads() - ending) <= (2 if executor == "threads" else 0)
        assert len(workers) == (2 if executor == "processes" else 0)
    assert len(compiled) == 1


def worker_threads() -> set[threading.Thread]:
    """Return the threads that trace."""
    return {each for each in threading.enumerate() if each.name.startswith("wavefront")}


VIEWS = [(0.4, (20, 15)), (-0.4, (12, 10)), (0.0, (24, 8))]


def test_the_camera_may_be_left_to_the_scene() -> None:
    with wf.Session(wf.Sphere((0, 0, 0), 1), 2, size=(8, 6), lighting="even", **QUIET) as session:
        first = session.run()
        session.set_camera(None, (8, 6))
        assert same(first, session.run())


def test_bad_cameras_leave_the_session_as_it_is() -> None:
    with wf.Session(everything(), 4, **QUIET) as session:
        next(session)
        with pytest.raises(wf.SceneError, match=r"camera must be a wf\.Camera"):
            session.set_camera("front")  # type: ignore[arg-type]
        with pytest.raises(wf.SceneError, match="size is"):
            session.set_camera(None, (0, 3))
        assert same(session.run(), wf.render(everything(), 4, **QUIET))


def test_time_begins_anew_with_another_camera(set_clock: Any) -> None:
    """The limit is for one picture; workers that were started hear of the new deadline."""
    clock = SharedInt()  # milliseconds; workers have it, too
    set_clock(lambda: clock.value / 1000)
    options = {"seconds": 0.4, "workers": 2, "executor": "processes" if LINUX else "threads"}
    options |= {"wave_size": 300, "progress": lambda *_: clock.rise_to(clock.value + 20)}
    with wf.Session(everything(), **options) as session:
        session.run()
        clock.rise_to(clock.value + 500)
        session.set_camera(view(0.4))
        image = session.run()
    assert image.counts.min() >= 1
    assert image.spp > 1


# --- Stopping -------------------------------------------------------------------------------------


@pytest.mark.usefixtures("patient")
@pytest.mark.parametrize("executor", EXECUTORS)
def test_stop_in_the_loop_ends_it(executor: str) -> None:
    options = {"workers": 2, "executor": executor, "wave_size": 300, **QUIET}
    seen = []
    with wf.Session(everything(), 100_000, **options) as session:
        for image in session:
            seen.append(image.spp)
            if image.spp >= 4:
                session.stop()
        assert seen == [1, 2, 4]
        workers = {each.pid for each in multiprocessing.active_children()}
        session.set_camera(view(0.4))
        assert next(session).spp == 1
        assert {each.pid for each in multiprocessing.active_children()} == workers


def test_stop_from_another_thread_gives_the_picture_so_far() -> None:
    begun = threading.Event()
    options = {**QUIET, "progress": lambda done, most: begun.set() if done else None}
    with wf.Session(everything(), 10_000_000, workers=2, wave_size=2000, **options) as session:

        def stop() -> None:
            begun.wait()
            session.stop()

        thread = threading.Thread(target=stop)
        thread.start()
        image = session.run()
        thread.join()
        assert image.metadata["interrupted"]
        assert image.metadata["samples"] > 0
        assert list(session) == []


def test_stop_before_there_is_a_picture() -> None:
    with wf.Session(everything(), 4, **QUIET) as session:
        session.stop()
        assert list(session) == []
        session.set_camera(None)
        session.stop()
        with pytest.raises(wf.RenderError, match="stopped before there was a picture"):
            session.run()


def test_drop_ends_a_render_without_a_picture(fails: Any) -> None:
    with wf.Session(everything(), 10_000_000, workers=2, wave_size=2000, **QUIET) as session:
        images = [next(session)]
        fails("wavefront.drive.picture.Picture.last_image", AssertionError())
        timer = threading.Timer(0.3, session.drop)
        timer.start()
        images.extend(session)
        timer.join()
        assert not any(image.metadata["interrupted"] for image in images)
        session.set_camera(view(0.4))
        assert next(session).spp == 1


@pytest.mark.parametrize("executor", EXECUTORS)
def test_workers_can_be_started_before_there_is_work(executor: str) -> None:
    with wf.Session(everything(), 4, workers=2, executor=executor, **QUIET) as session:
        session.start_workers()
        workers = {each.pid for each in multiprocessing.active_children()}
        assert len(workers) == (2 if executor == "processes" else 0)
        session.start_workers()
        assert session.run().spp == 4
        assert {each.pid for each in multiprocessing.active_children()} == workers


# --- Nothing is left ------------------------------------------------------------------------------


@pytest.mark.parametrize("executor", EXECUTORS)
@pytest.mark.parametrize("end", ["leave", "error", "close"])
def test_nothing_is_left(executor: str, end: str) -> None:
    """After the block, an error in it, and without a block after close."""
    before = threading.active_count()
    options = {"workers": 2, "executor": executor, "wave_size": 300, **QUIET}
    session = wf.Session(everything(), 100_000, **options)
    if end == "close":
        next(session)
        session.close()
    elif end == "leave":
        with session:
            next(session)
    else:
        with pytest.raises(ZeroDivisionError), session:
            _ = next(session).spp / 0
    assert not multiprocessing.active_children()
    assert threading.active_count() == before
    assert list(session) == []
    session.close()  # once more does no harm
    with pytest.raises(wf.RenderError, match="the session is closed"):
        session.set_camera(None)


@pytest.mark.parametrize("executor", EXECUTORS)
@pytest.mark.first(1)
def test_idle_workers_end_and_start_again(executor: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Outside of a block, after a time; what they have done is not lost."""
    assert pool.IDLE_TIMEOUT == 10
    monkeypatch.setattr(pool, "IDLE_TIMEOUT", 0.3)
    before = threading.active_count()
    session = wf.Session(everything(), 16, workers=2, executor=executor, wave_size=300, **QUIET)
    assert next(session).spp == 1
    assert eventually(lambda: not multiprocessing.active_children() and threading.active_count() == before)
    assert same(session.run(), wf.render(everything(), 16, **QUIET))
    session.close()
    assert threading.active_count() == before


@pytest.mark.parametrize("executor", EXECUTORS)
@pytest.mark.first(1)
def test_workers_stay_within_a_block(executor: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pool, "IDLE_TIMEOUT", 0.05)
    options = {"workers": 2, "executor": executor, "wave_size": 300, **QUIET}
    session = wf.Session(everything(), 100_000, **options)
    next(session)
    with session:
        next(session)
        threads, children = set(threading.enumerate()), multiprocessing.active_children()
        time.sleep(0.5)
        assert set(multiprocessing.active_children()) == set(children)
        assert set(threading.enumerate()) == threads


@needs_fork
@pytest.mark.parametrize(("executor", "where"), [("processes", "waiting"), ("threads", "looking")])
def test_ctrl_c_leaves_nothing(executor: str, where: str) -> None:
    """While a picture is waited for, with the picture so far; in the loop's body it is Python's own."""
    body = f"""
try:
    with wf.Session(light, 10_000_000, workers=2, executor={executor!r}, progress=False) as session:
        for image in session:
            print("tracing", flush=True)
            if {where!r} == "looking":
                rest()
except KeyboardInterrupt as stop:
    print(type(stop).__name__, "left", left(), flush=True)
"""
    with script(body) as process:
        wait_for(process, "tracing")
        workers = children(process)
        if where == "waiting":
            time.sleep(0.2)
        os.killpg(process.pid, signal.SIGINT)
        output = end_of(process)
    names = ("Interrupted",) if where == "waiting" else ("KeyboardInterrupt",)
    if where == "waiting":  # it may come between two pictures
        names += ("KeyboardInterrupt",)
    assert any(f"{name} left []" in output for name in names), output
    assert len(workers) == (2 if executor == "processes" else 0)
    assert not any(map(runs, workers))


# --- Several threads ------------------------------------------------------------------------------------


@pytest.mark.parametrize("executor", ["threads", "processes"])
def test_a_second_thread_gets_an_error(executor: str) -> None:
    """It may stop the session, or close it: the render ends with its picture so far."""
    begun, images = threading.Event(), []

    def report(done: float, total: float) -> None:
        if done:
            begun.set()

    session = wf.Session(
        scenes.everything(), 1_000_000, executor=executor, workers=2, wave_size=500, progress=report
    )
    renderer = threading.Thread(target=lambda: images.append(session.run()))
    renderer.start()
    assert begun.wait(60)
    for use in (session.run, session.run_once, lambda: next(session), lambda: session.set_camera(None)):
        with pytest.raises(
            wf.RenderError, match="in use by another thread; meanwhile it can only be stopped"
        ):
            use()
    session.close()
    renderer.join(60)
    assert images[0].metadata["interrupted"]


def test_a_function_of_progress_cannot_use_its_session() -> None:
    session = wf.Session(scenes.everything(), 4, progress=lambda done, total: session.run())
    with session, pytest.raises(wf.RenderError, match="in use by the caller of this function"):
        session.run()


# --- A picture of one wave ------------------------------------------------------------------------


class Noting(wf.Diffuse):
    """Counts the threads while it is shaded, and warns as a part of this package does."""

    def __init__(self) -> None:
        super().__init__(0.5)
        self.threads: list[tuple[set[threading.Thread], str]] = []

    def sample_f(self, *given: Any) -> Any:
        warn_caller("shaded")
        self.threads.append((set(threading.enumerate()), np.geterr()["under"]))
        return super().sample_f(*given)


def noted(**settings: Any) -> tuple[wf.Image, list[tuple[set[threading.Thread], str]]]:
    """Return a small picture of a ball that notes, and what it noted."""
    ball = wf.Sphere((0, 0, 0), 1, material=Noting())
    with pytest.warns(UserWarning, match="^shaded$") as caught, np.errstate(under="raise"):
        image = wf.render([ball, wf.Environment(1)], 4, size=(16, 12), **settings)
    assert len(caught) == 1
    return image, ball.material.bsdf.threads  # type: ignore[attr-defined]


def test_the_caller_traces_a_picture_of_one_wave() -> None:
    before = set(threading.enumerate())
    image, found = noted(progress=False)
    assert found
    assert all(threads == before and error == "ignore" for threads, error in found)
    by_threads, found = noted(progress=False, executor="threads")
    assert all(threads > before for threads, _ in found)
    assert same(image, by_threads)


def test_larger_pictures_have_workers(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(plan, "SMALL_WAVE", 16 * 12 * 4 * 4 - 1)
    before = set(threading.enumerate())
    _, found = noted(progress=False, workers=1)
    assert all(threads > before for threads, _ in found)
    _, found = noted(progress=False, workers=1, branches=1)
    assert all(threads == before for threads, _ in found)


def test_a_larger_view_gets_workers_and_a_smaller_one_none(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(plan, "SMALL_WAVE", 16 * 12 * 4)
    ball = wf.Sphere((0, 0, 0), 1, material=wf.Diffuse(0.5))
    settings: dict[str, Any] = {"branches": 1, "size": (16, 12), **QUIET}
    with wf.Session([ball, wf.Environment(1)], 4, **settings) as session:
        for size, workers in (((16, 12), 0), ((17, 12), 1), ((16, 12), 0)):
            session.set_camera(None, size)
            assert session.run().rgb.shape == (size[1], size[0], 3)
            assert len(worker_threads()) == workers


def test_the_caller_shows_progress_and_can_stop_within_a_wave(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(inline, "POLL_INTERVAL", 0.0)
    monkeypatch.setattr("wavefront.core.progress.TICK", 0.0)
    told: list[float] = []

    def progress(done: float, most: float) -> None:
        told.append(done)
        if len(told) == 3:
            session.stop()

    with wf.Session(everything(), 4, progress=progress, aovs="depth") as session:
        with pytest.raises(wf.RenderError, match="stopped before there was a picture"):
            session.run()
        assert told == [0, 0, 0]
        session.set_camera(None)
        assert session.run().spp == 4
    assert told[-1] == told[3 + told[3:].index(max(told))] == max(told) > 0


def test_a_line_says_that_something_is_tried_only_while_it_is(calls_of: Any, monkeypatch: Any) -> None:
    calls = calls_of("wavefront.drive.choice.phase")
    monkeypatch.setattr("wavefront.drive.choice.LEAST_PIXELS", 64 * 64)
    for side, said in ((63, 0), (64, 1)):
        wf.render(scenes.cornell_box(), 1, size=(side, side), executor="threads")
        assert len(calls) == said


def test_a_render_checks_its_scene_and_counts_bytes_once(calls_of: Any) -> None:
    scene = everything()
    checks, counts = calls_of("wavefront.scene.Scene.check"), calls_of("wavefront.drive.plan.bytes_per_pixel")
    plan._bytes_of_sums.cache_clear()
    wf.render(scene, 1, size=(4, 4), lighting=None, **QUIET)
    assert (len(checks), len(counts)) == (1, 1)
