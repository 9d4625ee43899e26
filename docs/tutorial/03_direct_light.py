"""
3. The rendering equation, and direct light
===========================================

The radiance that leaves a point x in the direction ωo is what x emits, and what it scatters of the light
that arrives from all directions ωi (Kajiya 1986)::

    Lo(x, ωo) = Le(x, ωo) + ∫ f(ωo, ωi) · Li(x, ωi) · |cosθi| dωi

f is the BSDF, the part of the material. A diffuse surface of reflectance ρ scatters the same in all
directions: f = ρ/π, so that no more light leaves than arrives. cosθ is there because slanted light spreads
over more surface.

Direct light is the part of Li that comes straight from a light. For a point light the integral has one
direction only, and a *shadow ray* tests whether anything is in the way. The shadow of a point is sharp. A
panel of light has many points; each sample picks one at random, and the mean of the samples is a soft
shadow.
"""

import wavefront as wf

shapes = [
    wf.Rectangle((-3, 0, 3), (6, 0, 0), (0, 0, -6), material=wf.Diffuse(0.6)),
    wf.Sphere((-1.1, 0.8, 0), 0.8, material=wf.Diffuse((0.8, 0.35, 0.2))),
    wf.Sphere((0.9, 0.6, 0.6), 0.6, material=wf.Diffuse((0.25, 0.45, 0.8))),
]
panel = wf.Rectangle((1, 4, 2), (2, 0, 0), (0, 0, 2), emission=15)
camera = wf.Camera.look_at((0, 1.8, 6), (0, 0.6, 0), fov=32, size=(200, 150))

point = wf.Scene(shapes, [wf.PointLight((2, 4, 3), 60)], camera)
wf.render(point, spp=16, integrator="direct_simple").save("1_point.png")

wf.render(wf.Scene([*shapes, panel], camera=camera), spp=64, integrator="direct_simple").save("2_panel.png")
