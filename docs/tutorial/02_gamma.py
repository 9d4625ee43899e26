"""
2. Gamma
========

A render computes radiance, which is linear: twice the light is twice the number. Displays are not linear. A
code of half the largest value shines with about a fifth of the full brightness, because brightness is about
code\\ :sup:`2.2`. A file for display therefore holds the radiance to the power of 1/2.2.

On the left the linear values are written as they are, with ``gamma=1``: the shadows are much too dark. On
the right they are encoded, as ``save`` does by default.
"""

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
image = wf.render(scene, spp=16)

image.save("1_linear.png", gamma=1)
image.save("2_encoded.png")
