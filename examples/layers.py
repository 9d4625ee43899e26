"""One scene's layers side by side: what a render holds besides its colors.

python examples/layers.py [out.png] [--spp 256] [--size 240]

Light of the lamp and of the sky is kept apart, and every pixel names its surface. All layers are also written
to one file beside the picture, out.exr.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from PIL import Image as PillowImage
from PIL import ImageDraw, ImageFont

import wavefront as wf

TILES = (
    ("rgb", "direct", "indirect", "albedo"),
    ("light_groups.lamp", "light_groups.sky", "alpha", "denoising_normal"),
    ("normal", "depth", "uv", "shape_id"),
)
AOVS = (
    "direct",
    "indirect",
    "albedo",
    "light_groups",
    "alpha",
    "denoising_normal",
    "normal",
    "depth",
    "uv",
    "shape_id",
)
GAP = 4  # pixels between tiles


def still_life(size: int) -> wf.Scene:
    """Return a glass ball, a golden ball and a matte one on a checkered table, under a lamp and the sky."""
    x, z = np.indices((12, 12))
    checker = np.where(((x + z) % 2)[..., None], [0.75, 0.7, 0.6], [0.25, 0.3, 0.4])
    table = wf.Rectangle(
        (-3.2, 0, 3.2),
        (6.4, 0, 0),
        (0, 0, -6.4),
        material=wf.Diffuse(wf.Texture(checker, filter="nearest")),
        name="table",
    )
    shining = wf.Material(wf.Diffuse(0), emission=(11, 8.5, 5.3), group="lamp")
    lamp = wf.Disk((-2.5, 4, 2), (2.5, -4, -2), 1.2, material=shining, name="lamp")
    balls = [
        wf.Sphere((-0.95, 0.6, 0.2), 0.6, material=wf.Dielectric(1.5), name="glass"),
        wf.Sphere((0.35, 0.8, -0.7), 0.8, material=wf.Conductor.named("gold", roughness=0.25), name="gold"),
        wf.Sphere((0.9, 0.4, 0.7), 0.4, material=wf.Diffuse((0.65, 0.15, 0.12)), name="matte"),
    ]
    camera = wf.Camera.look_at((0.3, 2.2, 5.2), (0, 0.45, 0), fov=34, size=(size, size * 3 // 4))
    return wf.Scene([table, *balls, lamp], [wf.Environment((0.35, 0.5, 0.8), group="sky")], camera)


def tile(image: wf.Image, name: str) -> np.ndarray:
    """Return a layer as colors to look at, (H, W, 3) uint8; light without its noise."""
    if name == "rgb":
        return wf.Image(image.rgb).denoise().to_uint8(tone="aces", exposure=0.4)
    values = image.layers[name]
    if name.endswith("_id"):
        return np.uint8(255 * id_colors(values))
    if name == "depth":
        nearest, farthest = np.nanmin(values), np.nanmax(values)
        values = 1 - 0.9 * (values - nearest) / (farthest - nearest)
    if "normal" in name:
        values = (values + 1) / 2
    if name == "uv":
        values = np.concatenate([values, np.zeros_like(values[..., :1])], axis=-1)
    colors = values if values.ndim == 3 else np.repeat(values[..., None], 3, axis=-1)
    radiance = name in ("direct", "indirect", "albedo") or name.startswith("light_groups")
    picture = wf.Image(np.nan_to_num(colors, nan=0.0))
    return picture.denoise().to_uint8() if radiance else picture.to_uint8(gamma=1)


def id_colors(ids: np.ndarray) -> np.ndarray:
    """Return a color (..., 3) in [0, 1] for each id; black where there is none."""
    numbers = ids[..., None].astype(float)
    return np.where(numbers < 0, 0, 0.5 + 0.5 * np.cos(2.4 * numbers + np.array([0.0, 2.1, 4.2])))


def sheet(image: wf.Image) -> PillowImage.Image:
    """Return all tiles with their names."""
    height, width = image.shape[:2]
    rows, columns = len(TILES), len(TILES[0])
    canvas = PillowImage.new(
        "RGB", (columns * (width + GAP) - GAP, rows * (height + GAP) - GAP), (255, 255, 255)
    )
    draw, font = ImageDraw.Draw(canvas), ImageFont.load_default(max(width / 20, 6))
    for y, names in enumerate(TILES):
        for x, name in enumerate(names):
            left, top = x * (width + GAP), y * (height + GAP)
            canvas.paste(PillowImage.fromarray(tile(image, name)), (left, top))
            label = draw.textbbox((left + 6, top + 4), name, font)
            draw.rectangle((label[0] - 3, label[1] - 2, label[2] + 3, label[3] + 2), fill=(0, 0, 0))
            draw.text((left + 6, top + 4), name, (255, 255, 255), font)
    return canvas


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="One scene's layers side by side.")
    parser.add_argument("output", nargs="?", default="layers.png")
    parser.add_argument("--spp", type=int, default=256)
    parser.add_argument("--size", type=int, default=240)
    options = parser.parse_args()
    image = wf.render(still_life(options.size), options.spp, aovs=AOVS)
    image.save(Path(options.output).with_suffix(".exr"))
    sheet(image).save(options.output)
    print(f"wrote {options.output}")
