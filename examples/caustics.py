"""A glass ball, a tumbler and a gold ring in the light of a small lamp, whose light they gather.

python examples/caustics.py [out.png] [--spp 200] [--size 640]
"""

import argparse

import numpy as np

import wavefront as wf

LAMP = (0.6, 2.6, -3)  # where it is
GLASS = wf.Dielectric(1.5)


def lathe(
    profile: np.ndarray, place: tuple[float, float, float], material: wf.Bsdf, steps: int = 360
) -> wf.Mesh:
    """Return a smooth mesh: a closed outline (k, 2) of radius and height, turned about the vertical."""
    angle = 2 * np.pi * np.arange(steps) / steps
    cos, sin = np.cos(angle)[:, None], np.sin(angle)[:, None]
    along = np.roll(profile, -1, 0) - np.roll(profile, 1, 0)
    radius, height = profile.T
    vertices = np.stack([radius * cos, height + 0 * cos, radius * sin], -1)
    normals = np.stack([along[:, 1] * cos, -along[:, 0] + 0 * cos, along[:, 1] * sin], -1)
    step, k = np.mgrid[:steps, : len(profile)]
    quads = [
        (step + i) % steps * len(profile) + (k + j) % len(profile)
        for i, j in [(0, 0), (0, 1), (1, 1), (1, 0)]
    ]
    a, b, c, d = (corner.ravel() for corner in quads)
    faces = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    return wf.Mesh(vertices.reshape(-1, 3) + place, faces, normals=normals.reshape(-1, 3), material=material)


def rounded(corners: list[tuple[float, float]], radius: float, steps: int = 8) -> np.ndarray:
    """Return a closed outline (k, 2) with rounded corners."""
    corner = np.array(corners)
    points = []
    for before, here, after in zip(np.roll(corner, 1, 0), corner, np.roll(corner, -1, 0), strict=True):
        start = here + (before - here) * radius / np.linalg.norm(before - here)
        end = here + (after - here) * radius / np.linalg.norm(after - here)
        t = np.linspace(0, 1, steps)[:, None]
        points.append((1 - t) ** 2 * start + 2 * t * (1 - t) * here + t**2 * end)
    return np.concatenate(points)


def ball() -> wf.Sphere:
    """Return a ball of glass."""
    return wf.Sphere((-1.3, 0.5, 0), 0.5, material=GLASS)


def tumbler() -> wf.Mesh:
    """Return a drinking glass with a thick bottom."""
    outline = [(1e-3, 0.01), (0.4, 0.01), (0.5, 1.2), (0.45, 1.2), (0.36, 0.18), (1e-3, 0.18)]
    return lathe(rounded(outline, 0.02), (0, 0, -0.5), GLASS)


def ring() -> wf.Mesh:
    """Return a polished ring of gold."""
    outline = [(0.44, 0.005), (0.5, 0.005), (0.5, 0.26), (0.44, 0.26)]
    return lathe(rounded(outline, 0.02), (1.25, 0, 0.1), wf.Conductor.named("gold", roughness=0))


def table(things: list[wf.Shape], lights: list[wf.Light], size: tuple[int, int] = (640, 400)) -> wf.Scene:
    """Return a table with some things on it, in dim surroundings."""
    wood = wf.Rectangle((-6, 0, 6), (12, 0, 0), (0, 0, -12), material=wf.Diffuse((0.55, 0.42, 0.32)))
    camera = wf.Camera.look_at((0, 3.2, 4.6), (0, 0.25, 0.35), fov=33, size=size)
    return wf.Scene([wood, *things], [wf.Environment((0.06, 0.07, 0.1)), *lights], camera)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("output", nargs="?", default="caustics.png")
    parser.add_argument("--spp", type=int, default=200)
    parser.add_argument("--size", type=int, default=640, help="width in pixels")
    options = parser.parse_args()
    lamp = wf.PointLight(LAMP, (60, 54, 45))
    scene = table([ball(), tumbler(), ring()], [lamp], (options.size, options.size * 5 // 8))
    wf.render(scene, options.spp, caustics=True).save(options.output)
    print(f"wrote {options.output}")
