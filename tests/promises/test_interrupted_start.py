"""Ctrl-C at any moment while workers start: the prompt comes back, and no child is left."""

from __future__ import annotations

import json
import os
import signal
import sys
import threading

import pytest
from inside import STOP, InterruptHandler, ProcessPool, SharedInt, deferred_signals
from scripts import start_python

pytestmark = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="signals and processes of Linux")
SOON = 2.0  # seconds to the prompt
TIMEOUT = 120.0  # seconds for all tries of a script; one that hangs takes longer

# Prints the seconds from each Ctrl-C to the prompt, and what is left then, as a notebook's kernel has it.
TRIES = """
import json, multiprocessing, os, random, signal, sys, threading, time
from contextlib import suppress
from pathlib import Path
import wavefront as wf
executor, accel, when, tries, seed = sys.argv[1], sys.argv[2], sys.argv[3], int(sys.argv[4]), int(sys.argv[5])
floor = wf.Rectangle((-5, -1, -5), (0, 0, 10), (10, 0, 0))
camera = wf.Camera.look_at((0, 1, 5), (0, 0, 0), size=(200, 200))  # large enough for a trial
scene = wf.Scene([wf.Sphere((0, 0, 0), 1), floor], [wf.Environment(0.3)], camera)
OTHERS = "resource_tracker", "forkserver"  # of multiprocessing, which end with the program

def children():
    found = []
    for thread in Path("/proc/self/task").iterdir():
        with suppress(OSError):  # it has ended
            found += (thread / "children").read_text().split()
    return [pid for pid in found if not any(other in command(pid) for other in OTHERS)]

def command(pid):
    with suppress(OSError):
        return Path(f"/proc/{pid}/cmdline").read_text()
    return ""

def threads():
    return [each.name for each in threading.enumerate() if each.name != "MainThread"]

def press(delay):
    global pressed
    if when == "fork":
        while not children():
            time.sleep(0.0005)
    time.sleep(delay)
    pressed = time.perf_counter()
    os.kill(os.getpid(), signal.SIGINT)

def render():
    begin = time.perf_counter()
    def seen(done, total):
        spans.append(time.perf_counter() - begin)
        os.kill(os.getpid(), signal.SIGINT)
    try:
        wf.render(scene, 1_000_000, workers=4, executor=executor, accel=accel, progress=seen)
    except KeyboardInterrupt:
        return

spans, found = [], []
render()  # until the first samples are there
choose = random.Random(seed)
for _ in range(tries):
    presser = threading.Thread(target=press, args=(choose.uniform(0, 0.01 if when == "fork" else spans[0]),))
    try:
        presser.start()
        wf.render(scene, 1_000_000, workers=4, executor=executor, accel=accel, progress=False)
    except KeyboardInterrupt:
        seconds = time.perf_counter() - pressed
    presser.join()
    left = [str(each) for each in multiprocessing.active_children()] + children() + threads()
    found.append((seconds, left))
print(json.dumps(found))
"""


def tries(executor: str, accel: str, when: str, count: int, seed: int = 1) -> list[float]:
    """Press Ctrl-C in so many renders; return the seconds to the prompt. Nothing may be left of any."""
    process = start_python("-", executor, accel, when, str(count), str(seed))
    try:
        output, errors = process.communicate(TRIES, TIMEOUT)
    finally:
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGKILL)
            process.communicate()
    assert process.returncode == 0, errors
    found = json.loads(output)
    assert [left for _, left in found if left] == []
    return [seconds for seconds, _ in found]


@pytest.mark.parametrize("executor", ["processes", pytest.param("threads", marks=pytest.mark.slow)])
def test_ctrl_c_while_workers_start(executor: str) -> None:
    """At a few moments: while the first processes are forked, or at any before the first samples."""
    assert len(tries(executor, "auto", "fork" if executor == "processes" else "any", 3)) == 3


@pytest.mark.slow
@pytest.mark.parametrize("accel", ["embree", "numpy"])
@pytest.mark.parametrize("executor", ["processes", "threads", "spawn"])
def test_ctrl_c_at_two_hundred_moments(executor: str, accel: str) -> None:
    """From the beginning of a render to its first samples, and while children are forked."""
    seconds = tries(executor, accel, "any", 17, seed=2)
    seconds += tries(executor, accel, "any" if executor == "threads" else "fork", 17, seed=3)
    ordered = sorted(seconds)
    assert ordered[len(ordered) // 2] < SOON  # a busy machine may be slower now and then
    print(executor, accel, "median", ordered[len(ordered) // 2], "longest", ordered[-3:])


def test_signals_wait_for_the_end_of_a_block() -> None:
    """Handlers of the program come back; the second signal of a kind waits where that is asked for."""
    done: list[tuple[int, bool]] = []

    def begin(presses: int, also_the_second: bool) -> None:
        with deferred_signals(also_the_second):
            for _ in range(presses):
                signal.raise_signal(signal.SIGINT)
            done.append((presses, also_the_second))
        pytest.fail("went on")

    for presses, also_the_second in ((1, False), (2, False), (2, True)):
        with pytest.raises(KeyboardInterrupt):
            begin(presses, also_the_second)
        assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    assert done == [(1, False), (2, True)]


def test_a_handler_that_sets_a_flag_need_not_wait() -> None:
    stop, seen = SharedInt(), []

    def press() -> None:
        with InterruptHandler(stop), deferred_signals():
            signal.raise_signal(signal.SIGINT)
            seen.append(stop.value)

    with pytest.raises(KeyboardInterrupt):
        press()
    assert seen == [STOP]


def test_other_threads_defer_nothing() -> None:

    def work() -> None:
        with deferred_signals():
            done.append(True)

    done: list[bool] = []
    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert done


@pytest.mark.parametrize("error", [OSError("no more processes"), KeyboardInterrupt()])
def test_children_end_where_not_all_can_be_started(error, monkeypatch):
    pool = ProcessPool("fork", 3, SharedInt())
    make = pool._context.Process

    def process(*given: object, **options: object) -> object:
        if len(pool._context.processes) == 2:
            raise error
        return make(*given, **options)

    monkeypatch.setattr(pool._context, "Process", process)
    with pytest.raises(type(error)):
        pool.submit(int)
    assert len(pool._context.processes) == 2
    assert not any(each.is_alive() for each in pool._context.processes)
