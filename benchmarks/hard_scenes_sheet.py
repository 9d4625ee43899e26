"""A sheet of the hard scenes at equal time: plain, guided with four branches, Mitsuba and Cycles.

python benchmarks/hard_scenes_sheet.py --bpy-python PATH [--seconds 4] [--size 128] [--out sheet.png]

The sample counts follow from the times of renders of 4 and 16 paths per pixel, branches counted; the time of
training a guide counts. A picture is the second one that its side draws, so that Mitsuba has compiled
its kernels.
`--spp 93,40,196,50` gives the counts of the four sides instead, for a machine too busy to measure times.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

import matplotlib as mpl
import numpy as np
import PIL.Image
from error_vs_time import Render, Subject, renderer
from hard_scenes import HARD_SCENES

import wavefront as wf

mpl.use("Agg")
import matplotlib.pyplot as plt

SIDES = {
    "plain": "wavefront auto sobol",
    "guided, four branches": "wavefront auto guided/4",
    "Mitsuba multijitter": "llvm_ad_rgb multijitter",
    "Cycles, guided": "cycles guided",
}
TITLES = {
    "ceiling": "lamp at the ceiling",
    "ajar": "door ajar",
    "window": "sky through a window",
    "corridor": "corridor, glossy floor",
}
PROBES = (4, 16)  # paths per pixel
BRIGHTNESS = 0.4  # mean of a picture as it is shown


def timed(render: Render, spp: int) -> tuple[float, np.ndarray]:
    """Return the seconds of the second of two renders, and its picture."""
    render(spp, 0)
    begin = time.perf_counter()
    picture = render(spp, 1)
    return time.perf_counter() - begin, picture


def drawer(name: str, side: str, options: argparse.Namespace) -> Callable[..., Render]:
    """Return a function that makes the renderer of a side for some sample counts."""
    build = partial(HARD_SCENES[name], options.size)
    scene = build()
    return lambda *spp: renderer(side, scene, Subject(build, 12, spp, (), "sobol"), options.bpy_python)


def at_equal_time(of: Callable[..., Render], seconds: float) -> tuple[np.ndarray, str]:
    """Return a picture that takes so many seconds, and a line that says what it took."""
    render = of(*PROBES)
    few, many = (timed(render, spp)[0] for spp in PROBES)
    per_sample = max(many - few, 1e-3) / (PROBES[1] - PROBES[0])
    spp = max(1, PROBES[0] + round((seconds - few) / per_sample))
    taken, picture = timed(of(spp), spp)
    return picture, f"{spp} paths, {taken:.1f} s"


def main(options: argparse.Namespace) -> None:
    """Render all pictures and draw the sheet."""
    counts = [int(count) for count in options.spp.split(",")] if options.spp else [0] * len(SIDES)
    figure, axes = plt.subplots(
        len(HARD_SCENES), len(SIDES), figsize=(1.7 * len(SIDES), 1.8 * len(HARD_SCENES)), squeeze=False
    )
    for row, name in zip(axes, HARD_SCENES, strict=True):
        scale = None
        for axis, (title, side), spp in zip(row, SIDES.items(), counts, strict=True):
            of = drawer(name, side, options)
            picture, line = (of(spp)(spp, 1), f"{spp} paths") if spp else at_equal_time(of, options.seconds)
            scale = scale or BRIGHTNESS / picture.mean()  # one exposure for a scene
            axis.imshow(wf.Image(picture * scale, 1).to_uint8())
            axis.set_title(f"{title}\n{line}", fontsize=6.5)
            axis.set(xticks=[], yticks=[])
            print(f"{name:10}{title:24}{line}", flush=True)
        row[0].set_ylabel(TITLES[name], fontsize=7)
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
    parser.add_argument("--spp", help="sample counts of the four sides, in place of --seconds")
    parser.add_argument("--size", type=int, default=128)
    parser.add_argument("--out", type=Path, default=Path("hard_scenes.png"))
    main(parser.parse_args())
