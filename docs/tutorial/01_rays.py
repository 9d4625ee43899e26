"""
1. Rays and what they meet
==========================

A camera sends a ray through each pixel. The nearest surface that it meets is what the pixel shows. The
layer ``depth`` is the distance of that surface along the view, and ``normal`` is the direction in which the
surface faces. Neither needs any light.
"""

import numpy as np

import wavefront as wf

scene = wf.Scene(
    [
        wf.Rectangle((-3, 0, 3), (6, 0, 0), (0, 0, -6), material=wf.Diffuse(0.6)),
        wf.Sphere((-1.1, 0.8, 0), 0.8, material=wf.Diffuse((0.8, 0.35, 0.2))),
        wf.Sphere((0.9, 0.6, 0.6), 0.6, material=wf.Diffuse((0.25, 0.45, 0.8))),
    ],
    lights=[wf.PointLight((2, 4, 3), 60)],
    camera=wf.Camera.look_at((0, 1.8, 6), (0, 0.6, 0), fov=32, size=(200, 150)),
)
image = wf.render(scene, spp=16, aovs=("depth", "normal"))

# near is bright; a normal is shown as a color, with 0.5 for 0
depth = np.nan_to_num(image.depth, nan=20, posinf=20)
wf.Image(np.repeat(np.exp(-0.25 * (depth - 4))[..., None], 3, 2).astype("f4")).save("1_depth.png")
wf.Image((0.5 + 0.5 * np.nan_to_num(image.normal)).astype("f4")).save("2_normal.png")
