"""Eight scenes of what people render, all of materials that Mitsuba and Cycles have alike."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import trimesh
from hard_scenes import ceiling
from many_lights import lit

import wavefront as wf
from wavefront.scene.lighting import PRESETS

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "examples"))
from cornell_box import cornell_box

GOLD = wf.Conductor((0.143, 0.374, 1.442), (3.983, 2.386, 1.603), roughness=0.3, multiscatter=False)
COATED = wf.Mix(
    wf.Diffuse((0.45, 0.08, 0.06)), wf.Conductor(1, 1000, roughness=0.2, multiscatter=False), 0.12
)
FLOOR = wf.Rectangle((-6, 0, 6), (12, 0, 0), (0, 0, -12), material=wf.Diffuse(0.45))


def studio() -> wf.Environment:
    """Return the preset of that name, without its backdrop."""
    return wf.Environment(PRESETS["studio"].pixels().astype(np.float32))


def sky(kind: str = "soft sun", height: int = 128) -> wf.Environment:
    """Return an HDRI of one kind, twice as wide as it is high.

    Kinds are "even", but for noise of 5 %; "soft sun", of some degrees in a sky over a dark ground; and "hard
    sun", a disk of 0.53 degrees, 100 000 times as bright as that sky.
    """
    if kind == "even":
        noise = np.random.default_rng(1).uniform(0.95, 1.05, (height, 2 * height, 1))
        return wf.Environment((noise * (0.9, 0.95, 1)).astype(np.float32))
    up = np.cos((np.arange(height) + 0.5) / height * np.pi)[:, None]
    turn = (0.5 - (np.arange(2 * height) + 0.5) / (2 * height)) * 2 * np.pi
    x, y, z = np.array((0.5, 0.6, 0.62)) / np.linalg.norm((0.5, 0.6, 0.62))
    toward = y * up + np.sqrt(1 - up**2) * (x * np.sin(turn) + z * np.cos(turn))
    suns = {
        "soft sun": lambda: 60 * np.exp(120 * (toward - 1)),
        "hard sun": lambda: 1e5 * (toward > np.cos(np.radians(0.533 / 2))),
    }
    pixels = suns[kind]().astype(np.float32)[..., None] * np.float32((1, 0.9, 0.75))
    pixels += np.where(up[..., None] > 0, np.float32((0.5, 0.7, 1.0)), np.float32((0.18, 0.15, 0.12)))
    return wf.Environment(pixels)


def blob(material: wf.Bsdf, center: tuple[float, float, float], subdivisions: int = 6) -> wf.Mesh:
    """Return a wavy ball of radius 0.7 with smooth normals."""
    ball = trimesh.creation.icosphere(subdivisions=subdivisions)
    x, y, z = ball.vertices.T
    vertices = ball.vertices * (0.7 * (1 + 0.15 * np.sin(9 * x) * np.sin(7 * y + 1) * np.sin(8 * z)))[:, None]
    vertices = vertices - (0, vertices[:, 1].min(), 0) + center
    normals = trimesh.Trimesh(vertices, ball.faces, process=False).vertex_normals
    return wf.Mesh(vertices, ball.faces, normals=normals, material=material)


def textured() -> list[wf.Mesh]:
    """Return a vase and a floor with images of colors, as a glTF file has them."""
    x, y = np.meshgrid(np.arange(256) / 256, np.arange(256) / 256)
    checks = ((x * 16).astype(int) + (y * 16).astype(int)) % 2
    grain = np.random.default_rng(1).random((64, 64)).repeat(4, 0).repeat(4, 1)
    tiles = np.where(checks[..., None], (0.75, 0.7, 0.6), (0.2, 0.3, 0.4)) * (0.7 + 0.3 * grain[..., None])
    bands = 0.4 + 0.35 * np.sin(np.stack([40 * y + 6 * np.sin(12 * np.pi * x), 55 * y, 30 * y + 2], -1))
    u, v = np.meshgrid(np.linspace(0, 1, 97), np.linspace(0, 1, 65))
    radius = 0.35 + 0.25 * np.sin(1 + 5.5 * v)
    places = np.stack([radius * np.cos(2 * np.pi * u), 1.4 * v, -radius * np.sin(2 * np.pi * u)], -1)
    corner = (np.arange(64)[:, None] * 97 + np.arange(96)).ravel()
    faces = np.concatenate(
        [np.stack([corner, corner + 1, corner + 98], 1), np.stack([corner, corner + 98, corner + 97], 1)]
    )
    vase = wf.Mesh(
        places.reshape(-1, 3),
        faces,
        uvs=np.stack([u, v], -1).reshape(-1, 2),
        material=wf.Diffuse(wf.Texture(bands.astype(np.float32))),
    )
    floor = wf.Mesh(
        [(-4, 0, 4), (4, 0, 4), (4, 0, -4), (-4, 0, -4)],
        [(0, 1, 2), (0, 2, 3)],
        uvs=[(0, 0), (2, 0), (2, 2), (0, 2)],
        material=wf.Diffuse(wf.Texture(tiles.astype(np.float32))),
    )
    return [vase, floor]


def before(size: int, shapes: list[wf.Mesh | wf.Sphere], light: wf.Environment) -> wf.Scene:
    """Return shapes on the ground, about a meter high, and the camera that sees them."""
    camera = wf.Camera.look_at((0.6, 1.5, 3.6), (0, 0.6, 0), fov=35, size=(size, size))
    return wf.Scene(shapes, [light], camera)


def glass(size: int) -> wf.Scene:
    """Return balls of glass on a floor under a panel and a gray sky."""
    shapes = [
        FLOOR,
        wf.Sphere((-0.45, 0.6, 0), 0.6, material=wf.Dielectric(1.5)),
        wf.Sphere((0.6, 0.4, 0.5), 0.4, material=wf.Dielectric(1.5)),
        wf.Sphere((0.7, 0.45, -0.9), 0.45, material=wf.Diffuse((0.7, 0.35, 0.15))),
        wf.Rectangle((-2, 4, -2), (4, 0, 0), (0, 0, 4), material=wf.Diffuse(0), emission=3.0),
    ]
    return before(size, shapes, wf.Environment((0.4, 0.45, 0.5)))


SCENES: dict[str, tuple[Callable[[int], wf.Scene], int]] = {  # and the bounces
    "mesh, studio": (
        lambda n: before(n, [FLOOR, blob(wf.Diffuse((0.6, 0.55, 0.5)), (0, 0, 0))], studio()),
        7,
    ),
    "textures": (lambda n: before(n, textured(), studio()), 7),
    "glass": (glass, 9),
    "gold": (lambda n: before(n, [FLOOR, blob(GOLD, (0, 0, 0))], studio()), 7),
    "glossy, HDRI": (lambda n: before(n, [FLOOR, blob(COATED, (0, 0, 0))], sky()), 7),
    "Cornell box": (cornell_box, 7),
    "ceiling": (ceiling, 12),
    "1000 lights": (lambda n: lit("panels", 1000, n), 3),
}
