"""Print the SHA-256 of pictures that use every elementary function; test_elementary.py runs this.

Arguments are the accelerators; all that are installed by default.
"""

from __future__ import annotations

import hashlib
import json
import sys
import warnings
from collections.abc import Iterable
from typing import Any

import numpy as np

import wavefront as wf
from wavefront.accel import registry as choose
from wavefront.accel.embree import installed
from wavefront.codecs.encoding import srgb_to_linear, to_codes

warnings.simplefilter("ignore")
choose.COPIES = 0  # instances are traced as such
rng = np.random.default_rng(0)
ACCELERATORS = sys.argv[1:] or (["numpy", "embree"] if installed() else ["numpy"])
GREY = wf.Diffuse(0.6)
FLOOR = wf.Rectangle((-3, 0, -3), (0, 0, 6), (6, 0, 0), material=GREY)
EMITTER = wf.Rectangle((-0.5, 2, -0.5), (1, 0, 0), (0, 0, 1), emission=6)
LOW_LIGHT = wf.Rectangle((-0.5, 0.3, 0.5), (1, 0, 0), (0, 0.02, 0.5), emission=6, two_sided=True)
SKY = wf.Environment(rng.random((16, 32, 3)).astype(np.float32))
SPOTS = [wf.SpotLight((k - 2, 2, 1), 4, target=(0, 0, 0), angle=50) for k in range(5)]
COLORS = wf.Texture((rng.random((16, 16, 3)) * 255).astype(np.uint8))
CAMERA = wf.Camera.look_at((0.5, 1.5, 4.0), (0, 0.4, 0), fov=40, size=(24, 18))
hashes = {
    "numpy's own sine": hashlib.sha256(np.sin(rng.random(10_000, np.float32) * 9).tobytes()).hexdigest()
}


def ball(material: wf.Bsdf) -> wf.Sphere:
    return wf.Sphere((0, 0.5, 0), 0.5, material=material)


def net(material: wf.Bsdf) -> wf.Mesh:
    """A smooth mesh with texture coordinates."""
    grid = np.stack(np.meshgrid(np.linspace(-1, 1, 6), np.linspace(-1, 1, 6)), -1).reshape(-1, 2)
    vertices = np.column_stack([grid[:, 0], 0.3 + 0.2 * grid[:, 0] * grid[:, 1], grid[:, 1]])
    normals = np.column_stack([-0.2 * grid[:, 1], np.ones(36), -0.2 * grid[:, 0]])
    corner = (np.arange(5)[:, None] * 6 + np.arange(5)).ravel()
    faces = np.concatenate([corner[:, None] + (0, 6, 1), corner[:, None] + (1, 6, 7)])
    return wf.Mesh(vertices, faces, normals=normals, uvs=(grid + 1) / 2, material=material)


def add(name: str, shapes: Any, lights: Iterable[Any] = (), camera: wf.Camera = CAMERA, **more: Any) -> None:
    scene = wf.Scene([FLOOR, *shapes], lights, camera)
    for accel in ACCELERATORS:
        image = wf.render(scene, 2, accel=accel, max_bounces=5, workers=1, progress=False, **more)
        hashes[f"{name}, {accel}"] = hashlib.sha256(image.rgb.tobytes()).hexdigest()


for material in (
    wf.OrenNayar(0.7, 0.5),
    wf.OrenNayar(0.7, 0.5, energy_preserving=True),
    wf.Material(wf.Dielectric(1.5), interior=wf.Medium((1, 2, 0.3))),
    wf.Dielectric(1.5, 0.4),
    wf.Conductor.named("gold", 0.3),
    wf.ThinDielectric(1.5, 0.2),
    wf.Principled((0.8, 0.3, 0.2), 0.3, 0.4, clearcoat=0.7, sheen=0.8),
    wf.Material(wf.Principled(0.9, transmission=0.8, roughness=0.2), interior=wf.Medium(0.4)),
    wf.Diffuse(COLORS),
):
    add(f"{len(hashes)} {type(material).__name__}", [ball(material), EMITTER], [wf.Environment(0.3)])
add("rectangle", [ball(GREY), LOW_LIGHT])
add(
    "sphere and disk",
    [wf.Sphere((0, 1, 0), 0.3, emission=4), wf.Disk((1, 2, 0), (0, -1, 0), 0.5, emission=4)],
)
add(
    "sun and image",
    [ball(wf.Conductor.named("gold", 0.2))],
    [wf.DirectionalLight((1, -2, -1), 3, angle=1), SKY],
)
add("spots", [ball(GREY)], SPOTS)
add("bumps", [net(wf.Material(GREY, normal_map=wf.BumpMap(rng.random((16, 16)), 0.05)))], [SKY])
add(
    "normal map",
    [net(wf.Material(GREY, normal_map=wf.NormalMap(0.5 + 0.3 * rng.random((16, 16, 3)))))],
    [SKY],
)
add(
    "lens",
    [ball(GREY), EMITTER],
    camera=wf.Camera.look_at((0.5, 1.5, 4), (0, 0.4, 0), aperture=0.3, size=(32, 24)),
)
add(
    "panorama",
    [ball(GREY), EMITTER],
    camera=wf.Camera.panorama((1, 0.5, 1), size=(32, 16)),
    filter=wf.GaussianFilter(2.0, windowed=True),
)
add(
    "framed",
    [ball(GREY), EMITTER],
    camera=wf.Scene([FLOOR]).framing_camera(size=(30, 20)),
    filter="gaussian",
)
transform = np.array([[0.6, 0.4, 0, 0.3], [-0.3, 0.5, 0.1, 0.5], [0, 0.1, 0.7, 0], [0, 0, 0, 1]])
moved = transform + np.array([[0, 0, 0, -0.9], [0, 0, 0, 0.2], [0, 0, 0, 0], [0, 0, 0, 0]])
add("instances", [wf.Instance(mesh, matrix) for mesh in [net(GREY)] for matrix in (transform, moved)], [SKY])
for number, camera in enumerate([CAMERA, wf.Camera.panorama((1, 0.5, 1), size=(32, 16))]):
    glass = [ball(wf.Dielectric(1.5)), net(wf.Mirror()), wf.Sphere((1, 1, 1), 0.2, emission=4)]
    add(f"caustics {number}", glass, [wf.PointLight((1, 2, -1), 9)], camera, caustics=True)
codes = np.concatenate([np.arange(n, dtype=np.float32) / np.float32(n - 1) for n in (256, 65_536)])
hashes["sRGB"] = hashlib.sha256(srgb_to_linear(codes).tobytes()).hexdigest()
hashes["8 bits"] = hashlib.sha256(to_codes(codes).tobytes() + to_codes(codes, "srgb").tobytes()).hexdigest()
print(json.dumps(hashes))
