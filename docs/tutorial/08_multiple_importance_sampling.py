"""
8. Multiple importance sampling
===============================

Four plates of metal, from smooth at the back to rough at the front, reflect four lights of equal power,
from small to large: a scene after that of Veach and Guibas (1995). Only direct light is computed, with 16
samples per pixel.

Light samples are good for small lights on rough plates. On smooth plates nearly all points of a large light
are outside the reflection, so few samples count, and these count much: noise. BSDF samples are good where
light samples are bad. The power heuristic weighs both by their densities, w = p²/(p² + q²): the weights of
a direction add up to one, and the better sample gets the larger weight.

First ``naive`` with one bounce, which has only BSDF samples, then ``direct_simple``, which has only light
samples, then ``direct_mis``, which has one of each.
"""

import numpy as np

import wavefront as wf

EYE, LIGHTS = np.array([0, 2.0, 10.0]), np.array([0, 4.2, -4.0])
shapes = [wf.Rectangle((-8, -3, 6), (16, 0, 0), (0, 0, -12), material=wf.Diffuse(0.1))]
for roughness, height, z in ((0.09, 0.9, -2.0), (0.15, 0.15, 0.0), (0.22, -0.6, 1.6), (0.32, -1.3, 3.0)):
    middle = np.array([0, height, z])
    # the plate faces halfway between the eye and the lights, so that it reflects them
    halfway = (EYE - middle) / np.linalg.norm(EYE - middle) + (LIGHTS - middle) / np.linalg.norm(
        LIGHTS - middle
    )
    along = np.array([0, halfway[2], -halfway[1]]) / np.linalg.norm(halfway) * 1.1
    metal = wf.Conductor.named("aluminium", roughness=roughness)
    shapes.append(wf.Rectangle(middle - (3.6, 0, 0) - along / 2, (7.2, 0, 0), along, material=metal))
WARM, GREEN, BLUE, WHITE = (1, 0.6, 0.3), (0.4, 0.9, 0.5), (0.4, 0.6, 1), (1, 0.9, 0.9)
for x, radius, color in ((-3.3, 0.06, WARM), (-1.2, 0.18, GREEN), (1, 0.42, BLUE), (3.2, 0.8, WHITE)):
    shapes.append(wf.Sphere(LIGHTS + np.array([x, 0, 0]), radius, emission=2 / radius**2 * np.array(color)))
camera = wf.Camera.look_at(EYE, (0, 0.4, 0), fov=44, size=(200, 150))
scene = wf.Scene(shapes, camera=camera)

wf.render(scene, 16, integrator="naive", max_bounces=1).save("1_bsdf_samples.png", tone="agx")
wf.render(scene, 16, integrator="direct_simple").save("2_light_samples.png", tone="agx")
wf.render(scene, 16, integrator="direct_mis").save("3_both.png", tone="agx")
