"""Renders by the executor of mpi4py: the same bits. Skipped where mpi4py, or an MPI library, is missing."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("mpi4py", reason="mpi4py is not installed")
pytestmark = pytest.mark.slow
FOLDERS = str(Path(sys.executable).parent) + os.pathsep + os.environ.get("PATH", "")
MPIEXEC = shutil.which("mpiexec", path=FOLDERS)

# Own classes are sent with their code.
SCRIPT = """
import os, signal, sys
import numpy as np
import wavefront as wf

class Lambert(wf.Bsdf):
    def __init__(self, folder):
        self.folder = folder

    def f(self, wo, wi):
        open(f"{self.folder}/{os.getpid()}", "w").close()
        return np.float32(0.8 / np.pi) * np.broadcast_to(wi[2] > 0, wi.shape)

class Broken(wf.Bsdf):
    def f(self, wo, wi):
        raise ZeroDivisionError("no such material")

def render(material, spp, executor, **options):
    camera = wf.Camera.look_at((0, 1, 5), (0, 0, 0), size=(64, 48))
    scene = wf.Scene([wf.Sphere((0, 0, 0), 1, material=material)], [wf.Environment(1)], camera)
    options = {"progress": False, "wave_size": 4000} | options
    return wf.render(scene, spp, executor=executor, strict=True, **options)

if __name__ == "__main__":
    from mpi4py.futures import MPIPoolExecutor
    lambert = Lambert(sys.argv[1])
    with MPIPoolExecutor(*map(int, sys.argv[2:])) as pool:
        image = render(lambert, 64, pool)
        workers = set(os.listdir(sys.argv[1])) - {str(os.getpid())}
        print("workers", image.metadata["workers"], image.metadata["executor"], len(workers))
        try:
            render(Broken(), 4, pool)
        except wf.RenderError as error:
            print(error)
        def stop(done, total):
            if done:
                os.kill(os.getpid(), signal.SIGINT)
        try:
            render(lambert, 100_000, pool, progress=stop)
        except wf.Interrupted as stopped:
            print("interrupted", stopped.image.spp < 100_000)
        again = render(lambert, 64, pool)
    expected = render(lambert, 64, "threads", workers=1)
    print("equal", [(each.rgb == expected.rgb).all().item() for each in (image, again)])
"""


@pytest.mark.parametrize(
    "launch",
    [
        pytest.param([], id="spawned"),
        pytest.param(
            [MPIEXEC, "-n", "3"], marks=pytest.mark.skipif(not MPIEXEC, reason="no mpiexec"), id="mpiexec"
        ),
    ],
)
def test_workers_of_mpi_give_the_same_bits(launch: list[str], tmp_path: Path) -> None:
    """Two of them, also after a failure and after Ctrl-C; the pool says how many it has."""
    script, seen = tmp_path / "script.py", tmp_path / "seen"
    script.write_text(SCRIPT)
    seen.mkdir()
    module = ["-m", "mpi4py.futures"] if launch else []
    count = [] if launch else ["2"]
    command = [*launch, sys.executable, *module, str(script), str(seen), *count]
    # After a timeout MPI kills the process group of the script, which must not be that of the tests.
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, start_new_session=True)
    assert done.returncode == 0, done.stderr
    lines = done.stdout.splitlines()
    assert lines[0] == "workers 2 MPIPoolExecutor 2"
    assert "failed 3 times, at last by: ZeroDivisionError: no such material" in lines[1]
    assert lines[2:] == ["interrupted True", "equal [True, True]"]
