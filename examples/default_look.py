"""Thirty meshes as `render` shows them when it is given a mesh and nothing else.

python examples/default_look.py [out.png] [--spp 256] [--size 720]

Every picture of the sheet has its camera, its light and its ground from `wf.render`.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence

import numpy as np

import wavefront as wf

COLUMNS = 6
WHITE, BLACK = wf.Diffuse(0.8), wf.Diffuse(0.03)
GLASS, GOLD = wf.Dielectric(1.5), wf.Conductor.named("gold", roughness=0.15)
COPPER, STEEL = wf.Conductor.named("copper", roughness=0.3), wf.Conductor.named("iron", roughness=0.1)
RED, BLUE = wf.Principled((0.6, 0.03, 0.03), 0, 0.3), wf.Principled((0.04, 0.15, 0.5), 0, 0.25)
PIANO = wf.Principled((0.01, 0.01, 0.01), 0, 0.1)
JADE = wf.Principled((0.1, 0.4, 0.2), 0, 0.35)


def surface(points: np.ndarray, material: wf.Bsdf | None = None, *, round_u=False, round_v=False) -> wf.Mesh:
    """Return a smooth mesh through a grid of points (n, m, 3); `round` joins the last row to the first."""
    if round_u:
        points = np.concatenate([points, points[:1]], 0)
    if round_v:
        points = np.concatenate([points, points[:, :1]], 1)
    along_u, along_v = np.gradient(points, axis=0), np.gradient(points, axis=1)
    if round_u:
        along_u[0] = along_u[-1] = points[1] - points[-2]
    if round_v:
        along_v[:, 0] = along_v[:, -1] = points[:, 1] - points[:, -2]
    normals = np.cross(along_u, along_v)
    n, m, _ = points.shape
    corner = (np.arange(n - 1)[:, None] * m + np.arange(m - 1)).ravel()
    right, up, across = corner + 1, corner + m, corner + m + 1
    faces = np.concatenate([np.stack([corner, up, across], 1), np.stack([corner, across, right], 1)])
    points = points.reshape(-1, 3)
    a, b, c = points[faces.T]
    faces = faces[np.cross(b - a, c - a).any(1)]  # at a pole every other face has no area
    return wf.Mesh(points, faces, normals=normals.reshape(-1, 3), material=material)


def grid(n: int, m: int, u_end: float = 2 * np.pi, v_end: float = 2 * np.pi) -> tuple[np.ndarray, np.ndarray]:
    """Return u (n, 1) and v (1, m), from 0 up to but not including the ends."""
    return np.arange(n)[:, None] * u_end / n, np.arange(m)[None] * v_end / m


def stack(*xyz: np.ndarray) -> np.ndarray:
    """Return the points (n, m, 3) with these coordinates."""
    return np.stack(np.broadcast_arrays(*xyz), -1).astype(float)


def tube(path: np.ndarray, radius: float, material: wf.Bsdf | None = None, closed: bool = True) -> wf.Mesh:
    """Return a tube of this radius around a path (n, 3)."""
    ahead = np.roll(path, -1, 0) - np.roll(path, 1, 0) if closed else np.gradient(path, axis=0)
    ahead /= np.linalg.norm(ahead, axis=1, keepdims=True)
    out = path - (path * ahead).sum(1, keepdims=True) * ahead
    out /= np.linalg.norm(out, axis=1, keepdims=True)
    side = np.cross(out, ahead)
    turn = np.arange(32)[None, :, None] * 2 * np.pi / 32
    size = np.full((len(path), 1, 1), radius)
    if not closed:
        size[0] = size[-1] = 0  # shuts the ends
    ring = size * (out[:, None] * np.cos(turn) + side[:, None] * np.sin(turn))
    return surface(path[:, None] + ring, material, round_u=closed, round_v=True)


def lathe(profile: Sequence[tuple[float, float]], material: wf.Bsdf | None = None) -> wf.Mesh:
    """Return a profile of (radius, height), from bottom to top, rounded off and turned about the y axis."""
    points = np.array(profile)
    for _ in range(4):  # G. Chaikin, 1974: corners are cut off until they are round
        cut = np.stack([0.75 * points[:-1] + 0.25 * points[1:], 0.25 * points[:-1] + 0.75 * points[1:]], 1)
        points = np.concatenate([points[:1], cut.reshape(-1, 2), points[-1:]])
    turn = -np.arange(96)[None] * 2 * np.pi / 96
    radius, height = points[:, :1], points[:, 1:]
    return surface(stack(radius * np.sin(turn), height, radius * np.cos(turn)), material, round_v=True)


def prism(outline: np.ndarray, depth: float, material: wf.Bsdf | None = None) -> wf.Mesh:
    """Return an outline (n, 2) that is seen whole from its middle, as a plate of this depth."""
    n = len(outline)
    k, nxt = np.arange(n), (np.arange(n) + 1) % n
    front = np.column_stack([outline, np.full(n, depth / 2)])
    points = np.concatenate([front, front * (1, 1, -1), [[0, 0, depth / 2], [0, 0, -depth / 2]]])
    faces = [(k, nxt, np.full(n, 2 * n)), (nxt + n, k + n, np.full(n, 2 * n + 1))]
    faces += [(k, k + n, nxt), (nxt, k + n, nxt + n)]
    return wf.Mesh(points, np.concatenate([np.stack(f, 1) for f in faces]), material=material)


def blocks(boxes: list[tuple[float, ...]], material: wf.Bsdf | None = None) -> wf.Mesh:
    """Return boxes, each by its lower corner and its size (x, y, z, width, height, depth), as one mesh."""
    corner = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], float)
    sides = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    faces = np.array([triangle for a, b, c, d in sides for triangle in ([a, b, c], [a, c, d])])
    vertices = [np.array(box[:3]) + corner * box[3:] for box in boxes]
    return wf.Mesh(
        np.concatenate(vertices),
        np.concatenate([faces + 8 * number for number in range(len(boxes))]),
        material=material,
    )


def knot(material: wf.Bsdf | None = None, p: int = 2, q: int = 3) -> wf.Mesh:
    """Return a torus knot that goes p times around and q times through."""
    t = np.arange(400) * 2 * np.pi / 400
    reach = 2 + np.cos(q * t)
    return tube(np.stack([reach * np.cos(p * t), reach * np.sin(p * t), np.sin(q * t)], 1), 0.36, material)


def spring(material: wf.Bsdf | None = None) -> wf.Mesh:
    """Return a coil of five turns."""
    t = np.linspace(0, 10 * np.pi, 500)
    return tube(np.stack([np.cos(t), t / 11 - 1.4, np.sin(t)], 1), 0.16, material, closed=False)


def torus(material: wf.Bsdf | None = None) -> wf.Mesh:
    """Return a ring that lies askew."""
    u, v = grid(96, 48)
    reach = 1 + 0.4 * np.cos(v)
    ring = stack(reach * np.cos(u), reach * np.sin(u), 0.4 * np.sin(v))
    return surface(ring, material, round_u=True, round_v=True)


def cog(teeth: int = 12, material: wf.Bsdf | None = None) -> wf.Mesh:
    """Return a toothed wheel."""
    turn = (np.arange(4 * teeth) + 0.5) * np.pi / (2 * teeth)
    radius = np.tile([0.78, 1, 1, 0.78], teeth)
    return prism(np.stack([radius * np.cos(turn), radius * np.sin(turn)], 1), 0.45, material)


def star(points: int = 5, material: wf.Bsdf | None = None) -> wf.Mesh:
    """Return a thick star with one point up."""
    turn = np.pi / 2 + np.arange(2 * points) * np.pi / points
    radius = np.tile([1, 0.45], points)
    return prism(np.stack([radius * np.cos(turn), radius * np.sin(turn)], 1), 0.4, material)


def terrain(material: wf.Bsdf | None = None) -> wf.Mesh:
    """Return hills: waves of random directions, the smaller the shorter."""
    z, x = grid(160, 160, 2, 2)
    random = np.random.default_rng(8)
    height = np.zeros((160, 160))
    for number in range(40):
        wave = random.normal(size=2) * 1.25 ** (number / 2)
        height += np.sin(wave[0] * x + wave[1] * z + random.uniform(0, 7)) / (1 + np.hypot(*wave)) ** 1.3
    return surface(stack(x, 0.22 * height, z), material)


def ripples(material: wf.Bsdf | None = None) -> wf.Mesh:
    """Return waves around a drop."""
    z, x = grid(200, 200, 2, 2)
    distance = np.hypot(x - 1, z - 1)
    return surface(stack(x, 0.12 * np.cos(22 * distance) * np.exp(-2 * distance), z), material)


def shell(material: wf.Bsdf | None = None) -> wf.Mesh:
    """Return a snail's shell."""
    u, v = grid(400, 40, 6.5 * np.pi)
    size = np.exp(0.13 * (u - 6.5 * np.pi))
    reach = size * (1 + 0.95 * np.cos(v))
    return surface(
        stack(reach * np.cos(u), size * (0.95 * np.sin(v) - 2.2) + 1, -reach * np.sin(u)),
        material,
        round_v=True,
    )


def moebius(material: wf.Bsdf | None = None) -> wf.Mesh:
    """Return a strip with one side."""
    u = np.linspace(0, 2 * np.pi, 200)[:, None]
    v = np.linspace(-0.45, 0.45, 12)[None]
    reach = 1 + v * np.cos(u / 2)
    return surface(stack(reach * np.cos(u), v * np.sin(u / 2), reach * np.sin(u)), material)


def blob(material: wf.Bsdf | None = None) -> wf.Mesh:
    """Return a ball with soft bumps."""
    u = np.linspace(0, np.pi, 120)[:, None]
    v = -np.arange(160)[None] * 2 * np.pi / 160
    radius = 1 + 0.22 * np.sin(3 * u) ** 2 * np.sin(5 * v) * np.sin(u)
    return surface(
        stack(radius * np.sin(u) * np.sin(v), -radius * np.cos(u), radius * np.sin(u) * np.cos(v)),
        material,
        round_v=True,
    )


def cushion(power: float, material: wf.Bsdf | None = None) -> wf.Mesh:
    """Return a superellipsoid: a box with round edges for powers below 1."""
    u = np.linspace(-np.pi / 2, np.pi / 2, 100)[:, None]
    v = -np.arange(160)[None] * 2 * np.pi / 160

    def bent(x: np.ndarray) -> np.ndarray:
        return np.sign(x) * np.abs(x) ** power

    return surface(
        stack(bent(np.cos(u)) * bent(np.sin(v)), bent(np.sin(u)), bent(np.cos(u)) * bent(np.cos(v))),
        material,
        round_v=True,
    )


def bottle(material: wf.Bsdf | None = None) -> wf.Mesh:
    """Return the figure-8 form of Klein's bottle, which passes through itself."""
    u, v = grid(160, 80)
    across, along = np.sin(v), np.sin(2 * v)
    reach = 2 + np.cos(u / 2) * across - np.sin(u / 2) * along
    height = np.sin(u / 2) * across + np.cos(u / 2) * along
    whole = stack(reach * np.cos(u), height, reach * np.sin(u))
    return surface(np.concatenate([whole, whole[:1, ::-1]]), material, round_v=True)


# radius and height, from the bottom up
VASE = (
    (0, 0),
    (0.55, 0),
    (0.6, 0.1),
    (1, 0.9),
    (0.75, 1.7),
    (0.3, 2.1),
    (0.5, 2.6),
    (0.42, 2.6),
    (0.22, 2.1),
)
BOWL = ((0, 0), (0.4, 0), (0.4, 0.08), (0.95, 0.3), (1.15, 0.85), (1.09, 0.85), (0.9, 0.4), (0, 0.18))
PAWN = (
    (0, 0),
    (0.7, 0),
    (0.7, 0.25),
    (0.5, 0.35),
    (0.3, 0.6),
    (0.2, 1.2),
    (0.45, 1.3),
    (0.2, 1.4),
    (0.4, 1.6),
)
PAWN = (*PAWN, (0.4, 2.1), (0, 2.15))
TOP = ((0, 0), (0.08, 0.2), (0.9, 0.75), (0.95, 1.0), (0.2, 1.25), (0.1, 1.4), (0.12, 1.9), (0, 1.9))
# left, bottom, width and height of the strokes of two letters
STROKES = ((0, 0, 0.3, 1.6), (0.3, 0, 0.4, 0.3), (0.7, 0, 0.3, 1), (1, 0, 0.4, 0.3), (1.4, 0, 0.3, 1.6))
STROKES = (*STROKES, (2.1, 0, 0.3, 1.6), (2.4, 1.3, 0.7, 0.3), (2.4, 0.65, 0.5, 0.3))
LETTERS = [(left, bottom, 0, width, height, 0.4) for left, bottom, width, height in STROKES]
STAIRS = [(0, 0, -0.25 * step, 1.2, 0.2 * (step + 1), 0.25) for step in range(7)]


def subjects() -> list[wf.Mesh | wf.Sphere]:
    """Return what is on the sheet, row by row."""
    plain = [blocks([(-1, -1, -1, 2, 2, 2)]), wf.Sphere((0, 0, 0), 1), torus(), knot(), spring(), cog()]
    curved = [lathe(VASE), terrain(), shell(), moebius(), cushion(0.35), star()]
    painted = [
        blob(WHITE),
        knot(BLACK, 3, 2),
        lathe(BOWL, PIANO),
        lathe(PAWN, RED),
        bottle(JADE),
        ripples(BLUE),
    ]
    clear = [wf.Sphere((0, 0, 0), 1, material=GLASS), torus(GLASS), cushion(0.5, GLASS)]
    metal = [knot(GOLD), lathe(VASE, COPPER), blob(STEEL)]
    more = [blocks(LETTERS), lathe(TOP, WHITE), lathe(PAWN, PIANO)]
    more += [blocks(STAIRS), spring(GOLD), lathe(BOWL, BLUE)]
    return [*plain, *curved, *painted, *clear, *metal, *more]


def sheet(width: int, spp: int) -> wf.Image:
    """Render all of them, side by side; the picture is `width` pixels wide."""
    size = width // COLUMNS
    images = [wf.render(subject, spp, size=(size, size), progress=False) for subject in subjects()]
    tiles = [image.rgb for image in images]
    rows = [np.hstack(tiles[first : first + COLUMNS]) for first in range(0, len(tiles), COLUMNS)]
    tone = {"tone": images[0].metadata["tone"]}  # by which a picture of chosen light is shown
    return wf.Image(np.vstack(rows), spp, metadata=tone)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("output", nargs="?", default="default_look.png")
    parser.add_argument("--spp", type=int, default=256)
    parser.add_argument("--size", type=int, default=720)
    options = parser.parse_args()
    sheet(options.size, options.spp).save(options.output)
    print(f"wrote {options.output}")
