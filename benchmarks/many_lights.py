"""Variance at equal time with 1000 lights, against 10 lights of the same total power.

python benchmarks/many_lights.py [--spp 16] [--size 128] [--repeat 6] [--accel numpy]

A hall of columns lit by square panels or by point lights under its ceiling, 10 of them or 1000, that
together give the same power. For each number and each way of choosing a light: variance of a pixel
(over seeds, relative to the picture's squared mean), seconds, and their product relative to 10
lights chosen by place. No light is in the picture itself.
"""

from __future__ import annotations

import argparse
from statistics import median

import numpy as np
from options import several

import wavefront as wf

POWER = 4000.0


def hall(size: int) -> tuple[list[wf.Mesh], wf.Camera]:
    """Return a hall 40 by 20 by 6 with two rows of columns, and a camera at its end."""
    gray = wf.Diffuse(0.6)
    walls = [
        wf.Rectangle((-20, 0, 10), (40, 0, 0), (0, 0, -20), material=gray),
        wf.Rectangle((-20, 6, -10), (40, 0, 0), (0, 0, 20), material=gray),
        wf.Rectangle((-20, 0, -10), (40, 0, 0), (0, 6, 0), material=gray),
        wf.Rectangle((20, 0, 10), (-40, 0, 0), (0, 6, 0), material=gray),
        wf.Rectangle((20, 0, -10), (0, 0, 20), (0, 6, 0), material=gray),
        wf.Rectangle((-20, 0, 10), (0, 0, -20), (0, 6, 0), material=gray),
    ]
    for x in range(-16, 17, 4):
        for z in (-5, 5):
            for corner, edge in (
                ((x - 0.4, 0, z + 0.4), (0.8, 0, 0)),
                ((x + 0.4, 0, z + 0.4), (0, 0, -0.8)),
                ((x + 0.4, 0, z - 0.4), (-0.8, 0, 0)),
                ((x - 0.4, 0, z - 0.4), (0, 0, 0.8)),
            ):
                walls.append(wf.Rectangle(corner, edge, (0, 6, 0), material=wf.Diffuse((0.7, 0.5, 0.4))))
    camera = wf.Camera.look_at((-17, 5.0, 2), (-8, 0, 0), fov=50, size=(size, size * 3 // 4))
    return walls, camera


def places(count: int) -> np.ndarray:
    """Return (count, 3) positions spread over the ceiling."""
    columns = int(np.ceil(np.sqrt(2 * count)))
    rows = int(np.ceil(count / columns))
    x, z = np.meshgrid((np.arange(columns) + 0.5) / columns, (np.arange(rows) + 0.5) / rows)
    spread = np.stack([x.ravel() * 38 - 19, np.full(x.size, 5.9), z.ravel() * 18 - 9], 1)
    return spread[:count]


def lit(kind: str, count: int, size: int) -> wf.Scene:
    """Return the hall with `count` lights of one kind."""
    walls, camera = hall(size)
    if kind == "points":
        lights = [wf.PointLight(place - (0, 0.5, 0), POWER / count / (4 * np.pi)) for place in places(count)]
        return wf.Scene(walls, lights, camera)
    side = 0.15
    radiance = POWER / count / (np.pi * side**2)
    panels = [
        wf.Rectangle(
            place - (side / 2, 0, side / 2),
            (side, 0, 0),
            (0, 0, side),
            material=wf.Diffuse(0),
            emission=radiance,
        )
        for place in places(count)
    ]
    return wf.Scene([*walls, *panels], camera=camera)


def measure(scene: wf.Scene, choice: str, options: argparse.Namespace) -> tuple[float, float]:
    """Return the relative variance of a pixel over seeds, and the median seconds of a render."""
    pictures = [
        wf.render(
            scene,
            options.spp,
            seed=seed,
            light_sampler=choice,
            accel=options.accel,
            max_bounces=3,
            sampler="independent",
            branches=1,
            progress=False,
        )
        for seed in range(options.repeat)
    ]
    stack = np.stack([picture.rgb for picture in pictures]).astype(float)
    return float(stack.var(0, ddof=1).mean() / stack.mean() ** 2), median(
        p.metadata["seconds"] for p in pictures
    )


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--spp", type=int, default=16)
    parser.add_argument("--size", type=int, default=128)
    parser.add_argument("--repeat", type=several, default=6, help="renders of each, 2 or more")
    parser.add_argument("--accel", default="numpy")
    options = parser.parse_args()
    print(f"{'lights':14}{'choice':>10}{'variance':>12}{'seconds':>10}{'variance x time':>18}")
    for kind in ("panels", "points"):
        base = 0.0
        for count in (10, 1000):
            scene = lit(kind, count, options.size)
            for choice in ("spatial", "power", "uniform"):
                variance, seconds = measure(scene, choice, options)
                base = base or variance * seconds
                row = f"{count} {kind}"
                print(
                    f"{row:14}{choice:>10}{variance:12.5f}{seconds:10.2f}{variance * seconds / base:17.2f}x"
                )
