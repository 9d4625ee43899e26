"""Relative MSE over time: this project beside Mitsuba 3, on three scenes.

python benchmarks/error_vs_time.py [--scene cornell|mesh|lights|all] [--data DATA] [--out plot.png]

Sides: wavefront with each sampler, numpy and embree; Mitsuba `llvm_ad_rgb` and `scalar_rgb`, each with
`independent` and `multijitter`. All are measured in turn, warm, medians over the repeats; Mitsuba's
first render with its compilation is reported apart. The reference is the mean of two converged
renders, one of each side, whose means are compared first. A table of error and time per sample count
is printed, and for each side the time to the error that `llvm_ad_rgb independent` has at its largest
sample count, by interpolation on logarithms. Needs `pip install wavefront[bench]`, and for
`llvm_ad_rgb` an LLVM library (DRJIT_LIBLLVM_PATH).
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np
from many_lights import lit
from mitsuba_scene import to_mitsuba

import wavefront as wf

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "examples"))
from cornell_box import cornell_box

BOUNCES = {"cornell": 7, "mesh": 7, "lights": 3}
SPP = (4, 16, 64)
Render = Callable[[int, int], np.ndarray]  # spp, seed -> picture


def mesh_scene(data: Path | None, size: int) -> wf.Scene:
    """Return 40 000 triangles or more of metal and glass on a floor, under a panel and a grey sky."""
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


def ours(scene: wf.Scene, bounces: int, sampler: str, accel: str) -> Render:
    """Return a renderer of this project."""

    def render(spp: int, seed: int) -> np.ndarray:
        image = wf.render(
            scene, spp, seed=seed, sampler=sampler, accel=accel, max_bounces=bounces, progress=False
        )
        return image.rgb

    return render


def mitsuba(scene: wf.Scene, bounces: int, sampler: str, variant: str) -> Render:
    """Return a renderer of Mitsuba."""
    import mitsuba as mi

    mi.set_variant(variant)
    loaded = {spp: to_mitsuba(mi, scene, bounces, sampler, spp) for spp in SPP}

    def render(spp: int, seed: int) -> np.ndarray:
        mi.set_variant(variant)
        subject = loaded.get(spp, loaded[SPP[-1]])
        return np.array(mi.render(subject, spp=spp, seed=seed))

    return render


def reference(scene: wf.Scene, bounces: int, spp: int, variant: str) -> np.ndarray:
    """Return the mean of a converged picture of each side, after printing how their means compare."""
    mine = ours(scene, bounces, "sobol", "auto")(spp, 1000)
    passes = [
        mitsuba(scene, bounces, "independent", variant)(256, 2000 + i) for i in range(max(1, spp // 256))
    ]
    other = np.mean(passes, 0)
    ratio = mine.mean((0, 1)) / other.mean((0, 1))
    print(f"converged at {spp} spp: mean of wavefront / mean of mitsuba = {ratio.round(4)}")
    if np.abs(ratio - 1).max() > 0.01:
        print("the means differ by more than 1 %: the figures below are not comparable")
    return (mine.astype(float) + other) / 2


def relative_mse(picture: np.ndarray, exact: np.ndarray) -> float:
    """Return the error that `wf.compare` reports."""
    return wf.compare(picture.astype(np.float32), exact.astype(np.float32)).relative_mse


def time_to(error: float, errors: list[float], times: list[float]) -> float:
    """Interpolate, or extrapolate, the time to an error on logarithms."""
    slope, offset = np.polyfit(np.log(errors), np.log(times), 1)
    return float(np.exp(slope * np.log(error) + offset))


def measure(name: str, scene: wf.Scene, options: argparse.Namespace) -> dict[str, Any]:
    """Measure all sides on one scene and print the table."""
    bounces = BOUNCES[name]
    variants = [v for v in ("llvm_ad_rgb", "scalar_rgb") if v in options.variants]
    print(f"\n## {name}: {scene.camera.size[0]}x{scene.camera.size[1]}, max_bounces {bounces}")
    exact = reference(scene, bounces, options.reference_spp, variants[0])
    sides: dict[str, Render] = {}
    for accel in ("numpy", "embree"):
        for sampler in ("independent", "sobol"):
            sides[f"wavefront {accel} {sampler}"] = ours(scene, bounces, sampler, accel)
    for variant in variants:
        for sampler in ("independent", "multijitter"):
            side = mitsuba(scene, bounces, sampler, variant)
            begin = time.perf_counter()
            side(SPP[0], 0)
            print(f"first render at {SPP[0]} spp, {variant} {sampler}: {time.perf_counter() - begin:.2f} s")
            sides[f"{variant} {sampler}"] = side
    times = {side: {spp: [] for spp in SPP} for side in sides}
    errors = {side: {spp: [] for spp in SPP} for side in sides}
    for spp in SPP:
        for seed in range(options.repeat):
            for side, render in sides.items():
                begin = time.perf_counter()
                picture = render(spp, seed)
                times[side][spp].append(time.perf_counter() - begin)
                errors[side][spp].append(relative_mse(picture, exact))
    return report(times, errors)


def report(times: dict[str, Any], errors: dict[str, Any]) -> dict[str, Any]:
    """Print error and time per sample count, and the time to equal error; return the medians."""
    medians = {
        side: ([median(errors[side][spp]) for spp in SPP], [median(times[side][spp]) for spp in SPP])
        for side in times
    }
    base = "llvm_ad_rgb independent"
    base = base if base in medians else next(side for side in medians if "rgb" in side)
    target = medians[base][0][-1]
    head = "".join(f"{f'{spp} spp':>22}" for spp in SPP)
    print(f"{'relMSE in seconds':32}{head}{'time to ' + format(target, '.2g'):>18}{'speed':>8}")
    base_time = time_to(target, *medians[base])
    for side, (error, seconds) in medians.items():
        cells = "".join(f"{f'{e:.5f} in {s:.2f} s':>22}" for e, s in zip(error, seconds, strict=True))
        reached = time_to(target, error, seconds)
        print(f"{side:32}{cells}{reached:16.2f} s{base_time / reached:7.2f}x")
    return medians


def plot(results: dict[str, dict[str, Any]], path: Path) -> None:
    """Draw error over time, a panel for each scene, both axes logarithmic."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(1, len(results), figsize=(6 * len(results), 5), squeeze=False)
    for axis, (name, medians) in zip(axes[0], results.items(), strict=True):
        for side, (error, seconds) in medians.items():
            axis.loglog(seconds, error, "o-" if side.startswith("wavefront") else "s--", label=side)
        axis.set(title=name, xlabel="seconds", ylabel="relative MSE")
        axis.grid(True, which="both", alpha=0.3)
    axes[0][0].legend(fontsize=7)
    figure.tight_layout()
    figure.savefig(path, dpi=80)
    print(f"wrote {path}")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--scene", choices=("cornell", "mesh", "lights", "all"), default="all")
    parser.add_argument("--data", type=Path, help="folder that holds rocker-arm.obj")
    parser.add_argument("--size", type=int, default=256)
    parser.add_argument("--repeat", type=int, default=3)
    parser.add_argument("--reference-spp", type=int, default=4096)
    parser.add_argument("--variants", default="llvm_ad_rgb,scalar_rgb")
    parser.add_argument("--out", type=Path, default=Path("error_vs_time.png"))
    chosen = parser.parse_args()
    os.environ["HOME"] = tempfile.mkdtemp()  # without Mitsuba's cache of compiled kernels
    subjects = {
        "cornell": lambda: cornell_box(chosen.size),
        "mesh": lambda: mesh_scene(chosen.data, chosen.size),
        "lights": lambda: lit("panels", 1000, chosen.size),
    }
    names = list(subjects) if chosen.scene == "all" else [chosen.scene]
    plot({name: measure(name, subjects[name](), chosen) for name in names}, chosen.out)
