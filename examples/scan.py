"""A head as a scanner records it: distances from an axis, with noise, and a color for each vertex.

The surface is given by its distance from a vertical axis, for each height and direction, as the range data of
a cylindrical scanner are. The shape, the noise of the scanner and the dirt in the hollows are made here.

python examples/scan.py [out.png] [--spp 64] [--size 600]
"""

from __future__ import annotations

import argparse

import numpy as np
from terrace import noise

import wavefront as wf

ROWS, COLUMNS = 420, 500  # measured heights and directions
Field = np.ndarray  # (ROWS, COLUMNS)


def bump(x: Field, width: float) -> Field:
    """Return a smooth bump of height 1 around x = 0."""
    return np.exp(-((x / width) ** 2))


def distances() -> tuple[Field, Field, Field]:
    """Return heights (ROWS, 1), directions (1, COLUMNS) in radians with the face at 0, and distances."""
    y = np.linspace(0.40, 2.84, ROWS)[:, None]
    phi = np.linspace(-np.pi, np.pi, COLUMNS, endpoint=False)[None, :]
    side, front, back = np.abs(phi), np.cos(phi).clip(0), (-np.cos(phi)).clip(0)
    dome = np.where(y > 1.94, (y - 1.94) / 0.90, (1.94 - y) / 0.80).clip(0, 1)
    crown = (1 - dome ** np.where(y > 1.94, 2.0, 2.5)) ** np.where(y > 1.94, 0.5, 0.4)
    jaw = np.clip((y - 1.18) / 0.75, 0, 1) ** 0.7
    head = crown * (0.53 + 0.10 * front**2 + 0.20 * back**2 * jaw) * (0.80 + 0.20 * jaw)
    neck = 0.33 + 0.06 * back - 0.03 * front + 0.05 * bump(y - 0.9, 0.15)
    chest = 0.98 * np.sqrt((1 - ((y - 0.40) / 0.55).clip(-1, 1) ** 2).clip(0)) * (1 - 0.28 * np.cos(phi) ** 2)
    r = (np.power(head, 7) + np.power(neck * (y < 2.0), 7) + np.power(chest, 7)) ** (1 / 7)
    face = np.ones_like(r)
    ridge = np.interp(y, [1.58, 1.64, 1.70, 1.98, 2.06], [0, 0.9, 1, 0.32, 0])
    r = r + 0.19 * ridge * bump(phi, 0.07 + 0.09 * bump(y - 1.66, 0.07)) * face
    r += 0.035 * bump(side - 0.17, 0.07) * bump(y - 1.655, 0.05)  # wings of the nose
    r += 0.050 * bump(y - 2.07 - 0.03 * side, 0.06) * bump(side - 0.25, 0.32)  # brows
    r -= 0.090 * bump(y - 1.955, 0.065) * bump(side - 0.33, 0.15)  # hollows of the eyes
    r += eye(y - 1.945, (side - 0.36) * 0.62)
    r += 0.035 * bump(y - 1.74, 0.13) * bump(side - 0.55, 0.2)  # cheeks
    r += 0.052 * bump(y - 1.49, 0.028) * bump(phi, 0.20)  # upper lip
    r += 0.055 * bump(y - 1.425, 0.030) * bump(phi, 0.17)  # lower lip
    r -= 0.030 * bump(y - 1.459, 0.009) * bump(phi, 0.22)  # mouth
    r += 0.085 * bump(y - 1.27, 0.07) * bump(phi, 0.24)  # chin
    ear = bump(side - 1.62, 0.13) * bump(y - 1.80 + 0.25 * (side - 1.62), 0.15)
    r += 0.10 * ear - 0.09 * bump(side - 1.55, 0.06) * bump(y - 1.80, 0.08)
    hair = np.clip((y - 2.23 + 0.85 * (side - 0.55).clip(0)) / 0.10, 0, 1) * np.clip((y - 1.35) / 0.2, 0, 1)
    hair *= 1 - bump(side - 1.58, 0.22) * (y < 1.98)
    waves = noise((ROWS, COLUMNS), 12, 3, 3)
    locks = np.sin(26 * (y - 0.10 * side**2) + 3 * np.sin(7 * phi) + 5 * waves)
    r += hair * (0.045 + 0.024 * locks + 0.02 * waves) * np.clip((2.84 - y) / 0.12, 0, 1)
    r += 0.004 * noise((ROWS, COLUMNS), 40, 5, 3)  # the tool of the sculptor
    r += np.random.default_rng(1).normal(0, 0.0009, r.shape)  # the scanner
    return y, phi, r.clip(1e-3)


def eye(up: Field, out: Field) -> Field:
    """Return what an eye adds to the distances: a ball between two lids, with a carved iris and pupil."""
    opening = 0.046 * (1 - (out / 0.115) ** 2)  # half the height between the lids, negative beside them
    slit = np.where(up > 0, up / 1.1, -up / 0.8) - opening  # negative where the ball is seen
    ball = 0.062 * bump(up, 0.085) * bump(out, 0.12)
    lids = (0.030 * bump(slit - 0.008, 0.012) + 0.010 * (up > 0) * bump(slit - 0.04, 0.03)) * bump(out, 0.125)
    center = np.hypot(up - 0.006, out)
    iris = -0.010 * bump(center - 0.036, 0.007) - 0.028 * bump(center, 0.016)
    return ball + np.where(up > 0, lids, 0.7 * lids) + iris * (slit < -0.004)


def head() -> wf.Mesh:
    """Return the mesh of the measured points, smooth, with a color for each vertex."""
    y, phi, r = distances()
    points = np.stack([r * np.sin(phi), y + 0 * r, r * np.cos(phi)], -1)
    around = np.concatenate([points[:, -1:], points, points[:, :1]], 1)
    along_y, along_phi = np.gradient(points, axis=0), np.gradient(around, axis=1)[:, 1:-1]
    normals = np.cross(along_phi, along_y)
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    first = np.arange(ROWS * COLUMNS).reshape(ROWS, COLUMNS)
    a, b = first, np.roll(first, -1, 1)
    quads = np.stack([a[:-1], b[:-1], b[1:], a[1:]], -1).reshape(-1, 4)
    faces = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    return wf.Mesh(
        points.reshape(-1, 3),
        faces,
        normals=normals.reshape(-1, 3),
        colors=stone(r).reshape(-1, 3),
        material=wf.Principled(wf.VertexColors(), roughness=0.45, specular=0.4),
        name="head",
    )


def stone(r: Field) -> np.ndarray:
    """Return linear colors: pale stone with veins, dark where the surface is hollow."""
    smooth = r
    for axis, reach in ((0, 7), (1, 9)):
        smooth = np.mean([np.roll(smooth, k, axis) for k in range(-reach, reach + 1)], 0)
    hollow = np.clip((smooth - r) / 0.012, 0, 1)[..., None]
    vein = np.abs(noise(r.shape, 5, 8, 6))[..., None]
    grain = 1 + 0.05 * noise(r.shape, 60, 9, 3)[..., None]
    pale = np.array([0.74, 0.68, 0.58]) * (0.75 + 0.25 * np.clip(vein / 0.18, 0, 1)) * grain
    return np.clip(pale * (1 - 0.75 * hollow) + np.array([0.10, 0.07, 0.04]) * hollow, 0, 1)


def scan(size: int = 600) -> wf.Scene:
    """Return the head on a plinth before a gray wall."""
    angle = np.radians(24)
    turn = np.eye(4)
    turn[[0, 0, 2, 2], [0, 2, 0, 2]] = np.cos(angle), np.sin(angle), -np.sin(angle), np.cos(angle)
    shapes = [
        wf.Instance(head(), turn, name="head"),
        wf.Cylinders(
            [(0, -0.9, 0)], [(0, 0.42, 0)], 0.60, material=wf.Principled((0.02, 0.02, 0.022), 0, 0.25)
        ),
        wf.Disk((0, 0.42, 0), (0, 1, 0), 0.60, material=wf.Principled((0.02, 0.02, 0.022), 0, 0.25)),
        wf.Rectangle((-9, -4, -2.4), (18, 0, 0), (0, 12, 0), material=wf.Diffuse((0.16, 0.18, 0.20))),
        wf.Rectangle((-3.6, 1.2, 2.4), (0, 2.6, 0), (1.5, 0, 1.6), emission=(9.5, 8.4, 7.0)),
        wf.Rectangle((3.4, 0.6, -1.6), (0, 2.6, 0), (0.5, 0, 1.6), emission=(2.2, 3.2, 4.6), two_sided=True),
    ]
    camera = wf.Camera.look_at((0, 1.75, 6.4), (0, 1.58, 0), fov=26, size=(size, size * 2 // 3))
    return wf.Scene(shapes, [wf.Environment(0.12)], camera)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="A head as a scanner records it.")
    parser.add_argument("output", nargs="?", default="scan.png")
    parser.add_argument("--spp", type=int, default=64)
    parser.add_argument("--size", type=int, default=600)
    options = parser.parse_args()
    wf.render(scan(options.size), options.spp, denoise=True).save(options.output, tone="agx", exposure=0.8)
    print(f"wrote {options.output}")
