"""
5. Glass
========

Light that meets glass is divided: Fresnel's equations say how much is reflected, and the rest is refracted
by Snell's law. A path does not split. It goes one of both ways, with the probability that Fresnel's
equations give, and the mean of many paths has both.

On the left a ball of glass, index 1.5. On the right the light is absorbed inside: its color comes from the
length of the way, not from the surface.
"""

import wavefront as wf

floor = wf.Rectangle(
    (-3, 0, 3),
    (6, 0, 0),
    (0, 0, -6),
    material=wf.Diffuse(
        wf.Texture([[0.2, 0.7], [0.7, 0.2]], filter="nearest", transform=[[6, 0, 0], [0, 6, 0], [0, 0, 1]])
    ),
)
clear = wf.Dielectric(1.5)
green = wf.Material(clear, interior=wf.Medium(absorption=(1.2, 0.15, 0.6)))
camera = wf.Camera.look_at((0, 1.6, 6), (0, 0.8, 0), fov=28, size=(240, 135))
scene = wf.Scene(
    [
        floor,
        wf.Sphere((-1.1, 0.9, 0), 0.9, material=clear),
        wf.Sphere((1.1, 0.9, 0), 0.9, material=green),
    ],
    wf.studio("softbox", camera=camera),
    camera,
)
wf.render(scene, spp=64).save("1_glass.png")
