"""Furnaces: scenes whose right answer is known, measured against it.

Prints a table and writes a strip of the four pictures, each divided by its exact value and shown
at half brightness: a correct renderer shows one uniform gray. t is the deviation in standard errors of the
mean; by chance it is beyond 4 once in 900 times (Student's t with 15 degrees of freedom).

python examples/furnace.py [out.png] [--spp 64] [--size 48]
"""

from __future__ import annotations

import argparse

import numpy as np

import wavefront as wf

BATCHES = 16  # independent renders, from whose spread the standard error is taken
ROUNDING = 1e-7  # relative, of pictures in float32
MAX_BOUNCES = 100  # so many that what is cut off does not matter; Russian roulette ends most paths


def box(reflectance: float) -> list[wf.Mesh]:
    """Return a closed room from -0.5 to 0.5 whose six walls reflect, and emit a radiance of 1."""
    walls = []
    for axis in range(3):
        for side in (-0.5, 0.5):
            corner, u, v = np.full(3, -0.5), np.zeros(3), np.zeros(3)
            corner[axis] = side
            u[(axis + 1) % 3] = v[(axis + 2) % 3] = 1
            if side > 0:
                u, v = v, u  # the front faces inwards
            walls.append(wf.Rectangle(corner, u, v, material=wf.Diffuse(reflectance), emission=1))
    return walls


def inside(size: int) -> wf.Camera:
    """Return a camera in the middle of the room."""
    return wf.Camera.look_at((0.1, 0.05, 0.2), (-0.4, 0.3, -0.5), fov=70, size=(size, size))


def furnaces(size: int) -> list[tuple[str, wf.Scene, float]]:
    """Return (name, scene, exact radiance everywhere in the picture)."""
    gray = wf.Diffuse(0.5)
    point = wf.PointLight((0, 0, 0), intensity=np.pi)
    glass = wf.Sphere((0, 0, 0), 1, material=wf.Dielectric(1.5))
    outside = wf.Camera.look_at((0, 0, 4), (0, 0, 0), fov=40, size=(size, size))
    return [
        # light that has bounced k times is the emission times reflectance^k: the sum is 1/(1-reflectance)
        ("closed box, Le = 1, reflectance 0.5", wf.Scene(box(0.5), camera=inside(size)), 2.0),
        ("closed box, Le = 1, reflectance 0.8", wf.Scene(box(0.8), camera=inside(size)), 5.0),
        # the light at the center sends irradiance pi to the whole wall; half of
        # it is scattered, evenly, again and again
        (
            "unit sphere from inside, point light pi",
            wf.Scene([wf.Sphere((0, 0, 0), 1, material=gray)], [point], inside(size)),
            1.0,
        ),
        (
            "unit sphere from inside, Le = 0.5",
            wf.Scene([wf.Sphere((0, 0, 0), 1, material=gray, emission=0.5)], camera=inside(size)),
            1.0,
        ),
        # glass that absorbs nothing is invisible where all around is equally bright
        ("glass sphere in a white world", wf.Scene([glass], [wf.Environment(1)], outside), 1.0),
    ]


def measure(scene: wf.Scene, spp: int) -> tuple[float, float, np.ndarray]:
    """Return mean, standard error of the mean, and the average picture of independent renders."""
    batches = np.stack(
        [
            np.asarray(wf.render(scene, spp, max_bounces=MAX_BOUNCES, seed=seed, progress=False))
            for seed in range(BATCHES)
        ]
    )
    means = batches.mean((1, 2, 3), dtype=np.float64)
    return means.mean(), means.std(ddof=1) / np.sqrt(BATCHES), batches.mean(0)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="Scenes whose right answer is known.")
    parser.add_argument("output", nargs="?", default="furnace.png")
    parser.add_argument("--spp", type=int, default=64)
    parser.add_argument("--size", type=int, default=48)
    options = parser.parse_args()
    print(f"{'scene':<42}{'t':>7}{'exact':>8}{'measured':>11}{'std. error':>12}{'off by':>10}")
    strip = []
    for name, scene, exact in furnaces(options.size):
        mean, error, picture = measure(scene, options.spp)
        t = (mean - exact) / max(error, ROUNDING * exact)
        print(f"{name:<42}{t:>+7.2f}{exact:>8.4f}{mean:>11.5f}{error:>12.6f}{(mean - exact) / exact:>+10.4%}")
        strip.append(picture / exact * 0.5)
    wf.Image(np.concatenate(strip, 1), options.spp * BATCHES).save(options.output)
    print(f"wrote {options.output}")
