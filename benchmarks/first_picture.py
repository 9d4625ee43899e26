"""Import time, and time from process start to a picture in a file, beside Mitsuba 3.

python benchmarks/first_picture.py [--repeat 5]

The picture is the Cornell box at 256x256 and 16 spp, Mitsuba's own for Mitsuba. Every run is a process
of its own, the sides in turn; `llvm_ad_rgb` is measured with an empty cache of compiled kernels and with
a full one.
Needs `pip install -e '.[bench]'` and an LLVM library (DRJIT_LIBLLVM_PATH).
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
wf.render(cornell_box(256), 16, max_bounces=7, branches=1, accel={accel!r}, progress=False).save({out!r})
"""
THEIRS = """
import mitsuba as mi
mi.set_variant({variant!r})
box = mi.cornell_box()
box["sensor"]["film"] = dict(type="hdrfilm", width=256, height=256, rfilter=dict(type="box"))
mi.util.write_bitmap({out!r}, mi.render(mi.load_dict(box), spp=16))
"""


def seconds(code: str, home: str) -> float:
    """Run a Python process, which may keep bytecode as it does by default, and return its wall time."""
    environment = {**os.environ, "HOME": home}
    environment.pop("PYTHONDONTWRITEBYTECODE", None)
    begin = time.perf_counter()
    subprocess.run([sys.executable, "-c", code], check=True, env=environment)
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
        for code in jobs.values():  # a first time, for bytecode and compiled kernels
            seconds(code, kept)
        for _ in range(repeat):
            for name, code in jobs.items():
                home = tempfile.mkdtemp(dir=folder) if "cold" in name else kept
                times[name].append(seconds(code, home))
    for name, values in times.items():
        print(f"{name:30}{median(values):8.2f} s")
