"""A sheet of samples: one ball for each material and roughness, on steps in a photographer's studio.

python examples/material_sheet.py [out.png] [--spp 128] [--size 900]

With these defaults it runs for about a quarter of an hour on two cores.

The lists that `rows` returns are the steps from the top down; docs/materials.md says what is on each.
"""

from __future__ import annotations

import argparse

import numpy as np
from PIL import Image as Picture
from PIL import ImageDraw, ImageFont

import wavefront as wf

RADIUS = 0.42
TREAD, RISER = 1.15, 0.58  # of a step, scene units
ELEVATION = 25  # of the camera, degrees
LABELS = (  # of three balls each
    ("Diffuse, DiffuseTransmission, Sides", "OrenNayar: sigma 0.3, 0.6, 1", "OrenNayar, energy preserving"),
    ("Conductor gold: roughness 0, 0.3, 0.6", "Conductor copper", "Conductor aluminum"),
    ("Dielectric: roughness 0, 0.25, 0.5", "ThinDielectric", "Dielectric around a Medium"),
    ("Disney: metallic 0, 1; ThinDisney", "Principled: clearcoat 0, 0.5, 1", "Principled: sheen 0, 0.5, 1"),
    ("Principled: transmission 0.3, 0.65, 1", "Plastic: roughness 0.1, 0.35, 0.8", "Mix: 25, 50, 75 % gold"),
    ("Texture: color, roughness, Mix", "BumpMap, BumpMap, NormalMap", "alpha: 0.45, Texture, cutoff"),
)
CLAY, SKY, WINE = (0.75, 0.33, 0.2), (0.16, 0.4, 0.68), (0.45, 0.05, 0.09)


def rows() -> list[list[wf.Bsdf]]:
    """Return nine materials for each step, three of a kind side by side."""
    return [diffuse(), metal(), glass(), coated(), blended(), textured()]


def diffuse() -> list[wf.Bsdf]:
    """Return `Diffuse`, paper that lets light through, and clay ever rougher, without and with energy."""
    sigmas = (0.3, 0.6, 1.0)
    rough = [wf.OrenNayar(CLAY, sigma) for sigma in sigmas]
    preserving = [wf.OrenNayar(CLAY, sigma, energy_preserving=True) for sigma in sigmas]
    return [
        wf.Diffuse(SKY),
        wf.DiffuseTransmission((0.5, 0.45, 0.35), (0.4, 0.33, 0.2)),
        wf.Sides(wf.Diffuse(CLAY)),
        *rough,
        *preserving,
    ]


def metal() -> list[wf.Bsdf]:
    """Return three metals, each as a mirror, brushed and rough."""
    names = ("gold", "copper", "aluminum")
    return [wf.Conductor.named(name, roughness) for name in names for roughness in (0.0, 0.3, 0.6)]


def glass() -> list[wf.Bsdf]:
    """Return solid glass and thin shells, each ever more frosted, and glass that absorbs."""
    solid = [wf.Dielectric(1.5, roughness) for roughness in (0.0, 0.25, 0.5)]
    tint = (0.7, 0.85, 0.95)
    shells = [wf.ThinDielectric(1.5, roughness, transmittance=tint) for roughness in (0.0, 0.25, 0.5)]
    colors = [(0.15, 0.9, 2.6), (1.8, 0.35, 0.7), (2.2, 0.9, 0.2)]  # leave amber, green, blue
    return [
        *solid,
        *shells,
        *(wf.Material(wf.Dielectric(1.5), interior=wf.Medium(color)) for color in colors),
    ]


def coated() -> list[wf.Bsdf]:
    """Return `Disney` as plastic, metal and a sheet, `Principled` under ever more varnish and with sheen."""
    disney = [wf.Disney(SKY, 0.3, 0.0), wf.Disney(SKY, 0.3, 1.0), wf.ThinDisney(SKY, 0.3, transmission=0.5)]
    varnish = [wf.Principled(WINE, 0.6, 0.55, clearcoat=coat) for coat in (0.0, 0.5, 1.0)]
    velvet = [
        wf.Principled((0.05, 0.09, 0.06), 0, 0.9, sheen=sheen, sheen_color=(0.5, 0.9, 0.6))
        for sheen in (0.0, 0.5, 1.0)
    ]
    return [*disney, *varnish, *velvet]


def blended() -> list[wf.Bsdf]:
    """Return `Principled` that grows clear, `Plastic` that grows rough, and mixes of matte blue and gold."""
    clear = [wf.Principled((0.95, 0.7, 0.75), 0, 0.05, transmission=part) for part in (0.3, 0.65, 1.0)]
    plastic = [wf.Plastic((0.85, 0.6, 0.08), roughness) for roughness in (0.1, 0.35, 0.8)]
    gold = wf.Conductor.named("gold", 0.2)
    return [*clear, *plastic, *(wf.Mix(wf.Diffuse(SKY), gold, weight) for weight in (0.25, 0.5, 0.75))]


def textured() -> list[wf.Bsdf]:
    """Return materials that vary over the ball: by textures, by normal and bump maps, and by holes."""
    u, v = np.meshgrid((np.arange(512) + 0.5) / 512, (np.arange(256) + 0.5) / 256)
    checks = ((u * 16).astype(int) + (v * 8).astype(int)) % 2
    colors = np.where(checks[:, :, None], (0.85, 0.8, 0.7), (0.1, 0.25, 0.3))
    bands = 0.5 + 0.5 * np.sin(2 * np.pi * 7 * v)
    waves = 0.5 + 0.25 * (np.sin(2 * np.pi * 14 * u) + np.sin(2 * np.pi * 8 * v))
    quilt = np.abs(np.sin(2 * np.pi * (6 * u + 3 * v)) * np.sin(2 * np.pi * (6 * u - 3 * v))) ** 0.5
    return [
        wf.Diffuse(wf.Texture(colors)),
        wf.Conductor.named("copper", number(0.1 + 0.5 * checks)),
        wf.Mix(wf.Diffuse((0.12, 0.12, 0.14)), wf.Conductor.named("gold", 0.2), number(bands > 0.5)),
        wf.Material(wf.OrenNayar((0.7, 0.68, 0.6), 0.4), normal_map=wf.BumpMap(waves, 0.12)),
        wf.Material(wf.Conductor.named("aluminum", 0.15), normal_map=wf.BumpMap(waves, 0.04)),
        wf.Material(wf.Principled(WINE, 0, 0.35), normal_map=wf.NormalMap(normals(quilt, 0.06))),
        wf.Material(wf.Diffuse((0.8, 0.35, 0.1)), alpha=0.45),
        wf.Material(wf.Diffuse((0.2, 0.45, 0.4)), alpha=number(bands)),
        wf.Material(wf.Conductor.named("gold", 0.3), alpha=number(waves), alpha_cutoff=0.5),
    ]


def number(values: np.ndarray) -> wf.Texture:
    """Return an array (H, W) as a texture of one number."""
    return wf.Texture(values.astype(np.float32), srgb=False, channel=0)


def normals(heights: np.ndarray, height: float) -> np.ndarray:
    """Return the normal map (H, W, 3) of heights on a ball: texel 1 stands `height` above texel 0."""
    rows, columns = heights.shape
    per_turn, per_half_turn = 2 * np.pi * RADIUS, np.pi * RADIUS
    along_u = (np.roll(heights, -1, 1) - np.roll(heights, 1, 1)) * (height * columns / 2 / per_turn)
    along_v = -np.gradient(heights, axis=0) * (height * rows / per_half_turn)  # v runs up, rows run down
    normal = np.stack([-along_u, -along_v, np.ones_like(heights)], 2)
    return 0.5 + 0.5 * normal / np.linalg.norm(normal, axis=2, keepdims=True)


def studio(height: int = 128) -> np.ndarray:
    """Return the radiance around the steps, (height, 2·height, 3): a dim room with two soft boxes.

    It is black below and behind, which the steps and the wall hide: no samples are spent there.
    """
    latitude = 90 - 180 * (np.arange(height) + 0.5)[:, None] / height  # degrees
    longitude = 180 - 180 * (np.arange(2 * height) + 0.5)[None, :] / height  # degrees from +z towards +x

    def box(at: float, wide: float, low: float, high: float) -> np.ndarray:
        """Return 1 inside a rectangle of directions, falling softly to 0 around it."""
        beside = np.abs(longitude - at) - wide / 2
        above = np.maximum(low - latitude, latitude - high)
        return np.clip(0.5 - np.maximum(beside, above) / 6, 0, 1)[:, :, None]

    room, warm, cool = np.array([0.32, 0.34, 0.38]), np.array([1.2, 0.95, 0.7]), np.array([0.7, 0.95, 1.3])
    return box(0, 210, 0, 90) * room + box(-75, 55, 5, 60) * warm + box(70, 45, 5, 55) * cool


def scene(size: int = 900) -> wf.Scene:
    """Return the steps with a ball for each material, under a large panel."""
    samples = rows()
    width, top = 40.0, len(samples) * RISER
    gray = wf.Diffuse((0.34, 0.335, 0.33))
    shapes: list[wf.Mesh | wf.Sphere] = []
    for step, row in enumerate(reversed(samples)):
        floor, front = step * RISER, -step * TREAD
        deep = TREAD if step else 8.0  # the lowest reaches out below the camera
        tall = RISER if step < len(samples) - 1 else 6.0  # the highest is the back of the studio
        left = -width / 2
        shapes.append(wf.Rectangle((left, floor, front + deep), (width, 0, 0), (0, 0, -deep), material=gray))
        shapes.append(wf.Rectangle((left, floor, front), (width, 0, 0), (0, tall, 0), material=gray))
        for column, material in enumerate(row):
            x = column - 4 + 0.3 * (column // 3 - 1)
            shapes.append(wf.Sphere((x, floor + RADIUS, front + TREAD / 2), RADIUS, material=material))
    panel = wf.Rectangle((-10, 9, -3), (14, 0, 0), (0, 3, 9), emission=(2.5, 2.4, 2.25), name="panel")
    middle = np.array([0, top / 2 - 0.1, TREAD - len(samples) * TREAD / 2])
    angle = np.radians(ELEVATION)
    eye = middle + 40 * np.array([0, np.sin(angle), np.cos(angle)])
    camera = wf.Camera.look_at(eye, middle, fov=10.0, size=(size, size * 2 // 3))
    return wf.Scene([*shapes, panel], [wf.Environment(studio())], camera)


def labeled(image: wf.Image, camera: wf.Camera) -> Picture.Image:
    """Return the picture with a label for each three balls, on the step before them."""
    places = [
        (3.3 * group, step * RISER, (0.96 - step) * TREAD)
        for step in reversed(range(len(LABELS)))
        for group in (-1, 0, 1)
    ]
    picture = Picture.fromarray(image.to_uint8())
    draw, font = ImageDraw.Draw(picture), ImageFont.load_default(max(image.shape[1] / 80, 5))
    for at, label in zip(camera.project(places)[0], (each for row in LABELS for each in row), strict=True):
        draw.text(tuple(at), label, "white", font, anchor="mb", stroke_width=1, stroke_fill=(60, 58, 56))
    return picture


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("output", nargs="?", default="material_sheet.png")
    parser.add_argument("--spp", type=int, default=128)
    parser.add_argument("--size", type=int, default=900)
    options = parser.parse_args()
    sheet = scene(options.size)
    image = wf.render(sheet, options.spp, filter="gaussian")
    labeled(image, sheet.camera).save(options.output)
    print(f"wrote {options.output}")
