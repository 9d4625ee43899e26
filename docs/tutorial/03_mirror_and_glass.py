r"""
3. The rendering equation, mirrors and glass
============================================

The radiance that leaves a point :math:`x` in direction :math:`\omega_o` is what it emits and what it
scatters of the light that arrives from all directions :math:`\omega_i` (Kajiya 1986):

.. math:: L_o(x,\omega_o) = L_e(x,\omega_o)
   + \int f(\omega_o,\omega_i)\,L_i(x,\omega_i)\,\lvert\cos\theta_i\rvert\,\mathrm d\omega_i .

:math:`f` is the *bidirectional scattering distribution function*, BSDF for short. It describes the
material: which part of the light from :math:`\omega_i` goes on to :math:`\omega_o`, per steradian.

**What the integral runs over.** Directions are points on the unit sphere, and :math:`\mathrm d\omega` is a
small area on it, a *solid angle*, measured in steradian. With the angle :math:`\theta` to the normal and the
azimuth :math:`\varphi` around it,

.. math:: \mathrm d\omega = \sin\theta\,\mathrm d\theta\,\mathrm d\varphi :

the circle of directions at :math:`\theta` is :math:`2\pi\sin\theta` long. A hemisphere has
:math:`2\pi`, the sphere :math:`4\pi`. For matte surfaces and mirrors the domain is the hemisphere around the
normal. For glass it is the whole sphere, since light arrives through it from the other side; this is why
the cosine has the bars of an absolute value.

A BSDF has to be symmetric for reflection, :math:`f(\omega_o,\omega_i)=f(\omega_i,\omega_o)`, and may not
create light, :math:`\int f\cos\theta_i\,\mathrm d\omega_i\le 1`.

**Matte.** :math:`f=\rho/\pi` for all directions. The integral of :math:`\cos\theta` over the hemisphere is
:math:`\pi`, so a part :math:`\rho` of the light is scattered.

**Mirror.** All light of one direction goes to one other direction, :math:`\omega_r =
2\,(\omega_o\cdot\mathbf n)\,\mathbf n - \omega_o`. No ordinary function describes this. It takes a Dirac
delta, which is zero except in one direction and has the integral 1:

.. math:: f(\omega_o,\omega_i) = \rho\;\frac{\delta(\omega_i - \omega_r)}{\cos\theta_i} .

The division by :math:`\cos\theta_i` cancels the cosine of the rendering equation, which is a property of
the arriving light and not of the mirror. What is left is the radiance that one more ray finds, times
:math:`\rho`:

.. math:: \int \rho\,\frac{\delta(\omega_i-\omega_r)}{\cos\theta_i}\,L_i(\omega_i)\cos\theta_i
   \,\mathrm d\omega_i = \rho\,L_i(\omega_r) .

Without that division a mirror would be darker the more obliquely one looks at it.

**Glass.** Two deltas, with the weights :math:`F` and :math:`1-F` of Fresnel's equations: the reflection,
and the refraction by Snell's law :math:`n_1\sin\theta_1=n_2\sin\theta_2`. We do not follow both. We choose
the reflection with the probability :math:`F`. Dividing its weight :math:`F` by this probability leaves 1,
and likewise for the refraction.
"""

import imageio.v3 as iio
import numpy as np
from tracer import COLOR, camera_rays, dot, intersect, normal_at, picture, point_light, unit

MATTE, MIRROR, GLASS = 0, 1, 2
KIND = np.array([MATTE] * 6 + [MATTE, MIRROR, GLASS, MATTE, MATTE])


def reflect(direction, normal):
    return direction - 2 * dot(direction, normal) * normal


def through_glass(direction, normal, rng, index=1.5):
    cos = -dot(direction, normal)
    normal = np.where(cos > 0, normal, -normal)  # towards the ray
    ratio = np.where(cos > 0, 1 / index, index)
    cos = np.abs(cos)
    behind = np.sqrt(np.maximum(1 - ratio**2 * (1 - cos**2), 0))  # 0: total reflection
    s = (ratio * cos - behind) / (ratio * cos + behind)
    p = (ratio * behind - cos) / (ratio * behind + cos)
    reflected = rng.random(cos.shape) < (s**2 + p**2) / 2
    refracted = ratio * direction + (ratio * cos - behind) * normal
    return np.where(reflected, reflect(direction, normal), unit(refracted))


# %%
# Rays that meet the mirror or the glass go on until they meet something matte.

width, height, rays = 120, 90, 8


def followed(origin, direction, rng, bounces):
    color = np.ones(origin.shape)
    for bounce in range(bounces + 1):
        distance, which = intersect(origin, direction)
        origin = origin + distance * direction
        normal = normal_at(origin, which)
        if bounce == bounces:
            break
        for kind, turn in ((MIRROR, reflect), (GLASS, lambda d, n: through_glass(d, n, rng))):
            these = KIND[which] == kind
            direction = np.where(these[:, None], turn(direction, normal), direction)
            color[these] *= COLOR[which[these]]
        matte = KIND[which] == MATTE
        origin = np.where(matte[:, None], origin - 1e-3 * direction, origin)  # met once more
    return color * point_light(origin, normal, COLOR[which]) * (KIND[which] == MATTE)[:, None]


rng = np.random.default_rng(0)
for number, bounces in ((1, 1), (2, 6)):
    light = sum(followed(*camera_rays(width, height, rng), rng, bounces) for _ in range(rays)) / rays
    iio.imwrite(f"{number}_bounces_{bounces}.png", picture(light, width, height).repeat(3, 0).repeat(3, 1))

# %%
# On the left one bounce: the mirror shows the room, and in it spheres that are not matte are black. On the
# right six bounces: light needs two of them to cross the glass sphere.
#
# In the library
# --------------
#
# ``wf.Mirror`` and ``wf.Dielectric`` (``bsdfs/mirror.py``, ``bsdfs/dielectric.py``). Their lobes are *delta
# lobes*: ``f`` and the density ``p`` are infinite, and their ratio :math:`f\cos\theta/p = \rho` is what
# ``sample`` returns as the weight.
#
# Exercises
# ---------
#
# 1. Leave out the division by :math:`\cos\theta_i` in the formula of the mirror, that is, multiply its color
#    by the cosine, and divide the new picture by the old one. *Expect* a quotient that falls from 1 in the
#    middle of the mirror sphere to a half at 87 % of its radius, and to 0 at its rim. In the picture itself
#    it is hardly seen.
# 2. Set the index of the glass to 1. *Expect* the sphere to vanish, except for its shadow.
# 3. Why is the shadow of the glass sphere as black as that of the matte sphere? *Expect* a flaw of the
#    method: a shadow ray goes straight and stops at the glass. Light that the glass refracts is a caustic,
#    which steps 5 and 8 find.
