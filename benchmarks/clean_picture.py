"""FLIP and relative MSE of denoised pictures over CPU time, beside Mitsuba 3 and Cycles.

python benchmarks/clean_picture.py --bpy-python PATH [--scene NAME] [--size 192] [--repeat 3]

All denoise by Open Image Denoise. The eight scenes of clean_scenes.py. Sides: `wf.render(scene, spp,
denoise=True)`; Mitsuba's `llvm_ad_rgb` with its default sampler, whose pictures, albedo and normals this
package denoises; Cycles with its own use of that library, at numbers of samples and, as "adaptive", at
thresholds of its adaptive sampling. Pictures are compared with a converged one. FLIP
(Andersson et al. 2020) is that of sRGB codes of the pictures as they are, at 67 pixels per degree, its mean
over the pixels.

The seconds are those of the CPU, of all threads and processes, warm: a wavefront render includes the set-up
of its scene, the others have loaded theirs before. On a busy machine they are less wrong than wall time.

Needs `pip install -e '.[bench,metrics,denoise]'`, an LLVM library (see error_vs_time.py) and a Python
that has `bpy`.
"""

from __future__ import annotations

import argparse
import os
from collections.abc import Callable
from pathlib import Path
from statistics import median

import numpy as np
from clean_scenes import SCENES
from cycles_peer import Cycles
from error_vs_time import time_to
from mitsuba_scene import to_mitsuba
from references import References, relative_mse

import wavefront as wf

Side = Callable[[float, int], tuple[np.ndarray, float]]  # spp or threshold, seed -> picture, CPU seconds
ROOMS = ("Cornell box", "ceiling")  # whose converged pictures are by shared paths
COUNTS: dict[str, tuple[float, ...]] = {
    "wavefront": (1, 4, 16, 64),
    "mitsuba": (4, 16, 64),
    "cycles": (4, 16, 64),
    "adaptive": (1, 0.2, 0.05, 0.02),
}
MOST = 1024  # samples per pixel of adaptive sampling
GUIDES = ("denoising_albedo", "denoising_normal")


def ours(scene: wf.Scene, max_bounces: int, python: str | None) -> Side:
    """Return the side of this package."""

    def render(spp: float, seed: int) -> tuple[np.ndarray, float]:
        begin = cpu()
        image = wf.render(scene, int(spp), seed=seed, max_bounces=max_bounces, denoise=True, progress=False)
        return image.rgb, cpu() - begin

    return render


def mitsuba(scene: wf.Scene, max_bounces: int, python: str | None) -> Side:
    """Return the side of Mitsuba, denoised by this package's use of Open Image Denoise."""
    import mitsuba as mi

    mi.set_variant("llvm_ad_rgb")
    loaded = to_mitsuba(mi, scene, max_bounces, guides=True)

    def render(spp: float, seed: int) -> tuple[np.ndarray, float]:
        begin = cpu()
        layers = np.split(np.array(mi.render(loaded, spp=int(spp), seed=seed)), 3, axis=2)
        image = wf.Image(layers[0], int(spp), layers=dict(zip(GUIDES, layers[1:], strict=True))).denoise(
            "oidn"
        )
        return image.rgb, cpu() - begin

    return render


def cycles(scene: wf.Scene, max_bounces: int, python: str | None) -> Side:
    """Return the side of Cycles, which loads the scene again for each picture."""
    assert python is not None
    peer = Cycles(python, scene, 1, max_bounces, denoise=True)

    def render(spp: float, seed: int) -> tuple[np.ndarray, float]:
        begin = cpu(peer.process.pid)
        return peer.picture(spp)[..., :3], cpu(peer.process.pid) - begin

    return render


def adaptive(scene: wf.Scene, max_bounces: int, python: str | None) -> Side:
    """Return the side of Cycles with adaptive sampling, by its threshold."""
    assert python is not None
    peer = Cycles(python, scene, 1, max_bounces, denoise=True)

    def render(threshold: float, seed: int) -> tuple[np.ndarray, float]:
        begin = cpu(peer.process.pid)
        return peer.picture(MOST, threshold)[..., :3], cpu(peer.process.pid) - begin

    return render


SIDES = {"wavefront": ours, "mitsuba": mitsuba, "cycles": cycles, "adaptive": adaptive}


def cpu(process: int | None = None) -> float:
    """Return the CPU seconds of a process so far, with those of its children that have ended."""
    if process is None:
        return sum(os.times()[:4])
    fields = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    return sum(map(int, fields[11:15])) / os.sysconf("SC_CLK_TCK")


def flip(picture: np.ndarray, exact: np.ndarray) -> float:
    """Return the mean FLIP of two linear pictures as sRGB shows them."""
    codes = (wf.Image(each.astype(np.float32)).to_uint8()[..., :3] for each in (picture, exact))
    found = wf.compare(*codes).flip
    assert found is not None
    return found


def measure(name: str, options: argparse.Namespace) -> None:
    """Print the table of a scene."""
    build, max_bounces = SCENES[name]
    scene = build(options.size)
    side, spp = (
        ("wavefront embree guided/reused", 256) if name in ROOMS else ("llvm_ad_rgb multijitter", 1024)
    )
    converged = References(options.references).picture(name, scene, side, max_bounces, spp)
    exact = converged.picture[..., :3]
    print(f"\n{name}: {options.size} pixels wide, relative MSE of the reference {converged.noise:.2g}")
    if options.prepare:
        return
    rows = {}
    for side in options.sides.split(","):
        render = SIDES[side](scene, max_bounces, options.bpy_python)
        cells = []
        for spp in COUNTS[side]:
            if side == "mitsuba" or not cells:  # warm up; Mitsuba may compile anew for each sample count
                render(spp, 100)
            found = [render(spp, seed) for seed in range(options.repeat)]
            columns = ([flip(p, exact) for p, _ in found], [relative_mse(p, exact) for p, _ in found])
            cells.append((*map(median, columns), median(seconds for _, seconds in found)))
        rows[side] = cells
        shown = "".join(f"{f'{f:.3f}, {e:.5f} in {t:.2f}':>26}" for f, e, t in cells)
        print(f"{side:10}{shown}", flush=True)
    if "wavefront" not in rows:
        return
    for key, column in (("FLIP", 0), ("relative MSE", 1)):
        mine, times = [c[column] for c in rows["wavefront"]], [c[2] for c in rows["wavefront"]]
        for side in rows.keys() - {"wavefront"}:
            for spp, cell in zip(COUNTS[side], rows[side], strict=True):
                seconds, beyond = time_to(cell[column], mine, times)
                mark = "*" if beyond else "<" if cell[column] > mine[0] else ""
                at = f"threshold {spp}" if side == "adaptive" else f"{spp} spp"
                print(f"  to the {key} of {side} at {at}: {cell[2] / seconds:.2f} times as fast{mark}")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--scene", help="one of clean_scenes.py; all by default")
    parser.add_argument("--sides", default=",".join(SIDES), help="some of them")
    parser.add_argument("--size", type=int, default=192)
    parser.add_argument("--repeat", type=int, default=3)
    parser.add_argument("--references", type=Path, help="folder of converged pictures, made where missing")
    parser.add_argument("--prepare", action="store_true", help="only make the converged pictures")
    parser.add_argument("--bpy-python", help="a Python that has bpy, for Cycles")
    chosen = parser.parse_args()
    for each in [chosen.scene] if chosen.scene else SCENES:
        measure(each, chosen)
