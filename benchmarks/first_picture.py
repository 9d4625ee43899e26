"""Import time, and time from process start to a picture in a file, beside Mitsuba 3.

python benchmarks/first_picture.py [--repeat 5]

The picture is the Cornell box at 256x256 and 16 spp. Every run is a process of its own, the two
sides in turn; `llvm_ad_rgb` is measured with an empty cache of compiled kernels and with a full one.
Needs `pip install wavefront[bench]` and an LLVM library (DRJIT_LIBLLVM_PATH).
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from statistics import median

HERE = Path(__file__).resolve().parent
OURS = """
import sys
sys.path.insert(0, {examples!r})
import wavefront as wf
from cornell_box import cornell_box
wf.render(cornell_box(256), 16, max_bounces=7, accel={accel!r}, progress=False).save({out!r})
"""
THEIRS = """
import sys
sys.path[:0] = [{examples!r}, {here!r}]
import mitsuba as mi
mi.set_variant({variant!r})
from cornell_box import cornell_box
from mitsuba_scene import to_mitsuba
scene = to_mitsuba(mi, cornell_box(256), 7, spp=16)
mi.util.write_bitmap({out!r}, mi.render(scene, spp=16))
"""


def seconds(code: str, home: str) -> float:
    """Run a Python process and return its wall time."""
    begin = time.perf_counter()
    subprocess.run([sys.executable, "-c", code], check=True, env={**os.environ, "HOME": home})
    return time.perf_counter() - begin


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--repeat", type=int, default=5)
    repeat = parser.parse_args().repeat
    with tempfile.TemporaryDirectory() as folder:
        names = {
            "examples": str(HERE.parent / "examples"),
            "here": str(HERE),
            "out": str(Path(folder) / "out.png"),
        }
        jobs = {
            "import numpy": "import numpy",
            "import wavefront": "import wavefront",
            "import mitsuba": "import mitsuba; mitsuba.set_variant('llvm_ad_rgb')",
            "wavefront numpy": OURS.format(accel="numpy", **names),
            "wavefront embree": OURS.format(accel="embree", **names),
            "mitsuba scalar_rgb": THEIRS.format(variant="scalar_rgb", **names),
            "mitsuba llvm_ad_rgb, cold": THEIRS.format(variant="llvm_ad_rgb", **names),
            "mitsuba llvm_ad_rgb, cached": THEIRS.format(variant="llvm_ad_rgb", **names),
        }
        times: dict[str, list[float]] = {name: [] for name in jobs}
        kept = tempfile.mkdtemp(dir=folder)
        for _ in range(repeat):
            for name, code in jobs.items():
                home = tempfile.mkdtemp(dir=folder) if "cold" in name else kept
                times[name].append(seconds(code, home))
    for name, values in times.items():
        print(f"{name:30}{median(values):8.2f} s")
