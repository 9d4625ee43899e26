r"""
5. A lamp with a size: the naive estimator
==========================================

A point light is an idealization. Let the lamp be a sphere of radius :math:`r` that emits the radiance
:math:`L_e`. If its intensity is :math:`I`, then :math:`L_e = I/(\pi r^2)`. Now a path can find the light by
itself: it starts at the camera and goes from surface to surface. Where it meets the lamp, it adds the
radiance that the lamp sends back along the path, and goes on: the lamp is black, so that what follows counts
nothing here. Where a light also reflects, as most do, the path must go on; one may only stop at a light that
scatters nothing. After :math:`k` reflections a path carries the *throughput*

.. math:: T_k = \prod_{j=1}^{k}\frac{f_j\cos\theta_j}{p_j},
   \qquad L = \sum_k T_k\,L_e(x_k) .
"""

import imageio.v3 as iio
import numpy as np
from tracer import (
    COLOR,
    GLASS,
    KIND,
    LAMP,
    MIRROR,
    POINT_INTENSITY,
    RADIUS,
    around,
    camera_rays,
    cosine_directions,
    intersect,
    normal_at,
    picture,
    reflect,
    through_glass,
)

# %%
# The directions of all three materials in one function, as in step 4, and the mean of many paths:


def scatter(direction, normal, which, rng):
    """Return the next directions, f·cosθ/p, and the densities p, which are infinite for mirrors and glass."""
    local = cosine_directions(rng.random((2, len(which))))
    following, pdf = around(normal, local), local[:, 2:] / np.pi
    for kind, turn in ((MIRROR, reflect), (GLASS, lambda d, n: through_glass(d, n, rng))):
        these = KIND[which] == kind
        following[these], pdf[these] = turn(direction[these], normal[these]), np.inf
    return following, COLOR[which], pdf


def render(estimator, width, height, paths, seed=0):
    """Return the mean of so many paths for each pixel, (width · height, 3)."""
    rng, total = np.random.default_rng(seed), 0
    for _ in range(paths):
        total = total + estimator(*camera_rays(width, height, rng), rng)
    return total / paths


# %%
# The whole estimator is ten lines.

EMISSION = np.zeros((len(COLOR), 3))
EMISSION[LAMP] = POINT_INTENSITY / (np.pi * RADIUS[LAMP] ** 2)  # so that it shines as the point did


def naive(origin, direction, rng, bounces=5):
    light, throughput = 0, 1
    for _ in range(bounces + 1):
        distance, which = intersect(origin, direction)
        light = light + throughput * EMISSION[which]
        origin = origin + distance * direction
        direction, factor, _ = scatter(direction, normal_at(origin, which), which, rng)
        throughput = throughput * factor
    return light


width, height = 64, 48
pictures = [picture(render(naive, width, height, n), width, height) for n in (10, 100)]
iio.imwrite("1_naive.png", np.concatenate(pictures, 1).repeat(4, 0).repeat(4, 1))

# %%
# 10 and 100 paths for each pixel. The result is unbiased, but noisy: of the directions at a point on the
# floor, about one in 140 leads to the lamp. Most paths find nothing, and a few find all the light. The same
# number of paths had much less noise in step 4, because each path added the light of the lamp at every point.
#
# In the library
# --------------
#
# ``integrator="naive"``: ``li_naive`` in ``integrators/ladder.py``. It is there for comparisons and tests. It
# cannot find points and spots, which have no size.
#
# Exercises
# ---------
#
# 1. Double the radius of the lamp in ``tracer.py``; ``EMISSION`` keeps its power. *Expect* about a quarter of
#    the variance: twice the radius is met by four times as many paths.
# 2. Return the light of paths with exactly one reflection, then two, and so on. *Expect* each further one to
#    be darker, by factors from 0.55 to 0.75: about the mean reflectance of the room, 0.6.
