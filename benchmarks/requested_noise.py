"""The error that `render(noise=...)` leaves, against a converged picture, with each sampler.

python benchmarks/requested_noise.py [--noise 0.02] [--size 64] [--reference-spp 8192]

Printed are the root of the relative MSE (`wf.compare`) and the mean samples per pixel, by default settings,
and the error that the converged picture estimates for itself.
"""

from __future__ import annotations

import argparse

import numpy as np
from adaptive_bias import cornell_box, glass_and_metal

import wavefront as wf

SAMPLERS = ("sobol", "bluenoise", "independent")


def ball_under_a_panel() -> wf.Scene:
    """Return a matte ball on a floor."""
    floor = wf.Rectangle((-4, -1, -4), (0, 0, 8), (8, 0, 0), material=wf.Diffuse(0.6))
    panel = wf.Rectangle((-0.8, 3, -0.8), (1.6, 0, 0), (0, 0, 1.6), emission=8)
    camera = wf.Camera.look_at((0, 1.5, 6), (0, 0, 0), fov=40)
    return wf.Scene([floor, panel, wf.Sphere((0, 0, 0), 1)], camera=camera)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--noise", type=float, default=0.02)
    parser.add_argument("--size", type=int, default=64)
    parser.add_argument("--reference-spp", type=int, default=8192)
    options = parser.parse_args()
    scenes = {
        "ball under a panel": ball_under_a_panel(),
        "glass and mirror under a panel and a dim sky": glass_and_metal(),
        "Cornell box": cornell_box(options.size),
    }
    print(f"| scene | {' | '.join(f'`{sampler}`' for sampler in SAMPLERS)} | converged picture |")
    print("|---|---|---|---|---|")
    for name, scene in scenes.items():
        how = {"size": (options.size, options.size), "progress": False}
        converged = wf.render(scene, options.reference_spp, seed=2**40, **how)
        cells = []
        for sampler in SAMPLERS:
            image = wf.render(scene, noise=options.noise, sampler=sampler, **how)
            error = np.sqrt(wf.compare(image, converged).relative_mse)
            cells.append(f"{error:.2%}, {image.spp:.0f} spp{', shared' if image.metadata['reuse'] else ''}")
        print(f"| {name} | {' | '.join(cells)} | {converged.metadata['noise']:.2%} |", flush=True)


if __name__ == "__main__":
    main()
