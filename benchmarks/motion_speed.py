"""What motion blur costs: CPU time per sample of what moves over that of the same scene, still.

    python benchmarks/motion_speed.py [scene ...] [--accel numpy embree] [--repeat 5] [--size 160x120]

Each scene is compiled twice: with an open shutter, and as it is in the middle of that time, without one. Both
render in turn, one worker each, without branches or shared paths; the figures are medians of CPU time per
sample, and of the ratios of pairs, with the smallest and the greatest. "set-up" is the CPU time of the set-up
of both, once.
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("OMP_NUM_THREADS", "1")

import argparse
import time
from collections.abc import Callable
from statistics import median
from typing import Any

import numpy as np

import wavefront as wf

TIMES = np.linspace(0, 1, 5)  # s, of forms
FAST: dict[str, Any] = {
    "branches": 1,
    "reuse": False,
    "workers": 1,
    "executor": "threads",
    "progress": False,
    "denoise": False,
}


def placed(shift: tuple[float, float, float], degrees: float) -> np.ndarray:
    """Return a turn about y, and then a shift, as a matrix (4, 4)."""
    turn = np.radians(degrees)
    matrix = np.eye(4)
    matrix[::2, ::2] = [[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]]
    matrix[:3, 3] = shift
    return matrix


def bumpy(triangles: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the vertices (n, 3) and faces of a sphere with bumps, of about so many triangles."""
    rings = round((triangles / 4) ** 0.5)
    polar, around = np.linspace(1e-3, np.pi - 1e-3, rings + 1), np.linspace(0, 2 * np.pi, 2 * rings + 1)
    p, a = (each.ravel() for each in np.meshgrid(polar, around, indexing="ij"))
    radius = 0.7 + 0.05 * np.sin(9 * p) * np.sin(8 * a)
    vertices = radius[:, None] * np.stack([np.sin(p) * np.cos(a), np.cos(p), np.sin(p) * np.sin(a)], 1)
    row, column = (each.ravel() for each in np.indices((rings, 2 * rings)))
    first = row * (2 * rings + 1) + column
    below = first + 2 * rings + 1
    faces = [np.stack(each, 1) for each in ((first, first + 1, below), (first + 1, below + 1, below))]
    return vertices, np.concatenate(faces)


def floor() -> wf.Shape:
    return wf.Rectangle((-3, -0.8, 3), (6, 0, 0), (0, 0, -6), material=wf.Diffuse(0.6))


def lights() -> list[Any]:
    return [wf.PointLight((1, 4, 2), 60), wf.Environment(0.3)]


def camera(size: tuple[int, int]) -> wf.Camera:
    return wf.Camera.look_at((0, 1.5, 4), (0, 0, 0), fov=40, size=size)


SLIDE = wf.Keyframes([0, 1], [placed((-0.4, 0, 0), 0), placed((0.4, 0, 0), 0)])
TURN = wf.Keyframes([0, 0.4, 1], [placed((-0.4, 0, 0), -30), placed((0, 0.1, 0), 0), placed((0.4, 0, 0), 50)])


def instance(motion: wf.Keyframes, triangles: int) -> wf.Shape:
    """Return a mesh that moves as a whole."""
    mesh = wf.Box((0, 0, 0), 1.0) if triangles == 12 else wf.Mesh(*bumpy(triangles))
    return mesh.transformed(motion)


def crowd() -> list[wf.Shape]:
    """Return 100 meshes of 1 000 triangles that move, each by a motion of its own."""
    mesh, rng = wf.Mesh(*bumpy(1000)), np.random.default_rng(1)
    small = np.diag([0.2, 0.2, 0.2, 1])
    moving = []
    for _ in range(100):
        a, b = rng.uniform((-1.5, -0.6, -1.5), (1.5, 0.8, 1.5), (2, 3))
        ends = [placed(tuple(each), turn) @ small for each, turn in ((a, 0), (a + 0.2 * (b - a), 40))]
        moving.append(mesh.transformed(wf.Keyframes([0, 1], ends)))
    return moving


def deforming(way: Callable[[np.ndarray, float], np.ndarray], smooth: bool = False) -> wf.Shape:
    """Return a mesh of 100 000 triangles whose vertices go along lines between five forms."""
    vertices, faces = bumpy(100_000)
    return wf.Mesh(
        np.stack([way(vertices, time) for time in TIMES.tolist()]), faces, times=TIMES, smooth=smooth
    )


def breathe(v: np.ndarray, time: float) -> np.ndarray:
    """Return vertices that bend a little, as a character's do while a shutter is open."""
    return v * (1 + 0.02 * time * np.sin(3 * v[:, [1]])) + np.array([0.02 * time, 0, 0])


def bend(v: np.ndarray, time: float) -> np.ndarray:
    """Return vertices the upper of which turn by up to a quarter of a turn."""
    angle = np.pi / 2 * time * np.clip(v[:, 1] + 0.5, 0, 1)
    x, y, z = v.T
    return np.stack([x * np.cos(angle) - z * np.sin(angle), y, x * np.sin(angle) + z * np.cos(angle)], 1)


def stretch(v: np.ndarray, time: float) -> np.ndarray:
    """Return vertices that go over the picture while they become flat and wide."""
    return v * np.array([1 + 0.4 * time, 1 - 0.6 * time, 1]) + np.array([1.2 * time - 0.6, 0, 0])


def scenes(size: tuple[int, int]) -> dict[str, wf.Scene]:
    """Return scenes that move, by name."""
    vertices, faces = bumpy(100_000)
    moving = camera(size).transformed(
        wf.Keyframes([0, 1], [placed((0.1, 0, 0), -2), placed((-0.1, 0.05, 0), 3)])
    )
    shapes: dict[str, list[wf.Shape]] = {
        "box slides": [instance(SLIDE, 12)],
        "box turns": [instance(TURN, 12)],
        "mesh slides": [instance(SLIDE, 100_000)],
        "mesh turns": [instance(TURN, 100_000)],
        "crowd": crowd(),
        "breathes": [deforming(breathe)],
        "breathes, smooth": [deforming(breathe, True)],
        "bends": [deforming(bend)],
        "stretches": [deforming(stretch)],
    }
    found = {name: wf.Scene([floor(), *each], lights(), camera(size)) for name, each in shapes.items()}
    found["camera, box"] = wf.Scene([floor(), wf.Box((0, 0, 0), 1.0)], lights(), moving)
    found["camera, mesh"] = wf.Scene([floor(), wf.Mesh(vertices, faces)], lights(), moving)
    return found


class Side:
    """A scene that is rendered again and again.

    Attributes
    ----------
    set_up
        CPU time until it can be rendered, s.
    """

    def __init__(self, scene: wf.Scene, spp: int, **options: Any) -> None:
        begin = time.process_time()
        self._session, self._camera, self._spp = wf.Session(scene, spp, **FAST, **options), scene.camera, spp
        self.set_up = time.process_time() - begin

    def seconds(self) -> float:
        """Render once more, and return the CPU time per sample, s."""
        self._session.set_camera(self._camera)
        begin = time.process_time()
        self._session.run()
        return (time.process_time() - begin) / self._spp

    def close(self) -> None:
        """End its workers."""
        self._session.close()


def measured(scene: wf.Scene, accel: str, repeat: int, spp: int) -> str:
    """Return a row of the table."""
    sides = Side(scene, spp, accel=accel, shutter=(0, 1)), Side(scene.at(0.5), spp, accel=accel)
    pairs = np.array([[side.seconds() for side in sides] for _ in range(repeat + 1)])[1:]
    for side in sides:
        side.close()
    ratio = pairs[:, 0] / pairs[:, 1]
    moving, still = (1e3 * median(column) for column in pairs.T)
    return (
        f"{moving:.1f} | {still:.1f} | {median(ratio):.2f} ({ratio.min():.2f} to {ratio.max():.2f}) "
        f"| {sides[0].set_up:.2f}, {sides[1].set_up:.2f}"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("scenes", nargs="*", help="by default all")
    parser.add_argument("--accel", nargs="+", default=["numpy", "embree"])
    parser.add_argument("--repeat", type=int, default=5)
    parser.add_argument("--spp", type=int, default=8, help="samples of a pixel in each turn")
    parser.add_argument("--size", default="160x120")
    given = parser.parse_args()
    width, height = map(int, given.size.split("x"))
    subjects = scenes((width, height))
    print("| scene | accelerator | moving, ms per sample | still | ratio (least, most) | set-up, s |")
    print("|---|---|---|---|---|---|")
    for name in given.scenes or subjects:
        for accel in given.accel:
            row = measured(subjects[name], accel, given.repeat, given.spp)
            print(f"| {name} | {accel} | {row} |", flush=True)


if __name__ == "__main__":
    main()
