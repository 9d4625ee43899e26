"""A cloud of noise on a grid, in the low sun.

python examples/cloud.py [out.png] [--spp 32] [--size 400]
"""

from __future__ import annotations

import argparse

import numpy as np

import wavefront as wf


def noise(size: int, slope: float, rng: np.random.Generator) -> np.ndarray:
    """Return random waves (size, size, size) of mean 0 and deviation 1, weaker the shorter they are."""
    waves = np.meshgrid(*[np.fft.fftfreq(size) * size] * 3, indexing="ij")
    length = np.sqrt(sum(each * each for each in waves))
    amplitude = np.where(length > 0, np.maximum(length, 1) ** -slope, 0)
    values = np.fft.ifftn(np.fft.fftn(rng.normal(size=(size,) * 3)) * amplitude).real
    return values / values.std()


def cumulus(size: int = 96) -> np.ndarray:
    """Return densities (z, y, x) from 0 to 1: a ball with a flat base, torn by noise."""
    z, y, x = (np.indices((size,) * 3) + 0.5) / size * 2 - 1
    ball = 0.62 - np.sqrt(x * x + z * z + (np.where(y < -0.2, 3.0, 1.15) * (y + 0.2)) ** 2)
    return np.clip(6 * (ball + 0.2 * noise(size, 1.9, np.random.default_rng(7))), 0, 1)


def sky(size: int) -> wf.Scene:
    """Return the cloud, a kilometer wide, seen from below."""
    cloud = wf.GridMedium(
        cumulus(), [(-1, -0.7, -1), (1, 0.7, 1)], albedo=0.999, scale=30, phase=wf.HenyeyGreenstein(0.5)
    )
    lights = [wf.Environment((0.06, 0.14, 0.32)), wf.DirectionalLight((1, -0.5, -0.15), (9, 6.5, 4))]
    camera = wf.Camera.look_at((0, -0.75, 3.4), (0, -0.05, 0), fov=26, size=(size, size * 3 // 4))
    return wf.Scene([wf.GridBox(cloud)], lights, camera)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("output", nargs="?", default="cloud.png")
    parser.add_argument("--spp", type=int, default=32)
    parser.add_argument("--size", type=int, default=400)
    options = parser.parse_args()
    image = wf.render(sky(options.size), options.spp, max_bounces=32, denoise=True)
    image.save(options.output, gamma="srgb", tone="agx")
    print(f"wrote {options.output}")
