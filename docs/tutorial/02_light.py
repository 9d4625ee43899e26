r"""
2. Light, shadows and gamma
===========================

A point light of intensity :math:`I` (watts per steradian) at distance :math:`d` sends the irradiance

.. math:: E = \frac{I}{d^2}\,\cos\theta

to a surface whose normal makes the angle :math:`\theta` with the direction to the light: light that arrives
at an angle is spread over more surface. A matte surface of reflectance :math:`\rho` sends :math:`L =
\frac{\rho}{\pi} E` in all directions. The :math:`\pi` makes sure that no more light leaves than arrives, as
the next step shows. Where another sphere is between the surface and the light there is a shadow: a *shadow
ray* tests it.
"""

import imageio.v3 as iio
import numpy as np
from tracer import CENTER, camera_rays, dot, intersect, normal_at

WALLS = [(0.75, 0.75, 0.75), (0.85, 0.85, 0.85), (0.75, 0.25, 0.25)]  # floor, ceiling, left
WALLS += [(0.25, 0.35, 0.75), (0.35, 0.7, 0.4), (0.75, 0.45, 0.7)]  # right, back, behind the camera
# the last row is that of a ray that meets nothing, whose number is -1
COLOR = np.array([*WALLS, (0.9, 0.6, 0.2), (0.95, 0.95, 0.95), (1, 1, 1), (0, 0, 0), (0, 0, 0)])
LAMP, POINT_INTENSITY = 9, 3500.0


def point_light(point, normal, color):
    towards = CENTER[LAMP] - point
    distance = np.sqrt(dot(towards, towards))
    towards = towards / distance
    cos = np.maximum(dot(normal, towards), 0)
    seen = (intersect(point, towards)[1] == LAMP)[:, None]
    return color / np.pi * POINT_INTENSITY / distance**2 * cos * seen


# %%
# Gamma
# -----
#
# The result is radiance, which is linear: twice the light is twice the number. A display is not linear. A
# code of half the largest value gives about a fifth of the full brightness, because the brightness is about
#
# .. math:: \text{brightness} = \text{code}^{2.2},\qquad\text{so we store}\qquad \text{code} = L^{1/2.2} .


def picture(radiance, width, height):
    codes = np.clip(radiance, 0, 1) ** (1 / 2.2)
    return (255 * codes.reshape(height, width, 3) + 0.5).astype(np.uint8)


# %%
# On the left the linear values are stored as they are. The shadows are much too dark. On the right they are
# encoded.

width, height = 160, 120
origin, direction = camera_rays(width, height, np.random.default_rng(0))
distance, which = intersect(origin, direction)
point = origin + distance * direction
radiance = point_light(point, normal_at(point, which), COLOR[which])
linear = (255 * radiance.clip(0, 1)).astype(np.uint8).reshape(height, width, 3)
iio.imwrite("1_linear.png", linear.repeat(2, 0).repeat(2, 1))
iio.imwrite("2_encoded.png", picture(radiance, width, height).repeat(2, 0).repeat(2, 1))

# %%
# In the library
# --------------
#
# ``wf.PointLight``, the shadow rays of ``stages/intersect.py``, and ``image.save(..., gamma=2.2)``, which is
# the default. ``codecs/encoding.py`` has the codes. ``tone="agx"`` is a tone curve that keeps bright parts
# from being cut off.
#
# Exercises
# ---------
#
# 1. Leave out ``seen``. *Expect* no shadows, and light on the floor below the spheres.
# 2. Divide by the distance in place of its square. *Expect* white almost everywhere: it is about fifty times
#    as bright.
# 3. A surface has half the radiance of white. Which code does it get? *Expect* 186 of 255, not 128.
