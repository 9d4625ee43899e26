"""A still life on a terrace in the evening: glass, metal, stone and glazed clay under a painted sky.

All shapes are curves turned about an axis or swept along a line, and all textures are sums of noise. Caustics
of small glass balls are noisy, so the picture is denoised: best with `pip install pyoidn`.

python examples/terrace.py [out.png] [--spp 341] [--size 640]
"""

from __future__ import annotations

import argparse

import numpy as np

import wavefront as wf

SUN = np.array([-0.85, 0.42, 0.05]) / np.linalg.norm([-0.85, 0.42, 0.05])


def noise(shape: tuple[int, int], cells: int, seed: int, octaves: int = 5) -> np.ndarray:
    """Return smooth noise in about [-1, 1] that repeats along both axes: octaves of interpolated values."""
    total, rng = np.zeros(shape), np.random.default_rng(seed)
    for octave in range(octaves):
        n = cells * 2**octave
        values = rng.uniform(-1, 1, (n, n))
        (y, fy), (x, fx) = (_cell(count, n) for count in shape)
        rows = values[y][:, x] * (1 - fx) + values[y][:, (x + 1) % n] * fx
        below = values[(y + 1) % n][:, x] * (1 - fx) + values[(y + 1) % n][:, (x + 1) % n] * fx
        total += (rows * (1 - fy[:, None]) + below * fy[:, None]) / 2**octave
    return total


def _cell(count: int, n: int) -> tuple[np.ndarray, np.ndarray]:
    position = np.arange(count) * n / count
    fraction = position % 1
    return position.astype(int) % n, fraction * fraction * (3 - 2 * fraction)


def sky(height: int = 1024) -> np.ndarray:
    """Return the radiance of an evening sky above a calm sea, (height, 2·height, 3)."""
    theta = np.pi * (np.arange(height) + 0.5)[:, None] / height
    longitude = 2 * np.pi * (0.5 - (np.arange(2 * height) + 0.5)[None, :] / (2 * height))
    y = np.cos(theta) + 0 * longitude
    x, z = np.sin(theta) * np.sin(longitude), np.sin(theta) * np.cos(longitude)
    up = np.abs(y)[:, :, None]  # the sea mirrors the sky
    towards_sun = SUN[0] * x + SUN[1] * np.abs(y) + SUN[2] * z
    blend = np.exp(-16 * up)
    picture = np.array([0.05, 0.17, 0.48]) * (1 - blend) + np.array([1.1, 0.47, 0.20]) * blend
    picture += np.exp(-5 * (1 - towards_sun))[:, :, None] * np.array([0.9, 0.40, 0.14])
    streaks = noise((height, 2 * height), 14, 3, 6)
    clouds = np.clip(2.2 * streaks - 0.1 - 9 * np.abs(np.abs(y) - 0.11), 0, 1)[:, :, None]
    picture += 0.8 * clouds * (np.array([1.0, 0.50, 0.42]) - picture)
    disk = (SUN[0] * x + SUN[1] * y + SUN[2] * z > np.cos(np.radians(6)))[:, :, None]
    waves = 1 + 0.25 * noise((height, 2 * height), 64, 4, 2)[:, :, None]
    picture *= 0.85
    sea = picture * np.array([0.22, 0.36, 0.45]) * waves
    return np.where(y[:, :, None] > 0, picture + disk * np.array([150.0, 98.0, 56.0]), sea)


def grid(points: np.ndarray, closed: tuple[bool, bool], **options: object) -> wf.Mesh:
    """Return the mesh of a grid of points (rows, columns, 3), smooth, with uv in [0, 1] along both."""
    rows, columns = points.shape[:2]
    along, across = (np.gradient(_extended(points, axis, closed[axis]), axis=axis) for axis in (0, 1))
    along = along[1:-1] if closed[0] else along
    across = across[:, 1:-1] if closed[1] else across
    normals = np.cross(across, along)
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True).clip(1e-12)
    v, u = np.meshgrid(np.linspace(0, 1, rows), np.linspace(0, 1, columns), indexing="ij")
    index = np.arange(rows * columns).reshape(rows, columns)
    a, b, c, d = index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]
    faces = np.concatenate([np.stack(t, -1).reshape(-1, 3) for t in ((a, b, c), (a, c, d))])
    points = points.reshape(-1, 3)
    first, second, third = points[faces.T]
    faces = faces[np.cross(second - first, third - first).any(1)]  # on the axis half of them have no area
    return wf.Mesh(
        points,
        faces,
        normals=normals.reshape(-1, 3),
        uvs=np.stack([u, v], -1).reshape(-1, 2),
        **options,
    )


def _extended(points: np.ndarray, axis: int, closed: bool) -> np.ndarray:
    """Return a grid whose first line equals its last one, with one more line at either end of it."""
    if not closed:
        return points
    lines = np.moveaxis(points, axis, 0)
    return np.moveaxis(np.concatenate([lines[-2:-1], lines, lines[1:2]]), 0, axis)


def turned(profile: np.ndarray, center: tuple[float, float], **options: object) -> wf.Mesh:
    """Return the surface of a profile (n, 2), radius and height from its lower end, turned about its axis."""
    angle = np.linspace(0, 2 * np.pi, 145)
    radius, height = profile[:, :1], profile[:, 1:]
    points = np.stack(
        [center[0] + radius * np.cos(angle), height + 0 * angle, center[1] - radius * np.sin(angle)], -1
    )
    return grid(points, (False, True), **options)


def curve(*points: tuple[float, float], n: int = 24) -> np.ndarray:
    """Return a smooth line (m, 2) through points: a Catmull-Rom spline."""
    p = np.array([points[0], *points, points[-1]], float)
    t = np.linspace(0, 1, n, endpoint=False)[:, None]
    pieces = []
    for a, b, c, d in zip(p, p[1:], p[2:], p[3:], strict=False):
        pieces.append(b + t * (c - a + t * (2 * a - 5 * b + 4 * c - d + t * (3 * (b - c) + d - a))) / 2)
    return np.concatenate([*pieces, p[-1:]])


def knot(center: tuple[float, float, float], size: float, thickness: float, **options: object) -> wf.Mesh:
    """Return a tube around a trefoil knot."""
    t, angle = np.linspace(0, 2 * np.pi, 385)[:, None], np.linspace(0, 2 * np.pi, 49)
    line = np.stack([np.sin(t) + 2 * np.sin(2 * t), np.cos(t) - 2 * np.cos(2 * t), -1.1 * np.sin(3 * t)], -1)
    line = (line * size)[:, 0]
    ahead = np.stack(
        [np.cos(t) + 4 * np.cos(2 * t), -np.sin(t) + 4 * np.sin(2 * t), -3.3 * np.cos(3 * t)], -1
    )
    ahead = ahead[:, 0] / np.linalg.norm(ahead[:, 0], axis=1, keepdims=True)
    side = np.cross(ahead, line - line.mean(0))
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    over = np.cross(side, ahead)
    ring = np.cos(angle)[None, :, None] * side[:, None] + np.sin(angle)[None, :, None] * over[:, None]
    return grid(line[:, None] + thickness * ring + center, (True, True), **options)


def tiles(size: int = 1024) -> tuple[np.ndarray, np.ndarray]:
    """Return colors (linear) and heights of 8 by 8 stone tiles with joints."""
    u = np.arange(size) * 8 / size
    x, y = u[None, :] % 1, u[:, None] % 1
    joint = np.clip(np.minimum(np.minimum(x, 1 - x), np.minimum(y, 1 - y)) / 0.02, 0, 1)[:, :, None]
    tone = np.random.default_rng(7).uniform(0.75, 1.15, (8, 8)).repeat(size // 8, 0).repeat(size // 8, 1)
    vein = 0.5 + 0.22 * noise((size, size), 16, 5, 6)
    stone = (tone * vein)[:, :, None] * np.array([0.42, 0.25, 0.17])
    return np.clip(joint * stone + (1 - joint) * 0.10, 0.02, 0.9), joint[:, :, 0]


def marble(height: int = 512) -> np.ndarray:
    """Return dark green stone with pale veins, linear."""
    bend = noise((height, 2 * height), 4, 11, 6)
    rows = np.arange(height)[:, None] / height
    vein = np.abs(np.sin(2 * np.pi * (3 * rows + 0.9 * bend))) ** 0.35
    return (
        np.array([0.75, 0.80, 0.70]) * (1 - vein[:, :, None])
        + np.array([0.010, 0.075, 0.05]) * vein[:, :, None]
    )


def terrace(size: int = 640) -> wf.Scene:
    """Return the still life, 1 unit = 10 cm."""
    colors, joints = tiles()
    floor = wf.Material(
        wf.Principled(wf.Texture(colors), roughness=wf.Texture(0.8 - 0.42 * joints, srgb=False, channel=0)),
        normal_map=wf.BumpMap(wf.Texture(joints, srgb=False, channel=0), height=0.02),
    )
    vase = curve(
        (0.0, 0.0),
        (0.55, 0.0),
        (0.62, 0.08),
        (1.0, 0.9),
        (0.85, 1.7),
        (0.38, 2.25),
        (0.36, 2.5),
        (0.55, 2.75),
    )
    rows = np.arange(512)[:, None] / 512
    bands = (np.abs(((rows * 18) % 1) - 0.5) < 0.16) & (rows > 0.28) & (rows < 0.62)
    glaze = np.where(bands[:, :, None], (0.85, 0.70, 0.45), (0.02, 0.09, 0.30)) * np.ones((512, 512, 1))
    glaze *= (1 + 0.18 * noise((512, 512), 8, 2))[:, :, None]
    inside = [(1.21, 1.21), (1.14, 1.15), (0.97, 0.62), (0.62, 0.24), (0.3, 0.16), (0.0, 0.15)]
    outside = [(0.0, 0.05), (0.5, 0.06), (0.6, 0.02), (0.68, 0.06), (1.05, 0.55), (1.22, 1.15), (1.26, 1.2)]
    bowl = curve(*outside, *inside, n=16)
    glass = wf.Material(wf.Dielectric(1.5), interior=wf.Medium(absorption=(0.9, 0.18, 0.22)))
    amber = wf.Material(wf.Dielectric(1.5), interior=wf.Medium(absorption=(0.2, 1.4, 6.0)))
    shapes = [
        wf.Rectangle((-12, 0, 4), (24, 0, 0), (0, 0, -12), material=floor, name="floor"),
        turned(
            vase,
            (-2.15, -1.1),
            material=wf.Principled(wf.Texture(glaze.clip(0, 1)), roughness=0.35, clearcoat=1),
            name="vase",
        ),
        knot(
            (0.35, 1.02, -0.75), 0.34, 0.17, material=wf.Conductor.named("gold", roughness=0.18), name="knot"
        ),
        turned(bowl, (2.05, -0.15), material=glass, name="bowl"),
        wf.Sphere(
            (-0.75, 0.55, 0.95),
            0.55,
            material=wf.Principled(wf.Texture(marble()), roughness=0.3, clearcoat=1),
            name="marble",
        ),
        wf.Sphere((0.85, 0.32, 1.35), 0.32, material=amber, name="amber"),
        wf.Sphere(
            (1.45, 0.2, 1.75), 0.2, material=wf.Conductor.named("copper", roughness=0.1), name="copper"
        ),
        wf.Sphere((-1.75, 0.22, 1.5), 0.22, material=wf.Dielectric(1.5), name="clear"),
    ]
    camera = wf.Camera.look_at(
        (0.35, 1.75, 8.2), (0.05, 1.12, 0), fov=28, size=(size, size * 9 // 16), aperture=0.22, focus=7.6
    )
    return wf.Scene(shapes, [wf.Environment(sky())], camera)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="A still life on a terrace.")
    parser.add_argument("output", nargs="?", default="terrace.png")
    parser.add_argument("--spp", type=int, default=341)
    parser.add_argument("--size", type=int, default=640)
    options = parser.parse_args()
    image = wf.render(terrace(options.size), options.spp, denoise=True)
    image.save(options.output, tone="agx", exposure=0.35)
    print(f"wrote {options.output}")
