"""The integrator "naive" beside "full" at equal time, in a room of 48 by 48 pixels.

python benchmarks/naive_vs_full.py [--size 48] [--repeats 8] [--picture naive_vs_full.png]

The rooms are the Cornell box, and the same with a lamp of half the width and length, and of the same
power. Both estimators have the same mean, so the squared error is the variance, estimated from renders with
different seeds. Time is CPU time of one thread. The renders alternate, so that a busy machine slows down
both. With `--picture` two pictures of the Cornell box that took the same CPU time are saved side by side.
"""

from __future__ import annotations

import argparse
import runpy
import time
from pathlib import Path

import numpy as np
from options import several

import wavefront as wf

EXAMPLE = Path(__file__).parents[1] / "examples" / "cornell_box.py"
NAMES = ("naive", "full")
SPP = {"naive": 64, "full": 64}
PANEL, PICTURE_SPP = 300, 96  # pixels of a picture, and samples per pixel of its "naive"


def room(size: int, lamp: float = 1.0) -> wf.Scene:
    """Return the Cornell box with a lamp whose sides are multiplied by `lamp`; it is as bright in all."""
    scene = runpy.run_path(str(EXAMPLE))["cornell_box"](size)
    at = next(place for place, shape in enumerate(scene.shapes) if shape.name == "light")
    light = scene.shapes[at]
    middle = light.vertices.mean(0)
    vertices = middle + (light.vertices - middle) * (lamp, 1, lamp)
    shapes = list(scene.shapes)
    shapes[at] = wf.Mesh(
        vertices, light.faces, material=light.material, emission=np.array(light.emission) / lamp**2
    )
    return wf.Scene(shapes, camera=scene.camera)


def timed(scene: wf.Scene, name: str, spp: int, seed: int) -> tuple[np.ndarray, float]:
    """Return a picture and the CPU time that it took, s."""
    begin = time.process_time()
    image = wf.render(
        scene,
        spp,
        integrator=name,
        seed=seed,
        branches=1,
        reuse=False,
        workers=1,
        executor="threads",
        progress=False,
    )
    return image.rgb.astype(np.float64), time.process_time() - begin


def measure(scene: wf.Scene, repeats: int) -> dict[str, tuple[float, float, float]]:
    """Return mean squared error, CPU time and mean of each estimator."""
    found: dict[str, list[tuple[np.ndarray, float]]] = {name: [] for name in NAMES}
    for seed in range(-1, repeats):  # the first round warms up
        for name in NAMES:
            result = timed(scene, name, SPP[name], seed + 1)
            if seed >= 0:
                found[name].append(result)
    summary = {}
    for name, results in found.items():
        pictures = np.stack([picture for picture, _ in results])
        error = float(pictures.var(0, ddof=1).mean())
        summary[name] = error, float(np.median([each for _, each in results])), float(pictures.mean())
    return summary


def save_picture(path: str) -> None:
    """Save both pictures of the same CPU time, and print what they have."""
    from PIL import Image as Pillow

    scene = room(PANEL)
    pace = {name: min(timed(scene, name, 16, seed)[1] for seed in range(4)) for name in NAMES}
    spp = {"naive": PICTURE_SPP, "full": round(PICTURE_SPP * pace["naive"] / pace["full"])}
    (naive, seconds), (full, taken) = (timed(scene, name, spp[name], 0) for name in NAMES)
    print(f"picture: naive {spp['naive']} spp in {seconds:.1f} s, full {spp['full']} spp in {taken:.1f} s")
    pair = np.concatenate([naive, full], 1).astype(np.float32)
    Pillow.fromarray(wf.Image(pair).to_uint8()).save(path, optimize=True)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description='"naive" beside "full" at equal time.')
    parser.add_argument("--size", type=int, default=48)
    parser.add_argument("--repeats", type=several, default=8, help="2 or more")
    parser.add_argument("--picture")
    options = parser.parse_args()
    print(f"{'lamp':<6}{'estimator':<11}{'mean':>8}{'MSE':>12}{'CPU s':>8}{'MSE · s':>11}{'ratio':>8}")
    for label, lamp in (("whole", 1.0), ("half", 0.5)):
        summary = measure(room(options.size, lamp), options.repeats)
        best = summary["full"][0] * summary["full"][1]
        for name, (error, seconds, mean) in summary.items():
            cost = error * seconds
            numbers = f"{mean:>8.4f}{error:>12.3e}{seconds:>8.2f}{cost:>11.3e}{cost / best:>8.1f}"
            print(f"{label:<6}{name:<11}{numbers}")
    if options.picture:
        save_picture(options.picture)
