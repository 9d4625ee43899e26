"""Where the time of a render goes, stage by stage.

python benchmarks/stages.py [--spp 16] [--size 256] [--repeat 5]

One worker, so that the stages' times add up; medians over the repeats. The scenes are the Cornell
box in one material kind, and the same room with ten materials that share nothing; a third column
has the plain room with ten materials defined on shapes that no ray can reach.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections import defaultdict
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from statistics import median
from typing import Any
from unittest import mock

import wavefront as wf
from wavefront.integrators import ladder, shared_paths, steps
from wavefront.stages import shade

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "examples"))
from cornell_box import cornell_box

STAGES = (
    "intersect",
    "emitted",
    "mis_weighted",
    "interaction",
    "shading",
    "direct",
    "branch",
    "roulette",
    "accumulate",
)


def timed(function: Callable[..., Any], name: str, clock: dict[str, float]) -> Callable[..., Any]:
    """Return `function` with its time added to clock[name]."""

    def wrapper(*args: Any, **kwargs: Any) -> Any:
        begin = time.perf_counter()
        try:
            return function(*args, **kwargs)
        finally:
            clock[name] += time.perf_counter() - begin

    return wrapper


def profile(scene: wf.Scene, spp: int, accel: str) -> dict[str, float]:
    """Render once with a clock on every stage; the shadow test is taken out of `direct`."""
    clock: dict[str, float] = defaultdict(float)
    with (
        ExitStack() as stages,
        mock.patch.object(shade, "visible", timed(shade.visible, "visible", clock)),
    ):
        for name in STAGES:  # each module that calls a stage has a name for it
            for module in (ladder, shared_paths, steps):
                if hasattr(module, name):
                    timer = timed(getattr(module, name), name, clock)
                    stages.enter_context(mock.patch.object(module, name, timer))
        image = wf.render(scene, spp, max_bounces=7, accel=accel, workers=1, branches=1, progress=False)
    clock["direct"] -= clock["visible"]
    clock["rest"] = image.metadata["seconds"] - sum(clock.values())
    clock["all"] = image.metadata["seconds"]
    return clock


def ten_materials() -> list[wf.Bsdf]:
    """Return ten materials of different kinds or with values that keep them apart."""
    return [
        wf.Diffuse(0.7),
        wf.Mirror(0.9),
        wf.Dielectric(1.5),
        wf.Conductor((0.2, 0.92, 1.1), (3.9, 2.45, 2.14)),
        wf.Conductor((0.2, 0.92, 1.1), (3.9, 2.45, 2.14), roughness=0.3),
        wf.Dielectric(1.5, roughness=0.3),
        wf.OrenNayar((0.7, 0.6, 0.5), 0.5),
        wf.Principled((0.8, 0.3, 0.2), roughness=0.4),
        wf.Principled((0.9, 0.7, 0.3), metallic=1.0, roughness=0.2, clearcoat=1.0),
        wf.Mix(wf.Diffuse(0.4), wf.Mirror(0.8), 0.3),
    ]


def scenes(size: int) -> dict[str, wf.Scene]:
    """Return the room plain, with ten materials in use, and with ten out of sight."""
    plain, mixed, idle = cornell_box(size), cornell_box(size), cornell_box(size)
    for i, material in enumerate(ten_materials()):
        x, y = -0.8 + 0.4 * (i % 5), 0.3 * (i // 5)
        mixed.shapes.append(wf.Sphere((x, y, 0), 0.14, material=material))
        plain.shapes.append(wf.Sphere((x, y, 0), 0.14))
        idle.shapes.append(wf.Sphere((x, y, 0), 0.14))
        idle.shapes.append(wf.Sphere((x, 50, 0), 0.14, material=material))
    return {"box": cornell_box(size), "10 spheres": plain, "10 materials": mixed, "10 unused": idle}


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--spp", type=int, default=16)
    parser.add_argument("--size", type=int, default=256)
    parser.add_argument("--repeat", type=int, default=5)
    parser.add_argument("--accel", default="numpy")
    options = parser.parse_args()
    subjects = scenes(options.size)
    runs: dict[str, list[dict[str, float]]] = {name: [] for name in subjects}
    for _ in range(options.repeat):
        for name, subject in subjects.items():
            runs[name].append(profile(subject, options.spp, options.accel))
    print(f"seconds of one worker, accel={options.accel}, {options.size}x{options.size}, {options.spp} spp")
    print(f"{'':14}" + "".join(f"{name:>14}" for name in subjects))
    for stage in (*STAGES, "visible", "rest", "all"):
        print(
            f"{stage:14}" + "".join(f"{median(run[stage] for run in runs[name]):14.3f}" for name in subjects)
        )
