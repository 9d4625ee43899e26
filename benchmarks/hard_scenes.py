"""Four rooms whose light is hard to find: where path guiding should pay.

All materials are diffuse, or diffuse and rough metal mixed, which Mitsuba and Cycles have alike.
Lengths are meters, y is up.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

import wavefront as wf

WHITE, RED, BLUE, YELLOW = (wf.Diffuse(c) for c in (0.75, (0.7, 0.4, 0.3), (0.35, 0.5, 0.7), (0.6, 0.6, 0.3)))
GLOSSY = wf.Mix(wf.Diffuse((0.3, 0.25, 0.2)), wf.Conductor(1, 1000, roughness=0.25), 0.15)
CORNER_QUADS = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
Shapes = list[wf.Mesh | wf.Sphere]


def cuboid(center: ArrayLike, half: ArrayLike, material: wf.Bsdf = WHITE, turn: float = 0) -> wf.Mesh:
    """Return a box of given half edges, turned around y by some degrees."""
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * half
    cos, sin = np.cos(np.radians(turn)), np.sin(np.radians(turn))
    corners = corners @ np.array([[cos, 0, -sin], [0, 1, 0], [sin, 0, cos]]) + center
    faces = [f for a, b, c, d in CORNER_QUADS for f in ((a, b, c), (a, c, d))]
    return wf.Mesh(corners, faces, material=material)


def lamp(corner: ArrayLike, u: ArrayLike, v: ArrayLike, radiance: float) -> wf.Mesh:
    """Return a black rectangle that shines to the side of u × v."""
    return wf.Rectangle(corner, u, v, material=wf.Diffuse(0), emission=radiance)


def walls(low: ArrayLike, high: ArrayLike, without: str = "") -> Shapes:
    """Return the walls of a room, facing in, but for one: left and right are at x, back and front at z."""
    (x, y, z), (dx, dy, dz) = low, np.subtract(high, low)
    sides = {
        "floor": ((x, y, z + dz), (dx, 0, 0), (0, 0, -dz), WHITE),
        "ceiling": ((x, y + dy, z), (dx, 0, 0), (0, 0, dz), WHITE),
        "back": ((x, y, z), (dx, 0, 0), (0, dy, 0), WHITE),
        "front": ((x + dx, y, z + dz), (-dx, 0, 0), (0, dy, 0), WHITE),
        "left": ((x, y, z + dz), (0, 0, -dz), (0, dy, 0), RED),
        "right": ((x + dx, y, z), (0, 0, dz), (0, dy, 0), BLUE),
    }
    return [
        wf.Rectangle(corner, u, v, material=material)
        for name, (corner, u, v, material) in sides.items()
        if name != without
    ]


def ceiling(size: int) -> wf.Scene:
    """Return a room lit by a lamp in a trough on the wall, which shines up at the ceiling."""
    shapes = [
        *walls((0, 0, 0), (4, 3, 5)),
        lamp((0.6, 2.2, 0.25), (0, 0, 0.3), (0.6, 0, 0), 120),
        cuboid((0.9, 2.1, 0.4), (0.36, 0.04, 0.2)),
        cuboid((2.9, 0.5, 1.6), (0.5, 0.5, 0.5), turn=20),
        cuboid((1.2, 0.3, 2.6), (0.5, 0.3, 0.3), turn=-15),
        wf.Sphere((2.2, 0.4, 3), 0.4, material=YELLOW),
    ]
    camera = wf.Camera.look_at((2, 1.5, 4.9), (2, 1.2, 0), fov=65, size=(size, size))
    return wf.Scene(shapes, camera=camera)


def ajar(size: int) -> wf.Scene:
    """Return a dark room beside a bright one, with a door between them that is a little open."""
    angle = np.radians(18)
    middle_of_door = (1.5 + 0.5 * np.cos(angle), 1.04, -0.05 - 0.5 * np.sin(angle))
    shapes = [
        *walls((0, 0, 0), (4, 3, 5), without="back"),
        *walls((0, 0, -4.1), (4, 3, -0.1), without="front"),
        cuboid((0.75, 1.5, -0.05), (0.75, 1.5, 0.05)),
        cuboid((3.25, 1.5, -0.05), (0.75, 1.5, 0.05)),
        cuboid((2, 2.55, -0.05), (0.5, 0.45, 0.05)),
        cuboid(middle_of_door, (0.5, 1.04, 0.02), turn=18),
        lamp((2.6, 2.9, -2.6), (1, 0, 0), (0, 0, 1), 60),
        cuboid((2.9, 0.4, 1.6), (0.4, 0.4, 0.4), turn=20),
        wf.Sphere((1.2, 0.4, 2.2), 0.4, material=YELLOW),
    ]
    camera = wf.Camera.look_at((2, 1.5, 4.9), (2, 1.1, 0), fov=60, size=(size, size))
    return wf.Scene(shapes, camera=camera)


def window(size: int) -> wf.Scene:
    """Return a room into which sun and sky shine through a small window."""
    shapes = [
        *walls((0, 0, 0), (4, 3, 5), without="left"),
        cuboid((-0.1, 0.6, 2.5), (0.1, 0.6, 2.5), RED),
        cuboid((-0.1, 2.6, 2.5), (0.1, 0.4, 2.5), RED),
        cuboid((-0.1, 1.7, 0.75), (0.1, 0.5, 0.75), RED),
        cuboid((-0.1, 1.7, 3.75), (0.1, 0.5, 1.25), RED),
        cuboid((2.9, 0.5, 1.6), (0.5, 0.5, 0.5), turn=20),
        wf.Sphere((1.2, 0.4, 2.6), 0.4, material=YELLOW),
    ]
    sun = wf.DirectionalLight((1, -0.9, -0.2), (20, 18, 15), angle=0.53)
    camera = wf.Camera.look_at((2.4, 1.5, 4.9), (1.8, 1.2, 0), fov=65, size=(size, size))
    return wf.Scene(shapes, [wf.Environment((0.5, 0.7, 1)), sun], camera)


def corridor(size: int) -> wf.Scene:
    """Return a corridor with a glossy floor, lit by a lamp round the corner at its end."""
    height = (0, 2.5, 0)
    shapes = [
        wf.Rectangle((0, 0, 10), (2, 0, 0), (0, 0, -10), material=GLOSSY),
        wf.Rectangle((0, 2.5, 0), (2, 0, 0), (0, 0, 10), material=WHITE),
        wf.Rectangle((0, 0, 10), (0, 0, -10), height, material=RED),
        wf.Rectangle((2, 0, 2), (0, 0, 8), height, material=WHITE),
        wf.Rectangle((2, 0, 10), (-2, 0, 0), height, material=WHITE),
        # the side arm, to the right of the far end
        wf.Rectangle((0, 0, 0), (5, 0, 0), height, material=WHITE),
        wf.Rectangle((5, 0, 2), (-3, 0, 0), height, material=WHITE),
        wf.Rectangle((5, 0, 0), (0, 0, 2), height, material=WHITE),
        wf.Rectangle((2, 0, 2), (3, 0, 0), (0, 0, -2), material=GLOSSY),
        wf.Rectangle((2, 2.5, 0), (3, 0, 0), (0, 0, 2), material=WHITE),
        lamp((3.5, 2.45, 0.5), (1, 0, 0), (0, 0, 1), 30),
        cuboid((0.4, 0.4, 4), (0.25, 0.4, 0.25)),
        cuboid((1.6, 0.4, 6), (0.25, 0.4, 0.25)),
    ]
    camera = wf.Camera.look_at((1, 1.4, 9.8), (1, 1, 0), fov=55, size=(size, size))
    return wf.Scene(shapes, camera=camera)


HARD_SCENES: dict[str, Callable[[int], wf.Scene]] = {
    "ceiling": ceiling,
    "ajar": ajar,
    "window": window,
    "corridor": corridor,
}
