"""Samples per second on the Cornell box: this project beside other renderers, measured in turn.

python benchmarks/cornell_peers.py [--bpy-python PATH] [--prototype PATH] [--repeat 5]

Needs `pip install -e '.[bench]'`. Cycles joins when --bpy-python names a Python that has `bpy`
installed; --prototype names a script with a function render(res=, spp=). 256x256, 64 spp, eight
path edges, all cores, scene set-up and compilation left out.
"""

from __future__ import annotations

import argparse
import importlib.util
import sys
import time
from collections.abc import Callable
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np
from cycles_peer import Cycles
from mitsuba_scene import to_mitsuba

import wavefront as wf

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "examples"))
from cornell_box import cornell_box

SIZE, MAX_BOUNCES = 256, 7


def ours(spp: int, accel: str) -> Callable[[], np.ndarray]:
    """Return a function that renders with wavefront."""
    scene = cornell_box(SIZE)
    plain = {"branches": 1, "reuse": False, "progress": False}  # samples are counted: each must be one path
    return lambda: wf.render(scene, spp, max_bounces=MAX_BOUNCES, accel=accel, **plain).rgb


def mitsuba(spp: int, variant: str) -> Callable[[], np.ndarray]:
    """Return a function that renders with Mitsuba, warmed up."""
    import mitsuba as mi

    mi.set_variant(variant)
    scene = to_mitsuba(mi, cornell_box(SIZE), MAX_BOUNCES)
    np.array(mi.render(scene, spp=1))
    return lambda: np.array(mi.render(scene, spp=spp))


def prototype(path: str, spp: int) -> Callable[[], np.ndarray]:
    """Return a function that calls render() of the script at `path`."""
    sys.path.insert(0, str(Path(path).parent))
    spec = importlib.util.spec_from_file_location("prototype", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)

    def render() -> np.ndarray:
        with np.errstate(all="ignore"):
            return np.asarray(module.render(res=SIZE, spp=spp))

    return render


def clock(render: Callable[[], Any]) -> Callable[[], float]:
    """Return a function that gives the seconds of one render."""

    def seconds() -> float:
        begin = time.perf_counter()
        render()
        return time.perf_counter() - begin

    return seconds


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--spp", type=int, default=64)
    parser.add_argument("--repeat", type=int, default=5)
    parser.add_argument("--bpy-python", help="a Python that has bpy")
    parser.add_argument("--prototype", help="path of a script with render(res=, spp=)")
    options = parser.parse_args()
    sides = {
        "wavefront numpy": clock(ours(options.spp, "numpy")),
        "wavefront embree": clock(ours(options.spp, "embree")),
        "mitsuba scalar_rgb": clock(mitsuba(options.spp, "scalar_rgb")),
    }
    if options.bpy_python:
        peer = Cycles(options.bpy_python, cornell_box(SIZE), options.spp, MAX_BOUNCES)
        peer.seconds()  # warm up
        sides["cycles"] = peer.seconds
    if options.prototype:
        sides["prototype"] = clock(prototype(options.prototype, options.spp))
    times: dict[str, list[float]] = {name: [] for name in sides}
    for _ in range(options.repeat):
        for name, seconds in sides.items():
            times[name].append(seconds())
    samples = SIZE * SIZE * options.spp / 1e6
    base = median(times["wavefront numpy"])
    print(f"{'':20}{'million samples/s':>18}{'wavefront numpy is':>20}")
    for name, values in times.items():
        print(f"{name:20}{samples / median(values):18.2f}{median(values) / base:19.2f}x")
