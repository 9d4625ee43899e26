r"""
8. The full estimator
=====================

The path takes a weighted light sample at *every* matte point, and then follows the direction of its BSDF
sample. This finds all light, direct and indirect. Two techniques make it fast.

**Russian roulette.** Most paths carry next to nothing after a few reflections. Each goes on with a
probability :math:`q`, and its throughput is divided by :math:`q`. The expected value stays the same:

.. math:: q\cdot\frac{T}{q} + (1-q)\cdot 0 = T .

If :math:`q` is the largest channel of :math:`T`, all paths that go on carry about the same.

**Compaction.** Paths that have ended are removed from the arrays, so that no work is done for them.
``slot`` holds the row of the result that each path belongs to.
"""

import time

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
    naive,
    normal_at,
    picture,
    power,
    render,
    scatter,
)


def full(origin, direction, rng, bounces=5, first_roulette=2):
    light, slot = np.zeros(origin.shape), np.arange(len(origin))
    throughput, pdf = np.ones(origin.shape), np.full((len(origin), 1), np.inf)
    for bounce in range(bounces + 1):
        distance, which = intersect(origin, direction)
        light[slot] += throughput * EMISSION[which] * power(pdf, lamp_pdf(origin))
        if bounce == bounces:
            break
        origin = origin + distance * direction
        normal = normal_at(origin, which)
        matte = (KIND[which] == MATTE)[:, None]
        sample, towards = light_sample(origin, normal, COLOR[which], rng)
        other = np.maximum(dot(normal, towards), 0) / np.pi
        light[slot] += throughput * sample * power(lamp_pdf(origin), other) * matte
        direction, factor, pdf = scatter(direction, normal, which, rng)
        throughput = throughput * factor
        stay = throughput.max(1) if bounce >= first_roulette else (throughput.max(1) > 0).astype(float)
        alive = np.flatnonzero(rng.random(len(slot)) < stay)
        throughput = throughput[alive] / np.minimum(stay[alive], 1)[:, None]
        slot, origin, direction, pdf = slot[alive], origin[alive], direction[alive], pdf[alive]
    return light


# %%
# Equal time
# ----------
#
# ``full`` takes longer for a path than ``naive``, as it also traces a shadow ray at each point. So we compare
# at equal *time*: on the left ``naive``, on the right ``full`` with as many paths as fit into the same time.

width, height, parts = 64, 48, 8


def in_parts(estimator, paths):
    """Return a picture of `parts` independent ones, and the mean of all pixels with its error."""
    pictures = np.array([render(estimator, width, height, paths, seed) for seed in range(parts)])
    means = pictures.mean((1, 2))
    return pictures.mean(0), means.mean(), means.std(ddof=1) / np.sqrt(parts)


def seconds(estimator, paths):
    begin = time.process_time()
    render(estimator, width, height, paths)
    return (time.process_time() - begin) / paths


paths = max(1, int(8 * seconds(naive, 8) / seconds(full, 8)))
pair = []
for name, estimator, count in (("naive", naive, 8), ("full", full, paths)):
    result, mean, error = in_parts(estimator, count)
    pair.append(picture(result, width, height))
    print(f"mean of {name:<5} {mean:.3f} ± {error:.3f}")
iio.imwrite("1_naive_and_full.png", np.concatenate(pair, 1).repeat(4, 0).repeat(4, 1))

# %%
# Both have the same mean, within the errors. The bright dots on the floor are light that the glass sphere
# focuses: a *caustic*. No light sample finds it, because the shadow ray stops at the glass. Only paths that
# meet the lamp by chance do.
#
# All cores
# ---------
#
# Paths do not depend on each other, so each process can render some of them, and the picture is the mean of
# all parts. Every part needs random numbers of its own: two processes that start from the same seed would
# draw the same picture twice, and their mean is as noisy as either.
#
# .. code-block:: python
#
#    from concurrent.futures import ProcessPoolExecutor
#
#    with ProcessPoolExecutor() as pool:
#        parts = [pool.submit(tracer.render, tracer.full, 64, 48, 16, seed) for seed in range(8)]
#        radiance = np.mean([part.result() for part in parts], 0)
#
# In the library
# --------------
#
# ``integrator="full"``, the default. Roulette and compaction are the stage ``compact``
# (``stages/compact.py``). In a room with a panel of light, 48 by 48 pixels, the library's ``full`` has about
# thirty times less squared error than its ``naive`` in the same time (``benchmarks/naive_vs_full.py``):
#
# .. image:: /docs/naive_vs_full.jpg
#    :alt: The Cornell box by naive and by full, rendered in the same time
#
# With ``caustics=True`` paths from the lamps find the caustics. This is called light tracing.
#
# Exercises
# ---------
#
# 1. Count the rays of ``full`` with roulette and without (``first_roulette=9``). *Expect* a third fewer, and
#    about a sixth more variance: at equal time a small gain here, and a large one with 50 bounces.
# 2. Remove the division by ``stay``. *Expect* a picture that is too dark, by an eighth in the mean, and most
#    where indirect light counts most.
# 3. Add ``EMISSION`` only where ``pdf`` is finite. *Expect* the lamp to turn black, its reflections in mirror
#    and glass to vanish, and the caustic with them: its paths meet the lamp after glass.
