"""The Cornell box full of fog, beside the same scene in Mitsuba 3 (volpath): samples/s and equal error.

python benchmarks/fog.py [--variants llvm_ad_rgb scalar_rgb] [--spp 32] [--size 128] [--runs 6]

Needs `pip install -e '.[bench]'`. CPU seconds are those of all threads. The cost at equal error is the CPU
time times the mean variance of the pixels, over that of wavefront. The means of both should agree.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import wavefront as wf

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "examples"))
from cornell_box import cornell_box  # noqa: E402
from mitsuba_scene import to_mitsuba  # noqa: E402
from options import several  # noqa: E402

ABSORPTION, SCATTERING, G, BOUNCES = 0.1, 0.5, 0.3, 7
HALF = 0.999  # of the box of fog: the camera is outside


def ours(size: int) -> wf.Scene:
    """Return the room with fog."""
    fog = wf.Medium(ABSORPTION, SCATTERING, phase=wf.HenyeyGreenstein(G))
    scene = cornell_box(size)
    return scene.add(wf.Box((0, 0, 0), 2 * HALF, material=wf.Material(wf.NullSurface(), interior=fog)))


def theirs(mi: Any, size: int) -> Any:
    """Return the same for Mitsuba."""

    def load_dict(description: dict[str, Any]) -> Any:
        if description.get("type") == "scene":
            description["integrator"] = {"type": "volpath", "max_depth": BOUNCES + 1}
            description["fog"] = {
                "type": "cube",
                "to_world": mi.ScalarTransform4f().scale(HALF),
                "bsdf": {"type": "null"},
                "interior": {
                    "type": "homogeneous",
                    "sigma_t": ABSORPTION + SCATTERING,
                    "albedo": SCATTERING / (ABSORPTION + SCATTERING),
                    "phase": {"type": "hg", "g": G},
                },
            }
        return mi.load_dict(description)

    class WithFog:
        def __getattr__(self, name: str) -> Any:
            return load_dict if name == "load_dict" else getattr(mi, name)

    return to_mitsuba(WithFog(), cornell_box(size), BOUNCES)


def measure(name: str, draw: Callable[[int], np.ndarray], runs: int, samples: int) -> tuple[float, float]:
    """Print the speed and the mean of a renderer; return CPU seconds and the mean variance of a picture."""
    draw(1000)
    pictures, seconds = [], []
    for seed in range(runs):
        start = time.process_time()
        pictures.append(draw(seed))
        seconds.append(time.process_time() - start)
    stack = np.stack(pictures).astype(np.float64)
    variance, cpu = float(stack.var(0, ddof=1).mean()), float(np.median(seconds))
    print(
        f"{name:14} {samples / cpu / 1e3:9.1f} ksamples/CPU-s  mean {stack.mean((0, 1, 2)).round(4)}  ",
        end="",
    )
    return cpu, variance


def main() -> None:
    """Print a line for each renderer."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--variants", nargs="*", default=["llvm_ad_rgb", "scalar_rgb"])
    parser.add_argument("--spp", type=int, default=32)
    parser.add_argument("--size", type=int, default=128)
    parser.add_argument("--runs", type=several, default=6, help="2 or more")
    options = parser.parse_args()
    spp, size = options.spp, options.size
    scene = ours(size)

    def render(seed: int) -> np.ndarray:
        more: dict[str, Any] = {"workers": 1, "progress": False, "max_bounces": BOUNCES, "seed": seed}
        return wf.render(scene, spp, **more).rgb

    cpu, variance = measure("wavefront", render, options.runs, spp * size * size)
    print()
    for variant in options.variants:
        import mitsuba as mi

        mi.set_variant(variant)
        other = theirs(mi, size)

        def draw(seed: int, other: Any = other) -> np.ndarray:
            return np.asarray(mi.render(other, spp=spp, seed=seed))[..., :3]

        time_of, variance_of = measure(variant, draw, options.runs, spp * size * size)
        print(f"cost at equal error {time_of * variance_of / (cpu * variance):.2f} of wavefront's")


if __name__ == "__main__":
    main()
