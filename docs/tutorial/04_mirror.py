"""
4. A mirror
===========

A mirror scatters all light of a direction into one other direction, the reflection about the normal. The
integral of the rendering equation then has a single direction that counts, and its estimate is the color
that one more ray finds. No light sample could find that direction by chance, so none is taken.

``max_bounces`` limits how often a path is scattered. With 1 the mirror shows the sky and the lamp, and other
surfaces in it are black: their light needs a second step.
"""

import wavefront as wf

shapes = [
    wf.Rectangle((-3, 0, 3), (6, 0, 0), (0, 0, -6), material=wf.Diffuse(0.6)),
    wf.Sphere((-1.1, 0.8, 0), 0.8, material=wf.Mirror(0.95)),
    wf.Sphere((0.9, 0.6, 0.6), 0.6, material=wf.Diffuse((0.25, 0.45, 0.8))),
    wf.Rectangle((1, 4, 2), (2, 0, 0), (0, 0, 2), emission=15),
]
camera = wf.Camera.look_at((0, 1.8, 6), (0, 0.6, 0), fov=32, size=(200, 150))
scene = wf.Scene(shapes, [wf.Environment((0.1, 0.15, 0.25))], camera)

wf.render(scene, spp=32, max_bounces=1).save("1_one_bounce.png")
wf.render(scene, spp=32, max_bounces=8).save("2_eight_bounces.png")
