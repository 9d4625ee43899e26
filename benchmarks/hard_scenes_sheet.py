"""A sheet of the hard scenes at equal time: plain, guided with paths re-used, Mitsuba and Cycles.

python benchmarks/hard_scenes_sheet.py --bpy-python PATH [--references FOLDER] [--seconds 4] [--out sheet.png]

Each side takes as many samples per pixel as it draws in the given time, with the training of a guide. Two
short renders say how many these are; where the picture then takes a tenth more or less time, the number is
corrected once. A picture is the second one that its side draws, so that Mitsuba has compiled its kernels.
Under it stand its paths per pixel (branches counted), its time, and its relative MSE to the reference of
error_vs_time.py, which --references keeps. Run it on a quiet machine: it takes five minutes, besides the
references.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from pathlib import Path

import matplotlib as mpl
import numpy as np
import PIL.Image
from hard_scenes import HARD_SCENES
from references import References, relative_mse
from renderers import Render, renderer

import wavefront as wf

mpl.use("Agg")
import matplotlib.pyplot as plt

SIDES = {
    "plain": "wavefront auto plain",
    "guided, re-used": "wavefront auto guided/reused",
    "Mitsuba multijitter": "llvm_ad_rgb multijitter",
    "Cycles, guided": "cycles guided",
}
TITLES = {
    "ceiling": "lamp at the ceiling",
    "ajar": "door ajar",
    "window": "sky through a window",
    "corridor": "corridor, glossy floor",
}
MAX_BOUNCES = 12
PROBES = (9, 36)  # paths per pixel
CLOSE = 0.1  # of the time, which is near enough
BRIGHTNESS = 0.4  # mean of a picture as it is shown


def timed(render: Render, spp: int) -> tuple[float, np.ndarray]:
    """Return the seconds of the second of two renders, and its picture."""
    render(spp, 0)
    begin = time.perf_counter()
    picture = render(spp, 1)
    return time.perf_counter() - begin, picture


def whole(samples: float) -> int:
    """Return a number near to this that is a grid of strata: `multijitter` rounds others up."""
    rows = max(1, int(max(samples, 1) ** 0.5))
    return max(1, rows * round(samples / rows))


def at_equal_time(of: Callable[..., Render], seconds: float) -> tuple[int, float, np.ndarray]:
    """Return the samples per pixel that a side draws in so many seconds, what it took, and the picture."""
    render = of(*PROBES)
    few, many = (timed(render, spp)[0] for spp in PROBES)
    per_sample = max(many - few, many / 10) / (PROBES[1] - PROBES[0])  # clocks are not exact
    fixed = max(few - per_sample * PROBES[0], 0)
    spp = whole((seconds - fixed) / per_sample)
    taken, picture = timed(of(spp), spp)
    if abs(taken / seconds - 1) > CLOSE and taken > fixed:
        spp = whole(spp * (seconds - fixed) / (taken - fixed))
        taken, picture = timed(of(spp), spp)
    return spp, taken, picture


def main(options: argparse.Namespace) -> None:
    """Render all pictures and draw the sheet."""
    kept = References(options.references)
    figure, axes = plt.subplots(
        len(HARD_SCENES), len(SIDES), figsize=(1.7 * len(SIDES), 1.9 * len(HARD_SCENES)), squeeze=False
    )
    for row, name in zip(axes, HARD_SCENES, strict=True):
        scene = HARD_SCENES[name](options.size)
        exact = kept.mean_with_mitsuba(
            name, scene, MAX_BOUNCES, options.reference_spp, method="guided/4", variant="llvm_ad_rgb"
        )
        scale = BRIGHTNESS / exact.mean()  # one exposure for a scene
        for axis, (title, side) in zip(row, SIDES.items(), strict=True):
            spp, seconds, picture = at_equal_time(
                lambda *counts, side=side, scene=scene: renderer(
                    side, scene, MAX_BOUNCES, counts, options.bpy_python
                ),
                options.seconds,
            )
            line = f"{spp} paths, {seconds:.1f} s, error {relative_mse(picture, exact):.3f}"
            axis.imshow(wf.Image(picture * scale, 1).to_uint8())
            axis.set_xlabel(line, fontsize=6)
            axis.set(xticks=[], yticks=[])
            print(f"{name:10}{title:24}{line}", flush=True)
        row[0].set_ylabel(TITLES[name], fontsize=7)
    for axis, title in zip(axes[0], SIDES, strict=True):
        axis.set_title(title, fontsize=7)
    figure.tight_layout()
    figure.savefig(options.out, dpi=100)
    with PIL.Image.open(options.out) as drawn:  # noise compresses badly: 128 colors make a fourth of the size
        drawn.convert("RGB").quantize(128).save(options.out, optimize=True)
    print(f"wrote {options.out}")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--bpy-python", required=True, help="a Python that has bpy, for Cycles")
    parser.add_argument("--seconds", type=float, default=4.0, help="of each picture")
    parser.add_argument("--size", type=int, default=128)
    parser.add_argument("--references", type=Path, help="folder of converged pictures, made where missing")
    parser.add_argument("--reference-spp", type=int, default=2048)
    parser.add_argument("--out", type=Path, default=Path("hard_scenes.png"))
    main(parser.parse_args())
