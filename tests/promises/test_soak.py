"""Many renders one after the other leave nothing behind."""

import subprocess
import sys
from pathlib import Path

import pytest

SOAK = Path(__file__).parents[2] / "benchmarks" / "soak.py"
MINUTES = 2  # of `python benchmarks/soak.py`; 20 by default


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
def test_memory_is_flat_and_nothing_leaks():
    done = subprocess.run(
        [sys.executable, SOAK, "--minutes", str(MINUTES)], capture_output=True, text=True, check=False
    )
    print(done.stdout)
    assert done.returncode == 0, done.stdout + done.stderr[-3000:]
