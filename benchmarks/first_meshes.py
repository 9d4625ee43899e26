"""Eight meshes of 2 000 to 200 000 triangles, made by formulas, as files that `wf.render` reads."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import trimesh
from trimesh.creation import annulus, box, icosphere, revolve


def tube(curve: np.ndarray, radius: float, sides: int) -> trimesh.Trimesh:
    """Return a tube around a closed curve (n, 3)."""
    along = np.roll(curve, -1, 0) - np.roll(curve, 1, 0)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    across = np.cross(along, (0, 0, 1))
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    turn = np.linspace(0, 2 * np.pi, sides, endpoint=False)[None, :, None]
    rings = np.cos(turn) * across[:, None] + np.sin(turn) * np.cross(along, across)[:, None]
    return trimesh.Trimesh(
        (curve[:, None] + radius * rings).reshape(-1, 3), grid(len(curve), sides), process=False
    )


def grid(rows: int, columns: int, closed: bool = True) -> np.ndarray:
    """Return the triangles (n, 3) of a grid of vertices whose last row and column meet the first, or not."""
    i, j = np.meshgrid(np.arange(rows - (not closed)), np.arange(columns - (not closed)), indexing="ij")
    k, n = (i + 1) % rows, (j + 1) % columns
    a, b, c, d = (
        each.ravel() for each in (i * columns + j, k * columns + j, k * columns + n, i * columns + n)
    )
    return np.concatenate([np.stack([a, c, b], 1), np.stack([a, d, c], 1)])


def knot(points: int, sides: int) -> trimesh.Trimesh:
    """Return a trefoil."""
    t = np.linspace(0, 2 * np.pi, points, endpoint=False)
    away = 2 + np.cos(3 * t)
    return tube(np.stack([away * np.cos(2 * t), away * np.sin(2 * t), np.sin(3 * t)], 1), 0.3, sides)


def rough(subdivisions: int, height: float, frequency: float) -> trimesh.Trimesh:
    """Return a ball with waves on it."""
    ball, rng = icosphere(subdivisions), np.random.default_rng(5)
    waves = [
        np.sin(ball.vertices @ rng.normal(size=3) * frequency * k + rng.uniform(0, 6)) / k
        for k in (1, 2, 3, 4)
    ]
    return trimesh.Trimesh(ball.vertices * (1 + height * sum(waves)[:, None]), ball.faces, process=False)


def gear() -> trimesh.Trimesh:
    """Return a wheel with 48 teeth."""
    wheel = annulus(0.3, 1, 0.3, sections=288)
    vertices = wheel.vertices.copy()
    turn = np.rint(np.arctan2(vertices[:, 1], vertices[:, 0]) / (2 * np.pi / 288)).astype(int)
    low = (np.hypot(vertices[:, 0], vertices[:, 1]) > 0.6) & (turn // 3 % 2 == 0)
    vertices[low, :2] *= 0.88
    return trimesh.Trimesh(vertices, wheel.faces, process=False)


def vase() -> trimesh.Trimesh:
    """Return a solid of revolution."""
    height = np.linspace(0, 2, 80)
    radius = 0.5 + 0.25 * np.sin(4 * height) + 0.1 * np.cos(9 * height)
    radius[[0, -1]] = 0
    return revolve(np.stack([radius, height], 1), sections=48)


def balls() -> trimesh.Trimesh:
    """Return fifty balls."""
    rng = np.random.default_rng(2)
    made = []
    for _ in range(50):
        made.append(icosphere(3, rng.uniform(0.08, 0.3)))
        made[-1].apply_translation(rng.uniform(-1, 1, 3))
    return trimesh.util.concatenate(made)


def hills(side: int = 224) -> trimesh.Trimesh:
    """Return a terrain."""
    x, y = np.meshgrid(np.linspace(-1, 1, side), np.linspace(-1, 1, side), indexing="ij")
    waves = np.random.default_rng(3).uniform(-9, 9, (9, 3))
    z = 0.4 * sum(np.sin(x * a + y * b + c) / (3 * k) for k, (a, b, c) in enumerate(waves, 1))
    vertices = np.stack([x.ravel(), z.ravel(), y.ravel()], 1)
    return trimesh.Trimesh(vertices, grid(side, side, closed=False), process=False)


def sponge() -> trimesh.Trimesh:
    """Return Menger's sponge after three steps."""
    corners, side = [np.zeros(3)], 1.0
    cells = [np.array(cell) for cell in np.ndindex(3, 3, 3) if cell.count(1) < 2]
    for _ in range(3):
        side /= 3
        corners = [corner + side * cell for corner in corners for cell in cells]
    move = trimesh.transformations.translation_matrix
    return trimesh.util.concatenate([box((side,) * 3, move(corner)) for corner in corners])


MESHES: dict[str, Callable[[], trimesh.Trimesh]] = {
    "gear": gear,
    "vase": vase,
    "knot": lambda: knot(480, 20),
    "rock": lambda: rough(5, 0.12, 2),
    "balls": balls,
    "sponge": sponge,
    "hills": hills,
    "long knot": lambda: knot(1600, 62),
}


def written(folder: Path) -> list[Path]:
    """Write the eight meshes as files in a folder, and return their paths."""
    paths = []
    for name, make in MESHES.items():
        paths.append(folder / f"{name.replace(' ', '_')}.ply")
        make().export(paths[-1])
    return paths
