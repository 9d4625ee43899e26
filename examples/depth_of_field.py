"""Depth of field: a row of spheres that runs into the distance, of which the middle one is sharp.

python examples/depth_of_field.py [out.png] [--spp 64] [--size 640] [--aperture 0.5] [--focus 12]
"""

from __future__ import annotations

import argparse
import colorsys

import numpy as np

import wavefront as wf

EYE, AHEAD = np.array([0.0, 1.6, 12.0]), np.array([0.475, 0.7, -1.9])


def scene(size: int = 640, aperture: float = 0.5, focus: float | None = None) -> wf.Scene:
    """Return the row; without a focus the camera is focused on the middle sphere, its target."""
    spheres = []
    for k in range(-2, 5):
        color = colorsys.hsv_to_rgb(0.08 + (k + 2) / 9, 0.75, 0.8)
        spheres.append(wf.Sphere((0.95 * (k - 0.5), 0.7, -1.9 * k), 0.7, material=wf.Diffuse(color)))
    lights = []
    for k in range(9):  # a string of lamps far behind, which the lens spreads into discs
        color = np.array(colorsys.hsv_to_rgb(0.02 + 0.018 * k, 0.85, 1.0))
        lights.append(wf.Sphere((2.1 * (k - 4), 2.4 + 0.05 * (k - 4) ** 2, -16), 0.2, emission=3 * color))
    ground = wf.Rectangle(
        (-40, 0, 40), (80, 0, 0), (0, 0, -80), material=wf.Diffuse((0.4, 0.38, 0.36)), name="ground"
    )
    sun = wf.DirectionalLight((-0.6, -1, -0.5), (2.4, 2.2, 1.9), angle=2)
    camera = wf.Camera.look_at(
        EYE, AHEAD, fov=24, size=(size, size * 9 // 16), aperture=aperture, focus=focus
    )
    return wf.Scene([ground, *spheres, *lights], [wf.Environment((0.12, 0.16, 0.26)), sun], camera)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("output", nargs="?", default="depth_of_field.png")
    parser.add_argument("--spp", type=int, default=64)
    parser.add_argument("--size", type=int, default=640)
    parser.add_argument("--aperture", type=float, default=0.5, help="diameter of the lens, 0 for a pinhole")
    parser.add_argument(
        "--focus", type=float, help="distance of the sharp plane (default: the middle sphere)"
    )
    options = parser.parse_args()
    wf.render(scene(options.size, options.aperture, options.focus), options.spp).save(
        options.output, tone="agx_punchy", exposure=0.5
    )
    print(f"wrote {options.output}")
