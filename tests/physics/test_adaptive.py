"""Stopping by noise or time: right errors, no bias, the same bits, and the time that was given."""

import re
import threading

import numpy as np
import pytest
import scenes
from inside import (
    MIN_SPP,
    SQUARE,
    CameraJob,
    Film,
    JobResult,
    Scheduler,
    f4,
    next_stop,
    passes,
    session,
    split_jobs,
    tracing,
)
from inside import drive_Job as Job
from inside import final_checks as outcome
from inside import jobs as scheduler
from significance import render

import wavefront as wf


def lit(size: tuple[int, int] = (24, 16)) -> wf.Scene:
    """A ball on a floor under a panel; the sky around them is black."""
    panel = wf.Rectangle((-1, 2, -1), (2, 0, 0), (0, 0, 2), emission=3.0)
    camera = wf.Camera.look_at((0, 2, 4), (0, 0.4, 0), size=size)
    return wf.Scene([scenes.floor(), panel, wf.Sphere((0, 0.5, 0), 0.5)], camera=camera)


def shiny(size: tuple[int, int] = (16, 12)) -> wf.Scene:
    """A glass ball and a mirror in a colored environment, beside a small light."""
    balls = [
        wf.Sphere((-0.6, 0.5, 0), 0.5, material=wf.Dielectric(1.5)),
        wf.Sphere((0.6, 0.5, 0), 0.5, material=wf.Mirror(0.9)),
        wf.Sphere((0, 2, 1), 0.4, emission=(6, 5, 4)),
    ]
    camera = wf.Camera.look_at((0, 1.5, 4), (0, 0.4, 0), size=size)
    return wf.Scene([scenes.floor(), *balls], [wf.Environment((0.3, 0.4, 0.5))], camera)


VIEW = CameraJob(lit().camera)
SCENES = {"lit": lit, "shiny": shiny}

# --- Noise ----------------------------------------------------------------------------------------


def test_decisions_come_at_fixed_counts() -> None:
    """At powers of two and halfway between, from 32 on."""
    found = [0]
    while found[-1] < 300:
        found.append(next_stop(found[-1]))
    assert found == [0, 32, 48, 64, 96, 128, 192, 256, 384]


@pytest.mark.parametrize("name", SCENES)
@pytest.mark.first(1)
def test_noise_is_the_true_error(name: str) -> None:
    """`noise=0.02` is a relative error between 1 and 3 % against the converged picture."""
    scene = SCENES[name]((16, 12))
    converged = render(scene, 2048, seed=99, accel="auto", workers=None)
    assert converged.metadata["noise"] < 0.007
    image = render(scene, None, noise=0.02, accel="auto", workers=None)
    assert image.metadata["noise"] <= 0.02
    assert 0.01 < wf.compare(image, converged).relative_mse ** 0.5 < 0.03
    assert image.counts.min() >= MIN_SPP
    assert image.spp == round(image.counts.mean())


def test_noisy_parts_get_more_samples() -> None:
    image = render(lit(), None, noise=0.04)
    assert len(np.unique(image.counts)) >= 3
    assert image.counts[:, 0].min() == MIN_SPP
    tiles = image.counts.reshape(2, 8, 3, 8)
    assert (tiles == tiles[:, :1, :, :1]).all()


@pytest.mark.parametrize("cut", [{"wave_size": 300}, {"wave_size": 3000, "workers": 2}])
@pytest.mark.first(1)
def test_noise_gives_the_same_bits(cut: dict) -> None:
    expected = render(lit(), None, noise=0.08)
    image = render(lit(), None, noise=0.08, **cut)
    assert image.metadata["samples"] == expected.metadata["samples"]
    for part in ("rgb", "counts", "variance", "standard_error"):
        assert getattr(image, part).tobytes() == getattr(expected, part).tobytes(), part


def test_samples_are_a_bound() -> None:
    """None gets more, however noisy; and where noise is reached early they are not used up."""
    for most in (7, 40):
        with pytest.warns(UserWarning, match="noise=1e-06 was not reached"):
            image = render(lit(), most, noise=1e-6)
        assert image.counts.max() == most
        assert most > MIN_SPP or (image.counts == most).all()
    assert (render(lit(), 4096, noise=0.9).counts == MIN_SPP).all()
    assert (render(lit((4, 4)), None).counts == 100).all()


@pytest.mark.parametrize("limit", [{"spp": 40}, {"spp": None, "seconds": 0.5}], ids=["samples", "time"])
def test_noise_that_is_not_reached_is_told(limit: dict) -> None:
    with pytest.warns(UserWarning, match="noise") as caught:
        image = render(lit(), noise=1e-4, **limit)
    found = image.metadata
    (warning,) = caught
    for value in (
        "noise=0.0001",
        f"{found['noise']:.4g}",
        f"{found['spp']:.4g}",
        f"{found['seconds']:.3g} s",
    ):
        assert value in str(warning.message)
    with pytest.warns(UserWarning, match="it is unknown after 1 sample per"):
        render(lit(), 1, noise=0.5)


def test_pieces_go_on_where_pixels_stopped() -> None:
    """A pixel's samples in an adaptive picture are the first of those it has in a plain one."""
    image = render(lit(), None, noise=0.05)
    for count in np.unique(image.counts):
        plain = render(lit(), int(count))
        there = image.counts == count
        assert (image.rgb[there] == plain.rgb[there]).all()
        assert (image.standard_error[there] == plain.standard_error[there]).all()


def adaptive_means(runs: int, side: int) -> np.ndarray:
    """Mean of pictures with mean 1, sampled adaptively by squares of a side: (runs,).

    Half of the light comes from one sample in twenty, so a pixel that has not met one looks done.
    """
    rng = np.random.default_rng(0)
    means, row = [], np.arange(32) // side
    square_of = (row[:, None] * 32 + row).ravel()
    for _ in range(runs):
        film = Film(32, 32)
        for step in passes(film, 1024, 0.15, square_of):
            bright = rng.random((1, step.last - step.first, step.pixels.size), np.float32) < 0.05
            film.add(step.pixels, (f4(0.5) + f4(10) * bright).repeat(3, 0))
        means.append(film.mean().mean())
    return np.array(means)


def test_adaptive_sampling_has_no_bias_worth_mentioning() -> None:
    """Below 0.2 % of the mean; deciding pixel by pixel would have much more, and this would see it."""
    means = adaptive_means(40, SQUARE)
    error = means.std(ddof=1) / len(means) ** 0.5
    assert error < 0.0008
    assert abs(means.mean() - 1) < 0.002
    assert adaptive_means(2, 1).mean() < 0.95


# --- Time -----------------------------------------------------------------------------------------


class Machine:
    """Workers that take a known time for a wave, and a clock to match."""

    def __init__(self, per_path: float, per_wave: float, workers: int) -> None:
        self.now, self.per_path, self.per_wave, self.workers = 0.0, per_path, per_wave, workers

    def run(self, pixels: int, seconds: float, setup: float = 0.0, slower: float = 1.0) -> np.ndarray:
        """Return samples of each pixel when work is handed out as `render` does it."""
        counts = np.zeros(pixels, int)
        clock = Scheduler(0.0, seconds, 65_536, self.workers)
        self.now = setup
        free = [self.now] * self.workers
        queue: list = []
        everything = np.arange(pixels, dtype=np.uint32)

        def finish() -> None:
            job, spent, end = queue.pop(0)
            self.now = max(self.now, end)
            counts[job.pixels] += job.samples
            clock.job_done(job, spent)

        for job in clock.in_time(split_jobs(VIEW, everything, 0, 10**9, clock.job_size)):
            spent = self.per_wave + self.per_path * job.lanes
            spent *= slower if self.now > seconds / 2 else 1
            worker = int(np.argmin(free))
            free[worker] = max(free[worker], self.now) + spent
            queue.append((job, spent, free[worker]))
            if len(queue) > 2 * self.workers:
                finish()
        while queue:
            finish()
        assert clock.time_up
        self.last_wave_size = clock.job_size(10**9)
        return counts


@pytest.mark.parametrize("slower", [1.0, 1.3, 0.7])
@pytest.mark.parametrize(
    ("seconds", "per_path", "workers"), [(3.0, 3e-5, 4), (3.0, 8e-6, 1), (20.0, 8e-6, 4)]
)
def test_time_is_used_and_kept(seconds, per_path, workers, slower, set_clock):
    """Within 10 %, on fast and slow machines and where speed changes on the way."""
    machine = Machine(per_path, 2e-3, workers)
    set_clock(lambda: machine.now)
    counts = machine.run(10_000, seconds, setup=seconds / 20, slower=slower)
    assert 0.9 * seconds <= machine.now <= (1.1 if slower > 1 else 1.02) * seconds
    assert counts.min() >= 1


def wave_sizes(per_path: float, wave_size: int | None, workers: int, branches: int = 1) -> np.ndarray:
    """Lanes of all waves of 100 000 pixels and 60 samples, each path of which takes a known time."""
    clock, lanes = Scheduler(0.0, None, wave_size, workers, branches), []
    for job in split_jobs(VIEW, np.arange(100_000, dtype=np.uint32), 0, 60, clock.job_size):
        clock.job_done(job, per_path * job.lanes)
        lanes.append(job.lanes)
    assert sum(lanes) == 6_000_000
    return np.array(lanes)


def test_waves_are_large_where_that_pays() -> None:
    """Small until the speed is known and towards the end, and never larger than was asked for."""
    least, largest = scheduler.SMALL_WAVE, scheduler.LARGE_WAVE
    for workers in (1, 2, 4):
        lanes = wave_sizes(1e-6, None, workers)
        most = min(largest, scheduler.LANES_AT_ONCE // workers)
        assert 0.75 * most < lanes.max() <= most
        assert lanes[0] <= least
        assert lanes[-1] <= least
        late = lanes[lanes.size // 2 :]
        assert (np.diff(late[late > least]) <= 0.01 * most).all()  # the last of a sweep may be smaller
        assert np.median(lanes) > 0.75 * most
    for limit, cut in ((least, (None, 64)), (least // 4, (None, 64, 4)), (5000, (5000, 2))):
        assert limit / 2 < wave_sizes(1e-6, *cut).min() <= wave_sizes(1e-6, *cut).max() <= limit
    assert wave_sizes(1e-6, 5000, 2, 64).max() == 5000 // 64


@pytest.mark.parametrize("wave_size", [1, 3, 50, 100, 299, 300, 900])
@pytest.mark.parametrize("whole_tiles", [False, True])
def test_waves_of_a_job_are_its_samples_in_order(wave_size: int, whole_tiles: bool) -> None:
    """Each pixel's samples come one after the other, and every one of them once."""
    camera = wf.Camera.look_at((0, 0, 4), (0, 0, 0), size=(20, 5))
    job = Job(CameraJob(camera, reuse=whole_tiles), np.arange(100, dtype=np.uint32), 7, 3, wave_size)
    samples = np.full(100, 7)
    for wave in job.waves():
        assert wave.lanes <= wave_size or whole_tiles
        assert (samples[wave.pixels] == wave.first_sample).all()
        samples[wave.pixels] = wave.end
    assert (samples == 10).all()
    halves = job.halves()
    assert sum(half.lanes for half in halves) == job.lanes
    assert all(half.lanes_at_once <= max(1, job.lanes_at_once // 2) for half in halves)


def test_every_pixel_gets_a_sample(set_clock) -> None:
    machine = Machine(1e-3, 1e-3, 2)
    set_clock(lambda: machine.now)
    assert (machine.run(500_000, 0.5) == 1).all()


@pytest.mark.usefixtures("no_estimates")
def test_seconds_end_a_render() -> None:
    """With an image that is whole; `spp` and `noise` may end it before."""
    image = render(lit((8, 8)), None, seconds=0.3, workers=2)
    assert image.counts.min() >= 1
    assert image.metadata["seconds"] >= 0.3
    assert (render(lit((8, 8)), 3, seconds=1000).counts == 3).all()
    assert render(lit((8, 8)), None, seconds=1000, noise=0.5).metadata["noise"] <= 0.5


@pytest.mark.slow
@pytest.mark.parametrize("name", SCENES)
def test_ten_seconds_are_ten_seconds(name: str) -> None:
    """Within 10 %, on a machine that has nothing else to do."""
    image = wf.render(SCENES[name]((256, 256)), seconds=10, progress=False)
    assert 9 <= image.metadata["seconds"] <= 11


# --- Waves that take long --------------------------------------------------------------------------


def closed(size: tuple[int, int]) -> wf.Scene:
    """A room in which no light is lost, so that no path ends before `max_bounces`."""
    room = wf.Sphere((0, 0, 0), 5, material=wf.Diffuse(1.0))
    light = wf.Sphere((0, 0, -3), 0.1, emission=1)
    return wf.Scene([room, light], camera=wf.Camera.look_at((0, 0, 3), (0, 0, 0), size=size))


@pytest.mark.filterwarnings("ignore:paths have met more than")  # as a fast machine does in the time
def test_time_ends_waves_under_way() -> None:
    """Also those of first samples, if they take long: there is no picture then, and the error says why."""
    message = r"no picture: when seconds=0.4 were over, .* had met (\d+) surfaces; .* lower max_bounces"
    with pytest.raises(wf.RenderError, match=message) as caught:
        render(closed((64, 64)), None, seconds=0.4, max_bounces=2**16, workers=2)
    assert caught.value.image is None
    met = re.search(message, str(caught.value))
    assert met is not None
    assert int(met[1]) < 2**16  # which takes minutes


@pytest.mark.usefixtures("no_estimates")
def test_samples_of_waves_that_time_ends_are_discarded(calls_of) -> None:
    """What was done before is there, as if nothing else had been asked for."""

    def endless(tracer: tracing.Tracer, monitor: tracing.WaveMonitor, job: Job) -> JobResult:
        if job.first_sample < 3 or seconds is None:
            return tracing.trace_job(tracer, monitor, job)
        while True:
            monitor.check(0, job.view.deadline)

    calls_of("wavefront.drive.session.trace_job", endless)
    seconds = 0.5
    image = render(lit(), None, seconds=seconds, wave_size=384)  # one sample of all pixels
    assert image.spp <= 3
    seconds = None
    assert (image.rgb == render(lit(), image.spp).rgb).all()


def test_pixels_without_a_sample_are_told(calls_of) -> None:
    first_is_done = threading.Event()

    def endless_after_the_first(tracer: tracing.Tracer, monitor: tracing.WaveMonitor, job: Job) -> JobResult:
        if not job.pixels[0]:
            return tracing.trace_job(tracer, monitor, job)
        assert first_is_done.wait(60)
        while True:
            monitor.check(123, job.view.deadline)

    calls_of("wavefront.drive.session.trace_job", endless_after_the_first)
    message = (
        r"288 pixels of 384 have no sample and are black: when seconds=0.5 were over, .* met 123 surfaces"
    )
    settings = {"workers": 1, "wave_size": 100, "progress": lambda *_: first_is_done.set()}
    with pytest.warns(UserWarning, match=message):
        image = render(lit(), None, seconds=0.5, **settings)
    assert (image.counts == 0).sum() == 288
    assert (image.rgb[image.counts == 0] == 0).all()


def test_paths_that_do_not_end_are_told(monkeypatch) -> None:
    """Once, where more than 1 000 bounces are allowed, and more than 1 000 surfaces met."""
    assert outcome.LONG_PATH == 1000  # takes seconds
    monkeypatch.setattr(session, "LONG_PATH", 50)
    monkeypatch.setattr(outcome, "LONG_PATH", 50)
    with pytest.warns(UserWarning, match=r"more than 50 surfaces.*max_bounces=60.*absorb") as caught:
        wf.render(closed((2, 2)), 4, max_bounces=60, wave_size=8, progress=False)
    assert [warning.filename for warning in caught] == [__file__]
    render(closed((2, 2)), 2, max_bounces=50)
    render(lit((8, 8)), 2, max_bounces=2**16)


@pytest.mark.filterwarnings("ignore:paths have met more than")  # as a fast machine does in the time
def test_progress_goes_on_within_a_wave() -> None:
    """A function is called every second, so that it can also stop what takes long."""
    calls: list = []

    def stop(*call: float) -> None:
        calls.append(call)
        if len(calls) == 2:
            raise KeyboardInterrupt

    with pytest.raises(wf.Interrupted, match="no picture yet"):
        render(closed((32, 32)), 1, max_bounces=2**16, progress=stop)
    assert calls == [(0, 1024)] * 2


# --- Arguments, progress, Ctrl-C ------------------------------------------------------------------


@pytest.mark.parametrize("name", ["noise", "seconds"])
@pytest.mark.parametrize("value", [0, -1, np.nan, np.inf, "much"])
def test_bad_limits_are_named(name: str, value) -> None:
    with pytest.raises(wf.SceneError, match=f"{name} (is|must be)"):
        wf.render(None, **{name: value})


def test_progress_counts_samples_or_seconds() -> None:
    """Samples against the most there may be; seconds against the time there is."""
    calls: list = []
    image = render(lit((8, 8)), 500, noise=0.3, progress=lambda *call: calls.append(call))
    assert calls[-1] == (image.metadata["samples"], 500 * 64)
    calls.clear()
    render(lit((8, 8)), None, seconds=0.2, progress=lambda *call: calls.append(call))
    done, total = np.array(calls).T
    assert (total == 0.2).all()
    assert (np.diff(done) >= 0).all()
    assert 0 < done[-1] <= 0.2


def test_ctrl_c_in_an_adaptive_pass_gives_the_picture_so_far() -> None:
    size = 24 * 16

    def stop(done: float, total: float) -> None:
        if done > 40 * size:
            raise KeyboardInterrupt

    message = r"interrupted: the picture so far has 4\d\.\d+ samples per pixel"
    with pytest.raises(wf.Interrupted, match=message) as caught:
        render(lit(), None, noise=1e-3, wave_size=100, progress=stop)
    image = caught.value.image
    assert image.metadata["interrupted"]
    assert set(np.unique(image.counts)) <= set(range(32, 49))
    assert image.metadata["samples"] == image.counts.sum() > 40 * size
    plain = render(lit(), 32)
    assert (image.rgb[image.counts == 32] == plain.rgb[image.counts == 32]).all()
