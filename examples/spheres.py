"""A dense fluid of spheres with outlines, in the manner of fresnel's gallery.

python examples/spheres.py [out.png] [--spp 64] [--size 480]
"""

import argparse

import numpy as np

import wavefront as wf

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("output", nargs="?", default="spheres.png")
parser.add_argument("--spp", type=int, default=64)
parser.add_argument("--size", type=int, default=480)
options = parser.parse_args()
centers = np.random.default_rng(1).uniform(0, 7, (440, 3))
for _ in range(150):  # push overlapping spheres apart, within a box
    apart = centers[:, None] - centers
    distance = np.linalg.norm(apart, axis=2) + np.eye(len(centers))
    centers += 0.3 * (apart * np.maximum(1 / distance - 1, 0)[:, :, None]).sum(1)
    centers = np.clip(centers, 0, 7)
green = wf.Principled((0.01, 0.6, 0.01), roughness=0.8)
balls = wf.Spheres(centers, 0.5, material=green)
camera = wf.Camera.look_at((14, 12, 24), (3.5, 3.4, 3.5), fov=27, size=(options.size, options.size * 2 // 3))
layers = "shape_id", "normal", "depth"
image = wf.render(balls, options.spp, camera=camera, lighting="cloudy", aovs=layers)
image.outlined(0, width=options.size / 150).save(options.output, exposure=0.6)
print(f"wrote {options.output}")
