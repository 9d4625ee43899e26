"""
6. Indirect light, and noise
============================

What a surface scatters lights other surfaces. Monte Carlo estimates the integral by random directions ωi
with a density p, as the mean of f·Li·cosθ/p. For a diffuse surface, directions with p = cosθ/π leave only
the reflectance::

    x = cos(2π r1) √(1 − r2)      y = sin(2π r1) √(1 − r2)      z = √r2

To follow n directions at each of r bounces would take nʳ rays. One direction at each bounce, and n paths
for each pixel, have the same mean. The price is noise, which falls with 1/√n where samples are independent:
100 times the samples leave a tenth of it. These are 1, 10, 100 and 1000 samples per pixel. The error is
estimated from how much samples differ, so of a single one it is not known: nan.
"""

import wavefront as wf

red, white, blue = wf.Diffuse((0.75, 0.2, 0.15)), wf.Diffuse(0.75), wf.Diffuse((0.15, 0.25, 0.7))
room = [
    wf.Rectangle((-1, 0, 1), (2, 0, 0), (0, 0, -2), material=white),
    wf.Rectangle((-1, 2, -1), (2, 0, 0), (0, 0, 2), material=white),
    wf.Rectangle((-1, 0, -1), (2, 0, 0), (0, 2, 0), material=white),
    wf.Rectangle((-1, 0, 1), (0, 0, -2), (0, 2, 0), material=red),
    wf.Rectangle((1, 0, -1), (0, 0, 2), (0, 2, 0), material=blue),
    wf.Rectangle((-0.4, 1.99, -0.4), (0.8, 0, 0), (0, 0, 0.8), emission=8),
    wf.Sphere((-0.35, 0.4, -0.2), 0.4, material=white),
    wf.Sphere((0.45, 0.3, 0.3), 0.3, material=white),
]
camera = wf.Camera.look_at((0, 1, 4.4), (0, 1, 0), fov=32, size=(80, 80))
for number, spp in enumerate((1, 10, 100, 1000), 1):
    image = wf.render(wf.Scene(room, camera=camera), spp, sampler="independent")
    image.save(f"{number}_{spp}_spp.png", tone="agx", exposure=0.5)
    print(f"{spp:5} samples per pixel: relative error {image.metadata['noise']:.3f}")
