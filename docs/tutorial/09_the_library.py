r"""
9. The same room by the library
===============================

The library computes the same integrals. Here it renders the same scene, built from the same arrays, and both
agree. The end of this page has all steps in one file.
"""

import tracer

import wavefront as wf

MATERIALS = {tracer.MIRROR: lambda color: wf.Mirror(color), tracer.GLASS: lambda color: wf.Dielectric(1.5)}
spheres = []
for k, (center, radius) in enumerate(zip(tracer.CENTER, tracer.RADIUS, strict=True)):
    material = MATERIALS.get(tracer.KIND[k], wf.Diffuse)(tracer.COLOR[k])
    emission = tracer.EMISSION[k] if k == tracer.LAMP else None
    spheres.append(wf.Sphere(center, radius, material=material, emission=emission))
scene = wf.Scene(spheres, camera=wf.Camera.look_at(tracer.EYE, tracer.TARGET, fov=60, size=(64, 48)))

image = wf.render(scene, 64, max_bounces=5)
ours = tracer.render(tracer.full, 64, 48, 64)
print(f"library {image.rgb.mean():.3f}, tutorial {ours.mean():.3f}")
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
#      - ``scheduling/``, ``film/film.py``
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
# 1. Render with ``noise=0.05`` in place of a number of samples. *Expect* far more than 64 samples, most of
#    them where the glass sphere focuses light: ``image.counts`` shows where.
# 2. Add a mesh: ``wf.load_mesh("part.stl")`` placed by ``wf.Instance``. *Expect* the time to grow much more
#    slowly than the number of triangles.
# 3. Write a BSDF of your own, and test it by ``wf.testing.check_bsdf``: see the page on materials.
#
# The whole tracer
# ----------------
#
# .. literalinclude:: /docs/tutorial/tracer.py
