"""Relative MSE over time: this project beside Mitsuba 3 and Cycles, on five scenes and four hard ones.

python benchmarks/error_vs_time.py [--scene NAME] [--bpy-python PATH] [--data DATA] [--out plot.png]

Scenes: "cornell", "mesh", "studio", "hdri" and "lights"; those of hard_scenes.py, which are "ceiling",
"ajar", "window" and "corridor"; "hard" for these four, "all" for all.
Sides: wavefront by each method of the scene, or by those
of --methods, in numpy and embree; Mitsuba `llvm_ad_rgb` and `scalar_rgb`, each with `independent` and
`multijitter`; with `--bpy-python`, Cycles with its own path guiding on the box and the hard scenes, and with
Open Image Denoise on the box. All draw the same shapes with as many bounces, a box filter and a worker per
core; rough metals scatter once, as Mitsuba's do; Cycles has a sphere of 20 480 triangles in place of each
ball. The reference is the mean of two converged renders, one of wavefront and one of Mitsuba, weighted by
their noise, whose means are compared first. Printed are, for each side:

- error and wall time at each sample count (with four branches a fourth of it), warm: medians over the
  repeats, the sides in turn, forwards and backwards. The scene of Mitsuba is loaded once, beforehand. Cycles
  takes it from Blender in each render: with `use_persistent_data` all its pictures have one seed. A render
  of wavefront includes setting up its scene and training a guide, but what rays are traced with, which
  stays with the scene, has been built by the render before;
- the mean of the pictures of most samples over that of the reference;
- what a fresh process takes besides, once: importing the renderer, loading the scene, compiling. It is
  the time of a process of its own, with an empty cache of compiled kernels, less that of a warm render;
- speed to each error that `llvm_ad_rgb independent` has, relative to its own, by straight lines between
  the measured points on logarithmic axes, and beyond the last by the last two (marked *); a side whose
  fewest samples have less error than that is given their time (marked <);
- speed to the last of these errors with what comes once added ("cold").

With `--blur 1.5` a second table has the errors of the same pictures after a Gaussian blur of 1.5 pixels,
of the picture and of the reference: noise that neighbors share does not vanish there. With `--keep FILE`
results join those of earlier runs in that file, and the plot shows all of them, so that the scenes can be
measured one at a time.

With `--references FOLDER` converged pictures are kept there and found again. `--prepare` makes them and ends:
it measures nothing, so it may run on a busy machine, and the measurement later on a quiet one. `--warm`
leaves out the fresh processes, which take a large part of the time of a run.

Needs `pip install -e '.[bench]'`, and for `llvm_ad_rgb` an LLVM library
(DRJIT_LIBLLVM_PATH; Mitsuba 3.9 ends with an error of version 15 on processors with AVX-512, not of 19).
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
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np
from clean_scenes import FLOOR, SCENES, before, sky
from hard_scenes import HARD_SCENES
from many_lights import lit
from references import References, relative_mse
from renderers import DENOISED, GUIDED, METHODS, renderer
from scipy.ndimage import gaussian_filter

import wavefront as wf

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "examples"))
from cornell_box import cornell_box

PAUSE = 0.2  # seconds before each measurement: OpenBLAS's thread spins for 0.1 s after a render of ours
IMPORT = """
import time
import numpy
begin = time.perf_counter()
import wavefront
print(time.perf_counter() - begin)
"""


@dataclass(frozen=True)
class Subject:
    """A scene, and how it is measured."""

    build: Callable[[], wf.Scene]
    max_bounces: int
    spp: tuple[int, ...]
    own_spp: tuple[int, ...]  # of wavefront, as many
    methods: tuple[str, ...]  # of wavefront
    exact: str  # the method of the converged picture of wavefront
    cycles: tuple[str, ...] = ()  # methods of Cycles

    def counts(self, side: str) -> tuple[int, ...]:
        """Return the sample counts of a side."""
        return self.own_spp if side.startswith("wavefront") else self.spp


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
    gold = wf.Conductor((0.143, 0.374, 1.442), (3.983, 2.386, 1.603), roughness=0.4, multiscatter=False)
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


def hdri_scene(size: int, kind: str = "soft sun", height: int = 128) -> wf.Scene:
    """Return a matte ball and a torus of rough gold on a floor, before a `sky` of that kind and height."""
    import trimesh

    torus = trimesh.creation.torus(0.5, 0.2)
    flat = torus.vertices[:, [1, 2, 0]] + (0.75, 0.2, 0.3)  # its axis is upright
    gold = wf.Conductor((0.143, 0.374, 1.442), (3.983, 2.386, 1.603), roughness=0.35, multiscatter=False)
    shapes = [
        FLOOR,
        wf.Sphere((-0.7, 0.65, 0), 0.65, material=wf.Diffuse(0.7)),
        wf.Mesh(flat, torus.faces, normals=torus.vertex_normals[:, [1, 2, 0]], material=gold, name="torus"),
    ]
    return before(size, shapes, sky(kind, height))


def ball(subdivisions: int) -> tuple[np.ndarray, np.ndarray]:
    """Return a unit icosphere: vertices (n, 3) and 20·4^subdivisions faces."""
    import trimesh

    mesh = trimesh.creation.icosphere(subdivisions=subdivisions)
    return np.asarray(mesh.vertices), np.asarray(mesh.faces)


def first(side: str, options: argparse.Namespace, name: str) -> float:
    """Return the seconds of a first render in a process of its own, import and loading included."""
    command = [sys.executable, __file__, "--scene", name, "--size", str(options.size), "--first", side]
    if options.data:
        command += ["--data", str(options.data)]
    seconds = []
    for _ in range(options.repeat):
        with tempfile.TemporaryDirectory() as home:  # without Mitsuba's cache of compiled kernels
            seconds.append(printed_by(command, HOME=home))
    return median(seconds)


def print_first(side: str, subject: Subject) -> None:
    """Print how long a first render takes in this process, the scene's arrays being there already."""
    scene, fewest = subject.build(), subject.counts(side)[:1]
    begin = time.perf_counter()
    renderer(side, scene, subject.max_bounces, fewest)(fewest[0], 0)
    seconds = time.perf_counter() - begin
    if side.startswith("wavefront"):  # which this script has imported
        seconds += printed_by([sys.executable, "-c", IMPORT])
    print(seconds)


def printed_by(command: list[str], **environment: str) -> float:
    """Run a process and return the number that it prints last."""
    done = subprocess.run(command, env={**os.environ, **environment}, check=True, stdout=subprocess.PIPE)
    return float(done.stdout.split()[-1])


def time_to(error: float, errors: list[float], times: list[float]) -> tuple[float, bool]:
    """Return the time to an error, on straight lines through logarithms, and whether it was extrapolated."""
    if error >= errors[0]:
        return times[0], False
    x, y = np.log(errors), np.log(times)
    end = next((i for i in range(1, len(x)) if errors[i] <= error), len(x) - 1)
    slope = (y[end] - y[end - 1]) / (x[end] - x[end - 1])
    return float(np.exp(y[end] + slope * (np.log(error) - x[end]))), error < errors[-1]


def blurred(picture: np.ndarray, pixels: float) -> np.ndarray:
    """Return a picture after a Gaussian blur."""
    return gaussian_filter(picture, (pixels, pixels, 0))


def sides_of(subject: Subject, options: argparse.Namespace) -> list[str]:
    """Return the names of all sides that draw a scene."""
    methods = options.methods.split(",") if options.methods else subject.methods
    names = [f"wavefront {accel} {method}" for accel in options.accel.split(",") for method in methods]
    names += [
        f"{variant} {sampler}"
        for variant in ("llvm_ad_rgb", "scalar_rgb")
        if variant in options.variants
        for sampler in ("independent", "multijitter")
    ]
    return names + ([f"cycles {method}" for method in subject.cycles] if options.bpy_python else [])


def base_of(sides: list[str]) -> str:
    """Return the side that the others are compared with."""
    return next(side for side in sides if side.endswith("rgb independent"))


def measure(name: str, subject: Subject, options: argparse.Namespace) -> dict[str, Any]:
    """Measure all sides on one scene and print the tables; {} where only references are made."""
    scene = subject.build()
    width, height = scene.camera.size
    print(f"\n## {name}: {width}x{height}, max_bounces {subject.max_bounces}", flush=True)
    names = sides_of(subject, options)
    base = base_of(names)
    exact = References(options.references).mean_with_mitsuba(
        name,
        scene,
        subject.max_bounces,
        options.reference_spp,
        method=subject.exact,
        variant=base.split()[0],
    )
    if options.prepare:
        return {}
    sides = {
        each: renderer(each, scene, subject.max_bounces, subject.counts(each), options.bpy_python)
        for each in names
    }
    for side, render in sides.items():  # warm up; Mitsuba may compile anew for each sample count
        for spp in subject.own_spp[:1] if side.startswith("wavefront") else subject.spp:
            render(spp, 0)
    found: dict[str, Any] = {side: {"errors": [], "blurred": [], "seconds": []} for side in sides}
    for place in range(len(subject.spp)):
        rows: dict[str, list[tuple[float, ...]]] = {side: [] for side in sides}
        for seed in range(options.repeat):
            # in changing order, as a side may be slower after another one
            for side in names if seed % 2 == 0 else names[::-1]:
                time.sleep(PAUSE)
                begin = time.perf_counter()
                picture = sides[side](subject.counts(side)[place], seed)
                seconds = time.perf_counter() - begin
                soft = relative_mse(*(blurred(p, options.blur) for p in (picture, exact)))
                ratio = picture.mean(dtype=float) / exact.mean()
                rows[side].append((relative_mse(picture, exact), soft, seconds, ratio))
        for side, measured in rows.items():
            columns = [list(column) for column in zip(*measured, strict=True)]
            for key, column in zip(("errors", "blurred", "seconds"), columns, strict=False):
                found[side][key].append(median(column))
            found[side]["mean"] = sum(columns[-1]) / options.repeat
    for side, of in found.items():
        # the scene of Cycles is loaded beforehand, and not measured
        of["once"] = (
            0.0
            if options.warm or side.startswith("cycles")
            else max(0.0, first(side, options, name) - of["seconds"][0])
        )
    report(found, subject, base, "errors")
    if options.blur:
        print(f"after a blur of {options.blur} pixels")
        report(found, subject, base, "blurred")
    return found


def report(found: dict[str, Any], subject: Subject, base: str, key: str) -> None:
    """Print error and time per sample count, and the speed to each error that the base has."""
    targets, base_times = found[base][key], found[base]["seconds"]
    counts = zip(subject.own_spp, subject.spp, strict=True)
    heads = [str(spp) if own == spp else f"{own} or {spp}" for own, spp in counts]
    head = "".join(f"{f'{counts} spp':>19}" for counts in heads)
    speeds = "".join(f"{format(target, '.2g'):>10}" for target in targets)
    print(f"{'relMSE in seconds':29}{head}{'mean':>8}  speed to{speeds}{'once':>7}{'cold':>7}")
    for side, of in found.items():
        errors = of[key]
        cells = "".join(f"{f'{e:.5f} in {s:.2f}':>19}" for e, s in zip(errors, of["seconds"], strict=True))
        row = ""
        for target, base_time in zip(targets, base_times, strict=True):
            reached, beyond = time_to(target, errors, of["seconds"])
            mark = "*" if beyond else "<" if target > errors[0] else " "
            row += f"{base_time / reached:8.2f}x{mark}"
        cold = (base_time + found[base]["once"]) / (reached + of["once"])
        print(f"{side:29}{cells}{of['mean']:8.4f}{'':10}{row}{of['once']:7.2f}{cold:6.2f}x", flush=True)


COLORS = {
    "wavefront numpy": "C3",
    "wavefront embree": "C1",
    "llvm_ad_rgb": "C0",
    "scalar_rgb": "C2",
    "cycles": "C4",
}
LINES = {
    "independent": ":",
    "default": "-",
    "plain": (0, (9, 1)),
    "bluenoise": "--",
    "multijitter": "-",
    "plain/4": "-.",
    GUIDED: (0, (5, 1)),
    "guided/4": (0, (5, 1, 1, 1)),
    "guided/reused": (0, (5, 2, 1, 2)),
    "auto": (0, (3, 1)),
    "reused": (0, (7, 2)),
    "reused/4": (0, (7, 2, 1, 2)),
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


def counts_in(text: str) -> tuple[int, ...]:
    """Return the sample counts that a text such as 4,16,64 names."""
    return tuple(int(count) for count in text.split(","))


def subjects(options: argparse.Namespace) -> dict[str, Subject]:
    """Return all scenes by name."""
    size, spp = options.size, (4, 16, 64)
    hard = ("default", "plain", "plain/4", GUIDED, "guided/4", "guided/reused", "reused")
    methods = (*hard, "independent", "bluenoise", DENOISED)
    box = (*methods, "reused/4")
    found = {
        "cornell": Subject(lambda: cornell_box(size), 7, spp, spp, box, "reused", (GUIDED, DENOISED)),
        "mesh": Subject(lambda: mesh_scene(options.data, size), 7, spp, spp, methods, "plain"),
        "studio": Subject(partial(SCENES["mesh, studio"][0], size), 7, spp, spp, methods, "plain"),
        "hdri": Subject(lambda: hdri_scene(size), 7, spp, spp, methods, "plain"),
        "lights": Subject(lambda: lit("panels", 1000, size), 3, spp, spp, methods, "plain"),
    }
    for name, build in HARD_SCENES.items():
        hard_spp = (16, 64, 256)
        found[name] = Subject(partial(build, size), 12, hard_spp, hard_spp, hard, "guided/reused", (GUIDED,))
    if options.spp:
        spp = counts_in(options.spp)
        own = counts_in(options.own_spp) if options.own_spp else spp
        found = {name: replace(subject, spp=spp, own_spp=own) for name, subject in found.items()}
    return found


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--scene", default="all", help="a scene, hard or all")
    parser.add_argument("--data", type=Path, help="folder that holds rocker-arm.obj")
    parser.add_argument("--size", type=int, default=256)
    parser.add_argument("--spp", help="sample counts, such as 4,16,64")
    parser.add_argument("--own-spp", help="those of wavefront, as many, where they differ")
    parser.add_argument("--methods", help=f"of wavefront, some of {','.join(METHODS)}")
    parser.add_argument("--accel", default="numpy,embree", help="accelerators of wavefront")
    parser.add_argument("--blur", type=float, default=0.0, help="pixels; prints a second table")
    parser.add_argument("--repeat", type=int, default=3)
    parser.add_argument("--reference-spp", type=int, default=4096)
    parser.add_argument("--references", type=Path, help="folder of converged pictures, made where missing")
    parser.add_argument("--prepare", action="store_true", help="only make the converged pictures")
    parser.add_argument("--warm", action="store_true", help="measure no fresh processes")
    parser.add_argument("--bpy-python", help="a Python that has bpy, for Cycles")
    parser.add_argument("--variants", default="llvm_ad_rgb,scalar_rgb")
    parser.add_argument("--out", type=Path, default=Path("error_vs_time.png"))
    parser.add_argument("--keep", type=Path, help="JSON file of results to add to")
    parser.add_argument("--first", help=argparse.SUPPRESS)  # a side: print what its first render takes
    chosen = parser.parse_args()
    known = subjects(chosen)
    names = {"all": list(known), "hard": list(HARD_SCENES)}.get(chosen.scene, [chosen.scene])
    if not set(names) <= set(known):
        parser.error(f"--scene is one of {', '.join(known)}, hard, all")
    if chosen.first:
        print_first(chosen.first, known[names[0]])
        sys.exit()
    results: dict[str, Any] = {}
    for name in names:
        found = measure(name, known[name], chosen)
        results = joined({**results, name: found}, chosen.keep) if found else results
    if not chosen.prepare:
        plot(results, chosen.out)
