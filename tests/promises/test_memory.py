"""Out of memory: refused before work where it can be known, else an error that has the picture so far."""

from __future__ import annotations

import subprocess
import sys
from itertools import count
from typing import Any

import pytest
import scenes
from inside import available_memory, check_memory

import wavefront as wf

linux = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="limits of Linux")

LIMITED = """
import resource, sys
import wavefront as wf
from wavefront.drive import session
import wavefront.workers.processes
mesh = wf.Mesh(*{mesh})
camera = wf.Camera.look_at((0, 0, 4), (0, 0, 0), size=(96, 96))
scene = wf.Scene([mesh, wf.Sphere((0, -100, 0), 99)], [wf.Environment(1.0)], camera)
wf.render(scene, 1, progress=False, accel="numpy")  # all modules are there from now on
pages = int(open("/proc/self/statm").read().split()[0])
limit = pages * resource.getpagesize() + (int(sys.argv[1]) << 20)
resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
calls = []
try:
    image = wf.render(scene, 64, progress=lambda *call: calls.append(call), executor=sys.argv[2],
                      workers=2, accel="numpy")
    print("picture of", image.spp)
except (wf.RenderError, wf.SceneError) as error:
    print(type(error).__name__, error)
    if isinstance(error, wf.RenderError) and calls:
        print("so far", (error.image.metadata["samples"] if error.image else 0) == calls[-1][0])
"""


@linux
@pytest.mark.parametrize(
    ("megabytes", "executor"), [(5, "threads"), (70, "processes"), (70, "threads"), (160, "processes")]
)
@pytest.mark.first(2)
def test_without_memory_there_is_an_error(megabytes: int, executor: str) -> None:
    """One that has a type, with the picture of the waves that were done; never an abort of BLAS's."""
    script = LIMITED.format(mesh="([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])")
    done = subprocess.run(
        [sys.executable, "-c", script, str(megabytes), executor], capture_output=True, text=True, timeout=120
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith(("RenderError", "SceneError", "picture of 64")), done.stdout
    assert megabytes > 5 or "memory" in done.stdout
    assert "so far False" not in done.stdout


@linux
def test_a_picture_that_does_not_fit_is_refused() -> None:
    """Before the scene is built, with how much it needs and what there is; a lazy system would give it."""
    camera = wf.Camera.look_at((0, 0, 4), (0, 0, 0), size=(2**16, 2**16))
    scene = wf.Scene([wf.Sphere((0, 0, 0), 1)], [wf.Environment(1.0)], camera)
    message = r"a picture of 65536x65536 pixels needs [\d,]+ MB of memory; [\d,]+ MB are available"
    if available_memory() > 10**12:
        pytest.skip("this machine has a terabyte")
    with pytest.raises(wf.SceneError, match=message):
        wf.render(scene, 1, progress=False)


def test_memory_that_is_there_is_not_refused() -> None:
    """And what is not is named."""
    check_memory("nothing", 0)
    with pytest.raises(wf.SceneError, match=r"all needs 1,000,000,000,000,000 MB of memory; .* available"):
        check_memory("all", 10**21)


def test_the_picture_so_far_is_kept_when_memory_runs_out(fails: Any) -> None:
    calls = count()
    fails(
        "wavefront.drive.picture.Picture.add",
        MemoryError("no room"),
        lambda *given, **options: next(calls) >= 4,
    )
    with pytest.raises(wf.RenderError, match="out of memory: no room; use fewer workers") as caught:
        wf.render(scenes.everything(), 64, wave_size=300, workers=1, progress=False)
    assert 0 < caught.value.image.metadata["samples"] <= 4 * 300


def test_no_memory_for_the_scene_is_an_error_without_a_picture(fails: Any) -> None:
    fails("wavefront.drive.prepared_scene.compile_scene", MemoryError("no room"))
    with pytest.raises(wf.RenderError, match="out of memory while the scene was set up: no room") as caught:
        wf.render(scenes.everything(), 1, progress=False)
    assert caught.value.image is None
