r"""
10. One iteration, taken apart
==============================

The library's loop can be stopped after each stage. Here are its buffers: 48 × 48 paths on their way through
two surfaces, as pictures and as a table. A button at the end of this page loads it as a notebook.
"""

import numpy as np

import wavefront as wf

floor = wf.Rectangle((-4, 0, 4), (8, 0, 0), (0, 0, -8), material=wf.Diffuse(0.6), name="floor")
lamp = wf.Rectangle((-1, 3, -1), (2, 0, 0), (0, 0, 2), emission=9, name="lamp")
ball = wf.Sphere((-1.1, 1, 0), 1, material=wf.Diffuse((0.9, 0.5, 0.2)), name="matte")
glass = wf.Sphere((1.1, 1, 0), 1, material=wf.Dielectric(1.5), name="glass")
camera = wf.Camera.look_at((0, 2.2, 6), (0, 1, 0), fov=40, size=(48, 48))
scene = wf.Scene([floor, lamp, ball, glass], [wf.Environment(0.1)], camera)

# %%
# A loop over ``wf.trace`` is the loop of a render with one sample of each pixel. Each step shows the arrays
# that a stage has left behind, a column for each path that is alive.

steps = list(wf.trace(scene, max_bounces=2))
for step in steps:
    print(f"{step.stage:<14} bounce {step.bounce}: {len(step.paths):>5} paths, light {step.light.mean():.4f}")

# %%
# Which columns are alive
# -----------------------
#
# ``compact`` drops the paths that have left the scene or met a lamp, and orders the others by material, so
# that a column is no pixel any more. ``paths.pixel`` finds it again. White are the paths that go on from
# the first surface, from the second, and from the third.


def shown(step, values):
    """Return values (3, n) of the paths of a step as a picture, gray where there is no path."""
    picture = np.full((48 * 48, 3), 0.2, np.float32)
    picture[step.paths.pixel] = np.clip(values.T, 0, 1)
    return picture.reshape(48, 48, 3)


def save(name, *pictures):
    """Save pictures beside each other, five times as large."""
    row = np.concatenate(pictures, axis=1).repeat(5, 0).repeat(5, 1)
    wf.Image(row, spp=1).save(name, tone="none")


compacted = [step for step in steps if step.stage == "compact"]
save("1_alive.png", *(shown(step, np.ones((3, len(step.paths)))) for step in compacted))

# %%
# What the buffers hold
# ---------------------
#
# After the rays of the camera have met their first surfaces: normals, directions to the viewer, and, after
# ``bounce-sample``, the directions in which the paths go on. Each is a picture of (x, y, z) as (red, green,
# blue).

first = next(step for step in steps if step.stage == "shade")
left = next(step for step in steps if step.stage == "bounce-sample")
normal, wo, wi = (
    shown(step, 0.5 + 0.5 * rows)
    for step, rows in ((first, first.surface.ns), (first, first.surface.wo), (left, left.paths.direction))
)
save("2_normal_wo_wi.png", normal, wo, wi)

# %%
# The throughput is what a path may still bring of the light that it meets: the product of f·cosθ/pdf so
# far. And the light: what light samples have brought to the first surfaces, then all.

direct = next(step for step in steps if step.stage == "direct")
pictures = (np.clip(step.light.T.reshape(48, 48, 3), 0, 1) for step in (direct, steps[-1]))
save("3_throughput_and_light.png", shown(left, left.paths.throughput), *pictures)

# %%
# One path
# --------
#
# The path of a pixel, vertex by vertex: the glass reflects it to the floor, from where it goes through the
# glass and meets the lamp. It is a caustic, found by chance, and shines brightly.

path = wf.trace(scene, max_bounces=4).path((42, 32))
print(path)

# %%
# The same path in the scene: its segments are capsules, and the light samples are yellow.

beside = wf.Camera.look_at((3.5, 4, 4.5), (0.5, 0.8, 0), fov=38, size=(240, 180))
image = wf.render(wf.Scene([*scene.shapes, *path.shapes(0.03)], scene.lights, beside), 32)
image.save("4_path.png")

# %%
# The last step is the picture that ``render`` makes of one sample, bit for bit: it is the same loop.

image = wf.render(scene, spp=1, max_bounces=2, branches=1, reuse=False)
print(np.array_equal(steps[-1].light.T.reshape(48, 48, 3), image.rgb))

# %%
# In the library
# --------------
#
# ``integrators/ladder.py`` has the loop, and ``integrators/steps.py`` the stages that it calls.
# ``watching/trace.py`` is told by the recorder that travels with the paths. ``print(wf.program(scene))``
# lists the stages of a scene.
#
# Exercises
# ---------
#
# 1. Let the camera see a mirror in place of the matte ball. *Expect* that its columns come last after
#    ``compact``, as materials with only delta lobes do, and that ``direct`` leaves the light there as it
#    is.
# 2. Print the steps for ``max_bounces=20``. *Expect* as many paths at ``intersect`` as at the step before it
#    at the first two surfaces, and fewer from the third on: Russian roulette ends them.
