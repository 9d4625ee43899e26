"""
9. The picture
==============

All of it together: a mesh, a texture, metal and glass in the light of a studio. A render goes on until the
error is below a limit, not for a number of samples. The estimate of the error is part of the image.
"""

import numpy as np
import trimesh

import wavefront as wf

torus = wf.from_trimesh(trimesh.creation.torus(0.7, 0.28, major_sections=64, minor_sections=32)).shapes[0]
torus.material = wf.Conductor.named("gold", roughness=0.2)
tilt = trimesh.transformations.rotation_matrix(-1.2, (1, 0.3, 0), (0, 0, 0))
tilt[1, 3] = 0.95
rings = np.linspace(0, 1, 64, endpoint=False)
wood = 0.5 + 0.15 * np.sin(40 * np.hypot(rings[:, None] + 0.3, 0.35 * rings[None, :]))
floor = wf.Rectangle(
    (-4, 0, 4),
    (8, 0, 0),
    (0, 0, -8),
    material=wf.Principled(wf.Texture(wood[..., None] * (0.8, 0.5, 0.3)), roughness=0.4),
)
shapes = [
    floor,
    wf.Instance(torus, tilt),
    wf.Sphere((-1.5, 0.6, 0.4), 0.6, material=wf.Dielectric(1.5)),
    wf.Sphere((1.5, 0.5, 0.6), 0.5, material=wf.Principled((0.05, 0.2, 0.5), roughness=0.3, clearcoat=1)),
]
camera = wf.Camera.look_at((0.4, 2.2, 6), (0, 0.7, 0), fov=30, size=(280, 180), aperture=0.1)
scene = wf.Scene(shapes, wf.studio("studio", camera=camera), camera)

image = wf.render(scene, noise=0.08)
image.save("1_picture.png", tone="agx")
print(f"{image.spp} samples per pixel in the mean, relative error {image.metadata['noise']:.3f}")
