"""Ten rooms that a seed draws: size, walls, openings and screens, floor, furniture and their materials.

Rules are tuned on the first five alone. Lengths are meters, y is up. `equal_error.py --scenes "room 1"
"room 2"` measures some.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
from hard_scenes import Shapes, cuboid, lamp, walls

import wavefront as wf

LIGHTS = "screen", "window", "next room", "cove", "panel"  # in turn; all else is drawn


def matte(rng: np.random.Generator) -> wf.Bsdf:
    """Return a matte material of any color, rather light."""
    return wf.Diffuse(rng.uniform(0.25, 0.8) * (0.6 + 0.4 * rng.random(3)))


def surface(rng: np.random.Generator) -> wf.Bsdf:
    """Return a material: half of all are matte, the others brushed metal, plastic or glass."""
    kind, color = rng.random(), 0.2 + 0.6 * rng.random(3)
    if kind < 0.5:
        return matte(rng)
    if kind < 0.7:
        return wf.Conductor.named(
            str(rng.choice(["gold", "copper", "aluminium"])), roughness=rng.uniform(0.15, 0.5)
        )
    if kind < 0.9:
        return wf.Principled(color, roughness=rng.uniform(0.15, 0.6))
    return wf.Dielectric(1.5)


def floor_of(rng: np.random.Generator) -> wf.Bsdf:
    """Return the material of a floor: matte, varnished, brushed metal."""
    kind, color = rng.random(), 0.15 + 0.5 * rng.random(3)
    if kind < 0.5:
        return matte(rng)
    if kind < 0.75:
        return wf.Principled(color, roughness=rng.uniform(0.25, 0.5))
    if kind < 0.9:
        return wf.Mix(wf.Diffuse(color), wf.Conductor(1, 1000, roughness=rng.uniform(0.15, 0.35)), 0.15)
    return wf.Conductor.named("aluminium", roughness=rng.uniform(0.2, 0.4))


def hole(rng: np.random.Generator, depth: float, height: float) -> Shapes:
    """Return the left wall, two hands thick, with a window or a door in it."""
    wide, half = rng.uniform(0.3, 0.7), 0.1
    low, high = (0.8, rng.uniform(1.4, 2)) if rng.random() < 0.6 else (0, 2)
    middle = rng.uniform(1.2, depth - 1.5)
    parts = [  # y and z from, to
        (0, low, 0, depth),
        (high, height, 0, depth),
        (low, high, 0, middle - wide),
        (low, high, middle + wide, depth),
    ]
    return [
        cuboid((-half, (a + b) / 2, (c + d) / 2), (half, (b - a) / 2, (d - c) / 2), matte(rng))
        for a, b, c, d in parts
        if b > a
    ]


def light(
    kind: str, rng: np.random.Generator, width: float, height: float, depth: float
) -> tuple[Shapes, list[wf.Light], bool]:
    """Return what shines and hides it, lights that have no surface, and whether the left wall is among it."""
    if kind == "window":
        sky = wf.Environment(rng.uniform(0.4, 1, 3))
        sun = wf.DirectionalLight(
            (1, -rng.uniform(0.5, 1.2), rng.uniform(-0.5, 0.3)), (20, 18, 15), angle=0.53
        )
        return hole(rng, depth, height), [sky, sun] if rng.random() < 0.6 else [sky], True
    if kind == "next room":
        beyond = walls((-3.2, 0, 0), (3, height, depth), without="right")
        place = (rng.uniform(-2.8, -1.4), height - 0.05, rng.uniform(0.5, depth - 1.5))
        shapes = [*hole(rng, depth, height), *beyond, lamp(place, (0.8, 0, 0), (0, 0, 0.8), 40)]
        return shapes, [], True
    if kind == "screen":
        x, z = rng.uniform(0.5, width - 1.5), rng.uniform(0.1, 0.3)
        low, high = rng.uniform(0.3, 0.8), rng.uniform(1.2, 1.8)
        screen = cuboid((x + 0.4, (high + 0.3) / 2, z + 0.5), (0.7, (high + 0.3) / 2, 0.03), matte(rng))
        return [lamp((x, low, z), (0.8, 0, 0), (0, high - low, 0), 20), screen], [], False
    if kind == "cove":
        z = rng.uniform(0.5, depth - 2)
        trough = cuboid((width - 0.25, height - 0.7, z + 0.5), (0.25, 0.03, 0.7), matte(rng))
        return [lamp((width - 0.4, height - 0.6, z), (0, 0, 1), (0.3, 0, 0), 60), trough], [], False
    side = rng.uniform(0.3, 0.9)
    place = (rng.uniform(0.5, width - 1.4), height - 0.02, rng.uniform(0.5, depth - 2))
    return [lamp(place, (side, 0, 0), (0, 0, side), 20)], [], False


def room(seed: int, size: int) -> wf.Scene:
    """Return the room of a seed."""
    rng = np.random.default_rng(seed)
    width, height, depth = rng.uniform((3, 2.4, 4), (5, 3.2, 6))
    shining, lights, open_ = light(LIGHTS[seed % len(LIGHTS)], rng, width, height, depth)
    inside = walls((0, 0, 0), (width, height, depth), without="left" if open_ else "")
    for wall in inside:
        wall.material = wf.Material(matte(rng))
    inside[0].material = wf.Material(floor_of(rng))
    things: Shapes = []
    places = rng.permutation(6)[: rng.integers(3, 6)]  # cells of the floor, two rows of three
    for place in places:
        half = rng.uniform(0.2, 0.45)
        x = (place % 3 + 0.5 + rng.uniform(-0.2, 0.2)) * width / 3
        z = depth * (0.3 + 0.25 * (place // 3)) + rng.uniform(-0.2, 0.2)
        if rng.random() < 0.5:
            things.append(wf.Sphere((x, half, z), half, material=surface(rng)))
        else:
            tall = half * rng.uniform(0.8, 2)
            things.append(cuboid((x, tall, z), (half, tall, half), surface(rng), turn=rng.uniform(0, 90)))
    eye = (width * rng.uniform(0.35, 0.65), rng.uniform(1.2, 1.7), depth - 0.1)
    camera = wf.Camera.look_at(eye, (width / 2, rng.uniform(0.7, 1.2), 0), fov=65, size=(size, size))
    return wf.Scene([*inside, *shining, *things], lights, camera)


ROOMS: dict[str, Callable[[int], wf.Scene]] = {f"room {seed}": partial(room, seed) for seed in range(1, 11)}
