"""The four estimators of one scene side by side, at equal samples per pixel.

"naive" and "full" estimate all light that reaches the camera, the other two only what surfaces
get straight from a light. The printed variance is that of one sample, from two independent renders.

python examples/estimators.py [out.png] [--spp 32] [--size 256]
"""

from __future__ import annotations

import argparse

import numpy as np

import wavefront as wf

ESTIMATORS = {
    "naive": "all light, found by chance",
    "direct_simple": "direct light, one sample of a light",
    "direct_mis": "direct light, a sample of a light and one of the BSDF",
    "full": "all light, both samples at every bounce",
}


def courtyard(size: int) -> wf.Scene:
    """Return a yard under an even sky, with a panel of light that touches its floor and back wall.

    Picking directions on the sky is a bad way to find its light: half of them lie below any
    surface. The same holds for picking points on a panel from close by. Following the BSDF is
    good at both, and bad at finding the panel from far away.
    """
    white, blue = wf.Diffuse(0.8), wf.Diffuse((0.25, 0.4, 0.75))
    shapes = [
        wf.Rectangle((-1, 0, 1.6), (2, 0, 0), (0, 0, -2.6), material=white, name="floor"),
        wf.Rectangle((-1, 0, -1), (2, 0, 0), (0, 1.6, 0), material=white, name="back wall"),
        wf.Rectangle((1, 0, -1), (0, 0, 2.6), (0, 1.6, 0), material=blue, name="right wall"),
        wf.Rectangle(
            (-1, 0, -1), (0, 0.8, 0), (0, 0, 0.5), material=white, emission=(8, 5.6, 2.8), name="panel"
        ),
        wf.Sphere((-0.25, 0.3, -0.1), 0.3, material=wf.Diffuse((0.8, 0.35, 0.25)), name="matte"),
        wf.Sphere((0.45, 0.35, -0.5), 0.35, material=wf.Mirror(0.9), name="mirror"),
    ]
    camera = wf.Camera.look_at((0.1, 0.95, 3.1), (0, 0.65, -0.3), fov=36, size=(size, size))
    return wf.Scene(shapes, [wf.Environment((0.25, 0.35, 0.5))], camera)


def compare(scene: wf.Scene, spp: int) -> dict[str, tuple[np.ndarray, float]]:
    """Return the picture of each estimator, and the variance of one sample averaged over the picture."""
    results = {}
    for name in ESTIMATORS:
        first, second = (
            np.asarray(wf.render(scene, spp, integrator=name, seed=seed, branches=1, progress=False))
            for seed in (0, 1)
        )
        # half the squared difference of two estimates is an unbiased estimate of their variance
        results[name] = first, float(((first - second) ** 2).mean(dtype=np.float64)) / 2 * spp
    return results


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="Four estimators of one scene.")
    parser.add_argument("output", nargs="?", default="estimators.png")
    parser.add_argument("--spp", type=int, default=32)
    parser.add_argument("--size", type=int, default=256)
    options = parser.parse_args()
    results = compare(courtyard(options.size), options.spp)
    print(f"{'estimator':<15}{'mean':>9}{'variance':>11}  from left to right")
    for name, (picture, variance) in results.items():
        print(f"{name:<15}{picture.mean():>9.4f}{variance:>11.4f}  {ESTIMATORS[name]}")
    side_by_side = np.concatenate([picture for picture, _ in results.values()], axis=1)
    wf.Image(side_by_side, options.spp).save(options.output)
    print(f"wrote {options.output}")
