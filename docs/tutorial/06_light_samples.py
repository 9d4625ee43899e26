r"""
6. Light samples (next event estimation)
========================================

We do not wait until a path meets the lamp. We choose a direction among those that lead to it. From a point at
the distance :math:`d` the lamp fills a cone with the half angle :math:`\theta_{\max}`, where
:math:`\sin\theta_{\max}=r/d`. All directions of the cone get the same density:

.. math:: p = \frac{1}{2\pi\,(1-\cos\theta_{\max})}, \qquad
   \cos\theta = 1 - u_2\,(1-\cos\theta_{\max}), \quad \varphi = 2\pi u_1 .

The estimate is :math:`f\,L_e\cos\theta/p` if nothing is in between, else 0. This is the light that comes
straight from the lamp: *direct light*.
"""

import imageio.v3 as iio
import numpy as np
from tracer import (
    CENTER,
    COLOR,
    EMISSION,
    KIND,
    LAMP,
    MATTE,
    RADIUS,
    around,
    dot,
    intersect,
    normal_at,
    picture,
    render,
    scatter,
)


def lamp_cone(point):
    towards = CENTER[LAMP] - point
    squared = dot(towards, towards)
    return towards / np.sqrt(squared), np.sqrt(np.maximum(1 - RADIUS[LAMP] ** 2 / squared, 0))


def lamp_pdf(point):
    return 1 / (2 * np.pi * (1 - lamp_cone(point)[1]))


def light_sample(point, normal, color, rng):
    """Return f·Le·cosθ/p for a direction to the lamp, and that direction."""
    axis, edge = lamp_cone(point)
    u = rng.random((2, len(point), 1))
    cos, phi = 1 - u[1] * (1 - edge), 2 * np.pi * u[0]
    sin = np.sqrt(1 - cos**2)
    towards = around(axis, np.concatenate([np.cos(phi) * sin, np.sin(phi) * sin, cos], 1))
    seen = (intersect(point, towards)[1] == LAMP)[:, None]
    cos = np.maximum(dot(normal, towards), 0)
    return color / np.pi * EMISSION[LAMP] * cos * seen / lamp_pdf(point), towards


# %%
# At the first matte point the path takes a light sample and ends. Mirrors and glass take none, because a
# random direction is never the one that they reflect. After a mirror or glass, and from the camera, the lamp
# counts where the path meets it.


def direct_simple(origin, direction, rng, bounces=5):
    light, throughput = 0, 1
    for _ in range(bounces + 1):
        distance, which = intersect(origin, direction)
        origin = origin + distance * direction
        normal, matte = normal_at(origin, which), (KIND[which] == MATTE)[:, None]
        sample, _ = light_sample(origin, normal, COLOR[which], rng)
        light = light + throughput * (EMISSION[which] + matte * sample)
        direction, factor, _ = scatter(direction, normal, which, rng)
        throughput = throughput * factor * ~matte
    return light


width, height = 64, 48
pictures = [picture(render(direct_simple, width, height, n), width, height) for n in (1, 16)]
iio.imwrite("1_direct.png", np.concatenate(pictures, 1).repeat(4, 0).repeat(4, 1))

# %%
# 1 and 16 paths for each pixel. What is left of the noise is in the soft edges of the shadows: there some
# samples are blocked and some are not.
#
# In the library
# --------------
#
# ``integrator="direct_simple"``. Each light has ``sample_li`` and ``pdf_li`` (``lights/sphere.py`` has the
# cone), and the stage ``shade`` chooses a light, takes the sample and tests whether it is seen. Where there
# are many lights, one is chosen by how much it brings to the point (``lights/tree.py``).
#
# Exercises
# ---------
#
# 1. Choose points evenly on the whole surface of the lamp, with the density :math:`d^2/(4\pi
#    r^2\cos\theta_L)` per solid angle. *Expect* more than half of the samples to be lost: less than half of a
#    sphere faces any point.
# 2. Give the lamp a radius of 12 in ``tracer.py``. *Expect* wide soft shadows: in one picture of one path,
#    more than twice as many points of the floor see a part of the lamp.
