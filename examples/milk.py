"""A glass of milk: the milk reaches into the glass, and priorities say which of both is there.

python examples/milk.py [out.png] [--spp 128] [--size 480]

With these defaults it runs for about five minutes on two cores: a path scatters hundreds of times.
"""

from __future__ import annotations

import argparse

from caustics import lathe, rounded

import wavefront as wf

# Lengths are in units of 4 cm. Real milk is denser, which takes more bounces and looks the same.
MILK = wf.Medium(
    albedo=(0.9999, 0.9995, 0.998), mean_free_path=(0.05, 0.04, 0.035), phase=wf.HenyeyGreenstein(0.7)
)


def glass_of_milk(size: int) -> wf.Scene:
    """Return a tumbler, two thirds full, on a table."""
    outline = [(1e-3, 0.01), (0.4, 0.01), (0.5, 1.2), (0.46, 1.2), (0.37, 0.12), (1e-3, 0.12)]
    tumbler = lathe(rounded(outline, 0.015), (0, 0, 0), wf.Material(wf.Dielectric(1.5), priority=2))
    milk = wf.Material(wf.Dielectric(1.35), interior=MILK, priority=1)
    inside = lathe(rounded([(1e-3, 0.1), (0.385, 0.1), (0.46, 0.85), (1e-3, 0.85)], 0.01), (0, 0, 0), milk)
    table = wf.Rectangle((-6, 0, 6), (12, 0, 0), (0, 0, -12), material=wf.Diffuse((0.25, 0.16, 0.1)))
    window = wf.Rectangle((-4, 0.5, 2), (0, 0, -4), (0, 4, 0), emission=4)
    camera = wf.Camera.look_at((0.6, 1.7, 2.8), (0, 0.55, 0), fov=32, size=(size, size * 2 // 3))
    return wf.Scene([tumbler, inside, table, window], wf.Environment((0.5, 0.55, 0.65)), camera)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("output", nargs="?", default="milk.png")
    parser.add_argument("--spp", type=int, default=128)
    parser.add_argument("--size", type=int, default=480)
    options = parser.parse_args()
    wf.render(glass_of_milk(options.size), options.spp, max_bounces=200).save(options.output)
    print(f"wrote {options.output}")
