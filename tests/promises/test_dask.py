"""Renders on a cluster of Dask: the same bits, also when workers are lost. Skipped where Dask is missing."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Iterator
from functools import partial
from typing import Any

import pytest
import scenes
from inside import STOP, SharedInt, Stopped, WorkerPool
from inside import remote as payloads

import wavefront as wf

distributed = pytest.importorskip("distributed")
QUIET = {"progress": False, "wave_size": 500}


@pytest.fixture(scope="module")
def client() -> Iterator[Any]:
    """A cluster of two processes of one thread each."""
    settings = {"threads_per_worker": 1, "dashboard_address": ":0"}
    with distributed.LocalCluster(n_workers=2, **settings) as cluster, distributed.Client(cluster) as client:
        yield client


@pytest.fixture(scope="module")
def expected() -> bytes:
    """The bits of one worker."""
    return wf.render(scenes.everything(), 8, workers=1, executor="threads", **QUIET).rgb.tobytes()


def tokens(client: Any) -> dict[str, list[str]]:
    """Return what each worker keeps."""
    return client.run(lambda: list(payloads._kept._entries))


def test_a_cluster_gives_the_same_bits(client: Any, expected: bytes) -> None:
    """The scene goes once to each worker; the cluster goes on to work for others."""
    before = {name for names in tokens(client).values() for name in names}
    image = wf.render(scenes.everything(), 8, executor=client, **QUIET)
    assert image.rgb.tobytes() == expected
    assert (image.metadata["executor"], image.metadata["workers"]) == ("Client", 2)
    sent = [set(names) - before for names in tokens(client).values()]
    assert len(set.union(*sent)) == 1
    assert client.submit(abs, -1).result() == 1


def test_light_paths_come_from_a_cluster(client: Any, expected: bytes) -> None:
    images = [
        wf.render(scenes.everything(), 8, caustics=True, **settings, **QUIET)
        for settings in ({"executor": client}, {"workers": 1, "executor": "threads"})
    ]
    assert images[0].rgb.tobytes() == images[1].rgb.tobytes() != expected
    assert images[0].standard_error.tobytes() == images[1].standard_error.tobytes()


def test_a_task_has_several_waves(client: Any, expected: bytes, calls_of: Any) -> None:
    calls = calls_of("wavefront.workers.remote.RemoteWorkers.submit")
    image = wf.render(scenes.everything(), 8, executor=client, progress=False, wave_size=10)
    assert image.rgb.tobytes() == expected
    jobs = [call.args[1] for call in calls]
    assert sum(job.lanes for job in jobs) == image.metadata["samples"]
    assert max(len(list(job.waves())) for job in jobs) == 4
    assert all(wave.lanes <= 10 for job in jobs for wave in job.waves())


def test_pictures_come_while_a_cluster_renders(client: Any) -> None:
    with wf.Session(scenes.everything(), 8, executor=client, **QUIET) as session:
        images = list(session)
    assert [image.spp for image in images if image.spp in (1, 2, 4, 8)] == [1, 2, 4, 8]


def test_nothing_stays_on_the_cluster(client: Any) -> None:
    wf.render(scenes.everything(), 1, executor=client, **QUIET)
    end = time.monotonic() + 30
    while any(client.who_has().values()) and time.monotonic() < end:
        time.sleep(0.05)
    assert not any(client.who_has().values())


def wait_for_stop(stop: SharedInt, job: int) -> int:
    end = time.monotonic() + 40  # a job that begins after the pool has ended does not see the stop
    while job and not stop.value and time.monotonic() < end:
        time.sleep(0.01)
    if stop.value:
        raise Stopped
    return job


@pytest.mark.slow  # one that begins late takes its 40 seconds
def test_a_stop_ends_jobs_on_the_cluster(client: Any) -> None:
    """Those under way, on this machine, and those that have not begun."""
    stop = SharedInt()
    begin = time.monotonic()
    with WorkerPool(partial(wait_for_stop, stop), 2, client, stop) as pool:
        results = pool.run(range(20))
        assert next(results) == (0, 0)
        stop.rise_to(STOP)
        with pytest.raises(Stopped):
            list(results)
        pool.cancel()
    assert time.monotonic() - begin < 30
    assert client.submit(abs, -1).result() == 1


def test_a_result_that_is_lost_before_it_is_fetched_is_an_error(client, monkeypatch):

    async def lost(*given: Any, **options: Any) -> None:
        raise RuntimeError("lost with its inputs")

    monkeypatch.setattr(client, "gather", lost)
    with (
        WorkerPool(abs, 2, client) as pool,
        pytest.raises(wf.RenderError, match="7 failed 3 times, at last by: RuntimeError: lost with its"),
    ):
        list(pool.run([7]))


@pytest.mark.slow
@pytest.mark.filterwarnings("default")  # of Dask, about the worker
def test_a_worker_that_is_killed_in_the_middle_costs_its_jobs_alone(client: Any) -> None:
    room = scenes.everything()
    alone = wf.render(room, 64, workers=1, executor="threads", **QUIET)
    (pid, *_), killed = list(client.run(os.getpid).values()), []

    def kill(done: int, total: int) -> None:
        if not killed and done > total / 3:
            os.kill(pid, signal.SIGKILL)
            killed.append(done)

    image = wf.render(room, 64, executor=client, progress=kill, wave_size=500)
    assert killed
    assert image.rgb.tobytes() == alone.rgb.tobytes()
    client.wait_for_workers(2, timeout=60)


@pytest.mark.slow
@pytest.mark.filterwarnings("default")
def test_all_workers_may_be_lost(client: Any) -> None:
    killed = []

    def jobs() -> Iterator[int]:
        for job in range(40):
            if job == 20:
                for pid in client.run(os.getpid).values():
                    os.kill(pid, signal.SIGKILL)
                    killed.append(pid)
            yield job

    with WorkerPool(abs, 2, client) as pool:
        assert list(pool.run(jobs())) == [(job, job) for job in range(40)]
    assert len(killed) == 2
    client.wait_for_workers(2, timeout=60)


@pytest.mark.slow
def test_two_threads_of_a_worker_share_the_scene(expected: bytes) -> None:
    settings = {"processes": False, "dashboard_address": ":0"}
    with (
        distributed.LocalCluster(n_workers=1, threads_per_worker=2, **settings) as cluster,
        distributed.Client(cluster) as client,
    ):
        assert wf.render(scenes.everything(), 8, executor=client, **QUIET).rgb.tobytes() == expected


@pytest.mark.slow
@pytest.mark.parametrize("workers", [1, 2, 3, 8])
def test_any_number_of_jobs_at_once_gives_the_same_bits(client: Any, expected: bytes, workers: int) -> None:
    image = wf.render(scenes.everything(), 8, workers=workers, executor=client, **QUIET)
    assert image.rgb.tobytes() == expected


def test_a_closed_client_is_an_error() -> None:
    cluster = {"n_workers": 1, "processes": False, "dashboard_address": ":0"}
    with distributed.LocalCluster(**cluster) as here, distributed.Client(here) as client:
        client.close()
        with pytest.raises(wf.SceneError, match=r"executor is a client of Dask .*closed\?"):
            wf.render(scenes.everything(), 1, executor=client)
        with pytest.raises(wf.RenderError, match="the cluster of Dask cannot be given work"):
            wf.render(scenes.everything(), 1, executor=client, workers=1)


@pytest.mark.slow
def test_the_picture_outlives_the_cluster() -> None:
    """A scheduler that is lost, or begins anew without workers, ends the render with the picture so far."""
    cluster = {"n_workers": 1, "processes": False, "dashboard_address": ":0"}
    with distributed.LocalCluster(**cluster) as here, distributed.Client(here) as client:

        def end_it(done: float, total: float) -> None:
            if done:
                here.close()

        with pytest.raises(wf.RenderError, match="Dask") as failed:
            wf.render(scenes.everything(), 100_000, executor=client, progress=end_it, wave_size=500)
    assert failed.value.image is not None
