"""A render in a process of multiprocessing ends soon after the process that started it."""

from __future__ import annotations

import multiprocessing
import signal
import sys

import pytest
from inside import interrupt
from scripts import CLOSED, SOON, eventually, runs, start_python

import wavefront as wf

POOL = """
import os
def work(number):
    sys.stdout.write(f"{os.getpid()}\\n")
    sys.stdout.flush()
    wf.render(closed, 64, executor="threads", max_bounces=65536, progress=False)
"""
STARTS = {
    "pool": "with multiprocessing.get_context('fork').Pool(2) as pool:\n    pool.map(work, range(2))",
    "process": "context = multiprocessing.get_context('fork')\n"
    "for _ in range(2):\n    context.Process(target=work, args=(0,)).start()\nrest()",
    "futures": "from concurrent.futures import ProcessPoolExecutor as Pool\n"
    "with Pool(2, multiprocessing.get_context('fork')) as pool:\n    list(pool.map(work, range(2)))",
}


class Ended:
    """In place of a parent that has ended."""

    sentinel = 0

    def is_alive(self) -> bool:
        return False


def test_a_render_is_interrupted_where_the_parent_has_ended(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(interrupt, "ORPHAN_TIMEOUT", 1e6)
    scene = wf.Scene([wf.Sphere((0, 0, 0), 1)], [wf.Environment(1)])
    wf.render(scene, 1, size=(4, 4), executor="threads", progress=False)
    monkeypatch.setattr(multiprocessing, "parent_process", Ended)
    with pytest.raises(wf.Interrupted):
        wf.render(scene, 1, size=(4, 4), executor="threads", progress=False)


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="processes are looked for in /proc")
@pytest.mark.parametrize("start", STARTS)
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP, signal.SIGKILL])
def test_processes_end_after_the_one_that_started_them(start: str, number: signal.Signals) -> None:
    process = start_python("-c", CLOSED + POOL + STARTS[start])
    assert process.stdout is not None
    found = [int(process.stdout.readline()) for _ in range(2)]
    process.send_signal(number)
    process.wait(SOON)
    assert eventually(lambda: not any(map(runs, found)))
    process.communicate()


def test_a_parent_of_which_nothing_is_known_interrupts_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    """As those of loky's processes, which multiprocessing has not started."""
    monkeypatch.setattr(
        multiprocessing, "parent_process", lambda: multiprocessing.process._ParentProcess("parent", 1, None)
    )
    interrupt.end_with_parent()
