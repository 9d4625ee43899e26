"""A living room by day: the sun and the sky through a window are all its light.

Cushions are superellipsoids; the floor, the rug and the painting are images made here.

python examples/interior.py [out.png] [--spp 128] [--size 600]
"""

from __future__ import annotations

import argparse

import numpy as np
from fruit import wood
from terrace import curve, grid, noise, turned

import wavefront as wf

WALL, LINEN = wf.Diffuse((0.80, 0.78, 0.74)), wf.Diffuse((0.50, 0.53, 0.52))
OAK = wf.Principled((0.36, 0.21, 0.11), roughness=0.4)
BRASS = wf.Conductor.named("gold", roughness=0.25)


def cushion(
    center: tuple[float, ...], half: tuple[float, ...], material: object, power: float = 0.35
) -> wf.Mesh:
    """Return a superellipsoid: a ball with power 1, and a box with round edges near 0."""
    theta, phi = np.linspace(-np.pi / 2, np.pi / 2, 65)[:, None], np.linspace(0, 2 * np.pi, 129)[None, :]

    def rounded(x: np.ndarray) -> np.ndarray:
        return np.sign(x) * np.abs(x) ** power

    unit = [rounded(np.cos(theta)) * rounded(np.cos(phi)), rounded(np.sin(theta)) + 0 * phi]
    unit.append(rounded(np.cos(theta)) * rounded(-np.sin(phi)))
    return grid(np.stack(unit, -1) * half + center, (False, True), material=material)


def box(low: tuple[float, ...], high: tuple[float, ...], material: object) -> wf.Mesh:
    """Return a box between two corners."""
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], float)
    corners = np.array(low) + corners * (np.array(high) - low)
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return wf.Mesh(
        corners, [face for a, b, c, d in quads for face in ((a, b, c), (a, c, d))], material=material
    )


def walls() -> list[wf.Mesh]:
    """Return the room from (-3, 0, -3) to (3, 2.8, 3.6), with a window in the wall on the left."""
    colors, heights = wood()
    times = [[2, 0, 0], [0, 2, 0], [0, 0, 1]]
    floor = wf.Material(
        wf.Principled(wf.Texture(colors * 1.25, transform=times), roughness=0.38),
        normal_map=wf.BumpMap(wf.Texture(heights, srgb=False, channel=0, transform=times), height=0.004),
    )
    frame = wf.Principled((0.75, 0.75, 0.73), roughness=0.4)
    left = [  # around the window, from z = -1.9 to 1.5 and y = 0.75 to 2.45
        box((-3.2, 0, -3), (-3, 0.75, 3.6), WALL),
        box((-3.2, 2.45, -3), (-3, 2.8, 3.6), WALL),
        box((-3.2, 0.75, -3), (-3, 2.45, -1.9), WALL),
        box((-3.2, 0.75, 1.5), (-3, 2.45, 3.6), WALL),
    ]
    bars = [
        box((-3.12, 0.75, z - 0.035), (-3.05, 2.45, z + 0.035), frame) for z in (-1.87, -0.77, 0.37, 1.47)
    ]
    bars += [box((-3.12, y - 0.035, -1.9), (-3.05, y + 0.035, 1.5), frame) for y in (0.78, 1.85, 2.42)]
    return [
        wf.Rectangle((-3, 0, 3.6), (6, 0, 0), (0, 0, -6.6), material=floor, name="floor"),
        wf.Rectangle((-3, 2.8, -3), (6, 0, 0), (0, 0, 6.6), material=WALL, name="ceiling"),
        wf.Rectangle((-3, 0, -3), (6, 0, 0), (0, 2.8, 0), material=WALL, name="back"),
        wf.Rectangle((3, 0, -3), (0, 0, 6.6), (0, 2.8, 0), material=WALL, name="right"),
        wf.Rectangle((3, 0, 3.6), (-6, 0, 0), (0, 2.8, 0), material=WALL, name="behind"),
        box((-2.995, 0, -3), (3, 0.09, -2.98), frame),
        *left,
        *bars,
        box((-3.0, 0.70, -1.95), (-2.82, 0.75, 1.55), frame),
    ]


def rug(size: int = 256) -> wf.Texture:
    """Return the image of a woven rug with a border."""
    v, u = np.mgrid[0:size, 0:size] / size
    edge = np.minimum(np.minimum(u, 1 - u) * 1.5, np.minimum(v, 1 - v))
    stripes = 0.5 + 0.5 * np.sign(np.sin(40 * (u + np.abs(v - 0.5))))
    inner = np.where(
        (edge > 0.09)[..., None], np.array([0.42, 0.36, 0.28]) * (0.8 + 0.2 * stripes[..., None]), 0
    )
    border = np.where((edge > 0.05)[..., None], (0.17, 0.055, 0.04), (0.40, 0.35, 0.27))
    weave = (
        1
        + 0.12 * np.sin(np.pi * size / 2 * u) * np.sin(np.pi * size / 2 * v)
        + 0.1 * noise((size, size), 16, 21)
    )
    return wf.Texture(np.where((edge > 0.09)[..., None], inner, border) * weave[..., None])


def painting(size: int = 256) -> wf.Texture:
    """Return an abstract painting."""
    v, u = np.mgrid[0:size, 0:size] / size
    hills = np.stack([v > 0.45 + 0.12 * k + 0.11 * np.sin(5 * u + 2 * k) for k in range(4)], -1)
    tones = np.array([(0.75, 0.50, 0.20), (0.50, 0.20, 0.08), (0.16, 0.20, 0.20), (0.03, 0.07, 0.10)])
    picture = np.full((size, size, 3), (0.80, 0.72, 0.58))
    for k in range(4):
        picture = np.where(hills[..., k, None], tones[k], picture)
    sun = (u - 0.66) ** 2 + (v - 0.24) ** 2 < 0.012
    picture = np.where(sun[..., None], (0.78, 0.12, 0.03), picture)
    return wf.Texture((picture * (1 + 0.12 * noise((size, size), 24, 22, 3))[..., None]).clip(0, 1))


def furniture() -> list[wf.Shape]:
    """Return a sofa, a table with a vase, a lamp, a rug and a painting."""
    rust, navy = wf.Diffuse((0.45, 0.13, 0.05)), wf.Diffuse((0.04, 0.08, 0.16))
    sofa = [
        cushion((0.1, 0.27, -2.25), (1.45, 0.17, 0.55), LINEN, 0.2),
        cushion((0.1, 0.62, -2.72), (1.45, 0.36, 0.20), LINEN, 0.25),
        cushion((-1.35, 0.42, -2.25), (0.17, 0.27, 0.58), LINEN, 0.25),
        cushion((1.55, 0.42, -2.25), (0.17, 0.27, 0.58), LINEN, 0.25),
        cushion((-0.46, 0.50, -2.18), (0.66, 0.12, 0.48), LINEN, 0.4),
        cushion((0.72, 0.50, -2.18), (0.66, 0.12, 0.48), LINEN, 0.4),
        cushion((-0.92, 0.78, -2.42), (0.26, 0.25, 0.12), rust, 0.55),
        cushion((1.02, 0.78, -2.42), (0.26, 0.25, 0.12), navy, 0.55),
    ]
    sofa += [box((x, 0, z), (x + 0.06, 0.12, z + 0.06), OAK) for x in (-1.2, 1.35) for z in (-2.7, -1.85)]
    vase = curve((0, 0), (0.08, 0), (0.14, 0.12), (0.09, 0.26), (0.045, 0.34), (0.06, 0.38))
    vase[:, 1] += 0.425
    top = curve((0, 0.38), (0.4, 0.38), (0.52, 0.40), (0.4, 0.425), (0, 0.425))
    legs = np.array([(np.cos(a), 0, np.sin(a)) for a in (0.3, 2.4, 4.5)])
    shade = np.array([(0.24, 1.45), (0.15, 1.80)])
    white = wf.Principled((0.85, 0.85, 0.82), roughness=0.3, clearcoat=1)
    return [
        *sofa,
        turned(top, (-0.2, -0.75), material=OAK),
        wf.Cylinders(legs * 0.42 + (-0.2, 0, -0.75), legs * 0.3 + (-0.2, 0.39, -0.75), 0.022, material=OAK),
        turned(vase, (-0.35, -0.85), material=wf.Principled((0.02, 0.13, 0.17), roughness=0.25, clearcoat=1)),
        wf.Sphere((0.05, 0.485, -0.62), 0.06, material=wf.Principled((0.75, 0.28, 0.02), roughness=0.4)),
        wf.Sphere((0.16, 0.48, -0.70), 0.055, material=wf.Principled((0.55, 0.03, 0.02), roughness=0.3)),
        wf.Cylinders([(2.25, 0, -2.4)], [(2.25, 1.6, -2.4)], 0.015, material=BRASS),
        turned(curve((0, 0), (0.17, 0.0), (0.17, 0.025), (0, 0.03)), (2.25, -2.4), material=BRASS),
        turned(shade, (2.25, -2.4), material=wf.Diffuse((0.82, 0.76, 0.64))),
        box((-2.65, 0.0, -2.9), (-1.95, 0.5, -2.35), OAK),
        cushion((-2.3, 0.68, -2.6), (0.16, 0.18, 0.16), white, 0.8),
        wf.Rectangle((-1.6, 0.004, 0.6), (3.2, 0, 0), (0, 0, -2.2), material=wf.Diffuse(rug()), name="rug"),
        box((-0.75, 1.32, -2.99), (0.95, 2.36, -2.95), wf.Principled((0.03, 0.025, 0.02), roughness=0.3)),
        wf.Rectangle((-0.70, 1.37, -2.945), (1.6, 0, 0), (0, 0.94, 0), material=wf.Diffuse(painting())),
    ]


def interior(size: int = 600) -> wf.Scene:
    """Return the room, 1 unit = 1 m."""
    sun = wf.DirectionalLight((1.0, -0.62, -0.42), (62, 52, 40), angle=0.6)
    camera = wf.Camera.look_at((1.35, 1.42, 3.4), (-0.25, 1.02, -2.0), fov=46, size=(size, size * 2 // 3))
    return wf.Scene([*walls(), *furniture()], [sun, wf.Environment((3.0, 3.9, 5.2))], camera)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="A living room by day.")
    parser.add_argument("output", nargs="?", default="interior.png")
    parser.add_argument("--spp", type=int, default=128)
    parser.add_argument("--size", type=int, default=600)
    options = parser.parse_args()
    wf.render(interior(options.size), options.spp, denoise=True).save(
        options.output, tone="agx", exposure=0.3
    )
    print(f"wrote {options.output}")
