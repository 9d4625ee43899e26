"""Renders beside other things: threads, worker processes, asyncio, notebooks and other libraries.

Warnings are errors in all tests.
"""

from __future__ import annotations

import asyncio
import multiprocessing
import subprocess
import sys
import threading
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scenes
from inside import executors, single_threaded_blas
from threadpoolctl import threadpool_info, threadpool_limits

import wavefront as wf

QUIET = {"progress": False, "wave_size": 500}
LINUX = sys.platform.startswith("linux")
needs_fork = pytest.mark.skipif(not LINUX, reason="needs fork")
NAMES = [
    "threads",
    pytest.param("processes", marks=needs_fork),
    pytest.param("spawn", marks=pytest.mark.slow),
]


def bits(executor: str = "threads", workers: int = 2, **settings: Any) -> bytes:
    """Render, and return the bits of the picture."""
    settings = {"workers": workers, "executor": executor, **QUIET, **settings}
    return wf.render(scenes.everything(), 8, **settings).rgb.tobytes()


@pytest.fixture(scope="module")
def expected() -> bytes:
    """The bits of one worker."""
    return bits(workers=1)


@pytest.mark.parametrize("executor", NAMES)
@pytest.mark.first(1)
def test_two_renders_at_once(executor: str, expected: bytes) -> None:
    """In two threads; BLAS has as many threads as before when both are over."""
    before = threadpool_info()
    with ThreadPoolExecutor(2) as pool:
        assert list(pool.map(bits, [executor] * 4)) == [expected] * 4
    assert threadpool_info() == before
    assert not [each.name for each in threading.enumerate() if each.name.startswith("wavefront")]
    assert not multiprocessing.active_children()


def blas_threads() -> set[int]:
    """Return how many threads libraries of BLAS have."""
    return {each["num_threads"] for each in threadpool_info() if each["user_api"] == "blas"}


@pytest.mark.parametrize("executor", NAMES)
@pytest.mark.first(1)
def test_blas_has_its_threads_back_after_a_render(executor: str, expected: bytes) -> None:
    """Although a thread of the render's own ends it, and the caller has set their number."""
    with threadpool_limits(3, "blas"):
        for _ in range(2):
            assert bits(executor) == expected
            assert blas_threads() == {3}


def test_blas_is_held_to_one_thread_by_any_thread() -> None:
    """Also where the caller has set the number in another one, and can set it again."""

    def held() -> set[int]:
        with single_threaded_blas:
            return blas_threads()

    with ThreadPoolExecutor(1) as pool, threadpool_limits(3, "blas"):
        assert pool.submit(held).result() == {1}
        assert blas_threads() == {3}
        with threadpool_limits(2, "blas"):
            assert blas_threads() == {2}
        assert blas_threads() == {3}


@pytest.mark.parametrize(
    "method", [pytest.param("fork", marks=needs_fork), pytest.param("spawn", marks=pytest.mark.slow)]
)
@pytest.mark.parametrize("executor", NAMES)
def test_a_render_in_a_worker_process(method: str, executor: str, expected: bytes) -> None:
    with ProcessPoolExecutor(1, multiprocessing.get_context(method)) as pool:
        assert pool.submit(bits, executor).result() == expected


@pytest.mark.parametrize("executor", NAMES)
@pytest.mark.first(1)
def test_a_render_in_asyncio(executor: str, expected: bytes) -> None:
    begun, turned = threading.Event(), threading.Event()

    def wait_for_a_turn(done: int, total: int) -> None:
        begun.set()
        assert turned.wait(60)

    async def both() -> tuple[bytes, bytes]:
        render = asyncio.create_task(asyncio.to_thread(bits, executor, progress=wait_for_a_turn))
        while not render.done():
            await asyncio.sleep(0.001)
            if begun.is_set():
                turned.set()
        return await render, bits(executor)

    assert asyncio.run(both()) == (expected, expected)


@pytest.mark.parametrize("executor", [None, "threads", pytest.param("spawn", marks=pytest.mark.slow)])
def test_beside_threads_of_blas(executor, expected, monkeypatch):
    """That multiply all the while: a fork would wait for them forever, so by default there is none."""
    monkeypatch.setattr(executors, "MIN_PATHS", 1)
    over, begun = threading.Event(), threading.Semaphore(0)
    matrix = np.ones((300, 300))

    def multiply() -> None:
        matrix @ matrix
        begun.release()
        while not over.is_set():
            matrix @ matrix

    others = [threading.Thread(target=multiply, daemon=True) for _ in range(2)]
    for each in others:
        each.start()
        assert begun.acquire(timeout=60)
    try:
        image = wf.render(scenes.everything(), 8, workers=2, executor=executor, **QUIET)
    finally:
        over.set()
        for each in others:
            each.join(60)
    assert image.rgb.tobytes() == expected
    assert image.metadata["executor"] == (executor or "threads")


@pytest.mark.parametrize("executor", NAMES)
def test_beside_threads_that_python_warns_of(executor: str) -> None:
    """A script with threads and a pool of its own ends, with nothing on stderr."""
    script = f"""
import threading
import numpy as np
import wavefront as wf
from concurrent.futures import ThreadPoolExecutor
pool = ThreadPoolExecutor(2)
list(pool.map(np.linalg.inv, np.stack([np.eye(200)] * 8)))
ball = [wf.Sphere((0, 0, 0), 1), wf.Environment(1)]
for _ in range(2):
    print(wf.render(ball, 4, size=(16, 16), workers=2, executor={executor!r}, progress=False).rgb.sum())
"""
    command = [sys.executable, "-W", "error", "-c", script]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120)
    assert done.stderr == ""
    assert len(done.stdout.split()) == 2
    assert len(set(done.stdout.split())) == 1


NOTEBOOK = """
import warnings
warnings.simplefilter("error")
import numpy as np
import wavefront as wf
class Gray(wf.Bsdf):
    def f(self, wo, wi):
        return (wi[2] > 0) * np.full_like(wi, 0.1)
ball = [wf.Sphere((0, 0, 0), 1, material=Gray()), wf.Environment(1)]
sums = {str(wf.render(ball, 8, size=(32, 32), workers=2, executor=executor).rgb.sum())
        for executor in ("threads", "processes", "spawn", None)}
print(len(sums), end="")
"""


@pytest.mark.slow
@pytest.mark.filterwarnings("default")  # of the client that runs the notebook
@needs_fork
def test_a_render_in_a_notebook(tmp_path: Path) -> None:
    """With classes of the notebook, in every kind of worker; a second cell renders again."""
    nbformat = pytest.importorskip("nbformat")
    nbclient = pytest.importorskip("nbclient")
    pytest.importorskip("ipykernel")
    cells = [nbformat.v4.new_code_cell(NOTEBOOK) for _ in range(2)]
    notebook = nbformat.v4.new_notebook(cells=cells)
    nbclient.NotebookClient(
        notebook, timeout=120, kernel_name="python3", resources={"metadata": {"path": str(tmp_path)}}
    ).execute()
    for cell in notebook.cells:
        written = [output.text for output in cell.outputs if output.output_type == "stream"]
        assert written == ["1"], cell.outputs  # beside the pictures that notebooks show
