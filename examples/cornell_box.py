"""The Cornell box: the classic room with two boxes.

python examples/cornell_box.py [out.png] [--spp 16] [--size 512]
"""

from __future__ import annotations

import argparse

import numpy as np

import wavefront as wf

WHITE = wf.Diffuse((0.885, 0.699, 0.666))
GREEN = wf.Diffuse((0.105, 0.378, 0.076))
RED = wf.Diffuse((0.570, 0.043, 0.044))


def box(center: tuple[float, float, float], half: tuple[float, float, float], turn: float) -> wf.Mesh:
    """Return a box of half-sizes `half`, turned about the vertical by `turn` degrees."""
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * half
    c, s = np.cos(np.radians(turn)), np.sin(np.radians(turn))
    corners = corners @ np.array([[c, 0, -s], [0, 1, 0], [s, 0, c]]) + center
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    faces = [face for a, b, c, d in quads for face in ((a, b, c), (a, c, d))]
    return wf.Mesh(corners, faces, material=WHITE, name="box")


def cornell_box(size: int = 512) -> wf.Scene:
    """Return a room from -1 to 1, open to the camera, with a light under the ceiling."""
    room = [
        wf.Rectangle((-1, -1, 1), (2, 0, 0), (0, 0, -2), material=WHITE, name="floor"),
        wf.Rectangle((-1, 1, -1), (2, 0, 0), (0, 0, 2), material=WHITE, name="ceiling"),
        wf.Rectangle((-1, -1, -1), (2, 0, 0), (0, 2, 0), material=WHITE, name="back wall"),
        wf.Rectangle((-1, -1, 1), (0, 0, -2), (0, 2, 0), material=RED, name="left wall"),
        wf.Rectangle((1, -1, -1), (0, 0, 2), (0, 2, 0), material=GREEN, name="right wall"),
    ]
    light = wf.Rectangle(
        (-0.23, 0.99, -0.19),
        (0.46, 0, 0),
        (0, 0, 0.38),
        material=wf.Diffuse(0),
        emission=(18.387, 13.9873, 6.75357),
        name="light",
    )
    boxes = [
        box((0.335, -0.7, 0.38), (0.3, 0.3, 0.3), -17),
        box((-0.33, -0.4, -0.28), (0.3, 0.61, 0.3), 18.25),
    ]
    camera = wf.Camera.look_at((0, 0, 3.9), (0, 0, 0), fov=39.3077, size=(size, size))
    return wf.Scene([*room, light, *boxes], camera=camera)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("output", nargs="?", default="cornell_box.png")
    parser.add_argument("--spp", type=int, default=16)
    parser.add_argument("--size", type=int, default=512)
    options = parser.parse_args()
    scene = cornell_box(options.size)
    scene.camera = wf.Camera.look_at((0, 0, 3.9), (0, 0, 0), fov=37.9, size=scene.camera.size)  # fills it
    wf.render(scene, options.spp, denoise=True).save(options.output, exposure=1.0)
    print(f"wrote {options.output}")
