r"""
1. Rays and what they meet
==========================

We build a path tracer in NumPy, in about a hundred lines. Its scene has spheres only, so one formula finds
what a ray meets. A ray starts at a point :math:`\mathbf o` and has a unit direction :math:`\mathbf d`. Its
points are

.. math:: \mathbf x(t) = \mathbf o + t\,\mathbf d, \qquad t > 0 .

A point lies on a sphere with center :math:`\mathbf c` and radius :math:`r` if :math:`\lvert\mathbf x -
\mathbf c\rvert^2 = r^2`. With :math:`\mathbf a = \mathbf o - \mathbf c` this is a quadratic equation for
:math:`t`,

.. math:: t^2 + 2\,(\mathbf a\cdot\mathbf d)\,t + \lvert\mathbf a\rvert^2 - r^2 = 0,
   \qquad t = -b \pm\sqrt{b^2 - c}, \quad b = \mathbf a\cdot\mathbf d,\; c = \lvert\mathbf a\rvert^2 - r^2 .

The ray misses the sphere if :math:`b^2 < c`. Otherwise the smaller positive solution is the hit.
"""

# %%
# The scene
# ---------
#
# A matte, a mirror and a glass sphere of radius 10 stand in a room. The floor, the ceiling and the walls are
# spheres of radius 925 to 990: so large that they look flat. The last sphere is the lamp.

import imageio.v3 as iio
import numpy as np

FAR = 1000.0
ROOM = [(0, -FAR, 0), (0, FAR, 0), (-FAR, 0, 0), (FAR, 0, 0), (0, 0, -FAR), (0, 0, FAR)]
CENTER = np.array(
    [*ROOM, (-21, 0, -4), (0, 0, -18), (20, 0, -4), (-15, 35, 25)]
)  # matte, mirror, glass, lamp
RADIUS = np.array([990.0, 950, 955, 955, 950, 925, 10, 10, 10, 5])
EYE, TARGET, FIELD = np.array([0.0, 8, 55]), np.array([0.0, 5, 0]), np.radians(60)

# %%
# Camera
# ------
#
# Each pixel sends a ray through a random point of the pixel. The mean of many such rays has no jagged edges.
# All rays are computed at once: an array has a row for each ray, and no loop runs over pixels.


def dot(a, b):
    return (a * b).sum(-1, keepdims=True)


def unit(a):
    return a / np.sqrt(dot(a, a))


def camera_rays(width, height, rng):
    y, x = np.mgrid[0:height, 0:width].reshape(2, -1) + rng.random((2, width * height))
    up = 2 * np.tan(FIELD / 2) * (0.5 - y / height)
    right = 2 * np.tan(FIELD / 2) * (x - width / 2) / height
    forward = unit(TARGET - EYE)
    sideways = unit(np.cross(forward, (0, 1, 0)))
    across = np.cross(sideways, forward)
    direction = unit(forward + right[:, None] * sideways + up[:, None] * across)
    return np.broadcast_to(EYE, direction.shape), direction


# %%
# The nearest sphere
# ------------------
#
# Arrays of all rays by all ten spheres: ``@`` multiplies each direction with each center. Distances below
# 1e-4 do not count: a ray that starts on a sphere must not meet the same place again because of rounding.


def intersect(origin, direction):
    b = dot(origin, direction) - direction @ CENTER.T
    c = dot(origin, origin) - 2 * origin @ CENTER.T + dot(CENTER, CENTER)[:, 0] - RADIUS**2
    root = np.sqrt(np.maximum(b * b - c, 0))
    t = np.where(-b - root > 1e-4, -b - root, -b + root)  # the far side where the ray starts inside
    t[(b * b < c) | (t < 1e-4)] = np.inf
    which = t.argmin(1)
    nearest = np.take_along_axis(t, which[:, None], 1)
    missed = np.isinf(nearest)
    return np.where(missed, 0, nearest), np.where(missed[:, 0], -1, which)


def normal_at(point, which):
    return unit(point - CENTER[which])


# %%
# These pictures need no light: the first shows the distance, where near is bright; the second shows each
# normal as a color.

width, height = 160, 120
origin, direction = camera_rays(width, height, np.random.default_rng(0))
distance, which = intersect(origin, direction)
near = np.exp(-distance / 60).reshape(height, width)
normal = normal_at(origin + distance * direction, which).reshape(height, width, 3)
iio.imwrite("1_distance.png", (255 * near).astype(np.uint8).repeat(2, 0).repeat(2, 1))
iio.imwrite("2_normal.png", (127.5 + 127.5 * normal).astype(np.uint8).repeat(2, 0).repeat(2, 1))

# %%
# In the library
# --------------
#
# The stages ``generate`` (``stages/generate.py``) and ``intersect`` (``stages/intersect.py``). A bounding
# volume hierarchy, which is a tree of boxes, replaces the test of all spheres. A bound on the rounding error
# replaces 1e-4.
#
# Exercises
# ---------
#
# 1. Set ``FIELD`` to 30 degrees. *Expect* the spheres at more than twice the size.
# 2. In ``tracer.py``, whose ``intersect`` the next steps use, replace ``> 1e-4`` by ``> 0`` and ``< 1e-4`` by
#    ``<= 0``, and render step 2. *Expect* black dots on half of the lit points of the small spheres: their
#    shadow rays meet the sphere from which they start. (With ``< 0`` the walls turn black too: a hit at the
#    distance 0 counts.)
# 3. How many additions and multiplications does a picture of a million pixels take here? *Expect* about 3·10⁸
#    for ten spheres, and 10⁴ times as many for a mesh of 100 000 triangles: the reason for trees.
