"""
7. Four estimators
==================

The four integrators estimate the same equation with increasing skill.

- ``naive`` follows directions of the BSDF until one meets a light, which for a small light is rare.
- ``direct_simple`` picks a point on a light. It has direct light only.
- ``direct_mis`` takes both samples and weighs them by their densities. It has direct light only.
- ``full`` does that at every bounce, so it has all light, at little noise.

All four have 16 samples per pixel.
"""

import wavefront as wf

white = wf.Diffuse(0.75)
shapes = [
    wf.Rectangle((-1.5, 0, 1.5), (3, 0, 0), (0, 0, -3), material=white),
    wf.Rectangle((-1.5, 0, -1.5), (3, 0, 0), (0, 2.4, 0), material=white),
    wf.Rectangle((-1.5, 0, 1.5), (0, 0, -3), (0, 2.4, 0), material=wf.Diffuse((0.75, 0.25, 0.15))),
    wf.Sphere((-0.5, 0.5, -0.3), 0.5, material=white),
    wf.Sphere((0.6, 0.4, 0.3), 0.4, material=wf.Mirror(0.9)),
    wf.Rectangle((-0.3, 2.2, -0.3), (0.6, 0, 0), (0, 0, 0.6), emission=20),
]
camera = wf.Camera.look_at((0.6, 1.3, 5), (0, 0.9, 0), fov=30, size=(160, 120))
scene = wf.Scene(shapes, camera=camera)
for number, name in enumerate(("naive", "direct_simple", "direct_mis", "full"), 1):
    wf.render(scene, 16, integrator=name).save(f"{number}_{name}.png", tone="agx")
