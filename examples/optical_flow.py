"""Optical flow: a picture of things that move, and the flow to the next one as colors.

python examples/optical_flow.py [out.png] [--spp 32] [--size 360]

Colors are directions and how far: gray stands still, and white lines are what the next picture hides.
"""

import argparse
import colorsys

import numpy as np

import wavefront as wf

FRAME = 1 / 12  # seconds between pictures
parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("output", nargs="?", default="optical_flow.png")
parser.add_argument("--spp", type=int, default=32)
parser.add_argument("--size", type=int, default=360)
options = parser.parse_args()


def placed(shift, degrees=0.0):
    """The matrix of a turn about y and then a shift."""
    cos, sin = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return np.array([[cos, 0, sin, shift[0]], [0, 1, 0, shift[1]], [-sin, 0, cos, shift[2]], [0, 0, 0, 1]])


def colors(flow, hidden):
    """Colors (H, W, 3) of a flow (H, W, 2): the hue is the direction, the saturation how far it is."""
    far = np.hypot(*np.moveaxis(flow, 2, 0))
    most = max(np.nanmax(far), 1e-9)
    turn = np.arctan2(flow[..., 1], flow[..., 0]) / (2 * np.pi) % 1
    wheel = np.array([colorsys.hsv_to_rgb(k / 256, 1, 0.9) for k in range(256)])
    part = np.nan_to_num(far / most)[..., None]
    out = 0.5 + part * (wheel[(np.nan_to_num(turn) * 255).astype(int)] - 0.5)
    stripes = np.add(*np.indices(hidden.shape)) % 4 == 0
    out[(hidden == 1) & stripes] = 1
    out[hidden == -1] = 0
    return out


# a box that slides, a ball that falls, and a wave, which deforms, seen by a camera that turns slowly
box = wf.Box((0, 0, 0), 1, material=wf.Plastic("orangered")).transformed(
    wf.Keyframes([0, 1], [placed((-1.6, 0, 0), 20), placed((1.2, 0, 0.6), 80)])
)
ball = wf.Spheres([[(1.1, 1.6, -0.4)], [(1.1, -0.1, -0.4)]], 0.42, times=[0, 1], material=wf.Plastic("gold"))
x, z = (each.ravel() for each in np.meshgrid(np.linspace(-4, 4, 81), np.linspace(-4, 2.5, 66)))
times = np.linspace(0, 1, 9)
sea = [np.stack([x, 0.12 * np.sin(2.5 * x + z + 6 * time) - 0.75, z], 1) for time in times]
row, column = (each.ravel() for each in np.indices((65, 80)))
first = row * 81 + column
faces = np.concatenate(
    [np.stack([first, first + 81, first + 1], 1), np.stack([first + 1, first + 81, first + 82], 1)]
)
water = wf.Mesh(np.stack(sea), faces, times=times, smooth=True, material=wf.Plastic("steelblue"))
view = wf.Camera.look_at((0.4, 2.2, 6), (0, 0, 0), fov=34, size=(options.size, options.size * 2 // 3))
camera = view.transformed(wf.Keyframes([0, 1], [placed((0, 0, 0)), placed((0, 0, 0), 4)]))
scene = wf.Scene([box, ball, water], wf.studio("cloudy"), camera)

now = 0.5
image = wf.render(
    scene.at(now),
    options.spp,
    aovs=("flow", "flow_occluded"),
    flow_times=(now - FRAME, now + FRAME),
    denoise=True,
)
shown = colors(image.flow, image.flow_occluded)
both = np.concatenate([image.to_uint8(gamma="srgb") / 255, shown], 1)
wf.Image(wf.srgb(both)).save(options.output, gamma="srgb", tone="none")
print(f"wrote {options.output}")
