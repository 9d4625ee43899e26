r"""
4. Monte Carlo and importance sampling
======================================

The integral of the rendering equation has no closed form in a room. Monte Carlo estimates it: draw
directions :math:`\omega_1,\dots,\omega_n` at random with a density :math:`p`, and take the mean

.. math:: \int g(\omega)\,\mathrm d\omega \;\approx\; \frac1n\sum_{k=1}^n \frac{g(\omega_k)}{p(\omega_k)},
   \qquad g = f\,L_i\cos\theta .

A *density* over directions says how likely samples are: a part :math:`\int p\,\mathrm d\omega` of them falls
into a range of directions, and over all directions the integral is 1. It is a density per solid angle. Angles
:math:`\theta` and :math:`\varphi` drawn evenly are not evenly spread directions: the density is then
proportional to :math:`1/\sin\theta`, and samples crowd around the normal.

The expected value of the mean is the integral, for any :math:`p` that is positive where :math:`g` is not
zero. Its error falls as :math:`1/\sqrt n`: a hundred times the samples leave a tenth of the noise. The error
also depends on :math:`p`: the closer :math:`p` is to a multiple of :math:`g`, the less :math:`g/p` varies. To
choose such a :math:`p` is called *importance sampling*.

Two densities for a matte surface, whose :math:`f=\rho/\pi` is constant:

- **uniform** over the hemisphere: :math:`p = \frac{1}{2\pi}`, with :math:`z=u_2,\; x,y =
  \sqrt{1-u_2^2}\,(\cos 2\pi u_1, \sin 2\pi u_1)`. Each sample counts :math:`\frac{f\cos\theta}{p} =
  2\rho\cos\theta` times the light that it finds;
- **cosine-weighted**: :math:`p = \frac{\cos\theta}{\pi}`, with :math:`z=\sqrt{u_2},\;
  x,y=\sqrt{1-u_2}\,(\cos 2\pi u_1,\sin 2\pi u_1)`. Everything but the reflectance cancels:
  :math:`\frac{f\cos\theta}{p} = \rho`.

Most uniform directions are near the tangent plane: half of them are more than 60° away from the normal. They
bring little light, and the estimator multiplies by a small cosine. Cosine-weighted sampling draws a quarter
of its samples there. So where the cosine has not been counted yet, a sample there weighs more: the division
by :math:`p=\cos\theta/\pi` raises it, and the cosine of the equation lowers it by as much.

Rounding can make :math:`p` exactly 0, for a direction in the tangent plane. Such a sample is discarded, and
counts as black: light from there has no cosine anyway.
"""

import imageio.v3 as iio
import numpy as np
from tracer import (
    COLOR,
    GLASS,
    KIND,
    MATTE,
    MIRROR,
    intersect,
    normal_at,
    picture,
    point_light,
    reflect,
    render,
    through_glass,
    unit,
)


def uniform_directions(u):
    phi, radius = 2 * np.pi * u[0], np.sqrt(1 - u[1] ** 2)
    return np.stack([np.cos(phi) * radius, np.sin(phi) * radius, u[1]], -1)


def cosine_directions(u):
    phi, radius = 2 * np.pi * u[0], np.sqrt(1 - u[1])
    return np.stack([np.cos(phi) * radius, np.sin(phi) * radius, np.sqrt(u[1])], -1)


def around(normal, local):
    helper = np.where(np.abs(normal[:, :1]) > 0.9, (0.0, 1.0, 0.0), (1.0, 0.0, 0.0))
    tangent = unit(np.cross(helper, normal))
    return local[:, :1] * tangent + local[:, 1:2] * np.cross(normal, tangent) + local[:, 2:] * normal


# %%
# A first test
# ------------
#
# The irradiance under a sky of radiance 1 is :math:`\int\cos\theta\,\mathrm d\omega=\pi`. A uniform sample is
# :math:`2\pi\cos\theta`, of standard deviation :math:`\pi/\sqrt3`. A cosine-weighted one is :math:`\pi`,
# always.

u = np.random.default_rng(0).random((2, 1000))
uniform = np.cos(np.arccos(uniform_directions(u)[:, 2])) / (1 / (2 * np.pi))
cosine = cosine_directions(u)[:, 2] / (cosine_directions(u)[:, 2] / np.pi)
for name, sample in (("uniform", uniform), ("cosine", cosine)):
    error = sample.std() / np.sqrt(sample.size)
    print(f"{name:<8} {sample.mean():.3f} ± {error:.3f}, standard deviation of a sample {sample.std():.3f}")

# %%
# The error of the mean is the standard deviation of a sample divided by :math:`\sqrt n`. Here π is two errors
# above the uniform estimate, as happens to one in twenty. To see the root, we repeat the estimate a thousand
# times for each :math:`n`, and fit a line to the logarithms of :math:`n` and of the error. Its slope should
# be −1/2.

counts = np.array([1, 4, 16, 64, 256])
rng = np.random.default_rng(1)
errors = [np.sqrt(np.mean((2 * np.pi * rng.random((1000, n)).mean(1) - np.pi) ** 2)) for n in counts]
slope = np.polyfit(np.log(counts), np.log(errors), 1)[0]
print(f"slope of the error: {slope:.3f}")

# a point for each n: to the right n grows fourfold, and down the error falls by half
points = np.full((100, 170, 3), 255, np.uint8)
for n, error in zip(counts, errors, strict=True):
    row, column = round(10 - 20 * np.log2(error / errors[0])), round(10 + 18 * np.log2(n))
    points[row - 4 : row + 4, column - 4 : column + 4] = (30, 90, 160)
iio.imwrite("1_error.png", points.repeat(3, 0).repeat(3, 1))

# %%
# One path in place of a tree of rays
# -----------------------------------
#
# Light is reflected more than once. With :math:`n` directions at each of :math:`r` reflections there would be
# :math:`n^r` rays. One direction at each reflection, and :math:`n` such paths for each pixel, have the same
# expected value: the pixel is one integral of many dimensions. At each matte point the path adds the light of
# the point lamp, and goes on in a random direction.


def paths(directions, pdf):
    def estimator(origin, direction, rng, bounces=2):
        light, throughput = 0, 1
        for _ in range(bounces + 1):
            distance, which = intersect(origin, direction)
            origin = origin + distance * direction
            normal, color = normal_at(origin, which), COLOR[which]
            matte = (KIND[which] == MATTE)[:, None]
            light = light + throughput * matte * point_light(origin, normal, color)
            local = directions(rng.random((2, len(which))))
            factor = color / np.pi * local[:, 2:] / pdf(local[:, 2:])  # f·cosθ/p
            following = around(normal, local)
            for kind, turn in ((MIRROR, reflect), (GLASS, lambda d, n: through_glass(d, n, rng))):
                these = KIND[which] == kind
                following[these], factor[these] = turn(direction[these], normal[these]), color[these]
            direction, throughput = following, throughput * factor
        return light

    return estimator


with_uniform = paths(uniform_directions, lambda cos: 1 / (2 * np.pi))
with_cosine = paths(cosine_directions, lambda cos: cos / np.pi)

# %%
# 1, 10, 100 and 1000 paths for each pixel
# ----------------------------------------
#
# The first row has uniform directions, the second cosine-weighted ones. A display clips what is brighter than
# white, but not the noise below it.

width, height = 40, 30
rows = []
for estimator in (with_uniform, with_cosine):
    pictures = [picture(render(estimator, width, height, n), width, height) for n in (1, 10, 100, 1000)]
    rows.append(np.concatenate(pictures, 1))
iio.imwrite("2_uniform_above_cosine.png", np.concatenate(rows, 0).repeat(5, 0).repeat(5, 1))

# %%
# The noise of both, from two pictures with different random numbers: half of the mean squared difference is
# the variance.

for name, estimator in (("uniform", with_uniform), ("cosine", with_cosine)):
    one, two = (render(estimator, width, height, 40, seed) for seed in (1, 2))
    print(f"{name:<8} variance of one path: {40 * np.square(one - two).mean() / 2:.3f}")

# %%
# In the library
# --------------
#
# ``sampling/warp.py`` has these formulas, and ``bsdfs/diffuse.py`` returns directions with the factor
# :math:`f\cos\theta/p`. The stage ``bounce`` (``stages/bounce.py``) multiplies it onto the throughput. The
# numbers :math:`u` come from a Sobol sequence by default: they are spread more evenly than random ones, and
# the error falls faster than :math:`1/\sqrt n`.
#
# Exercises
# ---------
#
# 1. Forget the :math:`2\pi` of the uniform density: use :math:`p=1`. *Expect* indirect light that is
#    :math:`2\pi=6.3` times as dark for each matte reflection on its way, 39 times after two. A wrong density
#    does not show as noise, but as a wrong mean.
# 2. How many uniform paths have the noise of 100 cosine-weighted ones? *Expect* the ratio of the variances
#    above, times 100: about 200.
# 3. Draw :math:`z=u_2` but divide by :math:`\cos\theta/\pi`. *Expect* a picture whose noise looks normal, of
#    another material: one whose :math:`f` is :math:`\rho/(2\pi\cos\theta)`.
