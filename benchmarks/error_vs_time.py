"""Relative MSE over time: this project beside Mitsuba 3, on three scenes.

python benchmarks/error_vs_time.py [--scene cornell|mesh|lights|all] [--data DATA] [--out plot.png]

Sides: wavefront with each sampler, "sobol/4" with four branches and "denoised" with `denoise=True`, numpy
and embree; Mitsuba `llvm_ad_rgb` and `scalar_rgb`, each with `independent` and `multijitter`; with
`--bpy-python`, on the box, Cycles with Open Image Denoise, whose error is that against its own converged
picture, since its edges lie a part of a pixel elsewhere. All draw the same shapes with
as many bounces, a box filter and a worker per core. The reference is the mean of two converged
renders, one of each side, whose means are compared first. Printed are, for each side:

- error and wall time at each sample count, warm: medians over the repeats, the sides in turn. Mitsuba's
  scene is loaded once, beforehand; a render of wavefront includes setting up its scene, but what rays are
  traced with, which stays with the scene, has been built by the render before;
- what a fresh process takes besides, once: importing the renderer, loading the scene, compiling. It is
  the time of a process of its own, with an empty cache of compiled kernels, less that of a warm render;
- time to the error that `llvm_ad_rgb independent` has at its largest sample count, by straight lines
  between the measured points on logarithmic axes, and beyond the last by the last two (marked *); a side
  whose fewest samples have less error than that is given their time;
- speed at that error relative to `llvm_ad_rgb independent`, warm, and cold with what comes once added.

With `--keep FILE` results join those of earlier runs in that file, and the plot shows all of them, so
that the scenes can be measured one at a time. Needs `pip install -e '.[bench]'`, and for
`llvm_ad_rgb` an LLVM library (DRJIT_LIBLLVM_PATH).
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np
from cornell_peers import Cycles
from many_lights import lit
from mitsuba_scene import to_mitsuba

import wavefront as wf
from wavefront.sampling.sampler import SAMPLERS
from wavefront.scheduling.executors import worker_count

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "examples"))
from cornell_box import cornell_box

BOUNCES = {"cornell": 7, "mesh": 7, "lights": 3}
SPP = (4, 16, 64)
DENOISED = "denoised"  # in place of a sampler
IMPORT = """
import time
import numpy
begin = time.perf_counter()
import wavefront
print(time.perf_counter() - begin)
"""
Render = Callable[[int, int], np.ndarray]  # spp, seed -> picture


def mesh_scene(data: Path | None, size: int) -> wf.Scene:
    """Return 40 000 triangles or more of metal and glass on a floor, under a panel and a gray sky."""
    part = data / "rocker-arm.obj" if data else None
    if part and part.exists():
        metal = wf.load_mesh(part)
        vertices = (metal.vertices - metal.bounds.mean(0)) / np.ptp(metal.bounds, axis=0).max() * 1.6
        faces = metal.faces
    else:
        vertices, faces = ball(7)
        wave = 1 + 0.15 * np.sin(9 * vertices[:, 0]) * np.sin(7 * vertices[:, 1] + 1) * np.sin(
            8 * vertices[:, 2]
        )
        vertices = vertices * wave[:, None] * 0.7
    vertices = vertices - (0, vertices[:, 1].min(), 0) + (-0.55, 0, 0)
    gold = wf.Conductor((0.143, 0.374, 1.442), (3.983, 2.386, 1.603), roughness=0.4)
    round_vertices, round_faces = ball(5)
    shapes = [
        wf.Mesh(vertices, faces, material=gold, name="metal"),
        wf.Mesh(
            round_vertices * 0.45 + (0.75, 0.45, 0.35),
            round_faces,
            normals=round_vertices,
            material=wf.Dielectric(1.5),
            name="glass",
        ),
        wf.Rectangle(
            (-6, 0, 6), (12, 0, 0), (0, 0, -12), material=wf.Diffuse((0.5, 0.48, 0.45)), name="floor"
        ),
        wf.Rectangle((-2, 4, -2), (4, 0, 0), (0, 0, 4), material=wf.Diffuse(0), emission=4.0, name="panel"),
    ]
    camera = wf.Camera.look_at((0.6, 1.6, 4), (0.05, 0.5, 0), fov=35, size=(size, size))
    return wf.Scene(shapes, [wf.Environment((0.4, 0.45, 0.5))], camera)


def ball(subdivisions: int) -> tuple[np.ndarray, np.ndarray]:
    """Return a unit icosphere: vertices (n, 3) and 20·4^subdivisions faces."""
    import trimesh

    mesh = trimesh.creation.icosphere(subdivisions=subdivisions)
    return np.asarray(mesh.vertices), np.asarray(mesh.faces)


def ours(scene: wf.Scene, bounces: int, sampler: str, accel: str, branches: int = 1) -> Render:
    """Return a renderer of this project."""
    denoise = sampler == DENOISED
    options: dict[str, Any] = {
        "sampler": "sobol" if denoise else sampler,
        "accel": accel,
        "branches": branches,
        "denoise": denoise,
    }

    def render(spp: int, seed: int) -> np.ndarray:
        return wf.render(scene, spp, seed=seed, max_bounces=bounces, progress=False, **options).rgb

    return render


def mitsuba(
    scene: wf.Scene, bounces: int, sampler: str, variant: str, counts: tuple[int, ...] = SPP
) -> Render:
    """Return a renderer of Mitsuba, with the scene loaded for each of some sample counts."""
    import mitsuba as mi

    mi.set_variant(variant)
    loaded = {spp: to_mitsuba(mi, scene, bounces, sampler, spp) for spp in counts}

    def render(spp: int, seed: int) -> np.ndarray:
        mi.set_variant(variant)
        subject = loaded.get(spp, loaded[counts[-1]])
        return np.array(mi.render(subject, spp=spp, seed=seed))

    return render


def cycles(python: str, size: int, counts: tuple[int, ...], denoise: bool = True) -> Render:
    """Return a renderer of Cycles, a process of a Python for each of some sample counts."""
    made = {spp: Cycles(python, spp, worker_count(None), size, denoise) for spp in counts}
    return lambda spp, seed: made[spp].picture()


def renderer(side: str, scene: wf.Scene, bounces: int, counts: tuple[int, ...] = SPP) -> Render:
    """Return the renderer of a side, called "wavefront embree sobol" or "scalar_rgb multijitter"."""
    *_, engine, sampler = side.split()
    if engine == "cycles":
        return cycles(chosen.bpy_python, scene.camera.size[0], counts)
    if side.startswith("wavefront"):
        sampler, _, branches = sampler.partition("/")
        return ours(scene, bounces, sampler, engine, int(branches or 1))
    return mitsuba(scene, bounces, sampler, engine, counts)


def first(side: str, options: argparse.Namespace, name: str) -> float:
    """Return the seconds of a first render in a process of its own, import and loading included."""
    command = [sys.executable, __file__, "--scene", name, "--size", str(options.size), "--first", side]
    if options.data:
        command += ["--data", str(options.data)]
    seconds = []
    for _ in range(3):
        with tempfile.TemporaryDirectory() as home:  # without Mitsuba's cache of compiled kernels
            seconds.append(printed_by(command, HOME=home))
    return median(seconds)


def print_first(side: str, scene: wf.Scene, bounces: int) -> None:
    """Print how long a first render takes in this process, the scene's arrays being there already."""
    begin = time.perf_counter()
    renderer(side, scene, bounces, SPP[:1])(SPP[0], 0)
    seconds = time.perf_counter() - begin
    if side.startswith("wavefront"):  # which this script has imported
        seconds += printed_by([sys.executable, "-c", IMPORT])
    print(seconds)


def printed_by(command: list[str], **environment: str) -> float:
    """Run a process and return the number that it prints last."""
    done = subprocess.run(command, env={**os.environ, **environment}, check=True, stdout=subprocess.PIPE)
    return float(done.stdout.split()[-1])


def reference(scene: wf.Scene, bounces: int, spp: int, variant: str) -> np.ndarray:
    """Return the mean of a converged picture of each side, after printing how they compare."""
    mine = ours(scene, bounces, "sobol", "auto")(spp, 1000).astype(float)
    render = mitsuba(scene, bounces, "independent", variant)
    passes = [render(min(spp, 256), 2000 + i) for i in range(max(1, spp // 256))]
    other = np.mean(passes, 0, dtype=float)
    ratio = mine.mean((0, 1)) / other.mean((0, 1))
    chance = (mine - other).std((0, 1)) / other.mean((0, 1)) / np.sqrt(mine[..., 0].size)
    print(
        f"converged at {spp} spp: mean of wavefront / mean of mitsuba = {ratio.round(4)} ± {chance.round(4)}"
    )
    if (np.abs(ratio - 1) > 4 * chance + 0.001).any():
        print("the means differ by more than chance and 0.1 %: the figures below are not comparable")
    exact = (mine + other) / 2
    print(f"relative MSE of the reference itself, their mean: {relative_mse(mine, exact):.2g}")
    return exact


def relative_mse(picture: np.ndarray, exact: np.ndarray) -> float:
    """Return the error that `wf.compare` reports."""
    return wf.compare(picture.astype(np.float32), exact.astype(np.float32)).relative_mse


def time_to(error: float, errors: list[float], times: list[float]) -> tuple[float, bool]:
    """Return the time to an error, on straight lines through logarithms, and whether it was extrapolated."""
    if error >= errors[0]:
        return times[0], False
    x, y = np.log(errors), np.log(times)
    end = next((i for i in range(1, len(x)) if errors[i] <= error), len(x) - 1)
    slope = (y[end] - y[end - 1]) / (x[end] - x[end - 1])
    return float(np.exp(y[end] + slope * (np.log(error) - x[end]))), error < errors[-1]


def measure(name: str, scene: wf.Scene, options: argparse.Namespace) -> dict[str, Any]:
    """Measure all sides on one scene and print the table."""
    bounces = BOUNCES[name]
    variants = [v for v in ("llvm_ad_rgb", "scalar_rgb") if v in options.variants]
    print(f"\n## {name}: {scene.camera.size[0]}x{scene.camera.size[1]}, max_bounces {bounces}", flush=True)
    exact = reference(scene, bounces, options.reference_spp, variants[0])
    names = [
        f"wavefront {accel} {sampler}"
        for accel in ("numpy", "embree")
        for sampler in (*SAMPLERS, "sobol/4", DENOISED)
    ]
    names += [f"{variant} {sampler}" for variant in variants for sampler in ("independent", "multijitter")]
    names += [f"cycles {DENOISED}"] if options.bpy_python and name == "cornell" else []
    sides = {side: renderer(side, scene, bounces) for side in names}
    for side, render in sides.items():  # warm up; Mitsuba may compile anew for each sample count
        for spp in SPP[:1] if side.startswith("wavefront") else SPP:
            render(spp, 0)
    converged = dict.fromkeys(sides, exact)
    for side in sides:
        if side.startswith("cycles"):
            counts = (options.reference_spp,)
            converged[side] = cycles(options.bpy_python, options.size, counts, denoise=False)(counts[0], 0)
    times: dict[str, Any] = {side: {spp: [] for spp in SPP} for side in sides}
    errors: dict[str, Any] = {side: {spp: [] for spp in SPP} for side in sides}
    for spp in SPP:
        for seed in range(options.repeat):
            for side, render in sides.items():
                begin = time.perf_counter()
                picture = render(spp, seed)
                times[side][spp].append(time.perf_counter() - begin)
                errors[side][spp].append(relative_mse(picture, converged[side]))
    found = {
        side: {
            "errors": [median(errors[side][spp]) for spp in SPP],
            "seconds": [median(times[side][spp]) for spp in SPP],
            "once": 0.0
            if side.startswith("cycles")  # its scene is loaded beforehand, and not measured
            else max(0.0, first(side, options, name) - median(times[side][SPP[0]])),
        }
        for side in sides
    }
    report(found)
    return found


def report(found: dict[str, Any]) -> None:
    """Print error and time per sample count, and the time to equal error."""
    base = "llvm_ad_rgb independent"
    base = base if base in found else next(side for side in found if "rgb" in side)
    target = found[base]["errors"][-1]
    head = "".join(f"{f'{spp} spp':>19}" for spp in SPP)
    print(
        f"{'relMSE in seconds':29}{head}{'once':>7}{'to ' + format(target, '.2g'):>11}{'warm':>8}{'cold':>7}"
    )
    base_time = found[base]["seconds"][-1]
    for side, of in found.items():
        cells = "".join(
            f"{f'{e:.5f} in {s:.2f}':>19}" for e, s in zip(of["errors"], of["seconds"], strict=True)
        )
        reached, beyond = time_to(target, of["errors"], of["seconds"])
        cold = (base_time + found[base]["once"]) / (reached + of["once"])
        mark = "*" if beyond else " "
        print(
            f"{side:29}{cells}{of['once']:7.2f}{reached:10.2f}{mark}{base_time / reached:7.2f}x{cold:6.2f}x"
        )


COLORS = {
    "wavefront numpy": "C3",
    "wavefront embree": "C1",
    "llvm_ad_rgb": "C0",
    "scalar_rgb": "C2",
    "cycles": "C4",
}
LINES = {
    "independent": ":",
    "sobol": "-",
    "bluenoise": "--",
    "multijitter": "-",
    "sobol/4": "-.",
    DENOISED: (0, (1, 1)),
}


def plot(results: dict[str, Any], path: Path) -> None:
    """Draw error over time, a panel for each scene, both axes logarithmic."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt
    from matplotlib.ticker import NullFormatter

    figure, axes = plt.subplots(1, len(results), figsize=(4.2 * len(results), 4.6), squeeze=False)
    for axis, (name, found) in zip(axes[0], results.items(), strict=True):
        for side, of in found.items():
            engine, sampler = side.rsplit(maxsplit=1)
            marker = "o" if side.startswith("wavefront") else "s"
            style = {"color": COLORS[engine], "linestyle": LINES[sampler], "marker": marker, "markersize": 4}
            axis.loglog(of["seconds"], of["errors"], label=side, **style)
        axis.set(title=name, xlabel="seconds, warm")
        axis.grid(True, which="both", alpha=0.25)
        axis.xaxis.set_minor_formatter(NullFormatter())
    axes[0][0].set_ylabel("relative MSE")
    handles, labels = axes[0][0].get_legend_handles_labels()
    rows = -(-len(labels) // (2 * len(results)))
    figure.tight_layout(rect=(0, 0.05 * rows, 1, 1))
    figure.legend(handles, labels, fontsize=7, ncols=2 * len(results), loc="lower center", frameon=False)
    figure.savefig(path, dpi=80)
    print(f"wrote {path}")


def joined(found: dict[str, Any], kept: Path | None) -> dict[str, Any]:
    """Return results together with those kept in a file, and keep them there too."""
    if kept is None:
        return found
    everything = {**(json.loads(kept.read_text()) if kept.exists() else {}), **found}
    kept.write_text(json.dumps(everything, indent=1))
    return everything


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--scene", choices=("cornell", "mesh", "lights", "all"), default="all")
    parser.add_argument("--data", type=Path, help="folder that holds rocker-arm.obj")
    parser.add_argument("--size", type=int, default=256)
    parser.add_argument("--repeat", type=int, default=3)
    parser.add_argument("--reference-spp", type=int, default=4096)
    parser.add_argument("--bpy-python", help="a Python that has bpy, for Cycles")
    parser.add_argument("--variants", default="llvm_ad_rgb,scalar_rgb")
    parser.add_argument("--out", type=Path, default=Path("error_vs_time.png"))
    parser.add_argument("--keep", type=Path, help="JSON file of results to add to")
    parser.add_argument("--first", help=argparse.SUPPRESS)  # a side: print what its first render takes
    chosen = parser.parse_args()
    subjects = {
        "cornell": lambda: cornell_box(chosen.size),
        "mesh": lambda: mesh_scene(chosen.data, chosen.size),
        "lights": lambda: lit("panels", 1000, chosen.size),
    }
    if chosen.first:
        print_first(chosen.first, subjects[chosen.scene](), BOUNCES[chosen.scene])
        sys.exit()
    names = list(subjects) if chosen.scene == "all" else [chosen.scene]
    plot(joined({name: measure(name, subjects[name](), chosen) for name in names}, chosen.keep), chosen.out)
