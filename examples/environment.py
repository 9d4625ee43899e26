"""Spheres under a sky with a sun, which a function paints into an environment's image.

python examples/environment.py [out.png] [--spp 64] [--size 640] [--sky sky.exr]

Give a picture of your own, such as an HDRI from the web, with --sky.
"""

from __future__ import annotations

import argparse

import numpy as np

import wavefront as wf

SUN = np.array([0.55, 0.45, 0.75]) / np.linalg.norm([0.55, 0.45, 0.75])


def sky(height: int = 256) -> np.ndarray:
    """Return the radiance of a hazy sky, (height, 2·height, 3): top row up, the middle +z."""
    theta = np.pi * (np.arange(height) + 0.5)[:, None] / height
    longitude = 2 * np.pi * (0.5 - (np.arange(2 * height) + 0.5)[None, :] / (2 * height))
    y = np.cos(theta) + 0 * longitude
    towards_sun = SUN[1] * y + np.sin(theta) * (SUN[0] * np.sin(longitude) + SUN[2] * np.cos(longitude))
    haze = np.exp(-6 * np.maximum(y, 0))[:, :, None]
    blue, pale, ground = (
        np.array([0.12, 0.28, 0.75]),
        np.array([0.75, 0.8, 0.85]),
        np.array([0.15, 0.13, 0.1]),
    )
    picture = np.where(y[:, :, None] > 0, blue + (pale - blue) * haze, ground)
    glow = np.exp(-12 * (1 - towards_sun))[:, :, None] * np.array([1.2, 0.9, 0.5])
    disk = (towards_sun > np.cos(np.radians(8)))[:, :, None] * np.array([45.0, 40.0, 31.0])
    return picture + np.where(y[:, :, None] > 0, glow + disk, 0)


def scene(size: int = 640, picture: str | None = None) -> wf.Scene:
    """Return a row of spheres of several materials on a gray ground."""
    materials = [
        wf.Diffuse((0.75, 0.2, 0.12)),
        wf.Conductor.named("gold", roughness=0.4),
        wf.Mirror(0.95),
        wf.Dielectric(1.5),
        wf.Diffuse((0.1, 0.35, 0.65)),
    ]
    spheres = [wf.Sphere((2.2 * (k - 2), 1, 0), 1, material=m) for k, m in enumerate(materials)]
    ground = wf.Disk((0, 0, 0), (0, 1, 0), 2000, material=wf.Diffuse(0.35), name="ground")
    camera = wf.Camera.look_at((0, 2.2, 13), (0, 0.95, 0), fov=29, size=(size, size * 9 // 16))
    return wf.Scene([ground, *spheres], [wf.Environment(picture or sky())], camera)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("output", nargs="?", default="environment.png")
    parser.add_argument("--spp", type=int, default=64)
    parser.add_argument("--size", type=int, default=640)
    parser.add_argument("--sky", help="an image of all directions: exr, hdr, png or jpg")
    options = parser.parse_args()
    wf.render(scene(options.size, options.sky), options.spp).save(options.output)
    print(f"wrote {options.output}")
