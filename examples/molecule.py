"""A fullerene, C60: sixty atoms, and bonds between neighbors.

python examples/molecule.py [out.png] [--spp 64] [--size 480]
"""

import argparse

import numpy as np

import wavefront as wf

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("output", nargs="?", default="molecule.png")
parser.add_argument("--spp", type=int, default=64)
parser.add_argument("--size", type=int, default=480)
options = parser.parse_args()
golden = (1 + 5**0.5) / 2
kinds = (0, 1, 3 * golden), (1, 2 + golden, 2 * golden), (golden, 2, 2 * golden + 1)
signs = np.stack(np.meshgrid(*[(-1, 1)] * 3), -1).reshape(-1, 3)
atoms = np.unique(
    [np.roll(kind, turn) * sign for kind in kinds for turn in range(3) for sign in signs], axis=0
)
distance = np.linalg.norm(atoms[:, None] - atoms, axis=2)
first, second = np.nonzero(np.triu(np.isclose(distance, 2)))
balls = wf.Spheres(atoms, 0.55, material=wf.Principled((0.06, 0.07, 0.09), roughness=0.25))
sticks = wf.Cylinders(atoms[first], atoms[second], 0.22, material=wf.Conductor.named("gold", roughness=0.25))
camera = wf.Camera.look_at((9, 7, 24), (0, 0, 0), fov=28, size=(options.size, options.size * 2 // 3))
wf.render([balls, sticks], options.spp, camera=camera, lighting="studio").save(options.output)
print(f"wrote {options.output}")
