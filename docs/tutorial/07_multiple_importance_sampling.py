r"""
7. Multiple importance sampling
===============================

The estimators of steps 5 and 6 have the same expected value. BSDF samples are good where the lamp is large
and near, or where the surface is shiny. Light samples are good where the lamp is small. *Multiple importance
sampling* takes one sample of each, and gives each a weight for its direction :math:`\omega`. With the
densities :math:`p` of the technique that drew it and :math:`q` of the other one, the power heuristic (Veach
and Guibas 1995) is

.. math:: w_p(\omega) = \frac{p(\omega)^2}{p(\omega)^2 + q(\omega)^2} ,
   \qquad w_p + w_q = 1 .

Since the weights of a direction add up to 1, the sum of both estimates still has the correct mean. A sample
counts much where its technique rarely draws it, and that is the cause of noise; there its weight is small.
"""

import imageio.v3 as iio
import numpy as np
from tracer import (
    COLOR,
    EMISSION,
    KIND,
    MATTE,
    dot,
    intersect,
    lamp_pdf,
    light_sample,
    normal_at,
    picture,
    render,
    scatter,
)

import wavefront as wf


def power(p, q):
    return np.where(np.isinf(p), 1, p**2 / (np.where(np.isinf(p), 1, p) ** 2 + q**2))


def direct_mis(origin, direction, rng, bounces=5):
    light, throughput, pdf = 0, 1, np.full((len(origin), 1), np.inf)
    for _ in range(bounces + 1):
        distance, which = intersect(origin, direction)
        light = light + throughput * EMISSION[which] * power(pdf, lamp_pdf(origin))
        throughput = throughput * np.isinf(pdf)  # a path ends after its first matte point
        origin = origin + distance * direction
        normal, matte = normal_at(origin, which), (KIND[which] == MATTE)[:, None]
        sample, towards = light_sample(origin, normal, COLOR[which], rng)
        other = np.maximum(dot(normal, towards), 0) / np.pi
        light = light + throughput * matte * sample * power(lamp_pdf(origin), other)
        direction, factor, pdf = scatter(direction, normal, which, rng)
        throughput = throughput * factor
    return light


width, height = 64, 48
iio.imwrite(
    "1_both.png", picture(render(direct_mis, width, height, 16), width, height).repeat(4, 0).repeat(4, 1)
)

# %%
# A density of infinity stands for a delta: after the mirror, and from the camera, the lamp counts in full.
#
# In this room the lamp is small and everything is matte, so both weights are almost those of step 6. The
# difference shows on metal. The scene after that of Veach and Guibas has four plates, from smooth at the back
# to rough at the front, and four lights of equal power. The library renders it with 16 samples per pixel:
# BSDF samples alone, light samples alone, both.

EYE, LIGHTS = np.array([0, 2.0, 10.0]), np.array([0, 4.2, -4.0])
shapes = [wf.Rectangle((-8, -3, 6), (16, 0, 0), (0, 0, -12), material=wf.Diffuse(0.1))]
for roughness, y, z in ((0.09, 0.9, -2.0), (0.15, 0.15, 0.0), (0.22, -0.6, 1.6), (0.32, -1.3, 3.0)):
    middle = np.array([0, y, z])
    # the plate faces halfway between the eye and the lights, so that it reflects them
    to_eye, to_lights = EYE - middle, LIGHTS - middle
    halfway = to_eye / np.linalg.norm(to_eye) + to_lights / np.linalg.norm(to_lights)
    along = np.array([0, halfway[2], -halfway[1]]) / np.linalg.norm(halfway) * 1.1
    metal = wf.Conductor.named("aluminium", roughness=roughness)
    shapes.append(wf.Rectangle(middle - (3.6, 0, 0) - along / 2, (7.2, 0, 0), along, material=metal))
WARM, GREEN, BLUE, WHITE = (1, 0.6, 0.3), (0.4, 0.9, 0.5), (0.4, 0.6, 1), (1, 0.9, 0.9)
for x, radius, color in ((-3.3, 0.06, WARM), (-1.2, 0.18, GREEN), (1, 0.42, BLUE), (3.2, 0.8, WHITE)):
    shapes.append(wf.Sphere(LIGHTS + np.array([x, 0, 0]), radius, emission=2 / radius**2 * np.array(color)))
camera = wf.Camera.look_at(EYE, (0, 0.4, 0), fov=44, size=(200, 150))
scene = wf.Scene(shapes, camera=camera)

wf.render(scene, 16, integrator="naive", max_bounces=1).save("2_bsdf_samples.png", tone="agx")
wf.render(scene, 16, integrator="direct_simple").save("3_light_samples.png", tone="agx")
wf.render(scene, 16, integrator="direct_mis").save("4_both.png", tone="agx")

# %%
# In the library
# --------------
#
# ``integrator="direct_mis"``, and ``sampling/mis.py`` for the weight. Light that is the same in all
# directions is left to BSDF samples alone ("MIS compensation", see the page on the algorithm).
#
# Exercises
# ---------
#
# 1. Use the balance heuristic :math:`p/(p+q)`. *Expect* the same mean and, in this room, the same noise
#    within a per cent: with either weight nearly all comes from the light samples.
# 2. Give both samples the weight 1. *Expect* direct light that is twice as bright. Weights of 1/2 give the
#    correct mean again, but six times the variance of light samples alone.
