r"""
9. The same room by the library
===============================

The library computes the same integrals. Here it renders the same scene, built from the same arrays, and both
agree. The end of this page has all steps in one file.
"""

import numpy as np
import tracer

import wavefront as wf

MATERIALS = {tracer.MIRROR: lambda color: wf.Mirror(color), tracer.GLASS: lambda color: wf.Dielectric(1.5)}
spheres = []
for k, (center, radius) in enumerate(zip(tracer.CENTER, tracer.RADIUS, strict=True)):
    material = MATERIALS.get(tracer.KIND[k], wf.Diffuse)(tracer.COLOR[k])
    emission = tracer.EMISSION[k] if k == tracer.LAMP else None
    spheres.append(wf.Sphere(center, radius, material=material, emission=emission))
scene = wf.Scene(spheres, camera=wf.Camera.look_at(tracer.EYE, tracer.TARGET, fov=60, size=(64, 48)))

library = [wf.render(scene, 8, seed=seed, max_bounces=5).rgb.mean() for seed in range(8)]
tutorial = [tracer.render(tracer.full, 64, 48, 8, seed).mean() for seed in range(8)]
for name, means in (("library", library), ("tutorial", tutorial)):
    print(f"{name:<8} {np.mean(means):.3f} ± {np.std(means, ddof=1) / 8**0.5:.3f}")

image = wf.render(scene, 64, max_bounces=5)
image.save("1_library.png")

# %%
# The dots of the caustic are gone with ``caustics=True``, and the rest of the noise with ``denoise=True``.

better = wf.render(scene, 32, size=(160, 120), caustics=True, denoise=True)
better.save("2_caustics_and_denoised.png")

# %%
# What is where
# -------------
#
# .. list-table::
#    :header-rows: 1
#
#    * - step
#      - here
#      - in the library
#      - what the library adds
#    * - 1
#      - ``camera_rays``
#      - ``stages/generate.py``
#      - lenses, filters, panoramas, distortion
#    * - 1
#      - ``intersect``
#      - ``stages/intersect.py``, ``accel/``
#      - triangles, instances, trees, Embree
#    * - 1
#      - ``normal_at``
#      - ``stages/interaction.py``
#      - error bounds, texture coordinates, bumps
#    * - 2
#      - ``point_light``
#      - ``lights/point.py``, ``stages/shade.py``
#      - spots, suns, skies, alpha in shadows
#    * - 2
#      - ``picture``
#      - ``codecs/encoding.py``
#      - tone curves, png of 16 bits, EXR
#    * - 3
#      - ``reflect``, ``through_glass``
#      - ``bsdfs/mirror.py``, ``bsdfs/dielectric.py``
#      - metal, rough glass, absorption
#    * - 4
#      - ``scatter``
#      - ``bsdfs/``, ``stages/bounce.py``
#      - microfacets, layers, textures
#    * - 4
#      - ``render``
#      - ``drive/``, ``workers/``, ``film/film.py``
#      - workers, errors of pixels, checkpoints
#    * - 6
#      - ``light_sample``
#      - ``lights/``
#      - triangles, images, a tree over many lights
#    * - 7
#      - ``power``
#      - ``sampling/mis.py``
#      - MIS compensation
#    * - 8
#      - ``full``
#      - ``integrators/ladder.py``
#      - branches, shared paths, guiding
#    * - 8
#      - roulette and compaction
#      - ``stages/compact.py``
#      - grouping by material
#
# Exercises
# ---------
#
# 1. Render with ``noise=0.15`` in place of a number of samples. *Expect* 32 samples on the floor in front,
#    where the light is even, and half as many again in most other places: ``image.counts`` shows them, for
#    tiles of 8 by 8 pixels.
# 2. Add a mesh. ``ball = trimesh.creation.icosphere(subdivisions=4)`` has 5 120 triangles, and
#    ``wf.Mesh(8 * ball.vertices + (-2, -2, 14), ball.faces)`` stands in front. *Expect* the time to grow much
#    more slowly than the number of triangles: four times as many with each subdivision.
# 3. Write a BSDF of your own, and test it by ``wf.testing.check_bsdf``: see the page on materials.
#
# The whole tracer
# ----------------
#
# .. literalinclude:: /docs/tutorial/tracer.py
