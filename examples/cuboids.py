"""Cuboids of polished blue plastic with edges of metal, in the manner of fresnel's gallery.

python examples/cuboids.py [out.png] [--spp 128] [--size 480]
"""

import argparse

import numpy as np
import trimesh

import wavefront as wf

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("output", nargs="?", default="cuboids.png")
parser.add_argument("--spp", type=int, default=128)
parser.add_argument("--size", type=int, default=480)
options = parser.parse_args()
rng, size = np.random.default_rng(3), np.array([1.2, 0.7, 0.7])
grid = np.stack(np.meshgrid(range(4), range(6), range(4)), -1).reshape(-1, 3)
box, places = trimesh.creation.box(size), np.tile(np.eye(4), (len(grid), 1, 1))
for place, cell in zip(places, grid, strict=True):
    place[:] = trimesh.transformations.euler_matrix(*rng.normal(0, 0.13, 3))
    place[:3, 3] = (cell + rng.normal(0, 0.05, 3)) * size * 1.3
a, b = box.vertices[box.face_adjacency_edges[box.face_adjacency_angles > 1]].swapaxes(0, 1)
a, b = ((end @ places[:, :3, :3].swapaxes(1, 2) + places[:, None, :3, 3]).reshape(-1, 3) for end in (a, b))
metal = wf.Principled((0.9, 0.85, 0.75), metallic=1, roughness=0.2)
plastic = wf.Principled((0.02, 0.04, 0.5), roughness=0.15)
blocks = wf.Instance.many(wf.Mesh(box.vertices, box.faces), places, material=plastic)
shapes = [*blocks, wf.Capsules(a, b, 0.03, material=metal)]
camera = wf.Camera.look_at((14, 11, 25), (2.3, 2.2, 1.3), fov=17, size=(options.size, options.size * 2 // 3))
wf.render(shapes, options.spp, camera=camera, lighting="studio").save(options.output)
print(f"wrote {options.output}")
