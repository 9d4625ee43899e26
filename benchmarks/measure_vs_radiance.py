"""CPU time at equal error of irradiance on a grid in the Cornell box, beside Radiance's rtrace.

python benchmarks/measure_vs_radiance.py --radiance FOLDER [--side 100] [--repeat 3]

FOLDER has `bin` and `lib` of Radiance, such as site-packages/pyradiance of an environment with
`pip install pyradiance`. The points lie on a plane above the floor, outside of the boxes. Errors are
relative: their root mean square, the median of their sizes, and their mean, over 400 of the points,
against values that this package has measured with an error of about 0.3 %. rtrace follows eight bounces,
with its ambient cache (-aa 0.2) and without it (-aa 0).

The seconds are those of the CPU, of all threads and processes, with the set-up of the scene. The last column
is the time of rtrace over the time in which this package has the same error: squared error times time is
constant for it.
"""

from __future__ import annotations

import argparse
import os
import resource
import subprocess
import sys
import tempfile
from pathlib import Path
from statistics import median

import numpy as np

import wavefront as wf

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
import scenes

CHECKED, EXACT = 400, 16384  # points with a reference, and its samples
FIXED = "-ab 8 -lr -12 -ds 0.02 -dj 0.9 -dt 0 -dc 1"
SETTINGS = (
    "-aa 0 -ad 64 -lw 0.01",
    "-aa 0.2 -ad 256 -as 64 -ar 32 -lw 0.0001",
)
SPP = (64, 256)


def to_radiance(scene: wf.Scene) -> str:
    """Return diffuse meshes as a scene of Radiance: a polygon for each rectangle, else for each face."""
    lines = []
    for k, shape in enumerate(scene.shapes):
        if shape.emission is not None:
            lines.append(f"void light m{k}\n0\n0\n3 {' '.join(map(str, shape.emission.ravel()))}")
        else:
            color = " ".join(map(str, shape.material.bsdf.reflectance.ravel()))
            lines.append(f"void plastic m{k}\n0\n0\n5 {color} 0 0")
        for j, corners in enumerate(
            [shape.vertices] if len(shape.vertices) == 4 else shape.vertices[shape.faces]
        ):
            lines.append(f"m{k} polygon p{k}.{j}\n0\n0\n{corners.size} {' '.join(map(str, corners.ravel()))}")
    return "\n".join(lines) + "\n"


def cpu() -> float:
    """Return CPU seconds of this process and those that it has waited for."""
    mine, theirs = resource.getrusage(resource.RUSAGE_SELF), resource.getrusage(resource.RUSAGE_CHILDREN)
    return mine.ru_utime + mine.ru_stime + theirs.ru_utime + theirs.ru_stime


def rtrace(folder: Path, octree: str, options: str, table: str) -> tuple[np.ndarray, float]:
    """Return irradiance (n, 3) by rtrace, and CPU seconds."""
    begin = cpu()
    command = [str(folder / "bin" / "rtrace"), "-I+", "-h", *FIXED.split(), *options.split(), octree]
    done = subprocess.run(command, input=table, capture_output=True, text=True, check=True)
    return np.array([line.split()[:3] for line in done.stdout.splitlines()], float), cpu() - begin


def ours(
    scene: wf.Scene, points: np.ndarray, normals: np.ndarray, spp: int, seed: int
) -> tuple[np.ndarray, float]:
    """Return irradiance (n, 3) by this package, and CPU seconds."""
    begin = cpu()
    found = wf.measure(scene, points, normals, spp=spp, seed=seed, workers=1, progress=False)
    return found.value, cpu() - begin


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--radiance", type=Path, required=True)
    parser.add_argument("--side", type=int, default=100)
    parser.add_argument("--repeat", type=int, default=3)
    options = parser.parse_args()
    os.environ["RAYPATH"] = str(options.radiance / "lib")
    scene = scenes.cornell_box()
    points, normals = wf.grid_points(
        (-0.98, -0.98, -0.98), (0, 0, 1.96), (1.96, 0, 0), (options.side, options.side)
    )
    dark = ~wf.measure(scene, points, normals, spp=16, progress=False).value.any(1)  # inside the boxes
    points, normals = points[~dark], normals[~dark]
    some = np.linspace(0, len(points) - 1, CHECKED).astype(int)
    exact = wf.measure(scene, points[some], normals[some], spp=EXACT, seed=99, progress=False)
    print(
        f"{len(points)} points; references are known to {np.median(exact.standard_error / exact.value):.2%}"
    )

    def errors(value: np.ndarray) -> tuple[float, float, float]:
        relative = (value[some] / exact.value - 1).mean(1)
        return (
            float(np.sqrt(np.square(relative).mean())),
            float(np.median(np.abs(relative))),
            float(relative.mean()),
        )

    with tempfile.TemporaryDirectory() as work:
        model, octree = os.path.join(work, "box.rad"), os.path.join(work, "box.oct")
        Path(model).write_text(to_radiance(scene))
        with open(octree, "wb") as file:
            subprocess.run([str(options.radiance / "bin" / "oconv"), model], stdout=file, check=True)
        table = "".join(
            " ".join(map(repr, row)) + "\n" for row in np.concatenate([points, normals], 1).tolist()
        )
        print(
            "| side | rms error | median error | mean | CPU seconds | rtrace over ours, by rms, by median |"
        )
        print("|---|---|---|---|---|---|")
        unit = []
        for spp in SPP:
            runs = [ours(scene, points, normals, spp, seed) for seed in range(options.repeat)]
            rms, middle, mean = (median(errors(value)[k] for value, _ in runs) for k in range(3))
            seconds = median(each for _, each in runs)
            unit = [rms**2 * seconds, middle**2 * seconds]
            print(
                f"| wavefront, {spp} spp | {rms:.2%} | {middle:.2%} | {mean:+.2%} | {seconds:.1f} | |",
                flush=True,
            )
        for settings in SETTINGS:
            value, seconds = rtrace(options.radiance, octree, settings, table)
            found = errors(value)
            ratios = (seconds * error**2 / each for error, each in zip(found[:2], unit, strict=True))
            print(
                f"| rtrace {settings} | {found[0]:.2%} | {found[1]:.2%} | {found[2]:+.2%} | {seconds:.1f} | "
                f"{', '.join(f'{each:.1f}' for each in ratios)} |",
                flush=True,
            )


if __name__ == "__main__":
    main()
