"""Bias of adaptive sampling: means of many renders with `noise=`, against a converged picture.

Samples that decide when sampling stops are no longer unbiased. The table shows by how much: of the
whole picture, and of its worst block of 8 × 8 pixels; beside it, what deciding pixel by pixel
instead of tile by tile would do.

python benchmarks/adaptive_bias.py [--seeds 64] [--reference-spp 16384]
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from unittest.mock import patch

import numpy as np

import wavefront as wf
from wavefront.drive import jobs

sys.path.insert(0, str(Path(__file__).parent.parent / "examples"))
from cornell_box import cornell_box
from options import several

SIZE, BLOCK = 24, 8


def glass_and_metal() -> wf.Scene:
    """A glass and a metal ball on a floor, under a panel and a dim sky."""
    floor = wf.Rectangle((-4, -1, -4), (0, 0, 8), (8, 0, 0), material=wf.Diffuse((0.6, 0.5, 0.4)))
    panel = wf.Rectangle((-0.8, 3, -0.8), (1.6, 0, 0), (0, 0, 1.6), emission=(8, 7, 6))
    glass = wf.Sphere((-1.1, 0, 0), 1, material=wf.Dielectric(1.5))
    metal = wf.Sphere((1.1, 0, 0), 1, material=wf.Mirror(0.8))
    camera = wf.Camera.look_at((0, 1.5, 6), (0, 0, 0), fov=45, size=(SIZE, SIZE))
    return wf.Scene([floor, panel, glass, metal], [wf.Environment(0.3)], camera)


def blocks(rgb: np.ndarray) -> np.ndarray:
    """Means of blocks of a picture (SIZE, SIZE, 3)."""
    side = SIZE // BLOCK
    return rgb.reshape(side, BLOCK, side, BLOCK, 3).astype(np.float64).mean((1, 3, 4))


def measure(scene: wf.Scene, noise: float, seeds: int, tile: int) -> tuple[np.ndarray, float]:
    """Return block means of renders with several seeds (seeds, n, n), and their mean spp."""
    with patch.object(jobs, "SQUARE", tile):
        images = [wf.render(scene, noise=noise, seed=seed, progress=False) for seed in range(seeds)]
    return np.stack([blocks(image.rgb) for image in images]), float(np.mean([i.spp for i in images]))


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=several, default=64, help="2 or more")
    parser.add_argument("--reference-spp", type=int, default=16384)
    options = parser.parse_args()
    print(f"{'scene':<8} {'noise':>6} {'tile':>4} {'spp':>7} {'bias of the mean':>20} {'worst block':>20}")
    for name, scene in (("cornell", cornell_box(SIZE)), ("glass", glass_and_metal())):
        converged = blocks(wf.render(scene, options.reference_spp, seed=2**40, progress=False).rgb)
        for noise in (0.1, 0.05):
            for tile in (jobs.SQUARE, 1):
                means, spp = measure(scene, noise, options.seeds, tile)
                overall = means.mean((1, 2)) / converged.mean() - 1
                local = means / converged - 1
                error = local.std(0, ddof=1) / np.sqrt(len(local))
                worst = np.unravel_index(np.abs(local.mean(0)).argmax(), converged.shape)
                print(
                    f"{name:<8} {noise:>6.0%} {tile:>4} {spp:>7.0f} {overall.mean():>+10.3%} ± "
                    f"{overall.std(ddof=1) / np.sqrt(len(overall)):.3%} "
                    f"{local.mean(0)[worst]:>+10.3%} ± {error[worst]:.3%}",
                    flush=True,
                )


if __name__ == "__main__":
    main()
