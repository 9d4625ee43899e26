"""Textured meshes: an apple, a pear, an orange and a plum on a board of wood.

Each fruit is a curve turned about an axis. Its colors, its roughness and its bumps are images made of noise.

python examples/fruit.py [out.png] [--spp 64] [--size 600]
"""

from __future__ import annotations

import argparse

import numpy as np
from terrace import curve, noise, turned

import wavefront as wf

HEIGHT, WIDTH = 512, 1024  # of the images; row 0 is the top of a fruit
ROWS = np.linspace(1, 0, HEIGHT)[:, None]  # the v of a row: 1 at the top


def mixed(parts: np.ndarray, first: tuple, second: tuple) -> np.ndarray:
    """Return linear colors (H, W, 3) between two, by parts (H, W) of the second one."""
    parts = parts.clip(0, 1)[..., None]
    return np.array(first) * (1 - parts) + np.array(second) * parts


def dots(count: int, radius: float, seed: int) -> np.ndarray:
    """Return a picture (H, W) of small soft dots at random places."""
    rng = np.random.default_rng(seed)
    picture = np.zeros((HEIGHT, WIDTH))
    reach = int(3 * radius) + 1
    y, x = np.mgrid[-reach : reach + 1, -reach : reach + 1]
    for row, column in zip(rng.integers(0, HEIGHT, count), rng.integers(0, WIDTH, count), strict=True):
        dot = np.exp(-(x**2 + y**2) / (radius * rng.uniform(0.5, 1)) ** 2)
        place = np.ix_((row + y[:, 0]).clip(0, HEIGHT - 1), (column + x[0]) % WIDTH)
        picture[place] = np.maximum(picture[place], dot)
    return picture


def skin(colors: np.ndarray, roughness: float, bumps: np.ndarray, height: float) -> wf.Material:
    """Return a material of linear colors and heights (H, W)."""
    return wf.Material(
        wf.Principled(wf.Texture(colors), roughness=roughness, specular=0.45, clearcoat=0.25),
        normal_map=wf.BumpMap(wf.Texture(bumps, srgb=False, channel=0), height=height),
    )


def apple() -> wf.Material:
    """Return red streaks on yellow, with pale dots."""
    streaks = noise((8 * HEIGHT, WIDTH), 32, 4, 3)[:HEIGHT]  # eight times as long as wide
    blush = (
        0.55 + 0.9 * noise((HEIGHT, WIDTH), 2, 5, 3) + 0.55 * streaks - 0.9 * (2 * ROWS - 0.9).clip(0) ** 3
    )
    colors = mixed(blush, (0.72, 0.50, 0.08), (0.45, 0.015, 0.02))
    colors = mixed(0.8 * dots(500, 1.6, 6), (0, 0, 0), (0.75, 0.6, 0.3)) + colors * (
        1 - 0.8 * dots(500, 1.6, 6)[..., None]
    )
    colors = np.where(
        ROWS[..., None] > 0.93, mixed(ROWS * 0 + 0.5 + streaks, (0.3, 0.25, 0.05), (0.2, 0.1, 0.03)), colors
    )
    return skin(colors, 0.28, noise((HEIGHT, WIDTH), 16, 7, 3), 0.006)


def pear() -> wf.Material:
    """Return green and yellow with brown specks and a rosy side."""
    specks = dots(3500, 1.5, 8)
    u = np.linspace(0, 2 * np.pi, WIDTH)[None, :]
    rosy = 0.55 * np.cos(u - 4.4) + 0.5 * noise((HEIGHT, WIDTH), 3, 9, 4) - 0.1
    colors = mixed(0.5 + 0.6 * noise((HEIGHT, WIDTH), 3, 10, 4), (0.36, 0.42, 0.05), (0.62, 0.52, 0.09))
    colors = colors * (1 - 0.75 * rosy.clip(0, 1)[..., None]) + np.array([0.52, 0.10, 0.04]) * (
        0.75 * rosy.clip(0, 1)[..., None]
    )
    colors = colors * (1 - 0.6 * specks[..., None]) + np.array([0.16, 0.10, 0.03]) * 0.6 * specks[..., None]
    return skin(colors, 0.42, noise((HEIGHT, WIDTH), 32, 11, 3) - 0.6 * specks, 0.006)


def orange() -> wf.Material:
    """Return orange peel with its pores."""
    pores = dots(9000, 2.6, 12)
    colors = mixed(0.4 + 0.5 * noise((HEIGHT, WIDTH), 3, 13, 4), (0.85, 0.30, 0.012), (0.80, 0.22, 0.01))
    return skin(colors * (1 - 0.18 * pores[..., None]), 0.38, 1 - pores, 0.012)


def plum() -> wf.Material:
    """Return dark violet under a pale bloom that is rubbed off in places."""
    bloom = (0.35 + 0.9 * noise((HEIGHT, WIDTH), 4, 14, 6)) * 0.8
    return skin(
        mixed(bloom, (0.035, 0.006, 0.03), (0.16, 0.13, 0.24)), 0.4, noise((HEIGHT, WIDTH), 8, 15), 0.004
    )


def wood(size: int = 1024) -> tuple[np.ndarray, np.ndarray]:
    """Return linear colors and heights of five planks."""
    v, u = np.mgrid[0:size, 0:size] / size
    plank = np.floor(5 * v)
    shift = np.random.default_rng(16).uniform(0, 9, 6)[plank.astype(int)]
    bend = noise((size, size), 3, 17, 4)
    rings = np.sin(60 * (5 * v % 1 - 0.5 + shift) ** 2 / 4 + 9 * bend + 6 * u)
    fibers = noise((size, 8 * size), 128, 18, 2)[:, :size]
    joint = np.clip(np.minimum(5 * v % 1, 1 - 5 * v % 1) / 0.012, 0, 1)
    tone = 0.5 + 0.22 * rings + 0.25 * fibers + 0.5 * (np.sin(3 * shift) * 0.3)
    return mixed(tone, (0.11, 0.052, 0.022), (0.33, 0.18, 0.085)) * (
        0.25 + 0.75 * joint[..., None]
    ), joint + 0.15 * fibers


def ball(radius: float, height: float, dent: float) -> np.ndarray:
    """Return the profile of a ball with a dent at its top."""
    t = np.linspace(0, np.pi, 96)
    r = radius * np.sin(t)
    return np.stack(
        [r.clip(0), height * (1 - np.cos(t)) / 2 - dent * np.exp(-((r / 0.12) ** 2)) * (t > 2)], 1
    )


def fruit(size: int = 600) -> wf.Scene:
    """Return the fruit in the light of a window."""
    colors, heights = wood()
    board = wf.Material(
        wf.Principled(wf.Texture(colors), roughness=0.42),
        normal_map=wf.BumpMap(wf.Texture(heights, srgb=False, channel=0), height=0.02),
    )
    stem = wf.Principled((0.09, 0.055, 0.025), roughness=0.7)
    shapes = [
        wf.Rectangle((-6, 0, 3.4), (12, 0, 0), (0, 0, -7.4), material=board, name="board"),
        wf.Rectangle(
            (-12, -3, -6), (24, 0, 0), (0, 12, 0), material=wf.Diffuse((0.10, 0.115, 0.10)), name="wall"
        ),
        turned(
            curve(
                (0.0, 0.12),
                (0.22, 0.03),
                (0.52, 0.06),
                (0.92, 0.62),
                (0.98, 1.15),
                (0.62, 1.66),
                (0.26, 1.66),
                (0.06, 1.48),
                (0.0, 1.44),
            ),
            (-0.55, 0.1),
            material=apple(),
            name="apple",
        ),
        turned(
            curve(
                (0.0, 0.1),
                (0.2, 0.02),
                (0.6, 0.1),
                (0.98, 0.72),
                (0.86, 1.32),
                (0.5, 1.95),
                (0.36, 2.35),
                (0.2, 2.55),
                (0.0, 2.52),
            ),
            (1.35, -0.75),
            material=pear(),
            name="pear",
        ),
        turned(
            ball(0.86, 1.64, 0.03),
            (-2.3, -0.75),
            material=orange(),
            name="orange",
        ),
        turned(
            ball(0.55, 1.02, 0.05),
            (0.95, 0.95),
            material=plum(),
            name="plum",
        ),
        wf.Capsules(
            [(-0.55, 1.4, 0.1), (-0.53, 1.66, 0.1)],
            [(-0.53, 1.66, 0.1), (-0.43, 1.98, 0.13)],
            0.035,
            material=stem,
        ),
        wf.Capsules(
            [(1.35, 2.45, -0.75), (1.38, 2.7, -0.74)],
            [(1.38, 2.7, -0.74), (1.5, 2.98, -0.7)],
            0.05,
            material=stem,
        ),
        wf.Rectangle(
            (-5.5, 0.8, 3.2),
            (0, 4.2, 0),
            (2.0, 0, 3.0),
            emission=(11, 10.4, 9.6),
            two_sided=True,
            name="window",
        ),
    ]
    camera = wf.Camera.look_at(
        (0.1, 2.5, 8.6), (-0.35, 0.98, 0), fov=27, size=(size, size * 2 // 3), aperture=0.16, focus=8.3
    )
    return wf.Scene(shapes, [wf.Environment((0.10, 0.12, 0.15))], camera)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="Textured meshes: fruit on a board.")
    parser.add_argument("output", nargs="?", default="fruit.png")
    parser.add_argument("--spp", type=int, default=64)
    parser.add_argument("--size", type=int, default=600)
    options = parser.parse_args()
    wf.render(fruit(options.size), options.spp, denoise=True).save(options.output, tone="agx", exposure=0.6)
    print(f"wrote {options.output}")
