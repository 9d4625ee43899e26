"""Newton's cradle: balls on strings that swing by keyframes, as a short loop.

python examples/cradle.py [out.png] [--spp 16] [--size 300]

The file may also end in .gif or .mp4.
"""

import argparse

import numpy as np

import wavefront as wf

FRAMES = 16
PERIOD, SWING, LENGTH, RADIUS = 1.25, 32.0, 3.0, 0.5  # seconds, degrees, and scene units
parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("output", nargs="?", default="cradle.gif")
parser.add_argument("--spp", type=int, default=16)
parser.add_argument("--size", type=int, default=300)
options = parser.parse_args()


def turned(degrees, pivot):
    """The matrix of a turn about z through a point at height LENGTH."""
    angle = np.radians(degrees)
    matrix = np.eye(4)
    matrix[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    matrix[:3, 3] = pivot - matrix[:3, :3] @ pivot
    return matrix


times = np.linspace(0, PERIOD, 49)
swing = SWING * np.cos(2 * np.pi * times / PERIOD)  # the balls at both ends take turns
steel, string = wf.Conductor.named("chromium", roughness=0.08), wf.Plastic("dimgray", roughness=0.3)
shapes = [wf.Plane((0, -0.8, 0), (0, 1, 0), material=wf.Diffuse(0.55))]
for number in range(-2, 3):
    x = 2 * RADIUS * number
    ends = np.array([(x, LENGTH, 1), (x, LENGTH, -1)])
    ball = wf.Sphere((x, 0, 0), RADIUS, material=steel)
    pendulum = wf.Group([ball, wf.Capsules(np.tile((x, RADIUS, 0), (2, 1)), ends, 0.02, material=string)])
    angles = {-2: np.minimum(-swing, 0), 2: np.maximum(-swing, 0)}.get(number)
    if angles is not None:
        pendulum = pendulum.placed(wf.Keyframes(times, [turned(each, ends.mean(0)) for each in angles]))
    shapes.append(pendulum)
rails = np.array([(-2.6, LENGTH, 1), (-2.6, LENGTH, -1)])
shapes.append(
    wf.Capsules(rails, np.add(rails, (5.2, 0, 0)), 0.06, material=wf.Conductor.named("gold", roughness=0.2))
)
camera = wf.Camera.look_at((2.5, 2.4, 11), (0, 1.1, 0), fov=30, size=(options.size, options.size * 2 // 3))
scene = wf.Scene(shapes, wf.studio("studio"), camera)
frames = wf.render_frames(scene, fps=FRAMES / PERIOD, spp=options.spp, denoise=True)
wf.save_animation(options.output, frames, fps=FRAMES / PERIOD, tone="agx_punchy")
print(f"wrote {options.output}")
